//! Calls that need more than a frame: of natives, of values, with parameters to be arranged, and
//! of plans whose key is not plain to see.

use crate::code::{FnId, FnKind, NativeId, Params, Pc, RoundKey, Site, SiteId};
use crate::desc::Desc;
use crate::failure::{Builtin, Failure, TypeId};
use crate::host::Host;
use crate::key::{Chain, Key, Ranks, Step};
use crate::native::{Effect, Next, Raise, map_key, type_error};
use crate::op::{Count, Op};
use crate::tree::{NodeKind, RecId, SlotId, Status};
use crate::value::{Imm, Obj, Symbol, Value, live};

use super::drive::{Body, Call, Driver};
use super::edited::Edited;
use super::{Ctx, CtxParts, Exit, Frame, Here, MEMO, Machine, RESUME, Run, hot};

/// The site of calls that stand in no source: the plan of `run-plan`.
pub(super) fn root_site() -> Site {
    Site {
        owner: FnId(0),
        pc: Pc(0),
        callee: None,
        name: Symbol::from("run-plan"),
        args: 0,
        hash: 0,
        form: 0,
        rounds: Box::new([]),
        counted: false,
        value_used: true,
    }
}

/// Bytes that make a call of a native a large one.
const LARGE: usize = 1 << 16;

/// What an instruction of the slow kind leads to.
pub(super) type Slow = Result<Option<Exit>, Raise>;

impl Machine {
    /// Runs the topmost run until it ends, asks, or has used `left` units of fuel.
    pub(super) fn run_for(&mut self, host: &mut dyn Host, left: &mut u64) -> Exit {
        loop {
            let Machine { program, globals, runs, limits, .. } = self;
            let Some(run) = runs.last_mut() else { return Exit::Done(Value::NIL) };
            let owes = !run.obligations.is_empty() || !run.handling.is_empty();
            let out = match owes {
                false => hot::run::<false>(program, globals, run, limits.depth, left),
                true => hot::run::<true>(program, globals, run, limits.depth, left),
            };
            let raise = match out {
                hot::Out::Due => match self.perform_due(host) {
                    Ok(None) => continue,
                    Ok(Some(exit)) => return exit,
                    Err(raise) => raise,
                },
                hot::Out::Slow(op) | hot::Out::Edited(op, _) => {
                    let done = match out {
                        hot::Out::Edited(_, slot) => self.call_edited(host, op, slot),
                        _ => self.slow(host, op, left),
                    };
                    if self.beside > 0 {
                        self.count_beside(left);
                    }
                    match done {
                        Ok(None) if self.broke.is_some() => return Exit::Began,
                        Ok(None) => continue,
                        Ok(Some(exit)) => return exit,
                        Err(raise) => raise,
                    }
                }
                hot::Out::Done(value) => return Exit::Done(value),
                hot::Out::Fuel => return Exit::Fuel,
                hot::Out::Raise(raise) => raise,
                hot::Out::TooDeep => {
                    self.over(Builtin::TooDeep, "calls are nested deeper than", self.limits.depth, "calls")
                }
                hot::Out::Grow => match self.grow_stack() {
                    Ok(()) => continue,
                    Err(raise) => raise,
                },
            };
            if let Some(exit) = self.unwind(host, raise) {
                return exit;
            }
        }
    }

    fn grow_stack(&mut self) -> Result<(), Raise> {
        self.check_memory()?;
        let stack = &mut self.top().stack;
        stack.resize(stack.len() * 2, Value::NIL);
        Ok(())
    }

