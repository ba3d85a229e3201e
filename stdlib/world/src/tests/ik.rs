//! Inverse kinematics against forward kinematics.

use expect_test::{Expect, expect};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::{Dice, apart, assert_same_pose, one_arm, pr2};
use crate::robot::ik::{Effort, Solver, Unreachable};
use crate::robot::urdf::PR2;
use crate::robot::{Chains, Robot};

/// Solves poses of random configurations from random seeds. Returns how many, and a number that
/// stands for all bits of the solutions.
#[track_caller]
fn check_random(solver: &Solver, queries: u64, seed: u64) -> (u64, u64) {
    let chain = solver.chain();
    let mut dice = Dice::new(seed);
    let (mut solved, mut bits) = (0, 0_u64);
    for number in 0..queries {
        let target = chain.forward(&dice.values(chain));
        let seed = dice.values(chain);
        let mut out = vec![0.0; seed.len()];
        if solver.solve(&target, &seed, number, &mut out).is_err() {
            continue;
        }
        solved += 1;
        assert_same_pose(&chain.forward(&out), &target, 1e-6);
        for ((value, limits), seed) in out.iter().zip(chain.limits()).zip(&seed) {
            match limits {
                Some((low, high)) => assert!((low..=high).contains(&value)),
                None => assert!((value - seed).abs() < std::f64::consts::PI + 1e-9),
            }
            bits = (bits ^ value.to_bits()).wrapping_mul(0x0100_0000_01B3).rotate_left(7);
        }
    }
    (solved, bits)
}

/// The left arm of the PR2.
fn closed() -> Solver {
    let solver = Solver::new(&pr2().1.arms[0].chain);
    assert!(solver.is_closed());
    solver
}

/// How many of how many, and all bits of the solutions: the same in each run, in each process, on
/// each machine. They change only when the method does.
#[track_caller]
fn check_golden(solver: &Solver, queries: u64, expected: Expect) {
    let (solved, bits) = check_random(solver, queries, 1);
    assert!(solved * 1000 >= queries * 995, "{solved} of {queries}");
    expected.assert_eq(&format!("{solved} of {queries}, {bits:016x}"));
}

#[test]
fn closed_form_reaches_what_the_pr2_reaches() {
    check_golden(&closed(), 5000, expect!["5000 of 5000, e7b13760a1b00df5"]);
    let right = Solver::new(&pr2().1.arms[1].chain);
    assert!(right.is_closed());
    check_golden(&right, 2000, expect!["2000 of 2000, fad6a6581b16f456"]);
}

#[test]
fn damped_least_squares_reach_what_other_chains_reach() {
    let (robot, _) = pr2();
    let with_torso = Solver::new(&robot.chain("base_link", "r_gripper_tool_frame").expect("it is connected"));
    let six_joints = Solver::new(&one_arm().1.arms[0].chain);
    assert!(!with_torso.is_closed() && !six_joints.is_closed());
    check_golden(&with_torso, 500, expect!["500 of 500, 8c93b58c5bef53ee"]);
    check_golden(&six_joints, 500, expect!["500 of 500, 150aa198f69ace3b"]);
    check_golden(
        &Solver::numeric(closed().chain(), Effort::default()),
        500,
        expect!["500 of 500, 2425238be0e32099"],
    );
}

