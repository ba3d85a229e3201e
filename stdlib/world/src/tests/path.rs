//! Straight ways of joints and of tools.

use nalgebra::{Isometry3, Vector3};

use super::{apart, assert_same_pose, one_arm, pr2};
use crate::robot::ik::Solver;
use crate::robot::path::{Detour, NoToolPath, Resolution, between, joint_detour, joint_path, tool_path};

#[test]
fn joints_go_in_steps_of_the_stated_size() {
    let mut seen: Vec<Vec<f64>> = Vec::new();
    let free = joint_path(&[0.0, 1.0], &[1.0, 0.5], 0.3, |at| {
        seen.push(at.to_vec());
        None::<()>
    });
    assert_eq!(free, Ok(()));
    assert_eq!(seen.len(), 5);
    assert_eq!((&seen[0][..], &seen[4][..]), (&[0.0, 1.0][..], &[1.0, 0.5][..]));
    let blocked = joint_path(&[0.0], &[1.0], 0.25, |at| (at[0] > 0.4).then_some("wall"));
    assert_eq!(blocked, Err((0.5, "wall")));
    // Nonsense ends as well.
    assert_eq!(joint_path(&[0.0], &[f64::NAN], 0.1, |_| None::<()>), Ok(()));
    assert_eq!(joint_path(&[0.0], &[1.0], 0.0, |_| None::<()>), Ok(()));
    assert_eq!(joint_path(&[], &[], 0.1, |_| None::<()>), Ok(()));
}

#[test]
fn poses_between_two_lie_on_a_line() {
    let from = Isometry3::new(Vector3::new(1.0, 0.0, 0.0), Vector3::new(0.0, 0.0, 0.2));
    let to = Isometry3::new(Vector3::new(0.0, 2.0, 0.0), Vector3::new(0.0, 0.0, 1.2));
    assert_same_pose(&between(&from, &to, 0.0), &from, 1e-12);
    assert_same_pose(&between(&from, &to, 1.0), &to, 1e-12);
    let middle = Isometry3::new(Vector3::new(0.5, 1.0, 0.0), Vector3::new(0.0, 0.0, 0.7));
    assert_same_pose(&between(&from, &to, 0.5), &middle, 1e-12);
    // A half turn has two ways; it takes one of them.
    let turned = Isometry3::new(Vector3::zeros(), Vector3::new(std::f64::consts::PI, 0.0, 0.0));
    let half = between(&Isometry3::identity(), &turned, 0.5);
    assert!((apart(&Isometry3::identity(), &half).1 - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
}

#[test]
fn a_tool_goes_straight_through_its_vias() {
    for (_, limbs) in [pr2(), one_arm()] {
        let solver = Solver::new(&limbs.arms[0].chain);
        let start: Vec<f64> = match solver.is_closed() {
            true => vec![0.3, 0.4, 0.5, -1.5, 0.5, -0.9, 0.2],
            false => vec![0.2, 0.3, 1.2, 0.1, 0.6, 0.0],
        };
        let from = solver.chain().forward(&start);
        let vias =
            [from * Isometry3::translation(0.1, 0.0, 0.0), Isometry3::translation(0.0, 0.0, 0.1) * from];
        let resolution = Resolution::default();
        let path = tool_path(&solver, &start, &vias, resolution, 0).expect("it is reached");
        assert_eq!(path.vias.len(), 2);
        let mut last = from;
        for configuration in &path.configurations {
            let pose = solver.chain().forward(configuration);
            assert!(apart(&last, &pose).0 <= resolution.metres + 1e-9);
            last = pose;
        }
        for (via, place) in vias.iter().zip(&path.vias) {
            assert_same_pose(&solver.chain().forward(&path.configurations[*place]), via, 1e-7);
        }
    }
}

#[test]
fn a_tool_that_cannot_get_there_says_how_far_it_came() {
    let (_, limbs) = pr2();
    let solver = Solver::new(&limbs.arms[0].chain);
    let start = [0.3, 0.4, 0.5, -1.5, 0.5, -0.9, 0.2];
    let from = solver.chain().forward(&start);
    let far = Isometry3::translation(1.0, 0.0, 0.0) * from;
    match tool_path(&solver, &start, &[from, far], Resolution::default(), 0) {
        Err(NoToolPath::Unreachable { via: 1, share, .. }) => assert!(share > 0.1 && share < 0.9, "{share}"),
        other => panic!("{other:?}"),
    }
    let nowhere = Isometry3::translation(f64::NAN, 0.0, 0.0);
    assert!(tool_path(&solver, &start, &[nowhere], Resolution::default(), 0).is_err());
    assert_eq!(tool_path(&solver, &[], &[], Resolution::default(), 0), Ok(Default::default()));
}

// ---------------------------------------------------------------------------------------------
// Around what is in the way

const LIMITS: [(usize, Option<(f64, f64)>); 2] = [(0, Some((-1.0, 1.0))), (1, Some((-1.0, 1.0)))];

fn around(wall: f64, random: u64) -> (Option<Vec<Vec<f64>>>, usize) {
    let detour = Detour { moving: &LIMITS, look: 0.02, questions: 4000, random };
    let mut asked = 0;
    // A wall across the middle, up to this height.
    let way = joint_detour(&[-0.8, 0.0, 7.0], &[0.8, 0.0, 7.0], &detour, |at| {
        asked += 1;
        at[0].abs() < 0.1 && at[1] < wall
    });
    (way, asked)
}

#[test]
fn joints_go_around_what_is_in_the_way() {
    for random in 0..20 {
        let (way, asked) = around(0.7, random);
        let way = way.expect("there is a gap above the wall");
        assert_eq!(way.last().map(Vec::as_slice), Some(&[0.8, 0.0, 7.0][..]));
        assert!(way.len() < 8 && asked < 4000, "{} corners after {asked} questions", way.len());
        let starts = std::iter::once(vec![-0.8, 0.0, 7.0]).chain(way.iter().cloned());
        for (from, to) in starts.zip(&way) {
            let blocked = |at: &[f64]| (at[0].abs() < 0.1 && at[1] < 0.7).then_some(());
            assert_eq!(joint_path(&from, to, 0.02, blocked), Ok(()));
            assert_eq!(to[2], 7.0, "what may not move stays");
        }
        assert_eq!(around(0.7, random).0.as_ref(), Some(&way), "the same draws give the same way");
    }
}

#[test]
fn a_search_for_a_way_of_joints_ends() {
    let (way, asked) = around(2.0, 1);
    assert_eq!(way, None);
    assert!(asked <= 4000 + 100, "{asked}");
}
