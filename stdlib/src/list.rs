//! Lists as cells: first element and rest. What also works on vectors is in `sequence`.

use vm::machine::Part;
use vm::native::{Next, Raise, arithmetic_error, index, list, number, range_error, too_large, type_error};
use vm::value::Value;

use crate::limit;
use crate::table::natives;
use crate::value::{key, same};

natives! {
    "cons" [2] => |args: &[Value]| Ok(Value::cons(args[0].clone(), args[1].clone()));
    "list" [0 ..] => |args: &[Value]| Ok(Value::list(args.iter().cloned()));
    "list*" [1 ..] => list_onto;
    "make-list" [1 2] => make_list;
    "range" [1 3] => range;
    "iota" [1] => range;

    "first" [1] in ctx => |_ctx, args| part(args, Part::First, first);
    "car" [1] in ctx => |_ctx, args| part(args, Part::First, first);
    "rest" [1] in ctx => |_ctx, args| part(args, Part::Rest, rest);
    "cdr" [1] in ctx => |_ctx, args| part(args, Part::Rest, rest);
    "second" [1] => |args: &[Value]| first(&after(1, &args[0])?);
    "cadr" [1] => |args: &[Value]| first(&after(1, &args[0])?);
    "third" [1] => |args: &[Value]| first(&after(2, &args[0])?);
    "caddr" [1] => |args: &[Value]| first(&after(2, &args[0])?);
    "fourth" [1] => |args: &[Value]| first(&after(3, &args[0])?);
    "cddr" [1] => |args: &[Value]| after(2, &args[0]);
    "caar" [1] => |args: &[Value]| first(&first(&args[0])?);
    "cdar" [1] => |args: &[Value]| rest(&first(&args[0])?);
    "nth" [2] => nth;
    "nthcdr" [2] => |args: &[Value]| after(index(&args[0])?, &args[1]);
    "last" [1 2] => last;
    "lastcar" [1] => last_element;
    "butlast" [1 2] => all_but_last;
    "revappend" [2] => |args: &[Value]| reverse_onto(&args[0], args[1].clone());
    "flatten" [1] => flatten;

    "list?" [1] => |args: &[Value]| Ok(Value::bool(args[0].is_list()));
    "listp" [1] => |args: &[Value]| Ok(Value::bool(args[0].is_list()));
    "pair?" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_pair().is_some()));
    "consp" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_pair().is_some()));
    "null?" [1] => |args: &[Value]| Ok(Value::bool(args[0].is_nil()));
    "null" [1] => |args: &[Value]| Ok(Value::bool(args[0].is_nil()));

    "%member" [2] => member;
    "%assoc" [2] => association;
    "getf" [2 3] => property_of_list;
}

fn list_onto(args: &[Value]) -> Result<Value, Raise> {
    let (end, items) = args.split_last().expect("the arity is at least one");
    Ok(Value::list_onto(items.iter().cloned(), end.clone()))
}

fn make_list(args: &[Value]) -> Result<Value, Raise> {
    let n = limit::elements(index(&args[0])?)?;
    let item = args.get(1).cloned().unwrap_or_default();
    Ok(Value::list((0..n).map(|_| item.clone())))
}

fn range(args: &[Value]) -> Result<Value, Raise> {
    let (zero, one) = (Value::int(0), Value::int(1));
    let (start, end, step) = match args {
        [end] => (&zero, end, &one),
        [start, end] => (start, end, &one),
        [start, end, step, ..] => (start, end, step),
        [] => (&zero, &zero, &one),
    };
    if let (Some(start), Some(end), Some(step_by)) = (start.as_int(), end.as_int(), step.as_int()) {
        return integer_range(start, end, step_by);
    }
    float_range(number(start)?, number(end)?, number(step)?)
}

fn no_step() -> Raise {
    range_error("the step of a range is zero", &Value::int(0))
}

fn integer_range(start: i64, end: i64, step: i64) -> Result<Value, Raise> {
    if step == 0 {
        return Err(no_step());
    }
    let way =
        if step > 0 { i128::from(end) - i128::from(start) } else { i128::from(start) - i128::from(end) };
    let stride = i128::from(step.unsigned_abs());
    let n = usize::try_from((way + stride - 1).max(0) / stride).unwrap_or(usize::MAX);
    // All elements lie before `end`; a product on the way may wrap and the sum wraps it back.
    Ok(Value::list(
        (0..limit::elements(n)?).map(|i| Value::int(start.wrapping_add((i as i64).wrapping_mul(step)))),
    ))
}

/// Elements are products, not sums, so that errors do not add up.
fn float_range(start: f64, end: f64, step: f64) -> Result<Value, Raise> {
    if step == 0.0 {
        return Err(no_step());
    }
    let n = ((end - start) / step).ceil();
    if !n.is_finite() || !start.is_finite() || !step.is_finite() {
        return Err(arithmetic_error("a range has finite ends and a finite step"));
    }
    let mut n = limit::elements(n.max(0.0) as usize)?;
    let element = |i: usize| start + i as f64 * step;
    // Rounding may put one too many into the quotient.
    while n > 0 && (if step > 0.0 { element(n - 1) >= end } else { element(n - 1) <= end }) {
        n -= 1;
    }
    Ok(Value::list((0..n).map(|i| Value::float(element(i)))))
}

// ---------------------------------------------------------------------------------------------
// Parts

/// Of a stream of answers somebody has to look for them.
fn part(args: &[Value], part: Part, of_list: fn(&Value) -> Result<Value, Raise>) -> Result<Next, Raise> {
    match args[0].is_stream() {
        true => Ok(Next::Part(args[0].clone(), part)),
        false => of_list(&args[0]).map(Next::Return),
    }
}

