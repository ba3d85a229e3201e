//! Clauses as the compiler reads them: what becomes rule code, what the planner of joins
//! rearranges, and what explanations show.
//!
//! All names are resolved: a variable is a number, a predicate too.

use crate::code::{FnId, Place};
use crate::value::{Symbol, Value};

/// A predicate: a name and a number of arguments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct PredId(pub u32);

impl PredId {
    /// As a position in [`super::Rules::predicates`].
    #[inline(always)]
    #[must_use]
    pub fn at(self) -> usize {
        self.0 as usize
    }
}

/// A variable of a clause: a position in [`Clause::vars`].
pub type VarNo = u16;

/// A pattern of values.
#[derive(Debug, Clone, PartialEq)]
pub enum Term {
    /// `?x`
    Var(VarNo),
    /// `?_`: each stands for itself.
    Any,
    /// Anything without variables: `milk`, `(a b)`, `(an object (type milk))`.
    Const(Value),
    /// `(?x . ?xs)`
    Pair(Box<Term>, Box<Term>),
    /// `[?x ?y]`
    Vector(Vec<Term>),
    /// `{:on ?x}`: keys are constants, in the order of values.
    Map(Vec<(Value, Term)>),
    /// `(an object (type ?t))`: kind, and properties in the order of their keys.
    Desc(Symbol, Vec<(Symbol, Term)>),
}

/// A number to be computed.
#[derive(Debug, Clone)]
pub enum Number {
    /// A variable that holds one, or a constant.
    Term(Term),
    /// `(+ a b)` and its relatives, two operands each.
    Op(Arith, Box<Number>, Box<Number>),
}

/// Arithmetic that rule code does itself. Everything else is a call of a function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arith {
    /// `+`
    Add,
    /// `-`
    Sub,
    /// `*`
    Mul,
    /// `/`
    Div,
}

/// How two numbers are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compare {
    /// `<`
    Less,
    /// `<=`
    LessEq,
    /// `>`
    More,
    /// `>=`
    MoreEq,
    /// `=`, as numbers
    Equal,
    /// `/=`, as numbers
    Unequal,
}

impl Compare {
    /// How it is written.
    #[must_use]
    pub fn sign(self) -> &'static str {
        match self {
            Compare::Less => "<",
            Compare::LessEq => "<=",
            Compare::More => ">",
            Compare::MoreEq => ">=",
            Compare::Equal => "=",
            Compare::Unequal => "/=",
        }
    }
}

/// What is collected from the answers of a goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Collect {
    /// `(findall template goal list)`: instances of the template, in the order of the answers.
    List,
    /// `(count goal n)`
    Count,
    /// `(min template goal x)`: the smallest by the order of values; no answer without any.
    Min,
    /// `(max template goal x)`
    Max,
}

/// A goal and its place.
#[derive(Debug, Clone)]
pub struct Goal {
    /// What it is.
    pub kind: GoalKind,
    /// The form that it comes from.
    pub place: Place,
}

