//! What touches what, and against a search of all pairs.

use nalgebra::{Isometry3, Vector3};

use super::{Dice, one_arm, pr2};
use crate::parry::Solid;
use crate::robot::collision::{Body, Carried, CollisionModel, Obstacles, SLACK_M, Scratch};
use crate::robot::{Limbs, Robot};
use crate::shape::{PosedShape, Shape};

fn boxed(x: f64, y: f64, z: f64) -> PosedShape {
    PosedShape { pose: Isometry3::identity(), shape: Shape::Box { size: Vector3::new(x, y, z) } }
}

/// A cup of 8 cm × 10 cm.
fn cup() -> PosedShape {
    PosedShape { pose: Isometry3::identity(), shape: Shape::Cylinder { radius: 0.04, length: 0.1 } }
}

struct Stage {
    robot: Robot,
    limbs: Limbs,
    model: CollisionModel,
    configuration: Vec<f64>,
    carried: Vec<Carried>,
    obstacles: Obstacles,
}

impl Stage {
    fn new((robot, limbs): (Robot, Limbs)) -> Stage {
        let model = CollisionModel::new(&robot, &limbs);
        let mut configuration = robot.zero();
        for arm in &limbs.arms {
            arm.chain.place(&arm.park, &mut configuration);
        }
        Stage { robot, limbs, model, configuration, carried: Vec::new(), obstacles: Obstacles::default() }
    }

    fn set(&mut self, joint: &str, value: f64) {
        let variable = self.robot.variable(joint).expect("the joint moves");
        self.configuration[variable.index()] = value;
    }

    fn poses(&self) -> Vec<Isometry3<f64>> {
        let mut poses = Vec::new();
        self.robot.forward(&Isometry3::identity(), &self.configuration, &mut poses);
        poses
    }

    /// Something in the left hand, or in that of the only arm.
    fn carry(&mut self, name: &str, shape: PosedShape) {
        let arm = &self.limbs.arms[0];
        self.carried.push(Carried {
            name: name.into(),
            link: arm.chain.tip(),
            pose_in_link: Isometry3::identity(),
            body: Body::moving(&[shape]),
            may_touch: arm.gripper.as_ref().expect("it has a gripper").fingers.clone(),
        });
    }

    fn touch(&self) -> Option<(String, String)> {
        let mut scratch = Scratch::default();
        let touch = self.model.touch(&self.poses(), &self.carried, &self.obstacles, &mut scratch)?;
        let (first, second) = touch.names(&self.robot, &self.carried, &self.obstacles);
        Some((first.into(), second.into()))
    }

    #[track_caller]
    fn check(&self, expected: Option<(&str, &str)>) {
        assert_eq!(self.touch(), expected.map(|(first, second)| (first.into(), second.into())));
    }
}

#[test]
fn parked_and_stretched_robots_are_free() {
    for robot in [pr2(), one_arm()] {
        let mut stage = Stage::new(robot);
        stage.check(None);
        stage.configuration = stage.robot.zero();
        stage.check(None);
    }
}

#[test]
fn arms_that_cross_touch() {
    let mut stage = Stage::new(pr2());
    stage.configuration = stage.robot.zero();
    stage.set("l_shoulder_pan_joint", -0.5);
    stage.set("r_shoulder_pan_joint", 0.5);
    stage.check(Some(("r_upper_arm_roll_link", "l_upper_arm_roll_link")));
}

#[test]
fn a_wall_is_touched_and_named() {
    let mut stage = Stage::new(pr2());
    let wall = Body::new(&[boxed(0.1, 4.0, 2.0)]);
    stage.obstacles.push("wall", &wall, &Isometry3::translation(0.8, 0.0, 1.0), &[]);
    stage.check(None);
    stage.obstacles.push("near wall", &wall, &Isometry3::translation(0.36, 0.0, 1.0), &[]);
    stage.check(Some(("base_link", "near wall")));
}

