//! Tests of conditions: comparisons that are jumps.

use vm::code::Pc;
use vm::op::Op;
use vm::value::{Imm, Value};

use super::{Label, Lower};
use crate::ast::{Expr, ExprKind};

impl Lower<'_> {
    /// Goes to `to` if the truth of the expression is `when`, else on.
    pub(super) fn test(&mut self, expr: &Expr, to: Label, when: bool) {
        let around = std::mem::replace(&mut self.span, expr.span);
        self.scratch(|it| it.test_kind(expr, to, when));
        self.span = around;
    }

    fn test_kind(&mut self, expr: &Expr, to: Label, when: bool) {
        match &expr.kind {
            ExprKind::Const(value) => {
                if value.is_true() == when {
                    self.jump_to(to, Op::Jump);
                }
            }
            ExprKind::And(parts) | ExprKind::Or(parts) => {
                let is_or = matches!(expr.kind, ExprKind::Or(_));
                self.connective(parts, is_or, to, when);
            }
            ExprKind::Call(callee, args) => match (self.native_name(callee), args.as_slice()) {
                (Some("not"), [Some(inner)]) => self.test(inner, to, !when),
                (Some("null?"), [Some(inner)]) => {
                    let register = self.operand(inner);
                    self.jump_to(to, |pc| {
                        if when { Op::JumpIfNil(register, pc) } else { Op::JumpUnlessNil(register, pc) }
                    });
                }
                (Some(name), [Some(a), Some(b)]) if !when => {
                    if !self.comparison(name, a, b, to) {
                        self.plain_test(expr, to, when);
                    }
                }
                (Some("="), [Some(a), Some(b)]) => {
                    let (a, b) = (self.operand(a), self.operand(b));
                    self.jump_to(to, |pc| Op::JumpIfNumEq(a, b, pc));
                }
                _ => self.plain_test(expr, to, when),
            },
            _ => self.plain_test(expr, to, when),
        }
    }

    fn plain_test(&mut self, expr: &Expr, to: Label, when: bool) {
        let register = self.operand(expr);
        self.jump_to(
            to,
            |pc| if when { Op::JumpIfTrue(register, pc) } else { Op::JumpIfFalse(register, pc) },
        );
    }

    fn connective(&mut self, parts: &[Expr], is_or: bool, to: Label, when: bool) {
        if is_or == when {
            // `or` goes there at the first true part, `and` at the first false one.
            for part in parts {
                self.step(|it| it.test(part, to, when));
            }
            return;
        }
        let on = self.label();
        let Some((last, first)) = parts.split_last() else { return };
        for part in first {
            self.step(|it| it.test(part, on, !when));
        }
        self.step(|it| it.test(last, to, when));
        self.bind(on);
    }

    /// Goes to `to` unless the comparison holds. False if this is no comparison.
    fn comparison(&mut self, name: &str, a: &Expr, b: &Expr, to: Label) -> bool {
        type WithInt = fn(u8, i16, Pc) -> Op;
        type WithReg = fn(u8, u8, Pc) -> Op;
        let (with_int, with_reg, swap): (WithInt, WithReg, bool) = match name {
            "<" => (Op::JumpUnlessLessInt, Op::JumpUnlessLess, false),
            "<=" => (Op::JumpUnlessLessEqInt, Op::JumpUnlessLessEq, false),
            ">" => (Op::JumpUnlessMoreInt, Op::JumpUnlessLess, true),
            ">=" => (Op::JumpUnlessMoreEqInt, Op::JumpUnlessLessEq, true),
            "=" => (Op::JumpUnlessEqInt, Op::JumpUnlessNumEq, false),
            _ => return false,
        };
        let a = self.operand(a);
        if let ExprKind::Const(Value::Imm(Imm::Int(i))) = b.kind
            && let Ok(i) = i16::try_from(i)
        {
            self.jump_to(to, |pc| with_int(a, i, pc));
            return true;
        }
        let b = self.operand(b);
        self.jump_to(to, |pc| if swap { with_reg(b, a, pc) } else { with_reg(a, b, pc) });
        true
    }
}
