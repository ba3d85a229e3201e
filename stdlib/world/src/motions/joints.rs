//! Torso, head, and arms to a configuration.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::robot::model::VariableId;
use crate::robot::path::{Detour, joint_detour, joint_path};
use crate::setting::Machine;
use crate::state::{Around, Grip, State};

use super::{Costs, Draws, Key, Outcome, Part, Surroundings, Track, Trouble, joint_time_s, machine};

/// Joints move by at most so much between two looks, radians or metres.
const LOOK: f64 = 0.05;
/// The same on ways around something.
const DETOUR_LOOK: f64 = 0.05;

/// The torso to a height: `position` of its joint, metres.
#[must_use]
pub fn moving_torso(state: &State, position: f64) -> Outcome {
    Outcome::of(torso(state, position), vec![Part::Torso])
}

fn torso(state: &State, position: f64) -> Result<Outcome, Trouble> {
    let machine = machine(state)?;
    let Some(variable) = machine.limbs.torso else {
        return Err(Trouble::new("torso-out-of-range", "this robot has no torso that lifts"));
    };
    let (low, high) = machine.robot.variables()[variable.index()].limits.unwrap_or((f64::MIN, f64::MAX));
    if !(low..=high).contains(&position) {
        let message = format!("the torso lifts from {low} to {high} m, not to {position}");
        return Err(Trouble::new("torso-out-of-range", message)
            .number("goal", position)
            .number("low", low)
            .number("high", high));
    }
    if let Some(Grip::Handle(container)) = state.hands.values().find(|grip| matches!(grip, Grip::Handle(_))) {
        let container = &state.setting.container(*container).name;
        let message = format!("a hand holds the handle of `{container}`; let go first");
        return Err(Trouble::new("hands-bound", message));
    }
    let to = with(&state.joints, &[(variable, position)]);
    line(state, &to, "while the torso moves", Blocked::Fails)
        .map(|(track, _)| Outcome { track, ..Outcome::default() })
}

/// An arm to a configuration, one number for each joint of its chain.
#[must_use]
pub fn moving_arm_joints(state: &State, arms: &[(usize, Vec<f64>)], draws: &Draws) -> Outcome {
    let blocked = if draws.looks_around() { Blocked::GoesAround } else { Blocked::Leaps };
    Outcome::of(arm_joints(state, arms, blocked), arms.iter().map(|(arm, _)| Part::Arm(*arm)).collect())
}

fn arm_joints(state: &State, arms: &[(usize, Vec<f64>)], blocked: Blocked) -> Result<Outcome, Trouble> {
    let machine = machine(state)?;
    let mut to = state.joints.to_vec();
    for (number, values) in arms {
        let Some(arm) = machine.limbs.arms.get(*number) else {
            return Err(Trouble::new("no-such-arm", "the robot has no such arm"));
        };
        let name = &arm.name;
        let needed = arm.chain.variables().len();
        if values.len() != needed {
            let message = format!("the arm `{name}` has {needed} joints, got {} numbers", values.len());
            return Err(Trouble::new("arm-goal-out-of-range", message).name("arm", name));
        }
        let inside = |(value, limits): (&f64, &Option<(f64, f64)>)| {
            value.is_finite() && limits.is_none_or(|(low, high)| (low - 1e-9..=high + 1e-9).contains(value))
        };
        if let Some(bad) = values.iter().zip(arm.chain.limits()).position(|pair| !inside(pair)) {
            let message = format!("joint {bad} of the arm `{name}` would be outside of its limits");
            return Err(Trouble::new("arm-goal-out-of-range", message).name("arm", name));
        }
        super::tool::is_free_to_move(state, *number)?;
        arm.chain.place(values, &mut to);
    }
    let (track, leaps) = line(state, &to, "on the way", blocked)?;
    let costs = Costs { leaps, ..Costs::default() };
    Ok(Outcome { track, costs, ..Outcome::default() })
}

/// What becomes of a motion whose straight way is blocked.
#[derive(Clone, Copy)]
enum Blocked {
    Fails,
    /// It leaps where no way around is found.
    GoesAround,
    Leaps,
}

