//! Calls: of functions, natives, plans, descriptions, and what edits make of them.
//!
//! A call of a plan has a record. Around and below it, from the outside in: the guard of each edit,
//! `with-param`, `owe`, `skip`, `defer`, the goal, `before`, `wrap`, `replace`, `after`.

use std::rc::Rc;

use compiler::ast::{Expr, ExprKind, Function};
use vm::code::{FnId, FnKind, NativeId, Params, SiteId};
use vm::edit::What;
use vm::failure::{Builtin, Failure};
use vm::key::Step;
use vm::native::{Next, type_error};
use vm::tree::{NodeKind, Status, Why};
use vm::value::{Imm, Obj, Symbol, Value};

use super::eval::{Eval, Exit, Here, Oracle, Ready, Use, Way};
use super::forms::Part;

/// What a call with a record runs.
#[derive(Clone, Copy)]
pub enum Body {
    Plan(FnId),
    /// What the description, its only argument, is grounded to.
    Action,
}

/// A call with a record.
pub struct Call<'p> {
    /// Where it stands.
    pub here: Here<'p>,
    pub slot: usize,
    pub rec: usize,
    pub body: Body,
    /// The arguments, as edits have changed them.
    pub args: Vec<Value>,
    /// The function that says whether the goal is reached.
    pub goal: Option<Value>,
    /// Numbers of the edits that hold for it.
    pub edits: Vec<usize>,
}

