//! Drivers: calls that take several steps.
//!
//! A plan call without goal, and without edits or with those that only change parameters, is one frame. A
//! performed description has to be grounded and may have a goal; edits put code before, after, around or
//! instead of a call. Such a call has a [`Driver`], as parallel forms and obligations have, that says which step
//! is next, and a frame whose program counter is [`RESUME`]: when what it called returns there,
//! [`Machine::resume`] takes the next step.
//!
//! ```text
//!   goal true? ─yes─▶ skipped          wraps ─▶ body (replace ─▶ … ─▶ ground ─▶ plan)
//!       │no                              ▲              │
//!       ▼                                │              ▼
//!    befores ────────────────────────────┘     goal true? ─▶ afters ─▶ value
//! ```

use crate::code::{FnId, FnKind, SiteId};
use crate::edit::What;
use crate::failure::{Builtin, Failure};
use crate::host::Host;
use crate::native::{Raise, type_error};
use crate::path::Path;
use crate::rules::Ask;
use crate::tree::{ATTEMPTED, COUNTED, DRIVEN, MOVED, NodeKind, RecId, SlotId, Status, Tree, Why};
use crate::value::{Imm, Obj, Symbol, Value};

use super::call::Slow;
use super::edited::Edited;
use super::fork::Fork;
use super::obligation::Discharge;
use super::solve::Solve;
use super::{Exit, Frame, Here, Machine, RESUME, Run};

/// What `run-plan` is asked to run.
pub(super) struct Order {
    pub plan: Value,
    pub args: Vec<Value>,
    pub tree: Option<Value>,
    pub seed: Option<u64>,
    pub projected: bool,
}

/// A call that takes several steps.
#[derive(Clone)]
pub(super) struct Call {
    pub slot: SlotId,
    /// The record that it is called from.
    pub parent: RecId,
    /// What is called.
    pub body: Body,
    /// The arguments, as edits have changed them.
    pub args: Vec<Value>,
    /// A function that says whether the goal is reached.
    pub goal: Option<Value>,
    /// Numbers of the edits that hold for this call.
    pub edits: Vec<u32>,
    /// Its record, once it has been made.
    pub rec: RecId,
    /// What the call returned.
    value: Value,
    stage: Stage,
}

/// What a call runs.
#[derive(Clone, Copy)]
pub(super) enum Body {
    /// This plan.
    Plan(FnId),
    /// What the description, its only argument, is grounded to.
    Action,
    /// A branch of a parallel form: its function, with arguments and what that captured.
    Branch(FnId),
}

/// What a call waits for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    GoalBefore,
    /// The code of the `n`-th `before`.
    Before(usize),
    /// The body, or the code of a `wrap`.
    Around,
    /// The code of the `n`-th `after`.
    After(usize),
}

/// What waits in a frame that goes on at [`RESUME`].
pub(super) enum Driver {
    /// A call.
    Call(Box<Call>),
    /// The code of a `wrap`: `(original)` in it runs the wrap with the next smaller number.
    Wrap(usize),
    /// The body of a record.
    Body(Layer),
    /// Something that was owed.
    Discharge(Box<Discharge>),
    /// A parallel form.
    Fork(Box<Fork>),
    /// A query.
    Solve(Box<Solve>),
    /// `(original)` in a branch of inserted code: the call that this belongs to, of a task above.
    Origin(Box<Call>),
}

/// What `(original)` is in inserted code, for the branches that this begins.
#[derive(Clone)]
pub(super) struct Origin {
    call: Box<Call>,
    code: InsertedCode,
}

/// Code of an edit that runs.
#[derive(Clone, Copy)]
enum InsertedCode {
    /// That of the `n`-th wrap.
    Wrap(usize),
    /// That of the `n`-th replace, as the body of a record.
    Replace(usize, RecId),
}

