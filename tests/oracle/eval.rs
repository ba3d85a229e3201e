//! Evaluation: one `match` over the expressions of the AST.
//!
//! An expression has a value, or control leaves it: [`Exit`]. What an expression can see is its
//! [`Here`], which is never changed: a binding, a round of a loop, a call makes a new one. So it can
//! be kept, for code that is performed later.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::rc::Rc;

use compiler::ast::{Callee, Clause, Expr, ExprKind, Function, VarId};

use vm::code::{FnId, GlobalId, NativeId, Params, SiteId};
use vm::desc::{Desc, Match};
use vm::failure::{Builtin, Failure, TypeId};
use vm::host::{CodeRequest, Host, Request};
use vm::key::{Element, Step};
use vm::machine::{Ctx, CtxParts, Draws};
use vm::native::{Effect, Next, Raise, map_key, type_error};
use vm::random::{hash_text, mix};

use vm::value::{Imm, Map, Obj, Symbol, Value};

use super::call::Original;
use super::calls::calls_of;
use super::fluents::Known;
use super::forms::{Part, Place};
use super::obligations::{Form, Obligation, branches};
use super::tasks::{Oracle, Tasks};
use super::tree::{Counts, Tree};
use super::{MOST_FUEL, Ran, Trees, World};

/// How control leaves an expression without a value.
pub enum Exit<'p> {
    /// A failure is on its way to a handler.
    Fail(Value),
    /// `(retry)`, on its way to its handler.
    Retry,
    /// `(propagate)`: the failure that is being handled, on its way to its clause. Handlers on this
    /// way do not see it, no more than they see `(retry)`.
    Propagate(Value),
    /// `(return v)`, on its way to the innermost loop or handler.
    Return(Value),
    /// The task is stopped: clean-ups run on the way, and no handler takes it.
    Evaporate(Value),
    /// An expression over fluents does what it must not do: nothing of it is done any more.
    Refused(&'static str),
    /// The function goes on as this one.
    Tail(Ready<'p>),
    /// The oracle cannot go on.
    GiveUp(String),
}

/// A function with all that its call needs.
pub struct Ready<'p> {
    pub function: &'p Function,
    /// Its number, where the compiler has given it one.
    pub owner: Option<FnId>,
    pub captured: Vec<Value>,
    pub args: Vec<Value>,
}

pub type Eval<'p> = Result<Value, Exit<'p>>;

/// What becomes of the value of an expression.
#[derive(Clone, Copy, PartialEq)]
pub enum Use {
    /// Something looks at it.
    Value,
    /// Nothing looks at it.
    Effect,
    /// It is the value of the function: a call of a function here is a tail call.
    Tail,
}

impl Use {
    /// The same, where a call would not be a tail call.
    pub fn no_tail(self) -> Use {
        if self == Use::Tail { Use::Value } else { self }
    }
}

/// Variables in sight. Each binding is a cell of its own.
#[derive(Clone, Default)]
pub struct Env(Option<Rc<(VarId, RefCell<Value>, Env)>>);

impl Env {
    pub fn bind(&self, var: VarId, value: Value) -> Env {
        Env(Some(Rc::new((var, RefCell::new(value), self.clone()))))
    }
    fn cell(&self, var: VarId) -> &RefCell<Value> {
        let mut at = self;
        loop {
            let it = at.0.as_ref().expect("the compiler lets only variables in sight through");
            if it.0 == var {
                return &it.1;
            }
            at = &it.2;
        }
    }
    pub fn get(&self, var: VarId) -> Value {
        self.cell(var).borrow().clone()
    }
}

/// Steps from a node to a place, innermost first.
#[derive(Clone, Default)]
pub struct Way(Option<Rc<(Step, Way)>>);

impl Way {
    pub fn then(&self, step: Step) -> Way {
        Way(Some(Rc::new((step, self.clone()))))
    }
    pub fn steps(&self) -> Vec<Step> {
        let mut steps: Vec<Step> =
            std::iter::successors(self.0.as_ref(), |it| it.1.0.as_ref()).map(|it| it.0.clone()).collect();
        steps.reverse();
        steps
    }
}

