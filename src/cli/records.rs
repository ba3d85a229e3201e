//! `--record` and `--picture`: files that take what happened in the world. They are opened before the run
//! begins: whoever cannot write them wants to know that then.

use std::fs::File;
use std::io::Write as _;
use std::path::PathBuf;

use pleach::Session;
use serde_json::json;

use super::run::{Job, Record};
use super::{Trouble, term};

/// The files that are wanted.
#[derive(Default)]
pub(super) struct Records {
    record: Option<(PathBuf, File)>,
    picture: Option<(PathBuf, File)>,
}

impl Records {
    pub(super) fn open(wanted: &Record) -> Result<Records, Trouble> {
        let open = |path: &Option<PathBuf>, option: &str, head: &str| {
            let Some(path) = path else { return Ok(None) };
            let known = std::fs::read(path).unwrap_or_default();
            if !known.is_empty() && !known.starts_with(head.as_bytes()) {
                let what = format!("{} is no file of {option}, and is not overwritten", path.display());
                return Err(Trouble::new(what, format!("choose another name after {option}")));
            }
            let cannot = |error| {
                let what = pleach::files::cannot_write(path, &error);
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

    pub(super) fn wanted(&self) -> bool {
        self.record.is_some() || self.picture.is_some()
    }

    pub(super) fn write(self, session: &mut Session, job: &Job) -> Result<(), Trouble> {
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
            let cannot = |error| Trouble::from(pleach::files::cannot_write(&path, &error));
            file.write_all(text().as_bytes()).map_err(cannot)
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
