//! Rules: Horn clauses over facts, trees and values.
//!
//! [`clause`] is what the compiler makes of the text; [`show`] is the way back.

pub mod clause;
pub mod show;

use clause::{Clause, Declared, PredId};

use crate::value::Value;

/// All rules of a program. Like its code it only grows, but clauses may be taken away.
#[derive(Default)]
pub struct Rules {
    /// The predicates.
    pub predicates: Vec<Predicate>,
}

/// A predicate with its clauses.
pub struct Predicate {
    /// What is known of it.
    pub declared: Declared,
    /// Its clauses, in the order in which they are tried.
    pub clauses: Vec<Clause>,
    /// The arguments of its facts.
    pub facts: Vec<Vec<Value>>,
}

/// What a query asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ask {
    /// `(ask goal)`: true or false.
    Whether,
    /// `(answers template goal)`: a list of all.
    All,
    /// `(query goal)`: a stream.
    Stream,
}

impl Rules {
    /// A new predicate without clauses.
    pub fn declare(&mut self, declared: Declared) -> PredId {
        self.predicates.push(Predicate { declared, clauses: Vec::new(), facts: Vec::new() });
        PredId(self.predicates.len() as u32 - 1)
    }

    /// Adds a clause; see [`Clause::priority`] for the order.
    pub fn add(&mut self, clause: Clause) {
        let Some(predicate) = self.predicates.get_mut(clause.predicate.at()) else { return };
        let rank = |it: &Clause| (std::cmp::Reverse(it.priority), std::cmp::Reverse(it.text));
        let at = predicate.clauses.partition_point(|it| rank(it) <= rank(&clause));
        predicate.clauses.insert(at, clause);
    }

    /// Adds a fact.
    pub fn add_fact(&mut self, predicate: PredId, args: Vec<Value>) {
        if let Some(predicate) = self.predicates.get_mut(predicate.at()) {
            predicate.facts.push(args);
        }
    }

    /// Forgets the clauses and facts of a predicate.
    pub fn clear(&mut self, predicate: PredId) {
        if let Some(predicate) = self.predicates.get_mut(predicate.at()) {
            predicate.clauses.clear();
            predicate.facts.clear();
        }
    }
}

/// True if a predicate of this name is written in Rust.
// FIXME: look it up among the natives; there are none yet.
#[must_use]
pub fn native(_name: &str, _arity: u8) -> bool {
    true
}
