//! The steps of a join, and what each does to the registers of a run.
//!
//! A step looks for tasks, and then may find several, or it holds once or not at all. Tests have steps inside of
//! them, which are only asked whether they hold.

use std::cell::Cell as Counter;
use std::rc::Rc;

use crate::value::Value;

use super::super::clause::Term;
use super::super::view::{Column, List, NONE, TreeView};
use super::{Join, Rel, Var};

/// Where tasks come from.
pub(super) enum Source {
    All,
    /// Those that have something, or this value.
    Having(u8, Option<Var>),
    Children(Var),
    /// Those below a task; of them only those that have something, or this value.
    Below(Var, Option<(u8, Option<Var>)>),
    /// Those above a task.
    Above(Var),
}

pub(super) enum Op {
    /// Looks for tasks.
    Find(Var, Source),
    /// What a task has.
    Get(Var, u8, Var),
    /// The task above.
    Parent(Var, Var),
    Copy(Var, Var),
    Test(Rel),
    Not(Vec<Op>),
    Any(Vec<Vec<Op>>),
    If(Vec<Op>, Vec<Op>, Vec<Op>),
}

/// A step, and what the plan of a query shows of it.
pub(super) struct Step {
    pub(super) op: Op,
    /// One past the last step before it that looks for tasks; 0 if there is none.
    pub(super) back: usize,
    /// The goals that it answers.
    pub(super) goals: Vec<usize>,
    pub(super) expected: f64,
    pub(super) held: Counter<u64>,
}

/// What a run goes through at a step that looks for tasks.
#[derive(Default)]
pub(super) struct Cursor {
    pub(super) list: List,
    pub(super) next: u32,
    pub(super) end: u32,
    pub(super) above: Vec<u32>,
}

/// What steps work on.
pub(super) struct Work<'a> {
    pub(super) view: &'a TreeView,
    pub(super) join: &'a Join,
    pub(super) columns: &'a [Rc<Column>],
    /// Tasks that tests have looked at.
    pub(super) spent: Counter<u32>,
}

/// The goals that come after those of a list.
struct After<'a> {
    ops: &'a [Op],
    after: Option<&'a After<'a>>,
}

impl Work<'_> {
    pub(super) fn open(&self, source: &Source, regs: &[u32], cursor: &mut Cursor) {
        let at = |var: Var| regs[var as usize];
        let list = |attr: u8, value: Option<Var>| {
            let column = &self.columns[usize::from(attr)];
            value.map_or_else(|| column.having(), |value| column.with(at(value)))
        };
        match source {
            Source::All => (cursor.next, cursor.end) = (0, self.view.len() as u32),
            Source::Having(attr, value) => cursor.list = list(*attr, *value),
            Source::Below(above, Some((attr, value))) => {
                cursor.list = list(*attr, *value).within(&self.view.below(at(*above)));
            }
            Source::Children(above) | Source::Below(above, None) => {
                let below = self.view.below(at(*above));
                (cursor.next, cursor.end) = (below.start, below.end);
            }
            Source::Above(task) => {
                cursor.above.clear();
                let mut task = at(*task);
                while task != 0 {
                    task = self.view.parent(task);
                    cursor.above.push(task);
                }
            }
        }
    }

    pub(super) fn next(&self, source: &Source, cursor: &mut Cursor) -> Option<u32> {
        match source {
            Source::Having(..) | Source::Below(_, Some(_)) => cursor.list.next(),
            Source::Above(_) => cursor.above.pop(),
            Source::All | Source::Below(_, None) | Source::Children(_) => {
                let task = cursor.next;
                (task < cursor.end).then(|| {
                    cursor.next = match source {
                        Source::Children(_) => self.view.below(task).end,
                        _ => task + 1,
                    };
                    task
                })
            }
        }
    }

    /// A step that finds one thing at the most.
    #[inline]
    pub(super) fn holds(&self, op: &Op, regs: &mut [u32]) -> bool {
        match op {
            Op::Get(value, attr, task) => {
                let found = self.columns[usize::from(*attr)].of[regs[*task as usize] as usize];
                regs[*value as usize] = found;
                found != NONE
            }
            Op::Parent(above, task) => {
                let task = regs[*task as usize];
                regs[*above as usize] = self.view.parent(task);
                task != 0
            }
            Op::Copy(to, from) => {
                regs[*to as usize] = regs[*from as usize];
                true
            }
            Op::Test(rel) => self.test(*rel, regs),
            Op::Not(ops) => !self.exists(ops, None, regs),
            Op::Any(all) => all.iter().any(|ops| self.exists(ops, None, regs)),
            Op::If(test, then, otherwise) => match self.exists(test, None, regs) {
                true => self.exists(then, None, regs),
                false => self.exists(otherwise, None, regs),
            },
            Op::Find(..) => false,
        }
    }

    #[inline]
    fn test(&self, rel: Rel, regs: &[u32]) -> bool {
        let at = |var: Var| regs[var as usize];
        match rel {
            Rel::Task(_) => true,
            Rel::Edited(task) => self.view.is_edited(at(task)),
            Rel::Attr(attr, task, value) => {
                self.columns[usize::from(attr)].of[at(task) as usize] == at(value)
            }
            Rel::Child(above, task) => at(task) != 0 && self.view.parent(at(task)) == at(above),
            Rel::Below(above, task) => self.view.is_above(at(above), at(task)),
            Rel::Before(a, b) => self.view.is_before(at(a), at(b)),
            Rel::Same(a, b) => at(a) == at(b),
            Rel::Form(value, form) => {
                has_form(&self.join.forms[usize::from(form)], &self.view.value_of(at(value)))
            }
        }
    }

    /// True if steps hold and those after them, for the first tasks for which they do. Its depth is that of what
    /// is written.
    fn exists(&self, ops: &[Op], after: Option<&After<'_>>, regs: &mut [u32]) -> bool {
        let Some((op, rest)) = ops.split_first() else {
            return match after {
                Some(next) => self.exists(next.ops, next.after, regs),
                None => true,
            };
        };
        match op {
            Op::Find(var, source) => {
                let mut cursor = Cursor::default();
                self.open(source, regs, &mut cursor);
                while let Some(task) = self.next(source, &mut cursor) {
                    self.spent.set(self.spent.get().saturating_add(1));
                    regs[*var as usize] = task;
                    if self.exists(rest, after, regs) {
                        return true;
                    }
                }
                false
            }
            // What is found in an alternative is seen by what comes after it.
            Op::Any(all) => {
                let after = After { ops: rest, after };
                all.iter().any(|ops| self.exists(ops, Some(&after), regs))
            }
            op => self.holds(op, regs) && self.exists(rest, after, regs),
        }
    }
}

/// True if a value has the form of a term whose only variables are `?_`.
pub(in super::super) fn has_form(form: &Term, value: &Value) -> bool {
    let (mut form, mut value) = (form, value);
    loop {
        match (form, value.as_pair()) {
            (Term::Any, _) => return true,
            (Term::Const(constant), _) => return constant == value,
            (Term::Pair(first, rest), Some((a, b))) => {
                if !has_form(first, a) {
                    return false;
                }
                (form, value) = (rest, b);
            }
            _ => return false,
        }
    }
}
