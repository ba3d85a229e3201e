//! Errors of programs: what the compiler says, and where.

use grammar::Span;
use miette::Diagnostic;
use thiserror::Error;

/// A mistake in a program that the compiler has found.
#[derive(Debug, Clone, PartialEq, Eq, Error, Diagnostic)]
pub enum CompileError {
    /// A name that no scope, module or library defines.
    #[error("nothing is called `{name}`")]
    #[diagnostic(code(resolve::unknown_name))]
    UnknownName {
        /// The name.
        name: String,
        /// Where it stands.
        #[label("not defined here")]
        at: Span,
        /// The nearest name.
        #[help]
        help: Option<String>,
    },

    /// A failure type that is not defined.
    #[error("no type of failures is called `{name}`")]
    #[diagnostic(code(resolve::unknown_failure))]
    UnknownFailure {
        /// The name.
        name: String,
        /// Where it stands.
        #[label("not defined here")]
        at: Span,
        /// The nearest name, or how to define it.
        #[help]
        help: Option<String>,
    },

    /// Two definitions of one name.
    #[error("`{name}` is defined twice")]
    #[diagnostic(code(resolve::duplicate), help("rename one of the two, or delete it"))]
    Duplicate {
        /// The name.
        name: String,
        /// The second definition.
        #[label(primary, "defined again here")]
        again: Span,
        /// The first one.
        #[label("first defined here")]
        first: Span,
    },

    /// A name that is none of the kind that is needed.
    #[error("`{name}` is {is}, not {wanted}")]
    #[diagnostic(code(resolve::wrong_kind))]
    WrongKind {
        /// The name.
        name: String,
        /// What it is.
        is: String,
        /// What is needed.
        wanted: String,
        /// Where it stands.
        #[label("used as {wanted}")]
        at: Span,
        /// What to do.
        #[help]
        help: Option<String>,
    },

