//! Goals that are only known when they run: `(call ?goal more…)`.
//!
//! Such a goal is data. One of the language, like `(and …)` or `(not …)`, is solved by the clauses of the
//! library's predicate `%goal`, which has one for each; all others are predicates, found by their names as the
//! module of the `call` sees them. The names are known by a *scope*, which the compiler fills.
//! While `%goal` solves parts of a goal, these keep the scope: `(%in scope goal)`.

use rustc_hash::FxHashMap;

use crate::code::Place;
use crate::failure::{Builtin, Failure};
use crate::native::{Raise, type_error};
use crate::value::{Imm, Symbol, Value};

use super::Rules;
use super::clause::{GoalKind, PredId, Term, VarNo};
use super::engine::{Engine, too_large};
use super::native::{Call, Found};
use super::store::Cell;

/// The predicate that solves goals of the language.
pub const SOLVER: (&str, u8) = ("%goal", 3);

/// Arguments that a goal can have.
const MOST_ARGS: usize = 250;

/// The predicates that a name with a number of arguments may mean; none if there are several.
pub type Scope = FxHashMap<(Symbol, u8), Option<PredId>>;

/// The goals of the language that may be data, with the least and greatest number of their arguments.
const CONTROL: &[(&str, usize, usize)] = &[
    ("and", 0, MOST_ARGS),
    ("or", 0, MOST_ARGS),
    ("not", 1, 1),
    ("->", 2, 3),
    ("*->", 2, 3),
    ("once", 1, 1),
    ("==", 2, 2),
    ("matches", 2, 2),
    ("identical?", 2, 2),
    ("<", 2, 2),
    ("<=", 2, 2),
    (">", 2, 2),
    (">=", 2, 2),
    ("=", 2, 2),
    ("/=", 2, 2),
    ("is", 2, 2),
    ("findall", 3, 3),
    ("count", 2, 2),
    ("min", 3, 3),
    ("max", 3, 3),
    ("bagof", 3, 3),
    ("setof", 3, 3),
    ("forall", 2, 2),
];

/// What a goal turns out to be.
pub(super) enum Goal {
    /// It holds.
    True,
    /// It does not.
    False,
    /// A predicate and its arguments.
    Predicate(PredId, Vec<Cell>),
}

impl Engine {
    /// What a goal with more arguments is, as a clause with this scope calls it.
    pub(super) fn goal(
        &mut self,
        rules: &Rules,
        goal: Cell,
        more: &[Cell],
        mut scope: u32,
    ) -> Result<Goal, Raise> {
        let goal = self.with_variables(goal);
        let mut parts = self.goal_parts(goal);
        parts.extend_from_slice(more);
        loop {
            let name = match parts.first().map(|name| self.store.deref(*name)) {
                Some(Cell::Imm(Imm::Symbol(name))) => name,
                Some(Cell::Imm(Imm::Bool(holds))) if parts.len() == 1 => {
                    return Ok(if holds { Goal::True } else { Goal::False });
                }
                Some(Cell::Ref(_)) => return Err(unbound()),
                other => {
                    let value = self.store.export(other.unwrap_or(Cell::NIL), &self.view);
                    return Err(type_error("a goal", &value.map_err(too_large)?));
                }
            };
            // What stands around another goal is taken away.
            let inner = match (name.as_str(), parts.len() - 1) {
                ("cut", 0) => return Err(cannot("a cut", "cuts stand in clauses")),
                ("fun", _) => {
                    return Err(cannot("`fun`", "make a predicate that calls the function, and call that"));
                }
                ("call", 1..) => 1,
                ("exists", 2) => 2,
                ("%in", 2..) => {
                    if let Cell::Imm(Imm::Int(of)) = self.store.deref(parts[1]) {
                        scope = of as u32;
                    }
                    2
                }
                ("exists", 3..) => {
                    parts.drain(..2);
                    parts.insert(0, Cell::Imm(Imm::Symbol(Symbol::from("and"))));
                    continue;
                }
                (text, n) => {
                    return self.of_language(rules, text, n, &parts[1..], scope).unwrap_or_else(|| {
                        Ok(Goal::Predicate(rules.named(scope, name, n)?, parts.split_off(1)))
                    });
                }
            };
            let more = parts.split_off(inner + 1);
            let goal = self.with_variables(parts[inner]);
            parts = self.goal_parts(goal);
            parts.extend(more);
        }
    }

