//! Tools along via poses: one arm, two arms at once, two arms on one thing.
//!
//! All arms of a motion go from via pose to via pose together. The first via poses are reached in a
//! straight line of the tools, or by any branch of inverse kinematics (in a line of joints, on a way of joints around what blocks it, or
//! by a leap); all further ones in straight lines, each step solved, looked at as a whole robot with what it carries.
//! Branches are tried until the rest of the way can be followed.
//!
//! What fingers may touch they touch on the way to the last via pose only: on those before they go around it, unless they begin at it.
//!
//! An arm that holds a thing together with one that moves follows it: the chain through the thing is
//! closed, both arms are solved at each step, and there are neither branches nor leaps.

use nalgebra::Isometry3;

use crate::robot::path::{Resolution, between, joint_path};
use crate::setting::Machine;
use crate::state::{Around, Grip, State};

use super::joints::{detour, track_of};
use super::{Costs, Draws, MODEL, Outcome, Part, Surroundings, Trouble, joint_time_s, machine};

/// The way of one tool.
#[derive(Debug, Clone)]
pub struct ToolWay {
    /// Which arm.
    pub arm: usize,
    /// Poses of its tool in the world.
    pub vias: Vec<Isometry3<f64>>,
}

/// Branches of inverse kinematics that are tried for one arm, and for all arms together.
const BRANCHES: usize = 10;
const ATTEMPTS: usize = 24;
/// A line of joints is looked at so often, radians.
const LOOK: f64 = 0.03;
/// Steps of one way at most.
const MAX_STEPS: f64 = 2000.0;

/// Tools through their via poses. `around` says what fingers may touch.
#[must_use]
pub fn moving_tcp(state: &State, ways: &[ToolWay], around: &Around, draws: &mut Draws) -> Outcome {
    let mut ways = ways.to_vec();
    let found = follow_along(state, &mut ways).and_then(|closed| tcp(state, &ways, around, closed, draws));
    Outcome::of(found, ways.iter().map(|way| Part::Arm(way.arm)).collect())
}

/// Adds the other hands on what these hands hold. True if a chain is closed.
fn follow_along(state: &State, ways: &mut Vec<ToolWay>) -> Result<bool, Trouble> {
    let mut closed = false;
    for number in 0..ways.len() {
        let arm = ways[number].arm;
        let Some(object) = state.held(arm) else { continue };
        for other in state.holders(object).into_iter().filter(|it| *it != arm) {
            closed = true;
            let relative = state.tool(arm).inverse() * state.tool(other);
            let vias: Vec<_> = ways[number].vias.iter().map(|via| via * relative).collect();
            match ways.iter().find(|way| way.arm == other) {
                None => ways.push(ToolWay { arm: other, vias }),
                Some(way) => {
                    let apart = way.vias.iter().zip(&vias).any(|(a, b)| {
                        (a.translation.vector - b.translation.vector).norm() > 0.005
                            || a.rotation.angle_to(&b.rotation) > 0.02
                    });
                    if apart || way.vias.len() != vias.len() {
                        let message = "both hands hold one thing, and would pull it apart";
                        return Err(Trouble::new("hands-bound", message));
                    }
                }
            }
        }
    }
    Ok(closed)
}

/// Why an arm cannot go anywhere by itself.
pub(crate) fn is_free_to_move(state: &State, arm: usize) -> Result<(), Trouble> {
    let name =
        state.machine().and_then(|it| it.limbs.arms.get(arm)).map_or_else(String::new, |it| it.name.clone());
    match state.hands.get(&arm) {
        Some(Grip::Handle(container)) => {
            let container = &state.setting.container(*container).name;
            let message = format!(
                "the hand `{name}` holds the handle of `{container}`; open it, close it or let go first"
            );
            Err(Trouble::new("hands-bound", message).name("arm", name))
        }
        Some(Grip::Object(object, _)) if state.holders(*object).len() > 1 => {
            let message = "two hands on one thing move along via poses only";
            Err(Trouble::new("hands-bound", message).name("arm", name))
        }
        _ => Ok(()),
    }
}

