//! `pleach run`, and what `resume` and `replay` share with it: load, run, report.

use std::fs::File;
use std::io::{BufWriter, IsTerminal as _, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use compiler::{Loaded, Report};
use pleach::render::Style;
use pleach::session::Output;
use pleach::{Ended, Session, render};
use serde_json::{Value as Json, json};
use store::{Store, StoreError, Writer};
use vm::log::Entry;
use vm::machine::Machine;
use vm::persist::SavedEdit;
use vm::value::Value;

use super::journal::{At, Journal, Recorded};
use super::keep::{self, Keeper, Place};
use super::settings::Settings;
use super::{Answer, ERRORS, FAILED, INTERRUPTED, Trouble, files, interrupt, json, term};

pub const HELP: &str = "\
Examples:
  pleach run hello.plan
  pleach run kitchen.plan --plan set-table --arg \"'(cup plate)\" --arg 2
  pleach run kitchen.plan --quiet --seed 7 --fuel 1_000_000 --memory 512M
  pleach run report.plan --allow read=data --allow write=out
  pleach run team.plan --timeline
  pleach run team.plan --schedules 0..200
  pleach run kitchen.plan --json > monday.json    to be asked with: pleach query … --tree monday.json
  pleach run long.plan --log long.log --stop-at 5000 && pleach resume long.log
  pleach run kitchen.plan --picture monday.svg --record monday.json
  pleach run kitchen.plan --robot simulated
  pleach run kitchen.plan --store runs.store     and later: pleach tree runs.store
  pleach run kitchen.plan --store runs.store --tree kitchen     the next version of a named tree

The program's own output goes to stdout; the tree of its tasks, failures and --trace go to stderr.
With --json stdout is one object, and the program's output goes to stderr:
  outcome   succeeded, failed, not-loaded, errors, stopped or interrupted
  value     as `write` prints it; where it succeeded
  failure   {type, fields, task, place, cause, also}; where it failed
  errors    [{severity, code, message, help, file, line, column, labels}]; where there are some
  plan seed steps clock    what was run, how much fuel it used, seconds of the task clock
  tree      [{name, path, parent, kind, status, attempt, params, value, failure, start, end}],
            parents before children; `parent` is a position in this list. Where there are such:
            attempts [{status, value, failure, start, end}], all runs of a task that was run more
            than once; written and written-params, the call as the plan makes it if edits have
            changed it; edits, why, goal, grounded, performed-in, notes
Exit codes: 0 it succeeded · 1 it failed · 2 errors, or a failure while the file was loaded ·
130 stopped by Ctrl-C.";

/// How many nodes of a tree are shown.
const MOST_NODES: usize = 500;
/// After how many rounds output that waits is written.
const PATIENCE: u32 = 500;
/// Of how many calls a stopped run says where they stand.
const MOST_CALLS: usize = 10;

/// `pleach run`
#[derive(Args)]
pub struct Run {
    /// The plan file
    file: PathBuf,
    /// The plan to run; without it `main`, where there is one
    #[arg(long, value_name = "NAME")]
    plan: Option<String>,
    /// An argument of the plan, as a form; once for each
    #[arg(long = "arg", value_name = "FORM", allow_hyphen_values = true)]
    args: Vec<String>,
    #[command(flatten)]
    show: Show,
    #[command(flatten)]
    record: Record,
    /// Run once for each of these schedules, and say whether they end alike: 0..200
    #[arg(long, value_name = "A..B", value_parser = super::schedules::range, conflicts_with_all = ["log", "store", "tree", "stop_at", "trace", "timeline", "schedule", "record", "picture"])]
    schedules: Option<std::ops::Range<u64>>,
    /// Write what comes from outside into a file, so that the run can be resumed and replayed
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Keep the run in a store: its program, its log and its tree, written while it runs
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    /// Go on with this tree of the store: its edits apply, and the run is its next version
    #[arg(long, value_name = "NAME", requires = "store", value_parser = tree_name)]
    tree: Option<String>,
    /// No option: tests say when the disk of the store is full.
    #[arg(skip)]
    pub store_fails_in: Option<u64>,
    /// Stop when so many calls and backward jumps have been done
    #[arg(long, value_name = "STEP", value_parser = super::settings::count)]
    stop_at: Option<u64>,
    #[command(flatten)]
    settings: Settings,
}

/// Names of trees are told from versions and numbers of runs.
fn tree_name(text: &str) -> Result<String, String> {
    match vm::persist::is_tree_name(text) {
        true => Ok(text.into()),
        false => Err("a tree has a name that is no number and has no `@` in it".into()),
    }
}

/// What is shown of a run.
#[derive(Debug, Clone, Args)]
pub struct Show {
    /// Do not show the tree
    #[arg(long, short)]
    quiet: bool,
    /// Result and tree as JSON on stdout
    #[arg(long)]
    json: bool,
    /// Show each start and end of a task as it happens
    #[arg(long)]
    trace: bool,
    /// Show which task ran when, instead of the tree
    #[arg(long)]
    timeline: bool,
    /// Show the whole tree, however large
    #[arg(long)]
    all: bool,
}

/// What is kept of the world of a run.
#[derive(Debug, Clone, Default, Args)]
#[group(skip)]
pub struct Record {
    /// Write the motions of the robot and the ways of the objects over time into a file, as JSON
    #[arg(long, value_name = "FILE.json")]
    record: Option<PathBuf>,
    /// Draw the world from above with what happened in it into a file
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
}

impl Show {
    /// Result as JSON on stdout.
    pub fn json(&self) -> bool {
        self.json
    }
}

/// What is run, and how: all that a log must know to run it again.
#[derive(Debug, Clone)]
pub struct Job {
    /// The program.
    pub file: PathBuf,
    /// The plan.
    pub plan: Option<String>,
    /// Its arguments, as forms.
    pub args: Vec<String>,
    /// Seed, limits, grants.
    pub settings: Settings,
}

/// What a run starts from, besides its program.
#[derive(Default)]
pub struct Start<'a> {
    /// A log of an earlier run, to be used again.
    pub recorded: Option<&'a Recorded>,
    /// Where a new log goes.
    pub log: Option<&'a Path>,
    /// Where the run is kept.
    pub store: Option<Place>,
    /// Where it is said what happened in the world.
    pub record: Record,
    /// When to stop.
    pub stop_at: Option<u64>,
    /// Only look: nothing outside is asked again, and the log is not written.
    pub sealed: bool,
}

