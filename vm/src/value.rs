//! Values: what programs compute with.
//!
//! A value takes 16 bytes. What fits beside a tag is an [`Imm`] and is copied; all else is an
//! [`Obj`] behind one `Rc` and is shared. (Measured: one heap variant beats several on calls,
//! and `Rc` beats `Arc` by a third on lists; trees that threads share go out as bytes.)
//!
//! Invariants
//! 1. Data never changes once it is made, so it never contains itself and `Rc` frees it all.
//!    (Of the cells that change, [`Obj::Counter`] and [`Obj::Ranks`] never hold what holds them. A
//!    [`Obj::Fluent`] may: such a circle is kept until the process ends, and counts as memory.)
//! 2. Dropping a value takes constant native stack, however deep it is nested.
//! 3. Nothing here depends on addresses or on the order of interning: order is by content.

use std::cell::{Cell, RefCell};
use std::cmp::Ordering;
use std::mem::take;
use std::rc::Rc;

use crate::code::{FnId, NativeId};
use crate::desc::Desc;
use crate::edit::Edit;
use crate::failure::Failure;
use crate::fluent::Fluent;
use crate::geometry::{Pose, Vec3};
use crate::key::Ranks;
use crate::path::Path;
use crate::rules::stream::Stream;
use crate::tree::Tree;

/// An interned name: copied like an integer, compared like one, read without a lock.
pub type Symbol = ustr::Ustr;

/// A persistent vector.
pub type Vector = im::GenericVector<Value, im::shared_ptr::RcK>;

/// The elements of a vector, and the memory that is counted for them.
pub struct Items {
    vector: Vector,
    bytes: usize,
}

impl std::ops::Deref for Items {
    type Target = Vector;
    fn deref(&self) -> &Vector {
        &self.vector
    }
}

/// A changed vector or map shares all but a few nodes with the one it came from: so many bytes.
const MOST_OWN: usize = 4096;
/// Bytes of an entry of a map.
const ENTRY: usize = 2 * size_of::<Value>();
/// A persistent map in the order of its keys.
pub type Map = im::GenericOrdMap<Value, Value, im::shared_ptr::RcK>;

/// Anything that a variable can hold.
#[derive(Clone)]
pub enum Value {
    /// What fits into the value itself.
    Imm(Imm),
    /// What is shared on the heap.
    Obj(Rc<Obj>),
}

/// Values without a heap part.
///
/// Tag and content are eight bytes each, whatever the content: so a value is moved as two words. With smaller tags
/// it is moved in pieces, and a processor waits when it reads as one what was just written as several.
#[derive(Clone, Copy, PartialEq)]
#[repr(u64)]
pub enum Imm {
    /// An optional parameter that the call did not give. No program ever sees it.
    Unset,
    /// `nil`: the empty list, and false.
    Nil,
    /// `true` or `false`.
    Bool(bool),
    /// An integer.
    Int(i64),
    /// A floating-point number.
    Float(f64),
    /// `milk`
    Symbol(Symbol),
    /// `:on`, held without its colon.
    Keyword(Symbol),
    /// `?x` where it is a variable of a pattern, held with its question mark.
    Var(Symbol),
    /// A function or plan that captures nothing.
    Function(FnId),
    /// A function written in Rust.
    Native(NativeId),
}

/// A task, for programs: it says which, and nothing else.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Handle {
    /// The run, by its number.
    pub run: u64,
    /// The task, by its number in the run.
    pub task: u32,
}

/// Values with a heap part.
pub enum Obj {
    /// A cell of a list: first element and rest.
    Pair(Value, Value),
    /// Text.
    Str(Box<str>),
    /// `[a b c]`
    Vector(Box<Items>),
    /// `{k v}`
    Map(Box<Map>),
    /// `(an object (type milk))`
    Desc(Box<Desc>),
    /// What `fail` raised.
    Failure(Box<Failure>),
    /// A function with the values that it captured.
    Closure(FnId, Box<[Value]>),
    /// A place and orientation in space.
    Pose(Box<Pose>),
    /// A vector of three numbers.
    Vec3(Box<Vec3>),
    /// The counter of `with-retry-counters`.
    Counter(Cell<i64>),
    /// What a running `dolist` knows of the elements that it has seen.
    Ranks(Box<Ranks>),
    /// A path in a task tree.
    Path(Box<Path>),
    /// A change to a place of a tree.
    Edit(Box<Edit>),
    /// A task tree.
    Tree(Rc<Tree>),
    /// A cell that tasks can wait for.
    Fluent(Box<Fluent>),
    /// A task that runs.
    Task(Handle),
    /// Answers of a query, as far as somebody has looked.
    Stream(Box<Stream>),
    /// Left behind when an object has been taken apart.
    Gone,
}

