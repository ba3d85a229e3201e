//! AST to instructions.
//!
//! Registers are a stack: parameters, captured values, then variables and intermediate values in
//! the order in which they come into being. An expression is told which register takes its value.
//! Calls put their arguments into a window above all registers in use, which becomes the frame
//! of the callee.
//!
//! Forms are noted as ranges of instructions while they are lowered (see [`vm::code`]).

mod calls;
mod control;
mod test;

use std::collections::BTreeMap;

use grammar::Span;
use vm::code::{
    ConstId, FnId, FnKind, FormKind, FormRange, Function as Proto, Pc, Place, Program, RoundKey, Site,
};
use vm::op::Op;
use vm::random::hash_call;
use vm::value::{Imm, Symbol, Value};

use crate::ast::{Callee, Expr, ExprKind, Function, VarId};
use crate::error::CompileError;

/// Registers of a frame that a function may use; the window of the machine has 256.
const MOST_REGISTERS: usize = 240;

/// Where a jump goes: a label that gets its instruction later.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Label(usize);

/// Who looks at the value of an expression.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Use {
    /// The program: it cannot be left out.
    Value,
    /// Nobody but the node that it is the value of: it is nil if a call is left out.
    Last,
    /// Nobody.
    Nothing,
}

/// What `return` and `retry` leave, innermost last.
#[derive(Debug, Clone, Copy)]
enum Target {
    /// A loop.
    Loop { dst: u8, end: Label, protections: usize },
    /// The clauses of a handler.
    Clause { dst: u8, end: Label, body: Label, mark: u8, failure: u8, protections: usize },
}

/// An `unwind-protect` whose body is being lowered: ways out of it run the clean-up first.
struct Protection {
    pending: u8,
    cleanup: Label,
    /// Where each way out goes on after the clean-up.
    exits: Vec<Exit>,
    /// How many protections stand around where it goes.
    depths: Vec<usize>,
}

#[derive(Clone, Copy)]
enum Exit {
    Jump(Label),
    Retry { mark: u8, body: Label },
}

/// Lowers a function into the program, in the place of `id`.
pub(crate) fn lower(program: &mut Program, id: FnId, function: &Function) -> Vec<CompileError> {
    let mut lower = Lower::new(program, id, function);
    lower.function(function);
    lower.finish(function)
}

struct Lower<'p> {
    program: &'p mut Program,
    id: FnId,
    name: Symbol,
    kind: FnKind,
    code: Vec<Op>,
    places: Vec<Place>,
    /// Instructions that wait for their label.
    jumps: Vec<(usize, Label)>,
    labels: Vec<Option<u32>>,
    forms: Vec<FormRange>,
    form: u32,
    sites: Vec<Site>,
    rounds: Vec<RoundKey>,
    /// How many loops without a key are around.
    uncounted: usize,
    targets: Vec<Target>,
    protections: Vec<Protection>,
    /// The register of each variable.
    vars: Vec<u8>,
    assigned: Vec<bool>,
    next: usize,
    most: usize,
    span: Span,
    guards: bool,
    /// Where a `return` out of the loop goes that has just been lowered.
    pending_out: Option<Label>,
    errors: Vec<CompileError>,
}

