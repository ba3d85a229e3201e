//! Terms: data with variables in it. In rules nothing is quoted.

use grammar::{Form, FormKind, Prefix, Span};
use vm::desc::Desc;
use vm::rules::clause::Term;
use vm::value::{Imm, Map, Symbol, Value};

use super::{MOST_VARS, Rule};
use crate::Compiler;
use crate::data::MOST_NESTED;
use crate::error::CompileError;
use crate::resolve::is_description_in_rule;

impl Compiler<'_> {
    /// Resolves a term.
    pub(super) fn term(&mut self, rule: &mut Rule, form: &Form) -> Term {
        self.nested(form.span, Term::Any, |it| it.term_of(rule, form))
    }

    pub(super) fn terms(&mut self, rule: &mut Rule, forms: &[Form]) -> Vec<Term> {
        forms.iter().map(|form| self.term(rule, form)).collect()
    }

    fn term_of(&mut self, rule: &mut Rule, form: &Form) -> Term {
        match &form.kind {
            FormKind::Symbol(name) => self.name_term(rule, *name, form.span),
            FormKind::Keyword(name) => Term::Const(Value::Imm(Imm::Keyword(*name))),
            FormKind::Int(i) => Term::Const(Value::int(*i)),
            FormKind::Float(f) => Term::Const(Value::float(*f)),
            FormKind::Str(text) => Term::Const(Value::str(text.clone())),
            FormKind::List(_) if is_description_in_rule(form) => self.description_term(rule, form),
            FormKind::List(items) => self.list_term(rule, items, form.span),
            FormKind::Vector(items) => {
                let items = self.terms(rule, items);
                match constants(&items) {
                    Some(items) => Term::Const(Value::vector(items)),
                    None => Term::Vector(items),
                }
            }
            FormKind::Map(pairs) => self.map_term(rule, pairs),
            FormKind::Prefixed(Prefix::Quote, inner) => self.term(rule, inner),
            FormKind::Prefixed(prefix, _) => {
                let problem = format!("`{}` means nothing in a rule", prefix.sign());
                let help =
                    "data stand as they are, variables are written `?x`; `(is ?x expression)` computes";
                self.no_term(problem, form.span, Some(help))
            }
        }
    }

    /// The error of something that is no term.
    pub(super) fn no_term(&mut self, problem: impl Into<String>, at: Span, help: Option<&str>) -> Term {
        self.error(CompileError::NotATerm { problem: problem.into(), at, help: help.map(Into::into) });
        Term::Any
    }

    fn name_term(&mut self, rule: &mut Rule, name: Symbol, span: Span) -> Term {
        match name.as_str() {
            "nil" => Term::Const(Value::NIL),
            "true" => Term::Const(Value::TRUE),
            "false" => Term::Const(Value::FALSE),
            "?_" => Term::Any,
            "." => {
                self.no_term("a dot stands before the last part of a list", span, Some("write (?x . ?xs)"))
            }
            text if text.starts_with('?') => Term::Var(self.variable(rule, name, span)),
            _ => Term::Const(Value::Imm(Imm::Symbol(name))),
        }
    }

    /// A variable as it is written at a place.
    pub(super) fn variable(&mut self, rule: &mut Rule, name: Symbol, span: Span) -> u16 {
        let var = rule.var(name, span);
        if rule.vars.len() > MOST_VARS && !std::mem::replace(&mut rule.full, true) {
            self.error(CompileError::ClauseTooLarge { limit: MOST_VARS, at: span });
        }
        var
    }

    /// `(a b ?c)`, `(?x . ?xs)`
    fn list_term(&mut self, rule: &mut Rule, items: &[Form], span: Span) -> Term {
        let (items, end) = match items {
            [items @ .., dot, end] if dot.is(".") && !items.is_empty() => (items, Some(end)),
            items => (items, None),
        };
        let items = self.terms(rule, items);
        let end = end.map_or(Term::Const(Value::NIL), |end| self.term(rule, end));
        let mut pairs = 0;
        let list = items.into_iter().rev().fold(end, |rest, first| match (first, rest) {
            (Term::Const(first), Term::Const(rest)) => Term::Const(Value::cons(first, rest)),
            // Terms are walked by recursion.
            (_, rest) if pairs >= MOST_NESTED => rest,
            (first, rest) => {
                pairs += 1;
                Term::Pair(Box::new(first), Box::new(rest))
            }
        });
        if pairs >= MOST_NESTED {
            return self.no_term(
                format!("a list with variables has more than {MOST_NESTED} elements"),
                span,
                None,
            );
        }
        list
    }

    fn map_term(&mut self, rule: &mut Rule, pairs: &[(Form, Form)]) -> Term {
        let mut terms: Vec<(Value, Term)> = Vec::new();
        for (key, value) in pairs {
            let value = self.term(rule, value);
            match self.term(rule, key) {
                Term::Const(key) => terms.push((key, value)),
                _ => {
                    let help = "look a key up with (fun get ?map ?key ?value)";
                    return self.no_term("a key of a map has a variable in it", key.span, Some(help));
                }
            }
        }
        terms.sort_by(|a, b| a.0.cmp(&b.0));
        if let Some(pair) = terms.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            let key = vm::print::brief(&pair[0].0);
            let at = pairs.first().map_or(Span::default(), |(key, _)| key.span);
            return self.no_term(format!("a map has the key {key} twice"), at, None);
        }
        let values: Vec<Term> = terms.iter().map(|(_, value)| value.clone()).collect();
        match constants(&values) {
            Some(values) => {
                let entries: Map = terms.into_iter().map(|(key, _)| key).zip(values).collect();
                Term::Const(Value::map(entries))
            }
            None => Term::Map(terms),
        }
    }

    /// `(an object (type ?t))`
    fn description_term(&mut self, rule: &mut Rule, form: &Form) -> Term {
        let described = self.described(form, &mut |it, value| it.term(rule, value));
        let Some((kind, mut properties)) = described else { return Term::Any };
        properties.sort_by(|a, b| a.0.as_str().cmp(b.0.as_str()));
        let values: Vec<Term> = properties.iter().map(|(_, value)| value.clone()).collect();
        match constants(&values) {
            Some(values) => {
                let keys = properties.into_iter().map(|(key, _)| key);
                Term::Const(Value::desc(Desc::new(kind, keys.zip(values).collect())))
            }
            None => Term::Desc(kind, properties),
        }
    }
}

/// The values of terms that all are constants.
fn constants(terms: &[Term]) -> Option<Vec<Value>> {
    let value = |term: &Term| if let Term::Const(value) = term { Some(value.clone()) } else { None };
    terms.iter().map(value).collect()
}
