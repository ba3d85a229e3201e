//! Rates of success: how sure they are, and whether two of them differ.

use super::distribution::{Z_95, binomial_at_least};

/// From where to where.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// The lower end.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

/// A difference with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// First rate minus second.
    pub difference: f64,
    /// The lower end of the interval.
    pub low: f64,
    /// The upper end of it.
    pub high: f64,
}

/// More trials than anybody runs; tests of counts take no more, so that they end soon.
pub const MOST_TRIALS: u64 = 1_000_000;

/// The score interval of Wilson 1927 for the rate `k` / `n`: (2k + z² ± z √(z² + 4k(n − k)/n)) / 2(n + z²).
///
/// `None` if there are no trials, or more successes than trials.
#[must_use]
pub fn wilson(k: u64, n: u64) -> Option<Interval> {
    if n == 0 || k > n {
        return None;
    }
    let (successes, trials, z2) = (k as f64, n as f64, Z_95 * Z_95);
    let middle = 2.0 * successes + z2;
    let half = Z_95 * (z2 + 4.0 * successes * (1.0 - successes / trials)).sqrt();
    let end = |at: f64| (at / (2.0 * (trials + z2))).clamp(0.0, 1.0);
    // At the ends it is exactly 0 and 1, which rounding would miss.
    let low = if k == 0 { 0.0 } else { end(middle - half) };
    let high = if k == n { 1.0 } else { end(middle + half) };
    Some(Interval { low, high })
}

/// The exact test of McNemar 1947 for paired successes: `b` pairs in which only the first succeeded, `c` in which only the
/// second did. Two-sided: twice P(X ≥ max(b, c)) of X ~ Binomial(b + c, 1/2), at most 1. Pairs that agree say nothing.
///
/// `None` if there are more than [`MOST_TRIALS`].
#[must_use]
pub fn mcnemar(b: u64, c: u64) -> Option<f64> {
    let pairs = b.checked_add(c)?;
    Some((2.0 * binomial_at_least(b.max(c), pairs, 0.5)?).min(1.0))
}

/// Fisher's exact test of a table of two rows `a b` and `c d`, two-sided: the probability of all tables with the same
/// margins that are no more likely than this one (Fisher 1935; two-sided as in Agresti 2002, section 3.5.1, and in R).
///
/// It is computed here, for that of `statrs` 0.19.1 is wrong for large counts: 0.48 for 1000, 0, 0, 1000.
///
/// A table without counts in a row or column says nothing: 1. `None` if there are more than [`MOST_TRIALS`].
#[must_use]
pub fn fisher(a: u64, b: u64, c: u64, d: u64) -> Option<f64> {
    let all = [b, c, d].into_iter().try_fold(a, u64::checked_add)?;
    if all > MOST_TRIALS {
        return None;
    }
    let tables = Weights::hypergeometric(a + c, a + b, c + d);
    // Equally likely tables must not be told apart by rounding; R has the same factor.
    let most = tables.of(a) * (1.0 + 1e-7);
    Some(tables.share(|_, weight| weight <= most))
}

/// The difference of the independent rates `k` / `m` and `l` / `n` with method 10 of Newcombe 1998 (Statistics in Medicine 17,
/// 873–890): the distances of the ends of both Wilson intervals from their rates, as sides of a rectangle.
///
/// `None` if a rate has no trials, or more successes than trials.
#[must_use]
pub fn newcombe(k: u64, m: u64, l: u64, n: u64) -> Option<Difference> {
    Some(difference(Rate::of(k, m)?, Rate::of(l, n)?, 0.0))
}

/// The difference of two rates of the same pairs, by method 10 of Newcombe 1998 (Statistics in Medicine 17, 2635–2650): like
/// [`newcombe`], with the correlation of the pairs. `both` succeeded, only the `first`, only the `second`, `neither`.
///
/// `None` if there are no pairs, or too many to count.
#[must_use]
pub fn newcombe_paired(both: u64, first: u64, second: u64, neither: u64) -> Option<Difference> {
    let n = [first, second, neither].into_iter().try_fold(both, u64::checked_add)?;
    let (one, other) = (Rate::of(both + first, n)?, Rate::of(both + second, n)?);
    let [e, f, g, h, n] = [both, first, second, neither, n].map(|count| count as f64);
    let margins = ((e + f) * (g + h) * (e + g) * (f + h)).sqrt();
    let more = match e * h - f * g {
        more if more > 0.0 => (more - n / 2.0).max(0.0),
        less => less,
    };
    Some(difference(one, other, if margins == 0.0 { 0.0 } else { more / margins }))
}

/// A rate with its Wilson interval.
struct Rate {
    rate: f64,
    interval: Interval,
}

impl Rate {
    fn of(k: u64, n: u64) -> Option<Rate> {
        Some(Rate { interval: wilson(k, n)?, rate: k as f64 / n as f64 })
    }
}

fn difference(one: Rate, other: Rate, correlation: f64) -> Difference {
    let side = |a: f64, b: f64| (a * a - 2.0 * correlation * a * b + b * b).max(0.0).sqrt();
    let difference = one.rate - other.rate;
    let down = side(one.rate - one.interval.low, other.interval.high - other.rate);
    let up = side(one.interval.high - one.rate, other.rate - other.interval.low);
    Difference { difference, low: difference - down, high: difference + up }
}

/// The probabilities of a discrete distribution with one mode, but for a factor that all have.
///
/// They are got from the mode outwards, each from its neighbour, so only the four operations are used. The mode weighs 1, and
/// what is so far out that it weighs nothing is left out.
struct Weights {
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
    fn hypergeometric(draws: u64, white: u64, black: u64) -> Weights {
        let (least, most) = (draws.saturating_sub(black), draws.min(white));
        let mode = ((draws + 1) * (white + 1) / (white + black + 2)).clamp(least, most);
        Weights::around(mode, least, most, |i| {
            ((white - i) * (draws - i)) as f64 / ((i + 1) * (black + i + 1 - draws)) as f64
        })
    }

    /// The weight of `i`.
    fn of(&self, i: u64) -> f64 {
        let at = i.checked_sub(self.first).and_then(|at| usize::try_from(at).ok());
        at.and_then(|at| self.weights.get(at)).copied().unwrap_or(0.0)
    }

    /// The probability of all for which `counts` holds, given the value and its weight.
    fn share(&self, counts: impl Fn(u64, f64) -> bool) -> f64 {
        let (mut inside, mut outside) = (0.0, 0.0);
        for (i, weight) in (self.first..).zip(&self.weights) {
            *(if counts(i, *weight) { &mut inside } else { &mut outside }) += weight;
        }
        inside / (inside + outside)
    }
}
