//! Writing a run while it runs.
//!
//! The writer is shown the tree now and then. It knows how far it has come, so that each look costs what is new: slots
//! and records that were made, and those records that had been open and are final now.

use std::cell::Cell;
use std::collections::BTreeSet;

use rusqlite::params;
use rustc_hash::FxHashMap;
use vm::code::Program;
use vm::log::{Entry, Log};
use vm::persist::chunk::{self, Chunk, Packer};
use vm::persist::{self, Outline, SavedEdit, SavedTree, Word};
use vm::tree::{RecId, SlotId, Tree};

use crate::error::StoreError;
use crate::open::Store;
use crate::read::RunRow;
use crate::sum::Sum;

/// A file of a program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Its name.
    pub file: String,
    /// The hash of its text.
    pub hash: String,
    /// Its text; that of the library is left out.
    pub text: Option<String>,
}

/// What is known of a run before it begins.
#[derive(Debug, Clone, Default)]
pub struct Begin {
    /// The tree; nothing for one of its own.
    pub tree: Option<String>,
    /// The version that it goes on with.
    pub base: Option<i64>,
    /// The plan file.
    pub file: String,
    /// The plan.
    pub plan: Option<String>,
    /// The hash of the program.
    pub program: String,
    /// Its files.
    pub sources: Vec<Source>,
    /// Key of the random draws.
    pub seed: u64,
    /// Key of the order of tasks.
    pub schedule: u64,
    /// How the robot moves.
    pub robot: String,
    /// All that is needed to run it again, as JSON.
    pub head: String,
    /// Edits of the version that it goes on with that hold no more, each with the reason.
    pub orphans: Vec<(SavedEdit, String)>,
}

/// A version that another store has had.
#[derive(Debug, Clone, Default)]
pub struct Import {
    /// The tree; nothing for one of its own.
    pub tree: Option<String>,
    /// Its version there. It is kept unless there is a later one here.
    pub version: i64,
    /// The version that it goes on with, by its number here.
    pub base: Option<i64>,
    /// Its rows.
    pub saved: SavedTree,
    /// Edits that hold no more, each with the reason.
    pub orphans: Vec<(SavedEdit, String)>,
    /// The run that made it.
    pub run: Option<RunRow>,
    /// The files of its program.
    pub sources: Vec<Source>,
    /// The log of the run.
    pub log: Log,
    /// Fuel that it used.
    pub steps: u64,
}

fn begin_of(run: &RunRow) -> Begin {
    Begin {
        file: run.file.clone(),
        plan: run.plan.clone(),
        program: run.program.clone(),
        seed: run.seed.parse().unwrap_or_default(),
        schedule: run.schedule.parse().unwrap_or_default(),
        robot: run.robot.clone(),
        head: run.head.clone(),
        ..Begin::default()
    }
}

/// What became of a proposal to change the plan of a run.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Decision {
    /// Who proposed which edits, as text.
    pub what: String,
    /// `accepted` or `refused`, and by which check.
    pub decision: String,
    /// Why it was refused; empty if it was not.
    pub why: String,
    /// What the check has measured, as JSON.
    pub numbers: String,
}

pub(crate) fn decision_sum(id: i64, number: i64, it: &Decision) -> i64 {
    let sum = Sum::of("decisions").number(id).number(number);
    sum.text(&it.what).text(&it.decision).text(&it.why).text(&it.numbers).end()
}

/// What a call of the store can come to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The disk is full.
    Full,
    /// It cannot be read or written.
    Broken,
    /// Another process holds the file, for too long.
    Locked,
}

impl Fault {
    /// All of them.
    pub const ALL: &[Fault] = &[Fault::Full, Fault::Broken, Fault::Locked];

    fn code(self) -> std::ffi::c_int {
        match self {
            Fault::Full => rusqlite::ffi::SQLITE_FULL,
            Fault::Broken => rusqlite::ffi::SQLITE_IOERR_WRITE,
            Fault::Locked => rusqlite::ffi::SQLITE_BUSY,
        }
    }
}

