//! What many values say together: their middle, their spread, and how sure these are.

use super::distribution::{binomial_at_least, student_quantile};
use super::{Interval, MOST_TRIALS};

/// A list of values in some numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// How many there are, at least one.
    pub n: usize,
    /// Their [`mean`].
    pub mean: f64,
    /// Their standard deviation, see [`sd`]; none of a single value.
    pub sd: Option<f64>,
    /// The smallest.
    pub min: f64,
    /// The 0.25 [`quantile`].
    pub q1: f64,
    /// The 0.5 [`quantile`].
    pub median: f64,
    /// The 0.75 [`quantile`].
    pub q3: f64,
    /// The largest.
    pub max: f64,
    /// The lower end of Student's 95 % interval of the mean, `mean − t(0.975, n − 1) · sd / √n` (Student 1908); none of a single value.
    pub low: Option<f64>,
    /// The upper end of it.
    pub high: Option<f64>,
}

impl Summary {
    /// The summary of these values. `None` if there are none, if one is not finite, or if they are too large for their mean
    /// or deviation to be finite.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Summary> {
        let sorted = sorted(values)?;
        let mean = mean(values)?;
        let (sd, half) = match values.len() {
            1 => (None, None),
            n => {
                let sd = sd(values)?;
                (Some(sd), Some(student_quantile(0.975, n as f64 - 1.0)? * sd / (n as f64).sqrt()))
            }
        };
        Some(Summary {
            n: values.len(),
            mean,
            sd,
            min: *sorted.first()?,
            q1: quantile_of_sorted(&sorted, 0.25)?,
            median: quantile_of_sorted(&sorted, 0.5)?,
            q3: quantile_of_sorted(&sorted, 0.75)?,
            max: *sorted.last()?,
            low: half.map(|half| mean - half),
            high: half.map(|half| mean + half),
        })
    }
}

/// The arithmetic mean. `None` if there are no values, if one is not finite, or if their sum is not.
///
/// What is summed are the distances from the first value, so the mean of equal values is this value to the last bit.
#[must_use]
pub fn mean(values: &[f64]) -> Option<f64> {
    let first = *values.first()?;
    let sum: f64 = values.iter().map(|value| value - first).sum();
    Some(first + sum / values.len() as f64).filter(|mean| mean.is_finite())
}

/// The standard deviation of a sample, √(Σ(x − mean)² / (n − 1)). `None` if there are less than two values, or as in [`mean`].
#[must_use]
pub fn sd(values: &[f64]) -> Option<f64> {
    variance(values).map(f64::sqrt)
}

/// The square of [`sd`].
pub(super) fn variance(values: &[f64]) -> Option<f64> {
    let mean = mean(values)?;
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    let variance = squares / (values.len() as f64 - 1.0);
    (values.len() > 1 && variance.is_finite()).then_some(variance)
}

/// The median: the [`quantile`] of 0.5.
#[must_use]
pub fn median(values: &[f64]) -> Option<f64> {
    quantile(values, 0.5)
}

/// The `p` quantile between the order statistics at (n − 1) p, as R, NumPy and spreadsheets have it (type 7 of Hyndman and Fan
/// 1996). `None` if there are no values, if one is not finite, or if not 0 ≤ `p` ≤ 1.
#[must_use]
pub fn quantile(values: &[f64], p: f64) -> Option<f64> {
    quantile_of_sorted(&sorted(values)?, p)
}

fn quantile_of_sorted(sorted: &[f64], p: f64) -> Option<f64> {
    if !(0.0..=1.0).contains(&p) {
        return None;
    }
    let at = (sorted.len() as f64 - 1.0) * p;
    let below = *sorted.get(at as usize)?;
    let above = *sorted.get(at as usize + 1).unwrap_or(&below);
    Some(below + at.fract() * (above - below)).filter(|quantile| quantile.is_finite())
}

/// All of them, if all are finite and there are any, in their order.
fn sorted(values: &[f64]) -> Option<Vec<f64>> {
    if values.is_empty() || !values.iter().all(|value| value.is_finite()) {
        return None;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    Some(sorted)
}

/// An interval that has the median with at least 95 %, whatever the distribution: from the k-th smallest value to the k-th
/// largest, with the largest k for which P(X < k) ≤ 0.025 of X ~ Binomial(n, 1/2) (Conover 1999, section 3.2).
///
/// `None` as in [`quantile`], and of less than six values, for which not even the smallest and the largest are enough.
#[must_use]
pub fn median_interval(values: &[f64]) -> Option<Interval> {
    let sorted = sorted(values)?;
    let n = u64::try_from(sorted.len()).ok().filter(|n| *n <= MOST_TRIALS)?;
    // By symmetry P(X < k) = P(X ≥ n + 1 − k), and this falls as k falls, so k is between 0 and the half.
    let (mut k, mut too_many) = (0, n / 2 + 1);
    while too_many - k > 1 {
        let middle = k + (too_many - k) / 2;
        match binomial_at_least(n + 1 - middle, n, 0.5)? <= 0.025 {
            true => k = middle,
            false => too_many = middle,
        }
    }
    let k = usize::try_from(k).ok().filter(|k| *k > 0)?;
    Some(Interval { low: *sorted.get(k - 1)?, high: *sorted.get(sorted.len() - k)? })
}