#[test]
fn what_is_carried_touches() {
    let mut stage = Stage::new(pr2());
    // The arm stretched forward, the hand open, the fingers beside the cup.
    stage.configuration = stage.robot.zero();
    stage.set("l_gripper_l_finger_joint", 0.5);
    let tool = stage.poses()[stage.limbs.arms[0].chain.tip().index()];
    stage.carry("cup", cup());
    stage.check(None);
    // A table just below the cup: it stands there; 5 mm higher it is in the way.
    let table = Body::new(&[boxed(0.3, 0.3, 0.02)]);
    stage.obstacles.push("table", &table, &(tool * Isometry3::translation(0.1, 0.0, -0.06)), &[]);
    stage.check(None);
    let mut higher = Obstacles::default();
    higher.push("table", &table, &(tool * Isometry3::translation(0.1, 0.0, -0.055)), &[]);
    let standing = std::mem::replace(&mut stage.obstacles, higher);
    stage.check(Some(("cup", "table")));
    // Fingers may touch what they are told they may.
    let fingers = stage.carried[0].may_touch.clone();
    stage.obstacles = standing;
    stage.obstacles.push("handle", &Body::new(&[boxed(0.02, 0.02, 0.02)]), &tool, &fingers);
    stage.carried.clear();
    stage.check(None);
    stage.obstacles.push("stone", &Body::new(&[boxed(0.02, 0.2, 0.02)]), &tool, &[]);
    assert_eq!(stage.touch().map(|names| names.1), Some("stone".into()));
}

#[test]
fn a_tray_in_one_hand_touches_the_other_arm() {
    let mut stage = Stage::new(pr2());
    stage.configuration = stage.robot.zero();
    stage.carry("tray", boxed(0.3, 0.3, 0.02));
    // Between the fingers, away from the forearm.
    stage.carried[0].pose_in_link = Isometry3::translation(0.12, 0.0, 0.0);
    stage.carry("plate on the tray", cup());
    // The second thing lies in the first one.
    stage.check(Some(("plate on the tray", "tray")));
    stage.carried.truncate(1);
    stage.check(None);
    let right = stage.poses()[stage.limbs.arms[1].chain.tip().index()];
    let left = stage.poses()[stage.limbs.arms[0].chain.tip().index()];
    stage.carried[0].pose_in_link = left.inv_mul(&right) * Isometry3::translation(0.12, 0.0, 0.0);
    let touched = stage.touch().expect("the tray is in the right hand");
    assert_eq!(touched.0, "tray");
    assert!(touched.1.starts_with("r_"), "{touched:?}");
    let hand = stage.limbs.arms[1].gripper.as_ref().expect("it has a gripper").fingers.clone();
    stage.carried[0].may_touch.extend(hand);
    assert_ne!(stage.touch(), Some(touched));
}

#[test]
fn distance_is_that_to_the_nearest_thing() {
    let mut stage = Stage::new(pr2());
    let mut scratch = Scratch::default();
    let wall = Body::new(&[boxed(0.1, 4.0, 4.0)]);
    stage.obstacles.push("wall", &wall, &Isometry3::translation(-1.05, 0.0, 0.0), &[]);
    let mut ask = |most_m| stage.model.distance(&stage.poses(), &[], &stage.obstacles, most_m, &mut scratch);
    assert_eq!(ask(0.1), 0.1);
    // The column ends at -0.33, the torso at -0.05 - 0.28, the base at -0.34.
    let expected = 1.0 - 0.34 + SLACK_M;
    assert!(ask(5.0) <= expected + 0.02 && ask(5.0) > 0.5, "{}", ask(5.0));
}

/// The same question with parry alone, for all pairs.
fn naive(stage: &Stage, poses: &[Isometry3<f64>]) -> bool {
    let moving = |link: crate::robot::LinkId| -> Vec<Solid> {
        let shapes = &stage.robot.links()[link.index()].shapes;
        shapes
            .iter()
            .map(|posed| Solid::new(&PosedShape { pose: posed.pose, shape: posed.shape.shrunk(SLACK_M) }))
            .collect()
    };
    stage.model.pairs().any(|(a, b)| {
        let (first, second) = (moving(a), moving(b));
        first.iter().any(|x| second.iter().any(|y| x.touches(&poses[a.index()], y, &poses[b.index()])))
    })
}

