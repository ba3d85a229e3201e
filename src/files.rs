//! The files of a program: where their texts come from, and what places in them are called.

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use compiler::{Loader, Source};
use grammar::FileId;

/// All files that have been read, and how to find more.
#[derive(Default)]
pub struct Files {
    files: Vec<File>,
    /// Texts by their names that stand for all files.
    shelf: Option<BTreeMap<String, String>>,
}

/// A text with its name.
#[derive(Debug, Clone)]
pub struct File {
    /// As shown in messages.
    pub name: String,
    /// Its text.
    pub text: String,
    /// Its folder, where `use` looks first.
    folder: Option<PathBuf>,
}

/// Files of programs larger than this are not read, in bytes.
const LARGEST: u64 = 64 << 20;
/// Nor files of data larger than this.
const LARGEST_DATA: u64 = 2 << 30;

impl Files {
    /// Adds a text that is not from a file.
    pub fn add(&mut self, name: &str, text: &str) -> FileId {
        self.push(name, text.to_string(), None)
    }

    fn push(&mut self, name: &str, text: String, folder: Option<PathBuf>) -> FileId {
        self.files.push(File { name: name.into(), text, folder });
        FileId(self.files.len() as u32 - 1)
    }

    /// From now on these texts are the files that there are, by the names that messages give them; without any, those of
    /// the disk are.
    pub fn use_shelf(&mut self, texts: Option<BTreeMap<String, String>>) {
        self.shelf = texts;
    }

    fn text(&self, path: &Path) -> Result<String, String> {
        match &self.shelf {
            None => read_text(path),
            Some(shelf) => shelf
                .get(&path.display().to_string())
                .cloned()
                .ok_or_else(|| format!("cannot read {}: it is not kept with the run", path.display())),
        }
    }

    fn exists(&self, path: &Path) -> bool {
        match &self.shelf {
            None => path.exists(),
            Some(shelf) => shelf.contains_key(&path.display().to_string()),
        }
    }

    /// A file that has been read.
    #[must_use]
    pub fn get(&self, id: FileId) -> Option<&File> {
        self.files.get(id.0 as usize)
    }

    /// All files that have been read, in that order.
    pub fn iter(&self) -> impl Iterator<Item = &File> {
        self.files.iter()
    }

    /// Reads a file of the user's.
    ///
    /// # Errors
    /// A sentence that says why it cannot be read, or where it is no text.
    pub fn read(&mut self, path: &Path) -> Result<Source, String> {
        let name = path.display().to_string();
        let text = self.text(path)?;
        let key = path.canonicalize().map_or_else(|_| name.clone(), |full| full.display().to_string());
        let folder = path.parent().map(Path::to_path_buf);
        let file = self.push(&name, text.clone(), folder);
        Ok(Source { file, text, key, library: false })
    }

    /// Reads a program of the user's. Prolog text is one that uses its rules and does nothing else.
    ///
    /// # Errors
    /// A sentence that says why it cannot be read, or where it is no text.
    pub fn read_program(&mut self, path: &Path) -> Result<Source, String> {
        let name = path.file_name().and_then(|name| name.to_str());
        let Some(rules) = name.filter(|name| name.ends_with(".pl")) else { return self.read(path) };
        self.text(path)?;
        let text = format!("(use-rules {})", vm::print::quoted(rules));
        let folder = path.parent().map(Path::to_path_buf);
        let file = self.push(&format!("the rules of {}", path.display()), text.clone(), folder);
        let key = format!("{}#rules", path.display());
        Ok(Source { file, text, key, library: false })
    }

    /// Line and column, from 1, of a byte in a file.
    #[must_use]
    pub fn line_column(&self, file: FileId, at: u32) -> Option<(usize, usize)> {
        let text = &self.get(file)?.text;
        let before = text.get(..at as usize)?;
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |line| line.chars().count()) + 1;
        Some((line, column))
    }

    /// `name:line:column` of a place.
    #[must_use]
    pub fn show(&self, place: vm::Place) -> String {
        let file = FileId(place.file);
        match (self.get(file), self.line_column(file, place.start)) {
            (Some(it), Some((line, column))) => format!("{}:{line}:{column}", it.name),
            _ => "unknown place".into(),
        }
    }
}

/// Reads a file as text.
///
/// # Errors
/// A sentence for the user.
pub fn read_text(path: &Path) -> Result<String, String> {
    read_up_to(path, LARGEST)
}

/// Reads a file of data, which may be larger, as text.
pub(crate) fn read_large_text(path: &Path) -> Result<String, String> {
    read_up_to(path, LARGEST_DATA)
}

fn read_up_to(path: &Path, largest: u64) -> Result<String, String> {
    let name = path.display();
    let cannot = |error: std::io::Error| format!("cannot read {name}: {}", why(&error));
    let about = std::fs::metadata(path).map_err(cannot)?;
    if about.is_dir() {
        return Err(format!("cannot read {name}: it is a folder"));
    }
    if about.len() > largest {
        return Err(format!("cannot read {name}: it has {} bytes, more than {largest}", about.len()));
    }
    let file = std::fs::File::open(path).map_err(cannot)?;
    let mut bytes = Vec::new();
    // A device or a pipe may have more than its size says.
    file.take(largest + 1).read_to_end(&mut bytes).map_err(cannot)?;
    if bytes.len() as u64 > largest {
        return Err(format!("cannot read {name}: it has more than {largest} bytes"));
    }
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let line = error.as_bytes()[..at].iter().filter(|byte| **byte == b'\n').count() + 1;
        format!(
            "cannot read {name}: it is no UTF-8 text; the first wrong byte is number {at}, in line {line}"
        )
    })
}

/// That a file cannot be written, and why.
#[must_use]
pub fn cannot_write(path: &Path, error: &std::io::Error) -> String {
    format!("cannot write {}: {}", path.display(), why(error))
}

/// Why input or output did not work, in the same words on every system where there are such.
#[must_use]
pub fn why(error: &std::io::Error) -> String {
    use std::io::ErrorKind as E;
    match error.kind() {
        E::NotFound => "there is no such file".into(),
        E::PermissionDenied => "there is no permission".into(),
        E::IsADirectory => "it is a folder".into(),
        E::NotADirectory => "a part of its path is no folder".into(),
        E::StorageFull => "the disk is full".into(),
        E::ReadOnlyFilesystem => "the disk is read-only".into(),
        _ => error.to_string(),
    }
}

impl Loader for Files {
    fn load(&mut self, name: &str, from: FileId) -> Result<Source, String> {
        let mut library = stdlib::MODULES.iter().chain(stdlib::PLANS).chain(world::MODULES);
        if let Some((_, text)) = library.find(|(module, _)| *module == name) {
            let file = self.push(&format!("library/{name}.plan"), (*text).to_string(), None);
            return Ok(Source { file, text: (*text).to_string(), key: name.into(), library: true });
        }
        let folder = self.get(from).and_then(|file| file.folder.clone()).unwrap_or_default();
        let has_ending = name.ends_with(".plan") || name.ends_with(".pl");
        let file_name = if has_ending { name.to_string() } else { format!("{name}.plan") };
        let path = folder.join(&file_name);
        match self.exists(&path) {
            true => self.read(&path),
            false => Err(format!(
                "there is no library module and no file of this name; looked for {}",
                path.display()
            )),
        }
    }
}
