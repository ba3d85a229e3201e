//! Clause by clause: which names are operators, and where brackets or depth go wrong.
//!
//! An LR parser cannot tell whether `-` is an infix operator, a sign or just a name, and Prolog
//! allows all three. So this adapter stands between lexer and parser and looks at the neighbours:
//! behind a term only an infix operator can stand; elsewhere a name is an operator if an operand
//! follows it, else a name.
//!
//! The first mistake ends its clause for the parser; [`Reader::go_on`] goes to the next one. Depth is
//! limited here, so that terms can be dropped and translated by recursion: each operator and each
//! bracket counts, which is more than the true depth and never less.

use std::collections::VecDeque;

use super::error::PrologError;
use super::term::Name;
use super::token::{Lexeme, Lexer, Spanned, number};
use crate::error::ParseError;
use crate::form::Symbol;
use crate::literal::Word;
use crate::span::Span;
use crate::token::{Bracket, show};

/// The greatest number of operators and brackets around a term.
///
/// Each becomes at most two forms in one another, and forms have their own limit
/// [`MAX_DEPTH`](crate::parse::MAX_DEPTH), which must hold for what is made of a clause.
pub(crate) const MAX_DEPTH: usize = 400;

/// What the rules of `prolog.lalrpop` are made of.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Token {
    Open(Bracket),
    Close(Bracket),
    Comma(Name),
    Bar,
    Variable(Symbol),
    Atom(Name),
    /// A name with its arguments behind it.
    Functor(Name),
    Int(i64),
    Float(f64),
    Str(Box<str>),
    Prefix(Level, Name),
    Infix(Level, Name),
}

/// The priorities of operators.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Level {
    /// 1200 `:- --> ?-`
    Rule,
    /// 1150 `dynamic table …`
    Directive,
    /// 1100 `;`
    Or,
    /// 1050 `-> *->`
    Then,
    /// 900 `\+`
    Not,
    /// 700 `= is < …`
    Compare,
    /// 600 `:`
    Module,
    /// 500 `+ - …`
    Sum,
    /// 400 `* / …`
    Product,
    /// 200 `**`
    Power,
    /// 200 `^`
    Hat,
    /// 200 `- + \` before a term
    Sign,
}

fn infix(name: &str) -> Option<Level> {
    Some(match name {
        ":-" | "-->" => Level::Rule,
        ";" => Level::Or,
        "->" | "*->" => Level::Then,
        "=" | "\\=" | "==" | "\\==" | "is" | "=:=" | "=\\=" | "<" | ">" | "=<" | ">=" => Level::Compare,
        "@<" | "@>" | "@=<" | "@>=" | "=.." => Level::Compare,
        ":" => Level::Module,
        "+" | "-" | "/\\" | "\\/" | "xor" => Level::Sum,
        "*" | "/" | "//" | "mod" | "rem" | "div" | "rdiv" | "<<" | ">>" => Level::Product,
        "**" => Level::Power,
        "^" => Level::Hat,
        _ => return None,
    })
}

/// In Prolog `table` is an operator everywhere; here only `after_rule`, right behind the `:-` of a
/// directive, so that a kitchen may have a `table-1`.
fn prefix(name: &str, after_rule: bool) -> Option<Level> {
    Some(match name {
        ":-" | "?-" => Level::Rule,
        "\\+" => Level::Not,
        "-" | "+" | "\\" => Level::Sign,
        "dynamic" | "discontiguous" | "initialization" | "multifile" | "table" if after_rule => {
            Level::Directive
        }
        _ => return None,
    })
}

/// The tokens of a text, one clause at a time: after the last of a clause comes `None`.
pub(super) struct Reader<'t> {
    pub(super) lexer: Lexer<'t>,
    /// Lexemes that were looked at in advance.
    ahead: VecDeque<Spanned>,
    /// The clause itself, then each bracket that is open.
    frames: Vec<Frame>,
    /// Operators and brackets that wait for their end: a limit on the stack of the parser.
    waiting: usize,
    /// The next token should begin a term.
    operand: bool,
    /// What `operand` was before the last token.
    operand_before: bool,
    /// The last token was the `:-` of a directive.
    after_rule: bool,
    /// The last token was a functor: its arguments follow.
    after_functor: bool,
    first_of_clause: bool,
    /// The point of the clause was read.
    at_end: bool,
    /// Where the last token stands; it may be the point.
    last: (usize, usize),
    /// A mistake in this clause was reported.
    pub(super) damaged: bool,
}

