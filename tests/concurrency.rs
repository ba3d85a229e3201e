//! What must hold of every concurrent program, on random ones.
//!
//! Each runs plainly, again, with stops, resumed from its log, and with other orders of the ready tasks
//! in a round. See [`invariants`] for what is looked at in each run.

mod invariants;
mod random;

use std::collections::BTreeMap;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use pleach::{Options, Session};
use vm::limits::{Grants, Limits};
use vm::log::Log;
use vm::machine::Progress;
use vm::random::mix;
use vm::value::Value;

use crate::oracle::both::{Verdict, compare};
use crate::oracle::seeds::report_of;
use crate::oracle::shrink::shrink;
use crate::oracle::{text, with_large_stack};
use random::{HEAD, random_program};

/// How many programs are run.
const PROGRAMS: u64 = 2_400;
/// How many are compared with the oracle.
const COMPARED: u64 = 4_000;
/// How many of these may use up their fuel: they hold what invariants say of trees, and no more.
const MOST_ENDLESS: usize = 60;
const FUEL: u64 = 200_000;
/// Nothing takes so long but what never ends.
const PATIENCE: Duration = Duration::from_secs(20);
/// How many threads run programs.
const THREADS: u64 = 2;

/// How a program is run.
#[derive(Default)]
struct How {
    seed: u64,
    schedule: u64,
    /// After so many units of fuel it is stopped; it goes on, unless it is to end there.
    stops: Vec<u64>,
    ends_at_stop: bool,
    log: Option<Log>,
}

/// What is seen of a run.
struct Seen {
    /// Outcome, output, tree.
    text: String,
    log: Log,
    steps: u64,
    endless: bool,
    problem: Option<Problem>,
}

const ERRORS: &str = "the program has errors";
const HANGS: &str = "it does not end";

/// A word for what is wrong, and where.
type Problem = (&'static str, String);

/// A file that programs may read.
fn file() -> (String, String) {
    let folder = format!("{}/concurrency", env!("CARGO_TARGET_TMPDIR"));
    (format!("{folder}/answer.txt"), folder)
}

fn run(program: &str, how: How) -> Seen {
    let mut grants = Grants::default();
    grants.allow(&format!("read={}", file().1)).expect("it is a grant");
    let limits = Limits { fuel: FUEL, depth: 10_000, memory: 256 << 20, ..Limits::default() };
    let (seed, schedule) = (how.seed, how.schedule);
    let mut session = Session::new(Options { seed, schedule, limits, grants, ..Options::default() });
    if let Some(log) = how.log {
        session.replay(log);
    }
    let mut output = String::new();
    let loaded = session.load_text("random.plan", &format!("{HEAD}{program}"));
    let mut reports = loaded.reports;
    let mut todo = loaded.init;
    if session.plan("main").is_some() {
        let call = session.extend("the call of the plan", "(main)");
        reports.extend(call.reports);
        todo.extend(call.init);
    }
    let mut seen = Seen { text: String::new(), log: Log::default(), steps: 0, endless: false, problem: None };
    if !reports.iter().all(compiler::Report::is_warning) {
        let errors = reports.iter().map(|report| session.report(report)).collect();
        return Seen { problem: Some((ERRORS, errors)), ..seen };
    }
    let start = session.machine.steps();
    let mut outcome = Ok(Value::NIL);
    'all: for function in todo {
        session.machine.start(function, Vec::new());
        outcome = loop {
            let used = session.machine.steps() - start;
            let stop = how.stops.iter().find(|stop| **stop > used).map(|stop| start + stop);
            match session.go(&mut output, stop) {
                Progress::Ended(outcome) => break outcome,
                Progress::Stopped if how.ends_at_stop => break 'all,
                Progress::Stopped => {}
            }
        };
        if outcome.is_err() {
            break;
        }
    }
    seen.steps = session.machine.steps() - start;
    seen.log = session.machine.log.clone();
    if how.ends_at_stop {
        return seen;
    }
    session.machine.finish(&outcome);
    let (Ok(value) | Err(value)) = &outcome;
    vm::failure::name_tasks(session.machine.tree(), value);
    let tree = session.machine.tree();
    let ended = text::of_outcome(&outcome);
    seen.endless = ended.contains("fuel-exhausted");
    seen.problem = invariants::of_tree(tree);
    for tree in invariants::trees_in(value) {
        seen.problem = seen.problem.or_else(|| invariants::of_tree(&tree));
    }
    if !seen.endless {
        seen.problem = seen.problem.or_else(|| invariants::of_clean_ups(&output));
    }
    seen.text = format!("{ended}\n{output}{}", text::of_machine(tree));
    seen
}

