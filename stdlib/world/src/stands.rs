//! Whether something would stay where it is let go: a quick look, for goals and for those who judge a run.
//!
//! Seen from above: an object is the rectangle around it, what is in its way is the shadow of all that is
//! as high as it. That is cheap, and a little careful; `releasing` lets it fall. The truth is asked. Where a robot
//! proposes to put something is another question: [`crate::places`].

use nalgebra::{Isometry3, Translation3, Vector3};

use crate::nav::convex::Polygon;
use crate::scene::{ContainerId, Kind, ObjectId};
use crate::shape::PosedShape;
use crate::state::{State, Support};

/// What is lower than this above a plane is no obstacle on it.
const ABOVE_M: f64 = 0.005;
/// A tilt up to here is none.
const LEVEL_RAD: f64 = 0.05;
/// What stands on a plane is so far above it or in it at most.
pub const ON_M: f64 = 0.02;
/// The share of the rectangle under an object that has to be carried.
const CARRIED: f64 = 0.7;

/// What is put somewhere.
pub struct Item<'a> {
    /// Its kind.
    pub kind: &'a Kind,
    /// It, if it is in the world: it is not in its own way.
    pub object: Option<ObjectId>,
}

/// True if an item would stay at a pose if it were let go there: upright, on something that takes one more, in
/// nothing.
#[must_use]
pub fn stands(state: &State, item: &Item<'_>, pose: &Isometry3<f64>) -> bool {
    let up = pose.rotation * Vector3::z();
    let is_upright = libm::atan2(libm::hypot(up.x, up.y), up.z) <= LEVEL_RAD;
    if !is_upright {
        return false;
    }
    let kind = item.kind;
    // With the number of no object, all trays count.
    let own = item.object.unwrap_or(ObjectId(usize::MAX));
    let below = |x: f64, y: f64| {
        let foot = (pose * Translation3::new(x, y, kind.low.z)).translation.vector;
        state.support_below(&foot, ON_M, own).map(|(support, _)| support)
    };
    let (middle, half) = ((kind.low + kind.high) * 0.5, (kind.high - kind.low) * 0.5 * CARRIED);
    let Some(support) = below(middle.x, middle.y) else { return false };
    let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
    let carried =
        corners.iter().all(|(x, y)| below(middle.x + x * half.x, middle.y + y * half.y) == Some(support));
    let Some(plane) = plane(state, support).filter(|_| carried && has_room(state, item, support)) else {
        return false;
    };
    let Some(ground) = ground(kind, pose) else { return false };
    !blocks(state, item, support, plane.translation.z).iter().any(|block| block.touches(&ground))
}

/// The middle of a plane that carries objects.
#[must_use]
pub fn plane(state: &State, support: Support) -> Option<Isometry3<f64>> {
    match support {
        Support::Surface(id) => Some(state.surface_pose(id)),
        Support::Object(object) => {
            let tray = state.setting.scene.kind_of(object).carries?;
            Some(state.object_pose(object) * Translation3::from(tray.at))
        }
        Support::Floor | Support::Hand(_) => None,
    }
}

fn has_room(state: &State, item: &Item<'_>, support: Support) -> bool {
    let is_there = |it: ObjectId| state.objects.get(&it).is_some_and(|place| place.on == support);
    let others = state.count_on(support) - usize::from(item.object.is_some_and(is_there));
    state.capacity(support).is_none_or(|capacity| others < capacity)
}

/// The rectangle under an item.
fn ground(kind: &Kind, pose: &Isometry3<f64>) -> Option<Polygon> {
    let corner = |x: f64, y: f64| (pose * Translation3::new(x, y, 0.0)).translation.vector.xy();
    let (low, high) = (kind.low, kind.high);
    Polygon::around(&[
        corner(low.x, low.y),
        corner(high.x, low.y),
        corner(high.x, high.y),
        corner(low.x, high.y),
    ])
}

/// Shadows of all that is as high as an item on a plane would be.
fn blocks(state: &State, item: &Item<'_>, support: Support, plane_m: f64) -> Vec<Polygon> {
    let scene = &state.setting.scene;
    let (low, high) = (plane_m + ABOVE_M, plane_m + item.kind.size().z);
    let mut blocks = Vec::new();
    let mut add = |pose: &Isometry3<f64>, shapes: &[PosedShape]| {
        for shape in shapes {
            let posed = PosedShape { pose: pose * shape.pose, shape: shape.shape };
            let (least, most) = posed.bounds();
            if least.z < high && most.z > low {
                blocks.extend(Polygon::shadow(&posed));
            }
        }
    };
    for fixture in &scene.fixtures {
        add(&fixture.pose, &fixture.shapes);
    }
    for (number, container) in scene.containers.iter().enumerate() {
        let id = ContainerId(number);
        add(&state.setting.container_pose(id, state.opening(id)), &container.shapes);
    }
    let own = item.object.map(|it| state.with_load(it)).unwrap_or_default();
    // What is on a tray in the hands has neighbours there.
    let held_by = match support {
        Support::Object(tray) => Some(state.ground_of(tray)),
        _ => None,
    };
    for object in state.objects.keys().filter(|it| !own.contains(it)) {
        let ground = state.ground_of(*object);
        if !matches!(ground, Support::Hand(_)) || Some(ground) == held_by {
            add(&state.object_pose(*object), &scene.kind_of(*object).shapes);
        }
    }
    blocks
}
