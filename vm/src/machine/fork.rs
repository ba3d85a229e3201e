//! Parallel forms: `par`, `pursue`, `try-all`, … are one driver that starts branches as tasks, waits,
//! and decides by the ends of one round.
//!
//! A form ends only when all its branches have ended, whatever decided it: those that are not needed
//! any more are evaporated, and run their clean-ups first. So no task outlives its parent.

use std::ops::Range;

use crate::code::{FnId, SiteId};
use crate::failure::{Builtin, Failure};
use crate::host::Host;
use crate::key::{Rounds, Step};
use crate::native::{Raise, type_error};
use crate::op::Count;
use crate::tree::{DRIVEN, NodeKind, RecId, SlotId, Status, Why};
use crate::value::{Imm, Obj, Value};

use super::call::{Slow, Way};
use super::cleanup::CleanUp;
use super::drive::{Call, Driver, Origin};
use super::task::{Task, TaskId, Waits, is_evaporation};
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
    /// Its branches in the order of the source, as numbers of tasks.
    branches: Range<u32>,
    /// What they run: one function for each, or one for all rounds of a loop.
    code: Vec<Code>,
    /// What is left of the list that it goes over: the elements of branches that have not been started.
    elements: Value,
    /// The branches that have a name, for all of them.
    handles: Vec<Value>,
    /// What `(original)` is in its branches, if it stands in inserted code.
    pub(super) origin: Option<Box<Origin>>,
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

/// The function of a branch.
struct Code {
    function: FnId,
    entry: u32,
    /// With what it captured.
    closure: Value,
}