    /// Does an instruction that the loop does not do itself.
    fn slow(&mut self, host: &mut dyn Host, op: Op, left: &mut u64) -> Slow {
        if op.costs_fuel() {
            if *left == 0 {
                self.top().pc -= 1;
                return Ok(Some(Exit::Fuel));
            }
            *left -= 1;
        }
        match op {
            Op::List(d, s, n) => self.put(d, Value::list(self.registers(s, n.0).to_vec())),
            Op::Vector(d, s, n) => self.put(d, Value::vector(self.registers(s, n.0).to_vec())),
            Op::Map(d, s, n) => {
                let map = self.make_map(s, n.0)?;
                self.put(d, map)
            }
            Op::Desc(d, s, k) => {
                let desc = self.make_desc(s, k.at());
                self.put(d, desc)
            }
            Op::Counter(d, s) => {
                let start = crate::native::index(self.reg(s))? as i64;
                self.put(d, Value::new(Obj::Counter(start.into())))
            }
            Op::CountDown(d, s) => {
                let more = self.count_down(s)?;
                self.put(d, Value::bool(more))
            }
            Op::IterStart(d, s) => self.iter_start(d, s),
            Op::IterNext(d, t) => self.next_answer(d, t),
            Op::First(d, a) => {
                let stream = self.reg(a).clone();
                self.stream_part(d, &stream, super::Part::First)
            }
            Op::Rest(d, a) => {
                let stream = self.reg(a).clone();
                self.stream_part(d, &stream, super::Part::Rest)
            }
            Op::CountStart(d, s) => {
                let count = self.reg(s).clone();
                crate::native::int(&count)?;
                self.put(d, count)
            }
            Op::Global(_, g) => {
                let name = self.program.globals[g.at()];
                let message = format!("`{name}` is used before its definition has been computed");
                Err(Box::new(Failure::new(Builtin::ProgramError, message)))
            }
            Op::CallPlan(d, w, s) => {
                let site = &self.program.sites[s.at()];
                let (callee, n) = (site.callee, site.args);
                let callee =
                    callee.ok_or_else(|| Box::new(Failure::new(Builtin::ProgramError, "no plan to call")))?;
                let args = self.registers(w, n).to_vec();
                self.call_plan(host, d, s, callee, args)
            }
            Op::CallValue(d, w, n, s) => {
                let callee = self.reg(w).clone();
                let args = self.registers(w.wrapping_add(1), n.0).to_vec();
                self.call_value(host, d, s, &callee, args)
            }
            Op::TailCall(w, n, f) => {
                let args = self.registers(w, n.0).to_vec();
                self.enter(w, f, args, &[]);
                Ok(None)
            }
            Op::TailCallValue(w, n, s) => self.tail_call_value(host, w, n, s),
            Op::CallNative(d, w, n, f) => {
                let run = self.runs.len() - 1;
                let first = self.runs[run].base as usize + w as usize;
                let next = self.native(host, f, first, n.0 as usize)?;
                self.next(host, d, SiteId(0), next)
            }
            Op::Perform(d, w, s) => {
                let (desc, goal) = (self.reg(w).clone(), self.reg(w.wrapping_add(1)).clone());
                self.perform(host, d, s, desc, (!goal.is_nil()).then_some(goal))
            }
            Op::Original(d, _) => self.original(host, d),
            Op::Fork(d, w, n, s) => self.fork(host, d, w, n, s),
            Op::ReturnPlan(a) => self.return_plan(host, a),
            Op::Fail(a, n, k) => Err(self.make_failure(TypeId(k.0.into()), a, n.0)?),
            Op::MakeFailure(d, a, n, k) => {
                let failure = self.make_failure(TypeId(k.0.into()), a, n.0)?;
                self.put(d, Value::failure(*failure))
            }
            Op::Raise(a) => {
                let failure = self.reg(a).clone();
                match failure.as_failure() {
                    // One that was made as a value is raised for the first time.
                    Some(it) if it.task.is_none() => Err(Box::new(it.clone())),
                    Some(_) => Ok(self.throw(host, failure)),
                    None => Err(type_error("a failure", &failure)),
                }
            }
            Op::JumpUnlessKind(a, k, t) => {
                let kind = self.reg(a).as_failure().map(|failure| failure.kind);
                if !kind.is_some_and(|kind| self.program.failures.is_a(kind, TypeId(k.0.into()))) {
                    self.top().pc = t.0;
                }
                Ok(None)
            }
            Op::Mark(d) => {
                let run = self.top();
                let rec = run.record(run.here);
                let mark = run.occurrences.get(&rec).map_or(0, |it| it.journal.len());
                self.put(d, Value::int(mark as i64))
            }
            Op::Retry(a, t) => self.retry(a, t),
            Op::EndCleanUp(a) => {
                self.top().cleanups.pop();
                let waiting = self.reg(a).clone();
                if waiting.as_failure().is_some() {
                    return Ok(self.throw(host, waiting));
                }
                // Who was to be stopped meanwhile could not be.
                Ok(self.evaporate_if_asked(host))
            }
            Op::Resume => {
                let value = std::mem::take(self.top().register(0));
                if let Some(Driver::Solve(_)) = self.top().drivers.last() {
                    return self.go_on_solving(host, value);
                }
                self.resume(host, value)
            }
            other => unreachable!("{other:?} is done by the loop"),
        }
    }

