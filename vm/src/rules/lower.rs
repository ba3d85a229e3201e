//! Clauses to instructions.
//!
//! Registers of a clause: the arguments of its head, then one for each variable that is not such an
//! argument itself, then temporary ones. A register gets its value once on each way through the
//! clause, so going back to a choice restores nothing.

use crate::code::Pc;
use crate::value::{Imm, Value};

use super::Rules;
use super::clause::{Arith, Clause, Collect, Compare, Goal, GoalKind, Number, Term, VarNo};
use super::op::{Const, Part, RuleOp, Template};
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
        if cuts(&clause.body) {
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

    // ------------------------------------------------------------------ terms

    /// The register must hold `term`.
    fn get(&mut self, register: u8, term: &Term) -> Lower {
        match term {
            Term::Any => {}
            Term::Var(var) => {
                let own = self.registers[*var as usize];
                match std::mem::replace(&mut self.known[*var as usize], true) {
                    true => self.emit(RuleOp::Unify(own, register)),
                    false => self.emit(RuleOp::Move(own, register)),
                };
            }
            Term::Const(value) if value.is_nil() => {
                self.emit(RuleOp::GetNil(register));
            }
            Term::Const(value) => {
                let constant = self.constant(value);
                self.emit(RuleOp::GetConst(register, constant));
            }
            Term::Pair(..) => self.get_list(register, term)?,
            Term::Vector(_) | Term::Map(_) | Term::Desc(..) => {
                let (template, values) = self.template(term);
                let saved = self.next;
                let first = self.temps(values.len())?;
                self.emit(RuleOp::GetStruct(register, first, template));
                for (at, term) in values.into_iter().enumerate() {
                    self.get(first + at as u8, term)?;
                }
                self.next = saved;
            }
        }
        Ok(())
    }

    /// The register must hold a list: its cells are looked at one after another, and each rest of it is in
    /// the same register as the one before.
    fn get_list(&mut self, register: u8, list: &Term) -> Lower {
        let saved = self.next;
        let (mut list, mut cell, mut rest_register) = (list, register, None);
        while let Term::Pair(first, rest) = list {
            let (mut later, before) = (Vec::new(), self.next);
            let is_end = !matches!(**rest, Term::Pair(..));
            if !is_end && rest_register.is_none() {
                rest_register = Some(self.temp()?);
            }
            let inner = self.next;
            let first = self.part(first, &mut later)?;
            let next = match rest_register {
                Some(next) if !is_end => Part::First(next),
                _ => self.part(rest, &mut later)?,
            };
            self.emit(match (first, next) {
                (Part::First(first), Part::First(next)) => RuleOp::GetParts(cell, first, next),
                (Part::Same(first), Part::First(next)) => RuleOp::GetRest(cell, first, next),
                _ => RuleOp::GetPair(cell, first, next),
            });
            for (register, term) in later {
                self.get(register, term)?;
            }
            self.next = if is_end { before } else { inner };
            cell = rest_register.unwrap_or(cell);
            list = rest;
        }
        self.next = saved;
        Ok(())
    }

    /// A part of a list cell that is looked at; what is more than a variable is looked at later.
    fn part<'t>(
        &mut self,
        term: &'t Term,
        later: &mut Vec<(u8, &'t Term)>,
    ) -> Result<Part, TooManyVariables> {
        if let Some(part) = self.plain_part(term) {
            return Ok(part);
        }
        let register = self.temp()?;
        later.push((register, term));
        Ok(Part::First(register))
    }

    /// A part of a list cell that needs nothing but itself.
    fn plain_part(&mut self, term: &Term) -> Option<Part> {
        Some(match term {
            Term::Any => Part::Any,
            Term::Const(value) if value.is_nil() => Part::Nil,
            Term::Var(var) => {
                let own = self.registers[*var as usize];
                match std::mem::replace(&mut self.known[*var as usize], true) {
                    true => Part::Same(own),
                    false => Part::First(own),
                }
            }
            _ => return None,
        })
    }

    /// Shape and keys of a structure, and the terms of its values.
    fn template<'t>(&mut self, term: &'t Term) -> (Template, Vec<&'t Term>) {
        let (shape, kind, keys, values): (_, _, Vec<Value>, Vec<&Term>) = match term {
            Term::Vector(items) => (Shape::Vector, Value::NIL, Vec::new(), items.iter().collect()),
            Term::Map(entries) => {
                let keys = entries.iter().map(|entry| entry.0.clone()).collect();
                (Shape::Map, Value::NIL, keys, entries.iter().map(|entry| &entry.1).collect())
            }
            Term::Desc(kind, properties) => {
                let keys = properties.iter().map(|property| Value::Imm(Imm::Symbol(property.0))).collect();
                let values = properties.iter().map(|property| &property.1).collect();
                (Shape::Desc, Value::Imm(Imm::Symbol(*kind)), keys, values)
            }
            _ => (Shape::Vector, Value::NIL, Vec::new(), Vec::new()),
        };
        let keys = Keys { shape, kind, keys, values: values.len() as u32 };
        let known = self.rules.templates.iter().position(|it| *it == keys);
        let at = known.unwrap_or_else(|| {
            self.rules.templates.push(keys);
            self.rules.templates.len() - 1
        });
        (Template(at as u32), values)
    }

    /// Puts a term into a register.
    fn put(&mut self, register: u8, term: &Term) -> Lower {
        match term {
            Term::Any => {
                self.emit(RuleOp::Fresh(register));
            }
            Term::Var(var) => {
                let own = self.var(*var);
                if own != register {
                    self.emit(RuleOp::Move(register, own));
                }
            }
            Term::Const(value) => {
                let constant = self.constant(value);
                self.emit(RuleOp::PutConst(register, constant));
            }
            Term::Pair(first, rest) => {
                // A list is built from its end, in one register.
                let mut items = vec![&**first];
                let mut end = &**rest;
                while let Term::Pair(first, rest) = end {
                    items.push(first);
                    end = rest;
                }
                let known = short_list(end);
                if let Some(known) = &known {
                    items.extend(known);
                    end = &Term::Const(Value::NIL);
                }
                let saved = self.next;
                let list = if items.len() > 1 { self.temp()? } else { register };
                if let Term::Var(var) = end
                    && items.iter().any(|item| item.has_var(*var))
                {
                    self.var(*var);
                }
                let mut rest = self.built(end)?;
                for (n, item) in items.into_iter().enumerate().rev() {
                    let inner = self.next;
                    let first = self.built(item)?;
                    self.next = inner;
                    self.emit(RuleOp::PutPair(if n == 0 { register } else { list }, first, rest));
                    rest = Part::Same(list);
                }
                self.next = saved;
            }
            Term::Vector(_) | Term::Map(_) | Term::Desc(..) => {
                let (template, values) = self.template(term);
                let saved = self.next;
                let first = self.temps(values.len())?;
                for (at, term) in values.into_iter().enumerate() {
                    self.put(first + at as u8, term)?;
                }
                self.emit(RuleOp::PutStruct(register, first, template));
                self.next = saved;
            }
        }
        Ok(())
    }

    /// A part of a list cell that is made.
    fn built(&mut self, term: &Term) -> Result<Part, TooManyVariables> {
        match self.plain_part(term) {
            Some(part) => Ok(part),
            None => Ok(Part::Same(self.build(term)?)),
        }
    }

    /// A register that holds a term: that of a variable, or a temporary one.
    fn build(&mut self, term: &Term) -> Result<u8, TooManyVariables> {
        if let Term::Var(var) = term {
            return Ok(self.var(*var));
        }
        let register = self.temp()?;
        self.put(register, term)?;
        Ok(register)
    }

    /// The register of a variable, which has a value from now on.
    fn var(&mut self, var: VarNo) -> u8 {
        let own = self.registers[var as usize];
        if !std::mem::replace(&mut self.known[var as usize], true) {
            self.emit(RuleOp::Fresh(own));
        }
        own
    }

    // ------------------------------------------------------------------ goals

    /// The goal with which the clause ends.
    fn last_goal(&mut self, goal: &Goal) -> Lower {
        match &goal.kind {
            GoalKind::And(goals) => match goals.split_last() {
                Some((last, goals)) => {
                    for goal in goals {
                        self.goal(goal)?;
                    }
                    self.last_goal(last)
                }
                None => {
                    self.emit(RuleOp::Proceed);
                    Ok(())
                }
            },
            GoalKind::Call(predicate, args) if !self.rules.is_native(*predicate) => {
                let saved = self.next;
                if self.can_stay(args) {
                    for (at, term) in args.iter().enumerate() {
                        self.put(at as u8, term)?;
                    }
                    self.emit_at(RuleOp::ExecuteHere(*predicate), goal);
                } else {
                    let window = self.window(args)?;
                    self.emit_at(RuleOp::Execute(window, *predicate), goal);
                }
                self.next = saved;
                Ok(())
            }
            GoalKind::Or(goals) if !goals.is_empty() => {
                self.all_known(goal);
                self.alternatives(goals, &mut |it, goal| it.last_goal(goal))
            }
            GoalKind::If { test, then, otherwise, soft } => {
                self.choose(goal, test, then, otherwise.as_deref(), *soft, true)
            }
            _ => {
                self.goal(goal)?;
                self.emit(RuleOp::Proceed);
                Ok(())
            }
        }
    }

    /// True if the arguments of the last goal can be put into the first registers one after another:
    /// the clause makes no other calls and has no choices of its own, and no argument needs a register
    /// that has been overwritten.
    fn can_stay(&self, args: &[Term]) -> bool {
        if !is_chain(&self.clause.body) {
            return false;
        }
        let reads = |term: &Term, register: u8| {
            let mut found = false;
            term.each_var(&mut |var| found |= self.registers[var as usize] == register);
            found
        };
        args.len() <= usize::from(self.next)
            && (0..args.len()).all(|at| !args[at + 1..].iter().any(|later| reads(later, at as u8)))
    }

    /// The arguments of a goal in the registers from the next one on.
    fn window(&mut self, args: &[Term]) -> Result<u8, TooManyVariables> {
        let window = self.temps(args.len())?;
        for (at, term) in args.iter().enumerate() {
            self.put(window + at as u8, term)?;
        }
        Ok(window)
    }

    /// Gives all variables of a goal a value, so that its alternatives agree on them.
    fn all_known(&mut self, goal: &Goal) {
        let mut vars = Vec::new();
        goal.each_var(&mut |var| vars.push(var));
        for var in vars {
            self.var(var);
        }
    }

    /// The same for a term that is built on one way through the clause only.
    fn all_of(&mut self, term: &Term) {
        term.each_var(&mut |var| {
            self.var(var);
        });
    }

    fn alternatives(&mut self, goals: &[Goal], each: &mut dyn FnMut(&mut Self, &Goal) -> Lower) -> Lower {
        let Some((last, goals)) = goals.split_last() else { return Ok(()) };
        for goal in goals {
            let attempt = self.try_else();
            each(self, goal)?;
            self.lands(attempt);
        }
        each(self, last)
    }

    /// A choice whose alternative is not known yet.
    fn try_else(&mut self) -> usize {
        let at = self.emit(RuleOp::Try(0, Pc(0)));
        self.sized.push(at);
        at
    }

    fn lands(&mut self, at: usize) {
        let here = self.here();
        match &mut self.rules.code[at] {
            RuleOp::Try(_, target) | RuleOp::Jump(target) => *target = here,
            _ => {}
        }
    }

    /// `(-> test then else)`
    fn choose(
        &mut self,
        goal: &Goal,
        test: &Goal,
        then: &Goal,
        otherwise: Option<&Goal>,
        soft: bool,
        last: bool,
    ) -> Lower {
        self.all_known(goal);
        let saved = self.next;
        let choices = match soft {
            true => self.soft,
            false => self.temp()?,
        };
        self.soft += u8::from(soft);
        self.emit(RuleOp::Choices(choices));
        let attempt = self.try_else();
        self.enclosed(test)?;
        self.emit(if soft { RuleOp::Close(choices) } else { RuleOp::Cut(choices) });
        let end = match last {
            true => {
                self.last_goal(then)?;
                None
            }
            false => {
                self.goal(then)?;
                Some(self.emit(RuleOp::Jump(Pc(0))))
            }
        };
        self.lands(attempt);
        match (otherwise, last) {
            (Some(goal), true) => self.last_goal(goal)?,
            (Some(goal), false) => self.goal(goal)?,
            (None, _) => drop(self.emit(RuleOp::Fail)),
        }
        if let Some(end) = end {
            self.lands(end);
        }
        self.next = saved;
        Ok(())
    }

    /// A goal that a cut in it does not leave.
    fn enclosed(&mut self, goal: &Goal) -> Lower {
        if !cuts(goal) {
            return self.goal(goal);
        }
        let saved = self.next;
        let choices = self.temp()?;
        self.emit(RuleOp::Choices(choices));
        let entry = self.entry.replace(choices);
        self.goal(goal)?;
        self.entry = entry;
        self.next = saved;
        Ok(())
    }

    /// What succeeds once without leaving choices or bindings, if `goal` does not hold.
    fn unless(&mut self, goal: &Goal) -> Lower {
        let saved = self.next;
        let choices = self.temp()?;
        self.emit(RuleOp::Choices(choices));
        let attempt = self.try_else();
        self.enclosed(goal)?;
        self.emit(RuleOp::Cut(choices));
        self.emit(RuleOp::Fail);
        self.lands(attempt);
        self.next = saved;
        Ok(())
    }

    fn goal(&mut self, goal: &Goal) -> Lower {
        let saved = self.next;
        match &goal.kind {
            GoalKind::True => {}
            GoalKind::Tick(n) => drop(self.emit(RuleOp::Tick(*n))),
            GoalKind::False => drop(self.emit(RuleOp::Fail)),
            GoalKind::Cut => {
                if let Some(entry) = self.entry {
                    self.emit(RuleOp::Cut(entry));
                }
            }
            GoalKind::And(goals) => {
                for goal in goals {
                    self.goal(goal)?;
                }
            }
            GoalKind::Or(goals) if goals.is_empty() => drop(self.emit(RuleOp::Fail)),
            GoalKind::Or(goals) => {
                self.all_known(goal);
                let mut ends = Vec::new();
                self.alternatives(goals, &mut |it, goal| {
                    it.goal(goal)?;
                    ends.push(it.emit(RuleOp::Jump(Pc(0))));
                    Ok(())
                })?;
                for end in ends {
                    self.lands(end);
                }
            }
            GoalKind::Not(inner, shared) => {
                self.all_known(inner);
                for var in shared {
                    let name = Value::Imm(Imm::Var(self.clause.vars[*var as usize]));
                    let name = self.constant(&name);
                    self.emit_at(RuleOp::NeedsBound(self.registers[*var as usize], name), goal);
                }
                self.unless(inner)?;
            }
            GoalKind::If { test, then, otherwise, soft } => {
                self.choose(goal, test, then, otherwise.as_deref(), *soft, false)?;
            }
            GoalKind::Once(inner) => {
                self.all_known(inner);
                let choices = self.temp()?;
                self.emit(RuleOp::Choices(choices));
                self.enclosed(inner)?;
                self.emit(RuleOp::Cut(choices));
            }
            GoalKind::Call(predicate, args) => {
                let window = self.window(args)?;
                let at = self.emit_at(
                    match self.rules.is_native(*predicate) {
                        true => RuleOp::CallNative(window, *predicate),
                        false => RuleOp::Call(window, 0, *predicate),
                    },
                    goal,
                );
                self.sized.push(at);
            }
            GoalKind::CallValue(callee, args, scope) => {
                let all: Vec<Term> = std::iter::once(callee.clone()).chain(args.iter().cloned()).collect();
                let window = self.window(&all)?;
                let at = self.emit_at(RuleOp::CallValue(window, args.len() as u8, 0, *scope), goal);
                self.sized.push(at);
            }
            GoalKind::Unify(a, b) => self.unify(a, b)?,
            GoalKind::Matches(a, b) => {
                let (a, b) = (self.build(a)?, self.build(b)?);
                self.emit_at(RuleOp::Matches(a, b), goal);
            }
            GoalKind::Identical(a, b) => {
                let (a, b) = (self.build(a)?, self.build(b)?);
                self.emit_at(RuleOp::Identical(a, b), goal);
            }
            GoalKind::Compare(how, a, b) => {
                let (a, b) = (self.number(a, goal)?, self.number(b, goal)?);
                self.emit_at(
                    match how {
                        Compare::Less => RuleOp::Less(a, b),
                        Compare::LessEq => RuleOp::LessEq(a, b),
                        Compare::More => RuleOp::Less(b, a),
                        Compare::MoreEq => RuleOp::LessEq(b, a),
                        Compare::Equal => RuleOp::NumEq(a, b),
                        Compare::Unequal => RuleOp::NumNe(a, b),
                    },
                    goal,
                );
            }
            GoalKind::Is(term, number) => {
                let register = self.number(number, goal)?;
                self.get(register, term)?;
            }
            GoalKind::Fun(function, args, result) => {
                let window = self.window(args)?;
                let d = self.temp()?;
                self.emit_at(RuleOp::CallFun(d, window, args.len() as u8, *function), goal);
                self.get(d, result)?;
            }
            GoalKind::Collect(kind, template, inner, result) => {
                self.all_known(inner);
                self.all_of(template);
                let d = self.temp()?;
                self.emit(RuleOp::Collect(d, *kind));
                let attempt = self.try_else();
                self.enclosed(inner)?;
                let instance = match kind {
                    Collect::Count => d,
                    _ => self.build(template)?,
                };
                self.emit(RuleOp::Add1(d, instance));
                self.emit(RuleOp::Fail);
                self.lands(attempt);
                self.emit(RuleOp::Collected(d));
                self.get(d, result)?;
            }
            GoalKind::Bag { template, by, goal: inner, list, set } => {
                self.all_known(inner);
                self.all_of(template);
                let window = self.temps(3)?;
                let witness = Term::Vector(by.iter().map(|var| Term::Var(*var)).collect());
                let pair = Term::Pair(Box::new(witness.clone()), Box::new(template.clone()));
                let d = window + 1;
                self.emit(RuleOp::Collect(d, Collect::List));
                let attempt = self.try_else();
                self.enclosed(inner)?;
                let instance = self.build(&pair)?;
                self.emit(RuleOp::Add1(d, instance));
                self.emit(RuleOp::Fail);
                self.lands(attempt);
                self.emit(RuleOp::Collected(d));
                self.put(window, &witness)?;
                self.emit_at(RuleOp::Groups(window, *set), goal);
                self.get(window + 2, list)?;
            }
            GoalKind::ForAll(test, goal) => {
                self.all_known(test);
                self.all_known(goal);
                let choices = self.temp()?;
                self.emit(RuleOp::Choices(choices));
                let attempt = self.try_else();
                self.enclosed(test)?;
                self.unless(goal)?;
                self.emit(RuleOp::Cut(choices));
                self.emit(RuleOp::Fail);
                self.lands(attempt);
            }
        }
        self.next = saved;
        Ok(())
    }

    fn unify(&mut self, a: &Term, b: &Term) -> Lower {
        match (a, b) {
            (Term::Any, _) | (_, Term::Any) => Ok(()),
            (Term::Var(a), b) if self.known[*a as usize] => self.get(self.registers[*a as usize], b),
            (a, Term::Var(b)) if self.known[*b as usize] => self.get(self.registers[*b as usize], a),
            (Term::Var(a), b) => {
                // A term that the variable is part of needs it first.
                if b.has_var(*a) {
                    let own = self.var(*a);
                    return self.get(own, b);
                }
                self.put(self.registers[*a as usize], b)?;
                self.known[*a as usize] = true;
                Ok(())
            }
            (a, Term::Var(_)) => self.unify(b, a),
            (a, b) => {
                let register = self.build(a)?;
                self.get(register, b)
            }
        }
    }

    /// A register that holds a number.
    fn number(&mut self, number: &Number, goal: &Goal) -> Result<u8, TooManyVariables> {
        let (op, a, b) = match number {
            Number::Term(term) => return self.build(term),
            Number::Op(op, a, b) => (op, a, b),
        };
        if let (Arith::Add | Arith::Sub, Number::Term(Term::Const(value))) = (op, &**b)
            && let Some(i) = value.as_int()
            && let Ok(i) = i32::try_from(if *op == Arith::Add { i } else { -i })
        {
            let a = self.number(a, goal)?;
            let d = self.temp()?;
            self.emit_at(RuleOp::AddInt(d, a, i), goal);
            return Ok(d);
        }
        let (a, b) = (self.number(a, goal)?, self.number(b, goal)?);
        let d = self.temp()?;
        let op = match op {
            Arith::Add => RuleOp::Add(d, a, b),
            Arith::Sub => RuleOp::Sub(d, a, b),
            Arith::Mul => RuleOp::Mul(d, a, b),
            Arith::Div => RuleOp::Div(d, a, b),
        };
        self.emit_at(op, goal);
        Ok(d)
    }
}

