//! Ways: straight lines of joints, straight lines of a tool, and ways of joints around what is in the way.
//!
//! A way is looked at in steps of a stated size. What lies between two steps is not seen, so the
//! step should be smaller than the thinnest thing divided by the arm's length.

use nalgebra::{Isometry3, Translation3, Unit};
use thiserror::Error;

use super::ik::{Solver, Unreachable};
use super::model::turn;
use crate::random::unit;

/// How finely a tool's way is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resolution {
    /// Metres of the tool between two steps at most.
    pub metres: f64,
    /// Radians that the tool turns between two steps at most.
    pub radians: f64,
    /// Radians, or metres, that a joint may move in one step: more is a jump to another branch.
    pub jump: f64,
}

impl Default for Resolution {
    fn default() -> Resolution {
        Resolution { metres: 0.02, radians: 0.1, jump: 0.5 }
    }
}

/// Steps of one line at most; longer ones get longer steps.
const MAX_STEPS: f64 = 10_000.0;

/// Configurations along a tool's way.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ToolPath {
    /// From the first step to the last via pose; where it starts is not among them.
    pub configurations: Vec<Vec<f64>>,
    /// For each via pose: its place in `configurations`.
    pub vias: Vec<usize>,
}

/// Why a tool cannot go along straight lines through its via poses.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum NoToolPath {
    /// A pose on the way is not reached.
    #[error("{:.0} % of the way to via pose {via}: {why}", share * 100.0)]
    Unreachable {
        /// Number of the via pose that the line leads to, from 0.
        via: usize,
        /// Share of the line that is done.
        share: f64,
        /// From inverse kinematics.
        why: Unreachable,
    },
    /// The arm would have to change to another branch.
    #[error("{:.0} % of the way to via pose {via}: a joint would jump by {by:.2}", share * 100.0)]
    Jump {
        /// Number of the via pose that the line leads to, from 0.
        via: usize,
        /// Share of the line that is done.
        share: f64,
        /// Radians or metres.
        by: f64,
    },
}

/// Part of the straight line from `from` to `to`: position linear, rotation about one axis with
/// even speed. `share` 0 gives `from`, 1 gives `to` up to rounding.
#[must_use]
pub fn between(from: &Isometry3<f64>, to: &Isometry3<f64>, share: f64) -> Isometry3<f64> {
    let at = from.translation.vector.lerp(&to.translation.vector, share);
    let (axis, angle_rad) = rotation_between(from, to);
    let rotation = axis.map_or(from.rotation, |axis| from.rotation * turn(&axis, angle_rad * share));
    Isometry3::from_parts(Translation3::from(at), rotation)
}

/// Axis and angle of the short turn from one pose to the other, in the axes of `from`; no axis if
/// there is no turn.
fn rotation_between(
    from: &Isometry3<f64>,
    to: &Isometry3<f64>,
) -> (Option<Unit<nalgebra::Vector3<f64>>>, f64) {
    let turned = (from.rotation.inverse() * to.rotation).into_inner();
    // A half turn either way is the same rotation; the one with the smaller angle is taken.
    let (imaginary, real) =
        if turned.w < 0.0 { (-turned.imag(), -turned.w) } else { (turned.imag(), turned.w) };
    let length = imaginary.norm();
    (Unit::try_new(imaginary, 1e-12), 2.0 * libm::atan2(length, real))
}

/// Goes from one configuration to another in a straight line and asks `blocked` at each step; both
/// ends are asked, and no number moves by more than `step` from one question to the next.
///
/// # Errors
/// Share of the way where `blocked` first answered, and its answer.
pub fn joint_path<B>(
    from: &[f64],
    to: &[f64],
    step: f64,
    mut blocked: impl FnMut(&[f64]) -> Option<B>,
) -> Result<(), (f64, B)> {
    let longest = from.iter().zip(to).map(|(from, to)| (to - from).abs()).fold(0.0, f64::max);
    let steps = count(longest / step);
    let mut at = from.to_vec();
    for number in 0..=steps {
        let share = number as f64 / steps as f64;
        for ((place, from), to) in at.iter_mut().zip(from).zip(to) {
            *place = from + (to - from) * share;
        }
        if let Some(answer) = blocked(&at) {
            return Err((share, answer));
        }
    }
    Ok(())
}