/// An open bracket, and how deep terms are in it.
#[derive(Default)]
struct Frame {
    bracket: Option<(Bracket, usize)>,
    /// Commas part arguments or elements, which stand beside one another.
    arguments: bool,
    /// The depth of the arguments before this one.
    before: usize,
    /// `->`, `*->` and `:-` in this argument: what follows such an arrow stands inside it.
    arrows: usize,
    /// The depth of what stands between the arrows, commas and `;` of this argument, but the last part.
    parts: usize,
    /// The other operators in the last part, of which each may stand inside the one before.
    operators: usize,
    /// The depth of the deepest bracket in the last part.
    inside: usize,
}

impl Frame {
    fn depth(&self) -> usize {
        self.before.max(self.arrows + self.parts.max(self.operators + self.inside))
    }
}

/// A token and its bytes `start..end`.
type Placed = (usize, Token, usize);

impl Iterator for Reader<'_> {
    type Item = Placed;

    fn next(&mut self) -> Option<Placed> {
        if self.at_end || self.damaged {
            return None;
        }
        let Some((start, lexeme, mut end)) = self.take() else {
            self.text_ended();
            return None;
        };
        self.operand_before = self.operand;
        let after_rule = std::mem::take(&mut self.after_rule);
        let after_functor = std::mem::take(&mut self.after_functor);
        let token = match lexeme {
            Lexeme::End => {
                self.clause_ended();
                return None;
            }
            Lexeme::Invalid => {
                self.damaged = true;
                return None;
            }
            Lexeme::Open(kind) => self.open(kind, start, after_functor),
            Lexeme::Close(kind) => self.close(kind, start, end)?,
            Lexeme::Comma => {
                self.argument_ended();
                Token::Comma(Name { text: ",".into(), quoted: false, span: self.span(start, end) })
            }
            Lexeme::Bar => {
                self.argument_ended();
                Token::Bar
            }
            Lexeme::Atom(text, quoted) => {
                let name = Name { text, quoted, span: self.span(start, end) };
                match self.number_after_minus(&name, end) {
                    Some((digits, lexeme, digits_end)) => {
                        end = digits_end;
                        self.number(&lexeme, digits, end, true)
                    }
                    None => self.name(name, end, after_rule),
                }
            }
            Lexeme::Variable(name) => self.term(Token::Variable(name)),
            Lexeme::Number | Lexeme::Code(_) => self.number(&lexeme, start, end, false),
            Lexeme::Str(text) => self.term(Token::Str(text)),
        };
        self.first_of_clause = false;
        self.check_depth(start, end)?;
        Some((start, token, end))
    }
}

