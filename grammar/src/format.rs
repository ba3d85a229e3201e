//! Lays out a whole file as Lisp people like to read it, and keeps its comments.
//!
//! A form stays on one line if it fits into [`WIDTH`] columns and nothing asks for a break: a
//! comment, a body of several forms, a line break the author made between forms of a body. A table
//! of heads (`style`) says what is broken how. Names, numbers and strings are copied from the
//! source, so nothing but blanks and line ends changes.
//!
//! The way: `tree` turns forms and comments into nodes and measures them from the leaves up,
//! `layout` writes them from the top down. Both are linear.
//!
//! Invariants
//! 1. The result reads as the same forms and the same comments in the same order.
//! 2. Formatting twice is formatting once. Therefore each decision of `layout` rests on what the
//!    result keeps: the forms, the comments, and those line breaks that force a break again.

mod layout;
mod style;
mod tree;

use crate::error::ParseError;
use crate::parse::parse;
use crate::span::FileId;

/// The greatest column that code may reach, where there is a choice.
pub const WIDTH: usize = 100;

/// Lays out `text`.
///
/// # Errors
/// A text with mistakes is not touched: what is wrong with it.
pub fn format(text: &str) -> Result<String, Vec<ParseError>> {
    let parsed = parse(FileId::default(), text);
    if !parsed.errors.is_empty() {
        return Err(parsed.errors);
    }
    let file = tree::build(text, &parsed);
    Ok(layout::write(&file, text.len()))
}
