//! Calls: arguments into a window, and natives that are instructions.

use vm::code::{FnId, FnKind, SiteId};
use vm::machine::ForkKind;
use vm::op::{Count, Op};
use vm::value::{Imm, Symbol, Value};

use super::{Lower, Use};
use crate::ast::{Callee, Expr, ExprKind, Function};

/// Makes an instruction of one operand.
type OneOperand = fn(u8, u8) -> Op;
/// Makes an instruction of two operands.
type TwoOperands = fn(u8, u8, u8) -> Op;

/// Natives of two arguments that are an instruction. The last flag swaps the arguments.
const BINARY: &[(&str, TwoOperands, bool)] = &[
    ("+", Op::Add, false),
    ("-", Op::Sub, false),
    ("*", Op::Mul, false),
    ("/", Op::Div, false),
    ("<", Op::Less, false),
    ("<=", Op::LessEq, false),
    (">", Op::Less, true),
    (">=", Op::LessEq, true),
    ("=", Op::NumEq, false),
    ("identical?", Op::Identical, false),
    ("cons", Op::Cons, false),
];

/// Natives of one argument that are an instruction.
const UNARY: &[(&str, OneOperand)] = &[
    ("not", Op::Not),
    ("null?", Op::IsNil),
    ("first", Op::First),
    ("car", Op::First),
    ("rest", Op::Rest),
    ("cdr", Op::Rest),
];

/// Natives among these whose value is true or false.
const BOOLEAN: &[&str] = &["not", "null?", "<", "<=", ">", ">=", "=", "identical?"];