/// What an expression can see and where it stands.
#[derive(Clone)]
pub struct Here {
    pub env: Env,
    /// The record that calls belong to.
    pub rec: usize,
    /// The way from the node to here: loops and functions.
    pub way: Way,
    /// The forms around.
    pub place: Place,
    /// The first form of the function that it belongs to, by its number.
    pub function_form: usize,
    /// What `(original)` runs, in the code of an edit.
    pub original: Option<Original>,
    /// The failure that the innermost clause around handles.
    pub handled: Option<Value>,
    /// The function that the code belongs to, where it has a number.
    pub owner: Option<FnId>,
}

impl Here {
    /// The outermost place of a run.
    pub fn root(owner: Option<FnId>) -> Self {
        let (env, way, place) = (Env::default(), Way::default(), Place::default());
        Here { env, rec: 0, way, place, function_form: 0, original: None, handled: None, owner }
    }
}

/// A handler whose body is being done.
#[derive(Clone)]
pub struct Handler<'p> {
    pub clauses: &'p [Clause],
    pub here: Here,
    /// How often calls had been made when its body was entered.
    pub counts: Counts,
}

/// A tree being grown.
pub struct Run<'p> {
    /// Tells it from other runs.
    pub number: u64,
    pub tree: Tree,
    /// The task clock, in nanoseconds.
    pub now: u64,
    pub tasks: Tasks,
    /// The forms that are being done, by their numbers: a later one has a greater number.
    pub forms: BTreeMap<usize, Form>,
    pub forms_made: usize,
    /// What they owe, in the order of its making.
    pub obligations: Vec<Obligation<'p>>,
    pub draws: Draws,
    /// The version of the world as a fluent, once somebody has asked for it.
    pub world_fluent: Option<Value>,
}

impl Run<'_> {
    pub fn new(tree: Tree) -> Self {
        Run {
            number: 0,
            tree,
            now: 0,
            tasks: Tasks::of_root(),
            forms: BTreeMap::from([(0, Form::default())]),
            forms_made: 1,
            obligations: Vec::new(),
            draws: Draws::default(),
            world_fluent: None,
        }
    }
}

/// The output of the run; it answers nothing.
#[derive(Default)]
struct Output(String);

impl Host for Output {
    fn print(&mut self, text: &str) {
        self.0.push_str(text);
    }
    fn answer(&mut self, _request: &Request) -> Result<serde_json::Value, String> {
        Err("the oracle has no world".into())
    }
    fn compile(&mut self, _program: &mut vm::Program, _code: CodeRequest<'_>) -> Result<FnId, String> {
        Err("the oracle compiles elsewhere".into())
    }
}

/// Lambdas get numbers from here on.
const FIRST_LAMBDA: u32 = 1 << 30;

/// What all tasks of a program share.
pub struct Walker<'p> {
    pub world: &'p mut dyn World,
    functions: &'p BTreeMap<FnId, Rc<Function>>,
    lambdas: Vec<&'p Function>,
    seed: u64,
    pub run: Run<'p>,
    /// The runs that it is part of, outermost first: their tasks stand still.
    pub outer: Vec<Run<'p>>,
    /// How many runs have begun inside of the outermost.
    pub inner_runs: u64,
    pub trees: Trees,
    /// What is known of fluents, by their numbers.
    pub fluents: BTreeMap<u64, Known>,
    /// The fuel that is left for what is computed from fluents, while that is done.
    pub computing: Option<u64>,
    /// Why a task cannot go on.
    pub gave_up: Option<String>,
    pub globals: BTreeMap<GlobalId, Value>,
    output: Output,
    /// Fuel used.
    fuel: u64,
    printed: usize,
    pub fresh: u64,
    /// Call sites, known by their addresses, with what stands for them in draws.
    sites: HashMap<usize, SiteId>,
    pub site_hashes: Vec<u64>,
    /// What stands for calls in draws, by their addresses.
    hashes: HashMap<usize, u64>,
}

