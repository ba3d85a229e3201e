//! Code as text, for `pleach check --code` and for those who look for a mistake in the compiler.

use std::fmt::Write as _;

use crate::code::{FnId, FormKind, Pc, Program};
use crate::op::{Op, Operand};
use crate::print;

/// The instructions of a function, one per line, with the forms that they belong to.
#[must_use]
pub fn function(program: &Program, id: FnId) -> String {
    let Some(it) = program.functions.get(id.at()) else { return String::new() };
    let params: Vec<&str> = it.params.names.iter().map(|name| name.as_str()).collect();
    let mut out =
        format!("{} {} ({}) registers={}\n", it.kind.word(), it.name, params.join(" "), it.registers);
    for at in it.entry.0..it.end.0 {
        let op = program.code[at as usize];
        let shown: Vec<String> =
            op.operands().iter().map(|operand| text(program, it.entry, *operand)).collect();
        let _ = writeln!(out, "  {:>4}  {:<20} {}", at - it.entry.0, op.name(), shown.join(" "));
    }
    for form in &program.forms[it.forms.start as usize..it.forms.end as usize] {
        let what = match form.kind {
            FormKind::Body | FormKind::Step | FormKind::Branch(_) => continue,
            FormKind::Round(None) => "round".to_string(),
            FormKind::Round(Some(key)) => format!("round {key:?}"),
            FormKind::Guarded { handler, failure } => {
                format!("guarded, handler {} r{failure}", handler.0 - it.entry.0)
            }
            FormKind::Clauses { failure } => format!("clauses r{failure}"),
            FormKind::Protected { cleanup, pending, .. } => {
                format!("protected, clean-up {} r{pending}", cleanup.0 - it.entry.0)
            }
            FormKind::CleanUp { pending, .. } => format!("clean-up r{pending}"),
        };
        let _ = writeln!(
            out,
            "  {:>4} – {:<4} {what}",
            form.start.0 - it.entry.0,
            form.end.0.saturating_sub(it.entry.0)
        );
    }
    out
}

fn text(program: &Program, entry: Pc, operand: Operand) -> String {
    match operand {
        Operand::Reg(register) => format!("r{register}"),
        Operand::Num(number) => number.to_string(),
        Operand::Target(pc) => format!("@{}", pc.0.saturating_sub(entry.0)),
        Operand::Const(id) => {
            let shown = |value| print::Printer::new(Some(program), true, 80).text(value);
            program.constants.get(id.at()).map_or("?".into(), shown)
        }
        Operand::Global(id) => program.globals.get(id.at()).map_or("?".into(), |name| name.to_string()),
        Operand::Function(id) => program.functions.get(id.at()).map_or("?".into(), |it| it.name.to_string()),
        Operand::Native(id) => program.natives.get(id.at()).map_or("?".into(), |it| it.name.to_string()),
        Operand::Site(id) => program.sites.get(id.at()).map_or("?".into(), |it| it.name.to_string()),
        Operand::Failure(id) => program.failures.get(id).map_or("?".into(), |it| it.name.to_string()),
    }
}

/// BYTECODE.md: what each instruction does, from the one table.
#[must_use]
pub fn manual() -> String {
    let mut out = String::from(
        "# Instructions\n\nMade from the table in `src/op.rs` by `UPDATE_EXPECT=1 cargo test -p pleach-vm`. \
         `d` is the register that takes the result.\n\n| instruction | operands | does |\n|---|---|---|\n",
    );
    for (name, operands, doc) in Op::TABLE {
        let _ = writeln!(out, "| `{name}` | {} | {} |", operands.join(" "), doc.trim());
    }
    out
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_manual_is_up_to_date() {
        expect_test::expect_file!["../BYTECODE.md"].assert_eq(&super::manual());
    }
}
