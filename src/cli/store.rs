//! `pleach store`: checks, saves, mends and empties stores.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use serde_json::{Value as Json, json};
use store::{Store, StoreError, VersionRow, Writer};
use vm::persist::SavedTree;
use vm::show::safe;

use super::{Answer, FAILED, Trouble, count, term};

pub const HELP: &str = "\
Examples:
  pleach store check runs.store                 reads everything and says what is whole
  pleach store export runs.store trees.json     all trees that are whole, as JSON
  pleach store import new.store trees.json      the same into a store
  pleach store gc runs.store --keep 3           forgets all but the last 3 versions of each tree

Exit codes: 0 all is well · 1 something is damaged or was left out · 2 it cannot be done.";

/// The version of the format of exported trees.
const EXPORT: u64 = 1;

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
    /// Write all trees that are whole into a file, as JSON
    Export {
        /// The store
        store: PathBuf,
        /// The file; it must not be there yet
        file: PathBuf,
    },
    /// Take exported trees into a store
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
        What::Export { store, file } => export(&Store::read(store)?, file),
        What::Import { store, file } => import(store, file),
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

fn export(store: &Store, file: &Path) -> Answer {
    let mut versions = Vec::new();
    let mut left_out = 0;
    for finding in store.check()? {
        let version = &finding.version;
        if let Some(trouble) = finding.trouble {
            left_out += 1;
            term::complain(&format!("left out: {trouble}\n"));
            continue;
        }
        let run = store.run(version).ok();
        let log: Vec<Json> = store.log(version)?.entries.iter().map(|entry| entry.to_json()).collect();
        versions.push(json!({
            "tree": version.tree, "version": version.version,
            "outcome": run.as_ref().map(|run| &run.outcome),
            "head": run.as_ref().and_then(|run| serde_json::from_str::<Json>(&run.head).ok()),
            "log": log, "rows": store.tree(version)?.rows(),
        }));
    }
    let text = format!("{}\n", json!({"pleach-trees": EXPORT, "versions": versions}));
    let made = std::fs::File::create_new(file)
        .and_then(|mut file| std::io::Write::write_all(&mut file, text.as_bytes()));
    made.map_err(|error| match error.kind() {
        std::io::ErrorKind::AlreadyExists => Trouble::new(
            format!("{} is there already, and is not overwritten", file.display()),
            "choose another name",
        ),
        _ => Trouble::from(format!("cannot write {}: {}", file.display(), pleach::files::why(&error))),
    })?;
    term::complain(&format!("{} in {}\n", count(versions.len(), "version"), file.display()));
    Ok(if left_out > 0 { FAILED } else { 0 })
}

fn import(path: &Path, file: &Path) -> Answer {
    let text = std::fs::read_to_string(file).map_err(|error| {
        Trouble::from(format!("cannot read {}: {}", file.display(), pleach::files::why(&error)))
    })?;
    let json: Json = serde_json::from_str(&text).unwrap_or_default();
    if json["pleach-trees"].as_u64() != Some(EXPORT) {
        let what = format!("{} holds no exported trees", file.display());
        return Err(Trouble::new(what, "write some with: pleach store export STORE FILE"));
    }
    // All are read before the first is written.
    let mut trees = Vec::new();
    for (at, version) in json["versions"].as_array().into_iter().flatten().enumerate() {
        let name = version["tree"].as_str().unwrap_or_default().to_string();
        let wrong = |why| Trouble::from(format!("{}: versions[{at}]: {why}", file.display()));
        let tree = SavedTree::from_rows(&version["rows"]).map_err(wrong)?;
        if name.is_empty() {
            return Err(wrong("it has no name".into()));
        }
        trees.push((name, tree));
    }
    for (name, tree) in &trees {
        let writer = Writer::put(Store::write(path)?, name, None, tree, "import")?;
        term::say(&format!("{}@{}\n", safe(&writer.tree), writer.version));
    }
    Ok(0)
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