/// Runs a plan file.
pub fn run(it: Run) -> Answer {
    let job = Job { file: it.file, plan: it.plan, args: it.args, settings: it.settings };
    if let Some(schedules) = it.schedules {
        return super::schedules::explore(&job, &it.show, schedules);
    }
    let store = it.store.map(|path| Place { path, tree: it.tree, fails_in: it.store_fails_in });
    let (log, record, stop_at) = (it.log.as_deref(), it.record, it.stop_at);
    let start = Start { log, store, record, stop_at, ..Start::default() };
    perform(&job, &it.show, &start)
}

/// Loads a program, runs it, and reports.
pub fn perform(job: &Job, show: &Show, start: &Start<'_>) -> Answer {
    let mut session = Session::new(job.settings.options(term::error_style())?);
    let loaded = session.load_file(&job.file).map_err(|why| files::unreadable(&job.file, why))?;
    if let Some(recorded) = start.recorded {
        recorded.check_program(&session.files)?;
    }
    if !loaded.reports.iter().all(Report::is_warning) {
        return Ok(errors(&session, &loaded.reports, show));
    }
    loaded.reports.iter().for_each(|warning| term::complain(&session.report(warning)));
    let call = call(&session, job)?;
    let keeper = keeper(&mut session, job, call.as_deref(), start)?;
    let journal = match (start.log, start.recorded.map(|recorded| (recorded.path(), recorded.at))) {
        (Some(path), _) => Some(Journal::create(path, job, &session.files)?),
        (None, Some((path, At::Log(whole)))) if !start.sealed => Some(Journal::reopen(path, whole)?),
        _ => None,
    };
    let records = Records::open(&start.record)?;
    if records.wanted() {
        let world = world::world::World::empty(job.settings.robot.mode(), true);
        *session.machine.world() = Some(Box::new(world));
    }
    let mut console = Console::new(show, journal, keeper);
    let mut ended = run_call(&mut session, loaded, call.as_deref(), start, &mut console);
    if session.log_ended {
        ended = again(&mut session, job, call.as_deref(), start)?;
    }
    keep_end(&session, &ended, &mut console);
    let code = report(&session, &ended, show, &mut console, job);
    records.write(&mut session, job)?;
    // Freeing a large tree takes longer than leaving that to the system.
    std::mem::forget(session);
    code
}

