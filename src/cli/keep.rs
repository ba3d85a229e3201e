//! Runs in a store: writing one while it runs, finding one to go on with or to look at.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use pleach::files::Files;
use serde_json::Value as Json;
use store::{Begin, Decision, Fault, Source, Store, StoreError, VersionRow, Writer};
use vm::log::Entry;
use vm::machine::Machine;
use vm::persist::{SavedEdit, SavedTree};

use super::Trouble;
use super::journal::{self, Recorded};
use super::run::Job;

/// A batch is written when so many entries of the log wait.
const MOST_ENTRIES: usize = 256;
/// Or so many records of tasks.
const MOST_RECORDS: usize = 8192;
/// Or when something waits and so much time has passed.
const MOST_TIME: Duration = Duration::from_millis(100);
/// Rows that had been written before are not written again until so many times the time has passed that this took: many
/// tasks that end one by one stand in chunks with many that do not.
const PAUSE: f64 = 4.0;

impl From<StoreError> for Trouble {
    fn from(error: StoreError) -> Trouble {
        Trouble { what: error.to_string(), help: error.help() }
    }
}

/// Where a run is kept.
#[derive(Debug, Clone)]
pub struct Place {
    /// The store.
    pub path: PathBuf,
    /// The tree that it goes on with; nothing for a new one.
    pub tree: Option<String>,
    /// For tests: after so many calls of the store one fails so.
    pub fails_in: Option<(u64, Fault)>,
}

/// Keeps a run.
pub struct Keeper {
    writer: Writer,
    path: PathBuf,
    last: Instant,
    /// How long it stays as it is.
    pause: Duration,
}

impl Keeper {
    /// Opens the store for a new run. It is opened before the run begins: whoever cannot write it wants to know that
    /// then.
    pub fn begin(
        store: Store,
        place: &Place,
        job: &Job,
        files: &Files,
        plan: Option<String>,
        base: Option<i64>,
        orphans: Vec<(SavedEdit, String)>,
    ) -> Result<Keeper, Trouble> {
        let sources = journal::hashes(files).into_iter().map(|(file, hash)| {
            let text = files.iter().find(|it| it.name == file).map(|it| it.text.clone());
            Source { file, hash, text }
        });
        let head = journal::head(job, files);
        let begin = Begin {
            tree: place.tree.clone(),
            base,
            file: job.file.display().to_string(),
            plan: plan.or_else(|| job.plan.clone()),
            program: head["program"].as_str().unwrap_or_default().into(),
            sources: sources.collect(),
            seed: job.settings.seed,
            schedule: job.settings.schedule,
            robot: job.settings.robot.mode().name().into(),
            head: head.to_string(),
            orphans,
        };
        let mut writer = Writer::begin(store, begin)?;
        writer.fails_at = place.fails_in.map(|(calls, fault)| (writer.calls() + calls, fault));
        Ok(Keeper { writer, path: place.path.clone(), last: Instant::now(), pause: Duration::ZERO })
    }

    /// Goes on with a run.
    pub fn resume(path: &Path, id: i64) -> Result<Keeper, Trouble> {
        let writer = Writer::resume(path, id)?;
        Ok(Keeper { writer, path: path.into(), last: Instant::now(), pause: Duration::ZERO })
    }

    /// What came from outside.
    pub fn logged(&mut self, entry: &Entry) {
        self.writer.logged(entry);
    }

    /// Asked while time passes: what came from outside is not kept waiting.
    pub fn nap(&mut self) -> Result<(), StoreError> {
        if self.last.elapsed() < MOST_TIME {
            return Ok(());
        }
        self.last = Instant::now();
        self.writer.write_log()
    }

    /// Looks at the run between two stretches of work, and writes what is new when there is enough of it.
    pub fn look(&mut self, machine: &Machine) -> Result<(), StoreError> {
        let (entries, records) = self.writer.waiting(machine.tree(), machine.steps());
        let due = entries >= MOST_ENTRIES || records >= MOST_RECORDS;
        if !due && (self.last.elapsed() < MOST_TIME || !self.writer.is_behind(machine.steps())) {
            return Ok(());
        }
        if self.last.elapsed() < self.pause {
            return if entries >= MOST_ENTRIES { self.writer.write_log() } else { Ok(()) };
        }
        let begin = Instant::now();
        self.writer.write(&machine.program, machine.tree(), machine.steps())?;
        self.last = Instant::now();
        self.pause = begin.elapsed().mul_f64(PAUSE * self.writer.again());
        Ok(())
    }

