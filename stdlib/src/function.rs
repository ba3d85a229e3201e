//! Functions as values. What combines them is in `function.plan`.

use vm::code::{FnId, FnKind, Program};
use vm::machine::Ctx;
use vm::native::{Next, Raise, type_error};
use vm::value::{Imm, Obj, Symbol, Value};

use crate::sequence::elements;
use crate::table::natives;

natives! {
    "apply" [2 ..] in ctx => apply;
    "funcall" [1 ..] in ctx => |_ctx, args| Ok(Next::Call { callee: args[0].clone(), args: args[1..].to_vec() });
    "function?" [1] => |args: &[Value]| is_function(args);
    "functionp" [1] => |args: &[Value]| is_function(args);
    "plan?" [1] in ctx => |ctx: &mut Ctx<'_>, args| Ok(Value::bool(kind(ctx.program, &args[0]) == Some(FnKind::Plan)).into());
    "function-name" [1] in ctx => |ctx: &mut Ctx<'_>, args| Ok(Value::Imm(Imm::Symbol(name(ctx.program, &args[0])?)).into());
}

fn apply(_ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let (last, front) = args.split_last().expect("the arity is at least two");
    let mut all = front[1..].to_vec();
    all.extend(elements(last)?);
    Ok(Next::Call { callee: args[0].clone(), args: all })
}

fn is_function(args: &[Value]) -> Result<Value, Raise> {
    let is_one =
        matches!(args[0], Value::Imm(Imm::Function(_) | Imm::Native(_))) || code_of(&args[0]).is_some();
    Ok(Value::bool(is_one))
}

/// The code of a function that is written in the language.
fn code_of(value: &Value) -> Option<FnId> {
    match value {
        Value::Imm(Imm::Function(id)) => Some(*id),
        Value::Obj(obj) => {
            if let Obj::Closure(id, _) = &**obj {
                Some(*id)
            } else {
                None
            }
        }
        Value::Imm(_) => None,
    }
}

fn kind(program: &Program, value: &Value) -> Option<FnKind> {
    program.functions.get(code_of(value)?.at()).map(|function| function.kind)
}

fn name(program: &Program, value: &Value) -> Result<Symbol, Raise> {
    let name = match value {
        Value::Imm(Imm::Native(id)) => program.natives.get(id.at()).map(|native| Symbol::from(native.name)),
        _ => code_of(value).and_then(|id| program.functions.get(id.at())).map(|function| function.name),
    };
    name.ok_or_else(|| type_error("a function", value))
}
