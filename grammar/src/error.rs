//! What can be wrong with a text before its meaning is looked at.
//!
//! Each code has a page, see [`crate::pages`].

// The derived code of miette assigns fields it does not read.
#![allow(unused_assignments)]

use miette::Diagnostic;
use thiserror::Error;

use crate::prolog::PrologError;
use crate::span::Span;

/// A mistake in the text of a program.
#[derive(Debug, Clone, PartialEq, Error, Diagnostic)]
#[non_exhaustive]
pub enum ParseError {
    /// A bracket that is still open where the text ends or a new definition starts.
    #[error("`{open}` is never closed")]
    #[diagnostic(code(parse::unclosed), help("the missing end is `{missing}`"))]
    Unclosed {
        /// The bracket.
        open: char,
        /// What closes it and all around it.
        missing: String,
        /// The bracket; where the indentation tells which one was forgotten, that one.
        #[label(primary, "opened here")]
        at: Span,
        /// The definition that starts before the bracket is closed.
        #[label("this starts a new definition")]
        next: Option<Span>,
    },

    /// `"` without an end.
    #[error("a string is never closed")]
    #[diagnostic(
        code(parse::unclosed_string),
        help("end the string with `\"`, or write `\\\"` for a quote inside it")
    )]
    UnclosedString {
        /// The quote that starts the last string.
        #[label(primary, "this string runs to the end of the text")]
        at: Span,
        /// An earlier string that swallowed the start of a definition.
        #[label("this string contains the start of a definition: is its end missing?")]
        suspect: Option<Span>,
    },

    /// `|` without an end on its line.
    #[error("a name in bars is never closed")]
    #[diagnostic(
        code(parse::unclosed_symbol),
        help("end the name with `|` on the same line; a bar inside it is written `\\|`")
    )]
    UnclosedSymbol {
        /// The bar and the first word of the name.
        #[label("no second `|` on this line")]
        at: Span,
    },

    /// `#|` without `|#`.
    #[error("a comment is never closed")]
    #[diagnostic(
        code(parse::unclosed_comment),
        help("end it with `|#`; each `#|` inside it needs a `|#` of its own")
    )]
    UnclosedComment {
        /// The `#|`.
        #[label("opened here")]
        at: Span,
    },

    /// `(` closed by `]`.
    #[error("`{open}` is closed by `{close}`")]
    #[diagnostic(
        code(parse::mismatched),
        help("close each bracket with its own kind, the last opened first")
    )]
    Mismatched {
        /// The bracket that is open.
        open: char,
        /// The bracket that closes it.
        close: char,
        /// Where it is closed.
        #[label(primary, "closed here")]
        at: Span,
        /// Where it was opened.
        #[label("opened here")]
        opened: Span,
    },

    /// `)` with nothing open.
    #[error("`{close}` closes nothing")]
    #[diagnostic(
        code(parse::stray_close),
        help("delete it, or look whether the form before it ends too early")
    )]
    StrayClose {
        /// The bracket.
        close: char,
        /// It, and those like it that follow at once.
        #[label("nothing is open here")]
        at: Span,
    },

    /// `12abc`, or a number that does not fit.
    #[error("`{text}` {why}")]
    #[diagnostic(code(parse::number))]
    Number {
        /// As it was written; a long one is cut.
        text: String,
        /// What is wrong, as the rest of a sentence.
        why: &'static str,
        /// Its place.
        #[label("here")]
        at: Span,
        /// What to write instead.
        #[help]
        help: &'static str,
    },

    /// `"\q"`
    #[error("`{text}` is no escape")]
    #[diagnostic(code(parse::escape))]
    Escape {
        /// As it was written.
        text: String,
        /// The backslash and what follows.
        #[label("here")]
        at: Span,
        /// What to write instead.
        #[help]
        help: &'static str,
    },

    /// A character that begins nothing.
    #[error("`{text}` cannot stand here")]
    #[diagnostic(code(parse::character))]
    Character {
        /// The character; invisible ones as `\u{…}`.
        text: String,
        /// It, and those like it that follow at once.
        #[label("here")]
        at: Span,
        /// What to write instead.
        #[help]
        help: &'static str,
    },

    /// More than [`MAX_DEPTH`](crate::parse::MAX_DEPTH) forms in one another.
    #[error("forms are nested more than {limit} deep")]
    #[diagnostic(code(parse::too_deep), help("give the inner part a name of its own"))]
    TooDeep {
        /// The greatest depth.
        limit: usize,
        /// The first form that is too deep.
        #[label("too deep from here on")]
        at: Span,
    },

    /// `(a ')`
    #[error("`{sign}` stands before nothing")]
    #[diagnostic(code(parse::prefix), help("write the form that `{sign}` belongs to after it, or delete it"))]
    Prefix {
        /// The sign.
        sign: &'static str,
        /// Its place.
        #[label("no form follows")]
        at: Span,
    },

    /// `{:a 1 :b}`
    #[error("a map has a key without a value")]
    #[diagnostic(code(parse::odd_map), help("a map is written `{{key value key value}}`"))]
    OddMap {
        /// The last key.
        #[label(primary, "no value follows")]
        at: Span,
        /// The bracket of the map.
        #[label("in this map")]
        map: Span,
    },

    /// Bytes that are no UTF-8.
    #[error("byte {offset} is no UTF-8 (line {line}, column {column})")]
    #[diagnostic(code(parse::utf8), help("save the file with the encoding UTF-8"))]
    Utf8 {
        /// Offset of the first wrong byte.
        offset: usize,
        /// Its line, from 1.
        line: usize,
        /// Its column in characters, from 1.
        column: usize,
        /// Its place.
        #[label("this byte")]
        at: Span,
    },

    /// A file over [`MAX_BYTES`](crate::parse::MAX_BYTES).
    #[error("the file has {bytes} bytes, {limit} are allowed")]
    #[diagnostic(code(parse::too_large), help("is it a plan? if so, split it into modules"))]
    TooLarge {
        /// Its size.
        bytes: usize,
        /// The greatest size.
        limit: usize,
        /// Its start.
        at: Span,
    },

    /// Stands after the first [`MAX_ERRORS`](crate::parse::MAX_ERRORS).
    #[error("{more} more errors are not shown")]
    #[diagnostic(code(parse::too_many), help("correct the first ones and try again"))]
    TooMany {
        /// How many were left out.
        more: usize,
        /// The place of the last one that is shown.
        at: Span,
    },

    /// A mistake in Prolog text.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Prolog(PrologError),

    /// The rules of the grammar refused a balanced text: a bug of ours, which must not stop an editor.
    #[error("the parser is confused (a bug in Pleach, not in your program)")]
    #[diagnostic(code(parse::internal), help("please report it together with the text"))]
    Internal {
        /// Where it gave up.
        #[label("here")]
        at: Span,
    },
}

impl ParseError {
    /// Its main place.
    #[must_use]
    pub fn span(&self) -> Span {
        use ParseError as E;
        match self {
            E::Unclosed { at, .. }
            | E::UnclosedString { at, .. }
            | E::UnclosedSymbol { at }
            | E::UnclosedComment { at }
            | E::Mismatched { at, .. }
            | E::StrayClose { at, .. }
            | E::Number { at, .. }
            | E::Escape { at, .. }
            | E::Character { at, .. }
            | E::TooDeep { at, .. }
            | E::Prefix { at, .. }
            | E::OddMap { at, .. }
            | E::Utf8 { at, .. }
            | E::TooLarge { at, .. }
            | E::TooMany { at, .. }
            | E::Internal { at } => *at,
            E::Prolog(error) => error.span(),
        }
    }
}