/// Configurations that lead the tool along straight lines through `vias`, from where `start` has it.
///
/// `vias`: poses of the chain's tip in the frame of its base. Each configuration is the solution
/// nearest to the one before. Whether the arm touches anything is for the caller to ask, between
/// the steps by [`joint_path`].
///
/// # Errors
/// The first pose that is not reached, or only with a jump.
pub fn tool_path(
    solver: &Solver,
    start: &[f64],
    vias: &[Isometry3<f64>],
    resolution: Resolution,
    random: u64,
) -> Result<ToolPath, NoToolPath> {
    let mut path = ToolPath::default();
    let mut from = solver.chain().forward(start);
    let mut last = start.to_vec();
    last.resize(solver.chain().variables().len(), 0.0);
    for (via, to) in vias.iter().enumerate() {
        let distance_m = (to.translation.vector - from.translation.vector).norm();
        let (_, angle_rad) = rotation_between(&from, to);
        let steps = count((distance_m / resolution.metres).max(angle_rad / resolution.radians));
        for number in 1..=steps {
            let share = number as f64 / steps as f64;
            // The via pose itself, not one that rounding made of it.
            let pose = if number == steps { *to } else { between(&from, to, share) };
            let mut next = last.clone();
            solver.solve(&pose, &last, random, &mut next).map_err(|why| NoToolPath::Unreachable {
                via,
                share,
                why,
            })?;
            let by = last.iter().zip(&next).map(|(last, next)| (next - last).abs()).fold(0.0, f64::max);
            if by > resolution.jump {
                return Err(NoToolPath::Jump { via, share, by });
            }
            path.configurations.push(next.clone());
            last = next;
        }
        path.vias.push(path.configurations.len() - 1);
        from = *to;
    }
    Ok(path)
}

/// Steps of a line: at least one, and no more than memory can take; NaN gives one.
fn count(steps: f64) -> usize {
    libm::ceil(steps).clamp(1.0, MAX_STEPS).max(1.0) as usize
}

// ---------------------------------------------------------------------------------------------
// Around what is in the way

/// What a search for a way of joints goes by.
#[derive(Debug, Clone)]
pub struct Detour<'a> {
    /// The numbers of the configuration that may change, with their limits.
    pub moving: &'a [(usize, Option<(f64, f64)>)],
    /// No number moves by more than this from one question to the next.
    pub look: f64,
    /// So many configurations are asked about at most.
    pub questions: usize,
    /// Seed of the draws.
    pub random: u64,
}

/// Branches of a tree grow by so much at once, radians.
const GROW: f64 = 0.6;
/// Tries to leave out corners.
const SHORTCUTS: usize = 40;

/// Corners of a free way from one configuration to another, the last one `to`; `None` if none was found among so many questions.
///
/// Two trees grow towards each other: RRT-Connect (Kuffner and LaValle, ICRA 2000), then corners are left out. Both ends must be
/// free. The same arguments give the same way.
#[must_use]
pub fn joint_detour(
    from: &[f64],
    to: &[f64],
    detour: &Detour<'_>,
    mut blocked: impl FnMut(&[f64]) -> bool,
) -> Option<Vec<Vec<f64>>> {
    let mut search = Bushes { detour, asked: 0, drawn: 0, blocked: &mut blocked };
    let mut trees = [vec![(from.to_vec(), 0)], vec![(to.to_vec(), 0)]];
    let mut first = 0;
    while search.asked < detour.questions {
        let aim = search.anywhere(from);
        let (grown, met) = {
            let [a, b] = &mut trees;
            let (here, there) = if first == 0 { (a, b) } else { (b, a) };
            let grown = search.grow(here, &aim, false);
            let goal = here[grown.unwrap_or(0)].0.clone();
            let met = grown.and_then(|_| search.grow(there, &goal, true));
            (grown, met.filter(|met| apart(&there[*met].0, &goal) < 1e-9))
        };
        if let (Some(grown), Some(met)) = (grown, met) {
            let (at_start, at_goal) = if first == 0 { (grown, met) } else { (met, grown) };
            let mut way = back_to_root(&trees[0], at_start);
            way.reverse();
            way.extend(back_to_root(&trees[1], at_goal).into_iter().skip(1));
            return Some(search.shortened(way));
        }
        first = 1 - first;
    }
    None
}

