//! Places that are worth a try: where the base may stand for something, where a thing may be put.
//!
//! These are generators of locations: they propose, in the order of a weighted sampling ([`Costmap`]), and
//! leave it to others to check what the arms can do there ([`crate::rehearse`]). Number `k` is a function
//! of the question, the world, the seed and `k`; so a plan that asks for the next one goes on where it was.
//!
//! What the base may stand on is asked of the truth, as a laser scanner tells it; where a thing may be put, of
//! what the robot believes ([`crate::world::World::believed`]).

use nalgebra::{Isometry3, Vector2, Vector3};

use crate::motions::base::Maps;
use crate::motions::{Trouble, machine};
use crate::nav::convex::{Polygon, heights, placed};
use crate::nav::{Costmap, Flood, Grid, Map, Place, turn_between};
use crate::random::unit;
use crate::scene::{ContainerId, ObjectId, upright};
use crate::shape::PosedShape;
use crate::state::{Grip, State, Support};

/// Two places nearer to one another than this are one, metres and radians.
const APART_M: [f64; 2] = [0.12, 0.05];
const APART_RAD: f64 = 0.3;
/// The width of the ring of good distances, metres.
const RING_M: f64 = 0.12;
/// A place is half as good if the way there is so much longer, metres.
const FAR_M: f64 = 0.7;
/// Headings off the line to the goal that are tried, in the order of a draw: a hand does not sit in the middle.
const ASIDE_RAD: [f64; 5] = [0.0, 0.35, -0.35, 0.7, -0.7];
/// Cells of surfaces, metres.
const SPOT_M: f64 = 0.025;
/// Room for fingers around what is put down, metres.
const FINGERS_M: f64 = 0.03;
/// How far in front of the base the best place for putting is.
const REACH_M: f64 = 0.6;
/// How far off the edge the outline of a thing stays, metres.
const EDGE_M: f64 = 0.01;

/// How far the base stands from what it wants to reach or see.
#[derive(Debug, Clone, Copy)]
pub struct Distance {
    /// At least, metres.
    pub least_m: f64,
    /// Best.
    pub best_m: f64,
    /// At most.
    pub most_m: f64,
}

/// Places of the base around a point that it gets to from where it is, heading for the point. It drives with its
/// arms parked.
///
/// # Errors
/// There is no robot, or it cannot drive at all.
pub fn to_stand(
    state: &State,
    maps: &Maps,
    goal: Vector2<f64>,
    distance: Distance,
    seed: u64,
    count: usize,
) -> Result<Vec<Place>, Trouble> {
    let drive = machine(state)?.limbs.drive;
    let state = &state.parked();
    let map = maps.of(state);
    let flood = Flood::new(&map, Place::of_pose(&state.base), drive).map_err(|why| {
        Trouble::new("base-goal-unreachable", format!("the base is stuck where it stands: {why}"))
            .pose("goal", state.base)
    })?;
    let costmap = Costmap::new(*map.grid())
        .range(goal, distance.least_m, distance.most_m)
        .free(&map)
        .gaussian(goal, distance.best_m, RING_M)
        .times(|cell, _| flood.cell_cost_m(&map, cell).map_or(0.0, |metres| libm::exp2(-metres / FAR_M)));
    let mut found: Vec<Place> = Vec::new();
    // First here and there, then, if that was not enough, in between.
    for apart_m in APART_M {
        for (k, at) in costmap.samples(seed).enumerate() {
            if found.len() == count {
                return Ok(found);
            }
            let Some(place) = heading(&map, at, goal, unit(seed, k as u64)) else { continue };
            let apart = |other: &Place| {
                (other.point() - at).norm() >= apart_m
                    || turn_between(other.yaw, place.yaw).abs() >= APART_RAD
            };
            if found.iter().all(apart) {
                found.push(place);
            }
        }
    }
    Ok(found)
}

/// A free heading for the goal, or a little aside.
fn heading(map: &Map, at: Vector2<f64>, goal: Vector2<f64>, draw: f64) -> Option<Place> {
    let towards = goal - at;
    let ahead = libm::atan2(towards.y, towards.x);
    let first = (draw * ASIDE_RAD.len() as f64) as usize;
    let asides = (0..ASIDE_RAD.len()).map(|k| ASIDE_RAD[(first + k) % ASIDE_RAD.len()]);
    asides.map(|aside| Place::new(at.x, at.y, ahead + aside)).find(|place| map.blocker(place).is_none())
}

