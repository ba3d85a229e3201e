//! The outline of a tree: its tasks as they stand in it, with no more than where they stand, what they are called and
//! what became of them. A query about a large tree begins with it, and has its first answer before the rest is read.

use rustc_hash::FxHashMap;

use super::chunk::{put_word, read_words, symbols};
use super::{SavedRecord, SavedTree, Word};
use crate::tree::{NodeKind, ROOT, RecId, Record, SlotId, Status, Tree};

/// Tasks in the order of the tree.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outline {
    /// Names, kinds and statuses: a JSON list of texts.
    pub words: String,
    /// Ten bytes for each task: the number of the one above, then its name, kind and status as numbers of words.
    pub tasks: Vec<u8>,
}

/// Bytes of a task.
const TASK: usize = 10;

/// A task of an outline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outlined {
    /// The number of the task above, from 0; that of the root is its own.
    pub parent: u32,
    /// What is called.
    pub name: Word,
    /// The word for its kind.
    pub kind: Word,
    /// The word for its status.
    pub status: Word,
}

impl Outline {
    /// The outline of a tree as it is now; nothing if it has too many names.
    #[must_use]
    pub fn of(tree: &Tree) -> Option<Outline> {
        let (kinds, statuses) = (symbols(NodeKind::ALL, NodeKind::word), symbols(Status::ALL, Status::word));
        let words = |slot: SlotId, record: &Record| {
            [tree.slot(slot).name, kinds[record.kind as usize], statuses[record.status as usize]]
        };
        let stands = |rec: RecId| {
            let it = tree.record(rec);
            let above = if rec == RecId(1) { SlotId(0) } else { tree.record(it.parent).slot };
            let is_only = it.attempt == 1 && (rec == RecId(1) || tree.place(it.slot) == rec.0);
            (is_only && tree.slot(it.slot).parent == above).then(|| (it.parent.0, words(it.slot, it)))
        };
        if let Some(made) = in_order(tree.len(), tree.records().map(stands)) {
            return Some(made);
        }
        let mut making = Making::new(tree.len());
        let mut todo = vec![(ROOT, 0)];
        let mut children = Vec::new();
        while let Some((slot, parent)) = todo.pop() {
            let Some(rec) = tree.shown(slot) else { continue };
            let number = making.add(parent, words(slot, tree.record(rec)))?;
            tree.children_into(slot, &mut children);
            todo.extend(children.iter().rev().map(|child| (*child, number)));
        }
        Some(making.end())
    }

    /// The same of a saved one; nothing if its rows do not fit together, too.
    #[must_use]
    pub fn of_saved(saved: &SavedTree) -> Option<Outline> {
        let stands = |(number, it): (u32, &SavedRecord)| {
            let slot = saved.slots.get(number as usize - 1)?;
            let is_only = it.slot == number && it.record == number && slot.slot == number;
            let is_there = number == 1 || slot.place == number;
            (is_only && is_there && slot.parent == it.parent)
                .then_some((it.parent, [slot.name, it.kind, it.status]))
        };
        if let Some(made) = in_order(saved.records.len(), (1..).zip(&saved.records).map(stands)) {
            return Some(made);
        }
        let places = saved.places().ok()?;
        let mut making = Making::new(saved.records.len());
        let mut todo = vec![(ROOT.0, 0)];
        while let Some((slot, parent)) = todo.pop() {
            let Some(last) = places.records(slot).last() else { continue };
            let record = &saved.records[*last as usize - 1];
            let name = saved.slots[slot as usize - 1].name;
            let number = making.add(parent, [name, record.kind, record.status])?;
            todo.extend(places.children(slot).iter().rev().map(|child| (*child, number)));
        }
        Some(making.end())
    }

    /// Its tasks; nothing if these are none.
    #[must_use]
    pub fn read(words: &str, tasks: &[u8]) -> Option<Vec<Outlined>> {
        let words = read_words(words)?;
        let (tasks, rest) = tasks.as_chunks::<TASK>();
        let task = |(number, it): (u32, &[u8; TASK])| {
            let [p0, p1, p2, p3, n0, n1, k0, k1, s0, s1] = *it;
            let parent = u32::from_le_bytes([p0, p1, p2, p3]);
            let word = |bytes| words.get(usize::from(u16::from_le_bytes(bytes))).copied();
            let it =
                Outlined { parent, name: word([n0, n1])?, kind: word([k0, k1])?, status: word([s0, s1])? };
            (parent < number || number == 0 && parent == 0).then_some(it)
        };
        if !rest.is_empty() || tasks.is_empty() {
            return None;
        }
        (0..).zip(tasks).map(task).collect()
    }
}

/// The outline of records that stand in the order of the tree, as those of a run do that does nothing at the same time nor
/// twice. Of each the record above is given, with its words, or nothing if its slot has others.
fn in_order(tasks: usize, rows: impl Iterator<Item = Option<(u32, [Word; 3])>>) -> Option<Outline> {
    let mut making = Making::new(tasks);
    let mut open: Vec<u32> = Vec::new();
    for (number, row) in (1..).zip(rows) {
        let (parent, words) = row?;
        while open.last().is_some_and(|last| *last != parent) {
            open.pop();
        }
        if open.is_empty() != (number == 1) {
            return None;
        }
        open.push(number);
        making.add(parent.saturating_sub(1), words)?;
    }
    Some(making.end())
}

struct Making {
    words: String,
    known: FxHashMap<Word, u16>,
    last: [Option<(Word, u16)>; 3],
    tasks: Vec<u8>,
    number: u32,
}

impl Making {
    fn new(tasks: usize) -> Making {
        let (words, known) = (String::new(), FxHashMap::default());
        Making { words, known, last: [None; 3], tasks: Vec::with_capacity(tasks * TASK), number: 0 }
    }

    fn add(&mut self, parent: u32, words: [Word; 3]) -> Option<u32> {
        let mut numbers = [0; 3];
        for (column, word) in words.into_iter().enumerate() {
            numbers[column] = match self.last[column] {
                Some((last, number)) if last == word => number,
                _ => self.word(word)?,
            };
            self.last[column] = Some((word, numbers[column]));
        }
        let [p0, p1, p2, p3] = parent.to_le_bytes();
        let [[n0, n1], [k0, k1], [s0, s1]] = numbers.map(u16::to_le_bytes);
        self.tasks.extend_from_slice(&[p0, p1, p2, p3, n0, n1, k0, k1, s0, s1]);
        self.number += 1;
        Some(self.number - 1)
    }

    fn word(&mut self, word: Word) -> Option<u16> {
        let next = u16::try_from(self.known.len()).ok()?;
        Some(*self.known.entry(word).or_insert_with(|| {
            put_word(&mut self.words, &word);
            next
        }))
    }

    fn end(mut self) -> Outline {
        self.words.push_str(if self.words.is_empty() { "[]" } else { "]" });
        Outline { words: self.words, tasks: self.tasks }
    }
}

#[cfg(test)]
mod tests {
    use super::{Word, in_order};

    #[test]
    fn order_is_that_of_the_tree() {
        let row = |parent: &u32| Some((*parent, [Word::from("put"); 3]));
        let is = |parents: &[u32]| in_order(parents.len(), parents.iter().map(row)).is_some();
        assert!(is(&[0, 1, 2, 3, 2, 2, 1]));
        // Two branches take turns; a second root; a second run of a slot.
        assert!(!is(&[0, 1, 1, 2, 3]));
        assert!(!is(&[0, 0]));
        assert!(in_order(3, [row(&0), row(&1), None].into_iter()).is_none());
    }
}
