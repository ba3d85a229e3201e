//! The engine: solves one query, an answer at a time.
//!
//! It is a machine of its own beside the one that runs plans, since rules go back: registers and
//! frames stay until no choice needs them. A *frame* says where a clause goes on when a goal of it
//! holds. A *choice* says what to try when something does not hold, and what everything was like.
//! What is older than the newest choice is protected: new frames and registers begin above it.
//!
//! The engine never waits: when a rule calls a function it says so ([`Step::Call`]) and is told the
//! value; when it has used its fuel it stops between two goals.

use std::rc::Rc;

use rustc_hash::FxHashMap;

use crate::code::{FnId, Pc, Program};
use crate::native::Raise;
use crate::value::{Symbol, Value};

use super::View;
use super::call::Frame;
use super::choice::Choice;
use super::clause::PredId;
use super::collect::Collecting;
use super::live::Live;
use super::steps::Out;
use super::store::{Cell, Store, TooLarge};
use super::tabling::Tables;

/// What the engine has come to.
pub enum Step {
    /// An answer, in [`Engine::answer`].
    Answer,
    /// There are no more.
    No,
    /// The fuel is used up; go on later.
    Fuel,
    /// A function is to be called; go on with [`Engine::give`].
    Call(FnId, Vec<Value>),
}

/// Solves one query.
pub struct Engine {
    pub(super) store: Store,
    pub(super) stack: Vec<Cell>,
    pub(super) frames: Vec<Frame>,
    pub(super) choices: Vec<Choice>,
    /// Arguments of calls that have choices.
    pub(super) saved: Vec<Cell>,
    pub(super) collecting: Vec<Collecting>,
    pub(super) pc: u32,
    pub(super) base: u32,
    pub(super) frame: u32,
    /// How many choices there were when the predicate was called.
    pub(super) entry: u32,
    /// Registers and frames below these are protected by the newest choice.
    pub(super) top: u32,
    pub(super) frames_top: u32,
    /// The register that takes the value of a function.
    pub(super) result: u32,
    /// The variable that an answer is the value of.
    pub(super) template: Cell,
    /// How many cells there may be before garbage is looked for.
    pub(super) collect_at: usize,
    /// Registers that clauses need, by where they go on.
    pub(super) live: FxHashMap<u32, Rc<Live>>,
    /// What the query sees besides rules.
    pub view: View,
    /// The world as it was when the query was opened, for the functions that rules call; where there is
    /// none, they see that of the run.
    pub world: crate::world::WorldSlot,
    pub(super) tables: Tables,
    /// How often each counter of the clauses has been met.
    pub ticks: Vec<u64>,
    /// The goals that are open, for explanations.
    pub(super) trace: Option<Box<super::why::Trace>>,
    pub(super) started: bool,
    /// How many arguments of the query are given.
    inputs: usize,
}

/// Registers that one clause can name.
pub(super) const WINDOW: usize = 256;

/// Cells that are worth looking for garbage.
const MUCH: usize = 1000;

/// The program counter where the newest choice is to go on.
pub(super) const GOES_BACK: u32 = u32::MAX;

impl Engine {
    /// A query for `predicate`, whose last argument is what an answer is. With `open`, the names `?_0` … in
    /// the inputs stand for variables.
    #[must_use]
    pub fn new(predicate: PredId, inputs: &[Value], view: View, open: bool) -> Engine {
        let mut store = Store::default();
        let template = store.fresh();
        let mut stack = vec![Cell::NIL; 2 * WINDOW];
        let mut vars = Vec::new();
        for (register, value) in stack.iter_mut().zip(inputs) {
            *register = match open {
                true => store.import_open(value, &mut vars).unwrap_or(Cell::NIL),
                false => store.import(value),
            };
        }
        if let Some(register) = stack.get_mut(inputs.len()) {
            *register = template;
        }
        // Number 0 of the code says that the query holds; the frame of the query returns there.
        let frames = vec![Frame { parent: 0, pc: 0, base: 0 }];
        let mut engine = Engine {
            store,
            stack,
            frames,
            choices: Vec::new(),
            saved: Vec::new(),
            collecting: Vec::new(),
            pc: 0,
            base: 0,
            frame: 0,
            entry: 0,
            top: 0,
            frames_top: 0,
            result: 0,
            template,
            collect_at: 0,
            live: FxHashMap::default(),
            view,
            world: None,
            tables: Tables::default(),
            ticks: Vec::new(),
            trace: None,
            started: false,
            inputs: inputs.len(),
        };
        engine.result = predicate.0;
        engine
    }

