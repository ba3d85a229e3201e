//! The table of a tree that was kept, without a tree in between.

use std::cell::OnceCell;

use rustc_hash::FxHashMap;
use serde_json::{Map as JsonMap, Value as Json};

use crate::failure::FailureTypes;
use crate::persist::{Outlined, SavedRecord, SavedTree, failure};
use crate::tree::{NodeKind, ROOT};
use crate::value::{Obj, Symbol, Value};

use super::build::{Words, properties, seconds};
use super::{Attempt, Rare, Row, TreeView};

/// How the text of a value becomes one again.
type Read<'a> = &'a dyn Fn(&str) -> Value;

impl TreeView {
    /// The tree of these rows; `read` makes values of texts that `write` has printed.
    ///
    /// # Errors
    /// A sentence that says which row does not fit to the others.
    pub fn of_saved(failures: &FailureTypes, saved: &SavedTree, read: Read<'_>) -> Result<TreeView, String> {
        let places = saved.places()?;
        let mut edits: FxHashMap<u32, Vec<Value>> = FxHashMap::default();
        for it in &saved.edits {
            let edit = read(&it.edit);
            if !matches!(edit.obj(), Some(Obj::Edit(_))) {
                return Err(format!("edit {} is none", it.number));
            }
            edits.entry(it.slot).or_default().push(edit);
        }
        let mut adding = Adding {
            failures,
            read,
            words: Words::new(),
            view: TreeView { rows: Vec::with_capacity(saved.records.len()), ..TreeView::default() },
        };
        let mut todo = vec![(ROOT.0, 0)];
        while let Some((slot, parent)) = todo.pop() {
            let all = places.records(slot);
            let Some(last) = all.last() else { continue };
            let record = |number: u32| &saved.records[number as usize - 1];
            let number = adding.view.rows.len() as u32;
            let name = saved.slots[slot as usize - 1].name;
            let attempts = match all.len() {
                1 => Vec::new(),
                _ => all.iter().map(|at| adding.attempt(record(*at))).collect::<Result<_, _>>()?,
            };
            adding.add(parent, name, record(*last), attempts, edits.remove(&slot).unwrap_or_default())?;
            todo.extend(places.children(slot).iter().rev().map(|child| (*child, number)));
        }
        let mut view = adding.view;
        view.close();
        match view.rows.is_empty() {
            true => Err("the tree is empty: its run was stopped before it was written".into()),
            false => Ok(view),
        }
    }
}

/// The rest of a tree of which only the outline is known.
pub(super) struct Rest {
    load: Box<dyn Fn() -> Result<TreeView, String>>,
    view: OnceCell<Box<(TreeView, Option<String>)>>,
}

impl TreeView {
    /// The tree of this outline. What else it has is loaded when somebody asks for it.
    #[must_use]
    pub fn of_outline(
        tasks: Vec<Outlined>,
        load: impl Fn() -> Result<TreeView, String> + 'static,
    ) -> TreeView {
        let rest = Rest { load: Box::new(load), view: OnceCell::new() };
        let mut view = TreeView {
            rows: tasks.into_iter().map(Row::outlined).collect(),
            rest: Some(rest),
            ..TreeView::default()
        };
        view.close();
        view
    }

    /// The tree with all that its tasks have.
    pub(super) fn whole(&self) -> &TreeView {
        let Some(rest) = &self.rest else { return self };
        let load = || {
            Box::new(match (rest.load)() {
                Ok(view) if view.is_like(self) => (view, None),
                Ok(_) => (self.bare(), Some("the tree differs from its outline".into())),
                Err(trouble) => (self.bare(), Some(trouble)),
            })
        };
        &rest.view.get_or_init(load).0
    }

    /// Why the rest of the tree could not be loaded: what has been said of it since is not to be believed.
    #[must_use]
    pub fn trouble(&self) -> Option<&str> {
        self.rest.as_ref()?.view.get()?.1.as_deref()
    }

    fn is_like(&self, outline: &TreeView) -> bool {
        let same = |(a, b): (&Row, &Row)| {
            a.parent == b.parent && a.name == b.name && a.kind == b.kind && a.status == b.status
        };
        self.rows.len() == outline.rows.len() && self.rows.iter().zip(&outline.rows).all(same)
    }

    fn bare(&self) -> TreeView {
        let row = |it: &Row| Row {
            below: it.below,
            ..Row::outlined(Outlined { parent: it.parent, name: it.name, kind: it.kind, status: it.status })
        };
        TreeView { rows: self.rows.iter().map(row).collect(), ..TreeView::default() }
    }
}

struct Adding<'a> {
    failures: &'a FailureTypes,
    read: Read<'a>,
    words: Words,
    view: TreeView,
}

