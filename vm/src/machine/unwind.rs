//! Failures: from the instruction that raises one to the handler that takes it.
//!
//! Handlers and clean-ups cost nothing until a failure looks for them: each frame it leaves is
//! looked up in the form map, innermost form first.

use crate::code::{FormKind, Place};
use crate::host::Host;
use crate::native::Raise;
use crate::tree::DRIVEN;
use crate::value::{Obj, Value};

use super::task::is_evaporation;
use super::{Exit, Machine, Pc, RESUME};

/// Failures that are kept in one chain of causes, or beside one failure.
const MOST_KEPT: usize = 100;

impl Machine {
    /// Carries a failure to the innermost place that takes it. The run goes on there, or the
    /// failure has left it.
    pub(super) fn unwind(&mut self, host: &mut dyn Host, mut raise: Raise) -> Option<Exit> {
        self.say_where(&mut raise);
        self.throw(host, Value::new(Obj::Failure(raise)))
    }

    /// The same for a failure that has been raised before.
    pub(super) fn throw(&mut self, host: &mut dyn Host, mut failure: Value) -> Option<Exit> {
        loop {
            if self.top().pc == RESUME {
                match self.driver_failed(host, failure) {
                    Ok(()) => return None,
                    Err(passed) => failure = passed,
                }
            } else {
                match self.find_handler(host, failure) {
                    Ok(exit) => return exit,
                    Err(passed) => failure = passed,
                }
            }
            let run = self.top();
            let Some(frame) = run.frames.pop() else { return Some(Exit::Failed(failure)) };
            let (rec, below) = (run.record(run.here), run.record(frame.here));
            (run.pc, run.base, run.here) = (frame.pc, frame.base, frame.here);
            // A handler of an obligation works for a task that has ended.
            let record = run.tree.record(rec);
            if rec != below && record.flags & DRIVEN == 0 && !record.status.is_final() {
                self.fail_record(host, rec, &failure);
            }
        }
    }

    /// Notes where the failure was raised, unless it comes from elsewhere.
    pub(super) fn say_where(&mut self, raise: &mut Raise) {
        if raise.place.is_none() {
            raise.place = self.place_of_frame();
        }
        if let Some(place) = raise.place.filter(|place| self.program.library.contains(&place.file))
            && let Some(caller) = self.place_of_user()
        {
            // Code that the machine makes itself stands nowhere.
            raise.within = Some(place).filter(|place| place.end > 0);
            raise.place = Some(caller);
        }
        if raise.task.is_none() {
            let run = self.top();
            let slot = run.tree.record(run.record(run.here)).slot;
            raise.task = Some(run.raised.add(slot));
        }
    }

    /// The place in the source that the innermost frame stands at.
    pub(super) fn place_of_frame(&self) -> Option<Place> {
        let run = &self.runs[self.runs.len() - 1];
        let pcs = std::iter::once(run.pc).chain(run.frames.iter().rev().map(|frame| frame.pc));
        let pc = pcs.filter(|pc| *pc != RESUME).find(|pc| *pc > 0)?;
        self.program.places.get(pc as usize - 1).copied()
    }

    /// The place outside of the library that the innermost frame of the user's text stands at.
    fn place_of_user(&self) -> Option<Place> {
        const FRAMES: usize = 1000;
        let run = &self.runs[self.runs.len() - 1];
        let pcs = std::iter::once(run.pc).chain(run.frames.iter().rev().map(|frame| frame.pc));
        let pcs = pcs.take(FRAMES).filter(|pc| *pc != RESUME && *pc > 0);
        let mut places = pcs.filter_map(|pc| self.program.places.get(pc as usize - 1).copied());
        places.find(|place| place.end > 0 && !self.program.library.contains(&place.file))
    }