/// Makes the session go on with the tree that is meant, and opens the store for writing.
fn keeper(
    session: &mut Session,
    job: &Job,
    call: Option<&str>,
    start: &Start<'_>,
) -> Result<Option<Keeper>, Trouble> {
    if let Some(Recorded { at: At::Store(id, base), .. }) = start.recorded {
        let path = start.recorded.map(Recorded::path).unwrap_or(Path::new(""));
        if let Some(base) = base {
            take_up(session, &Store::read(path)?, *base, call)?;
        }
        return match start.sealed {
            true => Ok(None),
            false => Keeper::resume(path, *id).map(Some),
        };
    }
    let Some(place) = &start.store else { return Ok(None) };
    let store = Store::write(&place.path)?;
    let base = match &place.tree {
        None => None,
        Some(tree) => match store.version(tree, None) {
            Ok(version) => Some(version.id),
            Err(StoreError::Missing { .. }) => None,
            Err(error) => return Err(error.into()),
        },
    };
    let orphans = match base {
        None => Vec::new(),
        Some(base) => take_up(session, &store, base, call)?,
    };
    for (edit, why) in &orphans {
        let edit = vm::show::safe(&edit.edit);
        term::complain(&format!(
            "note: an edit of the tree holds no more: {edit}\n  {}\n",
            vm::show::safe(why)
        ));
    }
    let main = session.plan("main").filter(|_| job.plan.is_none()).map(|_| "main".to_string());
    Keeper::begin(store, place, job, &session.files, main, base, orphans).map(Some)
}

/// The session goes on with a version of a tree. Answers the edits that hold no more.
fn take_up(
    session: &mut Session,
    store: &Store,
    base: i64,
    call: Option<&str>,
) -> Result<Vec<(SavedEdit, String)>, Trouble> {
    let saved = keep::base(store, base)?;
    session.take_up(&saved, call).map_err(|why| {
        let what = format!("cannot go on with a tree of the store {}: {why}", store.path.display());
        Trouble::new(what, "`pleach store check` says which trees are whole")
    })
}

/// Files that take what happened in the world. They are opened before the run begins: whoever cannot write them wants to know
/// that then.
#[derive(Default)]
struct Records {
    record: Option<(PathBuf, File)>,
    picture: Option<(PathBuf, File)>,
}

impl Records {
    fn open(wanted: &Record) -> Result<Records, Trouble> {
        let open = |path: &Option<PathBuf>, option: &str, head: &str| {
            let Some(path) = path else { return Ok(None) };
            let known = std::fs::read(path).unwrap_or_default();
            if !known.is_empty() && !known.starts_with(head.as_bytes()) {
                let what = format!("{} is no file of {option}, and is not overwritten", path.display());
                return Err(Trouble::new(what, format!("choose another name after {option}")));
            }
            let cannot = |error| {
                let what = format!("cannot write {}: {}", path.display(), pleach::files::why(&error));
                Trouble::new(what, format!("name a file in a folder that is there: {option} FILE"))
            };
            File::create(path).map(|file| Some((path.clone(), file))).map_err(cannot)
        };
        if wanted.record.is_some() && wanted.record == wanted.picture {
            return Err(Trouble::new("--record and --picture name the same file", "name two files"));
        }
        Ok(Records {
            record: open(&wanted.record, "--record", "{\n  \"pleach-record\"")?,
            picture: open(&wanted.picture, "--picture", "<svg ")?,
        })
    }