    // ------------------------------------------------------------------ registers

    pub(super) fn reg(&self, register: u8) -> &Value {
        let run = &self.runs[self.runs.len() - 1];
        &run.stack[run.base as usize + register as usize]
    }

    fn registers(&self, first: u8, n: u8) -> &[Value] {
        let run = &self.runs[self.runs.len() - 1];
        let first = run.base as usize + first as usize;
        &run.stack[first..first + n as usize]
    }

    pub(super) fn put(&mut self, register: u8, value: Value) -> Slow {
        *self.top().register(register) = value;
        Ok(None)
    }

    fn make_map(&self, first: u8, n: u8) -> Result<Value, Raise> {
        let mut map = crate::value::Map::new();
        for pair in self.registers(first, n).chunks_exact(2) {
            map.insert(map_key(&pair[0])?, pair[1].clone());
        }
        Ok(Value::map(map))
    }

    /// The constant is the list (kind key…), the values are in registers.
    fn make_desc(&self, first: u8, constant: usize) -> Value {
        let shape = self.program.constants[constant].to_vec().unwrap_or_default();
        let mut names = shape.iter().filter_map(Value::as_symbol);
        let kind = names.next().unwrap_or_default();
        let values = self.registers(first, shape.len().saturating_sub(1) as u8);
        Value::desc(Desc::new(kind, names.zip(values.iter().cloned()).collect()))
    }

    fn count_down(&mut self, register: u8) -> Result<bool, Raise> {
        let value = self.reg(register);
        let Some(Obj::Counter(left)) = value.obj() else { return Err(type_error("a retry counter", value)) };
        let more = left.get() > 0;
        if more {
            left.set(left.get() - 1);
        }
        Ok(more)
    }

    fn iter_start(&mut self, d: u8, s: u8) -> Slow {
        let list = match self.reg(s) {
            it if it.is_stream() => it.clone(),
            it => walkable(it)?,
        };
        *self.top().register(d.wrapping_add(1)) = list.clone();
        self.put(d.wrapping_add(2), list)
    }

    fn make_failure(&self, kind: TypeId, first: u8, n: u8) -> Result<Raise, Raise> {
        let given = self.registers(first, n.saturating_mul(2));
        let Some(it) = self.program.failures.get(kind) else {
            return Err(Box::new(Failure::new(Builtin::ProgramError, "no such failure type")));
        };
        let mut fields = Vec::with_capacity(n as usize);
        for pair in given.chunks_exact(2) {
            let key = pair[0].as_keyword().ok_or_else(|| type_error("a keyword", &pair[0]))?;
            fields.push((key, pair[1].clone()));
        }
        // In the order of the type, however they were given: equal failures look equal.
        let place = |field: &(Symbol, Value)| {
            it.fields.iter().position(|known| *known == field.0).unwrap_or(usize::MAX)
        };
        fields.sort_by(|a, b| place(a).cmp(&place(b)).then_with(|| a.0.as_str().cmp(b.0.as_str())));
        Ok(Box::new(Failure::of_type(kind, it.name, fields)))
    }

    // ------------------------------------------------------------------ functions and natives

    /// Enters `function` with its arguments arranged, in a window above all registers in use.
    pub(super) fn enter(&mut self, d: u8, function: FnId, args: Vec<Value>, captured: &[Value]) {
        let above = self.window_above();
        let entry = self.program.functions[function.at()].entry.0;
        let run = self.top();
        run.frames.push(Frame { pc: run.pc, base: run.base, here: run.here, dst: d });
        run.base = above;
        run.pc = entry;
        let end = above as usize + args.len() + captured.len();
        if run.stack.len() < end + 256 {
            let len = (run.stack.len() * 2).max(end + 256);
            run.stack.resize(len, Value::NIL);
        }
        for (register, value) in
            run.stack[above as usize..].iter_mut().zip(args.into_iter().chain(captured.iter().cloned()))
        {
            *register = value;
        }
    }

