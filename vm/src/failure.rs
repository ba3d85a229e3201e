//! Failures: events in the world, as values that plans handle.
//!
//! Failure types form a hierarchy with several parents allowed; a handler for a type takes all
//! its subtypes. The types that the machine itself raises have fixed numbers.

use std::cell::OnceCell;
use std::rc::{Rc, Weak};

use rustc_hash::FxHashMap;

use crate::code::Place;
use crate::path::{Path, Paths};
use crate::tree::{SlotId, Tree};
use crate::value::{Symbol, Value};

/// A type of failures, as an index into [`FailureTypes`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TypeId(pub u32);

/// Something that went wrong, or that a plan said went wrong.
#[derive(Clone)]
pub struct Failure {
    /// Its type.
    pub kind: TypeId,
    /// The name of its type.
    pub name: Symbol,
    /// What its type says it carries, in that order, then what the `fail` form added.
    pub fields: Vec<(Symbol, Value)>,
    /// The form that raised it; if that is in the library, the one outside that called it.
    pub place: Option<Place>,
    /// The form of the library that raised it.
    pub within: Option<Place>,
    /// The task that raised it. Copies share it, which tells one event from another: see
    /// [`Failure::is_same_event`].
    pub task: Option<Rc<Task>>,
    /// The failure that was being handled when this one was raised.
    pub cause: Option<Value>,
    /// Failures of the same round, then of clean-ups and obligations, as they ended.
    pub also: Vec<Value>,
}

/// The task that raised a failure: its place in the tree of the run, and its path as text once
/// somebody has asked for it, for that takes a walk over the siblings.
#[derive(Debug)]
pub struct Task {
    slot: SlotId,
    path: OnceCell<Box<str>>,
}

impl Task {
    /// A task whose path is known.
    #[must_use]
    pub fn of_path(path: &str) -> Task {
        Task { slot: SlotId(0), path: OnceCell::from(Box::from(path)) }
    }
}

/// Gives the tasks of a failure, its causes and those beside it their paths. `tree` is that of the
/// run that is going on; tasks of other runs have been named when these ended.
pub fn name_tasks(tree: &Tree, failure: &Value) {
    let mut todo = vec![failure];
    while let Some(value) = todo.pop() {
        let Some(failure) = value.as_failure() else { continue };
        failure.name_task(tree);
        todo.extend(failure.cause.iter().chain(&failure.also));
    }
}

/// The tasks of the failures that a run has raised and that somebody may still have. They are named
/// when their tree goes away, or when another one takes its place for a while.
#[derive(Debug, Default)]
pub(crate) struct Raised {
    tasks: Vec<Weak<Task>>,
    /// So many may come before those that nobody has any more are left out.
    most: usize,
}

impl Raised {
    /// The task at a slot, for a failure that is raised there.
    pub(crate) fn add(&mut self, slot: SlotId) -> Rc<Task> {
        const FEW: usize = 64;
        if self.tasks.len() >= self.most {
            self.tasks.retain(|task| task.strong_count() > 0);
            self.most = (2 * self.tasks.len()).max(FEW);
        }
        let task = Rc::new(Task { slot, path: OnceCell::new() });
        self.tasks.push(Rc::downgrade(&task));
        task
    }

    /// Gives all of them their paths in the tree of their run.
    pub(crate) fn name(&mut self, tree: &Tree) {
        let mut paths = Paths::of(tree);
        for task in self.tasks.drain(..).filter_map(|task| task.upgrade()) {
            task.path.get_or_init(|| paths.path(task.slot).show().into());
        }
    }
}

