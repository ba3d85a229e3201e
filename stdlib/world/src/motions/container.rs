//! Doors and drawers: the hand holds the handle, and both go along the joint's arc.
//!
//! At each step the arm is solved for where the handle is then. Drawers keep the hand's turn; around the bar
//! of a door's handle the hand may turn by less than the door does, as fingers slide on a bar. What
//! stands in a drawer moves with it. The moving part is looked at like something that the robot carries:
//! it must touch neither the room nor the robot.

use nalgebra::{Isometry3, Unit, Vector3};

use crate::robot::collision::Carried;
use crate::robot::model::turn;
use crate::scene::{Container, ContainerId};
use crate::state::{Around, Grip, State};

use super::joints::track_of;
use super::{Costs, Draws, MODEL, Outcome, Part, Surroundings, Trouble, joint_time_s, machine};

/// Steps of the joint, radians and metres.
const STEP_RAD: f64 = 0.025;
const STEP_M: f64 = 0.02;
/// Shares of a door's turn that the hand turns with it, tried in this order.
const SHARES: [f64; 5] = [1.0, 0.75, 0.5, 0.25, 0.0];
/// A joint may move so far in one step.
const JUMP: f64 = 0.5;

/// The container whose handle the arm holds, to a position of its joint: 0 shuts it.
#[must_use]
pub fn moving_container(
    state: &State,
    arm: usize,
    container: ContainerId,
    to: f64,
    draws: &mut Draws,
) -> Outcome {
    Outcome::of(pull(state, arm, container, to, draws), vec![Part::Arm(arm)])
}

fn pull(state: &State, arm: usize, id: ContainerId, to: f64, draws: &mut Draws) -> Result<Outcome, Trouble> {
    let it = state.setting.container(id);
    if state.hands.get(&arm) != Some(&Grip::Handle(id)) {
        let message = format!("the hand does not hold the handle of `{}`", it.name);
        return Err(Trouble::new("handle-not-held", message).name("container", &it.name));
    }
    if !(0.0..=it.open + 1e-9).contains(&to) {
        let unit = if it.joint.turns() { "rad" } else { "m" };
        let message = format!("`{}` opens from 0 to {} {unit}, not to {to}", it.name, it.open);
        return Err(Trouble::new("container-out-of-range", message)
            .name("container", &it.name)
            .number("goal", to));
    }
    let from = state.opening(id);
    let random = draws.seed();
    let shares = if it.joint.turns() { &SHARES[..] } else { &SHARES[..1] };
    let mut first = None;
    for share in shares {
        match follow(state, arm, id, from, to, *share, random) {
            Ok(outcome) => return Ok(outcome),
            Err(trouble) => first = first.or(Some(trouble)),
        }
    }
    Err(first.unwrap_or_else(|| Trouble::new("container-blocked", "nothing moves")))
}