impl<'p> Lower<'p> {
    fn new(program: &'p mut Program, id: FnId, function: &Function) -> Lower<'p> {
        Lower {
            program,
            id,
            name: function.name,
            kind: function.kind,
            code: Vec::new(),
            places: Vec::new(),
            jumps: Vec::new(),
            labels: Vec::new(),
            forms: Vec::new(),
            form: 0,
            sites: Vec::new(),
            rounds: Vec::new(),
            uncounted: 0,
            targets: Vec::new(),
            protections: Vec::new(),
            vars: vec![0; function.vars.len()],
            assigned: function.vars.iter().map(|var| var.assigned.is_some()).collect(),
            next: 0,
            most: 1,
            span: function.span,
            guards: false,
            pending_out: None,
            errors: Vec::new(),
        }
    }

    fn function(&mut self, function: &Function) {
        self.open(FormKind::Body);
        for (var, _) in &function.inputs {
            self.vars[var.0 as usize] = self.register();
        }
        for (_, var) in &function.captures {
            self.vars[var.0 as usize] = self.register();
        }
        for (at, (var, default)) in function.inputs.iter().enumerate() {
            if at >= function.params.required as usize
                && !(function.params.rest && at + 1 == function.inputs.len())
            {
                let register = self.vars[var.0 as usize];
                let given = self.label();
                self.jump_to(given, |to| Op::JumpIfSet(register, to));
                match default {
                    Some(default) => self.expr(default, register, Use::Value),
                    None => self.emit(Op::Nil(register)),
                }
                self.bind(given);
            }
        }
        match self.kind {
            FnKind::Function | FnKind::Lambda => self.tail_body(&function.body),
            FnKind::Plan | FnKind::TopLevel | FnKind::Inserted | FnKind::Branch => {
                let dst = self.register();
                self.body(&function.body, dst, Use::Last);
                self.emit(if self.kind == FnKind::Plan { Op::ReturnPlan(dst) } else { Op::Return(dst) });
            }
        }
        self.close();
    }

    /// Puts the finished function into the program.
    fn finish(mut self, function: &Function) -> Vec<CompileError> {
        let entry = self.program.code.len() as u32;
        let first_form = self.program.forms.len() as u32;
        let first_site = self.program.sites.len() as u32;
        for (at, label) in &self.jumps {
            let target = self.labels[label.0].unwrap_or(0);
            set_target(&mut self.code[*at], Pc(entry + target));
        }
        for op in &mut self.code {
            move_site(op, first_site);
        }
        for form in &mut self.forms {
            form.start.0 += entry;
            form.end.0 += entry;
            form.parent += first_form;
            if let FormKind::Guarded { handler, .. } = &mut form.kind {
                handler.0 = entry + self.labels[handler.0 as usize].unwrap_or(0);
            }
            if let FormKind::Protected { cleanup, .. } = &mut form.kind {
                cleanup.0 = entry + self.labels[cleanup.0 as usize].unwrap_or(0);
            }
        }
        let mut seen: BTreeMap<Symbol, u64> = BTreeMap::new();
        for site in &mut self.sites {
            site.pc.0 += entry;
            site.form += first_form;
            let ordinal = seen.entry(site.name).or_default();
            *ordinal += 1;
            site.hash = hash_call(&self.name, &site.name, *ordinal);
        }
        let program = self.program;
        program.code.append(&mut self.code);
        program.places.append(&mut self.places);
        program.forms.append(&mut self.forms);
        program.sites.append(&mut self.sites);
        let end = program.code.len() as u32;
        program.functions[self.id.at()] = Proto {
            name: self.name,
            kind: self.kind,
            entry: Pc(entry),
            end: Pc(end),
            registers: self.most.min(255) as u8,
            params: function.params.clone(),
            captures: function.captures.len() as u8,
            guards: self.guards,
            forms: first_form..program.forms.len() as u32,
            sites: first_site..program.sites.len() as u32,
            place: place(function.span),
        };
        program.extents.push((Pc(entry), self.id));
        self.errors
    }

    // ------------------------------------------------------------------ emitting

    fn emit(&mut self, op: Op) {
        self.code.push(op);
        self.places.push(place(self.span));
    }

    fn label(&mut self) -> Label {
        self.labels.push(None);
        Label(self.labels.len() - 1)
    }

    /// The label is the next instruction.
    fn bind(&mut self, label: Label) {
        self.labels[label.0] = Some(self.code.len() as u32);
    }

    fn jump_to(&mut self, label: Label, op: impl Fn(Pc) -> Op) {
        self.jumps.push((self.code.len(), label));
        self.emit(op(Pc(0)));
    }

    /// Begins a form.
    fn open(&mut self, kind: FormKind) {
        let at = self.forms.len() as u32;
        let start = Pc(self.code.len() as u32);
        let parent = if at == 0 { 0 } else { self.form };
        let registers = self.next.min(MOST_REGISTERS) as u8;
        self.forms.push(FormRange { kind, start, end: start, parent, registers });
        self.form = at;
    }

    /// Ends the innermost form.
    fn close(&mut self) {
        let form = &mut self.forms[self.form as usize];
        form.end = Pc(self.code.len() as u32);
        self.form = form.parent;
    }

    /// A part of a form that is done in one go.
    fn step(&mut self, part: impl FnOnce(&mut Self)) {
        self.open(FormKind::Step);
        part(self);
        self.close();
    }

    /// A number for the branches of an expression: that of its first form, which no other has.
    fn branches(&self) -> FormKind {
        FormKind::Branch(self.forms.len() as u32)
    }

    /// One of the branches of an expression.
    fn branch(&mut self, kind: FormKind, part: impl FnOnce(&mut Self)) {
        self.open(kind);
        part(self);
        self.close();
    }

    fn register(&mut self) -> u8 {
        let register = self.next;
        self.next += 1;
        self.most = self.most.max(self.next);
        if register == MOST_REGISTERS {
            let (name, limit, at) = (self.name.to_string(), MOST_REGISTERS, self.span);
            self.errors.push(CompileError::TooManyRegisters { name, limit, at });
        }
        register.min(MOST_REGISTERS) as u8
    }

    /// Registers that are free again after `part`.
    fn scratch<T>(&mut self, part: impl FnOnce(&mut Self) -> T) -> T {
        let before = self.next;
        let result = part(self);
        self.next = before;
        result
    }

    fn constant(&mut self, value: &Value) -> ConstId {
        // Sharing is for what is near: a search among all would take time with their square.
        const NEAR: usize = 100;
        let constants = &self.program.constants;
        let first = constants.len().saturating_sub(NEAR);
        let known = constants[first..].iter().rposition(|known| is_same(known, value)).map(|at| first + at);
        let at = known.unwrap_or_else(|| {
            self.program.constants.push(value.clone());
            self.program.constants.len() - 1
        });
        ConstId(at as u32)
    }

    fn load(&mut self, value: &Value, dst: u8) {
        let op = match value {
            Value::Imm(Imm::Nil) => Op::Nil(dst),
            Value::Imm(Imm::Bool(true)) => Op::True(dst),
            Value::Imm(Imm::Bool(false)) => Op::False(dst),
            Value::Imm(Imm::Int(i)) if i32::try_from(*i).is_ok() => Op::Int(dst, *i as i32),
            other => Op::Const(dst, self.constant(other)),
        };
        self.emit(op);
    }

    fn var(&self, var: VarId) -> u8 {
        self.vars[var.0 as usize]
    }

    // ------------------------------------------------------------------ expressions

    /// Puts the value of an expression into `dst`, if somebody looks at it.
    fn expr(&mut self, expr: &Expr, dst: u8, used: Use) {
        let around = std::mem::replace(&mut self.span, expr.span);
        let before = self.next;
        self.expr_kind(expr, dst, used);
        self.next = before;
        self.span = around;
    }

    fn expr_kind(&mut self, expr: &Expr, dst: u8, used: Use) {
        match &expr.kind {
            ExprKind::Const(value) => {
                if used != Use::Nothing {
                    self.load(value, dst);
                }
            }
            ExprKind::Var(var) => {
                let register = self.var(*var);
                if register != dst {
                    self.emit(Op::Move(dst, register));
                }
            }
            ExprKind::Global(global) => self.emit(Op::Global(dst, *global)),
            ExprKind::Define(global, value) => {
                self.expr(value, dst, Use::Value);
                self.emit(Op::SetGlobal(dst, *global));
            }
            ExprKind::Let(parts, body) => {
                self.bindings(parts);
                self.body(body, dst, used);
            }
            ExprKind::Set(var, value) => self.set(*var, value, dst, used),
            ExprKind::If(test, then, other) => self.if_(test, then, other, dst, used),
            ExprKind::And(parts) => self.and_or(parts, dst, used, Op::JumpIfFalse),
            ExprKind::Or(parts) => self.and_or(parts, dst, used, Op::JumpIfTrue),
            ExprKind::Seq(body) => self.body(body, dst, used),
            ExprKind::Case(subject, arms, otherwise) => self.case(subject, arms, otherwise, dst, used),
            ExprKind::While(test, body) => self.step(|it| it.while_(test, body, dst)),
            ExprKind::Dolist { var, list, body, result } => self.step(|it| {
                it.dolist(*var, list, body, dst);
                it.result(result, dst, used);
            }),
            ExprKind::Dotimes { var, count, body, result } => self.step(|it| {
                it.dotimes(*var, count, body, dst);
                it.result(result, dst, used);
            }),
            ExprKind::Lambda(function) => self.lambda(function, dst),
            ExprKind::Call(callee, args) => self.call(callee, args, dst, used),
            ExprKind::Perform(desc, goal) => self.perform(desc, goal.as_deref(), dst, used),
            ExprKind::Fork { kind, extra, branches } => {
                self.step(|it| it.fork(*kind, extra, branches, dst, used));
            }
            ExprKind::Handle(clauses, body) => self.step(|it| it.handle(clauses, body, dst, used)),
            ExprKind::Retry => self.retry(),
            ExprKind::Return(value) => self.return_(value),
            ExprKind::Propagate => self.propagate(),
            ExprKind::Fail(kind, fields) => {
                let first = self.fields(fields);
                self.emit(Op::Fail(first, vm::op::Count(fields.len() as u8), vm::op::Kind(kind.0 as u16)));
            }
            ExprKind::MakeFailure(kind, fields) => {
                let first = self.fields(fields);
                let n = vm::op::Count(fields.len() as u8);
                self.emit(Op::MakeFailure(dst, first, n, vm::op::Kind(kind.0 as u16)));
            }
            ExprKind::Raise(failure) => {
                let register = self.operand(failure);
                self.emit(Op::Raise(register));
            }
            ExprKind::Protect(body, cleanup, name) => {
                self.step(|it| it.protect(body, cleanup, *name, dst, used));
            }
            ExprKind::Counter(count) => {
                let register = self.operand(count);
                self.emit(Op::Counter(dst, register));
            }
            ExprKind::CountDown(var) => self.emit(Op::CountDown(dst, self.var(*var))),
            ExprKind::Vector(items) => {
                let first = self.in_a_row(items);
                self.emit(Op::Vector(dst, first, vm::op::Count(items.len() as u8)));
            }
            ExprKind::Map(items) => {
                let first = self.in_a_row(items);
                self.emit(Op::Map(dst, first, vm::op::Count(items.len() as u8)));
            }
            ExprKind::Desc(kind, properties) => self.desc(*kind, properties, dst),
            ExprKind::Matches(mode, pattern, value) => {
                let name = if *mode == vm::desc::Match::Open { "%matches" } else { "%==" };
                let args = [pattern, value].map(|part| Some((**part).clone()));
                match self.program.native(name) {
                    Some(native) => self.call(&Callee::Native(native), &args, dst, used),
                    None => self.errors.push(CompileError::NoSuchNative { name: name.into(), at: expr.span }),
                }
            }
            ExprKind::Original => {
                let site = self.site(None, Symbol::from("original"), 0, used);
                self.emit(Op::Original(dst, site));
            }
        }
    }

    /// A register that holds the value: the variable's own, if nothing can change it meanwhile.
    fn operand(&mut self, expr: &Expr) -> u8 {
        if let ExprKind::Var(var) = &expr.kind
            && !self.assigned[var.0 as usize]
        {
            return self.var(*var);
        }
        let register = self.register();
        self.part(expr, register);
        register
    }

    /// The value of a part of an expression. What does something is a form of its own.
    fn part(&mut self, expr: &Expr, dst: u8) {
        match is_simple(expr) {
            true => self.expr(expr, dst, Use::Value),
            false => self.step(|it| it.expr(expr, dst, Use::Value)),
        }
    }

    /// The same, computed in `dst` if it needs a register: `dst` must not be a variable that
    /// what follows may look at.
    fn operand_in(&mut self, expr: &Expr, dst: u8) -> u8 {
        match &expr.kind {
            ExprKind::Var(_) => self.operand(expr),
            _ => {
                self.part(expr, dst);
                dst
            }
        }
    }

    /// Values in consecutive registers; the first of them.
    fn in_a_row(&mut self, items: &[Expr]) -> u8 {
        let registers: Vec<u8> = items.iter().map(|_| self.register()).collect();
        for (item, register) in items.iter().zip(&registers) {
            self.part(item, *register);
        }
        registers.first().copied().unwrap_or(0)
    }

    fn fields(&mut self, fields: &[(Symbol, Expr)]) -> u8 {
        let registers: Vec<u8> = fields.iter().flat_map(|_| [0, 0]).map(|_: u8| self.register()).collect();
        for ((key, value), pair) in fields.iter().zip(registers.chunks(2)) {
            self.load(&Value::Imm(Imm::Keyword(*key)), pair[0]);
            self.part(value, pair[1]);
        }
        registers.first().copied().unwrap_or(0)
    }

    fn desc(&mut self, kind: Symbol, properties: &[(Symbol, Expr)], dst: u8) {
        let registers: Vec<u8> = properties.iter().map(|_| self.register()).collect();
        for ((_, value), register) in properties.iter().zip(&registers) {
            self.part(value, *register);
        }
        let names = std::iter::once(kind).chain(properties.iter().map(|(key, _)| *key));
        let shape = Value::list(names.map(|name| Value::Imm(Imm::Symbol(name))).collect::<Vec<_>>());
        let shape = self.constant(&shape);
        self.emit(Op::Desc(dst, registers.first().copied().unwrap_or(0), shape));
    }

    fn bindings(&mut self, parts: &[(VarId, Expr)]) {
        for (var, value) in parts {
            // A name for a variable that nobody changes needs no register of its own.
            if let ExprKind::Var(other) = &value.kind
                && !self.assigned[var.0 as usize]
                && !self.assigned[other.0 as usize]
            {
                self.vars[var.0 as usize] = self.var(*other);
                continue;
            }
            let register = self.register();
            self.step(|it| it.expr(value, register, Use::Value));
            self.vars[var.0 as usize] = register;
        }
    }

    fn set(&mut self, var: VarId, value: &Expr, dst: u8, used: Use) {
        let register = self.var(var);
        // The value may look at the variable until it is complete.
        let simple = match &value.kind {
            ExprKind::Const(_) => true,
            // What is computed in the register itself must not look at it afterwards.
            ExprKind::Call(Callee::Native(_), args) => match args.as_slice() {
                [Some(first), rest @ ..] => is_var(first) && rest.iter().flatten().all(is_simple),
                _ => false,
            },
            _ => false,
        };
        if simple {
            self.expr(value, register, Use::Value);
        } else {
            let complete = self.register();
            self.expr(value, complete, Use::Value);
            self.emit(Op::Move(register, complete));
        }
        if used != Use::Nothing && register != dst {
            self.emit(Op::Move(dst, register));
        }
    }

    /// Several expressions; the value of the last goes to `dst`.
    fn body(&mut self, body: &[Expr], dst: u8, used: Use) {
        let Some((last, first)) = body.split_last() else {
            if used != Use::Nothing {
                self.emit(Op::Nil(dst));
            }
            return;
        };
        for expr in first {
            self.step(|it| {
                it.scratch(|it| {
                    let unused = it.register();
                    it.expr(expr, unused, Use::Nothing);
                });
            });
        }
        if first.is_empty() {
            self.expr(last, dst, used);
        } else {
            self.step(|it| it.expr(last, dst, used));
        }
    }

    fn lambda(&mut self, function: &Function, dst: u8) {
        let id = FnId(self.program.functions.len() as u32);
        self.program.functions.push(crate::placeholder(function.name, function.kind));
        let mut errors = lower(self.program, id, function);
        self.errors.append(&mut errors);
        if function.captures.is_empty() {
            return self.load(&Value::Imm(Imm::Function(id)), dst);
        }
        let registers: Vec<u8> = function.captures.iter().map(|_| self.register()).collect();
        for ((outer, _), register) in function.captures.iter().zip(&registers) {
            let from = self.var(*outer);
            self.emit(Op::Move(*register, from));
        }
        self.emit(Op::Closure(dst, registers[0], id));
    }

    // ------------------------------------------------------------------ the end of a function

    fn tail_body(&mut self, body: &[Expr]) {
        match body.split_last() {
            None => {
                let dst = self.register();
                self.emit(Op::Nil(dst));
                self.emit(Op::Return(dst));
            }
            Some((last, first)) => {
                for expr in first {
                    self.step(|it| {
                        it.scratch(|it| {
                            let unused = it.register();
                            it.expr(expr, unused, Use::Nothing);
                        });
                    });
                }
                if first.is_empty() {
                    self.tail(last);
                } else {
                    self.step(|it| it.tail(last));
                }
            }
        }
    }

    /// An expression whose value is that of the function.
    fn tail(&mut self, expr: &Expr) {
        let around = std::mem::replace(&mut self.span, expr.span);
        let before = self.next;
        match &expr.kind {
            ExprKind::If(test, then, other) => {
                let no = self.label();
                self.test(test, no, false);
                let branch = self.branches();
                self.branch(branch, |it| it.tail(then));
                self.bind(no);
                self.branch(branch, |it| it.tail(other));
            }
            ExprKind::Let(parts, body) => {
                self.bindings(parts);
                self.tail_body(body);
            }
            ExprKind::Seq(body) => self.tail_body(body),
            ExprKind::And(parts) => self.tail_and_or(parts, false),
            ExprKind::Or(parts) => self.tail_and_or(parts, true),
            ExprKind::Case(subject, arms, otherwise) => self.tail_case(subject, arms, otherwise),
            ExprKind::Call(Callee::Function(f), args) => self.tail_call(*f, args),
            ExprKind::Call(Callee::Value(callee), args) => self.tail_call_value(callee, args),
            ExprKind::Var(var) => {
                let register = self.var(*var);
                self.emit(Op::Return(register));
            }
            _ => {
                let dst = self.register();
                self.part(expr, dst);
                self.emit(Op::Return(dst));
            }
        }
        self.next = before;
        self.span = around;
    }
}

/// True if one constant can stand for both: zeros of different signs are two numbers.
fn is_same(known: &Value, value: &Value) -> bool {
    match (known, value) {
        (Value::Imm(Imm::Float(a)), Value::Imm(Imm::Float(b))) => a.to_bits() == b.to_bits(),
        _ => known.identical(value),
    }
}

fn is_var(expr: &Expr) -> bool {
    matches!(expr.kind, ExprKind::Var(_))
}

/// True for what needs no register that something else could change.
fn is_simple(expr: &Expr) -> bool {
    matches!(expr.kind, ExprKind::Const(_) | ExprKind::Var(_) | ExprKind::Global(_))
}

pub(crate) fn place(span: Span) -> Place {
    Place { file: span.file.0, start: span.start, end: span.end }
}

fn set_target(op: &mut Op, to: Pc) {
    match op {
        Op::Jump(t)
        | Op::Loop(t)
        | Op::JumpIfFalse(_, t)
        | Op::JumpIfTrue(_, t)
        | Op::JumpIfNil(_, t)
        | Op::JumpUnlessNil(_, t)
        | Op::JumpUnlessLess(_, _, t)
        | Op::JumpUnlessLessEq(_, _, t)
        | Op::JumpUnlessNumEq(_, _, t)
        | Op::JumpIfNumEq(_, _, t)
        | Op::JumpUnlessLessInt(_, _, t)
        | Op::JumpUnlessLessEqInt(_, _, t)
        | Op::JumpUnlessMoreInt(_, _, t)
        | Op::JumpUnlessMoreEqInt(_, _, t)
        | Op::JumpUnlessEqInt(_, _, t)
        | Op::JumpIfSet(_, t)
        | Op::JumpUnlessConst(_, _, t)
        | Op::IterNext(_, t)
        | Op::JumpUnlessKind(_, _, t)
        | Op::Retry(_, t) => *t = to,
        other => unreachable!("{other:?} does not jump"),
    }
}

/// Sites are numbered within the function until it is finished.
fn move_site(op: &mut Op, by: u32) {
    match op {
        Op::CallPlan(_, _, site)
        | Op::CallValue(_, _, _, site)
        | Op::TailCallValue(_, _, site)
        | Op::Perform(_, _, site)
        | Op::Fork(_, _, _, site)
        | Op::Original(_, site) => site.0 += by,
        _ => {}
    }
}