    /// The first register that the running frame does not use, as a position of the stack.
    pub(super) fn window_above(&self) -> u32 {
        let run = &self.runs[self.runs.len() - 1];
        let used = match run.pc {
            RESUME => 1,
            pc => self
                .program
                .function_at(Pc(pc.saturating_sub(1)))
                .map_or(1, |it| self.program.functions[it.at()].registers),
        };
        run.base + u32::from(used)
    }

    /// Calls any value that can be called.
    pub(super) fn call_value(
        &mut self,
        host: &mut dyn Host,
        d: u8,
        site: SiteId,
        callee: &Value,
        args: Vec<Value>,
    ) -> Slow {
        let (function, captured): (FnId, &[Value]) = match callee {
            Value::Imm(Imm::Function(function)) => (*function, &[]),
            Value::Imm(Imm::Native(native)) => {
                let next = self.native_with(host, *native, &args)?;
                return self.next(host, d, site, next);
            }
            Value::Obj(obj) if let Obj::Closure(function, captured) = &**obj => (*function, captured),
            _ => return Err(type_error("a function", callee)),
        };
        let args = self.arrange(function, args)?;
        if self.program.functions[function.at()].kind == FnKind::Plan {
            return self.call_plan(host, d, site, function, args);
        }
        self.enter(d, function, args, captured);
        Ok(None)
    }

    fn tail_call_value(&mut self, host: &mut dyn Host, w: u8, n: Count, s: SiteId) -> Slow {
        let callee = self.reg(w).clone();
        let args = self.registers(w.wrapping_add(1), n.0).to_vec();
        // The frame goes; what is called returns to the caller of it. The outermost has none.
        let run = self.top();
        let owes = run.obligations.iter().any(|it| it.holder == (run.tasks.loaded, run.frames.len()));
        let frame = run.frames.last().copied().filter(|_| !owes);
        let Some(frame) = frame else { return self.call_value(host, w, s, &callee, args) };
        let place = run.pc;
        run.frames.pop();
        let base = std::mem::replace(&mut run.base, frame.base);
        let here = std::mem::replace(&mut run.here, frame.here);
        run.pc = frame.pc;
        let plan = matches!(callee, Value::Imm(Imm::Function(f)) if self.program.functions[f.at()].kind == FnKind::Plan);
        if plan || !matches!(callee, Value::Imm(Imm::Function(_)) | Value::Obj(_)) {
            // Plans need the frame for their key, natives for their place: an ordinary call.
            let run = self.top();
            run.frames.push(frame);
            (run.pc, run.base, run.here) = (place, base, here);
            self.call_value(host, w, s, &callee, args)?;
            return Ok(None);
        }
        match self.call_value(host, frame.dst, s, &callee, args) {
            Ok(exit) => Ok(exit),
            Err(raise) => {
                let run = self.top();
                run.frames.push(frame);
                (run.pc, run.base, run.here) = (place, base, here);
                Err(raise)
            }
        }
    }

    fn native(&mut self, host: &mut dyn Host, f: NativeId, first: usize, n: usize) -> Result<Next, Raise> {
        // The registers are lent to the native, not copied: it cannot reach the stack.
        let mut stack = std::mem::take(&mut self.top().stack);
        let next = self.native_with(host, f, &stack[first..first + n]);
        std::mem::swap(&mut self.top().stack, &mut stack);
        next
    }

