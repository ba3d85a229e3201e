//! Tasks: whose turn it is, rounds, the clock, and what tasks do to each other. SEMANTICS, section 2.
//!
//! A task is a coroutine that walks its part of the program by recursion, so to wait is to suspend it in
//! the middle of that. The coroutines of the branches of a form live in the frame of the walker that
//! does the form ([`beside`]): a turn goes from the root down to the task that it is for. All that tasks
//! share is the [`Walker`], and it goes with the turn: who has no turn cannot touch it.

use std::ops::{Deref, DerefMut};
use std::rc::Rc;

use corosensei::stack::DefaultStack;
use corosensei::{CoroutineResult, ScopedCoroutine, Yielder};
use vm::failure::{Builtin, Failure, TypeId};
use vm::native::{Raise, type_error};
use vm::tree::{NodeKind, Status, Why};
use vm::value::{Handle, Obj, Symbol, Value};

use super::call::Call;
use super::eval::{Eval, Exit, Handler, Here, Run, Walker};

/// What goes with a turn.
pub type Baton<'p> = Box<Walker<'p>>;
type Turns<'p> = Yielder<Baton<'p>, Baton<'p>>;
/// What a task does, from its first turn on.
pub type Work<'p> = Box<dyn FnOnce(&Turns<'p>, Baton<'p>) -> Baton<'p> + 'p>;
/// Gives a task a turn.
pub type Resume<'s, 'p> = Box<dyn FnMut(Baton<'p>) -> Baton<'p> + 's>;

/// How large the stack of a task is, and how deep it may recurse: of the outermost run, and of others.
const OUTERMOST: (usize, usize) = (1 << 30, 20_000);
const OTHERS: (usize, usize) = (1 << 28, 5_000);

/// Units of fuel in a turn, and by how much a round with a used-up turn moves the clock.
const QUANTUM: u64 = 1000;
const QUANTUM_NS: u64 = 1_000_000;
/// How many of those who cannot go on a message names.
const MOST_TOLD: usize = 10;
/// The time that a clean-up has.
const CLEAN_UP_NS: u64 = 60_000_000_000;

/// The type of what stops a task: no program can name it.
const EVAPORATION: TypeId = TypeId(u32::MAX);

/// What is being done, outermost first.
#[derive(Clone)]
pub struct Stacks<'p> {
    /// Forms, by their numbers.
    pub forms: Vec<usize>,
    /// The bodies of records.
    pub bodies: Vec<(usize, Rc<Call>)>,
    pub handlers: Vec<Handler<'p>>,
    /// What is owed, by the slots in which it is performed.
    pub late: Vec<Option<usize>>,
}

impl Stacks<'_> {
    pub fn of_root() -> Self {
        Stacks { forms: vec![0], bodies: Vec::new(), handlers: Vec::new(), late: Vec::new() }
    }
}

/// The walker of one task.
pub struct Oracle<'t, 'p> {
    /// Here while it has its turn.
    baton: Option<Baton<'p>>,
    /// Where its turns come from; nothing for who only begins a run.
    turns: Option<&'t Turns<'p>>,
    /// Its number among the tasks of its run.
    pub me: usize,
    /// What it does. It begins with what its parent was doing.
    pub stacks: Stacks<'p>,
    depth: usize,
    most_depth: usize,
}

impl<'p> Deref for Oracle<'_, 'p> {
    type Target = Walker<'p>;
    fn deref(&self) -> &Walker<'p> {
        self.baton.as_ref().expect("it has its turn")
    }
}

impl<'p> DerefMut for Oracle<'_, 'p> {
    fn deref_mut(&mut self) -> &mut Walker<'p> {
        self.baton.as_mut().expect("it has its turn")
    }
}

