//! Robots at work over many seeds: what may go wrong ends in a failure that says so, and actions change what their
//! types say.
//!
//! How many runs succeed is measured by `cargo bench --bench transport`, not here: here each has to end well or honestly.

use pleach::{Ended, Options, Session};
use vm::value::Symbol;

use crate::expected::report;

/// The examples that perform actions.
const EXAMPLES: [&str; 7] = [
    "13-transport",
    "14-four-objects",
    "15-set-table",
    "16-tidy-up",
    "17-fridge",
    "18-two-arms",
    "19-own-room",
];
const SEEDS: std::ops::Range<u64> = 1..4;

/// The program with another `main`, whose value is what the types of its actions do not say.
fn audited(example: &str) -> String {
    let file = format!("examples/{example}/main.plan");
    let text = std::fs::read_to_string(&file).expect("the example is there");
    let text = text.replace("(def-plan main ()", "(def-plan work ()");
    format!("(use action)\n{text}\n(def-plan main () (record-world) (work) (effect-mistakes))\n")
}

#[test]
fn runs_end_well_or_honestly_and_actions_do_what_their_types_say() {
    let mut problems = Vec::new();
    let mut well = 0;
    for example in EXAMPLES {
        let text = audited(example);
        for seed in SEEDS {
            let mut session = Session::new(Options { seed, ..Options::default() });
            let loaded = session.load_text("work.plan", &text);
            let mut printed = String::new();
            match session.run(loaded, Some("main"), &mut printed) {
                Ended::Ran(Ok(mistakes)) if mistakes.is_nil() => well += 1,
                Ended::Ran(Ok(mistakes)) => {
                    problems.push(format!(
                        "{example}, seed {seed}: {}",
                        crate::program::text_of(&session, &mistakes)
                    ));
                }
                Ended::Ran(Err(failure)) => {
                    let types = &session.machine.program.failures;
                    let honest = failure.as_failure().is_some_and(|it| {
                        let says = |(field, value): &(Symbol, vm::Value)| {
                            *field == "message" && value.as_str().is_some_and(|text| text.contains("tries"))
                        };
                        types.is_named(it.kind, Symbol::from("action-failure")) && it.fields.iter().any(says)
                    });
                    if !honest {
                        problems.push(format!("{example}, seed {seed} ends with {failure:?}"));
                    }
                }
                _ => problems.push(format!("{example} was not run")),
            }
        }
    }
    report(&problems);
    assert!(well * 10 >= 7 * EXAMPLES.len() * SEEDS.count(), "only {well} runs ended well");
}
