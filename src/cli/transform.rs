//! `pleach transform`, and what `pleach run --rehearse` shares with it: a plan is rehearsed and rewritten.

use std::path::{Path, PathBuf};

use clap::Args;
use compiler::Report;
use pleach::rehearse::{NoRehearsal, Rehearsal, Wishes, is_library};
use pleach::session::Output;
use pleach::{Ended, Session};
use serde_json::{Value as Json, json};
use store::{Store, StoreError, VersionRow, Writer};
use vm::machine::Machine;
use vm::persist::SavedTree;
use vm::show::safe;

use super::run::{Job, Show, call};
use super::settings::Settings;
use super::{Answer, ERRORS, FAILED, INTERRUPTED, Trouble, files, interrupt, keep, report, term};

pub const HELP: &str = "\
Examples:
  pleach transform kitchen.plan                       what is proposed and kept, and what it saves
  pleach transform kitchen.plan --why                 also what was refused: by which check, with which numbers
  pleach transform kitchen.plan --accept paired       be sure that it pays: 20 to 200 pairs of runs for each step
  pleach transform kitchen.plan --only both-hands --plan set-table --arg \"'(cup plate)\"
  pleach transform kitchen.plan --rules my-rules      with all transformations in the files of a folder
  pleach transform kitchen.plan --list                the transformations, in the order in which they are tried
  pleach transform kitchen.plan --emit better.plan    the better plan as text; with --inline written out
  pleach transform runs.store kitchen --save          the plan of a stored run, with the edits that its tree has by now
  pleach run kitchen.plan --rehearse                  the same, and then run the better plan

The plan runs in projection under some seeds. Rules look at what happened, and propose edits of the plan. What is
kept succeeds under at least 4 of 5 seeds under which the plan without it succeeds, leaves nothing behind, keeps what
the transformation says, and is cheaper: seconds, and 60 for each failure that nobody made good. With --accept static
a run under one of the seeds has to succeed and keep what is said, and nobody asks what it costs.
Transformations are those of the files that the plan uses, as (use household) does, and of --rules.

With --json stdout is one object: {steps: [{transformation, input, edits, verdict, check, why, numbers}],
before, after, seeds, why, tree}; verdict is accepted or refused, check is edits, static, projected or paired.
Exit codes: 0 something was kept · 1 nothing was, or the plan fails in projection · 2 errors.";

/// `pleach transform`
#[derive(Args)]
pub struct Transform {
    /// The plan file, or a store
    file: PathBuf,
    /// The tree of the store: NAME or NAME@VERSION; without, the last one. Its edits are where it starts from
    tree: Option<String>,
    /// Put the better plan into the store, as the next version of the tree
    #[arg(long)]
    save: bool,
    /// The plan; without it `main`
    #[arg(long, value_name = "NAME")]
    plan: Option<String>,
    /// An argument of the plan, as a form; once for each
    #[arg(long = "arg", value_name = "FORM", allow_hyphen_values = true)]
    args: Vec<String>,
    #[command(flatten)]
    rehearsing: Rehearsing,
    /// Write the plan file into another one, with the better plan as a variant `PLAN/better`
    #[arg(long, value_name = "OUT.plan")]
    emit: Option<PathBuf>,
    /// With --emit: write the plan out with the edits worked in, where that can be done, and say where it cannot
    #[arg(long, requires = "emit")]
    inline: bool,
    /// Only list the transformations
    #[arg(long)]
    list: bool,
    /// Say of each proposal that was refused why
    #[arg(long)]
    why: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Do not show the tree of the better plan
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    settings: Settings,
}

/// How to rehearse.
#[derive(Debug, Clone, Args)]
#[group(skip)]
pub struct Rehearsing {
    /// Which check decides: `static` (declared effects, and one run), `projected` (runs under some seeds), `paired` (as many
    /// as it takes to know)
    #[arg(long, value_name = "CHECK", default_value = "projected", value_parser = ["static", "projected", "paired"], help_heading = "Rehearsing")]
    accept: String,
    /// Under how many seeds the plan is rehearsed
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000), help_heading = "Rehearsing")]
    seeds: u32,
    /// Only these transformations
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', help_heading = "Rehearsing")]
    only: Vec<String>,
    /// A plan file with more transformations, a folder of such files, or a module of the library; once for each
    #[arg(long, value_name = "FILE|DIR|MODULE", help_heading = "Rehearsing")]
    rules: Vec<PathBuf>,
}

