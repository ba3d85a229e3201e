//! The machine: runs programs, and grows their trees.
//!
//! A run works in *rounds*: each task that is ready goes on until it has used its quantum of fuel,
//! waits, or ends. Between two rounds the clock moves and answers from outside enter; nothing else
//! changes a run from outside, so its log replays to the same tree.
//!
//! [`hot`] is the loop; [`call`] what calls need beyond a frame; [`drive`] calls that take
//! several steps (goals, grounding, edits), [`edited`] which edits hold; [`unwind`] how failures find their handlers, [`cleanup`]
//! the time that clean-ups have; [`edits`] adds edits to a tree, [`graft`] to a call in it, [`obligation`] does what is put off;
//! [`solve`] asks rules,
//! [`task`] gives tasks their turns, [`fork`] begins and ends them, [`fluent`] wakes them.
//!
//! Invariants
//! 1. No Rust function waits for a plan: natives say what they want ([`crate::native::Next`]).
//! 2. The machine can stop between any two instructions that cost fuel.
//! 3. A record is ended by whoever started it: the frame of its plan, a [`drive::Driver`], or, for a branch,
//!    the end of its task.

mod call;
mod cleanup;
mod drive;
mod edited;
mod edits;
mod explain;
mod fluent;
mod fork;
mod graft;
mod hot;
mod obligation;
mod solve;
mod task;
mod unwind;

use std::collections::BTreeMap;
use std::rc::Rc;

use rustc_hash::FxHashMap;
use serde_json::Value as Json;

use crate::code::{FnId, Pc, Program};
use crate::failure::{Builtin, Failure, Raised};
use crate::host::{Host, Request};
use crate::key::{Chain, Key, Step};
use crate::limits::{Grants, Limits};
use crate::log::Log;
use crate::native::Raise;
use crate::op::Op;
use crate::path::PathEnd;
use crate::tree::{RecId, Status, Tree};
use crate::value::{Value, live};
use crate::world::WorldSlot;

pub use call::takes;
use drive::Driver;
pub use explain::PlanStep;
pub use fluent::TaskOp;
pub use fork::{ForkKind, nanoseconds};
pub use solve::{Part, Query};
use task::Tasks;

/// Units of fuel in a round: part of the language, for the clock moves by rounds.
pub const QUANTUM: u64 = 1000;
/// By how much a round that used up its quantum moves the clock, in nanoseconds.
const QUANTUM_NS: u64 = 1_000_000;
/// Fuel for clean-ups after the run has used up its own.
const LAST_FUEL: u64 = 1_000_000;
/// Where a driver's frame goes on; see [`Op::Resume`].
const RESUME: u32 = 0;

/// How a call ended: with a value, or with a failure.
pub type Outcome = Result<Value, Value>;

/// How far a run has come.
#[derive(Debug, Clone)]
pub enum Progress {
    /// The call has ended.
    Ended(Outcome),
    /// The step that was to be reached has been reached.
    Stopped,
}

/// The node that a frame works for: a record, or a memo of a record and the way to the frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Here(u32);

/// Tells memos from records.
const MEMO: u32 = 1 << 31;

/// Where a call goes back to; 16 bytes.
#[derive(Debug, Clone, Copy)]
struct Frame {
    pc: u32,
    base: u32,
    here: Here,
    /// The register that takes the value.
    dst: u8,
}

const _: () = assert!(size_of::<Frame>() == 16);

/// How often the calls of a record have been reached with the same key.
#[derive(Debug, Default)]
struct Occurrences {
    counts: FxHashMap<Key, u32>,
    /// The keys in the order of counting, so that `retry` can take them back.
    journal: Vec<Key>,
}

impl Occurrences {
    /// Takes back what has been counted since the journal had this length.
    fn take_back(&mut self, mark: usize) {
        for key in self.journal.drain(mark.min(self.journal.len())..) {
            if let Some(count) = self.counts.get_mut(&key) {
                *count -= 1;
            }
        }
    }
}

