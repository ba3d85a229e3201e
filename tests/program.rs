//! A program of the tests: its text, the options in its first comments, and how it is run.
//!
//! Lines `;! fuel 1000` at the start of a file set options: `fuel depth memory nodes output` are
//! limits, `seed` is the seed, `allow clock` a grant, `treatments none` leaves only the plain run,
//! `oracle none` all but the oracle (it does not word refusals and names as the machine does).

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use pleach::render;
use pleach::{Ended, Options, Session};
use vm::code::FnId;
use vm::log::Log;
use vm::machine::{Outcome, Progress};
use vm::print::{LIMIT, Printer};
use vm::tree::{RecId, Tree};
use vm::value::Value;

/// A program in a file.
pub struct Program {
    pub path: PathBuf,
    pub text: String,
    /// Run it under the treatments as well.
    pub treated: bool,
    /// Run it on the oracle as well.
    pub compared: bool,
    options: Options,
    /// Queries look for garbage all the time.
    tidy: bool,
}

/// What a run came to, as text.
#[derive(Debug, Clone)]
pub struct Ran {
    pub printed: String,
    /// The value, or the failure with its places.
    pub outcome: String,
    /// The type of the failure; nothing for a value.
    pub failure: Option<String>,
    pub diagnostics: String,
    /// The tree as people see it.
    pub tree: String,
    /// The outcome and all records, attempts included, without places in the source.
    pub records: Vec<String>,
    /// Units of fuel it took.
    pub steps: u64,
    pub log: Log,
}

/// When a run is stopped, in units of fuel from its start, to be continued at once.
#[derive(Debug, Clone)]
pub enum Stops {
    Never,
    At(Vec<u64>),
    Always,
}

impl Stops {
    /// The next stop after `steps` units.
    fn after(&self, steps: u64) -> Option<u64> {
        match self {
            Stops::Never => None,
            Stops::At(stops) => stops.iter().copied().find(|stop| *stop > steps),
            Stops::Always => Some(steps + 1),
        }
    }
}

impl Program {
    /// Reads a program and its options.
    pub fn read(path: &Path) -> Program {
        let text = std::fs::read_to_string(path).unwrap_or_else(|why| panic!("{}: {why}", path.display()));
        let mut program = Program {
            path: path.into(),
            options: Options::default(),
            tidy: false,
            treated: true,
            compared: !text.contains("(use ") && !text.contains("(use-rules ") && !text.contains(";! allow"),
            text: text.clone(),
        };
        // An expectation does not depend on the limits of the machine that runs it.
        for line in text.lines() {
            let Some(option) = line.strip_prefix(";! ") else { break };
            let (key, value) = option.split_once(' ').unwrap_or_else(|| panic!("{}: {line}", path.display()));
            program.option(key, value);
        }
        program
    }

    fn option(&mut self, key: &str, value: &str) {
        let number =
            || value.replace('_', "").parse::<u64>().unwrap_or_else(|why| panic!("{key} {value}: {why}"));
        let Options { limits, grants, seed, .. } = &mut self.options;
        match key {
            "fuel" => limits.fuel = number(),
            "depth" => limits.depth = number() as usize,
            "memory" => limits.memory = number() as usize,
            "nodes" => limits.nodes = number() as usize,
            "output" => limits.output = number() as usize,
            "seed" => *seed = number(),
            "allow" => grants.allow(value).expect("a grant that exists"),
            "treatments" => self.treated = value != "none",
            "oracle" => self.compared &= value != "none",
            _ => panic!("{}: there is no option {key}", self.path.display()),
        }
    }

    /// The same program in another file.
    pub fn moved_to(&self, path: PathBuf) -> Program {
        Program { path, text: self.text.clone(), options: self.options.clone(), ..*self }
    }

    /// The same program with queries that look for garbage all the time.
    pub fn tidy(&self) -> Program {
        Program { tidy: true, ..self.moved_to(self.path.clone()) }
    }

    /// The seed of its draws.
    pub fn seed(&self) -> u64 {
        self.options.seed
    }

    /// Runs the program, stopping where it is told, with the answers of a log as far as it goes.
    pub fn run(&self, stops: &Stops, log: Option<Log>) -> Ran {
        let mut session = Session::new(self.options.clone());
        if self.tidy {
            session.machine.program.rules.collect_from = 1;
        }
        if let Some(log) = log {
            session.replay(log);
        }
        let loaded = session.load_file(&self.path).unwrap_or_else(|why| panic!("{why}"));
        let diagnostics: String = loaded.reports.iter().map(|report| session.report(report)).collect();
        let mut printed = String::new();
        let before = session.machine.steps();
        let ended = match stops {
            Stops::Never => session.run(loaded, None, &mut printed),
            stops => run_with_stops(&mut session, loaded, stops, &mut printed),
        };
        let steps = session.machine.steps() - before;
        ran(&session, ended, printed, diagnostics, steps)
    }

    /// A session in which the program has run, unless it has errors.
    pub fn session(&self) -> Session {
        let mut session = Session::new(self.options.clone());
        let loaded = session.load_file(&self.path).unwrap_or_else(|why| panic!("{why}"));
        session.run(loaded, None, &mut String::new());
        session
    }

    /// Runs the program for so many units of fuel and no further. The log of what came from outside.
    pub fn log_until(&self, stop: u64) -> Log {
        let mut session = Session::new(self.options.clone());
        let loaded = session.load_file(&self.path).unwrap_or_else(|why| panic!("{why}"));
        let before = session.machine.steps();
        for init in loaded.init {
            session.machine.start(init, Vec::new());
            if let Progress::Stopped = session.go(&mut String::new(), Some(before + stop)) {
                return session.machine.log;
            }
        }
        let loaded = session.extend("the call of the plan", "(main)");
        if let Some(init) = loaded.init.last() {
            session.machine.start(*init, Vec::new());
            session.go(&mut String::new(), Some(before + stop));
        }
        session.machine.log
    }
}

