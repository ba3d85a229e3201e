//! Hands: closing around an object or a handle, and letting go.
//!
//! To hold something is an attachment: from then on it moves with the hand. Whether it does is decided when
//! the hand closes, by where the fingers are, how wide they open, and what friction can carry.
//! What is let go falls; a short simulation ([`super::settle`]) says where it comes to rest, and whether
//! that is what anybody could have wanted.

use nalgebra::{Isometry3, Translation3, Vector3};

use crate::robot::model::VariableId;
use crate::scene::{ContainerId, Grasp, Hands, ObjectId};
use crate::state::{Grip, State, Support};

use super::{Draws, Event, Key, MODEL, Outcome, Part, Track, Trouble, machine, settle};

/// Free fall, m/s².
const GRAVITY: f64 = 9.81;

/// What a hand is to close around.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// An object.
    Object(ObjectId),
    /// The handle of a container.
    Handle(ContainerId),
}

/// One hand, or two on one object, close.
#[must_use]
pub fn gripping(state: &State, arms: &[usize], target: Target, draws: &mut Draws) -> Outcome {
    let found = match target {
        Target::Object(object) => grip_object(state, arms, object, draws),
        Target::Handle(container) => grip_handle(state, arms, container),
    };
    Outcome::of(found, parts(arms))
}

fn parts(arms: &[usize]) -> Vec<Part> {
    arms.iter().map(|arm| Part::Arm(*arm)).collect()
}

fn arm_name(state: &State, arm: usize) -> String {
    state.support_name(Support::Hand(arm))
}

/// The variable of an arm's gripper, and its value when the fingers are so far apart.
fn fingers_at(state: &State, arm: usize, width_m: f64) -> Result<(VariableId, f64), Trouble> {
    let arm_of = machine(state)?.limbs.arms.get(arm);
    let gripper = arm_of
        .and_then(|it| it.gripper.as_ref())
        .ok_or_else(|| Trouble::new("no-such-arm", "the robot has no such arm, or no gripper at it"))?;
    if width_m > gripper.width_m {
        let message =
            format!("{width_m:.3} m are wider than the gripper opens, which is {:.3} m", gripper.width_m);
        return Err(Trouble::new("gripper-too-narrow", message)
            .name("arm", arm_name(state, arm))
            .number("width", width_m)
            .number("opening", gripper.width_m));
    }
    Ok((gripper.variable, gripper.value_for_width(width_m)))
}

fn is_empty(state: &State, arm: usize) -> Result<(), Trouble> {
    let holds = match state.hands.get(&arm) {
        None => return Ok(()),
        Some(Grip::Object(object, _)) => state.setting.scene.objects[object.0].name.clone(),
        Some(Grip::Handle(container)) => state.setting.container(*container).name.clone(),
    };
    let name = arm_name(state, arm);
    let message = format!("the hand `{name}` already holds `{holds}`");
    Err(Trouble::new("hand-occupied", message).name("arm", name).name("holds", holds))
}

fn fingers(state: &State, arms: &[usize], width_m: f64) -> Result<Track, Trouble> {
    let (mut from, mut to) = (Vec::new(), Vec::new());
    for arm in arms {
        let (variable, value) = fingers_at(state, *arm, width_m)?;
        from.push((variable, state.joints[variable.index()]));
        to.push((variable, value));
    }
    let mut track = Track::default();
    track.push(0.0, Key { joints: from, ..Key::default() });
    track.push(MODEL.grip_s, Key { joints: to, ..Key::default() });
    Ok(track)
}

fn grip_handle(state: &State, arms: &[usize], container: ContainerId) -> Result<Outcome, Trouble> {
    let [arm] = arms else {
        return Err(Trouble::new("no-such-arm", "a handle is held by one hand"));
    };
    is_empty(state, *arm)?;
    let it = state.setting.container(container);
    let handle = state.setting.container_pose(container, state.opening(container)) * it.handle.tool;
    let tool = state.tool(*arm);
    let distance_m = (handle.translation.vector - tool.translation.vector).norm();
    if distance_m > MODEL.grasp_m {
        return Err(missed(state, *arm, &it.name, distance_m));
    }
    let mut track = fingers(state, arms, it.handle.width_m)?;
    track.events.push((MODEL.grip_s, Event::Hold(*arm, container)));
    Ok(Outcome { track, ..Outcome::default() })
}

fn missed(state: &State, arm: usize, what: &str, distance_m: f64) -> Trouble {
    let message = match distance_m.is_finite() {
        true => {
            format!("the fingers close on nothing: `{what}` is {distance_m:.3} m from where a grasp has it")
        }
        false => format!("`{what}` has no grasp for so many hands"),
    };
    Trouble::new("grasp-missed", message).name("arm", arm_name(state, arm)).name("object", what)
}

