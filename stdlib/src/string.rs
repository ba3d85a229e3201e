//! Strings. Positions and lengths count characters, not bytes.

use std::borrow::Cow;

use vm::machine::Ctx;
use vm::native::{Next, Raise, index, int, range_error, str};
use vm::value::Value;

use crate::limit;
use crate::sequence::elements;
use crate::table::natives;

natives! {
    "string" [0 ..] in ctx => of_values;
    "write-to-string" [1] in ctx => |ctx: &mut Ctx<'_>, args| Ok(Value::str(ctx.text(&args[0], true)).into());
    "string?" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_str().is_some()));
    "stringp" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_str().is_some()));
    "concat" [0 ..] => concat;
    "string-join" [1 2] in ctx => join;
    "repeat" [2] => repeat;
    "split" [1 2] => split;
    "substring" [2 3] => substring;
    "index-of" [2 3] => index_of;
    "contains?" [2] => |args: &[Value]| Ok(Value::bool(str(&args[0])?.contains(str(&args[1])?)));
    "starts-with?" [2] => |args: &[Value]| Ok(Value::bool(str(&args[0])?.starts_with(str(&args[1])?)));
    "ends-with?" [2] => |args: &[Value]| Ok(Value::bool(str(&args[0])?.ends_with(str(&args[1])?)));
    "string-replace" [3] => replace;
    "trim" [1] => |args: &[Value]| Ok(Value::str(str(&args[0])?.trim()));
    "upcase" [1] => |args: &[Value]| Ok(Value::str(str(&args[0])?.to_uppercase()));
    "string-upcase" [1] => |args: &[Value]| Ok(Value::str(str(&args[0])?.to_uppercase()));
    "downcase" [1] => |args: &[Value]| Ok(Value::str(str(&args[0])?.to_lowercase()));
    "string-downcase" [1] => |args: &[Value]| Ok(Value::str(str(&args[0])?.to_lowercase()));
    "string=" [2] => |args: &[Value]| Ok(Value::bool(str(&args[0])? == str(&args[1])?));
    "string<" [2] => |args: &[Value]| Ok(Value::bool(str(&args[0])? < str(&args[1])?));
    "string->list" [1] => |args: &[Value]| Ok(Value::list(characters(str(&args[0])?)));
    "char-code" [1] => char_code;
    "code-char" [1] => code_char;
}

/// A value as text for people. A string is its own text, however long it is.
pub(crate) fn shown<'v>(ctx: &Ctx<'_>, value: &'v Value) -> Cow<'v, str> {
    value.as_str().map_or_else(|| Cow::Owned(ctx.text(value, false)), Cow::Borrowed)
}

fn of_values(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let mut text = limit::Text::default();
    for arg in args {
        text.push(&shown(ctx, arg))?;
    }
    Ok(Value::str(text.into_string()).into())
}

fn concat(args: &[Value]) -> Result<Value, Raise> {
    let mut text = limit::Text::default();
    for arg in args {
        text.push(str(arg)?)?;
    }
    Ok(Value::str(text.into_string()))
}

fn join(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let separator = args.get(1).map_or(Ok(""), str)?;
    let mut text = limit::Text::default();
    for (i, item) in elements(&args[0])?.iter().enumerate() {
        if i > 0 {
            text.push(separator)?;
        }
        text.push(&shown(ctx, item))?;
    }
    Ok(Value::str(text.into_string()).into())
}

fn repeat(args: &[Value]) -> Result<Value, Raise> {
    let (text, n) = (str(&args[0])?, index(&args[1])?);
    limit::text(text.len().saturating_mul(n))?;
    Ok(Value::str(text.repeat(n)))
}

fn split(args: &[Value]) -> Result<Value, Raise> {
    let text = str(&args[0])?;
    let parts: Vec<_> = match args.get(1).map(str).transpose()? {
        None => text.split_whitespace().map(Value::str).collect(),
        Some("") => return Err(range_error("the separator is empty", &args[1])),
        Some(separator) => text.split(separator).map(Value::str).collect(),
    };
    Ok(Value::list(parts))
}

fn replace(args: &[Value]) -> Result<Value, Raise> {
    let (text, old, new) = (str(&args[0])?, str(&args[1])?, str(&args[2])?);
    if old.is_empty() {
        return Err(range_error("the text to be replaced is empty", &args[1]));
    }
    let places = text.matches(old).count();
    limit::text(text.len().saturating_add(new.len().saturating_mul(places)))?;
    Ok(Value::str(text.replace(old, new)))
}

fn characters(text: &str) -> Vec<Value> {
    text.chars().map(|c| Value::str(c.to_string())).collect()
}

// ---------------------------------------------------------------------------------------------
// Positions

/// How many characters.
pub(crate) fn length(text: &str) -> usize {
    text.chars().count()
}

/// The byte where character `at` begins; the end of the text if there is no such character.
fn byte_of(text: &str, at: usize) -> usize {
    if text.is_ascii() {
        at.min(text.len())
    } else {
        text.char_indices().nth(at).map_or(text.len(), |(byte, _)| byte)
    }
}

/// The characters from `start` up to `end`, as far as they exist.
pub(crate) fn part(text: &str, start: usize, end: Option<usize>) -> &str {
    let tail = &text[byte_of(text, start)..];
    end.map_or(tail, |end| &tail[..byte_of(tail, end.saturating_sub(start))])
}

fn substring(args: &[Value]) -> Result<Value, Raise> {
    let text = str(&args[0])?;
    let (length, start) = (length(text), index(&args[1])?);
    let end = args.get(2).filter(|end| !end.is_nil()).map_or(Ok(length), index)?;
    if start > end || end > length {
        let message = format!("there is no part from {start} to {end} of {length} characters");
        return Err(range_error(message, args.get(2).unwrap_or(&args[1])));
    }
    Ok(Value::str(part(text, start, Some(end))))
}

fn index_of(args: &[Value]) -> Result<Value, Raise> {
    let (text, wanted) = (str(&args[0])?, str(&args[1])?);
    let start = args.get(2).map_or(Ok(0), index)?;
    let from = byte_of(text, start);
    let at = text[from..].find(wanted).map(|byte| length(&text[..from + byte]) as i64);
    Ok(at.map(Value::int).unwrap_or_default())
}

fn char_code(args: &[Value]) -> Result<Value, Raise> {
    let mut characters = str(&args[0])?.chars();
    match (characters.next(), characters.next()) {
        (Some(c), None) => Ok(Value::int(i64::from(u32::from(c)))),
        _ => Err(range_error("expected a string of one character", &args[0])),
    }
}

fn code_char(args: &[Value]) -> Result<Value, Raise> {
    let c = u32::try_from(int(&args[0])?).ok().and_then(char::from_u32);
    let c = c.ok_or_else(|| range_error("there is no character with this number", &args[0]))?;
    Ok(Value::str(c.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_count_characters() {
        assert_eq!(part("größe", 1, Some(4)), "röß");
        assert_eq!(part("größe", 9, Some(12)), "");
        assert_eq!(part("abc", 2, None), "c");
        let at = index_of(&[Value::str("größe"), Value::str("e")]);
        assert_eq!(at.map_err(|raise| raise.name.to_string()), Ok(Value::int(4)));
    }

    #[test]
    fn long_texts_are_refused_before_they_are_made() {
        assert!(repeat(&[Value::str("ab"), Value::int(i64::MAX)]).is_err());
        let text = Value::str("a".repeat(1 << 20));
        assert!(replace(&[text.clone(), Value::str("a"), text]).is_err());
    }
}
