//! Takes moves out of the code of a clause.
//!
//! The lowering gives each variable a register of its own, and moves it to where a goal wants it. What makes
//! the value can often put it there at once. That is done where the code runs straight on, and where nobody sees it:
//! the variable is used there only, its new register for nothing else in between, and nothing is called in between.
//! Where the clause calls, it may go on again after each call; then the new register must be written nowhere else.

use super::Rules;
use super::clause::PredId;
use super::op::{Part, RuleOp, Template};
use crate::code::Pc;

/// Takes out moves from `entry` to the end of the code; it is that of one clause with so many arguments.
pub(super) fn take_out(rules: &mut Rules, entry: Pc, arity: usize) {
    let is_straight = |op: &RuleOp| {
        !matches!(op, RuleOp::Jump(_) | RuleOp::Try(..) | RuleOp::Groups(..) | RuleOp::Collect(..))
    };
    if !rules.code[entry.at()..].iter().all(is_straight) {
        return;
    }
    let mut at = entry.at();
    while at < rules.code.len() {
        let maker = match rules.code[at] {
            RuleOp::Move(d, s) if usize::from(s) >= arity => maker(rules, entry, at, d, s, arity),
            _ => None,
        };
        match maker {
            Some((made, op)) => {
                rules.code[made] = op;
                rules.code.remove(at);
                rules.places.remove(at);
            }
            None => at += 1,
        }
    }
}

/// The instruction that makes the value of `s`, and what it is if it writes to `d` at once; nothing where
/// somebody would see that. The move is at `at`.
fn maker(rules: &Rules, entry: Pc, at: usize, d: u8, s: u8, arity: usize) -> Option<(usize, RuleOp)> {
    let values = |template: Template| rules.templates[template.0 as usize].values as u8;
    let count = |op: &RuleOp, register: u8| {
        let (mut reads, mut writes) = (0, 0);
        let arity = |predicate: PredId| rules.predicates[predicate.at()].declared.arity;
        op.reads(&arity, &values, &mut |it| reads += usize::from(it == register));
        op.writes(&values, &mut |it| writes += usize::from(it == register));
        (reads, writes)
    };
    let code = &rules.code[entry.at()..];
    let of = |register: u8| {
        let all = code.iter().map(|op| count(op, register));
        all.fold((0, 0), |sum, it| (sum.0 + it.0, sum.1 + it.1))
    };
    if of(s) != (1, 1) {
        return None;
    }
    let calls = |op: &RuleOp| {
        matches!(op, RuleOp::Call(..) | RuleOp::CallNative(..) | RuleOp::CallValue(..) | RuleOp::CallFun(..))
    };
    if code.iter().any(calls) && (usize::from(d) < arity || of(d).1 > 1) {
        return None;
    }
    let made = entry.at() + code.iter().position(|op| count(op, s).1 == 1)?;
    let op = rules.code[made].writing(s, d)?;
    // A choice of a native goal keeps the registers of variables only, so nothing else outlives a call.
    let between = rules.code.get(made + 1..at)?;
    let is_free = between.iter().all(|op| count(op, d) == (0, 0) && !calls(op));
    (is_free && count(&rules.code[made], d).1 == 0).then_some((made, op))
}

impl RuleOp {
    /// The same with `d` in the place of `s`, which it writes; nothing where it may need what is in `d`.
    fn writing(self, s: u8, d: u8) -> Option<RuleOp> {
        let other = |part: Part| if part == Part::First(s) { Part::First(d) } else { part };
        let to = |register: u8| if register == s { d } else { register };
        Some(match self {
            RuleOp::GetPair(a, first, rest) if first != Part::Same(d) && rest != Part::Same(d) => {
                RuleOp::GetPair(a, other(first), other(rest))
            }
            RuleOp::GetParts(a, first, rest) => RuleOp::GetParts(a, to(first), to(rest)),
            RuleOp::GetRest(a, first, rest) if first != d => RuleOp::GetRest(a, first, to(rest)),
            RuleOp::Fresh(_) => RuleOp::Fresh(d),
            RuleOp::Move(_, from) => RuleOp::Move(d, from),
            RuleOp::PutConst(_, k) => RuleOp::PutConst(d, k),
            RuleOp::Add(_, a, b) => RuleOp::Add(d, a, b),
            RuleOp::Sub(_, a, b) => RuleOp::Sub(d, a, b),
            RuleOp::Mul(_, a, b) => RuleOp::Mul(d, a, b),
            RuleOp::Div(_, a, b) => RuleOp::Div(d, a, b),
            RuleOp::AddInt(_, a, i) => RuleOp::AddInt(d, a, i),
            _ => return None,
        })
    }
}
