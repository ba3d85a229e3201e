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

use crate::arith;
use crate::code::{FnId, Pc, Program};
use crate::failure::{Builtin, Failure};
use crate::native::Raise;
use crate::value::{Imm, Symbol, Value};

use super::clause::PredId;
use super::collect::{Collecting, Groups};
use super::control::Goal;
use super::index::{FactRows, Facts};
use super::live::Live;
use super::native::{Alternatives, Call, Found};
use super::op::{Part, RuleOp};
use super::store::{Cell, Mark, Store, TooLarge};
use super::tabling::{Row, Tables};
use super::{Rules, View};

/// Where a clause goes on when a goal of it holds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// The frame of the clause that goes on.
    pub parent: u32,
    pub pc: u32,
    pub base: u32,
}

/// What can be tried instead.
pub(super) struct Choice {
    pub(super) mark: Mark,
    /// The frame that goes on when the alternative holds.
    pub(super) frame: u32,
    pub(super) base: u32,
    /// Registers below belong to something that may go on.
    pub(super) top: u32,
    /// Frames below, too.
    pub(super) frames: u32,
    /// Where the arguments of the call are kept, and how many.
    pub(super) saved: u32,
    pub(super) args: u8,
    pub(super) collecting: u32,
    pub(super) alternative: Alternative,
}

pub(super) enum Alternative {
    /// Code of the clause.
    Code(Pc),
    /// More clauses of the predicate: positions in [`Rules::lists`].
    Clauses(u32, u32),
    /// More facts.
    Facts(Rc<Facts>, FactRows),
    /// The predicate itself, after facts that are in force for a while.
    Plain(PredId),
    /// More of a predicate written in Rust.
    Native(Box<dyn Alternatives>),
    /// More groups; the register of the first.
    Groups(u8, Groups),
    /// More answers of a table.
    Answers(Rc<Vec<Row>>, u32),
    /// Tables are being filled for this call.
    Leader,
    /// Nothing: `*->` has taken it away.
    None,
}

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

/// Why the loop was left.
enum Out {
    Step(Step),
    /// The registers are at their end.
    Grow,
    /// There may be garbage.
    Collect,
    /// The goal does not hold.
    Back,
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
    entry: u32,
    /// Registers and frames below these are protected by the newest choice.
    top: u32,
    frames_top: u32,
    /// The register that takes the value of a function.
    result: u32,
    /// The variable that an answer is the value of.
    pub(super) template: Cell,
    /// How many cells there may be before garbage is looked for.
    pub(super) collect_at: usize,
    /// Registers that clauses need, by where they go on.
    pub(super) live: FxHashMap<u32, Rc<Live>>,
    /// What the query sees besides rules.
    pub view: View,
    pub(super) tables: Tables,
    /// How often each counter of the clauses has been met.
    pub ticks: Vec<u64>,
    /// The goals that are open, for explanations.
    pub(super) trace: Option<Box<super::why::Trace>>,
    started: bool,
    /// How many arguments of the query are given.
    inputs: usize,
}

/// Registers that one clause can name.
const WINDOW: usize = 256;

