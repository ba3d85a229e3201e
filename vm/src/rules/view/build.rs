//! Rows for the tasks of a tree: of a run as it is, or of tasks that somebody hands in.

use rustc_hash::FxHashMap;

use crate::code::Program;
use crate::key::Step;
use crate::tree::{NodeKind, ROOT, RecId, SlotId, Status, Tree};
use crate::value::{Map, Obj, Symbol, Value};

use super::super::overlay::overlay;
use super::{Rare, Row, TreeView};

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
    /// The transformation that put it there.
    pub by: Option<Symbol>,
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

/// Symbols of the words that many rows have.
#[derive(Default)]
pub(super) struct Texts(FxHashMap<&'static str, Symbol>);

impl Texts {
    pub(super) fn symbol(&mut self, text: &'static str) -> Symbol {
        *self.0.entry(text).or_insert_with(|| Symbol::from(text))
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
    pub(super) fn push(&mut self, task: Task, words: &mut Texts) {
        let number = self.rows.len() as u32;
        let args = self.args.len() as u32;
        let count = task.params.len() as u16;
        self.args.extend(task.params.into_iter().take(count.into()));
        self.grounded.extend(task.grounded.map(|call| (number, call)));
        if !task.edits.is_empty() {
            self.edited.push(number);
        }
        if task.written.is_some() || !task.attempts.is_empty() || !task.edits.is_empty() || task.by.is_some()
        {
            let (written, attempts, edits, by) = (task.written, task.attempts, task.edits, task.by);
            self.rare.insert(number, Rare { written, attempts, edits, by });
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
        let by = inserted_by(tree, slot);
        if !is_single || tree.is_changed(rec) || !on_it.is_empty() || by.is_some() {
            let attempt = |rec: &RecId| attempt(tree, *rec);
            let all = all.map_or(std::slice::from_ref(&rec), Vec::as_slice);
            let written = crate::show::written_params(program, tree, rec);
            self.rare.insert(
                number,
                Rare {
                    written: written.map(|params| properties(record.kind, params)),
                    attempts: if is_single { Vec::new() } else { all.iter().map(attempt).collect() },
                    edits: edits(tree, on_it),
                    by,
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
    pub(super) fn close(&mut self) {
        for at in (0..self.rows.len()).rev() {
            let below = self.rows[at].below.max(at as u32 + 1);
            self.rows[at].below = below;
            let parent = self.rows[at].parent as usize;
            self.rows[parent].below = self.rows[parent].below.max(below);
        }
    }
}

pub(super) fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

/// The words for what tasks are and what becomes of them: a symbol costs a look-up.
pub(super) struct Words {
    kinds: Vec<Symbol>,
    status: Vec<Symbol>,
}

impl Words {
    pub(super) fn new() -> Words {
        let kinds = NodeKind::ALL.iter().map(|it| Symbol::from(it.word())).collect();
        Words { kinds, status: Status::ALL.iter().map(|it| Symbol::from(it.word())).collect() }
    }

    pub(super) fn kind(&self, kind: NodeKind) -> Symbol {
        self.kinds[kind as usize]
    }

    pub(super) fn status(&self, status: Status) -> Symbol {
        self.status[status as usize]
    }

    /// The kind that has this word.
    pub(super) fn a_kind(&self, word: Symbol) -> Option<NodeKind> {
        NodeKind::ALL.get(self.kinds.iter().position(|it| *it == word)?).copied()
    }

    /// The status that has this word.
    pub(super) fn a_status(&self, word: Symbol) -> Option<Status> {
        Status::ALL.get(self.status.iter().position(|it| *it == word)?).copied()
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

/// The transformation whose edit put a call there, if the call stands in the code of an edit.
fn inserted_by(tree: &Tree, slot: SlotId) -> Option<Symbol> {
    if tree.edits.is_empty() {
        return None;
    }
    let steps = tree.keys.steps(tree.slot(slot).key.chain);
    let edit =
        steps.iter().find_map(|step| if let Step::Edit(number) = step { Some(*number) } else { None })?;
    tree.edits.get(edit as usize - 1)?.edit.by
}

/// Edits as values.
fn edits(tree: &Tree, numbers: &[u32]) -> Vec<Value> {
    let edit = |number: &u32| (*tree.edits[*number as usize - 1].edit).clone();
    numbers.iter().map(|number| Value::new(Obj::Edit(Box::new(edit(number))))).collect()
}

/// The properties of a description, or the parameters of a plan.
pub(super) fn properties(kind: NodeKind, params: Vec<(Symbol, Value)>) -> Vec<(Symbol, Value)> {
    match (kind, params.first().and_then(|param| param.1.as_desc())) {
        (NodeKind::Action, Some(desc)) => {
            desc.properties().map(|(key, value)| (key, value.clone())).collect()
        }
        _ => params.into_iter().filter(|param| !crate::code::is_pattern(&param.0)).collect(),
    }
}