const _: () = assert!(size_of::<Value>() == 16);
const _: () = assert!(size_of::<Obj>() <= 32, "a pair must not pay for the larger objects");

impl Default for Value {
    #[inline(always)]
    fn default() -> Value {
        Value::NIL
    }
}

impl Value {
    /// `nil`
    pub const NIL: Value = Value::Imm(Imm::Nil);
    /// `true`
    pub const TRUE: Value = Value::Imm(Imm::Bool(true));
    /// `false`
    pub const FALSE: Value = Value::Imm(Imm::Bool(false));
    /// A parameter that was not given.
    pub const UNSET: Value = Value::Imm(Imm::Unset);

    /// Puts an object on the heap.
    #[inline]
    pub fn new(obj: Obj) -> Value {
        live::add(obj.bytes());
        Value::Obj(Rc::new(obj))
    }
    /// An integer.
    #[inline(always)]
    pub fn int(i: i64) -> Value {
        Value::Imm(Imm::Int(i))
    }
    /// A float.
    #[inline(always)]
    pub fn float(f: f64) -> Value {
        Value::Imm(Imm::Float(f))
    }
    /// `true` or `false`.
    #[inline(always)]
    pub fn bool(b: bool) -> Value {
        Value::Imm(Imm::Bool(b))
    }
    /// A symbol of these letters.
    pub fn symbol(name: &str) -> Value {
        Value::Imm(Imm::Symbol(Symbol::from(name)))
    }
    /// A keyword of these letters, given without the colon.
    pub fn keyword(name: &str) -> Value {
        Value::Imm(Imm::Keyword(Symbol::from(name)))
    }
    /// A string.
    pub fn str(text: impl Into<Box<str>>) -> Value {
        Value::new(Obj::Str(text.into()))
    }
    /// A cell of a list.
    #[inline]
    pub fn cons(first: Value, rest: Value) -> Value {
        Value::new(Obj::Pair(first, rest))
    }
    /// The list of these values.
    pub fn list(items: impl IntoIterator<Item = Value, IntoIter: DoubleEndedIterator>) -> Value {
        Value::list_onto(items, Value::NIL)
    }
    /// These values in front of the list `rest`.
    pub fn list_onto(
        items: impl IntoIterator<Item = Value, IntoIter: DoubleEndedIterator>,
        rest: Value,
    ) -> Value {
        items.into_iter().rev().fold(rest, |rest, first| Value::cons(first, rest))
    }
    /// A vector of these values.
    pub fn vector(items: impl IntoIterator<Item = Value>) -> Value {
        let vector: Vector = items.into_iter().collect();
        let bytes = vector.len() * size_of::<Value>();
        Value::new(Obj::Vector(Box::new(Items { vector, bytes })))
    }
    /// A vector that shares most of its elements with another one.
    pub fn shared_vector(vector: Vector) -> Value {
        let bytes = (vector.len() * size_of::<Value>()).min(MOST_OWN);
        Value::new(Obj::Vector(Box::new(Items { vector, bytes })))
    }
    /// A map.
    pub fn map(map: Map) -> Value {
        Value::new(Obj::Map(Box::new(map)))
    }
    /// A failure.
    pub fn failure(failure: Failure) -> Value {
        Value::new(Obj::Failure(Box::new(failure)))
    }
    /// An entity description.
    pub fn desc(desc: Desc) -> Value {
        Value::new(Obj::Desc(Box::new(desc)))
    }