impl<'p> Walker<'p> {
    pub fn new(
        world: &'p mut dyn World,
        functions: &'p BTreeMap<FnId, Rc<Function>>,
        seed: u64,
    ) -> Walker<'p> {
        Walker {
            world,
            functions,
            lambdas: Vec::new(),
            seed,
            run: Run::new(Tree::begin(None)),
            outer: Vec::new(),
            inner_runs: 0,
            trees: Trees::new(),
            fluents: BTreeMap::new(),
            computing: None,
            gave_up: None,
            globals: BTreeMap::new(),
            output: Output::default(),
            fuel: 0,
            printed: 0,
            fresh: 0,
            sites: HashMap::new(),
            // Number 0 is the call of the plan of `run-plan`.
            site_hashes: vec![0],
            hashes: HashMap::new(),
        }
    }

    /// Runs functions without arguments one after another, until one fails: those of the library,
    /// then those of the program.
    pub fn run(self, library: &[FnId], start: &[FnId]) -> Result<Ran, String> {
        let mut it = Oracle::outside(self);
        let mut outcome = Ok(Value::NIL);
        for id in library.iter().chain(start) {
            let function = it.function(*id);
            let root = Here::root(Some(*id));
            it.run.tasks = Tasks::of_root();
            outcome = match it.as_root(|it| it.body_of(&root, function, Vec::new(), Vec::new())) {
                Ok(value) => Ok(value),
                Err(Exit::Fail(failure)) => Err(failure),
                Err(Exit::GiveUp(why)) => return Err(why),
                Err(_) => unreachable!("the compiler lets no way out of a function through"),
            };
            if outcome.is_err() {
                break;
            }
        }
        if start.is_empty() {
            outcome = Ok(Value::NIL);
        }
        let (status, value) = match &outcome {
            Ok(value) => (vm::tree::Status::Succeeded, value.clone()),
            Err(failure) => (vm::tree::Status::Failed, failure.clone()),
        };
        it.end_record(0, status, value);
        let walker = it.into_walker();
        Ok(Ran { outcome, tree: walker.run.tree, output: walker.output.0, trees: walker.trees })
    }
}

