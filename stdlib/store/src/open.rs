//! Opening a store, with nothing believed that its file says.

use std::fs::{File, TryLockError};
use std::io::Read as _;
use std::path::{Path, PathBuf};

use rusqlite::config::DbConfig;
use rusqlite::{Connection, OpenFlags};

use crate::error::StoreError;
use crate::schema::{APPLICATION, FORMAT, TABLES, VIEWS};

/// An open store.
pub struct Store {
    pub(crate) db: Connection,
    /// Its file.
    pub path: PathBuf,
    /// Held by the one who writes; the system lets it go when the process ends in whatever way.
    pub(crate) _lock: Option<File>,
    pub(crate) writes: bool,
}

/// True if a file begins as SQLite files do.
#[must_use]
pub fn is_store(path: &Path) -> bool {
    let mut head = [0; 16];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut head));
    read.is_ok() && &head == b"SQLite format 3\0"
}

/// How long a call waits for another process to finish a transaction, in milliseconds.
const PATIENCE_MS: u64 = 5000;

/// Bytes of a page: chunks of rows are larger than SQLite expects.
const PAGE: i64 = 16 * 1024;

/// Memory for pages of the file; a number below 0 is one of KiB.
const CACHE_KIB: i64 = -32 * 1024;

impl Store {
    /// Opens a store to look at it.
    ///
    /// # Errors
    /// It cannot be read, is no store, or has tables that are not ours.
    pub fn read(path: &Path) -> Result<Store, StoreError> {
        if let Err(error) = File::open(path) {
            return Err(unreachable_file(path, false, &error));
        }
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let attempt = |immutable: bool| {
            let db = match immutable {
                false => Connection::open_with_flags(path, flags)?,
                true => {
                    Connection::open_with_flags(immutable_name(path), flags | OpenFlags::SQLITE_OPEN_URI)?
                }
            };
            prepare(&db)?;
            // Only now the file is looked at.
            db.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get::<_, i64>(0))?;
            Ok(db)
        };
        let has_wal = std::fs::metadata(beside(path, "-wal")).is_ok_and(|it| it.len() > 0);
        // In a folder where nothing can be made, a file that nobody writes is read as it is.
        let db = attempt(false).or_else(|error| if has_wal { Err(error) } else { attempt(true) });
        let db = db.map_err(|error| StoreError::of(path, false, &error))?;
        let store = Store { db, path: path.into(), _lock: None, writes: false };
        store.check_format()?;
        Ok(store)
    }

    /// Opens a store to write it, and makes it if it is not there.
    ///
    /// # Errors
    /// It cannot be written, is no store, has tables that are not ours, or somebody else writes it.
    pub fn write(path: &Path) -> Result<Store, StoreError> {
        let holds_something = std::fs::metadata(path).is_ok_and(|it| it.len() > 0 || !it.is_file());
        if holds_something && !is_store(path) {
            return Err(StoreError::Foreign { path: path.into(), why: "it is another kind of file".into() });
        }
        let lock = lock(path)?;
        Store::write_locked(path, Some(lock))
    }

    /// The same where the lock is held.
    pub(crate) fn write_locked(path: &Path, lock: Option<File>) -> Result<Store, StoreError> {
        let cannot = |error: rusqlite::Error| StoreError::of(path, true, &error);
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE
            | OpenFlags::SQLITE_OPEN_CREATE
            | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let db = Connection::open_with_flags(path, flags).map_err(cannot)?;
        prepare(&db).map_err(cannot)?;
        let store = Store { db, path: path.into(), _lock: lock, writes: true };
        let is_new = || store.db.query_row("SELECT count(*) = 0 FROM sqlite_schema", [], |row| row.get(0));
        if is_new().map_err(cannot)? {
            store.create().map_err(cannot)?;
        }
        store.check_format()?;
        let set = || {
            store.db.pragma_update(None, "journal_mode", "wal")?;
            // After kill -9 all that was committed is there; after a loss of power perhaps not the last batches.
            store.db.pragma_update(None, "synchronous", "normal")
        };
        set().map_err(cannot)?;
        Ok(store)
    }

    fn create(&self) -> rusqlite::Result<()> {
        self.db.pragma_update(None, "page_size", PAGE)?;
        self.db.execute_batch("BEGIN IMMEDIATE")?;
        for (_, text) in TABLES.iter().chain(VIEWS) {
            self.db.execute_batch(text)?;
        }
        self.db.pragma_update(None, "application_id", APPLICATION)?;
        self.db.pragma_update(None, "user_version", FORMAT)?;
        self.db.execute_batch("COMMIT")
    }

    /// The tables must be ours, to the letter, and there must be nothing that runs by itself.
    fn check_format(&self) -> Result<(), StoreError> {
        let of = |error: rusqlite::Error| self.error(&error);
        let pragma = |name: &str| self.db.pragma_query_value(None, name, |row| row.get::<_, i64>(0));
        let foreign = |why: String| StoreError::Foreign { path: self.path.clone(), why };
        if pragma("application_id").map_err(of)? != APPLICATION {
            return Err(foreign("it is an SQLite file of something else".into()));
        }
        let found = pragma("user_version").map_err(of)?;
        if found != FORMAT {
            return Err(StoreError::Format { path: self.path.clone(), found });
        }
        let mut statement =
            self.db.prepare("SELECT type, name, tbl_name, sql FROM sqlite_schema").map_err(of)?;
        let text =
            |row: &rusqlite::Row<'_>, at| row.get::<_, Option<String>>(at).map(Option::unwrap_or_default);
        let rows =
            statement.query_map([], |row| Ok((text(row, 0)?, text(row, 1)?, text(row, 2)?, text(row, 3)?)));
        let rows: rusqlite::Result<Vec<_>> = rows.map_err(of)?.collect();
        let rows = rows.map_err(of)?;
        for (kind, name, table, text) in &rows {
            let ours = TABLES.iter().any(|(known, _)| known == table);
            let allowed = match kind.as_str() {
                "table" => !ours || TABLES.iter().any(|(known, sql)| known == name && sql == text),
                "index" => !ours || text.is_empty(),
                "view" => !ours,
                _ => false,
            };
            if !allowed {
                let name = vm::show::safe(name);
                return Err(foreign(format!("it has a {} `{name}` that no store has", vm::show::safe(kind))));
            }
        }
        let has = |table: &str| rows.iter().any(|(kind, name, ..)| kind == "table" && name == table);
        match TABLES.iter().find(|(table, _)| !has(table)) {
            Some((table, _)) => Err(foreign(format!("it has no table `{table}`"))),
            None => Ok(()),
        }
    }

    pub(crate) fn error(&self, error: &rusqlite::Error) -> StoreError {
        StoreError::of(&self.path, self.writes, error)
    }
}