    fn native_with(&mut self, host: &mut dyn Host, f: NativeId, args: &[Value]) -> Result<Next, Raise> {
        let native = &self.program.natives[f.at()];
        let (least, most) = native.arity;
        if args.len() < least as usize || most.is_some_and(|most| args.len() > most as usize) {
            let takes = match most {
                Some(1) if least == 1 => "1 argument".to_string(),
                Some(most) if most == least => format!("{least} arguments"),
                Some(most) => format!("{least} to {most} arguments"),
                None => format!("at least {least} arguments"),
            };
            let message = format!("`{}` takes {takes}, got {}", native.name, args.len());
            return Err(Box::new(Failure::new(Builtin::ArityError, message)));
        }
        if !self.grants.allows(native.effect) {
            let effect = native.effect.name();
            let message =
                format!("`{}` needs the grant `{effect}`, which this run does not have", native.name);
            let fields = vec![("message", Value::str(message)), ("effect", Value::symbol(effect))];
            return Err(Box::new(Failure::with(Builtin::NotAllowed, fields)));
        }
        let Some(run) = self.runs.last_mut() else { return Ok(Next::Return(Value::NIL)) };
        if run.projected && matches!(native.effect, Effect::Write | Effect::Network | Effect::Process) {
            let message =
                format!("`{}` changes what is outside, which a projected run does not", native.name);
            let fields =
                vec![("message", Value::str(message)), ("effect", Value::symbol(native.effect.name()))];
            return Err(Box::new(Failure::with(Builtin::NotAllowed, fields)));
        }
        let rec = run.record(run.here);
        // What rules call sees the world of their query.
        let world = match run.drivers.last_mut() {
            Some(Driver::Solve(solve)) if solve.engine.world.is_some() => &mut solve.engine.world,
            _ => &mut run.world,
        };
        let mut ctx = Ctx::new(CtxParts {
            program: &self.program,
            tree: &run.tree,
            rec,
            draws: &mut run.draws,
            seed: run.seed,
            projected: run.projected,
            now: run.now,
            printed: &mut self.printed,
            fresh: &mut self.fresh,
            output_limit: self.limits.output,
            host,
            world,
        });
        let before = live::bytes();
        let next = (native.run)(&mut ctx, args)?;
        // A round is long enough to take all memory there is, call by call. Small calls wait for its
        // end: clean-up and handlers need a few.
        let taken = live::bytes().saturating_sub(before);
        if taken > LARGE && live::bytes() > self.limits.memory {
            self.check_memory()?;
        }
        Ok(next)
    }

    /// Does what a native wants next.
    fn next(&mut self, host: &mut dyn Host, d: u8, site: SiteId, next: Next) -> Slow {
        match next {
            Next::Return(value) => self.put(d, value),
            Next::Call { callee, args } => self.call_value(host, d, site, &callee, args),
            Next::Ask(request) => {
                let run = self.top();
                let register = run.base as usize + d as usize;
                Ok(Some(Exit::Ask(request, register)))
            }
            Next::Sleep(ns) => self.sleep(d, ns),
            Next::Task(op) => self.task_op(host, d, op),
            Next::Query { predicate, inputs, ask } => self.ask(d, predicate, &inputs, ask),
            Next::Explain(stream, holds) => {
                let text = self.explain(host, &stream, holds)?;
                self.put(d, text)
            }
            Next::Part(stream, part) => self.stream_part(d, &stream, part),
            Next::PushFacts(facts) => {
                self.push_facts(&facts)?;
                self.put(d, Value::NIL)
            }
            Next::PushTree(tree) => {
                self.push_tree(&tree)?;
                self.put(d, Value::NIL)
            }
            Next::PopScope => {
                self.pop_scope();
                self.put(d, Value::NIL)
            }
            Next::RunPlan { plan, args, tree, seed, projected } => {
                let order = super::drive::Order { plan, args, tree, seed, projected };
                self.run_plan(host, d, order)
            }
            Next::WithEdits { plan, args, graft } => self.call_with_edits(host, d, site, &plan, args, &graft),
            Next::EditTree { tree, edits, origin } => {
                let tree = self.edit_tree(host, &tree, &edits, &origin)?;
                self.put(d, tree)
            }
        }
    }

    /// Arguments in the order of the parameters; what was not given is unset.
    ///
    /// # Errors
    /// `arity-error` if they do not fit.
    pub fn arrange(&self, function: FnId, args: Vec<Value>) -> Result<Vec<Value>, Raise> {
        let function = &self.program.functions[function.at()];
        arrange(&function.params, args).map_err(|problem| {
            let message = format!("`{}` {problem}", function.name);
            Box::new(Failure::new(Builtin::ArityError, message))
        })
    }

    // ------------------------------------------------------------------ plans