impl<'p> Oracle<'_, 'p> {
    /// A function by its number.
    pub fn function(&self, id: FnId) -> &'p Function {
        match id.0.checked_sub(FIRST_LAMBDA) {
            Some(lambda) => self.lambdas[lambda as usize],
            None => self.functions.get(&id).expect("the AST of each function is kept"),
        }
    }

    /// The number of a function, unless the oracle gave it.
    pub fn owner(&self, id: FnId) -> Option<FnId> {
        (id.0 < FIRST_LAMBDA).then_some(id)
    }

    /// A unit of fuel.
    pub fn burn(&mut self, here: &Here) -> Result<(), Exit<'p>> {
        self.fuel += 1;
        if self.fuel > MOST_FUEL {
            return Err(Exit::GiveUp("the program runs too long for the oracle".into()));
        }
        match &mut self.computing {
            None => self.use_turn(here),
            Some(0) => Err(Exit::Refused("takes too long")),
            Some(left) => {
                *left -= 1;
                Ok(())
            }
        }
    }

    /// Raises a failure at a place.
    #[expect(clippy::boxed_local, reason = "natives raise boxed failures")]
    pub fn raise<T>(&self, here: &Here, raise: Raise) -> Result<T, Exit<'p>> {
        Err(Exit::Fail(self.raised(here, *raise)))
    }

    fn raised(&self, here: &Here, mut failure: Failure) -> Value {
        let slot = self.run.tree.records[here.rec].slot;
        failure.task.get_or_insert_with(|| {
            std::rc::Rc::new(vm::failure::Task::of_path(&self.run.tree.path(slot).show()))
        });
        Value::failure(failure)
    }

    // ------------------------------------------------------------------ expressions

    /// The value of an expression, which is a form of its own.
    pub fn eval(&mut self, here: &Here, expr: &'p Expr, usage: Use) -> Eval<'p> {
        self.form(here, Part::Expr(address(expr)), |it, here| {
            it.branches(&branches(expr));
            it.eval_kind(here, expr, usage)
        })
    }

    fn eval_kind(&mut self, here: &Here, expr: &'p Expr, usage: Use) -> Eval<'p> {
        match &expr.kind {
            ExprKind::Const(value) => Ok(value.clone()),
            ExprKind::Var(var) => Ok(here.env.get(*var)),
            ExprKind::Global(global) => match self.globals.get(global) {
                Some(value) => Ok(value.clone()),
                None => {
                    let name = self.world.program().globals[global.at()];
                    let message = format!("`{name}` is used before its definition has been computed");
                    self.raise(here, Box::new(Failure::new(Builtin::ProgramError, message)))
                }
            },
            ExprKind::Define(global, value) => {
                let value = self.value(here, value)?;
                self.globals.insert(*global, value.clone());
                Ok(value)
            }
            ExprKind::Let(parts, body) => {
                let mut inner = here.clone();
                for (var, value) in parts {
                    let value = self.value(&inner, value)?;
                    inner.env = inner.env.bind(*var, value);
                }
                self.body(&inner, body, usage)
            }
            ExprKind::Set(var, value) => {
                let value = self.value(here, value)?;
                here.env.cell(*var).replace(value.clone());
                Ok(value)
            }
            ExprKind::If(test, then, other) => {
                let test = self.value(here, test)?;
                self.eval(here, if test.is_true() { then } else { other }, usage)
            }
            ExprKind::And(parts) => self.and_or(here, parts, usage, |value| !value.is_true()),
            ExprKind::Or(parts) => self.and_or(here, parts, usage, Value::is_true),
            ExprKind::Seq(body) => self.body(here, body, usage),
            ExprKind::Case(subject, arms, otherwise) => {
                let subject = self.value(here, subject)?;
                let arm = arms.iter().find(|(keys, _)| keys.contains(&subject));
                self.body(here, arm.map_or(otherwise, |(_, body)| body), usage)
            }
            ExprKind::While(test, body) => self.while_(here, test, body),
            ExprKind::Dolist { var, list, body, result } => {
                let over = self.value(here, list)?;
                let (items, bad_end) = elements(&over);
                let keys = round_keys(&items);
                let rounds = items.into_iter().zip(keys.clone());
                if let Some(returned) = self.rounds(here, *var, rounds, Rc::new(keys), body)? {
                    return Ok(returned);
                }
                match bad_end {
                    Some(raise) => self.raise(here, raise),
                    None => self.eval(here, result, usage.no_tail()),
                }
            }
            ExprKind::Dotimes { var, count, body, result } => {
                let count = self.value(here, count)?;
                let Some(count) = count.as_int() else {
                    return self.raise(here, type_error("an integer", &count));
                };
                let rounds =
                    (0..count).map(|number| (Value::int(number), Step::Round(Element::Int(number), 0)));
                let keys = Rc::new(if self.is_edited() {
                    rounds.clone().map(|(_, key)| key).collect()
                } else {
                    Vec::new()
                });
                match self.rounds(here, *var, rounds, keys, body)? {
                    Some(returned) => Ok(returned),
                    None => self.eval(here, result, usage.no_tail()),
                }
            }
            ExprKind::Lambda(function) => Ok(self.lambda(here, function)),
            ExprKind::Call(callee, args) => self.call_expr(here, expr, callee, args, usage),
            ExprKind::Perform(desc, goal) => self.perform_expr(here, expr, desc, goal.as_deref(), usage),
            ExprKind::Handle(clauses, body) => self.handle(here, clauses, body, usage.no_tail()),
            ExprKind::Retry => Err(Exit::Retry),
            ExprKind::Propagate => Err(Exit::Propagate(here.handled.clone().expect("it stands in a clause"))),
            ExprKind::Return(value) => Err(Exit::Return(self.value(here, value)?)),
            ExprKind::Fail(kind, fields) => {
                let failure = self.failure(here, *kind, fields)?;
                self.raise(here, Box::new(failure))
            }
            ExprKind::MakeFailure(kind, fields) => Ok(Value::failure(self.failure(here, *kind, fields)?)),
            ExprKind::Raise(failure) => {
                let value = self.value(here, failure)?;
                match value.as_failure() {
                    // A failure that has been raised before stays itself.
                    Some(failure) if failure.task.is_some() => Err(Exit::Fail(value)),
                    Some(failure) => self.raise(here, Box::new(failure.clone())),
                    None => self.raise(here, type_error("a failure", &value)),
                }
            }
            ExprKind::Protect(body, cleanup, _) => self.protect(here, body, cleanup, usage.no_tail()),
            ExprKind::Counter(count) => {
                let count = self.value(here, count)?;
                match vm::native::index(&count) {
                    Ok(count) => Ok(Value::new(Obj::Counter((count as i64).into()))),
                    Err(raise) => self.raise(here, raise),
                }
            }
            ExprKind::CountDown(var) => {
                let value = here.env.get(*var);
                let Some(Obj::Counter(left)) = value.obj() else {
                    return self.raise(here, type_error("a retry counter", &value));
                };
                let more = left.get() > 0;
                left.set(left.get() - i64::from(more));
                Ok(Value::bool(more))
            }
            ExprKind::Vector(items) => Ok(Value::vector(self.values(here, items)?)),
            ExprKind::Map(items) => {
                let mut map = Map::new();
                for pair in self.values(here, items)?.chunks_exact(2) {
                    match map_key(&pair[0]) {
                        Ok(key) => drop(map.insert(key, pair[1].clone())),
                        Err(raise) => return self.raise(here, raise),
                    }
                }
                Ok(Value::map(map))
            }
            ExprKind::Desc(kind, properties) => {
                let mut pairs = Vec::new();
                for (key, value) in properties {
                    pairs.push((*key, self.value(here, value)?));
                }
                Ok(Value::desc(Desc::new(*kind, pairs)))
            }
            ExprKind::Matches(mode, pattern, value) => {
                let name = if *mode == Match::Open { "%matches" } else { "%==" };
                let args = vec![self.value(here, pattern)?, self.value(here, value)?];
                let native =
                    self.world.program().native(name).expect("the library has what special forms need");
                self.native(here, expr, native, args, usage)
            }
            ExprKind::Original => self.original(here),
            ExprKind::Fork { kind, extra, branches } => {
                self.fork(here, *kind, extra, branches, usage != Use::Effect)
            }
        }
    }

    /// The value of an expression that something looks at.
    pub fn value(&mut self, here: &Here, expr: &'p Expr) -> Eval<'p> {
        self.eval(here, expr, Use::Value)
    }

    fn values(&mut self, here: &Here, exprs: &'p [Expr]) -> Result<Vec<Value>, Exit<'p>> {
        exprs.iter().map(|expr| self.value(here, expr)).collect()
    }

    /// Several expressions; the value is that of the last.
    pub fn body(&mut self, here: &Here, body: &'p [Expr], usage: Use) -> Eval<'p> {
        let Some((last, first)) = body.split_last() else { return Ok(Value::NIL) };
        for expr in first {
            self.eval(here, expr, Use::Effect)?;
        }
        self.eval(here, last, usage)
    }

    fn and_or(&mut self, here: &Here, parts: &'p [Expr], usage: Use, ends: fn(&Value) -> bool) -> Eval<'p> {
        let Some((last, first)) = parts.split_last() else { return Ok(Value::NIL) };
        for part in first {
            let value = self.value(here, part)?;
            if ends(&value) {
                return Ok(value);
            }
        }
        self.eval(here, last, usage)
    }

    pub fn lambda(&mut self, here: &Here, function: &'p Function) -> Value {
        let known = self.lambdas.iter().position(|known| std::ptr::eq(*known, function));
        let at = known.unwrap_or_else(|| {
            self.lambdas.push(function);
            self.lambdas.len() - 1
        });
        let id = FnId(FIRST_LAMBDA + at as u32);
        let captured: Vec<Value> = function.captures.iter().map(|(outer, _)| here.env.get(*outer)).collect();
        match captured.is_empty() {
            true => Value::Imm(Imm::Function(id)),
            false => Value::new(Obj::Closure(id, captured.into())),
        }
    }

    // ------------------------------------------------------------------ loops

    fn while_(&mut self, here: &Here, test: &'p Expr, body: &'p [Expr]) -> Eval<'p> {
        loop {
            let round = self.form(here, Part::Turn, |it, here| {
                let more = it.value(here, test)?.is_true();
                if more {
                    it.body(here, body, Use::Effect)?;
                }
                Ok(Value::bool(more))
            });
            match round {
                Ok(more) if more.is_true() => self.burn(here)?,
                Ok(_) => return Ok(Value::NIL),
                Err(Exit::Return(value)) => return Ok(value),
                Err(exit) => return Err(exit),
            }
        }
    }

    /// The rounds of a loop over elements. The value if `(return v)` left it.
    fn rounds(
        &mut self,
        here: &Here,
        var: VarId,
        rounds: impl Iterator<Item = (Value, Step)>,
        keys: Rc<Vec<Step>>,
        body: &'p [Expr],
    ) -> Result<Option<Value>, Exit<'p>> {
        for (at, (item, key)) in rounds.enumerate() {
            self.round_begins(&keys, at);
            let inner =
                Here { env: here.env.bind(var, item), way: here.way.then(key.clone()), ..here.clone() };
            match self.form(&inner, Part::Round(key), |it, here| it.body(here, body, Use::Effect)) {
                Ok(_) => self.burn(here)?,
                Err(Exit::Return(value)) => return Ok(Some(value)),
                Err(exit) => return Err(exit),
            }
        }
        Ok(None)
    }

    // ------------------------------------------------------------------ failures

    fn failure(
        &mut self,
        here: &Here,
        kind: TypeId,
        fields: &'p [(Symbol, Expr)],
    ) -> Result<Failure, Exit<'p>> {
        let mut given = Vec::new();
        for (key, value) in fields {
            given.push((*key, self.value(here, value)?));
        }
        // First what the type says, in its order, then the others by their names.
        let it = self.world.program().failures.get(kind).expect("the compiler knows the types");
        let place = |key: &Symbol| it.fields.iter().position(|field| field == key).unwrap_or(usize::MAX);
        given.sort_by(|(a, _), (b, _)| (place(a), a.as_str()).cmp(&(place(b), b.as_str())));
        Ok(Failure::of_type(kind, it.name, given))
    }

    fn handle(&mut self, here: &Here, clauses: &'p [Clause], body: &'p [Expr], usage: Use) -> Eval<'p> {
        loop {
            let counts = self.run.tree.records[here.rec].counts.clone();
            self.stacks.handlers.push(Handler { clauses, here: here.clone(), counts: counts.clone() });
            let result = self.form(here, Part::Guarded, |it, here| it.body(here, body, usage));
            self.stacks.handlers.pop();
            let Err(Exit::Fail(failure)) = result else { return result };
            match self.take(here, clauses, failure)? {
                Some(value) => return Ok(value),
                None => {
                    // Back to the beginning of the body: nothing of the form is over.
                    self.burn(here)?;
                    self.form_restarts();
                    self.run.tree.records[here.rec].counts = counts;
                }
            }
        }
    }

    /// Gives a failure to the first clause for it. `Ok(None)` is `(retry)`, `Ok(Some(v))` is
    /// `(return v)`; without a clause, at its end or by `(propagate)` the failure goes on.
    pub fn take(
        &mut self,
        here: &Here,
        clauses: &'p [Clause],
        failure: Value,
    ) -> Result<Option<Value>, Exit<'p>> {
        let kind = failure.as_failure().map(|failure| failure.kind).expect("only failures are raised");
        let types = &self.world.program().failures;
        let takes = |clause: &Clause| clause.kinds.iter().any(|of| types.is_a(kind, *of));
        let Some(at) = clauses.iter().position(takes) else { return Err(Exit::Fail(failure)) };
        let clause = &clauses[at];
        let mut inner = Here { handled: Some(failure.clone()), ..here.clone() };
        if let Some(var) = clause.var {
            inner.env = inner.env.bind(var, failure.clone());
        }
        // At its end a clause lets the failure pass, as `(propagate)` does.
        let end = |it: &mut Self, here: &Here| {
            it.body(here, &clause.body, Use::Effect)?;
            Err(Exit::Propagate(failure.clone()))
        };
        match self.form(&inner, Part::Clause(at), end) {
            Ok(value) => Ok(Some(value)),
            Err(Exit::Propagate(passed)) => Err(Exit::Fail(caused_by(&passed, &failure))),
            Err(Exit::Retry) => Ok(None),
            Err(Exit::Return(value)) => Ok(Some(value)),
            Err(Exit::Fail(new)) => Err(Exit::Fail(caused_by(&new, &failure))),
            Err(Exit::Evaporate(stopped)) => Err(Exit::Evaporate(caused_by(&stopped, &failure))),
            Err(exit) => Err(exit),
        }
    }

    fn protect(&mut self, here: &Here, body: &'p Expr, cleanup: &'p [Expr], usage: Use) -> Eval<'p> {
        let result = self.eval(here, body, usage);
        if gave_up(&result) {
            return result;
        }
        self.begin_clean_up();
        let cleaned = self.form(here, Part::CleanUp, |it, here| it.body(here, cleanup, Use::Effect));
        self.end_clean_up();
        match (result, cleaned) {
            (Err(exit), Err(Exit::Fail(other) | Exit::Propagate(other))) => Err(beside(exit, other)),
            (_, Err(exit)) => Err(exit),
            (Err(exit @ (Exit::Fail(_) | Exit::Propagate(_) | Exit::Evaporate(_))), Ok(_)) => Err(exit),
            // Who was to be stopped meanwhile could not be.
            (result, Ok(_)) => self.stop_if_asked().and(result),
        }
    }

    // ------------------------------------------------------------------ sites

    /// The number of a call, or of a branch, known by its address.
    pub fn site(&mut self, at: usize) -> SiteId {
        let next = SiteId(self.site_hashes.len() as u32);
        let known = *self.sites.entry(at).or_insert(next);
        if known == next {
            let hash = self.hashes.get(&at).copied().unwrap_or_default();
            self.site_hashes.push(hash);
        }
        known
    }

    /// What stands for the calls of a function in keyed draws: its name, and which it is of those that
    /// are called by one name.
    pub fn hash_calls(&mut self, function: &'p Function) {
        let Some(last) = function.body.last() else { return };
        if self.hashes.contains_key(&address(last)) {
            return;
        }
        self.hashes.insert(address(last), 0);
        let mut seen: HashMap<Symbol, u64> = HashMap::new();
        for (at, name) in calls_of(self.world.program(), function) {
            let number = seen.entry(name).or_insert(0);
            *number += 1;
            let hash = mix(hash_text(&function.name) ^ mix(*number) ^ hash_text(&name));
            self.hashes.insert(at, hash);
        }
    }

    // ------------------------------------------------------------------ natives

    /// What a native answers.
    pub fn ask_native(&mut self, here: &Here, native: NativeId, args: &[Value]) -> Result<Next, Raise> {
        let Walker { world, run, seed, printed, fresh, output, .. } = &mut **self;
        let program = world.program();
        let native = &program.natives[native.at()];
        let (least, most) = native.arity;
        if args.len() < usize::from(least) || most.is_some_and(|most| args.len() > usize::from(most)) {
            let takes = match most {
                Some(most) if most == least => format!("{least}"),
                Some(most) => format!("{least} to {most}"),
                None => format!("at least {least}"),
            };
            let message = format!("`{}` takes {takes} arguments, got {}", native.name, args.len());
            return Err(Box::new(Failure::new(Builtin::ArityError, message)));
        }
        if native.effect != Effect::Pure {
            let effect = native.effect.name();
            let message =
                format!("`{}` needs the grant `{effect}`, which this run does not have", native.name);
            let fields = vec![("message", Value::str(message)), ("effect", Value::symbol(effect))];
            return Err(Box::new(Failure::with(Builtin::NotAllowed, fields)));
        }
        // Programs with a world are not compared.
        let mut no_world = None;
        let mut ctx = Ctx::new(CtxParts {
            program,
            tree: &run.tree.mirror,
            rec: run.tree.records[here.rec].mirror,
            draws: &mut run.draws,
            seed: *seed,
            projected: false,
            now: run.now,
            printed,
            fresh,
            output_limit: usize::MAX,
            host: output,
            world: &mut no_world,
        });
        (native.run)(&mut ctx, args)
    }

    /// The arguments of a call of a function of the program, in the order of the text: keywords may
    /// stand in another order than the parameters.
    fn arguments(
        &mut self,
        here: &Here,
        args: &'p [Option<Expr>],
        params: Option<&Params>,
    ) -> Result<Vec<Value>, Exit<'p>> {
        let mut order: Vec<usize> = (0..args.len()).collect();
        if let Some(params) = params {
            let first = usize::from(params.required) + usize::from(params.optional);
            let keys = &mut order[first..first + usize::from(params.keys)];
            keys.sort_by_key(|at| args[*at].as_ref().map(|arg| arg.span.start));
        }
        let mut values = vec![Value::UNSET; args.len()];
        for at in order {
            if let Some(arg) = &args[at] {
                values[at] = self.value(here, arg)?;
            }
        }
        Ok(values)
    }

    fn call_expr(
        &mut self,
        here: &Here,
        expr: &'p Expr,
        callee: &'p Callee,
        args: &'p [Option<Expr>],
        usage: Use,
    ) -> Eval<'p> {
        match callee {
            Callee::Function(id) => {
                let args = self.arguments(here, args, Some(&self.function(*id).params))?;
                self.burn(here)?;
                let function = self.function(*id);
                let ready = Ready { function, owner: Some(*id), captured: Vec::new(), args };
                self.call_function(here, expr, ready, usage)
            }
            Callee::Plan(id) => {
                let args = self.arguments(here, args, Some(&self.function(*id).params))?;
                self.burn(here)?;
                self.call_plan(here, expr, *id, args, false, usage)
            }
            Callee::Native(native) => {
                let args = self.arguments(here, args, None)?;
                self.native(here, expr, *native, args, usage)
            }
            Callee::Value(callee) => {
                let callee = self.value(here, callee)?;
                let args = self.arguments(here, args, None)?;
                self.burn(here)?;
                self.call_value(here, expr, &callee, args, usage)
            }
        }
    }
}