    /// A name that two used modules define.
    #[error("`{name}` is defined by `{one}` and by `{other}`")]
    #[diagnostic(
        code(resolve::ambiguous),
        help("say which: `{one}/{name}` or `{other}/{name}`, with `(use {one} :as …)`")
    )]
    Ambiguous {
        /// The name.
        name: String,
        /// A module.
        one: String,
        /// Another one.
        other: String,
        /// Where it stands.
        #[label("which one?")]
        at: Span,
    },

    /// A definition of a name that the language itself uses.
    #[error("`{name}` is a form of the language and cannot be defined")]
    #[diagnostic(code(resolve::reserved), help("choose another name; `({name} …)` always means {shape}"))]
    Reserved {
        /// The name.
        name: String,
        /// How the form is written.
        shape: String,
        /// The definition.
        #[label("defined here")]
        at: Span,
    },

    /// `set!` of something that is not a local variable.
    #[error("`{name}` cannot be changed: it is {is}")]
    #[diagnostic(code(resolve::set_constant), help("bind a local variable with `let` and change that"))]
    SetConstant {
        /// The name.
        name: String,
        /// What it is.
        is: String,
        /// The `set!`.
        #[label("changed here")]
        at: Span,
    },

    /// `set!` of a variable that a closure or a branch has.
    #[error("`{name}` is changed, but {by} has captured it")]
    #[diagnostic(
        code(resolve::set_captured),
        help(
            "a captured variable keeps its value; write a loop, let `fold` hand the value on, or use a fluent"
        )
    )]
    SetCaptured {
        /// The variable.
        name: String,
        /// The `set!`.
        #[label(primary, "changed here")]
        at: Span,
        /// What has captured it.
        by: &'static str,
        /// The use in there.
        #[label("captured here")]
        captured: Span,
    },

    /// A special form that does not have its shape.
    #[error("`{form}` {problem}")]
    #[diagnostic(code(form::shape), help("it is written {shape}"))]
    Shape {
        /// The form.
        form: String,
        /// What is wrong.
        problem: String,
        /// How it is written.
        shape: String,
        /// Where.
        #[label("here")]
        at: Span,
    },

    /// A call with the wrong number of arguments.
    #[error("`{name}` takes {takes}, got {got}")]
    #[diagnostic(code(form::arity))]
    Arity {
        /// What is called.
        name: String,
        /// How many it takes.
        takes: String,
        /// How many it got.
        got: usize,
        /// The call.
        #[label("called here")]
        at: Span,
        /// Its parameters.
        #[help]
        help: Option<String>,
    },

    /// A keyword argument that the callee does not have.
    #[error("`{name}` has no parameter `:{key}`")]
    #[diagnostic(code(form::unknown_keyword))]
    UnknownKeyword {
        /// What is called.
        name: String,
        /// The keyword.
        key: String,
        /// Where it stands.
        #[label("not a parameter")]
        at: Span,
        /// The ones that it has.
        #[help]
        help: Option<String>,
    },

    /// A list whose head cannot be called.
    #[error("{what} cannot be called")]
    #[diagnostic(
        code(form::not_callable),
        help("write `'(…)` for a list as data, or `(list …)` for a list of values")
    )]
    NotCallable {
        /// What stands at the head.
        what: String,
        /// Where.
        #[label("at the head of a call")]
        at: Span,
    },

    /// `retry`, `return`, `propagate`, `original` where they mean nothing.
    #[error("`{form}` stands outside of {inside}")]
    #[diagnostic(code(form::outside))]
    Outside {
        /// The form.
        form: String,
        /// Where it may stand.
        inside: String,
        /// Where it stands.
        #[label("here")]
        at: Span,
        /// What to do.
        #[help]
        help: Option<String>,
    },

    /// A definition that is not at the top level.
    #[error("`{form}` stands inside another form")]
    #[diagnostic(
        code(form::not_at_top),
        help("definitions stand at the top level of a file; inside, use `let` and `lambda`")
    )]
    NotAtTop {
        /// The form.
        form: String,
        /// Where it stands.
        #[label("not at the top level")]
        at: Span,
    },

    /// An order of steps that are not there.
    #[error("no step is called `{name}`")]
    #[diagnostic(code(form::unknown_step), help("the steps are {}; a step gets its name by `(:tag name form)`", list(.steps)))]
    UnknownStep {
        /// The name.
        name: String,
        /// The names that there are.
        steps: Vec<String>,
        /// Where the order names it.
        #[label("not a step of this form")]
        at: Span,
    },

    /// Steps each of which comes before the other.
    #[error("these steps would wait for each other: {}", list(.steps))]
    #[diagnostic(code(form::order_cycle), help("leave out one of the orders between them"))]
    OrderCycle {
        /// The names of the steps.
        steps: Vec<String>,
        /// The form.
        #[label("none of them could begin")]
        at: Span,
    },

    /// One name bound twice by one form.
    #[error("`{name}` is bound twice here")]
    #[diagnostic(code(form::bound_twice), help("rename one of the two"))]
    BoundTwice {
        /// The name.
        name: String,
        /// The second one.
        #[label(primary, "again")]
        again: Span,
        /// The first one.
        #[label("first")]
        first: Span,
    },

    /// A parameter list that cannot be.
    #[error("{problem}")]
    #[diagnostic(
        code(form::parameters),
        help("parameters are written (a b &optional (c 1) &key (d 2) &rest more)")
    )]
    Parameters {
        /// What is wrong.
        problem: String,
        /// Where.
        #[label("here")]
        at: Span,
    },

    /// A description of an entity that does not exist.
    #[error("there are no entities of kind `{kind}`")]
    #[diagnostic(code(desc::kind), help("describe an action, a motion, a location or an object"))]
    DescKind {
        /// The word after `a` or `an`.
        kind: String,
        /// Where.
        #[label("unknown kind")]
        at: Span,
    },

    /// A part of a description that is no property.
    #[error("a property of a description is written (key value){detail}")]
    #[diagnostic(code(desc::property))]
    DescProperty {
        /// What is wrong.
        detail: String,
        /// Where.
        #[label("not a property")]
        at: Span,
        /// What to do.
        #[help]
        help: Option<String>,
    },

    /// A key that a description has twice.
    #[error("the property `{key}` is given twice")]
    #[diagnostic(
        code(desc::duplicate),
        help("a description has each key at most once; give a list as its value")
    )]
    DescDuplicate {
        /// The key.
        key: String,
        /// The second one.
        #[label(primary, "given again")]
        again: Span,
        /// The first one.
        #[label("first given here")]
        first: Span,
    },

    /// A property that most likely belongs to the action around the location.
    #[error("`{key}` stands inside the {kind}, though it says something about the action around it")]
    #[diagnostic(
        code(desc::misplaced),
        severity(Warning),
        help("close the {kind} before it: (location (a location …)) ({key} …)")
    )]
    Misplaced {
        /// The key.
        key: String,
        /// The kind of the description that it stands in.
        kind: String,
        /// The property.
        #[label(primary, "part of the {kind} by its brackets")]
        at: Span,
        /// The action.
        #[label("the action that probably wants it")]
        action: Span,
    },

    /// A macro that failed.
    #[error("the macro `{name}` failed: {why}")]
    #[diagnostic(code(expand::failed))]
    MacroFailed {
        /// The macro.
        name: String,
        /// Its failure.
        why: String,
        /// The call.
        #[label("expanded here")]
        at: Span,
    },

    /// Macros that expand to macros without end.
    #[error("macros are expanded more than {limit} levels deep")]
    #[diagnostic(code(expand::too_deep), help("a macro whose expansion calls it again must come to an end"))]
    ExpandedTooDeep {
        /// The limit.
        limit: usize,
        /// The call.
        #[label("still expanding here")]
        at: Span,
    },

    /// Macros whose expansions double and double again.
    #[error("macros are expanded more than {limit} times in one text")]
    #[diagnostic(
        code(expand::too_often),
        help("a macro that puts two calls of macros into its expansion doubles them each time")
    )]
    ExpandedTooOften {
        /// The limit.
        limit: usize,
        /// The call.
        #[label("one too many")]
        at: Span,
    },

    /// A macro that made something that is no form.
    #[error("the macro `{name}` made code out of {what}, which is no form")]
    #[diagnostic(code(expand::not_a_form), help("macros return lists, symbols, numbers and strings"))]
    NotAForm {
        /// The macro.
        name: String,
        /// What it made.
        what: String,
        /// The call.
        #[label("expanded here")]
        at: Span,
    },

    /// A macro that uses what stands below it.
    #[error("the macro `{name}` uses `{needs}`, which is not defined above")]
    #[diagnostic(
        code(expand::not_yet),
        help("move the definition of `{needs}` above the first use of the macro")
    )]
    NotYet {
        /// The macro.
        name: String,
        /// What is missing.
        needs: String,
        /// The call.
        #[label("expanded here")]
        at: Span,
    },

    /// A module that cannot be found.
    #[error("there is no module `{name}`")]
    #[diagnostic(code(module::missing))]
    ModuleMissing {
        /// The name.
        name: String,
        /// The `use`.
        #[label("used here")]
        at: Span,
        /// Where it was looked for.
        #[help]
        help: Option<String>,
    },

    /// Modules that use each other in a circle.
    #[error("the module `{name}` uses itself: {chain}")]
    #[diagnostic(code(module::cycle), help("move what both need into a third module"))]
    ModuleCycle {
        /// The module.
        name: String,
        /// The way around.
        chain: String,
        /// The `use` that closes the circle.
        #[label("used again here")]
        at: Span,
    },

    /// A native that the library does not have.
    #[error("no native is called `{name}`")]
    #[diagnostic(
        code(module::native),
        help("`def-native` declares functions that Rust code of the library provides")
    )]
    NoSuchNative {
        /// The name.
        name: String,
        /// The declaration.
        #[label("declared here")]
        at: Span,
    },

    /// A function that needs more registers than there are.
    #[error("`{name}` needs more than {limit} variables and intermediate values at once")]
    #[diagnostic(code(limit::registers), help("move a part of it into a function of its own"))]
    TooManyRegisters {
        /// The function.
        name: String,
        /// The limit.
        limit: usize,
        /// Where they run out.
        #[label("no room for this")]
        at: Span,
    },

    /// Forms nested too deep, after expansion.
    #[error("forms are nested more than {limit} deep")]
    #[diagnostic(code(limit::nesting), help("move the inner part into a function of its own"))]
    TooDeep {
        /// The limit.
        limit: usize,
        /// Where.
        #[label("here")]
        at: Span,
    },
}

