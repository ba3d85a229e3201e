//! Evaluation: one `match` over the expressions of the AST.
//!
//! An expression has a value, or control leaves it: [`Exit`]. What an expression can see is its
//! [`Here`], which is never changed: a binding, a round of a loop, a call makes a new one. So it can
//! be kept, for code that is performed later.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::rc::Rc;

use compiler::ast::{Callee, Clause, Expr, ExprKind, Function, VarId};
use rustc_hash::FxHashMap;
use vm::code::{FnId, GlobalId, SiteId};
use vm::desc::{Desc, Match};
use vm::failure::{Builtin, Failure, TypeId};
use vm::host::{CodeRequest, Host, Request};
use vm::key::{Element, Step};
use vm::native::{Raise, map_key, type_error};
use vm::tree::RecId;
use vm::value::{Imm, Map, Obj, Symbol, Value};

use super::call::Original;
use super::forms::{Part, Place};
use super::obligations::Form;
use super::tree::Tree;
use super::{MOST_DEPTH, Ran, Trees, World};

/// How control leaves an expression without a value.
pub enum Exit<'p> {
    /// A failure is on its way to a handler.
    Fail(Value),
    /// `(retry)`, on its way to its handler.
    Retry,
    /// `(propagate)`, on its way to its handler.
    Propagate,
    /// `(return v)`, on its way to the innermost loop or handler.
    Return(Value),
    /// The function goes on as this one.
    Tail(Ready<'p>),
    /// The oracle cannot go on.
    GiveUp(String),
}

/// A function with all that its call needs.
pub struct Ready<'p> {
    pub function: &'p Function,
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
        let mut steps: Vec<Step> = std::iter::successors(self.0.as_ref(), |it| it.1.0.as_ref()).map(|it| it.0.clone()).collect();
        steps.reverse();
        steps
    }
}

/// What an expression can see and where it stands.
#[derive(Clone)]
pub struct Here<'p> {
    pub env: Env,
    /// The record that calls belong to.
    pub rec: usize,
    /// The way from the node to here: loops and functions.
    pub way: Way,
    /// The forms around.
    pub place: Place,
    /// What `(original)` runs, in the code of an edit.
    pub original: Option<Original<'p>>,
    /// The function that the code belongs to, where it has a number.
    pub owner: Option<FnId>,
}

/// A handler whose body is being done.
#[derive(Clone)]
pub struct Handler<'p> {
    pub clauses: &'p [Clause],
    pub here: Here<'p>,
}

/// A tree being grown.
pub struct Run<'p> {
    pub tree: Tree,
    /// The task clock, in nanoseconds.
    pub now: u64,
    /// The forms that are being done, outermost first.
    pub forms: Vec<Form<'p>>,
    /// The handlers around what is being done, outermost first.
    pub handlers: Vec<Handler<'p>>,
    pub draws: FxHashMap<RecId, u64>,
}

impl Run<'_> {
    pub fn new(tree: Tree) -> Self {
        Run { tree, now: 0, forms: vec![Form::default()], handlers: Vec::new(), draws: FxHashMap::default() }
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

/// Units of fuel in a round, and by how much a used-up round moves the clock.
const QUANTUM: u64 = 1000;
const QUANTUM_NS: u64 = 1_000_000;
/// Lambdas get numbers from here on.
const FIRST_LAMBDA: u32 = 1 << 30;

/// The walker.
pub struct Oracle<'p> {
    pub world: &'p mut dyn World,
    functions: &'p BTreeMap<FnId, Rc<Function>>,
    lambdas: Vec<&'p Function>,
    seed: u64,
    pub run: Run<'p>,
    pub trees: Trees,
    globals: BTreeMap<GlobalId, Value>,
    output: Output,
    /// Fuel used in this round.
    in_round: u64,
    printed: usize,
    fresh: u64,
    depth: usize,
    /// Call sites, known by the address of their expression, with what stands for them in draws.
    sites: HashMap<usize, SiteId>,
    site_hashes: Vec<u64>,
}

