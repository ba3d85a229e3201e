//! Where the base could stand: places from which tools reach their poses, or from which a point is seen.
//!
//! A costmap proposes: a ring around what is to be done, only where one flood from the robot arrives, better on
//! the side from which the hands come. Each sample turns towards the goal, a little off it, and is looked at:
//! it is free, the base gets there, inverse kinematics has a solution for each via pose in which
//! nothing touches. What is left stands in the order of its costs: the way there, and how far
//! it is from where an arm works best.

use nalgebra::{Isometry3, Point3, Vector2, Vector3};

use crate::motions::container::{SHARES, tool_at};
use crate::motions::tool::ToolWay;
use crate::motions::{Surroundings, Trouble, machine};
use crate::nav::{Costmap, Flood, Map, Place};
use crate::random::unit;
use crate::scene::ContainerId;
use crate::scene::grasp::{PRE_GRASP_M, back};
use crate::setting::Machine;
use crate::state::{Around, State};

use super::key;
use super::reach::{container_problem, with_base};
use super::see::Open;

/// Samples that are looked at.
const POOL: usize = 40;
/// The same for containers: few of them are good for the whole way of a door.
const OPEN_POOL: usize = 400;
/// Candidates that the motions themselves look at, half a millisecond or more each.
const OPEN_CHECKS: usize = 24;
/// A container's way is looked at so often at first.
const ARC: usize = 4;
/// Branches of inverse kinematics that are tried for one sample.
const BRANCHES: usize = 6;
/// An arm works best at this share of its reach.
const BEST_SHARE: f64 = 0.65;
/// So far off the best distance is as bad as a metre more on the way.
const OFF_M: f64 = 0.3;
/// Samples are turned by so much to both sides at most.
const TURN_RAD: f64 = 0.5;
/// Cameras see best from here, and how that falls off.
const SEE_M: (f64, f64) = (1.1, 0.4);
/// How near and how far a camera may stand.
const SEE_RANGE_M: (f64, f64) = (0.4, 2.5);

/// A place with what speaks against it, metres.
type Candidate = (f64, Place);

/// Places from which tools reach all their via poses, the best first.
///
/// # Errors
/// There is no robot, or it cannot drive.
pub fn to_reach(
    state: &State,
    (map, flood): (&Map, &Flood),
    ways: &[ToolWay],
    around: &Around,
    seed: u64,
) -> Result<Vec<Place>, Trouble> {
    let machine = machine(state)?;
    let vias: Vec<&Isometry3<f64>> = ways.iter().flat_map(|way| &way.vias).collect();
    let Some((centre, approach)) = middle(&vias) else { return Ok(Vec::new()) };
    let arms: Vec<usize> = ways.iter().map(|way| way.arm).collect();
    let shoulders: Vec<Shoulder> = arms.iter().filter_map(|arm| Shoulder::of(machine, state, *arm)).collect();
    let count = shoulders.len().max(1) as f64;
    let span = |shoulder: &Shoulder| {
        let up = centre.z - shoulder.at.z;
        (shoulder.reach_m * shoulder.reach_m - up * up).max(0.01).sqrt()
    };
    let reach_m = shoulders.iter().map(span).fold(f64::INFINITY, f64::min).min(5.0);
    let side_m = shoulders.iter().map(|it| it.at.y).sum::<f64>() / count;
    let ahead_m = shoulders.iter().map(|it| it.at.x).sum::<f64>() / count;
    let best_m = (BEST_SHARE * reach_m + ahead_m).max(0.1);
    let from = Vector2::new(centre.x, centre.y);
    let comes = |at: Vector2<f64>| match approach {
        None => 1.0,
        Some(approach) => {
            let along = (from - at).try_normalize(1e-9).map_or(0.0, |along| along.dot(&approach));
            libm::exp(2.0 * (along - 1.0))
        }
    };
    let costs = Costmap::new(*map.grid())
        .range(from, 0.25 * reach_m, reach_m + ahead_m.abs() + side_m.abs())
        .free(map)
        .times(|cell, _| f64::from(u8::from(flood.reaches_cell(map, cell))))
        .gaussian(from, best_m, 0.25 * reach_m)
        .times(|_, at| comes(at));
    let there = with_base(state, None, &arms);
    let mut quick = Quick {
        state: &there,
        machine,
        around: Surroundings::new(machine, there.obstacles(around), there.carried()),
        seed,
    };
    let mut found: Vec<Candidate> = Vec::new();
    for (k, at) in costs.samples(seed).take(POOL).enumerate() {
        let off = (unit(seed, key(k, 1)) * 2.0 - 1.0) * TURN_RAD;
        let place = facing(at, from, side_m * 0.5, off);
        let Some(cost_m) = flood.cost_m(map, place) else { continue };
        if quick.reaches(&place.pose(), ways) {
            let off_m = ((at - from).norm() - best_m).abs() / OFF_M;
            found.push((cost_m + off_m * off_m + off.abs() + 1.0 - comes(at), place));
        }
    }
    Ok(in_order(found))
}

