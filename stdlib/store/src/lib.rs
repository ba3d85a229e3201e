//! The store: task trees, logs and edits of many runs in one SQLite file.
//!
//! A run is its log: program, seed and log give the same tree. The store keeps all of these, and beside them the tree
//! itself as rows, for those who ask without running. Everything of one moment is written in one **batch**, which is one
//! transaction, so a killed run leaves a whole moment of it. Rows have checksums, and nothing that a file says
//! is believed before they fit.
//!
//! The tables are described in `REFERENCE.md`; their texts stand in [`schema`].
//!
//! Invariants
//! 1. A version is written by one writer, who holds a lock beside the file; anybody may read meanwhile.
//! 2. The log in the file is never behind the tree in the file.
//! 3. Numbers of slots, records and entries have no gaps: a row that is missing is seen.
//! 4. Nothing in the file is run: triggers are refused, views are never read.

pub mod error;
mod open;
mod read;
pub mod schema;
mod sum;
#[cfg(test)]
mod tests;
mod write;

pub use error::StoreError;
pub use open::{Store, is_store, lock_file};
pub use read::{Finding, RunRow, VersionRow};
pub use write::{Begin, Decision, Fault, Import, Source, Writer, own_name};