/// Cells that are worth looking for garbage.
const MUCH: usize = 1000;

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
        let mut next = match std::mem::replace(&mut self.started, true) {
            false => match self.call_predicate(program, PredId(self.result), 0)? {
                true => None,
                false => Some(Out::Back),
            },
            true if self.pc == GOES_BACK => Some(Out::Back),
            true => None,
        };
        loop {
            let out = match next.take() {
                Some(out) => out,
                None => self.steps(program, fuel)?,
            };
            match out {
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
                Out::Back if *fuel == 0 => {
                    self.pc = GOES_BACK;
                    return Ok(Step::Fuel);
                }
                Out::Back => {
                    *fuel -= 1;
                    if !self.back(program)? {
                        return Ok(Step::No);
                    }
                }
            }
        }
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

    // ------------------------------------------------------------------ the loop

    fn steps(&mut self, program: &Program, fuel: &mut u64) -> Result<Out, Raise> {
        let rules: &Rules = &program.rules;
        let code: &[RuleOp] = &rules.code;
        'window: loop {
            let (mut pc, base) = (self.pc as usize, self.base as usize);
            let Some(w) = self.stack.get_mut(base..).and_then(|above| above.first_chunk_mut::<WINDOW>())
            else {
                return Ok(Out::Grow);
            };
            let store = &mut self.store;
            macro_rules! at {
                ($r:expr) => {
                    w[$r as usize]
                };
            }
            macro_rules! fail {
                () => {{
                    self.pc = pc as u32;
                    return Ok(Out::Back);
                }};
            }
            macro_rules! holds {
                ($it:expr) => {
                    if !$it.map_err(too_large)? {
                        fail!()
                    }
                };
            }
            macro_rules! make {
                ($part:expr) => {{
                    let at = store.heap.len() as u32;
                    let (cell, register) = match $part {
                        Part::Any => (Cell::Ref(at), None),
                        Part::First(r) => (Cell::Ref(at), Some(r)),
                        Part::Same(r) => (at!(r), None),
                        Part::Nil => (Cell::NIL, None),
                    };
                    store.heap.push(cell);
                    if let Some(r) = register {
                        at!(r) = cell;
                    }
                }};
            }
            macro_rules! number {
                ($r:expr) => {{
                    match store.deref(at!($r)) {
                        Cell::Imm(imm) => imm,
                        other => {
                            self.pc = pc as u32;
                            return Err(self.no_number(other));
                        }
                    }
                }};
            }
            macro_rules! arith {
                ($d:expr, $a:expr, $b:expr, $checked:ident, $slow:path) => {{
                    let (a, b) = (number!($a), number!($b));
                    let fast = match (a, b) {
                        (Imm::Int(a), Imm::Int(b)) => a.$checked(b),
                        _ => None,
                    };
                    at!($d) = match fast {
                        Some(it) => Cell::int(it),
                        None => {
                            self.pc = pc as u32;
                            cell_of($slow(&Value::Imm(a), &Value::Imm(b))?)
                        }
                    };
                }};
            }
            macro_rules! compare {
                ($a:expr, $b:expr, $op:tt, $slow:path) => {{
                    let holds = match (number!($a), number!($b)) {
                        (Imm::Int(a), Imm::Int(b)) => a $op b,
                        (a, b) => {
                            self.pc = pc as u32;
                            $slow(&Value::Imm(a), &Value::Imm(b))?
                        }
                    };
                    if !holds {
                        fail!()
                    }
                }};
            }
            macro_rules! before_call {
                () => {{
                    if *fuel == 0 || store.heap.len() >= self.collect_at {
                        self.pc = pc as u32 - 1;
                        return Ok(if *fuel == 0 { Out::Step(Step::Fuel) } else { Out::Collect });
                    }
                    *fuel -= 1;
                }};
            }
            loop {
                let op = code[pc];
                pc += 1;
                match op {
                    RuleOp::GetNil(a) => match store.deref(at!(a)) {
                        Cell::Imm(Imm::Nil) => {}
                        Cell::Ref(at) => store.bind(at, Cell::NIL),
                        _ => fail!(),
                    },
                    RuleOp::GetConst(a, k) => match (store.deref(at!(a)), rules.cells[k.0 as usize]) {
                        (Cell::Imm(a), Cell::Imm(b)) => {
                            if !super::store::same_imm(&a, &b) {
                                fail!()
                            }
                        }
                        (Cell::Ref(at), constant) => store.bind(at, constant),
                        (a, constant) => holds!(store.unify(a, constant)),
                    },
                    RuleOp::GetPair(a, first, rest) => {
                        let mut cell = store.deref(at!(a));
                        if let Cell::Obj(_) = cell {
                            cell = store.open(cell);
                        }
                        match cell {
                            Cell::Pair(pair) => {
                                for (part, at) in [(first, pair), (rest, pair + 1)] {
                                    match part {
                                        Part::First(r) => at!(r) = store.heap[at as usize],
                                        Part::Same(r) => holds!(store.unify(at!(r), store.heap[at as usize])),
                                        Part::Nil => holds!(store.unify(Cell::NIL, store.heap[at as usize])),
                                        Part::Any => {}
                                    }
                                }
                            }
                            Cell::Ref(var) => {
                                // What goes into the cell must not have the variable in it.
                                for part in [first, rest] {
                                    // In `(?x . ?x)` the second one is what the first will be.
                                    if let Part::Same(r) = part
                                        && first != Part::First(r)
                                    {
                                        let inside = store.deref(at!(r));
                                        if matches!(inside, Cell::Ref(it) if it == var)
                                            || store.occurs(var, inside).map_err(too_large)?
                                        {
                                            fail!()
                                        }
                                    }
                                }
                                let pair = store.heap.len() as u32;
                                make!(first);
                                make!(rest);
                                store.bind(var, Cell::Pair(pair));
                            }
                            _ => fail!(),
                        }
                    }
                    RuleOp::GetStruct(a, s, t) => {
                        let template = &rules.templates[t.0 as usize];
                        let cell = store.open(at!(a));
                        let holds = match cell {
                            Cell::Struct(at) => {
                                super::structure::take_apart(store, at, template, &mut w[s as usize..])
                            }
                            Cell::Ref(var) => {
                                let values = &mut w[s as usize..][..template.values as usize];
                                values.iter_mut().for_each(|value| *value = store.fresh());
                                let made = super::structure::make(store, template, &w[s as usize..]);
                                store.bind(var, made);
                                true
                            }
                            _ => false,
                        };
                        if !holds {
                            fail!()
                        }
                    }
                    RuleOp::Unify(a, b) => holds!(store.unify(at!(a), at!(b))),
                    RuleOp::Identical(a, b) => holds!(store.identical(at!(a), at!(b))),
                    RuleOp::Matches(a, b) => holds!(store.matches(at!(a), at!(b))),
                    RuleOp::Less(a, b) => compare!(a, b, <, arith::less),
                    RuleOp::LessEq(a, b) => compare!(a, b, <=, arith::less_eq),
                    RuleOp::NumEq(a, b) => compare!(a, b, ==, arith::num_eq),
                    RuleOp::NumNe(a, b) => compare!(a, b, !=, num_ne),
                    RuleOp::NeedsBound(a, k) => {
                        if let Cell::Ref(_) = store.deref(at!(a)) {
                            self.pc = pc as u32;
                            return Err(floundering(&rules.constants[k.0 as usize]));
                        }
                    }

                    RuleOp::Fresh(d) => at!(d) = store.fresh(),
                    RuleOp::Move(d, s) => at!(d) = at!(s),
                    RuleOp::PutConst(d, k) => at!(d) = rules.cells[k.0 as usize],
                    RuleOp::PutPair(d, first, rest) => {
                        let pair = store.heap.len() as u32;
                        make!(first);
                        make!(rest);
                        at!(d) = Cell::Pair(pair);
                    }
                    RuleOp::PutStruct(d, s, t) => {
                        let template = &rules.templates[t.0 as usize];
                        at!(d) = super::structure::make(store, template, &w[s as usize..]);
                    }
                    RuleOp::Add(d, a, b) => arith!(d, a, b, checked_add, arith::add),
                    RuleOp::Sub(d, a, b) => arith!(d, a, b, checked_sub, arith::sub),
                    RuleOp::Mul(d, a, b) => arith!(d, a, b, checked_mul, arith::mul),
                    RuleOp::Div(d, a, b) => arith!(d, a, b, checked_exact_div, arith::div),
                    RuleOp::AddInt(d, a, i) => {
                        let a = number!(a);
                        let fast = if let Imm::Int(a) = a { a.checked_add(i.into()) } else { None };
                        at!(d) = match fast {
                            Some(it) => Cell::int(it),
                            None => {
                                self.pc = pc as u32;
                                cell_of(arith::add(&Value::Imm(a), &Value::int(i.into()))?)
                            }
                        };
                    }

                    RuleOp::Call(window, n, predicate) => {
                        before_call!();
                        // The frame goes above all that a choice needs.
                        let at = (self.frame + 1).max(self.frames_top);
                        self.frames.truncate(at as usize);
                        self.frames.push(Frame { parent: self.frame, pc: pc as u32, base: base as u32 });
                        self.frame = at;
                        let above = (base as u32 + u32::from(n)).max(self.top);
                        let p = &rules.predicates[predicate.at()];
                        let plain = p.is_plain && self.view.scoped.is_empty() && self.trace.is_none();
                        self.move_args(base + window as usize, above as usize, p.declared.arity.into());
                        self.base = above;
                        self.pc = pc as u32;
                        if plain {
                            if !self.enter_clauses(rules, predicate) {
                                return Ok(Out::Back);
                            }
                        } else {
                            if let Some(trace) = &mut self.trace {
                                trace.begin(self.frame);
                            }
                            if !self.call_predicate(program, predicate, above)? {
                                return Ok(Out::Back);
                            }
                        }
                        continue 'window;
                    }
                    RuleOp::CallNative(window, predicate) => {
                        before_call!();
                        let it = &rules.predicates[predicate.at()];
                        let arity = it.declared.arity;
                        let args = &w[window as usize..][..usize::from(arity)];
                        self.pc = pc as u32;
                        if let (Some(native), None) = (it.native, &self.trace) {
                            let mut call = Call::new(program, store, args, &self.view);
                            match native(&mut call)? {
                                Found::Yes => continue,
                                Found::No => return Ok(Out::Back),
                                Found::Many(alternatives) => {
                                    self.frame_for_goal(base as u32, window, arity.into());
                                    let more = Alternative::Native(alternatives);
                                    self.push_choice(self.base.max(self.top), arity, more);
                                }
                            }
                            return Ok(Out::Back);
                        }
                        self.frame_for_goal(base as u32, window, arity.into());
                        if let Some(trace) = &mut self.trace {
                            trace.begin(self.frame);
                        }
                        if !self.call_predicate(program, predicate, self.base)? {
                            return Ok(Out::Back);
                        }
                        continue 'window;
                    }
                    RuleOp::Execute(window, predicate) => {
                        before_call!();
                        let n = usize::from(rules.predicates[predicate.at()].declared.arity);
                        if self.top <= base as u32 {
                            for i in 0..n {
                                w[i] = w[(window as usize + i) & 255];
                            }
                        } else {
                            let above = (base as u32 + u32::from(window)).max(self.top);
                            self.move_args(base + window as usize, above as usize, n);
                            self.base = above;
                        }
                        self.pc = pc as u32;
                        if !self.enter(program, predicate)? {
                            return Ok(Out::Back);
                        }
                        continue 'window;
                    }
                    RuleOp::ExecuteHere(predicate) => {
                        before_call!();
                        self.pc = pc as u32;
                        if !self.enter(program, predicate)? {
                            return Ok(Out::Back);
                        }
                        continue 'window;
                    }
                    RuleOp::CallValue(window, n, most, scope) => {
                        before_call!();
                        self.pc = pc as u32;
                        if !self.call_value(program, window, n, most, scope)? {
                            return Ok(Out::Back);
                        }
                        continue 'window;
                    }
                    RuleOp::CallFun(d, window, n, function) => {
                        let (mut args, mut vars) = (Vec::with_capacity(n.into()), Vec::new());
                        for i in 0..usize::from(n) {
                            let cell = w[(window as usize + i) & 255];
                            args.push(store.export_with(cell, &self.view, &mut vars).map_err(too_large)?);
                        }
                        self.pc = pc as u32;
                        if !vars.is_empty() {
                            return Err(no_value(program, function));
                        }
                        self.result = base as u32 + u32::from(d);
                        return Ok(Out::Step(Step::Call(function, args)));
                    }
                    RuleOp::Proceed => {
                        let frame = self.frames[self.frame as usize];
                        if let Some(trace) = &mut self.trace {
                            trace.leave(self.frame);
                        }
                        (self.pc, self.base, self.frame) = (frame.pc, frame.base, frame.parent);
                        continue 'window;
                    }
                    RuleOp::Answer => {
                        self.pc = pc as u32;
                        return Ok(Out::Step(Step::Answer));
                    }
                    RuleOp::TableAnswer => {
                        let (table, args) = (at!(0), store.deref(at!(1)));
                        self.pc = pc as u32;
                        self.table_answer(table, args)?;
                        return Ok(Out::Back);
                    }
                    RuleOp::Fail => fail!(),
                    RuleOp::Tick(n) => {
                        let n = n as usize;
                        if self.ticks.len() <= n {
                            self.ticks.resize(n + 1, 0);
                        }
                        self.ticks[n] += 1;
                    }

                    RuleOp::Jump(t) => pc = t.0 as usize,
                    RuleOp::Try(n, t) => {
                        let top = (base as u32 + u32::from(n)).max(self.top);
                        self.pc = pc as u32;
                        self.push_choice(top, 0, Alternative::Code(t));
                        continue 'window;
                    }
                    RuleOp::Entry(d) => at!(d) = Cell::int(self.entry.into()),
                    RuleOp::Choices(d) => at!(d) = Cell::int(self.choices.len() as i64),
                    RuleOp::Cut(a) => {
                        if let Cell::Imm(Imm::Int(n)) = at!(a)
                            && (n as usize) < self.choices.len()
                        {
                            self.pc = pc as u32;
                            self.cut_to(n as usize);
                            continue 'window;
                        }
                    }
                    RuleOp::Close(a) => {
                        if let Cell::Imm(Imm::Int(n)) = at!(a)
                            && let Some(choice) = self.choices.get_mut(n as usize)
                        {
                            choice.alternative = Alternative::None;
                        }
                    }

                    RuleOp::Collect(d, kind) => {
                        at!(d) = Cell::int(self.collecting.len() as i64);
                        self.collecting.push(Collecting::new(kind));
                    }
                    RuleOp::Add1(d, s) => {
                        let (d, s) = (at!(d), at!(s));
                        if let Cell::Imm(Imm::Int(n)) = d
                            && let Some(collecting) = self.collecting.get_mut(n as usize)
                        {
                            collecting.add(store, s, &self.view).map_err(too_large)?;
                        }
                    }
                    RuleOp::Collected(d) => {
                        let Cell::Imm(Imm::Int(n)) = at!(d) else { fail!() };
                        let Some(collecting) = self.collecting.get_mut(n as usize) else { fail!() };
                        let result = collecting.finish(store).map_err(too_large)?;
                        self.collecting.truncate(n as usize);
                        match result {
                            Some(cell) => at!(d) = cell,
                            None => fail!(),
                        }
                    }
                    RuleOp::Groups(window, set) => {
                        self.pc = pc as u32;
                        let groups =
                            Groups::new(store, at!(window), at!(window + 1), set, pc as u32, &self.view)
                                .map_err(too_large)?;
                        self.push_choice(
                            (base as u32 + WINDOW as u32).max(self.top),
                            0,
                            Alternative::Groups(window, groups),
                        );
                        return Ok(Out::Back);
                    }
                }
            }
        }
    }

    /// A frame for what comes after a goal whose arguments are in the registers from `window`: they are
    /// the first above it.
    fn frame_for_goal(&mut self, base: u32, window: u8, arity: usize) {
        let pc = self.pc;
        self.push_frame(pc, base);
        let from = base + u32::from(window);
        let above = from.max(self.top);
        if above != from {
            self.move_args(from as usize, above as usize, arity);
        }
        self.base = above;
    }

    #[inline(always)]
    fn move_args(&mut self, from: usize, to: usize, n: usize) {
        if self.stack.len() < to + WINDOW {
            let len = (self.stack.len() * 2).max(to + WINDOW);
            self.stack.resize(len, Cell::NIL);
        }
        self.stack.copy_within(from..from + n, to);
    }

    // ------------------------------------------------------------------ calls

    /// Solves a predicate whose arguments are at the base. False if nothing can answer.
    #[inline(always)]
    fn enter(&mut self, program: &Program, predicate: PredId) -> Result<bool, Raise> {
        let it = &program.rules.predicates[predicate.at()];
        if it.is_plain && self.view.scoped.is_empty() && self.trace.is_none() {
            return Ok(self.enter_clauses(&program.rules, predicate));
        }
        self.call_predicate(program, predicate, self.base)
    }

    /// Enters the clauses that can answer.
    #[inline(always)]
    pub(super) fn enter_clauses(&mut self, rules: &Rules, predicate: PredId) -> bool {
        let it = &rules.predicates[predicate.at()];
        let args = &self.stack[self.base as usize..][..usize::from(it.declared.arity)];
        let index = match &it.written {
            Some(written) if self.trace.is_some() => written,
            _ => &it.index,
        };
        let selected = index.select(&self.store, args);
        self.entry = self.choices.len() as u32;
        let Some(first) = rules.lists.get(selected.start as usize) else { return false };
        match selected.len() {
            0 => return false,
            1 => {}
            _ => {
                let more = Alternative::Clauses(selected.start + 1, selected.end);
                self.push_choice(self.base.max(self.top), it.declared.arity, more);
            }
        }
        self.pc = first.0;
        if let Some(trace) = &mut self.trace {
            trace.enter(*first);
        }
        true
    }

    /// Solves a predicate of any kind.
    fn call_predicate(&mut self, program: &Program, predicate: PredId, base: u32) -> Result<bool, Raise> {
        let it = &program.rules.predicates[predicate.at()];
        let arity = it.declared.arity;
        if let Some(trace) = &mut self.trace {
            trace.call(predicate, &self.stack[self.base as usize..][..usize::from(arity)]);
        }
        if let Some((_, facts)) = self.view.scoped.iter().find(|scoped| scoped.0 == predicate) {
            let facts = facts.clone();
            self.push_choice(base.max(self.top), arity, Alternative::Plain(predicate));
            return Ok(self.first_fact(&facts, arity));
        }
        self.call_plain(program, predicate)
    }

    fn call_plain(&mut self, program: &Program, predicate: PredId) -> Result<bool, Raise> {
        let it = &program.rules.predicates[predicate.at()];
        let arity = it.declared.arity;
        if it.declared.tabled {
            return self.call_table(program, predicate);
        }
        if let Some(native) = it.native {
            let args = &self.stack[self.base as usize..][..usize::from(arity)];
            let mut call = Call::new(program, &mut self.store, args, &self.view);
            return match native(&mut call)? {
                Found::No => Ok(false),
                Found::Yes => Ok(self.proceed()),
                Found::Many(alternatives) => {
                    self.push_choice(self.base.max(self.top), arity, Alternative::Native(alternatives));
                    Ok(false)
                }
            };
        }
        if !it.table.is_empty() {
            let facts = it.table.clone();
            return Ok(self.first_fact(&facts, arity));
        }
        Ok(self.enter_clauses(&program.rules, predicate))
    }

    /// A fact that is the first answer of a call: the rest is a choice, if there is one.
    fn first_fact(&mut self, facts: &Rc<Facts>, arity: u8) -> bool {
        let args = &self.stack[self.base as usize..][..usize::from(arity)];
        let mut rows = facts.select(&self.store, args);
        match next_fact(&self.store, facts, &mut rows, args) {
            None => false,
            Some(row) => {
                let first = facts.at(&rows, row);
                rows.left.start = row + 1;
                let args = &self.stack[self.base as usize..][..usize::from(arity)];
                if next_fact(&self.store, facts, &mut rows, args).is_some() {
                    let more = Alternative::Facts(facts.clone(), rows);
                    self.push_choice(self.base.max(self.top), arity, more);
                }
                self.take_fact(facts, first, arity)
            }
        }
    }

    fn take_fact(&mut self, facts: &Facts, row: u32, arity: u8) -> bool {
        for i in 0..usize::from(arity) {
            let arg = self.stack[self.base as usize + i];
            // Large constants of a program are not too large.
            if !self.store.unify(arg, facts.row(row)[i]).unwrap_or(false) {
                return false;
            }
        }
        self.proceed()
    }

    /// The registers that a clause needs from an instruction on.
    pub(super) fn live(&mut self, rules: &Rules, pc: u32) -> Rc<Live> {
        self.live.entry(pc).or_insert_with(|| Rc::new(super::live::live(rules, Pc(pc)))).clone()
    }

    /// The goal of the frame holds.
    pub(super) fn proceed(&mut self) -> bool {
        let frame = self.frames[self.frame as usize];
        if let Some(trace) = &mut self.trace {
            trace.leave(self.frame);
        }
        (self.pc, self.base, self.frame) = (frame.pc, frame.base, frame.parent);
        true
    }

    /// `(call goal more…)`: finds the predicate of the goal and puts its arguments in place.
    fn call_value(
        &mut self,
        program: &Program,
        window: u8,
        n: u8,
        most: u8,
        scope: u32,
    ) -> Result<bool, Raise> {
        let at = self.base as usize + window as usize;
        let goal = self.stack[at];
        let more = self.stack[at + 1..at + 1 + usize::from(n)].to_vec();
        let (predicate, args) = match self.goal(&program.rules, goal, &more, scope)? {
            Goal::True => return Ok(true),
            Goal::False => return Ok(false),
            Goal::Predicate(predicate, args) => (predicate, args),
        };
        let above = (self.base + u32::from(most)).max(self.top);
        self.move_args(at, above as usize, 0);
        self.stack[above as usize..][..args.len()].copy_from_slice(&args);
        let frame = (self.frame + 1).max(self.frames_top);
        self.frames.truncate(frame as usize);
        self.frames.push(Frame { parent: self.frame, pc: self.pc, base: self.base });
        (self.frame, self.base) = (frame, above);
        if let Some(trace) = &mut self.trace {
            trace.begin(frame);
        }
        self.enter(program, predicate)
    }

    // ------------------------------------------------------------------ choices

    /// Registers below `top` are needed by what may go on; the first `args` at the base are kept.
    fn push_choice(&mut self, top: u32, args: u8, alternative: Alternative) {
        let saved = self.saved.len() as u32;
        self.saved.extend_from_slice(&self.stack[self.base as usize..][..usize::from(args)]);
        let mark = self.store.mark();
        self.store.old = mark.heap;
        (self.top, self.frames_top) = (top, (self.frame + 1).max(self.frames_top));
        self.choices.push(Choice {
            mark,
            frame: self.frame,
            base: self.base,
            top,
            frames: self.frames_top,
            saved,
            args,
            collecting: self.collecting.len() as u32,
            alternative,
        });
        if let Some(trace) = &mut self.trace {
            trace.choice();
        }
    }

    /// Forgets all choices but the first `n`.
    pub(super) fn cut_to(&mut self, n: usize) {
        if let Some(choice) = self.choices.get(n) {
            self.saved.truncate(choice.saved as usize);
        }
        self.choices.truncate(n);
        if let Some(trace) = &mut self.trace {
            trace.cut(n);
        }
        self.look_at_newest();
    }

    /// What the newest choice protects.
    pub(super) fn look_at_newest(&mut self) {
        match self.choices.last() {
            Some(choice) => {
                (self.top, self.frames_top) = (choice.top, choice.frames);
                self.store.old = choice.mark.heap;
            }
            None => {
                (self.top, self.frames_top) = (0, 0);
                self.store.old = 0;
            }
        }
    }

    /// Forgets the newest choice.
    fn pop_choice(&mut self) {
        let n = self.choices.len().saturating_sub(1);
        self.cut_to(n);
    }

    /// Goes on with the newest choice. False if there is none.
    fn back(&mut self, program: &Program) -> Result<bool, Raise> {
        loop {
            let n = self.choices.len().saturating_sub(1);
            let Some(choice) = self.choices.last_mut() else { return Ok(false) };
            self.store.back_to(choice.mark);
            self.collecting.truncate(choice.collecting as usize);
            (self.frame, self.base) = (choice.frame, choice.base);
            let args = &self.saved[choice.saved as usize..][..usize::from(choice.args)];
            self.stack[choice.base as usize..][..args.len()].copy_from_slice(args);
            if let Some(trace) = &mut self.trace {
                trace.back();
            }
            match &mut choice.alternative {
                Alternative::Code(pc) => {
                    self.pc = pc.0;
                    self.pop_choice();
                    return Ok(true);
                }
                Alternative::Clauses(next, end) => {
                    let at = *next as usize;
                    *next += 1;
                    self.entry = n as u32;
                    if next == end {
                        self.pop_choice();
                    }
                    self.pc = program.rules.lists[at].0;
                    if let Some(trace) = &mut self.trace {
                        trace.enter(program.rules.lists[at]);
                    }
                    return Ok(true);
                }
                Alternative::Facts(facts, rows) => {
                    let args = &self.stack[self.base as usize..][..usize::from(choice.args)];
                    let arity = choice.args;
                    let Some(row) = next_fact(&self.store, facts, rows, args) else {
                        self.pop_choice();
                        continue;
                    };
                    let (facts, first) = (facts.clone(), facts.at(rows, row));
                    rows.left.start = row + 1;
                    if next_fact(&self.store, &facts, rows, args).is_none() {
                        self.pop_choice();
                    }
                    if self.take_fact(&facts, first, arity) {
                        return Ok(true);
                    }
                }
                Alternative::Plain(predicate) => {
                    let predicate = *predicate;
                    self.pop_choice();
                    if self.call_plain(program, predicate)? {
                        return Ok(true);
                    }
                }
                Alternative::Native(alternatives) => {
                    let args = &self.stack[self.base as usize..][..usize::from(choice.args)];
                    let mut call = Call::new(program, &mut self.store, args, &self.view);
                    match alternatives.next(&mut call)? {
                        Some(true) => return Ok(self.proceed()),
                        Some(false) => {
                            self.pop_choice();
                            return Ok(self.proceed());
                        }
                        None => self.pop_choice(),
                    }
                }
                Alternative::Groups(window, groups) => {
                    let at = self.base as usize + usize::from(*window);
                    self.pc = groups.pc;
                    match groups.next(&mut self.store).map_err(too_large)? {
                        Some((instances, more)) => {
                            self.stack[at + 2] = instances;
                            if !more {
                                self.pop_choice();
                            }
                            return Ok(true);
                        }
                        None => self.pop_choice(),
                    }
                }
                Alternative::Answers(answers, next) => {
                    let Some(answer) = answers.get(*next as usize).cloned() else {
                        self.pop_choice();
                        continue;
                    };
                    *next += 1;
                    if *next as usize == answers.len() {
                        self.pop_choice();
                    }
                    if self.take_answer(&answer)? {
                        return Ok(true);
                    }
                }
                Alternative::Leader => {
                    let arity = choice.args;
                    if self.lead(program, arity)? {
                        return Ok(true);
                    }
                }
                Alternative::None => self.pop_choice(),
            }
        }
    }

    /// Goes through the answers of a table.
    pub(super) fn answer_from(&mut self, answers: Rc<Vec<Row>>, arity: u8) {
        if !answers.is_empty() {
            self.push_choice(self.base.max(self.top), arity, Alternative::Answers(answers, 0));
        }
    }

    /// The call is answered when all tables that it needs are full.
    pub(super) fn push_leader(&mut self, arity: u8) {
        self.push_choice(self.base.max(self.top), arity, Alternative::Leader);
    }

    /// The tables of the newest choice are full: these are its answers.
    pub(super) fn replace_leader(&mut self, answers: Rc<Vec<Row>>, arity: u8) {
        self.pop_choice();
        self.answer_from(answers, arity);
    }

    /// Makes sure that there are registers above the newest choice. Returns where they begin.
    pub(super) fn room(&mut self, _n: usize) -> u32 {
        let base = self.base.max(self.top);
        self.move_args(0, base as usize + 2 * WINDOW, 0);
        base
    }

    /// A frame that goes on at `pc`.
    pub(super) fn push_frame(&mut self, pc: u32, base: u32) {
        let at = (self.frame + 1).max(self.frames_top);
        self.frames.truncate(at as usize);
        self.frames.push(Frame { parent: self.frame, pc, base });
        self.frame = at;
    }

    fn no_number(&self, cell: Cell) -> Raise {
        match cell {
            Cell::Ref(_) => Box::new(Failure::new(
                Builtin::UnboundVariable,
                "a variable in arithmetic has no value yet: put the goal that gives it one before",
            )),
            other => match self.store.export(other, &self.view) {
                Ok(value) => crate::native::type_error("a number", &value),
                Err(it) => too_large(it),
            },
        }
    }
}

