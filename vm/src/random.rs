//! Keyed random numbers: a draw is a function of (seed, slot, attempt, number of the draw).
//!
//! Parallel branches and transformed variants of a plan do not disturb one another's draws, so
//! paired comparisons really are paired. The mixer is the finaliser of SplitMix64 (Steele, Lea,
//! Flood, OOPSLA 2014), with the constants of Stafford's variant 13.

/// The golden ratio as a fraction of 2^64: what SplitMix64 counts by.
const GAMMA: u64 = 0x9E37_79B9_7F4A_7C15;

/// Spreads every bit of `z` over the whole result.
#[inline(always)]
#[must_use]
pub fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// A number that stands for a text, the same on every machine (FNV-1a, then mixed).
#[must_use]
pub fn hash_text(text: &str) -> u64 {
    mix(text
        .bytes()
        .fold(0xCBF2_9CE4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)))
}

/// A number that stands for a call in words: the function that it stands in, what is called, and the how many-th call of
/// that it is there. Calls of other names around it do not change what it draws.
#[must_use]
pub fn hash_call(owner: &str, name: &str, ordinal: u64) -> u64 {
    mix(hash_text(owner) ^ mix(ordinal) ^ hash_text(name))
}

/// Draw number `n` of attempt `attempt` at the slot with this hash.
#[inline]
#[must_use]
pub fn draw(seed: u64, slot_hash: u64, attempt: u32, n: u64) -> u64 {
    let key = mix(seed ^ mix(slot_hash ^ (u64::from(attempt) + 1).wrapping_mul(GAMMA)));
    mix(key.wrapping_add((n + 1).wrapping_mul(GAMMA)))
}