impl Run {
    /// What `(original)` is in the running code.
    pub(super) fn origin(&self) -> Option<Origin> {
        let code = match self.drivers.last() {
            Some(Driver::Wrap(n)) => InsertedCode::Wrap(*n),
            Some(Driver::Body(Layer { number, rec, .. })) if *number > 0 => {
                InsertedCode::Replace(*number, *rec)
            }
            None => return self.fork_of(self.tasks.loaded)?.origin.as_deref().cloned(),
            _ => return None,
        };
        let call = self.drivers.iter().rev().find_map(|driver| match driver {
            Driver::Call(call) | Driver::Origin(call) => Some(call.clone()),
            _ => None,
        });
        Some(Origin { call: call?, code })
    }
}

/// One layer of the body of a record.
pub(super) struct Layer {
    /// `0` for the plan itself, else the code of the `n`-th `replace`.
    number: usize,
    pub(super) rec: RecId,
    /// True for the outermost layer: it checks the goal and ends the record.
    pub(super) outermost: bool,
    phase: Phase,
}

/// What a layer of a body waits for.
enum Phase {
    /// Rules have been asked what to run.
    Rules,
    /// `ground` has been asked.
    Ground,
    /// The code runs.
    Run,
    /// The goal is being checked; then this is the value.
    Goal(Value),
}

impl Call {
    pub(super) fn of_plan(slot: SlotId, parent: RecId, plan: FnId, args: Vec<Value>) -> Call {
        Call {
            slot,
            parent,
            body: Body::Plan(plan),
            args,
            goal: None,
            edits: Vec::new(),
            rec: RecId(0),
            value: Value::NIL,
            stage: Stage::GoalBefore,
        }
    }

    pub(super) fn of_branch(slot: SlotId, parent: RecId, function: FnId, values: Vec<Value>) -> Call {
        Call { body: Body::Branch(function), ..Call::of_plan(slot, parent, function, values) }
    }

    /// The same call from its start, as record `rec`.
    pub(super) fn again(&self, rec: RecId) -> Call {
        Call { rec, stage: Stage::GoalBefore, value: Value::NIL, ..self.clone() }
    }
}

impl Machine {
    // ------------------------------------------------------------------ starting

    /// `(perform desc :goal goal)`
    pub(super) fn perform(
        &mut self,
        host: &mut dyn Host,
        d: u8,
        site: SiteId,
        desc: Value,
        goal: Option<Value>,
    ) -> Slow {
        let Some(it) = desc.as_desc() else { return Err(type_error("a description to perform", &desc)) };
        let name = it.entity_type().unwrap_or(it.kind);
        let own = it.get(Symbol::from("goal")).filter(|goal| goal.as_pair().is_some());
        let goal = goal.or_else(|| own.cloned());
        let slot = self.slot_of_call(site, name);
        let run = self.top();
        let parent = run.record(run.here);
        let call = Call { body: Body::Action, goal, ..Call::of_plan(slot, parent, FnId(0), vec![desc]) };
        self.drive(host, d, call)
    }

    /// `(run-plan plan :args args :tree tree)`: a run of its own on top of this one.
    pub(super) fn run_plan(&mut self, host: &mut dyn Host, d: u8, order: Order) -> Slow {
        let Order { plan, args, tree, seed, projected } = order;
        let function = match plan {
            Value::Imm(Imm::Function(function))
                if self.program.functions[function.at()].kind == FnKind::Plan =>
            {
                function
            }
            _ => return Err(type_error("a plan", &plan)),
        };
        let args = self.arrange(function, args)?;
        let start = match &tree {
            Some(tree) => tree.as_tree().ok_or_else(|| type_error("a tree", tree))?.for_next_run(),
            None => Tree::default(),
        };
        if self.runs.len() >= MOST_RUNS {
            return Err(self.over(Builtin::TooDeep, "run-plan is nested deeper than", MOST_RUNS, "runs"));
        }
        let below = self.top();
        below.raised.name(&below.tree);
        let deliver = below.base as usize + d as usize;
        self.inner_runs += 1;
        let (seed, projected) = (seed.unwrap_or(self.top().seed), projected || self.top().projected);
        let mut run = Run::new(start, !self.breaks.is_empty(), seed);
        run.projected = projected;
        run.before = projected.then(Default::default);
        run.number = self.inner_runs;
        run.deliver = deliver;
        run.world = self.top().world.as_ref().map(|world| world.fork());
        if let Some(world) = run.world.as_mut().filter(|_| projected) {
            world.project();
        }
        // The plan returns to a frame without instructions: its value ends the run.
        run.pc = RESUME;
        self.runs.push(Box::new(run));
        let name = self.program.functions[function.at()].name;
        let slot = self.slot_of_call(SiteId(0), name);
        self.top().tree.calls(slot, function);
        match self.drive(host, 0, Call::of_plan(slot, RecId(1), function, args)) {
            Ok(exit) => Ok(exit.or(Some(Exit::Began))),
            Err(raise) => Ok(self.unwind(host, raise).or(Some(Exit::Began))),
        }
    }