    /// Calls a plan as a new node. `args` are arranged.
    pub(super) fn call_plan(
        &mut self,
        host: &mut dyn Host,
        d: u8,
        site: SiteId,
        callee: FnId,
        mut args: Vec<Value>,
    ) -> Slow {
        let name = self.program.functions[callee.at()].name;
        let slot = self.slot_of_call(site, name);
        let is_dynamic = self.program.sites[site.at()].callee.is_none();
        let run = self.top();
        if is_dynamic {
            run.tree.calls(slot, callee);
        }
        let parent = run.record(run.here);
        let run = &self.runs[self.runs.len() - 1];
        let edited = Edited { program: &self.program, tree: &run.tree, slot, body: Body::Plan(callee) };
        if !edited.only_changes_params(&args) {
            return self.drive(host, d, Call::of_plan(slot, parent, callee, args));
        }
        let run = self.top();
        let rec = run.tree.enter(parent, slot, NodeKind::Plan, &args, run.now);
        run.note_late(rec);
        self.trace_start(host, rec);
        let Machine { program, runs, .. } = self;
        let tree = &mut runs.last_mut().expect("a machine has a run").tree;
        if !tree.edits_of(slot).is_empty() {
            hot::change_params(program, tree, (rec, slot), callee, &mut args);
        }
        self.enter(d, callee, args, &[]);
        self.top().here = Here(rec.0);
        Ok(None)
    }

    /// A call of a plan at this slot, from its node, that edits drive.
    fn call_edited(&mut self, host: &mut dyn Host, op: Op, slot: SlotId) -> Slow {
        let Op::CallPlan(d, w, site) = op else { return Ok(None) };
        let site = &self.program.sites[site.at()];
        let Some(callee) = site.callee else { return Ok(None) };
        let args = self.registers(w, site.args).to_vec();
        let run = self.top();
        let parent = run.record(run.here);
        self.drive(host, d, Call::of_plan(slot, parent, callee, args))
    }

    /// The slot of a call at `site` from the running frame, made if it is new.
    pub(super) fn slot_of_call(&mut self, site: SiteId, name: Symbol) -> SlotId {
        let way = self.way_to(site);
        self.slot_on(way, site, name, None)
    }

    /// The way from the node to the running frame, and the rounds of the loops around `site` in it.
    pub(super) fn way_to(&mut self, site: SiteId) -> Way {
        let mut calls = std::mem::take(&mut self.top().levels);
        calls.clear();
        let levels = self.levels(calls);
        let program = &self.program;
        let run = self.runs.last_mut().expect("a machine has a run");
        let rec = run.record(run.here);
        let mut chain = levels.start;
        let site_hash = |site: SiteId| program.sites[site.at()].hash;
        let deep = levels.calls.len() > MEMO_AFTER;
        for (i, (call, base)) in levels.calls.iter().rev().enumerate() {
            let innermost = i + 1 == levels.calls.len();
            let call = if innermost { Some(site) } else { *call };
            if innermost && deep {
                run.here = run.memo(rec, chain);
            }
            for round in call.map_or(&[][..], |call| &program.sites[call.at()].rounds) {
                let step = run.round(*round, *base);
                chain = run.tree.keys.then(chain, step, site_hash);
            }
            if let (false, Some(call)) = (innermost, call) {
                chain = run.tree.keys.then(chain, Step::Call(call), site_hash);
            }
        }
        run.levels = levels.calls;
        Way { rec, chain }
    }

    /// The slot of a call at `site`, to which a way leads; for one of several branches that begin there, the
    /// one with the step of its round.
    pub(super) fn slot_on(&mut self, way: Way, site: SiteId, name: Symbol, round: Option<Step>) -> SlotId {
        let Way { rec, mut chain } = way;
        let program = &self.program;
        let it = &program.sites[site.at()];
        let run = self.runs.last_mut().expect("a machine has a run");
        let site_hash = |site: SiteId| program.sites[site.at()].hash;
        if let Some(round) = round {
            chain = run.tree.keys.then(chain, round, site_hash);
        }
        if it.callee.is_none() {
            chain = run.tree.keys.then(chain, Step::Name(name), site_hash);
        }
        if it.counted || run.tree.record(rec).flags & crate::tree::COUNTED != 0 {
            let reached = run.occurrences.entry(rec).or_default();
            let key = Key { site, chain };
            let count = reached.counts.entry(key).or_insert(0);
            let before = *count;
            *count += 1;
            reached.journal.push(key);
            if before > 0 {
                chain = run.tree.keys.then(chain, Step::Again(before), site_hash);
            }
        }
        run.tree.child(rec, Key { site, chain }, name, it.hash)
    }

