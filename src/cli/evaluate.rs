//! `pleach evaluate`: experiments with variants of a plan, and tables of what they have come to.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use pleach::Options;
use pleach::evaluate::export::Format;
use pleach::evaluate::folder::{self, Head, Runs};
use pleach::evaluate::report;
use pleach::evaluate::summary::Table;
use pleach::evaluate::work::{Evaluated, Watch, evaluate};
use pleach::evaluate::worker::{Program, Worker};
use pleach::evaluate::{Experiment, Stop, file_name, text};
use serde_json::json;
use vm::limits::{Grants, Limits};
use vm::show::safe;

use super::{Answer, INTERRUPTED, Trouble, count, interrupt, settings, term, transform};

pub const HELP: &str = "\
Examples:
  pleach evaluate kitchen.plan                          all experiments of the file: its (def-experiment …)
  pleach evaluate kitchen.plan tray-by-way --runs 20    one of them, with fewer runs
  pleach evaluate kitchen.plan --list
  pleach evaluate kitchen.plan --plan main --rules household --variants none,both-hands,tray,all --runs 200
  pleach evaluate kitchen.plan --out results            keep runs, tables and pictures in results/EXPERIMENT
  pleach evaluate kitchen.plan --out shards --shard 3/8       the third of eight parts, here or on another machine
  pleach evaluate merge shards --out results            bring the parts together

Each variant runs in projection under the same seeds, so that runs can be compared in pairs. A variant is the plan as it
is written (none), or with the edits that a transformation makes in a rehearsal, under seeds that are not those of the
runs; several are written tray+both-hands, and all are all that are loaded. --accept says which check decides on edits: with static
they are taken whether they pay or not. The table counts all runs, and beside them the pairs in which both runs succeeded.

A run is a function of the program, the case, the variant and the seed: the same command gives the same numbers, however many
--jobs there are. With --out an evaluation that was stopped goes on by the same command, and with more --runs it
is enlarged. One run by itself: pleach run FILE --plan PLAN --arg … --seed N, for a variant with
--store OUT/EXPERIMENT/variants.store --tree VARIANT.

With --out DIR, in DIR/EXPERIMENT: evaluation.json, what was evaluated and with which edits · runs.csv, a line for each
run (--format: json, parquet) · summary.json, all statistics · report.html with the pictures · a .svg for each.
With --json stdout is {experiments: [what stands in summary.json]}.
Exit codes: 0 done · 2 errors · 130 stopped by Ctrl-C; what was done is kept with --out, and shown.";

/// `pleach evaluate`
#[derive(Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Evaluate {
    #[command(subcommand)]
    merge: Option<Merge>,
    /// The plan file
    #[arg(required = true)]
    file: Option<PathBuf>,
    /// Which of its experiments; without one all of them
    #[arg(value_name = "EXPERIMENT", conflicts_with = "plan")]
    names: Vec<String>,
    /// Evaluate this plan instead of an experiment; without any, `main`
    #[arg(long, value_name = "NAME")]
    plan: Option<String>,
    /// An argument of the plan, as a form; once for each
    #[arg(long = "arg", value_name = "FORM", allow_hyphen_values = true, requires = "plan")]
    args: Vec<String>,
    /// What is compared; the first is what the others are compared with
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    variants: Vec<String>,
    /// How many runs of each variant in each case
    #[arg(long, value_name = "N", value_parser = settings::count)]
    runs: Option<u64>,
    /// The first seed
    #[arg(long, value_name = "N", value_parser = settings::count)]
    seed: Option<u64>,
    /// Which check decides on edits
    #[arg(long, value_name = "CHECK", value_parser = ["static", "projected", "paired"], help_heading = "Rehearsing")]
    accept: Option<String>,
    /// Under how many seeds variants are rehearsed
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000), help_heading = "Rehearsing")]
    seeds: Option<u64>,
    /// A plan file with more transformations, a folder of such files, or a module of the library; once for each
    #[arg(long, value_name = "FILE|DIR|MODULE", help_heading = "Rehearsing")]
    rules: Vec<PathBuf>,
    /// How many runs at a time; without it one for each core
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1024))]
    jobs: Option<u64>,
    /// Do the i-th of n parts
    #[arg(long, value_name = "i/n", value_parser = folder::shard, requires = "out")]
    shard: Option<(u64, u64)>,
    /// Only list the experiments
    #[arg(long)]
    list: bool,
    /// Let the program read files while it is loaded (`read=DIR`)
    #[arg(long, value_name = "GRANT")]
    allow: Vec<String>,
    #[command(flatten)]
    show: Show,
}

