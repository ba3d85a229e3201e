//! Tasks: the green threads of a run, in rounds.
//!
//! A run has one stack of registers and one of frames: those of the task that is **loaded**. The
//! others are parked, with as many registers as they use. Each task that was ready when a round began
//! has one *turn* in it, in the order of the source: until it waits, ends, or has used its quantum.
//! What becomes ready meanwhile has its turn in the next round. Between two rounds the clock moves,
//! timers fire, and answers from outside come in; parents look at children that have ended in their
//! own next turn, so all ends of one round are simultaneous.
//!
//! To stop a task from outside is to throw [`evaporation`] in its next turn: it unwinds like a failure
//! that no handler takes, so its children end first and its clean-ups run.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use crate::failure::{Builtin, Failure, TypeId};
use crate::host::{Host, Request};
use crate::log::Entry;
use crate::native::Raise;
use crate::path::Path;
use crate::tree::{ROOT, RecId, SlotId, Status, Why};
use crate::value::{Obj, Symbol, Value};

use super::call::Slow;
use super::cleanup::CleanUp;
use super::drive::{Call, Driver, Origin};
use super::obligation::Handling;
use super::{Exit, Frame, Here, Machine, Outcome, QUANTUM_NS, Run, from_json};

/// A task of a run. The root is number 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub(super) struct TaskId(pub u32);

impl TaskId {
    pub(super) const ROOT: TaskId = TaskId(0);
    pub(super) fn at(self) -> usize {
        self.0 as usize
    }
}

/// A task, loaded or not.
pub(super) struct Task {
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
    parked: Option<Box<Parked>>,
}

/// What a task does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum State {
    /// It has its turn, or will have it.
    Ready,
    /// It waits until somebody makes it ready.
    Waiting(Waits),
    /// It is over.
    Ended,
}

