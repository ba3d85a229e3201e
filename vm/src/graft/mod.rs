//! Grafts: the edits below one call of a plan, apart from the tree that they were made in.
//!
//! An edit holds at a slot, and a slot is known by its key. A graft keeps the keys of the places that its edits need,
//! in words that a text can carry: a call site is "the second call of `deliver` in `set-table`". So the same edits can
//! be made below another call of the plan, in another tree, in another version of the program; the machine does that
//! when the call is made. A place that a program has no more is nowhere, and takes its edits along.
//!
//! ```text
//! (set-table                              the call itself
//!   (transporting :for milk               the round for milk of the loop around it
//!     (delivering :in transport))         in the body of `transport`, which performs it
//!   (transporting :call 2 :for cup))      what paths call `(transporting :call 2)`
//! (log :edit 1)                           beside the call, in the code of the first edit
//! ```

mod of_tree;
mod paths;
mod read;
mod words;
mod write;

pub use paths::move_paths;

use std::collections::BTreeMap;
use std::rc::Rc;

use crate::code::{FnId, SiteId};
use crate::edit::{Edit, What};
use crate::key::Step;
use crate::path::{Path, PathStep};
use crate::value::Symbol;

/// The place that the call stands in.
pub const AROUND: usize = 0;
/// The place of the call itself.
pub const CALL: usize = 1;

/// Edits below a call, and the places that they need.
#[derive(Debug, Clone, Default)]
pub struct Graft {
    /// Parents before children: [`AROUND`], [`CALL`], what is below these.
    pub places: Vec<Place>,
    /// In the order of making.
    pub edits: Vec<Change>,
    /// What has no place here, in sentences.
    pub lost: Vec<String>,
}

/// A place of a graft.
#[derive(Debug, Clone)]
pub struct Place {
    /// The one above.
    pub above: usize,
    /// What is called there, and what paths of the edits say for it.
    pub step: PathStep,
    /// The call site; none for the call and what is around it.
    pub site: Option<Words>,
    /// The site itself, if the graft comes from a tree of this program.
    pub known: Option<SiteId>,
    /// The way from the task above to the site.
    pub way: Vec<Link>,
    /// The plan that was called there, where the source does not say which.
    pub called: Option<FnId>,
}

impl Place {
    /// True if it stands in the code of this edit of the graft.
    #[must_use]
    pub fn comes_from(&self, edit: usize) -> bool {
        matches!(self.way.first(), Some(Link::Edit(number)) if *number as usize == edit)
    }
}

/// A call site in words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Words {
    /// The function that the call stands in; nothing for the code of the edit that it comes from.
    pub owner: Option<Symbol>,
    /// Which of the functions inside of that one: lambdas, branches; zero for itself.
    pub inner: u32,
    /// What is called.
    pub name: Symbol,
    /// Its number among the calls of that name there, from 1.
    pub nth: u32,
}

/// A step of a key.
#[derive(Debug, Clone, PartialEq)]
pub enum Link {
    /// One that says the same everywhere.
    Same(Step),
    /// The call of a function.
    Through(Words, Option<SiteId>),
    /// The code of an edit of the graft, from 1.
    Edit(u32),
}

/// An edit of a graft.
#[derive(Debug, Clone)]
pub struct Change {
    /// Where.
    pub place: usize,
    /// With the paths that the places have in the graft.
    pub edit: Rc<Edit>,
    /// The places that it waits for.
    pub after: Vec<usize>,
    /// The rounds that stood between.
    pub between: BTreeMap<usize, Vec<Step>>,
    /// Its code, if the graft comes from a tree of this program.
    pub code: Option<FnId>,
    /// Who made it, in words for people.
    pub origin: Rc<str>,
}

impl Graft {
    /// A graft without edits.
    #[must_use]
    pub fn empty(plan: Symbol) -> Graft {
        let place = |name| Place {
            above: AROUND,
            step: PathStep { name, call: 1 },
            site: None,
            known: None,
            way: Vec::new(),
            called: None,
        };
        Graft { places: vec![place(Symbol::from("top-level")), place(plan)], ..Graft::default() }
    }

    /// The path of a place, as the edits of the graft say it.
    #[must_use]
    pub fn path(&self, place: usize) -> Path {
        let up = std::iter::successors(Some(place), |at| Some(self.places[*at].above));
        let mut steps: Vec<PathStep> =
            up.take_while(|at| *at != AROUND).map(|at| self.places[at].step).collect();
        steps.reverse();
        Path { steps }
    }

    /// An edit with the paths that its places have in the graft.
    fn with_paths(&self, edit: &Edit, place: usize, after: &[usize]) -> Edit {
        let mut edit = Edit { at: self.path(place), ..edit.clone() };
        let paths = || after.iter().map(|place| self.path(*place)).collect();
        match &mut edit.what {
            What::Defer(after) => *after = paths(),
            What::Owe { after, .. } => *after = paths(),
            _ => {}
        }
        edit
    }
}

/// Why an edit does not hold here, for the notes of a task.
#[must_use]
pub fn not_applied(word: &str, at: &Path, why: &str) -> String {
    format!("{word} at {} not applied: {why}", at.show())
}
