//! Text to forms, and all that is wrong with the text.

use crate::balance::Balance;
use crate::error::ParseError;
use crate::form::Form;
use crate::grammar::FormsParser;
use crate::span::{FileId, Span};
use crate::token::Lexer;

/// The greatest file that is read: 64 MiB.
pub const MAX_BYTES: usize = 64 << 20;

/// The greatest number of brackets and prefixes around a form, its own included.
pub const MAX_DEPTH: usize = 1_000;

/// The greatest number of errors that are told apart.
pub const MAX_ERRORS: usize = 100;

/// What a text was read as.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Parsed {
    /// The top-level forms. If there are errors, some stand in for what could not be read.
    pub forms: Vec<Form>,
    /// The comments, in the order of the text.
    pub comments: Vec<Comment>,
    /// What is wrong, in the order of the text: at most [`MAX_ERRORS`], then how many more there are.
    pub errors: Vec<ParseError>,
}

/// A comment and its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Comment {
    /// From its first sign to its last, the end of the line left out.
    pub span: Span,
    /// `#| … |#` if true, else `; …`.
    pub block: bool,
}

/// Reads a whole text.
///
/// Never panics and always gives forms; they are the program only if there are no errors.
#[must_use]
pub fn parse(file: FileId, text: &str) -> Parsed {
    if let Err(error) = check_size(file, text.len()) {
        return refused(error);
    }
    let mut balance = Balance::new(Lexer::new(file, text));
    let result = FormsParser::new().parse(file, &mut balance);
    let Lexer { comments, mut report, .. } = balance.lexer;
    match result {
        Ok(forms) => Parsed { forms, comments, errors: report.in_order() },
        Err(error) => {
            report.errors.push(internal(file, text, &error));
            Parsed { forms: Vec::new(), comments, errors: report.in_order() }
        }
    }
}

/// Reads a whole file; bytes that are no UTF-8 are an error and nothing is read.
#[must_use]
pub fn parse_bytes(file: FileId, bytes: &[u8]) -> Parsed {
    match decode(file, bytes) {
        Ok(text) => parse(file, text),
        Err(error) => refused(error),
    }
}

pub(crate) fn refused(error: ParseError) -> Parsed {
    Parsed { errors: vec![error], ..Parsed::default() }
}

pub(crate) fn check_size(file: FileId, bytes: usize) -> Result<(), ParseError> {
    let at = Span::new(file, 0, 0);
    if bytes > MAX_BYTES { Err(ParseError::TooLarge { bytes, limit: MAX_BYTES, at }) } else { Ok(()) }
}

/// The text that `bytes` are, if they are one and not too large.
pub(crate) fn decode(file: FileId, bytes: &[u8]) -> Result<&str, ParseError> {
    check_size(file, bytes.len())?;
    std::str::from_utf8(bytes).map_err(|error| utf8(file, bytes, error.valid_up_to()))
}

/// The bytes before `offset` are UTF-8.
fn utf8(file: FileId, bytes: &[u8], offset: usize) -> ParseError {
    let before = String::from_utf8_lossy(&bytes[..offset]);
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    ParseError::Utf8 {
        offset,
        line: before.bytes().filter(|byte| *byte == b'\n').count() + 1,
        column: before[line_start..].chars().count() + 1,
        at: Span::new(file, offset, offset + 1),
    }
}

fn internal(
    file: FileId,
    text: &str,
    error: &lalrpop_util::ParseError<usize, crate::token::Token, &str>,
) -> ParseError {
    use lalrpop_util::ParseError as E;
    let (start, end) = match error {
        E::InvalidToken { location } | E::UnrecognizedEof { location, .. } => (*location, *location),
        E::UnrecognizedToken { token, .. } | E::ExtraToken { token } => (token.0, token.2),
        E::User { .. } => (0, text.len()),
    };
    ParseError::Internal { at: Span::new(file, start, end) }
}

/// Whether a text can be read as it is: what a prompt asks before it runs a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Completeness {
    /// Forms, or nothing at all.
    Complete,
    /// More must follow.
    Incomplete {
        /// What is open, outermost first: brackets, then `"`, `#` (a comment) or a prefix.
        open: Vec<(char, Span)>,
    },
    /// Nothing that follows can help; [`parse`] says why.
    Invalid,
}

/// Looks whether `text` is complete.
#[must_use]
pub fn completeness(text: &str) -> Completeness {
    if text.len() > MAX_BYTES {
        return Completeness::Invalid;
    }
    let mut balance = Balance::new(Lexer::new(FileId::default(), text));
    balance.by_ref().for_each(drop);
    let cut = balance.lexer.cut;
    if balance.errors_before_end > usize::from(cut.is_some()) {
        return Completeness::Invalid;
    }
    let mut open = std::mem::take(&mut balance.open_at_end);
    open.extend(cut.or(balance.prefix_at_end));
    if open.is_empty() { Completeness::Complete } else { Completeness::Incomplete { open } }
}