/// A tree being grown: its tasks and their clock. Registers, frames and what goes with them are those of
/// the task that is loaded.
struct Run {
    tasks: Tasks,
    stack: Vec<Value>,
    frames: Vec<Frame>,
    drivers: Vec<Driver>,
    pc: u32,
    base: u32,
    here: Here,
    tree: Tree,
    /// The task clock, in nanoseconds.
    now: u64,
    memos: Vec<(RecId, Chain)>,
    memo_index: FxHashMap<(RecId, Chain), u32>,
    occurrences: FxHashMap<RecId, Occurrences>,
    draws: Draws,
    /// How much each record has asked of the outside.
    asked: FxHashMap<RecId, u32>,
    /// Memory for walks over frames.
    levels: Vec<(Option<crate::code::SiteId>, u32)>,
    /// The chain that the keys of calls in each piece of inserted code begin with.
    inserted: FxHashMap<FnId, Chain>,
    /// What is owed, in the order of its making.
    obligations: Vec<obligation::Obligation>,
    /// Clean-ups that are running, innermost last.
    cleanups: Vec<cleanup::CleanUp>,
    /// Handlers of obligations that are running.
    handling: Vec<obligation::Handling>,
    /// The form that the failure on its way is leaving: handlers inside of it have seen it.
    leaving: Option<u32>,
    /// Tasks of failures that have been raised.
    raised: Raised,
    /// All plan calls take the long way, which tells the host of them.
    traced: bool,
    /// The tree as rules see it, as it was after so many changes.
    view: Option<(u64, Rc<crate::rules::view::TreeView>)>,
    /// The register of the run below that takes the tree.
    deliver: usize,
    /// Tells it from other runs.
    number: u64,
    /// What its natives keep of the world.
    world: WorldSlot,
    /// The version of the world as a fluent, once somebody has asked for it.
    world_fluent: Option<Value>,
    /// Key of its random draws.
    seed: u64,
    /// It is, or is in, a rehearsal: see [`Next::RunPlan`](crate::native::Next::RunPlan).
    projected: bool,
    /// Of a rehearsal: the fluents from before it that it has set, by their numbers, as they were.
    before: Option<BTreeMap<u64, fluent::Before>>,
}

impl Run {
    fn new(mut tree: Tree, traced: bool, seed: u64) -> Run {
        let root = tree.begin();
        let mut inserted = FxHashMap::default();
        for (id, edit) in (1..).zip(tree.edits.iter()) {
            let chain = tree.keys.then(Chain::EMPTY, Step::Edit(id), |_| 0);
            inserted.extend(edit.code.map(|code| (code, chain)));
        }
        Run {
            tasks: Tasks::new(root),
            stack: vec![Value::NIL; 1024],
            frames: Vec::new(),
            drivers: Vec::new(),
            pc: 0,
            base: 0,
            here: Here(root.0),
            tree,
            now: 0,
            memos: Vec::new(),
            memo_index: FxHashMap::default(),
            occurrences: FxHashMap::default(),
            draws: Draws::default(),
            asked: FxHashMap::default(),
            levels: Vec::new(),
            inserted,
            obligations: Vec::new(),
            handling: Vec::new(),
            cleanups: Vec::new(),
            leaving: None,
            raised: Raised::default(),
            traced,
            view: None,
            deliver: 0,
            number: 0,
            world: None,
            world_fluent: None,
            seed,
            projected: false,
            before: None,
        }
    }

    /// The record that the running frame works for.
    #[inline(always)]
    fn record(&self, here: Here) -> RecId {
        if here.0 & MEMO == 0 { RecId(here.0) } else { self.memos[(here.0 & !MEMO) as usize].0 }
    }

    fn register(&mut self, register: u8) -> &mut Value {
        &mut self.stack[self.base as usize + register as usize]
    }

    fn bytes(&self) -> usize {
        let frames = self.frames.len() * size_of::<Frame>();
        self.stack.len() * size_of::<Value>() + frames + self.tasks.bytes() + self.tree.bytes()
    }
}

/// What made the loop stop.
enum Exit {
    /// The outermost function returned.
    Done(Value),
    /// A failure left the outermost function.
    Failed(Value),
    /// The fuel for this stretch is used up.
    Fuel,
    /// Another run has begun on top: it has rounds of its own.
    Began,
    /// The task waits.
    Wait,
    /// A native asks the outside; the answer goes to this position of the stack.
    Ask(Request, usize),
}

