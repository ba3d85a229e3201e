//! Calls: of functions, natives, plans, descriptions, and what edits make of them.
//!
//! A call of a plan has a record. Around and below it, from the outside in: the guard of each edit,
//! `with-param`, `owe`, `skip`, `defer`, the goal, `before`, `wrap`, `replace`, `after`.

use std::rc::Rc;

use compiler::ast::{Expr, Function};
use vm::code::{FnId, FnKind, NativeId, Params, SiteId};
use vm::edit::What;
use vm::failure::{Builtin, Failure};
use vm::key::Step;
use vm::native::{Next, type_error};
use vm::tree::{NodeKind, Status, Why};
use vm::value::{Imm, Obj, Symbol, Value};

use super::MOST_STEPS;
use super::eval::{Eval, Exit, Here, Ready, Run, Use, Way, address};
use super::forms::Part;
use super::tasks::Oracle;

/// What a call with a record runs.
#[derive(Clone, Copy)]
pub enum Body {
    Plan(FnId),
    /// What the description, its only argument, is grounded to.
    Action,
    /// A branch of a parallel form.
    Branch,
}

/// A call with a record.
#[derive(Clone)]
pub struct Call {
    /// Where it stands.
    pub here: Here,
    pub slot: usize,
    pub rec: usize,
    pub body: Body,
    /// The arguments, as edits have changed them.
    pub args: Vec<Value>,
    /// The function of a branch.
    pub code: Option<Value>,
    /// The function that says whether the goal is reached.
    pub goal: Option<Value>,
    /// Numbers of the edits that hold for it.
    pub edits: Vec<usize>,
}

/// What `(original)` runs.
#[derive(Clone)]
pub enum Original {
    /// The call with this many of its wraps.
    Wrap(Rc<Call>, usize),
    /// The body of a record with this many of its replacements.
    Layer(Rc<Call>, usize, usize),
}

