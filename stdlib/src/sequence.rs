//! Sequences: what lists and vectors, and partly strings, have in common.
//!
//! A function that makes a sequence of some elements of another gives one of the same kind.
//! All that calls a function it was given is in `sequence.plan`.

use std::collections::BTreeSet;

use vm::machine::Part;
use vm::native::{Next, Raise, index, range_error, type_error};
use vm::value::{Obj, Value};

use crate::limit;
use crate::list::{after, reverse_onto};
use crate::string;
use crate::table::natives;
use crate::value::{key, same};

natives! {
    "length" [1] => |args: &[Value]| length(&args[0]).map(|n| Value::int(n as i64));
    "empty?" [1] in ctx => |_ctx, args| match args[0].is_stream() {
        true => Ok(Next::Part(args[0].clone(), Part::Empty)),
        false => is_empty(args).map(Next::Return),
    };
    "elt" [2] => element;
    "aref" [2] => element;
    "reverse" [1] => reverse;
    "append" [0 ..] => append;
    "slice" [2 3] => slice;
    "subseq" [2 3] => slice;
    "%take" [2] => take;
    "%drop" [2] => drop_first;
    "stream?" [1] => |args: &[Value]| Ok(Value::bool(args[0].is_stream()));
    "zip" [1 ..] => zip;
    "union" [0 ..] => |args: &[Value]| union(args);
    "intersection" [2] => |args: &[Value]| keep_members(args, true);
    "set-difference" [2] => |args: &[Value]| keep_members(args, false);
    "subset?" [2] => is_subset;

    "%elements" [1] => |args: &[Value]| to_list(&args[0]);
    "%collect" [2] => |args: &[Value]| collect(&args[0], &args[1]);
    "%distinct" [2] => distinct;
    "%find" [2] => |args: &[Value]| Ok(find(args)?.map(|(_, item)| item).unwrap_or_default());
    "%position" [2] => |args: &[Value]| Ok(find(args)?.map(|(at, _)| Value::int(at)).unwrap_or_default());
    "%count" [2] => count;
    "%remove" [2] => remove;
}

/// The elements of a list or vector.
pub(crate) fn elements(value: &Value) -> Result<Vec<Value>, Raise> {
    let items = match value.as_vector() {
        Some(items) => Some(items.iter().cloned().collect()),
        None => value.to_vec(),
    };
    items.ok_or_else(|| type_error("a list or vector", value))
}

/// These elements as a sequence of the kind of `model`.
pub(crate) fn like(model: &Value, items: Vec<Value>) -> Value {
    if model.as_vector().is_some() { Value::vector(items) } else { Value::list(items) }
}

/// A list as it is, a vector as a list.
fn to_list(value: &Value) -> Result<Value, Raise> {
    // A loop goes over a stream as over a list.
    if value.is_list() || value.is_stream() { Ok(value.clone()) } else { elements(value).map(Value::list) }
}

/// A list that was made last element first, in order and of the kind of `model`.
fn collect(model: &Value, reversed: &Value) -> Result<Value, Raise> {
    let items = reverse_onto(reversed, Value::NIL)?;
    if model.as_vector().is_some() { Ok(Value::vector(items.iter().cloned())) } else { Ok(items) }
}

fn length(value: &Value) -> Result<usize, Raise> {
    match value.obj() {
        Some(Obj::Str(text)) => Ok(string::length(text)),
        Some(Obj::Vector(items)) => Ok(items.len()),
        Some(Obj::Map(map)) => Ok(map.len()),
        _ => {
            let mut iter = value.iter();
            let length = iter.by_ref().count();
            if iter.rest.is_nil() {
                Ok(length)
            } else {
                Err(type_error("a list, vector, string or map", value))
            }
        }
    }
}

fn is_empty(args: &[Value]) -> Result<Value, Raise> {
    let empty = match args[0].obj() {
        Some(Obj::Pair(..)) => false,
        Some(Obj::Str(text)) => text.is_empty(),
        _ => length(&args[0])? == 0,
    };
    Ok(Value::bool(empty))
}

