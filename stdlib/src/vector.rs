//! Vectors: persistent sequences with quick access by position.

use vm::native::{Raise, index, list, range_error, type_error};
use vm::value::{Value, Vector};

use crate::limit;
use crate::table::natives;

natives! {
    "vector" [0 ..] => |args: &[Value]| Ok(Value::vector(args.iter().cloned()));
    "vector?" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_vector().is_some()));
    "vectorp" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_vector().is_some()));
    "make-vector" [1 2] => make_vector;
    "conj" [1 ..] => add_at_end;
    "set-at" [3] => set_at;
    "vec->list" [1] => |args: &[Value]| Ok(Value::list(vector(&args[0])?.iter().cloned().collect::<Vec<_>>()));
    "list->vec" [1] => |args: &[Value]| Ok(Value::vector(list(&args[0])?));
}

fn vector(value: &Value) -> Result<&Vector, Raise> {
    value.as_vector().ok_or_else(|| type_error("a vector", value))
}

fn whole(items: Vector) -> Value {
    Value::shared_vector(items)
}

fn make_vector(args: &[Value]) -> Result<Value, Raise> {
    let n = limit::elements(index(&args[0])?)?;
    let item = args.get(1).cloned().unwrap_or_default();
    Ok(Value::vector((0..n).map(|_| item.clone())))
}

fn add_at_end(args: &[Value]) -> Result<Value, Raise> {
    let mut items = vector(&args[0])?.clone();
    args[1..].iter().for_each(|item| items.push_back(item.clone()));
    Ok(whole(items))
}

fn set_at(args: &[Value]) -> Result<Value, Raise> {
    let items = vector(&args[0])?;
    let at = index(&args[1])?;
    if at >= items.len() {
        return Err(range_error(
            format!("there is no element {at} in a vector of {}", items.len()),
            &args[1],
        ));
    }
    Ok(whole(items.update(at, args[2].clone())))
}
