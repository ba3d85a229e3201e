//! Random numbers as functions of a seed and a counter.
//!
//! The mixer is the finaliser of SplitMix64 (Steele, Lea, Flood, OOPSLA 2014), as in the machine.

/// Number `n` of the stream `seed`, in [0, 1).
pub(crate) fn unit(seed: u64, n: u64) -> f64 {
    let mut z = seed.wrapping_add((n.wrapping_add(1)).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    // The 53 bits that a float can hold.
    (z >> 11) as f64 / (1_u64 << 53) as f64
}