/// A line of joints, straight or around something, and how many leaps it takes: the end must be free.
fn line(state: &State, to: &[f64], when: &str, if_blocked: Blocked) -> Result<(Track, usize), Trouble> {
    let machine = machine(state)?;
    let mut around = Surroundings::new(machine, state.obstacles(&Around::default()), state.carried());
    if let Some(touch) = around.touch(&state.base, to) {
        return Err(around.collision(&touch, "at the goal"));
    }
    let blocked = match joint_path(&state.joints, to, LOOK, |at| around.touch(&state.base, at)) {
        Ok(()) => None,
        Err((_, touch)) => match if_blocked {
            Blocked::Fails => return Err(around.collision(&touch, when)),
            Blocked::GoesAround => Some(detour(state, &mut around, to)),
            Blocked::Leaps => Some(None),
        },
    };
    let (way, leaps) = match blocked {
        None => (vec![to.to_vec()], 0),
        Some(Some(way)) => (way, 0),
        Some(None) => (vec![to.to_vec()], 1),
    };
    Ok((track_of(state, &way, &times_s(machine, &state.joints, &way)), leaps))
}

/// A free way of the joints that differ, around what blocks the straight one.
pub(super) fn detour(state: &State, around: &mut Surroundings<'_>, to: &[f64]) -> Option<Vec<Vec<f64>>> {
    // The same way for the same ends, whatever is drawn elsewhere.
    const SEED: u64 = 0x0de7_0012;
    const QUESTIONS: usize = 1500;
    let variables = around.machine.robot.variables();
    let moving: Vec<_> = (0..to.len())
        .filter(|index| to[*index] != state.joints[*index])
        .map(|index| (index, variables[index].limits))
        .collect();
    let detour = Detour { moving: &moving, look: DETOUR_LOOK, questions: QUESTIONS, random: SEED };
    if around.touch(&state.base, &state.joints).is_some() {
        return None;
    }
    joint_detour(&state.joints, to, &detour, |at| around.touch(&state.base, at).is_some())
}

/// Seconds for each part of a way of joints.
pub(super) fn times_s(machine: &Machine, from: &[f64], way: &[Vec<f64>]) -> Vec<f64> {
    let starts = std::iter::once(from).chain(way.iter().map(Vec::as_slice));
    starts.zip(way).map(|(from, to)| joint_time_s(machine, from, to)).collect()
}

/// The track through some configurations; only what moves is in it.
pub(super) fn track_of(state: &State, configurations: &[Vec<f64>], times_s: &[f64]) -> Track {
    let moves = |index: &usize| {
        configurations.iter().any(|it| it.get(*index).is_some_and(|value| *value != state.joints[*index]))
    };
    let moving: Vec<usize> = (0..state.joints.len()).filter(moves).collect();
    let key = |configuration: &[f64]| Key {
        joints: moving.iter().map(|index| (VariableId(*index), configuration[*index])).collect(),
        ..Key::default()
    };
    let mut track = Track::default();
    track.push(0.0, key(&state.joints));
    for (configuration, time_s) in configurations.iter().zip(times_s) {
        track.push(*time_s, key(configuration));
    }
    track
}

fn with(joints: &[f64], values: &[(VariableId, f64)]) -> Vec<f64> {
    let mut to = joints.to_vec();
    for (variable, value) in values {
        to[variable.index()] = *value;
    }
    to
}

/// The head to a point in the world: the camera's Z goes through it.
#[must_use]
pub fn looking(state: &State, at: &Vector3<f64>) -> Outcome {
    Outcome::of(look(state, at), vec![Part::Head])
}

fn look(state: &State, at: &Vector3<f64>) -> Result<Outcome, Trouble> {
    let machine = machine(state)?;
    let Some(head) = &machine.limbs.head else {
        return Err(Trouble::new("looking-out-of-range", "this robot has no head that moves"));
    };
    let look =
        machine.robot.look_at(head, &state.base, &state.joints, &Point3::from(*at)).map_err(|why| {
            let goal = Isometry3::translation(at.x, at.y, at.z);
            Trouble::new("looking-out-of-range", why.to_string()).pose("goal", goal)
        })?;
    let to = with(&state.joints, &[(head.pan, look.pan), (head.tilt, look.tilt)]);
    let time_s = joint_time_s(machine, &state.joints, &to);
    Ok(Outcome { track: track_of(state, &[to], &[time_s]), ..Outcome::default() })
}