    /// Goes on until there is an answer, none, or something else to do.
    ///
    /// # Errors
    /// What a rule did wrong, or a limit.
    pub fn run(&mut self, program: &Program, fuel: &mut u64) -> Result<Step, Raise> {
        if !Rc::ptr_eq(&self.store.constants, &program.rules.constants) {
            self.store.constants = program.rules.constants.clone();
        }
        let goes_on = match std::mem::replace(&mut self.started, true) {
            false => self.call_predicate(program, PredId(self.result), 0)?,
            true => self.pc != GOES_BACK,
        };
        if !goes_on && let Some(end) = self.back_or_stop(program, fuel)? {
            return Ok(end);
        }
        loop {
            match self.steps(program, fuel)? {
                Out::Step(step) => {
                    if let Step::Answer = step {
                        self.pc = GOES_BACK;
                    }
                    return Ok(step);
                }
                Out::Collect => {
                    if self.collect_at > 0 {
                        self.collect(&program.rules);
                    }
                    let (cells, from) = (self.store.heap.len(), program.rules.collect_from);
                    // A small limit is a test that wants garbage to be looked for at nearly every call.
                    let more = if from < MUCH { from.max(cells / 8) } else { from.max(cells) };
                    self.collect_at = cells.saturating_add(more.max(1));
                }
                Out::Grow => self.stack.resize(self.stack.len() * 2, Cell::NIL),
            }
        }
    }

    /// A goal does not hold: goes on with the newest choice. Returns what the engine has come to if there is none,
    /// or no fuel.
    pub(super) fn back_or_stop(&mut self, program: &Program, fuel: &mut u64) -> Result<Option<Step>, Raise> {
        if *fuel == 0 {
            self.pc = GOES_BACK;
            return Ok(Some(Step::Fuel));
        }
        *fuel -= 1;
        Ok(if self.back(program)? { None } else { Some(Step::No) })
    }

    /// The value of a function that was to be called.
    pub fn give(&mut self, value: &Value) {
        let cell = self.store.import(value);
        self.stack[self.result as usize] = cell;
    }

    /// The answer that has been found.
    ///
    /// # Errors
    /// `memory-exhausted` for an enormous one.
    pub fn answer(&self) -> Result<Value, Raise> {
        self.store.export(self.template, &self.view).map_err(too_large)
    }

    /// True if there is nothing more to try after the answer.
    #[must_use]
    pub fn is_last(&self) -> bool {
        self.choices.is_empty()
    }

    /// What is asked, if it has not begun: the predicate and its inputs.
    #[must_use]
    pub fn asked(&self) -> Option<(PredId, Vec<Value>)> {
        let inputs = self.stack[..self.inputs].iter();
        let inputs = inputs.map(|cell| self.store.export(*cell, &self.view).unwrap_or_default()).collect();
        (!self.started).then_some((PredId(self.result), inputs))
    }

    /// The instruction after the one that it does, then those where the clauses around go on, up to a limit.
    pub fn goes_on_at(&self) -> impl Iterator<Item = u32> {
        const FRAMES: usize = 1000;
        let mut frame = self.frame;
        let frames = std::iter::from_fn(move || {
            let it = self.frames.get(frame as usize).filter(|_| frame != 0)?;
            frame = it.parent;
            Some(it.pc)
        });
        std::iter::once(self.pc).chain(frames.take(FRAMES))
    }

    /// Memory in use, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.store.bytes()
            + self.stack.len() * size_of::<Cell>()
            + self.frames.len() * size_of::<Frame>()
            + self.choices.len() * size_of::<Choice>()
            + self.saved.len() * size_of::<Cell>()
            + self.collecting.iter().map(Collecting::bytes).sum::<usize>()
            + self.tables.bytes()
    }

    /// The predicates of the goals that are open while it has stopped between two goals, innermost first,
    /// at most `most`. Those that queries are made of have no names.
    #[must_use]
    pub fn open_goals(&self, program: &Program, most: usize) -> Vec<Symbol> {
        let mut pcs = Vec::new();
        if self.pc != GOES_BACK {
            pcs.push(self.pc);
        }
        let mut frame = self.frame;
        while frame != 0 && pcs.len() < most {
            let it = self.frames[frame as usize];
            // It goes on after the call.
            pcs.push(it.pc.saturating_sub(1));
            frame = it.parent;
        }
        let name = |pc: u32| {
            let predicate = program.rules.predicate_at(Pc(pc))?;
            Some(program.rules.predicates[predicate.at()].declared.name)
        };
        pcs.into_iter().filter_map(name).filter(|name| !name.starts_with('%')).collect()
    }
}

pub(super) fn too_large(_: TooLarge) -> Raise {
    crate::native::too_large("a term of a rule has more than 20 million parts")
}