    /// A goal that comes from a plan has the names of its variables: new ones take their places.
    fn with_variables(&mut self, goal: Cell) -> Cell {
        /// The parts of a goal that are looked at.
        const MOST_PARTS: usize = 10_000;
        let Cell::Obj(at) = self.store.deref(goal) else { return goal };
        let value = self.store.object(at).clone();
        match names_variables(&value, &mut { MOST_PARTS }) {
            true => self.with_variables_of(&value, &mut Vec::new()),
            false => goal,
        }
    }

    fn with_variables_of(&mut self, value: &Value, vars: &mut Vec<(Symbol, Cell)>) -> Cell {
        match (variable_name(value), value.to_vec()) {
            (Some(name), _) if name == "?_" => self.store.fresh(),
            (Some(name), _) => {
                let known = vars.iter().find(|var| var.0 == name).map(|var| var.1);
                known.unwrap_or_else(|| {
                    let var = self.store.fresh();
                    vars.push((name, var));
                    var
                })
            }
            (None, Some(items)) if !items.is_empty() => {
                let items: Vec<Cell> = items.iter().map(|item| self.with_variables_of(item, vars)).collect();
                self.store.list(&items, Cell::NIL)
            }
            _ => self.store.import(value),
        }
    }

    /// The name of a goal and its arguments. A symbol alone is a goal without arguments.
    fn goal_parts(&mut self, goal: Cell) -> Vec<Cell> {
        let mut rest = self.store.open(goal);
        let Cell::Pair(_) = rest else { return vec![rest] };
        let mut parts = Vec::new();
        while let Cell::Pair(pair) = rest
            && parts.len() <= MOST_ARGS
        {
            parts.push(self.store.heap[pair as usize]);
            rest = self.store.open(self.store.heap[pair as usize + 1]);
        }
        parts
    }

    /// A goal of the language becomes one of the solver; nothing if it is another one.
    fn of_language(
        &mut self,
        rules: &Rules,
        name: &str,
        n: usize,
        args: &[Cell],
        scope: u32,
    ) -> Option<Result<Goal, Raise>> {
        let (name, least, most) = CONTROL.iter().find(|known| known.0 == name)?;
        let solver = rules.solver?;
        if n < *least || n > *most {
            let message = format!("a goal `{name}` cannot have {}", arguments(n));
            return Some(Err(Box::new(Failure::new(Builtin::ProgramError, message))));
        }
        let args = self.store.list(args, Cell::NIL);
        let name = Cell::Imm(Imm::Symbol(Symbol::from(name)));
        Some(Ok(Goal::Predicate(solver, vec![Cell::int(scope.into()), name, args])))
    }
}

impl Rules {
    /// The predicate that a name means in a scope; where the scope does not know it, the only one of the
    /// program.
    fn named(&self, scope: u32, name: Symbol, n: usize) -> Result<PredId, Raise> {
        let key = (name, u8::try_from(n).unwrap_or(u8::MAX));
        let in_scope = self.scopes.get(&scope).and_then(|scope| scope.get(&key));
        let problem = match in_scope.or_else(|| self.everywhere.get(&key)) {
            Some(Some(predicate)) => return Ok(*predicate),
            Some(None) => format!(
                "several modules have a predicate `{name}` of {}: name the one that is meant where the goal is made",
                arguments(n)
            ),
            None => match self.other_arity(scope, name) {
                Some(has) => format!("`{name}` has {}, and is called with {n}", arguments(has)),
                None => format!("there is no predicate `{name}` of {}", arguments(n)),
            },
        };
        Err(Box::new(Failure::new(Builtin::ProgramError, problem)))
    }

    /// The least number of arguments that predicates of this name have.
    fn other_arity(&self, scope: u32, name: Symbol) -> Option<usize> {
        let known = [self.scopes.get(&scope), Some(&self.everywhere)].into_iter().flatten();
        (0..=u8::MAX).find(|n| known.clone().any(|scope| scope.contains_key(&(name, *n)))).map(usize::from)
    }
}

