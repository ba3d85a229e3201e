//! The table of a tree with edits that have not run.
//!
//! [`overlay`] knows what they do to tasks. Here the rows that they do not touch are kept: a tree is large, and what is
//! changed of it is little.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::tree::NodeKind;
use crate::value::{Symbol, Value};

use super::super::overlay::{self, overlay};
use super::build::Texts;
use super::{Row, Task, TreeView, status};

impl TreeView {
    /// The table with edits that have not run. What they do not change keeps its row.
    pub(super) fn overlaid(mut self, pending: Vec<(u32, Vec<Value>)>) -> TreeView {
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
            by: rare.and_then(|it| it.by),
            pending: Vec::new(),
        }
    }
}
