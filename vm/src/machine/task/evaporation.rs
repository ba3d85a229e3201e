//! Evaporation: what unwinds a task that is stopped from outside.
//!
//! It travels as a failure does, so branches end and clean-ups run on its way; no handler takes it.

use crate::failure::{Builtin, Failure, TypeId};
use crate::host::Host;
use crate::tree::{RecId, Status, Why};
use crate::value::{Symbol, Value};

use super::super::{Exit, Machine};

/// The type of what stops a task. No program can name it, so no handler takes it.
const EVAPORATION: TypeId = TypeId(u32::MAX);

/// What unwinds a task that is stopped from outside.
pub(in crate::machine) fn evaporation(why: Why) -> Value {
    let word = vec![(Symbol::from("why"), Value::symbol(why.word()))];
    Value::failure(Failure::of_type(EVAPORATION, Symbol::from("evaporated"), word))
}

/// True for what unwinds a task that is stopped from outside.
pub(in crate::machine) fn is_evaporation(failure: &Value) -> bool {
    failure.as_failure().is_some_and(|it| it.kind == EVAPORATION)
}

impl Machine {
    /// Throws what stops the loaded task, if somebody asked for that and no clean-up runs.
    pub(in crate::machine) fn evaporate_if_asked(&mut self, host: &mut dyn Host) -> Option<Exit> {
        let run = self.top();
        let task = run.tasks.get_mut(run.tasks.loaded);
        let why = task.evaporate.filter(|_| !task.thrown && run.cleanups.is_empty())?;
        task.thrown = true;
        self.throw(host, evaporation(why))
    }

    /// A mistake of the program in a clean-up of a task that is stopped: no handler will see it.
    pub(super) fn tell_of_clean_up(&mut self, host: &mut dyn Host, stopped: &Value) {
        let value = stopped.as_failure().filter(|it| it.kind == EVAPORATION).and_then(|it| it.also.first());
        let Some(failed) = value.and_then(Value::as_failure) else { return };
        if !self.program.failures.is_a(failed.kind, Builtin::ProgramError.id()) {
            return;
        }
        failed.name_task(&self.top().tree);
        let task = failed.path().unwrap_or_default();
        let message = failed.get(Symbol::from("message")).map(crate::print::brief).unwrap_or_default();
        let line =
            format!("a clean-up failed while its task was stopped: {} in {task}: {message}", failed.name);
        host.complain(&crate::show::safe(&line));
    }

    /// Makes a record final that a failure, or evaporation, leaves. A clean-up that failed while its task
    /// was stopped is the failure of the record.
    pub(in crate::machine) fn fail_record(&mut self, host: &mut dyn Host, rec: RecId, failure: &Value) {
        let Some(it) = failure.as_failure().filter(|it| it.kind == EVAPORATION) else {
            return self.end_record(host, rec, Status::Failed, failure.clone());
        };
        let value = it.also.first().cloned().unwrap_or_default();
        let why = it.get(Symbol::from("why")).and_then(Value::as_symbol);
        let why = Why::ALL.iter().find(|known| why.is_some_and(|why| why == known.word()));
        self.top().tree.record_mut(rec).why = why.copied().unwrap_or_default();
        self.end_record(host, rec, Status::Evaporated, value);
    }
}