fn tcp(
    state: &State,
    ways: &[ToolWay],
    around: &Around,
    closed: bool,
    draws: &mut Draws,
) -> Result<Outcome, Trouble> {
    let machine = machine(state)?;
    if ways.is_empty() {
        return Err(Trouble::new("no-such-arm", "no arm is named"));
    }
    for way in ways {
        if !closed || state.held(way.arm).is_none() {
            is_free_to_move(state, way.arm)?;
        }
        let finite = |via: &Isometry3<f64>| {
            via.translation.vector.iter().chain(via.rotation.coords.iter()).all(|number| number.is_finite())
        };
        if way.arm >= machine.solvers.len() || way.vias.is_empty() || !way.vias.iter().all(finite) {
            return Err(Trouble::new(
                "no-such-arm",
                "a way needs an arm of the robot and poses with finite numbers",
            ));
        }
    }
    let near = Surroundings::new(machine, state.obstacles(around), state.carried());
    let most = ways.iter().map(|way| way.vias.len()).max().unwrap_or(0);
    let may_touch = !(around.touchable.is_empty() && around.handles.is_empty());
    let mut far = (may_touch && most > 1).then(|| {
        let around = Around { touchable: Vec::new(), handles: Vec::new(), ..around.clone() };
        Surroundings::new(machine, state.obstacles(&around), state.carried())
    });
    // Who begins at a thing must get away from it first.
    if far.as_mut().is_some_and(|far| far.touch(&state.base, &state.joints).is_some()) {
        far = None;
    }
    let mut search = Search {
        state,
        machine,
        ways,
        near,
        far,
        most,
        random: draws.seed(),
        detours: if draws.looks_around() { DETOURS } else { 0 },
    };
    let (configurations, leaps) = search.run(closed)?;
    let (mut times, mut hand_m, mut from) = (Vec::new(), 0.0, state.joints.to_vec());
    for to in &configurations {
        times.push(search.time_s(&from, to));
        from.clone_from(to);
    }
    for way in ways {
        let mut at = state.tool(way.arm);
        for via in &way.vias {
            hand_m += (via.translation.vector - at.translation.vector).norm();
            at = *via;
        }
    }
    let costs = Costs { hand_m, leaps, ..Costs::default() };
    Ok(Outcome { track: track_of(state, &configurations, &times), costs, ..Outcome::default() })
}

struct Search<'a> {
    state: &'a State,
    machine: &'a Machine,
    ways: &'a [ToolWay],
    /// What stands around on the way to the last via pose, and on those before.
    near: Surroundings<'a>,
    far: Option<Surroundings<'a>>,
    /// How many via poses there are.
    most: usize,
    random: u64,
    /// How many ways around what blocks the first line are looked for.
    detours: usize,
}

/// Branches to which a way around something is looked for.
const DETOURS: usize = 3;

