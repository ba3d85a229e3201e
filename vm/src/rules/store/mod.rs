//! Terms while rules run: cells on a heap that goes back when an alternative is tried.
//!
//! A cell is 16 bytes and copied. What fits into a value without a heap part is one here, too
//! ([`Cell::Imm`]); lists and structures with variables in them live on the [`Store`]'s own heap;
//! values from outside come in as they are ([`Cell::Obj`]) and are opened a level at a time, when
//! something looks inside. So a large description costs nothing until a rule takes it apart.
//!
//! Invariants
//! 1. No term contains itself: a variable is bound only to what does not contain it ([`unify`]).
//! 2. What is older than the newest choice and is bound is on the trail.
//! 3. What an [`Cell::Obj`] holds has no variables of rules in it ([`export`]).

mod export;
mod unify;

use std::cmp::Ordering;
use std::rc::Rc;

use crate::value::{Imm, Obj, Value};

pub(super) use export::free_number;

/// A term, or a reference to one.
#[derive(Clone, Copy)]
pub enum Cell {
    /// A value without a heap part.
    Imm(Imm),
    /// A variable: its position on the heap. One that is not bound refers to itself.
    Ref(u32),
    /// A cell of a list: two positions of the heap from here.
    Pair(u32),
    /// A structure: its [`Cell::Head`] is at this position of the heap, its parts after it.
    Struct(u32),
    /// What a structure is, and of how many cells after this one.
    Head(Shape, u32),
    /// A value of [`Store::objects`]; beyond [`CONSTANT`] one of [`Store::constants`].
    Obj(u32),
    /// A task of the tree that is asked, by its number there.
    Task(u32),
}

const _: () = assert!(size_of::<Cell>() == 16);

/// What a structure is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// Its elements.
    Vector,
    /// Keys and values, in the order of the keys.
    Map,
    /// The kind, then keys and values, in the order of the keys.
    Desc,
}

impl Cell {
    /// `nil`
    pub const NIL: Cell = Cell::Imm(Imm::Nil);

    /// An integer.
    #[inline(always)]
    pub fn int(i: i64) -> Cell {
        Cell::Imm(Imm::Int(i))
    }
}

/// A unification, copy or comparison went through more cells than any honest one does.
#[derive(Debug)]
pub struct TooLarge;

/// How many cells one operation may go through.
const MOST_CELLS: usize = 20_000_000;

/// Counts one more cell of an operation.
#[inline(always)]
fn step(steps: &mut usize) -> Result<(), TooLarge> {
    *steps += 1;
    if *steps > MOST_CELLS { Err(TooLarge) } else { Ok(()) }
}

/// What a store was like when a choice was made.
#[derive(Debug, Clone, Copy, Default)]
pub struct Mark {
    /// Cells on the heap.
    pub heap: u32,
    /// Bindings on the trail.
    pub trail: u32,
    /// Objects.
    pub objects: u32,
}

/// Numbers of objects from here on are those of the program's constants.
pub const CONSTANT: u32 = 1 << 31;

/// The terms of one query.
#[derive(Default)]
pub struct Store {
    /// The constants of the program's rules.
    pub constants: Rc<Vec<Value>>,
    /// The heap.
    pub heap: Vec<Cell>,
    /// Variables that have been bound since the newest choice and are older than it.
    pub trail: Vec<u32>,
    /// Values from outside.
    pub objects: Vec<Value>,
    /// The heap when the newest choice was made.
    pub old: u32,
    /// Memory for walks over two terms, and for those over one.
    todo: Vec<(Cell, Cell)>,
    inner: Vec<Cell>,
}

impl Store {
    /// What to go back to.
    #[must_use]
    pub fn mark(&self) -> Mark {
        Mark {
            heap: self.heap.len() as u32,
            trail: self.trail.len() as u32,
            objects: self.objects.len() as u32,
        }
    }

    /// Undoes all that has happened since.
    #[inline]
    pub fn back_to(&mut self, mark: Mark) {
        for at in &self.trail[mark.trail as usize..] {
            self.heap[*at as usize] = Cell::Ref(*at);
        }
        self.trail.truncate(mark.trail as usize);
        self.heap.truncate(mark.heap as usize);
        if self.objects.len() > mark.objects as usize {
            self.objects.truncate(mark.objects as usize);
        }
    }