/// A program, what it may use, and its run.
pub struct Machine {
    /// The code. It only grows.
    pub program: Program,
    /// What the run may use.
    pub limits: Limits,
    /// What the run may do.
    pub grants: Grants,
    /// Key of the order in which ready tasks have their turns; 0 is the order of the source.
    pub schedule: u64,
    /// What came from outside.
    pub log: Log,
    globals: Vec<Value>,
    /// Innermost last.
    #[expect(clippy::vec_box, reason = "one is put on top, and taken off, for each computation of a fluent")]
    runs: Vec<Box<Run>>,
    /// Fuel used so far.
    steps: u64,
    round: u64,
    printed: usize,
    /// How many fresh names have been made.
    fresh: u64,
    /// The fuel limit was met in a run that has ended: it holds for the run below as well.
    spent: Option<Value>,
    /// The fuel limit has been met: only clean-ups run.
    last_fuel: bool,
    /// By how many parts of a limit the run was over it when that was said last.
    told_over: usize,
    /// The host is told of starts and ends.
    tells: bool,
    /// Ends of paths: a task that begins there stops the run.
    breaks: Vec<PathEnd>,
    /// The task that has just stopped it.
    broke: Option<crate::tree::SlotId>,
    /// The host has stopped the run while time was to pass.
    halted: bool,
    /// The clock of the outermost run goes no further than this, in nanoseconds.
    clock_end: Option<u64>,
    /// It has come to there.
    clock_ended: bool,
    /// Fuel of computing fluents that has not been counted yet.
    beside: u64,
    /// Where derived fluents are computed.
    scratch: Option<Box<Run>>,
    /// How many runs have begun inside of the outermost.
    inner_runs: u64,
}

impl Machine {
    /// A machine without code, about to grow a tree from its root.
    #[must_use]
    pub fn new(limits: Limits, grants: Grants, seed: u64) -> Machine {
        let mut program = Program::default();
        program.code.push(Op::Resume);
        program.places.push(crate::code::Place::default());
        program.sites.push(call::root_site());
        Machine {
            program,
            limits,
            grants,
            schedule: 0,
            log: Log::default(),
            globals: Vec::new(),
            runs: vec![Box::new(Run::new(Tree::default(), false, seed))],
            steps: 0,
            round: 0,
            printed: 0,
            fresh: 0,
            spent: None,
            last_fuel: false,
            told_over: 0,
            tells: false,
            breaks: Vec::new(),
            broke: None,
            halted: false,
            clock_end: None,
            clock_ended: false,
            beside: 0,
            scratch: None,
            inner_runs: 0,
        }
    }

    /// Tell the host of every start and end.
    pub fn trace(&mut self) {
        self.tells = true;
        self.look_at_starts();
    }

    /// Stops the run where a task begins whose path ends so.
    pub fn break_at(&mut self, breaks: Vec<PathEnd>) {
        self.breaks = breaks;
        self.look_at_starts();
    }

    /// The run stops when all that happens until this time of the task clock, in nanoseconds, has happened.
    pub fn stop_clock_at(&mut self, ns: u64) {
        self.clock_end = Some(ns);
    }

    /// True if the run has been stopped by [`Machine::stop_clock_at`].
    #[must_use]
    pub fn is_at_end_of_clock(&self) -> bool {
        self.clock_ended
    }

    /// True while a run inside of the outermost goes on.
    #[must_use]
    pub fn is_inside(&self) -> bool {
        self.runs.len() > 1
    }

    /// Plan calls take the long way if somebody wants to know of them.
    fn look_at_starts(&mut self) {
        let looks = self.tells || !self.breaks.is_empty();
        self.runs.iter_mut().for_each(|run| run.traced = looks);
    }

    /// The task at whose beginning the run has been stopped.
    #[must_use]
    pub fn stopped_at(&self) -> Option<crate::path::Path> {
        let run = self.runs.last()?;
        self.broke.map(|slot| crate::path::Path::of(&run.tree, slot))
    }

