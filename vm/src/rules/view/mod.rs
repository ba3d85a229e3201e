//! A task tree as rules see it: a table of tasks, with look-ups by what is asked for.
//!
//! Tasks are numbered as they stand in the tree, parents before children, siblings in the order of
//! their calls. So all below a task are the numbers after it up to an end, every look-up gives its
//! tasks in the one order, and a list of tasks is a sorted list of numbers.
//!
//! The table has one row of fixed size for each task ([`build`]) and copies no parameters: what is asked for by its
//! value becomes a [`column`] when the first query asks. Edits that have not run change rows ([`edited`]).

mod build;
mod column;
mod edited;
mod path;
mod saved;

use std::cell::{Cell, OnceCell, RefCell};
use std::collections::BTreeMap;
use std::ops::Range;
use std::rc::Rc;

use rustc_hash::FxHashMap;

use crate::persist::Outlined;
use crate::tree::Status;
use crate::value::{Imm, Obj, Symbol, Value};

use super::join::Order;
use super::overlay::Planned;

pub use build::{Attempt, Task};
use column::Values;
pub use column::{Attr, Column, List, NONE};

/// A task of the table.
struct Row {
    parent: u32,
    /// One past the number of the last task below.
    below: u32,
    name: Symbol,
    kind: Symbol,
    status: Symbol,
    /// What it returned, or the failure that left it.
    value: Value,
    start: f64,
    /// Not a number while it runs.
    end: f64,
    /// Where its parameters are in [`TreeView::args`], and how many.
    args: u32,
    count: u16,
    /// The parameter is a description; what is asked for are its properties.
    is_desc: bool,
    failed: bool,
    /// It ran once; what that was stands in the row.
    is_single: bool,
}

impl Row {
    /// A task of which no more is known.
    fn outlined(it: Outlined) -> Row {
        Row {
            parent: it.parent,
            below: 0,
            name: it.name,
            kind: it.kind,
            status: it.status,
            value: Value::NIL,
            start: 0.0,
            end: f64::NAN,
            args: 0,
            count: 0,
            is_desc: false,
            failed: false,
            is_single: true,
        }
    }
}

/// What few tasks have.
#[derive(Default)]
struct Rare {
    written: Option<Vec<(Symbol, Value)>>,
    attempts: Vec<Attempt>,
    edits: Vec<Value>,
    /// The transformation that put it there.
    by: Option<Symbol>,
}

/// A tree.
#[derive(Default)]
pub struct TreeView {
    /// The tasks; the root is number 0.
    rows: Vec<Row>,
    /// Parameters of all tasks, one after the other; for an action its description.
    args: Vec<(Symbol, Value)>,
    /// What descriptions were grounded to, by their tasks.
    grounded: Vec<(u32, Value)>,
    rare: BTreeMap<u32, Rare>,
    /// Tasks on which edits stand, in their order.
    edited: Vec<u32>,
    /// When tasks would be performed, if edits have changed that; else nothing.
    planned: Vec<Planned>,
    /// Where all else is, if the rows are an outline.
    rest: Option<saved::Rest>,
    values: RefCell<Values>,
    columns: RefCell<FxHashMap<Attr, Rc<Column>>>,
    all: OnceCell<Rc<Vec<u32>>>,
    /// The place of each task in the order in which they are performed.
    ranks: OnceCell<Vec<u32>>,
    /// The rank of each task among siblings of its name, from 1.
    calls: OnceCell<Vec<u32>>,
    /// How many siblings have been looked at for the ranks of single tasks.
    looked: Cell<usize>,
    /// Paths that somebody has asked for, as values.
    paths: RefCell<FxHashMap<u32, Value>>,
    /// The orders that joins have here, by the join and which of its variables are given.
    pub(super) orders: RefCell<FxHashMap<(u32, u64), Rc<Order>>>,
}

impl TreeView {
    /// The order in which a join has been answered here.
    pub(super) fn order_of(&self, join: u32) -> Option<Rc<Order>> {
        let orders = self.orders.borrow();
        let given = orders.keys().filter(|key| key.0 == join).map(|key| key.1).min()?;
        orders.get(&(join, given)).cloned()
    }

    /// Forgets the orders of joins and how often their goals have held.
    pub(crate) fn forget_orders(&self) {
        self.orders.borrow_mut().clear();
    }

    /// How many tasks there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// True for a tree that nobody has made.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The task above; the root's is itself.
    #[inline]
    #[must_use]
    pub fn parent(&self, task: u32) -> u32 {
        self.rows[task as usize].parent
    }

    /// What is called.
    #[must_use]
    pub fn name(&self, task: u32) -> Symbol {
        self.rows[task as usize].name
    }

    /// All that a task has: parameters of a plan, properties of an action.
    #[must_use]
    pub fn params(&self, task: u32) -> Vec<(Symbol, Value)> {
        let this = self.whole();
        let row = &this.rows[task as usize];
        let args = &this.args[row.args as usize..][..usize::from(row.count)];
        match (row.is_desc, args.first().and_then(|arg| arg.1.as_desc())) {
            (true, Some(desc)) => desc.properties().map(|(key, value)| (key, value.clone())).collect(),
            _ => args.to_vec(),
        }
    }

    /// The same as the plan has it, before edits.
    #[must_use]
    pub fn written_params(&self, task: u32) -> Vec<(Symbol, Value)> {
        let written = self.whole().rare.get(&task).and_then(|it| it.written.clone());
        written.unwrap_or_else(|| self.params(task))
    }

    /// What it returned; nil if it did not.
    #[must_use]
    pub fn value(&self, task: u32) -> Value {
        let row = &self.whole().rows[task as usize];
        if row.failed { Value::NIL } else { row.value.clone() }
    }

