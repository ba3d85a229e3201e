//! Entity descriptions as expressions: `(an object (type ?type))`.
//!
//! Inside a description `?x`, `,expr` and nested descriptions are evaluated, nothing else.

use grammar::{Form, FormKind, Prefix, Span};
use vm::desc::{KINDS, Match};
use vm::value::{Imm, Symbol, Value};

use super::Scope;
use crate::Compiler;
use crate::ast::{Expr, ExprKind};
use crate::error::CompileError;
use crate::module::nearest;

/// Properties that say something about an action: inside its location they are misplaced.
const OF_ACTIONS: [&str; 4] = ["target", "object", "arm", "goal"];

/// True for forms that describe an entity, or try to.
pub(super) fn is_description(form: &Form) -> bool {
    let Some(items) = form.list() else { return false };
    matches!(form.head().as_ref().map(|head| head.as_str()), Some("a" | "an"))
        && items.get(1).is_some_and(|kind| kind.symbol().is_some())
}

/// The same in rules, where `(a b c)` is a list like any other: the kind is one that there is, or is
/// misspelled and followed by properties.
pub(crate) fn is_description_in_rule(form: &Form) -> bool {
    let [_, kind, properties @ ..] = form.list().unwrap_or_default() else { return false };
    let kind = kind.symbol().unwrap_or_default();
    let is_like = || nearest(&kind, KINDS).is_some() && properties.iter().all(|it| it.head().is_some());
    is_description(form) && (KINDS.contains(&kind.as_str()) || (!properties.is_empty() && is_like()))
}

