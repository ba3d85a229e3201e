//! Programs in documents: examples in docstrings, `examples/`, blocks of Markdown files.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use compiler::Report;
use compiler::module::is_private;
use grammar::{FileId, Form};
use pleach::{Ended, Options, Session};

use crate::expected::{check_file, report};
use crate::program::{Program, Stops, files_below, text_of};

// ---------------------------------------------------------------------------------------------
// Docstrings

/// `ex: form => written value` and `ex! form => failure type`.
fn examples(doc: &str) -> Vec<(bool, &str, &str)> {
    let lines = doc.lines().map(str::trim_start);
    let examples = lines.filter_map(|line| {
        let (fails, rest) = match line.strip_prefix("ex: ") {
            Some(rest) => (false, rest),
            None => (true, line.strip_prefix("ex! ")?),
        };
        let (form, value) = rest.rsplit_once("=> ")?;
        Some((fails, form.trim_end(), value.trim_end()))
    });
    examples.collect()
}

/// Runs text in the module of the session. The value as text, or what is wrong.
fn evaluate(session: &mut Session, text: &str) -> Result<String, Wrong> {
    let loaded = session.extend("example", text);
    if !loaded.reports.iter().all(Report::is_warning) {
        return Err(Wrong::Errors(loaded.reports.iter().map(|report| session.report(report)).collect()));
    }
    let mut value = vm::Value::NIL;
    for init in loaded.init {
        value = session.call(init, Vec::new(), &mut String::new()).map_err(Wrong::Failure)?;
    }
    Ok(text_of(session, &value))
}

enum Wrong {
    Errors(String),
    Failure(vm::Value),
}

#[test]
fn examples_in_docstrings_give_what_they_say() {
    let mut session = Session::new(Options::default());
    for module in [
        "world",
        "location",
        "action",
        "pick-place",
        "statistics",
        "transformation",
        "household",
        "experiment",
    ] {
        let used = evaluate(&mut session, &format!("(use {module})"));
        assert!(used.is_ok(), "{module} is a module of the library");
    }
    let docs: Vec<(String, String)> = session
        .front
        .modules
        .iter()
        .flat_map(|(_, module)| module.names.iter())
        .filter_map(|(name, definition)| Some((name.to_string(), definition.doc.as_ref()?.to_string())))
        .collect();
    let mut problems = Vec::new();
    let mut count = 0;
    for (name, doc) in &docs {
        let lines = doc.lines().filter(|line| line.trim_start().starts_with("ex")).count();
        let examples = examples(doc);
        if examples.len() != lines {
            problems.push(format!("{name}: an example is not written `ex: form => value`"));
        }
        for (fails, form, expected) in examples {
            count += 1;
            if let Err(why) = check_example(&mut session, fails, form, expected) {
                problems.push(format!("{name}: {form}: {why}"));
            }
        }
    }
    assert!(count > 300, "only {count} examples");
    report(&problems);
}

fn check_example(session: &mut Session, fails: bool, form: &str, expected: &str) -> Result<(), String> {
    match evaluate(session, form) {
        Ok(value) if !fails && value == expected => Ok(()),
        Ok(value) => Err(format!("expected {expected}, got {value}")),
        Err(Wrong::Errors(text)) => Err(text),
        Err(Wrong::Failure(failure)) => {
            let it = failure.as_failure().expect("what is raised is a failure");
            let wanted = session.machine.program.failures.find(expected.into());
            match wanted {
                Some(wanted) if fails && session.machine.program.failures.is_a(it.kind, wanted) => Ok(()),
                _ => Err(format!("expected {expected}, got the failure {failure:?}")),
            }
        }
    }
}

// ---------------------------------------------------------------------------------------------
// examples/

