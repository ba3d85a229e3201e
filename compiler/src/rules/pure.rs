//! Functions that rules call only compute, or look at the world: this looks for what else they could do.
//!
//! A function is looked at when it has been compiled, with all that its instructions mention.

use std::collections::BTreeSet;

use vm::code::{FnId, FnKind, Program};
use vm::native::Effect;
use vm::op::{Op, Operand};
use vm::value::{Imm, Value};

use crate::Compiler;
use crate::error::CompileError;

/// Natives that need no grant, but a task that can wait or a run that can change.
const OF_TASKS: [&str; 12] = [
    "sleep",
    "set-value",
    "pulse",
    "evaporate",
    "suspend",
    "wake-up",
    "join",
    "status",
    "%wait-for",
    "%next-rise",
    "run-plan",
    "edit-tree",
];

impl Compiler<'_> {
    /// Reports functions called by rules of this text that do more than compute.
    pub(crate) fn check_called(&mut self) {
        for called in std::mem::take(&mut self.called) {
            if let Some(why) = impurity(self.program, called.function) {
                self.error(CompileError::Impure { name: called.name.to_string(), why, at: called.at });
            }
        }
    }
}

/// What a function does besides computing, if it does.
fn impurity(program: &Program, function: FnId) -> Option<String> {
    let mut seen = BTreeSet::from([function]);
    let mut todo = vec![function];
    while let Some(id) = todo.pop() {
        let function = program.functions.get(id.at())?;
        if function.kind == FnKind::Plan {
            return Some(format!("calls the plan `{}`", function.name));
        }
        for pc in function.entry.0..function.end.0 {
            let op = program.code[pc as usize];
            match op {
                Op::Perform(..) => return Some("performs an action".into()),
                Op::Fork(..) => return Some("starts tasks".into()),
                _ => {}
            }
            for operand in op.operands() {
                match mentioned(program, operand) {
                    Some(Imm::Function(id)) if seen.insert(id) => todo.push(id),
                    Some(Imm::Native(native)) => {
                        let native = &program.natives[native.at()];
                        if !matches!(native.effect, Effect::Pure | Effect::Look) {
                            return Some(format!(
                                "uses `{}`, which has the effect {}",
                                native.name,
                                native.effect.name()
                            ));
                        }
                        if OF_TASKS.contains(&native.name) {
                            return Some(format!("uses `{}`, which is for tasks", native.name));
                        }
                    }
                    _ => {}
                }
            }
        }
    }
    None
}

/// The function that an operand names.
fn mentioned(program: &Program, operand: Operand) -> Option<Imm> {
    match operand {
        Operand::Function(id) => Some(Imm::Function(id)),
        Operand::Native(id) => Some(Imm::Native(id)),
        Operand::Const(id) => match program.constants.get(id.at())? {
            Value::Imm(imm) => Some(*imm),
            Value::Obj(_) => None,
        },
        Operand::Site(id) => program.sites.get(id.at())?.callee.map(Imm::Function),
        _ => None,
    }
}
