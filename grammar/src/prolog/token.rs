//! Prolog text to lexemes.
//!
//! As for our own text, logos finds where a token begins and what kind it is, and what is quoted
//! is scanned by hand. What a name is (an operator, an atom, a functor) depends on its neighbours,
//! so that is left to [`super::reader`]; and so is the value of a number, as a minus may belong to it.

use logos::Logos;

use super::error::PrologError;
use crate::error::ParseError;
use crate::form::Symbol;
use crate::literal::{self, Escaped, Quoting, Word};
use crate::parse::Comment;
use crate::span::{FileId, Span};
use crate::token::{Bracket, Report, line_end, preamble, show};

/// What Prolog text is made of.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Lexeme {
    Open(Bracket),
    Close(Bracket),
    Comma,
    Bar,
    /// `milk`, `'sink area'`, `=..`, `;`; quoted if true
    Atom(Symbol, bool),
    Variable(Symbol),
    /// Digits, see [`number`].
    Number,
    /// `0'a`
    Code(i64),
    Str(Box<str>),
    /// The point that ends a clause.
    End,
    /// Something that was reported.
    Invalid,
}

/// How tokens begin.
#[derive(Logos, Debug, Clone, Copy, PartialEq)]
#[logos(skip r"[ \t\r\n\x0c]+")]
enum Raw {
    #[token("(")]
    ParenOpen,
    #[token(")")]
    ParenClose,
    #[token("[")]
    SquareOpen,
    #[token("]")]
    SquareClose,
    #[token("{")]
    CurlyOpen,
    #[token("}")]
    CurlyClose,
    #[token(",")]
    Comma,
    #[token("|")]
    Bar,
    #[token("%")]
    LineComment,
    #[token("/*")]
    BlockComment,
    #[token("'")]
    Quoted,
    #[token("\"")]
    String,
    #[token("`")]
    BackQuoted,
    #[token("0'")]
    Code,
    #[regex(r"[0-9][0-9_]*(\.[0-9][0-9_]*)?([eE][+-]?[0-9]+)?[A-Za-z0-9_]*")]
    Number,
    #[regex(r"[a-z][A-Za-z0-9_]*|[!;]")]
    Name,
    #[regex(r"[A-Z_][A-Za-z0-9_]*")]
    Variable,
    // All runs of these signs but those that begin a comment.
    #[regex(r"[#$&*+.:<=>?@^~\\-][#$&*+./:<=>?@^~\\-]*|/([#$&+./:<=>?@^~\\-][#$&*+./:<=>?@^~\\-]*)?")]
    Signs,
    #[regex(r"[^\x00-\x7F]")]
    Unicode,
}

/// A lexeme and its bytes `start..end`.
pub(super) type Spanned = (usize, Lexeme, usize);

/// Cuts a text into lexemes; comments and mistakes are put aside.
pub(super) struct Lexer<'t> {
    raw: logos::Lexer<'t, Raw>,
    file: FileId,
    pub(super) text: &'t str,
    pub(super) comments: Vec<Comment>,
    pub(super) report: Report,
}

