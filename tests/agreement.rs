//! Random programs give the same tree, and print the same, on the machine and on the [`crate::oracle`].

use crate::oracle::both::{Verdict, compare};
use crate::oracle::random::random_program;
use crate::oracle::seeds::{report, shown};
use crate::oracle::with_large_stack;

/// How many programs are compared.
const PROGRAMS: u64 = 10_000;

/// How many programs of some seeds were compared, and which differ.
fn compared(seeds: impl Iterator<Item = u64>) -> (u64, Vec<u64>) {
    let mut compared = 0;
    let mut different = Vec::new();
    for seed in seeds {
        match compare(&random_program(seed), seed) {
            Verdict::Same(_) => compared += 1,
            Verdict::Different(..) => different.push(seed),
            Verdict::Errors(errors) => {
                panic!("seed {seed} has errors:\n{errors}\n{}", random_program(seed))
            }
            Verdict::NotCompared(_) => {}
        }
    }
    (compared, different)
}

#[test]
fn machine_and_oracle_agree_on_random_programs() {
    with_large_stack(|| {
        let (compared, different) = compared(0..PROGRAMS);
        assert!(compared * 10 > PROGRAMS * 9, "only {compared} programs could be compared");
        println!("{} programs differ: {different:?}", different.len());
        if !different.is_empty() {
            panic!("{} programs differ, the first of them:\n{}", different.len(), report(different[0]));
        }
    });
}

/// Prints what both make of the programs of some seeds, or of those of so many that differ:
/// `SEEDS="8 44" cargo test --test language agreement::reports -- --ignored --nocapture`, `SEEDS=5000..9000`,
/// `SEEDS=some/file.plan` for a program that somebody has written, `SEEDS=some/file.plan@44` with a seed.
#[test]
#[ignore = "a tool for whoever looks for a difference"]
fn reports() {
    const SHOWN: usize = 4;
    let seeds = std::env::var("SEEDS").unwrap_or_default();
    with_large_stack(|| {
        if let Some((from, to)) = seeds.split_once("..").filter(|(from, _)| from.parse::<u64>().is_ok()) {
            let number = |text: &str| text.parse().expect("a seed is a number");
            let (compared, different) = compared(number(from)..number(to));
            println!("{compared} the same, {} differ: {different:?}", different.len());
            different.iter().take(SHOWN).for_each(|seed| println!("{}", report(*seed)));
            return;
        }
        for word in seeds.split_whitespace() {
            match word.parse() {
                Ok(seed) => println!("{}", report(seed)),
                Err(_) => {
                    let (file, seed) = word.split_once('@').unwrap_or((word, "0"));
                    let program = std::fs::read_to_string(file).expect("it is a file");
                    println!("{word}\n{}", shown(&program, seed.parse().expect("a seed is a number")));
                }
            }
        }
    });
}