/// What tells an expression from all others while the program lives.
pub fn address(expr: &Expr) -> usize {
    std::ptr::from_ref(expr) as usize
}

/// The elements that a loop walks over, and the failure at their end if there is one.
pub fn elements(over: &Value) -> (Vec<Value>, Option<Raise>) {
    match over.obj() {
        Some(Obj::Vector(items)) => (items.iter().cloned().collect(), None),
        Some(Obj::Map(map)) => (map.iter().map(|(k, v)| Value::list([k.clone(), v.clone()])).collect(), None),
        Some(Obj::Str(text)) => (text.chars().map(|c| Value::str(c.to_string())).collect(), None),
        Some(Obj::Pair(..)) => {
            let mut cells = over.iter();
            let items = cells.by_ref().cloned().collect();
            let end = cells.rest;
            (items, (!end.is_nil()).then(|| type_error("a list", end)))
        }
        None if over.is_nil() => (Vec::new(), None),
        _ => (Vec::new(), Some(type_error("something to walk over: a list, vector, map or string", over))),
    }
}

/// The keys of the rounds: the element and its rank among equal ones before it, or the number of
/// the round for what cannot be stored.
pub fn round_keys(items: &[Value]) -> Vec<Step> {
    let mut seen: HashMap<Element, u32> = HashMap::new();
    let key = |(at, item)| match Element::of(item) {
        Some(element) => {
            let rank = seen.entry(element.clone()).or_insert(0);
            *rank += 1;
            Step::Round(element, *rank - 1)
        }
        None => Step::Number(at as u32 + 1),
    };
    items.iter().enumerate().map(key).collect()
}

