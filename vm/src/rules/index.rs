//! Which clauses and facts can answer a call.
//!
//! For each argument that tells clauses apart there is a table from what the argument is to the
//! clauses that may take it, in their order. A call looks at the arguments that it gives and takes
//! the shortest list; with one clause in it, the call makes no choice.

use std::cell::OnceCell;
use std::ops::Range;

use rustc_hash::{FxHashMap, FxHasher};
use std::hash::Hasher;

use crate::code::Pc;
use crate::value::{Imm, Obj, Value};

use super::clause::Term;
use super::store::{Cell, Shape, Store};

/// What an argument is, as far as an index looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Key {
    /// `nil`
    Nil,
    /// A list with elements.
    Pair,
    /// A vector, map or description.
    Struct(u8),
    /// Anything else, by its content.
    Value(u64),
}

impl Key {
    /// What an argument of a head must be; nothing for a variable.
    #[must_use]
    pub fn of(term: &Term) -> Option<Key> {
        match term {
            Term::Var(_) | Term::Any => None,
            Term::Const(value) => Some(Key::of_value(value)),
            Term::Pair(..) => Some(Key::Pair),
            Term::Vector(_) => Some(Key::Struct(Shape::Vector as u8)),
            Term::Map(_) => Some(Key::Struct(Shape::Map as u8)),
            Term::Desc(..) => Some(Key::Struct(Shape::Desc as u8)),
        }
    }

    /// What a value is.
    #[must_use]
    pub fn of_value(value: &Value) -> Key {
        match value {
            Value::Imm(imm) => Key::of_imm(imm),
            Value::Obj(obj) => match &**obj {
                Obj::Pair(..) => Key::Pair,
                Obj::Vector(_) => Key::Struct(Shape::Vector as u8),
                Obj::Map(_) => Key::Struct(Shape::Map as u8),
                Obj::Desc(_) => Key::Struct(Shape::Desc as u8),
                _ => Key::Value(hash_value(value)),
            },
        }
    }

    #[inline(always)]
    fn of_imm(imm: &Imm) -> Key {
        match imm {
            Imm::Nil => Key::Nil,
            imm => Key::Value(hash_imm(imm)),
        }
    }

    /// What a term is; nothing for a variable.
    #[inline(always)]
    #[must_use]
    pub fn of_cell(store: &Store, cell: Cell) -> Option<Key> {
        Some(match cell {
            Cell::Ref(_) => return None,
            Cell::Imm(imm) => Key::of_imm(&imm),
            Cell::Pair(_) => Key::Pair,
            Cell::Struct(at) => Key::Struct(store.parts(at).0 as u8),
            Cell::Obj(at) => Key::of_value(store.object(at)),
            Cell::Task(task) => Key::Value(u64::from(task) ^ (1 << 62)),
            Cell::Head(..) => return None,
        })
    }
}

/// A number for a value without a heap part.
#[inline(always)]
pub(super) fn hash_imm(imm: &Imm) -> u64 {
    let mut hasher = FxHasher::default();
    match imm {
        Imm::Unset | Imm::Nil => hasher.write_u8(0),
        Imm::Bool(b) => hasher.write_u8(1 + u8::from(*b)),
        Imm::Int(i) => {
            hasher.write_u8(3);
            hasher.write_i64(*i);
        }
        Imm::Float(f) => {
            hasher.write_u8(4);
            // There is one nan, whatever its bits.
            hasher.write_u64(if f.is_nan() { f64::NAN.to_bits() } else { f.to_bits() });
        }
        Imm::Symbol(name) => hasher.write_u64(name.precomputed_hash() ^ 5),
        Imm::Keyword(name) => hasher.write_u64(name.precomputed_hash() ^ 6),
        Imm::Var(name) => hasher.write_u64(name.precomputed_hash() ^ 7),
        Imm::Function(id) => {
            hasher.write_u8(8);
            hasher.write_u32(id.0);
        }
        Imm::Native(id) => {
            hasher.write_u8(9);
            hasher.write_u32(id.0);
        }
    }
    hasher.finish()
}