    fn wanted(&self) -> bool {
        self.record.is_some() || self.picture.is_some()
    }

    fn write(self, session: &mut Session, job: &Job) -> Result<(), Trouble> {
        if !self.wanted() {
            return Ok(());
        }
        let end_ns = session.machine.now();
        let slot = session.machine.world();
        let world = slot.as_mut().and_then(|it| it.as_any().downcast_mut::<world::world::World>());
        let recording = world.and_then(|it| it.recording.clone()).unwrap_or_default();
        if recording.is_empty() {
            let files: Vec<String> = [&self.record, &self.picture]
                .iter()
                .filter_map(|it| it.as_ref())
                .map(|it| it.0.display().to_string())
                .collect();
            term::complain(&format!(
                "note: this run has no world, so there is nothing in {}\n",
                files.join(" and ")
            ));
        }
        let put = |file: Option<(PathBuf, File)>, text: &dyn Fn() -> String| {
            let Some((path, mut file)) = file else { return Ok(()) };
            file.write_all(text().as_bytes()).map_err(|error| {
                Trouble::from(format!("cannot write {}: {}", path.display(), pleach::files::why(&error)))
            })
        };
        let plan = job.plan.clone().unwrap_or_else(|| "main".into());
        put(self.record, &|| {
            let mut about = serde_json::Map::new();
            about.insert("file".into(), json!(job.file));
            about.insert("plan".into(), json!(plan));
            about.insert("seed".into(), json!(job.settings.seed));
            recording.json(about, end_ns)
        })?;
        let file = job.file.file_name().map_or_else(String::new, |it| it.to_string_lossy().into_owned());
        put(self.picture, &|| recording.picture(&format!("{file}, {plan}"), end_ns))
    }
}

fn run_call(
    session: &mut Session,
    loaded: Loaded,
    call: Option<&str>,
    start: &Start<'_>,
    console: &mut Console,
) -> Ended {
    session.stop_at = start.stop_at;
    session.sealed = start.sealed;
    if let Some(recorded) = start.recorded {
        session.replay(recorded.log.clone());
    }
    if console.trace {
        session.trace();
    }
    interrupt::listen();
    session.run_call(loaded, call, console)
}

/// A replay came to the end of its log, and a little further: once more in silence, to just
/// before the first question that the log does not answer.
fn again(session: &mut Session, job: &Job, call: Option<&str>, start: &Start<'_>) -> Result<Ended, Trouble> {
    let log = start.recorded.map(|recorded| recorded.log.clone()).unwrap_or_default();
    let unanswered = session.machine.log.entries.get(log.entries.len()).map_or(0, |entry| entry.step);
    *session = Session::new(job.settings.options(term::error_style())?);
    let loaded = session.load_file(&job.file)?;
    if let Some(Recorded { at: At::Store(_, Some(base)), .. }) = start.recorded {
        let path = start.recorded.map(Recorded::path).unwrap_or(Path::new(""));
        take_up(session, &Store::read(path)?, *base, call)?;
    }
    session.stop_at = Some(unanswered.saturating_sub(1));
    session.replay(log);
    let ended = session.run_call(loaded, call, &mut Silence);
    session.log_ended = true;
    Ok(ended)
}

