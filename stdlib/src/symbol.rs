//! Symbols and keywords.

use vm::native::{Raise, str, too_large, type_error};
use vm::value::Value;

use crate::table::natives;
use crate::value::field;

natives! {
    "symbol?" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_symbol().is_some()));
    "symbolp" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_symbol().is_some()));
    "keyword?" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_keyword().is_some()));
    "keywordp" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_keyword().is_some()));
    "string->symbol" [1] => |args: &[Value]| Ok(named(name(&args[0])?));
    "intern" [1] => |args: &[Value]| Ok(named(name(&args[0])?));
    "string->keyword" [1] => |args: &[Value]| Ok(Value::keyword(name(&args[0])?));
    "symbol->string" [1] => |args: &[Value]| Ok(Value::str(field(&args[0])?.as_str()));
    "symbol-name" [1] => |args: &[Value]| Ok(Value::str(field(&args[0])?.as_str()));
    "symbol->keyword" [1] => symbol_to_keyword;
    "keyword->symbol" [1] => keyword_to_symbol;
}

/// Names are kept as long as the process lives, so they are short.
const NAME_LIMIT: usize = 1000;

fn name(value: &Value) -> Result<&str, Raise> {
    let name = str(value)?;
    if name.len() <= NAME_LIMIT {
        Ok(name)
    } else {
        Err(too_large(format!("a name has at most {NAME_LIMIT} bytes")))
    }
}

/// What the reader makes of a name: the three that are no symbols are the values themselves.
pub(crate) fn named(name: &str) -> Value {
    match name {
        "nil" => Value::NIL,
        "true" => Value::TRUE,
        "false" => Value::FALSE,
        _ => Value::symbol(name),
    }
}

fn symbol_to_keyword(args: &[Value]) -> Result<Value, Raise> {
    let name = args[0].as_symbol().ok_or_else(|| type_error("a symbol", &args[0]))?;
    Ok(Value::keyword(&name))
}

fn keyword_to_symbol(args: &[Value]) -> Result<Value, Raise> {
    let name = args[0].as_keyword().ok_or_else(|| type_error("a keyword", &args[0]))?;
    Ok(named(&name))
}
