//! Reading a store: no row is used whose sum does not fit, and no row may be missing.

use rusqlite::{Row, params};
use serde_json::{Value as Json, json};
use vm::log::{Entry, Log};
use vm::persist::{Outline, Outlined, SavedEdit, SavedTree, chunk};

use crate::error::StoreError;
use crate::open::Store;
use crate::sum::Sum;
use crate::write::{Decision, Source, chunk_sum, decision_sum, edit_sum, outline_sum};

/// A version of a tree.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VersionRow {
    /// Its number in the file.
    pub id: i64,
    /// The name of the tree.
    pub tree: String,
    /// Its version, from 1.
    pub version: i64,
    /// The number of the version that it goes on with.
    pub base: Option<i64>,
    /// How often something of it has been written.
    pub batches: i64,
    /// How many slots it has.
    pub slots: i64,
    /// How many records it has.
    pub records: i64,
    /// How many edits hold in it.
    pub edits: i64,
    /// How many entries its log has.
    pub entries: i64,
    /// Fuel used when it was written last.
    pub steps: i64,
}

/// A run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunRow {
    /// The plan file.
    pub file: String,
    /// The plan.
    pub plan: Option<String>,
    /// The hash of the program.
    pub program: String,
    /// Key of the random draws.
    pub seed: String,
    /// Key of the order of tasks.
    pub schedule: String,
    /// How the robot moved.
    pub robot: String,
    /// All that is needed to run it again, as JSON.
    pub head: String,
    /// `running` as long as nobody has seen it end.
    pub outcome: String,
    /// Its value as text.
    pub value: Option<String>,
    /// The task clock at its end.
    pub clock_ns: i64,
}

/// What a check has found out about a version.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// The version.
    pub version: VersionRow,
    /// What is wrong with it.
    pub trouble: Option<StoreError>,
}

/// A row, or a sentence that says what is wrong with it.
type Rows<T> = Result<Vec<T>, Trouble>;

