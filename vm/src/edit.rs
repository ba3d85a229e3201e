//! Edits: changes to places of a plan, looked up when the place is called.
//!
//! An [`Edit`] is a value of the language: what to do, and at which path. Adding it to a tree
//! resolves its paths to slots and compiles its code; what holds then is an [`Accepted`].

use std::rc::Rc;

use crate::code::FnId;
use crate::path::Path;
use crate::tree::SlotId;
use crate::value::{Symbol, Value};

/// A change to a place of a plan.
#[derive(Debug, Clone)]
pub struct Edit {
    /// The place.
    pub at: Path,
    /// What changes there.
    pub what: What,
    /// Parameters and the values that they must have in the call as made, or the edit does not
    /// apply to that call. The callee must always be the one that was edited.
    pub guard: Vec<(Symbol, Value)>,
    /// The transformation that made it.
    pub by: Option<Symbol>,
    /// What `defer` and `owe` may move work out of: `with-timeout`, `clean-up` …
    pub out_of: Vec<Symbol>,
}

/// What an edit does at the call of its slot.
#[derive(Debug, Clone)]
pub enum What {
    /// The call is not run and has this value, or none that may be used.
    Skip(Option<Value>),
    /// This code is run instead of the body.
    Replace(Value),
    /// This code is run before the call.
    Before(Value),
    /// This code is run after the call has succeeded.
    After(Value),
    /// The call gets another value for a parameter, or a property of its description.
    WithParam(Symbol, Value),
    /// This code is run where the call stands; `(original)` in it is the call.
    Wrap(Value),
    /// The call is performed after the last of these that is still to come.
    Defer(Vec<Path>),
    /// The call puts this code into the form that contains it and these, once per name.
    Owe {
        /// What is owed.
        code: Value,
        /// After which tasks.
        after: Vec<Path>,
        /// Its name.
        name: Symbol,
    },
}

impl Edit {
    /// The word for what it does.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self.what {
            What::Skip(_) => "skip",
            What::Replace(_) => "replace",
            What::Before(_) => "before",
            What::After(_) => "after",
            What::WithParam(..) => "with-param",
            What::Wrap(_) => "wrap",
            What::Defer(_) => "defer",
            What::Owe { .. } => "owe",
        }
    }

    pub(crate) fn take_values(&mut self) -> Vec<Value> {
        let what = std::mem::replace(&mut self.what, What::Skip(None));
        let guard = std::mem::take(&mut self.guard).into_iter().map(|(_, value)| value);
        let value = match what {
            What::Skip(value) => value,
            What::Replace(code) | What::Before(code) | What::After(code) | What::Wrap(code) => Some(code),
            What::WithParam(_, value) => Some(value),
            What::Defer(_) => None,
            What::Owe { code, .. } => Some(code),
        };
        guard.chain(value).collect()
    }
}

/// An edit that holds in a tree.
#[derive(Debug, Clone)]
pub struct Accepted {
    /// What was asked for.
    pub edit: Rc<Edit>,
    /// The name of what was called at the slot when the edit was made.
    pub callee: Symbol,
    /// The plan that this was; none for a description.
    pub plan: Option<FnId>,
    /// Its code.
    pub code: Option<FnId>,
    /// The slots that a `defer` or `owe` names after `:after`.
    pub after: Vec<SlotId>,
    /// For slots in another round of a loop: the rounds that stood between when the edit was made.
    pub between: std::collections::BTreeMap<SlotId, Vec<crate::key::Step>>,
    /// Who made it, in words for people; empty if nobody has said so.
    pub origin: Rc<str>,
}
