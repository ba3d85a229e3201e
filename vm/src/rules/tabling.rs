//! Tabled predicates: each call is answered once, and may depend on itself.
//!
//! The first call of a kind is a *leader*: it stays as a choice while all tables that it needs are
//! filled, then goes through its answers. A call that meets a table that is still being filled keeps
//! what comes after it, a [`Rest`], at that table and fails; each answer that is found later, or has been
//! before, goes on with each rest once. So left recursion ends, and no answer is derived twice in one
//! way (tabling by delimited continuations: Desouter, van Dooren and Schrijvers 2015).
//!
//! A rest cannot leave a negation, a collection or a test, whose end depends on all answers: a goal in one
//! has a leader of its own, and may not depend on tables that are not full yet.

use std::rc::Rc;

use rustc_hash::{FxHashMap, FxHasher};
use std::hash::Hasher;

use crate::code::Program;
use crate::failure::{Builtin, Failure};
use crate::native::Raise;
use crate::value::{Imm, Value};

use super::Rules;
use super::call::Frame;
use super::clause::PredId;
use super::engine::{Engine, too_large};
use super::index::hash_value;
use super::live::Live;
use super::store::{Cell, Outside, Shape, Store, TooLarge};

/// A term that outlives what it was made for.
#[derive(Clone, PartialEq)]
pub(super) enum Kept {
    Imm(Imm),
    /// A variable, by its number.
    Var(u32),
    /// A value without variables.
    Value(Value),
    /// A value with variables in it, by their names.
    Open(Value),
}

/// Terms that share variables.
pub(super) type Row = Box<[Kept]>;

fn keep(
    store: &Store,
    cells: impl IntoIterator<Item = Cell>,
    vars: &mut Vec<u32>,
    outside: &dyn Outside,
) -> Result<Row, TooLarge> {
    let mut row = Vec::new();
    for cell in cells {
        row.push(match store.deref(cell) {
            Cell::Imm(imm) => Kept::Imm(imm),
            Cell::Ref(at) => {
                let n = vars.iter().position(|var| *var == at).unwrap_or_else(|| {
                    vars.push(at);
                    vars.len() - 1
                });
                Kept::Var(n as u32)
            }
            cell => {
                let mut own = Vec::new();
                let value = store.export_with(cell, outside, &mut own)?;
                match own.is_empty() {
                    true => Kept::Value(value),
                    false => Kept::Open(store.export_with(cell, outside, vars)?),
                }
            }
        });
    }
    Ok(row.into())
}

fn restore(store: &mut Store, kept: &Kept, vars: &mut Vec<Cell>) -> Result<Cell, TooLarge> {
    Ok(match kept {
        Kept::Imm(imm) => Cell::Imm(*imm),
        Kept::Var(n) => {
            while vars.len() <= *n as usize {
                let var = store.fresh();
                vars.push(var);
            }
            vars[*n as usize]
        }
        Kept::Value(value) => store.import(value),
        Kept::Open(value) => store.import_open(value, vars)?,
    })
}

fn hash(row: &Row) -> u64 {
    let mut hasher = FxHasher::default();
    for kept in row {
        match kept {
            Kept::Imm(imm) => hasher.write_u64(hash_value(&Value::Imm(*imm))),
            Kept::Var(n) => hasher.write_u32(*n),
            Kept::Value(value) | Kept::Open(value) => hasher.write_u64(hash_value(value)),
        }
    }
    hasher.finish()
}

/// What comes after a call that waits for answers, up to the end of a clause of a table.
struct Rest {
    /// The table whose answer it ends with.
    producer: u32,
    /// The frames, outermost first: where each goes on, and which of its registers it needs.
    frames: Vec<(u32, Rc<Live>)>,
    /// Arguments of the producer, arguments of the call, registers of the frames.
    kept: Row,
    /// How many answers it has gone on with.
    next: usize,
    /// It waits for its turn.
    queued: bool,
}

