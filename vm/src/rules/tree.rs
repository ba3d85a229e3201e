//! Predicates over task trees.
//!
//! Each says which tasks can answer a call, as a sorted list, and whether one of them does, binding the
//! other arguments. So each argument that is given is used to look tasks up, and all predicates give
//! tasks in the order of the tree.

use std::rc::Rc;

use crate::native::Raise;
use crate::value::{Imm, Obj, Symbol, Value};

use super::native::{Alternatives, Call, Found, NativeRule};
use super::store::Cell;
use super::view::{Attr, Column, List, TreeView};

/// The table of all of them.
pub const TABLE: &[(&str, u8, NativeRule)] = &[
    ("task", 1, |call| tasks(call, 0, |view, _| List::new(view.all()), |_, _| Ok(true))),
    ("task-name", 2, |call| column(call, Attr::Name, 1)),
    ("task-type", 2, |call| column(call, Attr::Param(Symbol::from("type")), 1)),
    ("task-param", 3, param),
    ("task-param-written", 3, |call| properties(call, TreeView::written_params)),
    ("task-kind", 2, |call| column(call, Attr::Kind, 1)),
    ("task-status", 2, |call| column(call, Attr::Status, 1)),
    ("task-value", 2, |call| functional(call, |view, task| Some(view.value(task)))),
    ("task-failure", 2, |call| functional(call, TreeView::failure)),
    ("task-grounded", 2, |call| functional(call, TreeView::grounded)),
    ("task-start", 2, |call| functional(call, |view, task| view.started(task).map(Value::float))),
    ("task-end", 2, |call| functional(call, |view, task| view.end(task).map(Value::float))),
    ("task-path", 2, path),
    ("task-robot", 2, |call| functional(call, |_, _| None)),
    ("task-method", 2, |call| functional(call, |_, _| None)),
    ("task-attempt", 3, |call| {
        several(call, |view, task| {
            let numbered = (1..).zip(view.attempts(task));
            numbered.map(|(n, attempt)| (Value::int(n), attempt.value())).collect()
        })
    }),
    ("task-edit", 2, |call| {
        several(call, |view, task| view.edits(task).iter().map(|edit| (edit.clone(), Value::NIL)).collect())
    }),
    ("task-order", 2, |call| functional(call, |view, task| Some(Value::int(view.order(task).into())))),
    ("task-by", 2, |call| {
        functional(call, |view, task| view.made_by(task).map(|name| Value::Imm(Imm::Symbol(name))))
    }),
    ("edited-by", 2, |call| {
        several(call, |view, task| {
            view.edited_by(task).into_iter().map(|name| (Value::Imm(Imm::Symbol(name)), Value::NIL)).collect()
        })
    }),
    ("subtask", 2, subtask),
    ("subtask+", 2, subtasks),
    ("subtask-with", 4, |call| with(call, true)),
    ("subtask+-with", 4, |call| with(call, false)),
    ("before", 2, before),
    ("edited", 1, |call| {
        tasks(call, 0, |view, _| List::new(view.all()), |call, task| Ok(call.view.tree.is_edited(task)))
    }),
];

/// What the predicates of this name need bound to have one answer at the most: the planner of clauses
/// moves such goals forward. Positions of arguments.
#[must_use]
pub fn determined_by(name: &str) -> Option<&'static [usize]> {
    Some(match name {
        "task" | "edited" | "task-name" | "task-type" | "task-kind" | "task-status" | "task-value"
        | "task-failure" | "task-grounded" | "task-start" | "task-end" | "task-path" | "task-order"
        | "task-by" => &[0],
        "task-param" | "task-param-written" => &[0, 1],
        "subtask" => &[1],
        "subtask+" | "before" => &[0, 1],
        "subtask-with" | "subtask+-with" => &[0, 1, 2],
        _ => return None,
    })
}

/// What a predicate says of a task.
type Of<T> = fn(&TreeView, u32) -> T;

fn symbol_arg(call: &Call<'_>, n: usize) -> Option<Symbol> {
    match call.arg(n) {
        Cell::Imm(Imm::Symbol(name) | Imm::Keyword(name)) => Some(name),
        _ => None,
    }
}

/// What stands where a task should.
pub(super) enum TaskArg {
    Free,
    Task(u32),
    /// Something else, or a path to nothing.
    None,
}