impl Failure {
    /// A failure of any type, not yet raised.
    #[must_use]
    pub fn of_type(kind: TypeId, name: Symbol, fields: Vec<(Symbol, Value)>) -> Failure {
        Failure { kind, name, fields, place: None, within: None, task: None, cause: None, also: Vec::new() }
    }
    /// A failure of one of the machine's own types with a message.
    #[must_use]
    pub fn new(builtin: Builtin, message: impl Into<String>) -> Failure {
        Failure::with(builtin, vec![("message", Value::str(message.into()))])
    }
    /// A failure of one of the machine's own types.
    #[must_use]
    pub fn with(builtin: Builtin, fields: Vec<(&str, Value)>) -> Failure {
        let fields = fields.into_iter().map(|(key, value)| (Symbol::from(key), value)).collect();
        Failure::of_type(builtin.id(), Symbol::from(builtin.name()), fields)
    }
    /// The value of a field.
    #[must_use]
    pub fn get(&self, field: Symbol) -> Option<&Value> {
        self.fields.iter().find(|(name, _)| *name == field).map(|(_, value)| value)
    }
    /// Gives its task the path; `tree` is that of the run that is going on.
    pub fn name_task(&self, tree: &Tree) {
        if let Some(task) = &self.task {
            task.path.get_or_init(|| Path::of(tree, task.slot).show().into());
        }
    }
    /// The path of the task that raised it, if it has been named.
    #[must_use]
    pub fn path(&self) -> Option<&str> {
        self.task.as_ref()?.path.get().map(|path| &**path)
    }
    /// True if both are copies of one failure that was raised once, perhaps raised again since.
    #[must_use]
    pub fn is_same_event(&self, other: &Failure) -> bool {
        matches!((&self.task, &other.task), (Some(a), Some(b)) if Rc::ptr_eq(a, b))
    }
    pub(crate) fn take_values(&mut self) -> Vec<Value> {
        let fields = std::mem::take(&mut self.fields).into_iter().map(|(_, value)| value);
        fields.chain(self.cause.take()).chain(self.also.drain(..)).collect()
    }
}