    /// The object, if the value has one.
    #[inline(always)]
    pub fn obj(&self) -> Option<&Obj> {
        if let Value::Obj(obj) = self { Some(obj) } else { None }
    }
    /// True for a true value, and for a fluent that holds one.
    #[must_use]
    pub fn holds(&self) -> bool {
        match self.obj() {
            Some(Obj::Fluent(fluent)) => fluent.value().is_true(),
            _ => self.is_true(),
        }
    }
    /// False for `nil` and `false` only.
    #[inline(always)]
    pub fn is_true(&self) -> bool {
        !matches!(self, Value::Imm(Imm::Nil | Imm::Bool(false)))
    }
    /// True for `nil`.
    #[inline(always)]
    pub fn is_nil(&self) -> bool {
        matches!(self, Value::Imm(Imm::Nil))
    }
    /// True for a parameter that was not given.
    #[inline(always)]
    pub fn is_unset(&self) -> bool {
        matches!(self, Value::Imm(Imm::Unset))
    }
    /// The integer.
    #[inline(always)]
    pub fn as_int(&self) -> Option<i64> {
        if let Value::Imm(Imm::Int(i)) = self { Some(*i) } else { None }
    }
    /// The number, integers converted.
    #[inline]
    pub fn as_number(&self) -> Option<f64> {
        match self {
            Value::Imm(Imm::Int(i)) => Some(*i as f64),
            Value::Imm(Imm::Float(f)) => Some(*f),
            _ => None,
        }
    }
    /// The symbol.
    pub fn as_symbol(&self) -> Option<Symbol> {
        if let Value::Imm(Imm::Symbol(name)) = self { Some(*name) } else { None }
    }
    /// The keyword, without its colon.
    pub fn as_keyword(&self) -> Option<Symbol> {
        if let Value::Imm(Imm::Keyword(name)) = self { Some(*name) } else { None }
    }
    /// The text of a string.
    pub fn as_str(&self) -> Option<&str> {
        if let Some(Obj::Str(text)) = self.obj() { Some(text) } else { None }
    }
    /// First element and rest of a list that is not empty.
    #[inline(always)]
    pub fn as_pair(&self) -> Option<(&Value, &Value)> {
        if let Some(Obj::Pair(first, rest)) = self.obj() { Some((first, rest)) } else { None }
    }
    /// The vector.
    pub fn as_vector(&self) -> Option<&Vector> {
        if let Some(Obj::Vector(vector)) = self.obj() { Some(vector) } else { None }
    }
    /// The map.
    pub fn as_map(&self) -> Option<&Map> {
        if let Some(Obj::Map(map)) = self.obj() { Some(map) } else { None }
    }
    /// The failure.
    pub fn as_failure(&self) -> Option<&Failure> {
        if let Some(Obj::Failure(failure)) = self.obj() { Some(failure) } else { None }
    }
    /// The description.
    pub fn as_desc(&self) -> Option<&Desc> {
        if let Some(Obj::Desc(desc)) = self.obj() { Some(desc) } else { None }
    }
    /// The tree.
    pub fn as_tree(&self) -> Option<&Rc<Tree>> {
        if let Some(Obj::Tree(tree)) = self.obj() { Some(tree) } else { None }
    }
    /// The path.
    pub fn as_path(&self) -> Option<&Path> {
        if let Some(Obj::Path(path)) = self.obj() { Some(path) } else { None }
    }
    /// True for answers of a query.
    pub fn is_stream(&self) -> bool {
        matches!(self.obj(), Some(Obj::Stream(_)))
    }
    /// First element and rest of a list, or of a stream as far as somebody has looked.
    pub fn cell(&self) -> Option<(Value, Value)> {
        match self.obj()? {
            Obj::Pair(first, rest) => Some((first.clone(), rest.clone())),
            Obj::Stream(stream) => stream.cell(),
            _ => None,
        }
    }
    /// True for `nil` and for cells of lists.
    pub fn is_list(&self) -> bool {
        self.is_nil() || self.as_pair().is_some()
    }
    /// The elements of a list; ends at the first rest that is not a cell.
    pub fn iter(&self) -> ListIter<'_> {
        ListIter { rest: self }
    }
    /// The elements of a proper list, or nothing if this is not one.
    pub fn to_vec(&self) -> Option<Vec<Value>> {
        let mut iter = self.iter();
        let items = iter.by_ref().cloned().collect();
        iter.rest.is_nil().then_some(items)
    }
    /// True if the two are one object, or equal without a heap part.
    #[inline]
    pub fn identical(&self, other: &Value) -> bool {
        match (self, other) {
            (Value::Imm(a), Value::Imm(b)) => a == b,
            (Value::Obj(a), Value::Obj(b)) => Rc::ptr_eq(a, b),
            _ => false,
        }
    }
    /// What kind of value this is, in the words of the language.
    pub fn type_name(&self) -> &'static str {
        match self {
            Value::Imm(imm) => match imm {
                Imm::Unset => "unset",
                Imm::Nil => "nil",
                Imm::Bool(_) => "boolean",
                Imm::Int(_) => "integer",
                Imm::Float(_) => "float",
                Imm::Symbol(_) => "symbol",
                Imm::Keyword(_) => "keyword",
                Imm::Var(_) => "variable",
                Imm::Function(_) | Imm::Native(_) => "function",
            },
            Value::Obj(obj) => match &**obj {
                Obj::Pair(..) => "list",
                Obj::Str(_) => "string",
                Obj::Vector(_) => "vector",
                Obj::Map(_) => "map",
                Obj::Desc(_) => "description",
                Obj::Failure(_) => "failure",
                Obj::Closure(..) => "function",
                Obj::Pose(_) => "pose",
                Obj::Vec3(_) => "vec3",
                Obj::Counter(_) => "counter",
                Obj::Fluent(_) => "fluent",
                Obj::Task(_) => "task",
                Obj::Stream(_) => "stream",
                Obj::Ranks(_) => "ranks",
                Obj::Path(_) => "path",
                Obj::Edit(_) => "edit",
                Obj::Tree(_) => "tree",
                Obj::Gone => "nothing",
            },
        }
    }
}

