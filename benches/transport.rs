//! The main job, measured: `cargo bench --bench transport [FILE.plan] [SEEDS]`.
//!
//! Runs a plan file, the four objects of `examples/14-four-objects` if none is named, once for each of 200 seeds, each
//! in a session of its own as `pleach run` does it. Says how many succeed and with which failures the others end, and the CPU
//! time of a run from the loaded program to its end: median, 90th percentile, greatest. What the plan prints is dropped.
//! Figures and budgets: `vm/benches/README.md`.

mod measure;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pleach::{Ended, Options, Session};

const FILE: &str = "examples/14-four-objects/main.plan";
const SEEDS: u64 = 200;

fn main() {
    measure::on_a_large_stack(all);
}

fn all() {
    let mut given = std::env::args().skip(1).filter(|arg| !arg.starts_with("--"));
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let file = given.next().map_or_else(|| root.join(FILE), PathBuf::from);
    let seeds = given.next().and_then(|it| it.parse().ok()).unwrap_or(SEEDS);
    let mut times_ms = Vec::new();
    let mut failures: BTreeMap<String, Vec<u64>> = BTreeMap::new();
    for seed in 0..seeds {
        let (failure, ms) = run(&file, seed);
        times_ms.push(ms);
        if let Some(failure) = failure {
            failures.entry(failure).or_default().push(seed);
        }
    }
    times_ms.sort_by(f64::total_cmp);
    let failed: usize = failures.values().map(Vec::len).sum();
    let at = |share: f64| times_ms[((times_ms.len() - 1) as f64 * share) as usize];
    println!("{}: {} of {seeds} runs succeed", file.display(), seeds as usize - failed);
    println!("median {:.1} ms, 90 % {:.1} ms, at most {:.1} ms a run", at(0.5), at(0.9), at(1.0));
    for (failure, seeds) in failures {
        println!("{failure}: seeds {seeds:?}");
    }
}

/// The type of the failure of a run, if it fails, and its milliseconds.
fn run(file: &Path, seed: u64) -> (Option<String>, f64) {
    let mut session = Session::new(Options { seed, ..Options::default() });
    let loaded = session.load_file(file).expect("the plan can be read");
    let mut printed = String::new();
    let (ended, ns) = measure::timed(|| session.run(loaded, None, &mut printed));
    let failure = match ended {
        Ended::Ran(Ok(_)) => None,
        Ended::Ran(Err(failure)) => {
            Some(failure.as_failure().map_or_else(|| "?".into(), |it| it.name.to_string()))
        }
        Ended::Errors(_) | Ended::NotLoaded(_) | Ended::Stopped => Some("not run".into()),
    };
    (failure, ns / 1e6)
}