/// The form that calls the plan; nothing for `main` or for a file without a plan.
pub fn call(session: &Session, job: &Job) -> Result<Option<String>, Trouble> {
    for arg in &job.args {
        let parsed = grammar::parse(grammar::FileId(0), arg);
        if !parsed.errors.is_empty() || parsed.forms.len() != 1 {
            let why = parsed
                .errors
                .first()
                .map_or(format!("it has {} forms, not one", parsed.forms.len()), ToString::to_string);
            let what = format!("--arg {} is no form: {why}", vm::show::safe(arg));
            return Err(Trouble::new(
                what,
                "each --arg is one form, as it stands in a program: --arg \"'milk\" --arg 3 --arg '\"text\"'",
            ));
        }
    }
    let name = match &job.plan {
        Some(name) => name,
        None if job.args.is_empty() => return Ok(None),
        None => "main",
    };
    if session.plan(name).is_none() {
        return Err(no_plan(session, name));
    }
    // A line end keeps a comment in an argument from hiding what follows.
    let args: String =
        job.args.iter().map(|arg| format!(" {arg}{}", if arg.contains(';') { "\n" } else { "" })).collect();
    Ok(Some(format!("({name}{args})")))
}

fn no_plan(session: &Session, name: &str) -> Trouble {
    use compiler::module::Meaning;
    let module = session.front.modules.get(session.module);
    let plans = module
        .names
        .iter()
        .filter(|(_, it)| matches!(it.meaning, Meaning::Plan(..)))
        .map(|(name, _)| name.as_str());
    let plans: Vec<&str> = plans.take(20).collect();
    let help = match (compiler::module::nearest(name, plans.iter().copied()), plans.as_slice()) {
        (Some(near), _) => format!("did you mean `{near}`?"),
        (None, []) => "the file defines no plan; define one: (def-plan main () …)".into(),
        (None, plans) => format!("its plans are: {}", plans.join(" ")),
    };
    Trouble::new(format!("the program has no plan called `{}`", vm::show::safe(name)), help)
}

// ---------------------------------------------------------------------------------------------
// While it runs

/// Why a run was stopped from outside.
enum Halt {
    Interrupted,
    /// Nobody reads the output.
    NoReader,
    /// Output or log cannot be written.
    Broken(String),
}

/// Where the output of a run goes.
pub struct Console {
    out: BufWriter<Box<dyn Write>>,
    /// Each line at once: somebody is watching.
    watched: bool,
    trace: bool,
    journal: Option<Journal>,
    keeper: Option<Keeper>,
    halt: Option<Halt>,
    rounds: u32,
}

impl Console {
    fn new(show: &Show, journal: Option<Journal>, keeper: Option<Keeper>) -> Console {
        let (out, watched): (Box<dyn Write>, bool) = match show.json {
            true => (Box::new(std::io::stderr()), std::io::stderr().is_terminal()),
            false => (Box::new(std::io::stdout()), std::io::stdout().is_terminal()),
        };
        Console {
            out: BufWriter::with_capacity(1 << 16, out),
            watched,
            trace: show.trace,
            journal,
            keeper,
            halt: None,
            rounds: 0,
        }
    }

    fn wrote(&mut self, result: std::io::Result<()>) {
        if let Err(error) = result {
            self.halt.get_or_insert(match error.kind() {
                std::io::ErrorKind::BrokenPipe => Halt::NoReader,
                _ => {
                    Halt::Broken(format!("cannot write the program's output: {}", pleach::files::why(&error)))
                }
            });
        }
    }

    fn kept(&mut self, result: Result<(), StoreError>) {
        if let Err(error) = result {
            let help = error.help().map_or(String::new(), |help| format!("\n  help: {help}"));
            self.halt.get_or_insert(Halt::Broken(format!("{error}{help}")));
            // What is not written any more does not become half of a run.
            self.keeper = None;
        }
    }

    fn flush(&mut self) {
        let result = self.out.flush();
        self.wrote(result);
    }
}

