//! `pleach run`, and what `resume` and `replay` share with it: load, run, report.

use std::path::{Path, PathBuf};

use clap::Args;
use compiler::{Loaded, Report};
use pleach::rehearse::{NoRehearsal, Rehearsal, Wishes};
use pleach::session::Output;
use pleach::{Ended, Session};
use store::{Store, StoreError};
use vm::persist::{SavedEdit, SavedTree};

use super::console::Console;
use super::journal::{At, Journal, Recorded};
use super::keep::{self, Keeper, Place};
use super::moment::{Moment, Target};
use super::records::Records;
use super::report::{Extra, errors, keep_end, motion_costs, report};
use super::settings::Settings;
use super::transform::Rehearsing;
use super::{Answer, Trouble, files, interrupt, term};

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
  pleach run kitchen.plan --rehearse             rewrite the plan where that pays, and run the better one
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
  rehearsal with --rehearse what `pleach transform --json` says, without its tree
  motions   {count, path-m, straight-m, hand-m, leaps, failures}; where there is a robot: metres that its base
            drove and in straight lines, metres of its hands, failures recovered from included
Exit codes: 0 it succeeded · 1 it failed · 2 errors, or a failure while the file was loaded ·
130 stopped by Ctrl-C.";

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
    /// Rehearse the plan in projection, rewrite it where that pays, and run the better plan
    #[arg(long, conflicts_with = "schedules")]
    rehearse: bool,
    #[command(flatten)]
    rehearsing: Rehearsing,
    /// No option: tests say when the disk of the store is full.
    #[arg(skip)]
    pub store_fails_in: Option<(u64, store::Fault)>,
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
#[derive(Debug, Clone, Default, Args)]
pub struct Show {
    /// Do not show the tree
    #[arg(long, short)]
    pub(super) quiet: bool,
    /// Result and tree as JSON on stdout
    #[arg(long)]
    pub(super) json: bool,
    /// Show each start and end of a task as it happens
    #[arg(long)]
    pub(super) trace: bool,
    /// Show which task ran when, instead of the tree
    #[arg(long)]
    pub(super) timeline: bool,
    /// Show the whole tree, however large
    #[arg(long)]
    pub(super) all: bool,
}

/// What is kept of the world of a run.
#[derive(Debug, Clone, Default, Args)]
#[group(skip)]
pub struct Record {
    /// Write the motions of the robot and the ways of the objects over time into a file, as JSON
    #[arg(long, value_name = "FILE.json")]
    pub(super) record: Option<PathBuf>,
    /// Draw the world from above with what happened in it into a file
    #[arg(long, value_name = "FILE.svg")]
    pub(super) picture: Option<PathBuf>,
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
    /// How it is rehearsed and transformed before, if it is.
    pub rehearse: Option<Wishes>,
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
    /// Which moment is looked at.
    pub to: Option<Target>,
    /// Only look: nothing outside is asked again, and the log is not written.
    pub sealed: bool,
}

/// Runs a plan file.
pub fn run(it: Run) -> Answer {
    if !it.rehearse && it.rehearsing.is_given() {
        return Err(Trouble::new("--only and --rules are for a rehearsal", "add --rehearse"));
    }
    let rehearse = if it.rehearse { Some(it.rehearsing.wishes(&it.settings)?) } else { None };
    let job = Job { file: it.file, plan: it.plan, args: it.args, settings: it.settings, rehearse };
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
    let mut session = session(job, start)?;
    let loaded = session.load_file(&job.file).map_err(|why| files::unreadable(&job.file, why))?;
    if loaded.reports.iter().all(Report::is_warning) {
        load_rules(&mut session, job)?;
    }
    if let Some(recorded) = start.recorded {
        recorded.check_program(&session.files)?;
    }
    if !loaded.reports.iter().all(Report::is_warning) {
        return Ok(errors(&session, &loaded.reports, show));
    }
    loaded.reports.iter().for_each(|warning| term::complain(&session.report(warning)));
    let call = call(&session, job)?;
    let (mut keeper, base) = keeper(&mut session, job, call.as_deref(), start)?;
    let rehearsal = match &job.rehearse {
        None => None,
        Some(wishes) => {
            let session = self::session(job, start)?;
            match super::transform::rehearse(session, job, show, wishes, base.as_ref())? {
                Ok(rehearsal) => Some(rehearsal),
                Err(code) => return Ok(code),
            }
        }
    };
    if let Some(rehearsal) = &rehearsal {
        if !show.quiet && !show.json {
            term::complain(&super::transform::text(&rehearsal.report, false));
        }
        session.take_up(&rehearsal.tree, call.as_deref())?;
        if let (Some(keeper), None) = (&mut keeper, start.recorded) {
            keeper.decided(super::transform::steps(&rehearsal.report))?;
        }
    }
    let journal = match (start.log, start.recorded.map(|recorded| (recorded.path(), recorded.at))) {
        (Some(path), _) => Some(Journal::create(path, job, &session.files)?),
        (None, Some((path, At::Log(whole)))) if !start.sealed => Some(Journal::reopen(path, whole)?),
        _ => None,
    };
    let records = Records::open(&start.record)?;
    if records.wanted() || start.to.is_some() {
        let world = world::world::World::empty(job.settings.robot.mode(), true);
        *session.machine.world() = Some(Box::new(world));
    }
    let mut console = Console::new(show, journal, keeper);
    let mut ended = run_call(&mut session, loaded, call.as_deref(), start, &mut console);
    if let Some(missed) = start.to.as_ref().and_then(|to| to.missed(&session)) {
        console.flush();
        return Err(missed);
    }
    if session.log_ended {
        ended = again(&mut session, job, call.as_deref(), start, rehearsal.as_ref())?;
    }
    keep_end(&session, &ended, &mut console);
    let costs = motion_costs(&mut session);
    let stands = start.to.is_some() && matches!(ended, Ended::Stopped);
    let moment = stands.then(|| Moment::of(&mut session));
    let extra = Extra { costs, moment, rehearsal: rehearsal.map(|it| it.report) };
    let code = report(&session, &ended, show, &mut console, job, extra);
    records.write(&mut session, job)?;
    // Freeing a large tree takes longer than leaving that to the system.
    std::mem::forget(session);
    code
}

