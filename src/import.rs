//! Task trees that `pleach run --json` wrote, as rules see them.
//!
//! A file may come from anywhere, so nothing in it is believed: what does not fit is an error that says
//! where it stands, as in `tree[3].status`.

use serde_json::Value as Json;
use vm::failure::{Builtin, Failure, FailureTypes, Task as Raiser};
use vm::rules::view::{Attempt, Task, TreeView};
use vm::tree::{NodeKind, Status};
use vm::value::{Obj, Symbol, Value};

use crate::read::Reader;

/// The tree in a JSON text: the object that `pleach run --json` prints, or the list in its `tree`.
///
/// # Errors
/// A sentence that says what is wrong with it, and where.
pub fn tree(text: &str, failures: &FailureTypes) -> Result<TreeView, String> {
    let json: Json = serde_json::from_str(text).map_err(|error| format!("it is no JSON: {error}"))?;
    tree_of(&json, failures)
}

/// The same for JSON that has been read.
///
/// # Errors
/// A sentence that says what is wrong with it, and where.
pub fn tree_of(json: &Json, failures: &FailureTypes) -> Result<TreeView, String> {
    let (nodes, name) = match json {
        Json::Array(nodes) => (nodes, ""),
        Json::Object(result) => match result.get("tree") {
            Some(Json::Array(nodes)) => (nodes, "tree"),
            Some(_) => return Err("`tree` is no list of tasks".into()),
            None if result.contains_key("outcome") => {
                return Err(
                    "there is no `tree` in it: was it written with --quiet, or by a run that had errors?"
                        .into(),
                );
            }
            None => return Err("there is no `tree` in it".into()),
        },
        _ => return Err("it is neither a list of tasks nor an object with one in `tree`".into()),
    };
    let reader = Reader::default();
    let mut tasks = Vec::with_capacity(nodes.len());
    let mut open: Vec<u32> = Vec::new();
    for (number, node) in nodes.iter().enumerate() {
        let at = format!("{name}[{number}]");
        let it = Node { json: node, at: &at, reader: &reader, failures };
        let mut task = it.task()?;
        task.parent = it.parent(number, &mut open)?;
        tasks.push(task);
    }
    match tasks.is_empty() {
        true => Err("the list of tasks is empty: a tree has a root".into()),
        false => Ok(TreeView::new(tasks)),
    }
}

/// A part of the text, and where it stands.
#[derive(Clone, Copy)]
struct Node<'a> {
    json: &'a Json,
    at: &'a str,
    reader: &'a Reader,
    failures: &'a FailureTypes,
}

impl<'a> Node<'a> {
    fn wrong<T>(&self, key: &str, problem: &str) -> Result<T, String> {
        let dot = if key.is_empty() { "" } else { "." };
        Err(format!("{}{dot}{key} {problem}", self.at))
    }