/// A tree: configurations, each with the place of the one before.
type Bush = Vec<(Vec<f64>, usize)>;

struct Bushes<'a, 'd> {
    detour: &'a Detour<'d>,
    asked: usize,
    drawn: u64,
    blocked: &'a mut dyn FnMut(&[f64]) -> bool,
}

impl Bushes<'_, '_> {
    fn unit(&mut self) -> f64 {
        self.drawn += 1;
        unit(self.detour.random, self.drawn)
    }

    fn anywhere(&mut self, from: &[f64]) -> Vec<f64> {
        let mut aim = from.to_vec();
        for (index, limits) in self.detour.moving {
            let (low, high) =
                limits.unwrap_or((from[*index] - std::f64::consts::PI, from[*index] + std::f64::consts::PI));
            aim[*index] = low + (high - low) * self.unit();
        }
        aim
    }

    /// True if the straight line is free; its beginning is known to be.
    fn is_free(&mut self, from: &[f64], to: &[f64]) -> bool {
        let longest = from.iter().zip(to).map(|(from, to)| (to - from).abs()).fold(0.0, f64::max);
        let steps = count(longest / self.detour.look);
        (1..=steps).all(|step| {
            self.asked += 1;
            !(self.blocked)(&mixed(from, to, step as f64 / steps as f64))
        })
    }

    /// The nearest branch grows towards a configuration, once or as far as it gets. The place of its new end.
    fn grow(&mut self, tree: &mut Bush, to: &[f64], far: bool) -> Option<usize> {
        let distances = tree.iter().map(|(at, _)| apart(at, to)).enumerate();
        let (mut last, _) = distances.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let mut grown = None;
        loop {
            let at = tree[last].0.clone();
            let way = apart(&at, to);
            let next = if way <= GROW { to.to_vec() } else { mixed(&at, to, GROW / way) };
            if way < 1e-12 || self.asked >= self.detour.questions || !self.is_free(&at, &next) {
                return grown;
            }
            tree.push((next, last));
            last = tree.len() - 1;
            grown = Some(last);
            if !far || way <= GROW {
                return grown;
            }
        }
    }

    /// Leaves out corners as long as the line past them is free.
    fn shortened(&mut self, mut way: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        for _ in 0..SHORTCUTS {
            if way.len() < 3 {
                break;
            }
            let first = (self.unit() * (way.len() - 2) as f64) as usize;
            let rest = way.len() - first - 2;
            let last = first + 2 + ((self.unit() * rest as f64) as usize).min(rest - 1);
            if self.is_free(&way[first].clone(), &way[last].clone()) {
                way.drain(first + 1..last);
            }
        }
        way.remove(0);
        way
    }
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

fn mixed(from: &[f64], to: &[f64], share: f64) -> Vec<f64> {
    from.iter().zip(to).map(|(from, to)| from + (to - from) * share).collect()
}

fn back_to_root(tree: &Bush, mut at: usize) -> Vec<Vec<f64>> {
    let mut way = vec![tree[at].0.clone()];
    while at != 0 {
        at = tree[at].1;
        way.push(tree[at].0.clone());
    }
    way
}