/// Writes a version of a tree.
pub struct Writer {
    store: Store,
    /// The number of the version in the file.
    pub id: i64,
    /// The name of its tree.
    pub tree: String,
    /// Its version.
    pub version: i64,
    base: Option<i64>,
    begin: Begin,
    batches: i64,
    slots: u32,
    /// Where the slots stood when they were written.
    places: Vec<u32>,
    records: u32,
    /// Records that were written before they were final.
    open: Vec<RecId>,
    /// What was said of records that may be more at the end of the run.
    late: FxHashMap<RecId, u64>,
    packer: Packer,
    /// Memory of [`Writer::write_tree`].
    moved: Vec<RecId>,
    /// Rows of the last batch: all, and those that had not been written before.
    rows: (u32, u32),
    edits: i64,
    entries: i64,
    pending: Vec<Entry>,
    /// Slots, records, edits and fuel that the file has of a run that is resumed.
    least: (i64, i64, i64, i64),
    /// While the run is replayed nothing is written: the file has it.
    silent_until: u64,
    calls: Cell<u64>,
    /// For tests: the call of the store that fails, and how.
    pub fails_at: Option<(u64, Fault)>,
    /// Fuel that was used when it was looked at last.
    looked: u64,
}

/// Trees with longer outlines have none, in bytes: SQLite keeps no more than a billion in one place.
const MOST_OUTLINE: usize = 900_000_000;

/// The tree of a run that goes on with none is called by its number.
#[must_use]
pub fn own_name(id: i64) -> String {
    format!("run-{id}")
}

impl Writer {
    /// Begins a version.
    ///
    /// # Errors
    /// The store cannot be written.
    pub fn begin(store: Store, begin: Begin) -> Result<Writer, StoreError> {
        let next: i64 = store
            .db
            .query_row("SELECT coalesce(max(id), 0) + 1 FROM versions", [], |row| row.get(0))
            .map_err(|error| store.error(&error))?;
        let tree = begin.tree.clone().unwrap_or_else(|| own_name(next));
        let version: i64 = store
            .db
            .query_row("SELECT coalesce(max(version), 0) + 1 FROM versions WHERE tree = ?", [&tree], |row| {
                row.get(0)
            })
            .map_err(|error| store.error(&error))?;
        let base = begin.base;
        let mut writer = Writer::new(store, next, tree, version, base, begin);
        writer.in_batch(|it| {
            it.write_program()?;
            it.write_run("running", None, 0)?;
            let orphans = it.begin.orphans.clone();
            for (number, (edit, why)) in (1..).zip(&orphans) {
                // Numbers below 0, so that those of the edits that hold have no gaps.
                let edit = SavedEdit { number: 0, ..edit.clone() };
                it.write_edit(-number, &edit, Some(why))?;
            }
            it.write_version(0)
        })?;
        Ok(writer)
    }

    fn new(store: Store, id: i64, tree: String, version: i64, base: Option<i64>, begin: Begin) -> Writer {
        Writer {
            store,
            id,
            tree,
            version,
            base,
            begin,
            batches: 0,
            slots: 0,
            places: Vec::new(),
            records: 0,
            open: Vec::new(),
            late: FxHashMap::default(),
            packer: Packer::default(),
            moved: Vec::new(),
            rows: (0, 0),
            edits: 0,
            entries: 0,
            pending: Vec::new(),
            least: (0, 0, 0, 0),
            silent_until: 0,
            calls: Cell::new(0),
            fails_at: None,
            looked: 0,
        }
    }

    /// Goes on with a version whose run was stopped.
    ///
    /// # Errors
    /// The store cannot be written, or is damaged.
    pub fn resume(path: &std::path::Path, id: i64) -> Result<Writer, StoreError> {
        let store = Store::write(path)?;
        let row = store.version_by_id(id)?;
        let run = store.run(&row)?;
        let mut writer = Writer::new(store, id, row.tree, row.version, row.base, begin_of(&run));
        (writer.batches, writer.entries) = (row.batches, row.entries);
        writer.least = (row.slots, row.records, row.edits, row.steps);
        writer.silent_until = row.steps as u64;
        Ok(writer)
    }

    /// How often the store has been called.
    #[must_use]
    pub fn calls(&self) -> u64 {
        self.calls.get()
    }

    /// What came from outside; it is written with the next batch.
    pub fn logged(&mut self, entry: &Entry) {
        self.pending.push(entry.clone());
    }

    /// How much has not been written yet: entries of the log, and new records.
    #[must_use]
    pub fn waiting(&self, tree: &Tree, steps: u64) -> (usize, usize) {
        if steps < self.silent_until {
            return (0, 0);
        }
        (self.pending.len(), tree.len() - (self.records as usize).min(tree.len()))
    }

    /// True if something happened since the last look.
    #[must_use]
    pub fn is_behind(&self, steps: u64) -> bool {
        steps >= self.silent_until && (steps > self.looked || !self.pending.is_empty())
    }