impl<'t> Reader<'t> {
    pub(super) fn new(lexer: Lexer<'t>) -> Reader<'t> {
        Reader {
            lexer,
            ahead: VecDeque::new(),
            frames: Vec::new(),
            waiting: 0,
            operand: true,
            operand_before: true,
            after_rule: false,
            after_functor: false,
            first_of_clause: true,
            at_end: true,
            last: (0, 0),
            damaged: false,
        }
    }

    /// Goes to the next clause; false if there is none.
    pub(super) fn begin(&mut self) -> bool {
        self.frames.clear();
        self.frames.push(Frame::default());
        self.waiting = 0;
        (self.operand, self.first_of_clause) = (true, true);
        (self.after_rule, self.after_functor) = (false, false);
        (self.at_end, self.damaged) = (false, false);
        self.peek(0).is_some()
    }

    /// Goes behind the point of this clause, if the parser did not come so far.
    pub(super) fn go_on(&mut self) {
        while !self.at_end {
            self.at_end = matches!(self.take(), Some((_, Lexeme::End, _)) | None);
        }
    }

    /// Says that the token at `start..end` does not fit, which the parser has found.
    pub(super) fn unexpected(&mut self, start: usize, token: &Token, end: usize) {
        if self.damaged {
            return;
        }
        let rule = matches!(token, Token::Infix(Level::Rule, _));
        if let Some(Frame { bracket: Some((kind, at)), .. }) = self.frames.last()
            && rule
        {
            let (kind, at) = (*kind, *at);
            return self.unclosed(kind, at);
        }
        let text = &self.lexer.text;
        let (before, text) = (&text[..start], show(&text[start..end]));
        let starts_line = before.is_empty() || before.ends_with('\n');
        let help = match token {
            _ if !self.operand_before && starts_line => "does the clause before it end with `.`?",
            Token::Infix(..) | Token::Close(_) | Token::Comma(_) | Token::Bar if self.operand_before => {
                "something is missing before it"
            }
            Token::Infix(..) => "it does not go with what is around it: brackets help, as in `(a = b) = c`",
            Token::Close(_) | Token::Comma(_) => {
                "behind the `|` of a list stands one term, the rest of the list"
            }
            Token::Bar => {
                "it stands once in a list, before its rest; other ways to an answer are parted by `;`"
            }
            _ if self.operand_before => "put it in brackets: it does not go with the operator before it",
            _ => "an operator, a comma or the end of the clause `.` is missing before it",
        };
        self.report(PrologError::Unexpected { text, at: self.span(start, end), help });
    }

    /// Says that the clause ends where something should follow.
    pub(super) fn unfinished(&mut self) {
        if !self.damaged {
            let at = self.span(self.last.0, self.last.1);
            self.report(PrologError::Unexpected {
                text: ".".into(),
                at,
                help: "something is missing before it",
            });
        }
    }

    fn report(&mut self, error: impl Into<ParseError>) {
        self.damaged = true;
        self.lexer.report.push(error.into());
    }

    fn span(&self, start: usize, end: usize) -> Span {
        self.lexer.span(start, end)
    }

    fn take(&mut self) -> Option<Spanned> {
        let taken = self.ahead.pop_front().or_else(|| self.lexer.next())?;
        self.last = (taken.0, taken.2);
        Some(taken)
    }

    fn peek(&mut self, index: usize) -> Option<&Spanned> {
        while self.ahead.len() <= index {
            let lexeme = self.lexer.next()?;
            self.ahead.push_back(lexeme);
        }
        self.ahead.get(index)
    }

    /// True if a term may begin with what comes next.
    fn operand_follows(&mut self) -> bool {
        let Some((_, lexeme, end)) = self.peek(0) else { return false };
        let end = *end;
        match lexeme {
            Lexeme::Atom(name, false)
                if infix(name).is_some() && prefix(name, false) != Some(Level::Sign) =>
            {
                self.peek(1).is_some_and(|next| is_open_at(next, end))
            }
            Lexeme::Close(_) | Lexeme::Comma | Lexeme::Bar | Lexeme::End => false,
            _ => true,
        }
    }

    /// Takes the number that a minus belongs to: one right behind it, where a term should begin.
    fn number_after_minus(&mut self, name: &Name, end: usize) -> Option<Spanned> {
        if !self.operand || name.quoted || name.text != "-" {
            return None;
        }
        let (start, lexeme, _) = self.peek(0)?;
        let is_number = *start == end && matches!(lexeme, Lexeme::Number | Lexeme::Code(_));
        if is_number { self.take() } else { None }
    }

    fn number(&mut self, lexeme: &Lexeme, start: usize, end: usize, negative: bool) -> Token {
        if let Lexeme::Code(value) = lexeme {
            return self.term(Token::Int(if negative { -value } else { *value }));
        }
        let text = &self.lexer.text[start..end];
        match number(text, negative) {
            Ok(Word::Float(value)) => self.term(Token::Float(value)),
            Ok(Word::Int(value)) => self.term(Token::Int(value)),
            Ok(_) => self.term(Token::Int(0)),
            Err((why, help)) => {
                let error = ParseError::Number { text: show(text), why, at: self.span(start, end), help };
                self.lexer.report.push(error);
                self.term(Token::Int(0))
            }
        }
    }

    /// What the name that ends at byte `end` is here.
    fn name(&mut self, name: Name, end: usize, after_rule: bool) -> Token {
        let infix = infix(&name.text).filter(|_| !name.quoted);
        let prefix = prefix(&name.text, after_rule).filter(|_| !name.quoted);
        if let (Some(level), false) = (infix, self.operand) {
            return self.operator(level, Token::Infix(level, name));
        }
        if self.peek(0).is_some_and(|next| is_open_at(next, end)) {
            self.after_functor = true;
            return Token::Functor(name);
        }
        match (prefix, infix) {
            (Some(level), _) if self.operand_follows() => {
                self.after_rule = level == Level::Rule && self.first_of_clause;
                self.operator(level, Token::Prefix(level, name))
            }
            // The parser will say that something is missing before it.
            (None, Some(level)) if self.operand_follows() => self.operator(level, Token::Infix(level, name)),
            _ => self.term(Token::Atom(name)),
        }
    }

    /// Behind a term stands an operator, a comma or the end.
    fn term(&mut self, token: Token) -> Token {
        self.operand = false;
        token
    }

    fn operator(&mut self, level: Level, token: Token) -> Token {
        self.operand = true;
        match level {
            Level::Or => self.part_ended(),
            Level::Then | Level::Rule => {
                self.part_ended();
                self.waiting += 1;
                self.frame().arrows += 1;
            }
            _ => {
                self.waiting += 1;
                self.frame().operators += 1;
            }
        }
        token
    }

    fn frame(&mut self) -> &mut Frame {
        self.frames.last_mut().expect("the clause itself is never closed")
    }

    /// What follows stands beside what was read since the last arrow, not around or inside it.
    fn part_ended(&mut self) {
        let frame = self.frame();
        frame.parts = frame.parts.max(frame.operators + frame.inside);
        frame.inside = 0;
        let operators = std::mem::take(&mut frame.operators);
        self.waiting -= operators;
    }

    /// A comma: where it parts no arguments, it binds more than arrows do.
    fn argument_ended(&mut self) {
        self.operand = true;
        self.part_ended();
        let frame = self.frame();
        if frame.arguments {
            frame.before = frame.depth();
            frame.parts = 0;
            let arrows = std::mem::take(&mut frame.arrows);
            self.waiting -= arrows;
        }
    }

    fn open(&mut self, kind: Bracket, start: usize, after_functor: bool) -> Token {
        self.operand = true;
        self.waiting += 1;
        let arguments = after_functor || kind == Bracket::Square;
        self.frames.push(Frame { bracket: Some((kind, start)), arguments, ..Frame::default() });
        Token::Open(kind)
    }

    fn close(&mut self, kind: Bracket, start: usize, end: usize) -> Option<Token> {
        let (at, close) = (self.span(start, end), kind.close());
        let Some((opened, open_at)) = self.frame().bracket else {
            self.report(ParseError::StrayClose { close, at });
            return None;
        };
        if opened != kind {
            let (open, opened) = (opened.open(), self.span(open_at, open_at + 1));
            self.report(ParseError::Mismatched { open, close, at, opened });
            return None;
        }
        let frame = self.frames.pop()?;
        self.waiting -= 1 + frame.operators + frame.arrows;
        let around = self.frame();
        around.inside = around.inside.max(frame.depth() + 1);
        Some(self.term(Token::Close(kind)))
    }

    fn check_depth(&mut self, start: usize, end: usize) -> Option<()> {
        if self.waiting.max(self.frame().depth()) <= MAX_DEPTH {
            return Some(());
        }
        let at = self.span(start, end);
        self.report(ParseError::TooDeep { limit: MAX_DEPTH, at });
        None
    }

    fn unclosed(&mut self, kind: Bracket, at: usize) {
        let what = match kind {
            Bracket::Paren => "`(`",
            Bracket::Square => "`[`",
            Bracket::Curly => "`{`",
        };
        let help = format!("the missing end is `{}`", kind.close());
        self.report(PrologError::Unclosed { what, at: self.span(at, at + 1), help });
    }

    fn clause_ended(&mut self) {
        self.at_end = true;
        if let Some((kind, at)) = self.frame().bracket {
            self.unclosed(kind, at);
        }
    }

    fn text_ended(&mut self) {
        self.at_end = true;
        match self.frame().bracket {
            Some((kind, at)) => self.unclosed(kind, at),
            None => {
                let at = self.span(self.last.0, self.last.1);
                self.report(PrologError::NoEnd { at });
            }
        }
    }
}

/// True if `next` is a `(` at byte `at`: what stands right before it is a functor.
fn is_open_at(next: &Spanned, at: usize) -> bool {
    next.0 == at && next.1 == Lexeme::Open(Bracket::Paren)
}
