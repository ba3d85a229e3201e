//! Answers of a query as a value: a list that is made as far as somebody looks.
//!
//! A cell of it changes once, from a query that has not been asked to an answer and the cell after
//! it, or to the end. So to programs it is data like any other: who reads it twice reads the same.

use std::cell::RefCell;

use crate::value::{Obj, Value};

use super::clause::PredId;
use super::engine::Engine;

/// A cell of a stream.
pub struct Stream {
    /// Which query, and the how many-th answer.
    pub id: (u64, u64),
    state: RefCell<State>,
}

/// What is known of a cell.
pub enum State {
    /// Nobody has looked yet.
    Open(Box<Engine>),
    /// Somebody is looking.
    Busy,
    /// An answer, and the stream of those after it.
    Answer(Value, Value),
    /// There are no more answers.
    End,
    /// Looking failed.
    Failed(Value),
}

impl Stream {
    /// The answers of a query.
    #[must_use]
    pub fn open(id: (u64, u64), engine: Box<Engine>) -> Value {
        Value::new(Obj::Stream(Box::new(Stream { id, state: RefCell::new(State::Open(engine)) })))
    }

    /// The query, if nobody has looked: it is the looker's now.
    pub fn take(&self) -> Option<Box<Engine>> {
        let mut state = self.state.borrow_mut();
        match std::mem::replace(&mut *state, State::Busy) {
            State::Open(engine) => Some(engine),
            other => {
                *state = other;
                None
            }
        }
    }

    /// What is asked, if nobody has looked.
    #[must_use]
    pub fn asked(&self) -> Option<(PredId, Vec<Value>)> {
        match &*self.state.borrow() {
            State::Open(engine) => engine.asked(),
            _ => None,
        }
    }

    /// What has been found out.
    pub fn becomes(&self, state: State) {
        *self.state.borrow_mut() = state;
    }

    /// What is known.
    pub fn look<T>(&self, look: impl FnOnce(&State) -> T) -> T {
        look(&self.state.borrow())
    }

    /// The answer and the stream after it, if somebody has looked.
    #[must_use]
    pub fn cell(&self) -> Option<(Value, Value)> {
        match &*self.state.borrow() {
            State::Answer(first, rest) => Some((first.clone(), rest.clone())),
            _ => None,
        }
    }

    /// What it holds, for it to be dropped without recursion.
    pub(crate) fn take_rest(&self) -> Value {
        match std::mem::replace(&mut *self.state.borrow_mut(), State::End) {
            State::Answer(_, rest) => rest,
            _ => Value::NIL,
        }
    }
}