/// A task of a run. The root is number 0.
pub struct Task {
    pub parent: usize,
    /// Which branch of its form it is.
    pub ordinal: usize,
    slot: usize,
    pub record: Option<usize>,
    pub state: State,
    suspended: bool,
    /// Its status as a fluent, if somebody has asked for that.
    status: Option<Value>,
    joiners: Vec<(usize, u64)>,
    /// Why it is to be stopped.
    pub evaporate: Option<Why>,
    /// That has been thrown in it.
    thrown: bool,
    /// What its next turn begins with.
    raise: Option<Raise>,
    /// The clean-ups that it is in, innermost last.
    clean_ups: Vec<CleanUp>,
    /// When the time of the clean-up is over that it is part of.
    limit: u64,
    /// The record whose code it does.
    stands_in: usize,
    /// What it waits for, where that has a name.
    pub awaits: Option<Awaits>,
    /// What it got that it waited for.
    got: Value,
    /// Which ends of its branches it wants to hear of.
    wakes: Wakes,
    pub end: Option<End>,
}

struct CleanUp {
    deadline: u64,
    /// It has been told that its time is over.
    told: bool,
}

/// The end of a task.
#[derive(Clone)]
pub struct End {
    pub round: u64,
    pub how: Ended,
    /// An edit has left its call out, or put it off.
    pub absent: bool,
}

#[derive(Clone)]
pub enum Ended {
    Succeeded(Value),
    Failed(Value),
    /// With what stopped it.
    Evaporated(Value),
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub enum State {
    /// Its form has not started it.
    Idle,
    Ready,
    /// This wait, for that.
    Waiting(u64, Waits),
    Ended,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Waits {
    Time,
    Branches,
    Fluent,
    Join,
}

/// A fluent, or a task.
pub enum Awaits {
    Fluent(Value),
    EndOf(usize),
}

/// Which ends of its branches wake a form; the end of the last one always does.
#[derive(Clone, Copy, PartialEq)]
pub enum Wakes {
    Any,
    Failure,
    Last,
}

struct Timer {
    at: u64,
    task: usize,
    wait: u64,
    /// It is not what the task waits for: the time of its clean-up is over.
    ends_clean_up: bool,
}

/// The tasks of a run.
pub struct Tasks {
    pub all: Vec<Task>,
    /// Whose turn it is.
    turn: usize,
    pub in_turn: u64,
    pub round: u64,
    /// A turn was used up in this round.
    busy: bool,
    /// Who has a turn in the next round.
    ready: Vec<usize>,
    /// Who would have one, but stands still.
    held: Vec<usize>,
    timers: Vec<Timer>,
    waits: u64,
}

impl Tasks {
    pub fn of_root() -> Tasks {
        let root = Task { record: Some(0), state: State::Ready, ..Task::new(0, 0, u64::MAX) };
        Tasks {
            all: vec![root],
            turn: 0,
            in_turn: 0,
            round: 0,
            busy: false,
            ready: vec![0],
            held: Vec::new(),
            timers: Vec::new(),
            waits: 0,
        }
    }

    /// The way from the root to a task: who stands first in the source comes first.
    fn way_to(&self, id: usize) -> Vec<usize> {
        let mut way: Vec<usize> =
            self.up_from(id).filter(|at| *at != 0).map(|at| self.all[at].ordinal).collect();
        way.reverse();
        way
    }

    /// A task, its parent, and so on.
    fn up_from(&self, id: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(id), |at| (*at != 0).then(|| self.all[*at].parent))
    }

    pub fn make_ready(&mut self, id: usize) {
        if let State::Waiting(..) = self.all[id].state {
            self.all[id].state = State::Ready;
            self.ready.push(id);
        }
    }

    /// True if a task still waits as it did.
    pub fn waits(&self, id: usize, wait: u64) -> bool {
        matches!(self.all[id].state, State::Waiting(other, _) if other == wait)
    }

    /// Ends a wait with what it was for.
    pub fn wake(&mut self, id: usize, got: Value) {
        self.all[id].got = got;
        self.make_ready(id);
    }

    /// True if a task stands still: it is suspended, or one above it, unless clean-up is being done between.
    fn is_held(&self, id: usize) -> bool {
        let free = |at: usize| self.all[at].evaporate.is_some() || !self.all[at].clean_ups.is_empty();
        let decides = |at: &usize| free(*at) || self.all[*at].suspended;
        self.up_from(id).find(decides).is_some_and(|at| !free(at))
    }

    /// Those go on who are not held any more.
    fn release(&mut self) {
        let held = std::mem::take(&mut self.held);
        let (held, free): (Vec<_>, Vec<_>) = held.into_iter().partition(|id| self.is_held(*id));
        self.held = held;
        self.ready.extend(free);
    }

    pub fn evaporate(&mut self, id: usize, why: Why) {
        let task = &mut self.all[id];
        if why == Why::Emergency && task.evaporate.is_some() {
            // It owes nothing from now on.
            task.evaporate = Some(why);
        }
        if task.state == State::Ended || task.evaporate.is_some() {
            return;
        }
        task.evaporate = Some(why);
        if task.clean_ups.is_empty() {
            self.make_ready(id);
        }
        self.release();
    }

    /// True if a task is stopped in an emergency: it, or one that it is part of.
    pub fn is_emergency(&self, id: usize) -> bool {
        self.up_from(id).any(|at| self.all[at].evaporate == Some(Why::Emergency))
    }

    pub fn open_branches(&self, of: usize) -> Vec<usize> {
        let is_open = |at: &usize| {
            let task = &self.all[*at];
            *at != 0 && task.parent == of && !matches!(task.state, State::Idle | State::Ended)
        };
        (0..self.all.len()).filter(is_open).collect()
    }

    fn next_timer(&self) -> Option<u64> {
        self.timers.iter().map(|timer| timer.at).min()
    }
}

impl Task {
    fn new(parent: usize, ordinal: usize, limit: u64) -> Task {
        Task {
            parent,
            ordinal,
            slot: 0,
            record: None,
            state: State::Idle,
            suspended: false,
            status: None,
            joiners: Vec::new(),
            evaporate: None,
            thrown: false,
            raise: None,
            clean_ups: Vec::new(),
            limit,
            stands_in: 0,
            awaits: None,
            got: Value::NIL,
            wakes: Wakes::Any,
            end: None,
        }
    }

