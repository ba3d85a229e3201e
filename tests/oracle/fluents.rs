//! Fluents: cells that tasks wait for, and those that are computed from others.
//!
//! What a fluent holds is in the value, for natives look at it; who waits for it, what is computed from
//! it and how often it has risen is kept here, under its number.

use std::collections::BTreeMap;
use std::rc::{Rc, Weak};

use vm::failure::{Builtin, Failure};
use vm::fluent::{Derived, Fluent, Missed};
use vm::machine::TaskOp;
use vm::native::{Raise, type_error};
use vm::tree::Why;
use vm::value::{Obj, Value};

use super::Tree;
use super::eval::{Eval, Exit, Here, Run, Walker};
use super::tasks::{Awaits, Oracle, Stacks, Waits};

/// What is known of a fluent beside its value.
#[derive(Default)]
pub struct Known {
    /// How often it became true, or was pulsed.
    rises: u64,
    /// Those that are computed from it.
    dependents: Vec<Weak<Obj>>,
    waiting: Vec<Waiting>,
}

#[derive(Clone)]
struct Waiting {
    run: u64,
    task: usize,
    wait: u64,
    until: Until,
}

#[derive(Clone, Copy)]
enum Until {
    /// It is true; the value is what it holds.
    True,
    /// It has risen more often than this; the value is how often.
    Rises(u64),
}

/// Units of fuel that computing one may take.
const MOST_FUEL: u64 = 100_000;

fn fluent(value: &Value) -> Option<&Fluent> {
    if let Some(Obj::Fluent(fluent)) = value.obj() { Some(fluent) } else { None }
}

impl Walker<'_> {
    /// A fluent in words: by its name if it is a constant, or by the names in the expression that it is.
    pub fn fluent_in_words(&self, of: &Value) -> String {
        let constant = |it: &Fluent| {
            let is_it = |value: &Value| fluent(value).is_some_and(|other| other.id == it.id);
            let (global, _) = self.globals.iter().find(|(_, value)| is_it(value))?;
            let name = self.world.program().globals[global.at()];
            Some(format!("{name}, which holds {}", vm::print::brief(&it.value())))
        };
        let it = fluent(of).expect("it is waited for");
        let inputs = it.derived.iter().flat_map(|derived| &derived.inputs).filter_map(fluent);
        let inputs: Vec<String> = inputs.filter_map(constant).collect();
        match constant(it) {
            Some(words) => words,
            None if inputs.is_empty() => "a fluent".into(),
            None => format!("an expression over {}", inputs.join(", and ")),
        }
    }
}

