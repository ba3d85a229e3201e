//! What the benchmarks of this crate share: medians of CPU time, and numbers by chance.

use cpu_time::ProcessTime;

/// How often each workload runs.
pub const RUNS: usize = 9;

/// Median of the CPU time of `work`, in ns, divided by the number of operations it does.
pub fn measure(operations: usize, mut work: impl FnMut()) -> f64 {
    let times = (0..RUNS).map(|_| {
        let start = ProcessTime::now();
        work();
        start.elapsed().as_nanos() as f64
    });
    median(times.collect()) / operations as f64
}

/// The one in the middle.
pub fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Numbers from 0 to 1 (SplitMix64).
#[allow(dead_code)]
pub struct Dice(pub u64);

#[allow(dead_code)]
impl Dice {
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