    /// Starts a call that may take several steps: makes its record, applies its edits.
    pub(super) fn drive(&mut self, host: &mut dyn Host, d: u8, mut call: Call) -> Slow {
        if call.rec == RecId(0) {
            call.rec = self.record_of_call(host, &call);
        }
        let run = self.top();
        run.frames.push(Frame { pc: run.pc, base: run.base, here: run.here, dst: d });
        // The driver's frame: register 0 takes what it called returns.
        let above = self.driver_base();
        let run = self.top();
        (run.pc, run.base) = (RESUME, above);
        let rec = call.rec;
        self.apply_edits(&mut call);
        self.owe_all(&call);
        if let Some(skip) = self.find_edits(&call, |what| matches!(what, What::Skip(_))).last() {
            let value = match &self.edit(*skip).what {
                What::Skip(Some(value)) => value.clone(),
                _ => Value::NIL,
            };
            self.skip(host, rec, Why::Edit, value.clone());
            return self.return_value(value);
        }
        let put_off = self.find_edits(&call, |what| matches!(what, What::Defer(_)));
        let call = match put_off.is_empty() {
            true => Box::new(call),
            false => match self.put_off(host, call) {
                Ok(()) => return self.return_value(Value::NIL),
                Err(call) => call,
            },
        };
        self.begin(host, call)
    }

    /// The record of a call that is made.
    pub(super) fn record_of_call(&mut self, host: &mut dyn Host, call: &Call) -> RecId {
        let (kind, shown) = match call.body {
            Body::Plan(_) => (NodeKind::Plan, &call.args[..]),
            Body::Action => (NodeKind::Action, &call.args[..]),
            // What it captured is nobody's business.
            Body::Branch(_) => (NodeKind::Branch, &[][..]),
        };
        let run = self.top();
        let rec = run.tree.enter(call.parent, call.slot, kind, shown, run.now);
        run.tree.record_mut(rec).flags |= DRIVEN;
        run.note_late(rec);
        self.trace_start(host, rec);
        rec
    }

    /// Performs a call that has a record, in a driver's frame of its own.
    pub(super) fn perform_again(&mut self, host: &mut dyn Host, call: Call) -> Slow {
        let above = self.driver_base();
        let run = self.top();
        run.frames.push(Frame { pc: RESUME, base: run.base, here: run.here, dst: 0 });
        // Its goal is a question of the task that made the call; so is what edits put beside it, whose calls
        // are looked at one by one.
        (run.base, run.here) = (above, Here(call.parent.0));
        run.tree.record_mut(call.parent).flags |= COUNTED;
        self.begin(host, Box::new(call))
    }

    /// The first step of a call: is its goal true already?
    fn begin(&mut self, host: &mut dyn Host, mut call: Box<Call>) -> Slow {
        match call.goal.clone() {
            Some(goal) => {
                self.top().drivers.push(Driver::Call(call));
                self.ask_goal(host, &goal)
            }
            None => {
                call.stage = Stage::Before(0);
                self.next_step(host, call)
            }
        }
    }

