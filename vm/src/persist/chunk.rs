//! Rows in chunks: a thousand of them in one JSON text, so that a database has few things to do for many rows, and
//! anybody who knows JSON can still read them.
//!
//! Words that many rows have stand once, in a list of their own; a row has their numbers in that. Which row it is
//! follows from where it stands. The list of words says what cannot be in a chunk, without a look at its rows.
//!
//! | row | fields |
//! |---|---|
//! | slot | parent, name*, site*, place−, steps |
//! | record | slot−, parent, attempt, name*, kind*, status*, why*, start, end, params, value, late |
//!
//! Fields with `*` are numbers of words; those with `−` say by how much they are more than the number of the row, which
//! is mostly 0. Steps and params are JSON, a value is a text, late is a pair of JSON: failure and more. Each of these is 0
//! where there is nothing. `end` is `null` while a task runs. The name in a record is for those who read only records.

use rustc_hash::{FxHashMap, FxHasher};
use serde_json::value::RawValue;
use std::hash::{Hash as _, Hasher as _};

use super::rows::{failure, has_failed, more, params_onto, put_number, put_text, put_value, steps_onto};
use super::{SavedRecord, SavedSlot, Word};
use crate::code::Program;
use crate::tree::{NodeKind, RecId, SlotId, Status, Tree, Why};

/// So many rows stand in a chunk; the last one may have fewer.
pub const ROWS: u32 = 1024;

/// The number of the first row of the chunk that a row stands in. Rows are numbered from 1.
#[must_use]
pub fn first_of(row: u32) -> u32 {
    row - (row - 1) % ROWS
}

/// Rows as text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chunk<'a> {
    /// The words: a JSON list of texts.
    pub words: &'a str,
    /// The rows: a JSON list of lists.
    pub rows: &'a str,
}

/// Makes chunks.
pub struct Packer {
    words: String,
    known: FxHashMap<Word, u32>,
    /// The words that the row before had, by their fields: mostly they are the same.
    last: [Option<(Word, u32)>; COLUMNS],
    sites: FxHashMap<u64, u32>,
    rows: String,
    /// The words of the fixed lists, in the order of those.
    kinds: Vec<Word>,
    statuses: Vec<Word>,
    whys: Vec<Word>,
}

impl Default for Packer {
    fn default() -> Packer {
        Packer {
            words: String::new(),
            known: FxHashMap::default(),
            last: Default::default(),
            sites: FxHashMap::default(),
            rows: String::new(),
            kinds: symbols(NodeKind::ALL, NodeKind::word),
            statuses: symbols(Status::ALL, Status::word),
            whys: symbols(Why::ALL, Why::word),
        }
    }
}

/// Fields that are words.
const COLUMNS: usize = 4;

impl Packer {
    /// Adds the row of a slot.
    pub fn slot(&mut self, program: &Program, tree: &Tree, id: SlotId) {
        let it = tree.slot(id);
        let site = program.sites.get(it.key.site.at()).map_or(0, |site| site.hash);
        self.put_slot(it.parent.0, it.name, site, far(tree.place(id), id.0), |out| {
            steps_onto(out, program, tree, it.key.chain);
        });
    }

    /// Adds such a row again. Its JSON must be such.
    pub fn saved_slot(&mut self, it: &SavedSlot) {
        self.put_slot(it.parent, it.name, it.site, far(it.place, it.slot), |out| *out += &it.steps);
    }

    /// Adds the row of a record. Answers a number for what may change after it is final, 0 if there is no such thing.
    pub fn record(&mut self, program: &Program, tree: &Tree, id: RecId) -> u64 {
        let it = tree.record(id);
        let is_final = it.status.is_final();
        let failed = has_failed(it);
        let late = Late::of(program, tree, id);
        let name = tree.slot(it.slot).name;
        self.put_words(
            far(it.slot.0, id.0),
            [it.parent.0, it.attempt],
            [
                name,
                self.kinds[it.kind as usize],
                self.statuses[it.status as usize],
                self.whys[it.why as usize],
            ],
        );
        self.put_times(it.start, is_final.then_some(it.end));
        let out = &mut self.rows;
        maybe(out, |out| params_onto(out, program, tree, id));
        match is_final && !failed {
            true => put_value(out, program, &it.value),
            false => out.push('0'),
        }
        out.push(',');
        late.put(out);
        late.number()
    }