impl<'p> Oracle<'p> {
    pub fn new(world: &'p mut dyn World, functions: &'p BTreeMap<FnId, Rc<Function>>, seed: u64) -> Oracle<'p> {
        Oracle {
            world,
            functions,
            lambdas: Vec::new(),
            seed,
            run: Run::new(Tree::begin(None)),
            trees: Trees::new(),
            globals: BTreeMap::new(),
            output: Output::default(),
            in_round: 0,
            printed: 0,
            fresh: 0,
            depth: 0,
            sites: HashMap::new(),
            // Number 0 is the call of the plan of `run-plan`.
            site_hashes: vec![0],
        }
    }

    /// Runs functions without arguments one after another, until one fails.
    pub fn run(mut self, start: &[FnId]) -> Result<Ran, String> {
        let mut outcome = Ok(Value::NIL);
        for id in start {
            let function = self.function(*id);
            let root = Here {
                env: Env::default(),
                rec: 0,
                way: Way::default(),
                place: Place::default(),
                original: None,
                owner: Some(*id),
            };
            outcome = match self.body_of(&root, function, Vec::new(), Vec::new()) {
                Ok(value) => Ok(value),
                Err(Exit::Fail(failure)) => Err(failure),
                Err(Exit::GiveUp(why)) => return Err(why),
                Err(_) => unreachable!("the compiler lets no way out of a function through"),
            };
            if outcome.is_err() {
                break;
            }
        }
        let (status, value) = match &outcome {
            Ok(value) => (vm::tree::Status::Succeeded, value.clone()),
            Err(failure) => (vm::tree::Status::Failed, failure.clone()),
        };
        let now = self.run.now;
        self.run.tree.end(0, status, value, now);
        Ok(Ran { outcome, tree: self.run.tree, output: self.output.0, trees: self.trees })
    }

    /// A function by its number.
    pub fn function(&self, id: FnId) -> &'p Function {
        match id.0.checked_sub(FIRST_LAMBDA) {
            Some(lambda) => self.lambdas[lambda as usize],
            None => self.functions.get(&id).expect("the AST of each function is kept"),
        }
    }

    /// A unit of fuel. The clock moves when a round has used up its own and wants more.
    pub fn burn(&mut self) {
        if self.in_round == QUANTUM {
            self.in_round = 0;
            self.run.now += QUANTUM_NS;
        }
        self.in_round += 1;
    }

    /// Raises a failure at a place.
    pub fn raise<T>(&self, here: &Here<'p>, raise: Raise) -> Result<T, Exit<'p>> {
        Err(Exit::Fail(self.raised(here, *raise)))
    }

    fn raised(&self, here: &Here<'p>, mut failure: Failure) -> Value {
        let slot = self.run.tree.records[here.rec].slot;
        failure.task.get_or_insert_with(|| self.run.tree.path(slot).show().into());
        Value::failure(failure)
    }

    // ------------------------------------------------------------------ expressions

    /// The value of an expression, which is a form of its own.
    pub fn eval(&mut self, here: &Here<'p>, expr: &'p Expr, usage: Use) -> Eval<'p> {
        self.form(here, Part::Expr(address(expr)), |it, here| it.eval_kind(here, expr, usage))
    }

    fn eval_kind(&mut self, here: &Here<'p>, expr: &'p Expr, usage: Use) -> Eval<'p> {
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
                match self.rounds(here, *var, elements(&over), body)? {
                    Some(returned) => Ok(returned),
                    None => self.eval(here, result, usage.no_tail()),
                }
            }
            ExprKind::Dotimes { var, count, body, result } => {
                let count = self.value(here, count)?;
                let Some(count) = count.as_int() else { return self.raise(here, type_error("an integer", &count)) };
                let numbers = (0..count).map(Value::int).collect();
                match self.rounds(here, *var, (numbers, None), body)? {
                    Some(returned) => Ok(returned),
                    None => self.eval(here, result, usage.no_tail()),
                }
            }
            ExprKind::Lambda(function) => Ok(self.lambda(here, function)),
            ExprKind::Call(callee, args) => self.call_expr(here, expr, callee, args, usage),
            ExprKind::Perform(desc, goal) => self.perform_expr(here, expr, desc, goal.as_deref(), usage),
            ExprKind::Handle(clauses, body) => self.handle(here, clauses, body, usage.no_tail()),
            ExprKind::Retry => Err(Exit::Retry),
            ExprKind::Propagate => Err(Exit::Propagate),
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
            ExprKind::Protect(body, cleanup) => self.protect(here, body, cleanup, usage.no_tail()),
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
                let native = self.world.program().native(name).expect("the library has what special forms need");
                self.native(here, expr, native, args, usage)
            }
            ExprKind::Original => self.original(here),
        }
    }

    /// The value of an expression that something looks at.
    pub fn value(&mut self, here: &Here<'p>, expr: &'p Expr) -> Eval<'p> {
        self.eval(here, expr, Use::Value)
    }

    fn values(&mut self, here: &Here<'p>, exprs: &'p [Expr]) -> Result<Vec<Value>, Exit<'p>> {
        exprs.iter().map(|expr| self.value(here, expr)).collect()
    }

    /// Several expressions; the value is that of the last.
    pub fn body(&mut self, here: &Here<'p>, body: &'p [Expr], usage: Use) -> Eval<'p> {
        let Some((last, first)) = body.split_last() else { return Ok(Value::NIL) };
        for expr in first {
            self.eval(here, expr, Use::Effect)?;
        }
        self.eval(here, last, usage)
    }

    fn and_or(&mut self, here: &Here<'p>, parts: &'p [Expr], usage: Use, ends: fn(&Value) -> bool) -> Eval<'p> {
        let Some((last, first)) = parts.split_last() else { return Ok(Value::NIL) };
        for part in first {
            let value = self.value(here, part)?;
            if ends(&value) {
                return Ok(value);
            }
        }
        // What is looked at inside a connective is looked at.
        self.eval(here, last, if usage == Use::Tail { Use::Tail } else { Use::Value })
    }

    fn lambda(&mut self, here: &Here<'p>, function: &'p Function) -> Value {
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

    /// The value of a goal's function.
    pub fn goal(&mut self, here: &Here<'p>, function: &'p Function) -> Value {
        self.lambda(here, function)
    }

    // ------------------------------------------------------------------ loops

    fn while_(&mut self, here: &Here<'p>, test: &'p Expr, body: &'p [Expr]) -> Eval<'p> {
        for turn in 0.. {
            let round = self.form(here, Part::Turn(turn), |it, here| {
                let more = it.value(here, test)?.is_true();
                if more {
                    it.body(here, body, Use::Effect)?;
                }
                Ok(Value::bool(more))
            });
            match round {
                Ok(more) if more.is_true() => self.burn(),
                Ok(_) => break,
                Err(Exit::Return(value)) => return Ok(value),
                Err(exit) => return Err(exit),
            }
        }
        Ok(Value::NIL)
    }

    /// The rounds of a loop over elements. The value if `(return v)` left it.
    fn rounds(
        &mut self,
        here: &Here<'p>,
        var: VarId,
        (items, bad_end): (Vec<Value>, Option<Raise>),
        body: &'p [Expr],
    ) -> Result<Option<Value>, Exit<'p>> {
        let steps = round_keys(&items);
        self.set_ahead(steps.clone());
        for (at, (item, step)) in items.into_iter().zip(&steps).enumerate() {
            self.pass(at);
            let inner = Here { env: here.env.bind(var, item), way: here.way.then(step.clone()), ..here.clone() };
            match self.form(&inner, Part::Round(step.clone()), |it, here| it.body(here, body, Use::Effect)) {
                Ok(_) => self.burn(),
                Err(Exit::Return(value)) => return Ok(Some(value)),
                Err(exit) => return Err(exit),
            }
        }
        bad_end.map_or(Ok(None), |raise| self.raise(here, raise))
    }

    // ------------------------------------------------------------------ failures

    fn failure(&mut self, here: &Here<'p>, kind: TypeId, fields: &'p [(Symbol, Expr)]) -> Result<Failure, Exit<'p>> {
        let mut failure = Failure::new(Builtin::Failure, "");
        failure.kind = kind;
        failure.name = self.world.program().failures.get(kind).expect("the compiler knows the types").name;
        failure.fields.clear();
        for (key, value) in fields {
            failure.fields.push((*key, self.value(here, value)?));
        }
        Ok(failure)
    }

    fn handle(&mut self, here: &Here<'p>, clauses: &'p [Clause], body: &'p [Expr], usage: Use) -> Eval<'p> {
        loop {
            let counts = self.run.tree.records[here.rec].counts.clone();
            self.run.handlers.push(Handler { clauses, here: here.clone() });
            let result = self.form(here, Part::Guarded, |it, here| it.body(here, body, usage));
            self.run.handlers.pop();
            let Err(Exit::Fail(failure)) = result else { return result };
            match self.take(here, clauses, failure)? {
                Some(value) => return Ok(value),
                None => self.run.tree.records[here.rec].counts = counts,
            }
        }
    }

    /// Gives a failure to the first clause for it. `Ok(None)` is `(retry)`, `Ok(Some(v))` is
    /// `(return v)`; without a clause, at its end or by `(propagate)` the failure goes on.
    pub fn take(
        &mut self,
        here: &Here<'p>,
        clauses: &'p [Clause],
        failure: Value,
    ) -> Result<Option<Value>, Exit<'p>> {
        let kind = failure.as_failure().map(|failure| failure.kind).expect("only failures are raised");
        let types = &self.world.program().failures;
        let takes = |clause: &Clause| clause.kinds.iter().any(|of| types.is_a(kind, *of));
        let Some(at) = clauses.iter().position(takes) else { return Err(Exit::Fail(failure)) };
        let clause = &clauses[at];
        let mut inner = here.clone();
        if let Some(var) = clause.var {
            inner.env = inner.env.bind(var, failure.clone());
        }
        match self.form(&inner, Part::Clause(at), |it, here| it.body(here, &clause.body, Use::Effect)) {
            Ok(_) | Err(Exit::Propagate) => Err(Exit::Fail(failure)),
            Err(Exit::Retry) => Ok(None),
            Err(Exit::Return(value)) => Ok(Some(value)),
            Err(Exit::Fail(new)) => Err(Exit::Fail(caused_by(&new, &failure))),
            Err(exit) => Err(exit),
        }
    }

    fn protect(&mut self, here: &Here<'p>, body: &'p Expr, cleanup: &'p [Expr], usage: Use) -> Eval<'p> {
        let result = self.eval(here, body, usage);
        if let Err(Exit::GiveUp(_)) = result {
            return result;
        }
        let cleaned = self.form(here, Part::CleanUp, |it, here| it.body(here, cleanup, Use::Effect));
        match (result, cleaned) {
            (result, Ok(_)) => result,
            (Err(Exit::Fail(failure)), Err(Exit::Fail(other))) => Err(Exit::Fail(with_also(&failure, other))),
            (_, Err(exit)) => Err(exit),
        }
    }

    // ------------------------------------------------------------------ sites

    /// The number of a call.
    pub fn site(&mut self, here: &Here<'p>, expr: &'p Expr, name: Symbol) -> SiteId {
        let next = SiteId(self.site_hashes.len() as u32);
        let known = *self.sites.entry(address(expr)).or_insert(next);
        if known == next {
            let hash = self.site_hash(here, expr, name);
            self.site_hashes.push(hash);
        }
        known
    }

    /// What stands for a call in keyed draws: it has no meaning, so the machine's is taken.
    fn site_hash(&self, here: &Here<'p>, expr: &'p Expr, name: Symbol) -> u64 {
        let program = self.world.program();
        let owner = here.owner.map(|owner| &program.functions[owner.at()]);
        let sites = owner.map_or(&program.sites[..], |it| &program.sites[it.sites.start as usize..it.sites.end as usize]);
        let at = (expr.span.file.0, expr.span.start, expr.span.end);
        let here = |site: &&vm::code::Site| {
            let place = program.places[site.pc.at()];
            site.name == name && (place.file, place.start, place.end) == at
        };
        sites.iter().find(here).map_or(0, |site| site.hash)
    }

    pub fn hash_of(&self, site: SiteId) -> u64 {
        self.site_hashes[site.at()]
    }

    pub fn hashes(&self) -> Vec<u64> {
        self.site_hashes.clone()
    }

    // ------------------------------------------------------------------ natives

    /// What a native answers.
    pub fn ask_native(&mut self, here: &Here<'p>, at: usize, args: &[Value]) -> Result<vm::native::Next, Raise> {
        let program = self.world.program();
        let native = &program.natives[at];
        let (least, most) = native.arity;
        if args.len() < usize::from(least) || most.is_some_and(|most| args.len() > usize::from(most)) {
            let mut takes = String::new();
            let _ = match most {
                Some(most) if most == least => write!(takes, "{least}"),
                Some(most) => write!(takes, "{least} to {most}"),
                None => write!(takes, "at least {least}"),
            };
            let message = format!("`{}` takes {takes} arguments, got {}", native.name, args.len());
            return Err(Box::new(Failure::new(Builtin::ArityError, message)));
        }
        if native.effect != vm::native::Effect::Pure {
            let effect = native.effect.name();
            let message = format!("`{}` needs the grant `{effect}`, which this run does not have", native.name);
            let fields = vec![("message", Value::str(message)), ("effect", Value::symbol(effect))];
            return Err(Box::new(Failure::with(Builtin::NotAllowed, fields)));
        }
        let run = native.run;
        let mut ctx = vm::machine::Ctx::new(vm::machine::CtxParts {
            program,
            tree: &self.run.tree.mirror,
            rec: self.run.tree.records[here.rec].mirror,
            draws: &mut self.run.draws,
            seed: self.seed,
            now: self.run.now,
            printed: &mut self.printed,
            fresh: &mut self.fresh,
            output_limit: usize::MAX,
            host: &mut self.output,
        });
        run(&mut ctx, args)
    }

    /// Goes one call deeper, if the stack has room.
    pub fn deeper(&mut self, work: impl FnOnce(&mut Self) -> Eval<'p>) -> Eval<'p> {
        if self.depth == MOST_DEPTH {
            return Err(Exit::GiveUp("calls are nested too deep for the oracle".into()));
        }
        self.depth += 1;
        let result = work(self);
        self.depth -= 1;
        result
    }

    /// The arguments of a call of a function of the program, in the order of the text.
    pub fn arguments(&mut self, here: &Here<'p>, args: &'p [Option<Expr>]) -> Result<Vec<Value>, Exit<'p>> {
        let mut order: Vec<usize> = (0..args.len()).filter(|at| args[*at].is_some()).collect();
        order.sort_by_key(|at| args[*at].as_ref().map(|arg| arg.span.start));
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
        here: &Here<'p>,
        expr: &'p Expr,
        callee: &'p Callee,
        args: &'p [Option<Expr>],
        usage: Use,
    ) -> Eval<'p> {
        match callee {
            Callee::Function(id) => {
                let args = self.arguments(here, args)?;
                let name = self.world.program().functions[id.at()].name;
                self.burn();
                let ready = Ready { function: self.function(*id), captured: Vec::new(), args };
                self.call_function(here, expr, name, Some(*id), ready, usage)
            }
            Callee::Plan(id) => {
                let args = self.arguments(here, args)?;
                let name = self.world.program().functions[id.at()].name;
                self.burn();
                self.call_plan(here, expr, name, *id, args, false, usage)
            }
            Callee::Native(native) => {
                let args = self.arguments(here, args)?;
                self.native(here, expr, *native, args, usage)
            }
            Callee::Value(callee) => {
                let name = match &callee.kind {
                    ExprKind::Global(global) => self.world.program().globals[global.at()],
                    _ => Symbol::from("call"),
                };
                let callee = self.value(here, callee)?;
                let args = self.arguments(here, args)?;
                self.burn();
                self.call_value(here, expr, name, &callee, args, usage)
            }
        }
    }
}