    /// Memory in use, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        (self.heap.len() + self.objects.len()) * size_of::<Cell>() + self.trail.len() * 4
    }

    /// A new variable.
    #[inline(always)]
    pub fn fresh(&mut self) -> Cell {
        let it = Cell::Ref(self.heap.len() as u32);
        self.heap.push(it);
        it
    }

    /// A cell of a list.
    #[inline(always)]
    pub fn pair(&mut self, first: Cell, rest: Cell) -> Cell {
        let at = self.heap.len() as u32;
        self.heap.extend_from_slice(&[first, rest]);
        Cell::Pair(at)
    }

    /// A structure.
    pub fn structure(&mut self, shape: Shape, parts: impl IntoIterator<Item = Cell>) -> Cell {
        let at = self.heap.len();
        self.heap.push(Cell::Head(shape, 0));
        self.heap.extend(parts);
        let n = (self.heap.len() - at - 1) as u32;
        self.heap[at] = Cell::Head(shape, n);
        Cell::Struct(at as u32)
    }

    /// A value from outside.
    #[inline]
    pub fn import(&mut self, value: &Value) -> Cell {
        match value {
            Value::Imm(imm) => Cell::Imm(*imm),
            Value::Obj(_) => {
                self.objects.push(value.clone());
                Cell::Obj(self.objects.len() as u32 - 1)
            }
        }
    }

    /// The list of these.
    pub fn list(&mut self, items: &[Cell], rest: Cell) -> Cell {
        items.iter().rev().fold(rest, |rest, first| self.pair(*first, rest))
    }

    /// What a cell stands for: something that is bound, or a variable that is not.
    #[inline(always)]
    #[must_use]
    pub fn deref(&self, mut cell: Cell) -> Cell {
        while let Cell::Ref(at) = cell {
            match self.heap[at as usize] {
                Cell::Ref(next) if next == at => break,
                next => cell = next,
            }
        }
        cell
    }

    /// The object behind a cell.
    #[inline]
    #[must_use]
    pub fn object(&self, at: u32) -> &Value {
        match at.checked_sub(CONSTANT) {
            Some(constant) => &self.constants[constant as usize],
            None => &self.objects[at as usize],
        }
    }

    /// A cell with the outermost level on the heap, if it is a list or structure.
    #[inline]
    pub fn open(&mut self, cell: Cell) -> Cell {
        let cell = self.deref(cell);
        match cell {
            Cell::Obj(at) => self.open_object(at).unwrap_or(cell),
            _ => cell,
        }
    }

    fn open_object(&mut self, at: u32) -> Option<Cell> {
        let value = self.object(at).clone();
        Some(match value.obj()? {
            Obj::Pair(first, rest) => {
                let (first, rest) = (self.import(first), self.import(rest));
                self.pair(first, rest)
            }
            Obj::Vector(items) => {
                let parts: Vec<Cell> = items.iter().map(|it| self.import(it)).collect();
                self.structure(Shape::Vector, parts)
            }
            Obj::Map(map) => {
                let parts: Vec<Cell> =
                    map.iter().flat_map(|(k, v)| [self.import(k), self.import(v)]).collect();
                self.structure(Shape::Map, parts)
            }
            Obj::Desc(desc) => {
                let mut parts = vec![Cell::Imm(Imm::Symbol(desc.kind))];
                for (key, value) in desc.properties() {
                    parts.push(Cell::Imm(Imm::Symbol(key)));
                    parts.push(self.import(value));
                }
                self.structure(Shape::Desc, parts)
            }
            _ => return None,
        })
    }

    /// The parts of a cell of a list on the heap.
    #[inline(always)]
    #[must_use]
    pub fn pair_at(&self, at: u32) -> [Cell; 2] {
        match self.heap[at as usize..].first_chunk() {
            Some(parts) => *parts,
            None => [Cell::NIL; 2],
        }
    }

    /// The parts of a structure on the heap.
    #[must_use]
    pub fn parts(&self, at: u32) -> (Shape, &[Cell]) {
        match self.heap[at as usize] {
            Cell::Head(shape, n) => (shape, &self.heap[at as usize + 1..][..n as usize]),
            _ => (Shape::Vector, &[]),
        }
    }

    /// Binds a variable that is not bound.
    #[inline(always)]
    pub fn bind(&mut self, at: u32, to: Cell) {
        self.heap[at as usize] = to;
        if at < self.old {
            self.trail.push(at);
        }
    }

    /// Visits a term and all its parts until `visit` says false.
    fn walk(&self, term: Cell, mut visit: impl FnMut(Cell) -> bool) -> Result<(), TooLarge> {
        let mut todo = vec![term];
        let mut steps = 0;
        while let Some(cell) = todo.pop() {
            let cell = self.deref(cell);
            step(&mut steps)?;
            if !visit(cell) {
                return Ok(());
            }
            match cell {
                Cell::Pair(at) => {
                    todo.push(self.heap[at as usize + 1]);
                    todo.push(self.heap[at as usize]);
                }
                Cell::Struct(at) => todo.extend(self.parts(at).1.iter().rev()),
                _ => {}
            }
        }
        Ok(())
    }

    /// The variables in a term that are not bound, in the order of their places.
    ///
    /// # Errors
    /// [`TooLarge`]
    pub fn variables(&self, term: Cell) -> Result<Vec<u32>, TooLarge> {
        let mut found = Vec::new();
        let mut seen = rustc_hash::FxHashSet::default();
        self.walk(term, |cell| {
            if let Cell::Ref(at) = cell
                && seen.insert(at)
            {
                found.push(at);
            }
            true
        })?;
        Ok(found)
    }
}