/// What is wrong with a program, or whether it ended within its fuel.
fn check(program: &str, seed: u64) -> Result<bool, Problem> {
    catch_unwind(AssertUnwindSafe(|| check_all(program, seed))).unwrap_or_else(|why| {
        let text = why.downcast_ref::<String>().cloned();
        let text = text.or_else(|| why.downcast_ref::<&str>().map(|text| (*text).into()));
        Err(("it panics", text.unwrap_or_default()))
    })
}

fn check_all(program: &str, seed: u64) -> Result<bool, Problem> {
    let holds = |seen: Seen| match &seen.problem {
        Some(problem) => Err(problem.clone()),
        None => Ok(seen),
    };
    let how = || How { seed, ..How::default() };
    let plain = holds(run(program, how()))?;
    // One of these for each program: a session takes longer than most runs.
    let (what, how_else) = match (seed / 8) % 4 {
        0 => ("another run differs", how()),
        1 => ("a run from its log differs", How { log: Some(plain.log.clone()), ..how() }),
        2 => ("a run with stops differs", How { stops: stops(seed, plain.steps), ..how() }),
        _ => {
            let stops = vec![mix(seed) % plain.steps.max(1)];
            let stopped = run(program, How { stops, ends_at_stop: true, ..how() });
            ("a resumed run differs", How { log: Some(stopped.log), ..how() })
        }
    };
    let other = run(program, how_else);
    if other.text != plain.text {
        return Err((what, crate::expected::difference(&plain.text, &other.text)));
    }
    let schedule = 1 + seed % 3;
    let shuffled = holds(run(program, How { schedule, ..how() }))?;
    if seed.is_multiple_of(8) && run(program, How { schedule, ..how() }).text != shuffled.text {
        return Err(("another run with the same schedule differs", String::new()));
    }
    Ok(!plain.endless)
}

/// Where a run of so many steps is stopped.
fn stops(seed: u64, steps: u64) -> Vec<u64> {
    let mut stops: Vec<u64> = (0..20).map(|n| mix(seed ^ (n << 32)) % steps.max(1)).collect();
    stops.sort_unstable();
    stops
}

/// The problem of a smaller program, which may not end where the larger one does.
fn check_in_time(program: &str, seed: u64) -> Option<Problem> {
    let (sender, receiver) = channel();
    let program = program.to_string();
    let thread = std::thread::Builder::new().stack_size(64 << 20);
    thread.spawn(move || sender.send(check(&program, seed))).expect("a thread can be started");
    receiver.recv_timeout(Duration::from_secs(2)).ok()?.err()
}

fn report(seed: u64, path: &str, (what, at): &Problem) -> String {
    let program = random_program(seed, path);
    if [ERRORS, HANGS].contains(what) {
        return format!("seed {seed}: {what}\n{at}\n{program}");
    }
    let small =
        shrink(&program, |program| check_in_time(program, seed).is_some_and(|(other, _)| other == *what));
    let at = check_in_time(&small, seed).map_or(at.clone(), |(_, at)| at);
    let small = grammar::format(&small).unwrap_or(small);
    format!("seed {seed}: {what}\n{at}\n{small}")
}

/// What came of the programs of some seeds: which used up their fuel, and what is wrong with others.
#[derive(Default)]
struct Found {
    endless: Vec<u64>,
    problems: Vec<(u64, Problem)>,
}

impl Found {
    fn of(seeds: Range<u64>) -> Found {
        let (path, folder) = file();
        std::fs::create_dir_all(folder).expect("a folder can be made");
        std::fs::write(&path, "answer").expect("a file can be written");
        let mut found = Found::default();
        let mut threads: Vec<_> = (0..THREADS).map(|at| checked(seeds.start + at..seeds.end)).collect();
        for (at, seed) in seeds.clone().enumerate() {
            let thread = &mut threads[at % THREADS as usize];
            match thread.recv_timeout(PATIENCE) {
                Ok(Ok(true)) => {}
                Ok(Ok(false)) => found.endless.push(seed),
                Ok(Err(problem)) => {
                    println!("seed {seed}: {}", problem.0);
                    found.problems.push((seed, problem));
                }
                Err(_) => {
                    // That thread is lost.
                    println!("seed {seed}: {HANGS}");
                    found.problems.push((seed, (HANGS, String::new())));
                    *thread = checked(seed + THREADS..seeds.end);
                }
            }
        }
        found.problems.sort_unstable();
        found
    }

