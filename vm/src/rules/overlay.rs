//! The tree as the edits make it that have been added since it ran.
//!
//! A tree that `edit-tree` has returned shows a run without the new edits. Rules see what is known of the run
//! to come: parameters as edits change them, calls that are skipped or deferred, and as tasks with the status
//! `planned` what edits put before and after calls, and what they owe. All tasks keep their paths, for edits name
//! places by them: what is deferred stays where it was called, and what is inserted has the ranks after those of
//! its name. When it is performed is another order, which `before` looks at.
//!
//! A task that is deferred, or owed, is performed when the child of the common task has ended in which the
//! awaited one is. (The machine looks at forms: within one body it may perform it earlier.)

use rustc_hash::{FxHashMap, FxHashSet};

use crate::edit::{Edit, What};
use crate::path::Path;
use crate::value::{Imm, Obj, Symbol, Value};

use super::view::Task;

/// The status of what is not performed.
pub(super) const SKIPPED: &str = "skipped";

/// When a task would be performed.
pub(super) struct Planned {
    /// Its position among all.
    pub place: u32,
    /// The time in seconds, where an edit changes that.
    pub moved: Option<f64>,
    /// Its number without the edits; nothing if one of them puts it there.
    pub was: Option<u32>,
}

/// A task, and where edits put others beside it.
#[derive(Default)]
struct Node {
    task: Task,
    children: Vec<usize>,
    before: Vec<usize>,
    after: Vec<usize>,
    /// What waits until it has ended.
    waiting: Vec<usize>,
    /// It waits for another one.
    waits: bool,
    inserted: bool,
    moved: Option<f64>,
}