/// `(%free-variables template goal ?vars)`: the variables of a goal that its answers are grouped by: not
/// those of the template, nor those that an `exists` around it names.
pub(super) fn free_variables(call: &mut Call<'_>) -> Result<Found, Raise> {
    let mut hidden = call.store.variables(call.arg(0)).map_err(too_large)?;
    let mut goal = call.arg(1);
    while let Some((names, inner)) = existing(call, goal) {
        hidden.extend(call.store.variables(names).map_err(too_large)?);
        goal = inner;
    }
    let vars = call.store.variables(goal).map_err(too_large)?;
    let free: Vec<Cell> = vars.into_iter().filter(|var| !hidden.contains(var)).map(Cell::Ref).collect();
    let list = call.store.list(&free, Cell::NIL);
    let holds = call.unify(2, list)?;
    Call::test(holds)
}

/// `(%closed goal)`: a goal whose negation is asked has no variables without a value, but for those that an
/// `exists` around it names; one that only looks may have some.
pub(super) fn closed(call: &mut Call<'_>) -> Result<Found, Raise> {
    let mut goal = call.arg(0);
    let mut hidden = Vec::new();
    while let Some((names, inner)) = existing(call, goal) {
        hidden.extend(call.store.variables(names).map_err(too_large)?);
        goal = inner;
    }
    if let Cell::Pair(at) = call.store.open(goal)
        && let Cell::Imm(Imm::Symbol(name)) = call.store.deref(call.store.heap[at as usize])
        && (name == "identical?" || binds_nothing(&name))
    {
        return Ok(Found::Yes);
    }
    let vars = call.store.variables(goal).map_err(too_large)?;
    if vars.iter().all(|var| hidden.contains(var)) {
        return Ok(Found::Yes);
    }
    let goal = call.store.export(goal, call.view).map_err(too_large)?;
    let message = format!(
        "the negation of {} is asked while it has variables without a value: a goal before must give \
         them one, or (exists (?x …) goal) say that any will do",
        crate::print::brief(&goal)
    );
    Err(Box::new(Failure::with(Builtin::Floundering, vec![("message", Value::str(message))])))
}

/// `(%no-expression term)`: always a failure.
pub(super) fn no_expression(call: &mut Call<'_>) -> Result<Found, Raise> {
    let term = call.value(0)?;
    Err(type_error("a number, or + - * / mod min max abs of numbers", &term))
}

/// The goal in `(%in scope goal)`.
pub(super) fn without_scope(goal: &Term) -> Option<Term> {
    let parts = items(goal, None)?;
    let [Term::Const(name), _, goal] = &parts[..] else { return None };
    (name.as_symbol()? == "%in").then(|| goal.clone())
}

/// A goal that is called, as if it were written out: nothing if it is not known, or one that the clauses of
/// the solver explain. The `n`-th variable without a name gets the `n`-th number of `vars`.
pub(crate) fn written_out(
    rules: &Rules,
    goal: &Term,
    more: &[Term],
    scope: u32,
    at: Place,
    vars: &std::ops::Range<VarNo>,
) -> Option<GoalKind> {
    let mut parts = items(goal, Some(vars))?;
    parts.extend_from_slice(more);
    let name = match parts.first()? {
        Term::Const(value) => value.as_symbol()?,
        _ => return None,
    };
    let args = parts.split_off(1);
    let inner = |goal: &Term| {
        let called = || GoalKind::CallValue(goal.clone(), Vec::new(), scope);
        super::clause::Goal {
            kind: written_out(rules, goal, &[], scope, at, vars).unwrap_or_else(called),
            place: at,
        }
    };
    Some(match (name.as_str(), &args[..]) {
        ("and", goals) => GoalKind::And(goals.iter().map(inner).collect()),
        ("or", goals) => GoalKind::Or(goals.iter().map(inner).collect()),
        ("not", [goal]) => GoalKind::Not(Box::new(inner(goal)), Vec::new()),
        ("once", [goal]) => GoalKind::Once(Box::new(inner(goal))),
        ("==", [a, b]) => GoalKind::Unify(a.clone(), b.clone()),
        _ => GoalKind::Call(rules.named(scope, name, args.len()).ok()?, args),
    })
}

