//! What a word or a quoted text stands for: numbers, names, escapes.
//!
//! Reading and printing share this file, so that what is printed reads back.

/// What a word without colon and bars is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Word {
    Symbol,
    Int(i64),
    Float(f64),
    Bad(NumberFault),
}

/// Why a word that looks like a number is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NumberFault {
    Malformed,
    IntRange,
    FloatRange,
    Point,
}

impl NumberFault {
    /// The rest of a sentence that starts with the word.
    pub(crate) fn why(self) -> &'static str {
        match self {
            NumberFault::Malformed | NumberFault::Point => "is not a number",
            NumberFault::IntRange => "does not fit into 64 bits",
            NumberFault::FloatRange => "is too large for a float",
        }
    }

    pub(crate) fn help(self) -> &'static str {
        match self {
            NumberFault::Malformed => {
                "a name that starts like a number stands in bars, `|2d|`; numbers are `42`, `1_000`, `0xff`, `0b101`, `1.5`, `2e3`"
            }
            NumberFault::Point => "write a digit on each side of the point: `0.5`, `1.0`",
            NumberFault::IntRange => {
                "integers go from -9223372036854775808 to 9223372036854775807; write a float, such as `1e30`, for more"
            }
            NumberFault::FloatRange => "the greatest float is about `1.8e308`; infinity is written `+inf`",
        }
    }
}

/// True if `c` may stand in a name that has no bars.
///
/// ASCII is decided by a list. Of the rest everything is allowed but blanks and what a reader
/// cannot see or takes for something else: controls, marks of direction, curly quotes.
pub(crate) fn is_symbol_char(c: char) -> bool {
    match c {
        'a'..='z' | 'A'..='Z' | '0'..='9' => true,
        '\0'..='\x7f' => "/?!*<>=+-_%&.:@~^|$".contains(c),
        '\u{ab}' | '\u{bb}' => false,
        '\u{ad}' | '\u{61c}' | '\u{180e}' => false,
        '\u{200b}'..='\u{206f}' | '\u{feff}' | '\u{fff0}'..='\u{ffff}' => is_general_symbol(c),
        '\u{e000}'..='\u{f8ff}' | '\u{e0000}'.. => false,
        _ => !c.is_whitespace() && !c.is_control(),
    }
}

/// The few characters of the block "General Punctuation" that are signs of their own.
fn is_general_symbol(c: char) -> bool {
    matches!(c, '\u{2020}'..='\u{2027}' | '\u{2030}'..='\u{2038}' | '\u{203b}'..='\u{205e}')
}

/// True if `name` reads back as this symbol without bars.
pub(crate) fn is_plain_symbol(name: &str) -> bool {
    !name.is_empty()
        && !name.starts_with([':', '@', '|'])
        && name.chars().all(is_symbol_char)
        && classify(name) == Word::Symbol
}

/// True if `:name` reads back as this keyword without bars.
pub(crate) fn is_plain_keyword(name: &str) -> bool {
    !name.is_empty() && !name.starts_with('|') && name.chars().all(is_symbol_char)
}

/// Number or symbol? A word that begins like a number must be one; only `1+` and `1-` are names.
pub(crate) fn classify(word: &str) -> Word {
    let bytes = word.as_bytes();
    let digit = |at: usize| bytes.get(at).is_some_and(u8::is_ascii_digit);
    let point = |at: usize| bytes.get(at) == Some(&b'.') && digit(at + 1);
    let numeric = match bytes.first() {
        Some(b'0'..=b'9') => true,
        Some(b'+' | b'-') => digit(1) || point(1),
        Some(b'.') => point(0),
        _ => false,
    };
    match word {
        "+inf" => Word::Float(f64::INFINITY),
        "-inf" => Word::Float(f64::NEG_INFINITY),
        "+nan" => Word::Float(f64::NAN),
        "1+" | "1-" => Word::Symbol,
        _ if numeric => number(word),
        _ => Word::Symbol,
    }
}