/// What a goal is.
#[derive(Debug, Clone)]
pub enum GoalKind {
    /// `(true)`
    True,
    /// `(false)`
    False,
    /// `(cut)`: the clause is decided, and what has been found so far in it.
    Cut,
    /// Goals in a row.
    And(Vec<Goal>),
    /// `(or goal …)`
    Or(Vec<Goal>),
    /// `(not goal)`. Of the variables those that occur elsewhere in the clause and may be
    /// unbound here: meeting one of them unbound is a failure `floundering`.
    Not(Box<Goal>, Vec<VarNo>),
    /// `(-> test then else)` commits to the first answer of the test, `(*-> …)` to its having one.
    If {
        /// The test.
        test: Box<Goal>,
        /// Then.
        then: Box<Goal>,
        /// Else; without one, no answer.
        otherwise: Option<Box<Goal>>,
        /// `*->`
        soft: bool,
    },
    /// `(once goal)`
    Once(Box<Goal>),
    /// `(p ?x b)`
    Call(PredId, Vec<Term>),
    /// `(call ?goal ?more …)`: a goal that is only known when it is run, with more arguments, in a scope of
    /// [`super::Rules::scopes`].
    CallValue(Term, Vec<Term>, u32),
    /// `(== a b)`
    Unify(Term, Term),
    /// `(matches pattern value)`: the value's descriptions may say more.
    Matches(Term, Term),
    /// `(identical? a b)`: the same without binding anything.
    Identical(Term, Term),
    /// `(< a b)`
    Compare(Compare, Number, Number),
    /// `(is ?x number)`
    Is(Term, Number),
    /// `(fun f args… ?result)`: the result of a pure function of these arguments.
    Fun(FnId, Vec<Term>, Term),
    /// `(findall template goal list)` and its relatives.
    Collect(Collect, Term, Box<Goal>, Term),
    /// `(bagof template goal list)`, `(setof …)`: one answer for each value of the variables of the
    /// goal that occur in the clause around it, or are not under `(exists (?v …) goal)`.
    Bag {
        /// What is collected.
        template: Term,
        /// The variables that group the answers.
        by: Vec<VarNo>,
        /// The goal.
        goal: Box<Goal>,
        /// The list of the instances.
        list: Term,
        /// Sorted, without repetitions.
        set: bool,
    },
    /// Counts how often it is met: nobody writes it, the plan of a query shows the number.
    Tick(u32),
    /// `(forall test goal)`: every answer of the test is one of the goal.
    ForAll(Box<Goal>, Box<Goal>),
}

/// A clause: `(<- (head …) goal…)`.
#[derive(Debug, Clone)]
pub struct Clause {
    /// What it is a clause of.
    pub predicate: PredId,
    /// The arguments of its head.
    pub head: Vec<Term>,
    /// True if the descriptions in its head match such as say more: so do those of `action-grounding`.
    pub open: bool,
    /// What must hold.
    pub body: Goal,
    /// The names of its variables.
    pub vars: Vec<Symbol>,
    /// Clauses of a predicate are tried by priority, the higher first; of one priority those of the text
    /// that was loaded last come first, and within a text they come in its order.
    pub priority: i64,
    /// The text, counted in the order of loading.
    pub text: u32,
    /// The clause in the source.
    pub place: Place,
}

/// How the clauses of a predicate are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// They are rules: code.
    Rules,
    /// They are facts of `def-facts`: rows of constants. Rules may be added.
    Facts,
    /// It is written in Rust.
    Native,
}

/// What is known of a predicate when it is declared.
#[derive(Debug, Clone)]
pub struct Declared {
    /// Its name, without the number of its arguments.
    pub name: Symbol,
    /// How many arguments it has.
    pub arity: u8,
    /// How its clauses are found.
    pub kind: Kind,
    /// `:tabled`
    pub tabled: bool,
    /// Its definition.
    pub place: Place,
}

impl Term {
    /// Visits its variables, each as often as it stands there.
    pub fn each_var(&self, visit: &mut dyn FnMut(VarNo)) {
        match self {
            Term::Var(var) => visit(*var),
            Term::Any | Term::Const(_) => {}
            Term::Pair(..) => {
                let mut at = self;
                while let Term::Pair(first, rest) = at {
                    first.each_var(visit);
                    at = rest;
                }
                at.each_var(visit);
            }
            Term::Vector(items) => items.iter().for_each(|item| item.each_var(visit)),
            Term::Map(entries) => entries.iter().for_each(|entry| entry.1.each_var(visit)),
            Term::Desc(_, properties) => properties.iter().for_each(|it| it.1.each_var(visit)),
        }
    }

    /// True if this variable is part of it.
    #[must_use]
    pub fn has_var(&self, var: VarNo) -> bool {
        let mut found = false;
        self.each_var(&mut |it| found |= it == var);
        found
    }
}

impl Number {
    /// Visits its variables, each as often as it stands there.
    pub fn each_var(&self, visit: &mut dyn FnMut(VarNo)) {
        match self {
            Number::Term(term) => term.each_var(visit),
            Number::Op(_, a, b) => {
                a.each_var(visit);
                b.each_var(visit);
            }
        }
    }
}

