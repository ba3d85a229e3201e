//! Choices: what can be tried instead, and how the engine goes back to it.
//!
//! A choice is one record of fixed size; the arguments of its call stand in a vector of their own. What is older
//! than the newest choice is protected: new frames and registers begin above it, and what is bound there is noted.

use std::rc::Rc;

use crate::code::{Pc, Program};
use crate::native::Raise;

use super::call::{is_fact, next_fact};
use super::clause::PredId;
use super::collect::Groups;
use super::engine::{Engine, too_large};
use super::index::{FactRows, Facts};
use super::native::{Alternatives, Call};
use super::store::Mark;
use super::tabling::Rows;

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
    Groups(u8, Box<Groups>),
    /// More answers of a table.
    Answers(Rc<Rows>, u32),
    /// Tables are being filled for this call.
    Leader,
    /// Nothing: `*->` has taken it away.
    None,
}

impl Engine {
    /// Registers below `top` are needed by what may go on; the first `args` at the base are kept.
    pub(super) fn push_choice(&mut self, top: u32, args: u8, alternative: Alternative) {
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
    pub(super) fn back(&mut self, program: &Program) -> Result<bool, Raise> {
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
                    let Some(position) = next_fact(&self.store, facts, rows, args) else {
                        self.pop_choice();
                        continue;
                    };
                    let row = facts.at(rows, position);
                    rows.left.start = position + 1;
                    if next_fact(&self.store, facts, rows, args).is_none() {
                        let (facts, arity) = (facts.clone(), choice.args);
                        self.pop_choice();
                        if self.take_fact(&facts, row, arity) {
                            return Ok(true);
                        }
                    } else if is_fact(&mut self.store, args, facts.row(row)) {
                        return Ok(self.proceed());
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
                        // The fuel is looked at, then it goes on.
                        None if alternatives.is_busy() => {
                            self.pc = super::FAIL.0;
                            return Ok(true);
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
                    let (at, rows) = (*next, answers.clone());
                    *next += 1;
                    if *next >= rows.count() {
                        self.pop_choice();
                    }
                    if self.take_answer(rows.row(at))? {
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
    pub(super) fn answer_from(&mut self, answers: Rc<Rows>, arity: u8) {
        if answers.count() > 0 {
            self.push_choice(self.base.max(self.top), arity, Alternative::Answers(answers, 0));
        }
    }

    /// The call is answered when all tables that it needs are full.
    pub(super) fn push_leader(&mut self, arity: u8) {
        self.push_choice(self.base.max(self.top), arity, Alternative::Leader);
    }

    /// The tables of the newest choice are full: these are its answers.
    pub(super) fn replace_leader(&mut self, answers: Rc<Rows>, arity: u8) {
        self.pop_choice();
        self.answer_from(answers, arity);
    }
}