    /// How long a clean-up may take that begins in it now.
    fn time_left(&self) -> u64 {
        self.clean_ups.last().map_or(self.limit, |outer| outer.deadline)
    }
}

/// Makes a coroutine of each piece of work, and does `then` while they live.
pub fn beside<'s, 'p, R>(
    mut todo: std::vec::IntoIter<Work<'p>>,
    mut made: Vec<Resume<'s, 'p>>,
    then: &mut dyn FnMut(&mut [Resume<'_, 'p>]) -> R,
) -> R {
    let Some(work) = todo.next() else { return then(&mut made) };
    coroutine(OTHERS.0, work).scope(|mut task| {
        // None of them lives longer than this one.
        let mut made: Vec<Resume<'_, 'p>> = made;
        made.push(Box::new(move |baton| turn_over(task.as_mut().resume(baton))));
        beside(todo, made, then)
    })
}

type Coroutine<'s, 'p> = ScopedCoroutine<'s, Baton<'p>, Baton<'p>, Baton<'p>, DefaultStack>;

fn coroutine<'s, 'p, W>(bytes: usize, work: W) -> Coroutine<'s, 'p>
where
    W: FnOnce(&Turns<'p>, Baton<'p>) -> Baton<'p> + 's,
{
    let stack = DefaultStack::new(bytes).expect("there is room for a stack");
    ScopedCoroutine::with_stack(stack, work)
}

fn turn_over<'p>(result: CoroutineResult<Baton<'p>, Baton<'p>>) -> Baton<'p> {
    match result {
        CoroutineResult::Yield(baton) | CoroutineResult::Return(baton) => baton,
    }
}

impl<'t, 'p> Oracle<'t, 'p> {
    /// Who begins a run.
    pub fn outside(walker: Walker<'p>) -> Oracle<'t, 'p> {
        let stacks = Stacks::of_root();
        Oracle { baton: Some(Box::new(walker)), turns: None, me: 0, stacks, depth: 0, most_depth: 0 }
    }

    /// What it shares with all other tasks, at the end.
    pub fn into_walker(mut self) -> Walker<'p> {
        *self.baton.take().expect("it has its turn")
    }
}

