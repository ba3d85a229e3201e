//! `pleach store`: checks, saves, mends and empties stores.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use store::{Store, StoreError, VersionRow};
use vm::show::safe;

use super::{Answer, FAILED, count, term, transfer};

pub const HELP: &str = "\
Examples:
  pleach store check runs.store                 reads everything and says what is whole
  pleach store export runs.store runs.json      all that is whole, as JSON: trees, runs, logs, programs
  pleach store import new.store runs.json       the same into a store; what is there already is passed over
  pleach store gc runs.store --keep 3           forgets all but the last 3 versions of each tree

An imported run can be replayed and asked where its program is not, and gone on with where it is. Versions
keep their numbers unless the store has later ones; runs without --tree get names of their own again.

Exit codes: 0 all is well · 1 something is damaged or was left out · 2 it cannot be done.";

/// `pleach store`
#[derive(Args)]
pub struct Command {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Read everything and say what is whole
    Check {
        /// The store
        store: PathBuf,
    },
    /// Write all versions that are whole into a file, as JSON, with their runs
    Export {
        /// The store
        store: PathBuf,
        /// The file; it must not be there yet
        file: PathBuf,
    },
    /// Take exported versions into a store
    Import {
        /// The store; it is made if it is not there
        store: PathBuf,
        /// What `pleach store export` has written
        file: PathBuf,
    },
    /// Forget old versions, and make the file smaller
    Gc {
        /// The store
        store: PathBuf,
        /// So many versions of each tree stay
        #[arg(long, value_name = "N", value_parser = super::settings::count)]
        keep: u64,
    },
}

/// Does it.
pub fn run(it: &Command) -> Answer {
    match &it.what {
        What::Check { store } => check(&Store::read(store)?),
        What::Export { store, file } => transfer::export(&Store::read(store)?, file),
        What::Import { store, file } => transfer::import(store, file),
        What::Gc { store, keep } => gc(Store::write(store)?, *keep),
    }
}

fn check(store: &Store) -> Answer {
    let mut bad = 0;
    if let Some(said) = store.check_pages() {
        bad += 1;
        term::say(&format!("the file: {}\n", safe(&said)));
    }
    for finding in store.check()? {
        let version = &finding.version;
        let name = format!("{}@{}", safe(&version.tree), version.version);
        match finding.trouble {
            None => {
                let nodes = count(version.records as usize, "node");
                let entries = count(version.entries as usize, "entry").replace("entrys", "entries");
                term::say(&format!("{name}: whole, {nodes}, {entries} in its log\n"));
            }
            Some(trouble) => {
                bad += 1;
                term::say(&format!("{name}: {trouble}\n"));
            }
        }
    }
    Ok(if bad > 0 { FAILED } else { 0 })
}

fn gc(mut from: Store, keep: u64) -> Answer {
    let versions = from.versions()?;
    let mut stays = std::collections::BTreeSet::new();
    // Runs without --tree, each of which has a tree of its own, count as versions of one.
    let tree = |it: &VersionRow| match it.tree == store::own_name(it.id) {
        true => None,
        false => Some(it.tree.clone()),
    };
    for version in &versions {
        let later = versions.iter().filter(|other| tree(other) == tree(version) && other.id > version.id);
        let unfinished = match from.run(version) {
            Ok(run) => matches!(run.outcome.as_str(), "running" | "stopped" | "interrupted"),
            Err(StoreError::Missing { .. }) => false,
            Err(error) => return Err(error.into()),
        };
        if (later.count() as u64) < keep || unfinished {
            stays.insert(version.id);
            // To run it again, what it goes on with is needed.
            stays.extend(version.base);
        }
    }
    let gone: Vec<i64> = versions.iter().map(|it| it.id).filter(|id| !stays.contains(id)).collect();
    from.forget(&gone)?;
    term::say(&format!("{} forgotten, {} left\n", count(gone.len(), "version"), versions.len() - gone.len()));
    Ok(0)
}