    /// Which part of the last batch had been written before.
    #[must_use]
    pub fn again(&self) -> f64 {
        let (all, new) = self.rows;
        f64::from(all - new.min(all)) / f64::from(all.max(1))
    }

    /// Writes the entries that wait, and no more: the tree of the file may be behind its log.
    ///
    /// # Errors
    /// The store cannot be written.
    pub fn write_log(&mut self) -> Result<(), StoreError> {
        let Some(last) = self.pending.last() else { return Ok(()) };
        let steps = last.step.max(self.looked);
        self.in_batch(|it| {
            it.write_entries()?;
            it.write_version(steps)
        })
    }

    /// Writes what is new.
    ///
    /// # Errors
    /// The store cannot be written.
    pub fn write(&mut self, program: &Program, tree: &Tree, steps: u64) -> Result<(), StoreError> {
        if steps < self.silent_until {
            return Ok(());
        }
        self.looked = steps;
        self.in_batch(|it| {
            it.write_entries()?;
            it.write_tree(program, tree)?;
            it.write_version(steps)
        })
    }

    /// Writes the end of the run: `outcome` in a word, its value as text.
    ///
    /// # Errors
    /// The store cannot be written.
    pub fn end(
        &mut self,
        program: &Program,
        tree: &Tree,
        steps: u64,
        clock_ns: u64,
        outcome: &str,
        value: Option<&str>,
    ) -> Result<(), StoreError> {
        self.silent_until = 0;
        self.in_batch(|it| {
            it.write_entries()?;
            it.write_tree(program, tree)?;
            it.write_late(program, tree)?;
            it.write_outline(Outline::of(tree))?;
            it.write_run(outcome, value, clock_ns)?;
            it.write_version(steps)
        })
    }

    /// Writes a tree that no run of this command has made.
    ///
    /// # Errors
    /// The store cannot be written.
    pub fn put(
        store: Store,
        tree: &str,
        base: Option<i64>,
        saved: &SavedTree,
        origin: &str,
    ) -> Result<Writer, StoreError> {
        let next: i64 = store
            .db
            .query_row("SELECT coalesce(max(id), 0) + 1 FROM versions", [], |row| row.get(0))
            .map_err(|error| store.error(&error))?;
        let version: i64 = store
            .db
            .query_row("SELECT coalesce(max(version), 0) + 1 FROM versions WHERE tree = ?", [tree], |row| {
                row.get(0)
            })
            .map_err(|error| store.error(&error))?;
        let mut writer = Writer::new(store, next, tree.into(), version, base, Begin::default());
        writer.in_batch(|it| {
            it.write_saved(saved)?;
            it.write_outline(Outline::of_saved(saved))?;
            for row in &saved.edits {
                it.write_edit(i64::from(row.number), &made_by(row, origin), None)?;
            }
            it.edits = saved.edits.len() as i64;
            it.write_version(0)
        })?;
        Ok(writer)
    }

    /// Writes a version that another store has had, with its run.
    ///
    /// # Errors
    /// The store cannot be written.
    pub fn import(store: Store, it: &Import) -> Result<Writer, StoreError> {
        let count = |select: &str, tree: &str| {
            let number = if tree.is_empty() {
                store.db.query_row(select, [], |row| row.get(0))
            } else {
                store.db.query_row(select, [tree], |row| row.get(0))
            };
            number.map_err(|error| store.error(&error))
        };
        let next: i64 = count("SELECT coalesce(max(id), 0) + 1 FROM versions", "")?;
        let tree = it.tree.clone().unwrap_or_else(|| own_name(next));
        let last: i64 = count("SELECT coalesce(max(version), 0) FROM versions WHERE tree = ?", &tree)?;
        let begin = it
            .run
            .as_ref()
            .map_or_else(Begin::default, |run| Begin { sources: it.sources.clone(), ..begin_of(run) });
        let mut writer = Writer::new(store, next, tree, it.version.max(last + 1), it.base, begin);
        writer.pending.clone_from(&it.log.entries);
        writer.in_batch(|to| {
            if let Some(run) = &it.run {
                to.write_program()?;
                to.write_run(&run.outcome, run.value.as_deref(), run.clock_ns as u64)?;
            }
            to.write_entries()?;
            to.write_saved(&it.saved)?;
            to.write_outline(Outline::of_saved(&it.saved))?;
            for row in &it.saved.edits {
                to.write_edit(i64::from(row.number), row, None)?;
            }
            for (number, (edit, why)) in (1..).zip(&it.orphans) {
                to.write_edit(-number, edit, Some(why))?;
            }
            to.edits = it.saved.edits.len() as i64;
            to.write_version(it.steps)
        })?;
        Ok(writer)
    }