impl<'p> Oracle<'_, 'p> {
    // ------------------------------------------------------------------ functions

    /// Calls a function of the program that is no plan.
    pub fn call_function(&mut self, here: &Here, expr: &'p Expr, ready: Ready<'p>, usage: Use) -> Eval<'p> {
        if usage == Use::Tail {
            // A function that owes something cannot go before it has been done.
            return match self.owes(here.function_form) {
                true => {
                    let place = self.place_of_call(here.function_form);
                    self.run_function(&Here { place, ..here.clone() }, ready)
                }
                false => Err(Exit::Tail(ready)),
            };
        }
        let site = self.site(address(expr));
        let inner = Here { way: here.way.then(Step::Call(site)), ..here.clone() };
        self.run_function(&inner, ready)
    }

    /// Runs a function and what it goes on as, on the same way and at the same place: a tail call ends the forms
    /// that it stands in.
    pub fn run_function(&mut self, here: &Here, mut ready: Ready<'p>) -> Eval<'p> {
        loop {
            let Ready { function, owner, captured, args } = ready;
            let function_form = self.run.forms_made;
            let inner = Here { function_form, owner, original: None, handled: None, ..here.clone() };
            let part = Part::Body(std::ptr::from_ref(function) as usize);
            let result = self
                .deeper(|it| it.form(&inner, part, |it, here| it.body_of(here, function, captured, args)));
            match result {
                Err(Exit::Tail(next)) => ready = next,
                result => return result,
            }
        }
    }

    /// Binds parameters and does the body.
    pub fn body_of(
        &mut self,
        here: &Here,
        function: &'p Function,
        captured: Vec<Value>,
        args: Vec<Value>,
    ) -> Eval<'p> {
        self.hash_calls(function);
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
            FnKind::Plan | FnKind::TopLevel | FnKind::Inserted | FnKind::Branch => Use::Effect,
        };
        self.body(&inner, &function.body, usage)
    }

    /// Calls a value.
    pub fn call_value(
        &mut self,
        here: &Here,
        expr: &'p Expr,
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
                self.call_plan(here, expr, *plan, ready.args, true, usage)
            }
            _ => self.call_function(here, expr, ready, usage),
        }
    }

    /// A function value with its arguments in the order of the parameters.
    pub fn ready(&mut self, here: &Here, callee: &Value, args: Vec<Value>) -> Result<Ready<'p>, Exit<'p>> {
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
        here: &Here,
        expr: &'p Expr,
        native: NativeId,
        args: Vec<Value>,
        usage: Use,
    ) -> Eval<'p> {
        match self.ask_native(here, native, &args) {
            Err(raise) => self.raise(here, raise),
            Ok(Next::Return(value)) => Ok(value),
            Ok(Next::Call { callee, args }) => self.call_value(here, expr, &callee, args, usage.no_tail()),
            Ok(Next::RunPlan { plan, args, tree, seed: None, projected: false }) => {
                self.run_plan(here, &plan, args, tree)
            }
            Ok(Next::RunPlan { .. }) => Err(Exit::GiveUp("the oracle does not rehearse".into())),
            Ok(Next::EditTree { tree, edits, .. }) => self.edit_tree(here, &tree, &edits),
            Ok(Next::Sleep(ns)) => self.sleep(here, ns),
            Ok(Next::Task(op)) => self.task_op(here, op),
            Ok(Next::Ask(_)) => Err(Exit::GiveUp("the oracle has no world to ask".into())),
            Ok(
                Next::Query { .. }
                | Next::Explain(..)
                | Next::Part(..)
                | Next::PushFacts(_)
                | Next::PushTree(_)
                | Next::PopScope,
            ) => Err(Exit::GiveUp("the oracle has no rules".into())),
            Ok(Next::WithEdits { .. }) => Err(Exit::GiveUp("the oracle has no grafts".into())),
        }
    }

    /// `(run-plan plan :args args :tree tree)`: a run of its own, with its own clock.
    fn run_plan(&mut self, here: &Here, plan: &Value, args: Vec<Value>, tree: Option<Value>) -> Eval<'p> {
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
        self.inner_runs += 1;
        let number = self.inner_runs;
        let inner = Run { number, ..Run::new(super::Tree::begin(start.as_deref())) };
        let outer = std::mem::replace(&mut self.run, inner);
        self.outer.push(outer);
        let name = self.function(id).name;
        let outcome = self.as_root(|it| {
            it.form(&Here::root(None), Part::Body(0), |it, here| {
                let slot = it.slot(here, SiteId(0), name, true, Some(id), true)?;
                it.start(here, slot, Body::Plan(id), args, None)
            })
        });
        let outer = self.outer.pop().expect("it has been put there");
        let mut inner = std::mem::replace(&mut self.run, outer);
        let (status, value) = match outcome {
            Ok(value) => (Status::Succeeded, value),
            Err(Exit::Fail(failure)) => (Status::Failed, failure),
            Err(exit) => return Err(exit),
        };
        inner.tree.end(0, status, value, inner.now);
        Ok(self.tree_value(inner.tree))
    }

    /// A tree as a value.
    pub fn tree_value(&mut self, mut tree: super::Tree) -> Value {
        tree.polish();
        let mirror = Rc::new(tree.mirror.clone());
        self.trees.push((mirror.clone(), Rc::new(tree)));
        Value::new(Obj::Tree(mirror))
    }

    /// The tree that a value is.
    pub fn tree_of(&self, value: &Value) -> Result<Rc<super::Tree>, Exit<'p>> {
        let found =
            value.as_tree().and_then(|it| self.trees.iter().find(|(mirror, _)| Rc::ptr_eq(mirror, it)));
        found
            .map(|(_, tree)| tree.clone())
            .ok_or_else(|| Exit::GiveUp("a tree that the oracle did not make".into()))
    }

    // ------------------------------------------------------------------ plans

    pub fn call_plan(
        &mut self,
        here: &Here,
        expr: &'p Expr,
        plan: FnId,
        args: Vec<Value>,
        dynamic: bool,
        usage: Use,
    ) -> Eval<'p> {
        let site = self.site(address(expr));
        let name = self.function(plan).name;
        let slot = self.slot(here, site, name, dynamic, Some(plan), usage != Use::Effect)?;
        self.deeper(|it| it.start(here, slot, Body::Plan(plan), args, None))
    }

    /// `(perform desc :goal goal)`
    pub fn perform_expr(
        &mut self,
        here: &Here,
        expr: &'p Expr,
        desc: &'p Expr,
        goal: Option<&'p Function>,
        usage: Use,
    ) -> Eval<'p> {
        let value = self.value(here, desc)?;
        let goal = goal.map(|goal| self.lambda(here, goal));
        self.burn(here)?;
        let Some(it) = value.as_desc() else {
            return self.raise(here, type_error("a description to perform", &value));
        };
        let name = it.entity_type().unwrap_or(it.kind);
        let site = self.site(address(expr));
        let slot = self.slot(here, site, name, true, None, usage != Use::Effect)?;
        self.deeper(|it| it.start(here, slot, Body::Action, vec![value.clone()], goal))
    }

    /// The slot of a call: its site, the way to it, what it calls if the source does not say, and
    /// how often the same has been called before in its record.
    pub fn slot(
        &mut self,
        here: &Here,
        site: SiteId,
        name: Symbol,
        dynamic: bool,
        plan: Option<FnId>,
        value_used: bool,
    ) -> Result<usize, Exit<'p>> {
        let mut steps = here.way.steps();
        if steps.len() > MOST_STEPS {
            return Err(Exit::GiveUp("keys are written out in full: this one is too long".into()));
        }
        if dynamic {
            steps.push(Step::Name(name));
        }
        let count = self.run.tree.records[here.rec].counts.entry((site, steps.clone())).or_insert(0);
        if *count > 0 {
            steps.push(Step::Again(*count));
        }
        *count += 1;
        let super::eval::Walker { run, site_hashes, .. } = &mut **self;
        let slot = run.tree.slot(here.rec, (site, steps), name, |site| site_hashes[site.at()]);
        let it = &mut self.run.tree.slots[slot];
        (it.place, it.plan, it.value_used) = (here.place.clone(), plan, value_used);
        let mirror = it.mirror;
        if let Some(plan) = plan {
            self.run.tree.mirror.calls(mirror, plan);
        }
        Ok(slot)
    }

    /// A call with a record, from its beginning.
    fn start(
        &mut self,
        here: &Here,
        slot: usize,
        body: Body,
        args: Vec<Value>,
        goal: Option<Value>,
    ) -> Eval<'p> {
        let kind = if matches!(body, Body::Plan(_)) { NodeKind::Plan } else { NodeKind::Action };
        let rec = self.enter(here.rec, slot, kind, args.clone());
        let (here, code, edits) = (here.clone(), None, Vec::new());
        self.begin(Call { here, slot, rec, body, args, code, goal, edits })
    }

    /// A call that has its record.
    pub fn begin(&mut self, mut call: Call) -> Eval<'p> {
        let rec = call.rec;
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
    pub fn perform(&mut self, call: &Rc<Call>) -> Eval<'p> {
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
            if let Err(exit) = self.edit_code(&call.here, call, id, None) {
                return self.call_failed(call, exit, Why::Before);
            }
        }
        let first = self.run.tree.slots[call.slot].records[0];
        // Branches keep their place among each other.
        let is_branch = matches!(call.body, Body::Branch);
        if first == call.rec
            && !is_branch
            && !self.edits_of(call, |what| matches!(what, What::Before(_))).is_empty()
        {
            self.run.tree.begins(call.slot);
        }
        let wraps = self.edits_of(call, |what| matches!(what, What::Wrap(_))).len();
        match self.wrapped(call, wraps, call.here.rec) {
            Ok(value) => {
                if !self.run.tree.records[call.rec].status.is_final() {
                    self.end_skipped(call.rec, Why::Edit, value.clone());
                }
                self.afters(call, value)
            }
            Err(exit) => self.call_failed(call, exit, Why::Nothing),
        }
    }

    fn afters(&mut self, call: &Rc<Call>, value: Value) -> Eval<'p> {
        for id in self.edits_of(call, |what| matches!(what, What::After(_))) {
            self.edit_code(&call.here, call, id, None)?;
        }
        Ok(value)
    }

    fn end_skipped(&mut self, rec: usize, why: Why, value: Value) {
        self.run.tree.records[rec].why = why;
        self.end_record(rec, Status::Skipped, value);
    }

    /// A failure leaves a call whose body has not ended it.
    fn call_failed(&mut self, call: &Call, exit: Exit<'p>, why: Why) -> Eval<'p> {
        if !self.run.tree.records[call.rec].status.is_final() {
            if !matches!(exit, Exit::GiveUp(_) | Exit::Refused(_)) {
                self.run.tree.records[call.rec].why = why;
            }
            self.left_by(call.rec, &exit);
        }
        Err(exit)
    }

    pub fn ask_goal(&mut self, here: &Here, goal: &Value) -> Result<bool, Exit<'p>> {
        let ready = self.ready(here, goal, Vec::new())?;
        Ok(self.run_function(here, ready)?.holds())
    }

    // ------------------------------------------------------------------ wraps and bodies

    /// Numbers of the edits of one kind that hold for a call, in the order of their making.
    pub fn edits_of(&self, call: &Call, wanted: impl Fn(&What) -> bool) -> Vec<usize> {
        call.edits.iter().copied().filter(|id| wanted(&self.run.tree.edits[*id].edit.what)).collect()
    }

    /// The code of an edit, beside a call or in its node.
    fn edit_code(&mut self, here: &Here, call: &Call, id: usize, original: Option<Original>) -> Eval<'p> {
        let (owner, function) = self.run.tree.edits[id].code.expect("this edit has code");
        let way = Way::default().then(Step::Edit(id as u32 + 1));
        let here = Here { way, original, owner: Some(owner), handled: None, ..here.clone() };
        let args = call.args.clone();
        self.deeper(|it| {
            it.form(&here, Part::Code(id), |it, here| it.body_of(here, function, Vec::new(), args))
        })
    }

    /// A call with its first `n` wraps around it; the last of them is the outermost. Their code belongs to
    /// the record `rec`: that of the call, or of a branch in an outer wrap.
    fn wrapped(&mut self, call: &Rc<Call>, n: usize, rec: usize) -> Eval<'p> {
        let Some(inner) = n.checked_sub(1) else { return self.attempt(call) };
        let wraps = self.edits_of(call, |what| matches!(what, What::Wrap(_)));
        let here = Here { rec, ..call.here.clone() };
        self.edit_code(&here, call, wraps[inner], Some(Original::Wrap(call.clone(), inner)))
    }

    /// `(original)`
    pub fn original(&mut self, here: &Here) -> Eval<'p> {
        match here.original.clone() {
            Some(Original::Wrap(call, n)) => self.wrapped(&call, n, here.rec),
            Some(Original::Layer(call, rec, n)) => self.layer(&call, rec, n),
            None => {
                self.raise(here, Box::new(Failure::new(Builtin::ProgramError, "there is no original here")))
            }
        }
    }

    /// Runs the body: the first time in the record of the call, then in new attempts.
    fn attempt(&mut self, call: &Rc<Call>) -> Eval<'p> {
        let mut rec = call.rec;
        if self.run.tree.records[rec].status.is_final() {
            let first = self.run.tree.records[rec].clone();
            let (written, args) = (first.written.clone(), call.args.clone());
            let entered = written.as_ref().unwrap_or(&args).clone();
            let now = self.run.now;
            rec = self.run.tree.enter(call.here.rec, call.slot, first.kind, entered, now);
            let it = &mut self.run.tree.records[rec];
            (it.args, it.written, it.performed_in) = (args, written, first.performed_in);
        }
        let replaces = self.edits_of(call, |what| matches!(what, What::Replace(_))).len();
        self.stacks.bodies.push((rec, call.clone()));
        let result = self.layer(call, rec, replaces);
        self.stacks.bodies.pop();
        let result = result.and_then(|value| self.check_goal(call, rec).map(|()| value));
        match &result {
            Ok(value) => self.end_record(rec, Status::Succeeded, value.clone()),
            Err(exit) => self.left_by(rec, exit),
        }
        result
    }

    fn check_goal(&mut self, call: &Call, rec: usize) -> Result<(), Exit<'p>> {
        let Some(goal) = call.goal.as_ref().filter(|_| !self.run.tree.records[rec].moved) else {
            return Ok(());
        };
        let here = self.at_node(call, rec);
        if self.ask_goal(&here, goal)? { Ok(()) } else { self.goal_not_reached(&here, call.slot) }
    }

    pub fn goal_not_reached<T>(&mut self, here: &Here, slot: usize) -> Result<T, Exit<'p>> {
        let path = self.run.tree.path(slot);
        let message = format!("the goal of {} is not true after it", path.show());
        let fields = vec![("message", Value::str(message)), ("of", Value::new(Obj::Path(Box::new(path))))];
        self.raise(here, Box::new(Failure::with(Builtin::GoalNotReached, fields)))
    }

    /// Where the node of a record stands; what runs in it begins a way of its own.
    fn at_node(&self, call: &Call, rec: usize) -> Here {
        let place = self.run.tree.slots[call.slot].place.clone();
        Here {
            rec,
            way: Way::default(),
            place,
            original: None,
            owner: None,
            handled: None,
            ..call.here.clone()
        }
    }

    /// The body of a record with the first `n` replacements; the last of them counts.
    fn layer(&mut self, call: &Rc<Call>, rec: usize, n: usize) -> Eval<'p> {
        let here = self.at_node(call, rec);
        self.form(&here, Part::Node(call.slot), |it, here| {
            if let Some(inner) = n.checked_sub(1) {
                let replaces = it.edits_of(call, |what| matches!(what, What::Replace(_)));
                return it.edit_code(
                    here,
                    call,
                    replaces[inner],
                    Some(Original::Layer(call.clone(), rec, inner)),
                );
            }
            let ready = match call.body {
                Body::Branch => return it.branch_code(here, call),
                Body::Plan(id) => {
                    let args = call.args.clone();
                    Ready { function: it.function(id), owner: it.owner(id), captured: Vec::new(), args }
                }
                Body::Action => it.ground(here, &call.args[0])?,
            };
            it.run_function(here, ready)
        })
    }

    /// A branch without edits: its code in its record.
    pub fn branch_body(&mut self, call: &Call, rec: usize) -> Eval<'p> {
        let here = Here { original: call.here.original.clone(), ..self.at_node(call, rec) };
        self.form(&here, Part::Node(call.slot), |it, here| it.branch_code(here, call))
    }

    fn branch_code(&mut self, here: &Here, call: &Call) -> Eval<'p> {
        let code = call.code.as_ref().expect("a branch has a function");
        let Ready { function, owner, captured, .. } = self.ready(here, code, call.args.clone())?;
        let here = Here { function_form: self.run.forms_made, owner, ..here.clone() };
        self.deeper(|it| it.body_of(&here, function, captured, call.args.clone()))
    }

    /// What a description is performed by: a plan and its arguments.
    fn ground(&mut self, here: &Here, desc: &Value) -> Result<Ready<'p>, Exit<'p>> {
        let answer = match self.world.program().ground {
            None => Value::NIL,
            Some(ground) => {
                let ready = self.ready(here, &Value::Imm(Imm::Function(ground)), vec![desc.clone()])?;
                self.run_function(here, ready)?
            }
        };
        if answer.is_nil() {
            let message = format!("no rule says which plan performs {}", vm::print::brief(desc));
            let fields =
                vec![("message", Value::str(message)), ("action", desc.clone()), ("nearest", Value::NIL)];
            return self.raise(here, Box::new(Failure::with(Builtin::ActionNotGrounded, fields)));
        }
        let parts = answer.to_vec().unwrap_or_default();
        let [plan, args @ ..] = parts.as_slice() else {
            return self.raise(
                here,
                type_error("a list of a plan and its arguments as what an action is grounded to", &answer),
            );
        };
        self.run.tree.records[here.rec].grounded = Some(answer.clone());
        self.ready(here, plan, args.to_vec())
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