/// Where results go.
#[derive(Args)]
#[group(skip)]
struct Show {
    /// Keep runs, tables and pictures in a folder, and go on with those that it has
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// In which formats the runs are written, besides CSV: json, parquet
    #[arg(long, value_name = "FORMAT,…", value_delimiter = ',', requires = "out")]
    format: Vec<Format>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Do not show the tables
    #[arg(long, short)]
    quiet: bool,
}

#[derive(Subcommand)]
enum Merge {
    /// Bring the parts of an evaluation together; doing it again changes nothing
    Merge {
        /// What --shard or --out has written, or folders of that
        #[arg(required = true, value_name = "DIR")]
        from: Vec<PathBuf>,
        #[command(flatten)]
        show: Show,
    },
}

/// Evaluates, or merges.
pub fn run(it: &Evaluate) -> Answer {
    if let Some(Merge::Merge { from, show }) = &it.merge {
        return merge(from, show);
    }
    let program = program(it)?;
    let threads = match it.jobs {
        Some(jobs) => usize::try_from(jobs).unwrap_or(1),
        None => std::thread::available_parallelism().map_or(1, usize::from),
    };
    interrupt::listen();
    let on = || !interrupt::asked();
    let mut worker = Worker::new(&program, &on).map_err(stopped)?;
    let experiments = worker.experiments().map_err(stopped)?;
    let fingerprint = worker.fingerprint();
    std::mem::forget(worker);
    let chosen = chosen(it, experiments)?;
    check(it, &chosen)?;
    if it.list {
        return Ok(list(&chosen, it.show.json));
    }
    let mut tables = Vec::new();
    for (at, experiment) in chosen {
        let wanted = experiment.runs;
        let folder = it.show.out.as_ref().map(|out| folder_of(out, it.shard, &experiment));
        let file = program.file.file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned());
        let head = Head::new(experiment, fingerprint.clone(), file, it.shard);
        let bar = Bar::new(&head.experiment.name);
        let ended = evaluate(&program, (at, head), threads, folder.as_deref(), &bar);
        bar.bar.finish_and_clear();
        let Evaluated { head, runs, stopped } = ended.map_err(self::stopped)?;
        if head.experiment.runs > wanted && !it.show.quiet {
            let runs = head.experiment.runs;
            term::complain(&format!(
                "note: the folder has been asked for {runs} runs of each variant, and all of them count\n"
            ));
        }
        let table = Table::of(&head, &runs);
        show(&table, &runs, folder.as_deref(), &it.show, stopped)?;
        tables.push(table);
        if stopped {
            term::complain(match folder {
                Some(_) => "interrupted; the same command goes on with what is kept\n",
                None => "interrupted; nothing is kept without --out\n",
            });
            finish(&tables, &it.show);
            return Ok(INTERRUPTED);
        }
    }
    finish(&tables, &it.show);
    Ok(0)
}

