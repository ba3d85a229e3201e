//! Motions that nobody planned well: random parameters, and what must hold all the same.

use nalgebra::{Isometry3, Vector3};

use super::kitchen::Errand;
use super::{Dice, text};
use crate::motions::hand::Target;
use crate::motions::tool::ToolWay;
use crate::nav::Place;
use crate::scene::{ContainerId, ObjectId, upright};
use crate::state::{Around, Grip, Support};
use crate::world::{Motion, Wanted, World};

/// Some motion, reasonable or not.
fn some_motion(dice: &mut Dice, errand: &Errand) -> Motion {
    let state = &errand.world.state;
    let arms = state.machine().map_or(0, |it| it.limbs.arms.len());
    let arm = dice.below(arms);
    let object = ObjectId(dice.below(state.objects.len()));
    let container = ContainerId(dice.below(state.setting.scene.containers.len()));
    let near = Around { touchable: vec![object], handles: vec![container], ..Around::default() };
    match dice.below(10) {
        0 | 1 => {
            let place = |dice: &mut Dice| Place::new(6.5 * dice.unit(), 5.5 * dice.unit(), 7.0 * dice.unit());
            Motion::Going(vec![place(dice), place(dice)])
        }
        2 => Motion::MovingTorso(0.6 * dice.unit() - 0.05),
        3 => Motion::Looking(Vector3::new(6.0 * dice.unit(), 5.0 * dice.unit(), 1.5 * dice.unit())),
        4 => {
            let limits =
                state.machine().map(|it| it.limbs.arms[arm].chain.limits().to_vec()).unwrap_or_default();
            Motion::MovingArmJoints(vec![(arm, limits.iter().map(|limits| dice.within(*limits)).collect())])
        }
        5 | 6 => {
            let ahead = state.base
                * upright(
                    Vector3::new(0.4 + 0.4 * dice.unit(), dice.unit() - 0.5, 0.6 + 0.6 * dice.unit()),
                    2.0 * dice.unit() - 1.0,
                );
            let vias = match dice.below(2) {
                0 => vec![ahead],
                _ => errand.ways_to(object).unwrap_or_else(|| vec![ahead]),
            };
            Motion::MovingTcp(vec![ToolWay { arm, vias }], near)
        }
        7 => Motion::Gripping(
            vec![arm],
            if dice.below(2) == 0 { Target::Object(object) } else { Target::Handle(container) },
        ),
        8 => Motion::Releasing(vec![arm]),
        _ => match dice.below(2) {
            0 => Motion::MovingContainer(arm, container, Some(dice.unit())),
            _ => Motion::Detecting(Wanted::Any),
        },
    }
}

impl Errand {
    /// The poses of a tool that takes an object, if one hand can.
    fn ways_to(&self, object: ObjectId) -> Option<Vec<Isometry3<f64>>> {
        let pose = self.world.state.object_pose(object);
        let tool =
            self.world.state.setting.scene.kind_of(object).grasps.iter().find_map(|grasp| {
                match grasp.hands {
                    crate::scene::Hands::One(tool) => Some(pose * tool),
                    crate::scene::Hands::Two(..) => None,
                }
            })?;
        Some(vec![crate::scene::grasp::back(&tool, 0.1), tool])
    }
}

#[test]
fn whatever_is_tried_nothing_penetrates_and_nothing_vanishes() {
    let mut done = 0;
    for seed in 0..40 {
        let mut dice = Dice::new(seed);
        let mut errand = Errand::kitchen(if seed % 2 == 0 { "pr2" } else { "one-arm" });
        errand.seed = 1000 * seed;
        let objects = errand.world.state.objects.len();
        for _ in 0..30 {
            let motion = some_motion(&mut dice, &errand);
            let before = errand.world.state.clone();
            // `try_motion` looks for what touches.
            let ended = errand.try_motion(&motion);
            done += usize::from(ended.is_ok());
            let state = &errand.world.state;
            assert_eq!(state.objects.len(), objects);
            for (object, place) in &state.objects {
                let pose = state.object_pose(*object);
                assert!(
                    pose.translation.vector.iter().all(|it| it.is_finite() && it.abs() < 100.0),
                    "{motion:?}"
                );
                let in_hand = matches!(place.on, Support::Hand(_));
                assert_eq!(in_hand, !state.holders(*object).is_empty(), "{motion:?}");
            }
            if ended.is_err() && !matches!(motion, Motion::Releasing(_) | Motion::Gripping(..)) {
                assert_eq!(before.joints, state.joints, "{motion:?} failed and moved");
                assert_eq!(before.base, state.base);
            }
        }
    }
    assert!(done > 200, "only {done} motions went well");
}