impl Compiler<'_> {
    /// `(an action (type fetching) …)`. With `free`, variables `?x` that are not bound are
    /// variables of a pattern.
    pub(super) fn description(&mut self, scope: &mut Scope, form: &Form, free: bool) -> Expr {
        let described = self.described(form, &mut |it, value| it.property_value(scope, value, free));
        match described {
            Some((kind, properties)) => Expr::new(ExprKind::Desc(kind, properties), form.span),
            None => Expr::nil(form.span),
        }
    }

    /// Kind and properties of a description, each value read by `read`.
    pub(crate) fn described<T>(
        &mut self,
        form: &Form,
        read: &mut dyn FnMut(&mut Self, &Form) -> T,
    ) -> Option<(Symbol, Vec<(Symbol, T)>)> {
        let span = form.span;
        let items = form.list().unwrap_or_default();
        let Some(kind) = items.get(1).and_then(Form::symbol) else {
            let shape = "(an action (key value) …)".into();
            let problem = "needs the kind of the entity".into();
            self.error(CompileError::Shape { form: "an".into(), problem, shape, at: span });
            return None;
        };
        if !KINDS.contains(&kind.as_str()) {
            let kind = match nearest(&kind, KINDS) {
                Some(near) => format!("{kind}`, did you mean `{near}"),
                None => kind.to_string(),
            };
            self.error(CompileError::DescKind { kind, at: items[1].span });
        }
        let mut properties: Vec<(Symbol, T)> = Vec::new();
        let mut places: Vec<Span> = Vec::new();
        for item in &items[2..] {
            let Some((key, value)) = self.property(item, read) else { continue };
            if let Some(first) = properties.iter().position(|(known, _)| *known == key) {
                let (again, first) = (item.span, places[first]);
                self.error(CompileError::DescDuplicate { key: key.to_string(), again, first });
                continue;
            }
            properties.push((key, value));
            places.push(item.span);
        }
        if kind == "action" {
            self.warn_misplaced(items, span);
        }
        Some((kind, properties))
    }

    fn property<T>(
        &mut self,
        item: &Form,
        read: &mut dyn FnMut(&mut Self, &Form) -> T,
    ) -> Option<(Symbol, T)> {
        let mut wrong = |detail: String, help: Option<String>| {
            self.error(CompileError::DescProperty { detail, at: item.span, help });
            None
        };
        let Some(parts) = item.list() else {
            return wrong(String::new(), Some("put the property into brackets: (key value)".into()));
        };
        let Some(key) = item.head() else { return wrong(", with a symbol as key".into(), None) };
        match parts {
            [_, value] => Some((key, read(self, value))),
            [_] => wrong(format!("; `{key}` has no value"), Some(format!("write ({key} value)"))),
            _ => wrong(
                format!("; `{key}` has several values"),
                Some(format!("write ({key} (a b)) for a list")),
            ),
        }
    }

    fn property_value(&mut self, scope: &mut Scope, form: &Form, free: bool) -> Expr {
        match &form.kind {
            FormKind::Symbol(name) if name.starts_with('?') => match scope.variable(*name, form.span) {
                Some(var) => Expr::new(ExprKind::Var(var), form.span),
                None if free => Expr::new(ExprKind::Const(Value::Imm(Imm::Var(*name))), form.span),
                None => self.expr(scope, form),
            },
            FormKind::Prefixed(Prefix::Unquote, inner) => self.expr(scope, inner),
            FormKind::Prefixed(Prefix::Quote, inner) => self.constant(inner),
            FormKind::List(_) if is_description(form) => self.description(scope, form, free),
            FormKind::List(items) if items.iter().any(|item| self.has_evaluated(item)) => {
                let items = items.iter().map(|item| Some(self.property_value(scope, item, free))).collect();
                self.list_of(items, form.span)
            }
            FormKind::Vector(items) if items.iter().any(|item| self.has_evaluated(item)) => {
                let items = items.iter().map(|item| self.property_value(scope, item, free)).collect();
                Expr::new(ExprKind::Vector(items), form.span)
            }
            _ => self.constant(form),
        }
    }

    /// True if a part of a property's value is evaluated.
    fn has_evaluated(&self, form: &Form) -> bool {
        match &form.kind {
            FormKind::Symbol(name) => name.starts_with('?'),
            FormKind::Prefixed(Prefix::Unquote, _) => true,
            FormKind::List(_) if is_description(form) => true,
            FormKind::List(items) | FormKind::Vector(items) => {
                items.iter().any(|item| self.has_evaluated(item))
            }
            _ => false,
        }
    }

    /// The brackets of Listing 1 as printed in the paper put `target` into `location`.
    fn warn_misplaced(&mut self, action: &[Form], span: Span) {
        let has = |key: &str| action.iter().any(|item| item.head().is_some_and(|head| head == key));
        for property in action.iter().filter_map(Form::list) {
            let [_, inner] = property else { continue };
            let location = inner.list().filter(|items| is_description(inner) && items[1].is("location"));
            for item in location.unwrap_or_default() {
                let Some(key) = item.head().filter(|key| OF_ACTIONS.contains(&key.as_str()) && !has(key))
                else {
                    continue;
                };
                let (key, kind) = (key.to_string(), "location".to_string());
                self.error(CompileError::Misplaced { key, kind, at: item.span, action: span });
            }
        }
    }

    /// `(matches pattern value)` and `(== pattern value)`.
    pub(super) fn matching(&mut self, scope: &mut Scope, mode: Match, form: &Form, args: &[Form]) -> Expr {
        let [pattern, value] = args else {
            let name = if mode == Match::Open { "matches" } else { "==" };
            return self.shape(
                form,
                "takes a pattern and a value",
                &format!("({name} (an object (type ?t)) value)"),
            );
        };
        let pattern = self.pattern(scope, pattern);
        let value = self.expr(scope, value);
        Expr::new(ExprKind::Matches(mode, Box::new(pattern), Box::new(value)), form.span)
    }

    /// A pattern: a description, a variable, or any expression.
    fn pattern(&mut self, scope: &mut Scope, form: &Form) -> Expr {
        match &form.kind {
            FormKind::List(_) if is_description(form) => self.description(scope, form, true),
            FormKind::Symbol(name) if name.starts_with('?') => self.property_value(scope, form, true),
            _ => self.expr(scope, form),
        }
    }
}
