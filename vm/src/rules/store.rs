//! Terms while rules run: cells on a heap that goes back when an alternative is tried.
//!
//! A cell is 16 bytes and copied. What fits into a value without a heap part is one here, too
//! ([`Cell::Imm`]); lists and structures with variables in them live on the [`Store`]'s own heap;
//! values from outside come in as they are ([`Cell::Obj`]) and are opened a level at a time, when
//! something looks inside. So a large description costs nothing until a rule takes it apart.
//!
//! Invariants
//! 1. No term contains itself: a variable is bound only to what does not contain it.
//! 2. What is older than the newest choice and is bound is on the trail.
//! 3. What an [`Cell::Obj`] holds has no variables of rules in it.

use std::cmp::Ordering;
use std::rc::Rc;

use crate::desc::Desc;
use crate::value::{Imm, Map, Obj, Symbol, Value, equal};

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

/// What has come out of two terms whose outermost level was compared.
enum Inside {
    Differ,
    Same,
    /// These two are to be compared next.
    Rest(Cell, Cell),
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

    // ------------------------------------------------------------------ making

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

    // ------------------------------------------------------------------ looking

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

    // ------------------------------------------------------------------ unification

    /// Binds a variable that is not bound.
    #[inline(always)]
    pub fn bind(&mut self, at: u32, to: Cell) {
        self.heap[at as usize] = to;
        if at < self.old {
            self.trail.push(at);
        }
    }

    /// Makes two terms the same, if that can be.
    ///
    /// # Errors
    /// [`TooLarge`]
    #[inline]
    pub fn unify(&mut self, a: Cell, b: Cell) -> Result<bool, TooLarge> {
        let (a, b) = (self.deref(a), self.deref(b));
        match self.unify_flat(a, b) {
            Some(same) => Ok(same),
            None => self.unify_deep(a, b),
        }
    }

    /// Unifies what needs no look inside; nothing for the rest. Both stand for themselves.
    #[inline(always)]
    fn unify_flat(&mut self, a: Cell, b: Cell) -> Option<bool> {
        match (a, b) {
            (Cell::Imm(a), Cell::Imm(b)) => Some(same_imm(&a, &b)),
            (Cell::Ref(a), Cell::Ref(b)) => {
                // The younger refers to the older, so nothing refers to what goes first.
                if a != b {
                    self.bind(a.max(b), Cell::Ref(a.min(b)));
                }
                Some(true)
            }
            (Cell::Ref(at), Cell::Imm(_)) => {
                self.bind(at, b);
                Some(true)
            }
            (Cell::Imm(_), Cell::Ref(at)) => {
                self.bind(at, a);
                Some(true)
            }
            (Cell::Imm(_), _) | (_, Cell::Imm(_)) => Some(false),
            _ => None,
        }
    }

    #[inline(never)]
    fn unify_deep(&mut self, a: Cell, b: Cell) -> Result<bool, TooLarge> {
        let mut todo = std::mem::take(&mut self.todo);
        todo.clear();
        let result = self.unify_all(a, b, &mut todo);
        self.todo = todo;
        result
    }

    /// Goes along lists; what else is to be done waits in `todo`.
    fn unify_all(&mut self, a: Cell, b: Cell, todo: &mut Vec<(Cell, Cell)>) -> Result<bool, TooLarge> {
        let mut steps = 0;
        let mut next = (a, b);
        loop {
            step(&mut steps)?;
            let (a, b) = (self.deref(next.0), self.deref(next.1));
            match self.unify_flat(a, b) {
                Some(true) => {}
                Some(false) => return Ok(false),
                None => match self.unify_inside(a, b, todo)? {
                    Inside::Differ => return Ok(false),
                    Inside::Same => {}
                    Inside::Rest(a, b) => {
                        next = (a, b);
                        continue;
                    }
                },
            }
            match todo.pop() {
                Some(more) => next = more,
                None => return Ok(true),
            }
        }
    }

