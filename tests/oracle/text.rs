//! One text for both kinds of trees: a line for each record, in the order of the slots.
//!
//! ```text
//! main / fetching :call 2 #1 plan succeeded args (milk) value 3 0–1000000
//! ```
//! Trees among the values follow, each under its number.

use std::rc::Rc;

use vm::failure::name_tasks;
use vm::path::Path;
use vm::tree::{NodeKind, ROOT, SlotId, Status, Why};
use vm::value::{Obj, Value};

use super::{Tree, Trees};

/// What a line says.
struct Line<'a> {
    path: Path,
    attempt: usize,
    kind: NodeKind,
    status: Status,
    why: Why,
    args: &'a [Value],
    written: Option<&'a [Value]>,
    grounded: Option<&'a Value>,
    value: &'a Value,
    notes: &'a [String],
    performed_in: Option<Path>,
    start: u64,
    end: u64,
}

/// Values share parts: what they write must end.
const MOST_PARTS: usize = 2000;

/// A text that grows, and the trees that it has met.
#[derive(Default)]
struct Text {
    out: String,
    met: Vec<Rc<vm::tree::Tree>>,
    /// How many parts of values the line has.
    parts: usize,
}

/// The text of a tree of the oracle; `trees` has those that it made as values.
#[must_use]
pub fn of_oracle(tree: &Tree, trees: &Trees) -> String {
    let mut text = Text::default();
    text.oracle_tree(tree);
    text.rest(|text, met| match trees.iter().find(|(mirror, _)| Rc::ptr_eq(mirror, met)) {
        Some((_, tree)) => text.oracle_tree(tree),
        None => text.out.push_str("not a tree of the oracle\n"),
    })
}

/// The text of a tree of the machine.
#[must_use]
pub fn of_machine(tree: &vm::tree::Tree) -> String {
    let mut text = Text::default();
    text.machine_tree(tree);
    text.rest(|text, met| text.machine_tree(met))
}

/// The text of a value, failures with their causes.
#[must_use]
pub fn of_outcome(outcome: &Result<Value, Value>) -> String {
    let mut text = Text::default();
    match outcome {
        Ok(value) => format!("value {}", text.value(value)),
        Err(failure) => text.failure(failure, 0),
    }
}

/// Gives all failures in a value the paths of their tasks. `tree` is that of their run.
pub fn name_all(tree: &vm::tree::Tree, value: &Value) {
    name_tasks(tree, value);
    let mut todo = vec![value.clone()];
    // Values share parts: this must end.
    for _ in 0..MOST_PARTS {
        let Some(value) = todo.pop() else { return };
        name_tasks(tree, &value);
        todo.extend(value.to_vec().unwrap_or_default());
        if let Some(failure) = value.as_failure() {
            todo.extend(failure.fields.iter().map(|(_, value)| value.clone()));
            todo.extend(failure.cause.iter().chain(&failure.also).cloned());
        }
    }
}

impl Text {
    fn rest(mut self, mut write: impl FnMut(&mut Text, &Rc<vm::tree::Tree>)) -> String {
        let mut next = 0;
        while let Some(met) = self.met.get(next).cloned() {
            next += 1;
            self.out.push_str(&format!("tree {next}:\n"));
            write(&mut self, &met);
        }
        self.out
    }

    fn oracle_tree(&mut self, tree: &Tree) {
        let mut todo = vec![0];
        while let Some(slot) = todo.pop() {
            let it = &tree.slots[slot];
            for number in &it.records {
                let record = &tree.records[*number];
                self.line(&Line {
                    path: tree.path(slot),
                    attempt: record.attempt,
                    kind: record.kind,
                    status: record.status,
                    why: record.why,
                    args: &record.args,
                    written: record.written.as_deref(),
                    grounded: record.grounded.as_ref(),
                    value: &record.value,
                    notes: &record.notes,
                    performed_in: record.performed_in.map(|slot| tree.path(slot)),
                    start: record.start,
                    end: record.end,
                });
            }
            todo.extend(it.children.iter().rev());
        }
    }