    /// The frames between the running one and its node, innermost first.
    fn levels(&self, mut calls: Vec<(Option<SiteId>, u32)>) -> Levels {
        let run = &self.runs[self.runs.len() - 1];
        let mut start = Chain::EMPTY;
        let (mut pc, mut base) = (run.pc, run.base);
        let mut frames = run.frames.iter().rev();
        loop {
            if pc != RESUME {
                let at = Pc(pc.saturating_sub(1));
                let Some(function) = self.program.function_at(at) else { break };
                calls.push((self.program.site_at(function, at), base));
                match self.program.functions[function.at()].kind {
                    FnKind::Plan | FnKind::Branch | FnKind::TopLevel => break,
                    FnKind::Inserted => {
                        start = run.inserted.get(&function).copied().unwrap_or_default();
                        break;
                    }
                    FnKind::Function | FnKind::Lambda => {}
                }
            }
            let Some(frame) = frames.next() else { break };
            if frame.here != run.here {
                if run.here.0 & MEMO != 0 {
                    start = run.memos[(run.here.0 & !MEMO) as usize].1;
                }
                break;
            }
            (pc, base) = (frame.pc, frame.base);
        }
        Levels { calls, start }
    }

    fn return_plan(&mut self, host: &mut dyn Host, a: u8) -> Slow {
        let value = std::mem::take(self.top().register(a));
        let run = self.top();
        let rec = run.record(run.here);
        if run.tree.record(rec).flags & crate::tree::DRIVEN == 0 {
            self.end_record(host, rec, Status::Succeeded, value.clone());
        }
        self.return_value(value)
    }

    /// Leaves the running frame with a value.
    pub(super) fn return_value(&mut self, value: Value) -> Slow {
        let run = self.top();
        match run.frames.pop() {
            Some(frame) => {
                (run.pc, run.base, run.here) = (frame.pc, frame.base, frame.here);
                self.put(frame.dst, value)
            }
            None => Ok(Some(Exit::Done(value))),
        }
    }

    /// Makes a record final and forgets what only running records need.
    pub(super) fn end_record(&mut self, host: &mut dyn Host, rec: RecId, status: Status, value: Value) {
        let run = self.top();
        let now = run.now;
        run.tree.end(rec, status, value, now);
        if !run.occurrences.is_empty() {
            run.occurrences.remove(&rec);
        }
        if self.tells && self.runs.len() == 1 {
            let run = &self.runs[self.runs.len() - 1];
            host.trace(&crate::show::trace_end(&self.program, &run.tree, rec));
        }
    }

    /// A record has been made: those hear of it who look at starts.
    pub(super) fn trace_start(&mut self, host: &mut dyn Host, rec: RecId) {
        let run = &self.runs[self.runs.len() - 1];
        if self.tells && self.runs.len() == 1 {
            host.trace(&crate::show::trace_start(&self.program, &run.tree, rec));
        }
        if !self.breaks.is_empty() {
            let slot = run.tree.record(rec).slot;
            if self.breaks.iter().any(|end| end.is_of(&run.tree, slot)) {
                self.broke = Some(slot);
            }
        }
    }

    fn retry(&mut self, mark: u8, to: Pc) -> Slow {
        let mark = self.reg(mark).as_int().unwrap_or(0) as usize;
        let run = self.top();
        let rec = run.record(run.here);
        if let Some(it) = run.occurrences.get_mut(&rec) {
            it.take_back(mark);
        }
        run.tree.retried(rec);
        run.pc = to.0;
        Ok(None)
    }
}

/// The list that a loop over a value walks.
pub(super) fn walkable(value: &Value) -> Result<Value, Raise> {
    Ok(match value.obj() {
        Some(Obj::Pair(..)) => value.clone(),
        None if value.is_nil() => Value::NIL,
        Some(Obj::Vector(items)) => Value::list(items.iter().cloned().collect::<Vec<_>>()),
        Some(Obj::Map(map)) => {
            let pairs: Vec<Value> = map.iter().map(|(k, v)| Value::list([k.clone(), v.clone()])).collect();
            Value::list(pairs)
        }
        Some(Obj::Str(text)) => {
            Value::list(text.chars().map(|c| Value::str(c.to_string())).collect::<Vec<_>>())
        }
        _ => return Err(type_error("something to walk over: a list, vector, map or string", value)),
    })
}