    /// Unifies the outermost level of two terms.
    #[inline(always)]
    fn unify_inside(&mut self, a: Cell, b: Cell, todo: &mut Vec<(Cell, Cell)>) -> Result<Inside, TooLarge> {
        match (a, b) {
            (Cell::Pair(a), Cell::Pair(b)) => {
                if a == b {
                    return Ok(Inside::Same);
                }
                let ([a, rest], [b, other]) = (self.pair_at(a), self.pair_at(b));
                let (a, b) = (self.deref(a), self.deref(b));
                match self.unify_flat(a, b) {
                    Some(true) => return Ok(Inside::Rest(rest, other)),
                    Some(false) => return Ok(Inside::Differ),
                    None => {
                        todo.push((rest, other));
                        return Ok(Inside::Rest(a, b));
                    }
                }
            }
            (Cell::Ref(at), other) | (other, Cell::Ref(at)) => {
                if self.occurs(at, other)? {
                    return Ok(Inside::Differ);
                }
                self.bind(at, other);
            }
            (Cell::Struct(a), Cell::Struct(b)) => {
                if a == b {
                    return Ok(Inside::Same);
                }
                let (Cell::Head(s, n), Cell::Head(t, m)) = (self.heap[a as usize], self.heap[b as usize])
                else {
                    return Ok(Inside::Differ);
                };
                if s != t || n != m {
                    return Ok(Inside::Differ);
                }
                for i in (1..=n).rev() {
                    todo.push((self.heap[(a + i) as usize], self.heap[(b + i) as usize]));
                }
            }
            (Cell::Obj(a), Cell::Obj(b)) => {
                if a != b && !equal(self.object(a), self.object(b), MOST_CELLS).ok_or(TooLarge)? {
                    return Ok(Inside::Differ);
                }
            }
            (Cell::Obj(at), Cell::Pair(pair)) | (Cell::Pair(pair), Cell::Obj(at)) => {
                let value = self.object(at).clone();
                let Some((first, rest)) = value.as_pair() else { return Ok(Inside::Differ) };
                // Only what is compound itself becomes an object of its own.
                let first = self.import(first);
                let own = self.deref(self.heap[pair as usize]);
                match self.unify_flat(own, first) {
                    Some(false) => return Ok(Inside::Differ),
                    Some(true) => {}
                    None => todo.push((own, first)),
                }
                return Ok(Inside::Rest(self.heap[pair as usize + 1], self.import(rest)));
            }
            (Cell::Obj(at), other @ Cell::Struct(_)) | (other @ Cell::Struct(_), Cell::Obj(at)) => {
                match self.open_object(at) {
                    Some(open @ Cell::Struct(_)) => return Ok(Inside::Rest(open, other)),
                    _ => return Ok(Inside::Differ),
                }
            }
            (Cell::Task(a), Cell::Task(b)) if a == b => {}
            _ => return Ok(Inside::Differ),
        }
        Ok(Inside::Same)
    }

    /// True if the variable at `at` is part of `term`.
    ///
    /// # Errors
    /// [`TooLarge`]
    #[inline(always)]
    pub fn occurs(&mut self, at: u32, term: Cell) -> Result<bool, TooLarge> {
        match term {
            Cell::Pair(_) | Cell::Struct(_) => self.occurs_deep(at, term),
            _ => Ok(false),
        }
    }

    #[inline(never)]
    fn occurs_deep(&mut self, at: u32, term: Cell) -> Result<bool, TooLarge> {
        let mut todo = std::mem::take(&mut self.inner);
        todo.clear();
        let result = self.occurs_in(at, term, &mut todo);
        self.inner = todo;
        result
    }

