//! The log of a run in a file: a head that says what was run and how, then a line of JSON for
//! each round in which something came from outside, with all that came, written when it came.
//!
//! A line is written in one piece and ends with a line end, so a killed run leaves whole lines
//! and at most a torn last one, which is left out. The head holds hashes of all texts of the
//! program: a log fits to the program that it was written by and to no other.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use pleach::files::{Files, why};
use serde_json::{Value as Json, json};
use store::Source;
use vm::log::{Entry, Log};

use super::Trouble;
use super::run::Job;
use super::settings::Settings;

/// The version of the format.
const VERSION: u64 = 2;
/// A head is not longer than this, in bytes.
const LONGEST_HEAD: u64 = 1 << 20;
/// The names of library files begin so.
const LIBRARY: &str = "library/";

/// A log that is being written.
pub struct Journal {
    file: File,
    /// Its name, for messages.
    pub path: PathBuf,
}

/// A log that has been read.
pub struct Recorded {
    /// What was run, and how.
    pub job: Job,
    /// The folder that it was run in.
    folder: PathBuf,
    hashes: Vec<(String, String)>,
    /// The texts of its program, where they are kept with it.
    texts: BTreeMap<String, String>,
    /// What came from outside.
    pub log: Log,
    /// Its file.
    path: PathBuf,
    /// Where in it.
    pub at: At,
}

/// Where a run is recorded.
#[derive(Debug, Clone, Copy)]
pub enum At {
    /// In a log; where its last whole line ends, in bytes.
    Log(u64),
    /// In a store: the number of the run, and that of the version that it goes on with.
    Store(i64, Option<i64>),
}

impl Journal {
    /// Starts a log. A file that is something else is not overwritten.
    pub fn create(path: &Path, job: &Job, files: &Files) -> Result<Journal, Trouble> {
        let holds_something = std::fs::metadata(path).is_ok_and(|it| it.is_file() && it.len() > 0);
        if holds_something && !first_line(path).is_ok_and(|head| head["pleach-log"].is_u64()) {
            let what = format!("{} is not the log of a run, and is not overwritten", path.display());
            return Err(Trouble::new(what, "choose another name after --log"));
        }
        let cannot =
            |error| Trouble::from(format!("cannot write the log {}: {}", path.display(), why(&error)));
        let file = File::create(path).map_err(cannot)?;
        let mut journal = Journal { file, path: path.into() };
        journal.line(&head(job, files)).map_err(cannot)?;
        Ok(journal)
    }

    /// Goes on with a log where its last whole line ends.
    pub fn reopen(path: &Path, whole: u64) -> Result<Journal, Trouble> {
        let open = || {
            let mut file = File::options().write(true).open(path)?;
            file.set_len(whole)?;
            file.seek(SeekFrom::End(0))?;
            Ok(file)
        };
        let file =
            open().map_err(|error| format!("cannot write the log {}: {}", path.display(), why(&error)))?;
        Ok(Journal { file, path: path.into() })
    }

    /// Writes what came from outside.
    pub fn add(&mut self, entry: &Entry) -> std::io::Result<()> {
        self.line(&entry.to_json())
    }

    fn line(&mut self, json: &Json) -> std::io::Result<()> {
        self.file.write_all(format!("{json}\n").as_bytes())
    }
}

impl Recorded {
    /// Reads a log.
    pub fn read(path: &Path) -> Result<Recorded, Trouble> {
        let cannot =
            |error| Trouble::from(format!("cannot read the log {}: {}", path.display(), why(&error)));
        let full = path.canonicalize().map_err(cannot)?;
        let head = read_head(&full)?;
        let text = std::fs::read(&full).map_err(cannot)?;
        let mut whole = 0;
        let mut log = Log::default();
        for (number, line) in text.split_inclusive(|byte| *byte == b'\n').enumerate() {
            if line.last() != Some(&b'\n') {
                break;
            }
            whole += line.len() as u64;
            if number == 0 {
                continue;
            }
            let entry = serde_json::from_slice(line).ok().and_then(|json: Json| Entry::from_json(&json));
            let damaged =
                || format!("the log {} is damaged: line {} is no entry of a log", path.display(), number + 1);
            log.entries.push(entry.ok_or_else(|| {
                Trouble::new(damaged(), "delete this line and all below it to go on from there")
            })?);
        }
        let unfit = || format!("the head of the log {} lacks what is needed to run again", path.display());
        let job = job_of(&head).ok_or_else(unfit)?;
        let folder = head["folder"].as_str().unwrap_or(".").into();
        Ok(Recorded {
            job,
            folder,
            hashes: hashes_of(&head),
            texts: BTreeMap::new(),
            log,
            path: full,
            at: At::Log(whole),
        })
    }

    /// The run of a store.
    pub fn of_store(
        head: &Json,
        log: Log,
        path: &Path,
        id: i64,
        base: Option<i64>,
        texts: BTreeMap<String, String>,
    ) -> Result<Recorded, Trouble> {
        let unfit =
            || format!("run {id} of the store {} lacks what is needed to run it again", path.display());
        let job = job_of(head).ok_or_else(unfit)?;
        let folder = head["folder"].as_str().unwrap_or(".").into();
        Ok(Recorded {
            job,
            folder,
            hashes: hashes_of(head),
            texts,
            log,
            path: path.into(),
            at: At::Store(id, base),
        })
    }

    /// The file that it stands in.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The texts of its program; nothing if they have to be read again.
    pub fn texts(&self) -> Option<BTreeMap<String, String>> {
        Some(self.texts.clone()).filter(|texts| !texts.is_empty())
    }