impl Machine {
    /// Begins a parallel form: kind, extra and `n` closures in registers from `w`.
    pub(super) fn fork(&mut self, host: &mut dyn Host, d: u8, w: u8, n: Count, site: SiteId) -> Slow {
        let number = self.reg(w).as_int().unwrap_or(0) as usize;
        let kind = ForkKind::ALL.get(number).copied().unwrap_or(ForkKind::Par);
        let extra = self.reg(w.wrapping_add(1)).clone();
        let code = (0..n.0).map(|i| self.code_of_branch(self.reg(w.wrapping_add(2 + i))));
        let code = code.collect::<Result<Vec<Code>, Raise>>()?;
        let elements = if kind.is_loop() { super::call::walkable(&extra)? } else { Value::NIL };
        let deadline = match kind {
            ForkKind::WithTimeout => Some(self.top().now.saturating_add(nanoseconds(&extra)?)),
            _ => None,
        };
        let way = self.way_to(site);
        let first = self.top().tasks.count();
        if kind.is_loop() {
            let count = elements.iter().count();
            self.top().tasks.reserve(count);
            let mut rounds = Rounds::with_capacity(count);
            for element in elements.iter() {
                self.add_branch(way, site, Some(rounds.next(element)));
            }
        } else {
            (0..n.0.into()).for_each(|i| self.add_branch(way, SiteId(site.0 + i), None));
        }
        let run = self.top();
        let branches = first..run.tasks.count();
        let (tags, edges) = match kind {
            ForkKind::ParLoop | ForkKind::TryEach | ForkKind::WithTimeout => (Vec::new(), Vec::new()),
            _ => tags_and_edges(&extra),
        };
        // Every branch knows those that have a name.
        let handles = tags.iter().map(|at| run.handle(TaskId(branches.start + *at as u32))).collect();
        let fork = Fork {
            kind,
            branches,
            code,
            elements,
            handles,
            origin: run.origin().map(Box::new),
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

    fn code_of_branch(&self, closure: &Value) -> Result<Code, Raise> {
        let function = match closure {
            Value::Imm(Imm::Function(function)) => *function,
            Value::Obj(obj) if let Obj::Closure(function, _) = &**obj => *function,
            _ => return Err(type_error("a function", closure)),
        };
        let entry = self.program.functions[function.at()].entry.0;
        Ok(Code { function, entry, closure: closure.clone() })
    }

    /// A new branch of the running task. It waits until it is started.
    fn add_branch(&mut self, way: Way, site: SiteId, round: Option<Step>) {
        let name = self.program.sites[site.at()].name;
        let slot = self.slot_on(way, site, name, round);
        let run = self.top();
        let limit = run.cleanups.last().map(CleanUp::deadline);
        run.tasks.add(slot, limit);
    }

    fn branches(&self, fork: &Fork) -> &[Task] {
        self.runs[self.runs.len() - 1].tasks.branches(&fork.branches)
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
                        fork.ending = Some(Ok(self.values(&fork)));
                    }
                }
            }
        }
        match fork.ending.take() {
            Some(outcome) if fork.open == 0 => {
                let failed = self.branches(&fork).iter().flat_map(Task::clean_up_failures);
                let mut failed: Vec<(u64, Value)> = failed.collect();
                self.top().tasks.forget(&fork.branches);
                match outcome {
                    Ok(value) => self.return_value(value),
                    Err(failure) => {
                        self.return_value(Value::NIL)?;
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
            self.top().tasks.forget(&fork.branches);
            return Err(failure);
        }
        self.stop_branches(&fork, Why::Parent);
        fork.ending = Some(Err(failure));
        self.top().drivers.push(Driver::Fork(fork));
        Ok(())
    }

    fn stop_branches(&mut self, fork: &Fork, why: Why) {
        let run = self.top();
        for id in fork.branches.clone().map(TaskId) {
            if run.tasks.get(id).is_running() {
                run.evaporate(id, why);
            }
        }
    }

    fn start_branches(&mut self, host: &mut dyn Host, fork: &mut Fork) {
        for (at, id) in fork.branches.clone().map(TaskId).enumerate() {
            let branches = self.branches(fork);
            if branches[at].rec != RecId(0) || !fork.may_start(branches, at) {
                continue;
            }
            fork.open += 1;
            // Those of a loop are started in the order of the list.
            let element = fork.elements.as_pair().map(|(element, rest)| (element.clone(), rest.clone()));
            let element = element.map(|(element, rest)| {
                fork.elements = rest;
                element
            });
            self.start_branch(host, fork, id, element);
            self.status_changed(host, id);
        }
    }

    fn start_branch(&mut self, host: &mut dyn Host, fork: &mut Fork, id: TaskId, element: Option<Value>) {
        let run = self.top();
        let (slot, function) = (run.tasks.get(id).slot, fork.code_of(id).function);
        let first = match fork.edges.is_empty() {
            true => slot,
            false => *fork.first.get_or_insert(slot),
        };
        let parent = run.record(run.here);
        run.tree.calls(slot, function);
        if run.tree.edits_of(slot).is_empty() {
            let rec = run.tree.enter(parent, slot, NodeKind::Branch, element.as_slice(), run.now);
            run.tree.record_mut(rec).flags |= DRIVEN;
            run.tree.stands_with(slot, first);
            run.note_late(rec);
            run.tasks.start(id, rec);
            self.trace_start(host, rec);
        } else {
            let values = fork.values_of(id, element.as_ref()).cloned().collect();
            let mut call = Call::of_branch(slot, parent, function, values);
            call.rec = self.record_of_call(host, &call);
            let run = self.top();
            run.tree.stands_with(slot, first);
            run.tasks.start(id, call.rec);
            run.tasks.get_mut(id).begin_with(call);
        }
    }

    /// A branch has ended: its form hears of it, and has a turn if that may decide something.
    pub(super) fn branch_ended(&mut self, id: TaskId, outcome: Outcome) {
        let run = self.top();
        let round = run.tasks.rounds;
        let record = run.tree.record(run.tasks.get(id).rec);
        let absent = match record.status {
            Status::Deferred => true,
            Status::Skipped => record.value.is_nil(),
            _ => false,
        };
        let failed = outcome.as_ref().is_err_and(|failure| !is_evaporation(failure));
        let task = run.tasks.get_mut(id);
        task.ends(round, outcome, absent);
        let parent = task.parent;
        let Some(Driver::Fork(fork)) = run.driver_of(parent) else { return };
        fork.open -= 1;
        let decides = match fork.kind {
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
        let branches = self.branches(fork);
        let round_of = |branch: &Task| branch.end.as_ref().map(|end| end.round);
        let first_round = |which: &dyn Fn(&Task) -> bool| {
            branches.iter().filter(|branch| which(branch)).filter_map(round_of).min()
        };
        let in_round = |round: u64| branches.iter().filter(move |branch| round_of(branch) == Some(round));
        let failures_of = |round: u64| {
            let failures = in_round(round).filter_map(|branch| branch.failure().cloned());
            failures.reduce(|first, other| with_also(&first, other))
        };
        let is_over = branches.iter().all(|branch| branch.end.is_some());
        match fork.kind {
            ForkKind::Par | ForkKind::ParLoop | ForkKind::PartialOrder => {
                if let Some(round) = first_round(&|branch| branch.failure().is_some()) {
                    return Some(Err(failures_of(round)?));
                }
                is_over.then(|| Ok(self.values(fork)))
            }
            ForkKind::Pursue => {
                let is_absent = |branch: &Task| branch.end.as_ref().is_some_and(|end| end.absent);
                let Some(round) = first_round(&|branch| !is_absent(branch)) else {
                    return is_over.then(|| Ok(Value::NIL));
                };
                let success = in_round(round).find(|branch| branch.has_succeeded());
                Some(match failures_of(round) {
                    Some(failure) => Err(failure),
                    None => Ok(success.map(Task::value).unwrap_or_default()),
                })
            }
            ForkKind::TryAll | ForkKind::TryInOrder | ForkKind::TryEach => {
                // Mistakes of the program and limits of the run are not hidden by another way to do it.
                let grave = |branch: &&Task| {
                    branch.failure().is_some_and(|failure| !self.is_hidden_by_alternatives(failure))
                };
                if let Some(branch) = branches.iter().find(grave) {
                    return branch.outcome();
                }
                let round = first_round(&Task::has_succeeded);
                let winner = round.and_then(|round| in_round(round).find(|branch| branch.has_succeeded()));
                if let Some(winner) = winner {
                    return Some(Ok(winner.value()));
                }
                let failure = is_over.then(|| all_failed(fork.kind, branches))?;
                Some(Err(self.raised_here(failure)))
            }
            ForkKind::WithTimeout => match branches.first()?.outcome() {
                Some(Err(failure)) if is_evaporation(&failure) => Some(Ok(Value::NIL)),
                None if fork.late => {
                    let message = "the time of `with-timeout` is over";
                    Some(Err(self.raised_here(Failure::new(Builtin::Timeout, message))))
                }
                end => end,
            },
        }
    }

    /// What the branches returned, in the order of the source.
    fn values(&self, fork: &Fork) -> Value {
        Value::list(self.branches(fork).iter().map(Task::value))
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
    fn code_of(&self, id: TaskId) -> &Code {
        let at = if self.kind.is_loop() { 0 } else { id.0 - self.branches.start };
        &self.code[at as usize]
    }

    /// Its branches.
    pub(super) fn tasks(&self) -> impl Iterator<Item = TaskId> + use<> {
        self.branches.clone().map(TaskId)
    }

    /// Where the code of a branch begins.
    pub(super) fn entry_of(&self, id: TaskId) -> u32 {
        self.code_of(id).entry
    }

    /// Puts what a branch begins with into the first registers.
    pub(super) fn fill(&self, registers: &mut [Value], id: TaskId, element: Option<&Value>) {
        let mut at = 0;
        self.values_of(id, element).for_each(|value| {
            registers[at] = value.clone();
            at += 1;
        });
    }

    /// What a branch begins with: arguments, which are the tasks that have names and the element of its round
    /// (the parameter of its record), then what its function captured.
    pub(super) fn values_of<'f>(
        &'f self,
        id: TaskId,
        element: Option<&'f Value>,
    ) -> impl Iterator<Item = &'f Value> + use<'f> {
        let captured = match self.code_of(id).closure.obj() {
            Some(Obj::Closure(_, captured)) => &captured[..],
            _ => &[],
        };
        self.handles.iter().chain(element).chain(captured)
    }

    /// True if what comes before a branch has succeeded.
    fn may_start(&self, branches: &[Task], at: usize) -> bool {
        if self.kind.is_sequential() {
            return branches[..at].iter().all(|branch| branch.end.is_some());
        }
        let before = self.edges.iter().filter(|(_, after)| *after == at);
        // One that is left out or put off holds nobody up.
        before.into_iter().all(|(before, _)| branches[*before].has_returned())
    }
}

fn all_failed(kind: ForkKind, branches: &[Task]) -> Failure {
    let failures: Vec<Value> = branches.iter().filter_map(|it| it.failure().cloned()).collect();
    let message = format!("none of the {} alternatives of `{}` succeeded", failures.len(), kind.word());
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
