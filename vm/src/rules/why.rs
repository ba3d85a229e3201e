//! Explanations: which goals hold why, and which do not.

/// The goals that are open or hold, while an engine is watched.
#[derive(Default)]
pub struct Trace {}

impl super::engine::Engine {
    pub(super) fn note_call(&mut self, _program: &crate::code::Program, _predicate: super::clause::PredId) {}
}

impl Trace {
    pub(super) fn leave(&mut self, _frame: u32) {}
    pub(super) fn choice(&mut self) {}
    pub(super) fn cut(&mut self, _n: usize) {}
    pub(super) fn back(&mut self) {}
}
