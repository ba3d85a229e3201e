//! Pleach: a language for robot plans that can rewrite themselves.
//!
//! This crate is the front door. A [`Session`] holds a program and its machine:
//!
//! ```
//! let mut session = pleach::Session::new(pleach::Options::default());
//! let run = session.run_text("hello.plan", "(def-plan main () (print \"hello\") (+ 1 2))");
//! assert_eq!(run.printed, "hello\n");
//! assert_eq!(run.outcome.map(|value| vm::print::write(&value)).ok(), Some("3".into()));
//! ```

pub mod evaluate;
pub mod files;
mod import;
pub mod inline;
pub mod query;
pub mod read;
pub mod rehearse;
pub mod render;
pub mod session;

pub use query::{Answer, Answers, Explained, Question};
pub use session::{Ended, Options, Run, Session};
