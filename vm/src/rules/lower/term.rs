//! Terms of a clause to instructions: what a register must hold, and what is put into one.

use crate::value::{Imm, Value};

use super::super::clause::{Term, VarNo};
use super::super::op::{Part, RuleOp, Template};
use super::super::store::Shape;
use super::{Keys, Lower, Lowering, TooManyVariables};

impl Lowering<'_> {
    /// The register must hold `term`.
    pub(super) fn get(&mut self, register: u8, term: &Term) -> Lower {
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
    pub(super) fn put(&mut self, register: u8, term: &Term) -> Lower {
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
    pub(super) fn build(&mut self, term: &Term) -> Result<u8, TooManyVariables> {
        if let Term::Var(var) = term {
            return Ok(self.var(*var));
        }
        let register = self.temp()?;
        self.put(register, term)?;
        Ok(register)
    }

    /// The register of a variable, which has a value from now on.
    pub(super) fn var(&mut self, var: VarNo) -> u8 {
        let own = self.registers[var as usize];
        if !std::mem::replace(&mut self.known[var as usize], true) {
            self.emit(RuleOp::Fresh(own));
        }
        own
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