fn program(it: &Evaluate) -> Result<Program, Trouble> {
    let mut rules = Vec::new();
    for path in &it.rules {
        rules.extend(transform::plan_files(path)?);
    }
    let mut grants = Grants::default();
    for text in &it.allow {
        grants.allow(text).map_err(|why| {
            Trouble::new(format!("--allow {text}: {why}"), "for example: --allow read=data")
        })?;
    }
    Ok(Program {
        file: it.file.clone().unwrap_or_default(),
        rules,
        plan: it.plan.clone(),
        args: it.args.clone(),
        variants: it.variants.clone(),
        accept: it.accept.clone(),
        seeds: it.seeds,
        seed: it.seed,
        runs: it.runs,
        // Each session does many runs.
        options: Options {
            limits: Limits { fuel: u64::MAX / 2, ..Limits::default() },
            grants,
            style: term::error_style(),
            ..Options::default()
        },
    })
}

/// Why there is nothing to show.
fn stopped(stop: Stop) -> Trouble {
    match stop {
        Stop::Asked => Trouble::from(String::from("interrupted before anything was done")),
        Stop::Because(why) => Trouble::from(why.trim_end().to_string()),
    }
}

/// The experiments that are meant, with their numbers.
fn chosen(it: &Evaluate, all: Vec<Experiment>) -> Result<Vec<(usize, Experiment)>, Trouble> {
    if all.is_empty() {
        return Err(Trouble::new(
            "the file defines no experiment",
            "name a plan with --plan and what to compare with --variants, or write (use experiment) and (def-experiment …)",
        ));
    }
    for name in &it.names {
        if !all.iter().any(|it| it.name == *name) {
            let names: Vec<&str> = all.iter().map(|it| it.name.as_str()).collect();
            let help = match compiler::module::nearest(name, names.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("its experiments are: {}", names.join(" ")),
            };
            return Err(Trouble::new(format!("the file has no experiment called `{}`", safe(name)), help));
        }
    }
    let meant = |name: &String| it.names.is_empty() || it.names.contains(name);
    Ok(all.into_iter().enumerate().filter(|(_, experiment)| meant(&experiment.name)).collect())
}

/// That all of them can be evaluated, and do not get into each other's way, before the first of them begins.
fn check(it: &Evaluate, chosen: &[(usize, Experiment)]) -> Result<(), Trouble> {
    let mut folders: Vec<(PathBuf, &str)> = Vec::new();
    for (_, experiment) in chosen {
        if let Some(why) = experiment.trouble() {
            return Err(
                format!("the experiment {} cannot be evaluated: {why}", safe(&experiment.name)).into()
            );
        }
        let folder = folder_of(Path::new(""), None, experiment);
        if let (Some((_, other)), true) =
            (folders.iter().find(|(path, _)| *path == folder), it.show.out.is_some())
        {
            let what = format!(
                "the experiments {} and {} have the same folder",
                safe(other),
                safe(&experiment.name)
            );
            return Err(Trouble::new(what, "name one of them, or give each evaluation an --out of its own"));
        }
        folders.push((folder, &experiment.name));
    }
    Ok(())
}

fn list(chosen: &[(usize, Experiment)], as_json: bool) -> u8 {
    if as_json {
        let all: Vec<_> = chosen.iter().map(|(_, it)| it.to_json()).collect();
        term::say(&format!("{}\n", json!({"experiments": all})));
        return 0;
    }
    for (_, it) in chosen {
        let variants: Vec<&str> = it.variants.iter().map(|it| it.name.as_str()).collect();
        let doc = it.doc.lines().next().unwrap_or_default();
        term::say(&format!("{}  {}\n", safe(&it.name), safe(doc)));
        term::say(&format!(
            "    {} · {} · {} of {}\n",
            safe(&it.plan),
            count(it.cases.len(), "case"),
            count(usize::try_from(it.runs).unwrap_or(usize::MAX), "run"),
            safe(&variants.join(", "))
        ));
    }
    0
}

/// Where the runs of an experiment are kept.
fn folder_of(out: &Path, shard: Option<(u64, u64)>, it: &Experiment) -> PathBuf {
    let name = file_name(&it.name);
    match shard {
        Some((shard, of)) => out.join(format!("shard-{shard}-of-{of}")).join(name),
        None => out.join(name),
    }
}

