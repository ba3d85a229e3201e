//! Evaluations, measured: `cargo bench --bench evaluate [RUNS]`.
//!
//! The first experiment of the paper: four things from the island to the sink, as written and with both hands
//! (`examples/22-experiments/both-hands.plan`), RUNS of each, 200 if no other number is named. Says
//! - how long `pleach evaluate` takes for all of it on all cores, with its rehearsals, tables and pictures
//! - what the harness costs: the CPU time of an evaluation on one thread beside that of the same runs, one after the other in one
//!   session, without anything around them; by turns, so that a busy machine disturbs both
//! - how the greatest memory of the process grows with the number of runs
//!
//! Figures and budgets: `vm/benches/README.md`.

mod measure;

use std::path::Path;
use std::time::Instant;

use pleach::evaluate::folder::Head;
use pleach::evaluate::report;
use pleach::evaluate::summary::Table;
use pleach::evaluate::work::{Watch, evaluate};
use pleach::evaluate::worker::{Program, Worker};
use pleach::{Options, Session};
use vm::value::Value;

const FILE: &str = "examples/22-experiments/both-hands.plan";
const RUNS: u64 = 200;
/// Runs of each of the turns in which overheads are compared.
const OF_A_TURN: u64 = 50;
const TURNS: usize = 5;

struct Patient;

impl Watch for Patient {
    fn begins(&self, _what: &str, _done: usize, _of: usize) {}
    fn did(&self) {}
    fn goes_on(&self) -> bool {
        true
    }
}

fn main() {
    measure::on_a_large_stack(all);
}

fn all() {
    let mut given = std::env::args().skip(1).filter(|arg| !arg.starts_with("--"));
    let runs = given.next().and_then(|it| it.parse().ok()).unwrap_or(RUNS);
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(FILE);
    let folder = std::env::temp_dir().join(format!("pleach-bench-{}", std::process::id()));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);

    let mut ratios: Vec<f64> = (0..TURNS).map(|turn| overhead(&file, &folder, turn)).collect();
    ratios.sort_by(f64::total_cmp);
    println!(
        "harness: {:.3} × the runs alone (median of {TURNS} turns of {OF_A_TURN} runs; {:.3} to {:.3})",
        ratios[TURNS / 2],
        ratios[0],
        ratios[TURNS - 1]
    );
    for of in [runs / 8, runs / 2, 2 * runs] {
        evaluated(&file, of, threads, 1, &folder);
        println!("memory: at most {} MB up to {of} runs of each variant", peak_mb());
    }
    let begin = Instant::now();
    let done = evaluated(&file, runs, threads, 1, &folder);
    println!("{done} runs of two variants on {threads} threads: {:.1} s", begin.elapsed().as_secs_f64());
    let _ = std::fs::remove_dir_all(&folder);
}

/// Evaluates the experiment into an empty folder, and writes its report. How many runs that were.
fn evaluated(file: &Path, runs: u64, threads: usize, seed: u64, folder: &Path) -> usize {
    let _ = std::fs::remove_dir_all(folder);
    let program = program(file, &["none", "both-hands"], runs, seed);
    let all = evaluate(&program, (0, head(&program)), threads, Some(folder), &Patient);
    let Ok(all) = all else { panic!("it can be evaluated") };
    report::write(folder, &Table::of(&all.head, &all.runs), &all.runs, &[]).expect("it can be written");
    all.runs.len()
}

fn program(file: &Path, variants: &[&str], runs: u64, seed: u64) -> Program {
    let variants = variants.iter().map(|it| (*it).to_string()).collect();
    Program { file: file.into(), variants, runs: Some(runs), seed: Some(seed), ..Program::default() }
}

fn head(program: &Program) -> Head {
    let mut worker = Worker::new(program, &|| true).expect("it can be loaded");
    let experiment = worker.experiments().expect("they are right").remove(0);
    Head::new(experiment, worker.fingerprint(), String::new(), None)
}

/// How many times as much CPU time an evaluation of the plan as written takes as its runs.
fn overhead(file: &Path, folder: &Path, turn: usize) -> f64 {
    let seed = 1 + turn as u64 * OF_A_TURN;
    let alone = || {
        let mut session = Session::new(Options::default());
        let text = format!(
            "(use {})\n(def-fun run (seed) (project carry :args '(4) :seed seed) nil)",
            vm::print::quoted(&file.display().to_string())
        );
        let loaded = session.load_text("bench.plan", &text);
        let ended = session.load_only(loaded, &mut String::new());
        assert!(matches!(ended, pleach::Ended::Ran(Ok(_))), "{ended:?}");
        let run = session.plan("run").expect("it is there");
        let runs = || {
            for seed in seed..seed + OF_A_TURN {
                session.call(run, vec![Value::int(seed as i64)], &mut String::new()).expect("it runs");
            }
        };
        measure::timed(runs).1
    };
    let harness = || {
        let _ = std::fs::remove_dir_all(folder);
        let program = program(file, &["none"], OF_A_TURN, seed);
        let head = head(&program);
        let (all, ns) = measure::timed(|| evaluate(&program, (0, head), 1, Some(folder), &Patient));
        assert!(all.is_ok(), "it can be evaluated");
        ns
    };
    match turn % 2 {
        0 => {
            let alone = alone();
            harness() / alone
        }
        _ => harness() / alone(),
    }
}

/// The greatest resident memory so far, as Linux counts it.
fn peak_mb() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kb = line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<u64>().ok());
    kb.map_or("?".into(), |kb| (kb / 1024).to_string())
}
