//! The distributions behind the tests, from the crate `statrs`: Student's t, the normal one and the binomial one.
//!
//! `statrs` takes logarithms from the system as soon as any crate of the program asks `num-traits` for that, so its last digits
//! are the machine's. What a plan decides must not depend on them: results are rounded to [`DIGITS`] digits.

use statrs::distribution::{Binomial, ContinuousCDF, DiscreteCDF, Normal, StudentsT};
use statrs::function::gamma::ln_gamma;

use super::MOST_TRIALS;

/// The 0.975 quantile of the normal distribution: so many standard errors are 95 % on both sides.
pub const Z_95: f64 = 1.959_963_984_540_054;

/// So many digits of a result are kept.
pub const DIGITS: usize = 10;

fn rounded(x: f64) -> Option<f64> {
    format!("{x:.*e}", DIGITS - 1).parse().ok().filter(|it: &f64| !it.is_nan())
}

/// How likely a normal value is at least as far from 0 as `z`, on either side: erfc(|z| / √2).
#[must_use]
pub fn normal_two_sided(z: f64) -> f64 {
    libm::erfc(z.abs() / std::f64::consts::SQRT_2)
}

/// With more degrees of freedom Student's t is the normal distribution but for the sixth digit, and `statrs` does not end.
const MANY: f64 = 1e6;

/// Student's t with so many degrees of freedom; with many of them the normal distribution.
fn student(degrees: f64) -> Option<Box<dyn ContinuousCDF<f64, f64>>> {
    if degrees.is_finite() && degrees > MANY {
        return Some(Box::new(Normal::standard()));
    }
    let student = StudentsT::new(0.0, 1.0, degrees).ok().filter(|_| degrees.is_finite())?;
    Some(Box::new(student))
}

/// How likely a value of Student's t with so many `degrees` of freedom is at least as far from 0 as `t`, on either side.
///
/// `None` unless `degrees` is finite and above 0; an infinite `t` gives 0.
#[must_use]
pub fn student_two_sided(t: f64, degrees: f64) -> Option<f64> {
    let distribution = student(degrees)?;
    if t.is_infinite() {
        return Some(0.0);
    }
    rounded((2.0 * distribution.sf(t.abs())).clamp(0.0, 1.0))
}

/// The number below which a value of Student's t with so many `degrees` of freedom is with the probability `p`.
///
/// `None` unless 0 < `p` < 1 and `degrees` is finite and above 0.
#[must_use]
pub fn student_quantile(p: f64, degrees: f64) -> Option<f64> {
    if !(p > 0.0 && p < 1.0) {
        return None;
    }
    rounded(student(degrees)?.inverse_cdf(p))
}

/// How likely `k` or more of `n` independent trials succeed, each with the probability `p`.
///
/// `None` unless 0 ≤ `p` ≤ 1 and `n` is at most [`MOST_TRIALS`].
#[must_use]
pub fn binomial_at_least(k: u64, n: u64, p: f64) -> Option<f64> {
    if n > MOST_TRIALS {
        return None;
    }
    let trials = Binomial::new(p, n).ok()?;
    match k {
        0 => Some(1.0),
        k if k > n => Some(0.0),
        k => rounded(trials.sf(k - 1).clamp(0.0, 1.0)),
    }
}

/// Γ(a + 1/2) / Γ(a), for `a` above 0.
#[must_use]
pub fn half_step(a: f64) -> Option<f64> {
    rounded(libm::exp(ln_gamma(a + 0.5) - ln_gamma(a)))
}
