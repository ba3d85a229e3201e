//! A task tree as rules see it: a table of tasks, with look-ups by what is asked for.
//!
//! Tasks are numbered as they stand in the tree, parents before children, siblings in the order of
//! their calls. So all below a task are the numbers after it up to an end, every look-up gives its
//! tasks in the one order, and a list of tasks is a sorted list of numbers.
//!
//! The table has one row of fixed size for each task and copies no parameters: what is asked for by its
//! value becomes a [`Column`] when the first query asks. There values are numbers: equal ones have the
//! same, and whoever compares two of one table compares numbers or, outside of it, pointers.

use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::ops::Range;
use std::rc::Rc;

use rustc_hash::{FxHashMap, FxHashSet};

use crate::code::Program;
use crate::path::{Path, PathStep};
use crate::tree::{NodeKind, ROOT, RecId, SlotId, Status, Tree};
use crate::value::{Imm, Map, Obj, Symbol, Value};

use super::index::hash_value;
use super::join::Order;
use super::overlay::{self, Planned, overlay};

/// What is known of a task, to make a tree of.
#[derive(Debug, Clone, Default)]
pub struct Task {
    /// The number of the task above; its own for the root.
    pub parent: u32,
    /// What is called.
    pub name: Symbol,
    /// `plan`, `action`, `branch`, `top-level`
    pub kind: &'static str,
    /// What became of it.
    pub status: &'static str,
    /// Parameters of a plan, properties of an action.
    pub params: Vec<(Symbol, Value)>,
    /// The same as the plan has them, where an edit has changed them.
    pub written: Option<Vec<(Symbol, Value)>>,
    /// What a description was grounded to.
    pub grounded: Option<Value>,
    /// What it returned.
    pub value: Value,
    /// The failure that left it.
    pub failure: Option<Value>,
    /// Seconds of the task clock.
    pub start: f64,
    /// Seconds of the task clock; nothing while it runs.
    pub end: Option<f64>,
    /// Each run of it.
    pub attempts: Vec<Attempt>,
    /// The edits on it.
    pub edits: Vec<Value>,
    /// Those of them that were added after it ran.
    pub pending: Vec<Value>,
}

/// One run of a task.
#[derive(Debug, Clone)]
pub struct Attempt {
    /// What became of it.
    pub status: &'static str,
    /// Its value, or the failure that left it.
    pub value: Value,
    /// Seconds of the task clock.
    pub start: f64,
    /// Seconds of the task clock; nothing while it runs.
    pub end: Option<f64>,
}

impl Attempt {
    /// As a map.
    #[must_use]
    pub fn value(&self) -> Value {
        let key = |name: &str| Value::keyword(name);
        let end = self.end.map_or(Value::NIL, Value::float);
        let map: Map = [
            (key("status"), Value::symbol(self.status)),
            (key("value"), self.value.clone()),
            (key("start"), Value::float(self.start)),
            (key("end"), end),
        ]
        .into_iter()
        .collect();
        Value::map(map)
    }
}

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

/// Symbols of the words that many rows have.
#[derive(Default)]
struct Texts(FxHashMap<&'static str, Symbol>);

impl Texts {
    fn symbol(&mut self, text: &'static str) -> Symbol {
        *self.0.entry(text).or_insert_with(|| Symbol::from(text))
    }
}

/// What few tasks have.
#[derive(Default)]
struct Rare {
    written: Option<Vec<(Symbol, Value)>>,
    attempts: Vec<Attempt>,
    edits: Vec<Value>,
}

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
    values: RefCell<Values>,
    columns: RefCell<FxHashMap<Attr, Rc<Column>>>,
    all: OnceCell<Rc<Vec<u32>>>,
    /// The rank of each task among siblings of its name, from 1.
    calls: OnceCell<Vec<u32>>,
    /// Paths that somebody has asked for, as values.
    paths: RefCell<FxHashMap<u32, Value>>,
    /// The orders that joins have here, by the join and which of its variables are given.
    pub(super) orders: RefCell<FxHashMap<(u32, u64), Rc<Order>>>,
}