    /// Writes another tree into the store that this run is kept in. Answers its version.
    ///
    /// # Errors
    /// The store cannot be written.
    pub fn put_beside(&self, tree: &str, saved: &SavedTree, origin: &str) -> Result<i64, StoreError> {
        // The lock is held already, by this writer.
        let store = Store::write_locked(&self.store.path, None)?;
        Writer::put(store, tree, None, saved, origin).map(|writer| writer.version)
    }

    /// Writes what became of the proposals of the rehearsal before the run.
    ///
    /// # Errors
    /// The store cannot be written.
    pub fn decided(&mut self, decisions: &[Decision]) -> Result<(), StoreError> {
        let id = self.id;
        self.in_batch(|to| {
            for (number, it) in (1..).zip(decisions) {
                let sum = decision_sum(id, number, it);
                to.execute(
                    "INSERT OR REPLACE INTO decisions VALUES (?, ?, ?, ?, ?, ?, ?)",
                    params![id, number, it.what, it.decision, it.why, it.numbers, sum],
                )?;
            }
            to.write_version(0)
        })
    }

    // ------------------------------------------------------------------ batches

    /// Writes in one transaction: all of it or nothing.
    fn in_batch(
        &mut self,
        write: impl FnOnce(&mut Writer) -> rusqlite::Result<()>,
    ) -> Result<(), StoreError> {
        self.batches += 1;
        let done = self.run("BEGIN IMMEDIATE").and_then(|()| {
            write(self)?;
            self.run("COMMIT")
        });
        done.map_err(|error| {
            let _ = self.store.db.execute_batch("ROLLBACK");
            self.store.error(&error)
        })
    }

    fn run(&self, text: &str) -> rusqlite::Result<()> {
        self.count()?;
        self.store.db.execute_batch(text)
    }

    fn count(&self) -> rusqlite::Result<()> {
        self.calls.set(self.calls.get() + 1);
        match self.fails_at {
            Some((at, fault)) if at == self.calls.get() => {
                let error = rusqlite::ffi::Error::new(fault.code());
                Err(rusqlite::Error::SqliteFailure(error, None))
            }
            _ => Ok(()),
        }
    }

    fn execute(&self, text: &str, values: impl rusqlite::Params) -> rusqlite::Result<()> {
        self.count()?;
        self.store.db.prepare_cached(text)?.execute(values)?;
        Ok(())
    }

    // ------------------------------------------------------------------ rows

    fn write_program(&mut self) -> rusqlite::Result<()> {
        let (program, sources) = (self.begin.program.clone(), self.begin.sources.clone());
        for Source { file, hash, text } in &sources {
            let sum = Sum::of("programs").text(&program).text(file).text(hash).maybe(text.as_deref()).end();
            let insert = "INSERT OR REPLACE INTO programs VALUES (?, ?, ?, ?, ?)";
            self.execute(insert, params![program, file, hash, text, sum])?;
        }
        Ok(())
    }

    fn write_run(&mut self, outcome: &str, value: Option<&str>, clock_ns: u64) -> rusqlite::Result<()> {
        let Begin { file, plan, program, seed, schedule, robot, head, .. } = self.begin.clone();
        let (seed, schedule, clock_ns) = (seed.to_string(), schedule.to_string(), clock_ns as i64);
        let sum = Sum::of("runs").number(self.id).text(&file).maybe(plan.as_deref()).text(&program);
        let sum = sum.text(&seed).text(&schedule).text(&robot).text(&head).text(outcome).maybe(value);
        let sum = sum.number(clock_ns).end();
        self.execute(
            "INSERT OR REPLACE INTO runs VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            params![self.id, file, plan, program, seed, schedule, robot, head, outcome, value, clock_ns, sum],
        )
    }