/// What code calls: name, kind, and the properties that are written out.
type Inserted = (Symbol, &'static str, Vec<(Symbol, Value)>);

struct Overlay {
    nodes: Vec<Node>,
    places: FxHashMap<(usize, Symbol, u32), usize>,
    /// The names of what each task owes.
    owed: FxHashSet<(usize, Symbol)>,
}

/// Makes of tasks in the order of a tree those with what edits change. Says when each would be performed; nothing
/// if no edit waits to be applied.
pub(super) fn overlay(tasks: &mut Vec<Task>) -> Vec<Planned> {
    if tasks.iter().all(|task| task.pending.is_empty()) {
        return Vec::new();
    }
    let mut it = Overlay::new(std::mem::take(tasks));
    for at in 0..it.nodes.len() {
        it.apply(at);
    }
    let planned;
    (*tasks, planned) = it.overlaid();
    planned
}

impl Overlay {
    fn new(tasks: Vec<Task>) -> Overlay {
        let mut it = Overlay { nodes: Vec::new(), places: FxHashMap::default(), owed: FxHashSet::default() };
        let mut ranks: FxHashMap<(usize, Symbol), u32> = FxHashMap::default();
        // Most edits name no place but their own.
        let has_paths = tasks.iter().flat_map(|task| &task.pending).filter_map(as_edit).any(names_places);
        it.nodes.reserve(tasks.len());
        for (at, task) in tasks.into_iter().enumerate() {
            let (parent, name) = (task.parent as usize, task.name);
            if at > 0 {
                if has_paths {
                    let rank = ranks.entry((parent, name)).or_insert(0);
                    *rank += 1;
                    it.places.insert((parent, name, *rank), at);
                }
                it.nodes[parent].children.push(at);
            }
            it.nodes.push(Node { task, ..Node::default() });
        }
        it
    }

    /// The edits on a task that hold for its call, in the order of their effect.
    fn apply(&mut self, at: usize) {
        let task = &mut self.nodes[at].task;
        let pending = std::mem::take(&mut task.pending);
        let edits = holding(task, &pending);
        let is_skipped = change(task, &edits);
        for edit in &edits {
            if let What::Owe { code, after, name } = &edit.what {
                self.owe(at, edit, code, after, *name);
            }
        }
        if is_skipped {
            return;
        }
        for edit in &edits {
            match &edit.what {
                What::Defer(after) => {
                    if let Some((_, last)) = self.awaited(at, after) {
                        self.nodes[at].task.status = "deferred";
                        self.nodes[at].waits = true;
                        self.nodes[last].waiting.push(at);
                    }
                }
                What::Before(code) => {
                    let new = self.insert(edit, code, self.nodes[at].task.parent);
                    self.nodes[at].before.extend(new);
                }
                What::After(code) => {
                    let new = self.insert(edit, code, self.nodes[at].task.parent);
                    self.nodes[at].after.extend(new);
                }
                _ => {}
            }
        }
    }

    fn owe(&mut self, at: usize, edit: &Edit, code: &Value, after: &[Path], name: Symbol) {
        let Some((common, last)) = self.awaited(at, after) else { return };
        if self.owed.insert((common, name)) {
            // What is owed is a task of this name, with the calls of the code below it.
            let owed = self.add(edit, (name, "plan", Vec::new()), common as u32);
            self.nodes[owed].children = self.insert(edit, code, owed as u32);
            self.nodes[last].waiting.push(owed);
        }
    }

    /// The last of these that comes after a task, as the common task of the two and what has to end.
    fn awaited(&self, at: usize, after: &[Path]) -> Option<(usize, usize)> {
        let last = after.iter().filter_map(|path| self.find(path)).filter(|it| *it > at).max()?;
        let above: Vec<usize> = self.above(at).collect();
        let mut side = last;
        for parent in self.above(last) {
            if parent == at {
                return None;
            }
            if above.contains(&parent) {
                // Who waits for one that waits itself follows it.
                return Some((parent, if self.nodes[last].waits { last } else { side }));
            }
            side = parent;
        }
        None
    }

    /// The tasks above one, the nearest first.
    fn above(&self, mut at: usize) -> impl Iterator<Item = usize> {
        std::iter::from_fn(move || {
            let parent = self.nodes[at].task.parent as usize;
            (at != parent).then(|| {
                at = parent;
                parent
            })
        })
    }

    fn find(&self, path: &Path) -> Option<usize> {
        path.steps.iter().try_fold(0, |at, step| self.places.get(&(at, step.name, step.call)).copied())
    }

    /// New tasks for the calls in the code of an edit.
    fn insert(&mut self, edit: &Edit, code: &Value, parent: u32) -> Vec<usize> {
        calls(code).into_iter().map(|call| self.add(edit, call, parent)).collect()
    }

    fn add(&mut self, edit: &Edit, (name, kind, params): Inserted, parent: u32) -> usize {
        let edits = vec![Value::new(Obj::Edit(Box::new(edit.clone())))];
        let by = edit.by;
        let task = Task { name, kind, params, parent, edits, by, status: "planned", ..Task::default() };
        self.nodes.push(Node { task, inserted: true, ..Node::default() });
        self.nodes.len() - 1
    }

    fn overlaid(mut self) -> (Vec<Task>, Vec<Planned>) {
        let performed = self.in_order_of_work();
        let shown = self.in_order_of_calls();
        let mut number = vec![0; self.nodes.len()];
        shown.iter().enumerate().for_each(|(new, old)| number[*old] = new as u32);
        // What waits in a circle is performed last.
        let mut places = vec![shown.len() as u32; shown.len()];
        (0..).zip(performed).for_each(|(place, old)| places[old] = place);
        let all = shown.into_iter().map(|old| {
            let node = &mut self.nodes[old];
            let mut task = std::mem::take(&mut node.task);
            task.parent = number[task.parent as usize];
            let was = (!node.inserted).then_some(old as u32);
            (task, Planned { place: places[old], moved: node.moved, was })
        });
        all.unzip()
    }

    /// All tasks as they are shown; what is below a task that is skipped is skipped with it.
    fn in_order_of_calls(&mut self) -> Vec<usize> {
        let mut done = Vec::with_capacity(self.nodes.len());
        let owed: Vec<(usize, usize)> = (0..self.nodes.len())
            .flat_map(|at| self.nodes[at].waiting.iter().map(move |new| (at, *new)))
            .filter(|(_, new)| self.nodes[*new].inserted)
            .collect();
        for (at, new) in owed {
            // It stands where the common task has what has to end.
            let common = self.nodes[new].task.parent as usize;
            let side = std::iter::once(at).chain(self.above(at)).take_while(|it| *it != common).last();
            self.nodes[side.unwrap_or(at)].after.push(new);
        }
        let mut todo = vec![(0, false)];
        while let Some((at, skipped)) = todo.pop() {
            done.push(at);
            let node = &mut self.nodes[at];
            if skipped {
                node.task.status = SKIPPED;
            }
            let skipped = node.task.status == SKIPPED;
            for child in self.nodes[at].children.iter().rev() {
                let child_node = &self.nodes[*child];
                todo.extend(child_node.after.iter().rev().map(|new| (*new, false)));
                todo.push((*child, skipped));
                todo.extend(child_node.before.iter().rev().map(|new| (*new, false)));
            }
        }
        done
    }

    /// All tasks as they would be performed. Those that are moved get the time of what they follow.
    fn in_order_of_work(&mut self) -> Vec<usize> {
        enum Work {
            Enter(usize, Option<f64>),
            /// Those that wait for a task, from the time of its end.
            Waiting(usize, Option<f64>),
        }
        let mut done = Vec::with_capacity(self.nodes.len());
        let mut todo = vec![Work::Enter(0, None)];
        while let Some(work) = todo.pop() {
            match work {
                Work::Enter(at, moved) => {
                    done.push(at);
                    self.nodes[at].moved = moved;
                    for child in (0..self.nodes[at].children.len()).rev() {
                        let child = self.nodes[at].children[child];
                        let node = &self.nodes[child];
                        if !node.waits {
                            if !node.waiting.is_empty() {
                                todo.push(Work::Waiting(child, moved));
                            }
                            todo.extend(self.with_inserted(child, moved).map(|(it, at)| Work::Enter(it, at)));
                        }
                    }
                }
                Work::Waiting(at, moved) => {
                    let end = moved.or(self.nodes[at].task.end).unwrap_or(f64::INFINITY);
                    for waiting in self.nodes[at].waiting.clone().into_iter().rev() {
                        todo.push(Work::Waiting(waiting, Some(end)));
                        let all = self.with_inserted(waiting, Some(end));
                        todo.extend(all.map(|(it, at)| Work::Enter(it, at)));
                    }
                }
            }
        }
        done
    }

    /// A task between those that edits put before and after it, with their times, the last first.
    fn with_inserted(&self, at: usize, moved: Option<f64>) -> impl Iterator<Item = (usize, Option<f64>)> {
        let node = &self.nodes[at];
        let start = Some(moved.unwrap_or(node.task.start));
        let end = Some(moved.or(node.task.end).unwrap_or(f64::INFINITY));
        let before = node.before.iter().rev().map(move |it| (*it, start));
        let after = node.after.iter().rev().map(move |it| (*it, end));
        after.chain([(at, moved)]).chain(before)
    }
}

impl Task {
    fn change(&mut self, key: Symbol, value: &Value) {
        match self.params.iter_mut().find(|param| param.0 == key) {
            Some(param) => param.1 = value.clone(),
            None if self.kind == "action" => {
                let at = self.params.partition_point(|param| param.0.as_str() < key.as_str());
                self.params.insert(at, (key, value.clone()));
            }
            None => {}
        }
    }
}

/// Those of some edits whose guards hold for a task.
pub(super) fn holding<'a>(task: &Task, edits: &'a [Value]) -> Vec<&'a Edit> {
    edits.iter().filter_map(as_edit).filter(|edit| holds_for(edit, task)).collect()
}