/// Places from which a camera sees something small at a point, if no object hides it; the best first.
///
/// # Errors
/// There is no robot, or it cannot drive.
pub fn to_see(
    state: &State,
    (map, flood): (&Map, &Flood),
    point: &Vector3<f64>,
    seed: u64,
) -> Result<Vec<Place>, Trouble> {
    let machine = machine(state)?;
    let Some(head) = &machine.limbs.head else { return Ok(Vec::new()) };
    let from = Vector2::new(point.x, point.y);
    let (best_m, deviation_m) = SEE_M;
    let costs = Costmap::new(*map.grid())
        .range(from, SEE_RANGE_M.0, SEE_RANGE_M.1)
        .free(map)
        .times(|cell, _| f64::from(u8::from(flood.reaches_cell(map, cell))))
        .gaussian(from, best_m, deviation_m);
    let open = Open::new(state);
    let (mut found, mut links): (Vec<Candidate>, _) = (Vec::new(), Vec::new());
    for (k, at) in costs.samples(seed).take(POOL).enumerate() {
        let off = (unit(seed, key(k, 1)) * 2.0 - 1.0) * TURN_RAD;
        let place = facing(at, from, 0.0, off);
        let Some(cost_m) = flood.cost_m(map, place) else { continue };
        let base = place.pose();
        let Ok(look) = machine.robot.look_at(head, &base, &state.joints, &Point3::from(*point)) else {
            continue;
        };
        let mut joints = state.joints.to_vec();
        for (variable, value) in [(head.pan, look.pan), (head.tilt, look.tilt)] {
            if let Some(joint) = joints.get_mut(variable.index()) {
                *joint = value;
            }
        }
        machine.robot.forward(&base, &joints, &mut links);
        let eye = links.get(head.camera.index()).copied().unwrap_or_default();
        if open.sees(&eye, point) {
            let off_m = ((at - from).norm() - best_m).abs() / deviation_m;
            found.push((cost_m + off_m * off_m + off.abs(), place));
        }
    }
    Ok(in_order(found))
}

/// Places from which an arm takes the handle of a container and moves it to a position of its joint, the best
/// first. They are looked at by the motions themselves, so `most` bounds the time.
///
/// # Errors
/// There is no robot, or it cannot drive.
pub fn to_open(
    state: &State,
    (map, flood): (&Map, &Flood),
    (arm, id, to): (usize, ContainerId, f64),
    most: usize,
    seed: u64,
) -> Result<Vec<Place>, Trouble> {
    let machine = machine(state)?;
    let container = state.setting.container(id);
    let from = state.opening(id);
    let owner = state.setting.scene.fixtures[container.owner.0].pose;
    let handle = state.setting.container_pose(id, from) * container.handle.tool;
    let arc = |share: f64| -> Vec<Isometry3<f64>> {
        let position = |step: usize| from + (to - from) * step as f64 / ARC as f64;
        (1..=ARC).map(|step| tool_at(container, &owner, &handle, from, position(step), share)).collect()
    };
    let shares = if container.joint.turns() { &SHARES[..] } else { &SHARES[..1] };
    let arcs: Vec<Vec<Isometry3<f64>>> = shares.iter().map(|share| arc(*share)).collect();
    let all: Vec<&Isometry3<f64>> = std::iter::once(&handle).chain(&arcs[0]).collect();
    let (Some((centre, _)), Some(shoulder)) = (middle(&all), Shoulder::of(machine, state, arm)) else {
        return Ok(Vec::new());
    };
    let from_above = Vector2::new(centre.x, centre.y);
    let best_m = BEST_SHARE * shoulder.reach_m + shoulder.at.x;
    let costs = Costmap::new(*map.grid())
        .range(from_above, 0.2 * shoulder.reach_m, 1.2 * shoulder.reach_m)
        .free(map)
        .times(|cell, _| f64::from(u8::from(flood.reaches_cell(map, cell))))
        .gaussian(from_above, best_m, 0.25 * shoulder.reach_m);
    let there = with_base(state, None, &[arm]);
    let around = Around { handles: vec![id], ..Around::default() };
    let obstacles = there.obstacles(&around);
    let surroundings = Surroundings::new(machine, obstacles, there.carried());
    let mut quick = Quick { state: &there, machine, around: surroundings, seed };
    let ways = [ToolWay { arm, vias: vec![back(&handle, PRE_GRASP_M), handle] }];
    let at_handle = Vector2::new(handle.translation.x, handle.translation.y);
    let mut found: Vec<Candidate> = Vec::new();
    for (k, at) in costs.samples(seed).take(OPEN_POOL).enumerate() {
        let off = (unit(seed, key(k, 1)) * 2.0 - 1.0) * TURN_RAD;
        let place = facing(at, at_handle, shoulder.at.y, off);
        let base = place.pose();
        // Hands that may turn on the bar in several ways have more room on their way.
        let goes_along =
            |arc: &&Vec<Isometry3<f64>>| arc.iter().all(|tool| quick.has_solution(&base, arm, tool));
        let ways_along = arcs.iter().filter(goes_along).count();
        if ways_along == 0 {
            continue;
        }
        let Some(cost_m) = flood.cost_m(map, place) else { continue };
        if quick.reaches(&base, &ways) {
            found.push((cost_m - ways_along as f64, place));
        }
    }
    let opens = |place: &Place| container_problem(state, Some(*place), arm, id, to, seed).is_none();
    Ok(in_order(found).into_iter().take(OPEN_CHECKS).filter(opens).take(most).collect())
}

