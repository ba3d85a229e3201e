//! The report of a random program that tells the two apart.

use super::both::{Seen, Verdict, compare};
use super::random::random_program;
use super::shrink::shrink;

/// The program of a seed, as small as it could be made, and what both make of it.
#[must_use]
pub fn report(seed: u64) -> String {
    report_of("", &random_program(seed), seed)
}

/// The same for any program, after a head that stays as it is.
#[must_use]
pub fn report_of(head: &str, program: &str, seed: u64) -> String {
    let compared = |program: &str| compare(&format!("{head}{program}"), seed);
    let small = shrink(program, |program| matches!(compared(program), Verdict::Different(..)));
    let small = grammar::format(&small).unwrap_or(small);
    match compared(&small) {
        Verdict::Different(machine, oracle) => {
            format!("seed {seed}\n{small}\n{}", differences(&machine, &oracle))
        }
        other => format!("seed {seed} does not show it again: {other:?}"),
    }
}

/// What both make of a program.
#[must_use]
pub fn shown(program: &str, seed: u64) -> String {
    match compare(program, seed) {
        Verdict::Same(seen) => format!("the same\n{}\n{}{}", seen.outcome, seen.output, seen.tree),
        Verdict::Different(machine, oracle) => differences(&machine, &oracle),
        Verdict::Errors(why) | Verdict::NotCompared(why) => why,
    }
}

/// The lines of both, those that differ marked.
fn differences(machine: &Seen, oracle: &Seen) -> String {
    let text = |seen: &Seen| format!("{}\n{}{}", seen.outcome, seen.output, seen.tree);
    let (machine, oracle) = (text(machine), text(oracle));
    let marked = |lines: &str, others: &str| {
        let line = |line: &str| {
            format!("{} {line}\n", if others.lines().any(|other| other == line) { " " } else { ">" })
        };
        lines.lines().map(line).collect::<String>()
    };
    format!("---- machine\n{}---- oracle\n{}", marked(&machine, &oracle), marked(&oracle, &machine))
}