impl CompileError {
    /// Its main place.
    #[must_use]
    pub fn span(&self) -> Span {
        use CompileError as E;
        match self {
            E::UnknownName { at, .. }
            | E::UnknownFailure { at, .. }
            | E::Duplicate { again: at, .. }
            | E::WrongKind { at, .. }
            | E::Ambiguous { at, .. }
            | E::Reserved { at, .. }
            | E::SetConstant { at, .. }
            | E::SetCaptured { at, .. }
            | E::Shape { at, .. }
            | E::Arity { at, .. }
            | E::UnknownKeyword { at, .. }
            | E::NotCallable { at, .. }
            | E::Outside { at, .. }
            | E::NotAtTop { at, .. }
            | E::BoundTwice { again: at, .. }
            | E::UnknownStep { at, .. }
            | E::OrderCycle { at, .. }
            | E::Parameters { at, .. }
            | E::DescKind { at, .. }
            | E::DescProperty { at, .. }
            | E::DescDuplicate { again: at, .. }
            | E::Misplaced { at, .. }
            | E::MacroFailed { at, .. }
            | E::ExpandedTooDeep { at, .. }
            | E::ExpandedTooOften { at, .. }
            | E::NotAForm { at, .. }
            | E::NotYet { at, .. }
            | E::ModuleMissing { at, .. }
            | E::ModuleCycle { at, .. }
            | E::NoSuchNative { at, .. }
            | E::TooManyRegisters { at, .. }
            | E::TooDeep { at, .. } => *at,
        }
    }

    /// True for those that do not keep the program from running.
    #[must_use]
    pub fn is_warning(&self) -> bool {
        matches!(self, CompileError::Misplaced { .. })
    }
}

/// Names in a sentence; a word where there are none.
fn list(names: &[String]) -> String {
    if names.is_empty() { "none".into() } else { names.join(", ") }
}
