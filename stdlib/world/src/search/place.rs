//! Where something could be put: poses on a surface, on a tray, in a drawer, with room around.
//!
//! Seen from above: an object is the rectangle around it, what is in its way is the shadow of all that is
//! as high as it. That is cheap, a little careful, and does not know whether a hand gets there.

use nalgebra::{Isometry3, Translation3, Vector2, Vector3};

use crate::nav::convex::Polygon;
use crate::nav::{Costmap, Grid};
use crate::random::unit;
use crate::scene::{ContainerId, Kind, ObjectId, upright};
use crate::shape::PosedShape;
use crate::state::{State, Support};

use super::key;

/// Free room around an object, metres.
pub const ROOM_M: f64 = 0.02;
/// Samples lie so far apart at least.
const CELL_M: f64 = 0.03;
/// Samples that are looked at.
const POOL: usize = 160;
/// What is lower than this above a plane is no obstacle on it.
const ABOVE_M: f64 = 0.005;
/// How what is wanted near falls off, and what is wanted far.
const NEAR_M: f64 = 0.3;
const FAR_M: f64 = 0.25;
/// A tilt up to here is none.
const LEVEL_RAD: f64 = 0.05;
/// What stands on a plane is so far above it or in it at most.
pub const ON_M: f64 = 0.02;
/// The share of the rectangle under an object that has to be carried.
const CARRIED: f64 = 0.7;

/// What is wished of a place.
#[derive(Debug, Clone, Default)]
pub struct Wishes {
    /// Near to one of these points.
    pub near: Vec<Vector3<f64>>,
    /// Far from all of these.
    pub far: Vec<Vector3<f64>>,
    /// Turns about the vertical that are tried, against the frame of the surface; none: eight all around.
    pub yaws: Vec<f64>,
}

/// What is put somewhere.
pub struct Item<'a> {
    /// Its kind.
    pub kind: &'a Kind,
    /// It, if it is in the world: it is not in its own way.
    pub object: Option<ObjectId>,
}

/// Poses at which an item stands with room around, the best first.
#[must_use]
pub fn free_poses(
    state: &State,
    item: &Item<'_>,
    support: Support,
    wishes: &Wishes,
    seed: u64,
) -> Vec<Isometry3<f64>> {
    let Some(plane) = plane(state, support) else { return Vec::new() };
    let there = state.count_on(support)
        - usize::from(
            item.object.is_some_and(|it| state.objects.get(&it).is_some_and(|place| place.on == support)),
        );
    if plane.capacity.is_some_and(|capacity| there >= capacity) {
        return Vec::new();
    }
    let blocks = blocks(state, item, support, plane.pose.translation.z);
    let half = Vector2::new(plane.size[0], plane.size[1]) * 0.5;
    let grid = Grid::over(-half, half, CELL_M);
    let in_world = |at: Vector2<f64>| (plane.pose * Translation3::new(at.x, at.y, 0.0)).translation.vector;
    let weight = |at: Vector2<f64>| {
        let at = in_world(at);
        let near = wishes.near.iter().map(|wish| bell((wish.xy() - at.xy()).norm(), NEAR_M)).reduce(f64::max);
        let far = wishes.far.iter().map(|wish| 1.0 - bell((wish.xy() - at.xy()).norm(), FAR_M));
        near.unwrap_or(1.0).max(1e-12) * far.product::<f64>().max(1e-12)
    };
    let costs = Costmap::new(grid)
        .times(|_, at| if at.x.abs() <= half.x && at.y.abs() <= half.y { weight(at) } else { 0.0 });
    let mut found = Vec::new();
    for (k, at) in costs.samples(seed).take(POOL).enumerate() {
        let draw = |n: u64| unit(seed, key(k, n));
        let at = at + (Vector2::new(draw(1), draw(2)).add_scalar(-0.5)) * CELL_M;
        let yaw = match wishes.yaws.as_slice() {
            [] => std::f64::consts::FRAC_PI_4 * libm::floor(draw(3) * 8.0),
            yaws => yaws[(draw(3) * yaws.len() as f64) as usize % yaws.len()],
        };
        let on_plane = upright(
            Vector3::new(at.x, at.y, item.kind.height_above_ground_m()),
            crate::nav::normal_angle(yaw),
        );
        let Some(ground) = ground(item.kind, &on_plane, 0.0) else { continue };
        let inside =
            ground.corners().iter().all(|corner| corner.x.abs() <= half.x && corner.y.abs() <= half.y);
        let pose = plane.pose * on_plane;
        if inside && is_clear(item.kind, &pose, ROOM_M, &blocks) {
            found.push((weight(at), pose));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().map(|(_, pose)| pose).collect()
}

/// True if an item would stay at a pose if it were let go there: upright, on something, in nothing.
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
    let Some(plane) = plane(state, support).filter(|_| carried) else { return false };
    is_clear(kind, pose, 0.0, &blocks(state, item, support, plane.pose.translation.z))
}

/// A plane that carries objects.
pub(crate) struct Plane {
    pub pose: Isometry3<f64>,
    size: [f64; 2],
    capacity: Option<usize>,
}

pub(crate) fn plane(state: &State, support: Support) -> Option<Plane> {
    let scene = &state.setting.scene;
    match support {
        Support::Surface(id) => {
            let surface = &scene.surfaces[id.0];
            Some(Plane { pose: state.surface_pose(id), size: surface.size, capacity: surface.capacity })
        }
        Support::Object(object) => {
            let tray = scene.kind_of(object).carries?;
            let pose = state.object_pose(object) * Translation3::from(tray.at);
            Some(Plane { pose, size: tray.size, capacity: Some(tray.capacity) })
        }
        Support::Floor | Support::Hand(_) => None,
    }
}

fn bell(distance_m: f64, deviation_m: f64) -> f64 {
    let off = distance_m / deviation_m;
    libm::exp(-0.5 * off * off)
}

/// The rectangle under an item with room around.
fn ground(kind: &Kind, pose: &Isometry3<f64>, room_m: f64) -> Option<Polygon> {
    let corner = |x: f64, y: f64| (pose * Translation3::new(x, y, 0.0)).translation.vector.xy();
    let (low, high) = (kind.low.add_scalar(-room_m), kind.high.add_scalar(room_m));
    Polygon::around(&[
        corner(low.x, low.y),
        corner(high.x, low.y),
        corner(high.x, high.y),
        corner(low.x, high.y),
    ])
}

fn is_clear(kind: &Kind, pose: &Isometry3<f64>, room_m: f64, blocks: &[Polygon]) -> bool {
    ground(kind, pose, room_m).is_some_and(|ground| !blocks.iter().any(|block| block.touches(&ground)))
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