/// A number that equal values share. Looks at the first parts of large ones only.
#[must_use]
pub fn hash_value(value: &Value) -> u64 {
    const MOST: usize = 64;
    if let Value::Imm(imm) = value {
        return hash_imm(imm);
    }
    let mut hasher = FxHasher::default();
    let mut todo = vec![value];
    for _ in 0..MOST {
        let Some(value) = todo.pop() else { break };
        let obj = match value {
            Value::Imm(imm) => {
                hasher.write_u64(hash_imm(imm));
                continue;
            }
            Value::Obj(obj) => obj,
        };
        match &**obj {
            Obj::Pair(first, rest) => {
                hasher.write_u8(10);
                todo.extend([rest, first]);
            }
            Obj::Str(text) => hasher.write(text.as_bytes()),
            Obj::Vector(items) => {
                hasher.write_usize(items.len());
                todo.extend(items.iter().take(MOST).rev());
            }
            Obj::Map(map) => {
                hasher.write_usize(map.len());
                todo.extend(map.iter().take(MOST).flat_map(|(key, value)| [value, key]));
            }
            Obj::Desc(desc) => {
                hasher.write_u64(desc.kind.precomputed_hash());
                for (key, value) in desc.properties() {
                    hasher.write_u64(key.precomputed_hash());
                    todo.push(value);
                }
            }
            _ => hasher.write_u8(11),
        }
    }
    hasher.finish()
}

/// Clauses that can answer a call.
#[derive(Debug, Clone, Copy, Default)]
pub struct Selected {
    /// The code of the first, if there is one.
    pub first: Pc,
    /// Their positions in [`super::Rules::lists`].
    pub start: u32,
    /// One past the last.
    pub end: u32,
}

impl Selected {
    fn of(lists: &[Pc], range: Range<u32>) -> Selected {
        let first = lists.get(range.start as usize).copied().unwrap_or_default();
        Selected { first, start: range.start, end: range.end }
    }

    /// How many there are.
    #[inline(always)]
    #[must_use]
    pub fn count(&self) -> u32 {
        self.end - self.start
    }
}

/// The clauses of a predicate, by their arguments.
#[derive(Debug, Clone, Default)]
pub struct ClauseIndex {
    all: Selected,
    /// For arguments that tell clauses apart, the best first.
    tables: Vec<(u8, Table)>,
}

/// The clauses that take an argument, by what it is.
#[derive(Debug, Clone)]
struct Table {
    nil: Selected,
    pair: Selected,
    others: FxHashMap<Key, Selected>,
    /// For everything else: the clauses that take anything.
    any: Selected,
}

/// Arguments beyond this one are not looked at.
const MOST_ARGS: usize = 8;

impl ClauseIndex {
    /// Builds the index; the lists of clauses go to `lists`.
    pub fn new(clauses: &[(Pc, Vec<Option<Key>>)], lists: &mut Vec<Pc>) -> ClauseIndex {
        let start = lists.len() as u32;
        lists.extend(clauses.iter().map(|clause| clause.0));
        let all = Selected::of(lists, start..lists.len() as u32);
        let arity = clauses.first().map_or(0, |clause| clause.1.len());
        let mut tables = Vec::new();
        for arg in 0..arity.min(MOST_ARGS) {
            if clauses.len() < 2 {
                break;
            }
            // The clauses of each key, and those that take anything, by their positions.
            let mut groups: FxHashMap<Key, Vec<u32>> = FxHashMap::default();
            let mut anything: Vec<u32> = Vec::new();
            for (at, clause) in (0..).zip(clauses) {
                match clause.1[arg] {
                    Some(key) => groups.entry(key).or_default().push(at),
                    None => anything.push(at),
                }
            }
            if groups.is_empty() {
                continue;
            }
            let mut list = |key: Option<Key>| {
                let start = lists.len() as u32;
                let own = key.and_then(|key| groups.get(&key)).map_or(&[][..], Vec::as_slice);
                lists.extend(merged(own, &anything).map(|at| clauses[at as usize].0));
                Selected::of(lists, start..lists.len() as u32)
            };
            let (nil, pair, any) = (list(Some(Key::Nil)), list(Some(Key::Pair)), list(None));
            let keys = clauses.iter().filter_map(|clause| clause.1[arg]);
            let mut others: FxHashMap<Key, Selected> = FxHashMap::default();
            for key in keys.filter(|key| !matches!(key, Key::Nil | Key::Pair)) {
                others.entry(key).or_insert_with(|| list(Some(key)));
            }
            tables.push((groups.len(), anything.len(), (arg as u8, Table { nil, pair, others, any })));
        }
        // Where few clauses take anything, a look tells most. One that only says what nothing takes comes last.
        tables.sort_by_key(|(keys, anything, _)| (keys + anything < 2, *anything, std::cmp::Reverse(*keys)));
        ClauseIndex { all, tables: tables.into_iter().map(|it| it.2).collect() }
    }

