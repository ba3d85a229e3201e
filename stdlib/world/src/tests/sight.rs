//! Rays against boxes that can be computed by hand; heads against their own cameras.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{Dice, one_arm, pr2};
use crate::shape::{PosedShape, Shape};
use crate::sight::surface::patches;
use crate::sight::{Camera, Things};

fn boxed(x: f64, y: f64, z: f64) -> [PosedShape; 1] {
    [PosedShape { pose: Isometry3::identity(), shape: Shape::Box { size: Vector3::new(x, y, z) } }]
}

fn camera() -> Camera {
    Camera { width_rad: 1.0, height_rad: 0.8, near_m: 0.1, far_m: 4.0 }
}

/// Where the line enters an axis-parallel box, as a share of its length.
fn slab(half: &Vector3<f64>, from: &Point3<f64>, to: &Point3<f64>) -> Option<f64> {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for axis in 0..3 {
        let along = to[axis] - from[axis];
        let (a, b) = ((-half[axis] - from[axis]) / along, (half[axis] - from[axis]) / along);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    (enter < leave).then_some(enter)
}

#[test]
fn rays_meet_boxes_where_they_should() {
    let mut dice = Dice::new(1);
    let mut met = 0;
    for _ in 0..900 {
        let mut vector =
            |size: f64| Vector3::new(dice.unit() - 0.5, dice.unit() - 0.5, dice.unit() - 0.5) * size;
        let mut things = Things::default();
        let mut truth: Vec<(f64, usize)> = Vec::new();
        let (from, to) = (Point3::from(vector(4.0)), Point3::from(vector(4.0)));
        for number in 0..5 {
            let size = vector(2.0).abs().add_scalar(0.05);
            let pose = Isometry3::new(vector(3.0), vector(3.0));
            assert_eq!(things.push(&pose, &boxed(size.x, size.y, size.z)), number);
            let (from, to) = (pose.inverse_transform_point(&from), pose.inverse_transform_point(&to));
            truth.extend(slab(&(size * 0.5), &from, &to).map(|share| (share, number)));
        }
        truth.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Where several begin around the eye, or one just touches, rounding decides.
        let sure = truth.iter().all(|(share, _)| *share > 1e-3 && *share < 0.999)
            && truth.windows(2).all(|pair| pair[1].0 - pair[0].0 > 1e-3);
        if sure {
            let answer = things.between(&from, &to, &[]);
            assert_eq!(answer, truth.first().map(|(_, number)| *number));
            met += usize::from(answer.is_some());
            if let Some(first) = answer {
                assert_eq!(things.between(&from, &to, &[first]), truth.get(1).map(|(_, number)| *number));
            }
        }
    }
    assert!(met > 50, "{met}");
}

#[test]
fn patches_cover_the_surface() {
    use std::f64::consts::PI;
    let (radius, length) = (0.3, 0.8);
    for (shape, area) in [
        (boxed(1.0, 2.0, 3.0)[0].shape, 22.0),
        (Shape::Cylinder { radius, length }, 2.0 * PI * radius * (radius + length)),
        (Shape::Sphere { radius }, 4.0 * PI * radius * radius),
        (Shape::Capsule { radius, length }, 2.0 * PI * radius * (2.0 * radius + length)),
    ] {
        let mut all = Vec::new();
        patches(&PosedShape { pose: Isometry3::translation(1.0, 2.0, 3.0), shape }, &mut all);
        assert!((all.iter().map(|patch| patch.area).sum::<f64>() - area).abs() < 1e-9);
        let middle = all.iter().map(|patch| patch.point.coords * patch.area).sum::<Vector3<f64>>() / area;
        assert!((middle - Vector3::new(1.0, 2.0, 3.0)).norm() < 0.01, "{middle}");
        for patch in &all {
            let local = patch.point - Vector3::new(1.0, 2.0, 3.0);
            assert!((patch.normal.norm() - 1.0).abs() < 1e-12);
            assert!(local.coords.dot(&patch.normal) > 0.0);
        }
    }
}

#[test]
fn shares_add_up_and_tell_what_hides() {
    // A box 2 m ahead of the camera (Z), a board before its left half (X is to the right), a smaller
    // one before the upper quarter on the right.
    let target = (Isometry3::translation(0.0, 0.0, 2.0), boxed(0.3, 0.3, 0.3));
    let eye = Isometry3::identity();
    let mut things = Things::default();
    let own = things.push(&target.0, &target.1);
    let see =
        |things: &Things, eye: &Isometry3<f64>| things.sight(&camera(), eye, (&target.0, &target.1), &[own]);
    assert_eq!(see(&things, &eye).visible, 1.0);
    let half = things.push(&Isometry3::translation(-0.5, 0.0, 1.0), &boxed(0.98, 1.0, 0.02));
    let sight = see(&things, &eye);
    // The middle column of the front stays.
    assert!((sight.visible - 2.0 / 3.0).abs() < 0.02, "{sight:?}");
    assert_eq!(sight.hidden.len(), 1);
    let less = things.push(&Isometry3::translation(0.5, -0.5, 1.2), &boxed(0.98, 0.94, 0.02));
    let sight = see(&things, &eye);
    assert_eq!(sight.hidden.iter().map(|(owner, _)| *owner).collect::<Vec<_>>(), [half, less]);
    let all = sight.visible + sight.outside + sight.hidden.iter().map(|(_, share)| share).sum::<f64>();
    assert!((all - 1.0).abs() < 1e-12);
    assert_eq!(sight, see(&things.clone(), &eye));
    // Turned away by half the width, half of it is outside.
    let turned = Isometry3::rotation(Vector3::y() * 0.5);
    let mut alone = Things::default();
    alone.push(&target.0, &target.1);
    let sight = see(&alone, &turned);
    assert!(sight.outside > 0.3 && sight.outside < 0.7 && sight.hidden.is_empty(), "{sight:?}");
    for away in [Isometry3::rotation(Vector3::y() * 3.0), Isometry3::translation(0.0, 0.0, -3.0)] {
        assert_eq!(see(&alone, &away).visible, 0.0);
    }
}

#[test]
fn a_closed_container_hides_and_an_open_one_does_not() {
    let cup =
        [PosedShape { pose: Isometry3::identity(), shape: Shape::Cylinder { radius: 0.04, length: 0.1 } }];
    let at = Isometry3::translation(1.5, 0.0, 1.0);
    // The camera looks along X: its Z is the world's X, its Y points down.
    let turn = nalgebra::Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(turn);
    let eye = Isometry3::from_parts(Vector3::new(0.0, 0.0, 1.1).into(), rotation.into());
    let wall = |x: f64, y: f64, z: f64, size: (f64, f64, f64)| PosedShape {
        pose: Isometry3::translation(x, y, z),
        shape: Shape::Box { size: Vector3::new(size.0, size.1, size.2) },
    };
    let case = [
        wall(0.2, 0.0, 0.0, (0.02, 0.5, 0.5)),
        wall(0.0, 0.25, 0.0, (0.4, 0.02, 0.5)),
        wall(0.0, -0.25, 0.0, (0.4, 0.02, 0.5)),
        wall(0.0, 0.0, 0.25, (0.4, 0.5, 0.02)),
        wall(0.0, 0.0, -0.06, (0.4, 0.5, 0.02)),
    ];
    let door = [wall(0.0, 0.25, 0.0, (0.02, 0.5, 0.5))];
    for (angle, visible) in [(0.0, false), (1.9, true)] {
        let mut things = Things::default();
        let own = things.push(&at, &cup);
        things.push(&at, &case);
        let hinge =
            at * Isometry3::translation(-0.22, -0.25, 0.0) * Isometry3::rotation(Vector3::z() * angle);
        let number = things.push(&hinge, &door);
        let sight = things.sight(&camera(), &eye, (&at, &cup), &[own]);
        assert_eq!(sight.visible > 0.9, visible, "{sight:?}");
        assert_eq!(sight.hidden.first().map(|(owner, _)| *owner) == Some(number), !visible);
    }
}

#[test]
fn odd_poses_are_seen_without_harm() {
    let mut things = Things::default();
    let shapes = boxed(1.0, 1.0, 1.0);
    let nan = Isometry3::translation(f64::NAN, 0.0, 0.0);
    let far = Isometry3::translation(1e300, 0.0, 0.0);
    for pose in [nan, far, Isometry3::identity()] {
        things.push(&pose, &shapes);
    }
    for pose in [nan, far, Isometry3::identity()] {
        for eye in [nan, far, Isometry3::identity()] {
            let sight = things.sight(&camera(), &eye, (&pose, &shapes), &[]);
            assert!(sight.visible <= 1.0);
            let _ = things.between(&eye.translation.vector.into(), &pose.translation.vector.into(), &[0]);
        }
    }
    assert_eq!(things.sight(&camera(), &nan, (&far, &[]), &[]).visible, 0.0);
}

#[test]
fn heads_look_at_points() {
    let mut dice = Dice::new(2);
    for (robot, limbs) in [pr2(), one_arm()] {
        let head = limbs.head.as_ref().expect("it has a head");
        let (mut reached, mut refused) = (0, 0);
        for _ in 0..200 {
            let root = Isometry3::new(
                Vector3::new(dice.unit(), dice.unit(), 0.0),
                Vector3::z() * (6.0 * dice.unit()),
            );
            let mut configuration = dice.configuration(&robot);
            let mut local = || 4.0 * dice.unit() - 2.0;
            let point = root * Point3::new(local(), local(), local() * 0.5 + 1.0);
            match robot.look_at(head, &root, &configuration, &point) {
                Ok(look) => {
                    configuration[head.pan.index()] = look.pan;
                    configuration[head.tilt.index()] = look.tilt;
                    assert_eq!(robot.outside_limits(&configuration, 1e-9), None);
                    let mut poses = Vec::new();
                    robot.forward(&root, &configuration, &mut poses);
                    let seen = poses[head.camera.index()].inverse_transform_point(&point);
                    assert!(seen.z > 0.0 && seen.x.hypot(seen.y) < 1e-5 * seen.z, "{seen}");
                    reached += 1;
                }
                Err(far) => {
                    assert!(far.off_rad > 1e-6);
                    refused += 1;
                }
            }
        }
        // What is refused is too high, too low, or behind.
        assert!(reached > 120, "{}: {reached} reached, {refused} refused", robot.name);
    }
}