/// The elements of a list. `rest` is what has not been visited.
pub struct ListIter<'a> {
    /// The cells still to come; after the end `nil`, or the tail of an improper list.
    pub rest: &'a Value,
}

impl<'a> Iterator for ListIter<'a> {
    type Item = &'a Value;
    fn next(&mut self) -> Option<&'a Value> {
        let (first, rest) = self.rest.as_pair()?;
        self.rest = rest;
        Some(first)
    }
}

// ---------------------------------------------------------------------------------------------
// Order and equality

/// The total order of values, by content: first by kind, numbers by size, texts by their letters.
///
/// Integers and floats of the same size are equal in this order only if they are of one kind,
/// so `1` and `1.0` are different keys. Visits at most `limit` pairs of parts and answers
/// nothing if that is not enough: values that share their parts can be exponentially large.
pub fn compare(a: &Value, b: &Value, limit: usize) -> Option<Ordering> {
    let mut todo: Vec<(Value, Value)> = Vec::new();
    let mut steps = 0;
    let mut next = Some((a.clone(), b.clone()));
    while let Some((a, b)) = next.take().or_else(|| todo.pop()) {
        steps += 1;
        if steps > limit {
            return None;
        }
        match compare_shallow(&a, &b, &mut todo) {
            Ordering::Equal => {}
            unequal => return Some(unequal),
        }
    }
    Some(Ordering::Equal)
}

/// Enough for any value that a person looks at.
pub const COMPARE_LIMIT: usize = 10_000_000;

/// True if the two have the same content; see [`compare`] for `limit`.
pub fn equal(a: &Value, b: &Value, limit: usize) -> Option<bool> {
    compare(a, b, limit).map(Ordering::is_eq)
}