/// What a store does not know of itself.
pub trait Outside {
    /// The value that stands for a task of the tree.
    fn task(&self, task: u32) -> Value;
}

/// True if two values without heap parts have the same content. All is said here, so that both stay in registers.
#[inline(always)]
#[must_use]
pub fn same_imm(a: &Imm, b: &Imm) -> bool {
    match (*a, *b) {
        (Imm::Symbol(a), Imm::Symbol(b))
        | (Imm::Keyword(a), Imm::Keyword(b))
        | (Imm::Var(a), Imm::Var(b)) => a == b,
        (Imm::Int(a), Imm::Int(b)) => a == b,
        (Imm::Float(a), Imm::Float(b)) => a.total_cmp(&b) == Ordering::Equal || (a.is_nan() && b.is_nan()),
        (Imm::Bool(a), Imm::Bool(b)) => a == b,
        (Imm::Function(a), Imm::Function(b)) => a == b,
        (Imm::Native(a), Imm::Native(b)) => a == b,
        (Imm::Nil, Imm::Nil) | (Imm::Unset, Imm::Unset) => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::value::Symbol;

    struct Nobody;
    impl Outside for Nobody {
        fn task(&self, _: u32) -> Value {
            Value::NIL
        }
    }

    #[test]
    fn a_variable_is_never_part_of_itself() {
        let mut store = Store::default();
        let x = store.fresh();
        let list = store.pair(Cell::Imm(Imm::Symbol(Symbol::from("f"))), x);
        assert!(!store.unify(x, list).expect("it is small"));
        assert!(matches!(store.deref(x), Cell::Ref(_)));
    }

    #[test]
    fn values_are_opened_as_far_as_somebody_looks() {
        let mut store = Store::default();
        let value = Value::list([Value::int(1), Value::list([Value::int(2)]), Value::int(3)]);
        let cell = store.import(&value);
        let (x, xs) = (store.fresh(), store.fresh());
        let pattern = store.pair(x, xs);
        assert!(store.unify(cell, pattern).expect("it is small"));
        assert_eq!(store.export(x, &Nobody).expect("it is small"), Value::int(1));
        assert!(matches!(store.deref(xs), Cell::Obj(_)));
        assert_eq!(store.export(pattern, &Nobody).expect("it is small"), value);
    }

    #[test]
    fn copies_have_variables_of_their_own() {
        let mut store = Store::default();
        let (x, y) = (store.fresh(), store.fresh());
        let term = store.list(&[x, y, x], Cell::NIL);
        let value = store.export(term, &Nobody).expect("it is small");
        let copy = store.import_open(&value, &mut Vec::new()).expect("it is small");
        assert!(store.unify(copy, term).expect("it is small"));
        assert_eq!(store.variables(copy).expect("it is small").len(), 2);
    }

    #[test]
    fn what_is_bound_is_free_again_on_the_way_back() {
        let mut store = Store::default();
        let x = store.fresh();
        let mark = store.mark();
        store.old = mark.heap;
        let one = store.pair(Cell::int(1), Cell::NIL);
        assert!(store.unify(x, one).expect("it is small"));
        store.back_to(mark);
        assert!(matches!(store.deref(x), Cell::Ref(_)) && store.heap.len() == 1);
    }
}
