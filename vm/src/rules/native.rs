//! Predicates that are written in Rust.

use crate::code::Program;
use crate::native::Raise;
use crate::value::{Imm, Value};

use super::View;
use super::engine::too_large;
use super::store::{Cell, Shape, Store};

/// A call of a predicate that is written in Rust.
pub struct Call<'a> {
    /// The program.
    pub program: &'a Program,
    /// The terms.
    pub store: &'a mut Store,
    /// The arguments.
    args: &'a [Cell],
    /// What else the query sees.
    pub view: &'a View,
}

/// What a predicate found.
pub enum Found {
    /// It does not hold.
    No,
    /// It holds, once; its variables are bound.
    Yes,
    /// It may hold more than once.
    Many(Box<dyn Alternatives>),
}

/// Answers that are found one after another.
pub trait Alternatives {
    /// Binds the variables of the call for the next answer: true if there may be more after it,
    /// nothing if there is none.
    ///
    /// # Errors
    /// What went wrong.
    fn next(&mut self, call: &mut Call<'_>) -> Result<Option<bool>, Raise>;

    /// True if it has found nothing, but has only looked for a while: it is asked again.
    fn is_busy(&self) -> bool {
        false
    }

    /// The terms that it needs for the answers to come, besides the arguments of the call.
    fn terms(&mut self) -> &mut [Cell] {
        &mut []
    }
}

/// A predicate that is written in Rust.
pub type NativeRule = fn(&mut Call<'_>) -> Result<Found, Raise>;

impl<'a> Call<'a> {
    /// A call with these arguments.
    pub fn new(program: &'a Program, store: &'a mut Store, args: &'a [Cell], view: &'a View) -> Call<'a> {
        Call { program, store, args, view }
    }

    /// What an argument stands for.
    #[must_use]
    pub fn arg(&self, n: usize) -> Cell {
        self.args.get(n).map_or(Cell::NIL, |cell| self.store.deref(*cell))
    }

    /// True if an argument has a value.
    #[must_use]
    pub fn is_bound(&self, n: usize) -> bool {
        !matches!(self.arg(n), Cell::Ref(_))
    }

    /// The value of an argument.
    ///
    /// # Errors
    /// `memory-exhausted` for an enormous one.
    pub fn value(&self, n: usize) -> Result<Value, Raise> {
        self.store.export(self.arg(n), self.view).map_err(too_large)
    }

    /// Makes an argument the same as a term.
    ///
    /// # Errors
    /// `memory-exhausted` for enormous ones.
    pub fn unify(&mut self, n: usize, cell: Cell) -> Result<bool, Raise> {
        let arg = self.arg(n);
        self.store.unify(arg, cell).map_err(too_large)
    }

    /// Makes an argument the same as a value.
    ///
    /// # Errors
    /// `memory-exhausted` for enormous ones.
    pub fn unify_value(&mut self, n: usize, value: &Value) -> Result<bool, Raise> {
        let cell = self.store.import(value);
        self.unify(n, cell)
    }

    /// Answers with a test.
    ///
    /// # Errors
    /// None; as natives want it.
    pub fn test(holds: bool) -> Result<Found, Raise> {
        Ok(if holds { Found::Yes } else { Found::No })
    }
}

/// The table of all of them.
pub const TABLE: &[(&str, u8, NativeRule)] = &[
    ("bound?", 1, |call| Call::test(call.is_bound(0))),
    ("unbound?", 1, |call| Call::test(!call.is_bound(0))),
    ("var?", 1, |call| Call::test(!call.is_bound(0))),
    ("ground?", 1, |call| {
        let vars = call.store.variables(call.arg(0)).map_err(too_large)?;
        Call::test(vars.is_empty())
    }),
    ("number?", 1, |call| Call::test(matches!(call.arg(0), Cell::Imm(Imm::Int(_) | Imm::Float(_))))),
    ("integer?", 1, |call| Call::test(matches!(call.arg(0), Cell::Imm(Imm::Int(_))))),
    ("symbol?", 1, |call| Call::test(matches!(call.arg(0), Cell::Imm(Imm::Symbol(_))))),
    ("string?", 1, |call| {
        Call::test(matches!(call.arg(0), Cell::Obj(at) if call.store.object(at).as_str().is_some()))
    }),
    ("compare", 3, compare),
    ("property", 3, property),
    ("%free-variables", 3, super::control::free_variables),
    ("%closed", 1, super::control::closed),
    ("%no-expression", 1, super::control::no_expression),
];

/// The predicate of this name.
#[must_use]
pub fn find(name: &str, arity: u8) -> Option<NativeRule> {
    if name == super::join::NAME {
        return Some(super::join::call);
    }
    let all = TABLE.iter().chain(super::tree::TABLE);
    all.into_iter().find(|it| it.0 == name && it.1 == arity).map(|it| it.2)
}

/// `(compare ?order a b)`: `<`, `=` or `>` in the order of values.
fn compare(call: &mut Call<'_>) -> Result<Found, Raise> {
    let word = match call.value(1)?.cmp(&call.value(2)?) {
        std::cmp::Ordering::Less => "<",
        std::cmp::Ordering::Equal => "=",
        std::cmp::Ordering::Greater => ">",
    };
    let holds = call.unify_value(0, &Value::symbol(word))?;
    Call::test(holds)
}

/// `(property desc key ?value)`: of a description or a map.
fn property(call: &mut Call<'_>) -> Result<Found, Raise> {
    let it = call.arg(0);
    let Cell::Struct(at) = call.store.open(it) else { return Ok(Found::No) };
    let pairs: Vec<Cell> = match call.store.parts(at) {
        (Shape::Vector, _) => return Ok(Found::No),
        (Shape::Map, parts) => parts.to_vec(),
        (Shape::Desc, parts) => parts[1..].to_vec(),
    };
    Ok(Found::Many(Box::new(Properties { pairs, next: 0 })))
}

struct Properties {
    pairs: Vec<Cell>,
    next: usize,
}

impl Alternatives for Properties {
    fn next(&mut self, call: &mut Call<'_>) -> Result<Option<bool>, Raise> {
        while let Some(pair) = self.pairs.get(self.next..self.next + 2) {
            let (key, value) = (pair[0], pair[1]);
            self.next += 2;
            let mark = call.store.mark();
            if call.unify(1, key)? && call.unify(2, value)? {
                return Ok(Some(self.next < self.pairs.len()));
            }
            call.store.back_to(mark);
        }
        Ok(None)
    }

    fn terms(&mut self) -> &mut [Cell] {
        &mut self.pairs
    }
}