/// What tells an expression from all others while the program lives.
pub fn address(expr: &Expr) -> usize {
    std::ptr::from_ref(expr) as usize
}

/// The elements that a loop walks over, and the failure at their end if there is one.
fn elements(over: &Value) -> (Vec<Value>, Option<Raise>) {
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
fn round_keys(items: &[Value]) -> Vec<Step> {
    let elements: Vec<Option<Element>> = items.iter().map(Element::of).collect();
    let key = |at: usize| match &elements[at] {
        Some(element) => {
            let rank = elements[..at].iter().flatten().filter(|other| *other == element).count();
            Step::Round(element.clone(), rank as u32)
        }
        None => Step::Number(at as u32 + 1),
    };
    (0..items.len()).map(key).collect()
}

/// A failure that left a clause: what was being handled is its first cause.
fn caused_by(failure: &Value, handled: &Value) -> Value {
    let Some(it) = failure.as_failure() else { return failure.clone() };
    if failure.identical(handled) {
        return failure.clone();
    }
    let cause = match &it.cause {
        Some(cause) => caused_by(cause, handled),
        None => handled.clone(),
    };
    Value::failure(Failure { cause: Some(cause), ..it.clone() })
}

/// A failure, with another one that came after it.
pub fn with_also(failure: &Value, other: Value) -> Value {
    let Some(it) = failure.as_failure() else { return other };
    let mut it = it.clone();
    it.also.push(other);
    Value::failure(it)
}
