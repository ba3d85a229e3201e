//! Branches, loops, handlers, clean-ups, and the ways out of them.

use vm::code::{FormKind, Pc, RoundKey};
use vm::op::{Count, Kind, Op, ShortConst};
use vm::value::Value;

use super::{Exit, Label, Lower, Protection, Target, Use};
use crate::ast::{Clause, Expr, ExprKind, VarId};

impl Lower<'_> {
    pub(super) fn if_(&mut self, test: &Expr, then: &Expr, other: &Expr, dst: u8, used: Use) {
        let (no, end) = (self.label(), self.label());
        self.test(test, no, false);
        let branch = self.branches();
        self.branch(branch, |it| it.expr(then, dst, used));
        if used == Use::Nothing && matches!(other.kind, ExprKind::Const(_)) {
            self.bind(no);
            return;
        }
        self.jump_to(end, Op::Jump);
        self.bind(no);
        self.branch(branch, |it| it.expr(other, dst, used));
        self.bind(end);
    }

    pub(super) fn and_or(&mut self, parts: &[Expr], dst: u8, used: Use, stop: fn(u8, Pc) -> Op) {
        let Some((last, first)) = parts.split_last() else { return };
        let end = self.label();
        for part in first {
            self.step(|it| it.expr(part, dst, Use::Value));
            self.jump_to(end, |to| stop(dst, to));
        }
        self.step(|it| it.expr(last, dst, used));
        self.bind(end);
    }

    pub(super) fn tail_and_or(&mut self, parts: &[Expr], or: bool) {
        let Some((last, first)) = parts.split_last() else { return };
        // Parts whose value is true or false jump to where that is returned.
        let (end, decided) = (self.label(), self.label());
        let value = self.register();
        let (mut values, mut booleans) = (false, false);
        for part in first {
            if self.is_boolean(part) {
                booleans = true;
                self.step(|it| it.test(part, decided, or));
            } else {
                values = true;
                self.step(|it| it.expr(part, value, Use::Value));
                self.jump_to(
                    end,
                    |to| if or { Op::JumpIfTrue(value, to) } else { Op::JumpIfFalse(value, to) },
                );
            }
        }
        self.step(|it| it.tail(last));
        if booleans {
            self.bind(decided);
            self.emit(if or { Op::True(value) } else { Op::False(value) });
        }
        if booleans || values {
            self.bind(end);
            self.emit(Op::Return(value));
        }
    }

    pub(super) fn case(
        &mut self,
        subject: &Expr,
        arms: &[(Vec<Value>, Vec<Expr>)],
        otherwise: &[Expr],
        dst: u8,
        used: Use,
    ) {
        let end = self.label();
        let register = self.operand(subject);
        let branch = self.branches();
        for (keys, body) in arms {
            let next = self.case_test(register, keys);
            self.branch(branch, |it| it.body(body, dst, used));
            self.jump_to(end, Op::Jump);
            self.bind(next);
        }
        self.branch(branch, |it| it.body(otherwise, dst, used));
        self.bind(end);
    }

    pub(super) fn tail_case(&mut self, subject: &Expr, arms: &[(Vec<Value>, Vec<Expr>)], otherwise: &[Expr]) {
        let register = self.operand(subject);
        let branch = self.branches();
        for (keys, body) in arms {
            let next = self.case_test(register, keys);
            self.branch(branch, |it| it.scratch(|it| it.tail_body(body)));
            self.bind(next);
        }
        self.branch(branch, |it| it.tail_body(otherwise));
    }

    /// Goes on if the register holds one of the keys, else at the label.
    fn case_test(&mut self, register: u8, keys: &[Value]) -> Label {
        let (next, body) = (self.label(), self.label());
        let Some((last, first)) = keys.split_last() else {
            self.jump_to(next, Op::Jump);
            return next;
        };
        for key in first {
            let other = self.label();
            self.jump_unless_const(register, key, other);
            self.jump_to(body, Op::Jump);
            self.bind(other);
        }
        self.jump_unless_const(register, last, next);
        self.bind(body);
        next
    }

    fn jump_unless_const(&mut self, register: u8, key: &Value, to: Label) {
        let constant = self.constant(key);
        match u16::try_from(constant.0) {
            Ok(short) => self.jump_to(to, |pc| Op::JumpUnlessConst(register, ShortConst(short), pc)),
            // Too many constants for a short index: compare with the native.
            Err(_) => self.scratch(|it| {
                let (first, second) = (it.register(), it.register());
                it.emit(Op::Move(first, register));
                it.emit(Op::Const(second, constant));
                if let Some(equal) = it.program.native("equal?") {
                    it.emit(Op::CallNative(first, first, Count(2), equal));
                }
                it.jump_to(to, |pc| Op::JumpIfFalse(first, pc));
            }),
        }
    }

    // ------------------------------------------------------------------ loops

    pub(super) fn while_(&mut self, test: &Expr, body: &[Expr], dst: u8) {
        let (start, end, out) = (self.label(), self.label(), self.label());
        self.uncounted += 1;
        self.bind(start);
        self.open(FormKind::Round(None));
        if !matches!(&test.kind, ExprKind::Const(value) if value.is_true()) {
            self.scratch(|it| it.test(test, end, false));
        }
        self.loop_body(body, dst, out);
        self.close();
        self.jump_to(start, Op::Loop);
        self.bind(end);
        self.uncounted -= 1;
        self.emit(Op::Nil(dst));
        self.bind(out);
    }

    fn loop_body(&mut self, body: &[Expr], dst: u8, out: Label) {
        let protections = self.protections.len();
        self.targets.push(Target::Loop { dst, end: out, protections });
        for expr in body {
            self.step(|it| {
                it.scratch(|it| {
                    let unused = it.register();
                    it.expr(expr, unused, Use::Nothing);
                });
            });
        }
        self.targets.pop();
    }

    pub(super) fn dolist(&mut self, var: VarId, list: &Expr, body: &[Expr], dst: u8) {
        let (element, rest, ranks) = (self.register(), self.register(), self.register());
        let _ = (rest, ranks);
        self.step(|it| {
            it.scratch(|it| {
                let register = it.operand(list);
                it.emit(Op::IterStart(element, register));
            });
        });
        let (start, end) = (self.label(), self.label());
        self.bind(start);
        self.jump_to(end, |to| Op::IterNext(element, to));
        let key = RoundKey::Element(element);
        self.round(key, var, element, |it, out| it.loop_body(body, dst, out), start, end);
    }

    pub(super) fn dotimes(&mut self, var: VarId, count: &Expr, body: &[Expr], dst: u8) {
        let (number, limit) = (self.register(), self.register());
        self.step(|it| {
            it.scratch(|it| {
                let register = it.operand(count);
                it.emit(Op::CountStart(limit, register));
            });
        });
        self.emit(Op::Int(number, 0));
        let (start, end) = (self.label(), self.label());
        self.bind(start);
        self.jump_to(end, |to| Op::JumpUnlessLess(number, limit, to));
        let key = RoundKey::Count(number);
        self.round(key, var, number, |it, out| it.loop_body(body, dst, out), start, end);
    }

    /// One round of a loop, and the way back. The result of the form is computed at `end`, where
    /// a `return` has its label as well: it jumps over the result.
    fn round(
        &mut self,
        key: RoundKey,
        var: VarId,
        register: u8,
        body: impl FnOnce(&mut Self, Label),
        start: Label,
        end: Label,
    ) {
        let out = self.label();
        self.rounds.push(key);
        self.open(FormKind::Round(Some(key)));
        self.vars[var.0 as usize] = register;
        if self.assigned[var.0 as usize] {
            // The program changes its variable; the loop keeps its own.
            let own = self.register();
            self.emit(Op::Move(own, register));
            self.vars[var.0 as usize] = own;
        }
        body(self, out);
        self.close();
        self.rounds.pop();
        if let RoundKey::Count(number) = key {
            self.emit(Op::AddInt(number, number, 1));
        }
        self.jump_to(start, Op::Loop);
        self.bind(end);
        self.pending_out = Some(out);
    }

    /// The value of a loop that came to its end.
    pub(super) fn result(&mut self, result: &Expr, dst: u8, used: Use) {
        let out = self.pending_out.take();
        self.expr(result, dst, used);
        if let Some(out) = out {
            self.bind(out);
        }
    }

    // ------------------------------------------------------------------ handlers and clean-ups

    pub(super) fn handle(&mut self, clauses: &[Clause], body: &[Expr], dst: u8, used: Use) {
        self.guards = true;
        let (failure, mark) = (self.register(), self.register());
        let (start, handler, end) = (self.label(), self.label(), self.label());
        self.emit(Op::Mark(mark));
        self.bind(start);
        self.open(FormKind::Guarded { handler: Pc(handler.0 as u32), failure });
        self.body(body, dst, used);
        self.close();
        self.jump_to(end, Op::Jump);
        self.bind(handler);
        self.open(FormKind::Clauses { failure });
        let protections = self.protections.len();
        self.targets.push(Target::Clause { dst, end, body: start, mark, failure, protections });
        for clause in clauses {
            self.clause(clause, failure);
        }
        self.targets.pop();
        self.emit(Op::Raise(failure));
        self.close();
        self.bind(end);
    }

    fn clause(&mut self, clause: &Clause, failure: u8) {
        let next = self.label();
        let body = self.label();
        let Some((last, first)) = clause.kinds.split_last() else { return };
        for kind in first {
            let other = self.label();
            self.jump_to(other, |to| Op::JumpUnlessKind(failure, Kind(kind.0 as u16), to));
            self.jump_to(body, Op::Jump);
            self.bind(other);
        }
        self.jump_to(next, |to| Op::JumpUnlessKind(failure, Kind(last.0 as u16), to));
        self.bind(body);
        let around = std::mem::replace(&mut self.span, clause.span);
        self.step(|it| {
            it.scratch(|it| {
                if let Some(var) = clause.var {
                    it.vars[var.0 as usize] = failure;
                    if it.assigned[var.0 as usize] {
                        let own = it.register();
                        it.emit(Op::Move(own, failure));
                        it.vars[var.0 as usize] = own;
                    }
                }
                let unused = it.register();
                it.body(&clause.body, unused, Use::Nothing);
                it.emit(Op::Raise(failure));
            });
        });
        self.span = around;
        self.bind(next);
    }

    pub(super) fn propagate(&mut self) {
        let clause = self.targets.iter().rev().find_map(|target| match target {
            Target::Clause { failure, .. } => Some(*failure),
            Target::Loop { .. } => None,
        });
        if let Some(failure) = clause {
            self.emit(Op::Raise(failure));
        }
    }

    pub(super) fn retry(&mut self) {
        let clause = self.targets.iter().rev().find_map(|target| match target {
            Target::Clause { body, mark, protections, .. } => Some((*body, *mark, *protections)),
            Target::Loop { .. } => None,
        });
        if let Some((body, mark, protections)) = clause {
            self.leave(Exit::Retry { mark, body }, protections);
        }
    }

    pub(super) fn return_(&mut self, value: &Expr) {
        let (dst, end, protections) = match self.targets.last() {
            Some(Target::Loop { dst, end, protections } | Target::Clause { dst, end, protections, .. }) => {
                (*dst, *end, *protections)
            }
            None => return,
        };
        let complete = self.register();
        self.expr(value, complete, Use::Value);
        self.emit(Op::Move(dst, complete));
        self.leave(Exit::Jump(end), protections);
    }

    /// Leaves forms: the clean-ups of all that stand between run first, inner ones before outer.
    fn leave(&mut self, exit: Exit, protections: usize) {
        if self.protections.len() > protections
            && let Some(protection) = self.protections.last_mut()
        {
            let number = protection.exits.len() as i32;
            protection.exits.push(exit);
            protection.depths.push(protections);
            let (pending, cleanup) = (protection.pending, protection.cleanup);
            self.emit(Op::Int(pending, number));
            self.jump_to(cleanup, Op::Jump);
            return;
        }
        match exit {
            Exit::Jump(label) => self.jump_to(label, Op::Jump),
            Exit::Retry { mark, body } => self.jump_to(body, |to| Op::Retry(mark, to)),
        }
    }

    pub(super) fn protect(
        &mut self,
        body: &Expr,
        cleanup: &[Expr],
        name: vm::value::Symbol,
        dst: u8,
        used: Use,
    ) {
        self.guards = true;
        let pending = self.register();
        let start = self.label();
        self.protections.push(Protection { pending, cleanup: start, exits: Vec::new(), depths: Vec::new() });
        self.open(FormKind::Protected { cleanup: Pc(start.0 as u32), pending, name });
        self.expr(body, dst, used);
        self.emit(Op::Nil(pending));
        self.close();
        let Some(protection) = self.protections.pop() else { return };
        self.bind(start);
        self.open(FormKind::CleanUp { pending, name });
        self.emit(Op::BeginCleanUp);
        for expr in cleanup {
            self.step(|it| {
                it.scratch(|it| {
                    let unused = it.register();
                    it.expr(expr, unused, Use::Nothing);
                });
            });
        }
        self.close();
        self.emit(Op::EndCleanUp(pending));
        for (number, (exit, depth)) in protection.exits.iter().zip(&protection.depths).enumerate() {
            let next = self.label();
            self.jump_unless_const(pending, &Value::int(number as i64), next);
            self.leave(*exit, *depth);
            self.bind(next);
        }
    }
}