/// Compares all but the parts, which go to `todo`, the first to be compared last.
fn compare_shallow(a: &Value, b: &Value, todo: &mut Vec<(Value, Value)>) -> Ordering {
    let (one, other) = (a, b);
    let (a, b) = match (a, b) {
        (Value::Imm(a), Value::Imm(b)) => return compare_imm(a, b),
        (Value::Imm(_), Value::Obj(_)) => return Ordering::Less,
        (Value::Obj(_), Value::Imm(_)) => return Ordering::Greater,
        (Value::Obj(a), Value::Obj(b)) if Rc::ptr_eq(a, b) => return Ordering::Equal,
        (Value::Obj(a), Value::Obj(b)) => (&**a, &**b),
    };
    let mut later = |parts: &mut dyn DoubleEndedIterator<Item = (Value, Value)>| {
        todo.extend(parts.rev());
        Ordering::Equal
    };
    match (a, b) {
        (Obj::Pair(a0, a1), Obj::Pair(b0, b1)) => {
            later(&mut [(a0.clone(), b0.clone()), (a1.clone(), b1.clone())].into_iter())
        }
        (Obj::Str(a), Obj::Str(b)) => a.cmp(b),
        (Obj::Vector(a), Obj::Vector(b)) if a.len() == b.len() => {
            let parts: Vec<_> = a.iter().cloned().zip(b.iter().cloned()).collect();
            later(&mut parts.into_iter())
        }
        (Obj::Vector(a), Obj::Vector(b)) => a.len().cmp(&b.len()),
        (Obj::Map(a), Obj::Map(b)) if a.len() == b.len() => {
            let parts: Vec<_> = (a.iter().zip(b.iter()))
                .flat_map(|((k, v), (l, w))| [(k.clone(), l.clone()), (v.clone(), w.clone())])
                .collect();
            later(&mut parts.into_iter())
        }
        (Obj::Map(a), Obj::Map(b)) => a.len().cmp(&b.len()),
        (Obj::Desc(a), Obj::Desc(b)) => match a.shape().cmp(&b.shape()) {
            Ordering::Equal => later(&mut a.values().cloned().zip(b.values().cloned())),
            unequal => unequal,
        },
        (Obj::Failure(a), Obj::Failure(b)) => match a.name.as_str().cmp(b.name.as_str()) {
            Ordering::Equal => {
                let names = |it: &Failure| it.fields.iter().map(|field| field.0.as_str()).collect::<Vec<_>>();
                match names(a).cmp(&names(b)) {
                    Ordering::Equal => {
                        later(&mut a.fields.iter().zip(&b.fields).map(|(f, g)| (f.1.clone(), g.1.clone())))
                    }
                    unequal => unequal,
                }
            }
            unequal => unequal,
        },
        (Obj::Closure(f, a), Obj::Closure(g, b)) => match (f, a.len()).cmp(&(g, b.len())) {
            Ordering::Equal => later(&mut a.iter().cloned().zip(b.iter().cloned())),
            unequal => unequal,
        },
        (Obj::Pose(a), Obj::Pose(b)) => a.total_cmp(b),
        (Obj::Vec3(a), Obj::Vec3(b)) => a.total_cmp(b),
        (Obj::Counter(a), Obj::Counter(b)) => a.get().cmp(&b.get()),
        (Obj::Path(a), Obj::Path(b)) => a.cmp(b),
        (Obj::Fluent(a), Obj::Fluent(b)) => a.id.cmp(&b.id),
        (Obj::Task(a), Obj::Task(b)) => a.cmp(b),
        (Obj::Stream(a), Obj::Stream(b)) => a.id.cmp(&b.id),
        // Their texts make equal edits.
        (Obj::Edit(_), Obj::Edit(_)) => crate::print::write(one).cmp(&crate::print::write(other)),
        (Obj::Tree(a), Obj::Tree(b)) => a.fingerprint().cmp(&b.fingerprint()),
        _ => a.rank().cmp(&b.rank()),
    }
}

fn compare_imm(a: &Imm, b: &Imm) -> Ordering {
    match (a, b) {
        (Imm::Bool(a), Imm::Bool(b)) => a.cmp(b),
        (Imm::Int(a), Imm::Int(b)) => a.cmp(b),
        (Imm::Float(a), Imm::Float(b)) => one_nan(*a).total_cmp(&one_nan(*b)),
        (Imm::Int(a), Imm::Float(b)) => int_before_float(*a, *b),
        (Imm::Float(a), Imm::Int(b)) => int_before_float(*b, *a).reverse(),
        (Imm::Symbol(a), Imm::Symbol(b))
        | (Imm::Keyword(a), Imm::Keyword(b))
        | (Imm::Var(a), Imm::Var(b)) => {
            if a == b {
                Ordering::Equal
            } else {
                a.as_str().cmp(b.as_str())
            }
        }
        (Imm::Function(a), Imm::Function(b)) => a.cmp(b),
        (Imm::Native(a), Imm::Native(b)) => a.cmp(b),
        _ => a.rank().cmp(&b.rank()),
    }
}

/// There is one nan and one text for it: its sign and payload say nothing.
fn one_nan(float: f64) -> f64 {
    if float.is_nan() { f64::NAN } else { float }
}

