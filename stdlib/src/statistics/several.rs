//! Several tests at once: one of twenty is "significant" by chance.

/// The p values of several tests, corrected by Holm 1979, in the order given: the i-th smallest of m is multiplied by m − i + 1,
/// is no smaller than that before it, and at most 1. Whoever then takes those below 0.05 is wrong in any of them with at most 5 %.
///
/// `None` if one is not from 0 to 1.
#[must_use]
pub fn holm(ps: &[f64]) -> Option<Vec<f64>> {
    if !ps.iter().all(|p| (0.0..=1.0).contains(p)) {
        return None;
    }
    let mut order: Vec<usize> = (0..ps.len()).collect();
    order.sort_by(|a, b| ps[*a].total_cmp(&ps[*b]));
    let mut corrected = vec![0.0; ps.len()];
    let mut least = 0.0f64;
    for (rank, at) in order.into_iter().enumerate() {
        least = least.max(ps[at] * (ps.len() - rank) as f64).min(1.0);
        corrected[at] = least;
    }
    Some(corrected)
}
