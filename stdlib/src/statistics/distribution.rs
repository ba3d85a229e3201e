//! The distributions behind the tests: Student's t, the normal one, the binomial and the hypergeometric one.
//!
//! They are written here although crates have them, because the same run must give the same bits on every machine. The
//! crate statrs takes logarithms and exponentials through num-traits, and that takes them from the system as soon as any
//! crate of the program asks num-traits for `std`, as nalgebra and rapier do: digits 15 and 16 of a quantile then depend
//! on the machine. Here they come from `libm`, and the discrete distributions need none at all.

use super::MOST_TRIALS;

/// The 0.975 quantile of the normal distribution: so many standard errors are 95 % on both sides.
pub const Z_95: f64 = 1.959_963_984_540_054;

/// How likely a normal value is at least as far from 0 as `z`, on either side: erfc(|z| / √2).
#[must_use]
pub fn normal_two_sided(z: f64) -> f64 {
    libm::erfc(z.abs() / std::f64::consts::SQRT_2)
}

/// How likely a value of Student's t with so many `degrees` of freedom is at least as far from 0 as `t`, on either side.
///
/// It is I(x; degrees/2, 1/2) at x = degrees / (degrees + t²), with the regularized incomplete beta function I (Abramowitz
/// and Stegun 1964, 26.7.1). `None` unless `degrees` is finite and above 0; an infinite `t` gives 0.
#[must_use]
pub fn student_two_sided(t: f64, degrees: f64) -> Option<f64> {
    if t.is_nan() || !degrees.is_finite() || degrees <= 0.0 {
        return None;
    }
    if degrees > 1e6 {
        // The fraction below would lose its digits; the approximation of Wallace 1959 is exact to 1 / degrees².
        let z = (degrees * libm::log1p(t * t / degrees)).sqrt();
        return Some(normal_two_sided(z * ((8.0 * degrees + 1.0) / (8.0 * degrees + 3.0))));
    }
    // Both shares are computed, not one from the other: near 1 the difference has no digits left.
    let (a, t_squared) = (degrees / 2.0, t * t);
    let (x, y) = (degrees / (degrees + t_squared), t_squared / (degrees + t_squared));
    if y == 0.0 || x == 0.0 || t_squared.is_infinite() {
        return Some(f64::from(u8::from(y == 0.0)));
    }
    // x^a √y / B(a, 1/2)
    let factor =
        libm::exp(-a * libm::log1p(t_squared / degrees)) * (y / std::f64::consts::PI).sqrt() * half_step(a);
    // The continued fraction converges quickly on this side of the mean; else I(x; a, b) = 1 − I(y; b, a).
    let p = match x < (a + 1.0) / (a + 2.5) {
        true => factor * beta_fraction(a, 0.5, x) / a,
        false => 1.0 - factor * beta_fraction(0.5, a, y) / 0.5,
    };
    Some(p.clamp(0.0, 1.0))
}

/// Γ(a + 1/2) / Γ(a), for `a` above 0: by its series for large `a` (Tricomi and Erdélyi 1951), to which Γ(a + 1) = a Γ(a)
/// leads. A difference of two logarithms of Γ would have few digits.
pub(super) fn half_step(a: f64) -> f64 {
    let (mut at, mut factor) = (a, 1.0);
    while at < 30.0 {
        factor *= at / (at + 0.5);
        at += 1.0;
    }
    let inverse = 1.0 / at;
    let square = inverse * inverse;
    let series = [-1.0 / 8.0, 1.0 / 192.0, -1.0 / 640.0, 17.0 / 14336.0];
    let logarithm = series.iter().rev().fold(0.0, |sum, term| sum * square + term) * inverse;
    factor * at.sqrt() * libm::exp(logarithm)
}

/// The number below which a value of Student's t with so many `degrees` of freedom is with the probability `p`.
///
/// `None` unless 0 < `p` < 1 and `degrees` is finite and above 0; infinite if it is larger than any float.
#[must_use]
pub fn student_quantile(p: f64, degrees: f64) -> Option<f64> {
    if !(p > 0.0 && p < 1.0) {
        return None;
    }
    let tails = 2.0 * p.min(1.0 - p);
    // Floats above 0 are in the order of their bits, so halving the bits finds the float in 64 steps, whatever its size.
    let (mut low, mut high) = (0.0f64.to_bits(), f64::INFINITY.to_bits());
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        match student_two_sided(f64::from_bits(middle), degrees)? > tails {
            true => low = middle,
            false => high = middle,
        }
    }
    let t = if p == 0.5 { 0.0 } else { f64::from_bits(high) };
    Some(if p < 0.5 { -t } else { t })
}

/// More than it takes anywhere.
const MOST_TERMS: u32 = 10_000;

/// The continued fraction of the incomplete beta function (DLMF 8.17.22), evaluated as Lentz does with the change by Thompson and
/// Barnett 1986.
fn beta_fraction(a: f64, b: f64, x: f64) -> f64 {
    let away_from_zero = |value: f64| if value.abs() < 1e-300 { 1e-300 } else { value };
    let mut c = 1.0;
    let mut d = 1.0 / away_from_zero(1.0 - (a + b) * x / (a + 1.0));
    let mut fraction = d;
    for m in 1..=MOST_TERMS {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let before = fraction;
        for term in [even, odd] {
            d = 1.0 / away_from_zero(1.0 + term * d);
            c = away_from_zero(1.0 + term / c);
            fraction *= c * d;
        }
        if (fraction - before).abs() <= f64::EPSILON * before.abs() {
            break;
        }
    }
    fraction
}

/// How likely `k` or more of `n` independent trials succeed, each with the probability `p`.
///
/// `None` unless 0 ≤ `p` ≤ 1 and `n` is at most [`MOST_TRIALS`].
#[must_use]
pub fn binomial_at_least(k: u64, n: u64, p: f64) -> Option<f64> {
    if !(0.0..=1.0).contains(&p) || n > MOST_TRIALS {
        return None;
    }
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
    }
}
