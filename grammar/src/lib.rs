//! Text to forms and back.
//!
//! The way of a text: `token` cuts it into tokens, `balance` makes their brackets match whatever
//! was typed, the rules of `grammar.lalrpop` build the forms, [`parse`](mod@parse) collects forms,
//! comments and errors. On the way back, [`print`](mod@print) writes a form on one line and
//! [`format`](mod@format) a whole file as people like to read it.
//!
//! Rules may also be written as Prolog text, which [`prolog`] reads by tokens and rules of its own and
//! turns into the same forms.
//!
//! Nothing here knows what a form means: `(if a)` is a fine list of two. That is the compiler's.
//!
//! Invariants
//! 1. No input panics, overflows the stack, or takes more than linear time.
//! 2. A text without errors gives the same forms after [`format()`], and a printed form reads back
//!    as itself.
//! 3. One mistake gives one error, and the definitions after it are read as if it were not there.

mod balance;
pub mod error;
pub mod form;
pub mod format;
mod literal;
pub mod pages;
pub mod parse;
pub mod print;
pub mod prolog;
pub mod span;
mod token;

lalrpop_util::lalrpop_mod!(
    #[allow(missing_docs, unused, clippy::all, clippy::pedantic, clippy::unwrap_used)]
    grammar
);

pub use error::ParseError;
pub use form::{Form, FormKind, Prefix, Symbol};
pub use format::format;
pub use parse::{Comment, Completeness, Parsed, completeness, parse, parse_bytes};
pub use span::{FileId, Span};
