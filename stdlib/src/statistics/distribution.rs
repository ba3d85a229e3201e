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
pub const DIGITS: usize = 12;

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
<<<<<<< HEAD
    let trials = Binomial::new(p, n).ok()?;
    match k {
        0 => Some(1.0),
        k if k > n => Some(0.0),
        k => rounded(trials.sf(k - 1).clamp(0.0, 1.0)),
=======
    match p {
        _ if k == 0 => return Some(1.0),
        _ if k > n => return Some(0.0),
        0.0 | 1.0 => return Some(p),
        _ => {}
    }
    let odds = p / (1.0 - p);
    let mode = (((n + 1) as f64 * p) as u64).min(n);
    let weights = Weights::around(mode, 0, n, |i| (n - i) as f64 / (i + 1) as f64 * odds);
    Some(weights.share(|i, _| i >= k))
}

/// The probabilities of a discrete distribution with one mode, but for a factor that all have.
///
/// They are got from the mode outwards, each from its neighbour, so only the four operations are used. The mode weighs 1, and
/// what is so far out that it weighs nothing is left out.
pub(super) struct Weights {
    first: u64,
    weights: Vec<f64>,
}

impl Weights {
    /// `up(i)`: how many times as likely `i + 1` is as `i`.
    fn around(mode: u64, least: u64, most: u64, up: impl Fn(u64) -> f64) -> Weights {
        let mut weights = vec![1.0];
        let mut weight = 1.0;
        let mut first = mode;
        while first > least && weight > 0.0 {
            first -= 1;
            weight /= up(first);
            weights.push(weight);
        }
        weights.reverse();
        weight = 1.0;
        for i in mode..most {
            weight *= up(i);
            if weight == 0.0 {
                break;
            }
            weights.push(weight);
        }
        Weights { first, weights }
    }

    /// Of `draws` from a population of `white` and `black` ones, how many are white. No more than [`MOST_TRIALS`] in all.
    pub(super) fn hypergeometric(draws: u64, white: u64, black: u64) -> Weights {
        let (least, most) = (draws.saturating_sub(black), draws.min(white));
        let mode = ((draws + 1) * (white + 1) / (white + black + 2)).clamp(least, most);
        Weights::around(mode, least, most, |i| {
            ((white - i) * (draws - i)) as f64 / ((i + 1) * (black + i + 1 - draws)) as f64
        })
    }

    /// The weight of `i`.
    pub(super) fn of(&self, i: u64) -> f64 {
        let at = i.checked_sub(self.first).and_then(|at| usize::try_from(at).ok());
        at.and_then(|at| self.weights.get(at)).copied().unwrap_or(0.0)
    }

    /// The probability of all for which `counts` holds, given the value and its weight.
    pub(super) fn share(&self, counts: impl Fn(u64, f64) -> bool) -> f64 {
        let (mut inside, mut outside) = (0.0, 0.0);
        for (i, weight) in (self.first..).zip(&self.weights) {
            *(if counts(i, *weight) { &mut inside } else { &mut outside }) += weight;
        }
        inside / (inside + outside)
>>>>>>> stats
    }
}

/// Γ(a + 1/2) / Γ(a), for `a` above 0.
#[must_use]
pub fn half_step(a: f64) -> Option<f64> {
    rounded(libm::exp(ln_gamma(a + 0.5) - ln_gamma(a)))
}