    fn write_version(&mut self, steps: u64) -> rusqlite::Result<()> {
        let least = self.least;
        let (id, steps, edits) = (self.id, (steps as i64).max(least.3), self.edits.max(least.2));
        let (slots, records) = (i64::from(self.slots).max(least.0), i64::from(self.records).max(least.1));
        let entries = self.entries;
        let sum = Sum::of("batches").number(id).number(self.batches).number(slots).number(records);
        let sum = sum.number(entries).number(steps).end();
        self.execute(
            "INSERT OR REPLACE INTO batches VALUES (?, ?, ?, ?, ?, ?, ?)",
            params![id, self.batches, slots, records, entries, steps, sum],
        )?;
        let (tree, version, base) = (self.tree.clone(), self.version, self.base);
        let sum = Sum::of("versions").number(id).text(&tree).number(version).maybe_number(base);
        let sum = sum.number(self.batches).number(slots).number(records).number(edits).number(entries);
        let sum = sum.number(steps).end();
        self.execute(
            "INSERT OR REPLACE INTO versions VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            params![id, tree, version, base, self.batches, slots, records, edits, entries, steps, sum],
        )
    }

    fn write_entries(&mut self) -> rusqlite::Result<()> {
        for entry in std::mem::take(&mut self.pending) {
            self.entries += 1;
            let (id, number) = (self.id, self.entries);
            let events = entry.to_json()["events"].to_string();
            let (round, step, clock) = (entry.round as i64, entry.step as i64, entry.clock as i64);
            let sum = Sum::of("log").number(id).number(number).number(round).number(step).number(clock);
            let sum = sum.text(&events).end();
            self.execute(
                "INSERT OR REPLACE INTO log VALUES (?, ?, ?, ?, ?, ?, ?)",
                params![id, number, round, step, clock, events, sum],
            )?;
        }
        Ok(())
    }

    fn write_tree(&mut self, program: &Program, tree: &Tree) -> rusqlite::Result<()> {
        let is_final = |id: &RecId| tree.record(*id).status.is_final();
        let mut records = BTreeSet::new();
        let mut slots = BTreeSet::new();
        for id in self.open.extract_if(.., |id| is_final(id)) {
            records.insert(chunk::first_of(id.0));
            self.moved.push(id);
        }
        let last = tree.len() as u32;
        for id in (self.records + 1..=last).map(RecId) {
            if !is_final(&id) {
                self.open.push(id);
            }
            self.moved.push(id);
        }
        // A slot that was written stands elsewhere in this run.
        for id in self.moved.drain(..) {
            let slot = tree.record(id).slot;
            if slot.0 <= self.slots && self.places.get(slot.0 as usize) != Some(&tree.place(slot)) {
                slots.insert(chunk::first_of(slot.0));
            }
        }
        let (from, last_slot) = (self.slots + self.records, tree.last_slot().0);
        records.extend(chunks_of(self.records + 1, last));
        slots.extend(chunks_of(self.slots + 1, last_slot));
        (self.slots, self.records) = (last_slot, last);
        self.rows = (0, (last + last_slot).saturating_sub(from));
        self.write_chunks(program, tree, records, slots)?;
        // Some come while the tree runs: a call with the edits of another tree.
        if (self.edits as usize) < tree.edits.len() {
            let known = self.edits as usize;
            for edit in persist::edits(program, tree).into_iter().skip(known) {
                self.edits += 1;
                self.write_edit(i64::from(edit.number), &made_by(&edit, "base"), None)?;
            }
        }
        Ok(())
    }

    /// What is said of failures and edits may be more at the end than when it was written.
    fn write_late(&mut self, program: &Program, tree: &Tree) -> rusqlite::Result<()> {
        let mut records: BTreeSet<u32> = self.open.drain(..).map(|id| chunk::first_of(id.0)).collect();
        let mut slots = BTreeSet::new();
        for id in tree.records() {
            vm::failure::name_tasks(tree, &tree.record(id).value);
            let late = chunk::late(program, tree, id);
            if late != self.late.get(&id).copied().unwrap_or(0) {
                records.insert(chunk::first_of(id.0));
            }
        }
        for slot in tree.slots() {
            if self.places.get(slot.0 as usize) != Some(&tree.place(slot)) {
                slots.insert(chunk::first_of(slot.0));
            }
        }
        self.write_chunks(program, tree, records, slots)
    }

    /// Writes chunks, each named by its first row. One that was written before is written again as a whole.
    fn write_chunks(
        &mut self,
        program: &Program,
        tree: &Tree,
        records: BTreeSet<u32>,
        slots: BTreeSet<u32>,
    ) -> rusqlite::Result<()> {
        self.places.resize(self.slots as usize + 1, u32::MAX);
        for first in slots {
            let last = self.slots.min(first + chunk::ROWS - 1);
            for id in (first..=last).map(SlotId) {
                self.packer.slot(program, tree, id);
                self.places[id.0 as usize] = tree.place(id);
            }
            self.write_chunk("slots", first, last)?;
        }
        for first in records {
            let last = self.records.min(first + chunk::ROWS - 1);
            for id in (first..=last).map(RecId) {
                let late = self.packer.record(program, tree, id);
                if late != 0 {
                    self.late.insert(id, late);
                }
            }
            self.write_chunk("records", first, last)?;
        }
        Ok(())
    }

