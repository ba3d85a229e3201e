//! Tabled predicates.

use crate::code::Program;
use crate::native::Raise;

use super::clause::PredId;
use super::engine::Engine;

/// The tables of one query.
#[derive(Default)]
pub struct Tables {}

impl Tables {
    /// Memory in use, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        0
    }
}

impl Engine {
    pub(super) fn call_table(&mut self, _program: &Program, _predicate: PredId) -> Result<bool, Raise> {
        Ok(false)
    }
    pub(super) fn note_call(&mut self, _program: &Program, _predicate: PredId) {}
}
