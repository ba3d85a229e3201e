//! Calls: how the engine comes to the clauses, facts or natives that can answer a goal, and how it goes on
//! when the goal holds.
//!
//! A *frame* says where a clause goes on. The arguments of a call are the first registers of the callee; the
//! caller's stay below them as long as a choice may come back to them.

use std::rc::Rc;

use crate::code::{Pc, Program};
use crate::native::Raise;

use super::Rules;
use super::choice::Alternative;
use super::clause::PredId;
use super::control::Goal;
use super::engine::{Engine, WINDOW};
use super::index::{FactRows, Facts, Selected};
use super::live::Live;
use super::native::{Call, Found};
use super::store::{Cell, Store};

/// Where a clause goes on when a goal of it holds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// The frame of the clause that goes on.
    pub parent: u32,
    pub pc: u32,
    pub base: u32,
}

impl Engine {
    /// A frame for what comes after a goal whose arguments are in the registers from `window`: they are
    /// the first above it.
    pub(super) fn frame_for_goal(&mut self, base: u32, window: u8, arity: usize) {
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
    pub(super) fn move_args(&mut self, from: usize, to: usize, n: usize) {
        if self.stack.len() < to + WINDOW {
            let len = (self.stack.len() * 2).max(to + WINDOW);
            self.stack.resize(len, Cell::NIL);
        }
        self.stack.copy_within(from..from + n, to);
    }

    /// Solves a predicate whose arguments are at the base. False if nothing can answer.
    #[inline(always)]
    pub(super) fn enter(&mut self, program: &Program, predicate: PredId) -> Result<bool, Raise> {
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
        let found = index.select(&self.store, args);
        self.entry = self.choices.len() as u32;
        self.take_clauses(found, it.declared.arity)
    }

    /// Enters the first of these clauses; the others are a choice. False if there are none.
    #[inline(always)]
    pub(super) fn take_clauses(&mut self, found: Selected, arity: u8) -> bool {
        match found.count() {
            0 => return false,
            1 => {}
            _ => {
                let more = Alternative::Clauses(found.start + 1, found.end);
                self.push_choice(self.base.max(self.top), arity, more);
            }
        }
        self.pc = found.first.0;
        if let Some(trace) = &mut self.trace {
            trace.enter(found.first);
        }
        true
    }

    /// Solves a predicate of any kind.
    pub(super) fn call_predicate(
        &mut self,
        program: &Program,
        predicate: PredId,
        base: u32,
    ) -> Result<bool, Raise> {
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

    pub(super) fn call_plain(&mut self, program: &Program, predicate: PredId) -> Result<bool, Raise> {
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

    pub(super) fn take_fact(&mut self, facts: &Facts, row: u32, arity: u8) -> bool {
        let args = &self.stack[self.base as usize..][..usize::from(arity)];
        is_fact(&mut self.store, args, facts.row(row)) && self.proceed()
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

    /// `(call goal more…)`, in a window with the goal and `n` more arguments: finds the predicate of the goal and
    /// puts its arguments in place.
    pub(super) fn call_value(
        &mut self,
        program: &Program,
        (window, n): (u8, u8),
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
}

/// The next fact whose constants are those of the call, from the first of `rows` on.
pub(super) fn next_fact(store: &Store, facts: &Facts, rows: &mut FactRows, args: &[Cell]) -> Option<u32> {
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

/// Makes the arguments of a call those of a fact, if that can be.
pub(super) fn is_fact(store: &mut Store, args: &[Cell], fact: &[Cell]) -> bool {
    // Large constants of a program are not too large.
    args.iter().zip(fact).all(|(arg, cell)| store.unify(*arg, *cell).unwrap_or(false))
}