pub(crate) fn first(list: &Value) -> Result<Value, Raise> {
    match list.as_pair() {
        Some((first, _)) => Ok(first.clone()),
        None if list.is_nil() => Ok(Value::NIL),
        None => Err(type_error("a list", list)),
    }
}

fn rest(list: &Value) -> Result<Value, Raise> {
    match list.as_pair() {
        Some((_, rest)) => Ok(rest.clone()),
        None if list.is_nil() => Ok(Value::NIL),
        None => Err(type_error("a list", list)),
    }
}

/// The list without its first `n` elements.
pub(crate) fn after(n: usize, list: &Value) -> Result<Value, Raise> {
    let mut iter = list.iter();
    if n > 0 && iter.by_ref().nth(n - 1).is_none() && !iter.rest.is_nil() {
        return Err(type_error("a list", iter.rest));
    }
    Ok(iter.rest.clone())
}

fn nth(args: &[Value]) -> Result<Value, Raise> {
    let n = index(&args[0])?;
    match args[1].as_vector() {
        Some(items) => Ok(items.get(n).cloned().unwrap_or_default()),
        None => first(&after(n, &args[1])?),
    }
}

/// How many elements the second argument asks for; one without it.
fn how_many(args: &[Value]) -> Result<usize, Raise> {
    args.get(1).map_or(Ok(1), index)
}

fn last(args: &[Value]) -> Result<Value, Raise> {
    let length = list(&args[0])?.len();
    after(length.saturating_sub(how_many(args)?), &args[0])
}

fn last_element(args: &[Value]) -> Result<Value, Raise> {
    Ok(list(&args[0])?.pop().unwrap_or_default())
}

fn all_but_last(args: &[Value]) -> Result<Value, Raise> {
    let mut items = list(&args[0])?;
    items.truncate(items.len().saturating_sub(how_many(args)?));
    Ok(Value::list(items))
}

pub(crate) fn reverse_onto(items: &Value, end: Value) -> Result<Value, Raise> {
    let mut iter = items.iter();
    let all = iter.by_ref().fold(end, |rest, item| Value::cons(item.clone(), rest));
    if iter.rest.is_nil() { Ok(all) } else { Err(type_error("a list", items)) }
}

/// Lists share parts, so a few cells can flatten to more atoms than there are.
fn flatten(args: &[Value]) -> Result<Value, Raise> {
    list(&args[0])?;
    let mut atoms = Vec::new();
    let mut todo = vec![args[0].clone()];
    for _ in 0..limit::ELEMENTS {
        let Some(part) = todo.pop() else { return Ok(Value::list(atoms)) };
        match part.as_pair() {
            Some((first, rest)) => todo.extend([rest.clone(), first.clone()]),
            None if part.is_nil() => {}
            None => atoms.push(part),
        }
    }
    Err(too_large("the list has too many parts to be flattened"))
}

// ---------------------------------------------------------------------------------------------
// Looking something up

fn member(args: &[Value]) -> Result<Value, Raise> {
    let mut tail = &args[1];
    while let Some((item, rest)) = tail.as_pair() {
        if same(&args[0], item)? {
            return Ok(tail.clone());
        }
        tail = rest;
    }
    if tail.is_nil() { Ok(Value::NIL) } else { Err(type_error("a list", &args[1])) }
}

fn association(args: &[Value]) -> Result<Value, Raise> {
    for entry in list(&args[1])? {
        if entry.is_nil() {
            continue;
        }
        let (key, _) = entry.as_pair().ok_or_else(|| type_error("a pair", &entry))?;
        if same(&args[0], key)? {
            return Ok(entry);
        }
    }
    Ok(Value::NIL)
}

fn property_of_list(args: &[Value]) -> Result<Value, Raise> {
    let wanted = key(&args[1])?;
    for pair in list(&args[0])?.chunks(2) {
        if let [name, value] = pair
            && same(name, &wanted)?
        {
            return Ok(value.clone());
        }
    }
    Ok(args.get(2).cloned().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range_of(args: &[i64]) -> Result<String, String> {
        let args: Vec<_> = args.iter().copied().map(Value::int).collect();
        range(&args).map(|list| vm::print::write(&list)).map_err(|raise| raise.name.to_string())
    }

    #[test]
    fn ranges_reach_the_ends_of_the_integers() {
        assert_eq!(range_of(&[i64::MAX - 2, i64::MAX]), Ok(format!("({} {})", i64::MAX - 2, i64::MAX - 1)));
        assert_eq!(
            range_of(&[i64::MIN, i64::MAX, i64::MAX]),
            Ok(format!("({} -1 {})", i64::MIN, i64::MAX - 1))
        );
        assert_eq!(range_of(&[3, 0, -2]), Ok("(3 1)".into()));
        assert_eq!(range_of(&[0, -1, i64::MIN]), Ok("(0)".into()));
        assert_eq!(range_of(&[0, 5, 0]), Err("range-error".into()));
        assert_eq!(range_of(&[i64::MAX]), Err("memory-exhausted".into()));
        let rounded = float_range(1.0, 1.3, 0.1).ok().and_then(|list| list.to_vec());
        assert_eq!(rounded.map(|list| list.len()), Some(3));
    }

    #[test]
    fn improper_lists_are_no_lists() {
        let dotted = Value::cons(Value::int(1), Value::int(2));
        assert!(after(1, &dotted).is_ok_and(|rest| rest == Value::int(2)));
        assert!(after(2, &dotted).is_err());
        assert!(reverse_onto(&dotted, Value::NIL).is_err());
    }

    #[test]
    fn flattening_what_shares_itself_ends() {
        let shared = (0..60).fold(Value::NIL, |it: Value, _| Value::cons(it.clone(), it));
        assert!(flatten(&[shared]).is_err());
    }
}