impl<'t> Lexer<'t> {
    pub(super) fn new(file: FileId, text: &'t str) -> Lexer<'t> {
        let (comments, report) = (Vec::new(), Report::default());
        let mut lexer = Lexer { raw: Raw::lexer(text), file, text, comments, report };
        lexer.skip_preamble();
        lexer
    }

    pub(super) fn span(&self, start: usize, end: usize) -> Span {
        Span::new(self.file, start, end)
    }

    pub(super) fn next(&mut self) -> Option<Spanned> {
        loop {
            let raw = self.raw.next()?;
            let start = self.raw.span().start;
            if let Some(lexeme) = self.lexeme(raw, start) {
                return Some((start, lexeme, self.raw.span().end));
            }
        }
    }

    fn skip_preamble(&mut self) {
        let (end, is_comment) = preamble(self.text);
        self.raw.bump(end);
        if is_comment {
            self.comment(0, false);
        }
    }

    fn lexeme(&mut self, raw: Result<Raw, ()>, start: usize) -> Option<Lexeme> {
        Some(match raw {
            Ok(Raw::ParenOpen) => Lexeme::Open(Bracket::Paren),
            Ok(Raw::ParenClose) => Lexeme::Close(Bracket::Paren),
            Ok(Raw::SquareOpen) => Lexeme::Open(Bracket::Square),
            Ok(Raw::SquareClose) => Lexeme::Close(Bracket::Square),
            Ok(Raw::CurlyOpen) => Lexeme::Open(Bracket::Curly),
            Ok(Raw::CurlyClose) => Lexeme::Close(Bracket::Curly),
            Ok(Raw::Comma) => Lexeme::Comma,
            Ok(Raw::Bar) => Lexeme::Bar,
            Ok(Raw::LineComment) => {
                self.raw.bump(line_end(self.raw.remainder()));
                self.comment(start, false);
                return None;
            }
            Ok(Raw::BlockComment) => {
                self.block_comment(start);
                return None;
            }
            Ok(Raw::Quoted) => self
                .quoted(start, '\'')
                .map_or(Lexeme::Invalid, |name| Lexeme::Atom(name.as_ref().into(), true)),
            Ok(Raw::String) => self.quoted(start, '"').map_or(Lexeme::Invalid, Lexeme::Str),
            Ok(Raw::BackQuoted) => self.back_quoted(start),
            Ok(Raw::Code) => self.code(start),
            Ok(Raw::Number) => {
                self.extend_word();
                Lexeme::Number
            }
            Ok(Raw::Name) => {
                self.extend_word();
                Lexeme::Atom(self.raw.slice().into(), false)
            }
            Ok(Raw::Variable) => {
                self.extend_word();
                Lexeme::Variable(self.raw.slice().into())
            }
            Ok(Raw::Signs) if self.raw.slice() == "." && ends_clause(self.raw.remainder()) => Lexeme::End,
            Ok(Raw::Signs) => Lexeme::Atom(self.raw.slice().into(), false),
            Ok(Raw::Unicode) => return self.unicode(start),
            Err(()) => self.invalid(start),
        })
    }

    fn comment(&mut self, start: usize, block: bool) {
        let span = self.span(start, self.raw.span().end);
        self.comments.push(Comment { span, block });
    }

    fn block_comment(&mut self, start: usize) {
        let rest = self.raw.remainder();
        let end = rest.find("*/");
        self.raw.bump(end.map_or(rest.len(), |end| end + 2));
        if end.is_none() {
            let (what, help) = ("a comment", "end it with `*/`; such comments do not nest in Prolog".into());
            self.report.push(PrologError::Unclosed { what, at: self.span(start, start + 2), help }.into());
        }
        self.comment(start, true);
    }

    /// The rest of a quoted text, its first quote being read; `None` if it has no end.
    fn quoted(&mut self, start: usize, quote: char) -> Option<Box<str>> {
        let rest = self.raw.remainder();
        let Some(len) = quoted_len(rest, quote) else {
            // Its line is lost, but not the point that most likely ends the clause there.
            let line = rest[..line_end(rest)].trim_end();
            self.raw.bump(line.strip_suffix('.').unwrap_or(line).len());
            let what = match quote {
                '"' => "a string",
                '`' => "a text in back quotes",
                _ => "a quoted name",
            };
            let help = format!("end it with `{quote}` on the same line; a line end in it is written `\\n`");
            let at = self.span(start, start + 1);
            self.report.push(PrologError::Unclosed { what, at, help }.into());
            return None;
        };
        self.raw.bump(len + 1);
        let mut faults = Vec::new();
        let value = literal::unquote(&rest[..len], quote, &QUOTING, &mut faults);
        for fault in faults {
            self.report.push(fault.error(rest, self.file, start + 1));
        }
        Some(value)
    }

    fn back_quoted(&mut self, start: usize) -> Lexeme {
        if self.quoted(start, '`').is_some() {
            let at = self.span(start, self.raw.span().end);
            let help = "write a string, `\"text\"`";
            let what = "a list of codes in back quotes".into();
            self.report.push(PrologError::NotTaken { what, at, help }.into());
        }
        Lexeme::Invalid
    }

    /// The rest of `0'a`.
    fn code(&mut self, start: usize) -> Lexeme {
        let rest = self.raw.remainder();
        let (code, len) = match rest.chars().next() {
            Some('\\') => {
                let (value, len) = escape(&rest[1..]);
                (value.ok().flatten(), len + 1)
            }
            Some('\'') if rest.starts_with("''") => (Some('\''), 2),
            Some('\'') => (None, 1),
            Some('\n') | None => (None, 0),
            Some(c) => (Some(c).filter(|c| !literal::is_hidden(*c)), c.len_utf8()),
        };
        self.raw.bump(len);
        if let Some(c) = code {
            return Lexeme::Code(i64::from(u32::from(c)));
        }
        let (text, at) = (show(self.raw.slice()), self.span(start, self.raw.span().end));
        let help = "a character's number is written `0'a`, `0'''` for the quote, `0'\\n` for a line end";
        self.report.push(ParseError::Number { text, why: "is not a number", at, help });
        Lexeme::Invalid
    }

    /// A word goes on over letters that are not ASCII, which the table of logos leaves out to stay small.
    fn extend_word(&mut self) {
        let rest = self.raw.remainder();
        let is_word = self.raw.slice().ends_with(|c: char| c.is_alphanumeric() || c == '_');
        if is_word && rest.as_bytes().first().is_some_and(|byte| *byte >= 0x80) {
            self.raw.bump(rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len()));
        }
    }