    /// The clauses that can answer a call with these arguments.
    #[inline(always)]
    #[must_use]
    pub fn select(&self, store: &Store, args: &[Cell]) -> Selected {
        let mut best = self.all;
        for (arg, table) in &self.tables {
            let found = match store.deref(args[*arg as usize]) {
                Cell::Ref(_) => continue,
                Cell::Pair(_) => table.pair,
                Cell::Imm(Imm::Nil) => table.nil,
                cell => table.other(store, cell),
            };
            if found.count() < best.count() {
                best = found;
                if best.count() <= 1 {
                    break;
                }
            }
        }
        best
    }
}

impl Table {
    /// The clauses that take something that is not an empty list or a cell of one on the heap.
    fn other(&self, store: &Store, cell: Cell) -> Selected {
        match Key::of_cell(store, cell) {
            None => self.any,
            Some(Key::Nil) => self.nil,
            Some(Key::Pair) => self.pair,
            Some(key) => self.others.get(&key).copied().unwrap_or(self.any),
        }
    }
}

/// Two sorted lists as one.
fn merged<'l>(mut a: &'l [u32], mut b: &'l [u32]) -> impl Iterator<Item = u32> + 'l {
    std::iter::from_fn(move || {
        let from = match (a.first(), b.first()) {
            (Some(x), Some(y)) if x > y => &mut b,
            (Some(_), _) => &mut a,
            (None, _) => &mut b,
        };
        let (first, rest) = from.split_first()?;
        *from = rest;
        Some(*first)
    })
}

/// Facts: rows of constants, with an index for each argument that a call has asked for.
#[derive(Default)]
pub struct Facts {
    arity: usize,
    /// The arguments of all facts, one fact after another.
    cells: Vec<Cell>,
    index: Vec<OnceCell<FactIndex>>,
}

/// The rows that have something at one argument.
#[derive(Debug, Default)]
struct FactIndex {
    /// Rows by what they have there, each group in the order of the rows.
    rows: Vec<u32>,
    groups: FxHashMap<u64, Range<u32>>,
}

/// Rows that may answer a call: all, or a part of an index.
#[derive(Debug, Clone)]
pub struct FactRows {
    arg: Option<u8>,
    /// Positions, in the index or among all rows.
    pub left: Range<u32>,
}

impl Facts {
    /// The table of these rows.
    #[must_use]
    pub fn new(arity: usize, cells: Vec<Cell>) -> Facts {
        Facts { arity, cells, index: (0..arity).map(|_| OnceCell::new()).collect() }
    }

    /// How many facts there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.cells.len().checked_div(self.arity).unwrap_or(0)
    }

    /// True without facts.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// The arguments of a fact.
    #[inline(always)]
    #[must_use]
    pub fn row(&self, row: u32) -> &[Cell] {
        &self.cells[row as usize * self.arity..][..self.arity]
    }

    fn index(&self, store: &Store, arg: usize) -> &FactIndex {
        self.index[arg].get_or_init(|| {
            let key = |row: u32| fact_key(store, self.row(row)[arg]).unwrap_or_default();
            let mut rows: Vec<u32> = (0..self.len() as u32).collect();
            rows.sort_by_cached_key(|row| (key(*row), *row));
            let mut groups: FxHashMap<u64, Range<u32>> = FxHashMap::default();
            for (at, row) in (0..).zip(&rows) {
                groups.entry(key(*row)).or_insert(at..at).end = at + 1;
            }
            FactIndex { rows, groups }
        })
    }

    /// The rows that can answer a call with these arguments.
    #[must_use]
    pub fn select(&self, store: &Store, args: &[Cell]) -> FactRows {
        let mut best = FactRows { arg: None, left: 0..self.len() as u32 };
        if best.left.len() < 4 {
            return best;
        }
        for (arg, cell) in args.iter().enumerate().take(MOST_ARGS) {
            let Some(key) = fact_key(store, store.deref(*cell)) else { continue };
            let found = self.index(store, arg).groups.get(&key).cloned().unwrap_or_default();
            if found.len() < best.left.len() {
                best = FactRows { arg: Some(arg as u8), left: found };
            }
            if best.left.len() <= 1 {
                break;
            }
        }
        best
    }

    /// The row at a position of `rows`.
    #[inline(always)]
    #[must_use]
    pub fn at(&self, rows: &FactRows, position: u32) -> u32 {
        match rows.arg {
            None => position,
            Some(arg) => self.index[arg as usize].get().map_or(0, |index| index.rows[position as usize]),
        }
    }
}

/// What facts are found by; nothing for terms that may have variables in them.
#[inline(always)]
fn fact_key(store: &Store, cell: Cell) -> Option<u64> {
    match cell {
        Cell::Imm(imm) => Some(hash_imm(&imm)),
        Cell::Obj(at) => Some(hash_value(store.object(at))),
        Cell::Task(task) => Some(u64::from(task) ^ (1 << 62)),
        _ => None,
    }
}