/// The elements of a list of the program that ends one with variables in it, if there are few. They are made
/// as cells, too: a value from outside would have to be opened each time that somebody looks inside.
fn short_list(term: &Term) -> Option<Vec<Term>> {
    const FEW: usize = 8;
    let Term::Const(value) = term else { return None };
    let mut items = Vec::new();
    let mut rest = value;
    while let Some((first, more)) = rest.as_pair() {
        items.push(Term::Const(first.clone()));
        rest = more;
        if items.len() > FEW {
            return None;
        }
    }
    (rest.is_nil() && !items.is_empty()).then_some(items)
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

/// True if a cut of the clause is in this goal.
fn cuts(goal: &Goal) -> bool {
    match &goal.kind {
        GoalKind::Cut => true,
        GoalKind::And(goals) | GoalKind::Or(goals) => goals.iter().any(cuts),
        GoalKind::If { then, otherwise, .. } => cuts(then) || otherwise.as_deref().is_some_and(cuts),
        // What is nested in other goals is left by its cuts only.
        _ => false,
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

/// True if a body is made of tests without choices, then perhaps one call.
fn is_chain(goal: &Goal) -> bool {
    let simple = |goal: &Goal| {
        matches!(
            goal.kind,
            GoalKind::True
                | GoalKind::False
                | GoalKind::Cut
                | GoalKind::Unify(..)
                | GoalKind::Matches(..)
                | GoalKind::Identical(..)
                | GoalKind::Compare(..)
                | GoalKind::Is(..)
        )
    };
    match &goal.kind {
        GoalKind::Call(..) => true,
        GoalKind::And(goals) => goals
            .split_last()
            .is_some_and(|(last, goals)| goals.iter().all(simple) && matches!(last.kind, GoalKind::Call(..))),
        _ => false,
    }
}
