//! Maps: persistent, in the order of their keys.

use vm::failure::{Builtin, Failure};
use vm::native::{Raise, list, type_error};
use vm::value::{Map, Value};

use crate::table::natives;
use crate::value::key;

natives! {
    "make-map" [0 ..] => |args: &[Value]| put_all(Map::new(), args);
    "map?" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_map().is_some()));
    "put" [1 ..] => |args: &[Value]| put_all(map(&args[0])?.clone(), &args[1..]);
    "remove-key" [2] => |args: &[Value]| Ok(Value::map(map(&args[0])?.without(&key(&args[1])?)));
    "has-key?" [2] => |args: &[Value]| Ok(Value::bool(map(&args[0])?.contains_key(&key(&args[1])?)));
    "keys" [1] => |args: &[Value]| Ok(Value::list(map(&args[0])?.keys().cloned().collect::<Vec<_>>()));
    "vals" [1] => |args: &[Value]| Ok(Value::list(map(&args[0])?.values().cloned().collect::<Vec<_>>()));
    "merge" [0 ..] => merge;
    "map->list" [1] => |args: &[Value]| Ok(Value::list(entries(map(&args[0])?)));
    "list->map" [1] => list_to_map;
}

fn map(value: &Value) -> Result<&Map, Raise> {
    value.as_map().ok_or_else(|| type_error("a map", value))
}

/// `(key value)` for each entry.
fn entries(map: &Map) -> Vec<Value> {
    map.iter().map(|(key, value)| Value::list([key.clone(), value.clone()])).collect()
}

fn put_all(mut map: Map, pairs: &[Value]) -> Result<Value, Raise> {
    for pair in pairs.chunks(2) {
        let [name, value] = pair else {
            return Err(Box::new(Failure::new(
                Builtin::ArityError,
                "a key has no value: they are given in pairs",
            )));
        };
        map.insert(key(name)?, value.clone());
    }
    Ok(Value::map(map))
}

fn merge(args: &[Value]) -> Result<Value, Raise> {
    let mut merged = Map::new();
    for arg in args {
        for (key, value) in map(arg)?.iter() {
            merged.insert(key.clone(), value.clone());
        }
    }
    Ok(Value::map(merged))
}

fn list_to_map(args: &[Value]) -> Result<Value, Raise> {
    let mut map = Map::new();
    for entry in list(&args[0])? {
        let pair = entry.to_vec().filter(|pair| pair.len() == 2);
        let [name, value]: [Value; 2] = (pair.and_then(|pair| pair.try_into().ok()))
            .ok_or_else(|| type_error("a list of key and value", &entry))?;
        map.insert(key(&name)?, value);
    }
    Ok(Value::map(map))
}