    /// The problems by their kinds, the first of each as a small program.
    fn report(&self) -> String {
        let path = file().0;
        let mut kinds: BTreeMap<&str, Vec<&(u64, Problem)>> = BTreeMap::new();
        for problem in &self.problems {
            kinds.entry(problem.1.0).or_default().push(problem);
        }
        let reports = kinds.values().map(|of_kind| {
            let seeds: Vec<u64> = of_kind.iter().map(|(seed, _)| *seed).collect();
            let (seed, problem) = of_kind[0];
            format!("{} programs: {seeds:?}, of these {}", seeds.len(), report(*seed, &path, problem))
        });
        reports.collect::<Vec<_>>().join("\n")
    }
}

/// Checks the programs of every `THREADS`-th seed.
fn checked(seeds: Range<u64>) -> Receiver<Result<bool, Problem>> {
    let (sender, receiver) = channel();
    let work = move || {
        let path = file().0;
        for seed in seeds.step_by(THREADS as usize) {
            if sender.send(check(&random_program(seed, &path), seed)).is_err() {
                return;
            }
        }
    };
    std::thread::Builder::new().stack_size(64 << 20).spawn(work).expect("a thread can be started");
    receiver
}

#[test]
fn random_concurrent_programs_keep_the_invariants() {
    let found = Found::of(0..PROGRAMS);
    assert!(found.endless.len() <= MOST_ENDLESS, "many programs use up their fuel: {:?}", found.endless);
    assert!(found.problems.is_empty(), "{}", found.report());
}

/// `SEEDS="8 44" cargo test --test language concurrent_reports -- --ignored --nocapture` shows some seeds,
/// `SEEDS=5000..9000` what is wrong with any of so many.
#[test]
#[ignore = "a tool for whoever looks for a mistake"]
fn concurrent_reports() {
    let path = file().0;
    let seeds = std::env::var("SEEDS").unwrap_or_default();
    if let Some((from, to)) = seeds.split_once("..") {
        let number = |text: &str| text.parse().expect("a seed is a number");
        let found = Found::of(number(from)..number(to));
        println!("use up their fuel: {:?}\n{}", found.endless, found.report());
        return;
    }
    for seed in seeds.split_whitespace().filter_map(|seed| seed.parse().ok()) {
        println!("seed {seed}\n{}", random_program(seed, &path));
        match check(&random_program(seed, &path), seed) {
            Ok(ended) => println!("holds; ended within its fuel: {ended}"),
            Err(problem) => println!("{}", report(seed, &path, &problem)),
        }
    }
}

/// What differs between machine and oracle in the programs of some seeds: how many were compared, how many
/// were not and why, and which differ.
fn compared(seeds: Range<u64>) -> (u64, BTreeMap<String, u64>, Vec<u64>) {
    let path = file().0;
    let (mut same, mut not, mut different) = (0, BTreeMap::new(), Vec::new());
    for seed in seeds {
        let program = format!("{HEAD}{}", random_program(seed, &path));
        match compare(&program, seed) {
            Verdict::Same(_) => same += 1,
            Verdict::Different(..) => different.push(seed),
            Verdict::Errors(errors) => panic!("seed {seed} has errors:\n{errors}\n{program}"),
            Verdict::NotCompared(why) => *not.entry(why).or_insert(0) += 1,
        }
    }
    (same, not, different)
}

#[test]
fn machine_and_oracle_agree_on_random_concurrent_programs() {
    with_large_stack(|| {
        let (same, not, different) = compared(0..COMPARED);
        assert!(same * 10 > COMPARED * 9, "only {same} programs could be compared: {not:?}");
        println!("{} programs differ: {different:?}", different.len());
        if !different.is_empty() {
            let seed = &different[0];
            let report = report_of(HEAD, &random_program(*seed, &file().0), *seed);
            panic!("{} programs differ: {different:?}, the first of them:\n{report}", different.len());
        }
    });
}

/// `SEEDS="8 44" cargo test --test language concurrent_differences -- --ignored --nocapture` shows what both
/// make of some programs, `SEEDS=5000..9000` which of so many differ, and of a few of them how.
#[test]
#[ignore = "a tool for whoever looks for a difference"]
fn concurrent_differences() {
    const SHOWN: usize = 8;
    with_large_stack(|| {
        let seeds = std::env::var("SEEDS").unwrap_or_default();
        let seeds: Vec<u64> = match seeds.split_once("..") {
            Some((from, to)) => {
                let number = |text: &str| text.parse().expect("a seed is a number");
                let (same, not, different) = compared(number(from)..number(to));
                println!("{same} the same, not compared {not:?}, {} differ: {different:?}", different.len());
                different.into_iter().take(SHOWN).collect()
            }
            None => seeds.split_whitespace().filter_map(|seed| seed.parse().ok()).collect(),
        };
        for seed in seeds {
            println!("{}", report_of(HEAD, &random_program(seed, &file().0), seed));
        }
    });
}