    /// Goes to the folder that the program was run in: its paths count from there.
    pub fn enter_folder(&self) -> Result<(), Trouble> {
        std::env::set_current_dir(&self.folder).map_err(|error| {
            let what = format!(
                "cannot go to {}, where the logged run was started: {}",
                self.folder.display(),
                why(&error)
            );
            Trouble::new(
                what,
                "put the program back there, or change \"folder\" in the first line of the log",
            )
        })
    }

    /// Compares the program with the one that wrote the log.
    pub fn check_program(&self, files: &Files) -> Result<(), Trouble> {
        let now = hashes(files);
        let mut changed: Vec<String> = Vec::new();
        for (name, hash) in &self.hashes {
            match now.iter().find(|(other, _)| other == name) {
                Some((_, other)) if other == hash => {}
                Some(_) if name == LIBRARY => {
                    changed.push("the library is that of another version of pleach".into())
                }
                Some(_) => changed.push(format!("{name} has changed")),
                None => changed.push(format!("{name} is not used any more")),
            }
        }
        let added = now.iter().filter(|(name, _)| !self.hashes.iter().any(|(other, _)| other == name));
        changed.extend(added.map(|(name, _)| format!("{name} is new")));
        if changed.is_empty() {
            return Ok(());
        }
        let (path, changed) = (self.path.display(), changed.join(", "));
        let what = match self.at {
            At::Log(_) => format!("the program is not the one that wrote the log {path}: {changed}"),
            At::Store(id, _) => {
                format!("the program is not the one of run {id} in the store {path}: {changed}")
            }
        };
        Err(Trouble::new(what, "put the old text back, or start again with `pleach run`"))
    }
}

/// What was run, for the first line.
pub fn head(job: &Job, files: &Files) -> Json {
    let hashes = hashes(files);
    let all: String = hashes.iter().map(|(_, hash)| hash.as_str()).collect();
    let listed: Vec<Json> = hashes.iter().map(|(name, hash)| json!({"name": name, "hash": hash})).collect();
    let mut head = json!({
        "pleach-log": VERSION,
        "pleach": env!("CARGO_PKG_VERSION"),
        "program": hash(&all),
        "file": job.file,
        "plan": job.plan,
        "args": job.args,
        "quantum": vm::machine::QUANTUM,
        "folder": std::env::current_dir().unwrap_or_default(),
        "files": listed,
    });
    if let Some(wishes) = &job.rehearse {
        head["rehearse"] = super::transform::to_json(wishes);
    }
    if let (Json::Object(head), Json::Object(settings)) = (&mut head, job.settings.to_json()) {
        head.extend(settings);
    }
    head
}

fn hashes_of(head: &Json) -> Vec<(String, String)> {
    let files = head["files"].as_array().into_iter().flatten();
    let hash = |it: &Json| Some((it["name"].as_str()?.to_string(), it["hash"].as_str()?.to_string()));
    files.filter_map(hash).collect()
}

fn job_of(head: &Json) -> Option<Job> {
    let args = head["args"].as_array()?.iter().map(|arg| arg.as_str().map(str::to_string));
    let plan = head["plan"].as_str().map(str::to_string);
    let file = head["file"].as_str()?.into();
    let rehearse = match &head["rehearse"] {
        Json::Null => None,
        wishes => Some(super::transform::from_json(wishes)?),
    };
    let (args, settings) = (args.collect::<Option<_>>()?, Settings::from_json(head)?);
    Some(Job { file, plan, args, settings, rehearse })
}

fn read_head(path: &Path) -> Result<Json, Trouble> {
    let no_log = || {
        Trouble::new(
            format!("{} is not the log of a run", path.display()),
            "logs are written by `pleach run FILE --log LOG`",
        )
    };
    let head = first_line(path)
        .map_err(|error| format!("cannot read the log {}: {}", path.display(), why(&error)))?;
    match head["pleach-log"].as_u64() {
        Some(VERSION) => Ok(head),
        Some(other) => {
            let what = format!(
                "{} is a log of version {other}; this pleach reads version {VERSION}",
                path.display()
            );
            Err(Trouble::new(what, "use the pleach that wrote it"))
        }
        None => Err(no_log()),
    }
}

/// The first line of a file as JSON; null if it is none.
fn first_line(path: &Path) -> std::io::Result<Json> {
    let mut line = Vec::new();
    BufReader::new(File::open(path)?).take(LONGEST_HEAD).read_until(b'\n', &mut line)?;
    let is_whole = line.last() == Some(&b'\n');
    Ok(serde_json::from_slice(&line).ok().filter(|_| is_whole).unwrap_or_default())
}

/// Names and hashes of the files of a program; those of the library together.
pub fn hashes(files: &Files) -> Vec<(String, String)> {
    let library: String =
        files.iter().filter(|file| file.name.starts_with(LIBRARY)).map(|file| file.text.as_str()).collect();
    let own = files
        .iter()
        .filter(|file| !file.name.starts_with(LIBRARY) && file.name != pleach::session::CALL)
        .map(|file| (file.name.clone(), hash(&file.text)));
    std::iter::once((LIBRARY.to_string(), hash(&library))).chain(own).collect()
}

/// True if these files, with the text of all but the library, are the program that a head is about.
pub fn is_program(head: &Json, program: &str, sources: &[Source]) -> bool {
    let listed = hashes_of(head);
    let all: String = listed.iter().map(|(_, hash)| hash.as_str()).collect();
    let fits = |it: &Source| match &it.text {
        Some(text) => hash(text) == it.hash,
        None => it.file == LIBRARY,
    };
    let known = |it: &Source| listed.iter().any(|(name, hash)| *name == it.file && *hash == it.hash);
    hash(&all) == program
        && sources.len() == listed.len()
        && sources.iter().all(|source| fits(source) && known(source))
}

fn hash(text: &str) -> String {
    format!("{:016x}", vm::random::hash_text(text))
}