pub(super) fn task_arg(call: &Call<'_>, n: usize) -> TaskArg {
    match call.arg(n) {
        Cell::Ref(_) => TaskArg::Free,
        Cell::Task(task) => TaskArg::Task(task),
        Cell::Imm(Imm::Symbol(name)) if name == "top-level" => TaskArg::Task(0),
        Cell::Obj(at) => match call.store.object(at).obj() {
            Some(Obj::Path(path)) => call.view.tree.at(path).map_or(TaskArg::None, TaskArg::Task),
            _ => TaskArg::None,
        },
        _ => TaskArg::None,
    }
}

type Holds = fn(&mut Call<'_>, u32) -> Result<bool, Raise>;

/// Tasks for argument `n`: the one that is given, or those of `which`, as far as they hold.
fn tasks(
    call: &mut Call<'_>,
    n: usize,
    which: impl FnOnce(&TreeView, &Call<'_>) -> List,
    holds: Holds,
) -> Result<Found, Raise> {
    match task_arg(call, n) {
        TaskArg::None => Ok(Found::No),
        TaskArg::Task(task) => {
            let holds = holds(call, task)?;
            Call::test(holds)
        }
        TaskArg::Free => {
            let list = which(&call.view.tree, call);
            Ok(several_tasks(n, list, holds))
        }
    }
}

fn several_tasks(n: usize, list: List, holds: Holds) -> Found {
    if list.is_empty() { Found::No } else { Found::Many(Box::new(Tasks { n, list, holds })) }
}

/// Tasks of a list that hold.
struct Tasks {
    n: usize,
    list: List,
    holds: Holds,
}

impl Alternatives for Tasks {
    fn next(&mut self, call: &mut Call<'_>) -> Result<Option<bool>, Raise> {
        while let Some(task) = self.list.next() {
            let mark = call.store.mark();
            if call.unify(self.n, Cell::Task(task))? && (self.holds)(call, task)? {
                return Ok(Some(!self.list.is_empty()));
            }
            call.store.back_to(mark);
        }
        Ok(None)
    }
}

/// Tasks of a range, for argument `n`.
struct Range {
    n: usize,
    next: u32,
    end: u32,
    /// Only those directly below this task.
    children: bool,
}

impl Alternatives for Range {
    fn next(&mut self, call: &mut Call<'_>) -> Result<Option<bool>, Raise> {
        if self.next >= self.end {
            return Ok(None);
        }
        let task = self.next;
        self.next = if self.children { call.view.tree.below(task).end } else { task + 1 };
        call.unify(self.n, Cell::Task(task))?;
        Ok(Some(self.next < self.end))
    }
}

/// `(task-… ?task value)` where a task has one value at the most.
fn functional(call: &mut Call<'_>, of: Of<Option<Value>>) -> Result<Found, Raise> {
    match task_arg(call, 0) {
        TaskArg::None => Ok(Found::No),
        TaskArg::Task(task) => match of(&call.view.tree, task) {
            Some(value) => {
                let holds = call.unify_value(1, &value)?;
                Call::test(holds)
            }
            None => Ok(Found::No),
        },
        TaskArg::Free => Ok(Found::Many(Box::new(Functional { next: 0, of }))),
    }
}

struct Functional {
    next: u32,
    of: Of<Option<Value>>,
}

impl Alternatives for Functional {
    fn next(&mut self, call: &mut Call<'_>) -> Result<Option<bool>, Raise> {
        let tree = &call.view.tree;
        let tasks = tree.len() as u32;
        while self.next < tasks {
            let task = self.next;
            self.next += 1;
            let Some(value) = (self.of)(tree, task) else { continue };
            let mark = call.store.mark();
            if call.unify_value(1, &value)? && call.unify(0, Cell::Task(task))? {
                return Ok(Some(self.next < tasks));
            }
            call.store.back_to(mark);
        }
        Ok(None)
    }
}

/// `(task-… ?task a b)` where a task may have several pairs; without `b` for predicates of two arguments.
fn several(call: &mut Call<'_>, of: Of<Vec<(Value, Value)>>) -> Result<Found, Raise> {
    let range = match task_arg(call, 0) {
        TaskArg::None => return Ok(Found::No),
        TaskArg::Task(task) => task..task + 1,
        TaskArg::Free => 0..call.view.tree.len() as u32,
    };
    Ok(Found::Many(Box::new(Several { range, rows: Vec::new().into_iter(), task: 0, of })))
}

struct Several {
    range: std::ops::Range<u32>,
    rows: std::vec::IntoIter<(Value, Value)>,
    task: u32,
    of: Of<Vec<(Value, Value)>>,
}

impl Alternatives for Several {
    fn next(&mut self, call: &mut Call<'_>) -> Result<Option<bool>, Raise> {
        loop {
            for (a, b) in self.rows.by_ref() {
                let mark = call.store.mark();
                let pair = matches!(call.arg(2), Cell::Imm(Imm::Nil)) || call.unify_value(2, &b)?;
                if pair && call.unify_value(1, &a)? && bind_task(call, self.task)? {
                    return Ok(Some(true));
                }
                call.store.back_to(mark);
            }
            let Some(task) = self.range.next() else { return Ok(None) };
            self.task = task;
            self.rows = (self.of)(&call.view.tree, task).into_iter();
        }
    }
}

/// The first argument is this task: it has been given, perhaps as a path, or becomes it.
fn bind_task(call: &mut Call<'_>, task: u32) -> Result<bool, Raise> {
    match task_arg(call, 0) {
        TaskArg::Free => call.unify(0, Cell::Task(task)),
        TaskArg::Task(given) => Ok(given == task),
        TaskArg::None => Ok(false),
    }
}

/// The tasks of which argument `n` may be the value.
fn with_value(call: &Call<'_>, column: &Column, n: usize) -> List {
    let number = match call.arg(n) {
        Cell::Imm(imm) => call.view.tree.number(&Value::Imm(imm)),
        Cell::Obj(at) => call.view.tree.number(call.store.object(at)),
        _ => return column.having(),
    };
    column.with(number)
}

/// What argument `n` says that a task has.
fn column(call: &mut Call<'_>, attr: Attr, n: usize) -> Result<Found, Raise> {
    match task_arg(call, 0) {
        TaskArg::None => Ok(Found::No),
        TaskArg::Task(task) => match call.view.tree.attr(task, attr) {
            Some(value) => {
                let holds = call.unify_value(n, &value)?;
                Call::test(holds)
            }
            None => Ok(Found::No),
        },
        TaskArg::Free => {
            let column = call.view.tree.column(attr);
            let list = with_value(call, &column, n);
            Ok(match list.is_empty() {
                true => Found::No,
                false => Found::Many(Box::new(InColumn { column, n, list })),
            })
        }
    }
}

struct InColumn {
    column: Rc<Column>,
    n: usize,
    list: List,
}

impl Alternatives for InColumn {
    fn next(&mut self, call: &mut Call<'_>) -> Result<Option<bool>, Raise> {
        while let Some(task) = self.list.next() {
            let value = call.view.tree.value_of(self.column.of[task as usize]);
            let mark = call.store.mark();
            if call.unify(0, Cell::Task(task))? && call.unify_value(self.n, &value)? {
                return Ok(Some(!self.list.is_empty()));
            }
            call.store.back_to(mark);
        }
        Ok(None)
    }
}

/// `(task-param ?task key ?value)`
fn param(call: &mut Call<'_>) -> Result<Found, Raise> {
    match call.arg(1) {
        Cell::Imm(Imm::Symbol(key) | Imm::Keyword(key)) => column(call, Attr::Param(key), 2),
        Cell::Ref(_) => properties(call, TreeView::params),
        _ => Ok(Found::No),
    }
}

/// All properties of a task, or of all.
fn properties(call: &mut Call<'_>, of: Of<Vec<(Symbol, Value)>>) -> Result<Found, Raise> {
    let range = match task_arg(call, 0) {
        TaskArg::None => return Ok(Found::No),
        TaskArg::Task(task) => task..task + 1,
        TaskArg::Free => 0..call.view.tree.len() as u32,
    };
    Ok(Found::Many(Box::new(Properties { range, task: 0, rows: Vec::new().into_iter(), of })))
}

struct Properties {
    range: std::ops::Range<u32>,
    task: u32,
    rows: std::vec::IntoIter<(Symbol, Value)>,
    of: Of<Vec<(Symbol, Value)>>,
}

impl Alternatives for Properties {
    fn next(&mut self, call: &mut Call<'_>) -> Result<Option<bool>, Raise> {
        loop {
            for (key, value) in self.rows.by_ref() {
                let mark = call.store.mark();
                let key = Cell::Imm(Imm::Symbol(key));
                if call.unify(1, key)? && call.unify_value(2, &value)? && bind_task(call, self.task)? {
                    return Ok(Some(true));
                }
                call.store.back_to(mark);
            }
            let Some(task) = self.range.next() else { return Ok(None) };
            self.task = task;
            self.rows = (self.of)(&call.view.tree, task).into_iter();
        }
    }
}

/// `(task-path ?task ?path)`
fn path(call: &mut Call<'_>) -> Result<Found, Raise> {
    if let (TaskArg::Free, Cell::Obj(at)) = (task_arg(call, 0), call.arg(1)) {
        let task = match call.store.object(at).obj() {
            Some(Obj::Path(path)) => call.view.tree.at(path),
            _ => None,
        };
        return match task {
            Some(task) => {
                let holds = call.unify(0, Cell::Task(task))?;
                Call::test(holds)
            }
            None => Ok(Found::No),
        };
    }
    tasks(
        call,
        0,
        |view, _| List::new(view.all()),
        |call, task| {
            let path = call.view.tree.path_value(task);
            call.unify_value(1, &path)
        },
    )
}

/// `(subtask ?above ?task)`: directly below.
fn subtask(call: &mut Call<'_>) -> Result<Found, Raise> {
    match (task_arg(call, 0), task_arg(call, 1)) {
        (TaskArg::None, _) | (_, TaskArg::None) | (_, TaskArg::Task(0)) => Ok(Found::No),
        (TaskArg::Task(above), TaskArg::Task(task)) => Call::test(call.view.tree.parent(task) == above),
        (TaskArg::Free, TaskArg::Task(task)) => {
            let parent = call.view.tree.parent(task);
            let holds = call.unify(0, Cell::Task(parent))?;
            Call::test(holds)
        }
        (TaskArg::Task(above), TaskArg::Free) => {
            let below = call.view.tree.below(above);
            Ok(Found::Many(Box::new(Range { n: 1, next: below.start, end: below.end, children: true })))
        }
        (TaskArg::Free, TaskArg::Free) => {
            Ok(several_tasks(1, List::new(call.view.tree.all()), |call, task| {
                // The root is below nothing.
                if task == 0 {
                    return Ok(false);
                }
                let parent = call.view.tree.parent(task);
                call.unify(0, Cell::Task(parent))
            }))
        }
    }
}

/// `(subtask+ ?above ?task)`: somewhere below.
fn subtasks(call: &mut Call<'_>) -> Result<Found, Raise> {
    match (task_arg(call, 0), task_arg(call, 1)) {
        (TaskArg::None, _) | (_, TaskArg::None) => Ok(Found::No),
        (TaskArg::Task(above), TaskArg::Task(task)) => Call::test(call.view.tree.is_above(above, task)),
        (TaskArg::Task(above), TaskArg::Free) => {
            let below = call.view.tree.below(above);
            Ok(Found::Many(Box::new(Range { n: 1, next: below.start, end: below.end, children: false })))
        }
        (TaskArg::Free, TaskArg::Task(task)) => {
            let mut above = Vec::new();
            let mut at = task;
            while at != 0 {
                at = call.view.tree.parent(at);
                above.push(at);
            }
            above.reverse();
            Ok(several_tasks(0, List::new(Rc::new(above)), |_, _| Ok(true)))
        }
        (TaskArg::Free, TaskArg::Free) => Ok(pairs(|view, above, task| view.is_above(above, task))),
    }
}

/// `(subtask-with ?above ?task key ?value)`: a task directly below, or somewhere below, with this value.
fn with(call: &mut Call<'_>, direct: bool) -> Result<Found, Raise> {
    let Some(key) = symbol_arg(call, 2) else { return Ok(Found::No) };
    let tree = call.view.tree.clone();
    let column = tree.column(Attr::Param(key));
    let list = with_value(call, &column, 3);
    let range = match (task_arg(call, 0), task_arg(call, 1)) {
        (TaskArg::None, _) | (_, TaskArg::None) => return Ok(Found::No),
        (_, TaskArg::Task(task)) => task..task + 1,
        (TaskArg::Task(above), TaskArg::Free) => tree.below(above),
        (TaskArg::Free, TaskArg::Free) => 0..tree.len() as u32,
    };
    let list = list.within(&range);
    Ok(match list.is_empty() {
        false => Found::Many(Box::new(With { list, column, direct, above: None })),
        true => Found::No,
    })
}

struct With {
    list: List,
    column: Rc<Column>,
    direct: bool,
    /// The next task above the current one, where the call does not say which.
    above: Option<u32>,
}

impl With {
    /// The tasks above one that the call may mean, the nearest first.
    fn is_below(&mut self, call: &mut Call<'_>, task: u32) -> Result<bool, Raise> {
        let parent = call.view.tree.parent(task);
        match task_arg(call, 0) {
            TaskArg::Task(above) if self.direct => Ok(task != 0 && parent == above),
            TaskArg::Task(above) => Ok(call.view.tree.is_above(above, task)),
            TaskArg::None => Ok(false),
            TaskArg::Free if task == 0 => Ok(false),
            TaskArg::Free => {
                let above = self.above.take().unwrap_or(parent);
                if !self.direct && above != 0 {
                    self.above = Some(call.view.tree.parent(above));
                    self.list.again();
                }
                call.unify(0, Cell::Task(above))
            }
        }
    }
}

impl Alternatives for With {
    fn next(&mut self, call: &mut Call<'_>) -> Result<Option<bool>, Raise> {
        while let Some(task) = self.list.next() {
            let mark = call.store.mark();
            let value = call.view.tree.value_of(self.column.of[task as usize]);
            let is_it = match task_arg(call, 1) {
                TaskArg::Free => call.unify(1, Cell::Task(task))?,
                TaskArg::Task(given) => given == task,
                TaskArg::None => false,
            };
            if is_it && call.unify_value(3, &value)? && self.is_below(call, task)? {
                return Ok(Some(!self.list.is_empty()));
            }
            call.store.back_to(mark);
        }
        Ok(None)
    }
}

/// `(before a b)`: a ended before b started.
fn before(call: &mut Call<'_>) -> Result<Found, Raise> {
    match (task_arg(call, 0), task_arg(call, 1)) {
        (TaskArg::None, _) | (_, TaskArg::None) => Ok(Found::No),
        (TaskArg::Task(a), TaskArg::Task(b)) => Call::test(call.view.tree.is_before(a, b)),
        (TaskArg::Task(_), TaskArg::Free) => {
            Ok(several_tasks(1, List::new(call.view.tree.all()), |call, b| {
                let TaskArg::Task(a) = task_arg(call, 0) else { return Ok(false) };
                Ok(call.view.tree.is_before(a, b))
            }))
        }
        (TaskArg::Free, TaskArg::Task(_)) => {
            Ok(several_tasks(0, List::new(call.view.tree.all()), |call, a| {
                let TaskArg::Task(b) = task_arg(call, 1) else { return Ok(false) };
                Ok(call.view.tree.is_before(a, b))
            }))
        }
        (TaskArg::Free, TaskArg::Free) => Ok(pairs(TreeView::is_before)),
    }
}

/// All pairs of tasks that are related.
fn pairs(related: fn(&TreeView, u32, u32) -> bool) -> Found {
    Found::Many(Box::new(Pairs { a: 0, b: 0, related }))
}

struct Pairs {
    a: u32,
    b: u32,
    related: fn(&TreeView, u32, u32) -> bool,
}

impl Alternatives for Pairs {
    fn next(&mut self, call: &mut Call<'_>) -> Result<Option<bool>, Raise> {
        let n = call.view.tree.len() as u32;
        while self.a < n {
            let (a, b) = (self.a, self.b);
            (self.a, self.b) = if b + 1 < n { (a, b + 1) } else { (a + 1, 0) };
            let mark = call.store.mark();
            if (self.related)(&call.view.tree, a, b)
                && call.unify(0, Cell::Task(a))?
                && call.unify(1, Cell::Task(b))?
            {
                return Ok(Some(self.a < n));
            }
            call.store.back_to(mark);
        }
        Ok(None)
    }
}