#[test]
fn a_mount_and_a_tool_may_be_anywhere() {
    // The left arm upside down on the ceiling, with a bent tool.
    let text = PR2
        .replace(r#"<origin xyz="0 0.188 0"/>"#, r#"<origin xyz="0.3 -0.2 1" rpy="3.1 0.2 -1.3"/>"#)
        .replace(r#"<origin xyz="0.18 0 0"/>"#, r#"<origin xyz="0.1 0.05 -0.2" rpy="0.4 1.1 -0.3"/>"#);
    assert_ne!(text, PR2);
    let robot = Robot::from_urdf("test.urdf", &text).expect("the file is read");
    let solver = Solver::new(&robot.limbs(&Chains::pr2()).expect("its parts are there").arms[0].chain);
    assert!(solver.is_closed());
    assert!(check_random(&solver, 500, 4).0 >= 498);
}

#[test]
fn an_arm_that_is_no_pr2_gets_no_closed_form() {
    for (written, instead) in [
        // Another axis, an elbow aside, a turned wrist, a roll in front of the lift.
        (
            r#"<origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>"#,
            r#"<origin xyz="0.4 0 0"/><axis xyz="0 0.6 0.8"/>"#,
        ),
        (r#"<origin xyz="0.4 0 0"/>"#, r#"<origin xyz="0.4 0.01 0"/>"#),
        (r#"<origin xyz="0.321 0 0"/>"#, r#"<origin xyz="0.321 0 0" rpy="0 0.001 0"/>"#),
        (r#"<origin xyz="0.1 0 0"/><axis xyz="0 1 0"/>"#, r#"<origin xyz="0.1 0 0"/><axis xyz="1 0 0"/>"#),
    ] {
        let text = PR2.replace(written, instead);
        assert_ne!(text, PR2, "{written}");
        let robot = Robot::from_urdf("test.urdf", &text).expect("the file is read");
        let solver = Solver::new(&robot.limbs(&Chains::pr2()).expect("its parts are there").arms[0].chain);
        assert!(!solver.is_closed(), "{instead}");
    }
}

#[test]
fn singular_poses_are_solved() {
    let solver = closed();
    let chain = solver.chain();
    let mut out = [0.0; 7];
    for values in [
        [0.0; 7],
        [0.5, 0.3, 1.0, 0.0, 1.0, 0.0, 2.0],
        [0.5, 0.3, 1.0, 0.0, 1.0, -1.0, 2.0],
        [0.5, 0.3, 1.0, -1.0, 1.0, 0.0, 2.0],
        [0.5, 1.3963, 0.0, -2.3213, 0.0, -2.18, 0.0],
        [2.285, -0.52, 3.9, -2.3213, 3.0, -2.18, -3.0],
    ] {
        let target = chain.forward(&values);
        for seed in [values, [0.7, 0.0, 0.5, -1.0, 0.0, -1.0, 0.0]] {
            let answer = solver.solve(&target, &seed, 0, &mut out);
            assert_eq!(answer, Ok(()), "{values:?} from {seed:?}");
            assert_same_pose(&chain.forward(&out), &target, 1e-6);
        }
    }
}

#[test]
fn what_the_seed_reaches_is_the_seed() {
    let mut dice = Dice::new(6);
    for solver in [closed(), Solver::new(&one_arm().1.arms[0].chain)] {
        for _ in 0..200 {
            let values = dice.values(solver.chain());
            let mut out = vec![0.0; values.len()];
            solver.solve(&solver.chain().forward(&values), &values, 0, &mut out).expect("it is reached");
            assert!(values.iter().zip(&out).all(|(a, b)| (a - b).abs() < 1e-6), "{values:?} {out:?}");
        }
    }
}

#[test]
fn joints_without_end_stay_near_the_seed() {
    let solver = closed();
    let values = [0.5, 0.3, 1.0, -1.0, 20.0, -1.0, -30.0];
    let mut out = [0.0; 7];
    solver.solve(&solver.chain().forward(&values), &values, 0, &mut out).expect("it is reached");
    assert!((out[4] - 20.0).abs() < 1e-6 && (out[6] + 30.0).abs() < 1e-6);
}

#[test]
fn what_cannot_be_reached_is_told() {
    let solver = closed();
    let mut out = [7.0; 7];
    let mut ask = |pose: Isometry3<f64>| solver.solve(&pose, &[0.0; 7], 0, &mut out);
    assert!(matches!(ask(Isometry3::translation(3.0, 0.0, 0.0)), Err(Unreachable::TooFar { .. })));
    assert!(matches!(ask(Isometry3::translation(f64::NAN, 0.0, 0.0)), Err(Unreachable::NotFinite)));
    // In the shoulder.
    assert_eq!(ask(Isometry3::translation(0.0, 0.188, 0.0)), Err(Unreachable::OutsideLimits));
    // Far, and the wrist would have to bend back.
    let back = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 3.0);
    let behind = Isometry3::from_parts(Vector3::new(0.6, 0.188, 0.0).into(), back);
    assert_eq!(ask(behind), Err(Unreachable::OutsideLimits));
    let numeric = Solver::new(&one_arm().1.arms[0].chain);
    let answer = numeric.solve(&Isometry3::translation(0.2, 0.0, 0.1), &[0.0; 6], 0, &mut out);
    assert!(matches!(answer, Ok(()) | Err(Unreachable::NotFound { .. })));
    let inside = numeric.solve(&Isometry3::translation(0.0, 0.0, 0.0), &[0.0; 6], 0, &mut out);
    assert!(matches!(inside, Err(Unreachable::NotFound { attempts: 100, .. })), "{inside:?}");
    assert!(solver.solve(&Isometry3::identity(), &[f64::NAN; 7], 0, &mut out).is_err());
}

#[test]
fn several_solutions_come_nearest_first() {
    for solver in [closed(), Solver::new(&one_arm().1.arms[0].chain)] {
        let mut dice = Dice::new(8);
        let mut more = 0;
        for number in 0..50 {
            let target = solver.chain().forward(&dice.values(solver.chain()));
            let seed = dice.values(solver.chain());
            let solutions = solver.solutions(&target, &seed, number, 8);
            assert!(!solutions.is_empty() && solutions.len() <= 8);
            more += usize::from(solutions.len() > 1);
            let cost =
                |values: &Vec<f64>| values.iter().zip(&seed).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
            assert!(solutions.windows(2).all(|pair| cost(&pair[0]) <= cost(&pair[1]) && pair[0] != pair[1]));
            for values in &solutions {
                assert_same_pose(&solver.chain().forward(values), &target, 1e-6);
            }
            if solver.is_closed() {
                let mut nearest = seed.clone();
                solver.solve(&target, &seed, number, &mut nearest).expect("it is reached");
                assert_eq!(nearest, solutions[0]);
            }
        }
        assert!(more > 25, "{more} of 50 have more than one");
    }
}

#[test]
fn a_pose_changes_little_when_the_target_does() {
    // The nearest solution follows a target that moves by a millimetre without a jump.
    let solver = closed();
    let mut dice = Dice::new(9);
    for _ in 0..100 {
        let values = dice.values(solver.chain());
        let pose = solver.chain().forward(&values);
        let moved = Isometry3::translation(0.001, 0.0, 0.0) * pose;
        let mut out = [0.0; 7];
        if solver.solve(&moved, &values, 0, &mut out).is_ok() {
            assert!(apart(&solver.chain().forward(&out), &moved).0 < 1e-9);
        }
    }
}