/// A value as a term, with variables in the place of those without names, as far as there are numbers.
fn opened(value: &Value, vars: &std::ops::Range<VarNo>, depth: usize) -> Term {
    const DEEP: usize = 100;
    let of = |name: &Symbol| vars.clone().nth(super::store::free_number(*name)?);
    match value {
        Value::Imm(Imm::Var(name)) => of(name).map_or(Term::Const(value.clone()), Term::Var),
        _ => match value.as_pair() {
            Some((first, rest)) if depth < DEEP => {
                match (opened(first, vars, depth + 1), opened(rest, vars, depth + 1)) {
                    (Term::Const(_), Term::Const(_)) => Term::Const(value.clone()),
                    (first, rest) => Term::Pair(Box::new(first), Box::new(rest)),
                }
            }
            _ => Term::Const(value.clone()),
        },
    }
}

/// The elements of a list; a symbol is a list of itself.
fn items(term: &Term, vars: Option<&std::ops::Range<VarNo>>) -> Option<Vec<Term>> {
    let mut items = Vec::new();
    let mut rest = term;
    while let Term::Pair(first, more) = rest {
        items.push((**first).clone());
        rest = more;
    }
    match rest {
        Term::Const(value) if value.is_nil() || value.as_pair().is_some() => {
            let item = |item: &Value| match vars {
                Some(vars) => opened(item, vars, 0),
                None => Term::Const(item.clone()),
            };
            items.extend(value.iter().map(item));
        }
        Term::Const(_) if items.is_empty() => items.push(rest.clone()),
        _ => return None,
    }
    Some(items)
}

/// The name of a variable in a goal that a plan has made.
fn variable_name(value: &Value) -> Option<Symbol> {
    match value {
        Value::Imm(Imm::Symbol(name) | Imm::Var(name)) => Some(*name).filter(|name| name.starts_with('?')),
        _ => None,
    }
}

/// True if there is such a name in lists of lists, as far as `left` parts show. What is larger, or nests
/// deeper than goals do, has none.
fn names_variables(value: &Value, left: &mut usize) -> bool {
    const DEEP: usize = 100;
    fn found(value: &Value, left: &mut usize, depth: usize) -> bool {
        if *left == 0 || depth > DEEP {
            // The rest is not looked at either, so that what is found can be walked.
            *left = 0;
            return false;
        }
        *left -= 1;
        let mut any = variable_name(value).is_some();
        for item in value.iter() {
            any |= found(item, left, depth + 1);
        }
        any
    }
    found(value, left, 0) && *left > 0
}

/// True for predicates that look at a variable itself, so that it needs no value under `not`.
#[must_use]
pub fn binds_nothing(name: &str) -> bool {
    matches!(name, "bound?" | "unbound?" | "var?" | "ground?")
}

/// The names and the goal of `(exists names goal)`.
fn existing(call: &mut Call<'_>, goal: Cell) -> Option<(Cell, Cell)> {
    let mut parts = Vec::new();
    let mut rest = call.store.open(goal);
    while let Cell::Pair(pair) = rest
        && parts.len() < 3
    {
        parts.push(call.store.heap[pair as usize]);
        rest = call.store.open(call.store.heap[pair as usize + 1]);
    }
    let [head, names, inner] = parts[..] else { return None };
    let is_end = matches!(rest, Cell::Imm(Imm::Nil));
    let is_exists = matches!(call.store.deref(head), Cell::Imm(Imm::Symbol(name)) if name == "exists");
    (is_end && is_exists).then_some((names, inner))
}

fn arguments(n: usize) -> String {
    if n == 1 { "1 argument".into() } else { format!("{n} arguments") }
}

fn unbound() -> Raise {
    let message = "a goal that is called has no value yet: put the goal that gives it one before";
    Box::new(Failure::new(Builtin::UnboundVariable, message))
}

fn cannot(what: &str, help: &str) -> Raise {
    let message = format!("{what} cannot stand in a goal that is only known when it runs: {help}");
    Box::new(Failure::new(Builtin::ProgramError, message))
}