/// What edits change of a task where it stands: its parameters, and whether it is skipped.
pub(super) fn change(task: &mut Task, edits: &[&Edit]) -> bool {
    let made = task.params.clone();
    for edit in edits {
        if let What::WithParam(key, value) = &edit.what {
            task.change(*key, value);
        }
    }
    if task.params != made {
        task.written.get_or_insert(made);
    }
    let is_skipped = edits.iter().any(|edit| matches!(edit.what, What::Skip(_)));
    if is_skipped {
        task.status = SKIPPED;
    }
    is_skipped
}

/// True if an edit neither moves its task nor puts others beside it.
pub(super) fn stays(edit: &Value) -> bool {
    let moves = |edit: &Edit| names_places(edit) || matches!(edit.what, What::Before(_) | What::After(_));
    !as_edit(edit).is_some_and(moves)
}

/// True if an edit names other places than the one that it stands on.
fn names_places(edit: &Edit) -> bool {
    matches!(edit.what, What::Defer(..) | What::Owe { .. })
}

fn as_edit(value: &Value) -> Option<&Edit> {
    if let Some(Obj::Edit(edit)) = value.obj() { Some(edit) } else { None }
}

/// True if the guard of an edit holds for the call as it was made.
fn holds_for(edit: &Edit, task: &Task) -> bool {
    let made = task.written.as_ref().unwrap_or(&task.params);
    edit.guard.iter().all(|(key, wanted)| made.iter().any(|(name, value)| name == key && value == wanted))
}