/// By exact size; an integer before the float of its size, but after -0.0. nan is at its end.
fn int_before_float(int: i64, float: f64) -> Ordering {
    let float = one_nan(float);
    let by_size = crate::arith::int_with_float(int, float).unwrap_or_else(|| 0.0_f64.total_cmp(&float));
    by_size.then_with(|| (int as f64).total_cmp(&float)).then(Ordering::Less)
}

impl Imm {
    fn rank(&self) -> u8 {
        match self {
            Imm::Unset => 0,
            Imm::Nil => 1,
            Imm::Bool(_) => 2,
            Imm::Int(_) | Imm::Float(_) => 3,
            Imm::Symbol(_) => 4,
            Imm::Keyword(_) => 5,
            Imm::Var(_) => 6,
            Imm::Function(_) => 7,
            Imm::Native(_) => 8,
        }
    }
}

impl Obj {
    fn rank(&self) -> u8 {
        match self {
            Obj::Str(_) => 0,
            Obj::Pair(..) => 1,
            Obj::Vector(_) => 2,
            Obj::Map(_) => 3,
            Obj::Desc(_) => 4,
            Obj::Vec3(_) => 5,
            Obj::Pose(_) => 6,
            Obj::Failure(_) => 7,
            Obj::Closure(..) => 8,
            Obj::Counter(_) => 9,
            Obj::Path(_) => 10,
            Obj::Edit(_) => 11,
            Obj::Tree(_) => 12,
            Obj::Fluent(_) => 13,
            Obj::Task(_) => 14,
            Obj::Ranks(_) => 15,
            Obj::Stream(_) => 16,
            Obj::Gone => 17,
        }
    }
    /// What the object is charged against the memory limit; the same when it goes as when it came.
    fn bytes(&self) -> usize {
        const CELL: usize = size_of::<Obj>() + 2 * size_of::<usize>();
        CELL + match self {
            Obj::Pair(..) | Obj::Counter(_) | Obj::Ranks(_) | Obj::Gone | Obj::Tree(_) | Obj::Task(_) => 0,
            Obj::Fluent(_) | Obj::Stream(_) => size_of::<Fluent>(),
            Obj::Str(text) => text.len(),
            Obj::Vector(items) => 2 * CELL + items.bytes,
            Obj::Map(map) => 2 * CELL + (map.len() * ENTRY).min(MOST_OWN),
            Obj::Closure(_, captured) => captured.len() * size_of::<Value>(),
            Obj::Desc(_) | Obj::Failure(_) | Obj::Pose(_) | Obj::Vec3(_) | Obj::Path(_) | Obj::Edit(_) => {
                4 * CELL
            }
        }
    }
}

/// Keys of maps are compared in the total order. Those who put keys into maps make sure that
/// they are small (see [`crate::native::map_key`]), so the limit is never met here.
impl Ord for Value {
    fn cmp(&self, other: &Value) -> Ordering {
        compare(self, other, usize::MAX).unwrap_or(Ordering::Equal)
    }
}
impl PartialOrd for Value {
    fn partial_cmp(&self, other: &Value) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Value {
    fn eq(&self, other: &Value) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Value {}

impl std::fmt::Debug for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&crate::print::write(self))
    }
}

// ---------------------------------------------------------------------------------------------
// Memory

/// Bytes on the heap that values of this thread hold, for the memory limit.
pub mod live {
    use super::Cell;
    thread_local! { static LIVE: Cell<usize> = const { Cell::new(0) }; }
    #[inline]
    pub(super) fn add(bytes: usize) {
        LIVE.with(|live| live.set(live.get().wrapping_add(bytes)));
    }
    #[inline]
    pub(super) fn sub(bytes: usize) {
        // Values may go while the thread ends and its variables are gone.
        let _ = LIVE.try_with(|live| live.set(live.get().wrapping_sub(bytes)));
    }
    /// The figure now.
    #[must_use]
    pub fn bytes() -> usize {
        LIVE.with(Cell::get)
    }
}

/// What waits to be dropped because its owners were nested too deep.
enum Garbage {
    #[expect(dead_code, reason = "held to be dropped")]
    Value(Value),
    #[expect(dead_code, reason = "held to be dropped")]
    Vector(Vector),
    #[expect(dead_code, reason = "held to be dropped")]
    Map(Map),
    #[expect(dead_code, reason = "held to be dropped")]
    Values(Vec<Value>),
}

