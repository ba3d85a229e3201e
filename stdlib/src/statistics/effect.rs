//! Effect sizes: how far two lists of values are apart, in units that do not depend on what was measured.
//!
//! All are positive if the first list is larger. Those in standard deviations are 0 if the means are equal, and
//! `None` if the values do not scatter but differ, where they would be infinite.

use super::distribution::half_step;
use super::summary::{mean, sd, variance};

/// Cohen's d (Cohen 1988): (mean a − mean b) / s with the pooled s² = ((n a − 1) var a + (n b − 1) var b) / (n a + n b − 2).
///
/// `None` if a list has less than two values, or one that is not finite.
#[must_use]
pub fn cohens_d(a: &[f64], b: &[f64]) -> Option<f64> {
    let (free_a, free_b) = (a.len() as f64 - 1.0, b.len() as f64 - 1.0);
    let pooled = (free_a * variance(a)? + free_b * variance(b)?) / (free_a + free_b);
    in_deviations(mean(a)? - mean(b)?, pooled.sqrt())
}

/// Hedges' g (Hedges 1981): Cohen's d without its bias, d · Γ(m/2) / (√(m/2) Γ((m − 1)/2)) with m = n a + n b − 2.
///
/// `None` as [`cohens_d`].
#[must_use]
pub fn hedges_g(a: &[f64], b: &[f64]) -> Option<f64> {
    let d = cohens_d(a, b)?;
    let half = (a.len() + b.len() - 2) as f64 / 2.0;
    Some(d * half_step(half - 0.5)? / half.sqrt())
}

/// d_z of pairs (Cohen 1988): the mean of the differences `a[i] − b[i]` in their standard deviations.
///
/// `None` if the lists are not of one length, have less than two values, or one that is not finite.
#[must_use]
pub fn d_z(a: &[f64], b: &[f64]) -> Option<f64> {
    if a.len() != b.len() {
        return None;
    }
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    in_deviations(mean(&differences)?, sd(&differences)?)
}

fn in_deviations(difference: f64, deviation: f64) -> Option<f64> {
    let size = if difference == 0.0 { 0.0 } else { difference / deviation };
    size.is_finite().then_some(size)
}

/// Cliff's delta (Cliff 1993): how likely a value of `a` is larger than one of `b`, minus how likely it is smaller. From −1 to 1.
///
/// `None` if a list is empty, or has a value that is not finite.
#[must_use]
pub fn cliffs_delta(a: &[f64], b: &[f64]) -> Option<f64> {
    if a.is_empty() || b.is_empty() || !a.iter().chain(b).all(|value| value.is_finite()) {
        return None;
    }
    let mut sorted = b.to_vec();
    sorted.sort_by(f64::total_cmp);
    let more: f64 = (a.iter())
        .map(|value| {
            let smaller = sorted.partition_point(|it| it < value);
            let larger = sorted.len() - sorted.partition_point(|it| it <= value);
            smaller as f64 - larger as f64
        })
        .sum();
    Some(more / (a.len() as f64 * b.len() as f64))
}
