//! Fluents that change, and tasks that wait for them or act on other tasks.

use std::collections::BTreeMap;
use std::rc::Rc;

use crate::failure::{Builtin, Failure};
use crate::fluent::{Derived, Fluent, Missed, Until, Waiter};
use crate::host::Host;
use crate::native::{Raise, type_error};
use crate::tree::{RecId, Status, Why};
use crate::value::{Handle, Obj, Value};

use super::call::Slow;
use super::task::{State, TaskId, Waits};
use super::{Exit, Here, Machine, RESUME, Run};

/// Fuel of one computation of a derived fluent.
const FUEL: u64 = 100_000;

/// A task is stopped without performing what it owes.
pub type Emergency = bool;

/// What a native wants with fluents and tasks; each call has the value that is said.
pub enum TaskOp {
    /// A fluent computed by a function from inputs.
    Derive {
        /// A function without parameters.
        function: Value,
        /// Values that it reads, fluents among them.
        inputs: Vec<Value>,
    },
    /// Gives a fluent a value; the value.
    Set(Value, Value),
    /// A fluent becomes true for a moment; nil.
    Pulse(Value),
    /// Waits until a fluent is true; its value, or nil when so many nanoseconds are over.
    WaitFor(Value, Option<u64>),
    /// Waits for more rises of a fluent than have been seen; their number. Without any seen, a fluent that
    /// is true has risen.
    NextRise(Value, Option<u64>),
    /// A fluent that is as another one, with its own way with missed rises.
    Pulsed(Value, Missed),
    /// Stops a task; nil. In an emergency nothing that it owes is performed.
    Evaporate(Value, Emergency),
    /// A task and all below it stand still; nil.
    Suspend(Value),
    /// They go on; nil.
    WakeUp(Value),
    /// Waits for the end of a task; its value.
    Join(Value),
    /// The status of a task, as a fluent.
    Status(Value),
    /// The version of the world, as a fluent.
    World,
    /// The world has changed: what is computed from it is computed again; this value.
    WorldChanged(Value),
}

/// How a fluent was before a rehearsal.
pub(super) struct Before {
    fluent: Value,
    value: Value,
    rises: u64,
}

impl Before {
    /// It is so again.
    pub(super) fn put_back(self) {
        if let Ok(fluent) = fluent_of(&self.fluent) {
            fluent.put_back(self.value, self.rises);
        }
    }
}

fn fluent_of(value: &Value) -> Result<&Fluent, Raise> {
    match value.obj() {
        Some(Obj::Fluent(fluent)) => Ok(fluent),
        _ => Err(type_error("a fluent", value)),
    }
}

/// A derived fluent as a value, known to what it is computed from.
fn add_to_inputs(fluent: Fluent) -> Value {
    let value = Value::new(Obj::Fluent(Box::new(fluent)));
    if let Value::Obj(it) = &value
        && let Obj::Fluent(fluent) = &**it
        && let Some(derived) = &fluent.derived
    {
        let inputs = derived.inputs.iter().filter_map(|input| fluent_of(input).ok());
        inputs.for_each(|input| input.add_dependent(Rc::downgrade(it)));
    }
    value
}

