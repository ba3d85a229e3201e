//! Damped least squares with restarts, for any chain.
//!
//! The step of Levenberg and Marquardt, Δq = Jᵀ (J Jᵀ + λ 1)⁻¹ e, with the damping λ proportional to
//! the squared error (Sugihara, *Solvability-unconcerned inverse kinematics by the
//! Levenberg-Marquardt method*, IEEE T-RO 2011): far from the target steps are careful, close to it
//! they are Newton's. A joint at its limit that the step would push out is left out of the step, and
//! the step is computed anew. An attempt that stops getting nearer is given up; the next begins at a
//! random configuration.

use nalgebra::{Isometry3, Vector3, Vector6};

use crate::random::unit;
use crate::robot::chain::{Chain, MAX_JOINTS};

use super::{Unreachable, Values, unwound};

/// How much to try.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Effort {
    /// Starts: the seed, then random configurations.
    pub attempts: u32,
    /// Steps of each.
    pub steps: u32,
}

impl Default for Effort {
    fn default() -> Effort {
        Effort { attempts: 100, steps: 40 }
    }
}

/// Metres and radians that may be left over.
const TOLERANCE: f64 = 1e-8;
/// Damping for an error of 1.
const DAMPING: f64 = 0.02;
/// Damping without any error, so that singular matrices have an inverse.
const LEAST_DAMPING: f64 = 1e-12;
/// The error of one step is taken for at most this, metres and radians.
const LONGEST: f64 = 2.0;
/// An attempt ends if in so many steps the squared error is not halved. Measured: to begin anew is
/// cheaper than to wait, and costs no solutions.
const PATIENCE: u32 = 3;

/// A configuration that brings the tip to the target.
pub(super) fn solve(
    chain: &Chain,
    target: &Isometry3<f64>,
    seed: &Values,
    random: u64,
    effort: Effort,
) -> Result<Values, Unreachable> {
    let (mut distance_m, mut angle_rad) = (f64::INFINITY, f64::INFINITY);
    for attempt in 0..effort.attempts {
        let start = start(chain, seed, random, attempt);
        let (values, error) = descend(chain, target, &start, effort.steps);
        if is_solved(&error)
            && let Some(values) = nearest_turns(chain, &values, seed)
        {
            return Ok(values);
        }
        let (linear, angular) = parts(&error);
        if linear + angular < distance_m + angle_rad {
            (distance_m, angle_rad) = (linear, angular);
        }
    }
    Err(Unreachable::NotFound { attempts: effort.attempts, distance_m, angle_rad })
}

/// Different configurations that bring the tip to the target, up to `most`.
pub(super) fn several(
    chain: &Chain,
    target: &Isometry3<f64>,
    seed: &Values,
    random: u64,
    effort: Effort,
    most: usize,
) -> Vec<Values> {
    let mut found: Vec<Values> = Vec::new();
    for attempt in 0..effort.attempts {
        if found.len() >= most {
            break;
        }
        let (values, error) = descend(chain, target, &start(chain, seed, random, attempt), effort.steps);
        let Some(values) = nearest_turns(chain, &values, seed).filter(|_| is_solved(&error)) else {
            continue;
        };
        let same = |other: &Values| values.iter().zip(other).all(|(a, b)| (a - b).abs() < 1e-3);
        if !found.iter().any(same) {
            found.push(values);
        }
    }
    found
}

/// Where an attempt begins: at the seed, then anywhere.
fn start(chain: &Chain, seed: &Values, random: u64, attempt: u32) -> Values {
    use std::f64::consts::PI;
    let mut values = *seed;
    if attempt > 0 {
        for (column, (value, limits)) in values.iter_mut().zip(chain.limits()).enumerate() {
            let (low, high) = limits.unwrap_or((*value - PI, *value + PI));
            *value =
                low + (high - low) * unit(random, u64::from(attempt) * MAX_JOINTS as u64 + column as u64);
        }
    }
    values
}

/// Joints without end as near to the seed as whole turns allow.
fn nearest_turns(chain: &Chain, values: &Values, seed: &Values) -> Option<Values> {
    let mut turned = *values;
    for (column, limits) in chain.limits().iter().enumerate() {
        if limits.is_none() {
            turned[column] = unwound(values[column], None, seed[column])?;
        }
    }
    Some(turned)
}

/// Steps from `start` until the error is gone, or does not get smaller.
fn descend(chain: &Chain, target: &Isometry3<f64>, start: &Values, steps: u32) -> (Values, Vector6<f64>) {
    let count = chain.variables().len().min(MAX_JOINTS);
    let mut columns = [Vector6::zeros(); MAX_JOINTS];
    let mut values = *start;
    let mut best = (values, Vector6::repeat(f64::INFINITY), f64::INFINITY);
    let (mut mark, mut patience) = (f64::INFINITY, PATIENCE);
    for _ in 0..steps {
        let error = difference(target, &chain.jacobian(&values[..count], &mut columns[..count]));
        let size = error.norm_squared();
        if size < best.2 {
            best = (values, error, size);
        }
        if is_solved(&error) {
            break;
        }
        if size < mark * 0.5 {
            (mark, patience) = (size, PATIENCE);
        } else {
            patience -= 1;
            if patience == 0 {
                break;
            }
        }
        let limits = &chain.limits()[..count];
        if !advance(&mut values[..count], limits, &columns[..count], &error, size) {
            break;
        }
    }
    (best.0, best.1)
}