fn number(word: &str) -> Word {
    let unsigned = word.strip_prefix(['+', '-']).unwrap_or(word);
    let radix = match unsigned.as_bytes() {
        [b'0', b'x' | b'X', ..] => 16,
        [b'0', b'b' | b'B', ..] => 2,
        _ => return decimal(word, unsigned),
    };
    let digits = &unsigned[2..];
    if run_of_digits(digits, radix) != digits.len() || digits.is_empty() {
        return Word::Bad(NumberFault::Malformed);
    }
    let sign = if word.starts_with('-') { "-" } else { "" };
    let plain = format!("{sign}{}", digits.replace('_', ""));
    i64::from_str_radix(&plain, radix).map_or(Word::Bad(NumberFault::IntRange), Word::Int)
}

/// `word` is `unsigned` with its sign.
fn decimal(word: &str, unsigned: &str) -> Word {
    let whole = run_of_digits(unsigned, 10);
    let mut rest = &unsigned[whole..];
    let is_float = !rest.is_empty();
    if let Some(fraction) = rest.strip_prefix('.') {
        let len = run_of_digits(fraction, 10);
        let ends = fraction.len() == len || fraction[len..].starts_with(['e', 'E']);
        if whole == 0 || len == 0 {
            return Word::Bad(if ends { NumberFault::Point } else { NumberFault::Malformed });
        }
        rest = &fraction[len..];
    }
    if let Some(exponent) = rest.strip_prefix(['e', 'E']) {
        let digits = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
        let len = run_of_digits(digits, 10);
        rest = if len == 0 { "e" } else { &digits[len..] };
    }
    if whole == 0 || !rest.is_empty() {
        return Word::Bad(NumberFault::Malformed);
    }
    let without;
    let plain = if word.contains('_') {
        without = word.replace('_', "");
        &without
    } else {
        word
    };
    if !is_float {
        return plain.parse().map_or(Word::Bad(NumberFault::IntRange), Word::Int);
    }
    match plain.parse::<f64>() {
        Ok(value) if value.is_finite() => Word::Float(value),
        _ => Word::Bad(NumberFault::FloatRange),
    }
}

/// Length of the digits at the start of `text`; underscores may stand between two digits.
fn run_of_digits(text: &str, radix: u32) -> usize {
    let is_digit = |byte: &u8| char::from(*byte).is_digit(radix);
    let bytes = text.as_bytes();
    let mut len = 0;
    while let Some(byte) = bytes.get(len) {
        let joins =
            *byte == b'_' && len > 0 && bytes.get(len + 1).is_some_and(is_digit) && bytes[len - 1] != b'_';
        if !is_digit(byte) && !joins {
            break;
        }
        len += 1;
    }
    len
}

/// What is wrong inside a quoted text, at bytes `start..end` of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct QuotedFault {
    pub(crate) start: usize,
    pub(crate) end: usize,
    /// An escape if true, else a character that may not stand as it is.
    pub(crate) escape: bool,
    pub(crate) help: &'static str,
}

