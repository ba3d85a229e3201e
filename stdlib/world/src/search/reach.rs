//! Whether an arm would get there, with the base elsewhere and nothing moved.
//!
//! The motions themselves answer, in a copy of the state: what they refuse is what would go wrong.

use crate::motions::container::moving_container;
use crate::motions::tool::{ToolWay, moving_tcp};
use crate::motions::{Draws, Trouble};
use crate::nav::Place;
use crate::scene::ContainerId;
use crate::scene::grasp::{PRE_GRASP_M, back};
use crate::state::{Around, Grip, State};

/// The state with the base at a place, and with empty hands of these arms open.
#[must_use]
pub fn with_base(state: &State, base: Option<Place>, arms: &[usize]) -> State {
    let mut there = state.clone();
    if let Some(place) = base {
        there.base = place.pose();
    }
    let gripper = |arm: &usize| {
        let gripper = state.machine()?.limbs.arms.get(*arm)?.gripper.as_ref()?;
        Some((gripper.variable, gripper.open))
    };
    let open: Vec<_> =
        arms.iter().filter(|arm| !state.hands.contains_key(*arm)).filter_map(gripper).collect();
    there.set_joints(&open);
    there
}

/// What keeps tools from going through their via poses, if anything does.
#[must_use]
pub fn problem(
    state: &State,
    base: Option<Place>,
    ways: &[ToolWay],
    around: &Around,
    seed: u64,
) -> Option<Trouble> {
    let arms: Vec<usize> = ways.iter().map(|way| way.arm).collect();
    moving_tcp(&with_base(state, base, &arms), ways, around, &mut Draws::new(seed)).trouble
}

/// What keeps an arm from taking the handle of a container and moving it to a position of its joint.
#[must_use]
pub fn container_problem(
    state: &State,
    base: Option<Place>,
    arm: usize,
    container: ContainerId,
    to: f64,
    seed: u64,
) -> Option<Trouble> {
    let mut there = with_base(state, base, &[arm]);
    let tool = state.setting.container_pose(container, state.opening(container))
        * state.setting.container(container).handle.tool;
    let ways = [ToolWay { arm, vias: vec![back(&tool, PRE_GRASP_M), tool] }];
    let around = Around { handles: vec![container], ..Around::default() };
    let outcome = moving_tcp(&there, &ways, &around, &mut Draws::new(seed));
    if outcome.trouble.is_some() {
        return outcome.trouble;
    }
    outcome.track.play(&mut there, f64::INFINITY);
    // The fingers close around it.
    let handle = &state.setting.container(container).handle;
    let gripper = state.machine().and_then(|it| it.limbs.arms.get(arm)?.gripper.as_ref());
    if let Some(gripper) = gripper {
        there.set_joints(&[(gripper.variable, gripper.value_for_width(handle.width_m))]);
    }
    there.hands.insert(arm, Grip::Handle(container));
    moving_container(&there, arm, container, to, &mut Draws::new(seed)).trouble
}
