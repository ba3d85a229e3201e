//! `pleach test`: runs the tests that plan files define, each in a world of its own.

use std::path::{Path, PathBuf};

use clap::Args;
use compiler::Report;
use compiler::module::Meaning;
use pleach::session::Output;
use pleach::{Options, Session};
use serde_json::{Value as Json, json};
use vm::code::FnId;
use vm::machine::Progress;
use vm::value::{Symbol, Value};

use super::settings::Settings;
use super::{
    Answer, ERRORS, FAILED, INTERRUPTED, Paths, Trouble, count, files, interrupt, json, report, term,
};

pub const HELP: &str = "\
Examples:
  pleach test kitchen.plan
  pleach test plans/ --filter grasp

A test is a form (def-test name \"doc\" body…). It fails if a failure leaves it, above all one of
(expect expression) and (expect-failure type body…). Each test runs in a fresh session after its
file has been loaded. What tests print is shown if they fail.

--json prints one object: {passed: N, failed: N, tests: [{name, file, line, outcome, printed,
failure}], errors: [{severity, code, message, …}]}.
Exit codes: 0 all passed · 1 some failed · 2 a file has errors.";

/// `pleach test`
#[derive(Args)]
pub struct Test {
    #[command(flatten)]
    paths: Paths,
    /// Run only the tests whose names contain this
    #[arg(long, value_name = "TEXT", default_value = "")]
    filter: String,
    /// Print the results as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    settings: Settings,
}

/// What has been found so far.
#[derive(Default)]
struct Tally {
    passed: usize,
    failed: usize,
    /// Files that could not be loaded.
    broken: usize,
    tests: Vec<Json>,
    errors: Vec<Json>,
}

/// What a test printed.
#[derive(Default)]
struct Printed(String);

impl Output for Printed {
    fn print(&mut self, text: &str) {
        self.0.push_str(text);
    }
    fn goes_on(&mut self) -> bool {
        !interrupt::asked()
    }
}

/// Runs tests.
pub fn run(it: &Test) -> Answer {
    interrupt::listen();
    let options = it.settings.options(term::out_style())?;
    let mut tally = Tally::default();
    for path in files::plans(&it.paths.paths)? {
        test_file(it, &options, &path, &mut tally);
        if interrupt::asked() {
            return Ok(INTERRUPTED);
        }
    }
    let Tally { passed, failed, broken, tests, errors } = tally;
    if it.json {
        term::say(&format!(
            "{}\n",
            json!({"passed": passed, "failed": failed, "tests": tests, "errors": errors})
        ));
    } else {
        if broken > 0 {
            term::say(&format!("{} could not be tested\n", count(broken, "file")));
        }
        term::say(&format!("{passed} passed, {failed} failed\n"));
    }
    Ok(match (broken, failed) {
        (0, 0) => 0,
        (0, _) => FAILED,
        _ => ERRORS,
    })
}

/// Why a file cannot be tested.
struct Broken {
    reports: Vec<Report>,
    /// What left one of its top-level forms.
    failure: Option<Value>,
}

/// A session with the file loaded and its top-level forms run.
fn load(options: &Options, path: &Path) -> (Session, Result<(), Broken>) {
    let mut session = Session::new(options.clone());
    let loaded = match session.load_file(path) {
        Ok(loaded) => loaded,
        // It could be opened a moment ago.
        Err(why) => return (session, Err(Broken { reports: Vec::new(), failure: Some(Value::str(why)) })),
    };
    if !loaded.reports.iter().all(Report::is_warning) {
        return (session, Err(Broken { reports: loaded.reports, failure: None }));
    }
    for init in loaded.init {
        if let Progress::Ended(Err(failure)) = session.call_until(init, Vec::new(), &mut Printed::default()) {
            return (session, Err(Broken { reports: Vec::new(), failure: Some(failure) }));
        }
    }
    (session, Ok(()))
}

fn test_file(it: &Test, options: &Options, path: &Path, tally: &mut Tally) {
    if let Err(trouble) = readable(path) {
        tally.broken += 1;
        tally.errors.push(json!({"severity": "error", "message": trouble.what, "file": path}));
        return if it.json {
        } else {
            term::say(&term::trouble(&trouble))
        };
    }
    let (session, loaded) = load(options, path);
    if let Err(why) = loaded {
        return broken(it, &session, &why, tally);
    }
    let tests = tests(&session, &it.filter);
    if !it.json {
        term::say(&format!("{}: {}\n", path.display(), count(tests.len(), "test")));
    }
    // The session that listed the tests is as good as new for the first of them.
    let mut fresh = Some(session);
    for (name, _) in tests {
        match fresh.take().map_or_else(|| load(options, path), |session| (session, Ok(()))) {
            (session, Ok(())) => test_one(it, session, path, name, tally),
            (session, Err(why)) => broken(it, &session, &why, tally),
        }
        if interrupt::asked() {
            return;
        }
    }
    if !it.json {
        term::say("\n");
    }
}

fn readable(path: &Path) -> Result<(), Trouble> {
    std::fs::File::open(path).map(drop).map_err(|error| {
        files::unreadable(path, format!("cannot read {}: {}", path.display(), pleach::files::why(&error)))
    })
}

/// The tests of the user's module, in the order of its text.
fn tests(session: &Session, filter: &str) -> Vec<(Symbol, u32)> {
    let names = &session.front.modules.get(session.module).names;
    let tests =
        names.iter().filter(|(name, it)| matches!(it.meaning, Meaning::Test(_)) && name.contains(filter));
    let mut tests: Vec<(Symbol, u32)> = tests.map(|(name, it)| (*name, it.span.start)).collect();
    tests.sort_by_key(|(_, start)| *start);
    tests
}

/// A file that cannot be loaded: all that is wrong with it.
fn broken(it: &Test, session: &Session, why: &Broken, tally: &mut Tally) {
    let Broken { reports, failure } = why;
    tally.broken += 1;
    tally.errors.extend(reports.iter().map(|report| json::report(&session.files, report)));
    if let Some(failure) = failure {
        let message = "a top-level form failed when the file was loaded";
        let failure = json::failure(&session.files, &session.machine.program, failure);
        tally.errors.push(json!({"severity": "error", "message": message, "failure": failure}));
    }
    if it.json {
        return;
    }
    reports.iter().for_each(|report| term::say(&session.report(report)));
    match failure {
        Some(failure) if failure.as_failure().is_some() => term::say(&report::failure_text(session, failure)),
        Some(why) => term::say(&format!("error: {}\n", vm::print::display(why))),
        None => {}
    }
}

fn test_one(it: &Test, mut session: Session, path: &Path, name: Symbol, tally: &mut Tally) {
    let Some((function, line)) = test_function(&session, name) else { return };
    let mut printed = Printed::default();
    let outcome = match session.call_until(function, Vec::new(), &mut printed) {
        Progress::Ended(outcome) => outcome,
        Progress::Stopped => return,
    };
    let word = if outcome.is_ok() { "passed" } else { "failed" };
    let mut json = json!({"name": name.as_str(), "file": PathBuf::from(path), "line": line, "outcome": word, "printed": printed.0});
    match &outcome {
        Ok(_) => tally.passed += 1,
        Err(failure) => {
            tally.failed += 1;
            json["failure"] = json::failure(&session.files, &session.machine.program, failure);
        }
    }
    tally.tests.push(json);
    if !it.json {
        show(&session, name, &outcome, &printed.0);
    }
}

fn test_function(session: &Session, name: Symbol) -> Option<(FnId, usize)> {
    let definition = session.front.modules.get(session.module).names.get(&name)?;
    let Meaning::Test(function) = definition.meaning else { return None };
    let line =
        session.files.line_column(definition.span.file, definition.span.start).map_or(0, |(line, _)| line);
    Some((function, line))
}

/// A line for the test; for one that failed also what it printed and why.
fn show(session: &Session, name: Symbol, outcome: &Result<Value, Value>, printed: &str) {
    let style = term::out_style();
    let name = vm::show::safe(&name);
    let Err(failure) = outcome else {
        return term::say(&format!("test {name} ... {}\n", term::paint("ok", 32, style)));
    };
    term::say(&format!("test {name} ... {}\n", term::paint("FAILED", 31, style)));
    if !printed.is_empty() {
        term::say(&format!("  it printed:\n{}", indented(printed)));
    }
    term::say(&indented(&pleach::render::failure_in_source(&session.files, failure, style)));
}

fn indented(text: &str) -> String {
    text.lines().map(|line| format!("    {line}").trim_end().to_string() + "\n").collect()
}