/// How deep drops may nest on the native stack before the rest is queued.
const DROP_DEPTH: u32 = 64;

thread_local! {
    static DEPTH: Cell<u32> = const { Cell::new(0) };
    static QUEUE: RefCell<Vec<Garbage>> = const { RefCell::new(Vec::new()) };
}

fn drop_nested(garbage: Garbage) {
    let depth = DEPTH.try_with(Cell::get).unwrap_or(0);
    if depth >= DROP_DEPTH {
        let _ = QUEUE.try_with(|queue| queue.borrow_mut().push(garbage));
        return;
    }
    let _ = DEPTH.try_with(|it| it.set(depth + 1));
    drop(garbage);
    if depth == 0 {
        while let Ok(Some(garbage)) = QUEUE.try_with(|queue| queue.borrow_mut().pop()) {
            drop(garbage);
        }
    }
    let _ = DEPTH.try_with(|it| it.set(depth));
}

/// A list of 10^6 cells goes in a loop; other nesting goes through [`drop_nested`].
impl Drop for Obj {
    #[inline]
    fn drop(&mut self) {
        live::sub(self.bytes());
        match self {
            Obj::Pair(first, rest) => {
                if let Value::Obj(_) = first {
                    drop_nested(Garbage::Value(take(first)));
                }
                if let Value::Obj(_) = rest {
                    drop_cells(take(rest));
                }
            }
            Obj::Str(_) | Obj::Pose(_) | Obj::Vec3(_) | Obj::Counter(_) | Obj::Ranks(_) => {}
            Obj::Path(_) | Obj::Tree(_) | Obj::Task(_) | Obj::Gone => {}
            Obj::Stream(stream) => drop_stream(stream.take_rest()),
            Obj::Fluent(fluent) => drop_nested(Garbage::Values(fluent.take_values())),
            Obj::Vector(items) => drop_nested(Garbage::Vector(take(&mut items.vector))),
            Obj::Map(map) => drop_nested(Garbage::Map(take(&mut **map))),
            Obj::Desc(desc) => drop_nested(Garbage::Values(desc.take_values())),
            Obj::Failure(failure) => drop_nested(Garbage::Values(failure.take_values())),
            Obj::Closure(_, captured) => drop_nested(Garbage::Values(take(captured).into_vec())),
            Obj::Edit(edit) => drop_nested(Garbage::Values(edit.take_values())),
        }
    }
}

fn drop_cells(mut rest: Value) {
    while let Value::Obj(cell) = rest {
        let Ok(mut cell) = Rc::try_unwrap(cell) else { return };
        let Obj::Pair(_, next) = &mut cell else { return };
        rest = take(next);
    }
}

/// Streams are long in the direction in which lists are.
fn drop_stream(mut rest: Value) {
    while let Value::Obj(cell) = rest {
        let Ok(cell) = Rc::try_unwrap(cell) else { return };
        let Obj::Stream(stream) = &cell else { return };
        rest = stream.take_rest();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deep_values_drop_without_recursion() {
        let before = live::bytes();
        let mut in_first = Value::NIL;
        let mut in_vector = Value::NIL;
        let mut in_map = Value::NIL;
        for i in 0..200_000 {
            in_first = Value::cons(in_first, Value::NIL);
            in_vector = Value::vector([in_vector]);
            in_map = Value::map([(Value::int(i), in_map)].into_iter().collect());
        }
        drop((in_first, in_vector, in_map));
        drop(Value::list((0..1_000_000).map(Value::int)));
        assert_eq!(live::bytes(), before);
    }

    #[test]
    fn shared_parts_are_compared_within_the_limit() {
        let double = |n| (0..n).fold(Value::NIL, |it: Value, _| Value::cons(it.clone(), it));
        assert_eq!(equal(&double(60), &double(60), 1000), None);
        assert_eq!(equal(&double(5), &double(5), 1000), Some(true));
    }

    #[test]
    fn an_integer_is_not_a_float() {
        assert_ne!(Value::int(1), Value::float(1.0));
        assert!(Value::int(1) < Value::float(1.0) && Value::float(1.0) < Value::int(2));
    }
}