/// What an escape stands for, nothing for an escaped line end, or how escapes are written; and how many bytes of the
/// text after its backslash it takes.
pub(crate) type Escaped = (Result<Option<char>, &'static str>, usize);

/// What stands for other characters in quoted text.
pub(crate) struct Quoting {
    /// The escape that goes on with a text; the quote is that which ends what it stands in.
    pub(crate) escape: fn(&str, char) -> Escaped,
    /// How to write what nobody could see.
    pub(crate) invisible: &'static str,
}

/// That of our own text.
pub(crate) const PLAIN: Quoting = Quoting { escape, invisible: INVISIBLE };

const ESCAPES: &str = "the escapes are `\\n`, `\\t`, `\\r`, `\\0`, `\\\\`, `\\u{1F600}` and, before the quote or bar that would end the text, `\\`";
const UNICODE: &str = "write the number of a Unicode character in hexadecimal: `\\u{1F600}`";
const INVISIBLE: &str = "an invisible character is written by its number: `\\u{1b}`";

/// True if `c` must be escaped in quoted text, because nobody could see it.
pub(crate) fn is_hidden(c: char) -> bool {
    (c.is_control() && !matches!(c, '\n' | '\t' | '\r'))
        || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The text between two quotes (or bars), its escapes resolved. Faults are left out of the result.
///
/// A quote inside of it is written twice, where a kind of text has that: else it would be its end.
pub(crate) fn unquote(raw: &str, quote: char, quoting: &Quoting, faults: &mut Vec<QuotedFault>) -> Box<str> {
    let is_plain = |byte: u8| matches!(byte, b' '..=b'~') && byte != b'\\' && char::from(byte) != quote;
    if raw.bytes().all(is_plain) {
        return raw.into();
    }
    let mut out = String::with_capacity(raw.len());
    let mut at = 0;
    while let Some(c) = raw[at..].chars().next() {
        let mut end = at + c.len_utf8();
        if c == '\\' {
            let (value, len) = (quoting.escape)(&raw[end..], quote);
            end += len;
            match value {
                Ok(value) => out.extend(value),
                Err(help) => faults.push(QuotedFault { start: at, end, escape: true, help }),
            }
        } else if is_hidden(c) {
            faults.push(QuotedFault { start: at, end, escape: false, help: quoting.invisible });
        } else {
            out.push(c);
            end += usize::from(c == quote);
        }
        at = end;
    }
    out.into()
}

/// The escape that goes on with `rest`.
fn escape(rest: &str, quote: char) -> Escaped {
    let Some(c) = rest.chars().next() else { return (Err(ESCAPES), 0) };
    let value = match c {
        'n' => '\n',
        't' => '\t',
        'r' => '\r',
        '0' => '\0',
        '\\' => '\\',
        'u' => return unicode_escape(rest),
        c if c == quote => c,
        _ => return (Err(ESCAPES), c.len_utf8()),
    };
    (Ok(Some(value)), c.len_utf8())
}

/// `rest` starts with the `u` of `\u{…}`.
fn unicode_escape(rest: &str) -> Escaped {
    let Some(digits) = rest.strip_prefix("u{") else { return (Err(UNICODE), 1) };
    let len = digits.bytes().take_while(u8::is_ascii_hexdigit).count();
    if !digits[len..].starts_with('}') {
        return (Err(UNICODE), 2 + len);
    }
    let value = (1..=6)
        .contains(&len)
        .then(|| u32::from_str_radix(&digits[..len], 16).ok().and_then(char::from_u32))
        .flatten();
    (value.map(Some).ok_or(UNICODE), len + 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers() {
        for (word, value) in
            [("0", 0), ("-7", -7), ("+5", 5), ("1_000", 1000), ("0xff", 255), ("-0b1_01", -5)]
        {
            assert_eq!(classify(word), Word::Int(value), "{word}");
        }
        assert_eq!(classify("-0x8000000000000000"), Word::Int(i64::MIN));
        assert_eq!(classify("9223372036854775807"), Word::Int(i64::MAX));
        for (word, value) in
            [("1.5", 1.5), ("-2e3", -2e3), ("1.0e-5", 1e-5), ("1_0.2_5", 10.25), ("-inf", -f64::INFINITY)]
        {
            assert_eq!(classify(word), Word::Float(value), "{word}");
        }
    }

    #[test]
    fn what_starts_like_a_number_must_be_one() {
        use NumberFault as F;
        for word in [
            "12abc", "1.2.3", "-1-", "1++", "0x", "0b2", "1__0", "1_", "1e", "1e+", "2d", "+1x", "-.5.",
            "0xfg",
        ] {
            assert_eq!(classify(word), Word::Bad(F::Malformed), "{word}");
        }
        for word in [".5", "-.5", "1.", "1.e5"] {
            assert_eq!(classify(word), Word::Bad(F::Point), "{word}");
        }
        assert_eq!(classify("9223372036854775808"), Word::Bad(F::IntRange));
        assert_eq!(classify("0xffff_ffff_ffff_ffff"), Word::Bad(F::IntRange));
        assert_eq!(classify("1e999"), Word::Bad(F::FloatRange));
    }

    #[test]
    fn names() {
        for word in
            ["+", "-", "...", "->", "*->", "1+", "1-", "-x", ".", "+infinity", "<-", "a|b", "größe", "→"]
        {
            assert!(is_plain_symbol(word), "{word}");
        }
        for word in ["", "a b", ":a", "@a", "|a", "12", "+inf", "a#", "a'", "\u{202e}a", "“a”", "\u{7f}"]
        {
            assert!(!is_plain_symbol(word), "{word}");
        }
    }
}
