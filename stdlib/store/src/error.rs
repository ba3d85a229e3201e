//! What can be wrong with a store.

use std::path::{Path, PathBuf};

use rusqlite::ErrorCode;

/// What is wrong with a store, or with what is asked of it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// It cannot be read or written.
    #[error("cannot {} the store {}: {why}", if *.write { "write" } else { "read" }, path.display())]
    Cannot {
        /// Its file.
        path: PathBuf,
        /// What was tried.
        write: bool,
        /// Why not.
        why: String,
    },
    /// The file is something else.
    #[error("{} is no store: {why}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is.
        why: String,
    },
    /// Another format.
    #[error("{} is a store of format {found}; this pleach reads format {}", path.display(), crate::schema::FORMAT)]
    Format {
        /// The file.
        path: PathBuf,
        /// Its format.
        found: i64,
    },
    /// Another run writes it.
    #[error("another run is writing the store {}", path.display())]
    Busy {
        /// Its file.
        path: PathBuf,
    },
    /// A row is not what was written.
    #[error("the store {} is damaged: tree {tree}, version {version}{}: {what}", path.display(), batch.map_or(String::new(), |it| format!(", batch {it}")))]
    Damaged {
        /// Its file.
        path: PathBuf,
        /// The tree, as far as that is known.
        tree: String,
        /// Its version.
        version: String,
        /// The batch that wrote the row.
        batch: Option<i64>,
        /// Which row.
        what: String,
    },
    /// There is no such tree, version or run.
    #[error("{what}")]
    Missing {
        /// What is missing, as a sentence.
        what: String,
        /// What there is instead.
        help: String,
    },
}

impl StoreError {
    /// What to do about it.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        Some(match self {
            StoreError::Cannot { .. } => return None,
            StoreError::Foreign { .. } => {
                "name a store, or a file that is not there yet: `pleach run FILE --store STORE` makes it"
                    .into()
            }
            StoreError::Format { path, found } if *found < crate::schema::FORMAT => {
                let path = path.display();
                format!(
                    "take its trees over: `pleach store export {path} FILE` with the pleach that wrote it, then \
                     `pleach store import NEW FILE` with this one"
                )
            }
            StoreError::Format { .. } => "use the pleach that wrote it, or a newer one".into(),
            StoreError::Busy { .. } => "wait until it has ended, or use another store".into(),
            StoreError::Damaged { path, .. } => {
                let path = path.display();
                format!(
                    "`pleach store check {path}` says what is whole; `pleach store export {path} FILE` saves that"
                )
            }
            StoreError::Missing { help, .. } => help.clone(),
        })
    }

    /// From an error of SQLite.
    pub(crate) fn of(path: &Path, write: bool, error: &rusqlite::Error) -> StoreError {
        let path = path.to_path_buf();
        let code = error.sqlite_error_code();
        let why = match code {
            Some(ErrorCode::DiskFull) => "the disk is full".into(),
            Some(ErrorCode::ReadOnly) => "the file or its folder is read-only".into(),
            Some(ErrorCode::PermissionDenied) => "there is no permission".into(),
            Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => "another process holds it".into(),
            Some(ErrorCode::CannotOpen) => {
                "it cannot be opened: is its folder there, and may files be made in it?".into()
            }
            Some(ErrorCode::SystemIoFailure) => "input or output failed".into(),
            Some(ErrorCode::NotADatabase) => {
                return StoreError::Foreign { path, why: "it is not an SQLite file".into() };
            }
            Some(ErrorCode::DatabaseCorrupt) => {
                let what = "pages of the file are not what was written".into();
                return StoreError::damaged_somewhere(path, what);
            }
            _ => match error {
                rusqlite::Error::InvalidColumnType(..)
                | rusqlite::Error::FromSqlConversionFailure(..)
                | rusqlite::Error::IntegralValueOutOfRange(..)
                | rusqlite::Error::Utf8Error(..) => {
                    return StoreError::damaged_somewhere(path, "a row holds no such values".into());
                }
                other => other.to_string(),
            },
        };
        StoreError::Cannot { path, write, why }
    }

    fn damaged_somewhere(path: PathBuf, what: String) -> StoreError {
        StoreError::Damaged { path, tree: "unknown".into(), version: "unknown".into(), batch: None, what }
    }
}