/// The answers of one call.
struct Table {
    predicate: PredId,
    call: Row,
    answers: Rc<Vec<Row>>,
    seen: FxHashMap<u64, Vec<u32>>,
    rests: Vec<Rest>,
    complete: bool,
}

/// The tables of one query.
#[derive(Default)]
pub struct Tables {
    tables: Vec<Table>,
    index: FxHashMap<(PredId, u64), Vec<u32>>,
    /// Leaders that are open, the newest last.
    leaders: Vec<Leader>,
    answers: usize,
}

/// A call that waits until its table and all that this one needs are full.
struct Leader {
    /// Its table; those after it are filled with it.
    first: u32,
    /// Tables whose clauses have not been tried.
    fresh: Vec<u32>,
    /// Rests that have answers to go on with.
    queue: Vec<(u32, u32)>,
}

impl Tables {
    /// Memory in use, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.answers * 3 * size_of::<Kept>()
    }

    fn find(&self, predicate: PredId, call: &Row) -> Option<u32> {
        let known = self.index.get(&(predicate, hash(call)))?;
        known.iter().copied().find(|at| self.tables[*at as usize].call == *call)
    }

    fn add(&mut self, predicate: PredId, call: Row) -> u32 {
        let at = self.tables.len() as u32;
        self.index.entry((predicate, hash(&call))).or_default().push(at);
        self.tables.push(Table {
            predicate,
            call,
            answers: Rc::default(),
            seen: FxHashMap::default(),
            rests: Vec::new(),
            complete: false,
        });
        at
    }

    /// An answer of a table; what waits for it goes on.
    fn answer(&mut self, table: u32, answer: Row) {
        let it = &mut self.tables[table as usize];
        let known = it.seen.entry(hash(&answer)).or_default();
        if known.iter().any(|at| it.answers[*at as usize] == answer) {
            return;
        }
        known.push(it.answers.len() as u32);
        self.answers += answer.len();
        Rc::make_mut(&mut it.answers).push(answer);
        let Some(leader) = self.leaders.last_mut() else { return };
        for (n, rest) in it.rests.iter_mut().enumerate() {
            if !std::mem::replace(&mut rest.queued, true) {
                leader.queue.push((table, n as u32));
            }
        }
    }
}

impl Engine {
    /// Solves a tabled predicate whose arguments are at the base.
    pub(super) fn call_table(&mut self, program: &Program, predicate: PredId) -> Result<bool, Raise> {
        let arity = program.rules.predicates[predicate.at()].declared.arity;
        let args = self.stack[self.base as usize..][..usize::from(arity)].to_vec();
        let call = keep(&self.store, args, &mut Vec::new(), &self.view).map_err(too_large)?;
        match self.tables.find(predicate, &call) {
            Some(table) if self.tables.tables[table as usize].complete => {
                self.answer_from(self.tables.tables[table as usize].answers.clone(), arity);
                Ok(false)
            }
            Some(table) => {
                let is_ours = self.tables.leaders.last().is_some_and(|leader| table >= leader.first);
                match self.rest_of_clause(&program.rules)? {
                    Some(frames) if is_ours => self.wait_for(table, frames, arity),
                    _ => Err(unstratified(program, predicate)),
                }
            }
            None => {
                let table = self.tables.add(predicate, call);
                if let Some(frames) = self.rest_of_clause(&program.rules)?
                    && let Some(leader) = self.tables.leaders.last_mut()
                {
                    leader.fresh.push(table);
                    return self.wait_for(table, frames, arity);
                }
                self.push_leader(arity);
                self.tables.leaders.push(Leader { first: table, fresh: vec![table], queue: Vec::new() });
                Ok(false)
            }
        }
    }

