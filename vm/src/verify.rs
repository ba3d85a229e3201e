//! A check of compiled code: every operand names something that exists.
//!
//! The machine trusts the compiler; this says in tests and debug builds whether it may.

use crate::code::{FnId, Program};
use crate::op::{Op, Operand};

/// What is wrong with the code of a function; nothing for code that may run.
#[must_use]
pub fn function(program: &Program, id: FnId) -> Vec<String> {
    let Some(it) = program.functions.get(id.at()) else {
        return vec![format!("there is no function {}", id.0)];
    };
    let mut problems = Vec::new();
    let inside = |pc: crate::code::Pc| (it.entry..it.end).contains(&pc);
    for at in it.entry.0..it.end.0 {
        let Some(op) = program.code.get(at as usize) else {
            problems.push(format!("{}: the code ends before the function", it.name));
            break;
        };
        for operand in op.operands() {
            let exists = match operand {
                Operand::Reg(register) => register < it.registers,
                Operand::Num(_) => true,
                Operand::Target(pc) => inside(pc),
                Operand::Const(id) => id.at() < program.constants.len(),
                Operand::Global(id) => id.at() < program.globals.len(),
                Operand::Function(id) => id.at() < program.functions.len(),
                Operand::Native(id) => id.at() < program.natives.len(),
                Operand::Site(id) => program.sites.get(id.at()).is_some_and(|site| site.pc.0 == at),
                Operand::Failure(id) => program.failures.get(id).is_some(),
            };
            if !exists {
                problems.push(format!("{} at {}: {} names {operand:?}", it.name, at - it.entry.0, op.name()));
            }
        }
    }
    let last = it.end.0.checked_sub(1).and_then(|at| program.code.get(at as usize));
    if !matches!(
        last,
        Some(
            Op::Return(_)
                | Op::ReturnPlan(_)
                | Op::Jump(_)
                | Op::Loop(_)
                | Op::TailCall(..)
                | Op::TailCallValue(..)
                | Op::Raise(_)
                | Op::Fail(..)
        )
    ) {
        problems.push(format!("{}: the code runs over its end", it.name));
    }
    if program.code.len() != program.places.len() {
        problems.push("instructions and places differ in number".into());
    }
    problems
}