/// What [`Session::run`] does, with stops.
fn run_with_stops(
    session: &mut Session,
    loaded: compiler::Loaded,
    stops: &Stops,
    printed: &mut String,
) -> Ended {
    if !loaded.reports.iter().all(compiler::Report::is_warning) {
        return Ended::Errors(loaded.reports);
    }
    let start = session.machine.steps();
    let mut last = Value::NIL;
    for init in loaded.init {
        match call_with_stops(session, init, stops, start, printed) {
            Ok(value) => last = value,
            Err(failure) => {
                session.machine.finish(&Err(failure.clone()));
                return Ended::NotLoaded(failure);
            }
        }
    }
    if session.plan("main").is_none() {
        session.machine.finish(&Ok(last.clone()));
        return Ended::Ran(Ok(last));
    }
    let loaded = session.extend("the call of the plan", "(main)");
    let Some(init) = loaded.init.last().filter(|_| loaded.reports.is_empty()) else {
        return Ended::Errors(loaded.reports);
    };
    let outcome = call_with_stops(session, *init, stops, start, printed);
    session.machine.finish(&outcome);
    Ended::Ran(outcome)
}

fn call_with_stops(
    session: &mut Session,
    function: FnId,
    stops: &Stops,
    start: u64,
    printed: &mut String,
) -> Outcome {
    session.machine.start(function, Vec::new());
    loop {
        let next = stops.after(session.machine.steps() - start).map(|stop| start + stop);
        if let Progress::Ended(outcome) = session.go(printed, next) {
            return outcome;
        }
    }
}

fn ran(session: &Session, ended: Ended, printed: String, diagnostics: String, steps: u64) -> Ran {
    let program = &session.machine.program;
    let tree = session.machine.tree();
    let (outcome, failure, json) = match &ended {
        Ended::Ran(Ok(value)) => (text_of(session, value) + "\n", None, text_of(session, value)),
        Ended::Ran(Err(failure)) | Ended::NotLoaded(failure) => {
            let name = failure.as_failure().map(|it| it.name.to_string());
            let json = vm::show::failure_json(program, failure, 0).to_string();
            (render::failure(&session.files, failure), name, json)
        }
        Ended::Errors(reports) => {
            let texts: String = reports.iter().map(|report| session.report(report)).collect();
            (texts, Some("errors".into()), String::new())
        }
        other => panic!("a run does not end so: {other:?}"),
    };
    let mut records = vec![format!("outcome {json}")];
    records.extend(records_of(session, tree));
    let tree = vm::show::text(program, tree, MOST_SHOWN);
    Ran { printed, outcome, failure, diagnostics, tree, records, steps, log: session.machine.log.clone() }
}

/// The text of a value that reads back, with the names of functions.
pub fn text_of(session: &Session, value: &Value) -> String {
    Printer::new(Some(&session.machine.program), true, LIMIT).text(value)
}

/// How many nodes of a tree stand in an expectation.
const MOST_SHOWN: usize = 40;
/// Of how many records each is a line of its own.
const MOST_LINES: usize = 20_000;

/// A line for each record with all that is known of it, or their hashes if they are many.
fn records_of(session: &Session, tree: &Tree) -> Vec<String> {
    let lines = tree.records().map(|rec| record_line(session, tree, rec));
    if tree.len() <= MOST_LINES {
        return lines.collect();
    }
    let hash = lines.fold(0, |hash, line| vm::random::mix(hash ^ vm::random::hash_text(&line)));
    vec![format!("{} records {hash:016x}", tree.len())]
}

fn record_line(session: &Session, tree: &Tree, rec: RecId) -> String {
    let program = &session.machine.program;
    let record = tree.record(rec);
    let slot = tree.slot(record.slot);
    let mut line = format!("{} {} slot {} {:016x}", rec.0, slot.name, record.slot.0, slot.hash);
    let mut add = |text: std::fmt::Arguments<'_>| line.write_fmt(text).expect("a string takes all");
    add(format_args!(" in {} attempt {} {}", record.parent.0, record.attempt, record.kind.word()));
    add(format_args!(" {} {}", record.status.word(), record.why.word()));
    add(format_args!(" {}–{}", record.start, record.end));
    let values =
        |values: &[Value]| values.iter().map(|value| text_of(session, value)).collect::<Vec<_>>().join(" ");
    add(format_args!(" ({})", values(&tree.args(rec))));
    match record.value.as_failure() {
        Some(_) => add(format_args!(" {}", vm::show::failure_json(program, &record.value, 0))),
        None => add(format_args!(" {}", text_of(session, &record.value))),
    }
    if tree.is_changed(rec) {
        add(format_args!(" written ({})", values(&tree.written_args(rec))));
    }
    if let Some(extra) = tree.extra(rec) {
        let grounded = extra.grounded.as_ref().map(|value| text_of(session, value));
        add(format_args!(" {grounded:?} {:?} {:?}", extra.performed_in, extra.notes));
    }
    line
}

/// All files below a folder whose names end so, in order.
pub fn files_below(folder: &Path, end: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut todo = vec![folder.to_path_buf()];
    while let Some(folder) = todo.pop() {
        let entries = std::fs::read_dir(&folder).unwrap_or_else(|why| panic!("{}: {why}", folder.display()));
        for entry in entries {
            let path = entry.expect("a folder can be listed").path();
            match path.is_dir() {
                true => todo.push(path),
                false if path.to_string_lossy().ends_with(end) => files.push(path),
                false => {}
            }
        }
    }
    files.sort();
    files
}
