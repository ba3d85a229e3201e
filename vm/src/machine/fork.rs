//! Parallel forms: `par`, `pursue`, `try-all`, … are one driver that starts branches as tasks, waits,
//! and decides by the ends of one round.
//!
//! A form ends only when all its branches have ended, whatever decided it: those that are not needed
//! any more are evaporated, and run their clean-ups first. So no task outlives its parent.

use crate::code::{FnId, SiteId};
use crate::failure::{Builtin, Failure};
use crate::host::Host;
use crate::key::{Ranks, Step};
use crate::native::{Raise, type_error};
use crate::op::Count;
use crate::tree::{DRIVEN, NodeKind, SlotId, Status, Why};
use crate::value::{Imm, Obj, Value};

use super::call::Slow;
use super::drive::{Call, Driver};
use super::task::{TaskId, Waits, is_evaporation};
use super::unwind::with_also;
use super::{Exit, Machine, Outcome};

macro_rules! kinds {
    ($($(#[$doc:meta])+ $kind:ident $word:literal;)+) => {
        /// What kind of parallel form it is. The compiler puts its number into the code.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum ForkKind { $($(#[$doc])+ $kind),+ }
        impl ForkKind {
            const ALL: &'static [ForkKind] = &[$(ForkKind::$kind),+];
            /// The name of the form.
            #[must_use]
            pub fn word(self) -> &'static str { match self { $(ForkKind::$kind => $word),+ } }
        }
    };
}

kinds! {
    /// All must succeed.
    Par "par";
    /// One branch for each element of a list; all must succeed.
    ParLoop "par-loop";
    /// The first end decides.
    Pursue "pursue";
    /// The first success decides.
    TryAll "try-all";
    /// One after another, until one succeeds.
    TryInOrder "try-in-order";
    /// One branch for each element of a list, one after another, until one succeeds.
    TryEach "try-each";
    /// Each when those before it have succeeded; all must.
    PartialOrder "partial-order";
    /// One branch that has so many seconds.
    WithTimeout "with-timeout";
}

impl ForkKind {
    fn is_loop(self) -> bool {
        matches!(self, ForkKind::ParLoop | ForkKind::TryEach)
    }
    fn is_sequential(self) -> bool {
        matches!(self, ForkKind::TryInOrder | ForkKind::TryEach)
    }
}

/// A parallel form that is being done.
pub(super) struct Fork {
    kind: ForkKind,
    /// In the order of the source.
    branches: Vec<Branch>,
    /// The branches that have a name, for all of them.
    handles: Vec<Value>,
    /// How many run.
    open: usize,
    /// Which branches come before which.
    edges: Vec<(usize, usize)>,
    /// The branch that was started first, where some are started later than others.
    first: Option<SlotId>,
    /// When its time is over.
    deadline: Option<u64>,
    /// What it ends with, once all branches that run have ended.
    ending: Option<Outcome>,
    /// Its time was over in the last round.
    late: bool,
}

struct Branch {
    slot: SlotId,
    function: FnId,
    /// Its function with what that captured.
    code: Value,
    /// The element of the list that it is for; unset in forms that are no loops.
    element: Value,
    task: TaskId,
    /// It has been started.
    started: bool,
    /// Somebody had asked it to stop when it ended.
    stopped: bool,
    /// An edit has left it out, or put it off: its end decides nothing.
    absent: bool,
    /// How it ended, and in which round.
    end: Option<(u64, Outcome)>,
}

impl Branch {
    fn failure(&self) -> Option<&Value> {
        self.end.as_ref()?.1.as_ref().err().filter(|failure| !is_evaporation(failure))
    }
    fn has_succeeded(&self) -> bool {
        !self.absent && matches!(self.end, Some((_, Ok(_))))
    }
    fn value(&self) -> Value {
        match &self.end {
            Some((_, Ok(value))) => value.clone(),
            _ => Value::NIL,
        }
    }
    /// The failures of clean-ups while the branch was stopped, and the round in which it ended. One that was in
    /// its clean-up already, and could not be stopped, ends with it.
    fn clean_up_failures(&self) -> Vec<(u64, Value)> {
        let Some((round, Err(failure))) = &self.end else { return Vec::new() };
        let failures = match failure.as_failure() {
            Some(it) if is_evaporation(failure) => it.also.clone(),
            _ => self.stopped.then(|| failure.clone()).into_iter().collect(),
        };
        failures.into_iter().map(|failure| (*round, failure)).collect()
    }
    /// Its arguments, then what its function captured.
    fn values<'b>(&'b self, handles: &'b [Value]) -> impl Iterator<Item = Value> + 'b {
        let captured = match self.code.obj() {
            Some(Obj::Closure(_, captured)) => &captured[..],
            _ => &[],
        };
        let element = Some(&self.element).filter(|element| !element.is_unset());
        handles.iter().chain(element).chain(captured).cloned()
    }
    fn is_running(&self) -> bool {
        self.started && self.end.is_none()
    }
}

impl Machine {
    /// Begins a parallel form: kind, extra and `n` closures in registers from `w`.
    pub(super) fn fork(&mut self, host: &mut dyn Host, d: u8, w: u8, n: Count, site: SiteId) -> Slow {
        let number = self.reg(w).as_int().unwrap_or(0) as usize;
        let kind = ForkKind::ALL.get(number).copied().unwrap_or(ForkKind::Par);
        let extra = self.reg(w.wrapping_add(1)).clone();
        let mut branches = Vec::new();
        if kind.is_loop() {
            let code = self.reg(w.wrapping_add(2)).clone();
            let list = super::call::walkable(&extra)?;
            let ranks = Ranks::new(list.clone());
            let mut rest = list;
            while let Some((element, after)) = rest.as_pair().map(|(a, b)| (a.clone(), b.clone())) {
                rest = after;
                let round = ranks.step(&rest);
                branches.push(self.branch(site, Some(round), code.clone(), element)?);
            }
        } else {
            for i in 0..n.0 {
                let code = self.reg(w.wrapping_add(2 + i)).clone();
                branches.push(self.branch(SiteId(site.0 + u32::from(i)), None, code, Value::UNSET)?);
            }
        }
        let origin = self.top().origin().map(Box::new);
        for (ordinal, branch) in branches.iter_mut().enumerate() {
            let run = self.top();
            branch.task = run.new_task(branch.slot, ordinal as u32);
            run.tasks.get_mut(branch.task).origin.clone_from(&origin);
        }
        let (tags, edges) = match kind {
            ForkKind::ParLoop | ForkKind::TryEach | ForkKind::WithTimeout => (Vec::new(), Vec::new()),
            _ => tags_and_edges(&extra),
        };
        // Every branch knows those that have a name.
        let handles: Vec<Value> = tags.iter().map(|at| self.top().handle(branches[*at].task)).collect();
        let deadline = match kind {
            ForkKind::WithTimeout => Some(self.top().now.saturating_add(nanoseconds(&extra)?)),
            _ => None,
        };
        let fork = Fork {
            kind,
            branches,
            handles,
            open: 0,
            edges,
            first: None,
            deadline,
            ending: None,
            late: false,
        };
        self.push_driver(Driver::Fork(Box::new(fork)), d);
        self.fork_resumed_with(host)
    }

    fn branch(
        &mut self,
        site: SiteId,
        round: Option<Step>,
        code: Value,
        element: Value,
    ) -> Result<Branch, Raise> {
        let function = match &code {
            Value::Imm(Imm::Function(function)) => *function,
            Value::Obj(obj) if let Obj::Closure(function, _) = &**obj => *function,
            _ => return Err(type_error("a function", &code)),
        };
        let name = self.program.sites[site.at()].name;
        let slot = self.slot_of(site, name, round);
        Ok(Branch {
            slot,
            function,
            code,
            element,
            task: TaskId::ROOT,
            started: false,
            stopped: false,
            absent: false,
            end: None,
        })
    }

    fn fork_resumed_with(&mut self, host: &mut dyn Host) -> Slow {
        match self.top().drivers.pop() {
            Some(Driver::Fork(fork)) => self.fork_resumed(host, fork),
            _ => Ok(None),
        }
    }

    /// The form has its turn: it decides, starts what can start, or waits.
    pub(super) fn fork_resumed(&mut self, host: &mut dyn Host, mut fork: Box<Fork>) -> Slow {
        if fork.ending.is_none() {
            if fork.deadline.is_some_and(|at| at <= self.top().now) && !fork.late && fork.open > 0 {
                // What ends in this round ends in time.
                fork.late = true;
                let run = self.top();
                run.drivers.push(Driver::Fork(fork));
                run.tasks.wait_until(run.now);
                return Ok(Some(Exit::Wait));
            }
            fork.ending = self.decide(&fork);
            match &fork.ending {
                Some(Ok(_)) => self.stop_branches(&fork, Why::Won),
                Some(Err(_)) if fork.late => self.stop_branches(&fork, Why::Timeout),
                Some(Err(_)) => self.stop_branches(&fork, Why::Failed),
                None => {
                    self.start_branches(host, &mut fork);
                    if fork.open == 0 {
                        // What comes before the others has been stopped: they never begin.
                        fork.ending = Some(Ok(Value::list(fork.values())));
                    }
                }
            }
        }
        match fork.ending.take() {
            Some(outcome) if fork.open == 0 => {
                self.top().tasks.reclaim();
                match outcome {
                    Ok(value) => self.return_value(value),
                    Err(failure) => {
                        self.return_value(Value::NIL)?;
                        let failed = fork.branches.iter().flat_map(Branch::clean_up_failures);
                        let mut failed: Vec<(u64, Value)> = failed.collect();
                        failed.sort_by_key(|(round, _)| *round);
                        let failure =
                            failed.into_iter().fold(failure, |it, (_, other)| with_also(&it, other));
                        Ok(self.throw(host, failure))
                    }
                }
            }
            ending => {
                fork.ending = ending;
                let deadline = fork.deadline.filter(|_| fork.ending.is_none());
                let run = self.top();
                run.drivers.push(Driver::Fork(fork));
                match deadline {
                    Some(at) => run.tasks.wait_until(at),
                    None => run.tasks.wait(Waits::Branches),
                }
                Ok(Some(Exit::Wait))
            }
        }
    }

    /// A failure has come to the form, or it is stopped: its branches end first.
    pub(super) fn fork_failed(&mut self, mut fork: Box<Fork>, failure: Value) -> Result<(), Value> {
        if fork.open == 0 {
            return Err(failure);
        }
        self.stop_branches(&fork, Why::Parent);
        fork.ending = Some(Err(failure));
        self.top().drivers.push(Driver::Fork(fork));
        Ok(())
    }

    fn stop_branches(&mut self, fork: &Fork, why: Why) {
        let run = self.top();
        for branch in fork.branches.iter().filter(|branch| branch.is_running()) {
            run.evaporate(branch.task, why);
        }
    }

    fn start_branches(&mut self, host: &mut dyn Host, fork: &mut Fork) {
        for at in 0..fork.branches.len() {
            if fork.branches[at].started || !fork.may_start(at) {
                continue;
            }
            let branch = &mut fork.branches[at];
            branch.started = true;
            fork.open += 1;
            let first = match fork.edges.is_empty() {
                true => branch.slot,
                false => *fork.first.get_or_insert(branch.slot),
            };
            let run = self.top();
            if !run.tree.edits_of(branch.slot).is_empty() {
                let parent = run.record(run.here);
                let (task, slot) = (branch.task, branch.slot);
                let values = branch.values(&fork.handles).collect();
                let mut call = Call::of_branch(slot, parent, branch.function, values);
                run.tree.calls(slot, branch.function);
                call.rec = self.record_of_call(host, &call);
                self.top().tree.stands_with(slot, first);
                self.top().start_call(task, call);
                self.status_changed(host, task);
                continue;
            }
            let entry = self.program.functions[branch.function.at()].entry.0;
            let run = &mut self.runs[..];
            let Some(run) = run.last_mut() else { return };
            let parent = run.record(run.here);
            let shown = [branch.element.clone()];
            let args = if branch.element.is_unset() { &[][..] } else { &shown[..] };
            let rec = run.tree.enter(parent, branch.slot, NodeKind::Branch, args, run.now);
            run.tree.record_mut(rec).flags |= DRIVEN;
            run.tree.stands_with(branch.slot, first);
            run.note_late(rec);
            run.tree.calls(branch.slot, branch.function);
            run.start_task(branch.task, rec, entry, branch.values(&fork.handles));
            self.trace_start(host, rec);
            let id = fork.branches[at].task;
            self.status_changed(host, id);
        }
    }

    /// A branch has ended: its form hears of it, and has a turn if that may decide something.
    pub(super) fn branch_ended(&mut self, id: TaskId, outcome: Outcome) {
        let run = self.top();
        let round = run.tasks.rounds;
        let task = run.tasks.get(id);
        let (parent, ordinal, stopped) = (task.parent, task.ordinal as usize, task.evaporate.is_some());
        let record = run.tree.record(task.rec);
        let absent = match record.status {
            Status::Deferred => true,
            Status::Skipped => record.value.is_nil(),
            _ => false,
        };
        let Some(Driver::Fork(fork)) = run.driver_of(parent) else { return };
        let kind = fork.kind;
        let failed = outcome.as_ref().is_err_and(|failure| !is_evaporation(failure));
        fork.branches[ordinal].stopped = stopped;
        fork.branches[ordinal].absent = absent;
        fork.branches[ordinal].end = Some((round, outcome));
        fork.open -= 1;
        let decides = match kind {
            _ if fork.open == 0 => true,
            _ if fork.ending.is_some() => false,
            ForkKind::Par | ForkKind::ParLoop => failed,
            _ => true,
        };
        if decides {
            run.tasks.make_ready(parent);
        }
    }

    /// What the form ends with, if its branches decide that.
    fn decide(&mut self, fork: &Fork) -> Option<Outcome> {
        let ended = |at: &usize| fork.branches[*at].end.is_some();
        let all: Vec<usize> = (0..fork.branches.len()).collect();
        let first_round = |which: &dyn Fn(&Branch) -> bool| {
            let of = fork.branches.iter().filter(|branch| which(branch));
            of.filter_map(|branch| branch.end.as_ref().map(|(round, _)| *round)).min()
        };
        let in_round = |round: u64| {
            all.iter().filter(move |at| matches!(fork.branches[**at].end, Some((of, _)) if of == round))
        };
        let failures_of = |round: u64| {
            let failures = in_round(round).filter_map(|at| fork.branches[*at].failure().cloned());
            failures.reduce(|first, other| with_also(&first, other))
        };
        let is_over = all.iter().all(ended);
        match fork.kind {
            ForkKind::Par | ForkKind::ParLoop | ForkKind::PartialOrder => {
                if let Some(round) = first_round(&|branch: &Branch| branch.failure().is_some()) {
                    return Some(Err(failures_of(round)?));
                }
                is_over.then(|| Ok(Value::list(fork.values())))
            }
            ForkKind::Pursue => {
                let Some(round) = first_round(&|branch: &Branch| !branch.absent) else {
                    return is_over.then(|| Ok(Value::NIL));
                };
                let success = in_round(round).find(|at| fork.branches[**at].has_succeeded());
                Some(match failures_of(round) {
                    Some(failure) => Err(failure),
                    None => Ok(success.map_or(Value::NIL, |at| fork.branches[*at].value())),
                })
            }
            ForkKind::TryAll | ForkKind::TryInOrder | ForkKind::TryEach => {
                // Mistakes of the program and limits of the run are not hidden by another way to do it.
                let grave = |branch: &&Branch| {
                    branch.failure().is_some_and(|failure| !self.is_hidden_by_alternatives(failure))
                };
                if let Some(branch) = fork.branches.iter().find(grave) {
                    return branch.end.clone().map(|(_, outcome)| outcome);
                }
                let round = first_round(&|branch: &Branch| branch.has_succeeded());
                let winner = round.and_then(|round| {
                    let winner = in_round(round).find(|at| fork.branches[**at].has_succeeded())?;
                    Some(Ok(fork.branches[*winner].value()))
                });
                winner.or_else(|| is_over.then(|| Err(self.raised_here(all_failed(fork)))))
            }
            ForkKind::WithTimeout => match fork.branches.first()?.end.clone() {
                Some((_, Err(failure))) if is_evaporation(&failure) => Some(Ok(Value::NIL)),
                None if fork.late => {
                    let message = "the time of `with-timeout` is over";
                    Some(Err(self.raised_here(Failure::new(Builtin::Timeout, message))))
                }
                end => end.map(|(_, outcome)| outcome),
            },
        }
    }

    /// True for a failure after which another alternative is tried.
    fn is_hidden_by_alternatives(&self, failure: &Value) -> bool {
        let Some(failure) = failure.as_failure() else { return false };
        ![Builtin::ProgramError, Builtin::ResourceFailure]
            .iter()
            .any(|grave| self.program.failures.is_a(failure.kind, grave.id()))
    }

    /// A failure as if the running frame had raised it.
    fn raised_here(&mut self, failure: Failure) -> Value {
        let mut raise = Box::new(failure);
        self.say_where(&mut raise);
        Value::new(Obj::Failure(raise))
    }
}

impl Fork {
    fn values(&self) -> Vec<Value> {
        self.branches.iter().map(Branch::value).collect()
    }

    /// True if what comes before a branch has succeeded.
    fn may_start(&self, at: usize) -> bool {
        if self.kind.is_sequential() {
            return self.branches[..at].iter().all(|branch| branch.end.is_some());
        }
        let before = self.edges.iter().filter(|(_, after)| *after == at);
        // One that is left out or put off holds nobody up.
        before.into_iter().all(|(before, _)| matches!(self.branches[*before].end, Some((_, Ok(_)))))
    }
}

fn all_failed(fork: &Fork) -> Failure {
    let failures: Vec<Value> = fork.branches.iter().filter_map(|it| it.failure().cloned()).collect();
    let message = format!("none of the {} alternatives of `{}` succeeded", failures.len(), fork.kind.word());
    let fields = vec![("message", Value::str(message)), ("failures", Value::list(failures))];
    Failure::with(Builtin::CompositeFailure, fields)
}

/// Seconds of the task clock in nanoseconds.
///
/// # Errors
/// `range-error` for a negative time or one that no clock reaches.
pub fn nanoseconds(seconds: &Value) -> Result<u64, Raise> {
    let s = crate::native::number(seconds)?;
    if s >= 0.0 && s <= u64::MAX as f64 / 1e9 {
        return Ok((s * 1e9).round() as u64);
    }
    Err(crate::native::range_error("seconds are a number of at least 0", seconds))
}

/// Which branches have names, and which come before which: `((0 2) ((0 1) …))`.
fn tags_and_edges(spec: &Value) -> (Vec<usize>, Vec<(usize, usize)>) {
    let number = |value: &Value| value.as_int().unwrap_or(0) as usize;
    let parts = spec.to_vec().unwrap_or_default();
    let [tags, edges] = parts.as_slice() else { return (Vec::new(), Vec::new()) };
    let pair = |edge: &Value| match edge.to_vec()?.as_slice() {
        [a, b] => Some((number(a), number(b))),
        _ => None,
    };
    (tags.iter().map(number).collect(), edges.iter().filter_map(pair).collect())
}
