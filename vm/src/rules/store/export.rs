//! Terms as values for those outside of a query, and back.

use crate::desc::Desc;
use crate::value::{Imm, Map, Symbol, Value};

use super::{Cell, Outside, Shape, Store, TooLarge, step};

impl Store {
    /// The value of a term. Variables that are not bound are written `?_0`, `?_1`, in their order.
    ///
    /// # Errors
    /// [`TooLarge`]
    pub fn export(&self, term: Cell, outside: &dyn Outside) -> Result<Value, TooLarge> {
        self.export_with(term, outside, &mut Vec::new())
    }

    /// The same, where several terms share variables: `vars` are those that have names.
    ///
    /// # Errors
    /// [`TooLarge`]
    pub fn export_with(
        &self,
        term: Cell,
        outside: &dyn Outside,
        vars: &mut Vec<u32>,
    ) -> Result<Value, TooLarge> {
        enum Work {
            Enter(Cell),
            Pair,
            Struct(Shape, usize),
        }
        if let Cell::Imm(imm) = self.deref(term) {
            return Ok(Value::Imm(imm));
        }
        let mut todo = vec![Work::Enter(term)];
        let mut done: Vec<Value> = Vec::new();
        let mut steps = 0;
        while let Some(work) = todo.pop() {
            step(&mut steps)?;
            match work {
                Work::Enter(cell) => match self.deref(cell) {
                    Cell::Imm(imm) => done.push(Value::Imm(imm)),
                    Cell::Obj(at) => done.push(self.object(at).clone()),
                    Cell::Task(task) => done.push(outside.task(task)),
                    Cell::Ref(at) => {
                        let n = vars.iter().position(|var| *var == at).unwrap_or_else(|| {
                            vars.push(at);
                            vars.len() - 1
                        });
                        done.push(Value::Imm(Imm::Var(free_name(n))));
                    }
                    Cell::Pair(at) => {
                        todo.push(Work::Pair);
                        todo.push(Work::Enter(self.heap[at as usize + 1]));
                        todo.push(Work::Enter(self.heap[at as usize]));
                    }
                    Cell::Struct(at) => {
                        let (shape, parts) = self.parts(at);
                        todo.push(Work::Struct(shape, parts.len()));
                        todo.extend(parts.iter().rev().map(|part| Work::Enter(*part)));
                    }
                    Cell::Head(..) => done.push(Value::NIL),
                },
                Work::Pair => {
                    let rest = done.pop().unwrap_or_default();
                    let first = done.pop().unwrap_or_default();
                    done.push(Value::cons(first, rest));
                }
                Work::Struct(shape, n) => {
                    let parts = done.split_off(done.len() - n);
                    done.push(structure_value(shape, parts));
                }
            }
        }
        Ok(done.pop().unwrap_or_default())
    }

    /// A value that [`Store::export_with`] made of a term with variables, with new ones in their place.
    ///
    /// # Errors
    /// [`TooLarge`]
    pub fn import_open(&mut self, value: &Value, vars: &mut Vec<Cell>) -> Result<Cell, TooLarge> {
        // Lists are opened until their variables have been found; that is deep only where there are any.
        let cell = self.import(value);
        let root = self.fresh();
        let Cell::Ref(root_at) = root else { return Ok(root) };
        self.heap[root_at as usize] = cell;
        let mut todo = vec![root_at];
        let mut steps = 0;
        while let Some(at) = todo.pop() {
            step(&mut steps)?;
            match self.heap[at as usize] {
                Cell::Imm(Imm::Var(name)) => {
                    if let Some(n) = free_number(name) {
                        while vars.len() <= n {
                            let var = self.fresh();
                            vars.push(var);
                        }
                        self.heap[at as usize] = vars[n];
                    }
                }
                Cell::Obj(object) => {
                    let Some(open) = self.open_object(object) else { continue };
                    self.heap[at as usize] = open;
                    match open {
                        Cell::Pair(pair) => todo.extend([pair, pair + 1]),
                        Cell::Struct(head) => {
                            let n = self.parts(head).1.len() as u32;
                            todo.extend(head + 1..=head + n);
                        }
                        _ => {}
                    }
                }
                _ => {}
            }
        }
        Ok(self.deref(root))
    }
}

/// The name of the `n`-th variable that is not bound.
fn free_name(n: usize) -> Symbol {
    Symbol::from(&format!("?_{n}"))
}

pub(in super::super) fn free_number(name: Symbol) -> Option<usize> {
    name.strip_prefix("?_")?.parse().ok()
}

fn structure_value(shape: Shape, parts: Vec<Value>) -> Value {
    let mut parts = parts.into_iter();
    match shape {
        Shape::Vector => Value::vector(parts),
        Shape::Map => {
            let mut map = Map::new();
            while let (Some(key), Some(value)) = (parts.next(), parts.next()) {
                map.insert(key, value);
            }
            Value::map(map)
        }
        Shape::Desc => {
            let kind = parts.next().and_then(|kind| kind.as_symbol()).unwrap_or_default();
            let mut properties = Vec::new();
            while let (Some(key), Some(value)) = (parts.next(), parts.next()) {
                properties.push((key.as_symbol().unwrap_or_default(), value));
            }
            Value::desc(Desc::new(kind, properties))
        }
    }
}
