//! What all values have in common: truth, equality, order, kind, and parts that can be read.

use std::cmp::Ordering;

use vm::desc::Desc;
use vm::failure::Failure;
use vm::machine::Ctx;
use vm::native::{Next, Raise, index, map_key, too_large, type_error};
use vm::value::{COMPARE_LIMIT, Imm, Obj, Symbol, Value, compare as order};

use crate::table::natives;

natives! {
    "not" [1] => |args: &[Value]| Ok(Value::bool(!args[0].is_true()));
    "identical?" [2] => identical;
    "eq" [2] => identical;
    "eql" [2] => identical;
    "equal?" [2] => equal;
    "equal" [2] => equal;
    "compare" [2] => compare;
    "comes-before?" [2] => |args: &[Value]| Ok(Value::bool(ordering(&args[0], &args[1])?.is_lt()));
    "type-of" [1] => |args: &[Value]| Ok(crate::symbol::named(args[0].type_name()));
    "boolean?" [1] => |args: &[Value]| Ok(Value::bool(matches!(args[0], Value::Imm(Imm::Bool(_)))));
    "get" [2 3] in ctx => get;
}

fn identical(args: &[Value]) -> Result<Value, Raise> {
    Ok(Value::bool(args[0].identical(&args[1])))
}

fn equal(args: &[Value]) -> Result<Value, Raise> {
    same(&args[0], &args[1]).map(Value::bool)
}

fn compare(args: &[Value]) -> Result<Value, Raise> {
    Ok(Value::int(ordering(&args[0], &args[1])? as i64))
}

fn get(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    if let Some(failure) = args[0].as_failure()
        && field(&args[1]).is_ok_and(|name| name == "path")
    {
        failure.name_task(ctx.tree());
    }
    let found = part(&args[0], &args[1])?;
    Ok(found.or_else(|| args.get(2).cloned()).unwrap_or_default().into())
}

/// The order of two values by content, unless they are too large to tell.
pub(crate) fn ordering(a: &Value, b: &Value) -> Result<Ordering, Raise> {
    order(a, b, COMPARE_LIMIT).ok_or_else(|| too_large("the values have too many parts to be compared"))
}

/// True if two values have the same content.
pub(crate) fn same(a: &Value, b: &Value) -> Result<bool, Raise> {
    ordering(a, b).map(Ordering::is_eq)
}

/// A value as key of a map. Most keys are a keyword or symbol and need no look at their parts.
pub(crate) fn key(value: &Value) -> Result<Value, Raise> {
    match value {
        Value::Imm(Imm::Keyword(_) | Imm::Symbol(_) | Imm::Int(_)) => Ok(value.clone()),
        _ => map_key(value),
    }
}

/// A field or property: `type` or `:type`.
pub(crate) fn field(value: &Value) -> Result<Symbol, Raise> {
    (value.as_symbol().or_else(|| value.as_keyword())).ok_or_else(|| type_error("a keyword or symbol", value))
}

fn part(whole: &Value, at: &Value) -> Result<Option<Value>, Raise> {
    let Some(obj) = whole.obj() else {
        return if whole.is_nil() { Ok(None) } else { Err(no_parts(whole)) };
    };
    Ok(match obj {
        Obj::Pair(..) => whole.iter().nth(index(at)?).cloned(),
        Obj::Vector(items) => items.get(index(at)?).cloned(),
        Obj::Str(text) => text.chars().nth(index(at)?).map(|c| Value::str(c.to_string())),
        Obj::Map(map) => map.get(&key(at)?).cloned(),
        Obj::Desc(desc) => property(desc, field(at)?),
        Obj::Failure(failure) => failure_field(failure, field(at)?),
        Obj::Vec3(vec) => number_named(&["x", "y", "z"], &vec.numbers(), field(at)?),
        Obj::Pose(pose) => match field(at)? {
            name if name == "frame" => Some(Value::Imm(Imm::Symbol(pose.frame))),
            name => number_named(&["x", "y", "z", "qx", "qy", "qz", "qw"], &pose.numbers(), name),
        },
        _ => return Err(no_parts(whole)),
    })
}

fn no_parts(whole: &Value) -> Raise {
    type_error("a list, vector, string, map, description, failure, vec3 or pose", whole)
}

/// A property of a description.
pub(crate) fn property(desc: &Desc, key: Symbol) -> Option<Value> {
    desc.get(key).cloned()
}

/// A field of a failure; `type`, `cause`, `also` and `path` are there for all of them, unless a type
/// has a field of that name.
fn failure_field(failure: &Failure, name: Symbol) -> Option<Value> {
    (failure.get(name).cloned()).or_else(|| match name.as_str() {
        "type" => Some(Value::Imm(Imm::Symbol(failure.name))),
        "cause" => failure.cause.clone(),
        "also" => Some(Value::list(failure.also.clone())),
        "path" => failure.path().map(Value::str),
        _ => None,
    })
}

fn number_named(names: &[&str], numbers: &[f64], name: Symbol) -> Option<Value> {
    let at = names.iter().position(|it| name == *it)?;
    Some(Value::float(numbers[at]))
}