    /// Prepares a call of `function` as the root of the run. [`Machine::go`] runs it.
    pub fn start(&mut self, function: FnId, args: Vec<Value>) {
        let entry = self.program.functions[function.at()].entry.0;
        self.globals.resize(self.program.globals.len(), Value::UNSET);
        self.last_fuel = false;
        let run = self.bottom();
        run.tree.begin_again();
        run.tasks = Tasks::new(RecId(1));
        run.frames.clear();
        run.drivers.clear();
        run.obligations.clear();
        run.handling.clear();
        run.cleanups.clear();
        (run.pc, run.base, run.here) = (entry, 0, Here(1));
        for (register, arg) in run.stack.iter_mut().zip(args) {
            *register = arg;
        }
    }

    /// Begins another run in the same tree: with `keep` its places and edits stay, else only the
    /// memory. The clock starts again.
    pub fn restart(&mut self, keep: bool) {
        let run = self.bottom();
        let traced = run.traced;
        run.raised.name(&run.tree);
        let mut tree = std::mem::take(&mut run.tree);
        if !keep {
            tree.forget();
        }
        *run = Run::new(tree, traced, run.seed);
    }

    /// Bytes of registers and frames in use.
    #[must_use]
    pub fn frame_bytes(&self) -> usize {
        self.runs
            .iter()
            .map(|run| run.base as usize * size_of::<Value>() + run.frames.len() * size_of::<Frame>())
            .sum()
    }

    fn bottom(&mut self) -> &mut Run {
        self.runs.truncate(1);
        &mut self.runs[0]
    }

    /// The world of the outermost run, to be prepared before it begins and looked at afterwards.
    pub fn world(&mut self) -> &mut WorldSlot {
        &mut self.runs[0].world
    }

    /// Goes on until the call that was started ends, or until `stop` units of fuel are used.
    pub fn go(&mut self, host: &mut dyn Host, stop: Option<u64>) -> Progress {
        self.broke = None;
        loop {
            while let Some(failure) = self.spent.take() {
                if let Some(exit) = self.throw(host, failure)
                    && let Some(outcome) = self.task_exit(host, exit)
                {
                    return Progress::Ended(outcome);
                }
            }
            if stop.is_some_and(|stop| self.steps >= stop) || self.broke.is_some() {
                return Progress::Stopped;
            }
            if !self.top().tasks.running {
                match self.next_turn(host) {
                    Some(outcome) => return Progress::Ended(outcome),
                    None if std::mem::take(&mut self.halted) => return Progress::Stopped,
                    None => continue,
                }
            }
            self.count_beside(&mut 0);
            let limit = self.limits.fuel.saturating_add(if self.last_fuel { LAST_FUEL } else { 0 });
            let until = limit.min(stop.unwrap_or(limit)).min(self.steps + QUANTUM - self.top().tasks.in_turn);
            let given = until.saturating_sub(self.steps);
            let (mut left, run) = (given, self.runs.len() - 1);
            let exit = self.run_for(host, &mut left);
            self.steps += given - left;
            self.runs[run].tasks.in_turn += given - left;
            let ended = match exit {
                Exit::Fuel if self.steps >= limit => self.out_of_fuel(host),
                Exit::Fuel if self.top().tasks.in_turn >= QUANTUM => {
                    self.use_up_turn();
                    None
                }
                Exit::Fuel => None,
                exit => self.task_exit(host, exit),
            };
            if let Some(outcome) = ended {
                return Progress::Ended(outcome);
            }
        }
    }

    /// Computing a fluent is part of the turn in which it is set: its fuel is counted there, first in what is
    /// left of the stretch.
    fn count_beside(&mut self, left: &mut u64) {
        let beside = std::mem::take(&mut self.beside);
        let within = beside.min(*left);
        *left -= within;
        self.steps += beside - within;
        self.top().tasks.in_turn += beside - within;
    }

    /// What becomes of a run whose loaded task has left the loop.
    fn task_exit(&mut self, host: &mut dyn Host, exit: Exit) -> Option<Outcome> {
        match exit {
            Exit::Done(value) => self.end_task(host, Ok(value)),
            Exit::Failed(failure) => self.end_task(host, Err(failure)),
            Exit::Ask(request, register) => {
                self.wait_for_answer(request, register);
                None
            }
            Exit::Wait => {
                self.has_begun_to_wait();
                None
            }
            Exit::Fuel | Exit::Began => None,
        }
    }