    /// Adds such a row again. Its JSON must be such.
    pub fn saved_record(&mut self, it: &SavedRecord, name: Word) {
        self.put_words(far(it.slot, it.record), [it.parent, it.attempt], [name, it.kind, it.status, it.why]);
        self.put_times(it.start_ns, it.end_ns);
        let out = &mut self.rows;
        maybe(out, |out| *out += &it.params);
        match &it.value {
            Some(value) => put_text(out, value),
            None => out.push('0'),
        }
        out.push(',');
        Late { failure: it.failure.as_deref(), more: it.more.as_deref() }.put(out);
    }

    /// Ends the chunk: hands it on, and begins an empty one in the same memory.
    pub fn end<T>(&mut self, take: impl FnOnce(Chunk<'_>) -> T) -> T {
        for text in [&mut self.words, &mut self.rows] {
            text.push_str(if text.is_empty() { "[]" } else { "]" });
        }
        let taken = take(Chunk { words: &self.words, rows: &self.rows });
        self.words.clear();
        self.rows.clear();
        self.known.clear();
        self.sites.clear();
        self.last = Default::default();
        taken
    }

    fn put_slot(&mut self, parent: u32, name: Word, site: u64, place: i64, steps: impl FnOnce(&mut String)) {
        let name = self.word_of(0, name);
        let site = match self.sites.get(&site) {
            Some(known) => *known,
            None => {
                let word = self.word(Word::from(&format!("{site:016x}")));
                self.sites.insert(site, word);
                word
            }
        };
        self.open();
        let out = &mut self.rows;
        for number in [parent, name, site] {
            put_number(out, number);
            out.push(',');
        }
        put_number(out, place);
        out.push(',');
        maybe(out, steps);
        out.pop();
        out.push(']');
    }

    fn put_words(&mut self, slot: i64, numbers: [u32; 2], words: [Word; COLUMNS]) {
        let mut known = [0; COLUMNS];
        for (column, word) in words.into_iter().enumerate() {
            known[column] = self.word_of(column, word);
        }
        self.open();
        put_number(&mut self.rows, slot);
        self.rows.push(',');
        for number in numbers.into_iter().chain(known) {
            put_number(&mut self.rows, number);
            self.rows.push(',');
        }
    }

    fn put_times(&mut self, start: u64, end: Option<u64>) {
        put_number(&mut self.rows, start);
        self.rows.push(',');
        match end {
            Some(end) => put_number(&mut self.rows, end),
            None => self.rows.push_str("null"),
        }
        self.rows.push(',');
    }

    fn open(&mut self) {
        self.rows.push_str(if self.rows.is_empty() { "[[" } else { ",[" });
    }

    fn word_of(&mut self, column: usize, word: Word) -> u32 {
        if let Some((last, number)) = self.last[column]
            && last == word
        {
            return number;
        }
        let number = self.word(word);
        self.last[column] = Some((word, number));
        number
    }

    fn word(&mut self, word: Word) -> u32 {
        let next = self.known.len() as u32;
        *self.known.entry(word).or_insert_with(|| {
            put_word(&mut self.words, &word);
            next
        })
    }
}

/// What is said of a record may be more at the end of a run than when it became final.
struct Late<T> {
    failure: Option<T>,
    more: Option<T>,
}

impl Late<String> {
    fn of(program: &Program, tree: &Tree, id: RecId) -> Late<String> {
        let it = tree.record(id);
        Late { failure: has_failed(it).then(|| failure(program, it)), more: more(program, tree, id, it) }
    }
}

impl<T: AsRef<str>> Late<T> {
    fn put(&self, out: &mut String) {
        if self.failure.is_none() && self.more.is_none() {
            out.push_str("0]");
            return;
        }
        out.push('[');
        out.push_str(self.failure.as_ref().map_or("0", AsRef::as_ref));
        out.push(',');
        out.push_str(self.more.as_ref().map_or("0", AsRef::as_ref));
        out.push_str("]]");
    }