    /// What became of the proposals of a rehearsal: `steps` of its report.
    pub fn decided(&mut self, steps: &[Json]) -> Result<(), StoreError> {
        let decisions = decisions(steps);
        if decisions.is_empty() { Ok(()) } else { self.writer.decided(&decisions) }
    }

    /// Writes how the run ended.
    pub fn end(&mut self, machine: &Machine, outcome: &str, value: Option<&str>) -> Result<(), StoreError> {
        let (tree, steps, now) = (machine.tree(), machine.steps(), machine.now());
        self.writer.end(&machine.program, tree, steps, now, outcome, value)
    }

    /// True if this file is the store.
    pub fn is_in(&self, store: &Path) -> bool {
        let full = |path: &Path| path.canonicalize().ok();
        full(store).is_some_and(|store| full(&self.path) == Some(store))
    }

    /// The one who writes.
    pub fn writer(&mut self) -> &mut Writer {
        &mut self.writer
    }

    /// How to go on with it.
    pub fn resume_words(&self) -> String {
        format!("pleach resume {} {}", self.path.display(), self.writer.id)
    }
}

/// Steps of a rehearsal, as a store keeps them.
pub fn decisions(steps: &[Json]) -> Vec<Decision> {
    let word = |step: &Json, key: &str| step[key].as_str().unwrap_or_default().to_string();
    let decision = |step: &Json| {
        let edits = step["edits"].as_array().into_iter().flatten().filter_map(Json::as_str);
        let edits: Vec<&str> = edits.collect();
        Decision {
            what: format!("{}: {}", word(step, "transformation"), edits.join(" ")),
            decision: format!("{} ({})", word(step, "verdict"), word(step, "check")),
            why: word(step, "why"),
            numbers: step["numbers"].to_string(),
        }
    };
    steps.iter().map(decision).collect()
}

/// The version that is meant: `kitchen`, `kitchen@2`, or the number of a run; without a word the last one.
pub fn version(store: &Store, word: Option<&str>, number: Option<i64>) -> Result<VersionRow, Trouble> {
    let Some(word) = word else { return Ok(store.last()?) };
    if let Some(number) = number {
        return Ok(store.version(word, Some(number))?);
    }
    if let Some((tree, version)) = word.rsplit_once('@')
        && let Ok(version) = version.parse()
    {
        return Ok(store.version(tree, Some(version))?);
    }
    match (store.version(word, None), word.parse()) {
        (Err(StoreError::Missing { .. }), Ok(id)) => Ok(store.version_by_id(id)?),
        (found, _) => Ok(found?),
    }
}

/// The run to go on with: one that has not ended.
pub fn unfinished(store: &Store) -> Result<VersionRow, Trouble> {
    for version in store.versions()?.into_iter().rev() {
        match store.run(&version) {
            Ok(run) if is_unfinished(&run.outcome) => return Ok(version),
            Ok(_) | Err(StoreError::Missing { .. }) => {}
            Err(error) => return Err(error.into()),
        }
    }
    let what = format!("all runs in the store {} have ended", store.path.display());
    Err(Trouble::new(what, "`pleach replay STORE RUN` runs one again; `pleach tree STORE` lists them"))
}

fn is_unfinished(outcome: &str) -> bool {
    matches!(outcome, "running" | "stopped" | "interrupted")
}

/// A run of a store, to be run again.
pub fn recorded(path: &Path, run: Option<&str>, to_go_on: bool) -> Result<Recorded, Trouble> {
    let path = path.canonicalize().map_err(|error| {
        Trouble::from(format!("cannot read the store {}: {}", path.display(), pleach::files::why(&error)))
    })?;
    let store = Store::read(&path)?;
    let version = match run {
        None if to_go_on => unfinished(&store)?,
        run => version(&store, run, None)?,
    };
    let run = store.run(&version)?;
    if to_go_on && !is_unfinished(&run.outcome) {
        let what = format!("run {} of the store {} has ended: {}", version.id, path.display(), run.outcome);
        return Err(Trouble::new(
            what,
            format!("run it again with: pleach replay {} {}", path.display(), version.id),
        ));
    }
    let head = serde_json::from_str(&run.head).unwrap_or_default();
    let texts = texts(&store, &version, &run.program)?;
    Recorded::of_store(&head, store.log(&version)?, &path, version.id, version.base, texts)
}