/// The calls in the code of an edit, as far as they can be seen.
fn calls(code: &Value) -> Vec<Inserted> {
    let Some((head, args)) = code.as_pair() else { return Vec::new() };
    let Some(name) = head.as_symbol() else { return Vec::new() };
    if name == "seq" {
        // Code that nests deeper than one sequence says too little.
        return args.iter().filter(|it| !is_call_of(it, "seq")).flat_map(calls).collect();
    }
    match args.as_pair().filter(|_| name == "perform").and_then(|(action, _)| constant(action, 0)) {
        Some(action) => {
            let properties: Vec<(Symbol, Value)> = action
                .as_desc()
                .map(|desc| desc.properties().map(|(key, value)| (key, value.clone())).collect())
                .unwrap_or_default();
            let kind = properties.iter().find(|it| it.0 == "type").and_then(|it| it.1.as_symbol());
            vec![(kind.unwrap_or(name), "action", properties)]
        }
        None => vec![(name, "plan", Vec::new())],
    }
}

fn is_call_of(code: &Value, name: &str) -> bool {
    code.as_pair().and_then(|(head, _)| head.as_symbol()).is_some_and(|head| head == name)
}

/// A part of a description in code, without the properties that are computed; nothing if it is computed.
fn constant(code: &Value, depth: usize) -> Option<Value> {
    const DEEP: usize = 20;
    match code {
        Value::Imm(Imm::Var(_)) => None,
        Value::Imm(Imm::Symbol(name)) if name.starts_with('?') => None,
        Value::Imm(_) => Some(code.clone()),
        Value::Obj(_) if code.as_str().is_some() || code.as_desc().is_some() => Some(code.clone()),
        _ if depth > DEEP || !(is_call_of(code, "an") || is_call_of(code, "a")) => None,
        _ => {
            let mut parts = code.iter().skip(1);
            let kind = parts.next()?.as_symbol()?;
            let property = |part: &Value| {
                let mut words = part.iter();
                let (key, value) = (words.next()?.as_symbol()?, words.next()?);
                Some((key, constant(value, depth + 1)?)).filter(|_| words.next().is_none())
            };
            Some(Value::desc(crate::desc::Desc::new(kind, parts.filter_map(property).collect())))
        }
    }
}