/// Function frames deeper than this get a memo of the way to them, so that calls from deep
/// recursion do not walk it again.
const MEMO_AFTER: usize = 16;

/// The way from a node to a call in it, without what tells apart the calls of one site.
#[derive(Clone, Copy)]
pub(super) struct Way {
    rec: RecId,
    chain: Chain,
}

/// The frames between a node and the running frame.
struct Levels {
    /// Call site and base of each frame, innermost first.
    calls: Vec<(Option<SiteId>, u32)>,
    /// The chain that they continue.
    start: Chain,
}

impl Run {
    /// The step of the round that a loop is in.
    fn round(&mut self, round: RoundKey, base: u32) -> Step {
        match round {
            RoundKey::Count(register) => {
                let number = self.stack[base as usize + register as usize].as_int().unwrap_or(0);
                Step::Round(crate::key::Element::Int(number), 0)
            }
            RoundKey::Element(register) => {
                let at = base as usize + register as usize;
                let rest = self.stack[at + 1].clone();
                let ranks = &mut self.stack[at + 2];
                if !matches!(ranks.obj(), Some(Obj::Ranks(_))) {
                    let list = std::mem::take(ranks);
                    *ranks = Value::new(Obj::Ranks(Box::new(Ranks::new(list))));
                }
                match ranks.obj() {
                    Some(Obj::Ranks(ranks)) => ranks.step(&rest),
                    _ => Step::Number(0),
                }
            }
        }
    }

    fn memo(&mut self, rec: RecId, chain: Chain) -> Here {
        let next = self.memos.len() as u32;
        let at = *self.memo_index.entry((rec, chain)).or_insert(next);
        if at == next {
            self.memos.push((rec, chain));
        }
        Here(at | MEMO)
    }
}

/// Arguments in the order of the parameters, or what is wrong with them.
fn arrange(params: &Params, args: Vec<Value>) -> Result<Vec<Value>, String> {
    let (required, optional) = (params.required as usize, params.optional as usize);
    let given = args.len();
    if given < required {
        return Err(format!("takes {}, got {given}", takes(params)));
    }
    let mut args = args.into_iter();
    let mut arranged: Vec<Value> = args.by_ref().take(required + optional).collect();
    arranged.resize(required + optional, Value::UNSET);
    let left: Vec<Value> = args.collect();
    if params.keys > 0 {
        let names = params.key_names();
        let first = arranged.len();
        arranged.resize(first + names.len(), Value::UNSET);
        for pair in left.chunks(2) {
            let key = pair[0].as_keyword().ok_or_else(|| format!("takes {}, got {given}", takes(params)))?;
            let Some(value) = pair.get(1) else { return Err(format!("got `:{key}` without a value")) };
            match names.iter().position(|name| *name == key) {
                Some(at) if arranged[first + at].is_unset() => arranged[first + at] = value.clone(),
                Some(_) => return Err(format!("got `:{key}` twice")),
                None if params.rest => {}
                None => {
                    let known: Vec<String> = names.iter().map(|name| format!(":{name}")).collect();
                    return Err(format!("has no parameter `:{key}`, only {}", known.join(" ")));
                }
            }
        }
    } else if !left.is_empty() && !params.rest {
        return Err(format!("takes {}, got {given}", takes(params)));
    }
    if params.rest {
        arranged.push(Value::list(left));
    }
    Ok(arranged)
}

/// "2 arguments", "1 to 3 arguments", "at least 1 argument".
#[must_use]
pub fn takes(params: &Params) -> String {
    let (least, most) = (params.required as usize, params.required as usize + params.optional as usize);
    let plural = |n: usize| if n == 1 { "argument" } else { "arguments" };
    let keys = if params.keys > 0 { " and keywords" } else { "" };
    if params.rest {
        format!("at least {least} {}{keys}", plural(least))
    } else if least == most {
        format!("{least} {}{keys}", plural(least))
    } else {
        format!("{least} to {most} arguments{keys}")
    }
}