/// What a stranger's file could make SQLite do is switched off.
fn prepare(db: &Connection) -> rusqlite::Result<()> {
    db.busy_timeout(std::time::Duration::from_millis(PATIENCE_MS))?;
    db.set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true)?;
    db.set_db_config(DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false)?;
    db.set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_TRIGGER, false)?;
    db.set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_VIEW, false)?;
    db.pragma_update(None, "cache_size", CACHE_KIB)?;
    db.pragma_update(None, "cell_size_check", true)
}

/// A lock on a file beside the store. (A lock on the store itself would be lost when SQLite closes it.)
fn lock(path: &Path) -> Result<File, StoreError> {
    let beside = beside(path, "-writer");
    let file = File::options().create(true).truncate(false).write(true).open(&beside);
    let file = file.map_err(|error| unreachable_file(path, true, &error))?;
    match lock_file(&file) {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(StoreError::Busy { path: path.into() }),
        Err(TryLockError::Error(error)) => Err(unreachable_file(path, true, &error)),
    }
}

/// Locks a file for this process, or says that another one holds it. A process that is just being made holds the locks of the one
/// that makes it until it has become another program, so there are some tries.
///
/// # Errors
/// Another process holds the lock, or the system has none.
pub fn lock_file(file: &File) -> Result<(), TryLockError> {
    const TRIES: u32 = 20;
    let mut result = file.try_lock();
    for _ in 1..TRIES {
        if !matches!(result, Err(TryLockError::WouldBlock)) {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
        result = file.try_lock();
    }
    result
}

fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    name.into()
}

/// The name by which SQLite reads a file that does not change.
fn immutable_name(path: &Path) -> String {
    let path = path.to_string_lossy();
    let escaped = path.replace('%', "%25").replace('?', "%3f").replace('#', "%23");
    format!("file:{escaped}?immutable=1")
}

fn unreachable_file(path: &Path, write: bool, error: &std::io::Error) -> StoreError {
    use std::io::ErrorKind as E;
    let why = match error.kind() {
        E::NotFound if write => "its folder is not there".into(),
        E::NotFound => "there is no such file".into(),
        E::PermissionDenied => "there is no permission".into(),
        E::ReadOnlyFilesystem => "the disk is read-only".into(),
        E::StorageFull => "the disk is full".into(),
        _ => error.to_string(),
    };
    StoreError::Cannot { path: path.into(), write, why }
}