fn in_order(mut found: Vec<Candidate>) -> Vec<Place> {
    // Stable: equals stay in the order of the samples.
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().map(|(_, place)| place).collect()
}

/// The middle of via poses, and the level direction in which their tools come, if it is level.
fn middle(vias: &[&Isometry3<f64>]) -> Option<(Vector3<f64>, Option<Vector2<f64>>)> {
    let count = vias.len() as f64;
    let sum: Vector3<f64> = vias.iter().map(|via| via.translation.vector).sum();
    let comes: Vector3<f64> = vias.iter().map(|via| via.rotation * Vector3::x()).sum();
    let level = Vector2::new(comes.x, comes.y) / count;
    let centre = sum / count;
    let is_finite = !vias.is_empty() && centre.iter().all(|number| number.is_finite());
    is_finite.then_some((centre, level.try_normalize(0.5)))
}

/// A place at which a base faces a point, which is then so far to its left, and turned by `off` from there.
fn facing(at: Vector2<f64>, point: Vector2<f64>, left_m: f64, off: f64) -> Place {
    let along = point - at;
    let lean = libm::asin((left_m / along.norm().max(1e-6)).clamp(-0.9, 0.9));
    Place::new(at.x, at.y, crate::nav::normal_angle(libm::atan2(along.y, along.x) - lean + off))
}

/// Where an arm begins.
struct Shoulder {
    /// In the frame of the robot's root, as the robot is now.
    at: Vector3<f64>,
    /// How far the tool is from there at most.
    reach_m: f64,
}

impl Shoulder {
    fn of(machine: &Machine, state: &State, arm: usize) -> Option<Shoulder> {
        let chain = machine.solvers.get(arm)?.chain();
        let base = machine.robot.link_in_root(chain.base(), &state.joints);
        let first = chain.segments.first().map_or_else(Isometry3::identity, |segment| segment.origin);
        Some(Shoulder { at: (base * first).translation.vector, reach_m: chain.reach_m() })
    }
}

/// A quick look whether arms get to via poses: their ends only, not the ways between.
struct Quick<'a> {
    state: &'a State,
    machine: &'a Machine,
    around: Surroundings<'a>,
    seed: u64,
}

impl Quick<'_> {
    fn reaches(&mut self, base: &Isometry3<f64>, ways: &[ToolWay]) -> bool {
        let mut starts = vec![self.state.joints.to_vec()];
        for way in ways {
            let Some(first) = way.vias.first() else { return false };
            let solver = &self.machine.solvers[way.arm];
            let target = self.in_base(base, way.arm, first);
            let seed = solver.chain().pick(&self.state.joints);
            let solutions = solver.solutions(&target, &seed, self.seed, BRANCHES);
            let with = |values: &Vec<f64>| {
                starts
                    .iter()
                    .map(|start| {
                        let mut configuration = start.clone();
                        solver.chain().place(values, &mut configuration);
                        configuration
                    })
                    .collect::<Vec<_>>()
            };
            starts = solutions.iter().flat_map(with).take(2 * BRANCHES).collect();
        }
        starts.into_iter().any(|start| self.follows(base, ways, start))
    }

    fn follows(&mut self, base: &Isometry3<f64>, ways: &[ToolWay], mut joints: Vec<f64>) -> bool {
        let most = ways.iter().map(|way| way.vias.len()).max().unwrap_or(0);
        for via in 0..most {
            for way in ways.iter().filter(|_| via > 0) {
                let Some(pose) = way.vias.get(via) else { continue };
                let target = self.in_base(base, way.arm, pose);
                let solver = &self.machine.solvers[way.arm];
                let seed = solver.chain().pick(&joints);
                let mut out = seed.clone();
                if solver.solve(&target, &seed, self.seed, &mut out).is_err() {
                    return false;
                }
                solver.chain().place(&out, &mut joints);
            }
            if self.around.touch(base, &joints).is_some() {
                return false;
            }
        }
        most > 0
    }

    /// True if inverse kinematics has a solution, touching or not.
    fn has_solution(&self, base: &Isometry3<f64>, arm: usize, pose: &Isometry3<f64>) -> bool {
        let solver = &self.machine.solvers[arm];
        let mut out = solver.chain().pick(&self.state.joints);
        let seed = out.clone();
        solver.solve(&self.in_base(base, arm, pose), &seed, self.seed, &mut out).is_ok()
    }

    fn in_base(&self, base: &Isometry3<f64>, arm: usize, pose: &Isometry3<f64>) -> Isometry3<f64> {
        let mount = self.machine.solvers[arm].chain().base();
        (base * self.machine.robot.link_in_root(mount, &self.state.joints)).inverse() * pose
    }
}