/// What is wrong while the rows of a version are read.
enum Trouble {
    /// SQLite says so.
    Sqlite(rusqlite::Error),
    /// The row of this number is not what was written, or not there.
    Row(i64, &'static str),
    /// The rows of a chunk that begins with this one.
    Rows(i64, &'static str),
}

impl From<rusqlite::Error> for Trouble {
    fn from(error: rusqlite::Error) -> Trouble {
        Trouble::Sqlite(error)
    }
}

const VERSION: &str =
    "SELECT id, tree, version, base, batches, slots, records, edits, entries, steps, sum FROM versions";

impl Store {
    /// All versions of all trees, in the order of their making.
    ///
    /// # Errors
    /// The store cannot be read, or a row of the list is damaged.
    pub fn versions(&self) -> Result<Vec<VersionRow>, StoreError> {
        self.version_rows()?.into_iter().map(|row| self.fitting_version(row)).collect()
    }

    /// All rows of the list, and whether their sums fit.
    fn version_rows(&self) -> Result<Vec<(VersionRow, bool)>, StoreError> {
        let read = || -> rusqlite::Result<Vec<(VersionRow, bool)>> {
            let mut statement = self.db.prepare(&format!("{VERSION} ORDER BY id"))?;
            statement.query_map([], version_row)?.collect()
        };
        read().map_err(|error| self.error(&error))
    }

    fn fitting_version(&self, (row, fits): (VersionRow, bool)) -> Result<VersionRow, StoreError> {
        match fits {
            true => Ok(row),
            false => Err(self.damaged(&row, None, "its row in `versions` is not what was written".into())),
        }
    }

    /// The version of this number.
    ///
    /// # Errors
    /// It is not there or damaged.
    pub fn version_by_id(&self, id: i64) -> Result<VersionRow, StoreError> {
        let row = self.db.query_row(&format!("{VERSION} WHERE id = ?"), [id], version_row);
        match row {
            Ok(row) => self.fitting_version(row),
            Err(rusqlite::Error::QueryReturnedNoRows) => Err(self.missing(format!("there is no run {id}"))),
            Err(error) => Err(self.error(&error)),
        }
    }

    /// A version of a tree, the last one if none is given.
    ///
    /// # Errors
    /// It is not there or damaged.
    pub fn version(&self, tree: &str, version: Option<i64>) -> Result<VersionRow, StoreError> {
        let id = match version {
            Some(version) => self.db.query_row(
                "SELECT id FROM versions WHERE tree = ? AND version = ?",
                params![tree, version],
                |row| row.get(0),
            ),
            None => self.db.query_row(
                "SELECT id FROM versions WHERE tree = ? ORDER BY version DESC LIMIT 1",
                [tree],
                |row| row.get(0),
            ),
        };
        match id {
            Ok(id) => self.version_by_id(id),
            Err(rusqlite::Error::QueryReturnedNoRows) => {
                let tree = vm::show::safe(tree);
                Err(self.missing(match version {
                    Some(version) => format!("there is no version {version} of a tree `{tree}`"),
                    None => format!("there is no tree `{tree}`"),
                }))
            }
            Err(error) => Err(self.error(&error)),
        }
    }

    /// The version that was made last.
    ///
    /// # Errors
    /// There is none, or it is damaged.
    pub fn last(&self) -> Result<VersionRow, StoreError> {
        let last = self.db.query_row("SELECT max(id) FROM versions", [], |row| row.get::<_, Option<i64>>(0));
        match last.map_err(|error| self.error(&error))? {
            Some(id) => self.version_by_id(id),
            None => Err(self.missing("the store is empty".into())),
        }
    }

    fn missing(&self, what: String) -> StoreError {
        let names = self.versions().map(|rows| {
            let mut names: Vec<String> = rows.into_iter().map(|row| row.tree).collect();
            names.dedup();
            names.truncate(20);
            names.join(" ")
        });
        let help = match names {
            Ok(names) if !names.is_empty() => format!("its trees are: {}", vm::show::safe(&names)),
            _ => "`pleach run FILE --store STORE` writes into it".into(),
        };
        StoreError::Missing { what: format!("{what} in the store {}", self.path.display()), help }
    }

    /// The run that made a version.
    ///
    /// # Errors
    /// It is not there or damaged.
    pub fn run(&self, of: &VersionRow) -> Result<RunRow, StoreError> {
        let read = |row: &Row<'_>| {
            let run = RunRow {
                file: row.get(0)?,
                plan: row.get(1)?,
                program: row.get(2)?,
                seed: row.get(3)?,
                schedule: row.get(4)?,
                robot: row.get(5)?,
                head: row.get(6)?,
                outcome: row.get(7)?,
                value: row.get(8)?,
                clock_ns: row.get(9)?,
            };
            let sum = Sum::of("runs").number(of.id).text(&run.file).maybe(run.plan.as_deref());
            let sum = sum.text(&run.program).text(&run.seed).text(&run.schedule).text(&run.robot);
            let sum = sum.text(&run.head).text(&run.outcome).maybe(run.value.as_deref()).number(run.clock_ns);
            let fits = sum.end() == row.get::<_, i64>(10)?;
            Ok((run, fits))
        };
        let select = "SELECT file, plan, program, seed, schedule, robot, head, outcome, value, clock_ns, sum \
            FROM runs WHERE id = ?";
        match self.db.query_row(select, [of.id], read) {
            Ok((run, true)) => Ok(run),
            Ok((_, false)) => Err(self.damaged(of, None, "its row in `runs` is not what was written".into())),
            Err(rusqlite::Error::QueryReturnedNoRows) if of.entries == 0 => {
                let what = format!("version {} of {} was not made by a run", of.version, of.tree);
                Err(StoreError::Missing { what, help: "it can be shown and asked, but not run again".into() })
            }
            Err(rusqlite::Error::QueryReturnedNoRows) => {
                Err(self.damaged(of, None, "its row in `runs` is not there".into()))
            }
            Err(error) => Err(self.within(of, None, Trouble::Sqlite(error), "`runs`")),
        }
    }

    /// The files of a program.
    ///
    /// # Errors
    /// A row is damaged.
    pub fn program(&self, of: &VersionRow, program: &str) -> Result<Vec<Source>, StoreError> {
        let read = || -> Rows<Source> {
            let mut statement = self
                .db
                .prepare("SELECT file, hash, source, sum FROM programs WHERE program = ? ORDER BY file")?;
            let rows = statement.query_map([program], |row| {
                let source = Source { file: row.get(0)?, hash: row.get(1)?, text: row.get(2)? };
                let sum = Sum::of("programs").text(program).text(&source.file).text(&source.hash);
                let fits = sum.maybe(source.text.as_deref()).end() == row.get::<_, i64>(3)?;
                Ok((source, fits))
            })?;
            (1..).zip(rows).map(|(at, row)| fitting(at, row?)).collect()
        };
        read().map_err(|trouble| self.within(of, None, trouble, "`programs`"))
    }

    /// The log of a run.
    ///
    /// # Errors
    /// A row is damaged or missing.
    pub fn log(&self, of: &VersionRow) -> Result<Log, StoreError> {
        let read = || -> Rows<Entry> {
            let mut statement = self.db.prepare(
                "SELECT entry, round, step, clock_ns, events, sum FROM log WHERE id = ? AND entry <= ? ORDER BY entry",
            )?;
            let rows = statement.query_map([of.id, of.entries], |row| {
                let (number, round, step, clock, events): (i64, i64, i64, i64, String) =
                    (row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?, row.get(4)?);
                let sum = Sum::of("log").number(of.id).number(number).number(round).number(step).number(clock);
                let fits = sum.text(&events).end() == row.get::<_, i64>(5)?;
                let events: Json = serde_json::from_str(&events).unwrap_or_default();
                let line = json!({"round": round as u64, "step": step as u64, "clock": clock as u64, "events": events});
                Ok((number, Entry::from_json(&line), fits))
            })?;
            let rows = gapless(of.entries, rows, |(number, entry, fits)| (number, (entry, fits)))?;
            (1..)
                .zip(rows)
                .map(|(at, (entry, fits))| fitting(at, (entry, fits))?.ok_or(Trouble::Row(at, "is no entry")))
                .collect()
        };
        let entries = read().map_err(|trouble| self.within(of, Some("entries"), trouble, "`log`"))?;
        let mut log = Log::default();
        log.entries = entries;
        Ok(log)
    }

    /// A version of a tree.
    ///
    /// # Errors
    /// A row is damaged or missing.
    pub fn tree(&self, of: &VersionRow) -> Result<SavedTree, StoreError> {
        let slots = self.rows(of, "slots", of.slots, chunk::slots);
        let slots = slots.map_err(|it| self.within(of, Some("slots"), it, "`slots`"))?;
        let records = self.rows(of, "records", of.records, chunk::records);
        let records = records.map_err(|it| self.within(of, Some("records"), it, "`records`"))?;
        let edits = self.edits(of)?;
        Ok(SavedTree {
            slots,
            records,
            edits: edits.into_iter().filter(|(_, orphan)| orphan.is_none()).map(|(edit, _)| edit).collect(),
        })
    }

    /// The tasks of a version as they stand in its tree. Nothing if it was not written to its end: then they are known from
    /// its rows only.
    ///
    /// # Errors
    /// The outline is damaged.
    pub fn outline(&self, of: &VersionRow) -> Result<Option<Vec<Outlined>>, StoreError> {
        let read = || -> Result<Option<Vec<Outlined>>, Trouble> {
            let mut statement = self
                .db
                .prepare("SELECT batch, sum, words, tasks FROM outlines WHERE id = ? AND batch = ?")?;
            let mut rows = statement.query([of.id, of.batches])?;
            let Some(row) = rows.next()? else { return Ok(None) };
            let text = || -> rusqlite::Result<&str> { Ok(row.get_ref(2)?.as_str()?) };
            let blob = || -> rusqlite::Result<&[u8]> { Ok(row.get_ref(3)?.as_blob()?) };
            let (words, tasks) = (text()?, blob()?);
            let fits = outline_sum(of.id, row.get(0)?, words, tasks) == row.get::<_, i64>(1)?;
            match Outline::read(words, tasks).filter(|_| fits) {
                Some(tasks) => Ok(Some(tasks)),
                None => Err(Trouble::Row(of.id, "is not what was written")),
            }
        };
        read().map_err(|it| self.within(of, None, it, "`outlines`"))
    }

    /// The rows of all chunks of a version, of which `most` are said to be there.
    fn rows<T>(
        &self,
        of: &VersionRow,
        what: &str,
        most: i64,
        read: fn(&str, &str, u32) -> Option<Vec<T>>,
    ) -> Rows<T> {
        let mut statement = self.db.prepare(
            "SELECT first, count, sum, words, content FROM chunks WHERE id = ? AND what = ? ORDER BY first",
        )?;
        let mut rows = statement.query(params![of.id, what])?;
        // Room is made for what is there, not for what is said to be.
        let mut found: Vec<T> = Vec::new();
        while let Some(row) = rows.next()? {
            let expected = found.len() as i64 + 1;
            let (first, count): (u32, u32) = (row.get(0)?, row.get(1)?);
            if i64::from(first) != expected {
                break;
            }
            let text = |at| -> rusqlite::Result<&str> { Ok(row.get_ref(at)?.as_str()?) };
            let (words, content) = (text(3)?, text(4)?);
            let fits = chunk_sum(of.id, what, first, count, words, content) == row.get::<_, i64>(2)?;
            match read(words, content, first).filter(|rows| fits && rows.len() as u32 == count) {
                Some(mut rows) => found.append(&mut rows),
                None => return Err(Trouble::Rows(expected, "are not what was written")),
            }
        }
        match found.len() as i64 {
            len if len < most => Err(Trouble::Rows(len + 1, "are not there")),
            _ => {
                found.truncate(usize::try_from(most).unwrap_or(0));
                Ok(found)
            }
        }
    }

    /// The edits of a version; those that hold no more have a reason.
    ///
    /// # Errors
    /// A row is damaged or missing.
    pub fn edits(&self, of: &VersionRow) -> Result<Vec<(SavedEdit, Option<String>)>, StoreError> {
        let read = || -> Rows<(SavedEdit, Option<String>)> {
            let mut statement = self.db.prepare(
                "SELECT number, slot, edit, callee, after, origin, orphan, sum FROM edits WHERE id = ? ORDER BY number",
            )?;
            let rows = statement.query_map([of.id], |row| {
                let number: i64 = row.get(0)?;
                let edit = SavedEdit {
                    number: u32::try_from(number).unwrap_or(0),
                    slot: row.get(1)?,
                    edit: row.get(2)?,
                    callee: row.get(3)?,
                    after: row.get(4)?,
                    origin: row.get(5)?,
                };
                let orphan: Option<String> = row.get(6)?;
                let fits = edit_sum(of.id, number, &edit, orphan.as_deref()) == row.get::<_, i64>(7)?;
                Ok((number, (edit, orphan), fits))
            })?;
            let rows: rusqlite::Result<Vec<_>> = rows.collect();
            let (held, orphans): (Vec<_>, Vec<_>) = rows?.into_iter().partition(|it| it.0 > 0);
            let held =
                gapless(of.edits, held.into_iter().map(Ok), |(number, edit, fits)| (number, (edit, fits)))?;
            let orphans = orphans.into_iter().map(|(_, edit, fits)| (edit, fits));
            all_fit(held.into_iter().chain(orphans).collect())
        };
        read().map_err(|trouble| self.within(of, None, trouble, "`edits`"))
    }

    /// What became of the proposals of the rehearsal before the run of a version.
    ///
    /// # Errors
    /// A row is damaged or missing.
    pub fn decisions(&self, of: &VersionRow) -> Result<Vec<Decision>, StoreError> {
        let read = || -> Rows<Decision> {
            let mut statement = self.db.prepare(
                "SELECT number, what, decision, why, numbers, sum FROM decisions WHERE id = ? ORDER BY number",
            )?;
            let rows = statement.query_map([of.id], |row| {
                let (number, what, decision) = (row.get(0)?, row.get(1)?, row.get(2)?);
                let it = Decision { what, decision, why: row.get(3)?, numbers: row.get(4)? };
                let fits = decision_sum(of.id, number, &it) == row.get::<_, i64>(5)?;
                Ok((number, (it, fits)))
            })?;
            let rows: Vec<(i64, (Decision, bool))> = rows.collect::<rusqlite::Result<_>>()?;
            let count = rows.len() as i64;
            gapless(count, rows.into_iter().map(Ok), |it| it).and_then(all_fit)
        };
        read().map_err(|trouble| self.within(of, None, trouble, "`decisions`"))
    }

    /// Reads everything and says what is whole.
    ///
    /// # Errors
    /// Not even the list of versions can be read.
    pub fn check(&self) -> Result<Vec<Finding>, StoreError> {
        let check = |row: (VersionRow, bool)| -> Result<(), StoreError> {
            let version = &self.fitting_version(row)?;
            let tree = self.tree(version)?;
            tree.json().map_err(|what| self.damaged(version, None, what))?;
            self.outline(version)?;
            self.log(version)?;
            self.decisions(version)?;
            match self.run(version) {
                Ok(run) => drop(self.program(version, &run.program)?),
                Err(StoreError::Missing { .. }) => {}
                Err(error) => return Err(error),
            }
            Ok(())
        };
        let finding = |row: (VersionRow, bool)| Finding { version: row.0.clone(), trouble: check(row).err() };
        Ok(self.version_rows()?.into_iter().map(finding).collect())
    }

    /// What SQLite says about the file as a whole; nothing if all is well.
    #[must_use]
    pub fn check_pages(&self) -> Option<String> {
        let said = self.db.query_row("PRAGMA quick_check(1)", [], |row| row.get::<_, String>(0));
        match said {
            Ok(said) if said == "ok" => None,
            Ok(said) => Some(said),
            Err(error) => Some(error.to_string()),
        }
    }

    /// Forgets versions, and gives the room back.
    ///
    /// # Errors
    /// The store cannot be written.
    pub fn forget(&mut self, versions: &[i64]) -> Result<(), StoreError> {
        let mut work = || -> rusqlite::Result<()> {
            let all = self.db.transaction()?;
            for id in versions {
                for table in
                    ["versions", "runs", "batches", "log", "chunks", "outlines", "edits", "decisions"]
                {
                    all.execute(&format!("DELETE FROM {table} WHERE id = ?"), [id])?;
                }
            }
            all.execute("DELETE FROM programs WHERE program NOT IN (SELECT program FROM runs)", [])?;
            all.commit()?;
            self.db.execute_batch("VACUUM; PRAGMA wal_checkpoint(TRUNCATE)")
        };
        work().map_err(|error| StoreError::of(&self.path, true, &error))
    }

    pub(crate) fn damaged(&self, of: &VersionRow, batch: Option<i64>, what: String) -> StoreError {
        let (tree, version) = (vm::show::safe(&of.tree), of.version.to_string());
        StoreError::Damaged { path: self.path.clone(), tree, version, batch, what }
    }

    /// What is wrong with a row of a version, with the batch that wrote it first.
    fn within(&self, of: &VersionRow, count: Option<&str>, trouble: Trouble, table: &str) -> StoreError {
        match trouble {
            Trouble::Row(number, problem) => {
                let batch = count.and_then(|count| self.batch_of(of, count, number));
                self.damaged(of, batch, format!("row {number} of {table} {problem}"))
            }
            Trouble::Rows(number, problem) => {
                let batch = count.and_then(|count| self.batch_of(of, count, number));
                self.damaged(of, batch, format!("rows of {table} from {number} on {problem}"))
            }
            Trouble::Sqlite(error) => match StoreError::of(&self.path, self.writes, &error) {
                StoreError::Damaged { what, .. } => self.damaged(of, None, format!("{what}, in {table}")),
                other => other,
            },
        }
    }

    fn batch_of(&self, of: &VersionRow, count: &str, number: i64) -> Option<i64> {
        let select = format!("SELECT min(batch) FROM batches WHERE id = ? AND {count} >= ?");
        self.db.query_row(&select, [of.id, number], |row| row.get(0)).ok().flatten()
    }
}

fn version_row(row: &Row<'_>) -> rusqlite::Result<(VersionRow, bool)> {
    let it = VersionRow {
        id: row.get(0)?,
        tree: row.get(1)?,
        version: row.get(2)?,
        base: row.get(3)?,
        batches: row.get(4)?,
        slots: row.get(5)?,
        records: row.get(6)?,
        edits: row.get(7)?,
        entries: row.get(8)?,
        steps: row.get(9)?,
    };
    let sum = Sum::of("versions").number(it.id).text(&it.tree).number(it.version).maybe_number(it.base);
    let sum = sum.number(it.batches).number(it.slots).number(it.records).number(it.edits).number(it.entries);
    let fits = sum.number(it.steps).end() == row.get::<_, i64>(10)?;
    Ok((it, fits))
}

/// A row whose sum fits.
fn fitting<T>(number: i64, (row, fits): (T, bool)) -> Result<T, Trouble> {
    if fits { Ok(row) } else { Err(Trouble::Row(number, "is not what was written")) }
}

fn all_fit<T>(rows: Vec<(T, bool)>) -> Rows<T> {
    (1..).zip(rows).map(|(at, row)| fitting(at, row)).collect()
}

/// Rows that are numbered from 1 to `most`.
fn gapless<T, U>(
    most: i64,
    rows: impl Iterator<Item = rusqlite::Result<T>>,
    number: impl Fn(T) -> (i64, U),
) -> Rows<U> {
    let mut found = Vec::new();
    for row in rows {
        let (at, row) = number(row?);
        let expected = found.len() as i64 + 1;
        if at != expected {
            return Err(Trouble::Row(expected, "is not there"));
        }
        found.push(row);
    }
    match found.len() as i64 {
        len if len < most => Err(Trouble::Row(len + 1, "is not there")),
        _ => Ok(found),
    }
}
