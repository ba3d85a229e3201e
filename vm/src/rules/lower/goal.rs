//! Goals of a clause to instructions.
//!
//! A goal that has several ways to hold gives its variables values before it makes a choice, so that all ways
//! agree on where they are.

use crate::code::Pc;
use crate::value::{Imm, Value};

use super::super::clause::{Arith, Collect, Compare, Goal, GoalKind, Number, Term};
use super::super::op::RuleOp;
use super::{Lower, Lowering, TooManyVariables};

impl Lowering<'_> {
    /// The goal with which the clause ends.
    pub(super) fn last_goal(&mut self, goal: &Goal) -> Lower {
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
        if !goal.cuts() {
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

    /// What succeeds once without leaving choices or bindings, if `goals` do not hold.
    fn unless(&mut self, goals: &mut dyn FnMut(&mut Self) -> Lower) -> Lower {
        let saved = self.next;
        let choices = self.temp()?;
        self.emit(RuleOp::Choices(choices));
        let attempt = self.try_else();
        goals(self)?;
        self.emit(RuleOp::Cut(choices));
        self.emit(RuleOp::Fail);
        self.lands(attempt);
        self.next = saved;
        Ok(())
    }

    /// Collects `template` in register `d` each time that a goal holds.
    fn collect(&mut self, d: u8, kind: Collect, goal: &Goal, template: &Term) -> Lower {
        self.emit(RuleOp::Collect(d, kind));
        let attempt = self.try_else();
        self.enclosed(goal)?;
        let instance = match kind {
            Collect::Count => d,
            _ => self.build(template)?,
        };
        self.emit(RuleOp::Add1(d, instance));
        self.emit(RuleOp::Fail);
        self.lands(attempt);
        self.emit(RuleOp::Collected(d));
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
                self.unless(&mut |it| it.enclosed(inner))?;
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
                self.collect(d, *kind, inner, template)?;
                self.get(d, result)?;
            }
            GoalKind::Bag { template, by, goal: inner, list, set } => {
                self.all_known(inner);
                self.all_of(template);
                let window = self.temps(3)?;
                let witness = Term::Vector(by.iter().map(|var| Term::Var(*var)).collect());
                let pair = Term::Pair(Box::new(witness.clone()), Box::new(template.clone()));
                let d = window + 1;
                self.collect(d, Collect::List, inner, &pair)?;
                self.put(window, &witness)?;
                self.emit_at(RuleOp::Groups(window, *set), goal);
                self.get(window + 2, list)?;
            }
            GoalKind::ForAll(test, goal) => {
                self.all_known(test);
                self.all_known(goal);
                self.unless(&mut |it| {
                    it.enclosed(test)?;
                    it.unless(&mut |it| it.enclosed(goal))
                })?;
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