    /// The base of a driver's frame: above the frame that it is called from.
    pub(super) fn driver_base(&mut self) -> u32 {
        let run = &self.runs[self.runs.len() - 1];
        let used = match run.pc {
            RESUME => 1,
            pc => {
                let function = self.program.function_at(super::Pc(pc.saturating_sub(1)));
                function.map_or(1, |it| self.program.functions[it.at()].registers)
            }
        };
        let base = run.base + u32::from(used);
        let run = self.top();
        if run.stack.len() < base as usize + 512 {
            let len = run.stack.len() * 2;
            run.stack.resize(len, Value::NIL);
        }
        base
    }

    /// Keeps the edits whose guards hold, and changes parameters as they say.
    fn apply_edits(&mut self, call: &mut Call) {
        let run = &self.runs[self.runs.len() - 1];
        let edited = Edited { program: &self.program, tree: &run.tree, slot: call.slot, body: call.body };
        let mut args = call.args.clone();
        let mut notes = Vec::new();
        for (id, accepted) in edited.edits() {
            match edited.problem(accepted, &call.args) {
                None => {
                    call.edits.push(id);
                    edited.change_param(&accepted.edit, &mut args);
                }
                Some(problem) => notes.push(problem),
            }
        }
        let changed = call.args.iter().zip(&args).any(|(a, b)| !a.identical(b));
        call.args = args;
        let counted = call.edits.iter().any(|id| matches!(self.edit(*id).what, What::Replace(_)));
        let run = self.top();
        if changed {
            run.tree.change_args(call.rec, &call.args);
        }
        if counted {
            run.tree.record_mut(call.rec).flags |= COUNTED;
        }
        if !notes.is_empty() {
            run.tree.extra_mut(call.rec).notes.extend(notes);
        }
    }

    fn edit(&self, id: u32) -> &crate::edit::Edit {
        &self.runs[self.runs.len() - 1].tree.edits[id as usize - 1].edit
    }

    fn find_edits(&self, call: &Call, wanted: impl Fn(&What) -> bool) -> Vec<u32> {
        call.edits.iter().copied().filter(|id| wanted(&self.edit(*id).what)).collect()
    }

    // ------------------------------------------------------------------ going on

    /// What a driver called has returned.
    pub(super) fn resume(&mut self, host: &mut dyn Host, value: Value) -> Slow {
        // The program counter stands behind the Resume instruction: the frame is a driver's.
        self.top().pc = RESUME;
        match self.top().drivers.pop() {
            Some(Driver::Call(call)) => self.call_resumed(host, call, value),
            Some(Driver::Wrap(_) | Driver::Origin(_)) => self.return_value(value),
            Some(Driver::Body(layer)) => self.body_resumed(host, layer, value),
            Some(Driver::Discharge(discharge)) => self.discharge_resumed(host, discharge, value),
            Some(Driver::Fork(fork)) => self.fork_resumed(host, fork),
            // It needs fuel: the loop gives it some.
            Some(Driver::Solve(_)) => Ok(None),
            None => Ok(Some(Exit::Done(value))),
        }
    }

    fn call_resumed(&mut self, host: &mut dyn Host, mut call: Box<Call>, value: Value) -> Slow {
        call.stage = match call.stage {
            Stage::GoalBefore if value.holds() => {
                self.skip(host, call.rec, Why::Goal, Value::NIL);
                Stage::After(0)
            }
            Stage::GoalBefore => Stage::Before(0),
            Stage::Before(n) => Stage::Before(n + 1),
            Stage::Around => {
                if !self.top().tree.record(call.rec).status.is_final() {
                    self.skip(host, call.rec, Why::Edit, value.clone());
                }
                call.value = value;
                Stage::After(0)
            }
            Stage::After(n) => Stage::After(n + 1),
        };
        self.next_step(host, call)
    }

