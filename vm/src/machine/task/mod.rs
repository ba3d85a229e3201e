//! Tasks: the green threads of a run, in rounds.
//!
//! A run has one stack of registers and one of frames: those of the task that is **loaded**. The
//! others are parked, with as many registers as they use. Each task that was ready when a round began
//! has one *turn* in it, in the order of the source: until it waits, ends, or has used its quantum.
//! What becomes ready meanwhile has its turn in the next round. Between two rounds the clock moves,
//! timers fire, and answers from outside come in; parents look at children that have ended in their
//! own next turn, so all ends of one round are simultaneous.
//!
//! To stop a task from outside is to throw something in its next turn: it unwinds like a failure
//! that no handler takes, so its children end first and its clean-ups run.
//!
//! Here: what a task is, who is ready, and how tasks are loaded. [`round`] gives turns and moves the clock,
//! [`evaporation`] stops tasks, [`look`] shows them.

mod evaporation;
mod look;
mod round;

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use std::ops::Range;

use crate::host::Request;
use crate::log::Question;
use crate::native::Raise;
use crate::tree::{ROOT, RecId, SlotId, Why};
use crate::value::Value;

use super::cleanup::CleanUp;
use super::drive::{Call, Driver};
use super::fork::Fork;
use super::obligation::Handling;
use super::solve::Scoped;
use super::{Frame, Here, Outcome, Run};

pub(super) use evaporation::is_evaporation;

/// A task of a run. The root is number 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub(in crate::machine) struct TaskId(pub u32);

impl TaskId {
    pub(in crate::machine) const ROOT: TaskId = TaskId(0);
    pub(in crate::machine) fn at(self) -> usize {
        self.0 as usize
    }
}

/// A task, loaded or not. All but the root are branches of a parallel form.
pub(in crate::machine) struct Task {
    /// The place of its branch; that of the root for the root.
    pub slot: SlotId,
    /// Its record, once it has been started.
    pub rec: RecId,
    pub parent: TaskId,
    depth: u32,
    pub state: State,
    /// It stands still, with all below it.
    pub suspended: bool,
    /// A program may have a handle of it.
    pub kept: bool,
    /// Its form is over, and nobody can name it.
    forgotten: bool,
    /// Why it is to be stopped. It is thrown once, outside of clean-ups.
    pub evaporate: Option<Why>,
    thrown: bool,
    /// It has had a turn.
    has_begun: bool,
    /// It stands before an instruction that is not done, not behind a call.
    mid: bool,
    /// Tells this wait from all others of the run.
    pub token: u64,
    /// Its registers and frames, if it has had a turn and is not loaded.
    parked: Option<Box<Parked>>,
    rare: Option<Box<Rare>>,
    /// How it ended, as long as its form is not over.
    pub end: Option<End>,
}

/// There may be many tasks.
const _: () = assert!(size_of::<Task>() <= 80);

/// What few tasks have.
#[derive(Default)]
struct Rare {
    /// When the time of the clean-up is over that it is part of.
    limit: Option<u64>,
    /// What its next turn begins with.
    raise: Option<Raise>,
    /// Its status as a fluent, if somebody has asked for that.
    status: Option<Value>,
    /// Who waits for its end.
    joiners: Vec<(TaskId, u64)>,
    /// A branch with edits: its first turn makes this call.
    begins_with: Option<Box<Call>>,
    /// Facts and trees that its queries see for a while.
    scope: Scoped,
}

/// How a task ended.
pub(in crate::machine) struct End {
    /// Its value, or the failure that left it.
    value: Value,
    pub round: u64,
    failed: bool,
    /// An edit has left it out, or put it off: its end decides nothing.
    pub absent: bool,
}

/// What a task does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::machine) enum State {
    /// It has its turn, or will have it.
    Ready,
    /// It waits until somebody makes it ready.
    Waiting(Waits),
    /// It is over.
    Ended,
}

/// What a task waits for, in the words of `deadlock`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::machine) enum Waits {
    /// A time of the task clock.
    Time,
    /// The ends of its branches.
    Branches,
    /// An answer from outside.
    Answer,
    /// A fluent.
    Fluent,
    /// The end of another task.
    Join,
}

/// The registers and frames of a task that is not loaded.
#[derive(Default)]
pub(in crate::machine) struct Parked {
    registers: Vec<Value>,
    frames: Vec<Frame>,
    pc: u32,
    base: u32,
    here: Here,
    /// What most tasks that wait have nothing of.
    work: Option<Box<Work>>,
}