/// A failure that left a clause: what was being handled is its first cause, and that of the failures
/// which have come beside it since.
fn caused_by(failure: &Value, handled: &Value) -> Value {
    let (Some(it), Some(before)) = (failure.as_failure(), handled.as_failure()) else {
        return failure.clone();
    };
    let also = it.also.iter().map(|other| {
        let is_other = |also: &Failure| other.as_failure().is_some_and(|other| also.is_same_event(other));
        let known = before.also.iter().filter_map(Value::as_failure).any(is_other);
        if known { other.clone() } else { caused_by(other, handled) }
    });
    let failure = &Value::failure(Failure { also: also.collect(), ..it.clone() });
    let causes = std::iter::successors(failure.as_failure(), |it| it.cause.as_ref()?.as_failure());
    if handled.as_failure().is_some_and(|handled| causes.into_iter().any(|it| it.is_same_event(handled))) {
        return failure.clone();
    }
    add_cause(failure, handled)
}

fn add_cause(failure: &Value, first: &Value) -> Value {
    let Some(it) = failure.as_failure() else { return failure.clone() };
    let cause = it.cause.as_ref().map_or_else(|| first.clone(), |cause| add_cause(cause, first));
    Value::failure(Failure { cause: Some(cause), ..it.clone() })
}

/// A way out on which something else fails: that is beside a failure, and comes before a jump.
pub fn beside<'p>(exit: Exit<'p>, other: Value) -> Exit<'p> {
    match exit {
        Exit::Fail(failure) => Exit::Fail(with_also(&failure, other)),
        Exit::Propagate(failure) => Exit::Propagate(with_also(&failure, other)),
        Exit::Evaporate(stopped) => Exit::Evaporate(with_also(&stopped, other)),
        _ => Exit::Fail(other),
    }
}

/// True if nothing more is to be done.
pub fn gave_up(result: &Eval<'_>) -> bool {
    matches!(result, Err(Exit::GiveUp(_) | Exit::Refused(_)))
}

/// A failure, with another one that came after it.
pub fn with_also(failure: &Value, other: Value) -> Value {
    let (Some(it), Some(beside)) = (failure.as_failure(), other.as_failure()) else { return failure.clone() };
    if it.is_same_event(beside) {
        return failure.clone();
    }
    let mut it = it.clone();
    it.also.push(other);
    Value::failure(it)
}