    /// Goes along lists, too.
    fn occurs_in(&self, at: u32, term: Cell, todo: &mut Vec<Cell>) -> Result<bool, TooLarge> {
        let mut next = term;
        for _ in 0..MOST_CELLS {
            match self.deref(next) {
                Cell::Ref(var) if var == at => return Ok(true),
                Cell::Pair(pair) => {
                    let [first, rest] = self.pair_at(pair);
                    match self.deref(first) {
                        Cell::Ref(var) if var == at => return Ok(true),
                        inner @ (Cell::Pair(_) | Cell::Struct(_)) => todo.push(inner),
                        _ => {}
                    }
                    next = rest;
                    continue;
                }
                Cell::Struct(structure) => todo.extend_from_slice(self.parts(structure).1),
                _ => {}
            }
            match todo.pop() {
                Some(more) => next = more,
                None => return Ok(false),
            }
        }
        Err(TooLarge)
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

    /// The parts of two cells of lists are to be compared, first parts first.
    fn add_parts(&self, a: u32, b: u32, todo: &mut Vec<(Cell, Cell)>) {
        let ([a, rest], [b, other]) = (self.pair_at(a), self.pair_at(b));
        todo.extend([(rest, other), (a, b)]);
    }

    /// True if two terms are the same as they are, without binding anything.
    ///
    /// # Errors
    /// [`TooLarge`]
    pub fn identical(&mut self, a: Cell, b: Cell) -> Result<bool, TooLarge> {
        let mut todo = vec![(a, b)];
        let mut steps = 0;
        while let Some((a, b)) = todo.pop() {
            step(&mut steps)?;
            let same = match (self.deref(a), self.deref(b)) {
                (Cell::Ref(a), Cell::Ref(b)) => a == b,
                (Cell::Imm(a), Cell::Imm(b)) => same_imm(&a, &b),
                (Cell::Task(a), Cell::Task(b)) => a == b,
                (Cell::Pair(a), Cell::Pair(b)) => {
                    self.add_parts(a, b, &mut todo);
                    true
                }
                (Cell::Struct(a), Cell::Struct(b)) => {
                    let ((s, x), (t, y)) = (self.parts(a), self.parts(b));
                    todo.extend(x.iter().copied().zip(y.iter().copied()));
                    s == t && x.len() == y.len()
                }
                (Cell::Obj(a), Cell::Obj(b)) => {
                    equal(self.object(a), self.object(b), MOST_CELLS).ok_or(TooLarge)?
                }
                (Cell::Obj(at), other) | (other, Cell::Obj(at)) => match self.open_object(at) {
                    Some(open) => {
                        let alike = std::mem::discriminant(&open) == std::mem::discriminant(&other);
                        todo.push((open, other));
                        alike
                    }
                    None => false,
                },
                _ => false,
            };
            if !same {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Matches a pattern with a term whose descriptions may say more: variables of the pattern are
    /// bound, those of the term are left alone.
    ///
    /// # Errors
    /// [`TooLarge`]
    pub fn matches(&mut self, pattern: Cell, term: Cell) -> Result<bool, TooLarge> {
        let mut todo = vec![(pattern, term)];
        let mut steps = 0;
        while let Some((pattern, term)) = todo.pop() {
            step(&mut steps)?;
            let pattern = self.open(pattern);
            if let Cell::Ref(at) = pattern {
                let term = self.deref(term);
                match term {
                    Cell::Ref(other) if other == at => {}
                    _ if self.occurs(at, term)? => return Ok(false),
                    _ => self.bind(at, term),
                }
                continue;
            }
            let term = self.open(term);
            match (pattern, term) {
                (Cell::Pair(a), Cell::Pair(b)) => {
                    self.add_parts(a, b, &mut todo);
                }
                (Cell::Struct(a), Cell::Struct(b)) => {
                    let ((s, x), (t, y)) = (self.parts(a), self.parts(b));
                    if s != t {
                        return Ok(false);
                    }
                    match s {
                        Shape::Desc => match self.open_pairs(x, y) {
                            Some(pairs) => todo.extend(pairs),
                            None => return Ok(false),
                        },
                        _ if x.len() != y.len() => return Ok(false),
                        _ => todo.extend(x.iter().copied().zip(y.iter().copied()).rev()),
                    }
                }
                (Cell::Ref(_), _) | (_, Cell::Ref(_)) => return Ok(false),
                (pattern, term) => {
                    if !self.identical(pattern, term)? {
                        return Ok(false);
                    }
                }
            }
        }
        Ok(true)
    }

    /// The values of a description's properties, each with that of the other one under the same key.
    fn open_pairs(&self, pattern: &[Cell], desc: &[Cell]) -> Option<Vec<(Cell, Cell)>> {
        let same = |a: Cell, b: Cell| matches!((a, b), (Cell::Imm(a), Cell::Imm(b)) if a == b);
        let ((kind, pattern), (other, desc)) = (pattern.split_first()?, desc.split_first()?);
        if !same(*kind, *other) {
            return None;
        }
        let value_of = |key: Cell| desc.chunks_exact(2).find(|pair| same(pair[0], key)).map(|pair| pair[1]);
        pattern.chunks_exact(2).rev().map(|pair| Some((pair[1], value_of(pair[0])?))).collect()
    }

    // ------------------------------------------------------------------ going out

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

/// What a store does not know of itself.
pub trait Outside {
    /// The value that stands for a task of the tree.
    fn task(&self, task: u32) -> Value;
}

/// The name of the `n`-th variable that is not bound.
fn free_name(n: usize) -> Symbol {
    Symbol::from(&format!("?_{n}"))
}

pub(super) fn free_number(name: Symbol) -> Option<usize> {
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
