//! Tasks, their clock, and fluents.

use vm::fluent::{Fluent, Missed};
use vm::machine::{Ctx, TaskOp, nanoseconds};
use vm::native::{Next, Raise, index, type_error};
use vm::value::{Obj, Value};

use crate::table::natives;

natives! {
    "sleep" [1] in ctx => |_: &mut Ctx<'_>, args| Ok(Next::Sleep(nanoseconds(&args[0])?));
    "fluent" [0 1] in ctx => fluent;
    "fluent?" [1] => |args: &[Value]| Ok(Value::bool(as_fluent(&args[0]).is_some()));
    "value" [1] => |args: &[Value]| of(&args[0]).map(Fluent::value);
    "set-value" [2] in ctx => |_: &mut Ctx<'_>, args| task(TaskOp::Set(args[0].clone(), args[1].clone()));
    "pulse" [1] in ctx => |_: &mut Ctx<'_>, args| task(TaskOp::Pulse(args[0].clone()));
    "%derive" [2] in ctx => derive;
    "%world-fluent" [0] in ctx => |_: &mut Ctx<'_>, _args| task(TaskOp::World);
    "%read" [1] => |args: &[Value]| Ok(as_fluent(&args[0]).map_or_else(|| args[0].clone(), Fluent::value));
    "%wait-for" [2] in ctx => wait_for;
    "%pulsed" [2] in ctx => pulsed;
    "%next-rise" [2] in ctx => next_rise;
    "task?" [1] => |args: &[Value]| Ok(Value::bool(matches!(args[0].obj(), Some(Obj::Task(_)))));
    "evaporate" [1 2] in ctx => evaporate;
    "suspend" [1] in ctx => |_: &mut Ctx<'_>, args| task(TaskOp::Suspend(args[0].clone()));
    "wake-up" [1] in ctx => |_: &mut Ctx<'_>, args| task(TaskOp::WakeUp(args[0].clone()));
    "join" [1] in ctx => |_: &mut Ctx<'_>, args| task(TaskOp::Join(args[0].clone()));
    "status" [1] in ctx => |_: &mut Ctx<'_>, args| task(TaskOp::Status(args[0].clone()));
}

fn task(op: TaskOp) -> Result<Next, Raise> {
    Ok(Next::Task(op))
}

fn evaporate(_: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let emergency = match args.get(1).map(|it| (it, it.as_keyword())) {
        None => false,
        Some((_, Some(word))) if word.as_str() == "drop-obligations" => true,
        Some((other, _)) => return Err(type_error(":drop-obligations", other)),
    };
    task(TaskOp::Evaporate(args[0].clone(), emergency))
}

fn as_fluent(value: &Value) -> Option<&Fluent> {
    if let Some(Obj::Fluent(fluent)) = value.obj() { Some(fluent) } else { None }
}

fn of(value: &Value) -> Result<&Fluent, Raise> {
    as_fluent(value).ok_or_else(|| type_error("a fluent", value))
}

fn fluent(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let value = args.first().cloned().unwrap_or_default();
    Ok(Value::new(Obj::Fluent(Box::new(Fluent::new(ctx.number(), value)))).into())
}

fn derive(_: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    task(TaskOp::Derive { function: args[0].clone(), inputs: vm::native::list(&args[1])? })
}

fn wait_for(_: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    of(&args[0])?;
    let ns = if args[1].is_nil() { None } else { Some(nanoseconds(&args[1])?) };
    task(TaskOp::WaitFor(args[0].clone(), ns))
}

fn next_rise(_: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    of(&args[0])?;
    let seen = if args[1].is_nil() { None } else { Some(index(&args[1])? as u64) };
    task(TaskOp::NextRise(args[0].clone(), seen))
}

fn pulsed(_: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    of(&args[0])?;
    let missed = match args[1].as_keyword().as_ref().map(|it| it.as_str()) {
        Some("never") => Missed::Never,
        Some("once") => Missed::Once,
        Some("always") => Missed::Always,
        _ => return Err(type_error(":never, :once or :always", &args[1])),
    };
    task(TaskOp::Pulsed(args[0].clone(), missed))
}
