//! Terms: what Prolog text is made of before anything is known of its meaning.

use crate::form::Symbol;
use crate::span::Span;

/// A term and its place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Term {
    pub(crate) kind: TermKind,
    pub(crate) span: Span,
}

/// What a term is.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum TermKind {
    /// `First_task`, `_`
    Variable(Symbol),
    /// `milk`, `'sink area'`, `+` where it is no operator
    Atom(Name),
    Int(i64),
    Float(f64),
    Str(Box<str>),
    /// `f(a, b)`, `a + b`, `- a`. A chain `a, b, c` or `a ; b ; c` has all its parts here.
    Compound(Name, Vec<Term>),
    /// `[a, b]`, `[a, b|T]`
    List(Vec<Term>, Option<Box<Term>>),
    /// `{…}`, whatever is in it: none are taken.
    Curly,
}

/// A name as the text has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Name {
    pub(crate) text: Symbol,
    /// Written between `'`.
    pub(crate) quoted: bool,
    pub(crate) span: Span,
}

impl Term {
    pub(crate) fn infix(left: Term, op: Name, right: Term) -> Term {
        let span = left.span.to(right.span);
        Term { kind: TermKind::Compound(op, vec![left, right]), span }
    }

    pub(crate) fn prefix(op: Name, right: Term) -> Term {
        let span = op.span.to(right.span);
        Term { kind: TermKind::Compound(op, vec![right]), span }
    }

    /// `first`, then operators with what stands behind them.
    pub(crate) fn chain(first: Term, rest: Vec<(Name, Term)>) -> Term {
        let Some((op, last)) = rest.last() else { return first };
        let (op, span) = (*op, first.span.to(last.span));
        let parts = std::iter::once(first).chain(rest.into_iter().map(|(_, term)| term)).collect();
        Term { kind: TermKind::Compound(op, parts), span }
    }

    /// Name and arguments, if this term is a name or compound.
    pub(crate) fn call(&self) -> Option<(Name, &[Term])> {
        match &self.kind {
            TermKind::Atom(name) => Some((*name, &[])),
            TermKind::Compound(name, arguments) => Some((*name, arguments)),
            _ => None,
        }
    }

    /// The arguments, if this term is `name(…)` with `count` of them.
    pub(crate) fn arguments(&self, name: &str, count: usize) -> Option<&[Term]> {
        let (found, arguments) = self.call()?;
        (found.text == name && arguments.len() == count).then_some(arguments)
    }

    /// The parts of a chain of `op`, brackets inside it taken away; if it is none, the term itself.
    pub(crate) fn parts<'t>(&'t self, op: &str) -> Vec<&'t Term> {
        let mut parts = Vec::new();
        let mut waiting = vec![self];
        while let Some(term) = waiting.pop() {
            match &term.kind {
                TermKind::Compound(name, terms) if name.text == op && terms.len() > 1 => {
                    waiting.extend(terms.iter().rev());
                }
                _ => parts.push(term),
            }
        }
        parts
    }
}
