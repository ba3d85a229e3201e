//! The calls of a function, in the order of the text: draws are keyed by their numbers.

use compiler::ast::{Callee, Expr, ExprKind, Function};
use vm::code::{FnKind, Program};
use vm::value::Symbol;

use super::eval::address;

/// Address and name of each call in a function, and of each branch of its parallel forms; not of those in
/// functions inside of it. A tail call of a function of the program has no number: it leaves no trace.
pub fn calls_of(program: &Program, function: &Function) -> Vec<(usize, Symbol)> {
    let mut calls = Calls { program, found: Vec::new() };
    function.inputs.iter().filter_map(|(_, default)| default.as_ref()).for_each(|it| calls.expr(it, false));
    calls.body(&function.body, matches!(function.kind, FnKind::Function | FnKind::Lambda));
    calls.found
}

/// What a call of a value is called.
fn value_name(program: &Program, callee: &Expr) -> Symbol {
    match &callee.kind {
        ExprKind::Global(global) => program.globals[global.at()],
        _ => Symbol::from("call"),
    }
}

/// What the performing of a description is called.
fn perform_name(desc: &Expr) -> Symbol {
    match &desc.kind {
        ExprKind::Desc(kind, _) => *kind,
        _ => Symbol::from("perform"),
    }
}

struct Calls<'a> {
    program: &'a Program,
    found: Vec<(usize, Symbol)>,
}

impl Calls<'_> {
    fn all<'e>(&mut self, exprs: impl IntoIterator<Item = &'e Expr>) {
        exprs.into_iter().for_each(|expr| self.expr(expr, false));
    }

    fn body(&mut self, body: &[Expr], tail: bool) {
        let Some((last, first)) = body.split_last() else { return };
        self.all(first);
        self.expr(last, tail);
    }

    fn expr(&mut self, expr: &Expr, tail: bool) {
        match &expr.kind {
            ExprKind::Const(_)
            | ExprKind::Var(_)
            | ExprKind::Global(_)
            | ExprKind::Lambda(_)
            | ExprKind::Retry
            | ExprKind::Propagate
            | ExprKind::CountDown(_)
            | ExprKind::Original => {}
            ExprKind::Define(_, it)
            | ExprKind::Set(_, it)
            | ExprKind::Return(it)
            | ExprKind::Raise(it)
            | ExprKind::Counter(it) => self.expr(it, false),
            ExprKind::Let(parts, body) => {
                self.all(parts.iter().map(|(_, value)| value));
                self.body(body, tail);
            }
            ExprKind::If(test, then, other) => {
                self.expr(test, false);
                self.expr(then, tail);
                self.expr(other, tail);
            }
            ExprKind::And(body) | ExprKind::Or(body) | ExprKind::Seq(body) => self.body(body, tail),
            ExprKind::Vector(items) | ExprKind::Map(items) => self.all(items),
            ExprKind::Case(subject, arms, otherwise) => {
                self.expr(subject, false);
                arms.iter().for_each(|(_, body)| self.body(body, tail));
                self.body(otherwise, tail);
            }
            ExprKind::While(test, body) => {
                self.expr(test, false);
                self.all(body);
            }
            ExprKind::Dolist { list: over, body, result, .. }
            | ExprKind::Dotimes { count: over, body, result, .. } => {
                self.expr(over, false);
                self.all(body);
                self.expr(result, false);
            }
            ExprKind::Handle(clauses, body) => {
                self.all(body);
                self.all(clauses.iter().flat_map(|clause| &clause.body));
            }
            ExprKind::Fail(_, fields) | ExprKind::MakeFailure(_, fields) | ExprKind::Desc(_, fields) => {
                self.all(fields.iter().map(|(_, value)| value));
            }
            ExprKind::Protect(body, cleanup, _) => {
                self.expr(body, false);
                self.all(cleanup);
            }
            ExprKind::Matches(_, pattern, value) => self.all([&**pattern, &**value]),
            ExprKind::Perform(desc, _) => {
                self.expr(desc, false);
                self.found.push((address(expr), perform_name(desc)));
            }
            ExprKind::Fork { extra, branches, .. } => {
                self.expr(extra, false);
                self.found.extend(branches.iter().map(|it| (std::ptr::from_ref(it) as usize, it.0)));
            }
            ExprKind::Call(callee, args) => {
                if let Callee::Value(callee) = callee {
                    self.expr(callee, false);
                }
                self.all(args.iter().flatten());
                let name = match callee {
                    Callee::Function(_) if tail => return,
                    Callee::Function(it) | Callee::Plan(it) => self.program.functions[it.at()].name,
                    Callee::Native(it) => Symbol::from(self.program.natives[it.at()].name),
                    Callee::Value(callee) => value_name(self.program, callee),
                };
                self.found.push((address(expr), name));
            }
        }
    }
}
