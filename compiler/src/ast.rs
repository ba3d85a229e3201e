//! Programs after their names have been resolved: what the lowering and the oracle read.
//!
//! Macros are gone, every name is a variable of the function, a constant, a function, or a type
//! of failures. Each variant shows its source form.

use grammar::Span;
use vm::code::{FnId, FnKind, GlobalId, NativeId, Params};
use vm::desc::Match;
use vm::failure::TypeId;
use vm::machine::ForkKind;
use vm::value::{Symbol, Value};

/// A variable of a function, as an index into [`Function::vars`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct VarId(pub u32);

/// A variable of a function.
#[derive(Debug, Clone)]
pub struct Var {
    /// Its name.
    pub name: Symbol,
    /// Where it is bound.
    pub span: Span,
    /// Where `set!` changes it, if it does.
    pub assigned: Option<Span>,
    /// Where a function inside captures it, if one does.
    pub captured: Option<(Span, FnKind)>,
}

/// A function, plan, lambda, or the top level of a file.
#[derive(Debug, Clone)]
pub struct Function {
    /// Its name.
    pub name: Symbol,
    /// What it is.
    pub kind: FnKind,
    /// Its parameters as callers see them.
    pub params: Params,
    /// The variables of the parameters, in order, with defaults where there are some.
    pub inputs: Vec<(VarId, Option<Expr>)>,
    /// Captured variables: the variable of the function around, and the one that stands for it here.
    pub captures: Vec<(VarId, VarId)>,
    /// All its variables.
    pub vars: Vec<Var>,
    /// Its body.
    pub body: Vec<Expr>,
    /// Its definition.
    pub span: Span,
}

/// An expression and its place.
#[derive(Debug, Clone)]
pub struct Expr {
    /// What it is.
    pub kind: ExprKind,
    /// The form that it comes from.
    pub span: Span,
}

/// What is called.
#[derive(Debug, Clone)]
pub enum Callee {
    /// A function of the program.
    Function(FnId),
    /// A plan of the program.
    Plan(FnId),
    /// A native.
    Native(NativeId),
    /// What an expression evaluates to.
    Value(Box<Expr>),
}

/// A clause of `with-failure-handling`.
#[derive(Debug, Clone)]
pub struct Clause {
    /// The types that it takes, with their subtypes.
    pub kinds: Vec<TypeId>,
    /// The variable of the failure.
    pub var: Option<VarId>,
    /// What it does; falling off the end lets the failure pass.
    pub body: Vec<Expr>,
    /// The clause.
    pub span: Span,
}

/// What an expression is.
#[derive(Debug, Clone)]
pub enum ExprKind {
    /// `42`, `'milk`
    Const(Value),
    /// `x`
    Var(VarId),
    /// A name defined by `def-const`.
    Global(GlobalId),
    /// `(def-const x value)`
    Define(GlobalId, Box<Expr>),
    /// `(let ((x 1)) body…)`, one binding after another.
    Let(Vec<(VarId, Expr)>, Vec<Expr>),
    /// `(set! x 2)`
    Set(VarId, Box<Expr>),
    /// `(if test then else)`
    If(Box<Expr>, Box<Expr>, Box<Expr>),
    /// `(and a b)`
    And(Vec<Expr>),
    /// `(or a b)`
    Or(Vec<Expr>),
    /// `(seq a b)`
    Seq(Vec<Expr>),
    /// `(case x (k body…) … (otherwise body…))`
    Case(Box<Expr>, Vec<(Vec<Value>, Vec<Expr>)>, Vec<Expr>),
    /// `(while test body…)`; `(loop body…)` is the one whose test is true.
    While(Box<Expr>, Vec<Expr>),
    /// `(dolist (x list result) body…)`
    Dolist {
        /// The variable.
        var: VarId,
        /// What it walks over.
        list: Box<Expr>,
        /// Done for each element.
        body: Vec<Expr>,
        /// The value of the form.
        result: Box<Expr>,
    },
    /// `(dotimes (i n result) body…)`
    Dotimes {
        /// The variable.
        var: VarId,
        /// How often.
        count: Box<Expr>,
        /// Done each time.
        body: Vec<Expr>,
        /// The value of the form.
        result: Box<Expr>,
    },
    /// `(lambda (x) body…)`
    Lambda(Box<Function>),
    /// `(f x)`. For functions and plans of the program one argument per parameter, in the order of
    /// the parameters; `None` for one that is not given.
    Call(Callee, Vec<Option<Expr>>),
    /// `(perform desc :goal goal)`
    Perform(Box<Expr>, Option<Box<Function>>),
    /// A parallel form: its branches, each with the name of its node.
    Fork {
        /// Which one.
        kind: ForkKind,
        /// The list of a loop, or the seconds of a time-out.
        extra: Box<Expr>,
        /// The branches; the body of a loop is one, with the element as its parameter.
        branches: Vec<(Symbol, Function)>,
    },
    /// `(with-failure-handling (clauses…) body…)`
    Handle(Vec<Clause>, Vec<Expr>),
    /// `(retry)`
    Retry,
    /// `(return v)`: out of the innermost loop or handler.
    Return(Box<Expr>),
    /// `(propagate)`
    Propagate,
    /// `(fail type :field v …)`
    Fail(TypeId, Vec<(Symbol, Expr)>),
    /// `(fail f)` with a failure as value.
    Raise(Box<Expr>),
    /// `(make-failure type :field v …)`
    MakeFailure(TypeId, Vec<(Symbol, Expr)>),
    /// `(unwind-protect body cleanup…)`, and the name of the form that it is a part of.
    Protect(Box<Expr>, Vec<Expr>, Symbol),
    /// The counter of `(with-retry-counters ((n 3)) …)`.
    Counter(Box<Expr>),
    /// The test of `(do-retry n …)`: one less, unless there are none.
    CountDown(VarId),
    /// `[a b]`
    Vector(Vec<Expr>),
    /// `{k v}`
    Map(Vec<Expr>),
    /// `(an object (type milk))`: kind, and keys with values.
    Desc(Symbol, Vec<(Symbol, Expr)>),
    /// `(matches pattern value)`, `(== pattern value)`
    Matches(Match, Box<Expr>, Box<Expr>),
    /// `(original)` in the code of an edit.
    Original,
}

impl Expr {
    /// An expression at a place.
    #[must_use]
    pub fn new(kind: ExprKind, span: Span) -> Expr {
        Expr { kind, span }
    }
    /// nil at a place.
    #[must_use]
    pub fn nil(span: Span) -> Expr {
        Expr::new(ExprKind::Const(Value::NIL), span)
    }
    /// Several in a row.
    #[must_use]
    pub fn seq(mut body: Vec<Expr>, span: Span) -> Expr {
        match body.len() {
            0 => Expr::nil(span),
            1 => body.remove(0),
            _ => Expr::new(ExprKind::Seq(body), span),
        }
    }
}
