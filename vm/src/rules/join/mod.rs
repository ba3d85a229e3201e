//! Joins: goals over a task tree that are answered together.
//!
//! The planner of clauses ([`super::plan`]) takes what stands in a row and only asks the table of the tree, and
//! makes one goal of it. How that is answered is decided when it is asked: with the columns of the tree at hand
//! it is known how many tasks each goal can give. An [`Order`] is a list of steps ([`steps`]) over an array of
//! numbers, tasks and values; a [`run`] goes through them forwards and backwards. This file says what a join is.
//!
//! Invariant: every goal of a join is a relation between tasks and values: it holds once for each of them or not
//! at all, and neither fails with an error nor goes on for ever. [`Modes`] finds out which goals are such.

mod modes;
mod order;
mod run;
mod steps;

use crate::value::Value;

use super::clause::{Goal, Term};
use super::view::Attr;

pub use modes::Modes;
pub use order::{Order, asked};
pub use run::call;
pub(super) use steps::has_form;

/// A variable of a join: a register of its runs.
pub type Var = u8;

/// The name of the predicate whose first argument says which join it is.
pub const NAME: &str = "%join";

/// What a variable stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sort {
    /// Nobody has said.
    Unknown,
    /// A task.
    Task,
    /// A value of a column.
    Value,
}

/// A relation between tasks and values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rel {
    /// It is a task.
    Task(Var),
    /// An edit stands on it or below it.
    Edited(Var),
    /// What a task has of a kind: a position in [`Join::attrs`].
    Attr(u8, Var, Var),
    /// The second is directly below the first.
    Child(Var, Var),
    /// The second is somewhere below the first.
    Below(Var, Var),
    /// The first had ended when the second was called.
    Before(Var, Var),
    /// They are the same task, or the same value.
    Same(Var, Var),
    /// A value has a form: a position in [`Join::forms`].
    Form(Var, u8),
}

/// What may hold.
#[derive(Debug, Clone)]
pub enum Cond {
    /// A relation.
    Rel(Rel),
    /// All of them.
    All(Vec<Cond>),
    /// One of them, the first that does.
    Any(Vec<Cond>),
    /// It does not hold.
    Not(Box<Cond>),
    /// If the first does the second, else the third.
    If(Box<Cond>, Box<Cond>, Box<Cond>),
}

impl Cond {
    /// The same with other names for its variables.
    #[must_use]
    pub fn renamed(&self, name: &dyn Fn(Var) -> Var) -> Cond {
        let all = |all: &[Cond]| all.iter().map(|it| it.renamed(name)).collect();
        let boxed = |it: &Cond| Box::new(it.renamed(name));
        match self {
            Cond::Rel(rel) => Cond::Rel(match *rel {
                Rel::Task(a) => Rel::Task(name(a)),
                Rel::Edited(a) => Rel::Edited(name(a)),
                Rel::Attr(attr, a, b) => Rel::Attr(attr, name(a), name(b)),
                Rel::Child(a, b) => Rel::Child(name(a), name(b)),
                Rel::Below(a, b) => Rel::Below(name(a), name(b)),
                Rel::Before(a, b) => Rel::Before(name(a), name(b)),
                Rel::Same(a, b) => Rel::Same(name(a), name(b)),
                Rel::Form(a, form) => Rel::Form(name(a), form),
            }),
            Cond::All(parts) => Cond::All(all(parts)),
            Cond::Any(parts) => Cond::Any(all(parts)),
            Cond::Not(it) => Cond::Not(boxed(it)),
            Cond::If(a, b, c) => Cond::If(boxed(a), boxed(b), boxed(c)),
        }
    }

    /// Visits its relations.
    pub fn each_rel(&self, visit: &mut dyn FnMut(Rel)) {
        match self {
            Cond::Rel(rel) => visit(*rel),
            Cond::All(all) | Cond::Any(all) => all.iter().for_each(|it| it.each_rel(visit)),
            Cond::Not(it) => it.each_rel(visit),
            Cond::If(a, b, c) => [a, b, c].into_iter().for_each(|it| it.each_rel(visit)),
        }
    }

    /// Its variables.
    pub fn vars(&self) -> u64 {
        let mut vars = 0;
        self.each_rel(&mut |rel| vars |= rel.vars());
        vars
    }
}

/// Goals that are answered together.
#[derive(Default)]
pub struct Join {
    /// The goals, as they are written.
    pub goals: Vec<(Cond, Goal)>,
    /// What each variable stands for. The first are the arguments of the goal, after the number of the join.
    pub vars: Vec<Sort>,
    /// How many arguments there are.
    pub args: usize,
    /// What is asked of tasks.
    pub attrs: Vec<Attr>,
    /// Forms of values.
    pub forms: Vec<Term>,
    /// Variables that stand for something that is written.
    pub fixed: Vec<(Var, Value)>,
}

fn bit(var: Var) -> u64 {
    1 << var
}

impl Rel {
    /// Its variables.
    fn vars(self) -> u64 {
        match self {
            Rel::Task(a) | Rel::Edited(a) | Rel::Form(a, _) => bit(a),
            Rel::Attr(_, a, b)
            | Rel::Child(a, b)
            | Rel::Below(a, b)
            | Rel::Before(a, b)
            | Rel::Same(a, b) => bit(a) | bit(b),
        }
    }

    /// The tasks that it looks for where it is written, in their order, if these variables are known.
    fn looks_for(self, known: u64) -> impl Iterator<Item = Var> {
        let pair = match self {
            Rel::Task(a) | Rel::Edited(a) | Rel::Attr(_, a, _) => [Some(a), None],
            // With a task the one above is known.
            Rel::Child(_, b) => [None, Some(b)],
            Rel::Below(a, b) | Rel::Before(a, b) => [Some(a), Some(b)],
            Rel::Same(..) | Rel::Form(..) => [None, None],
        };
        pair.into_iter().flatten().filter(move |var| known & bit(*var) == 0)
    }
}
