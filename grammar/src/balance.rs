//! Makes the brackets match.
//!
//! An LR parser that meets a missing bracket loses the whole tree, and says so at the end of the
//! file. So this adapter stands between lexer and parser: it keeps the open brackets on a stack,
//! says what is wrong with them in the user's words, and puts in or leaves out tokens until all
//! is well formed. The parser sees brackets that match, prefixes that have a form, maps that have
//! as many values as keys, and no more than [`MAX_DEPTH`] forms in one another.
//!
//! Which bracket was forgotten? A definition at the left margin ends what is open before it. Among
//! the open ones, the first that indentation contradicts is blamed: a line that starts at or left
//! of an open bracket's own column does not look as if it stood inside it.

use std::collections::VecDeque;

use crate::error::ParseError;
use crate::form::Prefix;
use crate::parse::MAX_DEPTH;
use crate::span::Span;
use crate::token::{Bracket, Lexer, Spanned, Token};

/// The token stream of a text, well formed.
pub(crate) struct Balance<'t> {
    pub(crate) lexer: Lexer<'t>,
    /// Tokens that are decided but not yet asked for.
    ready: VecDeque<Spanned>,
    ended: bool,
    stack: Vec<Frame>,
    /// How many brackets of each kind are on the stack.
    open_count: [usize; 3],
    /// Prefixes whose form has not begun.
    pending: Vec<(usize, Prefix, usize)>,
    /// Brackets and prefixes around the next form, without `pending`.
    depth: usize,
    /// Brackets that are open inside a form which is too deep; nothing is passed on till they close.
    skipping: usize,
    top: TopLevel,
    lines: Lines,
    /// The last token was a stray bracket: the next one belongs to the same mistake.
    stray_run: bool,
    /// What the end of the text found open, outermost first.
    pub(crate) open_at_end: Vec<(char, Span)>,
    /// A prefix was the last token of the text.
    pub(crate) prefix_at_end: Option<(char, Span)>,
    /// How many errors there were before the end of the text added its own.
    pub(crate) errors_before_end: usize,
}

/// A bracket that is open.
struct Frame {
    kind: Bracket,
    start: usize,
    column: usize,
    /// The bracket and the prefixes before it.
    weight: usize,
    /// Forms in it so far.
    count: usize,
    last_child: (usize, usize),
    /// A mistake inside was reported, so that counting forms makes no sense.
    damaged: bool,
}

/// What is remembered of the top-level form that is being read.
#[derive(Default)]
struct TopLevel {
    /// The first bracket that indentation contradicts.
    suspect: Option<(Bracket, usize)>,
    /// Its nesting was reported.
    too_deep: bool,
}

/// Where lines start.
#[derive(Default)]
struct Lines {
    line_start: usize,
    last_start: usize,
    last_end: usize,
}

impl Lines {
    /// Steps to a token; true if it is the first one on its line.
    fn step(&mut self, text: &str, start: usize, end: usize) -> bool {
        let newline = text.as_bytes()[self.last_start..start].iter().rposition(|byte| *byte == b'\n');
        let first = match newline {
            Some(at) => {
                self.line_start = self.last_start + at + 1;
                self.line_start > self.last_end
            }
            None => self.last_end == 0,
        };
        (self.last_start, self.last_end) = (start, end);
        first
    }
}

impl Iterator for Balance<'_> {
    type Item = Spanned;

    fn next(&mut self) -> Option<Spanned> {
        while self.ready.is_empty() && !self.ended {
            self.step();
        }
        self.ready.pop_front()
    }
}

