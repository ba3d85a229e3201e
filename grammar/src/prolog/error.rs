//! What can be wrong with Prolog text, or be beyond what is taken of it.
//!
//! Mistakes that our own text can have as well (brackets that do not match, numbers, escapes) are
//! those of [`ParseError`].

// The derived code of miette assigns fields it does not read.
#![allow(unused_assignments)]

use miette::Diagnostic;
use thiserror::Error;

use crate::error::ParseError;
use crate::span::Span;

/// A mistake in Prolog text.
#[derive(Debug, Clone, PartialEq, Error, Diagnostic)]
#[non_exhaustive]
pub enum PrologError {
    /// `f(a.`, `'milk` without its second quote, `/*` without `*/`.
    #[error("{what} is never closed")]
    #[diagnostic(code(prolog::unclosed))]
    Unclosed {
        /// A bracket, a quoted name, a comment.
        what: &'static str,
        /// Its first sign.
        #[label("opened here")]
        at: Span,
        /// What is missing.
        #[help]
        help: String,
    },

    /// Text that is no term.
    #[error("`{text}` cannot stand here")]
    #[diagnostic(code(prolog::unexpected))]
    Unexpected {
        /// The first token that does not fit.
        text: String,
        /// Its place.
        #[label("here")]
        at: Span,
        /// What may be missing.
        #[help]
        help: &'static str,
    },

    /// A file that stops within a clause.
    #[error("the last clause has no end")]
    #[diagnostic(code(prolog::no_end), help("write `.` after it"))]
    NoEnd {
        /// The last token of the text.
        #[label("the text ends here")]
        at: Span,
    },

    /// `p :- 3.`, `3 :- p.`
    #[error("{what} is no {wanted}")]
    #[diagnostic(code(prolog::not_callable))]
    NotCallable {
        /// What stands there.
        what: &'static str,
        /// What should stand there.
        wanted: &'static str,
        /// Its place.
        #[label("here")]
        at: Span,
        /// What to write instead.
        #[help]
        help: &'static str,
    },

    /// What Prolog has and the rules have not.
    #[error("{what} is not taken from Prolog text")]
    #[diagnostic(code(prolog::not_taken))]
    NotTaken {
        /// What it is.
        what: String,
        /// Its place.
        #[label("here")]
        at: Span,
        /// What to write instead.
        #[help]
        help: &'static str,
    },

    /// Names that are the same in Prolog and differ here, or the other way round.
    #[error("{why}")]
    #[diagnostic(code(prolog::two_names))]
    TwoNames {
        /// Both names, and what becomes of them.
        why: String,
        /// The second one.
        #[label(primary, "here it is written so")]
        at: Span,
        /// The first one.
        #[label("and here so")]
        first: Span,
        /// What to write instead.
        #[help]
        help: &'static str,
    },
}

impl PrologError {
    /// Its main place.
    #[must_use]
    pub fn span(&self) -> Span {
        use PrologError as E;
        match self {
            E::Unclosed { at, .. }
            | E::Unexpected { at, .. }
            | E::NoEnd { at }
            | E::NotCallable { at, .. }
            | E::NotTaken { at, .. }
            | E::TwoNames { at, .. } => *at,
        }
    }
}

impl From<PrologError> for ParseError {
    fn from(error: PrologError) -> ParseError {
        ParseError::Prolog(error)
    }
}
