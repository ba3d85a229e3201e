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

use hashbrown::hash_table::{Entry, HashTable};
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
use super::index::{hash_imm, hash_value};
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

/// The answers of a call: rows of the same length, each once, in the order in which they were found.
pub(super) struct Rows {
    arity: usize,
    kept: Vec<Kept>,
    count: u32,
    /// Positions of rows by their content.
    known: HashTable<u32>,
}

impl Rows {
    fn new(arity: usize) -> Rows {
        Rows { arity, kept: Vec::new(), count: 0, known: HashTable::new() }
    }

    /// How many there are.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// A row by its position.
    pub fn row(&self, at: u32) -> &[Kept] {
        row_at(&self.kept, self.arity, at)
    }

    /// Adds a row, which is taken out of `row`. False if it is there already.
    fn add(&mut self, row: &mut Vec<Kept>) -> bool {
        let Rows { arity, kept, count, known } = self;
        let hash_of = |at: &u32| hash(row_at(kept, *arity, *at));
        let slot = known.entry(hash(row), |at| row_at(kept, *arity, *at) == *row, hash_of);
        let Entry::Vacant(slot) = slot else { return false };
        slot.insert(*count);
        *count += 1;
        kept.append(row);
        true
    }
}

fn row_at(kept: &[Kept], arity: usize, at: u32) -> &[Kept] {
    &kept[at as usize * arity..][..arity]
}

fn keep(
    store: &Store,
    cells: impl IntoIterator<Item = Cell>,
    vars: &mut Vec<u32>,
    outside: &dyn Outside,
) -> Result<Row, TooLarge> {
    let mut row = Vec::new();
    keep_in(&mut row, store, cells, vars, outside)?;
    Ok(row.into())
}

/// Keeps terms at the end of a row.
fn keep_in(
    row: &mut Vec<Kept>,
    store: &Store,
    cells: impl IntoIterator<Item = Cell>,
    vars: &mut Vec<u32>,
    outside: &dyn Outside,
) -> Result<(), TooLarge> {
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
    Ok(())
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

fn hash(row: &[Kept]) -> u64 {
    let mut hasher = FxHasher::default();
    for kept in row {
        match kept {
            Kept::Imm(imm) => hasher.write_u64(hash_imm(imm)),
            Kept::Var(n) => hasher.write_u32(*n),
            Kept::Value(value) | Kept::Open(value) => hasher.write_u64(hash_value(value)),
        }
    }
    hasher.finish()
}

/// What comes after a call that waits for answers, up to the end of a clause of a table.
struct Rest {
    what: Rc<Unfinished>,
    /// How many answers it has gone on with.
    next: u32,
    /// It waits for its turn.
    queued: bool,
}

/// A clause of a table that is half done.
struct Unfinished {
    /// The table whose answer it ends with.
    producer: u32,
    /// The frames, outermost first: where each goes on, and which of its registers it needs.
    frames: Vec<(u32, Rc<Live>)>,
    /// Arguments of the producer, arguments of the call, registers of the frames.
    kept: Row,
}

/// The answers of one call.
struct Table {
    predicate: PredId,
    call: Row,
    answers: Rc<Rows>,
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
    /// Memory for a row and for the terms of one.
    row: Vec<Kept>,
    cells: Vec<Cell>,
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
        let answers = Rc::new(Rows::new(call.len()));
        self.tables.push(Table { predicate, call, answers, rests: Vec::new(), complete: false });
        at
    }

    /// An answer of a table, which is taken out of `answer`; what waits for it goes on.
    fn answer(&mut self, table: u32, answer: &mut Vec<Kept>) {
        let it = &mut self.tables[table as usize];
        let terms = answer.len();
        // Answers are shared when the table is complete only.
        let Some(answers) = Rc::get_mut(&mut it.answers) else { return };
        if !answers.add(answer) {
            return;
        }
        self.answers += terms;
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
        let queued = it.answers.count() > 0;
        let n = it.rests.len() as u32;
        let what = Rc::new(Unfinished { producer: number as u32, frames: lives, kept });
        it.rests.push(Rest { what, next: 0, queued });
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
            let (rest, answers) = (&mut it.rests[n as usize], it.answers.count());
            let answer = rest.next;
            rest.next += 1;
            rest.queued = rest.next < answers;
            if rest.queued {
                leader.queue.push((table, n));
            }
            let (what, answers) = (rest.what.clone(), it.answers.clone());
            let mut cells = std::mem::take(&mut self.tables.cells);
            let result = self.go_on_with(program, &what, answers.row(answer), &mut cells);
            self.tables.cells = cells;
            return result;
        }
        let first = leader.first;
        self.tables.leaders.pop();
        for table in &mut self.tables.tables[first as usize..] {
            table.complete = true;
            table.rests = Vec::new();
        }
        let answers = self.tables.tables[first as usize].answers.clone();
        self.replace_leader(answers, arity);
        Ok(false)
    }

    /// The frame that an answer of `table` returns to, with the arguments of its call.
    fn producer_frame(&mut self, table: u32, args: &[Cell]) -> u32 {
        let base = self.room(2);
        let args = self.store.structure(Shape::Vector, args.iter().copied());
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
        let base = self.producer_frame(table, &args);
        self.base = base;
        self.room(args.len());
        self.stack[base as usize..][..args.len()].copy_from_slice(&args);
        Ok(self.enter_clauses(&program.rules, predicate))
    }

    /// Goes on with a rest of a clause, for an answer of what it waits for. `cells` is memory.
    fn go_on_with(
        &mut self,
        program: &Program,
        rest: &Unfinished,
        answer: &[Kept],
        cells: &mut Vec<Cell>,
    ) -> Result<bool, Raise> {
        let producer = self.tables.tables[rest.producer as usize].predicate;
        let arity = usize::from(program.rules.predicates[producer.at()].declared.arity);
        let mut vars = Vec::new();
        cells.clear();
        for kept in &rest.kept {
            cells.push(restore(&mut self.store, kept, &mut vars).map_err(too_large)?);
        }
        vars.clear();
        for (kept, cell) in answer.iter().zip(&cells[arity..]) {
            let value = restore(&mut self.store, kept, &mut vars).map_err(too_large)?;
            if !self.store.unify(*cell, value).map_err(too_large)? {
                return Ok(false);
            }
        }
        let mut registers = arity + answer.len();
        let mut base = self.producer_frame(rest.producer, &cells[..arity]);
        for (pc, live) in &rest.frames {
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
        let mut row = std::mem::take(&mut self.tables.row);
        row.clear();
        let args = self.store.parts(at).1.iter().copied();
        keep_in(&mut row, &self.store, args, &mut Vec::new(), &self.view).map_err(too_large)?;
        self.tables.answer(table as u32, &mut row);
        self.tables.row = row;
        Ok(())
    }

    /// Unifies the arguments of a call with an answer.
    pub(super) fn take_answer(&mut self, answer: &[Kept]) -> Result<bool, Raise> {
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