    fn machine_tree(&mut self, tree: &vm::tree::Tree) {
        let mut records: Vec<(SlotId, vm::tree::RecId)> =
            tree.records().map(|rec| (tree.record(rec).slot, rec)).collect();
        records.sort();
        let mut todo = vec![ROOT];
        while let Some(slot) = todo.pop() {
            let first = records.partition_point(|(other, _)| *other < slot);
            for (_, rec) in records[first..].iter().take_while(|(other, _)| *other == slot) {
                let record = tree.record(*rec);
                tree.args(*rec).iter().chain([&record.value]).for_each(|value| name_all(tree, value));
                let extra = tree.extra(*rec).cloned().unwrap_or_default();
                self.line(&Line {
                    path: Path::of(tree, slot),
                    attempt: record.attempt as usize,
                    kind: record.kind,
                    status: record.status,
                    why: record.why,
                    args: &tree.args(*rec),
                    written: extra.written.as_deref(),
                    grounded: extra.grounded.as_ref(),
                    value: &record.value,
                    notes: &extra.notes,
                    performed_in: extra.performed_in.map(|slot| Path::of(tree, slot)),
                    start: record.start,
                    end: record.end,
                });
            }
            todo.extend(tree.children(slot).into_iter().rev());
        }
    }

    fn line(&mut self, line: &Line<'_>) {
        let mut out =
            format!("{} #{} {} {}", line.path.show(), line.attempt, line.kind.word(), line.status.word());
        if line.why != Why::Nothing {
            out += &format!(" because {}", line.why.word());
        }
        out += &format!(" args {}", self.values(line.args));
        if let Some(written) = line.written {
            out += &format!(" written {}", self.values(written));
        }
        if let Some(grounded) = line.grounded {
            out += &format!(" grounded {}", self.value(grounded));
        }
        out += " ";
        out += &match line.status {
            Status::Failed => self.failure(line.value, 0),
            _ => format!("value {}", self.value(line.value)),
        };
        for note in line.notes {
            // The reason is for people.
            out += &format!(" note `{}`", note.split(':').next().unwrap_or_default());
        }
        if let Some(path) = &line.performed_in {
            out += &format!(" performed in {}", path.show());
        }
        out += &format!(" {}–{}\n", line.start, line.end);
        self.out += &out;
        self.parts = 0;
    }

    fn values(&mut self, values: &[Value]) -> String {
        let values: Vec<String> = values.iter().map(|value| self.value(value)).collect();
        format!("({})", values.join(" "))
    }

    /// Readable text, with the numbers of trees; names of functions are left out, for the oracle
    /// numbers its own.
    fn value(&mut self, value: &Value) -> String {
        self.parts += 1;
        match value.obj() {
            _ if self.parts > MOST_PARTS => "…".into(),
            Some(Obj::Tree(tree)) => {
                let known = self.met.iter().position(|met| Rc::ptr_eq(met, tree));
                let number = known.unwrap_or_else(|| {
                    self.met.push(tree.clone());
                    self.met.len() - 1
                });
                format!("tree {}", number + 1)
            }
            Some(Obj::Pair(..)) => {
                let mut cells = value.iter();
                let mut parts: Vec<String> =
                    cells.by_ref().take(MOST_PARTS).map(|part| self.value(part)).collect();
                if !cells.rest.is_list() {
                    parts.push(format!(". {}", self.value(cells.rest)));
                }
                format!("({})", parts.join(" "))
            }
            Some(Obj::Failure(_)) => self.failure(value, 0),
            // The machine uses numbers again.
            Some(Obj::Task(_)) => "#<task>".into(),
            _ => vm::print::write(value),
        }
    }

    /// Type, fields, task, causes, and what failed beside it. Messages are for people: those of
    /// the machine's own types are left out.
    fn failure(&mut self, value: &Value, depth: usize) -> String {
        const MOST_DEPTH: usize = 20;
        self.parts += 1;
        let short = depth < MOST_DEPTH && self.parts < MOST_PARTS;
        let Some(failure) = value.as_failure().filter(|_| short) else { return "…".into() };
        let builtin = (failure.kind.0 as usize) < vm::Builtin::ALL.len();
        let mut out = format!("{{{}", failure.name);
        for (key, value) in &failure.fields {
            if !builtin || *key != "message" {
                out += &format!(" :{key} {}", self.value(value));
            }
        }
        if let Some(task) = failure.path() {
            out += &format!(" in `{task}`");
        }
        if let Some(cause) = &failure.cause {
            out += &format!(" cause {}", self.failure(cause, depth + 1));
        }
        for also in &failure.also {
            out += &format!(" also {}", self.failure(also, depth + 1));
        }
        out + "}"
    }
}