/// Longer edits are cut in what is said without --why, in characters.
const LONGEST: usize = 110;

/// The first seed of rehearsals lies so far from that of the run.
const FAR: u64 = 1_000_003;

impl Rehearsing {
    /// True if something was said that only a rehearsal needs.
    pub fn is_given(&self) -> bool {
        !self.only.is_empty() || !self.rules.is_empty()
    }

    /// The same for a session.
    pub fn wishes(&self, settings: &Settings) -> Result<Wishes, Trouble> {
        let mut rules = Vec::new();
        for path in &self.rules {
            rules.extend(plan_files(path)?);
        }
        Ok(Wishes {
            accept: self.accept.clone(),
            seeds: self.seeds,
            seed: settings.seed.wrapping_add(1).wrapping_mul(FAR),
            only: self.only.clone(),
            rules,
        })
    }
}

/// The plan files of a folder by name, or the file or module of the library that was named.
pub fn plan_files(path: &PathBuf) -> Result<Vec<PathBuf>, Trouble> {
    if path.is_file() || (!path.exists() && path.to_str().is_some_and(is_library)) {
        return Ok(vec![path.clone()]);
    }
    let cannot = |error| format!("cannot read {}: {}", path.display(), pleach::files::why(&error));
    let entries = std::fs::read_dir(path).map_err(cannot)?;
    let mut all: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    all.retain(|it| it.extension().is_some_and(|ending| ending == "plan"));
    all.sort();
    if all.is_empty() {
        let what = format!("there is no plan file in the folder {}", path.display());
        return Err(Trouble::new(what, "files of transformations end in .plan"));
    }
    Ok(all)
}

/// For the head of a log.
pub fn to_json(wishes: &Wishes) -> Json {
    json!({"accept": wishes.accept, "seeds": wishes.seeds, "seed": wishes.seed, "only": wishes.only, "rules": wishes.rules})
}

/// From the head of a log.
pub fn from_json(json: &Json) -> Option<Wishes> {
    let texts = |key: &str| -> Option<Vec<String>> {
        json[key].as_array()?.iter().map(|it| it.as_str().map(str::to_string)).collect()
    };
    Some(Wishes {
        accept: json["accept"].as_str()?.into(),
        seeds: u32::try_from(json["seeds"].as_u64()?).ok()?,
        seed: json["seed"].as_u64()?,
        only: texts("only")?,
        rules: texts("rules")?.into_iter().map(PathBuf::from).collect(),
    })
}

/// What is transformed: a plan as its file says it, or as a tree of a store has it by now.
struct Subject {
    job: Job,
    session: Session,
    base: Option<SavedTree>,
    /// The tree and its last version.
    version: Option<VersionRow>,
}

/// The plan of a file.
fn of_file(it: &Transform) -> Result<Subject, Trouble> {
    if let Some(name) = &it.tree {
        let what = format!("{} is no store, so it has no tree `{}`", it.file.display(), safe(name));
        return Err(Trouble::new(what, "name a plan file alone, or a store and a tree of it"));
    }
    let job = Job {
        file: it.file.clone(),
        plan: it.plan.clone(),
        args: it.args.clone(),
        settings: it.settings.clone(),
        rehearse: None,
    };
    let session = Session::new(job.settings.options(term::error_style())?);
    Ok(Subject { job, session, base: None, version: None })
}

/// The plan that a run of a store has run, with the edits that hold by now.
fn of_store(it: &Transform) -> Result<Subject, Trouble> {
    if it.plan.is_some() || !it.args.is_empty() {
        return Err(Trouble::new(
            "the plan of a stored run, and its arguments, are those of the run",
            "leave out --plan and --arg, or name the plan file instead of the store",
        ));
    }
    let store = Store::read(&it.file)?;
    let version = keep::version(&store, it.tree.as_deref(), None)?;
    // A version that was saved is of the plan that ran before it.
    let mut ran = version.clone();
    while let (Err(StoreError::Missing { .. }), Some(base)) = (store.run(&ran), ran.base) {
        ran = store.version_by_id(base)?;
    }
    let recorded = keep::recorded(&it.file, Some(&ran.id.to_string()), false)?;
    let mut job = Job { rehearse: None, ..recorded.job.clone() };
    job.settings.seed = it.settings.seed;
    let mut session = Session::new(job.settings.options_of_replay(term::error_style())?);
    session.files.use_shelf(recorded.texts());
    Ok(Subject { base: Some(store.tree(&version)?), version: Some(version), job, session })
}