    /// A character that is not ASCII, at the start of a token.
    fn unicode(&mut self, start: usize) -> Option<Lexeme> {
        let c = self.raw.slice().chars().next()?;
        if c.is_whitespace() {
            return None;
        }
        if !c.is_alphabetic() {
            return Some(self.invalid(start));
        }
        self.extend_word();
        let rest = self.raw.remainder();
        self.raw.bump(rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len()));
        let name = self.raw.slice().into();
        Some(if c.is_uppercase() { Lexeme::Variable(name) } else { Lexeme::Atom(name, false) })
    }

    /// A character that begins nothing, and those like it that follow at once.
    fn invalid(&mut self, start: usize) -> Lexeme {
        let first = self.text[start..].chars().next().unwrap_or_default();
        let rest = self.raw.remainder();
        self.raw.bump(rest.find(|c| c != first).unwrap_or(rest.len()));
        let (text, at) = (show(&first.to_string()), self.span(start, self.raw.span().end));
        let help = match first {
            '\u{2018}'..='\u{201f}' => "use the plain quotes `'` and `\"`",
            _ => "delete it, or put the name that it belongs to in quotes, `'…'`",
        };
        self.report.push(ParseError::Character { text, at, help });
        Lexeme::Invalid
    }
}

/// True if a point before `rest` ends a clause.
fn ends_clause(rest: &str) -> bool {
    rest.chars().next().is_none_or(|c| c.is_whitespace() || c == '%')
}

/// Length of a quoted text up to the quote that ends it, which must be on the same line.
fn quoted_len(text: &str, quote: char) -> Option<usize> {
    let (bytes, quote) = (text.as_bytes(), quote as u8);
    let mut at = 0;
    loop {
        let stops = |byte: &u8| *byte == quote || matches!(byte, b'\\' | b'\n');
        at += bytes.get(at..)?.iter().position(stops)?;
        match bytes[at] {
            b'\n' => return None,
            b'\\' => at += 1 + escape(&text[at + 1..]).1,
            _ if bytes.get(at + 1) == Some(&quote) => at += 2,
            _ => return Some(at),
        }
    }
}

const ESCAPES: &str = "the escapes are `\\n`, `\\t`, `\\r`, `\\a`, `\\b`, `\\f`, `\\v`, `\\e`, `\\s`, `\\\\`, `\\'`, `\\\"`, and `\\x1F600\\`, `\\u00e9`, `\\351\\` for a character's number";
const NUMBERED: &str = "no character has this number; it is written `\\x1F600\\`, `\\u00e9` or `\\351\\`";
const INVISIBLE: &str = "an invisible character is written by its number: `\\x1b\\`";

const QUOTING: Quoting = Quoting { escape: |rest, _| escape(rest), invisible: INVISIBLE };

/// The escape that goes on with `rest`.
fn escape(rest: &str) -> Escaped {
    let Some(c) = rest.chars().next() else { return (Err(ESCAPES), 0) };
    let value = match c {
        'n' => '\n',
        't' => '\t',
        'r' => '\r',
        'a' => '\x07',
        'b' => '\x08',
        'f' => '\x0c',
        'v' => '\x0b',
        'e' => '\x1b',
        's' => ' ',
        '\\' | '\'' | '"' | '`' => c,
        '\n' => return (Ok(None), 1),
        '\r' if rest.starts_with("\r\n") => return (Ok(None), 2),
        'x' => return numbered(&rest[1..], 16, usize::MAX, 1),
        'u' => return numbered(&rest[1..], 16, 4, 1),
        'U' => return numbered(&rest[1..], 16, 8, 1),
        '0'..='7' => return numbered(rest, 8, usize::MAX, 0),
        _ => return (Err(ESCAPES), c.len_utf8()),
    };
    (Ok(Some(value)), c.len_utf8())
}

/// A character's number, and a backslash that ends it; `before` bytes of the escape were read.
fn numbered(rest: &str, radix: u32, most: usize, before: usize) -> Escaped {
    let len = rest.chars().take(most).take_while(|c| c.is_digit(radix)).count();
    let closed = most == usize::MAX && rest[len..].starts_with('\\');
    let value = u32::from_str_radix(&rest[..len], radix).ok().and_then(char::from_u32);
    (value.map(Some).ok_or(NUMBERED), before + len + usize::from(closed))
}

/// The value of the digits `text` with a minus before them or not, else what is wrong.
pub(super) fn number(text: &str, negative: bool) -> Result<Word, (&'static str, &'static str)> {
    let signed = if negative { format!("-{text}") } else { text.into() };
    if let Some(digits) = text.strip_prefix("0o") {
        let signed = if negative { format!("-{digits}") } else { digits.into() };
        let plain = digits.bytes().all(|byte| matches!(byte, b'0'..=b'7'));
        if let (true, Ok(value)) = (plain, i64::from_str_radix(&signed, 8)) {
            return Ok(Word::Int(value));
        }
    }
    match literal::classify(&signed) {
        Word::Bad(fault @ (literal::NumberFault::Malformed | literal::NumberFault::Point)) => Err((
            fault.why(),
            "numbers are `42`, `1_000`, `0xff`, `0o17`, `0b101`, `0'a`, `1.5`, `2.0e3`; a name does not begin with a digit",
        )),
        Word::Bad(fault) => Err((fault.why(), fault.help())),
        word => Ok(word),
    }
}