    fn write_saved(&mut self, saved: &SavedTree) -> rusqlite::Result<()> {
        (self.slots, self.records) = (saved.slots.len() as u32, saved.records.len() as u32);
        for (at, rows) in saved.slots.chunks(chunk::ROWS as usize).enumerate() {
            rows.iter().for_each(|row| self.packer.saved_slot(row));
            let first = at as u32 * chunk::ROWS + 1;
            self.write_chunk("slots", first, first + rows.len() as u32 - 1)?;
        }
        for (at, rows) in saved.records.chunks(chunk::ROWS as usize).enumerate() {
            for row in rows {
                let name = saved
                    .slots
                    .get((row.slot as usize).wrapping_sub(1))
                    .map_or_else(Word::default, |slot| slot.name);
                self.packer.saved_record(row, name);
            }
            let first = at as u32 * chunk::ROWS + 1;
            self.write_chunk("records", first, first + rows.len() as u32 - 1)?;
        }
        Ok(())
    }

    /// Whatever is written later, the outline is that of an earlier moment then, and not used.
    fn write_outline(&mut self, outline: Option<Outline>) -> rusqlite::Result<()> {
        let Some(Outline { words, tasks }) = outline.filter(|it| (1..MOST_OUTLINE).contains(&it.tasks.len()))
        else {
            return Ok(());
        };
        let (id, batch) = (self.id, self.batches);
        let sum = outline_sum(id, batch, &words, &tasks);
        let insert = "INSERT OR REPLACE INTO outlines VALUES (?, ?, ?, ?, ?)";
        self.execute(insert, params![id, batch, sum, words, tasks])
    }

    fn write_chunk(&mut self, what: &str, first: u32, last: u32) -> rusqlite::Result<()> {
        let (id, count) = (self.id, last + 1 - first);
        self.rows.0 += count;
        let mut packer = std::mem::take(&mut self.packer);
        let written = packer.end(|Chunk { words, rows }| {
            let sum = chunk_sum(id, what, first, count, words, rows);
            self.execute(
                "INSERT OR REPLACE INTO chunks VALUES (?, ?, ?, ?, ?, ?, ?)",
                params![id, what, first, count, sum, words, rows],
            )
        });
        self.packer = packer;
        written
    }

    fn write_edit(&mut self, number: i64, row: &SavedEdit, orphan: Option<&str>) -> rusqlite::Result<()> {
        let sum = edit_sum(self.id, number, row, orphan);
        let id = self.id;
        self.execute(
            "INSERT OR REPLACE INTO edits VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
            params![id, number, row.slot, row.edit, row.callee, row.after, row.origin, orphan, sum],
        )
    }
}

/// The chunks that rows stand in, each named by its first row.
fn chunks_of(from: u32, to: u32) -> impl Iterator<Item = u32> {
    (chunk::first_of(from)..=to).step_by(chunk::ROWS as usize).filter(move |_| from <= to)
}

pub(crate) fn outline_sum(id: i64, batch: i64, words: &str, tasks: &[u8]) -> i64 {
    Sum::of("outlines").number(id).number(batch).text(words).bytes(tasks).end()
}

pub(crate) fn chunk_sum(id: i64, what: &str, first: u32, count: u32, words: &str, rows: &str) -> i64 {
    let sum = Sum::of("chunks").number(id).text(what).number(first.into()).number(count.into());
    sum.text(words).text(rows).end()
}

/// An edit of which nobody has said who made it is said to be made by this.
fn made_by(row: &SavedEdit, origin: &str) -> SavedEdit {
    let origin = if row.origin.is_empty() { origin } else { &row.origin };
    SavedEdit { origin: origin.into(), ..row.clone() }
}

pub(crate) fn edit_sum(id: i64, number: i64, row: &SavedEdit, orphan: Option<&str>) -> i64 {
    let sum = Sum::of("edits").number(id).number(number).number(row.slot.into()).text(&row.edit);
    sum.text(&row.callee).text(&row.after).text(&row.origin).maybe(orphan).end()
}