#[test]
fn quick_tests_miss_nothing() {
    let mut dice = Dice::new(11);
    for robot in [pr2(), one_arm()] {
        let mut stage = Stage::new(robot);
        let mut scratch = Scratch::default();
        let things: Vec<(PosedShape, Isometry3<f64>)> = (0..20)
            .map(|number| {
                let size = |dice: &mut Dice| 0.05 + 0.4 * dice.unit();
                let shape = match number % 4 {
                    0 => Shape::Box { size: Vector3::new(size(&mut dice), size(&mut dice), size(&mut dice)) },
                    1 => Shape::Cylinder { radius: size(&mut dice), length: size(&mut dice) },
                    2 => Shape::Sphere { radius: size(&mut dice) },
                    _ => Shape::Capsule { radius: size(&mut dice) * 0.3, length: size(&mut dice) },
                };
                let at = Vector3::new(dice.unit() * 3.0 - 1.5, dice.unit() * 3.0 - 1.5, dice.unit() * 1.8);
                let turned = Vector3::new(dice.unit(), dice.unit(), dice.unit()) * 3.0;
                let part = Isometry3::new(Vector3::new(0.05, 0.0, 0.1), Vector3::new(0.0, 0.4, 0.0));
                (PosedShape { pose: part, shape }, Isometry3::new(at, turned))
            })
            .collect();
        for (shape, pose) in &things {
            stage.obstacles.push("thing", &Body::new(&[*shape]), pose, &[]);
        }
        let (mut itself, mut others) = (0, 0);
        for _ in 0..150 {
            stage.configuration = dice.configuration(&stage.robot);
            let poses = stage.poses();
            let found = stage.model.self_touch(&poses, &[], &mut scratch);
            assert_eq!(found.is_some(), naive(&stage, &poses));
            itself += i32::from(found.is_some());
            let found = stage.model.obstacle_touch(&poses, &[], &stage.obstacles, &mut scratch);
            let expected = stage.robot.link_ids().any(|link| {
                stage.robot.links()[link.index()].shapes.iter().any(|posed| {
                    let solid =
                        Solid::new(&PosedShape { pose: posed.pose, shape: posed.shape.shrunk(SLACK_M) });
                    things
                        .iter()
                        .any(|(shape, pose)| solid.touches(&poses[link.index()], &Solid::new(shape), pose))
                })
            });
            assert_eq!(found.is_some(), expected);
            others += i32::from(found.is_some());
            let distance = stage.model.distance(&poses, &[], &stage.obstacles, 1.0, &mut scratch);
            assert_eq!(distance == 0.0, expected, "{distance}");
        }
        assert!(itself > 10 && others > 10, "{itself} {others}");
    }
}

#[test]
fn odd_poses_do_not_panic() {
    let mut stage = Stage::new(pr2());
    let mut scratch = Scratch::default();
    stage.carry("cup", cup());
    for number in [f64::NAN, f64::INFINITY, 1e300, 1e18, -1e-310] {
        let pose = Isometry3::translation(number, 0.0, number);
        let mut obstacles = Obstacles::default();
        for shape in [cup(), boxed(number, 1.0, 1.0), boxed(1.0, 1.0, 1.0)] {
            obstacles.push("thing", &Body::new(&[shape]), &pose, &[]);
            obstacles.push("thing", &Body::new(&[shape]), &Isometry3::identity(), &[]);
        }
        let mut poses = Vec::new();
        stage.configuration.fill(number);
        stage.robot.forward(&pose, &stage.configuration, &mut poses);
        stage.model.touch(&poses, &stage.carried, &obstacles, &mut scratch);
        stage.model.distance(&poses, &stage.carried, &obstacles, 1.0, &mut scratch);
        stage.model.touch(&[], &stage.carried, &obstacles, &mut scratch);
    }
}