/// What a task is in the midst of.
#[derive(Default)]
struct Work {
    drivers: Vec<Driver>,
    handling: Vec<Handling>,
    cleanups: Vec<CleanUp>,
    leaving: Option<u32>,
}

/// Registers, and frames, of a task that are moved one by one; a deeper stack changes hands as a whole.
const FEW: usize = 4096;

/// The tasks of a run, who is ready, and what time will do.
pub(in crate::machine) struct Tasks {
    all: Vec<Task>,
    /// Whose registers and frames the run has.
    pub loaded: TaskId,
    /// The loaded task has its turn now.
    pub running: bool,
    /// Fuel used in this turn.
    pub in_turn: u64,
    /// Rounds of this run: those of a run inside of it are none of its own.
    pub rounds: u64,
    /// Who has a turn in this round, last first.
    round: Vec<TaskId>,
    /// Who has one in the next.
    ready: Vec<TaskId>,
    /// Who would have one, but stands still.
    held: Vec<TaskId>,
    /// A task of this run has been suspended.
    pub suspends: bool,
    /// A task used up its quantum in this round.
    busy: bool,
    timers: BinaryHeap<Reverse<Timer>>,
    /// How often nothing could go on.
    deadlocks: u32,
    /// Numbers waits: no two have the same token.
    waits: u64,
    /// Numbers timers, so that those of one time fire in the order of their making.
    timers_made: u64,
    /// What was asked of the outside in this round.
    asked: Vec<Asked>,
    /// Emptied ones, whose memory serves again.
    #[expect(clippy::vec_box, reason = "a box moves from a task to here and to the next task")]
    spare: Vec<Box<Parked>>,
}

/// A question to the outside that waits for the end of the round.
struct Asked {
    task: TaskId,
    request: Request,
    /// The same for the log.
    question: Question,
    /// The position of the task's stack that takes the answer.
    register: usize,
}

/// How many of these are kept.
const MOST_SPARE: usize = 1000;

#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Timer {
    at: u64,
    number: u64,
    task: TaskId,
    token: u64,
    /// It is not what the task waits for: the time of its clean-up is over then.
    ends_clean_up: bool,
}

impl Tasks {
    pub(in crate::machine) fn new(root: RecId) -> Tasks {
        let root = Task::new(ROOT, root, TaskId::ROOT, 0);
        Tasks {
            all: vec![root],
            loaded: TaskId::ROOT,
            running: true,
            in_turn: 0,
            rounds: 0,
            round: Vec::new(),
            ready: Vec::new(),
            held: Vec::new(),
            suspends: false,
            busy: false,
            timers: BinaryHeap::new(),
            deadlocks: 0,
            waits: 0,
            timers_made: 0,
            asked: Vec::new(),
            spare: Vec::new(),
        }
    }

    pub(in crate::machine) fn get(&self, id: TaskId) -> &Task {
        &self.all[id.at()]
    }

    pub(in crate::machine) fn get_mut(&mut self, id: TaskId) -> &mut Task {
        &mut self.all[id.at()]
    }

    /// Which of two tasks stands first in the source: a parent before its branches, these in order. (A task
    /// does one form at a time, and its branches are made in order.)
    fn order(&self, a: TaskId, b: TaskId) -> Ordering {
        let (mut x, mut y) = (a, b);
        while self.get(x).depth > self.get(y).depth {
            x = self.get(x).parent;
        }
        while self.get(y).depth > self.get(x).depth {
            y = self.get(y).parent;
        }
        if x == y {
            return self.get(a).depth.cmp(&self.get(b).depth);
        }
        while self.get(x).parent != self.get(y).parent {
            (x, y) = (self.get(x).parent, self.get(y).parent);
        }
        x.cmp(&y)
    }

    /// A task that waited has its turn in the next round.
    pub(in crate::machine) fn make_ready(&mut self, id: TaskId) {
        let task = self.get_mut(id);
        if let State::Waiting(_) = task.state {
            task.state = State::Ready;
            self.ready.push(id);
        }
    }

    /// True if a task still waits as it did when this was its token.
    pub(in crate::machine) fn is_waiting(&self, id: TaskId, token: u64) -> bool {
        let task = self.all.get(id.at());
        task.is_some_and(|task| task.token == token && matches!(task.state, State::Waiting(_)))
    }

    /// Who has a turn in the next round.
    pub(in crate::machine) fn ready_tasks(&self) -> Vec<TaskId> {
        self.ready.clone()
    }

