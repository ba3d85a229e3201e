//! Statistics for comparing runs: what the values say together, whether two variants of a plan differ, by how much.
//!
//! All functions are pure and take plain slices; evaluations in Rust use them directly, plans through the natives. Where there
//! is no answer, since a list is empty, too short or has a value that is not finite, it is `None`: nothing here
//! panics, and no result is NaN. Intervals are those of 95 %, and `p` is always two-sided.
//!
//! Distributions come from the crate `statrs`, see [`distribution`]; tests and intervals that it lacks are written here, after the papers
//! that their docstrings name. The tests below name for each formula a published example.
//!
//! The order of a comparison is: [`Summary`] of each variant; runs that were made under the same seeds are pairs, so
//! [`paired_t`] and [`wilcoxon`] compare their values and [`mcnemar`] their successes; else [`welch_t`] and [`fisher`]; how much
//! it is say the intervals and [`effect`]; who tests several variants corrects by [`holm`].

pub mod distribution;
pub mod effect;
mod natives;
mod rank;
mod rate;
mod several;
mod student;
mod summary;

pub(crate) use natives::natives;
pub use rank::{Wilcoxon, wilcoxon};
pub use rate::{Difference, Interval, MOST_TRIALS, fisher, mcnemar, newcombe, newcombe_paired, wilson};
pub use several::holm;
pub use student::{TTest, paired_t, welch_t};
pub use summary::{Summary, mean, median, median_interval, quantile, sd};

#[cfg(test)]
mod tests;