/// The values of properties, each once.
#[derive(Default)]
struct Values {
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

    fn number(&self, value: &Value) -> Option<u32> {
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
    /// The tree of these tasks, each after its parent and next to its siblings' trees.
    #[must_use]
    pub fn new(mut tasks: Vec<Task>) -> TreeView {
        if tasks.is_empty() {
            tasks.push(Task { name: Symbol::from("top-level"), kind: "top-level", ..Task::default() });
        }
        let planned = overlay(&mut tasks);
        let mut view = TreeView { planned, ..TreeView::default() };
        let mut words = Texts::default();
        for task in tasks {
            view.push(task, &mut words);
        }
        view.close();
        view
    }

    /// A row for a task.
    fn push(&mut self, task: Task, words: &mut Texts) {
        let number = self.rows.len() as u32;
        let args = self.args.len() as u32;
        let count = task.params.len() as u16;
        self.args.extend(task.params.into_iter().take(count.into()));
        self.grounded.extend(task.grounded.map(|call| (number, call)));
        if !task.edits.is_empty() {
            self.edited.push(number);
        }
        if task.written.is_some() || !task.attempts.is_empty() || !task.edits.is_empty() {
            let (written, attempts, edits) = (task.written, task.attempts, task.edits);
            self.rare.insert(number, Rare { written, attempts, edits });
        }
        self.rows.push(Row {
            parent: task.parent,
            below: 0,
            name: task.name,
            kind: words.symbol(task.kind),
            status: words.symbol(task.status),
            failed: task.failure.is_some(),
            value: task.failure.unwrap_or(task.value),
            start: task.start,
            end: task.end.unwrap_or(f64::NAN),
            args,
            count,
            is_desc: false,
            is_single: false,
        });
    }

    /// The tree of a run, as it is now.
    #[must_use]
    pub fn of(program: &Program, tree: &Tree) -> TreeView {
        let mut view = TreeView { rows: Vec::with_capacity(tree.len()), ..TreeView::default() };
        let words = Words::new();
        let attempts = attempts(tree);
        let mut todo = vec![(ROOT, 0)];
        let (mut children, mut pending) = (Vec::new(), Vec::new());
        while let Some((slot, parent)) = todo.pop() {
            let Some(rec) = tree.shown(slot) else { continue };
            let number = view.rows.len() as u32;
            view.add(program, tree, &words, &attempts, (slot, rec, parent));
            let added = tree.pending_edits_of(slot);
            if !added.is_empty() {
                pending.push((number, edits(tree, added)));
            }
            tree.children_into(slot, &mut children);
            todo.extend(children.iter().rev().map(|child| (*child, number)));
        }
        view.close();
        if pending.is_empty() {
            return view;
        }
        view.overlaid(pending)
    }

    /// The table with edits that have not run. What they do not change keeps its row.
    fn overlaid(mut self, pending: Vec<(u32, Vec<Value>)>) -> TreeView {
        if pending.iter().flat_map(|it| &it.1).all(overlay::stays) {
            for (task, edits) in pending {
                self.change(task, &edits);
            }
            return self;
        }
        let mut tasks: Vec<Task> = (0..self.len() as u32).map(|task| self.outline(task)).collect();
        for (task, edits) in &pending {
            tasks[*task as usize] = Task { pending: edits.clone(), ..self.task(*task) };
        }
        let planned = overlay(&mut tasks);
        let was: Vec<Option<u32>> = planned.iter().map(|it| it.was).collect();
        let mut is_edited: FxHashSet<u32> = pending.into_iter().map(|it| it.0).collect();
        for (task, was) in tasks.iter_mut().zip(&was) {
            // What is skipped below an edited one: its run stays as it was.
            if let Some(was) = was.filter(|was| !is_edited.contains(was))
                && task.status != status(&self.rows[was as usize])
            {
                *task = Task { parent: task.parent, status: task.status, ..self.task(was) };
                is_edited.insert(was);
            }
        }
        let args = std::mem::take(&mut self.args);
        let mut view =
            TreeView { planned, args, rows: Vec::with_capacity(tasks.len()), ..TreeView::default() };
        let mut grounded: FxHashMap<u32, Value> = std::mem::take(&mut self.grounded).into_iter().collect();
        let mut words = Texts::default();
        for (task, was) in tasks.into_iter().zip(was) {
            let Some(was) = was.filter(|was| !is_edited.contains(was)) else {
                view.push(task, &mut words);
                continue;
            };
            let number = view.rows.len() as u32;
            view.grounded.extend(grounded.remove(&was).map(|call| (number, call)));
            if let Some(rare) = self.rare.remove(&was) {
                if !rare.edits.is_empty() {
                    view.edited.push(number);
                }
                view.rare.insert(number, rare);
            }
            let row = &mut self.rows[was as usize];
            view.rows.push(Row {
                parent: task.parent,
                below: 0,
                status: words.symbol(task.status),
                value: std::mem::take(&mut row.value),
                ..*row
            });
        }
        view.close();
        view
    }

    /// Applies edits that leave all tasks where they are.
    fn change(&mut self, number: u32, edits: &[Value]) {
        let mut task = self.task(number);
        let edits = overlay::holding(&task, edits);
        let is_skipped = overlay::change(&mut task, &edits);
        if task.written.is_some() {
            let row = &mut self.rows[number as usize];
            (row.args, row.count, row.is_desc) = (self.args.len() as u32, task.params.len() as u16, false);
            self.args.extend(task.params);
            self.rare.entry(number).or_default().written = task.written;
        }
        if !is_skipped {
            return;
        }
        for below in number..self.rows[number as usize].below {
            if self.rows[below as usize].is_single {
                let attempts = self.attempts(below);
                self.rare.entry(below).or_default().attempts = attempts;
            }
            let row = &mut self.rows[below as usize];
            (row.is_single, row.status) = (false, Symbol::from(overlay::SKIPPED));
        }
    }

    /// As much of a task as says where it stands.
    fn outline(&self, task: u32) -> Task {
        let row = &self.rows[task as usize];
        Task {
            parent: row.parent,
            name: row.name,
            status: status(row),
            start: row.start,
            end: self.end(task),
            ..Task::default()
        }
    }

    /// What a tree is made of.
    fn task(&self, task: u32) -> Task {
        let row = &self.rows[task as usize];
        let kind = NodeKind::ALL.iter().find(|kind| row.kind == kind.word());
        let rare = self.rare.get(&task);
        Task {
            parent: row.parent,
            name: row.name,
            kind: kind.map_or("", |kind| kind.word()),
            status: status(row),
            params: self.params(task),
            written: rare.and_then(|it| it.written.clone()),
            grounded: self.grounded(task),
            value: self.value(task),
            failure: self.failure(task),
            start: row.start,
            end: self.end(task),
            attempts: self.attempts(task),
            edits: self.edits(task).to_vec(),
            pending: Vec::new(),
        }
    }

    /// A row for a slot with its record, below another row.
    fn add(
        &mut self,
        program: &Program,
        tree: &Tree,
        words: &Words,
        attempts: &FxHashMap<SlotId, Vec<RecId>>,
        (slot, rec, parent): (SlotId, RecId, u32),
    ) {
        let number = self.rows.len() as u32;
        let record = tree.record(rec);
        let args = self.args.len() as u32;
        let is_desc = crate::show::each_param(program, tree, rec, &mut |name, value| {
            self.args.push((name, value.clone()));
        });
        if let Some(call) = tree.extra(rec).and_then(|it| it.grounded.clone()) {
            self.grounded.push((number, call));
        }
        let on_it = tree.edits_of(slot);
        if !on_it.is_empty() {
            self.edited.push(number);
        }
        let all = attempts.get(&slot);
        let is_single = all.is_none();
        if !is_single || tree.is_changed(rec) || !on_it.is_empty() {
            let attempt = |rec: &RecId| attempt(tree, *rec);
            let all = all.map_or(std::slice::from_ref(&rec), Vec::as_slice);
            let written = crate::show::written_params(program, tree, rec);
            self.rare.insert(
                number,
                Rare {
                    written: written.map(|params| properties(record.kind, params)),
                    attempts: if is_single { Vec::new() } else { all.iter().map(attempt).collect() },
                    edits: edits(tree, on_it),
                },
            );
        }
        self.rows.push(Row {
            parent,
            below: 0,
            name: tree.slot(slot).name,
            kind: words.kind(record.kind),
            status: words.status(record.status),
            value: record.value.clone(),
            start: seconds(record.start),
            end: if record.status.is_final() { seconds(record.end) } else { f64::NAN },
            args,
            count: (self.args.len() as u32 - args) as u16,
            is_desc,
            // That of an evaporated task is the failure of its clean-up.
            failed: matches!(record.status, Status::Failed | Status::Evaporated)
                && record.value.as_failure().is_some(),
            is_single,
        });
    }

    /// Finds out where what is below each task ends.
    fn close(&mut self) {
        for at in (0..self.rows.len()).rev() {
            let below = self.rows[at].below.max(at as u32 + 1);
            self.rows[at].below = below;
            let parent = self.rows[at].parent as usize;
            self.rows[parent].below = self.rows[parent].below.max(below);
        }
    }

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

    /// All tasks.
    #[must_use]
    pub fn all(&self) -> Rc<Vec<u32>> {
        self.all.get_or_init(|| Rc::new((0..self.rows.len() as u32).collect())).clone()
    }

    // ------------------------------------------------------------------ columns

    /// What all tasks have of a kind.
    #[must_use]
    pub fn column(&self, attr: Attr) -> Rc<Column> {
        if let Some(column) = self.columns.borrow().get(&attr) {
            return column.clone();
        }
        let mut values = self.values.borrow_mut();
        let of: Vec<u32> = match attr {
            Attr::Param(key) => (self.rows.iter())
                .map(|row| self.raw(row, key).map_or(NONE, |it| values.intern(it)))
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
    fn raw<'a>(&'a self, row: &'a Row, key: Symbol) -> Option<&'a Value> {
        let args = &self.args[row.args as usize..][..usize::from(row.count)];
        match (row.is_desc, args.first().and_then(|arg| arg.1.as_desc())) {
            (true, Some(desc)) => desc.get(key),
            _ => args.iter().find(|arg| arg.0 == key).map(|arg| &arg.1),
        }
    }

    /// What a task has under a key: the value that all tasks with an equal one share.
    #[must_use]
    pub fn param(&self, task: u32, key: Symbol) -> Option<Value> {
        let number = *self.column(Attr::Param(key)).of.get(task as usize)?;
        (number != NONE).then(|| self.value_of(number))
    }

    /// All that a task has: parameters of a plan, properties of an action.
    #[must_use]
    pub fn params(&self, task: u32) -> Vec<(Symbol, Value)> {
        let row = &self.rows[task as usize];
        let args = &self.args[row.args as usize..][..usize::from(row.count)];
        match (row.is_desc, args.first().and_then(|arg| arg.1.as_desc())) {
            (true, Some(desc)) => desc.properties().map(|(key, value)| (key, value.clone())).collect(),
            _ => args.to_vec(),
        }
    }

    /// The same as the plan has it, before edits.
    #[must_use]
    pub fn written_params(&self, task: u32) -> Vec<(Symbol, Value)> {
        let written = self.rare.get(&task).and_then(|it| it.written.clone());
        written.unwrap_or_else(|| self.params(task))
    }

    // ------------------------------------------------------------------ rows

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

    /// What a task is and what became of it, as symbols.
    #[must_use]
    pub fn words(&self, task: u32) -> (Symbol, Symbol) {
        let row = &self.rows[task as usize];
        (row.kind, row.status)
    }

    /// What it returned; nil if it did not.
    #[must_use]
    pub fn value(&self, task: u32) -> Value {
        let row = &self.rows[task as usize];
        if row.failed { Value::NIL } else { row.value.clone() }
    }

    /// The failure that left it.
    #[must_use]
    pub fn failure(&self, task: u32) -> Option<Value> {
        let row = &self.rows[task as usize];
        row.failed.then(|| row.value.clone())
    }

    /// What its description was grounded to.
    #[must_use]
    pub fn grounded(&self, task: u32) -> Option<Value> {
        let at = self.grounded.binary_search_by_key(&task, |it| it.0).ok()?;
        self.grounded.get(at).map(|it| it.1.clone())
    }

    /// When it was called; nothing if an edit puts it there, so that it has not run.
    #[must_use]
    pub fn started(&self, task: u32) -> Option<f64> {
        (!self.is_inserted(task)).then(|| self.rows[task as usize].start)
    }

    /// When it ended; nothing while it runs.
    #[must_use]
    pub fn end(&self, task: u32) -> Option<f64> {
        Some(self.rows[task as usize].end).filter(|end| !end.is_nan())
    }

    /// Each run of it.
    #[must_use]
    pub fn attempts(&self, task: u32) -> Vec<Attempt> {
        let row = &self.rows[task as usize];
        if !row.is_single {
            return self.rare.get(&task).map(|it| it.attempts.clone()).unwrap_or_default();
        }
        vec![Attempt { status: status(row), value: row.value.clone(), start: row.start, end: self.end(task) }]
    }

    /// The edits on it.
    #[must_use]
    pub fn edits(&self, task: u32) -> &[Value] {
        self.rare.get(&task).map_or(&[], |it| &it.edits)
    }

    /// True if the first task had ended when the second was called, or would have with the edits on the tree.
    #[must_use]
    pub fn is_before(&self, a: u32, b: u32) -> bool {
        let moved = |task: u32| self.planned.get(task as usize).and_then(|it| it.moved);
        let place = |task: u32| self.planned.get(task as usize).map_or(task, |it| it.place);
        let end = moved(a).unwrap_or(self.rows[a as usize].end);
        let start = moved(b).unwrap_or(self.rows[b as usize].start);
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

    /// True if an edit stands on the task or on one below.
    #[must_use]
    pub fn is_edited(&self, task: u32) -> bool {
        let end = self.rows[task as usize].below;
        let at = self.edited.partition_point(|edited| *edited < task);
        self.edited.get(at).is_some_and(|edited| *edited < end)
    }

    // ------------------------------------------------------------------ paths

    /// The tasks directly below one, in the order of their ranks. What edits insert has ranks after those of the
    /// tasks that have run: their paths stay.
    fn ranked(&self, task: u32) -> impl Iterator<Item = u32> {
        let inserted = (!self.planned.is_empty()).then(|| self.children(task));
        let inserted = inserted.into_iter().flatten().filter(|child| self.is_inserted(*child));
        self.children(task).filter(|child| !self.is_inserted(*child)).chain(inserted)
    }

    /// The rank of each task among siblings of its name, from 1.
    fn calls(&self) -> &[u32] {
        /// With so many siblings it pays to keep a table of their names.
        const MANY: usize = 16;
        self.calls.get_or_init(|| {
            let mut calls = vec![1; self.rows.len()];
            let mut seen: Vec<u32> = Vec::new();
            let mut last: FxHashMap<Symbol, u32> = FxHashMap::default();
            for above in 0..self.rows.len() as u32 {
                seen.clear();
                last.clear();
                for child in self.ranked(above) {
                    let name = self.name(child);
                    let before = match seen.len() < MANY {
                        true => seen.iter().rev().copied().find(|it| self.name(*it) == name),
                        false => {
                            if last.is_empty() {
                                last.extend(seen.iter().map(|it| (self.name(*it), *it)));
                            }
                            last.insert(name, child)
                        }
                    };
                    calls[child as usize] = before.map_or(1, |before| calls[before as usize] + 1);
                    seen.push(child);
                }
            }
            calls
        })
    }

    /// The path of a task.
    #[must_use]
    pub fn path(&self, task: u32) -> Path {
        let calls = self.calls();
        let mut steps = Vec::new();
        let mut at = task;
        while at != 0 {
            let it = &self.rows[at as usize];
            steps.push(PathStep { name: it.name, call: calls[at as usize] });
            at = it.parent;
        }
        steps.reverse();
        Path { steps }
    }

    /// The path of a task as a value: made once.
    #[must_use]
    pub fn path_value(&self, task: u32) -> Value {
        let mut paths = self.paths.borrow_mut();
        paths.entry(task).or_insert_with(|| Value::new(Obj::Path(Box::new(self.path(task))))).clone()
    }

    /// The task at a path.
    #[must_use]
    pub fn at(&self, path: &Path) -> Option<u32> {
        let mut at = 0;
        for (depth, step) in path.steps.iter().enumerate() {
            if depth == 0 && step.name == "top-level" {
                continue;
            }
            let rank = (step.call as usize).checked_sub(1)?;
            at = self.ranked(at).filter(|child| self.name(*child) == step.name).nth(rank)?;
        }
        Some(at)
    }
}

/// Symbols as numbers of values.
fn symbols(values: &mut Values, names: impl Iterator<Item = Symbol>) -> Vec<u32> {
    let mut known: FxHashMap<Symbol, u32> = FxHashMap::default();
    let number = |name| *known.entry(name).or_insert_with(|| values.intern(&Value::Imm(Imm::Symbol(name))));
    names.map(number).collect()
}

fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

/// The words for what tasks are and what becomes of them: a symbol costs a look-up.
struct Words {
    kinds: Vec<Symbol>,
    status: Vec<Symbol>,
}

impl Words {
    fn new() -> Words {
        let kinds = NodeKind::ALL.iter().map(|it| Symbol::from(it.word())).collect();
        Words { kinds, status: Status::ALL.iter().map(|it| Symbol::from(it.word())).collect() }
    }

    fn kind(&self, kind: NodeKind) -> Symbol {
        self.kinds[kind as usize]
    }

    fn status(&self, status: Status) -> Symbol {
        self.status[status as usize]
    }
}

/// The records of slots that have several in this run.
fn attempts(tree: &Tree) -> FxHashMap<SlotId, Vec<RecId>> {
    let mut attempts: FxHashMap<SlotId, Vec<RecId>> = FxHashMap::default();
    for rec in tree.records() {
        let record = tree.record(rec);
        if record.attempt > 1 {
            attempts.entry(record.slot).or_default();
        }
    }
    if !attempts.is_empty() {
        for rec in tree.records() {
            if let Some(all) = attempts.get_mut(&tree.record(rec).slot) {
                all.push(rec);
            }
        }
    }
    attempts
}

fn attempt(tree: &Tree, rec: RecId) -> Attempt {
    let record = tree.record(rec);
    Attempt {
        status: record.status.word(),
        value: record.value.clone(),
        start: seconds(record.start),
        end: record.status.is_final().then(|| seconds(record.end)),
    }
}

/// Edits as values.
fn edits(tree: &Tree, numbers: &[u32]) -> Vec<Value> {
    let edit = |number: &u32| (*tree.edits[*number as usize - 1].edit).clone();
    numbers.iter().map(|number| Value::new(Obj::Edit(Box::new(edit(number))))).collect()
}

/// The word for what became of a task that has run.
fn status(row: &Row) -> &'static str {
    Status::ALL.iter().map(|status| status.word()).find(|word| row.status == *word).unwrap_or("")
}

/// The properties of a description, or the parameters of a plan.
fn properties(kind: NodeKind, params: Vec<(Symbol, Value)>) -> Vec<(Symbol, Value)> {
    match (kind, params.first().and_then(|param| param.1.as_desc())) {
        (NodeKind::Action, Some(desc)) => {
            desc.properties().map(|(key, value)| (key, value.clone())).collect()
        }
        _ => params.into_iter().filter(|param| !crate::code::is_pattern(&param.0)).collect(),
    }
}

/// The symbol of a value.
#[must_use]
pub fn symbol(value: &Value) -> Option<Symbol> {
    match value {
        Value::Imm(Imm::Symbol(name) | Imm::Keyword(name)) => Some(*name),
        _ => None,
    }
}