    /// The frames from here to the end of a clause of a table, innermost first; nothing where there is
    /// no such clause, or where something in between cannot be left half done.
    fn rest_of_clause(&mut self, rules: &Rules) -> Result<Option<Vec<Frame>>, Raise> {
        if self.tables.leaders.is_empty() {
            return Ok(None);
        }
        let mut frames = Vec::new();
        let mut at = self.frame;
        loop {
            let frame = self.frames[at as usize];
            match frame.pc {
                TABLED => return Ok(Some([frames, vec![frame]].concat())),
                0 => return Ok(None),
                pc if self.live(rules, pc).encloses => return Ok(None),
                _ => {}
            }
            frames.push(frame);
            if frames.len() > MOST_FRAMES {
                return Err(Box::new(Failure::new(
                    Builtin::TooDeep,
                    "a tabled goal stands deeper than 10000 goals below another one",
                )));
            }
            at = frame.parent;
        }
    }

    /// Keeps the rest of the clause at a table, and fails.
    fn wait_for(&mut self, table: u32, frames: Vec<Frame>, arity: u8) -> Result<bool, Raise> {
        let Some((producer, inner)) = frames.split_last() else { return Ok(false) };
        let at = producer.base as usize;
        let Cell::Imm(Imm::Int(number)) = self.stack[at] else { return Ok(false) };
        let mut cells = match self.store.deref(self.stack[at + 1]) {
            Cell::Struct(args) => self.store.parts(args).1.to_vec(),
            _ => Vec::new(),
        };
        cells.extend_from_slice(&self.stack[self.base as usize..][..usize::from(arity)]);
        let mut lives = Vec::new();
        for frame in inner.iter().rev() {
            let Some(live) = self.live.get(&frame.pc).cloned() else { continue };
            cells.extend(live.registers.iter().map(|r| self.stack[frame.base as usize + usize::from(*r)]));
            lives.push((frame.pc, live));
        }
        let kept = keep(&self.store, cells, &mut Vec::new(), &self.view).map_err(too_large)?;
        let it = &mut self.tables.tables[table as usize];
        let queued = !it.answers.is_empty();
        let n = it.rests.len() as u32;
        it.rests.push(Rest { producer: number as u32, frames: lives, kept, next: 0, queued });
        if queued && let Some(leader) = self.tables.leaders.last_mut() {
            leader.queue.push((table, n));
        }
        Ok(false)
    }

    /// The newest leader has tried all that it had: there may be more to do. False if its tables are
    /// complete now; then its answers are a choice in its place.
    pub(super) fn lead(&mut self, program: &Program, arity: u8) -> Result<bool, Raise> {
        let Some(leader) = self.tables.leaders.last_mut() else { return Ok(false) };
        if let Some(table) = leader.fresh.pop() {
            return self.try_clauses(program, table);
        }
        if let Some((table, n)) = leader.queue.pop() {
            let it = &mut self.tables.tables[table as usize];
            let (rest, answers) = (&mut it.rests[n as usize], it.answers.len());
            let answer = rest.next;
            rest.next += 1;
            rest.queued = rest.next < answers;
            if rest.queued {
                leader.queue.push((table, n));
            }
            return self.go_on_with(program, table, n as usize, answer);
        }
        let first = leader.first;
        self.tables.leaders.pop();
        for table in &mut self.tables.tables[first as usize..] {
            table.complete = true;
            table.rests = Vec::new();
            table.seen = FxHashMap::default();
        }
        let answers = self.tables.tables[first as usize].answers.clone();
        self.replace_leader(answers, arity);
        Ok(false)
    }

    /// The frame that an answer of `table` returns to, with the arguments of its call.
    fn producer_frame(&mut self, table: u32, args: Vec<Cell>) -> u32 {
        let base = self.room(2);
        let args = self.store.structure(Shape::Vector, args);
        self.stack[base as usize] = Cell::int(table.into());
        self.stack[base as usize + 1] = args;
        self.push_frame(TABLED, base);
        base + 2
    }