    /// The failure that left it.
    #[must_use]
    pub fn failure(&self, task: u32) -> Option<Value> {
        let row = &self.whole().rows[task as usize];
        row.failed.then(|| row.value.clone())
    }

    /// What its description was grounded to.
    #[must_use]
    pub fn grounded(&self, task: u32) -> Option<Value> {
        let grounded = &self.whole().grounded;
        let at = grounded.binary_search_by_key(&task, |it| it.0).ok()?;
        grounded.get(at).map(|it| it.1.clone())
    }

    /// When it was called; nothing if an edit puts it there, so that it has not run.
    #[must_use]
    pub fn started(&self, task: u32) -> Option<f64> {
        (!self.is_inserted(task)).then(|| self.whole().rows[task as usize].start)
    }

    /// When it ended; nothing while it runs.
    #[must_use]
    pub fn end(&self, task: u32) -> Option<f64> {
        Some(self.whole().rows[task as usize].end).filter(|end| !end.is_nan())
    }

    /// Each run of it.
    #[must_use]
    pub fn attempts(&self, task: u32) -> Vec<Attempt> {
        let row = &self.whole().rows[task as usize];
        if !row.is_single {
            return self.whole().rare.get(&task).map(|it| it.attempts.clone()).unwrap_or_default();
        }
        vec![Attempt { status: status(row), value: row.value.clone(), start: row.start, end: self.end(task) }]
    }

    /// The edits on it.
    #[must_use]
    pub fn edits(&self, task: u32) -> &[Value] {
        self.whole().rare.get(&task).map_or(&[], |it| &it.edits)
    }

    /// True if the first task had ended when the second was called, or would have with the edits on the tree.
    #[must_use]
    pub fn is_before(&self, a: u32, b: u32) -> bool {
        let rows = &self.whole().rows;
        let moved = |task: u32| self.planned.get(task as usize).and_then(|it| it.moved);
        let place = |task: u32| self.planned.get(task as usize).map_or(task, |it| it.place);
        let end = moved(a).unwrap_or(rows[a as usize].end);
        let start = moved(b).unwrap_or(rows[b as usize].start);
        // Of two that took no time the one that was called first.
        end < start || (end == start && place(a) < place(b) && !self.is_above(a, b))
    }

    fn is_inserted(&self, task: u32) -> bool {
        self.planned.get(task as usize).is_some_and(|it| it.was.is_none())
    }

    /// True if the first task is above the second.
    #[inline]
    #[must_use]
    pub fn is_above(&self, above: u32, task: u32) -> bool {
        above < task && task < self.rows[above as usize].below
    }

    /// The tasks below one, in their order.
    #[inline]
    #[must_use]
    pub fn below(&self, task: u32) -> Range<u32> {
        task + 1..self.rows[task as usize].below
    }

    /// The tasks directly below one.
    pub fn children(&self, task: u32) -> impl Iterator<Item = u32> {
        let range = self.below(task);
        let mut at = range.start;
        std::iter::from_fn(move || {
            let child = at;
            (child < range.end).then(|| {
                at = self.rows[child as usize].below;
                child
            })
        })
    }

    /// The place of a task among all as they are performed, or would be with the edits on the tree, from 1.
    #[must_use]
    pub fn order(&self, task: u32) -> u32 {
        let ranks = self.ranks.get_or_init(|| {
            let mut order: Vec<u32> = (0..self.len() as u32).collect();
            let rows = &self.whole().rows;
            let start = |task: &u32| rows[*task as usize].start;
            match self.planned.is_empty() {
                true => order.sort_by(|a, b| start(a).total_cmp(&start(b)).then(a.cmp(b))),
                false => order.sort_by_key(|task| self.planned[*task as usize].place),
            }
            let mut ranks = vec![0; order.len()];
            (1..).zip(order).for_each(|(rank, task)| ranks[task as usize] = rank);
            ranks
        });
        ranks.get(task as usize).copied().unwrap_or(0)
    }

    /// The transformation that put the task there, or one above it.
    #[must_use]
    pub fn made_by(&self, mut task: u32) -> Option<Symbol> {
        loop {
            if let Some(by) = self.whole().rare.get(&task).and_then(|it| it.by) {
                return Some(by);
            }
            let above = self.parent(task);
            if above == task {
                return None;
            }
            task = above;
        }
    }

    /// The transformations whose edits stand on the task or on one below, in the order of the tree.
    #[must_use]
    pub fn edited_by(&self, task: u32) -> Vec<Symbol> {
        let end = self.rows[task as usize].below;
        let edited = &self.whole().edited;
        let first = edited.partition_point(|edited| *edited < task);
        let mut names = Vec::new();
        for at in edited[first..].iter().take_while(|edited| **edited < end) {
            let by = self.edits(*at).iter().filter_map(|edit| match edit.obj() {
                Some(Obj::Edit(edit)) => edit.by,
                _ => None,
            });
            for name in by {
                if !names.contains(&name) {
                    names.push(name);
                }
            }
        }
        names
    }

    /// True if an edit stands on the task or on one below.
    #[must_use]
    pub fn is_edited(&self, task: u32) -> bool {
        let end = self.rows[task as usize].below;
        let edited = &self.whole().edited;
        let at = edited.partition_point(|edited| *edited < task);
        edited.get(at).is_some_and(|edited| *edited < end)
    }
}

/// The word for what became of a task that has run.
fn status(row: &Row) -> &'static str {
    Status::ALL.iter().map(|status| status.word()).find(|word| row.status == *word).unwrap_or("")
}

/// The symbol of a value.
#[must_use]
pub fn symbol(value: &Value) -> Option<Symbol> {
    match value {
        Value::Imm(Imm::Symbol(name) | Imm::Keyword(name)) => Some(*name),
        _ => None,
    }
}