/// The texts of a program, by the names of its files.
pub fn texts(
    store: &Store,
    version: &VersionRow,
    program: &str,
) -> Result<BTreeMap<String, String>, Trouble> {
    let files = store.program(version, program)?;
    Ok(files.into_iter().filter_map(|it| Some((it.file, it.text?))).collect())
}

/// The version that a run goes on with, as rows.
pub fn base(store: &Store, id: i64) -> Result<SavedTree, Trouble> {
    let version = store.version_by_id(id)?;
    Ok(store.tree(&version)?)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use clap::Parser as _;
    use store::{Fault, Store};

    use crate::cli::{Answer, Command, ERRORS, Line, exit_code, resume, run};

    fn line(words: &[&str]) -> Command {
        Line::try_parse_from(words).unwrap_or_else(|error| panic!("{error}")).command
    }

    #[track_caller]
    fn assert_whole(store: &Path) {
        let store = Store::read(store).expect("it opens");
        assert_eq!(store.check_pages(), None);
        let findings = store.check().expect("it is read");
        assert!(findings.iter().all(|it| it.trouble.is_none()), "{findings:?}");
    }

    /// Runs with a store whose call of this number fails.
    fn run_until(folder: &Path, store: &Path, calls: u64, fault: Fault) -> Answer {
        let (file, store) = (folder.join("work.plan"), store.display().to_string());
        let (read, write) = (format!("read={}", folder.display()), format!("write={}", folder.display()));
        let words = ["pleach", "run", &file.display().to_string(), "--allow", &read, "--allow", &write];
        let Command::Run(mut it) = line(&[&words[..], &["--quiet", "--store", &store]].concat()) else {
            panic!("it is a run")
        };
        it.store_fails_in = Some((calls, fault));
        run::run(*it)
    }

    fn go_on(store: &Path) -> Answer {
        let Command::Resume(it) = line(&["pleach", "resume", &store.display().to_string(), "--quiet"]) else {
            panic!("it goes on")
        };
        resume::resume(&it)
    }

    /// Runs until one of the first calls fails, then the next one, as long as there are so many.
    fn fail(name: &str, rounds: u32, faults: &[Fault]) -> u64 {
        let folder = std::env::temp_dir().join(format!("pleach-fails-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder can be made");
        let there = |name| format!("\"{}", folder.join(name).display());
        let work = include_str!("../../tests/store/work.plan");
        let work = work.replace("\"in.txt", &there("in.txt")).replace("\"out.txt", &there("out.txt"));
        let work = work.replace("(n 40)", &format!("(n {rounds})"));
        std::fs::write(folder.join("work.plan"), work).expect("it can be written");
        std::fs::write(folder.join("in.txt"), "hello").expect("it can be written");
        let mut tried = 0;
        for fault in faults {
            for calls in 1.. {
                let store = folder.join(format!("{fault:?}-{calls}.store"));
                let Err(trouble) = run_until(&folder, &store, calls, *fault) else { break };
                tried += 1;
                let what = &trouble.what;
                let why = match fault {
                    Fault::Full => "the disk is full",
                    Fault::Broken => "input or output failed",
                    Fault::Locked => "another process holds it",
                };
                assert!(what.contains("cannot write the store") && what.contains(why), "{what}");
                assert_eq!(exit_code(Err(trouble)), ERRORS);
                assert_whole(&store);
                assert_eq!(go_on(&store).expect("it goes on"), 0);
                assert_whole(&store);
                let _ = std::fs::remove_file(&store);
            }
        }
        let _ = std::fs::remove_dir_all(&folder);
        tried
    }

    #[test]
    fn each_call_of_the_store_may_fail() {
        assert!(fail("small", 2, Fault::ALL) > 30);
    }

    #[test]
    #[ignore = "takes a minute"]
    fn each_call_of_the_store_may_fail_in_a_run_of_many_batches() {
        assert!(fail("large", 40, &[Fault::Full]) > 100);
    }
}