    /// About how much memory they take.
    pub(in crate::machine) fn bytes(&self) -> usize {
        const REGISTERS: usize = 16;
        let task = size_of::<Task>() + size_of::<Parked>() + REGISTERS * size_of::<Value>();
        self.all.len() * task
    }

    /// How many there are.
    pub(in crate::machine) fn count(&self) -> u32 {
        self.all.len() as u32
    }

    /// So many will be added.
    pub(in crate::machine) fn reserve(&mut self, more: usize) {
        self.all.reserve(more);
    }

    /// A new branch of the loaded task. In a clean-up it has time until `limit`.
    pub(in crate::machine) fn add(&mut self, slot: SlotId, limit: Option<u64>) {
        let above = self.get(self.loaded);
        let limit = limit.or(above.limit());
        let branch = Task::new(slot, RecId(0), self.loaded, above.depth + 1);
        let scope = above.scope();
        let is_rare = limit.is_some() || scope.is_some();
        let rare = is_rare.then(|| Box::new(Rare { limit, scope, ..Rare::default() }));
        self.all.push(Task { rare, ..branch });
    }

    /// The branches of a form.
    pub(in crate::machine) fn branches(&self, range: &Range<u32>) -> &[Task] {
        &self.all[range.start as usize..range.end as usize]
    }

    /// A branch has a record: it has its first turn in the next round.
    pub(in crate::machine) fn start(&mut self, id: TaskId, rec: RecId) {
        self.get_mut(id).rec = rec;
        self.ready.push(id);
    }

    /// The form with these branches is over. Those that nobody can name are forgotten, as far as they are the
    /// last tasks: their numbers serve again.
    pub(in crate::machine) fn forget(&mut self, branches: &Range<u32>) {
        for task in &mut self.all[branches.start as usize..branches.end as usize] {
            (task.end, task.forgotten) = (None, !task.kept);
        }
        while self.all.last().is_some_and(|task| task.forgotten) {
            self.all.pop();
        }
    }

    /// The loaded task ends its turn and waits.
    pub(in crate::machine) fn wait(&mut self, waits: Waits) {
        self.running = false;
        self.waits += 1;
        let (id, token) = (self.loaded, self.waits);
        let task = self.get_mut(id);
        (task.state, task.token) = (State::Waiting(waits), token);
    }

    /// The loaded task waits until a time of the task clock.
    pub(in crate::machine) fn wait_until(&mut self, at: u64) {
        self.wait(Waits::Time);
        self.set_timer(at, false);
    }

    /// A timer for the wait of the loaded task.
    fn set_timer(&mut self, at: u64, ends_clean_up: bool) {
        let (task, token) = (self.loaded, self.get(self.loaded).token);
        self.timers_made += 1;
        self.timers.push(Reverse(Timer { at, number: self.timers_made, task, token, ends_clean_up }));
    }

    /// The time of the next timer that somebody still waits for.
    fn next_timer(&mut self) -> Option<u64> {
        while let Some(Reverse(timer)) = self.timers.peek() {
            if self.is_waiting(timer.task, timer.token) {
                return Some(timer.at);
            }
            self.timers.pop();
        }
        None
    }

    /// Makes those ready whose time has come.
    fn fire(&mut self, now: u64) {
        while self.next_timer().is_some_and(|at| at <= now) {
            if let Some(Reverse(timer)) = self.timers.pop() {
                if timer.ends_clean_up {
                    self.get_mut(timer.task).will_raise(super::cleanup::too_long());
                }
                self.make_ready(timer.task);
            }
        }
    }

    /// Those who became ready have their turns: in the order of the source, or in one that is drawn for a
    /// schedule and a round.
    fn begin_round(&mut self, drawn: Option<(u64, u64)>) {
        let mut ready = std::mem::take(&mut self.ready);
        if !ready.is_sorted_by(|a, b| self.order(*a, *b) != Ordering::Greater) {
            ready.sort_by(|a, b| self.order(*a, *b));
        }
        ready.reverse();
        if let Some((schedule, round)) = drawn {
            // Source: Fisher and Yates, the form of Durstenfeld, 1964.
            for i in (1..ready.len()).rev() {
                let number = crate::random::draw(schedule, round, 0, i as u64);
                ready.swap(i, (number % (i as u64 + 1)) as usize);
            }
        }
        // The memory of the last round serves the next one.
        self.ready = std::mem::replace(&mut self.round, ready);
    }
}