impl Machine {
    /// Does what a native wants with fluents and tasks.
    pub(super) fn task_op(&mut self, host: &mut dyn Host, d: u8, op: TaskOp) -> Slow {
        match op {
            TaskOp::Derive { function, inputs } => {
                let fluent = self.derive(host, function, inputs)?;
                self.put(d, fluent)
            }
            TaskOp::Set(fluent, value) => {
                self.set_fluent(host, &fluent, value.clone())?;
                self.put(d, value)
            }
            TaskOp::Pulse(fluent) => {
                self.pulse(&fluent)?;
                self.put(d, Value::NIL)
            }
            TaskOp::WaitFor(fluent, ns) => self.wait_for(d, &fluent, Until::True, ns),
            TaskOp::NextRise(fluent, seen) => {
                let it = fluent_of(&fluent)?;
                let seen = match seen {
                    None if it.value().is_true() => return self.put(d, Value::int(it.rises() as i64)),
                    Some(seen) if it.missed != Missed::Never => seen,
                    _ => it.rises(),
                };
                self.wait_for(d, &fluent, Until::Rises(seen), None)
            }
            TaskOp::Pulsed(fluent, missed) => {
                let it = fluent_of(&fluent)?;
                let derived =
                    Derived { function: Value::NIL, inputs: vec![fluent.clone()], level: it.level() + 1 };
                let pulsed = Fluent::derived(self.number(), it.value(), derived).missing(missed);
                let pulsed = add_to_inputs(pulsed);
                self.put(d, pulsed)
            }
            TaskOp::Evaporate(task, emergency) => {
                let id = self.task_of(&task)?;
                self.top().evaporate(id, if emergency { Why::Emergency } else { Why::Asked });
                self.put(d, Value::NIL)
            }
            TaskOp::Suspend(task) => {
                let id = self.task_of(&task)?;
                self.suspend(host, id, true)?;
                self.put(d, Value::NIL)
            }
            TaskOp::WakeUp(task) => {
                let id = self.task_of(&task)?;
                self.suspend(host, id, false)?;
                self.put(d, Value::NIL)
            }
            TaskOp::Join(task) => {
                let id = self.task_of(&task)?;
                self.join(host, d, id)
            }
            TaskOp::Status(task) => {
                let id = self.task_of(&task)?;
                let status = self.status_fluent(id);
                self.put(d, status)
            }
            TaskOp::World => {
                let fluent = self.world_fluent();
                self.put(d, fluent)
            }
            TaskOp::WorldChanged(value) => {
                if let Some(fluent) = self.top().world_fluent.clone() {
                    let version = self.world_version();
                    self.set_fluent(host, &fluent, version)?;
                }
                self.put(d, value)
            }
        }
    }

    // ------------------------------------------------------------------ fluents

    fn derive(&mut self, host: &mut dyn Host, function: Value, inputs: Vec<Value>) -> Result<Value, Raise> {
        let inputs: Vec<Value> = inputs.into_iter().filter(|it| fluent_of(it).is_ok()).collect();
        let value = self.compute(host, &function)?;
        let level =
            1 + inputs.iter().filter_map(|it| fluent_of(it).ok()).map(Fluent::level).max().unwrap_or(0);
        let derived = Derived { function, inputs, level };
        Ok(add_to_inputs(Fluent::derived(self.number(), value, derived)))
    }

    /// A number that no other fluent or stream gets.
    pub(super) fn number(&mut self) -> u64 {
        self.fresh += 1;
        self.fresh
    }

    fn pulse(&mut self, fluent: &Value) -> Result<(), Raise> {
        let mut todo = vec![fluent.clone()];
        while let Some(fluent) = todo.pop() {
            let it = fluent_of(&fluent)?;
            self.remember(&fluent);
            self.wake(it, it.pulse());
            let follows = |dependent: &Value| {
                let derived = fluent_of(dependent).ok().and_then(|it| it.derived.as_ref());
                derived.is_some_and(|derived| derived.function.is_nil())
            };
            todo.extend(it.dependents().into_iter().filter(follows));
        }
        Ok(())
    }

    /// Sets a fluent, and computes what depends on it: each once, after what it depends on.
    pub(super) fn set_fluent(
        &mut self,
        host: &mut dyn Host,
        fluent: &Value,
        value: Value,
    ) -> Result<(), Raise> {
        let it = fluent_of(fluent)?;
        if it.derived.is_some() {
            return Err(type_error("a fluent that is not computed from others", fluent));
        }
        self.remember(fluent);
        let Some(woken) = it.set(value) else { return Ok(()) };
        self.wake(it, woken);
        let mut todo: BTreeMap<(u32, u64), Value> = BTreeMap::new();
        let mut failed = None;
        let later = |todo: &mut BTreeMap<_, _>, changed: &Fluent| {
            for dependent in changed.dependents() {
                if let Ok(it) = fluent_of(&dependent) {
                    todo.insert((it.level(), it.id), dependent.clone());
                }
            }
        };
        later(&mut todo, it);
        while let Some((_, fluent)) = todo.pop_first() {
            let it = fluent_of(&fluent)?;
            let Some(derived) = &it.derived else { continue };
            let value = match derived.inputs.first().map(fluent_of) {
                Some(Ok(input)) if derived.function.is_nil() => Ok(input.value()),
                _ => self.compute(host, &derived.function),
            };
            match value {
                Ok(value) => {
                    self.remember(&fluent);
                    if let Some(woken) = it.set(value) {
                        self.wake(it, woken);
                        later(&mut todo, it);
                    }
                }
                // It keeps the value that it had; the others are computed all the same.
                Err(raise) => failed = failed.or(Some(raise)),
            }
        }
        failed.map_or(Ok(()), Err)
    }