/// What `(original)` runs.
#[derive(Clone)]
pub enum Original<'p> {
    /// The call with this many of its wraps.
    Wrap(Rc<Call<'p>>, usize),
    /// The body of a record with this many of its replacements.
    Layer(Rc<Call<'p>>, usize, usize),
}

impl<'p> Oracle<'p> {
    // ------------------------------------------------------------------ functions

    /// Calls a function of the program that is no plan.
    pub fn call_function(
        &mut self,
        here: &Here<'p>,
        expr: &'p Expr,
        name: Symbol,
        ready: Ready<'p>,
        usage: Use,
    ) -> Eval<'p> {
        if usage == Use::Tail {
            return Err(Exit::Tail(ready));
        }
        let site = self.site(here, expr, name);
        let inner = Here { way: here.way.then(Step::Call(site)), ..here.clone() };
        self.run_function(&inner, ready)
    }

    /// Runs a function and what it goes on as, on the same way.
    pub fn run_function(&mut self, here: &Here<'p>, mut ready: Ready<'p>) -> Eval<'p> {
        for turn in 0.. {
            let Ready { function, owner, captured, args } = ready;
            let inner = Here { owner, original: None, ..here.clone() };
            let result = self.deeper(|it| {
                it.form(&inner, Part::Body(turn), |it, here| it.body_of(here, function, captured, args))
            });
            match result {
                Err(Exit::Tail(next)) => ready = next,
                result => return result,
            }
        }
        unreachable!("a function does not go on for ever")
    }

    /// Binds parameters and does the body.
    pub fn body_of(
        &mut self,
        here: &Here<'p>,
        function: &'p Function,
        captured: Vec<Value>,
        args: Vec<Value>,
    ) -> Eval<'p> {
        let mut inner = Here { env: Default::default(), ..here.clone() };
        for ((_, var), value) in function.captures.iter().zip(captured) {
            inner.env = inner.env.bind(*var, value);
        }
        for ((var, default), arg) in function.inputs.iter().zip(args) {
            let value = match (arg.is_unset(), default) {
                (false, _) => arg,
                (true, Some(default)) => self.value(&inner, default)?,
                (true, None) => Value::NIL,
            };
            inner.env = inner.env.bind(*var, value);
        }
        let usage = match function.kind {
            FnKind::Function | FnKind::Lambda => Use::Tail,
            FnKind::Plan | FnKind::TopLevel | FnKind::Inserted => Use::Effect,
        };
        self.body(&inner, &function.body, usage)
    }

    /// Calls a value. `name` is what the source says of it.
    pub fn call_value(
        &mut self,
        here: &Here<'p>,
        expr: &'p Expr,
        name: Symbol,
        callee: &Value,
        args: Vec<Value>,
        usage: Use,
    ) -> Eval<'p> {
        if let Value::Imm(Imm::Native(native)) = callee {
            return self.native(here, expr, *native, args, usage);
        }
        let ready = self.ready(here, callee, args)?;
        match (callee, ready.function.kind) {
            (Value::Imm(Imm::Function(plan)), FnKind::Plan) => {
                self.call_plan(here, expr, name, *plan, ready.args, true, usage)
            }
            _ => self.call_function(here, expr, name, ready, usage),
        }
    }

    /// A function value with its arguments in the order of the parameters.
    fn ready(&mut self, here: &Here<'p>, callee: &Value, args: Vec<Value>) -> Result<Ready<'p>, Exit<'p>> {
        let (id, captured) = match callee {
            Value::Imm(Imm::Function(id)) => (*id, Vec::new()),
            Value::Obj(obj) if let Obj::Closure(id, captured) = &**obj => (*id, captured.to_vec()),
            _ => return self.raise(here, type_error("a function", callee)),
        };
        let function = self.function(id);
        match arrange(&function.params, args) {
            Ok(args) => Ok(Ready { function, owner: self.owner(id), captured, args }),
            Err(problem) => {
                let message = format!("`{}` {problem}", function.name);
                self.raise(here, Box::new(Failure::new(Builtin::ArityError, message)))
            }
        }
    }

    // ------------------------------------------------------------------ natives

    pub fn native(
        &mut self,
        here: &Here<'p>,
        expr: &'p Expr,
        native: NativeId,
        args: Vec<Value>,
        usage: Use,
    ) -> Eval<'p> {
        match self.ask_native(here, native, &args) {
            Err(raise) => self.raise(here, raise),
            Ok(Next::Return(value)) => Ok(value),
            Ok(Next::Call { callee, args }) => {
                let name = Symbol::from(self.world.program().natives[native.at()].name);
                self.call_value(here, expr, name, &callee, args, usage.no_tail())
            }
            Ok(Next::RunPlan { plan, args, tree }) => self.run_plan(here, &plan, args, tree),
            Ok(Next::EditTree { tree, edits }) => self.edit_tree(here, &tree, &edits),
            Ok(Next::Ask(_)) => Err(Exit::GiveUp("the oracle has no world to ask".into())),
        }
    }

    /// `(run-plan plan :args args :tree tree)`: a run of its own, with its own clock.
    fn run_plan(&mut self, here: &Here<'p>, plan: &Value, args: Vec<Value>, tree: Option<Value>) -> Eval<'p> {
        let id = match plan {
            Value::Imm(Imm::Function(id)) if self.function(*id).kind == FnKind::Plan => *id,
            _ => return self.raise(here, type_error("a plan", plan)),
        };
        let args = self.ready(here, plan, args)?.args;
        let start = match &tree {
            None => None,
            Some(tree) if tree.as_tree().is_some() => Some(self.tree_of(tree)?),
            Some(tree) => return self.raise(here, type_error("a tree", tree)),
        };
        let inner = super::eval::Run::new(super::Tree::begin(start.as_deref()));
        let outer = std::mem::replace(&mut self.run, inner);
        let root = Here::root(None);
        let name = self.function(id).name;
        let slot = self.slot(&root, SiteId(0), name, true, Some(id), true);
        let outcome = self.deeper(|it| it.start(&root, slot, Body::Plan(id), args, None));
        let (status, value) = match outcome {
            Ok(value) => (Status::Succeeded, value),
            Err(Exit::Fail(failure)) => (Status::Failed, failure),
            Err(exit) => return Err(exit),
        };
        let mut inner = std::mem::replace(&mut self.run, outer);
        inner.tree.end(0, status, value, inner.now);
        Ok(self.tree_value(inner.tree))
    }

    /// A tree as a value.
    pub fn tree_value(&mut self, tree: super::Tree) -> Value {
        let mirror = Rc::new(tree.mirror.clone());
        self.trees.push((mirror.clone(), Rc::new(tree)));
        Value::new(Obj::Tree(mirror))
    }

    /// The tree that a value is.
    pub fn tree_of(&self, value: &Value) -> Result<Rc<super::Tree>, Exit<'p>> {
        let found = value.as_tree().and_then(|it| self.trees.iter().find(|(mirror, _)| Rc::ptr_eq(mirror, it)));
        found.map(|(_, tree)| tree.clone()).ok_or_else(|| Exit::GiveUp("a tree that the oracle did not make".into()))
    }

    // ------------------------------------------------------------------ plans

    #[expect(clippy::too_many_arguments, reason = "a call has this many parts")]
    pub fn call_plan(
        &mut self,
        here: &Here<'p>,
        expr: &'p Expr,
        called: Symbol,
        plan: FnId,
        args: Vec<Value>,
        dynamic: bool,
        usage: Use,
    ) -> Eval<'p> {
        let site = self.site(here, expr, called);
        let name = self.function(plan).name;
        let slot = self.slot(here, site, name, dynamic, Some(plan), usage != Use::Effect);
        self.deeper(|it| it.start(here, slot, Body::Plan(plan), args, None))
    }

    /// `(perform desc :goal goal)`
    pub fn perform_expr(
        &mut self,
        here: &Here<'p>,
        expr: &'p Expr,
        desc: &'p Expr,
        goal: Option<&'p Function>,
        usage: Use,
    ) -> Eval<'p> {
        let called = match &desc.kind {
            ExprKind::Desc(kind, _) => *kind,
            _ => Symbol::from("perform"),
        };
        let value = self.value(here, desc)?;
        let goal = goal.map(|goal| self.lambda(here, goal));
        self.burn();
        let Some(it) = value.as_desc() else {
            return self.raise(here, type_error("a description to perform", &value));
        };
        let name = it.entity_type().unwrap_or(it.kind);
        let site = self.site(here, expr, called);
        let slot = self.slot(here, site, name, true, None, usage != Use::Effect);
        self.deeper(|it| it.start(here, slot, Body::Action, vec![value.clone()], goal))
    }

    /// The slot of a call: its site, the way to it, what it calls if the source does not say, and
    /// how often the same has been called before in its record.
    fn slot(
        &mut self,
        here: &Here<'p>,
        site: SiteId,
        name: Symbol,
        dynamic: bool,
        plan: Option<FnId>,
        value_used: bool,
    ) -> usize {
        let mut steps = here.way.steps();
        if dynamic {
            steps.push(Step::Name(name));
        }
        let count = self.run.tree.records[here.rec].counts.entry((site, steps.clone())).or_insert(0);
        if *count > 0 {
            steps.push(Step::Again(*count));
        }
        *count += 1;
        let hashes = &self.site_hashes;
        let slot = self.run.tree.slot(here.rec, (site, steps), name, |site| hashes[site.at()]);
        let it = &mut self.run.tree.slots[slot];
        (it.place, it.plan, it.value_used) = (here.place.clone(), plan, value_used);
        slot
    }

    /// A call with a record, from its beginning.
    fn start(&mut self, here: &Here<'p>, slot: usize, body: Body, args: Vec<Value>, goal: Option<Value>) -> Eval<'p> {
        let kind = if matches!(body, Body::Plan(_)) { NodeKind::Plan } else { NodeKind::Action };
        let rec = self.run.tree.enter(here.rec, slot, kind, args.clone(), self.run.now);
        let mut call = Call { here: here.clone(), slot, rec, body, args, goal, edits: Vec::new() };
        self.apply_edits(&mut call);
        let call = Rc::new(call);
        self.owe(&call);
        if let Some(skip) = self.edits_of(&call, |what| matches!(what, What::Skip(_))).pop() {
            let value = match &self.run.tree.edits[skip].edit.what {
                What::Skip(Some(value)) => value.clone(),
                _ => Value::NIL,
            };
            self.end_skipped(rec, Why::Edit, value.clone());
            return Ok(value);
        }
        if self.defer(&call) {
            return Ok(Value::NIL);
        }
        self.perform(&call)
    }

    /// A call that is neither skipped by an edit nor deferred.
    pub fn perform(&mut self, call: &Rc<Call<'p>>) -> Eval<'p> {
        if let Some(goal) = &call.goal {
            let site = self.run.tree.slots[call.slot].key.0;
            let here = Here { way: call.here.way.then(Step::Call(site)), ..call.here.clone() };
            match self.ask_goal(&here, goal) {
                Ok(true) => {
                    self.end_skipped(call.rec, Why::Goal, Value::NIL);
                    return self.afters(call, Value::NIL);
                }
                Ok(false) => {}
                Err(exit) => return self.call_failed(call, exit, Why::Nothing),
            }
        }
        for id in self.edits_of(call, |what| matches!(what, What::Before(_))) {
            if let Err(exit) = self.edit_code(call, id, call.here.rec, None) {
                return self.call_failed(call, exit, Why::Before);
            }
        }
        let wraps = self.edits_of(call, |what| matches!(what, What::Wrap(_))).len();
        match self.wrapped(call, wraps) {
            Ok(value) => {
                if !self.run.tree.records[call.rec].status.is_final() {
                    self.end_skipped(call.rec, Why::Edit, value.clone());
                }
                self.afters(call, value)
            }
            Err(exit) => self.call_failed(call, exit, Why::Nothing),
        }
    }

    fn afters(&mut self, call: &Rc<Call<'p>>, value: Value) -> Eval<'p> {
        for id in self.edits_of(call, |what| matches!(what, What::After(_))) {
            self.edit_code(call, id, call.here.rec, None)?;
        }
        Ok(value)
    }

    fn end_skipped(&mut self, rec: usize, why: Why, value: Value) {
        self.run.tree.records[rec].why = why;
        self.run.tree.end(rec, Status::Skipped, value, self.run.now);
    }

    /// A failure leaves a call whose body has not ended it.
    fn call_failed(&mut self, call: &Call<'p>, exit: Exit<'p>, why: Why) -> Eval<'p> {
        if let Exit::Fail(failure) = &exit
            && !self.run.tree.records[call.rec].status.is_final()
        {
            self.run.tree.records[call.rec].why = why;
            self.run.tree.end(call.rec, Status::Failed, failure.clone(), self.run.now);
        }
        Err(exit)
    }

    fn ask_goal(&mut self, here: &Here<'p>, goal: &Value) -> Result<bool, Exit<'p>> {
        let ready = self.ready(here, goal, Vec::new())?;
        Ok(self.run_function(here, ready)?.is_true())
    }

    // ------------------------------------------------------------------ wraps and bodies

    /// Numbers of the edits of one kind that hold for a call, in the order of their making.
    pub fn edits_of(&self, call: &Call<'p>, wanted: impl Fn(&What) -> bool) -> Vec<usize> {
        call.edits.iter().copied().filter(|id| wanted(&self.run.tree.edits[*id].edit.what)).collect()
    }

    /// The code of an edit; its calls belong to the record `rec`.
    fn edit_code(&mut self, call: &Call<'p>, id: usize, rec: usize, original: Option<Original<'p>>) -> Eval<'p> {
        let (owner, function) = self.run.tree.edits[id].code.expect("this edit has code");
        let place = if rec == call.here.rec {
            call.here.place.clone()
        } else {
            self.run.tree.slots[call.slot].place.inside(Part::Node(call.slot))
        };
        let way = Way::default().then(Step::Edit(id as u32 + 1));
        let here = Here { rec, way, place, original, owner: Some(owner), ..call.here.clone() };
        let args = call.args.clone();
        self.deeper(|it| it.form(&here, Part::Code(id), |it, here| it.body_of(here, function, Vec::new(), args)))
    }

    /// A call with its first `n` wraps around it; the last of them is the outermost.
    fn wrapped(&mut self, call: &Rc<Call<'p>>, n: usize) -> Eval<'p> {
        let Some(inner) = n.checked_sub(1) else { return self.attempt(call) };
        let wraps = self.edits_of(call, |what| matches!(what, What::Wrap(_)));
        self.edit_code(call, wraps[inner], call.here.rec, Some(Original::Wrap(call.clone(), inner)))
    }

    /// `(original)`
    pub fn original(&mut self, here: &Here<'p>) -> Eval<'p> {
        match here.original.clone() {
            Some(Original::Wrap(call, n)) => self.wrapped(&call, n),
            Some(Original::Layer(call, rec, n)) => self.layer(&call, rec, n),
            None => self.raise(here, Box::new(Failure::new(Builtin::ProgramError, "there is no original here"))),
        }
    }

    /// Runs the body: the first time in the record of the call, then in new attempts.
    fn attempt(&mut self, call: &Rc<Call<'p>>) -> Eval<'p> {
        let mut rec = call.rec;
        if self.run.tree.records[rec].status.is_final() {
            let first = self.run.tree.records[rec].clone();
            rec = self.run.tree.enter(call.here.rec, call.slot, first.kind, call.args.clone(), self.run.now);
            let it = &mut self.run.tree.records[rec];
            (it.written, it.performed_in) = (first.written, first.performed_in);
        }
        let replaces = self.edits_of(call, |what| matches!(what, What::Replace(_))).len();
        let result = match self.layer(call, rec, replaces) {
            Ok(value) => self.check_goal(call, rec).map(|()| value),
            Err(exit) => Err(exit),
        };
        let now = self.run.now;
        match &result {
            Ok(value) => self.run.tree.end(rec, Status::Succeeded, value.clone(), now),
            Err(Exit::Fail(failure)) => self.run.tree.end(rec, Status::Failed, failure.clone(), now),
            Err(_) => {}
        }
        result
    }

    fn check_goal(&mut self, call: &Call<'p>, rec: usize) -> Result<(), Exit<'p>> {
        let Some(goal) = call.goal.as_ref().filter(|_| !self.run.tree.records[rec].moved) else { return Ok(()) };
        let here = self.inside_node(call, rec);
        if self.ask_goal(&here, goal)? {
            return Ok(());
        }
        self.goal_not_reached(&here, call.slot)
    }

    pub fn goal_not_reached(&mut self, here: &Here<'p>, slot: usize) -> Result<(), Exit<'p>> {
        let path = self.run.tree.path(slot);
        let message = format!("the goal of {} is not true after it", path.show());
        let fields = vec![("message", Value::str(message)), ("of", Value::new(Obj::Path(Box::new(path))))];
        self.raise(here, Box::new(Failure::with(Builtin::GoalNotReached, fields)))
    }

    /// Where the body of a record stands.
    fn inside_node(&self, call: &Call<'p>, rec: usize) -> Here<'p> {
        let place = self.run.tree.slots[call.slot].place.inside(Part::Node(call.slot));
        Here { rec, way: Way::default(), place, original: None, owner: None, ..call.here.clone() }
    }

    /// The body of a record with the first `n` replacements; the last of them counts.
    fn layer(&mut self, call: &Rc<Call<'p>>, rec: usize, n: usize) -> Eval<'p> {
        if let Some(inner) = n.checked_sub(1) {
            let replaces = self.edits_of(call, |what| matches!(what, What::Replace(_)));
            return self.edit_code(call, replaces[inner], rec, Some(Original::Layer(call.clone(), rec, inner)));
        }
        let here = self.inside_node(call, rec);
        let (plan, args) = match call.body {
            Body::Plan(plan) => (Value::Imm(Imm::Function(plan)), None),
            Body::Action => {
                let (plan, args) = self.ground(&here, call)?;
                (plan, Some(args))
            }
        };
        let ready = match args {
            // The arguments of a plan's call are in the order of its parameters already.
            None => match call.body {
                Body::Plan(id) => {
                    Ready { function: self.function(id), owner: self.owner(id), captured: Vec::new(), args: call.args.clone() }
                }
                Body::Action => unreachable!("descriptions are grounded"),
            },
            Some(args) => match plan {
                Value::Imm(Imm::Native(_)) => return Err(Exit::GiveUp("a description grounded to a native".into())),
                _ => self.ready(&here, &plan, args)?,
            },
        };
        self.run_function_in_node(&here, ready)
    }

    fn run_function_in_node(&mut self, here: &Here<'p>, ready: Ready<'p>) -> Eval<'p> {
        // The node is the form; the function in it adds none.
        self.node(here, |it, here| it.run_function(here, ready))
    }

    /// What a description is performed by: a plan and its arguments.
    fn ground(&mut self, here: &Here<'p>, call: &Call<'p>) -> Result<(Value, Vec<Value>), Exit<'p>> {
        let desc = call.args[0].clone();
        let answer = match self.world.program().ground {
            None => Value::NIL,
            Some(ground) => {
                let ready = self.ready(here, &Value::Imm(Imm::Function(ground)), vec![desc.clone()])?;
                self.run_function(here, ready)?
            }
        };
        if answer.is_nil() {
            let message = format!("no rule says which plan performs {}", vm::print::brief(&desc));
            let fields = vec![("message", Value::str(message)), ("action", desc)];
            return self.raise(here, Box::new(Failure::with(Builtin::ActionNotGrounded, fields)));
        }
        let parts = answer.to_vec().filter(|parts| !parts.is_empty());
        let Some(mut parts) = parts else {
            return self.raise(here, type_error("a list of a plan and its arguments from `ground`", &answer));
        };
        self.run.tree.records[here.rec].grounded = Some(answer);
        let plan = parts.remove(0);
        Ok((plan, parts))
    }
}

/// Arguments in the order of the parameters, those not given unset, or what is wrong with them.
fn arrange(params: &Params, args: Vec<Value>) -> Result<Vec<Value>, String> {
    let (required, optional) = (usize::from(params.required), usize::from(params.optional));
    let given = args.len();
    let takes = || format!("takes {}, got {given}", vm::machine::takes(params));
    if given < required {
        return Err(takes());
    }
    let positional = given.min(required + optional);
    let mut arranged = args[..positional].to_vec();
    arranged.resize(required + optional, Value::UNSET);
    let more = &args[positional..];
    if params.keys == 0 && !params.rest && !more.is_empty() {
        return Err(takes());
    }
    let names = params.key_names();
    let mut keys = vec![Value::UNSET; names.len()];
    for pair in more.chunks(2).filter(|_| params.keys > 0) {
        let key = pair[0].as_keyword().ok_or_else(takes)?;
        let value = pair.get(1).ok_or_else(|| format!("got `:{key}` without a value"))?;
        match names.iter().position(|name| *name == key) {
            Some(at) if keys[at].is_unset() => keys[at] = value.clone(),
            Some(_) => return Err(format!("got `:{key}` twice")),
            None if params.rest => {}
            None => {
                let known: Vec<String> = names.iter().map(|name| format!(":{name}")).collect();
                return Err(format!("has no parameter `:{key}`, only {}", known.join(" ")));
            }
        }
    }
    arranged.extend(keys);
    if params.rest {
        arranged.push(Value::list(more.to_vec()));
    }
    Ok(arranged)
}
