//! `pleach resume` and `pleach replay`: a run is its log.
//!
//! Program, seed and log give the same tree. So going on means running again from the start with
//! the answers of the log, and looking at a moment means stopping there.

use std::path::{Path, PathBuf};

use clap::Args;

use super::journal::Recorded;
use super::keep;
use super::moment::Target;
use super::run::{Show, Start, perform};
use super::{Answer, Trouble, term};

pub const RESUME_HELP: &str = "\
Example:
  pleach run long.plan --log long.log --stop-at 5000      (or a run that was killed)
  pleach resume long.log
  pleach run long.plan --store runs.store                 (and the same, in a store)
  pleach resume runs.store                                the last run in it that has not ended
  pleach resume runs.store 3                              run 3

The program runs again from its start, with the answers that the log has; then it goes on and adds
to the log. What it prints, it prints again. Seed, limits and grants are those of the log. Output,
--json and exit codes are those of `pleach run`.";

pub const REPLAY_HELP: &str = "\
Examples:
  pleach replay long.log                 the same output and the same tree again
  pleach replay long.log --to 3000       at that step
  pleach replay long.log --to 12.5s      at that time of the task clock
  pleach replay runs.store 3 --to 'transporting :call 2 / fetching'
                                         where the first task begins whose path ends so
  pleach replay runs.store 3             run 3 of a store
  pleach replay runs.store kitchen@2     the run that made version 2 of a tree

Nothing outside is read or changed: all answers come from the log, and the replay ends where the
log ends. Output, --json and exit codes are those of `pleach run`.

With --to also that moment is shown: what tasks wait for, what fluents hold, the world and what the
robot believes of it. At a time all has happened that happens until then. With --json the object has
  tasks     [{path, what}], those that have not ended
  fluents   [{name, fluent, value}]; the name of the constant that holds it, if one does
  world     {robot: {name, base, joints}, hands, objects: [{name, type, on, pose}], containers,
            motions: [{motion, begin, lasts}]}, with motions played up to that moment; null without one
  beliefs   {seen: [{name, at, pose}], open}; null without a world
Poses are [x, y, z, qx, qy, qz, qw], in metres.";

/// `pleach resume`
#[derive(Args)]
pub struct Resume {
    /// The log of the run, or a store
    log: PathBuf,
    /// Which run of the store: its number, or NAME@VERSION of its tree; without, the last that has not ended
    run: Option<String>,
    /// Stop when so many calls and backward jumps have been done
    #[arg(long, value_name = "STEP", value_parser = super::settings::count)]
    stop_at: Option<u64>,
    #[command(flatten)]
    show: Show,
}

/// `pleach replay`
#[derive(Args)]
pub struct Replay {
    /// The log of the run, or a store
    log: PathBuf,
    /// Which run of the store: its number, or NAME@VERSION of its tree; without, the last one
    run: Option<String>,
    /// As far as this: a step (calls and backward jumps), a time (12.5s) or the begin of a task (the end of its path)
    #[arg(long, value_name = "STEP|TIME|PATH", value_parser = Target::read)]
    to: Option<Target>,
    #[command(flatten)]
    show: Show,
}

/// Goes on with a run.
pub fn resume(it: &Resume) -> Answer {
    let recorded = recorded(&it.log, it.run.as_deref(), true)?;
    recorded.enter_folder()?;
    if !recorded.job.settings.allow.is_empty() {
        term::complain(&format!("allowed, as the log says: {}\n", recorded.job.settings.allow.join(" ")));
    }
    let start = Start { recorded: Some(&recorded), stop_at: it.stop_at, ..Start::default() };
    perform(&recorded.job, &it.show, &start)
}

/// Looks at a run again.
pub fn replay(it: &Replay) -> Answer {
    let recorded = recorded(&it.log, it.run.as_deref(), false)?;
    // A store has the program, too, but not the rules of a rehearsal.
    let reads_rules = recorded.job.rehearse.as_ref().is_some_and(|wishes| !wishes.rules.is_empty());
    if recorded.texts().is_none() || reads_rules {
        recorded.enter_folder()?;
    }
    let to = it.to.clone();
    let start = Start { recorded: Some(&recorded), to, sealed: true, ..Start::default() };
    perform(&recorded.job, &it.show, &start)
}

fn recorded(path: &Path, run: Option<&str>, to_go_on: bool) -> Result<Recorded, Trouble> {
    match (store::is_store(path), run) {
        (true, run) => keep::recorded(path, run, to_go_on),
        (false, None) => Recorded::read(path),
        (false, Some(_)) => {
            let what = format!("{} is no store, so it has no runs to choose from", path.display());
            Err(Trouble::new(what, "name a log alone, or a store and a run of it"))
        }
    }
}
