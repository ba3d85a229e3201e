//! Student's t: do two lists of values have the same mean?

use super::distribution::{student_quantile, student_two_sided};
use super::summary::{mean, variance};

/// What a t test says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TTest {
    /// Mean of the first minus mean of the second.
    pub difference: f64,
    /// The lower end of the 95 % interval of the difference.
    pub low: f64,
    /// The upper end of it.
    pub high: f64,
    /// The difference in standard errors; infinite if the values do not scatter.
    pub t: f64,
    /// Degrees of freedom.
    pub degrees: f64,
    /// How likely a difference at least as large is if there is none, two-sided.
    pub p: f64,
}

/// The paired t test (Student 1908): whether the mean of the differences `a[i] − b[i]` is 0. t = mean / (sd / √n) with n − 1
/// degrees of freedom.
///
/// If the differences do not scatter, the interval is the difference itself, and `p` is 1 if it is 0, else 0.
/// `None` if the lists are not of one length, have less than two values, or one that is not finite.
#[must_use]
pub fn paired_t(a: &[f64], b: &[f64]) -> Option<TTest> {
    if a.len() != b.len() {
        return None;
    }
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    let n = differences.len() as f64;
    let error = (variance(&differences)? / n).sqrt();
    t_test(mean(&differences)?, error, n - 1.0, mean(a)?.abs().max(mean(b)?.abs()))
}

/// Welch's t test of values that are not paired, without the assumption that they scatter alike (Welch 1947, degrees of freedom by
/// Satterthwaite 1946): t = (mean a − mean b) / √(e), e = var a / n a + var b / n b, with e² / Σ((var / n)² / (n − 1)) degrees.
///
/// If the values do not scatter, the interval is the difference itself, `p` is 1 if it is 0, else 0, and the degrees are
/// those of two lists that scatter alike, n a + n b − 2. `None` if a list has less than two values, or one that is not finite.
#[must_use]
pub fn welch_t(a: &[f64], b: &[f64]) -> Option<TTest> {
    let (n_a, n_b) = (a.len() as f64, b.len() as f64);
    let (e_a, e_b) = (variance(a)? / n_a, variance(b)? / n_b);
    let error = (e_a + e_b).sqrt();
    // Shares of the sum, since squares of small numbers would be 0.
    let (s_a, s_b) = (e_a / (e_a + e_b), e_b / (e_a + e_b));
    let degrees = 1.0 / (s_a * s_a / (n_a - 1.0) + s_b * s_b / (n_b - 1.0));
    let degrees = if degrees.is_finite() { degrees } else { n_a + n_b - 2.0 };
    let (mean_a, mean_b) = (mean(a)?, mean(b)?);
    t_test(mean_a - mean_b, error, degrees, mean_a.abs().max(mean_b.abs()))
}

/// The test of a difference with its standard error. `size`: that of the values, to tell scatter from rounding.
fn t_test(difference: f64, error: f64, degrees: f64, size: f64) -> Option<TTest> {
    // As R has it: a smaller error is only rounding.
    let rounding = 10.0 * f64::EPSILON * size;
    if error <= rounding {
        let p = f64::from(u8::from(difference.abs() <= rounding));
        let t = if p == 1.0 { 0.0 } else { f64::INFINITY.copysign(difference) };
        return Some(TTest { difference, low: difference, high: difference, t, degrees, p });
    }
    let t = difference / error;
    let half = student_quantile(0.975, degrees)? * error;
    let p = student_two_sided(t, degrees)?;
    let test = TTest { difference, low: difference - half, high: difference + half, t, degrees, p };
    (test.low.is_finite() && test.high.is_finite()).then_some(test)
}