    fn get(&self, key: &str) -> Option<&'a Json> {
        self.json.get(key).filter(|json| !json.is_null())
    }

    fn text(&self, key: &str) -> Result<&'a str, String> {
        match self.get(key) {
            Some(Json::String(text)) => Ok(text),
            Some(_) => self.wrong(key, "is no text"),
            None => self.wrong(key, "is missing"),
        }
    }

    /// Seconds; 0 if they are missing.
    fn seconds(&self, key: &str) -> Result<f64, String> {
        match self.get(key) {
            None => Ok(0.0),
            Some(json) => match json.as_f64() {
                Some(seconds) => Ok(seconds),
                None => self.wrong(key, "is no number"),
            },
        }
    }

    /// One of some words.
    fn word<T: Copy>(&self, key: &str, all: &[T], word: fn(T) -> &'static str) -> Result<T, String> {
        let text = self.text(key)?;
        match all.iter().find(|it| word(**it) == text) {
            Some(found) => Ok(*found),
            None => {
                let words: Vec<&str> = all.iter().map(|it| word(*it)).collect();
                self.wrong(key, &format!("is none of {}", words.join(", ")))
            }
        }
    }

    fn status(&self) -> Result<Status, String> {
        self.word("status", Status::ALL, Status::word)
    }

    /// A value; nil if it is missing.
    fn value(&self, key: &str) -> Result<Value, String> {
        match self.get(key) {
            None => Ok(Value::NIL),
            Some(_) => Ok(self.reader.value(self.text(key)?)),
        }
    }

    /// Values by their names.
    fn params(&self, key: &str) -> Result<Vec<(Symbol, Value)>, String> {
        match self.get(key) {
            None => Ok(Vec::new()),
            Some(Json::Object(params)) => params
                .iter()
                .map(|(name, json)| match json {
                    Json::String(text) => Ok((Symbol::from(name), self.reader.value(text))),
                    _ => self.wrong(key, &format!("has no text for `{}`", vm::show::safe(name))),
                })
                .collect(),
            Some(_) => self.wrong(key, "is no object"),
        }
    }

    /// The parts of a list, each with its place; none if it is missing.
    fn each<T>(
        &self,
        key: &str,
        mut of: impl FnMut(Node<'_>) -> Result<T, String>,
    ) -> Result<Vec<T>, String> {
        match self.get(key) {
            None => Ok(Vec::new()),
            Some(Json::Array(items)) => {
                let items = items.iter().enumerate();
                let part =
                    |(number, json)| of(Node { json, at: &format!("{}.{key}[{number}]", self.at), ..*self });
                items.map(part).collect()
            }
            Some(_) => self.wrong(key, "is no list"),
        }
    }

    /// The number of the task above. `open` are the task before this one and those above it.
    fn parent(&self, number: usize, open: &mut Vec<u32>) -> Result<u32, String> {
        let parent = match (self.get("parent"), number) {
            (None, 0) => 0,
            (Some(_), 0) => return self.wrong("parent", "is given, but the first task is the root"),
            (None, _) => return self.wrong("parent", "is missing: only the first task has none"),
            (Some(json), _) => {
                let parent = json.as_u64().and_then(|it| u32::try_from(it).ok());
                let Some(parent) = parent else { return self.wrong("parent", "is no position in the list") };
                let Some(level) = open.iter().rposition(|it| *it == parent) else {
                    let problem = "is neither the task before it nor one above that: each task comes after its \
                        parent and all that is below its earlier siblings";
                    return self.wrong("parent", problem);
                };
                open.truncate(level + 1);
                parent
            }
        };
        open.push(number as u32);
        Ok(parent)
    }

    fn task(&self) -> Result<Task, String> {
        if !self.json.is_object() {
            return self.wrong("", "is no object");
        }
        let kind = self.word("kind", NodeKind::ALL, NodeKind::word)?;
        let last = self.attempt()?;
        let failed = self.get("failure").is_some();
        let attempts = self.each("attempts", |it| it.attempt())?;
        Ok(Task {
            by: None,
            // Who reads the list knows it.
            parent: 0,
            name: Symbol::from(self.text("name")?),
            kind: kind.word(),
            status: self.status()?.word(),
            params: properties(kind, self.params("params")?),
            written: match self.get("written-params") {
                Some(_) => Some(properties(kind, self.params("written-params")?)),
                None => None,
            },
            grounded: self.get("grounded").map(|_| self.value("grounded")).transpose()?,
            value: if failed { Value::NIL } else { last.value.clone() },
            failure: failed.then(|| last.value.clone()),
            start: last.start,
            end: last.end,
            attempts: if attempts.is_empty() { vec![last] } else { attempts },
            edits: self.each("edits", |it| it.edit())?,
            pending: self.each("pending", |it| it.edit())?,
        })
    }

    /// What is said of a run of a task: of the last one in the task itself.
    fn attempt(&self) -> Result<Attempt, String> {
        let status = self.status()?;
        let value = match self.get("failure") {
            // That of an evaporated task is the failure of its clean-up.
            Some(json) => Node { json, at: &format!("{}.failure", self.at), ..*self }.as_failure(0)?,
            None if status == Status::Failed => return self.wrong("failure", "is missing"),
            None => self.value("value")?,
        };
        let end = match status.is_final() {
            true => Some(self.seconds("end")?),
            false => None,
        };
        Ok(Attempt { status: status.word(), value, start: self.seconds("start")?, end })
    }

    fn edit(&self) -> Result<Value, String> {
        let value = self.json.as_str().map(|text| self.reader.value(text));
        match value.filter(|value| matches!(value.obj(), Some(Obj::Edit(_)))) {
            Some(edit) => Ok(edit),
            None => self.wrong("", "is no edit"),
        }
    }

    fn as_failure(&self, depth: usize) -> Result<Value, String> {
        const DEPTH: usize = 20;
        if self.json.is_null() || depth > DEPTH {
            return Ok(Value::NIL);
        }
        let name = Symbol::from(self.text("type")?);
        let kind = self.failures.find(name).unwrap_or(Builtin::PlanFailure.id());
        let mut failure = Failure::of_type(kind, name, self.params("fields")?);
        if self.get("task").is_some() {
            failure.task = Some(std::rc::Rc::new(Raiser::of_path(self.text("task")?)));
        }
        if let Some(json) = self.get("cause") {
            let cause = Node { json, at: &format!("{}.cause", self.at), ..*self };
            failure.cause = Some(cause.as_failure(depth + 1)?);
        }
        failure.also = self.each("also", |it| it.as_failure(depth + 1))?;
        Ok(Value::failure(failure))
    }
}

/// The properties of a description, or the parameters of a plan; as in the view of a live tree.
fn properties(kind: NodeKind, params: Vec<(Symbol, Value)>) -> Vec<(Symbol, Value)> {
    match (kind, params.first().and_then(|param| param.1.as_desc())) {
        (NodeKind::Action, Some(desc)) => {
            desc.properties().map(|(key, value)| (key, value.clone())).collect()
        }
        _ => params.into_iter().filter(|param| !vm::code::is_pattern(&param.0)).collect(),
    }
}
