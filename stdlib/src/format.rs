//! `format`: text with the values of expressions in it, by the directives of Common Lisp.
//!
//! A directive is `~`, up to two numbers with a comma between, and a letter. What Common Lisp lets
//! pass (too many arguments, `~d` of a string) is a failure here: it is a mistake of the program.

use vm::failure::{Builtin, Failure};
use vm::machine::Ctx;
use vm::native::{Next, Raise, int, number, str};
use vm::value::Value;

use crate::limit;
use crate::string::shown;
use crate::table::natives;

natives! {
    "format" [1 ..] in ctx => format;
}

/// Widest field and most decimals.
const WIDTH_LIMIT: usize = 1000;

/// `~8,2f`
struct Directive {
    letter: char,
    width: Option<usize>,
    decimals: Option<usize>,
}

/// The text between directives, and the directives.
enum Part<'a> {
    Text(&'a str),
    Directive(Directive),
}

fn format(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let parts = parse(str(&args[0])?)?;
    let mut values = args[1..].iter();
    let mut out = limit::Text::default();
    for part in parts {
        match part {
            Part::Text(text) => out.push(text)?,
            Part::Directive(directive) => out.push(&directive.text(ctx, &mut values)?)?,
        }
    }
    match values.len() {
        0 => Ok(Value::str(out.into_string()).into()),
        left => Err(arity(format!("{left} more values than directives"))),
    }
}

fn arity(message: String) -> Raise {
    Box::new(Failure::new(Builtin::ArityError, message))
}

fn parse(text: &str) -> Result<Vec<Part<'_>>, Raise> {
    let mut parts = Vec::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('~') {
        parts.push(Part::Text(before));
        let (directive, after) = Directive::parse(after).ok_or_else(|| unknown(after, text))?;
        parts.push(Part::Directive(directive));
        rest = after;
    }
    parts.push(Part::Text(rest));
    Ok(parts)
}

fn unknown(after: &str, text: &str) -> Raise {
    let shown: String = after.chars().take(8).collect();
    let known = "~a ~s ~d ~f ~% ~~, with a width and decimals as in ~8,2f";
    let message = format!("no directive begins like `~{shown}`: there are {known}");
    Box::new(Failure::with(
        Builtin::ParseError,
        vec![("message", Value::str(message)), ("text", Value::str(text))],
    ))
}

impl Directive {
    /// The directive whose `~` has been read, and what follows it.
    fn parse(text: &str) -> Option<(Directive, &str)> {
        let (width, text) = size(text)?;
        let (decimals, text) = match text.strip_prefix(',') {
            Some(text) => size(text)?,
            None => (None, text),
        };
        let letter = text.chars().next()?.to_ascii_lowercase();
        let known = match letter {
            'f' => true,
            'a' | 's' | 'd' | '%' | '~' => decimals.is_none(),
            _ => false,
        };
        known.then(|| (Directive { letter, width, decimals }, &text[letter.len_utf8()..]))
    }

    /// Numbers stand at the right of their field, everything else at the left.
    fn text(&self, ctx: &mut Ctx<'_>, values: &mut std::slice::Iter<'_, Value>) -> Result<String, Raise> {
        let width = self.width.unwrap_or(0);
        if matches!(self.letter, '%' | '~') {
            let sign = if self.letter == '%' { "\n" } else { "~" };
            return Ok(sign.repeat(self.width.unwrap_or(1)));
        }
        let value = values.next().ok_or_else(|| arity(format!("no value is left for `~{}`", self.letter)))?;
        Ok(match self.letter {
            'd' => format!("{:>width$}", int(value)?),
            'f' => format!("{:>width$}", self.float(number(value)?)),
            's' => format!("{:<width$}", ctx.text(value, true)),
            _ => format!("{:<width$}", shown(ctx, value)),
        })
    }

    fn float(&self, value: f64) -> String {
        match self.decimals {
            Some(decimals) if value.is_finite() => format!("{value:.decimals$}"),
            _ => vm::print::float(value),
        }
    }
}

/// A number in front of the letter, if there is one; nothing if it is too large.
fn size(text: &str) -> Option<(Option<usize>, &str)> {
    let digits = text.bytes().take_while(u8::is_ascii_digit).count();
    let (size, rest) = text.split_at(digits);
    if size.is_empty() {
        return Some((None, rest));
    }
    let size = size.parse().ok().filter(|size| *size <= WIDTH_LIMIT)?;
    Some((Some(size), rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directives() {
        for (text, letter, width, decimals) in [
            ("a", 'a', None, None),
            ("12D!", 'd', Some(12), None),
            (",2f", 'f', None, Some(2)),
            ("8,3f", 'f', Some(8), Some(3)),
            ("~", '~', None, None),
        ] {
            let (directive, _) = Directive::parse(text).expect(text);
            assert_eq!(
                (directive.letter, directive.width, directive.decimals),
                (letter, width, decimals),
                "{text}"
            );
        }
        for text in ["", "q", "2,2a", "9999999999f", ",,f", "ä"] {
            assert!(Directive::parse(text).is_none(), "{text}");
        }
    }
}
