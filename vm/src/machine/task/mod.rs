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

use crate::host::Request;
use crate::log::Question;
use crate::native::Raise;
use crate::tree::{ROOT, RecId, SlotId, Why};
use crate::value::Value;

use super::cleanup::CleanUp;
use super::drive::{Call, Driver, Origin};
use super::obligation::Handling;
use super::{Frame, Here, Run};

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

/// A task, loaded or not.
pub(in crate::machine) struct Task {
    /// The place of its branch; that of the root for the root.
    pub slot: SlotId,
    /// Its record, once it has one.
    pub rec: RecId,
    pub parent: TaskId,
    /// Which branch of its parent it is, among all that the parent has started.
    pub ordinal: u32,
    /// How many tasks are above it.
    depth: u32,
    pub state: State,
    /// It stands still, with all below it.
    pub suspended: bool,
    /// Its status as a fluent, if somebody has asked for that.
    pub status: Option<Value>,
    /// Who waits for its end.
    pub joiners: Vec<(TaskId, u64)>,
    /// A program may have a handle of it.
    pub kept: bool,
    /// Why it is to be stopped. It is thrown once, outside of clean-ups.
    pub evaporate: Option<Why>,
    thrown: bool,
    /// When the time of the clean-up is over that it is part of.
    pub limit: u64,
    /// It has had a turn.
    has_begun: bool,
    /// It stands before an instruction that is not done, not behind a call.
    mid: bool,
    /// What `(original)` is in it, for branches of inserted code.
    pub origin: Option<Box<Origin>>,
    /// A branch with edits: its first turn makes this call.
    pub begins_with: Option<Box<Call>>,
    /// What its next turn begins with.
    pub raise: Option<Raise>,
    /// Tells this wait from all others of the run.
    pub token: u64,
    /// Facts and trees that its queries see for a while.
    pub scope: super::solve::Scoped,
    parked: Option<Box<Parked>>,
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
    drivers: Vec<Driver>,
    handling: Vec<Handling>,
    cleanups: Vec<CleanUp>,
    pc: u32,
    base: u32,
    here: Here,
    leaving: Option<u32>,
}