    fn body_resumed(&mut self, host: &mut dyn Host, mut layer: Layer, value: Value) -> Slow {
        let goal = self.calling().and_then(|call| call.goal.clone()).filter(|_| layer.outermost);
        let rec = layer.rec;
        // The check has moved to what was put off.
        let goal = goal.filter(|_| self.top().tree.record(rec).flags & MOVED == 0);
        match (layer.phase, goal) {
            // What no rule says may be known to `ground`.
            (Phase::Rules, _) if value.is_nil() => {
                layer.phase = Phase::Ground;
                self.top().drivers.push(Driver::Body(layer));
                self.ask_ground(host, rec)
            }
            (Phase::Ground | Phase::Rules, _) => {
                layer.phase = Phase::Run;
                self.top().drivers.push(Driver::Body(layer));
                self.run_grounded(host, rec, &value)
            }
            (Phase::Run, Some(goal)) => {
                layer.phase = Phase::Goal(value);
                self.top().drivers.push(Driver::Body(layer));
                self.ask_goal(host, &goal)
            }
            (Phase::Run, None) => {
                if layer.outermost {
                    self.end_record(host, rec, Status::Succeeded, value.clone());
                }
                self.return_value(value)
            }
            (Phase::Goal(result), _) if value.holds() => {
                self.end_record(host, rec, Status::Succeeded, result.clone());
                self.return_value(result)
            }
            (Phase::Goal(_), _) => {
                layer.phase = Phase::Run;
                self.top().drivers.push(Driver::Body(layer));
                Err(self.goal_not_reached(rec))
            }
        }
    }

    /// Starts the code of the stage that a call has come to, or returns from the call.
    fn next_step(&mut self, host: &mut dyn Host, mut call: Box<Call>) -> Slow {
        if let Stage::Before(n) = call.stage {
            let befores = self.find_edits(&call, |what| matches!(what, What::Before(_)));
            if let Some(id) = befores.get(n) {
                return self.run_edit(call, *id);
            }
            call.stage = Stage::Around;
            // Branches keep their place among each other.
            let is_branch = matches!(call.body, Body::Branch(_));
            if !befores.is_empty() && !is_branch && self.top().tree.record(call.rec).attempt == 1 {
                self.top().tree.begins(call.slot);
            }
            let (wraps, rec) = (self.find_edits(&call, |what| matches!(what, What::Wrap(_))).len(), call.rec);
            self.top().drivers.push(Driver::Call(call));
            return if wraps > 0 { self.run_wrap(wraps, 0) } else { self.run_body(host, rec, None, 0) };
        }
        if let Stage::After(n) = call.stage {
            let afters = self.find_edits(&call, |what| matches!(what, What::After(_)));
            if let Some(id) = afters.get(n) {
                return self.run_edit(call, *id);
            }
        }
        self.return_value(call.value)
    }

    /// Runs the code of an edit beside the call; the call waits for it.
    fn run_edit(&mut self, call: Box<Call>, id: u32) -> Slow {
        let (code, args) = (self.code_of(id), call.args.clone());
        self.top().drivers.push(Driver::Call(call));
        self.enter_code(code, args)
    }

    fn enter_code(&mut self, code: Option<FnId>, args: Vec<Value>) -> Slow {
        let code =
            code.ok_or_else(|| Box::new(Failure::new(Builtin::ProgramError, "the edit has no code")))?;
        self.enter(0, code, args, &[]);
        Ok(None)
    }

    /// Whether a goal is reached: a function says that, or, for the property of an action, rules.
    pub(super) fn ask_goal(&mut self, host: &mut dyn Host, goal: &Value) -> Slow {
        match self.program.rules.goal {
            Some(predicate) if goal.is_list() => {
                self.ask(0, predicate, std::slice::from_ref(goal), Ask::Whether)
            }
            _ => self.call_value(host, 0, SiteId(0), goal, Vec::new()),
        }
    }