/// Transforms a plan, and says what came of it.
pub fn run(it: &Transform) -> Answer {
    let wishes = it.rehearsing.wishes(&it.settings)?;
    let is_store = store::is_store(&it.file);
    if it.save && !is_store {
        return Err(Trouble::new(
            "--save puts the better plan into a store, and this is a plan file",
            "pleach run FILE --rehearse --store STORE --tree NAME keeps it with the run",
        ));
    }
    let Subject { job, mut session, base, version } = if is_store { of_store(it)? } else { of_file(it)? };
    let show = Show { quiet: it.quiet, json: it.json, ..Show::default() };
    if it.list {
        return list(session, &job, &wishes, it.json);
    }
    if !wishes.rules.is_empty() {
        // What is kept with a run is its program, without these.
        session.files.use_shelf(None);
    }
    let rehearsal = match rehearse(session, &job, &show, &wishes, base.as_ref())? {
        Ok(rehearsal) => rehearsal,
        Err(code) => return Ok(code),
    };
    let is_better = accepted(&rehearsal.report).next().is_some();
    let saved = match version.filter(|_| it.save && is_better) {
        Some(version) => Some(save(&it.file, &version, &rehearsal)?),
        None => None,
    };
    if it.emit.is_some() && !is_better {
        term::complain("note: nothing was kept, so nothing is written\n");
    }
    let emitted = match it.emit.as_deref().filter(|_| is_better) {
        Some(out) => Some(emit(it, &job, &rehearsal, out)?),
        None => None,
    };
    if it.json {
        let mut json = rehearsal.report.clone();
        json["saved"] = json!(saved);
        json["tree"] = rehearsal.nodes.clone();
        term::say(&format!("{json}\n"));
    } else {
        term::say(&text(&rehearsal.report, it.why));
        if !it.quiet {
            term::say(&term::paint_tree(&super::tree::outline(&rehearsal.nodes), term::out_style()));
        }
    }
    if let Some(said) = emitted {
        term::complain(&said);
    }
    if let Some(saved) = saved.filter(|_| !it.json) {
        term::say(&format!("saved as {}; `pleach run … --tree` goes on with it\n", safe(&saved)));
    }
    Ok(if is_better { 0 } else { FAILED })
}

/// Writes the text of the program with the better plan. What is to be said about it.
fn emit(it: &Transform, job: &Job, rehearsal: &Rehearsal, out: &Path) -> Result<String, Trouble> {
    let same = |a: &Path, b: &Path| a.canonicalize().is_ok_and(|a| b.canonicalize().is_ok_and(|b| a == b));
    if same(out, &job.file) {
        let what = format!("{} is the plan file itself, and is not overwritten", out.display());
        return Err(Trouble::new(what, "choose another name after --emit"));
    }
    let text = std::fs::read_to_string(&job.file)
        .map_err(|why| files::unreadable(&job.file, pleach::files::why(&why)))?;
    let cannot = |why: &String| Trouble::from(format!("the better plan cannot be written down: {why}"));
    let (better, notes) = match it.inline {
        false => (rehearsal.variant.as_ref().map_err(cannot)?.clone(), Vec::new()),
        true => {
            let it = rehearsal.inlined.as_ref().map_err(cannot)?;
            let left = it
                .left
                .iter()
                .map(|(edit, why)| format!("not worked in: {}: {why}", super::tree::cut(edit, LONGEST)));
            let held = steps(&rehearsal.report).iter().filter(|step| step["verdict"] == "accepted");
            let all: usize = held.map(|step| step["edits"].as_array().map_or(0, Vec::len)).sum();
            if it.left.len() >= all {
                let why = it.left.first().map_or("", |(_, why)| why.as_str());
                let what = format!("none of the {all} edits can be worked into the text: {why}");
                return Err(Trouble::new(
                    what,
                    "without --inline they are written as a variant, which does the same",
                ));
            }
            (it.text.clone(), left.chain(it.remarks.iter().cloned()).collect())
        }
    };
    let whole = format!("{}\n\n{}\n", text.trim_end(), better.trim_end());
    std::fs::write(out, whole).map_err(|error| Trouble::from(pleach::files::cannot_write(out, &error)))?;
    let plan = job.plan.as_deref().unwrap_or("main");
    let more =
        it.rehearsing.rules.iter().map(|rules| {
            format!("its edits may need what {} defines: load that with (use …)", rules.display())
        });
    let notes: Vec<String> = notes.into_iter().chain(more).collect();
    let mut said: String = notes.iter().map(|note| format!("note: {}\n", safe(note))).collect();
    said += &format!("written: pleach run {} --plan {plan}/better\n", out.display());
    Ok(said)
}