/// Registers of a task that are moved one by one; a deeper stack changes hands as a whole.
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
        let root = Task::new(ROOT, root, TaskId::ROOT, 0, 0);
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

    /// Which of two tasks stands first in the source: a parent before its branches, these in order.
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
        self.get(x).ordinal.cmp(&self.get(y).ordinal)
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

    /// Forgets tasks that have ended and that nobody can name, as far as they are the last ones: their
    /// numbers serve again.
    pub(in crate::machine) fn reclaim(&mut self) {
        while self.all.last().is_some_and(|task| task.state == State::Ended && !task.kept) {
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
                    self.get_mut(timer.task).raise = Some(super::cleanup::too_long());
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
    fn new(slot: SlotId, rec: RecId, parent: TaskId, ordinal: u32, depth: u32) -> Task {
        Task {
            slot,
            rec,
            parent,
            ordinal,
            depth,
            state: State::Ready,
            suspended: false,
            status: None,
            joiners: Vec::new(),
            kept: false,
            evaporate: None,
            thrown: false,
            limit: u64::MAX,
            has_begun: false,
            mid: false,
            origin: None,
            begins_with: None,
            raise: None,
            token: 0,
            scope: None,
            parked: None,
        }
    }
}

// ---------------------------------------------------------------------------------------------
// Loading

impl Run {
    /// A new branch of the loaded task. It waits until it is started.
    pub(in crate::machine) fn new_task(&mut self, slot: SlotId, ordinal: u32) -> TaskId {
        let parent = self.tasks.loaded;
        let depth = self.tasks.get(parent).depth + 1;
        let id = TaskId(self.tasks.all.len() as u32);
        let limit = self.cleanups.last().map_or(self.tasks.get(parent).limit, CleanUp::deadline);
        let scope = self.tasks.get(parent).scope.clone();
        self.tasks.all.push(Task { limit, scope, ..Task::new(slot, RecId(0), parent, ordinal, depth) });
        id
    }

    /// The task begins with a call, in the next round.
    pub(in crate::machine) fn start_call(&mut self, id: TaskId, call: Call) {
        let (pc, base, here) = (super::RESUME, 0, Here(call.parent.0));
        let task = self.tasks.get_mut(id);
        task.rec = call.rec;
        task.begins_with = Some(Box::new(call));
        task.parked =
            Some(Box::new(Parked { registers: vec![Value::NIL], pc, base, here, ..Parked::default() }));
        self.tasks.ready.push(id);
    }

    /// The task begins with the code at `pc`, with these values in its registers, in the next round.
    pub(in crate::machine) fn start_task(
        &mut self,
        id: TaskId,
        rec: RecId,
        pc: u32,
        values: impl Iterator<Item = Value>,
    ) {
        let mut parked = self.tasks.spare.pop().unwrap_or_default();
        (parked.pc, parked.base, parked.here) = (pc, 1, Here(rec.0));
        // It returns to a frame without instructions: that ends the task.
        parked.registers.push(Value::NIL);
        parked.registers.extend(values);
        parked.frames.push(Frame { pc: super::RESUME, base: 0, here: Here(rec.0), dst: 0 });
        let task = self.tasks.get_mut(id);
        task.rec = rec;
        task.parked = Some(parked);
        self.tasks.ready.push(id);
    }

    /// Puts the loaded task aside; it uses so many registers.
    fn park(&mut self, used: usize) {
        let mut parked = self.tasks.spare.pop().unwrap_or_default();
        match used > FEW {
            true => parked.registers = std::mem::replace(&mut self.stack, vec![Value::NIL; 1024]),
            false => {
                // Many may wait for long: no room that is not used.
                parked.registers.reserve_exact(used);
                parked.registers.extend(self.stack[..used].iter_mut().map(std::mem::take));
            }
        }
        self.exchange(&mut parked);
        let id = self.tasks.loaded;
        self.tasks.get_mut(id).parked = Some(parked);
    }

    fn unpark(&mut self, id: TaskId) {
        self.tasks.loaded = id;
        let Some(mut parked) = self.tasks.get_mut(id).parked.take() else { return };
        if parked.registers.len() > FEW {
            self.stack = std::mem::take(&mut parked.registers);
        } else {
            for (register, value) in self.stack.iter_mut().zip(parked.registers.drain(..)) {
                *register = value;
            }
        }
        self.exchange(&mut parked);
        if self.tasks.spare.len() < MOST_SPARE {
            self.tasks.spare.push(parked);
        }
    }

    /// The loaded task and a parked one change places, but for their registers. One of them is empty.
    fn exchange(&mut self, parked: &mut Parked) {
        std::mem::swap(&mut self.frames, &mut parked.frames);
        std::mem::swap(&mut self.drivers, &mut parked.drivers);
        std::mem::swap(&mut self.handling, &mut parked.handling);
        std::mem::swap(&mut self.cleanups, &mut parked.cleanups);
        std::mem::swap(&mut self.leaving, &mut parked.leaving);
        (self.pc, parked.pc) = (parked.pc, self.pc);
        (self.base, parked.base) = (parked.base, self.base);
        (self.here, parked.here) = (parked.here, self.here);
    }

    /// The innermost driver of a task that waits for its branches.
    pub(in crate::machine) fn driver_of(&mut self, id: TaskId) -> Option<&mut Driver> {
        if self.tasks.loaded == id {
            return self.drivers.last_mut();
        }
        self.tasks.get_mut(id).parked.as_mut()?.drivers.last_mut()
    }

    /// The frames and drivers of a task.
    pub(in crate::machine) fn frames_of(&self, id: TaskId) -> (&[Frame], &[Driver]) {
        match &self.tasks.get(id).parked {
            Some(parked) => (&parked.frames, &parked.drivers),
            None => (&self.frames, &self.drivers),
        }
    }

    /// The clean-ups that a task is in.
    pub(in crate::machine) fn cleanups_of(&mut self, id: TaskId) -> &mut [CleanUp] {
        match &mut self.tasks.get_mut(id).parked {
            Some(parked) => &mut parked.cleanups,
            None => &mut self.cleanups,
        }
    }

    /// The record whose code a task does.
    pub(in crate::machine) fn stands_in(&self, task: &Task) -> RecId {
        match &task.parked {
            // A branch with edits that has not begun.
            Some(_) if task.begins_with.is_some() => task.rec,
            Some(parked) => self.record(parked.here),
            None => self.record(self.here),
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
            Some(parked) => !parked.cleanups.is_empty(),
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
