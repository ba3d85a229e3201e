//! Text to tokens.
//!
//! logos finds where a token begins and what kind it is; strings, bars and block comments are
//! then scanned by hand, because they nest or must be found unclosed. A mistake becomes an error
//! in the [`Report`] and a token that stands in for what was meant, so that nothing after it
//! suffers.

use logos::Logos;

use crate::error::ParseError;
use crate::form::{Prefix, Symbol};
use crate::literal::{self, QuotedFault, Word};
use crate::parse::{Comment, MAX_ERRORS};
use crate::span::{FileId, Span};

/// The kinds of brackets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bracket {
    Paren,
    Square,
    Curly,
}

impl Bracket {
    pub(crate) fn open(self) -> char {
        match self {
            Bracket::Paren => '(',
            Bracket::Square => '[',
            Bracket::Curly => '{',
        }
    }

    pub(crate) fn close(self) -> char {
        match self {
            Bracket::Paren => ')',
            Bracket::Square => ']',
            Bracket::Curly => '}',
        }
    }
}

/// What the grammar is made of.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Token {
    Open(Bracket),
    Close(Bracket),
    Prefix(Prefix),
    Symbol(Symbol),
    Keyword(Symbol),
    Int(i64),
    Float(f64),
    Str(Box<str>),
    /// Something that was reported and stands for no form.
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
    #[token("'")]
    Quote,
    #[token("`")]
    Quasi,
    #[token(",")]
    Unquote,
    #[token(",@")]
    Splice,
    #[token(";")]
    LineComment,
    #[token("#|")]
    BlockComment,
    #[token("\"")]
    String,
    #[token("|")]
    BarSymbol,
    #[token(":|")]
    BarKeyword,
    #[regex(r"[A-Za-z0-9/?!*<>=+_%&.~^$-][A-Za-z0-9/?!*<>=+_%&.:@~^|$-]*")]
    Word,
    #[regex(r":([A-Za-z0-9/?!*<>=+_%&.:@~^$-][A-Za-z0-9/?!*<>=+_%&.:@~^|$-]*)?")]
    Keyword,
    #[regex(r"[^\x00-\x7F]")]
    Unicode,
}

/// The mistakes found so far; only the first [`MAX_ERRORS`] are kept, the rest is counted.
#[derive(Debug, Default)]
pub(crate) struct Report {
    pub(crate) errors: Vec<ParseError>,
    pub(crate) more: usize,
}

impl Report {
    pub(crate) fn push(&mut self, error: ParseError) {
        if self.errors.len() < MAX_ERRORS {
            self.errors.push(error);
        } else {
            self.more += 1;
        }
    }

    /// The errors in the order of the text, then how many more there are.
    pub(crate) fn in_order(mut self) -> Vec<ParseError> {
        self.errors.sort_by_key(|error| error.span().start);
        if let (1.., Some(last)) = (self.more, self.errors.last()) {
            let at = last.span();
            self.errors.push(ParseError::TooMany { more: self.more, at });
        }
        self.errors
    }
}

/// A token and its bytes `start..end`.
pub(crate) type Spanned = (usize, Token, usize);

/// Cuts a text into tokens; comments and mistakes are put aside.
pub(crate) struct Lexer<'t> {
    raw: logos::Lexer<'t, Raw>,
    file: FileId,
    pub(crate) text: &'t str,
    pub(crate) comments: Vec<Comment>,
    pub(crate) report: Report,
    /// What runs to the end of the text unclosed: its first character and its place.
    pub(crate) cut: Option<(char, Span)>,
    /// The first string that contains a line which looks like the start of a definition.
    suspect: Option<Span>,
    faults: Vec<QuotedFault>,
}

