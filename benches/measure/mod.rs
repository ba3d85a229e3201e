//! What the benchmarks of this crate share: CPU time, medians of it, and a stack that suffices for deep programs.

use cpu_time::ProcessTime;

/// Which benchmarks are wanted.
pub type Wanted<'w> = &'w dyn Fn(&str) -> bool;

/// Runs the benchmarks whose names have the first argument in them, all without one.
#[allow(dead_code)]
pub fn begin(all: fn(Wanted<'_>)) {
    let pattern = std::env::args().skip(1).find(|arg| !arg.starts_with("--")).unwrap_or_default();
    on_a_large_stack(move || all(&|name| name.contains(&pattern)));
}

/// Does it on a thread with a stack for deep programs.
pub fn on_a_large_stack(work: impl FnOnce() + Send + 'static) {
    let thread = std::thread::Builder::new().stack_size(256 << 20);
    let bench = thread.spawn(work).expect("a thread can be started");
    bench.join().expect("the benchmarks run to their end");
}

/// The one in the middle.
#[allow(dead_code)]
pub fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// What `work` makes, and its CPU time in ns.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = ProcessTime::now();
    let result = work();
    (result, start.elapsed().as_nanos() as f64)
}
