//! `pleach fmt`: lays files out. A file with mistakes is never touched.

use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};

use clap::Args;
use compiler::Report;
use pleach::files::{Files, why};
use pleach::render;

use super::{Answer, ERRORS, FAILED, Trouble, files, term};

pub const HELP: &str = "\
Examples:
  pleach fmt kitchen.plan plans/      rewrite these files
  pleach fmt --check plans/           list those that would change
  pleach fmt - < draft.plan           from stdin to stdout, for editors

A file is replaced in one step and keeps its permissions. A file that cannot be read as a program is
left as it is.
Exit codes: 0 done · 1 --check found files that would change · 2 a file could not be read.";

/// `pleach fmt`
#[derive(Args)]
pub struct Fmt {
    /// Plan files, or folders of them; `-` for stdin
    #[arg(required_unless_present = "stdin", value_name = "FILE|FOLDER|-")]
    paths: Vec<PathBuf>,
    /// Change nothing; list the files that would change
    #[arg(long)]
    check: bool,
    /// Read stdin and write stdout
    #[arg(long, conflicts_with = "paths")]
    stdin: bool,
}

/// Formats files.
pub fn run(it: &Fmt) -> Answer {
    if it.stdin || it.paths == [Path::new("-")] {
        return from_stdin(it.check);
    }
    let (mut changed, mut broken) = (false, false);
    for path in files::plans(&it.paths)? {
        match one(&path, it.check) {
            Ok(would_change) => changed |= would_change,
            Err(why) => {
                term::complain(&why);
                broken = true;
            }
        }
    }
    Ok(match (broken, changed && it.check) {
        (true, _) => ERRORS,
        (false, true) => FAILED,
        (false, false) => 0,
    })
}

/// Formats one file. True if its text changes, or would.
fn one(path: &Path, check: bool) -> Result<bool, String> {
    let text = pleach::files::read_text(path).map_err(|why| term::trouble(&files::unreadable(path, why)))?;
    let name = path.display().to_string();
    let formatted = format(&name, &text)?;
    if formatted == text {
        return Ok(false);
    }
    match check {
        true => term::say(&format!("{name}\n")),
        false => replace(path, &formatted).map_err(|error| {
            term::trouble(&Trouble::from(format!("cannot write {name}: {}", why(&error))))
        })?,
    }
    Ok(true)
}

/// The text laid out, or all that is wrong with it, as text.
fn format(name: &str, text: &str) -> Result<String, String> {
    grammar::format(text).map_err(|errors| {
        let mut files = Files::default();
        files.add(name, text);
        let reports = errors
            .into_iter()
            .map(|error| render::report(&files, &Report::Parse(error), term::error_style()));
        reports.collect()
    })
}

/// Gives a file another text in one step: whoever reads it sees the old text or the new one.
fn replace(path: &Path, text: &str) -> std::io::Result<()> {
    // A link stays a link: what it points to is replaced.
    let path = path.canonicalize()?;
    let permissions = std::fs::metadata(&path)?.permissions();
    if permissions.readonly() {
        return Err(std::io::ErrorKind::PermissionDenied.into());
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let beside = path.with_file_name(format!(".{name}.{}.tmp", std::process::id()));
    let written = std::fs::File::create_new(&beside).and_then(|mut file| {
        file.write_all(text.as_bytes())?;
        file.set_permissions(permissions)?;
        file.sync_all()?;
        std::fs::rename(&beside, &path)
    });
    if written.is_err() {
        let _ = std::fs::remove_file(&beside);
    }
    written
}

fn from_stdin(check: bool) -> Answer {
    let mut text = String::new();
    let limit = grammar::parse::MAX_BYTES as u64 + 1;
    if let Err(error) = std::io::stdin().lock().take(limit).read_to_string(&mut text) {
        let help = "what is to be formatted must be UTF-8 text";
        return Err(Trouble::new(format!("cannot read stdin: {}", why(&error)), help));
    }
    match format("stdin", &text) {
        Ok(formatted) if check => Ok(if formatted == text { 0 } else { FAILED }),
        Ok(formatted) => {
            term::say(&formatted);
            Ok(0)
        }
        Err(errors) => {
            term::complain(&errors);
            Ok(ERRORS)
        }
    }
}