    fn number(&self) -> u64 {
        if self.failure.is_none() && self.more.is_none() {
            return 0;
        }
        let mut sum = FxHasher::default();
        self.failure.as_ref().map(AsRef::as_ref).hash(&mut sum);
        self.more.as_ref().map(AsRef::as_ref).hash(&mut sum);
        sum.finish() | 1
    }
}

/// The number that [`Packer::record`] would answer now.
#[must_use]
pub fn late(program: &Program, tree: &Tree, id: RecId) -> u64 {
    Late::of(program, tree, id).number()
}

/// True for JSON that may be in a row: an object or a list.
pub(super) fn is_part(text: &str) -> bool {
    text.starts_with(['{', '[']) && serde_json::from_str::<&RawValue>(text).is_ok()
}

/// By how much a number is more than that of its row.
fn far(number: u32, row: u32) -> i64 {
    i64::from(number) - i64::from(row)
}

/// The way back of [`far`].
fn near(far: i64, row: u32) -> Option<u32> {
    far.checked_add(row.into())?.try_into().ok()
}

/// JSON and a comma; 0 for nothing.
fn maybe(out: &mut String, put: impl FnOnce(&mut String)) {
    let from = out.len();
    put(out);
    if out.len() == from {
        out.push('0');
    }
    out.push(',');
}

/// The rows of a chunk of slots, of which the first has this number; nothing if it is no such chunk.
#[must_use]
pub fn slots(words: &str, rows: &str, first: u32) -> Option<Vec<SavedSlot>> {
    type Row<'a> = (u32, usize, usize, i64, &'a RawValue);
    let words = read_words(words)?;
    let rows: Vec<Row<'_>> = serde_json::from_str(rows).ok()?;
    let slot = |(slot, (parent, name, site, place, steps)): (u32, Row<'_>)| {
        Some(SavedSlot {
            slot,
            parent,
            name: *words.get(name)?,
            site: u64::from_str_radix(words.get(site)?, 16).ok()?,
            steps: there(steps).unwrap_or_default().into(),
            place: near(place, slot)?,
        })
    };
    (first..).zip(rows).map(slot).collect()
}

/// The rows of a chunk of records, of which the first has this number; nothing if it is no such chunk.
#[must_use]
pub fn records(words: &str, rows: &str, first: u32) -> Option<Vec<SavedRecord>> {
    type Raw<'a> = &'a RawValue;
    type Row<'a> = (i64, u32, u32, usize, usize, usize, usize, u64, Option<u64>, Raw<'a>, Raw<'a>, Raw<'a>);
    let words = read_words(words)?;
    let rows: Vec<Row<'_>> = serde_json::from_str(rows).ok()?;
    let record = |(record, row): (u32, Row<'_>)| {
        let (slot, parent, attempt, _, kind, status, why, start_ns, end_ns, params, value, late) = row;
        let (failure, more) = match there(late) {
            None => (None, None),
            Some(late) => {
                let (failure, more): (Raw<'_>, Raw<'_>) = serde_json::from_str(late).ok()?;
                (there(failure), there(more))
            }
        };
        Some(SavedRecord {
            record,
            slot: near(slot, record)?,
            parent,
            attempt,
            kind: *words.get(kind)?,
            status: *words.get(status)?,
            why: *words.get(why)?,
            start_ns,
            end_ns,
            params: there(params).unwrap_or_default().into(),
            value: there(value).map(text),
            failure: failure.map(str::to_string),
            more: more.map(str::to_string),
        })
    };
    (first..).zip(rows).map(record).collect()
}

fn there(json: &RawValue) -> Option<&str> {
    Some(json.get()).filter(|text| *text != "0")
}

/// What a text in JSON says.
fn text(json: &str) -> String {
    match json.strip_prefix('"').and_then(|it| it.strip_suffix('"')) {
        Some(text) if !text.contains('\\') => text.into(),
        _ => serde_json::from_str(json).unwrap_or_default(),
    }
}

/// The words of a fixed list, by the numbers of their variants.
pub(super) fn symbols<T: Copy>(all: &[T], word: fn(T) -> &'static str) -> Vec<Word> {
    all.iter().map(|it| Word::from(word(*it))).collect()
}

/// Puts a word at the end of a list that is not closed yet.
pub(super) fn put_word(list: &mut String, word: &str) {
    list.push(if list.is_empty() { '[' } else { ',' });
    put_text(list, word);
}

pub(super) fn read_words(words: &str) -> Option<Vec<Word>> {
    let words: Vec<String> = serde_json::from_str(words).ok()?;
    Some(words.iter().map(|word| Word::from(word)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_found_by_the_number_of_their_variant() {
        assert!(NodeKind::ALL.iter().enumerate().all(|(at, it)| at == *it as usize));
        assert!(Status::ALL.iter().enumerate().all(|(at, it)| at == *it as usize));
        assert!(Why::ALL.iter().enumerate().all(|(at, it)| at == *it as usize));
    }
}