    /// Looks for a handler or clean-up around the program counter of the running frame. Gives the
    /// failure back if there is none, with what it picked up on the way.
    fn find_handler(&mut self, host: &mut dyn Host, mut failure: Value) -> Result<Option<Exit>, Value> {
        let run = self.top();
        let leaving = run.leaving.take();
        let (depth, at) = (run.frames.len(), Pc(run.pc.saturating_sub(1)));
        let owes = run.obligations.iter().any(|it| it.holder == (run.tasks.loaded, depth));
        let handling = run.handling.last().and_then(|it| it.of_frame(depth));
        let Some(function) = self.program.function_at(at) else { return Err(failure) };
        if !self.program.functions[function.at()].guards && !owes {
            return Err(failure);
        }
        let form = leaving.unwrap_or_else(|| self.program.form_at(function, at));
        let mut next = Some(form);
        while let Some(form) = next {
            next = self.program.around(form);
            let kind = self.program.forms[form as usize].kind;
            if owes && is_evaporation(&failure) && self.top().is_emergency() {
                self.drop_owed(host);
            }
            if owes && let Some(owed) = self.due_before_failure(form) {
                return match self.discharge(host, owed, Some(failure)) {
                    Ok(exit) => Ok(exit),
                    Err(raise) => Ok(self.unwind(host, raise)),
                };
            }
            match kind {
                FormKind::Guarded { .. } if is_evaporation(&failure) => {}
                FormKind::Guarded { handler, failure: register } => {
                    *self.top().register(register) = failure;
                    self.top().pc = handler.0;
                    return Ok(None);
                }
                FormKind::Protected { cleanup, pending, .. } => {
                    *self.top().register(pending) = failure;
                    self.top().pc = cleanup.0;
                    return Ok(None);
                }
                FormKind::Clauses { failure: register } => {
                    let handled = self.reg(register).clone();
                    failure = caused_by(failure, &handled, &mut { MOST_KEPT });
                    if handling == Some(form) {
                        // The rest of the frame stands for a place that has been left.
                        self.end_handling();
                        return Err(failure);
                    }
                }
                FormKind::CleanUp { pending, .. } => {
                    self.top().cleanups.pop();
                    let waiting = self.reg(pending).clone();
                    if waiting.as_failure().is_some() && !is_same_event(&waiting, &failure) {
                        failure = with_also(&waiting, failure);
                    }
                }
                FormKind::Body | FormKind::Step | FormKind::Branch(_) | FormKind::Round(_) => {}
            }
        }
        Err(failure)
    }
}

/// A failure that left a handler: what was being handled is the first cause of it, and of those that
/// have ended beside it since. So many failures are looked at as there is `room` for.
fn caused_by(mut failure: Value, handled: &Value, room: &mut usize) -> Value {
    let Some(it) = failure.as_failure().filter(|_| *room > 0) else { return failure };
    *room -= 1;
    if it.also.iter().any(|other| !is_beside(other, handled)) {
        let mut it = it.clone();
        for other in it.also.iter_mut().filter(|other| !is_beside(other, handled)) {
            *other = caused_by(std::mem::take(other), handled, room);
        }
        failure = Value::failure(it);
    }
    if is_same_event(&failure, handled) || !chain_ends(&failure, handled) {
        return failure;
    }
    add_cause(&failure, handled, MOST_KEPT)
}

/// True if a failure had ended beside another one before that was handled.
fn is_beside(other: &Value, handled: &Value) -> bool {
    handled.as_failure().is_some_and(|it| it.also.iter().any(|also| is_same_event(also, other)))
}

/// True for copies of one failure: a clause that lets it pass raises a copy. A task is stopped once.
fn is_same_event(one: &Value, other: &Value) -> bool {
    if is_evaporation(one) && is_evaporation(other) {
        return true;
    }
    matches!((one.as_failure(), other.as_failure()), (Some(one), Some(other)) if one.is_same_event(other))
}

/// True if `handled` is not yet among the causes.
fn chain_ends(failure: &Value, handled: &Value) -> bool {
    let causes = std::iter::successors(failure.as_failure(), |it| it.cause.as_ref()?.as_failure());
    !causes.take(MOST_KEPT).any(|it| it.cause.as_ref().is_some_and(|cause| is_same_event(cause, handled)))
}

fn add_cause(failure: &Value, cause: &Value, depth: usize) -> Value {
    let (Some(it), true) = (failure.as_failure(), depth > 0) else { return failure.clone() };
    let mut it = it.clone();
    it.cause = Some(match &it.cause {
        Some(earlier) => add_cause(earlier, cause, depth - 1),
        None => cause.clone(),
    });
    Value::failure(it)
}

/// A failure, with another one that ended after it.
pub(super) fn with_also(failure: &Value, other: Value) -> Value {
    let Some(it) = failure.as_failure() else { return other };
    if is_same_event(failure, &other) {
        // Who waited for a task that failed fails with the same.
        return failure.clone();
    }
    let mut it = it.clone();
    if it.also.len() < MOST_KEPT {
        it.also.push(other);
    }
    Value::failure(it)
}