    /// Raises a failure in the call of a native that has just been left.
    fn refuse(&mut self, host: &mut dyn Host, raise: Raise) -> Option<Outcome> {
        let exit = self.unwind(host, raise)?;
        self.task_exit(host, exit)
    }

    /// Raises a failure between two instructions. Answers the outcome if nothing takes it.
    fn inject(&mut self, host: &mut dyn Host, raise: Raise) -> Option<Outcome> {
        // Frames are looked up one instruction back, where calls stand; the one that the run has
        // come to is not done, but it is the place.
        self.top().pc += 1;
        self.refuse(host, raise)
    }

    /// The first time a failure, with some fuel left for clean-ups; then the end.
    fn out_of_fuel(&mut self, host: &mut dyn Host) -> Option<Outcome> {
        if self.last_fuel {
            let failure = Failure::new(Builtin::FuelExhausted, "clean-up used up its fuel as well");
            return Some(Err(self.abandon(failure)));
        }
        self.last_fuel = true;
        let message = format!("the run used up its fuel of {} calls and backward jumps", self.limits.fuel);
        let mut fields =
            vec![("message", Value::str(message)), ("limit", Value::int(self.limits.fuel as i64))];
        let run = self.runs.last().expect("a machine has a run");
        if let Some(Driver::Solve(solve)) = run.drivers.last() {
            fields.extend(self.goals_of(&solve.engine));
        }
        self.inject(host, Box::new(Failure::with(Builtin::FuelExhausted, fields)))
    }

    fn top(&mut self) -> &mut Run {
        self.runs.last_mut().expect("a machine has a run")
    }

    /// An inner run hands its tree to the run below; the end of the outermost is the outcome.
    fn end_run(&mut self, outcome: Outcome) -> Option<Outcome> {
        if self.runs.len() == 1 {
            if let Err(failure) = &outcome {
                crate::failure::name_tasks(&self.top().tree, failure);
            }
            return Some(outcome);
        }
        let mut inner = self.runs.pop()?;
        if let Err(failure) = &outcome
            && self.last_fuel
            && failure.as_failure().is_some_and(|it| it.kind == Builtin::FuelExhausted.id())
        {
            inner.raised.name(&inner.tree);
            self.spent = Some(failure.clone());
            return None;
        }
        inner.raised.name(&inner.tree);
        let (status, value) = match outcome {
            Ok(value) => (Status::Succeeded, value),
            Err(failure) => (Status::Failed, failure),
        };
        inner.tree.end(RecId(1), status, value, inner.now);
        inner.tree.world = inner.world.take().map(Rc::from);
        inner.before.take().into_iter().flatten().for_each(|(_, before)| before.put_back());
        let tree = Value::new(crate::value::Obj::Tree(Rc::new(inner.tree)));
        self.top().stack[inner.deliver] = tree;
        None
    }

    /// How many runs there have been inside of the outermost.
    #[must_use]
    pub fn inner_runs(&self) -> u64 {
        self.inner_runs
    }

    /// Ends the run without another instruction: what is running fails with this.
    pub fn abandon(&mut self, failure: Failure) -> Value {
        let failure = Value::failure(failure);
        let run = self.bottom();
        let open: Vec<RecId> =
            run.tree.records().skip(1).filter(|rec| !run.tree.record(*rec).status.is_final()).collect();
        for rec in open {
            run.tree.end(rec, Status::Failed, failure.clone(), run.now);
        }
        run.frames.clear();
        run.drivers.clear();
        failure
    }

    /// Looks at the limits between two rounds. A round in which nobody used up his quantum is short, so who has
    /// been told there is told again only when there is a good deal more: a clean-up needs some rounds.
    fn check_memory_again(&mut self, busy: bool) -> Result<(), Raise> {
        const PARTS: usize = 16;
        let parts = |used: usize, limit: usize| match used.saturating_sub(limit) {
            0 => 0,
            more => 1 + more / (limit / PARTS).max(1),
        };
        let over = parts(self.bytes(), self.limits.memory).max(parts(self.nodes(), self.limits.nodes));
        let is_news = over > self.told_over;
        self.told_over = if over == 0 { 0 } else { over.max(self.told_over) };
        if busy || is_news { self.check_memory() } else { Ok(()) }
    }