#[test]
fn examples_print_what_stands_beside_them() {
    let mut problems = Vec::new();
    for path in files_below(Path::new("examples"), ".plan") {
        let mut program = Program::read(&path);
        // Why edits are refused or not applied the oracle says in other words.
        program.compared &= !program.text.contains("edit-refused");
        let ran = program.run(&Stops::Never, None);
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let must_fail = name.contains("error") || program.text.starts_with("; fails");
        if must_fail != ran.failure.is_some() {
            problems.push(format!("{} ended with {}", path.display(), ran.outcome));
        }
        let expected = match name.as_str() {
            "main.plan" => path.with_file_name("expected.txt"),
            _ => path.with_extension("txt"),
        };
        let text = if must_fail { ran.printed.clone() + &ran.outcome } else { ran.printed.clone() };
        // Files that others use print nothing.
        if !text.is_empty() || expected.exists() {
            problems.extend(check_file(&expected, &text).err());
        }
        problems.extend(crate::treatments::differences(&program, &ran));
    }
    report(&problems);
}

#[test]
fn examples_and_the_library_are_formatted() {
    let mut problems = Vec::new();
    for folder in ["examples", "stdlib/plans", "stdlib/world", "src/evaluate"] {
        for path in files_below(Path::new(folder), ".plan") {
            let text = std::fs::read_to_string(&path).expect("it was listed");
            if grammar::format(&text).is_ok_and(|formatted| formatted != text) {
                problems.push(format!("{} is not formatted", path.display()));
            }
        }
    }
    report(&problems);
}

// ---------------------------------------------------------------------------------------------
// Markdown

/// A fenced block: the words after the fence, the number of its first line, its text.
struct Block {
    mark: String,
    line: usize,
    text: String,
}

fn blocks(text: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut open: Option<(Block, String)> = None;
    for (number, line) in text.lines().enumerate() {
        let trimmed = line.trim_start();
        let ticks: String = trimmed.chars().take_while(|c| *c == '`').collect();
        match &mut open {
            Some((_, fence)) if !ticks.is_empty() && trimmed == ticks && ticks.len() >= fence.len() => {
                blocks.extend(open.take().map(|(block, _)| block));
            }
            Some((block, _)) => block.text += &format!("{line}\n"),
            None if ticks.len() >= 3 => {
                let mark = trimmed[ticks.len()..].trim().to_string();
                open = Some((Block { mark, line: number + 2, text: String::new() }, ticks));
            }
            None => {}
        }
    }
    blocks
}

/// Files of the repository that people read.
fn documents() -> Vec<PathBuf> {
    let folders = ["grammar", "compiler", "vm", "stdlib", "src", "examples", "tests"];
    let mut files: Vec<PathBuf> =
        folders.iter().flat_map(|folder| files_below(Path::new(folder), ".md")).collect();
    let top =
        std::fs::read_dir(".").expect("the root can be listed").map(|entry| entry.expect("it can").path());
    files.extend(top.filter(|path| path.extension().is_some_and(|end| end == "md")));
    files.sort();
    files
}

#[test]
fn blocks_in_documents_run() {
    let mut problems = Vec::new();
    for path in documents() {
        let text = std::fs::read_to_string(&path).expect("it was listed");
        for block in blocks(&text) {
            let checked = match block.mark.as_str() {
                "pleach" => check_block(&block.text),
                "pleach,fails" => check_failing(&block.text),
                _ => Ok(()),
            };
            if let Err(why) = checked {
                problems.push(format!("{}:{}: {why}", path.display(), block.line));
            }
        }
    }
    report(&problems);
}

/// Runs a block; the values that `; => value` comments say are compared.
fn check_block(text: &str) -> Result<(), String> {
    let mut session = Session::new(Options::default());
    let parsed = grammar::parse(FileId(0), text);
    let mut start = 0;
    for form in &parsed.forms {
        let Some(expected) = said_value(text, form) else { continue };
        let end = form.span.end as usize;
        let value = evaluate(&mut session, &text[start..end]).map_err(|wrong| show(&session, wrong))?;
        if value != expected {
            return Err(format!("{} is {value}, not {expected}", &text[form.span.start as usize..end]));
        }
        start = end;
    }
    if start > 0 {
        return evaluate(&mut session, &text[start..]).map(drop).map_err(|wrong| show(&session, wrong));
    }
    let run = session.run_text("block.plan", text);
    run.outcome.map(drop)
}

