//! Tasks and fluents of a run that stands, for those who look at it from outside.

use std::collections::BTreeMap;

use crate::path::Path;
use crate::tree::RecId;
use crate::value::{Obj, Symbol, Value};

use super::super::Machine;
use super::{State, TaskId};

impl Machine {
    /// The tasks of the innermost run that have not ended: where each stands, and what it does.
    #[must_use]
    pub fn tasks(&self) -> Vec<(Path, String)> {
        let Some(run) = self.runs.last() else { return Vec::new() };
        if run.tree.record(RecId(1)).status.is_final() {
            return Vec::new();
        }
        let all = run.tasks.all.iter().enumerate();
        let open = all.filter(|(_, task)| task.state != State::Ended && task.rec != RecId(0));
        open.map(|(at, task)| {
            let id = TaskId(at as u32);
            let what = match task.state {
                _ if run.is_held(id) => "is suspended".to_string(),
                State::Waiting(waits) => format!("waits for {}", waits.word()),
                _ if run.tasks.running && run.tasks.loaded == id => "runs".to_string(),
                _ => "is ready".to_string(),
            };
            (Path::of(&run.tree, run.tree.record(run.record(run.here_of(id))).slot), what)
        })
        .collect()
    }

    /// The fluents in constants and in the registers of tasks, by their numbers; with their names where they
    /// are constants.
    #[must_use]
    pub fn fluents(&self) -> Vec<(Option<Symbol>, Value)> {
        let mut found = BTreeMap::new();
        let mut add = |name: Option<Symbol>, value: &Value| {
            if let Some(Obj::Fluent(fluent)) = value.obj() {
                found.entry(fluent.id).or_insert_with(|| (name, value.clone()));
            }
        };
        let named = self.program.globals.iter().zip(&self.globals);
        named.for_each(|(name, value)| add(Some(*name), value));
        for run in &self.runs {
            let used = run.base as usize + 256;
            run.stack.iter().take(used).for_each(|value| add(None, value));
            let all = (0..run.tasks.all.len() as u32).map(TaskId);
            all.flat_map(|id| run.values_of(id)).for_each(|value| add(None, &value));
        }
        found.into_values().collect()
    }
}