fn element(args: &[Value]) -> Result<Value, Raise> {
    let at = index(&args[1])?;
    let item = match args[0].obj() {
        Some(Obj::Vector(items)) => items.get(at).cloned(),
        Some(Obj::Str(text)) => text.chars().nth(at).map(|c| Value::str(c.to_string())),
        _ if args[0].is_list() => args[0].iter().nth(at).cloned(),
        _ => return Err(type_error("a list, vector or string", &args[0])),
    };
    item.ok_or_else(|| range_error(format!("there is no element {at}"), &args[1]))
}

fn reverse(args: &[Value]) -> Result<Value, Raise> {
    match args[0].obj() {
        Some(Obj::Str(text)) => Ok(Value::str(text.chars().rev().collect::<String>())),
        Some(Obj::Vector(items)) => Ok(Value::vector(items.iter().rev().cloned())),
        _ if args[0].is_list() => reverse_onto(&args[0], Value::NIL),
        _ => Err(type_error("a list, vector or string", &args[0])),
    }
}

/// The last list is not copied: it becomes the end of the result.
fn append(args: &[Value]) -> Result<Value, Raise> {
    let Some((end, front)) = args.split_last() else { return Ok(Value::NIL) };
    let mut items = Vec::new();
    for arg in front {
        limit::elements(items.len() + length(arg)?)?;
        items.extend(elements(arg)?);
    }
    if args[0].as_vector().is_some() {
        limit::elements(items.len() + length(end)?)?;
        items.extend(elements(end)?);
        return Ok(Value::vector(items));
    }
    Ok(Value::list_onto(items, to_list(end)?))
}

// ---------------------------------------------------------------------------------------------
// Parts

/// The part of a sequence between two positions.
fn part(whole: &Value, start: usize, end: Option<usize>) -> Result<Value, Raise> {
    match whole.obj() {
        Some(Obj::Vector(items)) if start == 0 && end == Some(items.len()) => Ok(whole.clone()),
        Some(Obj::Vector(items)) => {
            let n = end.unwrap_or(items.len()).saturating_sub(start);
            Ok(Value::shared_vector(items.skip(start).take(n)))
        }
        Some(Obj::Str(text)) => Ok(Value::str(string::part(text, start, end))),
        _ => {
            let tail = after(start, whole)?;
            let Some(end) = end else { return Ok(tail) };
            let items: Vec<_> = tail.iter().take(end.saturating_sub(start)).cloned().collect();
            Ok(Value::list(items))
        }
    }
}

fn sliceable(value: &Value) -> Result<usize, Raise> {
    if value.as_map().is_some() { Err(type_error("a list, vector or string", value)) } else { length(value) }
}

fn slice(args: &[Value]) -> Result<Value, Raise> {
    let length = sliceable(&args[0])?;
    let start = index(&args[1])?;
    let end = match args.get(2) {
        Some(end) if !end.is_nil() => index(end)?,
        _ => length,
    };
    if start > end || end > length {
        let message = format!("there is no slice from {start} to {end} of {length} elements");
        return Err(range_error(message, args.get(2).unwrap_or(&args[1])));
    }
    part(&args[0], start, (end < length).then_some(end))
}

/// Of a list only the part that is asked for is looked at.
fn take(args: &[Value]) -> Result<Value, Raise> {
    let (n, whole) = (index(&args[0])?, &args[1]);
    if whole.is_list() {
        let ends_before = after(n, whole)?.is_nil();
        return if ends_before { Ok(whole.clone()) } else { part(whole, 0, Some(n)) };
    }
    if n >= sliceable(whole)? { Ok(whole.clone()) } else { part(whole, 0, Some(n)) }
}

fn drop_first(args: &[Value]) -> Result<Value, Raise> {
    let (n, whole) = (index(&args[0])?, &args[1]);
    if whole.is_list() { after(n, whole) } else { part(whole, n.min(sliceable(whole)?), None) }
}

/// One list per position, as long as the shortest sequence.
fn zip(args: &[Value]) -> Result<Value, Raise> {
    let columns = args.iter().map(elements).collect::<Result<Vec<_>, _>>()?;
    let rows = columns.iter().map(Vec::len).min().unwrap_or(0);
    limit::elements(rows.saturating_mul(columns.len()))?;
    Ok(Value::list((0..rows).map(|row| Value::list(columns.iter().map(|column| column[row].clone())))))
}

