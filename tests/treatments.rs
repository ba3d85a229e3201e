//! Treatments: other ways to run a program that must give the same output and the same records.
//!
//! Formatted; stopped and continued; run again from its log; stopped, and resumed from the log of
//! what came before the stop; on the oracle.

use std::path::{Path, PathBuf};

use crate::expected::difference;
use crate::oracle::both::{Verdict, compare};
use crate::oracle::with_large_stack;
use crate::program::{Program, Ran, Stops, files_below};

/// Programs that take no more fuel are stopped at each step.
const FEW_STEPS: u64 = 2_000;
/// How often others are stopped.
const STOPS: u64 = 5;

/// In what a program under a treatment differs from its plain run.
pub fn differences(program: &Program, plain: &Ran) -> Vec<String> {
    let mut problems = Vec::new();
    let mut check = |treatment: &str, other: &Ran| {
        if let Some(what) = difference_of(plain, other) {
            problems.push(format!("{} {treatment}:\n{what}", program.path.display()));
        }
    };
    let replayed = program.run(&Stops::Never, Some(plain.log.clone()));
    check("run again from its log", &replayed);
    if program.text.contains("(def-rules") || program.text.contains("(use-rules") {
        check("with garbage collected", &program.tidy().run(&Stops::Never, None));
    }
    let stops = match plain.steps {
        0..FEW_STEPS => Stops::Always,
        steps => Stops::At((1..=STOPS).map(|n| draw(&program.path, n) % steps).collect()),
    };
    let stops = sorted(stops);
    check(&format!("with stops {stops:?}"), &program.run(&stops, Some(plain.log.clone())));
    let stop = draw(&program.path, 0) % plain.steps.max(1);
    let log = program.log_until(stop);
    assert!(plain.log.entries.len() >= log.entries.len(), "{}", program.path.display());
    if log.entries.len() == plain.log.entries.len() {
        check(&format!("resumed from step {stop}"), &program.run(&Stops::Never, Some(log)));
    }
    check(
        "formatted",
        &program.moved_to(formatted(&program.path)).run(&Stops::Never, Some(plain.log.clone())),
    );
    if program.compared {
        problems.extend(on_the_oracle(program).map(|what| format!("{} {what}", program.path.display())));
    }
    problems
}

/// In what the oracle's run differs from the machine's; nothing if the oracle cannot run the program.
fn on_the_oracle(program: &Program) -> Option<String> {
    let (text, seed) = (&program.text, program.seed());
    let (machine, oracle) = match with_large_stack(|| compare(text, seed)) {
        Verdict::Different(machine, oracle) => (machine, oracle),
        Verdict::Errors(errors) => return Some(format!("has errors:\n{errors}")),
        Verdict::Same(_) | Verdict::NotCompared(_) => return None,
    };
    let parts = [
        ("outcome", machine.outcome, oracle.outcome),
        ("output", machine.output, oracle.output),
        ("tree", machine.tree, oracle.tree),
    ];
    let (part, machine, oracle) = parts.into_iter().find(|(_, machine, oracle)| machine != oracle)?;
    Some(format!("on the oracle, {part} (expected is the machine's):\n{}", difference(&machine, &oracle)))
}

fn sorted(stops: Stops) -> Stops {
    match stops {
        Stops::At(mut stops) => {
            stops.sort_unstable();
            Stops::At(stops)
        }
        other => other,
    }
}

/// A number for a program, the same in each run of the tests.
fn draw(path: &Path, n: u64) -> u64 {
    vm::random::mix(vm::random::hash_text(&path.display().to_string()) ^ n)
}

fn difference_of(plain: &Ran, other: &Ran) -> Option<String> {
    if plain.printed != other.printed {
        return Some(format!("printed\n{}", difference(&plain.printed, &other.printed)));
    }
    let (plain, other) = (plain.records.join("\n"), other.records.join("\n"));
    (plain != other).then(|| difference(&plain, &other))
}

/// The program as the formatter writes it, in a folder with all that it may use, formatted as well.
fn formatted(path: &Path) -> PathBuf {
    let folder = path.parent().expect("a program is in a folder");
    let name = path.file_name().expect("a program has a name");
    let area = folder.file_name().expect("an area has a name");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("formatted").join(area);
    // Beside it may be what it uses.
    for file in files_below(folder, ".plan") {
        let text = std::fs::read_to_string(&file).expect("it was listed");
        let text = grammar::format(&text).unwrap_or_else(|errors| panic!("{}: {errors:?}", file.display()));
        assert_eq!(grammar::format(&text).as_ref(), Ok(&text), "{} formatted twice", file.display());
        let copy = target.join(file.strip_prefix(folder).expect("it is below"));
        std::fs::create_dir_all(copy.parent().expect("it has a folder")).expect("folders can be made");
        std::fs::write(&copy, text).expect("files can be written");
    }
    for file in files_below(folder, ".pl") {
        let copy = target.join(file.strip_prefix(folder).expect("it is below"));
        std::fs::create_dir_all(copy.parent().expect("it has a folder")).expect("folders can be made");
        std::fs::copy(&file, &copy).expect("files can be copied");
    }
    target.join(name)
}