impl<'t> Lexer<'t> {
    pub(crate) fn new(file: FileId, text: &'t str) -> Lexer<'t> {
        let mut lexer = Lexer {
            raw: Raw::lexer(text),
            file,
            text,
            comments: Vec::new(),
            report: Report::default(),
            cut: None,
            suspect: None,
            faults: Vec::new(),
        };
        lexer.skip_preamble();
        lexer
    }

    pub(crate) fn span(&self, start: usize, end: usize) -> Span {
        Span::new(self.file, start, end)
    }

    /// The next token.
    pub(crate) fn next(&mut self) -> Option<Spanned> {
        loop {
            let raw = self.raw.next()?;
            let start = self.raw.span().start;
            if let Some(token) = self.token(raw, start) {
                return Some((start, token, self.raw.span().end));
            }
        }
    }

    fn skip_preamble(&mut self) {
        let (end, is_comment) = preamble(self.text);
        self.raw.bump(end);
        if is_comment {
            self.comments.push(Comment { span: self.span(0, end), block: false });
        }
    }

    fn token(&mut self, raw: Result<Raw, ()>, start: usize) -> Option<Token> {
        Some(match raw {
            Ok(Raw::ParenOpen) => Token::Open(Bracket::Paren),
            Ok(Raw::ParenClose) => Token::Close(Bracket::Paren),
            Ok(Raw::SquareOpen) => Token::Open(Bracket::Square),
            Ok(Raw::SquareClose) => Token::Close(Bracket::Square),
            Ok(Raw::CurlyOpen) => Token::Open(Bracket::Curly),
            Ok(Raw::CurlyClose) => Token::Close(Bracket::Curly),
            Ok(Raw::Quote) => Token::Prefix(Prefix::Quote),
            Ok(Raw::Quasi) => Token::Prefix(Prefix::Quasi),
            Ok(Raw::Unquote) => Token::Prefix(Prefix::Unquote),
            Ok(Raw::Splice) => Token::Prefix(Prefix::Splice),
            Ok(Raw::LineComment) => return self.line_comment(start),
            Ok(Raw::BlockComment) => return self.block_comment(start),
            Ok(Raw::String) => self.string(start),
            Ok(Raw::BarSymbol) => Token::Symbol(self.bars(start).as_ref().into()),
            Ok(Raw::BarKeyword) => Token::Keyword(self.bars(start).as_ref().into()),
            Ok(Raw::Word) => self.word(start),
            Ok(Raw::Keyword) => self.keyword(start),
            Ok(Raw::Unicode) => return self.unicode(start),
            Err(()) => self.invalid(start),
        })
    }

    fn line_comment(&mut self, start: usize) -> Option<Token> {
        self.raw.bump(line_end(self.raw.remainder()));
        let span = self.span(start, self.raw.span().end);
        self.comments.push(Comment { span, block: false });
        None
    }

    fn block_comment(&mut self, start: usize) -> Option<Token> {
        let rest = self.raw.remainder();
        let end = block_comment_end(rest.as_bytes());
        self.raw.bump(end.unwrap_or(rest.len()));
        if end.is_none() {
            let at = self.span(start, start + 2);
            self.cut = Some(('#', at));
            self.report.push(ParseError::UnclosedComment { at });
        }
        let span = self.span(start, self.raw.span().end);
        self.comments.push(Comment { span, block: true });
        None
    }

    fn string(&mut self, start: usize) -> Token {
        let rest = self.raw.remainder();
        let Some(len) = quoted_len(rest.as_bytes(), b'"') else {
            self.raw.bump(rest.len());
            let at = self.span(start, start + 1);
            self.cut = Some(('"', at));
            self.report.push(ParseError::UnclosedString { at, suspect: self.suspect });
            return Token::Str("".into());
        };
        self.raw.bump(len + 1);
        if self.suspect.is_none() && rest[..len].contains("\n(def-") {
            self.suspect = Some(self.span(start, start + 1));
        }
        Token::Str(self.unquote(&rest[..len], '"', start + 1))
    }

    /// The rest of `|…|`, the first bar being read.
    fn bars(&mut self, start: usize) -> Box<str> {
        let rest = self.raw.remainder();
        let line = &rest[..line_end(rest)];
        let inner = self.raw.span().end;
        if let Some(len) = quoted_len(line.as_bytes(), b'|') {
            self.raw.bump(len + 1);
            return self.unquote(&line[..len], '|', inner);
        }
        // Go on as if there were no bar, so that brackets on this line still count.
        self.skip_symbol_chars();
        let at = self.span(start, self.raw.span().end);
        self.report.push(ParseError::UnclosedSymbol { at });
        self.text[inner..self.raw.span().end].into()
    }

    /// `raw` starts at byte `at` of the text.
    fn unquote(&mut self, raw: &str, quote: char, at: usize) -> Box<str> {
        let value = literal::unquote(raw, quote, &literal::PLAIN, &mut self.faults);
        for fault in std::mem::take(&mut self.faults) {
            self.report.push(fault.error(raw, self.file, at));
        }
        value
    }

    /// A word goes on over letters that are not ASCII, which the table of logos leaves out to stay small.
    fn extend_word(&mut self) {
        if self.raw.remainder().as_bytes().first().is_some_and(|byte| *byte >= 0x80) {
            self.skip_symbol_chars();
        }
    }

    fn skip_symbol_chars(&mut self) {
        let rest = self.raw.remainder();
        self.raw.bump(rest.find(|c| !literal::is_symbol_char(c)).unwrap_or(rest.len()));
    }

    fn word(&mut self, start: usize) -> Token {
        self.extend_word();
        let word = self.raw.slice();
        match literal::classify(word) {
            Word::Symbol => Token::Symbol(word.into()),
            Word::Int(value) => Token::Int(value),
            Word::Float(value) => Token::Float(value),
            Word::Bad(fault) => {
                let at = self.span(start, self.raw.span().end);
                let (why, help) = (fault.why(), fault.help());
                self.report.push(ParseError::Number { text: show(word), why, at, help });
                Token::Int(0)
            }
        }
    }

    fn keyword(&mut self, start: usize) -> Token {
        self.extend_word();
        match &self.raw.slice()[1..] {
            "" => self.invalid(start),
            name => Token::Keyword(name.into()),
        }
    }

    /// A character that is not ASCII, at the start of a token.
    fn unicode(&mut self, start: usize) -> Option<Token> {
        let c = self.raw.slice().chars().next()?;
        if c.is_whitespace() {
            return None;
        }
        if !literal::is_symbol_char(c) {
            return Some(self.invalid(start));
        }
        self.skip_symbol_chars();
        Some(self.word(start))
    }

    /// A character that begins nothing, and those that follow it.
    fn invalid(&mut self, start: usize) -> Token {
        // A name that starts with `@` is one mistake, not one and a symbol.
        let first = self.text[start..].chars().next().unwrap_or_default();
        let rest = self.raw.remainder();
        let goes_on = |c: char| match first {
            '@' => literal::is_symbol_char(c),
            _ => c == first || !(c.is_ascii_graphic() || c.is_whitespace() || literal::is_symbol_char(c)),
        };
        self.raw.bump(rest.find(|c| !goes_on(c)).unwrap_or(rest.len()));
        let (slice, end) = (self.raw.slice(), self.raw.span().end);
        let text = if first == '@' { show(slice) } else { show(&slice[..first.len_utf8()]) };
        let help = character_help(first, self.raw.remainder());
        self.report.push(ParseError::Character { text, at: self.span(start, end), help });
        Token::Invalid
    }
}

impl QuotedFault {
    /// The mistake for it: `raw` is the quoted text, which starts at byte `at` of the file.
    pub(crate) fn error(&self, raw: &str, file: FileId, at: usize) -> ParseError {
        let (text, help) = (show(&raw[self.start..self.end]), self.help);
        let at = Span::new(file, at + self.start, at + self.end);
        match self.escape {
            true => ParseError::Escape { text, at, help },
            false => ParseError::Character { text, at, help },
        }
    }
}

/// The length of what stands before the first token: a mark of byte order, or a first line for the shell,
/// which is a comment.
pub(crate) fn preamble(text: &str) -> (usize, bool) {
    if text.starts_with('\u{feff}') {
        return ('\u{feff}'.len_utf8(), false);
    }
    let is_comment = text.starts_with("#!");
    (if is_comment { line_end(text) } else { 0 }, is_comment)
}

/// Offset of the end of the first line.
pub(crate) fn line_end(text: &str) -> usize {
    text.find('\n').unwrap_or(text.len())
}

/// Length of a quoted text up to the quote that ends it.
fn quoted_len(bytes: &[u8], quote: u8) -> Option<usize> {
    let mut at = 0;
    loop {
        at += bytes.get(at..)?.iter().position(|byte| *byte == quote || *byte == b'\\')?;
        if bytes[at] == quote {
            return Some(at);
        }
        at += 2;
    }
}

/// Length of a block comment after its `#|`, with its `|#`.
fn block_comment_end(bytes: &[u8]) -> Option<usize> {
    let (mut at, mut depth) = (0, 1_usize);
    while depth > 0 {
        at += bytes.get(at..)?.iter().position(|byte| matches!(byte, b'#' | b'|'))?;
        match bytes.get(at..at + 2)? {
            b"#|" => (depth, at) = (depth + 1, at + 2),
            b"|#" => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
    }
    Some(at)
}

/// `text` so that all of it can be seen, and not too much of it.
pub(crate) fn show(text: &str) -> String {
    const LONGEST: usize = 40;
    let mut out = String::new();
    for (count, c) in text.chars().enumerate() {
        if count == LONGEST {
            out.push('…');
            break;
        }
        if c.is_ascii_graphic() || literal::is_symbol_char(c) || is_curly_quote(c) {
            out.push(c);
        } else {
            out.extend(c.escape_unicode());
        }
    }
    out
}

fn is_curly_quote(c: char) -> bool {
    matches!(c, '\u{2018}'..='\u{201f}' | '\u{ab}' | '\u{bb}')
}

/// What to do about the character `c`, which is followed by `rest`.
fn character_help(c: char, rest: &str) -> &'static str {
    match c {
        '#' if rest.starts_with('\'') => "functions and values share their names: write `f` for `#'f`",
        '#' => {
            "a comment starts with `;` or `#|`; truth is `true` and `false`; a name with `#` stands in bars, `|a#b|`"
        }
        '@' => "only `,@` splices; a name that starts with `@` stands in bars, `|@a|`",
        ':' => "a keyword is a colon and a name, `:name`",
        '\\' => "a backslash stands in strings and between bars only",
        c if is_curly_quote(c) => "use the plain quote `\"`",
        _ => "delete it; in a string it is written by its number, such as `\\u{1b}`",
    }
}
