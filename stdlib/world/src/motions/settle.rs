//! What becomes of an object that nobody holds any more: a short simulation with rapier.
//!
//! The object and what stands on it are dynamic, all else that is near stands still. The simulation ends
//! when they rest. What ends as upright as it began is put exactly upright on the plane that carries it: a
//! simulation leaves a tenth of a millimetre here and there, which would add up from one placing to the next.

use nalgebra::{Isometry3, Translation3, Vector3};
use rapier3d::prelude::{InteractionGroups, RigidBodyHandle};

use crate::scene::{ContainerId, ObjectId};
use crate::shape::PosedShape;
use crate::state::{State, Support};

use super::physics::{Physics, WOOD};
use super::{MODEL, Trouble};

/// Seconds of a step.
const STEP_S: f32 = 1.0 / 240.0;
/// Steps at most: two seconds.
const MAX_STEPS: usize = 480;
/// Steps in a row at rest.
const REST_STEPS: usize = 8;
/// What counts as rest, m/s and rad/s.
const REST: f32 = 0.005;
/// What is farther to the side than this, or farther above, takes no part.
const NEAR_M: f64 = 0.4;
/// A tilt below this is none.
const LEVEL_RAD: f64 = 0.05;
/// How far above a plane an object may rest that still stands on it.
const ON_M: f64 = 0.02;

/// Where things have come to rest.
pub(super) struct Settled {
    pub places: Vec<(ObjectId, Support, Isometry3<f64>)>,
    pub trouble: Option<Trouble>,
}

/// Lets an object go where it is, with all that stands on it.
pub(super) fn settle(state: &State, object: ObjectId) -> Settled {
    let start = state.object_pose(object);
    let load = state.with_load(object);
    let poses = simulate(state, &load, &start.translation.vector);
    let mut after = state.clone();
    let mut places = Vec::new();
    // The object first, then what stands on it: each finds its ground where the others already are.
    for (each, pose) in load.iter().zip(&poses) {
        let (on, pose) = ground(&after, *each, pose);
        after.put(*each, on, &pose);
        places.push((*each, on, pose));
    }
    let trouble = load
        .iter()
        .zip(&places)
        .find_map(|(each, (_, on, pose))| judge(state, *each, &state.object_pose(*each), pose, *on));
    Settled { places, trouble }
}

fn simulate(state: &State, load: &[ObjectId], origin: &Vector3<f64>) -> Vec<Isometry3<f64>> {
    let mut physics = Physics::new(Translation3::from(-origin), STEP_S);
    let scene = &state.setting.scene;
    let near = |pose: &Isometry3<f64>, shape: &PosedShape| {
        let (low, high) = PosedShape { pose: pose * shape.pose, shape: shape.shape }.bounds();
        let beside =
            (0..2).all(|axis| low[axis] <= origin[axis] + NEAR_M && high[axis] >= origin[axis] - NEAR_M);
        // However deep it falls, something is below.
        beside && low.z <= origin.z + NEAR_M
    };
    let mut stand = |pose: Isometry3<f64>, shapes: &[PosedShape], friction: f64| {
        for shape in shapes.iter().filter(|shape| near(&pose, shape)) {
            physics.stand(&pose, shape, friction, InteractionGroups::default());
        }
    };
    for fixture in &scene.fixtures {
        stand(fixture.pose, &fixture.shapes, WOOD);
    }
    for (number, container) in scene.containers.iter().enumerate() {
        let id = ContainerId(number);
        stand(state.setting.container_pose(id, state.opening(id)), &container.shapes, WOOD);
    }
    for other in state.objects.keys().filter(|other| !load.contains(other)) {
        let kind = scene.kind_of(*other);
        stand(state.object_pose(*other), &kind.shapes, kind.friction);
    }
    let floor = crate::scene::boxed(Vector3::new(100.0, 100.0, 1.0), Vector3::new(0.0, 0.0, -0.5), 0.0);
    stand(Isometry3::translation(origin.x, origin.y, 0.0), &[floor], WOOD);
    let bodies: Vec<RigidBodyHandle> = load
        .iter()
        .map(|object| {
            let kind = scene.kind_of(*object);
            physics.drop_in(kind, &state.object_pose(*object), kind.friction, |collider| collider)
        })
        .collect();
    run(&mut physics, &bodies);
    bodies.iter().map(|body| physics.pose_of(*body)).collect()
}

fn run(physics: &mut Physics, bodies: &[RigidBodyHandle]) {
    let mut resting = 0;
    for _ in 0..MAX_STEPS {
        physics.world.step();
        resting = if bodies.iter().all(|body| physics.rests(*body, REST)) { resting + 1 } else { 0 };
        if resting >= REST_STEPS {
            return;
        }
    }
}

/// On what an object rests, and its pose there: exactly, if it stands.
pub(super) fn ground(state: &State, object: ObjectId, pose: &Isometry3<f64>) -> (Support, Isometry3<f64>) {
    let kind = state.setting.scene.kind_of(object);
    let up = pose.rotation * Vector3::z();
    let tilt = libm::atan2(libm::hypot(up.x, up.y), up.z);
    let middle = (kind.low + kind.high) * 0.5;
    let mut here = state.clone();
    here.put(object, Support::Floor, pose);
    let stands = tilt <= LEVEL_RAD;
    let foot = if stands {
        (pose * Translation3::new(middle.x, middle.y, kind.low.z)).translation.vector
    } else {
        // Its lowest corner.
        let shapes = kind
            .shapes
            .iter()
            .map(|shape| PosedShape { pose: pose * shape.pose, shape: shape.shape }.bounds().0.z);
        Vector3::new(pose.translation.x, pose.translation.y, shapes.fold(f64::INFINITY, f64::min))
    };
    let Some((support, gap)) = here.support_below(&foot, ON_M, object) else {
        return (Support::Floor, *pose);
    };
    if !stands {
        return (support, *pose);
    }
    let ahead = pose.rotation * Vector3::x();
    let mut level = crate::scene::upright(pose.translation.vector, libm::atan2(ahead.y, ahead.x));
    let lift = (level * Translation3::new(middle.x, middle.y, kind.low.z)).translation.z - foot.z;
    level.translation.z -= gap + lift;
    (support, level)
}

/// What is wrong with where an object has come to rest.
pub(super) fn judge(
    state: &State,
    object: ObjectId,
    before: &Isometry3<f64>,
    after: &Isometry3<f64>,
    on: Support,
) -> Option<Trouble> {
    let moved = after.translation.vector - before.translation.vector;
    let slid_m = libm::hypot(moved.x, moved.y);
    let up = (before.rotation * Vector3::z(), after.rotation * Vector3::z());
    let tilt_rad = libm::atan2(up.0.cross(&up.1).norm(), up.0.dot(&up.1));
    let name = &state.setting.scene.objects[object.0].name;
    let (kind, message) = if moved.z < -MODEL.fall_m {
        ("object-fell", format!("`{name}` fell {:.2} m", -moved.z))
    } else if tilt_rad > MODEL.tilt_rad {
        ("object-toppled", format!("`{name}` tilted by {tilt_rad:.2} rad"))
    } else if slid_m > MODEL.slide_m {
        ("object-slid", format!("`{name}` slid {slid_m:.2} m"))
    } else if moved.z > MODEL.fall_m {
        ("object-slid", format!("`{name}` was pushed {:.2} m up: it had been put into something", moved.z))
    } else {
        return None;
    };
    let place = state.support_name(on);
    Some(Trouble::new(kind, message).name("object", name).name("place", place).pose("pose", *after))
}