/// One line of [`builtin_types`]: a type, its parent, what raises it.
macro_rules! builtin_types {
    ($($(#[doc = $doc:literal])+ $variant:ident = $name:literal < $parent:literal [$($field:literal)*];)+) => {
        /// The types of failures that the machine and its natives raise.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Builtin { $($(#[doc = $doc])+ $variant),+ }
        impl Builtin {
            /// All of them, parents first.
            pub const ALL: &'static [Builtin] = &[$(Builtin::$variant),+];
            /// The name in the language.
            #[must_use]
            pub fn name(self) -> &'static str { match self { $(Builtin::$variant => $name),+ } }
            /// The name of the type above; empty for the root.
            #[must_use]
            pub fn parent(self) -> &'static str { match self { $(Builtin::$variant => $parent),+ } }
            /// What it carries.
            #[must_use]
            pub fn fields(self) -> &'static [&'static str] { match self { $(Builtin::$variant => &[$($field),*]),+ } }
            /// What it means.
            #[must_use]
            pub fn doc(self) -> &'static str { match self { $(Builtin::$variant => concat!($($doc),+)),+ } }
            /// Its number.
            #[must_use]
            pub fn id(self) -> TypeId { TypeId(self as u32) }
        }
    };
}

builtin_types! {
    /// Anything that a handler can take.
    Failure = "failure" < "" ["message"];
    /// A plan did not reach what it is for; the parent of all failures that programs define.
    PlanFailure = "plan-failure" < "failure" [];
    /// A mistake in the program that showed only when it ran. `try-…` forms do not hide it.
    ProgramError = "program-error" < "failure" [];
    /// A limit of the run was reached.
    ResourceFailure = "resource-failure" < "failure" [];
    /// A value of the wrong kind.
    TypeError = "type-error" < "program-error" ["expected" "value"];
    /// A call with too few, too many or unknown arguments.
    ArityError = "arity-error" < "program-error" [];
    /// An integer left the range of 64 bits, a division by zero, or no number as a result.
    ArithmeticError = "arithmetic-error" < "program-error" [];
    /// A position or key that is not there, or a number out of its range.
    RangeError = "range-error" < "program-error" ["value"];
    /// Text that does not say what it should: a number, a format, a form.
    ParseError = "parse-error" < "program-error" ["text"];
    /// An edit that cannot hold: no such place, a cycle, a value that is used.
    EditRefused = "edit-refused" < "program-error" ["edit"];
    /// No rule says which plan performs an action.
    ActionNotGrounded = "action-not-grounded" < "plan-failure" ["action" "nearest"];
    /// What was performed did not reach its goal.
    GoalNotReached = "goal-not-reached" < "plan-failure" ["of"];
    /// A rule computes with a variable that has no value yet.
    UnboundVariable = "unbound-variable" < "program-error" [];
    /// A rule negates a goal with a variable that has no value yet.
    Floundering = "floundering" < "program-error" ["variable"];
    /// A file could not be read or written.
    FileFailure = "file-failure" < "plan-failure" ["path"];
    /// A native that the run has no grant for.
    NotAllowed = "not-allowed" < "program-error" ["effect"];
    /// The run used up its fuel.
    FuelExhausted = "fuel-exhausted" < "resource-failure" ["limit"];
    /// Calls nested deeper than the limit.
    TooDeep = "too-deep" < "resource-failure" ["limit"];
    /// The values, frames and tree of the run take more memory than the limit.
    MemoryExhausted = "memory-exhausted" < "resource-failure" ["limit"];
    /// More nodes in the tree than the limit.
    TreeTooLarge = "tree-too-large" < "resource-failure" ["limit"];
    /// The program printed more than the limit.
    OutputTooLarge = "output-too-large" < "resource-failure" ["limit"];
    /// No alternative succeeded.
    CompositeFailure = "composite-failure" < "plan-failure" ["failures"];
    /// A time was over before its task had ended.
    Timeout = "timeout" < "plan-failure" [];
    /// The check of a policy became true while what it watches went on.
    PolicyViolated = "policy-violated" < "plan-failure" ["policy"];
    /// All tasks wait, and nothing can wake one.
    Deadlock = "deadlock" < "plan-failure" ["waits"];
    /// A clean-up ran longer than it may.
    CleanUpTimeout = "clean-up-timeout" < "plan-failure" [];
    /// A test's expectation that did not hold.
    ExpectationFailed = "expectation-failed" < "failure" ["form" "expected" "actual"];
}

/// A type of failures.
#[derive(Debug, Clone)]
pub struct FailureType {
    /// Its name.
    pub name: Symbol,
    /// The types directly above it.
    pub parents: Vec<TypeId>,
    /// What it carries, its own fields after those of its parents.
    pub fields: Vec<Symbol>,
    /// What it means.
    pub doc: Option<Box<str>>,
    /// Itself and all above it.
    ancestors: Vec<TypeId>,
}

/// The hierarchy of failure types of a program.
#[derive(Debug, Clone)]
pub struct FailureTypes {
    types: Vec<FailureType>,
    by_name: FxHashMap<Symbol, TypeId>,
}

impl Default for FailureTypes {
    fn default() -> FailureTypes {
        let mut types = FailureTypes { types: Vec::new(), by_name: FxHashMap::default() };
        for builtin in Builtin::ALL {
            let parents = types.find(Symbol::from(builtin.parent())).into_iter().collect();
            let fields = builtin.fields().iter().map(|field| Symbol::from(field)).collect();
            let doc = Some(builtin.doc().trim().into());
            types.define(Symbol::from(builtin.name()), parents, fields, doc);
        }
        types
    }
}

impl FailureTypes {
    /// The type of this name, the first if there are several: the machine's own.
    #[must_use]
    pub fn find(&self, name: Symbol) -> Option<TypeId> {
        self.by_name.get(&name).copied()
    }
    /// The type with this number.
    #[must_use]
    pub fn get(&self, id: TypeId) -> Option<&FailureType> {
        self.types.get(id.0 as usize)
    }
    /// All types, parents before children.
    pub fn iter(&self) -> impl Iterator<Item = &FailureType> {
        self.types.iter()
    }
    /// Adds a type. Another one may have its name: each file has its own.
    pub fn define(
        &mut self,
        name: Symbol,
        parents: Vec<TypeId>,
        own: Vec<Symbol>,
        doc: Option<Box<str>>,
    ) -> TypeId {
        let id = TypeId(self.types.len() as u32);
        self.define_again(id, name, parents, own, doc);
        id
    }
    /// Puts another type in the place of one, as a REPL does, or adds it.
    pub fn define_again(
        &mut self,
        id: TypeId,
        name: Symbol,
        parents: Vec<TypeId>,
        own: Vec<Symbol>,
        doc: Option<Box<str>>,
    ) {
        let mut ancestors = vec![id];
        let mut fields = Vec::new();
        for parent in parents.iter().filter_map(|parent| self.get(*parent)) {
            ancestors.extend(&parent.ancestors);
            fields.extend(&parent.fields);
        }
        fields.extend(own);
        let mut seen = Vec::new();
        fields.retain(|field| !seen.contains(field) && (seen.push(*field), true).1);
        ancestors.sort();
        ancestors.dedup();
        let it = FailureType { name, parents, fields, doc, ancestors };
        match self.types.get_mut(id.0 as usize) {
            Some(old) => *old = it,
            None => self.types.push(it),
        }
        self.by_name.entry(name).or_insert(id);
    }
    /// True if `kind`, or a type above it, has this name.
    #[must_use]
    pub fn is_named(&self, kind: TypeId, name: Symbol) -> bool {
        let above = self.get(kind).map_or(&[][..], |it| &it.ancestors);
        above.iter().filter_map(|of| self.get(*of)).any(|it| it.name == name)
    }
    /// True if `kind` is `of` or below it.
    #[must_use]
    pub fn is_a(&self, kind: TypeId, of: TypeId) -> bool {
        kind == of || self.get(kind).is_some_and(|it| it.ancestors.contains(&of))
    }
}