/// Poses of an object on a surface, or on another object, with room around it, the ones that are within a
/// robot's reach first. `near`: the nearer to this point the better.
///
/// # Errors
/// There is no robot, or nothing can be put there.
pub fn to_put(
    (state, believed): (&State, &State),
    maps: &Maps,
    object: ObjectId,
    on: Support,
    near: Option<Vector2<f64>>,
    seed: u64,
    count: usize,
) -> Result<Vec<Isometry3<f64>>, Trouble> {
    let size = region(believed, on)?;
    let frame = region_pose(believed, on);
    let half = Vector2::new(size[0], size[1]) * 0.5;
    let reachable = standing(state, maps)?;
    let mut around = obstacles(believed, object, on, &frame);
    around.retain(|it| it.touches(&Polygon::rectangle(-half, half).unwrap_or_else(|| it.clone())));
    let into_region = frame.inverse();
    let spots = Costmap::new(Grid::over(-half, half, SPOT_M)).times(|_, at| {
        let inside = at.x.abs() <= half.x && at.y.abs() <= half.y;
        let off = reachable.nearest(&world_point(&frame, at)).map_or(f64::INFINITY, |(_, metres)| metres);
        let near = near.map_or(1.0, |point| {
            let there = into_region * nalgebra::Point3::new(point.x, point.y, frame.translation.z);
            let metres = (there.coords.xy() - at).norm() / 0.15;
            libm::exp(-0.5 * metres * metres) + 1e-6
        });
        let off = (off - REACH_M).max(0.0) / 0.15;
        if inside { near * (libm::exp(-0.5 * off * off) + 1e-4) } else { 0.0 }
    });
    let height = believed.setting.scene.kind_of(object).height_above_ground_m();
    let mut found: Vec<Isometry3<f64>> = Vec::new();
    for (k, at) in spots.samples(seed).enumerate() {
        if found.len() == count {
            break;
        }
        let there = world_point(&frame, at);
        let towards = reachable.nearest(&there).map(|(from, _)| there - from);
        let yaw = yaw_for(believed, object, &frame, towards, unit(seed, k as u64));
        let pose = upright(Vector3::new(there.x, there.y, frame.translation.z + height), yaw);
        let in_region = into_region * pose;
        let Some(outline) = shadow(believed, object, &in_region) else { continue };
        let (low, high) = outline.bounds();
        let inside = low.x >= -half.x + EDGE_M
            && low.y >= -half.y + EDGE_M
            && high.x <= half.x - EDGE_M
            && high.y <= half.y - EDGE_M;
        if inside && around.iter().all(|other| !other.touches(&outline)) {
            found.push(pose);
        }
    }
    Ok(found)
}

fn world_point(frame: &Isometry3<f64>, at: Vector2<f64>) -> Vector2<f64> {
    (frame * nalgebra::Point3::new(at.x, at.y, 0.0)).coords.xy()
}

/// The edges of what carries objects.
fn region(state: &State, on: Support) -> Result<[f64; 2], Trouble> {
    let scene = &state.setting.scene;
    if let Support::Object(object) = on
        && !state.objects.contains_key(&object)
    {
        let name = state.support_name(on);
        return Err(
            Trouble::new("no-room", format!("the robot does not know where `{name}` is")).name("place", name)
        );
    }
    let size = match on {
        Support::Surface(surface) => Some(scene.surfaces[surface.0].size),
        Support::Object(object) => scene.kind_of(object).carries.map(|tray| tray.size),
        Support::Floor | Support::Hand(_) => None,
    };
    size.ok_or_else(|| {
        let name = state.support_name(on);
        Trouble::new("no-room", format!("nothing can be put on `{name}`")).name("place", name)
    })
}

/// The middle of what carries objects, in the world.
fn region_pose(state: &State, on: Support) -> Isometry3<f64> {
    let tray = match on {
        Support::Object(object) => state.setting.scene.kind_of(object).carries,
        _ => None,
    };
    let at = tray.map_or_else(Vector3::zeros, |tray| tray.at);
    state.support_pose(on) * nalgebra::Translation3::from(at)
}

/// Where the base can stand.
struct Standing {
    cells: Vec<Vector2<f64>>,
}

/// Of so many cells one is looked at: what matters are tenths of a metre.
const EACH: usize = 3;