    fn goal_not_reached(&self, rec: RecId) -> Raise {
        let run = &self.runs[self.runs.len() - 1];
        let path = Path::of(&run.tree, run.tree.record(rec).slot);
        let message = format!("the goal of {} is not true after it", path.show());
        let fields = vec![("message", Value::str(message)), ("of", Value::new(Obj::Path(Box::new(path))))];
        Box::new(Failure::with(Builtin::GoalNotReached, fields))
    }

    /// Makes the record of a call final that is not run.
    fn skip(&mut self, host: &mut dyn Host, rec: RecId, why: Why, value: Value) {
        self.top().tree.record_mut(rec).why = why;
        self.end_record(host, rec, Status::Skipped, value);
    }

    // ------------------------------------------------------------------ bodies and wraps

    /// The call that the innermost drivers work for.
    fn calling(&self) -> Option<&Call> {
        self.runs[self.runs.len() - 1].drivers.iter().rev().find_map(|driver| match driver {
            Driver::Call(call) | Driver::Origin(call) => Some(&**call),
            _ => None,
        })
    }

    /// Pushes a driver with a frame of its own; it returns to register `d` of the running frame.
    pub(super) fn push_driver(&mut self, driver: Driver, d: u8) {
        let above = self.driver_base();
        let run = self.top();
        run.frames.push(Frame { pc: run.pc, base: run.base, here: run.here, dst: d });
        (run.pc, run.base) = (RESUME, above);
        run.drivers.push(driver);
    }

    /// Runs the code of wrap number `n`, counted from 1, the last being the outermost.
    fn run_wrap(&mut self, n: usize, d: u8) -> Slow {
        let Some(call) = self.calling() else { return Ok(None) };
        let id = self.find_edits(call, |what| matches!(what, What::Wrap(_)))[n - 1];
        let (code, args) = (self.code_of(id), call.args.clone());
        self.push_driver(Driver::Wrap(n), d);
        self.enter_code(code, args)
    }

    fn code_of(&self, edit: u32) -> Option<FnId> {
        self.runs[self.runs.len() - 1].tree.edits[edit as usize - 1].code
    }

    /// Runs the body of a call as record `rec`: all layers, or those from `inner` down.
    fn run_body(&mut self, host: &mut dyn Host, rec: RecId, inner: Option<usize>, d: u8) -> Slow {
        let Some(call) = self.calling() else { return Ok(None) };
        let replaces = self.find_edits(call, |what| matches!(what, What::Replace(_)));
        let number = inner.unwrap_or(replaces.len());
        let (body, args) = (call.body, call.args.clone());
        let rules = self.program.rules.grounding;
        let phase = match body {
            Body::Action if number == 0 && rules.is_some() => Phase::Rules,
            Body::Action if number == 0 => Phase::Ground,
            _ => Phase::Run,
        };
        let layer = Layer { number, rec, outermost: inner.is_none(), phase };
        self.push_driver(Driver::Body(layer), d);
        self.top().here = Here(rec.0);
        match (number.checked_sub(1), body) {
            (Some(at), _) => self.enter_code(self.code_of(replaces[at]), args),
            (None, Body::Plan(plan) | Body::Branch(plan)) => self.enter_code(Some(plan), args),
            (None, Body::Action) => match rules {
                Some(predicate) => self.ask_first(0, predicate, &args),
                None => self.ask_ground(host, rec),
            },
        }
    }

    /// Asks the function `ground` what to run.
    fn ask_ground(&mut self, host: &mut dyn Host, rec: RecId) -> Slow {
        let desc = self.top().tree.args(rec);
        match self.program.ground {
            Some(ground) => self.call_value(host, 0, SiteId(0), &Value::Imm(Imm::Function(ground)), desc),
            None => Err(self.not_grounded(desc.first().unwrap_or(&Value::NIL))),
        }
    }