impl<'p> Oracle<'_, 'p> {
    /// Does work as the root task of the run, and gives turns to it and to all tasks that it begins.
    pub fn as_root(&mut self, work: impl FnOnce(&mut Oracle<'_, 'p>) -> Eval<'p>) -> Eval<'p> {
        let (bytes, most_depth) = if self.turns.is_none() { OUTERMOST } else { OTHERS };
        let mut outcome = None;
        let root = |turns: &Turns<'p>, baton: Baton<'p>| {
            let stacks = Stacks::of_root();
            let mut it =
                Oracle { baton: Some(baton), turns: Some(turns), me: 0, stacks, depth: 0, most_depth };
            outcome = Some(work(&mut it));
            it.run.tasks.all[0].state = State::Ended;
            it.baton.take().expect("it has its turn")
        };
        let gave_up = coroutine(bytes, root)
            .scope(|mut root| self.take_turns(&mut |baton| turn_over(root.as_mut().resume(baton))).err());
        match (gave_up, outcome) {
            (Some(why), _) => Err(Exit::GiveUp(why)),
            (None, outcome) => outcome.expect("the root has ended"),
        }
    }

    // ------------------------------------------------------------------ rounds

    /// Rounds, until the root ends. Or why the oracle cannot go on.
    fn take_turns(&mut self, root: &mut dyn FnMut(Baton<'p>) -> Baton<'p>) -> Result<(), String> {
        loop {
            let mut round = std::mem::take(&mut self.run.tasks.ready);
            round.sort_by_key(|id| self.run.tasks.way_to(*id));
            for id in round {
                let tasks = &mut self.run.tasks;
                if tasks.is_held(id) {
                    tasks.held.push(id);
                    continue;
                }
                (tasks.turn, tasks.in_turn) = (id, 0);
                self.baton = self.baton.take().map(&mut *root);
                if let Some(why) = self.gave_up.take() {
                    return Err(why);
                }
                if self.run.tasks.all[0].state == State::Ended {
                    return Ok(());
                }
            }
            self.between_rounds();
        }
    }

    /// The clock moves, timers fire.
    fn between_rounds(&mut self) {
        let Run { tasks, now, .. } = &mut self.run;
        tasks.round += 1;
        let standing: Vec<Timer> = std::mem::take(&mut tasks.timers)
            .into_iter()
            .filter(|it| tasks.waits(it.task, it.wait))
            .collect();
        tasks.timers = standing;
        let busy = std::mem::take(&mut tasks.busy);
        let (next, later) = (tasks.next_timer(), *now + QUANTUM_NS);
        match next {
            _ if busy => *now = next.filter(|at| at > now).map_or(later, |at| at.min(later)),
            _ if !tasks.ready.is_empty() => {}
            Some(at) => *now = at.max(*now),
            None => return self.deadlock(),
        }
        // Those of one time fire in the order of their making.
        tasks.timers.sort_by_key(|timer| timer.at);
        let due = tasks.timers.partition_point(|timer| timer.at <= *now);
        for timer in tasks.timers.drain(..due).collect::<Vec<_>>() {
            if tasks.waits(timer.task, timer.wait) {
                if timer.ends_clean_up {
                    tasks.all[timer.task].raise = Some(too_long());
                }
                tasks.make_ready(timer.task);
            }
        }
        if busy {
            for id in tasks.ready.clone() {
                let task = &mut tasks.all[id];
                if let Some(late) = task.clean_ups.last_mut().filter(|it| it.deadline <= *now && !it.told) {
                    late.told = true;
                    task.raise = Some(too_long());
                }
            }
        }
    }

    /// Nobody can ever go on. What waits in a clean-up cannot be stopped by somebody else's failure.
    fn deadlock(&mut self) {
        let tasks = &mut self.run.tasks;
        let waits = |task: &Task| matches!(task.state, State::Waiting(_, what) if what != Waits::Branches);
        if let Some(stuck) = tasks.all.iter().position(|task| waits(task) && !task.clean_ups.is_empty()) {
            tasks.all[stuck].raise = Some(too_long());
            return tasks.make_ready(stuck);
        }
        let stuck: Vec<String> = (0..tasks.all.len()).filter_map(|id| self.stuck(id)).collect();
        let told = stuck.iter().take(MOST_TOLD).cloned();
        let others = stuck.len().checked_sub(MOST_TOLD).filter(|others| *others > 0);
        let told: Vec<String> =
            told.chain(others.map(|others| format!("and so do {others} others"))).collect();
        let message = format!("nothing can go on: {}", told.join("; "));
        let lines = Value::list(stuck.into_iter().map(Value::str).collect::<Vec<_>>());
        let tasks = &mut self.run.tasks;
        let fields = vec![("message", Value::str(message)), ("waits", lines)];
        tasks.all[0].raise = Some(Box::new(Failure::with(Builtin::Deadlock, fields)));
        tasks.make_ready(0);
    }

    /// Where a task stands that cannot go on, and why it cannot.
    fn stuck(&self, id: usize) -> Option<String> {
        let Run { tasks, tree, .. } = &self.run;
        let path = |rec: usize| tree.path(tree.records[rec].slot).show();
        let task = &tasks.all[id];
        let waits = match task.state {
            State::Idle | State::Ended | State::Waiting(_, Waits::Branches) => return None,
            State::Ready => None,
            State::Waiting(_, what) => Some(match (&task.awaits, what) {
                (Some(Awaits::EndOf(other)), _) => match tasks.all[*other].record {
                    Some(rec) => format!("the end of {}", path(rec)),
                    None => format!("the end of {}", tree.path(tasks.all[*other].slot).show()),
                },
                (Some(Awaits::Fluent(fluent)), Waits::Time) => {
                    let words = self.fluent_in_words(fluent);
                    if words == "a fluent" { "a time".into() } else { format!("{words}, or a time") }
                }
                (Some(Awaits::Fluent(fluent)), _) => self.fluent_in_words(fluent),
                (None, _) => "a time".into(),
            }),
        };
        let words = match (tasks.is_held(id), waits) {
            (true, Some(waits)) => format!("is suspended, and waits for {waits}"),
            (true, None) => "is suspended".into(),
            (false, Some(waits)) => format!("waits for {waits}"),
            (false, None) => "is ready".into(),
        };
        Some(format!("{} {words}", path(task.stands_in)))
    }

    // ------------------------------------------------------------------ turns

    /// Gives the turn back, and has the next one of its own when this returns. Turns that are for tasks
    /// below it go to one of these.
    fn pass(&mut self, below: &mut [Resume<'_, 'p>]) {
        loop {
            let turns = self.turns.expect("who is outside does not wait");
            let mut baton = turns.suspend(self.baton.take().expect("it has its turn"));
            let tasks = &baton.run.tasks;
            let branch = tasks.up_from(tasks.turn).take_while(|at| *at != self.me).last();
            let Some(branch) = branch else {
                self.baton = Some(baton);
                return;
            };
            let ordinal = tasks.all[branch].ordinal;
            baton = below[ordinal](baton);
            self.baton = Some(baton);
        }
    }

    /// A turn begins with what has come from outside.
    fn begin_turn(&mut self, here: &Here) -> Result<(), Exit<'p>> {
        if let Some(raise) = self.mine().raise.take() {
            return self.raise(here, raise);
        }
        self.stop_if_asked()
    }

    /// Throws what stops it, once and outside of clean-ups.
    pub fn stop_if_asked(&mut self) -> Result<(), Exit<'p>> {
        let task = self.mine();
        match task.evaporate {
            Some(why) if !task.thrown && task.clean_ups.is_empty() => {
                task.thrown = true;
                Err(Exit::Evaporate(evaporation(why)))
            }
            _ => Ok(()),
        }
    }

    fn mine(&mut self) -> &mut Task {
        let me = self.me;
        &mut self.run.tasks.all[me]
    }

    /// A unit of fuel has been used in this turn; who has used up his quantum goes on in the next.
    pub fn use_turn(&mut self, here: &Here) -> Result<(), Exit<'p>> {
        if self.run.tasks.in_turn >= QUANTUM {
            let (me, rec) = (self.me, here.rec);
            let tasks = &mut self.run.tasks;
            tasks.busy = true;
            tasks.ready.push(me);
            tasks.all[me].stands_in = rec;
            self.pass(&mut []);
            self.begin_turn(here)?;
        }
        self.run.tasks.in_turn += 1;
        Ok(())
    }

    /// Begins to wait, until a time if one is given. The number of the wait.
    pub fn begin_wait(&mut self, here: &Here, what: Waits, until: Option<u64>) -> Result<u64, Exit<'p>> {
        if self.computing.is_some() {
            return Err(Exit::Refused("does not wait"));
        }
        let (me, rec) = (self.me, here.rec);
        let Run { tasks, now, .. } = &mut self.run;
        tasks.waits += 1;
        let wait = tasks.waits;
        let task = &mut tasks.all[me];
        (task.state, task.stands_in, task.got) = (State::Waiting(wait, what), rec, Value::NIL);
        task.awaits = None;
        tasks.timers.extend(until.map(|at| Timer { at, task: me, wait, ends_clean_up: false }));
        match task.clean_ups.last() {
            // Once it has been said that its time is over, it is not said again.
            Some(clean_up) if clean_up.deadline > *now && !clean_up.told => {
                let at = clean_up.deadline;
                tasks.timers.push(Timer { at, task: me, wait, ends_clean_up: true });
            }
            Some(_) => {}
            // Who is to be stopped does not wait.
            None if task.evaporate.is_some() && !task.thrown => tasks.make_ready(me),
            None => {}
        }
        Ok(wait)
    }

    /// Waits as it has begun to. What it got.
    pub fn end_wait(&mut self, here: &Here, below: &mut [Resume<'_, 'p>]) -> Eval<'p> {
        self.pass(below);
        self.begin_turn(here)?;
        Ok(std::mem::take(&mut self.mine().got))
    }

    /// `(sleep s)`
    pub fn sleep(&mut self, here: &Here, ns: u64) -> Eval<'p> {
        let until = self.run.now.saturating_add(ns);
        self.begin_wait(here, Waits::Time, Some(until))?;
        self.end_wait(here, &mut [])
    }

    /// Waits for branches that end.
    pub fn wait_for_branches(
        &mut self,
        here: &Here,
        wakes: Wakes,
        until: Option<u64>,
        below: &mut [Resume<'_, 'p>],
    ) -> Eval<'p> {
        self.mine().wakes = wakes;
        let what = if until.is_some() { Waits::Time } else { Waits::Branches };
        self.begin_wait(here, what, until)?;
        self.end_wait(here, below)
    }

    /// Goes one call deeper, if the stack has room.
    pub fn deeper(&mut self, work: impl FnOnce(&mut Self) -> Eval<'p>) -> Eval<'p> {
        if self.depth == self.most_depth {
            return Err(Exit::GiveUp("calls are nested too deep for the oracle".into()));
        }
        self.depth += 1;
        let result = work(self);
        self.depth -= 1;
        result
    }

    // ------------------------------------------------------------------ clean-ups

    /// A clean-up begins: it has 60 s, or what is left of the time of the one that it is part of.
    pub fn begin_clean_up(&mut self) {
        let now = self.run.now;
        let task = self.mine();
        let deadline = (now + CLEAN_UP_NS).min(task.time_left());
        task.clean_ups.push(CleanUp { deadline, told: false });
    }

    pub fn end_clean_up(&mut self) {
        self.mine().clean_ups.pop();
    }

    // ------------------------------------------------------------------ beginning and ending

    /// A new branch of the running task, not yet started.
    pub fn new_task(&mut self, ordinal: usize, slot: usize) -> usize {
        let me = self.me;
        let limit = self.mine().time_left();
        let tasks = &mut self.run.tasks;
        tasks.all.push(Task { slot, ..Task::new(me, ordinal, limit) });
        tasks.all.len() - 1
    }

    /// The first turn of a task is in the next round.
    pub fn start_task(&mut self, id: usize, record: usize) -> Result<(), Exit<'p>> {
        let tasks = &mut self.run.tasks;
        let task = &mut tasks.all[id];
        (task.state, task.record, task.stands_in) = (State::Ready, Some(record), record);
        tasks.ready.push(id);
        self.status_changed(id)
    }

    /// The work of a task that does `body` in its record.
    pub fn work(&self, id: usize, body: impl FnOnce(&mut Oracle<'_, 'p>) -> Eval<'p> + 'p) -> Work<'p> {
        let stacks = self.stacks.clone();
        Box::new(move |turns, baton| {
            let most_depth = OTHERS.1;
            let mut it =
                Oracle { baton: Some(baton), turns: Some(turns), me: id, stacks, depth: 0, most_depth };
            let result = it.first_turn().and_then(|()| body(&mut it));
            if let Err(Exit::GiveUp(why)) = it.end_task(result) {
                it.gave_up = Some(why);
            }
            it.baton.take().expect("it has its turn")
        })
    }

    /// Who is stopped before its first step has a record nevertheless.
    fn first_turn(&mut self) -> Result<(), Exit<'p>> {
        let stopped = self.stop_if_asked();
        if stopped.is_err() {
            let (now, rec) = (self.run.now, self.mine().record.expect("it has been started"));
            self.run.tree.records[rec].start = now;
        }
        stopped
    }

    fn end_task(&mut self, result: Eval<'p>) -> Result<(), Exit<'p>> {
        let how = match result {
            Ok(value) => Ended::Succeeded(value),
            Err(Exit::Fail(failure)) => Ended::Failed(failure),
            Err(Exit::Evaporate(stopped)) => Ended::Evaporated(stopped),
            Err(exit) => return Err(exit),
        };
        let me = self.me;
        let rec = self.mine().record.expect("it has been started");
        let status = self.run.tree.records[rec].status;
        // That of a branch with edits may have been ended by its call, or be put off.
        if !status.is_final() && status != Status::Deferred {
            match &how {
                Ended::Succeeded(value) => self.end_record(rec, Status::Succeeded, value.clone()),
                Ended::Failed(failure) => self.left_by(rec, &Exit::Fail(failure.clone())),
                Ended::Evaporated(stopped) => self.left_by(rec, &Exit::Evaporate(stopped.clone())),
            }
        }
        let record = &self.run.tree.records[rec];
        let absent = match record.status {
            Status::Deferred => true,
            Status::Skipped => record.value.is_nil(),
            _ => false,
        };
        let failed = matches!(how, Ended::Failed(_));
        let tasks = &mut self.run.tasks;
        let task = &mut tasks.all[me];
        task.state = State::Ended;
        task.end = Some(End { round: tasks.round, how, absent });
        for (joiner, wait) in std::mem::take(&mut task.joiners) {
            if tasks.waits(joiner, wait) {
                tasks.make_ready(joiner);
            }
        }
        self.status_changed(me)?;
        let tasks = &mut self.run.tasks;
        let parent = tasks.all[me].parent;
        let wakes = match tasks.all[parent].wakes {
            Wakes::Any => true,
            Wakes::Failure => failed,
            Wakes::Last => false,
        };
        if wakes || tasks.open_branches(parent).is_empty() {
            tasks.make_ready(parent);
        }
        Ok(())
    }

    /// A new record of a slot. What is called by a task that has ended is performed where that is performed
    /// which calls it.
    pub fn enter(&mut self, parent: usize, slot: usize, kind: NodeKind, args: Vec<Value>) -> usize {
        let now = self.run.now;
        let rec = self.run.tree.enter(parent, slot, kind, args, now);
        if self.run.tree.records[parent].status.is_final() {
            self.run.tree.records[rec].performed_in = self.stacks.late.last().copied().flatten();
        }
        rec
    }

    /// Ends a record that a failure leaves, or what stops a task.
    pub fn left_by(&mut self, rec: usize, exit: &Exit<'p>) {
        match exit {
            Exit::Fail(failure) => self.end_record(rec, Status::Failed, failure.clone()),
            Exit::Evaporate(stopped) => {
                self.run.tree.records[rec].why = why(stopped);
                let failed = failed_clean_ups(stopped).into_iter().next();
                self.end_record(rec, Status::Evaporated, failed.unwrap_or_default());
            }
            _ => {}
        }
    }

    pub fn end_record(&mut self, rec: usize, status: Status, value: Value) {
        let now = self.run.now;
        self.run.tree.end(rec, status, value, now);
    }

    // ------------------------------------------------------------------ what tasks do to each other

    pub fn task_of(&self, here: &Here, value: &Value) -> Result<usize, Exit<'p>> {
        match value.obj() {
            Some(Obj::Task(handle)) if handle.run == self.run.number => Ok(handle.task as usize),
            Some(Obj::Task(_)) => self.raise(here, type_error("a task of this run", value)),
            _ => self.raise(here, type_error("a task", value)),
        }
    }

    pub fn handle_of(&self, id: usize) -> Value {
        Value::new(Obj::Task(Handle { run: self.run.number, task: id as u32 }))
    }

    pub fn suspend(&mut self, id: usize, suspended: bool) -> Result<(), Exit<'p>> {
        let task = &mut self.run.tasks.all[id];
        if task.state == State::Ended || task.suspended == suspended {
            return Ok(());
        }
        task.suspended = suspended;
        if let Some(rec) = task.record {
            let record = &mut self.run.tree.records[rec];
            if !record.status.is_final() {
                record.status = if suspended { Status::Suspended } else { Status::Running };
            }
        }
        self.run.tasks.release();
        self.status_changed(id)
    }

    /// `(join task)`
    pub fn join(&mut self, here: &Here, id: usize) -> Eval<'p> {
        loop {
            let task = &self.run.tasks.all[id];
            if task.state == State::Ended {
                let rec = task.record.expect("what has ended had been started");
                let record = &self.run.tree.records[rec];
                return match record.status {
                    Status::Succeeded => Ok(record.value.clone()),
                    Status::Failed => Err(Exit::Fail(record.value.clone())),
                    _ => Ok(Value::NIL),
                };
            }
            if self.run.tasks.up_from(self.me).any(|at| at == id) {
                let message = "a task cannot wait for its own end, or for that of one that it is part of";
                return self.raise(here, Box::new(Failure::new(Builtin::ProgramError, message)));
            }
            let wait = self.begin_wait(here, Waits::Join, None)?;
            let me = self.me;
            self.run.tasks.all[id].joiners.push((me, wait));
            self.mine().awaits = Some(Awaits::EndOf(id));
            self.end_wait(here, &mut [])?;
        }
    }

    /// `(status task)`
    pub fn status(&mut self, id: usize) -> Value {
        let word = self.status_word(id);
        if let Some(status) = &self.run.tasks.all[id].status {
            return status.clone();
        }
        let fluent = self.new_fluent(word);
        self.run.tasks.all[id].status = Some(fluent.clone());
        fluent
    }

    fn status_word(&self, id: usize) -> Value {
        let record = self.run.tasks.all[id].record.map(|rec| self.run.tree.records[rec].status);
        Value::symbol(record.unwrap_or(Status::Created).word())
    }

    /// Tells who looks at the status of a task. What they compute from it may fail: that is a failure of
    /// the root.
    fn status_changed(&mut self, id: usize) -> Result<(), Exit<'p>> {
        let Some(status) = self.run.tasks.all[id].status.clone() else { return Ok(()) };
        let word = self.status_word(id);
        if let Err(raise) = self.set_fluent(&status, word)? {
            let tasks = &mut self.run.tasks;
            tasks.all[0].raise = Some(raise);
            tasks.make_ready(0);
        }
        Ok(())
    }
}

/// What stops a task. It is kept as a failure is, for failures of clean-ups come beside it.
fn evaporation(why: Why) -> Value {
    let fields = vec![(Symbol::from("why"), Value::symbol(why.word()))];
    Value::failure(Failure::of_type(EVAPORATION, Symbol::from("evaporated"), fields))
}

fn why(stopped: &Value) -> Why {
    let word = stopped.as_failure().and_then(|it| it.get(Symbol::from("why"))).and_then(Value::as_symbol);
    let known = Why::ALL.iter().find(|why| word.is_some_and(|word| word == why.word()));
    known.copied().expect("it says why")
}

/// The failures of clean-ups while a task was stopped.
pub fn failed_clean_ups(stopped: &Value) -> Vec<Value> {
    stopped.as_failure().map(|it| it.also.clone()).unwrap_or_default()
}

fn too_long() -> Raise {
    let message = "the clean-up forms have not ended after 60 s of the task clock";
    Box::new(Failure::new(Builtin::CleanUpTimeout, message))
}
