//! Rules answer as they should: random programs against an oracle of our own ([`naive`]), and against
//! SWI-Prolog where it is installed ([`swipl`]).
//!
//! The programs are Prolog text ([`generate`]); both sides read the same.

mod answers;
mod generate;
mod naive;
mod planned;
mod swipl;

use pleach::{Options, Session};
use vm::rules::View;
use vm::rules::clause::PredId;
use vm::rules::engine::{Engine, Step};
use vm::value::Symbol;

use answers::{End, Found, Verdict};
use generate::{Batch, Theme};

use crate::oracle::with_large_stack;

/// Programs in one text.
const BATCH: usize = 200;
/// Answers of a program that are compared.
const MOST: usize = 60;
/// Goals that a program may solve.
const FUEL: u64 = 200_000;

/// A session that has read the programs of a batch.
fn load(batch: &Batch) -> Session {
    let mut session = Session::new(Options::default());
    let file = std::env::temp_dir().join(format!("pleach-{}-{}.pl", std::process::id(), thread_number()));
    std::fs::write(&file, &batch.text).expect("a file can be written");
    let loaded = session.load_file(&file).expect("it can be read");
    std::fs::remove_file(&file).expect("it can be removed");
    let errors: Vec<String> =
        loaded.reports.iter().filter(|it| !it.is_warning()).map(|it| session.report(it)).collect();
    assert!(errors.is_empty(), "{}", errors.join("\n"));
    for init in loaded.init {
        session.call(init, Vec::new(), &mut String::new()).expect("the text loads");
    }
    session
}

/// Tests run side by side, each with its files.
fn thread_number() -> String {
    format!("{:?}", std::thread::current().id()).replace(['(', ')'], "")
}

fn question(session: &Session, number: usize) -> PredId {
    let name = format!("t{number}w");
    session.machine.program.rules.find(Symbol::from(&name), 1).expect("the program has its question")
}

/// The answers of the engine.
fn ask(session: &Session, predicate: PredId) -> Found {
    ask_over(session, predicate, &View::default())
}

fn ask_over(session: &Session, predicate: PredId, view: &View) -> Found {
    let work = std::panic::AssertUnwindSafe(|| answers(session, predicate, view));
    let asked = std::panic::catch_unwind(work);
    asked.unwrap_or_else(|_| Found { answers: Vec::new(), end: End::Panic })
}

fn answers(session: &Session, predicate: PredId, view: &View) -> Found {
    let program = &session.machine.program;
    let mut engine = Engine::new(predicate, &[], view.clone(), false);
    let mut fuel = FUEL;
    let mut found = Found::default();
    loop {
        match engine.run(program, &mut fuel) {
            Ok(Step::Answer) => {
                let Ok(answer) = engine.answer() else { panic!("an answer is too large") };
                found.answers.push(naive::value_text(&answer));
                if found.answers.len() == MOST {
                    found.end = End::Limit;
                    return found;
                }
            }
            Ok(Step::No) => return found,
            Ok(Step::Fuel) => {
                found.end = End::Limit;
                return found;
            }
            Ok(Step::Call(..)) => panic!("the programs call no functions"),
            Err(_) => {
                found.end = End::Error;
                return found;
            }
        }
    }
}

fn ask_naive(session: &Session, number: usize, tabled: bool) -> Found {
    let program = &session.machine.program;
    let prefix = format!("t{number}p");
    let is_table = |it: &PredId| {
        let declared = &program.rules.predicates[it.at()].declared;
        tabled && declared.tabled && declared.name.starts_with(&prefix)
    };
    let all = (0..program.rules.predicates.len()).map(|at| PredId(at as u32));
    let tables: Vec<PredId> = all.filter(is_table).collect();
    let mut naive = naive::Naive::new(program, &tables, 20_000);
    let (mut answers, fault) = naive.ask(question(session, number));
    let mut end = match fault {
        None => End::No,
        Some(naive::Fault::Error) => End::Error,
        Some(naive::Fault::Limit) => End::Limit,
    };
    if answers.len() >= MOST {
        answers.truncate(MOST);
        end = End::Limit;
    }
    Found { answers, end }
}

/// Programs that were compared to their end, and those that differ.
#[derive(Default)]
struct Tally {
    whole: usize,
    answers: usize,
    different: Vec<(u64, usize)>,
}

impl Tally {
    fn add(&mut self, seed: u64, number: usize, ours: Found, theirs: Found, tabled: bool) {
        self.answers += ours.answers.len();
        let verdict = match tabled {
            true => ours.compare_as_sets(theirs),
            false => ours.compare(&theirs),
        };
        match verdict {
            Verdict::Same => self.whole += 1,
            Verdict::SameSoFar => {}
            Verdict::Different => self.different.push((seed, number)),
        }
    }

