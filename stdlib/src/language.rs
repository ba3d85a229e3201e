//! What special forms need from Rust: matching of descriptions, taking values apart, fresh names.

use vm::desc::{Match, matches};
use vm::machine::Ctx;
use vm::native::{Next, Raise, index, str, type_error};
use vm::value::{COMPARE_LIMIT, Imm, Value};

use crate::table::natives;

natives! {
    "%matches" [2] => |args: &[Value]| Ok(matching(Match::Open, args));
    "%==" [2] => |args: &[Value]| Ok(matching(Match::Closed, args));
    "%take-apart" [3] => take_apart;
    "gensym" [0 1] in ctx => gensym;
}

/// The bindings as a map, or nil if the pattern does not match.
fn matching(mode: Match, args: &[Value]) -> Value {
    matches(mode, &args[0], &args[1], COMPARE_LIMIT).map_or(Value::NIL, Value::map)
}

/// The first `n` elements of a list or vector, which must be all there are, unless the rest is
/// wanted as one more element.
fn take_apart(args: &[Value]) -> Result<Value, Raise> {
    let (value, n, with_rest) = (&args[0], index(&args[1])?, args[2].is_true());
    let wanted = || {
        let least = if with_rest { "at least " } else { "" };
        type_error(&format!("a list or vector of {least}{n} element{}", if n == 1 { "" } else { "s" }), value)
    };
    let items: Vec<Value> = match value.as_vector() {
        Some(items) => items.iter().cloned().collect(),
        None => {
            let mut iter = value.iter();
            let mut items: Vec<Value> = iter.by_ref().take(n).cloned().collect();
            match (with_rest, iter.rest.is_nil()) {
                (true, _) if items.len() == n => {
                    items.push(iter.rest.clone());
                    return Ok(Value::list(items));
                }
                (false, true) if items.len() == n => return Ok(Value::list(items)),
                _ => return Err(wanted()),
            }
        }
    };
    match (items.len() == n, items.len() > n && with_rest || items.len() == n) {
        (true, _) if !with_rest => Ok(Value::list(items)),
        (_, true) if with_rest => {
            let rest = Value::list(items[n..].to_vec());
            Ok(Value::list(items[..n].iter().cloned().chain([rest]).collect::<Vec<_>>()))
        }
        _ => Err(wanted()),
    }
}

fn gensym(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let stem = args.first().map(str).transpose()?.unwrap_or("g");
    Ok(Value::Imm(Imm::Symbol(ctx.fresh(stem))).into())
}