impl Goal {
    /// True if it calls a predicate of which this is true, or one that is known only when it runs.
    pub fn calls(&self, wanted: &dyn Fn(PredId) -> bool) -> bool {
        match &self.kind {
            GoalKind::And(goals) | GoalKind::Or(goals) => goals.iter().any(|it| it.calls(wanted)),
            GoalKind::Not(goal, _) | GoalKind::Once(goal) => goal.calls(wanted),
            GoalKind::If { test, then, otherwise, .. } => {
                test.calls(wanted)
                    || then.calls(wanted)
                    || otherwise.as_ref().is_some_and(|it| it.calls(wanted))
            }
            GoalKind::Call(predicate, _) => wanted(*predicate),
            GoalKind::CallValue(..) => true,
            GoalKind::Collect(_, _, goal, _) | GoalKind::Bag { goal, .. } => goal.calls(wanted),
            GoalKind::ForAll(test, goal) => test.calls(wanted) || goal.calls(wanted),
            _ => false,
        }
    }

    /// True if a cut of its clause is in it. What is nested in other goals is left by its cuts only.
    #[must_use]
    pub fn cuts(&self) -> bool {
        match &self.kind {
            GoalKind::Cut => true,
            GoalKind::And(goals) | GoalKind::Or(goals) => goals.iter().any(Goal::cuts),
            GoalKind::If { then, otherwise, .. } => {
                then.cuts() || otherwise.as_deref().is_some_and(Goal::cuts)
            }
            _ => false,
        }
    }

    /// True if it calls a function.
    #[must_use]
    pub fn calls_functions(&self) -> bool {
        match &self.kind {
            GoalKind::Fun(..) => true,
            GoalKind::And(goals) | GoalKind::Or(goals) => goals.iter().any(Goal::calls_functions),
            GoalKind::If { test, then, otherwise, .. } => [Some(test), Some(then), otherwise.as_ref()]
                .into_iter()
                .flatten()
                .any(|it| it.calls_functions()),
            GoalKind::Not(goal, _)
            | GoalKind::Once(goal)
            | GoalKind::Collect(_, _, goal, _)
            | GoalKind::Bag { goal, .. } => goal.calls_functions(),
            GoalKind::ForAll(test, goal) => test.calls_functions() || goal.calls_functions(),
            _ => false,
        }
    }

    /// Visits its variables, each as often as it stands there.
    pub fn each_var(&self, visit: &mut dyn FnMut(VarNo)) {
        match &self.kind {
            GoalKind::True | GoalKind::False | GoalKind::Cut | GoalKind::Tick(_) => {}
            GoalKind::And(goals) | GoalKind::Or(goals) => goals.iter().for_each(|it| it.each_var(visit)),
            GoalKind::Not(goal, _) | GoalKind::Once(goal) => goal.each_var(visit),
            GoalKind::If { test, then, otherwise, .. } => {
                test.each_var(visit);
                then.each_var(visit);
                if let Some(goal) = otherwise {
                    goal.each_var(visit);
                }
            }
            GoalKind::Call(_, args) => args.iter().for_each(|it| it.each_var(visit)),
            GoalKind::CallValue(goal, args, _) => {
                goal.each_var(visit);
                args.iter().for_each(|it| it.each_var(visit));
            }
            GoalKind::Unify(a, b) | GoalKind::Matches(a, b) | GoalKind::Identical(a, b) => {
                a.each_var(visit);
                b.each_var(visit);
            }
            GoalKind::Compare(_, a, b) => {
                a.each_var(visit);
                b.each_var(visit);
            }
            GoalKind::Is(term, number) => {
                number.each_var(visit);
                term.each_var(visit);
            }
            GoalKind::Fun(_, args, result) => {
                args.iter().for_each(|it| it.each_var(visit));
                result.each_var(visit);
            }
            GoalKind::Collect(_, template, goal, result) => {
                template.each_var(visit);
                goal.each_var(visit);
                result.each_var(visit);
            }
            GoalKind::Bag { template, goal, list, .. } => {
                template.each_var(visit);
                goal.each_var(visit);
                list.each_var(visit);
            }
            GoalKind::ForAll(test, goal) => {
                test.each_var(visit);
                goal.each_var(visit);
            }
        }
    }
}

