//! Tasks and fluents of a run that stands, for those who look at it from outside, and for who is told that
//! nothing can go on.

use std::collections::{BTreeMap, BTreeSet};

use crate::fluent::Fluent;
use crate::path::{Path, Paths};
use crate::print::brief;
use crate::tree::RecId;
use crate::value::{Obj, Symbol, Value};

use super::super::{Machine, Run};
use super::{State, TaskId, Waits};

impl Machine {
    /// The tasks of the innermost run that have not ended: where each stands, and what it does.
    #[must_use]
    pub fn tasks(&self) -> Vec<(Path, String)> {
        let Some(run) = self.runs.last() else { return Vec::new() };
        if run.tree.record(RecId(1)).status.is_final() {
            return Vec::new();
        }
        let open = |it: &super::Task| it.state != State::Ended && it.rec != RecId(0);
        self.where_they_stand(run, open)
    }

    /// Those who keep a run from going on: who waits for what, and who is suspended.
    pub(super) fn stuck(&self) -> Vec<String> {
        let Some(run) = self.runs.last() else { return Vec::new() };
        let stuck = |it: &super::Task| match it.state {
            State::Waiting(waits) => waits != Waits::Branches,
            State::Ready => it.rec != RecId(0),
            State::Ended => false,
        };
        let tasks = self.where_they_stand(run, stuck);
        tasks.into_iter().map(|(path, what)| format!("{} {what}", path.show())).collect()
    }

    fn where_they_stand(&self, run: &Run, which: impl Fn(&super::Task) -> bool) -> Vec<(Path, String)> {
        let mut paths = Paths::of(&run.tree);
        let awaited = self.awaited(run, &mut paths);
        let all = run.tasks.all.iter().enumerate().filter(|(_, task)| which(task));
        all.map(|(at, task)| {
            let id = TaskId(at as u32);
            let waits = match (task.state, awaited.get(&id)) {
                (State::Waiting(Waits::Time), Some(what)) => Some(format!("waits for {what}, or a time")),
                (State::Waiting(_), Some(what)) => Some(format!("waits for {what}")),
                (State::Waiting(waits), None) => Some(format!("waits for {}", waits.word())),
                _ => None,
            };
            let what = match (run.is_held(id), waits) {
                (true, Some(waits)) => format!("is suspended, and {waits}"),
                (true, None) => "is suspended".to_string(),
                (false, Some(waits)) => waits,
                _ if run.tasks.running && run.tasks.loaded == id => "runs".to_string(),
                _ => "is ready".to_string(),
            };
            (paths.path(run.tree.record(run.stands_in(task)).slot), what)
        })
        .collect()
    }

    /// What tasks wait for, as far as it has a name: a task, a constant, or an expression over constants.
    fn awaited(&self, run: &Run, paths: &mut Paths<'_>) -> BTreeMap<TaskId, String> {
        let mut awaited = BTreeMap::new();
        for task in &run.tasks.all {
            for (waiting, _) in task.joiners.iter().filter(|(id, token)| run.tasks.is_waiting(*id, *token)) {
                awaited.insert(*waiting, format!("the end of {}", paths.path(task.slot).show()));
            }
        }
        let constants = self.program.globals.iter().zip(&self.globals);
        let fluents =
            constants.filter_map(|(name, value)| Some((as_fluent(value)?.id, (*name, value.clone()))));
        let named: BTreeMap<u64, (Symbol, Value)> = fluents.collect();
        let mut todo: Vec<Value> = named.values().map(|(_, fluent)| fluent.clone()).collect();
        let mut seen = BTreeSet::new();
        while let Some(value) = todo.pop() {
            let Some(fluent) = as_fluent(&value).filter(|fluent| seen.insert(fluent.id)) else { continue };
            todo.extend(fluent.dependents());
            let waiting = fluent.waiting(run.number).map(|(task, token)| (TaskId(task), token));
            let waiting = waiting.filter(|(id, token)| run.tasks.is_waiting(*id, *token));
            let words = std::cell::LazyCell::new(|| words(&named, fluent));
            awaited.extend(waiting.map(|(id, _)| (id, words.clone())));
        }
        awaited
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
            let parked = run.tasks.all.iter().filter_map(|task| task.parked.as_ref());
            parked.flat_map(|it| &it.registers).for_each(|value| add(None, value));
        }
        found.into_values().collect()
    }
}

fn as_fluent(value: &Value) -> Option<&Fluent> {
    if let Some(Obj::Fluent(fluent)) = value.obj() { Some(fluent) } else { None }
}

/// A fluent by its name, or by the names in the expression that it is.
fn words(named: &BTreeMap<u64, (Symbol, Value)>, fluent: &Fluent) -> String {
    if let Some((name, _)) = named.get(&fluent.id) {
        return format!("{name}, which holds {}", brief(&fluent.value()));
    }
    let inputs = fluent.derived.iter().flat_map(|derived| &derived.inputs).filter_map(as_fluent);
    let inputs = inputs.filter_map(|input| Some((named.get(&input.id)?.0, input.value())));
    let inputs: Vec<String> =
        inputs.map(|(name, value)| format!("{name}, which holds {}", brief(&value))).collect();
    match inputs.is_empty() {
        true => Waits::Fluent.word().to_string(),
        false => format!("an expression over {}", inputs.join(", and ")),
    }
}
