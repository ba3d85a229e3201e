//! Wilcoxon's signed rank test: like the paired t test, but a few huge differences decide nothing.

use super::distribution::normal_two_sided;

/// What the signed rank test says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wilcoxon {
    /// Pairs that differ; those that do not are left out, as Wilcoxon 1945 did.
    pub n: usize,
    /// The sum of the ranks of the pairs in which the first is larger.
    pub v: f64,
    /// How likely a sum at least as far out is if larger and smaller are alike, two-sided.
    pub p: f64,
    /// Whether `p` counts all signs, or approximates that.
    pub exact: bool,
}

/// So many pairs are counted exactly. Counts up to 2⁵⁰ are exact in floats.
const MOST_EXACT: usize = 50;

/// Wilcoxon's signed rank test (Wilcoxon 1945; Hollander and Wolfe 1973, section 3.1): the differences `a[i] − b[i]` are
/// ranked by their size, equal ones with their mean rank.
///
/// Up to 50 pairs that differ, `p` is exact: all 2ⁿ signs of these ranks are counted, so ties need no correction (R and others
/// approximate when there are ties). With more it is the normal approximation with corrections for ties and continuity,
/// z = (|V − n(n+1)/4| − 1/2) / √(n(n+1)(2n+1)/24 − Σ(t³ − t)/48), t the sizes of groups of equal ones. If no pair
/// differs, `p` is 1. `None` if the lists are not of one length, are empty, or have a value that is not finite.
#[must_use]
pub fn wilcoxon(a: &[f64], b: &[f64]) -> Option<Wilcoxon> {
    if a.len() != b.len() || a.is_empty() || !a.iter().chain(b).all(|value| value.is_finite()) {
        return None;
    }
    let mut differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).filter(|it| *it != 0.0).collect();
    differences.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let n = differences.len();
    // Twice the ranks, which are integers then.
    let (mut ranks, mut ties) = (Vec::with_capacity(n), 0.0);
    for group in differences.chunk_by(|a, b| a.abs() == b.abs()) {
        let twice = 2 * ranks.len() + group.len() + 1;
        ranks.extend(std::iter::repeat_n(twice, group.len()));
        let size = group.len() as f64;
        ties += size * size * size - size;
    }
    let v: usize = ranks.iter().zip(&differences).filter(|(_, it)| **it > 0.0).map(|(rank, _)| rank).sum();
    let exact = n <= MOST_EXACT;
    let p = if exact { p_of_signs(&ranks, v) } else { p_approximate(n as f64, v as f64 / 2.0, ties) };
    Some(Wilcoxon { n, v: v as f64 / 2.0, p, exact })
}

/// Twice the share of signs that give a sum as far out as `v`, on its side.
fn p_of_signs(ranks: &[usize], v: usize) -> f64 {
    let all: usize = ranks.iter().sum();
    // In how many ways some of the ranks have a sum: those without the next rank, and those with it.
    let mut ways = vec![0.0; all + 1];
    ways[0] = 1.0;
    for rank in ranks {
        for sum in (*rank..=all).rev() {
            ways[sum] += ways[sum - rank];
        }
    }
    let outside: f64 = ways[v.max(all - v)..].iter().sum();
    let total: f64 = ways.iter().sum();
    (2.0 * outside / total).min(1.0)
}

fn p_approximate(n: f64, v: f64, ties: f64) -> f64 {
    let deviation = (n * (n + 1.0) * (2.0 * n + 1.0) / 24.0 - ties / 48.0).sqrt();
    let distance = (v - n * (n + 1.0) / 4.0).abs() - 0.5;
    normal_two_sided(distance.max(0.0) / deviation)
}