impl Term {
    /// The same term with each variable and constant replaced by what `change` makes of it.
    #[must_use]
    pub fn map(&self, change: &mut dyn FnMut(&Term) -> Term) -> Term {
        match self {
            Term::Var(_) | Term::Any | Term::Const(_) => change(self),
            Term::Pair(first, rest) => Term::Pair(Box::new(first.map(change)), Box::new(rest.map(change))),
            Term::Vector(items) => Term::Vector(items.iter().map(|item| item.map(change)).collect()),
            Term::Map(entries) => {
                Term::Map(entries.iter().map(|(key, item)| (key.clone(), item.map(change))).collect())
            }
            Term::Desc(kind, properties) => {
                Term::Desc(*kind, properties.iter().map(|(key, item)| (*key, item.map(change))).collect())
            }
        }
    }
}

impl Number {
    fn map(&self, change: &mut dyn FnMut(&Term) -> Term) -> Number {
        match self {
            Number::Term(term) => Number::Term(term.map(change)),
            Number::Op(op, a, b) => Number::Op(*op, Box::new(a.map(change)), Box::new(b.map(change))),
        }
    }
}

impl Goal {
    /// The same goal with each variable and constant in it replaced by what `change` makes of it.
    #[must_use]
    pub fn map(&self, change: &mut dyn FnMut(&Term) -> Term) -> Goal {
        let goals = |goals: &[Goal], change: &mut dyn FnMut(&Term) -> Term| {
            goals.iter().map(|goal| goal.map(change)).collect::<Vec<_>>()
        };
        let terms = |terms: &[Term], change: &mut dyn FnMut(&Term) -> Term| {
            terms.iter().map(|term| term.map(change)).collect::<Vec<_>>()
        };
        let kind = match &self.kind {
            GoalKind::True => GoalKind::True,
            GoalKind::Tick(n) => GoalKind::Tick(*n),
            GoalKind::False => GoalKind::False,
            GoalKind::Cut => GoalKind::Cut,
            GoalKind::And(all) => GoalKind::And(goals(all, change)),
            GoalKind::Or(all) => GoalKind::Or(goals(all, change)),
            GoalKind::Not(goal, vars) => GoalKind::Not(Box::new(goal.map(change)), vars.clone()),
            GoalKind::If { test, then, otherwise, soft } => GoalKind::If {
                test: Box::new(test.map(change)),
                then: Box::new(then.map(change)),
                otherwise: otherwise.as_ref().map(|goal| Box::new(goal.map(change))),
                soft: *soft,
            },
            GoalKind::Once(goal) => GoalKind::Once(Box::new(goal.map(change))),
            GoalKind::Call(predicate, args) => GoalKind::Call(*predicate, terms(args, change)),
            GoalKind::CallValue(goal, args, scope) => {
                GoalKind::CallValue(goal.map(change), terms(args, change), *scope)
            }
            GoalKind::Unify(a, b) => GoalKind::Unify(a.map(change), b.map(change)),
            GoalKind::Matches(a, b) => GoalKind::Matches(a.map(change), b.map(change)),
            GoalKind::Identical(a, b) => GoalKind::Identical(a.map(change), b.map(change)),
            GoalKind::Compare(how, a, b) => GoalKind::Compare(*how, a.map(change), b.map(change)),
            GoalKind::Is(term, number) => GoalKind::Is(term.map(change), number.map(change)),
            GoalKind::Fun(function, args, result) => {
                GoalKind::Fun(*function, terms(args, change), result.map(change))
            }
            GoalKind::Collect(kind, template, goal, result) => {
                let (template, goal) = (template.map(change), Box::new(goal.map(change)));
                GoalKind::Collect(*kind, template, goal, result.map(change))
            }
            GoalKind::Bag { template, by, goal, list, set } => GoalKind::Bag {
                template: template.map(change),
                by: by.clone(),
                goal: Box::new(goal.map(change)),
                list: list.map(change),
                set: *set,
            },
            GoalKind::ForAll(test, goal) => {
                GoalKind::ForAll(Box::new(test.map(change)), Box::new(goal.map(change)))
            }
        };
        Goal { kind, place: self.place }
    }
}
