//! What could be: where to stand, where to put something, whether an arm would get there.
//!
//! Nothing moves. Candidates come from a pool of samples whose size is fixed, are looked at one by one, and
//! stand in the order of their goodness, so the k-th is a function of what is asked, of the world, and of a
//! seed that the caller hands in. What they promise is quick to find out and not certain: [`reach`] asks
//! the motions themselves.

pub mod place;
pub mod reach;
pub mod see;
pub mod stand;

/// What is asked for once more must have the same answer: a key for the `n`-th thing drawn for sample `k`.
fn key(k: usize, n: u64) -> u64 {
    (k as u64) << 8 | n
}