    #[track_caller]
    fn check(&self, theme: Theme, programs: usize, who: &str) {
        println!(
            "{theme:?}: {} of {programs} programs compared to their end with {who}, {} answers, {} differ",
            self.whole,
            self.answers,
            self.different.len()
        );
        let length = |it: &&(u64, usize)| generate::program(it.0, it.1, theme).len();
        if let Some((seed, number)) = self.different.iter().min_by_key(length) {
            panic!(
                "{} programs differ, the shortest of them: {}",
                self.different.len(),
                report(*seed, *number, theme)
            );
        }
        assert!(self.whole * 10 > programs * 8, "only {} programs could be compared", self.whole);
    }
}

/// One program and what all say to it.
fn report(seed: u64, number: usize, theme: Theme) -> String {
    let text = generate::program(seed, number, theme);
    let batch = Batch { text: text.clone(), programs: number + 1, tabled: theme == Theme::Tabling };
    let session = load(&batch);
    let ours = ask(&session, question(&session, number));
    let naive = ask_naive(&session, number, batch.tabled);
    let mut report =
        format!("seed {seed}, program {number}\n{text}\nmachine: {ours:#?}\noracle: {naive:#?}\n");
    if swipl::is_installed() {
        let theirs = swipl::ask(&batch, 10 * FUEL as usize, MOST);
        report += &format!("swipl: {:#?}\n", theirs.last());
    }
    report
}

fn compare_with_naive(theme: Theme, seeds: std::ops::Range<u64>) {
    with_large_stack(|| {
        let mut tally = Tally::default();
        for seed in seeds.clone() {
            let batch = generate::batch(seed, BATCH, theme);
            let session = load(&batch);
            for number in 0..batch.programs {
                let ours = ask(&session, question(&session, number));
                let theirs = ask_naive(&session, number, batch.tabled);
                tally.add(seed, number, ours, theirs, batch.tabled);
            }
        }
        tally.check(theme, seeds.count() * BATCH, "the oracle");
    });
}

fn compare_with_swipl(theme: Theme, seeds: std::ops::Range<u64>) {
    if !swipl::is_installed() {
        return println!("swipl is not installed: `.ci/install-swipl` does it");
    }
    with_large_stack(|| {
        let mut tally = Tally::default();
        for seed in seeds.clone() {
            let batch = generate::batch(seed, BATCH, theme);
            let session = load(&batch);
            let theirs = swipl::ask(&batch, 10 * FUEL as usize, MOST);
            assert_eq!(theirs.len(), batch.programs, "seed {seed}: swipl answers to all programs");
            for (number, theirs) in theirs.into_iter().enumerate() {
                let ours = ask(&session, question(&session, number));
                tally.add(seed, number, ours, theirs, batch.tabled);
            }
        }
        tally.check(theme, seeds.count() * BATCH, "SWI-Prolog");
    });
}

#[test]
fn control_as_the_oracle_has_it() {
    compare_with_naive(Theme::Control, 0..10);
}

#[test]
fn tables_as_the_oracle_has_them() {
    compare_with_naive(Theme::Tabling, 100..105);
}

#[test]
fn joins_as_the_oracle_has_them() {
    compare_with_naive(Theme::Joins, 200..205);
}

#[test]
fn control_as_in_prolog() {
    compare_with_swipl(Theme::Control, 1000..1010);
}

#[test]
fn tables_as_in_prolog() {
    compare_with_swipl(Theme::Tabling, 1100..1105);
}

#[test]
fn joins_as_in_prolog() {
    compare_with_swipl(Theme::Joins, 1200..1205);
}

/// Prints what all say to some programs: `SEEDS="Control:8:44" cargo test --test language rules::report --
/// --ignored --nocapture`.
#[test]
#[ignore = "a tool for whoever looks for a difference"]
fn reports() {
    let seeds = std::env::var("SEEDS").unwrap_or_default();
    with_large_stack(|| {
        for seed in seeds.split_whitespace() {
            let mut parts = seed.split(':');
            let theme = match parts.next() {
                Some("Tabling") => Theme::Tabling,
                Some("Joins") => Theme::Joins,
                _ => Theme::Control,
            };
            let mut number = || parts.next().and_then(|it| it.parse().ok()).unwrap_or_default();
            println!("{}", report(number(), number() as usize, theme));
        }
    });
}
