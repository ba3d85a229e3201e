//! The time of clean-ups: they cannot be stopped from outside, so they must end by themselves.
//!
//! A clean-up has 60 s of the task clock; one inside of another has what is left of the other's.
//! The clock moves between rounds, so that is where the time is looked at; for a clean-up that waits there
//! is a timer. What a form owes that a failure leaves has its time in the same way.

use crate::code::{FormKind, Pc};
use crate::failure::{Builtin, Failure};
use crate::native::Raise;

use super::{Machine, Run};

/// Nanoseconds of the task clock that a clean-up has.
const TIME_NS: u64 = 60_000_000_000;

/// A clean-up that is running.
pub(super) struct CleanUp {
    /// Its frame, as a number of frames.
    depth: usize,
    /// When its time is over; never, once that has been said.
    deadline: u64,
    /// It is not clean-up forms but what is owed by a form that a failure leaves.
    owed: bool,
}

impl CleanUp {
    /// A clean-up that begins `now`, inside of another one or not, in a task that has time until `limit`.
    pub(super) fn begin(depth: usize, now: u64, outer: Option<&CleanUp>, limit: u64) -> CleanUp {
        let most = outer.map_or(limit, |outer| outer.deadline);
        CleanUp { depth, deadline: now.saturating_add(TIME_NS).min(most), owed: false }
    }

    /// The same for what is owed, which ends when that says so.
    pub(super) fn owed(self) -> CleanUp {
        CleanUp { owed: true, ..self }
    }

    pub(super) fn deadline(&self) -> u64 {
        self.deadline
    }
}

/// The failure of a clean-up whose time is over.
pub(super) fn too_long() -> Raise {
    let message = "the clean-up forms have not ended after 60 s of the task clock";
    Box::new(Failure::new(Builtin::CleanUpTimeout, message))
}

impl Machine {
    /// A jump out of clean-up forms (`return`) leaves its entry behind.
    pub(super) fn forget_left_cleanups(&mut self) {
        while self.runs.last().and_then(|run| run.cleanups.last()).is_some_and(|last| !self.is_running(last))
        {
            self.top().cleanups.pop();
        }
    }

    fn is_running(&self, cleanup: &CleanUp) -> bool {
        if cleanup.owed {
            return true;
        }
        let run = &self.runs[self.runs.len() - 1];
        let pc = if cleanup.depth == run.frames.len() { Some(run.pc) } else { run.pc_of(cleanup.depth) };
        let Some(at) = pc.and_then(|pc| pc.checked_sub(1)).map(Pc) else { return false };
        let Some(function) = self.program.function_at(at) else { return false };
        let mut forms = self.program.forms_outward(self.program.form_at(function, at));
        forms.any(|(_, form)| matches!(form.kind, FormKind::CleanUp { .. }))
    }
}

impl Run {
    /// Who does not wait, but takes too long for a clean-up, fails in that in his next turn.
    pub(super) fn check_cleanups(&mut self) {
        let now = self.now;
        for id in self.tasks.ready_tasks() {
            if let Some(last) = self.cleanups_of(id).last_mut().filter(|last| last.deadline <= now) {
                last.deadline = u64::MAX;
                self.tasks.get_mut(id).raise = Some(too_long());
            }
        }
    }

    /// The program counter of the frame with so many frames below it.
    fn pc_of(&self, depth: usize) -> Option<u32> {
        self.frames.get(depth).map(|frame| frame.pc)
    }
}