    fn bytes(&self) -> usize {
        live::bytes() + self.runs.iter().map(|run| run.bytes()).sum::<usize>()
    }

    fn nodes(&self) -> usize {
        self.runs.iter().map(|run| run.tree.len()).sum()
    }

    fn check_memory(&self) -> Result<(), Raise> {
        if self.bytes() > self.limits.memory {
            return Err(self.over(
                Builtin::MemoryExhausted,
                "the run takes more than",
                self.limits.memory,
                "bytes",
            ));
        }
        if self.nodes() > self.limits.nodes {
            return Err(self.over(
                Builtin::TreeTooLarge,
                "the tree has more than",
                self.limits.nodes,
                "nodes",
            ));
        }
        Ok(())
    }

    fn over(&self, kind: Builtin, what: &str, limit: usize, unit: &str) -> Raise {
        let fields = vec![
            ("message", Value::str(format!("{what} {limit} {unit}"))),
            ("limit", Value::int(limit as i64)),
        ];
        Box::new(Failure::with(kind, fields))
    }

    /// Makes the root's record final: the run is over.
    pub fn finish(&mut self, outcome: &Outcome) {
        let run = self.bottom();
        if run.tree.record(RecId(1)).status.is_final() {
            return;
        }
        match outcome {
            Ok(value) => run.tree.end(RecId(1), Status::Succeeded, value.clone(), run.now),
            Err(failure) => run.tree.end(RecId(1), Status::Failed, failure.clone(), run.now),
        }
    }

    /// The tree of the run.
    #[must_use]
    pub fn tree(&self) -> &Tree {
        &self.runs[0].tree
    }
    /// The task clock, in nanoseconds.
    #[must_use]
    pub fn now(&self) -> u64 {
        self.runs[0].now
    }
    /// Units of fuel used: calls and backward jumps.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }
    /// The value of a top-level constant, if it has been computed.
    #[must_use]
    pub fn global(&self, id: crate::code::GlobalId) -> Option<&Value> {
        self.globals.get(id.at()).filter(|value| !value.is_unset())
    }
    /// Where the run stands: the places of its frames, innermost first, at most `most`.
    #[must_use]
    pub fn backtrace(&self, most: usize) -> Vec<(FnId, Pc)> {
        let Some(run) = self.runs.last() else { return Vec::new() };
        // The innermost frame stands before an instruction, the others behind their calls.
        let calls = run.frames.iter().rev().filter(|frame| frame.pc != RESUME).map(|frame| Pc(frame.pc - 1));
        let innermost = (run.pc != RESUME).then_some(Pc(run.pc));
        let places = innermost.into_iter().chain(calls);
        places.filter_map(|pc| Some((self.program.function_at(pc)?, pc))).take(most).collect()
    }
}

/// How many random numbers each task has drawn.
#[derive(Debug, Default)]
pub struct Draws(FxHashMap<RecId, u64>);

/// What a [`Ctx`] is made of: the parts of a run that natives may use.
pub struct CtxParts<'a> {
    /// The program: names of functions, types of failures.
    pub program: &'a Program,
    /// The tree of the run so far.
    pub tree: &'a Tree,
    /// The task that calls.
    pub rec: RecId,
    /// How many random numbers each task has drawn.
    pub draws: &'a mut Draws,
    /// Key of the random draws of the run.
    pub seed: u64,
    /// The run is a rehearsal.
    pub projected: bool,
    /// The task clock, in nanoseconds.
    pub now: u64,
    /// How many bytes have been printed.
    pub printed: &'a mut usize,
    /// How many fresh names have been made.
    pub fresh: &'a mut u64,
    /// How many bytes may be printed.
    pub output_limit: usize,
    /// Where what is printed goes.
    pub host: &'a mut dyn Host,
    /// The world of the run.
    pub world: &'a mut WorldSlot,
}

