//! Rules answer as they should: random programs against an oracle of our own ([`naive`]), and against
//! SWI-Prolog where it is installed ([`swipl`]).
//!
//! The programs are Prolog text ([`generate`]); both sides read the same.

mod answers;
mod generate;
mod naive;
mod planned;
mod swipl;
mod unification;

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

/// More seeds, if `RULES_ROUNDS` says so: `RULES_ROUNDS=10 cargo test --test language rules::`.
fn more(seeds: std::ops::Range<u64>) -> std::ops::Range<u64> {
    let rounds = std::env::var("RULES_ROUNDS").ok().and_then(|it| it.parse::<u64>().ok()).unwrap_or(1);
    seeds.start * rounds..seeds.start * rounds + (seeds.end - seeds.start) * rounds
}

fn compare_with_naive(theme: Theme, seeds: std::ops::Range<u64>) {
    let seeds = more(seeds);
    with_large_stack(|| {
        let mut tally = Tally::default();
        for seed in seeds.clone() {
            let batch = generate::batch(seed, BATCH, theme);
            let mut session = load(&batch);
            for number in 0..batch.programs {
                let ours = ask(&session, question(&session, number));
                session.machine.program.rules.collect_from = 7;
                let tidy = ask(&session, question(&session, number));
                session.machine.program.rules.collect_from = usize::MAX;
                assert_eq!(ours, tidy, "seed {seed}, program {number}, with garbage collected");
                let theirs = ask_naive(&session, number, batch.tabled);
                tally.add(seed, number, ours, theirs, batch.tabled);
            }
        }
        tally.check(theme, seeds.count() * BATCH, "the oracle");
    });
}

fn compare_with_swipl(theme: Theme, seeds: std::ops::Range<u64>) {
    let seeds = more(seeds);
    if !swipl::is_installed() {
        return println!("swipl is not installed: `.ci/install-swipl` does it");
    }
    with_large_stack(|| {
        let (mut tally, mut alone) = (Tally::default(), 0);
        for seed in seeds.clone() {
            let batch = generate::batch(seed, BATCH, theme);
            let session = load(&batch);
            let theirs = swipl::ask(&batch, 10 * FUEL as usize, MOST);
            assert_eq!(theirs.len(), batch.programs, "seed {seed}: swipl answers to all programs");
            for (number, theirs) in theirs.into_iter().enumerate() {
                let ours = ask(&session, question(&session, number));
                // Version 9.0.4 answers `w :- p(_,_,_). p(_,_,X) :- o(X,X,X). o(_,2,_). o(b,[],_).` twice.
                // Where the oracle is with us, the other one stands alone.
                if ours.compare(&theirs) == Verdict::Different
                    && !batch.tabled
                    && ours.compare(&ask_naive(&session, number, false)) == Verdict::Same
                {
                    alone += 1;
                    continue;
                }
                tally.add(seed, number, ours, theirs, batch.tabled);
            }
        }
        let programs = seeds.count() * BATCH;
        assert!(alone * 1000 <= programs, "SWI-Prolog stands alone with {alone} programs");
        tally.check(theme, programs, "SWI-Prolog");
    });
}

/// Random programs of a theme have the same answers elsewhere.
macro_rules! same_answers {
    ($($name:ident = $elsewhere:ident($theme:ident, $seeds:expr);)+) => {
        $(#[test] fn $name() { $elsewhere(Theme::$theme, $seeds); })+
    };
}

same_answers! {
    control_as_the_oracle_has_it = compare_with_naive(Control, 0..10);
    tables_as_the_oracle_has_them = compare_with_naive(Tabling, 100..105);
    joins_as_the_oracle_has_them = compare_with_naive(Joins, 200..205);
    control_as_in_prolog = compare_with_swipl(Control, 1000..1010);
    tables_as_in_prolog = compare_with_swipl(Tabling, 1100..1105);
    joins_as_in_prolog = compare_with_swipl(Joins, 1200..1205);
}

/// A loop that makes terms and forgets them does not grow, also with a choice before it.
#[test]
fn a_loop_keeps_no_garbage() {
    let text = "loop(0, _).\n\
        loop(N, f(A, B, C)) :- N > 0, M is N - 1, X = g(N, A, B), X = g(_, D, _), loop(M, f(C, g(N), D)).\n\
        t0w(done) :- loop(5000000, f(1, 2, 3)), !.\n\
        t1w(done) :- (fail ; true ; true), loop(500000, f(1, 2, 3)), (true ; fail), !.\n\
        t2w(N) :- between(0, 1000000, X), X >= 1000000, N = X.\n";
    let session = load(&Batch { text: text.into(), programs: 3, tabled: false });
    let program = &session.machine.program;
    for number in 0..3 {
        let mut engine = Engine::new(question(&session, number), &[], View::default(), false);
        let mut most = 0;
        loop {
            let mut fuel = 10_000;
            match engine.run(program, &mut fuel) {
                Ok(Step::Fuel) => most = most.max(engine.bytes()),
                Ok(Step::Answer) => break,
                _ => panic!("program {number} has an answer"),
            }
        }
        assert!(most < 10_000_000, "program {number} takes {most} bytes");
    }
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

/// Terms that share their parts are small, and enormous when somebody goes through them: that is a failure.
#[test]
fn terms_that_are_enormous_are_failures() {
    let text = "d(0, a).\n\
        d(N, f(X, X)) :- N > 0, M is N - 1, d(M, X).\n\
        n(0, a) :- !.\n\
        n(N, f(X)) :- M is N - 1, n(M, X).\n\
        t0w(X) :- d(60, X).\n\
        t1w(a) :- d(60, X), d(60, Y), X = Y.\n\
        t2w(L) :- findall(X, d(60, X), L).\n\
        t3w(a) :- d(60, X), X = f(X, _).\n\
        t4w(X) :- X = f(Y), Y = g(X).\n\
        t5w(a) :- n(300000, X), n(300000, Y), X = Y, findall(X, X = Y, [Z]), Z == Y.\n";
    let session = load(&Batch { text: text.into(), programs: 6, tabled: false });
    let program = &session.machine.program;
    let said: Vec<&str> = (0..6)
        .map(|number| {
            let mut engine = Engine::new(question(&session, number), &[], View::default(), false);
            match engine.run(program, &mut 10_000_000) {
                Ok(Step::Answer) if engine.answer().is_ok() => "an answer",
                Ok(Step::Answer) => "too large to be shown",
                Ok(Step::No) => "no",
                Ok(_) => "not finished",
                Err(_) => "too large",
            }
        })
        .collect();
    let wanted = ["too large to be shown", "too large", "too large", "no", "no", "an answer"];
    assert_eq!(said, wanted);
}
