//! Fluents: cells that tasks can wait for, and expressions over them.
//!
//! A **derived** fluent is a function of others. When one of these changes it is computed again, once
//! per change and after all that it depends on (its level is above theirs), so nobody sees a value that
//! is new in one part and old in another. Waiters are woken by the change itself, not by a later look at
//! the value, so a value that was true for a moment has woken them.

use std::cell::{Cell, RefCell};
use std::rc::Weak;

use crate::value::{Obj, Value};

/// A cell that tasks can wait for.
pub struct Fluent {
    /// Its number; later ones are greater.
    pub id: u64,
    /// What it is computed from, if it is computed.
    pub derived: Option<Derived>,
    /// What becomes of rises while nobody looks.
    pub missed: Missed,
    value: RefCell<Value>,
    /// How often it became true, or was pulsed.
    rises: Cell<u64>,
    dependents: RefCell<Vec<Weak<Obj>>>,
    waiters: RefCell<Vec<Waiter>>,
}

/// What `whenever` makes of rises that come while its body runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Missed {
    /// They are forgotten.
    Never,
    /// They are one.
    #[default]
    Once,
    /// Each counts.
    Always,
}

/// How a derived fluent is computed.
pub struct Derived {
    /// A function without parameters; nil for one that is as its input is, and is pulsed with it.
    pub function: Value,
    /// The fluents that it reads.
    pub inputs: Vec<Value>,
    /// Above the levels of all inputs; fluents that are set have level 0.
    pub level: u32,
}

/// Somebody who waits for a fluent.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Waiter {
    /// The run, by its number.
    pub run: u64,
    /// The task.
    pub task: u32,
    /// Which of its waits.
    pub token: u64,
    /// The position of its stack that takes the value.
    pub register: u32,
    /// What it waits for.
    pub until: Until,
}

/// What a task waits for in a fluent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Until {
    /// A true value, which it gets.
    True,
    /// More rises than this; it gets their number.
    Rises(u64),
}

impl Fluent {
    /// A fluent that holds a value until it is set.
    #[must_use]
    pub fn new(id: u64, value: Value) -> Fluent {
        Fluent::made(id, value, None)
    }
    /// A fluent that is computed; `value` is what it is now.
    #[must_use]
    pub fn derived(id: u64, value: Value, derived: Derived) -> Fluent {
        Fluent::made(id, value, Some(derived))
    }

    /// The same with its own way with missed rises.
    #[must_use]
    pub fn missing(mut self, missed: Missed) -> Fluent {
        self.missed = missed;
        self
    }

    fn made(id: u64, value: Value, derived: Option<Derived>) -> Fluent {
        Fluent {
            id,
            derived,
            missed: Missed::default(),
            value: RefCell::new(value),
            rises: Cell::new(0),
            dependents: RefCell::default(),
            waiters: RefCell::default(),
        }
    }

    /// What it holds.
    #[must_use]
    pub fn value(&self) -> Value {
        self.value.borrow().clone()
    }
    /// How often it became true, or was pulsed.
    #[must_use]
    pub fn rises(&self) -> u64 {
        self.rises.get()
    }
    /// Its place in the order of computing.
    #[must_use]
    pub fn level(&self) -> u32 {
        self.derived.as_ref().map_or(0, |it| it.level)
    }

    /// Gives it a value. Those who waited for that are taken out; nothing if it had this value.
    pub(crate) fn set(&self, value: Value) -> Option<Vec<(Waiter, Value)>> {
        let holds = self.value.borrow();
        if crate::value::equal(&holds, &value, crate::value::COMPARE_LIMIT) == Some(true) {
            return None;
        }
        if value.is_true() && !holds.is_true() {
            self.rises.set(self.rises.get() + 1);
        }
        drop(holds);
        self.put(value);
        Some(self.take_woken())
    }

    /// Puts a value into the cell; nobody hears of it.
    pub fn put(&self, value: Value) {
        *self.value.borrow_mut() = value;
    }

    /// It is as it was before somebody rehearsed something; nobody hears of it.
    pub(crate) fn put_back(&self, value: Value, rises: u64) {
        self.put(value);
        self.rises.set(rises);
    }

    /// As if it had become true for a moment.
    pub(crate) fn pulse(&self) -> Vec<(Waiter, Value)> {
        self.rises.set(self.rises.get() + 1);
        self.take_woken()
    }

    fn take_woken(&self) -> Vec<(Waiter, Value)> {
        let mut woken = Vec::new();
        self.waiters.borrow_mut().retain(|waiter| match self.answer(waiter.until) {
            Some(value) => {
                woken.push((*waiter, value));
                false
            }
            None => true,
        });
        woken
    }

    /// What somebody gets who waits for this, if he need not wait.
    pub(crate) fn answer(&self, until: Until) -> Option<Value> {
        match until {
            Until::True => Some(self.value()).filter(Value::is_true),
            Until::Rises(seen) => {
                let counted = if self.missed == Missed::Always { seen + 1 } else { self.rises.get() };
                (self.rises.get() > seen).then(|| Value::int(counted as i64))
            }
        }
    }

    /// Somebody waits. `stands` says of others whether they still do.
    pub(crate) fn wait(&self, waiter: Waiter, stands: impl Fn(&Waiter) -> bool) {
        const MANY: usize = 32;
        let mut waiters = self.waiters.borrow_mut();
        if waiters.len() >= MANY && waiters.len() == waiters.capacity() {
            waiters.retain(|other| stands(other));
        }
        waiters.push(waiter);
    }

    /// Tasks of a run that wait or have waited, with the token of the wait.
    pub(crate) fn waiting(&self, run: u64) -> impl Iterator<Item = (u32, u64)> {
        let waiters = self.waiters.borrow().clone();
        let of_run = waiters.into_iter().filter(move |waiter| waiter.run == run);
        of_run.map(|waiter| (waiter.task, waiter.token))
    }

    /// A derived fluent depends on this one.
    pub(crate) fn add_dependent(&self, dependent: Weak<Obj>) {
        let mut dependents = self.dependents.borrow_mut();
        if dependents.len() == dependents.capacity() {
            dependents.retain(|it| it.strong_count() > 0);
        }
        dependents.push(dependent);
    }

    /// Those that are computed from this one, as values.
    pub(crate) fn dependents(&self) -> Vec<Value> {
        self.dependents.borrow().iter().filter_map(|it| it.upgrade().map(Value::Obj)).collect()
    }

    pub(crate) fn take_values(&mut self) -> Vec<Value> {
        let derived = self.derived.take().map(|it| [vec![it.function], it.inputs].concat());
        let own = std::mem::take(self.value.get_mut());
        derived.unwrap_or_default().into_iter().chain([own]).collect()
    }
}
