//! Clauses to instructions: their terms ([`term`]) and their goals ([`goal`]).
//!
//! Registers of a clause: the arguments of its head, then one for each variable that is not such an
//! argument itself, then temporary ones. A register gets its value once on each way through the
//! clause, so going back to a choice restores nothing.

mod goal;
mod term;

use crate::code::Pc;
use crate::value::Value;

use super::Rules;
use super::clause::{Clause, Goal, GoalKind, Term};
use super::op::{Const, RuleOp};
use super::store::Shape;

/// What a structure of the program looks like.
#[derive(Debug, Clone, PartialEq)]
pub struct Keys {
    /// What it is.
    pub shape: Shape,
    /// The kind of a description; nil else.
    pub kind: Value,
    /// Its keys, in order; none for a vector.
    pub keys: Vec<Value>,
    /// How many values it has.
    pub values: u32,
}

/// The clause needs more registers than there are.
#[derive(Debug)]
pub struct TooManyVariables;

/// A clause as code.
#[derive(Debug, Clone)]
pub struct Lowered {
    /// Its first instruction.
    pub entry: Pc,
    /// For each argument what it must be, for the index.
    pub keys: Vec<Option<super::index::Key>>,
}

struct Lowering<'a> {
    rules: &'a mut Rules,
    clause: &'a Clause,
    /// The register of each variable.
    registers: Vec<u8>,
    /// Variables that have a value here.
    known: Vec<bool>,
    /// The next temporary register.
    next: u8,
    /// The most registers so far.
    most: u8,
    /// Positions of instructions that have to know how many registers the clause uses.
    sized: Vec<usize>,
    /// Holds the number of choices at the call, if the clause cuts.
    entry: Option<u8>,
    /// The next register for the number of choices before the test of a `*->`. It is looked at whenever the
    /// test holds again, after whatever the clause has done since, so nothing else may use it.
    soft: u8,
}

type Lower = Result<(), TooManyVariables>;

/// Compiles a clause.
///
/// # Errors
/// [`TooManyVariables`]
pub fn lower(rules: &mut Rules, clause: &Clause) -> Result<Lowered, TooManyVariables> {
    let entry = Pc(rules.code.len() as u32);
    let keys =
        clause.head.iter().map(|term| if clause.open { None } else { super::index::Key::of(term) }).collect();
    let arity = clause.head.len();
    let mut registers = vec![0; clause.vars.len()];
    let mut placed = vec![false; clause.vars.len()];
    for (at, term) in clause.head.iter().enumerate() {
        if let Term::Var(var) = term
            && !std::mem::replace(&mut placed[*var as usize], true)
        {
            registers[*var as usize] = at as u8;
        }
    }
    let mut next = arity;
    for (register, _) in registers.iter_mut().zip(&placed).filter(|it| !*it.1) {
        *register = u8::try_from(next).map_err(|_| TooManyVariables)?;
        next += 1;
    }
    let next = u8::try_from(next).map_err(|_| TooManyVariables)?;
    let known = vec![false; clause.vars.len()];
    let mut it = Lowering {
        rules,
        clause,
        registers,
        known,
        next,
        most: next,
        sized: Vec::new(),
        entry: None,
        soft: 0,
    };
    it.clause()?;
    let most = it.most;
    for at in std::mem::take(&mut it.sized) {
        if let RuleOp::Try(n, _) | RuleOp::Call(_, n, _) | RuleOp::CallValue(_, _, n, _) = &mut rules.code[at]
        {
            *n = most;
        }
    }
    super::moves::take_out(rules, entry, arity);
    rules.extents.push((entry, clause.predicate));
    Ok(Lowered { entry, keys })
}

impl Lowering<'_> {
    fn clause(&mut self) -> Lower {
        let clause = self.clause;
        if clause.body.cuts() {
            let register = self.temp()?;
            self.entry = Some(register);
            self.emit(RuleOp::Entry(register));
        }
        self.soft = self.temps(soft_tests(&clause.body))?;
        // Variables that are arguments have their values; what stands twice is compared below.
        let mut heads = Vec::new();
        for (at, term) in clause.head.iter().enumerate() {
            match term {
                Term::Var(var) if !self.known[*var as usize] => self.known[*var as usize] = true,
                Term::Any => {}
                term => heads.push((at as u8, term)),
            }
        }
        for (register, term) in heads {
            match clause.open && has_desc(term) {
                true => {
                    let pattern = self.build(term)?;
                    self.emit(RuleOp::Matches(pattern, register));
                }
                false => self.get(register, term)?,
            }
        }
        self.last_goal(&clause.body)
    }

    fn emit(&mut self, op: RuleOp) -> usize {
        self.rules.code.push(op);
        self.rules.places.push(self.clause.place);
        self.rules.code.len() - 1
    }

    fn emit_at(&mut self, op: RuleOp, goal: &Goal) -> usize {
        self.rules.code.push(op);
        self.rules.places.push(goal.place);
        self.rules.code.len() - 1
    }

    fn here(&self) -> Pc {
        Pc(self.rules.code.len() as u32)
    }

    fn temp(&mut self) -> Result<u8, TooManyVariables> {
        self.temps(1)
    }

    /// So many registers in a row.
    fn temps(&mut self, n: usize) -> Result<u8, TooManyVariables> {
        let first = self.next;
        let end = usize::from(first) + n;
        self.next = u8::try_from(end).ok().filter(|end| *end < 250).ok_or(TooManyVariables)?;
        self.most = self.most.max(self.next);
        Ok(first)
    }

    fn constant(&mut self, value: &Value) -> Const {
        Const(self.rules.constant(value))
    }
}

fn has_desc(term: &Term) -> bool {
    match term {
        Term::Desc(..) => true,
        Term::Const(value) => value.as_desc().is_some(),
        Term::Pair(a, b) => has_desc(a) || has_desc(b),
        Term::Vector(items) => items.iter().any(has_desc),
        Term::Map(entries) => entries.iter().any(|entry| has_desc(&entry.1)),
        Term::Var(_) | Term::Any => false,
    }
}

/// How many `*->` there are in a goal.
fn soft_tests(goal: &Goal) -> usize {
    let all = |goals: &[Goal]| goals.iter().map(soft_tests).sum();
    match &goal.kind {
        GoalKind::And(goals) | GoalKind::Or(goals) => all(goals),
        GoalKind::If { test, then, otherwise, soft } => {
            usize::from(*soft)
                + soft_tests(test)
                + soft_tests(then)
                + otherwise.as_deref().map_or(0, soft_tests)
        }
        GoalKind::Not(goal, _) | GoalKind::Once(goal) | GoalKind::Collect(_, _, goal, _) => soft_tests(goal),
        GoalKind::Bag { goal, .. } => soft_tests(goal),
        GoalKind::ForAll(test, goal) => soft_tests(test) + soft_tests(goal),
        _ => 0,
    }
}