fn standing(state: &State, maps: &Maps) -> Result<Standing, Trouble> {
    machine(state)?;
    let map = maps.of(state);
    let free = (0..map.grid().len()).filter(|cell| map.free_headings(*cell) != 0);
    Ok(Standing { cells: free.step_by(EACH).map(|cell| map.grid().centre(cell)).collect() })
}

impl Standing {
    /// The cell nearest to a point, and how far it is.
    fn nearest(&self, point: &Vector2<f64>) -> Option<(Vector2<f64>, f64)> {
        let metres = self.cells.iter().map(|cell| (*cell, (cell - point).norm_squared()));
        metres.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(cell, squared)| (cell, squared.sqrt()))
    }
}

/// How an object is turned when it is put down by a robot that looks `towards` a place: as it is in the hand.
fn yaw_for(
    state: &State,
    object: ObjectId,
    frame: &Isometry3<f64>,
    towards: Option<Vector2<f64>>,
    draw: f64,
) -> f64 {
    let ahead = towards.map_or(0.0, |it| libm::atan2(it.y, it.x));
    let tool_of = |arm: &usize| match state.hands.get(arm) {
        Some(Grip::Object(_, in_tool)) => Some(in_tool.inverse()),
        _ => None,
    };
    let tools: Vec<Isometry3<f64>> = state.holders(object).iter().filter_map(tool_of).collect();
    let in_object = match tools.as_slice() {
        [] => return ahead,
        // Between two hands it looks ahead: its left hand is the first. Large things stand along the edges.
        [left, right, ..] => {
            let across = left.translation.vector - right.translation.vector;
            let straight = Place::of_pose(frame).yaw;
            let turns = libm::round((ahead - straight) / std::f64::consts::FRAC_PI_2);
            return straight + turns * std::f64::consts::FRAC_PI_2 - libm::atan2(-across.x, across.y);
        }
        [tool] => (tool.rotation * Vector3::x()).xy(),
    };
    // From above the hand can be turned as it likes.
    if in_object.norm() < 0.7 && tools.len() == 1 {
        return ahead + (draw * 8.0).floor() * std::f64::consts::FRAC_PI_4;
    }
    ahead - libm::atan2(in_object.y, in_object.x)
}

/// An object seen from above.
fn shadow(state: &State, object: ObjectId, pose: &Isometry3<f64>) -> Option<Polygon> {
    outline(&state.setting.scene.kind_of(object).shapes, pose)
}

fn outline(shapes: &[PosedShape], pose: &Isometry3<f64>) -> Option<Polygon> {
    let corners: Vec<Vector2<f64>> = shapes
        .iter()
        .filter_map(|shape| Polygon::shadow(&placed(pose, shape)))
        .flat_map(|it| it.corners().to_vec())
        .collect();
    Polygon::around(&corners)
}

/// What is in the way of a thing that stands on `on`, in the frame of its middle, with room for fingers.
fn obstacles(state: &State, object: ObjectId, on: Support, frame: &Isometry3<f64>) -> Vec<Polygon> {
    let scene = &state.setting.scene;
    let into = frame.inverse();
    let height = scene.kind_of(object).size().z;
    let stands_in_the_way = |shape: &PosedShape| {
        let (low, high) = heights(shape);
        low < height && high > 0.005
    };
    let margin = Vector2::repeat(FINGERS_M);
    let mut all = Vec::new();
    let mut push = |shapes: &[PosedShape], pose: Isometry3<f64>, with_margin: bool| {
        for shape in shapes.iter().map(|it| placed(&(into * pose), it)).filter(stands_in_the_way) {
            let shadow = Polygon::shadow(&shape);
            all.extend(shadow.and_then(|it| match with_margin {
                true => Some(it.plus(&Polygon::rectangle(-margin, margin)?)),
                false => Some(it),
            }));
        }
    };
    for other in state.objects.keys().filter(|it| **it != object && Support::Object(**it) != on) {
        if !matches!(state.ground_of(*other), Support::Hand(_)) {
            push(&scene.kind_of(*other).shapes, state.object_pose(*other), true);
        }
    }
    for fixture in &scene.fixtures {
        push(&fixture.shapes, fixture.pose, false);
    }
    for (number, container) in scene.containers.iter().enumerate() {
        let id = ContainerId(number);
        push(&container.shapes, state.setting.container_pose(id, state.opening(id)), false);
    }
    // A tray's own rim and handles.
    if let Support::Object(tray) = on {
        push(&scene.kind_of(tray).shapes, state.object_pose(tray), false);
    }
    all
}