impl<'a> Search<'a> {
    /// What stands around on the way to a via pose.
    fn around(&mut self, via: usize) -> &mut Surroundings<'a> {
        match &mut self.far {
            Some(far) if via + 1 < self.most => far,
            _ => &mut self.near,
        }
    }

    fn run(&mut self, closed: bool) -> Result<(Vec<Vec<f64>>, usize), Trouble> {
        let start = self.state.joints.to_vec();
        let straight = self.follow(&start, 0);
        let mut why = match straight {
            Ok(configurations) => return Ok((configurations, 0)),
            Err(why) if closed => return Err(why),
            Err(_) => None,
        };
        let mut blocked: Vec<Vec<Vec<f64>>> = Vec::new();
        let base = self.state.base;
        for first in self.branches()? {
            let around = self.around(0);
            if let Some(touch) = around.touch(&base, &first) {
                why.get_or_insert_with(|| around.collision(&touch, "at the first via pose"));
                continue;
            }
            match self.follow(&first, 1) {
                Err(trouble) => why = Some(trouble),
                Ok(rest) => {
                    let mut configurations = vec![first.clone()];
                    configurations.extend(rest);
                    let around = self.around(0);
                    if joint_path(&start, &first, LOOK, |at| around.touch(&base, at)).is_ok() {
                        return Ok((configurations, 0));
                    }
                    blocked.push(configurations);
                }
            }
        }
        for configurations in blocked.iter().take(self.detours) {
            if let Some(mut way) = detour(self.state, self.around(0), &configurations[0]) {
                way.extend(configurations.iter().skip(1).cloned());
                return Ok((way, 0));
            }
        }
        match blocked.into_iter().next() {
            Some(configurations) => Ok((configurations, 1)),
            None => Err(why.unwrap_or_else(|| Trouble::new("arm-goal-unreachable", "no arm moves"))),
        }
    }

    /// Configurations with all tools at their first via poses, the nearest first.
    fn branches(&self) -> Result<Vec<Vec<f64>>, Trouble> {
        let mut found = vec![self.state.joints.to_vec()];
        for way in self.ways {
            let solver = &self.machine.solvers[way.arm];
            let target = self.in_base(way.arm, &way.vias[0]);
            let seed = solver.chain().pick(&self.state.joints);
            let solutions = solver.solutions(&target, &seed, self.random, BRANCHES);
            if solutions.is_empty() {
                let mut out = seed.clone();
                let why = solver.solve(&target, &seed, self.random, &mut out).err();
                return Err(self.unreachable(
                    way.arm,
                    0,
                    1.0,
                    why.map_or_else(String::new, |why| why.to_string()),
                ));
            }
            let combined = solutions.iter().flat_map(|values| {
                found.iter().map(move |configuration| {
                    let mut configuration = configuration.clone();
                    solver.chain().place(values, &mut configuration);
                    configuration
                })
            });
            found = combined.collect();
        }
        found.truncate(ATTEMPTS);
        Ok(found)
    }

    /// Configurations from `start` in straight lines of the tools through the via poses from number `first` on.
    fn follow(&mut self, start: &[f64], first: usize) -> Result<Vec<Vec<f64>>, Trouble> {
        let resolution = Resolution::default();
        let base = self.state.base;
        let mut configurations = Vec::new();
        let mut last = start.to_vec();
        let mut from: Vec<Isometry3<f64>> = self
            .ways
            .iter()
            .map(|way| {
                let chain = self.machine.solvers[way.arm].chain();
                chain.forward(&chain.pick(start))
            })
            .collect();
        for via in first..self.most {
            let to: Vec<Isometry3<f64>> = self
                .ways
                .iter()
                .map(|way| self.in_base(way.arm, &way.vias[via.min(way.vias.len() - 1)]))
                .collect();
            let steps = from.iter().zip(&to).map(|(from, to)| {
                let metres = (to.translation.vector - from.translation.vector).norm();
                (metres / resolution.metres).max(from.rotation.angle_to(&to.rotation) / resolution.radians)
            });
            let steps = libm::ceil(steps.fold(0.0, f64::max)).clamp(1.0, MAX_STEPS) as usize;
            for step in 1..=steps {
                let share = step as f64 / steps as f64;
                let mut next = last.clone();
                for ((way, from), to) in self.ways.iter().zip(&from).zip(&to) {
                    let pose = if step == steps { *to } else { between(from, to, share) };
                    self.solve(way.arm, &pose, via, share, resolution.jump, &mut next)?;
                }
                let around = self.around(via);
                if let Some(touch) = around.touch(&base, &next) {
                    let when = format!("{:.0} % of the way to via pose {via}", share * 100.0);
                    return Err(around.collision(&touch, &when));
                }
                configurations.push(next.clone());
                last = next;
            }
            from = to;
        }
        Ok(configurations)
    }

    fn solve(
        &self,
        arm: usize,
        pose: &Isometry3<f64>,
        via: usize,
        share: f64,
        jump: f64,
        configuration: &mut [f64],
    ) -> Result<(), Trouble> {
        let solver = &self.machine.solvers[arm];
        let seed = solver.chain().pick(configuration);
        let mut out = seed.clone();
        solver
            .solve(pose, &seed, self.random, &mut out)
            .map_err(|why| self.unreachable(arm, via, share, why.to_string()))?;
        let by = seed.iter().zip(&out).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if by > jump {
            return Err(self.unreachable(arm, via, share, format!("a joint would jump by {by:.2}")));
        }
        solver.chain().place(&out, configuration);
        Ok(())
    }

    /// A pose in the world as the base of an arm sees it. Arms hang on links that no arm moves.
    fn in_base(&self, arm: usize, pose: &Isometry3<f64>) -> Isometry3<f64> {
        let base = self.machine.solvers[arm].chain().base();
        let in_root = self.machine.robot.link_in_root(base, &self.state.joints);
        (self.state.base * in_root).inverse() * pose
    }

    fn unreachable(&self, arm: usize, via: usize, share: f64, why: String) -> Trouble {
        let name = &self.machine.limbs.arms[arm].name;
        let goal = self.ways.iter().find(|way| way.arm == arm).and_then(|way| way.vias.get(via)).copied();
        let message = format!(
            "the arm `{name}` does not get {:.0} % of the way to via pose {via}: {why}",
            share * 100.0
        );
        Trouble::new("arm-goal-unreachable", message).name("arm", name).pose("goal", goal.unwrap_or_default())
    }

    /// Joints have their speeds, tools have theirs.
    fn time_s(&self, from: &[f64], to: &[f64]) -> f64 {
        let tools = self.ways.iter().map(|way| {
            let chain = self.machine.solvers[way.arm].chain();
            let (a, b) = (chain.forward(&chain.pick(from)), chain.forward(&chain.pick(to)));
            let metres = (a.translation.vector - b.translation.vector).norm();
            (metres / MODEL.tool_m_s).max(a.rotation.angle_to(&b.rotation) / MODEL.tool_rad_s)
        });
        tools.fold(joint_time_s(self.machine, from, to), f64::max)
    }
}