/// The better plan as the next version of a tree, with what was decided.
fn save(path: &Path, version: &VersionRow, rehearsal: &Rehearsal) -> Result<String, Trouble> {
    let (tree, base) = (version.tree.as_str(), Some(version.id));
    let mut writer = Writer::put(Store::write(path)?, tree, base, &rehearsal.tree, "transform")?;
    writer.decided(&keep::decisions(steps(&rehearsal.report)))?;
    Ok(format!("{tree}@{}", writer.version))
}

/// Rehearses what a job says, in this session, which is for nothing else; or the exit code of what was said about errors.
pub fn rehearse(
    mut session: Session,
    job: &Job,
    show: &Show,
    wishes: &Wishes,
    base: Option<&SavedTree>,
) -> Result<Result<Rehearsal, u8>, Trouble> {
    let loaded = session.load_file(&job.file).map_err(|why| files::unreadable(&job.file, why))?;
    if !loaded.reports.iter().all(Report::is_warning) {
        return Ok(Err(report::errors(&session, &loaded.reports, show)));
    }
    let plan = job.plan.as_deref().unwrap_or("main");
    if session.plan(plan).is_none() {
        return Err(super::run::no_plan(&session, plan));
    }
    call(&session, job)?;
    interrupt::listen();
    let mut progress = Progress::new();
    let result = session.rehearse(loaded, plan, &job.args, wishes, base, &mut progress);
    progress.clear();
    let trouble = match result {
        Ok(rehearsal) if session.has_transformations() => return Ok(Ok(rehearsal)),
        Ok(_) => Trouble::new(
            "no transformation is loaded, so there is nothing to improve",
            "write (use household) into the plan file, or name a file or folder after --rules",
        ),
        Err(NoRehearsal::Because(why)) => Trouble::from(why),
        Err(NoRehearsal::Stopped) => {
            term::complain("interrupted while the plan was rehearsed; nothing was changed\n");
            return Ok(Err(INTERRUPTED));
        }
        Err(NoRehearsal::NotLoaded(Ended::Errors(reports))) => {
            return Ok(Err(report::errors(&session, &reports, show)));
        }
        Err(NoRehearsal::NotLoaded(Ended::NotLoaded(failure) | Ended::Ran(Err(failure)))) => {
            term::complain("error: a file could not be loaded: one of its top-level forms failed\n");
            term::complain(&report::failure_text(&session, &failure));
            return Ok(Err(ERRORS));
        }
        Err(NoRehearsal::NotLoaded(_)) => Trouble::from(String::from("the program could not be loaded")),
        Err(NoRehearsal::Failed(failure)) => {
            term::complain("error: the rehearsal failed\n");
            term::complain(&report::failure_text(&session, &failure));
            return Ok(Err(ERRORS));
        }
    };
    std::mem::forget(session);
    Err(trouble)
}

fn list(mut session: Session, job: &Job, wishes: &Wishes, as_json: bool) -> Answer {
    let loaded = session.load_file(&job.file).map_err(|why| files::unreadable(&job.file, why))?;
    if !loaded.reports.iter().all(Report::is_warning) {
        return Ok(report::errors(&session, &loaded.reports, &Show::default()));
    }
    let all = match session.transformations(loaded, wishes, &mut String::new()) {
        Ok(all) => all,
        Err(NoRehearsal::Failed(failure)) => {
            term::complain(&report::failure_text(&session, &failure));
            return Ok(ERRORS);
        }
        Err(NoRehearsal::NotLoaded(Ended::Errors(reports))) => {
            return Ok(report::errors(&session, &reports, &Show::default()));
        }
        Err(NoRehearsal::Because(why)) => return Err(why.into()),
        Err(_) => return Err(String::from("the program could not be loaded").into()),
    };
    if as_json {
        term::say(&format!("{}\n", json!({"transformations": all})));
        return Ok(0);
    }
    let rows = all.as_array().map_or(&[][..], Vec::as_slice);
    if rows.is_empty() {
        term::say("no transformation is loaded: write (use household) into the plan file, or use --rules\n");
    }
    for it in rows {
        let doc = it["doc"].as_str().unwrap_or_default().lines().next().unwrap_or_default();
        let word = |key: &str| safe(it[key].as_str().unwrap_or_default());
        term::say(&format!(
            "{:>3}  {:<24} {:<9} {}\n",
            it["priority"],
            word("name"),
            word("state"),
            safe(doc)
        ));
    }
    Ok(0)
}

