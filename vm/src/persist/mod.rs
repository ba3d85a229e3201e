//! Trees to be kept: slots, records and edits as rows of plain data, and the way back.
//!
//! A row says in words what the machine has as numbers of its own: a call site is its hash, a function its
//! name, a value the text that reads back. So rows fit to another run of the program, and to the program after
//! a change: what is not found there any more is left out and listed. No input or output is done here; how
//! a text becomes a value is handed in.

mod at;
mod back;
pub mod chunk;
mod diff;
mod export;
mod nodes;
mod outline;
mod rows;

pub(crate) use back::failure;
pub use back::{Awaited, Restored};
pub use diff::{Difference, DifferenceKind, diff};
pub use outline::{Outline, Outlined};
pub use rows::{edits, record, slot, tree};

use crate::value::Symbol;

/// A name, or a word of a fixed list: the same in many rows.
pub type Word = Symbol;

/// A place in a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SavedSlot {
    /// Its number, from 1: that of `top-level`.
    pub slot: u32,
    /// The number of the slot above; 0 for the root.
    pub parent: u32,
    /// What was called here first.
    pub name: Word,
    /// The hash of its call site.
    pub site: u64,
    /// The rest of its key: steps as JSON, empty for none.
    pub steps: String,
    /// The record that its place among its siblings comes from; 0 if the run did not reach it.
    pub place: u32,
}

/// A run of a slot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SavedRecord {
    /// Its number, from 1: that of `top-level`.
    pub record: u32,
    /// The number of its slot.
    pub slot: u32,
    /// The number of the record that it ran in; 0 for the root.
    pub parent: u32,
    /// 1 for the first run of the slot.
    pub attempt: u32,
    /// The word for its kind.
    pub kind: Word,
    /// The word for its status.
    pub status: Word,
    /// Why it was skipped or evaporated; empty where there is nothing to say.
    pub why: Word,
    /// When it was called, in nanoseconds of the task clock.
    pub start_ns: u64,
    /// When it became final.
    pub end_ns: Option<u64>,
    /// Parameters by their names, as a JSON object of texts; empty for none.
    pub params: String,
    /// What it returned, as text; nothing if it is not final or a failure left it.
    pub value: Option<String>,
    /// The failure that left it, as a JSON object.
    pub failure: Option<String>,
    /// What few records have, as a JSON object: called, grounded, written, written-params, performed-in, notes, goal.
    pub more: Option<String>,
}

/// A change to a place of a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SavedEdit {
    /// Its number, from 1, in the order of making.
    pub number: u32,
    /// The number of its slot.
    pub slot: u32,
    /// The edit, as text that reads back.
    pub edit: String,
    /// What was called at the slot when it was made.
    pub callee: String,
    /// The slots that it waits for, with the rounds that stood between, as JSON; empty for none.
    pub after: String,
    /// Who made it, in words; empty if nobody has said so.
    pub origin: String,
}

/// All of a tree.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SavedTree {
    /// In the order of their numbers, which begin at 1 and leave out none.
    pub slots: Vec<SavedSlot>,
    /// In the order of their numbers, which begin at 1 and leave out none.
    pub records: Vec<SavedRecord>,
    /// In the order of making.
    pub edits: Vec<SavedEdit>,
}

/// Names of trees are told from versions and numbers of runs.
#[must_use]
pub fn is_tree_name(text: &str) -> bool {
    !text.contains('@') && text.chars().any(|c| !c.is_ascii_digit())
}
