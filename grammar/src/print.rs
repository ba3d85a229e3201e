//! Forms to text, on one line.
//!
//! What is printed reads back as an equal form, floats as floats and odd names in bars. To lay
//! out a whole file, see [`mod@crate::format`].

use std::fmt::{self, Display, Formatter, Write};

use crate::form::{Form, FormKind};
use crate::literal::{is_hidden, is_plain_keyword, is_plain_symbol};

impl Display for Form {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.kind.fmt(f)
    }
}

impl Display for FormKind {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            FormKind::Symbol(name) if is_plain_symbol(name) => f.write_str(name),
            FormKind::Symbol(name) => quoted(f, name, '|'),
            FormKind::Keyword(name) if is_plain_keyword(name) => write!(f, ":{name}"),
            FormKind::Keyword(name) => {
                f.write_char(':')?;
                quoted(f, name, '|')
            }
            FormKind::Int(value) => value.fmt(f),
            FormKind::Float(value) => float(f, *value),
            FormKind::Str(text) => quoted(f, text, '"'),
            FormKind::List(items) => sequence(f, '(', items, ')'),
            FormKind::Vector(items) => sequence(f, '[', items, ']'),
            FormKind::Map(pairs) => map(f, pairs),
            FormKind::Prefixed(sign, form) => write!(f, "{}{form}", sign.sign()),
        }
    }
}

fn float(f: &mut Formatter<'_>, value: f64) -> fmt::Result {
    if value.is_nan() {
        f.write_str("+nan")
    } else if value.is_infinite() {
        f.write_str(if value > 0.0 { "+inf" } else { "-inf" })
    } else {
        // The shortest text that reads back as the same float, always with a point or an exponent.
        write!(f, "{value:?}")
    }
}

fn quoted(f: &mut Formatter<'_>, text: &str, quote: char) -> fmt::Result {
    f.write_char(quote)?;
    for c in text.chars() {
        match c {
            '\n' => f.write_str("\\n")?,
            '\t' => f.write_str("\\t")?,
            '\r' => f.write_str("\\r")?,
            '\0' => f.write_str("\\0")?,
            c if c == '\\' || c == quote => write!(f, "\\{c}")?,
            c if is_hidden(c) => write!(f, "{}", c.escape_unicode())?,
            c => f.write_char(c)?,
        }
    }
    f.write_char(quote)
}

fn sequence(f: &mut Formatter<'_>, open: char, items: &[Form], close: char) -> fmt::Result {
    f.write_char(open)?;
    for (index, item) in items.iter().enumerate() {
        if index > 0 {
            f.write_char(' ')?;
        }
        item.fmt(f)?;
    }
    f.write_char(close)
}

fn map(f: &mut Formatter<'_>, pairs: &[(Form, Form)]) -> fmt::Result {
    f.write_char('{')?;
    for (index, (key, value)) in pairs.iter().enumerate() {
        if index > 0 {
            f.write_char(' ')?;
        }
        write!(f, "{key} {value}")?;
    }
    f.write_char('}')
}
