//! A task tree as rules see it: a table of tasks, with look-ups by what is asked for.
//!
//! Tasks are numbered as they stand in the tree, parents before children, siblings in the order of
//! their calls. So all below a task are the numbers after it up to an end, every look-up gives its
//! tasks in the one order, and a list of tasks is a sorted list of numbers.
//!
//! Values of properties are kept once each: two tasks with the same location share it, and whoever
//! compares the two sees that they are one.

use std::cell::OnceCell;
use std::rc::Rc;

use rustc_hash::FxHashMap;

use crate::code::Program;
use crate::path::{Path, PathStep};
use crate::tree::{NodeKind, ROOT, RecId, SlotId, Status, Tree};
use crate::value::{Imm, Map, Obj, Symbol, Value};

use super::index::hash_value;
use super::overlay::overlay;

/// What is known of a task.
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
    /// An edit puts it there: it has not run.
    pub(super) inserted: bool,
    /// When it would be performed, where an edit changes that, in seconds.
    pub(super) moved: Option<f64>,
    /// `kind` and `status` as symbols.
    pub(super) words: (Symbol, Symbol),
    /// Its rank among siblings of its name, from 1.
    pub(super) call: u32,
    /// One past the number of the last task below.
    pub(super) below: u32,
}

impl Task {
    /// When it was called; nothing if it has not run.
    #[must_use]
    pub fn started(&self) -> Option<f64> {
        (!self.inserted).then_some(self.start)
    }
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

/// The values that tasks have under one key.
struct Column {
    /// Tasks that have one, in their order.
    tasks: Rc<Vec<u32>>,
    /// The tasks with a value, by its [`word`]. Two values of one word are told apart by who looks.
    with: FxHashMap<u64, Rc<Vec<u32>>>,
}

impl Column {
    fn new(rows: &[(u32, &Value)], values: &Values) -> Column {
        let mut with: FxHashMap<u64, Vec<u32>> = FxHashMap::default();
        for (task, value) in rows {
            if let Some(word) = word(value, values) {
                with.entry(word).or_default().push(*task);
            }
        }
        Column {
            tasks: Rc::new(rows.iter().map(|row| row.0).collect()),
            with: with.into_iter().map(|(word, tasks)| (word, Rc::new(tasks))).collect(),
        }
    }
}

/// A tree.
#[derive(Default)]
pub struct TreeView {
    /// The tasks; the root is number 0.
    pub tasks: Vec<Task>,
    by_name: OnceCell<FxHashMap<Symbol, Rc<Vec<u32>>>>,
    columns: OnceCell<FxHashMap<Symbol, Column>>,
    values: Values,
    all: OnceCell<Rc<Vec<u32>>>,
    /// Tasks on which edits stand, in their order.
    edited: Vec<u32>,
    /// In which order tasks are performed, if edits have changed that: for each its position.
    order: Vec<u32>,
}

/// The values of properties, each once.
#[derive(Default)]
struct Values {
    all: Vec<Value>,
    numbers: FxHashMap<u64, Vec<u32>>,
}

impl Values {
    fn number(&self, value: &Value) -> Option<u32> {
        let known = self.numbers.get(&hash_value(value))?;
        known.iter().copied().find(|at| self.all[*at as usize] == *value)
    }