    /// A rehearsal leaves fluents as they were: how this one is now, if it is older than the rehearsal that goes on.
    fn remember(&mut self, fluent: &Value) {
        let rehearsal = self.runs.iter_mut().rev().find_map(|run| run.before.as_mut());
        let (Some(before), Ok(it)) = (rehearsal, fluent_of(fluent)) else { return };
        let was = || Before { fluent: fluent.clone(), value: it.value(), rises: it.rises() };
        before.entry(it.id).or_insert_with(was);
    }

    /// Those who wait outside of a rehearsal go on waiting in it.
    fn wake(&mut self, fluent: &Fluent, woken: Vec<(Waiter, Value)>) {
        let rehearsal = self.runs.iter().find(|run| run.before.is_some()).map_or(0, |run| run.number);
        for (waiter, value) in woken {
            if waiter.run < rehearsal {
                fluent.wait(waiter, |_| true);
                continue;
            }
            let Some(run) = self.runs.iter_mut().find(|run| run.number == waiter.run) else { continue };
            let id = TaskId(waiter.task);
            if run.stands(&waiter) {
                run.set_register(id, waiter.register as usize, value);
                run.tasks.make_ready(id);
            }
        }
    }

    fn wait_for(&mut self, d: u8, fluent: &Value, until: Until, ns: Option<u64>) -> Slow {
        let it = fluent_of(fluent)?;
        if let Some(value) = it.answer(until) {
            return self.put(d, value);
        }
        let run = self.top();
        *run.register(d) = Value::NIL;
        match ns {
            Some(ns) => run.tasks.wait_until(run.now.saturating_add(ns)),
            None => run.tasks.wait(Waits::Fluent),
        }
        let id = run.tasks.loaded;
        let register = run.base + u32::from(d);
        let waiter = Waiter { run: run.number, task: id.0, token: run.tasks.get(id).token, register, until };
        it.wait(waiter, |other| other.run == run.number && run.stands(other));
        Ok(Some(Exit::Wait))
    }

    /// The value of a derived fluent.
    fn compute(&mut self, host: &mut dyn Host, function: &Value) -> Result<Value, Raise> {
        self.compute_at_once(host, function, Vec::new(), "an expression over fluents")
    }

    /// The value of a function, computed at once: it may not wait, and calls no plan. `what` it is, for
    /// messages.
    pub(super) fn compute_at_once(
        &mut self,
        host: &mut dyn Host,
        function: &Value,
        args: Vec<Value>,
        what: &str,
    ) -> Result<Value, Raise> {
        let mut run = self.scratch.take().unwrap_or_else(|| Box::new(Run::new(Default::default(), false, 0)));
        run.number = u64::MAX;
        (run.seed, run.projected) = (self.top().seed, self.top().projected);
        run.frames.clear();
        (run.pc, run.base, run.here) = (RESUME, 0, Here(1));
        // What is computed may look at the world, and nobody else looks meanwhile.
        run.world = self.top().world.take();
        run.world_fluent.clone_from(&self.top().world_fluent);
        let depth = self.runs.len();
        self.runs.push(run);
        let mut left = FUEL;
        let exit = match self.call_value(host, 0, crate::code::SiteId(0), function, args) {
            Ok(Some(exit)) => exit,
            Ok(None) => self.run_for(host, &mut left),
            Err(raise) => Exit::Failed(Value::new(Obj::Failure(raise))),
        };
        self.runs.truncate(depth + 1);
        let mut run = self.runs.pop();
        if let Some(run) = &mut run {
            (self.top().world, self.top().world_fluent) = (run.world.take(), run.world_fluent.take());
        }
        self.beside += FUEL - left;
        let has_nodes = run.as_ref().is_some_and(|run| run.tree.len() > 1);
        self.scratch = run.filter(|_| !has_nodes && matches!(exit, Exit::Done(_)));
        let refused = |why: &str| {
            let message = format!("{what} {why}");
            Box::new(Failure::new(Builtin::ProgramError, message))
        };
        match exit {
            _ if has_nodes => Err(refused("calls no plans")),
            Exit::Done(value) => Ok(value),
            Exit::Failed(failure) => match failure.as_failure() {
                Some(failure) => {
                    // It is one of the task that has it computed.
                    let mut failure = failure.clone();
                    failure.task = None;
                    Err(Box::new(failure))
                }
                None => Err(refused("failed")),
            },
            Exit::Fuel => Err(refused("takes too long")),
            Exit::Ask(..) | Exit::Wait | Exit::Began => Err(refused("does not wait")),
        }
    }

    // ------------------------------------------------------------------ tasks