/// A session for a run; who only looks takes the program that is kept with it.
fn session(job: &Job, start: &Start<'_>) -> Result<Session, Trouble> {
    let style = term::error_style();
    if !start.sealed {
        return Ok(Session::new(job.settings.options(style)?));
    }
    let mut session = Session::new(job.settings.options_of_replay(style)?);
    session.files.use_shelf(start.recorded.and_then(Recorded::texts));
    Ok(session)
}

/// Loads the files of `--rules`: the code of edits may call what they define.
fn load_rules(session: &mut Session, job: &Job) -> Result<(), Trouble> {
    for path in job.rehearse.iter().flat_map(|wishes| &wishes.rules) {
        session.load_rules(path, &mut Silence).map_err(|why| match why {
            NoRehearsal::Because(why) => Trouble::from(why),
            _ => Trouble::new(
                format!("the rules of {} cannot be loaded", path.display()),
                format!("pleach check {} says what is wrong with them", path.display()),
            ),
        })?;
    }
    Ok(())
}

/// Makes the session go on with the tree that is meant, and opens the store for writing. Answers that tree, too.
fn keeper(
    session: &mut Session,
    job: &Job,
    call: Option<&str>,
    start: &Start<'_>,
) -> Result<(Option<Keeper>, Option<SavedTree>), Trouble> {
    if let Some(Recorded { at: At::Store(id, base), .. }) = start.recorded {
        let path = start.recorded.map(Recorded::path).unwrap_or(Path::new(""));
        let mut saved = None;
        if let Some(base) = base {
            saved = Some(take_up(session, &Store::read(path)?, *base, call)?.0);
        }
        let keeper = match start.sealed {
            true => None,
            false => Some(Keeper::resume(path, *id)?),
        };
        return Ok((keeper, saved));
    }
    let Some(place) = &start.store else { return Ok((None, None)) };
    let store = Store::write(&place.path)?;
    let base = match &place.tree {
        None => None,
        Some(tree) => match store.version(tree, None) {
            Ok(version) => Some(version.id),
            Err(StoreError::Missing { .. }) => None,
            Err(error) => return Err(error.into()),
        },
    };
    let (saved, orphans) = match base {
        None => (None, Vec::new()),
        Some(base) => {
            let (saved, orphans) = take_up(session, &store, base, call)?;
            (Some(saved), orphans)
        }
    };
    for (edit, why) in &orphans {
        let edit = vm::show::safe(&edit.edit);
        term::complain(&format!(
            "note: an edit of the tree holds no more: {edit}\n  {}\n",
            vm::show::safe(why)
        ));
    }
    let main = session.plan("main").filter(|_| job.plan.is_none()).map(|_| "main".to_string());
    let keeper = Keeper::begin(store, place, job, &session.files, main, base, orphans)?;
    Ok((Some(keeper), saved))
}

/// The session goes on with a version of a tree. Answers it, and its edits that hold no more.
fn take_up(
    session: &mut Session,
    store: &Store,
    base: i64,
    call: Option<&str>,
) -> Result<(SavedTree, Vec<(SavedEdit, String)>), Trouble> {
    let saved = keep::base(store, base)?;
    let orphans = session.take_up(&saved, call).map_err(|why| {
        let what = format!("cannot go on with a tree of the store {}: {why}", store.path.display());
        Trouble::new(what, "`pleach store check` says which trees are whole")
    })?;
    Ok((saved, orphans))
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
    if let Some(to) = &start.to {
        to.set(session);
    }
    if console.trace {
        session.trace();
    }
    interrupt::listen();
    session.run_call(loaded, call, console)
}

/// A replay came to the end of its log, and a little further: once more in silence, to just
/// before the first question that the log does not answer.
fn again(
    session: &mut Session,
    job: &Job,
    call: Option<&str>,
    start: &Start<'_>,
    rehearsal: Option<&Rehearsal>,
) -> Result<Ended, Trouble> {
    let log = start.recorded.map(|recorded| recorded.log.clone()).unwrap_or_default();
    let unanswered = session.machine.log.entries.get(log.entries.len()).map_or(0, |entry| entry.step);
    *session = self::session(job, start)?;
    let loaded = session.load_file(&job.file)?;
    load_rules(session, job)?;
    if let Some(Recorded { at: At::Store(_, Some(base)), .. }) = start.recorded {
        let path = start.recorded.map(Recorded::path).unwrap_or(Path::new(""));
        take_up(session, &Store::read(path)?, *base, call)?;
    }
    if let Some(rehearsal) = rehearsal {
        session.take_up(&rehearsal.tree, call)?;
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

pub(super) fn no_plan(session: &Session, name: &str) -> Trouble {
    let (what, help) = session.no_plan(name);
    Trouble::new(what, help)
}

/// Prints nowhere.
struct Silence;

impl Output for Silence {
    fn print(&mut self, _text: &str) {}
}
