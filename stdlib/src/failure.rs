//! Failures as values that handlers look at.

use vm::failure::Failure;
use vm::machine::Ctx;
use vm::native::{Next, Raise, range_error, type_error};
use vm::value::{Imm, Map, Value};

use crate::table::natives;

natives! {
    "failure?" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_failure().is_some()));
    "failure-type" [1] => |args: &[Value]| Ok(Value::Imm(Imm::Symbol(failure(&args[0])?.name)));
    "failure-message" [1] => message;
    "failure-fields" [1] => fields;
    "failure-cause" [1] => |args: &[Value]| Ok(failure(&args[0])?.cause.clone().unwrap_or_default());
    "failure-also" [1] => |args: &[Value]| Ok(Value::list(failure(&args[0])?.also.clone()));
    "failure-path" [1] in ctx => path;
    "is-a?" [2] in ctx => is_a;
}

fn failure(value: &Value) -> Result<&Failure, Raise> {
    value.as_failure().ok_or_else(|| type_error("a failure", value))
}

/// The field `message`, or what the failure prints as without one.
fn message(args: &[Value]) -> Result<Value, Raise> {
    let given = failure(&args[0])?.get("message".into()).filter(|message| !message.is_nil());
    Ok(match given {
        Some(message) if message.as_str().is_some() => message.clone(),
        Some(message) => Value::str(vm::print::display(message)),
        None => Value::str(vm::print::display(&args[0])),
    })
}

fn fields(args: &[Value]) -> Result<Value, Raise> {
    let fields = failure(&args[0])?.fields.iter();
    Ok(Value::map(
        fields.map(|(name, value)| (Value::Imm(Imm::Keyword(*name)), value.clone())).collect::<Map>(),
    ))
}

/// True for a failure of the type or below it; false for anything that is no failure.
fn is_a(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let name = args[1].as_symbol().ok_or_else(|| type_error("the name of a failure type", &args[1]))?;
    let types = &ctx.program.failures;
    if types.find(name).is_none() {
        return Err(range_error(format!("no failure type is called `{name}`"), &args[1]));
    }
    let is_one = args[0].as_failure().is_some_and(|failure| types.is_named(failure.kind, name));
    Ok(Value::bool(is_one).into())
}

/// The path is found in the tree of the run, unless the failure brought it from another one.
fn path(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let failure = failure(&args[0])?;
    failure.name_task(ctx.tree());
    Ok(failure.path().map(Value::str).unwrap_or_default().into())
}
