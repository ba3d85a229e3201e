//! Which files a command is about.

use std::path::{Path, PathBuf};

use super::Trouble;

/// The plan files that are named, and all in the folders that are named, each once, in order.
pub fn plans(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Trouble> {
    let mut files = Vec::new();
    for path in paths {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let before = files.len();
        below(path, &mut files)?;
        if files.len() == before {
            let what = format!("there is no plan file in the folder {}", path.display());
            return Err(Trouble::new(what, "plan files end in .plan"));
        }
        files[before..].sort();
    }
    let mut seen = std::collections::BTreeSet::new();
    files.retain(|file| seen.insert(file.clone()));
    Ok(files)
}

/// Links to folders are not followed, so this ends.
fn below(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), Trouble> {
    let cannot = |error| {
        Trouble::from(format!("cannot read the folder {}: {}", folder.display(), pleach::files::why(&error)))
    };
    for entry in std::fs::read_dir(folder).map_err(cannot)? {
        let entry = entry.map_err(cannot)?;
        let path = entry.path();
        match entry.file_type() {
            Ok(it) if it.is_dir() => below(&path, files)?,
            Ok(_) if path.extension().is_some_and(|end| end == "plan") => files.push(path),
            _ => {}
        }
    }
    Ok(())
}

/// Why a file could not be read, with what to do about it.
pub fn unreadable(path: &Path, why: String) -> Trouble {
    if path.exists() {
        let help = match () {
            () if path.is_dir() => "name a file in it",
            () if why.contains("UTF-8") => {
                "plan files are UTF-8 text: is it another kind of file, or saved with another encoding?"
            }
            () if why.contains("bytes") => "split it into modules, and put data into files of their own",
            () => return Trouble::from(why),
        };
        return Trouble::new(why, help);
    }
    let folder = path.parent().filter(|it| !it.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let names: Vec<String> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| name.ends_with(".plan"))
        .collect();
    let wanted = path.file_name().unwrap_or_default().to_string_lossy();
    let near = compiler::module::nearest(&wanted, names.iter().map(String::as_str));
    let help = near.map(|name| format!("did you mean {}?", folder.join(name).display()));
    Trouble {
        what: why,
        help: help.or_else(|| Some("check the name, and the folder that you are in".into())),
    }
}
