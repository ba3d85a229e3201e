//! Making terms the same, and comparing them.
//!
//! Walks over two terms keep what is left to do in memory of the store, so that none is asked for each time. They
//! go along lists without it.

use crate::value::equal;

use super::{Cell, MOST_CELLS, Shape, Store, TooLarge, same_imm, step};

/// What has come out of two terms whose outermost level was compared.
enum Inside {
    Differ,
    Same,
    /// These two are to be compared next.
    Rest(Cell, Cell),
}

impl Store {
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
}