/// Prints the table, and writes what belongs to it into the folder.
fn show(
    table: &Table,
    runs: &Runs,
    folder: Option<&Path>,
    show: &Show,
    stopped: bool,
) -> Result<(), Trouble> {
    if !show.quiet && !show.json && table.done > 0 {
        term::say(&format!("{}\n", text::text(table)));
    }
    if let Some(folder) = folder.filter(|_| !stopped) {
        report::write(folder, table, runs, &show.format)?;
        if !show.quiet {
            term::complain(&format!("written: {}\n", folder.join(report::PAGE).display()));
        }
    }
    Ok(())
}

fn finish(tables: &[Table], show: &Show) {
    if show.json {
        let all: Vec<_> = tables.iter().map(Table::to_json).collect();
        term::say(&format!("{}\n", json!({"experiments": all})));
    }
}

/// Parts of evaluations, by the names of their experiments.
type Parts = std::collections::BTreeMap<String, Vec<(PathBuf, Head, Runs)>>;

fn merge(from: &[PathBuf], show: &Show) -> Answer {
    let Some(out) = &show.out else {
        return Err(Trouble::new(
            "it is not said where to",
            "name a folder: pleach evaluate merge DIR … --out DIR",
        ));
    };
    let mut parts = Parts::new();
    for path in from {
        if !find(path, DEPTH, &mut parts)? {
            let what = format!("there is no evaluation in {}", path.display());
            return Err(Trouble::new(what, "evaluations are made by pleach evaluate FILE --out DIR"));
        }
    }
    let mut tables = Vec::new();
    for parts in parts.values() {
        let folder = folder_of(out, None, &parts[0].1.experiment);
        let (head, runs) = folder::merge(parts, &folder)?;
        let table = Table::of(&head, &runs);
        self::show(&table, &runs, Some(&folder), show, false)?;
        tables.push(table);
    }
    finish(&tables, show);
    Ok(0)
}

/// Evaluations lie so deep in the folders that are named: shard, experiment.
const DEPTH: usize = 3;

/// Collects the evaluations in a folder and those below it. True if there is one.
fn find(path: &Path, depth: usize, parts: &mut Parts) -> Result<bool, Trouble> {
    if let Some((head, runs)) = folder::read(path)? {
        parts.entry(head.experiment.name.clone()).or_default().push((path.to_path_buf(), head, runs));
        return Ok(true);
    }
    if depth == 0 || !path.is_dir() {
        return Ok(false);
    }
    let cannot = |error| format!("cannot read {}: {}", path.display(), pleach::files::why(&error));
    let mut below: Vec<PathBuf> =
        std::fs::read_dir(path).map_err(cannot)?.filter_map(|entry| Some(entry.ok()?.path())).collect();
    below.sort();
    let mut found = false;
    for path in below.iter().filter(|path| path.is_dir()) {
        found |= find(path, depth - 1, parts)?;
    }
    Ok(found)
}

/// How far it is, on a terminal.
struct Bar {
    bar: ProgressBar,
    name: String,
}

impl Bar {
    fn new(name: &str) -> Bar {
        Bar { bar: ProgressBar::no_length(), name: safe(name) }
    }
}

impl Watch for Bar {
    fn begins(&self, what: &str, done: usize, of: usize) {
        let template = "{msg} {wide_bar} {pos} of {len}, {eta} left";
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style);
        }
        self.bar.set_message(format!("{}: {what}", self.name));
        self.bar.set_length(of as u64);
        self.bar.reset();
        self.bar.set_position(done as u64);
        self.bar.reset_eta();
        self.bar.enable_steady_tick(Duration::from_millis(500));
    }
    fn did(&self) {
        self.bar.inc(1);
    }
    fn goes_on(&self) -> bool {
        !interrupt::asked()
    }
}
