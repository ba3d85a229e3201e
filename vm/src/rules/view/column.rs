//! What tasks have, by its value: columns of the table.
//!
//! Values are numbers there: equal ones have the same, and whoever compares two of one table compares numbers or,
//! outside of it, pointers. A column is made when the first query asks for what is in it.

use std::ops::Range;
use std::rc::Rc;

use rustc_hash::FxHashMap;

use crate::value::{Imm, Symbol, Value};

use super::super::index::hash_value;
use super::{Row, TreeView};

/// What each task has one of at the most.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Attr {
    /// A parameter or property.
    Param(Symbol),
    /// What is called.
    Name,
    /// `plan`, `action` …
    Kind,
    /// What became of it.
    Status,
}

/// No value.
pub const NONE: u32 = u32::MAX;

/// The values that tasks have of one kind, as numbers.
pub struct Column {
    /// The value of each task, or [`NONE`].
    pub of: Vec<u32>,
    /// Tasks that have one, in their order.
    tasks: Rc<Vec<u32>>,
    /// The same by their values.
    by_value: Rc<Vec<u32>>,
    /// Where those of each value begin; those of values that are not here have none.
    starts: Vec<u32>,
    /// How many different values there are.
    pub distinct: usize,
}

impl Column {
    fn new(of: Vec<u32>, values: usize) -> Column {
        let mut starts = vec![0; values + 1];
        let mut tasks = Vec::new();
        for (task, value) in (0..).zip(&of) {
            if *value != NONE {
                tasks.push(task);
                starts[*value as usize + 1] += 1;
            }
        }
        let distinct = starts.iter().filter(|count| **count > 0).count();
        for at in 1..starts.len() {
            starts[at] += starts[at - 1];
        }
        let mut next = starts.clone();
        let mut by_value = vec![0; tasks.len()];
        for task in &tasks {
            let at = &mut next[of[*task as usize] as usize];
            by_value[*at as usize] = *task;
            *at += 1;
        }
        Column { of, tasks: Rc::new(tasks), by_value: Rc::new(by_value), starts, distinct }
    }

    /// The tasks that have something.
    #[must_use]
    pub fn having(&self) -> List {
        List { all: self.tasks.clone(), next: 0, end: self.tasks.len() }
    }

    /// The tasks with this value.
    #[must_use]
    pub fn with(&self, value: u32) -> List {
        let at = |value: usize| self.starts.get(value).copied().unwrap_or(0) as usize;
        match (value as usize) < self.starts.len() - 1 {
            true => {
                List { all: self.by_value.clone(), next: at(value as usize), end: at(value as usize + 1) }
            }
            false => List::default(),
        }
    }
}

/// Tasks in their order.
#[derive(Default, Clone)]
pub struct List {
    all: Rc<Vec<u32>>,
    next: usize,
    end: usize,
}

impl List {
    /// These tasks.
    #[must_use]
    pub fn new(all: Rc<Vec<u32>>) -> List {
        let end = all.len();
        List { all, next: 0, end }
    }

    /// How many are left.
    #[must_use]
    pub fn len(&self) -> usize {
        self.end - self.next
    }

    /// True if none is left.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.next == self.end
    }

    /// Those of them that are in a range.
    #[must_use]
    pub fn within(mut self, range: &Range<u32>) -> List {
        let left = &self.all[self.next..self.end];
        let (from, to) = match left.len() {
            // A look at a few neighbours costs less than the arithmetic.
            0..8 => (
                left.iter().take_while(|task| **task < range.start).count(),
                left.iter().take_while(|task| **task < range.end).count(),
            ),
            _ => {
                let from = left.partition_point(|task| *task < range.start);
                (from, from + left[from..].partition_point(|task| *task < range.end))
            }
        };
        (self.next, self.end) = (self.next + from, self.next + to.max(from));
        self
    }

    /// Some of them, as a sample.
    pub fn some(&self, n: usize) -> impl Iterator<Item = u32> {
        let step = (self.len() / n.max(1)).max(1);
        self.all[self.next..self.end].iter().copied().step_by(step)
    }

    /// Steps back: the last task comes again.
    pub fn again(&mut self) {
        self.next -= 1;
    }
}

impl Iterator for List {
    type Item = u32;

    #[inline]
    fn next(&mut self) -> Option<u32> {
        (self.next < self.end).then(|| {
            self.next += 1;
            self.all[self.next - 1]
        })
    }
}

/// The values of properties, each once.
#[derive(Default)]
pub(super) struct Values {
    all: Vec<Value>,
    numbers: FxHashMap<u64, Vec<u32>>,
    /// Those that have been met, by their places: the rows keep them there.
    by_place: FxHashMap<usize, u32>,
}