impl Output for Console {
    fn print(&mut self, text: &str) {
        let result = self.out.write_all(text.as_bytes());
        self.wrote(result);
        if self.watched && text.contains('\n') {
            self.flush();
        }
    }
    fn trace(&mut self, line: &str) {
        if self.trace {
            self.flush();
            term::complain(&format!("{line}\n"));
        }
    }
    fn complain(&mut self, line: &str) {
        self.flush();
        term::complain(&format!("warning: {line}\n"));
    }
    fn logged(&mut self, entry: &Entry) {
        if let Some(journal) = &mut self.journal
            && let Err(error) = journal.add(entry)
        {
            let why =
                format!("cannot write the log {}: {}", journal.path.display(), pleach::files::why(&error));
            self.halt.get_or_insert(Halt::Broken(why));
        }
        if let Some(keeper) = &mut self.keeper {
            keeper.logged(entry);
        }
    }
    fn looked(&mut self, machine: &Machine) {
        if let Some(keeper) = &mut self.keeper {
            let result = keeper.look(machine);
            self.kept(result);
        }
    }
    fn store(&mut self, store: &Path) -> Option<&mut Writer> {
        let keeper = self.keeper.as_mut()?;
        keeper.is_in(store).then(|| keeper.writer())
    }
    fn goes_on(&mut self) -> bool {
        self.rounds += 1;
        if let Some(keeper) = &mut self.keeper {
            let result = keeper.nap();
            self.kept(result);
        }
        if self.rounds.is_multiple_of(PATIENCE) {
            self.flush();
        }
        if interrupt::asked() {
            self.halt.get_or_insert(Halt::Interrupted);
        }
        self.halt.is_none()
    }
}

/// Prints nowhere.
struct Silence;

impl Output for Silence {
    fn print(&mut self, _text: &str) {}
}

// ---------------------------------------------------------------------------------------------
// Afterwards

/// Shows errors of the program.
pub fn errors(session: &Session, reports: &[Report], show: &Show) -> u8 {
    if show.json {
        let errors: Vec<Json> = reports.iter().map(|it| json::report(&session.files, it)).collect();
        term::say(&format!("{}\n", json!({"outcome": "errors", "errors": errors})));
    }
    reports.iter().for_each(|it| term::complain(&session.report(it)));
    ERRORS
}

/// The word for how a run ended, and the exit code.
fn outcome(ended: &Ended, console: &Console) -> (&'static str, u8) {
    match ended {
        Ended::Errors(_) => ("errors", ERRORS),
        Ended::Ran(Ok(_)) => ("succeeded", 0),
        Ended::Ran(Err(_)) => ("failed", FAILED),
        Ended::NotLoaded(_) => ("not-loaded", ERRORS),
        Ended::Stopped if console.halt.is_some() => ("interrupted", INTERRUPTED),
        Ended::Stopped => ("stopped", 0),
    }
}

/// Writes the end of the run into the store.
fn keep_end(session: &Session, ended: &Ended, console: &mut Console) {
    let (word, _) = outcome(ended, console);
    let Some(keeper) = &mut console.keeper else { return };
    let machine = &session.machine;
    let value = match ended {
        Ended::Ran(Ok(value)) => {
            Some(vm::print::Printer::new(Some(&machine.program), true, vm::print::LIMIT).text(value))
        }
        _ => None,
    };
    let result = keeper.end(machine, word, value.as_deref());
    console.kept(result);
}

