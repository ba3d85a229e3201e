//! Rules that are written as Prolog text, as the forms of our own rules.
//!
//! The way of a text: `token` cuts it, `reader` goes through it clause by clause and finds out
//! which names are operators, the rules of `prolog.lalrpop` build terms, `translate` turns clauses
//! into forms with the words of `table` and the spelling of `names`. What is taken stands in
//! `REFERENCE.md`; what Prolog has beyond that is named with its place and never guessed at.
//!
//! Invariants
//! 1. No input panics, overflows the stack, or takes more than linear time.
//! 2. One mistake gives one error and costs one clause.
//! 3. Without errors the forms are such as [`parse()`](crate::parse()) could have read, and no deeper.

mod error;
mod names;
pub(crate) mod reader;
mod table;
pub(crate) mod term;
mod token;
mod translate;

lalrpop_util::lalrpop_mod!(
    #[allow(missing_docs, unused, clippy::all, clippy::pedantic, clippy::unwrap_used)]
    clause,
    "/prolog.rs"
);

use lalrpop_util::ParseError as Refused;

pub use error::PrologError;

use crate::parse::{Parsed, check_size, decode, refused};
use crate::span::FileId;
use clause::ClauseParser;
use reader::Reader;
use token::Lexer;
use translate::Translator;

/// Reads Prolog text as rules.
///
/// The forms are `(def-open p 2)` for each predicate that a directive declares, then
/// `(def-rules name clause…)` with all clauses in the order of the text, and `(def-rules name-tabled
/// :tabled clause…)` with those of tabled predicates. Their spans lie in the Prolog text. Clauses
/// with errors are left out.
#[must_use]
pub fn parse(file: FileId, name: &str, text: &str) -> Parsed {
    if let Err(error) = check_size(file, text.len()) {
        return refused(error);
    }
    let mut reader = Reader::new(Lexer::new(file, text));
    let parser = ClauseParser::new();
    let mut terms = Vec::new();
    while reader.begin() {
        match parser.parse(file, &mut reader) {
            Ok(term) if !reader.damaged => terms.push(term),
            Ok(_) => {}
            Err(Refused::UnrecognizedToken { token: (start, token, end), .. }) => {
                reader.unexpected(start, &token, end);
            }
            Err(_) => reader.unfinished(),
        }
        reader.go_on();
    }
    let Lexer { comments, report, .. } = reader.lexer;
    let mut translator = Translator::new(report);
    let forms = translator.program(name, &terms);
    Parsed { forms, comments, errors: translator.report.in_order() }
}

/// Reads a whole file of Prolog text; bytes that are no UTF-8 are an error and nothing is read.
#[must_use]
pub fn parse_bytes(file: FileId, name: &str, bytes: &[u8]) -> Parsed {
    match decode(file, bytes) {
        Ok(text) => parse(file, name, text),
        Err(error) => refused(error),
    }
}