    fn task_of(&mut self, value: &Value) -> Result<TaskId, Raise> {
        match value.obj() {
            Some(Obj::Task(handle)) if handle.run == self.top().number => Ok(TaskId(handle.task)),
            Some(Obj::Task(_)) => Err(type_error("a task of this run", value)),
            _ => Err(type_error("a task", value)),
        }
    }

    fn join(&mut self, host: &mut dyn Host, d: u8, id: TaskId) -> Slow {
        let run = self.top();
        let task = run.tasks.get(id);
        if task.state == State::Ended {
            let record = run.tree.record(task.rec);
            let value = record.value.clone();
            return match record.status {
                Status::Succeeded => self.put(d, value),
                Status::Failed => Ok(self.throw(host, value)),
                _ => self.put(d, Value::NIL),
            };
        }
        // It looks again when the other has ended.
        let mut ancestors = std::iter::successors(Some(run.tasks.loaded), |at| {
            (*at != TaskId::ROOT).then(|| run.tasks.get(*at).parent)
        });
        if ancestors.any(|at| at == id) {
            let message = "a task cannot wait for its own end, or for that of one that it is part of";
            return Err(Box::new(Failure::new(Builtin::ProgramError, message)));
        }
        run.pc -= 1;
        run.tasks.wait(Waits::Join);
        let waiting = run.tasks.loaded;
        let token = run.tasks.get(waiting).token;
        run.tasks.get_mut(id).add_joiner(waiting, token);
        Ok(Some(Exit::Wait))
    }

    /// The fluent of the world's version: one for each run.
    fn world_fluent(&mut self) -> Value {
        if let Some(fluent) = &self.top().world_fluent {
            return fluent.clone();
        }
        let fluent = Fluent::new(self.number(), self.world_version());
        let fluent = Value::new(Obj::Fluent(Box::new(fluent)));
        self.top().world_fluent = Some(fluent.clone());
        fluent
    }

    fn world_version(&mut self) -> Value {
        self.top().world.as_ref().map_or(Value::NIL, |world| Value::int(world.version() as i64))
    }

    fn status_fluent(&mut self, id: TaskId) -> Value {
        let word = self.top().status_word(id);
        if let Some(status) = self.top().tasks.get(id).status() {
            return status.clone();
        }
        let fluent = Fluent::new(self.number(), Value::symbol(word));
        let fluent = Value::new(Obj::Fluent(Box::new(fluent)));
        self.top().tasks.get_mut(id).show_status(fluent.clone());
        fluent
    }

    /// Tells those who look at the status of a task. What they compute from it may fail: that is a failure
    /// of the root.
    pub(super) fn status_changed(&mut self, host: &mut dyn Host, id: TaskId) {
        let run = self.top();
        let Some(status) = run.tasks.get(id).status().cloned() else { return };
        let word = Value::symbol(run.status_word(id));
        if let Err(raise) = self.set_fluent(host, &status, word) {
            let tasks = &mut self.top().tasks;
            tasks.get_mut(TaskId::ROOT).will_raise(raise);
            tasks.make_ready(TaskId::ROOT);
        }
    }

    fn suspend(&mut self, host: &mut dyn Host, id: TaskId, suspended: bool) -> Result<(), Raise> {
        let run = self.top();
        if run.tasks.get(id).state == State::Ended || run.tasks.get(id).suspended == suspended {
            return Ok(());
        }
        run.tasks.get_mut(id).suspended = suspended;
        run.tasks.suspends = true;
        let (rec, status) =
            (run.tasks.get(id).rec, if suspended { Status::Suspended } else { Status::Running });
        if rec != RecId(0) && !run.tree.record(rec).status.is_final() {
            run.tree.record_mut(rec).status = status;
        }
        if !suspended {
            run.release();
        }
        self.status_changed(host, id);
        Ok(())
    }
}

impl Run {
    /// True if somebody still waits as he said.
    fn stands(&self, waiter: &Waiter) -> bool {
        self.tasks.is_waiting(TaskId(waiter.task), waiter.token)
    }

    fn status_word(&self, id: TaskId) -> &'static str {
        let task = self.tasks.get(id);
        if task.rec == RecId(0) { Status::Created.word() } else { self.tree.record(task.rec).status.word() }
    }

    /// A handle of a task, for programs.
    pub(super) fn handle(&mut self, id: TaskId) -> Value {
        self.tasks.get_mut(id).kept = true;
        Value::new(Obj::Task(Handle { run: self.number, task: id.0 }))
    }
}