/// Shows how the run ended. The exit code.
fn report(session: &Session, ended: &Ended, show: &Show, console: &mut Console, job: &Job) -> Answer {
    console.flush();
    match &console.halt {
        Some(Halt::NoReader) => return Ok(141),
        Some(Halt::Broken(why)) => return Err(why.clone().into()),
        Some(Halt::Interrupted) | None => {}
    }
    if let Ended::Errors(reports) = ended {
        return Ok(errors(session, reports, show));
    }
    let (outcome, code) = outcome(ended, console);
    if show.json {
        term::say(&format!("{}\n", result_json(session, ended, outcome, show, job)));
        return Ok(code);
    }
    if show.timeline {
        let most = if show.all { usize::MAX } else { MOST_NODES };
        let machine = &session.machine;
        term::complain(&vm::show::timeline(&machine.program, machine.tree(), machine.now(), most));
    } else if !show.quiet {
        term::complain(&tree_text(session, show.all, "--all", term::error_style()));
    }
    match ended {
        Ended::Ran(Err(failure)) => term::complain(&failure_text(session, failure)),
        Ended::NotLoaded(failure) => {
            term::complain("error: the file could not be loaded: one of its top-level forms failed\n");
            term::complain(&failure_text(session, failure));
        }
        Ended::Stopped => term::complain(&stopped_text(session, console)),
        _ => {}
    }
    Ok(code)
}

/// A failure with the lines of the source that it comes from.
pub fn failure_text(session: &Session, failure: &Value) -> String {
    render::failure_in_source(&session.files, failure, term::error_style())
}

/// The tree as far as it is shown; `more` shows the rest.
pub fn tree_text(session: &Session, all: bool, more: &str, style: Style) -> String {
    let most = if all { usize::MAX } else { MOST_NODES };
    let tree = session.machine.tree();
    let mut text = vm::show::text(&session.machine.program, tree, most);
    if tree.len() > most && text.ends_with(" nodes in all\n") {
        text.pop();
        text += &format!("; {more} shows them\n");
    }
    term::paint_tree(&text, style)
}

/// Where a stopped run stands, and how to go on.
fn stopped_text(session: &Session, console: &Console) -> String {
    let machine = &session.machine;
    let why = match (&console.halt, session.log_ended) {
        (Some(_), _) => "interrupted",
        (None, true) => "the log ends here: stopped",
        (None, false) => "stopped",
    };
    let mut text = format!(
        "{why} at step {}, {} s of the task clock\n",
        machine.steps(),
        vm::show::seconds(machine.now())
    );
    text += &place_text(session);
    if let Some(journal) = &console.journal {
        text += &format!("go on with: pleach resume {}\n", journal.path.display());
    }
    if let Some(keeper) = &console.keeper {
        text += &format!("go on with: {}\n", keeper.resume_words());
    }
    text
}

/// The calls in which a stopped run stands, innermost first.
pub fn place_text(session: &Session) -> String {
    let machine = &session.machine;
    let mut text = String::new();
    let calls = machine.backtrace(MOST_CALLS + 1);
    for (function, pc) in calls.iter().take(MOST_CALLS) {
        let function = &machine.program.functions[function.at()];
        let place = machine.program.places.get(pc.at()).copied().unwrap_or_default();
        text +=
            &format!("  in {} {} at {}\n", function.kind.word(), function.name, session.files.show(place));
    }
    if calls.len() > MOST_CALLS {
        text += "  …\n";
    }
    text
}

/// See [`HELP`].
fn result_json(session: &Session, ended: &Ended, outcome: &str, show: &Show, job: &Job) -> Json {
    let machine = &session.machine;
    let mut json = json!({"outcome": outcome});
    match ended {
        Ended::Ran(Ok(value)) => {
            let printer = vm::print::Printer::new(Some(&machine.program), true, vm::print::LIMIT);
            json["value"] = json!(printer.text(value));
        }
        Ended::Ran(Err(failure)) | Ended::NotLoaded(failure) => {
            json["failure"] = json::failure(&session.files, &machine.program, failure);
        }
        Ended::Errors(_) | Ended::Stopped => {}
    }
    let main = session.plan("main").map(|_| "main".to_string());
    json["file"] = json!(job.file);
    json["plan"] = json!(job.plan.clone().or(main));
    json["seed"] = json!(job.settings.seed);
    json["steps"] = json!(machine.steps());
    json["clock"] = json!(machine.now() as f64 / 1e9);
    if !show.quiet {
        json["tree"] = vm::show::json(&machine.program, machine.tree());
    }
    json
}
