//! Explanations: which goals hold why, and which do not.

/// The goals that are open or hold, while an engine is watched.
#[derive(Default)]
pub struct Trace {}

impl Trace {
    pub(super) fn leave(&mut self, _frame: u32) {}
    pub(super) fn choice(&mut self) {}
    pub(super) fn cut(&mut self, _n: usize) {}
    pub(super) fn back(&mut self) {}
}
