//! Inverse kinematics: a configuration of a chain that brings its tip to a pose.
//!
//! [`Solver::new`] looks whether the chain is built like an arm of the PR2, for which there is a
//! closed form ([`pr2_arm`]); any other chain is left to damped least squares with restarts
//! ([`damped`]). Both keep to the limits and prefer what is near the configuration they are given,
//! so that following a path by small steps gives no jumps.
//!
//! A joint without end gets the turn that is nearest to the seed's, so the straight line in joint
//! space from the seed to the solution is the short way round.
//!
//! The same (chain, target, seed, random) gives the same bits, whatever was asked before.

mod damped;
mod pr2_arm;

use nalgebra::Isometry3;
use thiserror::Error;

use super::chain::{Chain, MAX_JOINTS};

pub use damped::Effort;

use pr2_arm::Pr2Arm;

/// A configuration of a chain; the places beyond its variables are 0.
pub(crate) type Values = [f64; MAX_JOINTS];

/// How near to its limits a value may be computed before it counts as outside, radians or metres.
const LIMIT_TOLERANCE: f64 = 1e-9;

/// [`Chain::reach_m`] is a sum.
const ROUNDING_M: f64 = 1e-9;

/// Why a pose is not reached.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum Unreachable {
    /// NaN or infinity in the target or in the seed.
    #[error("the pose or the configuration to start from has a number that is not finite")]
    NotFinite,
    /// Beyond the length of the arm.
    #[error("the pose is {distance_m:.2} m from the shoulder, the arm is {reach_m:.2} m long")]
    TooFar {
        /// From the first joint to the target.
        distance_m: f64,
        /// What the arm could bridge stretched out.
        reach_m: f64,
    },
    /// The closed form has no solution within the limits.
    #[error("no configuration within the joints' limits reaches the pose")]
    OutsideLimits,
    /// The search gave up. This proves nothing, but is right more often than not.
    #[error("{attempts} attempts came no nearer than {distance_m:.4} m and {angle_rad:.4} rad")]
    NotFound {
        /// How many times it started.
        attempts: u32,
        /// Position left over in the best attempt.
        distance_m: f64,
        /// Rotation left over in that attempt.
        angle_rad: f64,
    },
}

/// Inverse kinematics of one chain.
#[derive(Debug, Clone)]
pub struct Solver {
    chain: Chain,
    closed: Option<Pr2Arm>,
    effort: Effort,
}

impl Solver {
    /// Chooses the method for a chain.
    #[must_use]
    pub fn new(chain: &Chain) -> Solver {
        Solver { closed: Pr2Arm::of(chain), chain: chain.clone(), effort: Effort::default() }
    }

    /// Damped least squares even where there is a closed form.
    #[must_use]
    pub fn numeric(chain: &Chain, effort: Effort) -> Solver {
        Solver { closed: None, chain: chain.clone(), effort }
    }

    /// The chain.
    #[must_use]
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// True if solutions are computed in closed form.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.closed.is_some()
    }

    /// Writes a configuration into `out` that brings the tip to `target`.
    ///
    /// `target`: pose of the tip in the frame of [`Chain::base`]. `seed`: a configuration of the
    /// chain; the solution is near to it (closed form: the nearest of all branches over the pan
    /// joint's sampled range; else: the first one found). `random`: seed of the restarts, unused by
    /// the closed form. `out` has the length of [`Chain::variables`] and is changed only on success.
    /// Nothing is allocated.
    ///
    /// # Errors
    /// [`Unreachable`] says what was tried.
    pub fn solve(
        &self,
        target: &Isometry3<f64>,
        seed: &[f64],
        random: u64,
        out: &mut [f64],
    ) -> Result<(), Unreachable> {
        let seed = self.checked(target, seed)?;
        let found = match &self.closed {
            Some(arm) => arm.nearest(target, &seed)?,
            None => damped::solve(&self.chain, target, &seed, random, self.effort)?,
        };
        for (place, value) in out.iter_mut().zip(found) {
            *place = value;
        }
        Ok(())
    }

    /// Up to `most` different configurations, the nearest to the seed first: for callers that must
    /// avoid something. Empty if there are none; ask [`Solver::solve`] why.
    #[must_use]
    pub fn solutions(
        &self,
        target: &Isometry3<f64>,
        seed: &[f64],
        random: u64,
        most: usize,
    ) -> Vec<Vec<f64>> {
        let Ok(seed) = self.checked(target, seed) else { return Vec::new() };
        let mut found = match &self.closed {
            Some(arm) => arm.all(target, &seed),
            None => damped::several(&self.chain, target, &seed, random, self.effort, most),
        };
        // Stable, so that equals stay in the order in which they were found.
        found.sort_by(|a, b| distance_squared(a, &seed).total_cmp(&distance_squared(b, &seed)));
        let count = self.chain.variables().len();
        found.iter().take(most).map(|values| values[..count].to_vec()).collect()
    }

    /// The seed as an array, moved into the limits.
    fn checked(&self, target: &Isometry3<f64>, seed: &[f64]) -> Result<Values, Unreachable> {
        let finite = |number: &f64| number.is_finite();
        let pose_is_finite =
            target.translation.vector.iter().all(finite) && target.rotation.coords.iter().all(finite);
        if !(pose_is_finite && seed.iter().all(finite)) {
            return Err(Unreachable::NotFinite);
        }
        let mut values = [0.0; MAX_JOINTS];
        for ((place, value), limits) in values.iter_mut().zip(seed).zip(self.chain.limits()) {
            *place = limits.map_or(*value, |(low, high)| value.clamp(low, high));
        }
        let first = self.chain.segments.first().map_or_else(Isometry3::identity, |segment| segment.origin);
        let (distance_m, reach_m) =
            ((target.translation.vector - first.translation.vector).norm(), self.chain.reach_m());
        if distance_m > reach_m + ROUNDING_M {
            return Err(Unreachable::TooFar { distance_m, reach_m });
        }
        Ok(values)
    }
}

/// Squared distance of two configurations, radians and metres alike.
pub(crate) fn distance_squared(a: &Values, b: &Values) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// `angle` plus or minus whole turns: within the limits, and as near to `seed` as they allow.
/// `None` if no turn is within the limits.
pub(crate) fn unwound(angle: f64, limits: Option<(f64, f64)>, seed: f64) -> Option<f64> {
    use std::f64::consts::TAU;
    let mut value = angle + TAU * libm::round((seed - angle) / TAU);
    let Some((low, high)) = limits else { return Some(value) };
    if value < low - LIMIT_TOLERANCE {
        value += TAU * libm::ceil((low - LIMIT_TOLERANCE - value) / TAU);
    } else if value > high + LIMIT_TOLERANCE {
        value -= TAU * libm::ceil((value - high - LIMIT_TOLERANCE) / TAU);
    }
    let inside = value >= low - LIMIT_TOLERANCE && value <= high + LIMIT_TOLERANCE;
    inside.then(|| value.clamp(low, high))
}
