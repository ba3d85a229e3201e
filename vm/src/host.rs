//! What the machine may not know by itself, given to it by whoever runs it.

use std::rc::Rc;

use serde_json::Value as Json;

use crate::code::{FnId, Program};
use crate::log::Entry;
use crate::persist::SavedTree;
use crate::value::Value;

/// A question to the world outside of the run. Its answer becomes an event of the run's log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Request {
    /// The text of a file.
    ReadFile(String),
    /// Put a text into a file.
    WriteFile {
        /// The file.
        path: String,
        /// Its new text.
        text: String,
    },
    /// Seconds since 1970 on the wall clock.
    Clock,
    /// The rows of a tree of a store.
    LoadTree {
        /// The store.
        store: String,
        /// The name of the tree.
        tree: String,
        /// Its version; nothing for the last one.
        version: Option<i64>,
    },
    /// Put a tree into a store.
    SaveTree {
        /// The store.
        store: String,
        /// The name of the tree.
        tree: String,
        /// What is put there.
        rows: Rc<SavedTree>,
    },
    /// The numbers of the versions of a tree of a store.
    Versions {
        /// The store.
        store: String,
        /// The name of the tree.
        tree: String,
    },
}

/// Code for the machine to compile: the form of an edit, for the plan that it edits.
pub struct CodeRequest<'a> {
    /// The form, as data.
    pub form: &'a Value,
    /// The plan whose parameters it sees.
    pub plan: FnId,
    /// The function that makes the edit: names mean what they mean in its module, and those that mean
    /// nothing there what they mean in the plan's.
    pub home: FnId,
    /// True if `(original)` may stand in it.
    pub original: bool,
}

/// The root's part of a run.
pub trait Host {
    /// Writes text that the program prints.
    fn print(&mut self, text: &str);

    /// Answers a question to the outside, or says why not.
    ///
    /// # Errors
    /// A sentence for the user: what could not be done, and why.
    fn answer(&mut self, request: &Request) -> Result<Json, String>;

    /// Told what came from outside before the run goes on with it: written down now, it is there
    /// after a crash.
    fn commit(&mut self, _entry: &Entry) {}

    /// Compiles the code of an edit into the program.
    ///
    /// # Errors
    /// The diagnostics, as text.
    fn compile(&mut self, program: &mut Program, code: CodeRequest<'_>) -> Result<FnId, String>;

    /// How texts that `write` has printed become values again: for trees that have been kept.
    fn reader(&self) -> Rc<dyn Fn(&str) -> Value> {
        Rc::new(|text| Value::str(text))
    }

    /// Lays the text of a program out as people like to read it.
    fn lay_out(&self, text: String) -> String {
        text
    }

    /// So much time of the task clock is about to pass while all tasks wait, in nanoseconds. Against the
    /// clock on the wall this takes that long. False if the run is to stop before.
    fn pass(&mut self, _ns: u64) -> bool {
        true
    }

    /// Told of a mistake of the program that nothing else will show.
    fn complain(&mut self, _line: &str) {}

    /// Told when a record starts or ends, for `--trace`.
    fn trace(&mut self, _line: &str) {}
}

/// A host that prints nowhere and answers nothing: for macros, whose expansion has no world.
#[derive(Debug, Default)]
pub struct NoHost;

impl Host for NoHost {
    fn print(&mut self, _text: &str) {}
    fn answer(&mut self, _request: &Request) -> Result<Json, String> {
        Err("there is no world while macros are expanded".into())
    }
    fn compile(&mut self, _program: &mut Program, _code: CodeRequest<'_>) -> Result<FnId, String> {
        Err("code cannot be compiled while macros are expanded".into())
    }
}
