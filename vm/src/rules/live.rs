//! Which registers a clause needs from an instruction on.

use super::Rules;
use super::clause::PredId;
use super::op::RuleOp;
use crate::code::Pc;

/// The registers that a clause needs from an instruction on.
pub(super) struct Live {
    pub registers: Vec<u8>,
    /// It ends a negation, collection or test that began before.
    pub encloses: bool,
}

/// What a clause needs from an instruction on. Its code runs forward only, so a register that is read
/// before it is written, in the order of the code, is needed.
pub(super) fn live(rules: &Rules, pc: Pc) -> Live {
    let end = rules.clause_end(pc);
    let mut registers = Vec::new();
    let mut written = [false; 256];
    let mut encloses = false;
    for op in &rules.code[pc.at()..end.at()] {
        let mut reads = |register: u8| {
            if !written[register as usize] && !registers.contains(&register) {
                registers.push(register);
            }
        };
        let arity = |predicate: PredId| rules.predicates[predicate.at()].declared.arity;
        op.reads(&arity, &|template| rules.templates[template.0 as usize].values as u8, &mut reads);
        if let RuleOp::Cut(a) | RuleOp::Close(a) | RuleOp::Add1(a, _) | RuleOp::Collected(a) = op {
            encloses |= !written[*a as usize];
        }
        op.writes(&|template| rules.templates[template.0 as usize].values as u8, &mut |register| {
            written[register as usize] = true;
        });
    }
    Live { registers, encloses }
}