#[test]
fn what_is_held_moves_with_the_hand() {
    let mut errand = Errand::kitchen("pr2");
    errand.go(&Motion::MovingTorso(0.2));
    errand.drive(1.1, 3.35, std::f64::consts::PI).expect("it gets to the sink");
    errand.pick("cup-1", crate::scene::Side::Front, &[0]).expect("the cup is taken");
    let cup = errand.object("cup-1");
    let Some(Grip::Object(_, in_tool)) = errand.world.state.hands.get(&0).copied() else {
        panic!("it is held")
    };
    let mut dice = Dice::new(7);
    for _ in 0..60 {
        let motion = match dice.below(3) {
            0 => Motion::MovingTorso(0.3 * dice.unit()),
            1 => Motion::Going(vec![Place::new(
                1.0 + 1.2 * dice.unit(),
                2.0 + 2.0 * dice.unit(),
                6.0 * dice.unit(),
            )]),
            _ => some_motion(&mut dice, &errand),
        };
        if matches!(motion, Motion::Releasing(_)) {
            continue;
        }
        let _ = errand.try_motion(&motion);
        let state = &errand.world.state;
        super::assert_same_pose(&state.object_pose(cup), &(state.tool(0) * in_tool), 1e-9);
    }
}

#[test]
fn a_stopped_motion_is_somewhere_between() {
    let mut errand = Errand::new("pr2", &text::with_tableware("(a room (from -5 -5) (to 5 5))"));
    errand.world.state.base = Isometry3::identity();
    let (number, duration_s) = errand.world.begin(&Motion::Going(vec![Place::new(2.0, 0.0, 0.0)]), 0, 1);
    errand.world.end(number, (duration_s * 0.5e9) as u64);
    let x = errand.world.state.base.translation.x;
    assert!((x - 1.0).abs() < 0.02, "{x}");
    assert!(errand.world.costs.path_m > 0.9 && errand.world.costs.path_m < 1.1);
}

#[test]
fn numbers_that_are_none_are_failures() {
    let mut errand = Errand::kitchen("pr2");
    let nan = f64::NAN;
    let bad = Isometry3::translation(nan, 0.0, 0.0);
    for motion in [
        Motion::Going(vec![Place::new(nan, 1.0, 0.0)]),
        Motion::Going(vec![Place::new(1e300, 1.0, 0.0)]),
        Motion::Going(Vec::new()),
        Motion::MovingTorso(nan),
        Motion::Looking(Vector3::new(nan, 0.0, 0.0)),
        Motion::MovingArmJoints(vec![(0, vec![nan; 7])]),
        Motion::MovingArmJoints(vec![(9, vec![0.0; 7])]),
        Motion::MovingTcp(vec![ToolWay { arm: 0, vias: vec![bad] }], Around::default()),
        Motion::MovingTcp(vec![ToolWay { arm: 0, vias: Vec::new() }], Around::default()),
        Motion::MovingTcp(Vec::new(), Around::default()),
        Motion::MovingTcp(vec![ToolWay { arm: 7, vias: vec![Isometry3::identity()] }], Around::default()),
        Motion::Gripping(Vec::new(), Target::Object(ObjectId(0))),
        Motion::Gripping(vec![7], Target::Object(ObjectId(0))),
        Motion::Releasing(vec![7]),
        Motion::MovingContainer(7, ContainerId(0), Some(nan)),
    ] {
        let before = errand.world.state.clone();
        errand.try_motion(&motion).expect_err("it cannot go well");
        assert_eq!(
            (before.base, before.joints),
            (errand.world.state.base, errand.world.state.joints.clone())
        );
    }
}

#[test]
fn a_world_without_anything_refuses_motions() {
    let mut world = World::default();
    let (number, _) = world.begin(&Motion::MovingTorso(0.1), 0, 1);
    world.end(number, 1_000_000_000);
    let ended = format!("{:?}", world.take_end(number));
    assert!(ended.contains("no-robot"), "{ended}");
}
