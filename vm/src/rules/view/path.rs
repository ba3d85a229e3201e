//! The paths of tasks: names with their ranks among siblings, counted when somebody asks for the first.

use rustc_hash::FxHashMap;

use crate::path::{Path, PathStep};
use crate::value::{Obj, Symbol, Value};

use super::TreeView;

impl TreeView {
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

    /// The rank of one task. Who asks for a few needs no table of all.
    fn call(&self, task: u32) -> u32 {
        let mut looked = self.looked.get();
        if self.calls.get().is_some() || looked > self.rows.len() {
            return self.calls()[task as usize];
        }
        let name = self.name(task);
        let mut call = 1;
        for sibling in self.ranked(self.parent(task)).take_while(|sibling| *sibling != task) {
            looked += 1;
            call += u32::from(self.name(sibling) == name);
        }
        self.looked.set(looked);
        call
    }

    /// The path of a task.
    #[must_use]
    pub fn path(&self, task: u32) -> Path {
        let mut steps = Vec::new();
        let mut at = task;
        while at != 0 {
            let it = &self.rows[at as usize];
            steps.push(PathStep { name: it.name, call: self.call(at) });
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