impl<'t> Balance<'t> {
    pub(crate) fn new(lexer: Lexer<'t>) -> Balance<'t> {
        Balance {
            lexer,
            ready: VecDeque::new(),
            ended: false,
            stack: Vec::new(),
            open_count: [0; 3],
            pending: Vec::new(),
            depth: 0,
            skipping: 0,
            top: TopLevel::default(),
            lines: Lines::default(),
            stray_run: false,
            open_at_end: Vec::new(),
            prefix_at_end: None,
            errors_before_end: 0,
        }
    }

    fn report(&mut self, error: ParseError) {
        self.lexer.report.push(error);
    }

    fn span(&self, start: usize, end: usize) -> Span {
        self.lexer.span(start, end)
    }

    /// Takes one token of the lexer.
    fn step(&mut self) {
        let Some((start, token, end)) = self.lexer.next() else { return self.finish() };
        if self.lines.step(self.lexer.text, start, end) {
            self.line_begins(start, &token);
        }
        let stray_run = std::mem::take(&mut self.stray_run);
        match token {
            Token::Open(_) if self.skipping > 0 => self.skipping += 1,
            Token::Close(_) if self.skipping > 0 => self.skipping -= 1,
            _ if self.skipping > 0 => {}
            Token::Open(kind) => self.open(kind, start, end),
            Token::Close(kind) => self.close(kind, start, end, stray_run),
            Token::Prefix(sign) => self.prefix(sign, start, end),
            Token::Invalid => self.damage(),
            atom => self.form((start, atom, end)),
        }
    }

    fn damage(&mut self) {
        if let Some(frame) = self.stack.last_mut() {
            frame.damaged = true;
        }
    }

    /// A token is the first one on its line: look whether brackets should have been closed before.
    fn line_begins(&mut self, start: usize, token: &Token) {
        let Some(innermost) = self.stack.last() else { return };
        let column = start - self.lines.line_start;
        let opens = matches!(token, Token::Open(Bracket::Paren));
        if column == 0 && opens && starts_definition(&self.lexer.text[start + 1..]) {
            let blamed = self.top.suspect.unwrap_or((innermost.kind, innermost.start));
            let next = self.span(start, start + 1);
            return self.close_all(start, blamed, Some(next));
        }
        let suspicious = column <= innermost.column && !matches!(token, Token::Close(_) | Token::Invalid);
        if suspicious && self.top.suspect.is_none() {
            self.top.suspect = Some((innermost.kind, innermost.start));
        }
    }

    /// Passes on the prefixes that wait, then a token that begins or is a form.
    fn emit(&mut self, token: Spanned) {
        for (start, sign, end) in self.pending.drain(..) {
            self.ready.push_back((start, Token::Prefix(sign), end));
        }
        self.ready.push_back(token);
    }

    /// A form that is one token.
    fn form(&mut self, token: Spanned) {
        let start = self.pending.first().map_or(token.0, |prefix| prefix.0);
        let end = token.2;
        self.emit(token);
        self.form_ended(start, end);
    }

    fn form_ended(&mut self, start: usize, end: usize) {
        match self.stack.last_mut() {
            Some(frame) => {
                frame.count += 1;
                frame.last_child = (start, end);
            }
            None => self.top = TopLevel::default(),
        }
    }

    fn prefix(&mut self, sign: Prefix, start: usize, end: usize) {
        if self.depth + self.pending.len() + 1 > MAX_DEPTH {
            return self.too_deep(start, end);
        }
        self.pending.push((start, sign, end));
    }

    fn too_deep(&mut self, start: usize, end: usize) {
        if !std::mem::replace(&mut self.top.too_deep, true) {
            let at = self.span(start, end);
            self.report(ParseError::TooDeep { limit: MAX_DEPTH, at });
        }
    }

    fn open(&mut self, kind: Bracket, start: usize, end: usize) {
        let weight = self.pending.len() + 1;
        if self.depth + weight > MAX_DEPTH {
            self.too_deep(start, end);
            self.skipping = 1;
            return self.form((start, placeholder(), end));
        }
        self.depth += weight;
        self.open_count[kind as usize] += 1;
        let column = start - self.lines.line_start;
        self.stack.push(Frame {
            kind,
            start,
            column,
            weight,
            count: 0,
            last_child: (start, end),
            damaged: false,
        });
        self.emit((start, Token::Open(kind), end));
    }

    fn close(&mut self, kind: Bracket, start: usize, end: usize, stray_run: bool) {
        self.drop_prefixes();
        let Some(innermost) = self.stack.last() else { return self.stray(kind, start, end, stray_run) };
        if innermost.kind != kind {
            let (open, opened) = (innermost.kind.open(), self.span(innermost.start, innermost.start + 1));
            let at = self.span(start, end);
            self.report(ParseError::Mismatched { open, close: kind.close(), at, opened });
            // If such a bracket is open further out, those inside it lack their ends; if not, this
            // one is taken for a slip of the finger.
            while self.open_count[kind as usize] > 0
                && self.stack.last().is_some_and(|frame| frame.kind != kind)
            {
                self.damage();
                self.pop(start, start);
            }
            self.damage();
        }
        self.pop(start, end);
    }

    fn stray(&mut self, kind: Bracket, start: usize, end: usize, stray_run: bool) {
        self.stray_run = true;
        match self.lexer.report.errors.last_mut() {
            Some(ParseError::StrayClose { at, .. }) if stray_run => {
                at.end = Span::new(at.file, start, end).end
            }
            _ if stray_run => {}
            _ => {
                let at = self.span(start, end);
                self.report(ParseError::StrayClose { close: kind.close(), at });
            }
        }
    }

    /// Reports prefixes that no form followed.
    fn drop_prefixes(&mut self) {
        if let Some((start, sign, end)) = self.pending.pop() {
            if !self.top.too_deep {
                let at = self.span(start, end);
                self.report(ParseError::Prefix { sign: sign.sign(), at });
            }
            self.pending.clear();
            self.damage();
        }
    }

    /// Closes the innermost bracket by a token at `start..end`, which is empty if there is none.
    fn pop(&mut self, start: usize, end: usize) {
        let Some(frame) = self.stack.pop() else { return };
        self.depth -= frame.weight;
        self.open_count[frame.kind as usize] -= 1;
        if frame.kind == Bracket::Curly && frame.count % 2 == 1 {
            if !frame.damaged {
                let at = self.span(frame.last_child.0, frame.last_child.1);
                let map = self.span(frame.start, frame.start + 1);
                self.report(ParseError::OddMap { at, map });
            }
            self.ready.push_back((start, placeholder(), start));
        }
        self.ready.push_back((start, Token::Close(frame.kind), end));
        self.form_ended(frame.start, end);
    }

    /// Closes all brackets before byte `at`, because there the text ends or `next` starts.
    fn close_all(&mut self, at: usize, blamed: (Bracket, usize), next: Option<Span>) {
        self.pending.clear();
        self.skipping = 0;
        // A form that is too deep was reported, and a string without end swallowed all that follows.
        if !self.top.too_deep && self.lexer.cut.is_none() {
            let missing = self.stack.iter().rev().map(|frame| frame.kind.close()).collect();
            let span = self.span(blamed.1, blamed.1 + 1);
            self.report(ParseError::Unclosed { open: blamed.0.open(), missing, at: span, next });
        }
        while !self.stack.is_empty() {
            self.damage();
            self.pop(at, at);
        }
    }

    fn finish(&mut self) {
        self.ended = true;
        self.errors_before_end = self.lexer.report.errors.len() + self.lexer.report.more;
        self.open_at_end = self
            .stack
            .iter()
            .map(|frame| (frame.kind.open(), self.span(frame.start, frame.start + 1)))
            .collect();
        if let Some((start, sign, end)) = self.pending.last() {
            self.prefix_at_end = sign.sign().chars().next().map(|c| (c, self.span(*start, *end)));
        }
        match self.stack.last() {
            None => self.drop_prefixes(),
            Some(innermost) => {
                let blamed = self.top.suspect.unwrap_or((innermost.kind, innermost.start));
                // The end of what was written, not of the blanks after it.
                self.close_all(self.lines.last_end, blamed, None);
            }
        }
    }
}

/// Stands in for a form that was left out.
fn placeholder() -> Token {
    Token::Symbol("nil".into())
}

/// True if `text`, which follows an open bracket at the left margin, names a definition.
///
/// Not every name that starts with `def` does: `(defer …)` and `(default …)` are calls.
fn starts_definition(text: &str) -> bool {
    let name = text.split(|c: char| !crate::literal::is_symbol_char(c)).next().unwrap_or_default();
    name.starts_with("def-")
        || matches!(name, "defun" | "defmacro" | "defvar" | "defparameter" | "module" | "use")
}