/// The program counter where the newest choice is to go on.
const GOES_BACK: u32 = u32::MAX;

/// The next fact whose constants are those of the call, from the first of `rows` on.
fn next_fact(store: &Store, facts: &Facts, rows: &mut FactRows, args: &[Cell]) -> Option<u32> {
    let found = rows.left.clone().find(|position| {
        let row = facts.row(facts.at(rows, *position));
        args.iter().zip(row).all(|(arg, cell)| match (store.deref(*arg), cell) {
            (Cell::Imm(a), Cell::Imm(b)) => super::store::same_imm(&a, b),
            (Cell::Imm(_), Cell::Obj(_)) => false,
            _ => true,
        })
    })?;
    rows.left.start = found;
    Some(found)
}

fn cell_of(value: Value) -> Cell {
    match value {
        Value::Imm(imm) => Cell::Imm(imm),
        Value::Obj(_) => Cell::NIL,
    }
}

fn num_ne(a: &Value, b: &Value) -> Result<bool, Raise> {
    arith::num_eq(a, b).map(|equal| !equal)
}

/// Integers that divide exactly.
trait ExactDiv: Sized {
    fn checked_exact_div(self, other: Self) -> Option<Self>;
}
impl ExactDiv for i64 {
    fn checked_exact_div(self, other: i64) -> Option<i64> {
        if self.checked_rem(other)? == 0 { Some(self / other) } else { None }
    }
}

pub(super) fn too_large(_: TooLarge) -> Raise {
    crate::native::too_large("a term of a rule has more than 20 million parts")
}

fn no_value(program: &Program, function: FnId) -> Raise {
    let name = program.functions.get(function.at()).map_or("a function", |it| it.name.as_str());
    let name = if name.starts_with('%') { "an expression" } else { name };
    let message = format!(
        "a variable that `{name}` is computed from has no value yet: put the goal that gives it one before"
    );
    Box::new(Failure::new(Builtin::UnboundVariable, message))
}

fn floundering(var: &Value) -> Raise {
    let name = crate::print::brief(var);
    let message =
        format!("`{name}` has no value where its negation is asked: a goal before must give it one");
    Box::new(Failure::with(
        Builtin::Floundering,
        vec![("message", Value::str(message)), ("variable", var.clone())],
    ))
}