impl Task {
    fn new(slot: SlotId, rec: RecId, parent: TaskId, depth: u32) -> Task {
        Task {
            slot,
            rec,
            parent,
            depth,
            state: State::Ready,
            suspended: false,
            kept: false,
            forgotten: false,
            evaporate: None,
            thrown: false,
            has_begun: false,
            mid: false,
            token: 0,
            parked: None,
            rare: None,
            end: None,
        }
    }

    fn rare_mut(&mut self) -> &mut Rare {
        self.rare.get_or_insert_default()
    }

    /// When the time of the clean-up is over that it is part of.
    pub(in crate::machine) fn limit(&self) -> Option<u64> {
        self.rare.as_ref()?.limit
    }

    /// What its queries see for a while.
    pub(in crate::machine) fn scope(&self) -> Scoped {
        self.rare.as_ref()?.scope.clone()
    }

    pub(in crate::machine) fn set_scope(&mut self, scope: Scoped) {
        self.rare_mut().scope = scope;
    }

    /// Its next turn begins with a failure.
    pub(in crate::machine) fn will_raise(&mut self, raise: Raise) {
        self.rare_mut().raise = Some(raise);
    }

    /// Its status as a fluent, if somebody has asked for that.
    pub(in crate::machine) fn status(&self) -> Option<&Value> {
        self.rare.as_ref()?.status.as_ref()
    }

    pub(in crate::machine) fn show_status(&mut self, fluent: Value) {
        self.rare_mut().status = Some(fluent);
    }

    /// Another task waits for its end.
    pub(in crate::machine) fn add_joiner(&mut self, waiting: TaskId, token: u64) {
        self.rare_mut().joiners.push((waiting, token));
    }

    /// Who waits for its end.
    pub(in crate::machine) fn joiners(&self) -> &[(TaskId, u64)] {
        self.rare.as_ref().map_or(&[], |it| &it.joiners)
    }

    /// Its first turn makes this call.
    pub(in crate::machine) fn begin_with(&mut self, call: Call) {
        self.rare_mut().begins_with = Some(Box::new(call));
    }

    pub(in crate::machine) fn ends(&mut self, round: u64, outcome: Outcome, absent: bool) {
        let failed = outcome.is_err();
        let (Ok(value) | Err(value)) = outcome;
        self.end = Some(End { value, round, failed, absent });
    }

    pub(in crate::machine) fn is_running(&self) -> bool {
        self.rec != RecId(0) && self.end.is_none()
    }

    /// The failure that it ended with, if it was not stopped.
    pub(in crate::machine) fn failure(&self) -> Option<&Value> {
        self.end.as_ref().filter(|end| end.failed && !is_evaporation(&end.value)).map(|end| &end.value)
    }

    pub(in crate::machine) fn has_returned(&self) -> bool {
        self.end.as_ref().is_some_and(|end| !end.failed)
    }

    pub(in crate::machine) fn has_succeeded(&self) -> bool {
        self.end.as_ref().is_some_and(|end| !end.failed && !end.absent)
    }

    /// What it ended with.
    pub(in crate::machine) fn outcome(&self) -> Option<Outcome> {
        let end = self.end.as_ref()?;
        Some(if end.failed { Err(end.value.clone()) } else { Ok(end.value.clone()) })
    }

    /// What it returned; nil if it did not.
    pub(in crate::machine) fn value(&self) -> Value {
        self.end.as_ref().filter(|end| !end.failed).map(|end| end.value.clone()).unwrap_or_default()
    }

    /// The failures of clean-ups while it was stopped, and the round in which it ended. One that was in its
    /// clean-up already, and could not be stopped, ends with it.
    pub(in crate::machine) fn clean_up_failures(&self) -> Vec<(u64, Value)> {
        let Some(end) = self.end.as_ref().filter(|end| end.failed) else { return Vec::new() };
        let failures = match end.value.as_failure() {
            Some(it) if is_evaporation(&end.value) => it.also.clone(),
            _ => self.evaporate.map(|_| end.value.clone()).into_iter().collect(),
        };
        failures.into_iter().map(|failure| (end.round, failure)).collect()
    }
}

// ---------------------------------------------------------------------------------------------
// Loading