    fn intern(&mut self, value: &Value) -> u32 {
        let known = self.numbers.entry(hash_value(value)).or_default();
        if let Some(number) = known.iter().copied().find(|at| self.all[*at as usize] == *value) {
            return number;
        }
        let number = self.all.len() as u32;
        known.push(number);
        self.all.push(value.clone());
        number
    }
}

/// What a column finds a value by: itself, or for a large one its number.
fn word(value: &Value, values: &Values) -> Option<u64> {
    match value {
        Value::Imm(_) => Some(hash_value(value)),
        Value::Obj(_) => values.number(value).map(u64::from),
    }
}

impl TreeView {
    /// The tree of these tasks, each after its parent and next to its siblings' trees.
    #[must_use]
    pub fn new(mut tasks: Vec<Task>) -> TreeView {
        if tasks.is_empty() {
            tasks.push(Task { name: Symbol::from("top-level"), kind: "top-level", ..Task::default() });
        }
        let overlaid = overlay(&mut tasks);
        let order = match overlaid {
            Some(overlaid) => {
                tasks = overlaid.tasks;
                overlaid.order
            }
            None => Vec::new(),
        };
        let mut calls: FxHashMap<(u32, Symbol), u32> = FxHashMap::default();
        let mut rank = |task: &mut Task| {
            let call = calls.entry((task.parent, task.name)).or_insert(0);
            *call += 1;
            task.call = *call;
        };
        tasks.iter_mut().skip(1).filter(|task| !task.inserted).for_each(&mut rank);
        // What edits insert has ranks after those of the tasks that have run: their paths stay.
        if !order.is_empty() {
            tasks.iter_mut().filter(|task| task.inserted).for_each(&mut rank);
        }
        for at in (0..tasks.len()).rev() {
            let below = tasks[at].below.max(at as u32 + 1);
            tasks[at].below = below;
            let parent = tasks[at].parent as usize;
            tasks[parent].below = tasks[parent].below.max(below);
        }
        let mut words: FxHashMap<&'static str, Symbol> = FxHashMap::default();
        let mut word = |text: &'static str| *words.entry(text).or_insert_with(|| Symbol::from(text));
        tasks.iter_mut().for_each(|task| task.words = (word(task.kind), word(task.status)));
        let edited = (0..).zip(&tasks).filter(|task| !task.1.edits.is_empty()).map(|task| task.0).collect();
        // Equal values become one, so that whoever compares two of them sees it at once.
        let mut values = Values::default();
        for (_, value) in tasks.iter_mut().flat_map(|task| &mut task.params) {
            if let Value::Obj(_) = value {
                let number = values.intern(value);
                *value = values.all[number as usize].clone();
            }
        }
        TreeView { tasks, edited, values, order, ..TreeView::default() }
    }