/// What natives may use.
pub struct Ctx<'a> {
    /// The program: names of functions, types of failures.
    pub program: &'a Program,
    parts: CtxParts<'a>,
}

impl<'a> Ctx<'a> {
    /// A context for one call of a native.
    #[must_use]
    pub fn new(parts: CtxParts<'a>) -> Ctx<'a> {
        Ctx { program: parts.program, parts }
    }
    /// Prints text as it is.
    ///
    /// # Errors
    /// `output-too-large` if the run has printed more than its limit.
    pub fn print(&mut self, text: &str) -> Result<(), Raise> {
        *self.parts.printed += text.len();
        if *self.parts.printed > self.parts.output_limit {
            let message = format!("the program printed more than {} bytes", self.parts.output_limit);
            let fields =
                vec![("message", Value::str(message)), ("limit", Value::int(self.parts.output_limit as i64))];
            return Err(Box::new(Failure::with(Builtin::OutputTooLarge, fields)));
        }
        if !self.parts.projected {
            self.parts.host.print(text);
        }
        Ok(())
    }
    /// The next random number of the running task.
    pub fn draw(&mut self) -> u64 {
        let n = self.parts.draws.0.entry(self.parts.rec).or_insert(0);
        let record = self.parts.tree.record(self.parts.rec);
        let number =
            crate::random::draw(self.parts.seed, self.parts.tree.slot(record.slot).hash, record.attempt, *n);
        *n += 1;
        number
    }
    /// True in a rehearsal, in which motions are projected whatever the plan says.
    #[must_use]
    pub fn is_projected(&self) -> bool {
        self.parts.projected
    }
    /// A key for this place in the plan and this seed, the same in each attempt: for what is a function of
    /// what is asked, and no draw.
    #[must_use]
    pub fn key(&self) -> u64 {
        let slot = self.parts.tree.record(self.parts.rec).slot;
        crate::random::draw(self.parts.seed, self.parts.tree.slot(slot).hash, 0, 0)
    }
    /// A number that no other call gets.
    pub fn number(&mut self) -> u64 {
        *self.parts.fresh += 1;
        *self.parts.fresh
    }
    /// A name that no program uses.
    pub fn fresh(&mut self, stem: &str) -> crate::value::Symbol {
        *self.parts.fresh += 1;
        crate::value::Symbol::from(&format!("{stem}%{}", self.parts.fresh))
    }
    /// Seconds of the task clock.
    #[must_use]
    pub fn now_s(&self) -> f64 {
        self.parts.now as f64 / 1e9
    }
    /// The text of a value, with the names of functions.
    #[must_use]
    pub fn text(&self, value: &Value, readable: bool) -> String {
        crate::print::Printer::new(Some(self.program), readable, crate::print::LIMIT).text(value)
    }
    /// How texts that `write` has printed become values again.
    #[must_use]
    pub fn reader(&self) -> Rc<dyn Fn(&str) -> Value> {
        self.parts.host.reader()
    }
    /// The text of a program as people like to read it.
    #[must_use]
    pub fn lay_out(&self, text: String) -> String {
        self.parts.host.lay_out(text)
    }
    /// The tree of the run so far.
    #[must_use]
    pub fn tree(&self) -> &Tree {
        self.parts.tree
    }
    /// The task clock, in nanoseconds.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.parts.now
    }
    /// Where the run keeps its world.
    pub fn world(&mut self) -> &mut WorldSlot {
        self.parts.world
    }
}

/// An answer from outside as a value.
fn from_json(json: &Json) -> Value {
    match json {
        Json::Null => Value::NIL,
        Json::Bool(b) => Value::bool(*b),
        Json::Number(n) => {
            n.as_i64().map_or_else(|| Value::float(n.as_f64().unwrap_or(f64::NAN)), Value::int)
        }
        Json::String(text) => Value::str(text.as_str()),
        Json::Array(items) => Value::list(items.iter().map(from_json).collect::<Vec<_>>()),
        Json::Object(map) => {
            Value::map(map.iter().map(|(key, value)| (Value::keyword(key), from_json(value))).collect())
        }
    }
}