impl Adding<'_> {
    fn add(
        &mut self,
        parent: u32,
        name: Symbol,
        it: &SavedRecord,
        attempts: Vec<Attempt>,
        edits: Vec<Value>,
    ) -> Result<(), String> {
        let kind = self.words.a_kind(it.kind).ok_or_else(|| wrong(it, "kind"))?;
        let status = self.words.a_status(it.status).ok_or_else(|| wrong(it, "status"))?;
        let number = self.view.rows.len() as u32;
        let mut more: JsonMap<String, Json> = match &it.more {
            None => JsonMap::new(),
            Some(text) => serde_json::from_str(text).map_err(|_| wrong(it, "extras"))?,
        };
        let args = self.view.args.len() as u32;
        let mut params = self.params(&it.params).ok_or_else(|| wrong(it, "parameters"))?;
        let is_desc = kind == NodeKind::Action && params.first().is_some_and(|it| it.1.as_desc().is_some());
        params.retain(|param| is_desc || !crate::code::is_pattern(&param.0));
        let count = params.len() as u16;
        self.view.args.extend(params.into_iter().take(count.into()));
        if let Some(grounded) = more.get("grounded").and_then(Json::as_str) {
            self.view.grounded.push((number, (self.read)(grounded)));
        }
        if !edits.is_empty() {
            self.view.edited.push(number);
        }
        let written = match more.remove("written-params") {
            Some(Json::Object(params)) => Some(properties(kind, self.texts(params))),
            _ => None,
        };
        let is_single = attempts.is_empty();
        if written.is_some() || !is_single || !edits.is_empty() {
            self.view.rare.insert(number, Rare { written, attempts, edits, by: None });
        }
        self.view.rows.push(Row {
            parent,
            below: 0,
            name,
            kind: self.words.kind(kind),
            status: self.words.status(status),
            value: self.value(it)?,
            start: seconds(it.start_ns),
            end: it.end_ns.filter(|_| status.is_final()).map_or(f64::NAN, seconds),
            args,
            count,
            is_desc,
            failed: it.failure.is_some(),
            is_single,
        });
        Ok(())
    }

    fn attempt(&self, it: &SavedRecord) -> Result<Attempt, String> {
        let status = self.words.a_status(it.status).ok_or_else(|| wrong(it, "status"))?;
        Ok(Attempt {
            status: status.word(),
            value: self.value(it)?,
            start: seconds(it.start_ns),
            end: it.end_ns.filter(|_| status.is_final()).map(seconds),
        })
    }

    fn value(&self, it: &SavedRecord) -> Result<Value, String> {
        Ok(match (&it.failure, it.value.as_deref()) {
            (Some(json), _) => {
                let json = serde_json::from_str(json).map_err(|_| wrong(it, "failure"))?;
                failure(self.failures, &json, self.read, 0)
            }
            (None, None) => Value::NIL,
            (None, Some(text)) => self.text(text),
        })
    }

    /// The values that most tasks have need no reader.
    fn text(&self, text: &str) -> Value {
        match text {
            "nil" => Value::NIL,
            _ if text.len() < 18 && text.bytes().all(|byte| byte.is_ascii_digit()) => {
                text.parse().map_or_else(|_| (self.read)(text), Value::int)
            }
            _ => (self.read)(text),
        }
    }

    fn params(&self, json: &str) -> Option<Vec<(Symbol, Value)>> {
        match json {
            "" => Some(Vec::new()),
            json => Some(self.texts(serde_json::from_str(json).ok()?)),
        }
    }

    fn texts(&self, params: JsonMap<String, Json>) -> Vec<(Symbol, Value)> {
        let param =
            |(name, json): (String, Json)| (Symbol::from(&name), self.text(json.as_str().unwrap_or("nil")));
        params.into_iter().map(param).collect()
    }
}

fn wrong(it: &SavedRecord, what: &str) -> String {
    format!("the {what} of record {} cannot be read", it.record)
}

#[cfg(test)]
mod tests {
    use super::super::Attr;
    use super::*;

    fn outline(parents: &[u32]) -> Vec<Outlined> {
        let word = Symbol::from;
        let task = |parent: &u32| Outlined {
            parent: *parent,
            name: word("put"),
            kind: word("plan"),
            status: word("succeeded"),
        };
        parents.iter().map(task).collect()
    }

    #[test]
    fn what_is_no_outline_is_loaded_when_it_is_asked_for() {
        let load = || {
            let mut view = TreeView::of_outline(outline(&[0, 0, 1]), || Err("not here".into()));
            view.rest = None;
            view.rows[2].value = Value::int(7);
            Ok(view)
        };
        let view = TreeView::of_outline(outline(&[0, 0, 1]), load);
        assert_eq!(view.column(Attr::Name).with(view.number(&Value::symbol("put"))).len(), 3);
        assert_eq!(view.path(2).steps.len(), 2);
        assert!(view.rest.as_ref().is_some_and(|rest| rest.view.get().is_none()));
        assert_eq!((view.value(2), view.trouble()), (Value::int(7), None));
    }

    #[test]
    fn what_cannot_be_loaded_is_a_trouble() {
        let view = TreeView::of_outline(outline(&[0, 0]), || Err("a row is damaged".into()));
        assert_eq!(view.trouble(), None);
        assert_eq!((view.value(1), view.trouble()), (Value::NIL, Some("a row is damaged")));
        let other = || Ok(TreeView::of_outline(outline(&[0]), || Err(String::new())));
        let view = TreeView::of_outline(outline(&[0, 0]), other);
        assert_eq!(view.params(1), Vec::new());
        assert!(view.trouble().is_some_and(|it| it.contains("outline")));
    }
}