    /// The tree of a run, as it is now.
    #[must_use]
    pub fn of(program: &Program, tree: &Tree) -> TreeView {
        let mut attempts: FxHashMap<SlotId, Vec<RecId>> = FxHashMap::default();
        for rec in tree.records() {
            let record = tree.record(rec);
            if record.attempt > 1 || attempts.contains_key(&record.slot) {
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
        let mut tasks = Vec::with_capacity(tree.len());
        let mut todo = vec![(ROOT, 0)];
        while let Some((slot, parent)) = todo.pop() {
            let Some(rec) = tree.shown(slot) else { continue };
            let number = tasks.len() as u32;
            let all = attempts.get(&slot).map_or(std::slice::from_ref(&rec), Vec::as_slice);
            tasks.push(task(program, tree, slot, rec, parent, all));
            todo.extend(tree.children(slot).into_iter().rev().map(|child| (child, number)));
        }
        TreeView::new(tasks)
    }

    /// All tasks.
    #[must_use]
    pub fn all(&self) -> Rc<Vec<u32>> {
        self.all.get_or_init(|| Rc::new((0..self.tasks.len() as u32).collect())).clone()
    }

    /// The tasks of this name.
    #[must_use]
    pub fn named(&self, name: Symbol) -> Rc<Vec<u32>> {
        let by_name = self.by_name.get_or_init(|| {
            let mut by_name: FxHashMap<Symbol, Vec<u32>> = FxHashMap::default();
            for (at, task) in (0..).zip(&self.tasks) {
                by_name.entry(task.name).or_default().push(at);
            }
            by_name.into_iter().map(|(name, tasks)| (name, Rc::new(tasks))).collect()
        });
        by_name.get(&name).cloned().unwrap_or_default()
    }

    fn column(&self, key: Symbol) -> Option<&Column> {
        let columns = self.columns.get_or_init(|| {
            let mut columns: FxHashMap<Symbol, Vec<(u32, &Value)>> = FxHashMap::default();
            for (at, task) in (0..).zip(&self.tasks) {
                for (key, value) in &task.params {
                    columns.entry(*key).or_default().push((at, value));
                }
            }
            columns.into_iter().map(|(key, rows)| (key, Column::new(&rows, &self.values))).collect()
        });
        columns.get(&key)
    }

    /// The tasks that have something under a key.
    #[must_use]
    pub fn having(&self, key: Symbol) -> Rc<Vec<u32>> {
        self.column(key).map(|column| column.tasks.clone()).unwrap_or_default()
    }

    /// The tasks that have this value under a key.
    #[must_use]
    pub fn with(&self, key: Symbol, value: &Value) -> Rc<Vec<u32>> {
        let found = word(value, &self.values).and_then(|word| self.column(key)?.with.get(&word));
        found.cloned().unwrap_or_default()
    }

    /// How many different values tasks have under a key.
    #[must_use]
    pub fn distinct(&self, key: Symbol) -> usize {
        self.column(key).map_or(0, |column| column.with.len())
    }

    /// What a task has under a key: the value that all tasks with an equal one share.
    #[inline]
    #[must_use]
    pub fn param(&self, task: u32, key: Symbol) -> Option<&Value> {
        let params = &self.tasks.get(task as usize)?.params;
        params.iter().find(|param| param.0 == key).map(|param| &param.1)
    }

    /// True if the first task is above the second.
    #[must_use]
    pub fn is_above(&self, above: u32, task: u32) -> bool {
        above < task && task < self.tasks[above as usize].below
    }

    /// The tasks below one, in their order.
    #[must_use]
    pub fn below(&self, task: u32) -> std::ops::Range<u32> {
        task + 1..self.tasks[task as usize].below
    }

    /// The tasks directly below one.
    pub fn children(&self, task: u32) -> impl Iterator<Item = u32> {
        let range = self.below(task);
        let mut at = range.start;
        std::iter::from_fn(move || {
            let child = at;
            (child < range.end).then(|| {
                at = self.tasks[child as usize].below;
                child
            })
        })
    }

    /// What a task is and what became of it, as symbols.
    #[must_use]
    pub fn words(&self, task: u32) -> (Symbol, Symbol) {
        self.tasks[task as usize].words
    }

    /// True if the first task had ended when the second was called, or would have with the edits on the tree.
    #[must_use]
    pub fn is_before(&self, a: u32, b: u32) -> bool {
        let (first, second) = (&self.tasks[a as usize], &self.tasks[b as usize]);
        let (end, start) = (first.moved.or(first.end), second.moved.unwrap_or(second.start));
        let place = |task: u32| self.order.get(task as usize).copied().unwrap_or(task);
        // Of two that took no time the one that was called first.
        let is_first = || place(a) < place(b) && !self.is_above(a, b);
        end.is_some_and(|end| end < start || (end == start && is_first()))
    }

    /// True if an edit stands on the task or on one below.
    #[must_use]
    pub fn is_edited(&self, task: u32) -> bool {
        let end = self.tasks[task as usize].below;
        let at = self.edited.partition_point(|edited| *edited < task);
        self.edited.get(at).is_some_and(|edited| *edited < end)
    }

    /// The path of a task.
    #[must_use]
    pub fn path(&self, task: u32) -> Path {
        let mut steps = Vec::new();
        let mut at = task;
        while at != 0 {
            let it = &self.tasks[at as usize];
            steps.push(PathStep { name: it.name, call: it.call });
            at = it.parent;
        }
        steps.reverse();
        Path { steps }
    }

    /// The task at a path.
    #[must_use]
    pub fn at(&self, path: &Path) -> Option<u32> {
        let mut at = 0;
        for (depth, step) in path.steps.iter().enumerate() {
            if depth == 0 && step.name == "top-level" {
                continue;
            }
            at = self.children(at).find(|child| {
                let task = &self.tasks[*child as usize];
                task.name == step.name && task.call == step.call
            })?;
        }
        Some(at)
    }
}

fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

fn task(program: &Program, tree: &Tree, slot: SlotId, rec: RecId, parent: u32, all: &[RecId]) -> Task {
    let record = tree.record(rec);
    let extra = tree.extra(rec);
    let params = crate::show::params(program, tree, rec);
    let written = crate::show::written_params(program, tree, rec);
    let written = written.map(|params| properties(record.kind, params));
    let edit = |id: &u32| Value::new(Obj::Edit(Box::new((*tree.edits[*id as usize - 1].edit).clone())));
    let edits: Vec<Value> = tree.edits_of(slot).iter().map(edit).collect();
    let pending = tree.pending_edits_of(slot).iter().map(edit).collect();
    let end = |status: Status, ns: u64| status.is_final().then(|| seconds(ns));
    // That of an evaporated task is the failure of its clean-up.
    let failed =
        matches!(record.status, Status::Failed | Status::Evaporated) && record.value.as_failure().is_some();
    Task {
        parent,
        name: tree.slot(slot).name,
        kind: record.kind.word(),
        status: record.status.word(),
        params: properties(record.kind, params),
        written,
        grounded: extra.and_then(|it| it.grounded.clone()),
        value: if failed { Value::NIL } else { record.value.clone() },
        failure: failed.then(|| record.value.clone()),
        start: seconds(record.start),
        end: end(record.status, record.end),
        attempts: all
            .iter()
            .map(|rec| {
                let record = tree.record(*rec);
                Attempt {
                    status: record.status.word(),
                    value: record.value.clone(),
                    start: seconds(record.start),
                    end: end(record.status, record.end),
                }
            })
            .collect(),
        edits,
        pending,
        inserted: false,
        moved: None,
        words: Default::default(),
        call: 0,
        below: 0,
    }
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