impl Run {
    /// Puts the loaded task aside; it uses so many registers.
    fn park(&mut self, used: usize) {
        let mut parked = self.tasks.spare.pop().unwrap_or_default();
        // Many may wait for long: no room that is not used.
        match used > FEW {
            true => parked.registers = std::mem::replace(&mut self.stack, vec![Value::NIL; 1024]),
            false => {
                parked.registers.reserve_exact(used);
                parked.registers.extend(self.stack[..used].iter_mut().map(std::mem::take));
            }
        }
        match self.frames.len() > FEW {
            true => parked.frames = std::mem::take(&mut self.frames),
            false => {
                parked.frames.reserve_exact(self.frames.len());
                parked.frames.append(&mut self.frames);
            }
        }
        let idle = self.drivers.is_empty() && self.handling.is_empty() && self.cleanups.is_empty();
        if !idle || self.leaving.is_some() {
            self.exchange(parked.work.get_or_insert_default());
        }
        (parked.pc, parked.base, parked.here) = (self.pc, self.base, self.here);
        self.tasks.get_mut(self.tasks.loaded).parked = Some(parked);
    }

    fn unpark(&mut self, id: TaskId) {
        self.tasks.loaded = id;
        let Some(mut parked) = self.tasks.get_mut(id).parked.take() else { return self.begin_branch(id) };
        if parked.registers.len() > FEW {
            self.stack = std::mem::take(&mut parked.registers);
        } else {
            for (register, value) in self.stack.iter_mut().zip(parked.registers.drain(..)) {
                *register = value;
            }
        }
        match parked.frames.len() > FEW {
            true => self.frames = std::mem::take(&mut parked.frames),
            false => self.frames.append(&mut parked.frames),
        }
        if let Some(work) = &mut parked.work {
            self.exchange(work);
        }
        (self.pc, self.base, self.here) = (parked.pc, parked.base, parked.here);
        if self.tasks.spare.len() < MOST_SPARE {
            self.tasks.spare.push(parked);
        }
    }

    /// What the loaded task is in the midst of changes places with nothing, or the other way round.
    fn exchange(&mut self, work: &mut Work) {
        std::mem::swap(&mut self.drivers, &mut work.drivers);
        std::mem::swap(&mut self.handling, &mut work.handling);
        std::mem::swap(&mut self.cleanups, &mut work.cleanups);
        std::mem::swap(&mut self.leaving, &mut work.leaving);
    }

    /// The registers for the first turn of a branch. It has no frames and drivers: where it ends, the task
    /// does.
    fn begin_branch(&mut self, id: TaskId) {
        let Run { tasks, tree, stack, drivers, .. } = self;
        let task = tasks.get(id);
        (self.pc, self.base, self.here) = (super::RESUME, 0, Here(task.rec.0));
        if task.rare.as_ref().is_some_and(|it| it.begins_with.is_some()) {
            // The call is made from where the form is.
            self.here = Here(tree.record(task.rec).parent.0);
            stack[0] = Value::NIL;
        } else if let Some(Driver::Fork(fork)) = innermost(tasks, drivers, task.parent) {
            self.pc = fork.entry_of(id);
            fork.fill(stack, id, tree.arg(task.rec, 0));
        }
    }

    /// What is in the registers of a task that is not loaded, or will be.
    fn values_of(&self, id: TaskId) -> Vec<Value> {
        let task = self.tasks.get(id);
        match (&task.parked, self.fork_of(id)) {
            (Some(parked), _) => parked.registers.clone(),
            (None, Some(fork)) if task.is_running() && !task.has_begun => {
                fork.values_of(id, self.tree.arg(task.rec, 0)).cloned().collect()
            }
            _ => Vec::new(),
        }
    }

    /// The innermost driver of a task that waits for its branches.
    pub(in crate::machine) fn driver_of(&mut self, id: TaskId) -> Option<&mut Driver> {
        if self.tasks.loaded == id {
            return self.drivers.last_mut();
        }
        self.tasks.get_mut(id).parked.as_mut()?.work.as_mut()?.drivers.last_mut()
    }

    /// The form that a task is a branch of.
    pub(in crate::machine) fn fork_of(&self, id: TaskId) -> Option<&Fork> {
        match innermost(&self.tasks, &self.drivers, self.tasks.get(id).parent)? {
            Driver::Fork(fork) if id != TaskId::ROOT => Some(fork),
            _ => None,
        }
    }

    /// The frames and drivers of a task.
    pub(in crate::machine) fn frames_of(&self, id: TaskId) -> (&[Frame], &[Driver]) {
        match &self.tasks.get(id).parked {
            Some(parked) => (&parked.frames, parked.drivers()),
            None => (&self.frames, &self.drivers),
        }
    }