/// One step. False if no joint can move.
fn advance(
    values: &mut [f64],
    limits: &[Option<(f64, f64)>],
    columns: &[Vector6<f64>],
    error: &Vector6<f64>,
    size: f64,
) -> bool {
    let damping = DAMPING * size.min(1.0) + LEAST_DAMPING;
    let error = error * (LONGEST / size.sqrt()).min(1.0);
    let mut free = [true; MAX_JOINTS];
    // Each round fixes a joint at least, or is the last.
    for _ in 0..=values.len() {
        let used = || columns.iter().zip(&free).filter(|(_, free)| **free).map(|(column, _)| column);
        let Some(y) = damped_inverse(used(), damping, &error) else { return false };
        let mut pushed = false;
        for ((value, limits), (column, free)) in values.iter().zip(limits).zip(columns.iter().zip(&mut free))
        {
            let (Some((low, high)), true) = (limits, *free) else { continue };
            let step = column.dot(&y);
            if (*value <= *low && step < 0.0) || (*value >= *high && step > 0.0) {
                *free = false;
                pushed = true;
            }
        }
        if pushed {
            continue;
        }
        for ((value, limits), (column, free)) in values.iter_mut().zip(limits).zip(columns.iter().zip(&free))
        {
            if *free {
                let next = *value + column.dot(&y);
                *value = limits.map_or(next, |(low, high)| next.clamp(low, high));
            }
        }
        return free[..values.len()].contains(&true);
    }
    false
}

/// y = (Σ c cᵀ + λ 1)⁻¹ e by Cholesky's decomposition. Plain arrays: with nalgebra's own
/// decomposition a whole query takes 1.4 times as long.
fn damped_inverse<'a>(
    columns: impl Iterator<Item = &'a Vector6<f64>>,
    damping: f64,
    error: &Vector6<f64>,
) -> Option<Vector6<f64>> {
    // The lower triangle of the sum, which becomes that of its root.
    let mut l = [[0.0_f64; 6]; 6];
    for column in columns {
        let column: [f64; 6] = (*column).into();
        for (row, a) in l.iter_mut().zip(column) {
            for (place, b) in row.iter_mut().zip(column) {
                *place += a * b;
            }
        }
    }
    let mut y: [f64; 6] = (*error).into();
    let mut inverse = [0.0_f64; 6];
    for row in 0..6 {
        for other in 0..row {
            let done: f64 = (0..other).map(|k| l[row][k] * l[other][k]).sum();
            l[row][other] = (l[row][other] - done) * inverse[other];
        }
        let done: f64 = l[row][..row].iter().map(|number| number * number).sum();
        // Rounding may eat up the damping; the smallest that can be is taken then.
        inverse[row] = 1.0 / (l[row][row] + damping - done).max(LEAST_DAMPING).sqrt();
        let done: f64 = l[row][..row].iter().zip(&y).map(|(number, y)| number * y).sum();
        y[row] = (y[row] - done) * inverse[row];
    }
    for row in (0..6).rev() {
        let done: f64 = (row + 1..6).map(|k| l[k][row] * y[k]).sum();
        y[row] = (y[row] - done) * inverse[row];
    }
    let y = Vector6::from(y);
    y.iter().all(|number| number.is_finite()).then_some(y)
}

/// What leads from `pose` to `target`: metres, then the rotation as axis times angle, in the axes of
/// the base.
fn difference(target: &Isometry3<f64>, pose: &Isometry3<f64>) -> Vector6<f64> {
    let linear = target.translation.vector - pose.translation.vector;
    let turn = (target.rotation * pose.rotation.inverse()).into_inner();
    let (mut sin, mut cos) = (turn.imag(), turn.w);
    if cos < 0.0 {
        // The short way round.
        (sin, cos) = (-sin, -cos);
    }
    let length = sin.norm();
    let angular = if length < 1e-12 { sin * 2.0 } else { sin * (2.0 * libm::atan2(length, cos) / length) };
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

fn parts(error: &Vector6<f64>) -> (f64, f64) {
    let [x, y, z, a, b, c]: [f64; 6] = (*error).into();
    (Vector3::new(x, y, z).norm(), Vector3::new(a, b, c).norm())
}

fn is_solved(error: &Vector6<f64>) -> bool {
    error.norm_squared() < TOLERANCE * TOLERANCE
}
