//! Parallel forms: they start branches, decide by the ends of one round, and end when all branches have
//! ended. DESIGN 3.1.

use compiler::ast::{Expr, Function};
use vm::code::FnId;
use vm::failure::{Builtin, Failure};
use vm::key::Step;
use vm::machine::{ForkKind, nanoseconds};
use vm::tree::{NodeKind, Why};
use vm::value::{Symbol, Value};

use super::call::{Body, Call};
use super::eval::{Eval, Exit, Here, elements, round_keys, with_also};
use super::forms::Part;
use super::tasks::{End, Ended, Oracle, Resume, State, Wakes, Work, beside, failed_clean_ups};

/// So many branches of one form are begun.
const MOST_BRANCHES: usize = 300;

/// A parallel form that is being done.
struct Fork {
    kind: ForkKind,
    branches: Vec<Branch>,
    /// Which come before which.
    edges: Vec<(usize, usize)>,
    deadline: Option<u64>,
    /// The slot of the branch that was started first.
    first: Option<usize>,
}

struct Branch {
    task: usize,
    slot: usize,
    /// It is for this element of a list.
    element: Option<Value>,
    started: bool,
}

impl<'p> Oracle<'_, 'p> {
    /// A parallel form. `here` is the form.
    pub fn fork(
        &mut self,
        here: &Here,
        kind: ForkKind,
        extra: &'p Expr,
        functions: &'p [(Symbol, Function)],
        value_used: bool,
    ) -> Eval<'p> {
        let extra = self.value(here, extra)?;
        let codes: Vec<Value> = functions.iter().map(|(_, function)| self.lambda(here, function)).collect();
        self.burn(here)?;
        // A branch for each element, or for each function.
        let each: Vec<(usize, Option<(Value, Step)>)> = match kind {
            ForkKind::ParLoop | ForkKind::TryEach => {
                let (items, bad_end) = elements(&extra);
                if let Some(raise) = bad_end {
                    return self.raise(here, raise);
                }
                let keys = round_keys(&items);
                items.into_iter().zip(keys).map(|round| (0, Some(round))).collect()
            }
            _ => (0..functions.len()).map(|at| (at, None)).collect(),
        };
        if each.len() > MOST_BRANCHES {
            return Err(Exit::GiveUp("a form with so many branches".into()));
        }
        let mut branches = Vec::new();
        for (at, round) in &each {
            let (name, function) = &functions[*at];
            let place = here.place.inside(Part::Branch(*at, round.as_ref().map(|(_, key)| key.clone())));
            let way = round.iter().fold(here.way.clone(), |way, (_, key)| way.then(key.clone()));
            let there = Here { place, way, ..here.clone() };
            let site = self.site(std::ptr::from_ref(&functions[*at]) as usize);
            let plan = self.number_of_branch(function);
            let slot = self.slot(&there, site, *name, true, plan, value_used)?;
            branches.push((slot, round.as_ref().map(|(element, _)| element.clone())));
        }
        let begin = |(at, (slot, element))| {
            let task = self.new_task(at, slot);
            Branch { task, slot, element, started: false }
        };
        let branches: Vec<Branch> = branches.into_iter().enumerate().map(begin).collect();
        let (tags, edges) = match kind {
            ForkKind::ParLoop | ForkKind::TryEach | ForkKind::WithTimeout => (Vec::new(), Vec::new()),
            _ => tags_and_edges(&extra),
        };
        let handles: Vec<Value> = tags.iter().map(|at| self.handle_of(branches[*at].task)).collect();
        let deadline = match kind {
            ForkKind::WithTimeout => match nanoseconds(&extra) {
                Ok(ns) => Some(self.run.now.saturating_add(ns)),
                Err(raise) => return self.raise(here, raise),
            },
            _ => None,
        };
        let work: Vec<Work<'p>> = branches
            .iter()
            .zip(&each)
            .map(|(branch, (at, _))| {
                let args: Vec<Value> = handles.iter().cloned().chain(branch.element.clone()).collect();
                self.work_of_branch(here, branch, &codes[*at], args)
            })
            .collect();
        let mut fork = Fork { kind, branches, edges, deadline, first: None };
        beside(work.into_iter(), Vec::new(), &mut |below| self.watch(here, &mut fork, below))
    }

    fn work_of_branch(&self, here: &Here, branch: &Branch, code: &Value, args: Vec<Value>) -> Work<'p> {
        let (task, slot, code, here) = (branch.task, branch.slot, code.clone(), here.clone());
        self.work(task, move |it| {
            let rec = it.run.tasks.all[task].record.expect("it has been started");
            let place = it.run.tree.slots[slot].place.clone();
            it.branch_form(&here, place, |it, place| {
                let call = Call {
                    here: Here { place, ..here.clone() },
                    slot,
                    rec,
                    body: Body::Branch,
                    args,
                    code: Some(code),
                    goal: None,
                    edits: Vec::new(),
                };
                if it.run.tree.slots[slot].edits.is_empty() {
                    it.branch_body(&call, rec)
                } else {
                    it.begin(call)
                }
            })
        })
    }

    /// The machine's number for the function of a branch: edits of the branch are compiled for that.
    fn number_of_branch(&self, function: &Function) -> Option<FnId> {
        let span = function.span;
        let known = self.world.program().functions.iter().position(|it| {
            let place = (it.place.file, it.place.start, it.place.end);
            (it.kind, it.name) == (function.kind, function.name)
                && place == (span.file.0, span.start, span.end)
                && it.params == function.params
        });
        known.map(|at| FnId(at as u32))
    }

    // ------------------------------------------------------------------ deciding

    /// Starts branches and waits for them until the form has ended.
    fn watch(&mut self, here: &Here, fork: &mut Fork, below: &mut [Resume<'_, 'p>]) -> Eval<'p> {
        let mut ending: Option<Eval<'p>> = None;
        let mut late = false;
        loop {
            let time_is_over = fork.deadline.is_some_and(|at| at <= self.run.now) && self.is_open(fork);
            let mut until = fork.deadline;
            if ending.is_none() && time_is_over && !late {
                // What ends in this round ends in time.
                (late, until) = (true, Some(self.run.now));
            } else if ending.is_none() {
                ending = self.decide(here, fork, late);
                match &ending {
                    Some(Ok(_)) => self.stop_branches(fork, Why::Won),
                    Some(Err(_)) if late => self.stop_branches(fork, Why::Timeout),
                    Some(Err(_)) => self.stop_branches(fork, Why::Failed),
                    None => {
                        self.start_branches(here, fork)?;
                        if !self.is_open(fork) {
                            // What comes before the others has been stopped: they never begin.
                            ending = Some(Ok(self.values_of(fork)));
                        }
                    }
                }
            }
            if ending.is_some() {
                if !self.is_open(fork) {
                    break;
                }
                until = None;
            }
            let wakes = match fork.kind {
                _ if ending.is_some() => Wakes::Last,
                ForkKind::Par | ForkKind::ParLoop => Wakes::Failure,
                _ => Wakes::Any,
            };
            match self.wait_for_branches(here, wakes, until, below) {
                Ok(_) => {}
                Err(exit @ (Exit::GiveUp(_) | Exit::Refused(_))) => return Err(exit),
                Err(exit) if !self.is_open(fork) => return Err(exit),
                // It is stopped itself, or fails: its branches end before.
                Err(exit) => {
                    self.stop_branches(fork, Why::Parent);
                    ending = Some(Err(exit));
                }
            }
        }
        let mut clean_ups: Vec<(u64, Value)> =
            fork.branches.iter().flat_map(|branch| self.clean_up_failures(branch)).collect();
        clean_ups.sort_by_key(|(round, _)| *round);
        let clean_ups = clean_ups.into_iter().map(|(_, failure)| failure);
        let beside = |failure: Value| clean_ups.fold(failure, |it, other| with_also(&it, other));
        match ending.expect("it has been decided") {
            Err(Exit::Fail(failure)) => Err(Exit::Fail(beside(failure))),
            Err(Exit::Evaporate(stopped)) => Err(Exit::Evaporate(beside(stopped))),
            ending => ending,
        }
    }

    fn is_open(&self, fork: &Fork) -> bool {
        fork.branches
            .iter()
            .any(|branch| branch.started && self.run.tasks.all[branch.task].state != State::Ended)
    }

    fn end_of(&self, branch: &Branch) -> Option<&End> {
        self.run.tasks.all[branch.task].end.as_ref()
    }

    fn has_succeeded(&self, branch: &Branch) -> bool {
        self.end_of(branch).is_some_and(|end| matches!(end.how, Ended::Succeeded(_)))
    }

    /// What a form knows as the value of a branch, succeeded or not.
    fn value_of(&self, branch: &Branch) -> Value {
        match self.end_of(branch).map(|end| &end.how) {
            Some(Ended::Succeeded(value)) => value.clone(),
            _ => Value::NIL,
        }
    }

    fn values_of(&self, fork: &Fork) -> Value {
        Value::list(fork.branches.iter().map(|branch| self.value_of(branch)).collect::<Vec<_>>())
    }

    fn failure_of(&self, branch: &Branch) -> Option<Value> {
        match self.end_of(branch).map(|end| &end.how) {
            Some(Ended::Failed(failure)) => Some(failure.clone()),
            _ => None,
        }
    }

    /// The failures of clean-ups while the branch was stopped, with the round of its end. One that was in a
    /// clean-up already could not be stopped, and ends with what becomes of that.
    fn clean_up_failures(&self, branch: &Branch) -> Vec<(u64, Value)> {
        let Some(end) = self.end_of(branch) else { return Vec::new() };
        let was_stopped = self.run.tasks.all[branch.task].evaporate.is_some();
        let failures = match &end.how {
            Ended::Evaporated(stopped) => failed_clean_ups(stopped),
            Ended::Failed(failure) if was_stopped => vec![failure.clone()],
            Ended::Failed(_) | Ended::Succeeded(_) => Vec::new(),
        };
        failures.into_iter().map(|failure| (end.round, failure)).collect()
    }

    fn stop_branches(&mut self, fork: &Fork, why: Why) {
        for branch in fork.branches.iter().filter(|branch| branch.started) {
            self.run.tasks.evaporate(branch.task, why);
        }
    }

    /// Starts those before which all has been done.
    fn start_branches(&mut self, here: &Here, fork: &mut Fork) -> Result<(), Exit<'p>> {
        for at in 0..fork.branches.len() {
            if fork.branches[at].started || !self.may_start(fork, at) {
                continue;
            }
            let branch = &mut fork.branches[at];
            branch.started = true;
            let (slot, task) = (branch.slot, branch.task);
            let is_edited = !self.run.tree.slots[slot].edits.is_empty();
            let args = branch.element.iter().filter(|_| !is_edited).cloned().collect();
            let rec = self.enter(here.rec, slot, NodeKind::Branch, args);
            if !fork.edges.is_empty() {
                // Who begins later keeps his place among those of the form.
                let begun = fork.branches.iter().filter(|branch| branch.started);
                let begun: Vec<usize> = begun.map(|branch| branch.slot).collect();
                let first = *fork.first.get_or_insert(slot);
                self.run.tree.stands_with(slot, first, &begun);
            }
            self.start_task(task, rec)?;
        }
        Ok(())
    }

    fn may_start(&self, fork: &Fork, at: usize) -> bool {
        match fork.kind {
            ForkKind::TryInOrder | ForkKind::TryEach => {
                fork.branches[..at].iter().all(|branch| self.end_of(branch).is_some())
            }
            _ => {
                let before = fork.edges.iter().filter(|(_, after)| *after == at);
                before.into_iter().all(|(before, _)| self.has_succeeded(&fork.branches[*before]))
            }
        }
    }

    /// What the form ends with, if that is decided. What edits leave out or put off decides nothing.
    fn decide(&self, here: &Here, fork: &Fork, late: bool) -> Option<Eval<'p>> {
        let ended: Vec<(&Branch, &End)> =
            fork.branches.iter().filter_map(|branch| Some((branch, self.end_of(branch)?))).collect();
        let all_ended = ended.len() == fork.branches.len();
        let succeeded = |branch: &Branch, end: &End| self.has_succeeded(branch) && !end.absent;
        // The ends of the first round in which one is as wanted.
        let first = |wanted: &dyn Fn(&Branch, &End) -> bool| -> Option<Vec<&Branch>> {
            let rounds = ended.iter().filter(|(branch, end)| wanted(branch, end)).map(|(_, end)| end.round);
            let round = rounds.min()?;
            Some(ended.iter().filter(|(_, end)| end.round == round).map(|(branch, _)| *branch).collect())
        };
        let failure_of_all = |branches: &[&Branch]| {
            let failures = branches.iter().filter_map(|branch| self.failure_of(branch));
            failures.reduce(|first, other| with_also(&first, other))
        };
        let winner = |branches: &[&Branch]| {
            let winner =
                branches.iter().find(|branch| self.end_of(branch).is_some_and(|end| succeeded(branch, end)));
            winner.map(|branch| self.value_of(branch))
        };
        match fork.kind {
            ForkKind::Par | ForkKind::ParLoop | ForkKind::PartialOrder => {
                match first(&|branch, _| self.failure_of(branch).is_some()) {
                    Some(branches) => Some(Err(Exit::Fail(failure_of_all(&branches)?))),
                    None => all_ended.then(|| Ok(self.values_of(fork))),
                }
            }
            ForkKind::Pursue => match first(&|_, end| !end.absent) {
                Some(branches) => Some(match failure_of_all(&branches) {
                    Some(failure) => Err(Exit::Fail(failure)),
                    None => Ok(winner(&branches).unwrap_or_default()),
                }),
                None => all_ended.then_some(Ok(Value::NIL)),
            },
            ForkKind::TryAll | ForkKind::TryInOrder | ForkKind::TryEach => {
                let mut failures = ended.iter().filter_map(|(branch, _)| self.failure_of(branch));
                if let Some(grave) = failures.find(|failure| self.is_grave(failure)) {
                    return Some(Err(Exit::Fail(grave)));
                }
                if let Some(branches) = first(&succeeded) {
                    return winner(&branches).map(Ok);
                }
                all_ended.then(|| self.all_failed(here, fork))
            }
            ForkKind::WithTimeout => match ended.first() {
                Some((branch, end)) => Some(match &end.how {
                    Ended::Failed(failure) => Err(Exit::Fail(failure.clone())),
                    _ => Ok(self.value_of(branch)),
                }),
                None if late => {
                    let message = "the time of `with-timeout` is over";
                    Some(self.raise(here, Box::new(Failure::new(Builtin::Timeout, message))))
                }
                None => None,
            },
        }
    }

    /// Mistakes of the program and limits of the run are not hidden by another way to do it.
    fn is_grave(&self, failure: &Value) -> bool {
        let types = &self.world.program().failures;
        let kind = failure.as_failure().expect("only failures are raised").kind;
        [Builtin::ProgramError, Builtin::ResourceFailure].iter().any(|of| types.is_a(kind, of.id()))
    }

    fn all_failed(&self, here: &Here, fork: &Fork) -> Eval<'p> {
        let failures: Vec<Value> =
            fork.branches.iter().filter_map(|branch| self.failure_of(branch)).collect();
        let fields = vec![("message", Value::str("none succeeded")), ("failures", Value::list(failures))];
        self.raise(here, Box::new(Failure::with(Builtin::CompositeFailure, fields)))
    }
}

/// Which branches have tags, and which come before which: `((0 2) ((0 1) …))`.
fn tags_and_edges(spec: &Value) -> (Vec<usize>, Vec<(usize, usize)>) {
    let number = |value: &Value| value.as_int().expect("the compiler numbers branches") as usize;
    let parts: Vec<Vec<Value>> = spec.iter().map(|part| part.to_vec().unwrap_or_default()).collect();
    let pair = |edge: &Value| {
        let ends = edge.to_vec().unwrap_or_default();
        (number(&ends[0]), number(&ends[1]))
    };
    (parts[0].iter().map(number).collect(), parts[1].iter().map(pair).collect())
}