impl Lower<'_> {
    /// Notes a call, made by the next instruction.
    pub(super) fn site(
        &mut self,
        callee: Option<FnId>,
        name: Symbol,
        args: usize,
        value_used: Use,
    ) -> SiteId {
        let in_node = matches!(self.kind, FnKind::Plan | FnKind::Branch | FnKind::TopLevel);
        self.sites.push(vm::code::Site {
            owner: self.id,
            pc: vm::code::Pc(self.code.len() as u32),
            callee,
            name,
            args: args as u8,
            hash: 0,
            form: self.form,
            rounds: self.rounds.clone().into(),
            counted: !in_node || self.uncounted > 0,
            value_used: value_used == Use::Value,
        });
        SiteId(self.sites.len() as u32 - 1)
    }

    pub(super) fn native_name(&self, callee: &Callee) -> Option<&'static str> {
        let Callee::Native(native) = callee else { return None };
        self.program.natives.get(native.at()).map(|native| native.name)
    }

    pub(super) fn call(&mut self, callee: &Callee, args: &[Option<Expr>], dst: u8, used: Use) {
        if let Some(name) = self.native_name(callee)
            && self.instruction(name, args, dst)
        {
            return;
        }
        match callee {
            Callee::Function(f) => {
                let window = self.window(args);
                let name = self.program.functions[f.at()].name;
                self.site(Some(*f), name, args.len(), used);
                self.emit(Op::Call(dst, window, *f));
            }
            Callee::Plan(f) => {
                let window = self.window(args);
                let name = self.program.functions[f.at()].name;
                let site = self.site(Some(*f), name, args.len(), used);
                self.emit(Op::CallPlan(dst, window, site));
            }
            Callee::Native(native) => {
                let window = self.window(args);
                let name = self.program.natives[native.at()].name;
                // A native may call back what it was given, so it is a site as well.
                self.site(None, Symbol::from(name), args.len(), used);
                self.emit(Op::CallNative(dst, window, Count(args.len() as u8), *native));
            }
            Callee::Value(callee) => {
                let window = self.register();
                self.part(callee, window);
                self.window(args);
                let site = self.site(None, value_name(self, callee), args.len(), used);
                self.emit(Op::CallValue(dst, window, Count(args.len() as u8), site));
            }
        }
    }

    /// Arguments in consecutive registers above all in use; the first of them.
    fn window(&mut self, args: &[Option<Expr>]) -> u8 {
        let registers: Vec<u8> = args.iter().map(|_| self.register()).collect();
        let first = registers.first().copied().unwrap_or_else(|| self.scratch(Self::register));
        let mut moved = false;
        for (at, (arg, register)) in args.iter().zip(&registers).enumerate() {
            if std::mem::take(&mut moved) {
                continue;
            }
            match arg {
                Some(Expr { kind: ExprKind::Var(a), .. })
                    if let Some(Some(Expr { kind: ExprKind::Var(b), .. })) = args.get(at + 1) =>
                {
                    let (a, b) = (self.var(*a), self.var(*b));
                    self.emit(Op::Move2(*register, a, b));
                    moved = true;
                }
                Some(arg) => self.part(arg, *register),
                None => {
                    let unset = self.constant(&Value::UNSET);
                    self.emit(Op::Const(*register, unset));
                }
            }
        }
        first
    }

    /// Natives that are instructions of the machine. False if this is none.
    fn instruction(&mut self, name: &str, args: &[Option<Expr>], dst: u8) -> bool {
        match args {
            [Some(a)] => {
                let Some((_, op)) = UNARY.iter().find(|(known, _)| *known == name) else { return false };
                let a = self.operand_in(a, dst);
                self.emit(op(dst, a));
            }
            [Some(a), Some(b)] => {
                let Some((_, op, swap)) = BINARY.iter().find(|(known, ..)| *known == name) else {
                    return false;
                };
                let sum = small_int(b, name).map(|i| (a, i));
                let sum = sum.or_else(|| small_int(a, name).filter(|_| name == "+").map(|i| (b, i)));
                if let Some((other, i)) = sum {
                    let other = self.operand_in(other, dst);
                    self.emit(Op::AddInt(dst, other, i));
                    return true;
                }
                let a = self.operand_in(a, dst);
                let b = self.operand(b);
                self.emit(if *swap { op(dst, b, a) } else { op(dst, a, b) });
            }
            _ => {
                if name != "list" {
                    return false;
                }
                let items: Vec<Expr> = args.iter().flatten().cloned().collect();
                let first = self.in_a_row(&items);
                self.emit(Op::List(dst, first, Count(items.len() as u8)));
            }
        }
        true
    }

    /// True for an expression whose value is true or false, computed by an instruction.
    pub(super) fn is_boolean(&self, expr: &Expr) -> bool {
        let ExprKind::Call(callee, _) = &expr.kind else { return false };
        self.native_name(callee).is_some_and(|name| BOOLEAN.contains(&name))
    }

    /// Kind, what else it needs, and a function for each branch, in a row of registers.
    pub(super) fn fork(
        &mut self,
        kind: ForkKind,
        extra: &Expr,
        branches: &[(Symbol, Function)],
        dst: u8,
        used: Use,
    ) {
        let registers: Vec<u8> = (0..branches.len() + 2).map(|_| self.register()).collect();
        self.emit(Op::Int(registers[0], kind as i32));
        self.part(extra, registers[1]);
        for ((_, function), register) in branches.iter().zip(&registers[2..]) {
            self.scratch(|it| it.lambda(function, *register));
        }
        // Nobody waits for a branch by its value: the form's value is a list, or that of one of them.
        let used = if used == Use::Value { Use::Value } else { Use::Last };
        let first = SiteId(self.sites.len() as u32);
        for (name, _) in branches {
            self.site(None, *name, 0, used);
        }
        self.emit(Op::Fork(dst, registers[0], Count(branches.len() as u8), first));
    }

    pub(super) fn perform(&mut self, desc: &Expr, goal: Option<&Function>, dst: u8, used: Use) {
        let window = self.register();
        let goal_register = self.register();
        self.part(desc, window);
        match goal {
            Some(goal) => self.scratch(|it| it.lambda(goal, goal_register)),
            None => self.emit(Op::Nil(goal_register)),
        }
        let name = match &desc.kind {
            ExprKind::Desc(kind, _) => *kind,
            _ => Symbol::from("perform"),
        };
        let site = self.site(None, name, 2, used);
        self.emit(Op::Perform(dst, window, site));
    }

    pub(super) fn tail_call(&mut self, f: FnId, args: &[Option<Expr>]) {
        let window = self.window(args);
        self.emit(Op::TailCall(window, Count(args.len() as u8), f));
        // A frame that owes something calls in an ordinary way and comes back here.
        self.emit(Op::Return(window));
    }

    pub(super) fn tail_call_value(&mut self, callee: &Expr, args: &[Option<Expr>]) {
        let window = self.register();
        self.part(callee, window);
        self.window(args);
        let site = self.site(None, value_name(self, callee), args.len(), Use::Value);
        self.emit(Op::TailCallValue(window, Count(args.len() as u8), site));
        // What is no function of the program is called in an ordinary way and comes back here.
        self.emit(Op::Return(window));
    }
}

/// The number to add, for sums with a small constant.
fn small_int(expr: &Expr, name: &str) -> Option<i32> {
    let ExprKind::Const(Value::Imm(Imm::Int(i))) = expr.kind else { return None };
    let i = i32::try_from(i).ok()?;
    match name {
        "+" => Some(i),
        "-" => i.checked_neg(),
        _ => None,
    }
}

fn value_name(lower: &Lower<'_>, callee: &Expr) -> Symbol {
    match &callee.kind {
        ExprKind::Global(global) => lower.program.globals[global.at()],
        _ => Symbol::from("call"),
    }
}