impl Values {
    fn find(&self, hash: u64, value: &Value) -> Option<u32> {
        let known = self.numbers.get(&hash)?;
        known.iter().copied().find(|at| self.all[*at as usize] == *value)
    }

    pub(super) fn number(&self, value: &Value) -> Option<u32> {
        match value {
            Value::Obj(obj) if let Some(known) = self.by_place.get(&(Rc::as_ptr(obj) as usize)) => {
                Some(*known)
            }
            _ => self.find(hash_value(value), value),
        }
    }

    /// The number of a value that some row keeps.
    fn intern(&mut self, value: &Value) -> u32 {
        if let Value::Obj(obj) = value
            && let Some(known) = self.by_place.get(&(Rc::as_ptr(obj) as usize))
        {
            return *known;
        }
        let hash = hash_value(value);
        let number = self.find(hash, value).unwrap_or_else(|| {
            let number = self.all.len() as u32;
            self.numbers.entry(hash).or_default().push(number);
            self.all.push(value.clone());
            number
        });
        if let Value::Obj(obj) = value {
            self.by_place.insert(Rc::as_ptr(obj) as usize, number);
        }
        number
    }
}

impl TreeView {
    /// All tasks.
    #[must_use]
    pub fn all(&self) -> Rc<Vec<u32>> {
        self.all.get_or_init(|| Rc::new((0..self.rows.len() as u32).collect())).clone()
    }

    /// What all tasks have of a kind.
    #[must_use]
    pub fn column(&self, attr: Attr) -> Rc<Column> {
        if let Some(column) = self.columns.borrow().get(&attr) {
            return column.clone();
        }
        let whole = if let Attr::Param(_) = attr { self.whole() } else { self };
        let mut values = self.values.borrow_mut();
        let of: Vec<u32> = match attr {
            Attr::Param(key) => (whole.rows.iter())
                .map(|row| whole.raw(row, key).map_or(NONE, |it| values.intern(it)))
                .collect(),
            Attr::Name => symbols(&mut values, self.rows.iter().map(|row| row.name)),
            Attr::Kind => symbols(&mut values, self.rows.iter().map(|row| row.kind)),
            Attr::Status => symbols(&mut values, self.rows.iter().map(|row| row.status)),
        };
        let column = Rc::new(Column::new(of, values.all.len()));
        self.columns.borrow_mut().insert(attr, column.clone());
        column
    }

    /// The number of a value in columns; [`NONE`] if no column has it.
    #[must_use]
    pub fn number(&self, value: &Value) -> u32 {
        self.values.borrow().number(value).unwrap_or(NONE)
    }

    /// The value of a number.
    #[must_use]
    pub fn value_of(&self, number: u32) -> Value {
        self.values.borrow().all.get(number as usize).cloned().unwrap_or_default()
    }

    /// The tasks that have this value under a key.
    #[must_use]
    pub fn with(&self, key: Symbol, value: &Value) -> List {
        let column = self.column(Attr::Param(key));
        column.with(self.number(value))
    }

    /// What a task has under a key, as its row has it.
    pub(super) fn raw<'a>(&'a self, row: &'a Row, key: Symbol) -> Option<&'a Value> {
        let args = &self.args[row.args as usize..][..usize::from(row.count)];
        match (row.is_desc, args.first().and_then(|arg| arg.1.as_desc())) {
            (true, Some(desc)) => desc.get(key),
            _ => args.iter().find(|arg| arg.0 == key).map(|arg| &arg.1),
        }
    }

    /// What a task has of a kind.
    #[must_use]
    pub fn attr(&self, task: u32, attr: Attr) -> Option<Value> {
        let row = &self.rows[task as usize];
        let word = match attr {
            Attr::Param(key) => return self.param(task, key),
            Attr::Name => row.name,
            Attr::Kind => row.kind,
            Attr::Status => row.status,
        };
        Some(Value::Imm(Imm::Symbol(word)))
    }

    /// What a task has under a key: the value that all tasks with an equal one share.
    #[must_use]
    pub fn param(&self, task: u32, key: Symbol) -> Option<Value> {
        let number = *self.column(Attr::Param(key)).of.get(task as usize)?;
        (number != NONE).then(|| self.value_of(number))
    }
}

/// Symbols as numbers of values.
fn symbols(values: &mut Values, names: impl Iterator<Item = Symbol>) -> Vec<u32> {
    let mut known: FxHashMap<Symbol, u32> = FxHashMap::default();
    let mut last = None;
    let number = |name| match last {
        Some((same, number)) if same == name => number,
        _ => {
            let number = *known.entry(name).or_insert_with(|| values.intern(&Value::Imm(Imm::Symbol(name))));
            last = Some((name, number));
            number
        }
    };
    names.map(number).collect()
}
