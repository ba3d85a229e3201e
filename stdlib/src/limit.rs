//! How large a result may be that a short call asks for: `(make-list n)`, `(repeat text n)`.
//!
//! The machine looks at the memory of a run between instructions, which is too late for a native
//! that has already taken all of it. So natives refuse what no run could hold.

use vm::native::{Raise, too_large};

/// Elements of a list or vector: about 800 MB of cells.
pub(crate) const ELEMENTS: usize = 1 << 24;
/// Bytes of a string.
const TEXT: usize = 64 << 20;

/// `n` elements, if that many can be made in one call.
pub(crate) fn elements(n: usize) -> Result<usize, Raise> {
    if n <= ELEMENTS {
        Ok(n)
    } else {
        Err(too_large(format!("{n} elements are more than one call makes, which is {ELEMENTS}")))
    }
}

/// `n` bytes of text, if that many can be made in one call.
pub(crate) fn text(n: usize) -> Result<usize, Raise> {
    if n <= TEXT {
        Ok(n)
    } else {
        Err(too_large(format!("{n} bytes of text are more than one call makes, which is {TEXT}")))
    }
}

/// A string that grows up to the limit.
#[derive(Default)]
pub(crate) struct Text(String);

impl Text {
    /// Adds to the end.
    pub(crate) fn push(&mut self, part: &str) -> Result<(), Raise> {
        text(self.0.len() + part.len())?;
        self.0.push_str(part);
        Ok(())
    }
    /// What was pushed.
    pub(crate) fn into_string(self) -> String {
        self.0
    }
}