fn follow(
    state: &State,
    arm: usize,
    id: ContainerId,
    from: f64,
    to: f64,
    share: f64,
    random: u64,
) -> Result<Outcome, Trouble> {
    let machine = machine(state)?;
    let it = state.setting.container(id);
    let (step, speed) =
        if it.joint.turns() { (STEP_RAD, MODEL.door_rad_s) } else { (STEP_M, MODEL.drawer_m_s) };
    let steps = libm::ceil((to - from).abs() / step).max(1.0) as usize;
    let (solver, start_tool) = (&machine.solvers[arm], state.tool(arm));
    let chain_base = state.base * machine.robot.link_in_root(solver.chain().base(), &state.joints);
    let owner = state.setting.scene.fixtures[it.owner.0].pose;
    let mut around = Surroundings::new(
        machine,
        state.obstacles(&Around { moving: Some(id), handles: vec![id], ..Around::default() }),
        state.carried(),
    );
    let held = around.carried.len();
    let mut last = state.joints.to_vec();
    let (mut configurations, mut times, mut positions) = (Vec::new(), Vec::new(), Vec::new());
    let mut hand_m = 0.0;
    let mut tool_before = start_tool;
    for number in 1..=steps {
        let position = from + (to - from) * number as f64 / steps as f64;
        let tool = tool_at(it, &owner, &start_tool, from, position, share);
        let mut values = solver.chain().pick(&last);
        let seed = values.clone();
        let name = &machine.limbs.arms[arm].name;
        let off = |why: String| {
            let message = format!("the arm `{name}` does not follow the handle of `{}`: {why}", it.name);
            Trouble::new("arm-goal-unreachable", message).name("arm", name).pose("goal", tool)
        };
        solver
            .solve(&(chain_base.inverse() * tool), &seed, random, &mut values)
            .map_err(|why| off(why.to_string()))?;
        let by = seed.iter().zip(&values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if by > JUMP {
            return Err(off(format!("a joint would jump by {by:.2}")));
        }
        let mut next = last.clone();
        solver.chain().place(&values, &mut next);
        around.carried.truncate(held);
        around.carried.extend(moving_parts(state, arm, id, position, &tool));
        if let Some(touch) = around.touch(&state.base, &next) {
            let (first, second) = around.names(&touch);
            let message = format!(
                "`{}` does not get from {from:.2} to {to:.2}: at {position:.2} `{first}` would touch `{second}`",
                it.name
            );
            return Err(Trouble::new("container-blocked", message)
                .name("container", &it.name)
                .name("first", first)
                .name("second", second));
        }
        times.push(joint_time_s(machine, &last, &next).max((to - from).abs() / steps as f64 / speed));
        hand_m += (tool.translation.vector - tool_before.translation.vector).norm();
        tool_before = tool;
        configurations.push(next.clone());
        positions.push(position);
        last = next;
    }
    let mut track = track_of(state, &configurations, &times);
    for (key, position) in track.keys.iter_mut().zip(std::iter::once(from).chain(positions)) {
        key.opening = Some((id, position));
    }
    let costs = Costs { hand_m, ..Costs::default() };
    Ok(Outcome { track, costs, opened: Some((id, to)), ..Outcome::default() })
}

/// Where the tool is when the joint is at `position`, if it is at `tool` when the joint is at `from`.
fn tool_at(
    it: &Container,
    owner: &Isometry3<f64>,
    tool: &Isometry3<f64>,
    from: f64,
    position: f64,
    share: f64,
) -> Isometry3<f64> {
    let moved = owner * it.joint.moved(position) * it.joint.moved(from).inverse() * owner.inverse();
    let follows = moved * tool;
    if share >= 1.0 {
        return follows;
    }
    // The hand goes where the handle goes, and turns about the bar by a part of the door's turn.
    let Some(axis) = turn_axis(it, owner) else { return follows };
    let back = turn(&axis, (share - 1.0) * (position - from));
    Isometry3::from_parts(follows.translation, back * follows.rotation)
}

/// The axis of a door in the world, if the bar of its handle lies along it.
fn turn_axis(it: &Container, owner: &Isometry3<f64>) -> Option<Unit<Vector3<f64>>> {
    match it.joint {
        crate::scene::Hinge::Turn { axis, .. } if axis.dot(&it.handle.bar).abs() > 0.99 => {
            Some(Unit::new_unchecked(owner.rotation * axis.into_inner()))
        }
        _ => None,
    }
}

/// What moves with a container, as something that the tool carries.
fn moving_parts(
    state: &State,
    arm: usize,
    id: ContainerId,
    position: f64,
    tool: &Isometry3<f64>,
) -> Vec<Carried> {
    let Some(machine) = state.machine() else { return Vec::new() };
    let link = machine.limbs.arms[arm].chain.tip();
    let may_touch = crate::state::fingers(machine, arm).to_vec();
    let part = state.setting.container_pose(id, position);
    let mut parts = vec![Carried {
        name: state.setting.container(id).name.clone(),
        link,
        pose_in_link: tool.inverse() * part,
        body: state.setting.moving_containers[id.0].clone(),
        may_touch: may_touch.clone(),
    }];
    let moved = part * state.setting.container_pose(id, state.opening(id)).inverse();
    for object in state.objects.keys().filter(|it| state.drawer_of(**it) == Some(id)) {
        let pose_in_link = tool.inverse() * moved * state.object_pose(*object);
        parts.push(state.as_carried(*object, link, pose_in_link, may_touch.clone()));
    }
    parts
}
