//! Entity descriptions as data: `(an object (type milk))` taken apart and put together.

use vm::desc::{Desc, KINDS};
use vm::native::{Raise, range_error, type_error};
use vm::value::{Imm, Symbol, Value};

use crate::sequence::elements;
use crate::table::natives;
use crate::value::{field, property};

natives! {
    "desc?" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_desc().is_some()));
    "desc-kind" [1] => |args: &[Value]| Ok(symbol(desc(&args[0])?.kind));
    "desc-type" [1] => |args: &[Value]| Ok(desc(&args[0])?.entity_type().map(symbol).unwrap_or_default());
    "desc-get" [2 3] => get;
    "desc-prop-value" [2 3] => get;
    "desc-properties" [1] => properties;
    "with-property" [3] => |args: &[Value]| Ok(Value::desc(desc(&args[0])?.with(field(&args[1])?, args[2].clone())));
    "without-property" [2] => |args: &[Value]| Ok(Value::desc(desc(&args[0])?.without(field(&args[1])?)));
    "make-desc" [1 2] => make;
}

fn desc(value: &Value) -> Result<&Desc, Raise> {
    value.as_desc().ok_or_else(|| type_error("a description", value))
}

fn symbol(name: Symbol) -> Value {
    Value::Imm(Imm::Symbol(name))
}

fn get(args: &[Value]) -> Result<Value, Raise> {
    let value = property(desc(&args[0])?, field(&args[1])?);
    Ok(value.or_else(|| args.get(2).cloned()).unwrap_or_default())
}

/// `((key value) …)`, as descriptions are written.
fn properties(args: &[Value]) -> Result<Value, Raise> {
    let properties = desc(&args[0])?.properties();
    Ok(Value::list(
        properties.map(|(key, value)| Value::list([symbol(key), value.clone()])).collect::<Vec<_>>(),
    ))
}

fn make(args: &[Value]) -> Result<Value, Raise> {
    let kind = field(&args[0])?;
    if !KINDS.contains(&kind.as_str()) {
        return Err(range_error(
            format!("`{kind}` is no kind of description: there are {}", KINDS.join(", ")),
            &args[0],
        ));
    }
    let given = args.get(1).map_or(Ok(Vec::new()), pairs)?;
    Ok(Value::desc(Desc::new(kind, given)))
}

/// Keys and values of a map, or of a list like that of `desc-properties`.
fn pairs(value: &Value) -> Result<Vec<(Symbol, Value)>, Raise> {
    if let Some(map) = value.as_map() {
        return map.iter().map(|(key, value)| Ok((field(key)?, value.clone()))).collect();
    }
    let pair = |entry: Value| match entry.to_vec().as_deref() {
        Some([key, value]) => Ok((field(key)?, value.clone())),
        _ => Err(type_error("a list of key and value", &entry)),
    };
    elements(value)?.into_iter().map(pair).collect()
}