/// What the comment after a form says that its value is: on its last line, or on the next.
fn said_value<'t>(text: &'t str, form: &Form) -> Option<&'t str> {
    let rest = text.get(form.span.end as usize..)?;
    let rest = rest.trim_start_matches([' ', ')']);
    let line = rest.strip_prefix('\n').unwrap_or(rest).lines().next()?;
    line.trim_start().trim_start_matches(';').strip_prefix(" => ").map(str::trim_end)
}

fn show(session: &Session, wrong: Wrong) -> String {
    match wrong {
        Wrong::Errors(text) => text,
        Wrong::Failure(failure) => pleach::render::failure(&session.files, &failure),
    }
}

fn check_failing(text: &str) -> Result<(), String> {
    let mut options = Options::default();
    options.limits.fuel = 10_000_000;
    let mut session = Session::new(options);
    let loaded = session.load_text("block.plan", text);
    if !loaded.reports.is_empty() {
        return Ok(());
    }
    match session.run(loaded, None, &mut String::new()) {
        Ended::Ran(Ok(_)) => Err("it has no error and does not fail".into()),
        _ => Ok(()),
    }
}

// ---------------------------------------------------------------------------------------------
// The reference names everything

const REFERENCE: &str = "grammar/REFERENCE.md";

/// The parts of a text between backticks; the text in them may have fewer of these.
fn spans(text: &str) -> Vec<&str> {
    let mut spans = Vec::new();
    let mut rest = text;
    while let Some(start) = rest.find('`') {
        let count = rest[start..].chars().take_while(|c| *c == '`').count();
        let (fence, inner) = rest[start..].split_at(count);
        let Some((span, after)) = inner.split_once(fence) else { break };
        spans.push(span);
        rest = after;
    }
    spans
}

/// All words in the code of a document: in its blocks, and between backticks.
fn words_in_code(text: &str) -> BTreeSet<String> {
    let letter = |c: char| c.is_alphanumeric() || "/?!*<>=+-_%&.:@~^$".contains(c);
    let code = blocks(text).into_iter().map(|block| block.text);
    let code = code.chain(text.lines().flat_map(spans).map(String::from));
    code.flat_map(|code| code.split(|c| !letter(c)).map(String::from).collect::<Vec<_>>()).collect()
}

#[test]
fn reference_names_each_special_form_and_each_type_of_failures() {
    let text = std::fs::read_to_string(REFERENCE).expect("it is there");
    let words = words_in_code(&text);
    let forms = compiler::special_forms().iter().map(|(name, _)| *name);
    let types = vm::Builtin::ALL.iter().map(|kind| kind.name());
    let missing: Vec<&str> = forms.chain(types).filter(|name| !words.contains(*name)).collect();
    assert_eq!(missing, [""; 0]);
}

/// The tables of the library have a row for a name, with how it is called and what it is documented as.
fn is_in_table(chapter: &str, name: &str, doc: &str) -> bool {
    let heads = [format!("| `({name} "), format!("| `({name})"), format!("| `{name}`")];
    let said = format!(" | {} |", doc.lines().next().unwrap_or_default());
    chapter.lines().any(|line| line.ends_with(&said) && heads.iter().any(|head| line.starts_with(head)))
}

#[test]
fn reference_has_a_line_for_each_name_of_the_library() {
    let text = std::fs::read_to_string(REFERENCE).expect("it is there");
    let modules = &Session::new(Options::default()).front.modules;
    let mut problems = Vec::new();
    for module in modules.prelude.iter().map(|id| modules.get(*id)) {
        let heading = format!("\n### {}\n", module.name);
        let rest = text.split_once(&heading).map_or("", |(_, rest)| rest);
        let chapter = rest.split("\n#").next().unwrap_or_default();
        for (name, definition) in module.names.iter().filter(|(name, _)| !is_private(**name)) {
            let doc = definition.doc.as_deref().unwrap_or_default();
            if !is_in_table(chapter, name.as_str(), doc) {
                problems.push(format!("{REFERENCE} has no line for `{name}` of {}: {doc}", module.name));
            }
        }
    }
    report(&problems);
}