    /// The clean-ups that a task is in.
    pub(in crate::machine) fn cleanups_of(&mut self, id: TaskId) -> &mut [CleanUp] {
        if self.tasks.loaded == id {
            return &mut self.cleanups;
        }
        let work = self.tasks.get_mut(id).parked.as_mut().and_then(|parked| parked.work.as_mut());
        work.map_or(&mut [], |work| &mut work.cleanups)
    }

    /// The record whose code a task does.
    pub(in crate::machine) fn stands_in(&self, id: TaskId) -> RecId {
        let task = self.tasks.get(id);
        match &task.parked {
            Some(parked) => self.record(parked.here),
            None if self.tasks.loaded == id => self.record(self.here),
            // A branch that has not begun.
            None => task.rec,
        }
    }

    /// The registers of a task from a position of its stack on.
    pub(in crate::machine) fn registers_of(&self, id: TaskId, from: usize) -> &[Value] {
        match &self.tasks.get(id).parked {
            Some(parked) => &parked.registers[from..],
            None => &self.stack[from..],
        }
    }

    /// True if a task stands still: it, or a task above it, is suspended. What is being stopped does not,
    /// for its clean-ups must run, and neither does what a clean-up has begun.
    fn is_held(&self, id: TaskId) -> bool {
        if !self.tasks.suspends {
            return false;
        }
        let mut at = id;
        loop {
            let task = self.tasks.get(at);
            if task.evaporate.is_some() || self.is_cleaning_up(at) {
                return false;
            }
            if task.suspended {
                return true;
            }
            if at == TaskId::ROOT {
                return false;
            }
            at = task.parent;
        }
    }

    /// Something has been woken up: those go on who were held by it.
    pub(in crate::machine) fn release(&mut self) {
        let held = std::mem::take(&mut self.tasks.held);
        let (held, free): (Vec<_>, Vec<_>) = held.into_iter().partition(|id| self.is_held(*id));
        self.tasks.held = held;
        self.tasks.ready.extend(free);
    }

    /// Asks a task to stop. It does so in its next turn, or when the clean-up is over that it is in.
    pub(in crate::machine) fn evaporate(&mut self, id: TaskId, why: Why) {
        let task = self.tasks.get_mut(id);
        if why == Why::Emergency && task.evaporate.is_some() {
            // It is on its way already, and owes nothing from now on.
            task.evaporate = Some(why);
        }
        if task.state == State::Ended || task.evaporate.is_some() {
            return;
        }
        task.evaporate = Some(why);
        if !self.is_cleaning_up(id) {
            self.tasks.make_ready(id);
        }
        self.release();
    }

    /// True if the loaded task is stopped in an emergency: it, or what it is part of.
    pub(in crate::machine) fn is_emergency(&self) -> bool {
        let up = |at: &TaskId| (*at != TaskId::ROOT).then(|| self.tasks.get(*at).parent);
        let mut around = std::iter::successors(Some(self.tasks.loaded), up);
        around.any(|at| self.tasks.get(at).evaporate == Some(Why::Emergency))
    }

    fn is_cleaning_up(&self, id: TaskId) -> bool {
        match &self.tasks.get(id).parked {
            Some(parked) => parked.work.as_ref().is_some_and(|work| !work.cleanups.is_empty()),
            None => self.tasks.loaded == id && !self.cleanups.is_empty(),
        }
    }

    pub(in crate::machine) fn set_register(&mut self, id: TaskId, at: usize, value: Value) {
        if self.tasks.loaded == id {
            self.stack[at] = value;
        } else if let Some(parked) = &mut self.tasks.get_mut(id).parked {
            parked.registers[at] = value;
        }
    }
}

impl Parked {
    fn drivers(&self) -> &[Driver] {
        self.work.as_ref().map_or(&[], |work| &work.drivers)
    }
}

/// The innermost driver of a task. The loaded one has these.
fn innermost<'r>(tasks: &'r Tasks, loaded: &'r [Driver], id: TaskId) -> Option<&'r Driver> {
    match &tasks.get(id).parked {
        Some(parked) => parked.drivers().last(),
        None if tasks.loaded == id => loaded.last(),
        None => None,
    }
}

impl Waits {
    fn word(self) -> &'static str {
        match self {
            Waits::Time => "a time",
            Waits::Branches => "its branches",
            Waits::Answer => "an answer",
            Waits::Fluent => "a fluent",
            Waits::Join => "the end of another task",
        }
    }
}