// ---------------------------------------------------------------------------------------------
// Equal elements

fn find(args: &[Value]) -> Result<Option<(i64, Value)>, Raise> {
    for (at, item) in elements(&args[1])?.into_iter().enumerate() {
        if same(&args[0], &item)? {
            return Ok(Some((at as i64, item)));
        }
    }
    Ok(None)
}

fn count(args: &[Value]) -> Result<Value, Raise> {
    let mut count = 0;
    for item in elements(&args[1])? {
        count += i64::from(same(&args[0], &item)?);
    }
    Ok(Value::int(count))
}

fn remove(args: &[Value]) -> Result<Value, Raise> {
    let mut kept = Vec::new();
    for item in elements(&args[1])? {
        if !same(&args[0], &item)? {
            kept.push(item);
        }
    }
    Ok(like(&args[1], kept))
}

/// A set of values. Those that can be keys of a map are found quickly; the few that cannot (they
/// are huge, or a tree) are compared one by one.
#[derive(Default)]
struct Set {
    keys: BTreeSet<Value>,
    others: Vec<Value>,
}

impl Set {
    fn of(items: Vec<Value>) -> Result<Set, Raise> {
        let mut set = Set::default();
        for item in items {
            set.insert(item)?;
        }
        Ok(set)
    }
    fn contains(&self, item: &Value) -> Result<bool, Raise> {
        if let Ok(key) = key(item) {
            return Ok(self.keys.contains(&key));
        }
        for other in &self.others {
            if same(other, item)? {
                return Ok(true);
            }
        }
        Ok(false)
    }
    /// True if it was not there.
    fn insert(&mut self, item: Value) -> Result<bool, Raise> {
        if let Ok(key) = key(&item) {
            return Ok(self.keys.insert(key));
        }
        let new = !self.contains(&item)?;
        if new {
            self.others.push(item);
        }
        Ok(new)
    }
}

/// `(%distinct keys items)`: the items whose key is the first of its kind.
fn distinct(args: &[Value]) -> Result<Value, Raise> {
    let mut seen = Set::default();
    let mut kept = Vec::new();
    for (key, item) in elements(&args[0])?.into_iter().zip(elements(&args[1])?) {
        if seen.insert(key)? {
            kept.push(item);
        }
    }
    Ok(like(&args[1], kept))
}

fn union(args: &[Value]) -> Result<Value, Raise> {
    let mut seen = Set::default();
    let mut kept = Vec::new();
    for arg in args {
        for item in elements(arg)? {
            if seen.insert(item.clone())? {
                kept.push(item);
            }
        }
    }
    Ok(args.first().map_or(Value::NIL, |model| like(model, kept)))
}

/// The elements of the first argument that are in the second, or that are not.
fn keep_members(args: &[Value], wanted: bool) -> Result<Value, Raise> {
    let set = Set::of(elements(&args[1])?)?;
    let mut kept = Vec::new();
    for item in elements(&args[0])? {
        if set.contains(&item)? == wanted {
            kept.push(item);
        }
    }
    Ok(like(&args[0], kept))
}

fn is_subset(args: &[Value]) -> Result<Value, Raise> {
    let set = Set::of(elements(&args[1])?)?;
    for item in elements(&args[0])? {
        if !set.contains(&item)? {
            return Ok(Value::FALSE);
        }
    }
    Ok(Value::TRUE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn appending_many_times_meets_the_limit() {
        let long = Value::list((0..100_000).map(Value::int));
        let many = vec![long; 200];
        assert_eq!(append(&many).map_err(|raise| raise.name.to_string()), Err("memory-exhausted".into()));
    }

    #[test]
    fn values_that_cannot_be_keys_still_go_into_sets() {
        let nan = Value::float(f64::NAN);
        let items = Value::list([nan.clone(), Value::int(1), nan]);
        let kept = distinct(&[items.clone(), items]).map(|kept| vm::print::write(&kept));
        assert_eq!(kept.map_err(|raise| raise.name.to_string()), Ok("(+nan 1)".into()));
    }
}
