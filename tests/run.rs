//! Programs that run: `run/<area>/NAME.plan`, and beside each `NAME.expected` with what it prints,
//! how it ends and the tree that it grows. Files in folders of an area are what its programs use.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use grammar::{Form, FormKind};
use pleach::{Options, Session};

use crate::expected::{check_file, report};
use crate::program::{Program, Ran, Stops, files_below};
use crate::treatments;

/// Runs each program of an area, plainly and under all treatments.
#[track_caller]
fn check_area(area: &str) {
    let folder = Path::new("tests/run").join(area);
    let mut problems = Vec::new();
    for path in programs(&folder) {
        let program = Program::read(&path);
        let ran = program.run(&Stops::Never, None);
        let checked = check_file(&path.with_extension("expected"), &sections(&ran));
        problems.extend(checked.err());
        if ran.failure.as_deref() == Some("errors") {
            problems.push(format!("{} has errors:\n{}", path.display(), ran.diagnostics));
        } else if program.treated {
            problems.extend(treatments::differences(&program, &ran));
        }
    }
    report(&problems);
}

/// The programs of an area, without the files that they use.
fn programs(folder: &Path) -> Vec<PathBuf> {
    files_below(folder, ".plan").into_iter().filter(|path| path.parent() == Some(folder)).collect()
}

fn sections(ran: &Ran) -> String {
    let parts = [
        ("stdout", &ran.printed),
        ("diagnostics", &ran.diagnostics),
        ("outcome", &ran.outcome),
        ("tree", &ran.tree),
    ];
    let mut text = String::new();
    for (name, part) in parts.into_iter().filter(|(_, part)| !part.is_empty()) {
        text += &format!("--- {name}\n{part}");
        if !part.ends_with('\n') {
            text += "⏎\n";
        }
    }
    text
}

macro_rules! areas {
    ($($name:ident $folder:literal;)+) => {
        const AREAS: &[&str] = &[$($folder),+];
        $(#[test] fn $name() { check_area($folder); })+
    };
}

areas! {
    values "values";
    numbers "numbers";
    strings "strings";
    lists "lists";
    maps "maps";
    vectors "vectors";
    control "control";
    functions "functions";
    macros "macros";
    modules "modules";
    descriptions "descriptions";
    failures "failures";
    retries "retries";
    clean_up "clean-up";
    tasks "tasks";
    trees "trees";
    edits "edits";
    limits "limits";
    replay "replay";
    rules "rules";
    world "world";
    pick_place "pick-place";
    transformations "transformations";
}

#[test]
fn each_folder_is_an_area() {
    let folders = std::fs::read_dir("tests/run")
        .expect("the programs are there")
        .map(|entry| entry.expect("a folder can be listed").file_name().to_string_lossy().into_owned());
    let folders: BTreeSet<String> = folders.collect();
    let areas: BTreeSet<String> = AREAS.iter().map(|area| area.to_string()).collect();
    assert_eq!(folders, areas);
}

#[test]
fn each_expectation_has_a_program() {
    for path in files_below(Path::new("tests/run"), ".expected") {
        assert!(path.with_extension("plan").exists(), "{}", path.display());
    }
}

#[test]
fn each_program_says_what_must_hold() {
    for path in AREAS.iter().flat_map(|area| programs(&Path::new("tests/run").join(area))) {
        let text = std::fs::read_to_string(&path).expect("it was listed");
        let comment =
            text.lines().find(|line| !line.starts_with(";!")).is_some_and(|line| line.starts_with("; "));
        assert!(comment, "{} begins with a comment", path.display());
    }
}

/// Every list head and every symbol in the programs.
fn words(files: &[PathBuf]) -> (BTreeSet<String>, BTreeSet<String>) {
    let (mut heads, mut names) = (BTreeSet::new(), BTreeSet::new());
    for path in files {
        let text = std::fs::read_to_string(path).expect("it was listed");
        let mut todo: Vec<Form> = grammar::parse(grammar::FileId(0), &text).forms;
        while let Some(form) = todo.pop() {
            heads.extend(form.head().map(|head| head.to_string()));
            match form.kind {
                FormKind::Symbol(name) => drop(names.insert(name.to_string())),
                FormKind::List(items) | FormKind::Vector(items) => todo.extend(items),
                FormKind::Map(pairs) => todo.extend(pairs.into_iter().flat_map(|(key, value)| [key, value])),
                FormKind::Prefixed(prefix, inner) => {
                    heads.insert(prefix.name().into());
                    todo.push(*inner);
                }
                _ => {}
            }
        }
    }
    (heads, names)
}

#[test]
fn each_special_form_runs_somewhere() {
    let (heads, _) = words(&files_below(Path::new("tests/run"), ".plan"));
    let missing: Vec<&str> = compiler::special_forms()
        .iter()
        .map(|(name, _)| *name)
        .filter(|name| !heads.contains(*name))
        .collect();
    assert_eq!(missing, [""; 0]);
}

#[test]
fn each_type_of_failures_occurs_somewhere() {
    let (_, names) = words(&files_below(Path::new("tests/run"), ".plan"));
    let expected: String = files_below(Path::new("tests/run"), ".expected")
        .iter()
        .map(|path| std::fs::read_to_string(path).expect("it was listed"))
        .collect();
    let occurs = |name: &str| names.contains(name) || expected.contains(&format!("failed: {name}"));
    let missing: Vec<&str> =
        vm::Builtin::ALL.iter().map(|kind| kind.name()).filter(|name| !occurs(name)).collect();
    assert_eq!(missing, [""; 0]);
}

/// The only test that looks at the clock on the wall: a run in real time takes as long as it says.
#[test]
fn a_run_in_real_time_takes_its_time() {
    let begun = std::time::Instant::now();
    let mut session = Session::new(Options { real_time: true, ..Options::default() });
    let run = session.run_text("real.plan", "(def-plan main () (par (sleep 0.3) (sleep 0.2)) (print (now)))");
    assert_eq!(run.printed, "0.3\n");
    let took = begun.elapsed().as_secs_f64();
    assert!((0.3..10.0).contains(&took), "took {took} s");
}
