//! Random programs give the same tree, and print the same, on the machine and on the [`crate::oracle`].

use crate::oracle::both::{Verdict, compare};
use crate::oracle::random::random_program;
use crate::oracle::seeds::report;
use crate::oracle::with_large_stack;

/// How many programs are compared.
const PROGRAMS: u64 = 10_000;

/// FIXME: so many of these still differ (seeds 2705 and 9767), both where handlers run again for what
/// was put off in functions that have returned. To be settled by `vm/OBLIGATIONS.md`; then this is 0.
const MOST_DIFFERENT: usize = 2;

#[test]
fn machine_and_oracle_agree_on_random_programs() {
    with_large_stack(|| {
        let mut compared = 0;
        let mut different = Vec::new();
        for seed in 0..PROGRAMS {
            match compare(&random_program(seed), seed) {
                Verdict::Same(_) => compared += 1,
                Verdict::Different(..) => different.push(seed),
                Verdict::Errors(errors) => {
                    panic!("seed {seed} has errors:\n{errors}\n{}", random_program(seed))
                }
                Verdict::NotCompared(_) => {}
            }
        }
        assert!(compared * 10 > PROGRAMS * 9, "only {compared} programs could be compared");
        println!("{} programs differ: {different:?}", different.len());
        if different.len() > MOST_DIFFERENT {
            panic!("{} programs differ, the first of them:\n{}", different.len(), report(different[0]));
        }
    });
}

/// Prints what both make of the programs of some seeds:
/// `SEEDS="8 44" cargo test --test language reports -- --ignored --nocapture`.
#[test]
#[ignore = "a tool for whoever looks for a difference"]
fn reports() {
    let seeds = std::env::var("SEEDS").unwrap_or_default();
    let seeds: Vec<u64> = seeds.split_whitespace().filter_map(|seed| seed.parse().ok()).collect();
    with_large_stack(|| seeds.iter().for_each(|seed| println!("{}", report(*seed))));
}