    /// Rules or `ground` have answered: nil, or a list of a plan and its arguments.
    fn run_grounded(&mut self, host: &mut dyn Host, rec: RecId, answer: &Value) -> Slow {
        let desc = self.top().tree.args(rec).first().cloned().unwrap_or_default();
        if answer.is_nil() {
            return Err(self.not_grounded(&desc));
        }
        let wanted =
            || type_error("a list of a plan and its arguments as what an action is grounded to", answer);
        let (plan, args) = answer.as_pair().ok_or_else(wanted)?;
        let args = args.to_vec().ok_or_else(wanted)?;
        self.top().tree.extra_mut(rec).grounded = Some(answer.clone());
        match plan {
            Value::Imm(Imm::Function(function)) => {
                let args = self.arrange(*function, args)?;
                self.enter_code(Some(*function), args)
            }
            _ => self.call_value(host, 0, SiteId(0), plan, args),
        }
    }

    /// The failure of an action that nothing grounds, with the rules that are nearest to it.
    fn not_grounded(&self, desc: &Value) -> Raise {
        let nearest = crate::rules::nearest::to_action(&self.program, desc);
        let mut message = format!("no rule says which plan performs {}", crate::print::brief(desc));
        for line in &nearest {
            message += &format!("; {line}");
        }
        let fields = vec![
            ("message", Value::str(message)),
            ("action", desc.clone()),
            (
                "nearest",
                Value::list(nearest.iter().map(|line| Value::str(line.as_str())).collect::<Vec<_>>()),
            ),
        ];
        Box::new(Failure::with(Builtin::ActionNotGrounded, fields))
    }

    /// `(original)` in the code of a `wrap` or `replace`.
    pub(super) fn original(&mut self, host: &mut dyn Host, d: u8) -> Slow {
        let Some(origin) = self.top().origin() else {
            return Err(Box::new(Failure::new(Builtin::ProgramError, "there is no original here")));
        };
        if self.calling().is_some() {
            return self.run_original(host, origin.code, d);
        }
        // In a branch the call is that of a task above.
        self.push_driver(Driver::Origin(origin.call), d);
        self.run_original(host, origin.code, 0)
    }

    fn run_original(&mut self, host: &mut dyn Host, code: InsertedCode, d: u8) -> Slow {
        match code {
            InsertedCode::Wrap(n) if n > 1 => self.run_wrap(n - 1, d),
            InsertedCode::Wrap(_) => {
                let rec = self.attempt();
                self.run_body(host, rec, None, d)
            }
            InsertedCode::Replace(number, rec) => self.run_body(host, rec, Some(number - 1), d),
        }
    }

    /// The record for one evaluation of `(original)` in a wrap: the call's own, then new attempts.
    fn attempt(&mut self) -> RecId {
        let Some(call) = self.calling() else { return RecId(0) };
        let rec = call.rec;
        let run = self.top();
        let record = run.tree.record_mut(rec);
        if !record.status.is_final() && record.flags & ATTEMPTED == 0 {
            record.flags |= ATTEMPTED;
            return rec;
        }
        run.tree.enter_again(rec, run.now)
    }

    // ------------------------------------------------------------------ failing

    /// A failure has come to a driver's frame. Gives it back, perhaps changed.
    pub(super) fn driver_failed(&mut self, host: &mut dyn Host, failure: Value) -> Result<(), Value> {
        match self.top().drivers.pop() {
            Some(Driver::Call(call)) => {
                if !self.top().tree.record(call.rec).status.is_final() {
                    if let Stage::Before(_) = call.stage {
                        self.top().tree.record_mut(call.rec).why = Why::Before;
                    }
                    self.fail_record(host, call.rec, &failure);
                }
            }
            Some(Driver::Body(Layer { rec, outermost: true, .. })) => {
                self.fail_record(host, rec, &failure);
            }
            Some(Driver::Discharge(discharge)) => return self.discharge_failed(host, discharge, failure),
            Some(Driver::Fork(fork)) => return self.fork_failed(fork, failure),
            Some(Driver::Solve(solve)) => self.solve_failed(*solve, &failure),
            Some(Driver::Body(_) | Driver::Wrap(_) | Driver::Origin(_)) | None => {}
        }
        Err(failure)
    }
}

/// How deep `run-plan` may nest.
const MOST_RUNS: usize = 100;
