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

    /// A goal whose predicate is not there.
    #[error("no predicate is called `{name}`")]
    #[diagnostic(code(rule::unknown_predicate))]
    UnknownPredicate {
        /// The name.
        name: String,
        /// Where it stands.
        #[label("not a goal")]
        at: Span,
        /// The nearest name, or what else has this name.
        #[help]
        help: Option<String>,
    },

    /// A goal or head with a number of arguments that its predicate does not have.
    #[error("`{name}` takes {has}, got {got}")]
    #[diagnostic(code(rule::arity))]
    PredicateArity {
        /// The predicate, or the goal of the language.
        name: String,
        /// The numbers of arguments that there are.
        has: String,
        /// How many are given.
        got: usize,
        /// The goal.
        #[label("here")]
        at: Span,
        /// How it is written.
        #[help]
        help: Option<String>,
    },

    /// Something that is no goal.
    #[error("{what} is no goal")]
    #[diagnostic(code(rule::goal))]
    NotAGoal {
        /// What stands there.
        what: String,
        /// Where.
        #[label("a goal is expected here")]
        at: Span,
        /// What to write.
        #[help]
        help: Option<String>,
    },

    /// Something that cannot be a term.
    #[error("{problem}")]
    #[diagnostic(code(rule::term))]
    NotATerm {
        /// What is wrong.
        problem: String,
        /// Where.
        #[label("here")]
        at: Span,
        /// What to write.
        #[help]
        help: Option<String>,
    },

    /// A plan, or a form of plans, as a goal.
    #[error("{what} cannot stand in a rule: rules compute, they do not act")]
    #[diagnostic(code(rule::plan_form))]
    PlanForm {
        /// What it is.
        what: String,
        /// Where it stands.
        #[label("not a goal")]
        at: Span,
        /// What to write instead.
        #[help]
        help: Option<String>,
    },

    /// A function that does more than compute, called by a rule.
    #[error("a rule calls `{name}`, which {why}")]
    #[diagnostic(
        code(rule::impure),
        help("let the rule say what is needed, and do it in the plan that asks the rule")
    )]
    Impure {
        /// The function.
        name: String,
        /// What it does.
        why: String,
        /// The call.
        #[label("only functions that compute can be called here")]
        at: Span,
    },

    /// A variable that could as well not be there.
    #[error("the variable `{name}` occurs only once in its clause")]
    #[diagnostic(
        code(rule::singleton),
        severity(Warning),
        help("write `?_` if its value does not matter, or a name that begins with `?_`")
    )]
    Singleton {
        /// The variable.
        name: String,
        /// Where it occurs.
        #[label("nothing else in the clause has this name")]
        at: Span,
    },

    /// A clause, or goals of one, that cannot be reached.
    #[error("{what} is never reached")]
    #[diagnostic(code(rule::unreachable), severity(Warning))]
    Unreachable {
        /// What it is.
        what: String,
        /// Where it stands.
        #[label(primary, "never reached")]
        at: Span,
        /// Why, in a few words.
        because: String,
        /// What stands in the way.
        #[label("{because}")]
        of: Span,
        /// What to do.
        #[help]
        help: Option<String>,
    },

    /// A goal that needs values, over a variable that has none yet.
    #[error("`{form}` needs `{name}`, and nothing before it gives `{name}` a value")]
    #[diagnostic(
        code(rule::floundering),
        help("put the goal that finds `{name}` before this one; if any value will do, write `?_`")
    )]
    Floundering {
        /// The goal's head.
        form: String,
        /// The variable.
        name: String,
        /// The goal.
        #[label("`{name}` has no value here")]
        at: Span,
    },

    /// A cut that would throw away what a table needs.
    #[error("a cut follows a call of `{name}`, which is tabled")]
    #[diagnostic(
        code(rule::table_cut),
        help(
            "a table needs all answers: find them first, for example with `findall`, or put the cut before the call"
        )
    )]
    TableCut {
        /// The tabled predicate.
        name: String,
        /// The cut.
        #[label(primary, "this cut")]
        at: Span,
        /// The call.
        #[label("would end this call too early")]
        call: Span,
    },

    /// A cut inside of a goal that it cannot leave.
    #[error("a cut cannot leave `{inside}`")]
    #[diagnostic(code(rule::cut), help("write `once` around what is to be found once, or move the cut out"))]
    CutInside {
        /// The goal around it.
        inside: String,
        /// The cut.
        #[label("here")]
        at: Span,
    },

    /// Clauses of one predicate in two places, though it is not open.
    #[error("`{name}` has clauses in two places")]
    #[diagnostic(
        code(rule::not_open),
        help("put them into one `def-rules`, or declare that it may have clauses anywhere: {open}")
    )]
    NotOpen {
        /// The predicate.
        name: String,
        /// The declaration that would allow it.
        open: String,
        /// The second place.
        #[label(primary, "again here")]
        again: Span,
        /// The first one.
        #[label("first here")]
        first: Span,
    },

    /// A variable of a query that has no value and is not asked for.
    #[error("`{name}` has no value here")]
    #[diagnostic(code(rule::unbound))]
    Unbound {
        /// The variable.
        name: String,
        /// Where it stands.
        #[label("neither bound nor asked for")]
        at: Span,
        /// What to do.
        #[help]
        help: Option<String>,
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

    /// A clause that needs more room than there is.
    #[error("the clause needs more than {limit} variables and intermediate values at once")]
    #[diagnostic(code(limit::clause), help("move some of its goals into a rule of their own"))]
    ClauseTooLarge {
        /// The limit.
        limit: usize,
        /// The clause.
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
            | E::UnknownPredicate { at, .. }
            | E::PredicateArity { at, .. }
            | E::NotAGoal { at, .. }
            | E::NotATerm { at, .. }
            | E::PlanForm { at, .. }
            | E::Impure { at, .. }
            | E::Singleton { at, .. }
            | E::Unreachable { at, .. }
            | E::Floundering { at, .. }
            | E::TableCut { at, .. }
            | E::CutInside { at, .. }
            | E::NotOpen { again: at, .. }
            | E::Unbound { at, .. }
            | E::MacroFailed { at, .. }
            | E::ExpandedTooDeep { at, .. }
            | E::ExpandedTooOften { at, .. }
            | E::NotAForm { at, .. }
            | E::NotYet { at, .. }
            | E::ModuleMissing { at, .. }
            | E::ModuleCycle { at, .. }
            | E::NoSuchNative { at, .. }
            | E::TooManyRegisters { at, .. }
            | E::ClauseTooLarge { at, .. }
            | E::TooDeep { at, .. } => *at,
        }
    }

    /// True for those that do not keep the program from running.
    #[must_use]
    pub fn is_warning(&self) -> bool {
        use CompileError as E;
        matches!(self, E::Misplaced { .. } | E::Singleton { .. } | E::Unreachable { .. })
    }
}

/// Names in a sentence; a word where there are none.
fn list(names: &[String]) -> String {
    if names.is_empty() { "none".into() } else { names.join(", ") }
}