/// What a task waits for, in the words of `deadlock`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Waits {
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
pub(super) struct Parked {
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

/// How often a run may come to where nothing can go on: each time something is stopped.
const MOST_DEADLOCKS: u32 = 10_000;

/// Registers of a task that are moved one by one; a deeper stack changes hands as a whole.
const FEW: usize = 4096;

/// The tasks of a run, who is ready, and what time will do.
pub(super) struct Tasks {
    all: Vec<Task>,
    /// Whose registers and frames the run has.
    pub loaded: TaskId,
    /// The loaded task has its turn now.
    pub running: bool,
    /// Fuel used in this turn.
    pub in_turn: u64,
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
    asked: Vec<(TaskId, Request, usize)>,
    /// Emptied ones, whose memory serves again.
    #[expect(clippy::vec_box, reason = "a box moves from a task to here and to the next task")]
    spare: Vec<Box<Parked>>,
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
    pub(super) fn new(root: RecId) -> Tasks {
        let root = Task::new(ROOT, root, TaskId::ROOT, 0, 0);
        Tasks {
            all: vec![root],
            loaded: TaskId::ROOT,
            running: true,
            in_turn: 0,
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

    pub(super) fn get(&self, id: TaskId) -> &Task {
        &self.all[id.at()]
    }

    pub(super) fn get_mut(&mut self, id: TaskId) -> &mut Task {
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
    pub(super) fn make_ready(&mut self, id: TaskId) {
        let task = self.get_mut(id);
        if let State::Waiting(_) = task.state {
            task.state = State::Ready;
            self.ready.push(id);
        }
    }

    /// True if a task still waits as it did when this was its token.
    pub(super) fn is_waiting(&self, id: TaskId, token: u64) -> bool {
        let task = self.all.get(id.at());
        task.is_some_and(|task| task.token == token && matches!(task.state, State::Waiting(_)))
    }

    /// About how much memory they take.
    pub(super) fn bytes(&self) -> usize {
        const REGISTERS: usize = 16;
        let task = size_of::<Task>() + size_of::<Parked>() + REGISTERS * size_of::<Value>();
        self.all.len() * task
    }

    /// Forgets tasks that have ended and that nobody can name, as far as they are the last ones: their
    /// numbers serve again.
    pub(super) fn reclaim(&mut self) {
        while self.all.last().is_some_and(|task| task.state == State::Ended && !task.kept) {
            self.all.pop();
        }
    }

    /// The loaded task ends its turn and waits.
    pub(super) fn wait(&mut self, waits: Waits) {
        self.running = false;
        self.waits += 1;
        let (id, token) = (self.loaded, self.waits);
        let task = self.get_mut(id);
        (task.state, task.token) = (State::Waiting(waits), token);
    }

    /// The loaded task waits until a time of the task clock.
    pub(super) fn wait_until(&mut self, at: u64) {
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
            parked: None,
        }
    }
}

// ---------------------------------------------------------------------------------------------
// Loading

impl Run {
    /// A new branch of the loaded task. It waits until it is started.
    pub(super) fn new_task(&mut self, slot: SlotId, ordinal: u32) -> TaskId {
        let parent = self.tasks.loaded;
        let depth = self.tasks.get(parent).depth + 1;
        let id = TaskId(self.tasks.all.len() as u32);
        let limit = self.cleanups.last().map_or(self.tasks.get(parent).limit, CleanUp::deadline);
        self.tasks.all.push(Task { limit, ..Task::new(slot, RecId(0), parent, ordinal, depth) });
        id
    }

    /// The task begins with a call, in the next round.
    pub(super) fn start_call(&mut self, id: TaskId, call: Call) {
        let (pc, base, here) = (super::RESUME, 0, Here(call.parent.0));
        let task = self.tasks.get_mut(id);
        task.rec = call.rec;
        task.begins_with = Some(Box::new(call));
        task.parked =
            Some(Box::new(Parked { registers: vec![Value::NIL], pc, base, here, ..Parked::default() }));
        self.tasks.ready.push(id);
    }

    /// The task begins with the code at `pc`, with these values in its registers, in the next round.
    pub(super) fn start_task(
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
    pub(super) fn driver_of(&mut self, id: TaskId) -> Option<&mut Driver> {
        if self.tasks.loaded == id {
            return self.drivers.last_mut();
        }
        self.tasks.get_mut(id).parked.as_mut()?.drivers.last_mut()
    }

    /// The frames and drivers of a task.
    pub(super) fn frames_of(&self, id: TaskId) -> (&[Frame], &[Driver]) {
        match &self.tasks.get(id).parked {
            Some(parked) => (&parked.frames, &parked.drivers),
            None => (&self.frames, &self.drivers),
        }
    }

    /// The registers of a task from a position of its stack on.
    pub(super) fn registers_of(&self, id: TaskId, from: usize) -> &[Value] {
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
    pub(super) fn release(&mut self) {
        let held = std::mem::take(&mut self.tasks.held);
        let (held, free): (Vec<_>, Vec<_>) = held.into_iter().partition(|id| self.is_held(*id));
        self.tasks.held = held;
        self.tasks.ready.extend(free);
    }

    /// Asks a task to stop. It does so in its next turn, or when the clean-up is over that it is in.
    pub(super) fn evaporate(&mut self, id: TaskId, why: Why) {
        let task = self.tasks.get_mut(id);
        if task.state == State::Ended || task.evaporate.is_some() {
            return;
        }
        task.evaporate = Some(why);
        if !self.is_cleaning_up(id) {
            self.tasks.make_ready(id);
        }
        self.release();
    }

    fn is_cleaning_up(&self, id: TaskId) -> bool {
        match &self.tasks.get(id).parked {
            Some(parked) => !parked.cleanups.is_empty(),
            None => self.tasks.loaded == id && !self.cleanups.is_empty(),
        }
    }

    pub(super) fn set_register(&mut self, id: TaskId, at: usize, value: Value) {
        if self.tasks.loaded == id {
            self.stack[at] = value;
        } else if let Some(parked) = &mut self.tasks.get_mut(id).parked {
            parked.registers[at] = value;
        }
    }
}

impl Machine {
    /// Makes a task the loaded one.
    fn load(&mut self, id: TaskId) {
        let loaded = self.top().tasks.loaded;
        if loaded == id {
            return;
        }
        if self.top().tasks.get(loaded).state != State::Ended {
            let used = self.window_above() as usize;
            self.top().park(used);
        }
        self.top().unpark(id);
    }

    // ------------------------------------------------------------------ turns

    /// Gives the next task its turn. Answers the outcome if that ends the outermost run.
    pub(super) fn next_turn(&mut self, host: &mut dyn Host) -> Option<Outcome> {
        loop {
            let Some(id) = self.top().tasks.round.pop() else {
                let outcome = self.end_round(host);
                if outcome.is_some() || self.halted || self.top().tasks.running {
                    return outcome;
                }
                continue;
            };
            if self.top().tasks.get(id).state != State::Ready {
                continue;
            }
            if self.top().is_held(id) {
                self.top().tasks.held.push(id);
                continue;
            }
            self.load(id);
            let tasks = &mut self.top().tasks;
            (tasks.running, tasks.in_turn) = (true, 0);
            return self.begin_turn(host);
        }
    }

    /// What a turn begins with: the end of the task, if somebody asked for it, or a failure.
    fn begin_turn(&mut self, host: &mut dyn Host) -> Option<Outcome> {
        let run = self.top();
        let task = run.tasks.get_mut(run.tasks.loaded);
        let (mid, has_begun) = (std::mem::take(&mut task.mid), std::mem::replace(&mut task.has_begun, true));
        let (rec, raise) = (task.rec, task.raise.take());
        if let (false, Some(why)) = (has_begun, task.evaporate) {
            // It has a record nevertheless, which begins and ends now.
            task.thrown = true;
            run.tree.record_mut(rec).start = run.now;
            return self.end_task(host, Err(evaporation(why)));
        }
        let asked = task.evaporate.is_some() && !task.thrown && run.cleanups.is_empty();
        if mid && (asked || raise.is_some()) {
            // Frames are looked up one instruction back, where calls stand.
            run.pc += 1;
        }
        if let Some(raise) = raise {
            return self.refuse(host, raise);
        }
        let exit = match self.evaporate_if_asked(host) {
            Some(exit) => Some(exit),
            None => self.begin_edited(host),
        };
        self.task_exit(host, exit?)
    }

    /// The call of a branch with edits.
    fn begin_edited(&mut self, host: &mut dyn Host) -> Option<Exit> {
        let run = self.top();
        let call = run.tasks.get_mut(run.tasks.loaded).begins_with.take()?;
        match self.drive(host, 0, *call) {
            Ok(exit) => exit,
            Err(raise) => self.unwind(host, raise),
        }
    }

    /// Throws what stops the loaded task, if somebody asked for that and no clean-up runs.
    pub(super) fn evaporate_if_asked(&mut self, host: &mut dyn Host) -> Option<Exit> {
        let run = self.top();
        let task = run.tasks.get_mut(run.tasks.loaded);
        let why = task.evaporate.filter(|_| !task.thrown && run.cleanups.is_empty())?;
        task.thrown = true;
        self.throw(host, evaporation(why))
    }

    /// The loaded task has used up its quantum.
    pub(super) fn use_up_turn(&mut self) {
        let tasks = &mut self.top().tasks;
        (tasks.running, tasks.busy) = (false, true);
        let id = tasks.loaded;
        tasks.get_mut(id).mid = true;
        tasks.ready.push(id);
    }

    /// The loaded task asks the outside; the answer goes to this position of its stack.
    pub(super) fn wait_for_answer(&mut self, request: Request, register: usize) {
        let tasks = &mut self.top().tasks;
        tasks.wait(Waits::Answer);
        tasks.asked.push((tasks.loaded, request, register));
    }

    /// The code of the loaded task has ended.
    pub(super) fn end_task(&mut self, host: &mut dyn Host, outcome: Outcome) -> Option<Outcome> {
        let id = self.top().tasks.loaded;
        if id == TaskId::ROOT {
            return self.end_run(outcome);
        }
        if let Err(failure) = &outcome {
            self.tell_of_clean_up(host, failure);
        }
        let rec = self.top().tasks.get(id).rec;
        // The record of a branch with edits may have been ended by its driver, or be deferred.
        let status = self.top().tree.record(rec).status;
        if !status.is_final() && status != Status::Deferred {
            match &outcome {
                Ok(value) => self.end_record(host, rec, Status::Succeeded, value.clone()),
                Err(failure) => self.fail_record(host, rec, failure),
            }
        }
        let run = self.top();
        run.tasks.running = false;
        run.tasks.get_mut(id).state = State::Ended;
        // Nothing of it is left but what others know of it.
        run.frames.clear();
        run.drivers.clear();
        run.leaving = None;
        run.handling.clear();
        run.cleanups.clear();
        for (waiting, token) in std::mem::take(&mut run.tasks.get_mut(id).joiners) {
            if run.tasks.is_waiting(waiting, token) {
                run.tasks.make_ready(waiting);
            }
        }
        self.status_changed(host, id);
        self.branch_ended(id, outcome);
        None
    }

    /// The loaded task waits. In a clean-up it does so for a limited time.
    pub(super) fn has_begun_to_wait(&mut self) {
        let run = self.top();
        let id = run.tasks.loaded;
        let task = run.tasks.get(id);
        match run.cleanups.last().map(CleanUp::deadline) {
            // Once it has been said that the time is over, it is not said again.
            Some(deadline) if deadline <= run.now => {}
            Some(deadline) => run.tasks.set_timer(deadline, true),
            // Who is to be stopped does not wait.
            None if task.evaporate.is_some() && !task.thrown => run.tasks.make_ready(id),
            None => {}
        }
    }

    // ------------------------------------------------------------------ between two rounds

    /// All had their turns: the clock moves, timers fire, answers come.
    fn end_round(&mut self, host: &mut dyn Host) -> Option<Outcome> {
        self.round += 1;
        let run = self.top();
        let busy = std::mem::take(&mut run.tasks.busy);
        let next = run.tasks.next_timer();
        if busy {
            let later = run.now + QUANTUM_NS;
            run.now = next.filter(|at| *at > run.now).map_or(later, |at| at.min(later));
        } else if run.tasks.ready.is_empty() && run.tasks.asked.is_empty() {
            match next {
                Some(at) => {
                    if !host.pass(at.saturating_sub(run.now)) {
                        // The round has not ended: it does so when the run goes on.
                        self.round -= 1;
                        self.halted = true;
                        return None;
                    }
                    run.now = run.now.max(at);
                }
                None => return self.deadlock(host),
            }
        }
        let now = run.now;
        run.tasks.fire(now);
        if let Err(differs) = self.answer_all(host) {
            return self.interrupt(host, Box::new(Failure::new(Builtin::ProgramError, differs)));
        }
        let full = self.check_memory_again(busy);
        let checked = if busy { full.and_then(|()| self.check_cleanups()) } else { full };
        if let Err(raise) = checked {
            let outcome = self.interrupt(host, raise);
            if outcome.is_some() {
                return outcome;
            }
        }
        let order = (self.schedule != 0).then_some((self.schedule, self.round));
        self.top().tasks.begin_round(order);
        None
    }

    /// Answers what the tasks asked in this round, from the log or from the host.
    fn answer_all(&mut self, host: &mut dyn Host) -> Result<(), String> {
        for (id, request, register) in std::mem::take(&mut self.top().tasks.asked) {
            if !matches!(self.top().tasks.get(id).state, State::Waiting(Waits::Answer)) {
                continue;
            }
            let words = request.describe();
            let entry = match self.log.replay(self.round, &words)? {
                Some(entry) => entry,
                None => {
                    let answer = host.answer(&request);
                    let (round, step, clock) = (self.round, self.steps, self.top().now);
                    let entry = Entry { round, step, clock, request: words, answer };
                    host.commit(&entry);
                    self.log.add(entry.clone());
                    entry
                }
            };
            let run = self.top();
            match entry.answer {
                Ok(answer) => run.set_register(id, register, from_json(&answer)),
                Err(why) => run.tasks.get_mut(id).raise = Some(no_answer(&request, why)),
            }
            run.tasks.make_ready(id);
        }
        Ok(())
    }

    /// Raises a failure between two rounds, in the task that ran last or else in the root.
    fn interrupt(&mut self, host: &mut dyn Host, raise: Raise) -> Option<Outcome> {
        let tasks = &self.top().tasks;
        let last = tasks.loaded;
        let id = if tasks.get(last).state == State::Ended { TaskId::ROOT } else { last };
        self.load(id);
        let tasks = &mut self.top().tasks;
        tasks.make_ready(id);
        // Frames are looked up one instruction back, where calls stand: a task that waits stands behind
        // its call, another one before an instruction that is not done.
        let mid = std::mem::take(&mut tasks.get_mut(id).mid);
        let runs = self.runs.len();
        self.top().pc += u32::from(mid);
        let outcome = self.refuse(host, raise);
        if self.runs.len() == runs {
            let tasks = &mut self.top().tasks;
            tasks.running = false;
            if tasks.get(id).state == State::Ended {
                tasks.ready.retain(|ready| *ready != id);
            }
        }
        outcome
    }

    /// Nobody can ever go on.
    fn deadlock(&mut self, host: &mut dyn Host) -> Option<Outcome> {
        let run = self.top();
        run.tasks.deadlocks += 1;
        if run.tasks.deadlocks > MOST_DEADLOCKS {
            let failure = Failure::new(Builtin::Deadlock, "nothing can go on, and nothing can be stopped");
            return Some(Err(self.abandon(failure)));
        }
        // What waits in a clean-up cannot be stopped by the failure of another task.
        let cleaning = run.tasks.all.iter().enumerate().map(|(at, task)| (TaskId(at as u32), task));
        let stuck = cleaning
            .filter(|(_, task)| matches!(task.state, State::Waiting(waits) if waits != Waits::Branches))
            .map(|(id, _)| id)
            .find(|id| run.is_cleaning_up(*id));
        if let Some(id) = stuck {
            run.tasks.get_mut(id).raise = Some(super::cleanup::too_long());
            run.tasks.make_ready(id);
            return None;
        }
        let mut lines: Vec<String> = Vec::new();
        for (at, task) in run.tasks.all.iter().enumerate() {
            let id = TaskId(at as u32);
            let what = match task.state {
                State::Waiting(waits) if waits != Waits::Branches => format!("waits for {}", waits.word()),
                State::Ready if run.tasks.held.contains(&id) => "is suspended".to_string(),
                _ => continue,
            };
            let here = task.parked.as_ref().map_or(run.here, |parked| parked.here);
            let path = Path::of(&run.tree, run.tree.record(run.record(here)).slot);
            lines.push(format!("{} {what}", path.show()));
        }
        let waits = Value::list(lines.iter().map(|line| Value::str(line.as_str())).collect::<Vec<_>>());
        let message = format!("nothing can go on: {}", lines.join("; "));
        let fields = vec![("message", Value::str(message)), ("waits", waits)];
        self.load(TaskId::ROOT);
        self.interrupt(host, Box::new(Failure::with(Builtin::Deadlock, fields)))
    }

    /// `(sleep s)`: the value of the call is nil, when the time has come.
    pub(super) fn sleep(&mut self, d: u8, ns: u64) -> Slow {
        let run = self.top();
        *run.register(d) = Value::NIL;
        run.tasks.wait_until(run.now.saturating_add(ns));
        Ok(Some(Exit::Wait))
    }
}

impl Machine {
    /// The tasks of the innermost run that have not ended: where each stands, and what it does.
    #[must_use]
    pub fn tasks(&self) -> Vec<(Path, String)> {
        let Some(run) = self.runs.last() else { return Vec::new() };
        if run.tree.record(RecId(1)).status.is_final() {
            return Vec::new();
        }
        let all = run.tasks.all.iter().enumerate();
        let open = all.filter(|(_, task)| task.state != State::Ended && task.rec != RecId(0));
        open.map(|(at, task)| {
            let id = TaskId(at as u32);
            let here = task.parked.as_ref().map_or(run.here, |parked| parked.here);
            let what = match task.state {
                _ if run.is_held(id) => "is suspended".to_string(),
                State::Waiting(waits) => format!("waits for {}", waits.word()),
                _ if run.tasks.running && run.tasks.loaded == id => "runs".to_string(),
                _ => "is ready".to_string(),
            };
            (Path::of(&run.tree, run.tree.record(run.record(here)).slot), what)
        })
        .collect()
    }

    /// The fluents in constants and in the registers of tasks, by their numbers; with their names where they
    /// are constants.
    #[must_use]
    pub fn fluents(&self) -> Vec<(Option<Symbol>, Value)> {
        let mut found = std::collections::BTreeMap::new();
        let mut add = |name: Option<Symbol>, value: &Value| {
            if let Some(Obj::Fluent(fluent)) = value.obj() {
                found.entry(fluent.id).or_insert_with(|| (name, value.clone()));
            }
        };
        let named = self.program.globals.iter().zip(&self.globals);
        named.for_each(|(name, value)| add(Some(*name), value));
        for run in &self.runs {
            let used = run.base as usize + 256;
            run.stack.iter().take(used).for_each(|value| add(None, value));
            let parked = run.tasks.all.iter().filter_map(|task| task.parked.as_ref());
            parked.flat_map(|it| &it.registers).for_each(|value| add(None, value));
        }
        found.into_values().collect()
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

fn no_answer(request: &Request, why: String) -> Raise {
    let path = match request {
        Request::ReadFile(path) | Request::WriteFile { path, .. } => Value::str(path.as_str()),
        Request::Clock => Value::NIL,
    };
    Box::new(Failure::with(Builtin::FileFailure, vec![("message", Value::str(why)), ("path", path)]))
}

// ---------------------------------------------------------------------------------------------
// Evaporation

/// The type of what stops a task. No program can name it, so no handler takes it.
const EVAPORATION: TypeId = TypeId(u32::MAX);

/// What unwinds a task that is stopped from outside.
pub(super) fn evaporation(why: Why) -> Value {
    let word = vec![(Symbol::from("why"), Value::symbol(why.word()))];
    Value::failure(Failure::of_type(EVAPORATION, Symbol::from("evaporated"), word))
}

/// True for what unwinds a task that is stopped from outside.
pub(super) fn is_evaporation(failure: &Value) -> bool {
    failure.as_failure().is_some_and(|it| it.kind == EVAPORATION)
}

impl Machine {
    /// A mistake of the program in a clean-up of a task that is stopped: no handler will see it.
    fn tell_of_clean_up(&mut self, host: &mut dyn Host, stopped: &Value) {
        let value = stopped.as_failure().filter(|it| it.kind == EVAPORATION).and_then(|it| it.also.first());
        let Some(failed) = value.and_then(Value::as_failure) else { return };
        if !self.program.failures.is_a(failed.kind, Builtin::ProgramError.id()) {
            return;
        }
        failed.name_task(&self.top().tree);
        let task = failed.path().unwrap_or_default();
        let message = failed.get(Symbol::from("message")).map(crate::print::brief).unwrap_or_default();
        let line =
            format!("a clean-up failed while its task was stopped: {} in {task}: {message}", failed.name);
        host.complain(&crate::show::safe(&line));
    }

    /// Makes a record final that a failure, or evaporation, leaves. A clean-up that failed while its task
    /// was stopped is the failure of the record.
    pub(super) fn fail_record(&mut self, host: &mut dyn Host, rec: RecId, failure: &Value) {
        let Some(it) = failure.as_failure().filter(|it| it.kind == EVAPORATION) else {
            return self.end_record(host, rec, Status::Failed, failure.clone());
        };
        let value = it.also.first().cloned().unwrap_or_default();
        let why = it.get(Symbol::from("why")).and_then(Value::as_symbol);
        let why = Why::ALL.iter().find(|known| why.is_some_and(|why| why == known.word()));
        self.top().tree.record_mut(rec).why = why.copied().unwrap_or_default();
        self.end_record(host, rec, Status::Evaporated, value);
    }
}