    fn try_clauses(&mut self, program: &Program, table: u32) -> Result<bool, Raise> {
        let (predicate, call) = {
            let it = &self.tables.tables[table as usize];
            (it.predicate, it.call.clone())
        };
        let mut vars = Vec::new();
        let mut args = Vec::with_capacity(call.len());
        for kept in &call {
            args.push(restore(&mut self.store, kept, &mut vars).map_err(too_large)?);
        }
        let base = self.producer_frame(table, args.clone());
        self.base = base;
        self.room(args.len());
        self.stack[base as usize..][..args.len()].copy_from_slice(&args);
        Ok(self.enter_clauses(&program.rules, predicate))
    }

    /// Goes on with the `n`-th rest at `table`, for one of its answers.
    fn go_on_with(&mut self, program: &Program, table: u32, n: usize, answer: usize) -> Result<bool, Raise> {
        let it = &self.tables.tables[table as usize];
        let (rest, answer) = (&it.rests[n], &it.answers[answer]);
        let producer = rest.producer;
        let arity =
            program.rules.predicates[self.tables.tables[producer as usize].predicate.at()].declared.arity;
        let mut vars = Vec::new();
        let mut cells = Vec::with_capacity(rest.kept.len());
        for kept in &rest.kept {
            cells.push(restore(&mut self.store, kept, &mut vars).map_err(too_large)?);
        }
        let mut vars = Vec::new();
        let call = &cells[usize::from(arity)..];
        for (kept, cell) in answer.iter().zip(call) {
            let value = restore(&mut self.store, kept, &mut vars).map_err(too_large)?;
            if !self.store.unify(*cell, value).map_err(too_large)? {
                return Ok(false);
            }
        }
        let mut registers = usize::from(arity) + answer.len();
        let frames = rest.frames.clone();
        let mut base = self.producer_frame(producer, cells[..usize::from(arity)].to_vec());
        for (pc, live) in &frames {
            self.base = base;
            let size = live.registers.iter().map(|r| usize::from(*r) + 1).max().unwrap_or(0);
            self.room(size);
            for register in &live.registers {
                self.stack[base as usize + usize::from(*register)] = cells[registers];
                registers += 1;
            }
            self.push_frame(*pc, base);
            // Calls of the clause begin above all its registers.
            base += 256;
        }
        Ok(self.proceed())
    }

    /// A clause of a table holds: an answer, and on to the next.
    pub(super) fn table_answer(&mut self, table: Cell, args: Cell) -> Result<(), Raise> {
        let (Cell::Imm(Imm::Int(table)), Cell::Struct(at)) = (table, args) else { return Ok(()) };
        let args = self.store.parts(at).1.to_vec();
        let answer = keep(&self.store, args, &mut Vec::new(), &self.view).map_err(too_large)?;
        self.tables.answer(table as u32, answer);
        Ok(())
    }

    /// Unifies the arguments of a call with an answer.
    pub(super) fn take_answer(&mut self, answer: &Row) -> Result<bool, Raise> {
        let mut vars = Vec::new();
        for (n, kept) in answer.iter().enumerate() {
            let value = restore(&mut self.store, kept, &mut vars).map_err(too_large)?;
            let arg = self.stack[self.base as usize + n];
            if !self.store.unify(arg, value).map_err(too_large)? {
                return Ok(false);
            }
        }
        Ok(self.proceed())
    }
}

/// Where an answer of a table is taken: the second instruction of the code.
pub(super) const TABLED: u32 = 1;

/// How many goals may be open between a tabled goal and the one that needs it.
const MOST_FRAMES: usize = 10_000;

fn unstratified(program: &Program, predicate: PredId) -> Raise {
    let name = program.rules.predicates[predicate.at()].declared.name;
    let message = format!(
        "`{name}` depends on itself through a negation, a collection or a test: its answers cannot be known there"
    );
    Box::new(Failure::new(Builtin::ProgramError, message))
}