/// The steps that were kept.
fn accepted(report: &Json) -> impl Iterator<Item = &Json> {
    steps(report).iter().filter(|step| step["verdict"] == "accepted")
}

/// What was proposed, and what became of it.
pub fn steps(report: &Json) -> &[Json] {
    report["steps"].as_array().map_or(&[], Vec::as_slice)
}

/// What came of a rehearsal, for people.
pub fn text(report: &Json, why: bool) -> String {
    if let Some(why) = report["why"].as_str() {
        return format!("{}\n", safe(why));
    }
    let (before, after) = (report["before"].as_f64(), report["after"].as_f64());
    let seeds = report["seeds"].as_array().map_or(0, Vec::len);
    let mut out = String::new();
    if let (Some(before), Some(after)) = (before, after) {
        let percent = if before > 0.0 { (100.0 * (before - after) / before).round() } else { 0.0 };
        let (plural, word) = (if seeds == 1 { "" } else { "s" }, if percent < 0.0 { "more" } else { "less" });
        let percent = percent.abs();
        out += &format!(
            "rehearsed under {seeds} seed{plural}: {before:.1} s → {after:.1} s, {percent} % {word}\n"
        );
    }
    let kept = accepted(report).count();
    let refused = steps(report).len() - kept;
    for step in steps(report) {
        let is_kept = step["verdict"] == "accepted";
        if !is_kept && !why {
            continue;
        }
        let word = |key: &str| safe(step[key].as_str().unwrap_or_default());
        out += &format!("  {:<16} {} ({})", word("transformation"), word("verdict"), word("check"));
        out += &numbers(&step["numbers"]);
        if let Some(why) = step["why"].as_str() {
            out += &format!(": {}", safe(&why.replace('\n', "; ")));
        }
        out += "\n";
        for edit in step["edits"].as_array().into_iter().flatten().filter_map(Json::as_str) {
            let edit = if why { edit.to_string() } else { super::tree::cut(edit, LONGEST) };
            out += &format!("      {}\n", safe(&edit));
        }
    }
    match (kept, refused, why) {
        (0, 0, _) => out += "no transformation applies\n",
        (0, _, false) => out += &format!("nothing was kept; {refused} refused, --why says why\n"),
        (_, 1.., false) => out += &format!("{refused} refused, --why says why\n"),
        _ => {}
    }
    out
}

/// What a check has measured.
fn numbers(numbers: &Json) -> String {
    let number = |key: &str| numbers[key].as_f64();
    if let (Some(pairs), Some(saving), Some(low), Some(high)) =
        (number("pairs"), number("saving"), number("low"), number("high"))
    {
        return format!(", saves {saving:.1} s ({low:.1} to {high:.1}, {pairs} pairs)");
    }
    match (number("before"), number("after")) {
        (Some(before), Some(after)) => format!(", {before:.1} s → {after:.1} s"),
        _ => String::new(),
    }
}

/// Says on a terminal how many runs there have been.
struct Progress {
    watched: bool,
    shown: u64,
}

impl Progress {
    fn new() -> Progress {
        use std::io::IsTerminal as _;
        Progress { watched: std::io::stderr().is_terminal(), shown: 0 }
    }

    fn clear(&mut self) {
        if self.shown > 0 {
            term::complain("\r\x1b[K");
        }
    }
}

impl Output for Progress {
    fn print(&mut self, _text: &str) {}
    fn looked(&mut self, machine: &Machine) {
        if self.watched && machine.inner_runs() > self.shown {
            self.shown = machine.inner_runs();
            term::complain(&format!("\rrehearsing: {} runs", self.shown));
        }
    }
    fn goes_on(&mut self) -> bool {
        !interrupt::asked()
    }
}