impl<'p> Oracle<'_, 'p> {
    fn known(&mut self, of: &Fluent) -> &mut Known {
        self.fluents.entry(of.id).or_default()
    }

    fn number(&mut self) -> u64 {
        self.fresh += 1;
        self.fresh
    }

    pub fn new_fluent(&mut self, value: Value) -> Value {
        Value::new(Obj::Fluent(Box::new(Fluent::new(self.number(), value))))
    }

    /// What a native wants with fluents and tasks.
    pub fn task_op(&mut self, here: &Here, op: TaskOp) -> Eval<'p> {
        match op {
            TaskOp::Derive { function, inputs } => {
                let inputs: Vec<Value> = inputs.into_iter().filter(|it| fluent(it).is_some()).collect();
                match self.compute(&function)? {
                    Ok(value) => Ok(self.derived(function, inputs, value, Missed::default())),
                    Err(raise) => self.raise(here, raise),
                }
            }
            TaskOp::Pulsed(of, missed) => {
                let Some(it) = fluent(&of) else { return self.raise(here, type_error("a fluent", &of)) };
                let value = it.value();
                Ok(self.derived(Value::NIL, vec![of], value, missed))
            }
            TaskOp::Set(of, value) => match self.set_fluent(&of, value.clone())? {
                Ok(()) => Ok(value),
                Err(raise) => self.raise(here, raise),
            },
            TaskOp::Pulse(of) => match fluent(&of) {
                Some(it) => {
                    self.pulse(it);
                    Ok(Value::NIL)
                }
                None => self.raise(here, type_error("a fluent", &of)),
            },
            TaskOp::WaitFor(of, ns) => self.wait_for(here, &of, Until::True, ns),
            TaskOp::NextRise(of, seen) => {
                let Some(it) = fluent(&of) else { return self.raise(here, type_error("a fluent", &of)) };
                let rises = self.known(it).rises;
                match seen {
                    None if it.value().is_true() => Ok(Value::int(rises as i64)),
                    Some(seen) if it.missed != Missed::Never => {
                        self.wait_for(here, &of, Until::Rises(seen), None)
                    }
                    _ => self.wait_for(here, &of, Until::Rises(rises), None),
                }
            }
            TaskOp::Evaporate(task, emergency) => {
                let id = self.task_of(here, &task)?;
                self.run.tasks.evaporate(id, if emergency { Why::Emergency } else { Why::Asked });
                Ok(Value::NIL)
            }
            TaskOp::Suspend(task) => {
                let id = self.task_of(here, &task)?;
                self.suspend(id, true).map(|()| Value::NIL)
            }
            TaskOp::WakeUp(task) => {
                let id = self.task_of(here, &task)?;
                self.suspend(id, false).map(|()| Value::NIL)
            }
            TaskOp::Join(task) => {
                let id = self.task_of(here, &task)?;
                self.join(here, id)
            }
            TaskOp::Status(task) => {
                let id = self.task_of(here, &task)?;
                Ok(self.status(id))
            }
            // Its programs have no world that could change.
            TaskOp::World => {
                if self.run.world_fluent.is_none() {
                    self.run.world_fluent = Some(self.new_fluent(Value::NIL));
                }
                Ok(self.run.world_fluent.clone().unwrap_or_default())
            }
            TaskOp::WorldChanged(value) => Ok(value),
        }
    }

    /// A fluent computed from others; without a function one that is as its only input.
    fn derived(&mut self, function: Value, inputs: Vec<Value>, value: Value, missed: Missed) -> Value {
        let level = 1 + inputs.iter().filter_map(fluent).map(Fluent::level).max().unwrap_or(0);
        let derived = Derived { function, inputs: inputs.clone(), level };
        let it = Fluent::derived(self.number(), value, derived).missing(missed);
        let it = Value::new(Obj::Fluent(Box::new(it)));
        let Value::Obj(obj) = &it else { unreachable!("a fluent is no immediate value") };
        for input in inputs.iter().filter_map(fluent) {
            self.known(input).dependents.push(Rc::downgrade(obj));
        }
        it
    }

    fn dependents(&mut self, of: &Fluent) -> Vec<Value> {
        self.known(of).dependents.iter().filter_map(|it| it.upgrade().map(Value::Obj)).collect()
    }

    // ------------------------------------------------------------------ changes

    /// Sets a fluent and computes what depends on it, each once and after all that it depends on. The
    /// first failure, if computing failed.
    pub fn set_fluent(&mut self, of: &Value, value: Value) -> Result<Result<(), Raise>, Exit<'p>> {
        let Some(it) = fluent(of) else { return Ok(Err(type_error("a fluent", of))) };
        if it.derived.is_some() {
            return Ok(Err(type_error("a fluent that is not computed from others", of)));
        }
        let mut failed = Ok(());
        let mut todo: BTreeMap<(u32, u64), Value> = BTreeMap::new();
        let mut changed = self.put(it, value).then(|| of.clone());
        loop {
            let dependents = changed.iter().filter_map(fluent).flat_map(|it| self.dependents(it));
            for dependent in dependents.collect::<Vec<_>>() {
                let key = fluent(&dependent).map(|it| (it.level(), it.id)).expect("fluents depend on it");
                todo.insert(key, dependent);
            }
            let Some((_, next)) = todo.pop_first() else { return Ok(failed) };
            let (it, derived) =
                fluent(&next).and_then(|it| Some((it, it.derived.as_ref()?))).expect("it is derived");
            let value = match derived.inputs.first().and_then(fluent) {
                Some(input) if derived.function.is_nil() => Ok(input.value()),
                _ => self.compute(&derived.function)?,
            };
            changed = None;
            match value {
                Ok(value) => changed = self.put(it, value).then(|| next.clone()),
                // It keeps the value that it had.
                Err(raise) => failed = failed.and(Err(raise)),
            }
        }
    }

    /// Gives a fluent a value and wakes who waited for that. True if it had another one.
    fn put(&mut self, it: &Fluent, value: Value) -> bool {
        let old = it.value();
        if old == value {
            return false;
        }
        let rises = value.is_true() && !old.is_true();
        it.put(value);
        self.known(it).rises += u64::from(rises);
        self.wake(it);
        true
    }

    /// It rises for a moment, and what is as it is.
    fn pulse(&mut self, it: &Fluent) {
        self.known(it).rises += 1;
        self.wake(it);
        for dependent in self.dependents(it) {
            let dependent = fluent(&dependent).expect("fluents depend on it");
            if dependent.derived.as_ref().is_some_and(|derived| derived.function.is_nil()) {
                self.pulse(dependent);
            }
        }
    }

    fn wake(&mut self, it: &Fluent) {
        for waiting in self.known(it).waiting.clone() {
            if let Some(value) = self.answer(it, waiting.until)
                && let Some(run) = self.run_with(waiting.run)
                && run.tasks.waits(waiting.task, waiting.wait)
            {
                run.tasks.wake(waiting.task, value);
            }
        }
    }

    fn run_with(&mut self, number: u64) -> Option<&mut Run<'p>> {
        let walker = &mut **self;
        let mut runs = std::iter::once(&mut walker.run).chain(&mut walker.outer);
        runs.find(|run| run.number == number)
    }

    // ------------------------------------------------------------------ waiting

    /// What somebody gets who waits for this, if he need not wait.
    fn answer(&mut self, it: &Fluent, until: Until) -> Option<Value> {
        let rises = self.known(it).rises;
        match until {
            Until::True => Some(it.value()).filter(Value::is_true),
            // Each missed rise counts, or all of them are one.
            Until::Rises(seen) if it.missed == Missed::Always => {
                (rises > seen).then(|| Value::int(seen as i64 + 1))
            }
            Until::Rises(seen) => (rises > seen).then(|| Value::int(rises as i64)),
        }
    }

    fn wait_for(&mut self, here: &Here, of: &Value, until: Until, ns: Option<u64>) -> Eval<'p> {
        let Some(it) = fluent(of) else { return self.raise(here, type_error("a fluent", of)) };
        if let Some(value) = self.answer(it, until) {
            return Ok(value);
        }
        let time = ns.map(|ns| self.run.now.saturating_add(ns));
        let what = if time.is_some() { Waits::Time } else { Waits::Fluent };
        let wait = self.begin_wait(here, what, time)?;
        let (run, task) = (self.run.number, self.me);
        self.run.tasks.all[task].awaits = Some(Awaits::Fluent(of.clone()));
        self.known(it).waiting.push(Waiting { run, task, wait, until });
        self.end_wait(here, &mut [])
    }

    // ------------------------------------------------------------------ computing

    /// The value of a function without parameters, computed at once: it neither waits nor calls plans.
    fn compute(&mut self, function: &Value) -> Result<Result<Value, Raise>, Exit<'p>> {
        let inner = Run { number: u64::MAX, ..Run::new(Tree::begin(None)) };
        let outer = std::mem::replace(&mut self.run, inner);
        self.outer.push(outer);
        let stacks = std::mem::replace(&mut self.stacks, Stacks::of_root());
        let computing = self.computing.replace(MOST_FUEL);
        let root = Here::root(None);
        let result =
            self.ready(&root, function, Vec::new()).and_then(|ready| self.run_function(&root, ready));
        let inner = self.outer.pop().map(|outer| std::mem::replace(&mut self.run, outer));
        self.stacks = stacks;
        // It is part of the turn, or of what is being computed.
        let used = MOST_FUEL - std::mem::replace(&mut self.computing, computing).unwrap_or_default();
        match &mut self.computing {
            Some(left) => *left = left.saturating_sub(used),
            None => self.run.tasks.in_turn += used,
        }
        let refused = |what: &str| {
            let message = format!("an expression over fluents {what}");
            Ok(Err(Box::new(Failure::new(Builtin::ProgramError, message))))
        };
        match result {
            Err(Exit::GiveUp(why)) => Err(Exit::GiveUp(why)),
            _ if inner.is_some_and(|run| run.tree.records.len() > 1) => refused("calls no plans"),
            Ok(value) => Ok(Ok(value)),
            Err(Exit::Fail(failure)) => {
                // It is one of the task that has it computed.
                let failure = failure.as_failure().expect("only failures are raised").clone();
                Ok(Err(Box::new(Failure { task: None, ..failure })))
            }
            Err(Exit::Refused(what)) => refused(what),
            Err(_) => refused("does not jump"),
        }
    }
}