fn grip_object(
    state: &State,
    arms: &[usize],
    object: ObjectId,
    draws: &mut Draws,
) -> Result<Outcome, Trouble> {
    let Some(first) = arms.first() else {
        return Err(Trouble::new("no-such-arm", "nothing is gripped without a hand"));
    };
    for arm in arms {
        is_empty(state, *arm)?;
    }
    let kind = state.setting.scene.kind_of(object);
    let name = &state.setting.scene.objects[object.0].name;
    let pose = state.object_pose(object);
    let tools: Vec<Isometry3<f64>> = arms.iter().map(|arm| state.tool(*arm)).collect();
    let (grasp, distance_m) = nearest_grasp(&kind.grasps, &pose, &tools);
    let Some(grasp) = grasp.filter(|_| distance_m <= MODEL.grasp_m) else {
        return Err(missed(state, *first, name, distance_m));
    };
    let mut track = fingers(state, arms, grasp.width_m)?;
    // Two fingers at each hand press; friction has to carry what stands on the object, too.
    let mass_kg: f64 =
        state.with_load(object).iter().map(|it| state.setting.scene.kind_of(*it).mass_kg).sum();
    let hands = arms.len() + state.holders(object).len();
    let friction = kind.friction * (1.0 + draws.error(MODEL.friction_share));
    let carries_n = 2.0 * friction.max(0.0) * MODEL.grip_n * hands as f64;
    let needed_n = mass_kg * GRAVITY;
    let trouble = (carries_n < needed_n).then(|| {
        let message =
            format!("`{name}` slips: it weighs {needed_n:.1} N, and the grip carries {carries_n:.1} N");
        Trouble::new("object-slipped", message).name("arm", arm_name(state, *first)).name("object", name)
    });
    if trouble.is_none() {
        let mut holders = state.holders(object);
        holders.extend(arms);
        track.events.push((MODEL.grip_s, Event::Take(object, holders)));
    }
    Ok(Outcome { track, trouble, ..Outcome::default() })
}

/// The grasp that fits best to where the tools are, and how far they are from it. A turn counts as
/// much as the way of a fingertip.
pub(super) fn nearest_grasp<'a>(
    grasps: &'a [Grasp],
    object: &Isometry3<f64>,
    tools: &[Isometry3<f64>],
) -> (Option<&'a Grasp>, f64) {
    let off = |tool: &Isometry3<f64>, wanted: &Isometry3<f64>| {
        let metres = (tool.translation.vector - wanted.translation.vector).norm();
        // Fingers close as well the other way round.
        let turned = tool.rotation.angle_to(&wanted.rotation).min({
            let over = wanted.rotation
                * nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(0.0, 1.0, 0.0, 0.0));
            tool.rotation.angle_to(&over)
        });
        metres.max(turned * MODEL.grasp_m / MODEL.grasp_rad)
    };
    let distance = |grasp: &Grasp| match (grasp.hands, tools) {
        (Hands::One(in_object), [tool]) => off(tool, &(object * in_object)),
        (Hands::Two(left, right), [first, second]) => {
            off(first, &(object * left)).max(off(second, &(object * right)))
        }
        _ => f64::INFINITY,
    };
    let best = grasps.iter().map(|grasp| (grasp, distance(grasp))).min_by(|a, b| a.1.total_cmp(&b.1));
    match best {
        Some((grasp, distance)) if distance.is_finite() => (Some(grasp), distance),
        _ => (None, f64::INFINITY),
    }
}

/// Hands let go. What nobody holds any more comes to rest.
#[must_use]
pub fn releasing(state: &State, arms: &[usize]) -> Outcome {
    Outcome::of(release(state, arms), parts(arms))
}

fn release(state: &State, arms: &[usize]) -> Result<Outcome, Trouble> {
    let mut track = Track::default();
    let (mut from, mut to) = (Vec::new(), Vec::new());
    for arm in arms {
        let width_m = machine(state)?.limbs.arms.get(*arm).and_then(|it| Some(it.gripper.as_ref()?.width_m));
        let (variable, value) = fingers_at(state, *arm, width_m.unwrap_or(0.0))?;
        from.push((variable, state.joints[variable.index()]));
        to.push((variable, value));
    }
    track.push(0.0, Key { joints: from, ..Key::default() });
    track.push(MODEL.grip_s, Key { joints: to, ..Key::default() });
    let mut trouble = None;
    let mut objects: Vec<ObjectId> = arms.iter().filter_map(|arm| state.held(*arm)).collect();
    objects.dedup();
    for object in objects {
        let rest: Vec<usize> = state.holders(object).into_iter().filter(|arm| !arms.contains(arm)).collect();
        if rest.is_empty() {
            has_room(state, object)?;
            let settled = settle::settle(state, object);
            for (each, on, pose) in settled.places {
                track.events.push((MODEL.grip_s, Event::Put(each, on, pose)));
            }
            trouble = trouble.or(settled.trouble);
        } else {
            track.events.push((MODEL.grip_s, Event::Take(object, rest)));
        }
    }
    // Hands that have let go of an object are empty by that; those at handles, and those that another hand
    // has taken over from, are opened.
    let opened = arms.iter().map(|arm| (0.0, Event::Open(*arm)));
    track.events.splice(0..0, opened.map(|(_, event)| (MODEL.grip_s, event)));
    Ok(Outcome { track, trouble, ..Outcome::default() })
}

/// Whether what is right below an object takes one more.
fn has_room(state: &State, object: ObjectId) -> Result<(), Trouble> {
    let Some((support, _)) = below(state, object) else { return Ok(()) };
    let there = state.count_on(support);
    match state.capacity(support).filter(|capacity| there >= *capacity) {
        None => Ok(()),
        Some(_) => {
            let on = state.support_name(support);
            let name = &state.setting.scene.objects[object.0].name;
            let message =
                format!("`{on}` is full: {there} objects are there, and `{name}` would be one more");
            Err(Trouble::new("no-room", message).name("object", name).name("place", on))
        }
    }
}

/// What is below the lowest point in the middle of an object, and how far.
pub(crate) fn below(state: &State, object: ObjectId) -> Option<(Support, f64)> {
    const REACH_M: f64 = 0.1;
    let pose = state.object_pose(object);
    let kind = state.setting.scene.kind_of(object);
    let middle = (kind.low + kind.high) * 0.5;
    let foot = pose * Translation3::new(middle.x, middle.y, kind.low.z);
    let foot: Vector3<f64> = foot.translation.vector;
    state.support_below(&foot, REACH_M, object)
}
