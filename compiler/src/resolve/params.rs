//! Parameter lists, and patterns that take values apart.

use grammar::{Form, FormKind, Span};
use vm::code::{Params, is_pattern};
use vm::value::Symbol;

use super::Scope;
use crate::Compiler;
use crate::ast::{Expr, ExprKind, VarId};
use crate::error::CompileError;

/// The variables of parameters, with their defaults.
pub(super) type Inputs = Vec<(VarId, Option<Expr>)>;

/// A parameter list as written.
#[derive(Debug, Clone, Default)]
pub(crate) struct ParamForms {
    pub params: Params,
    /// For each parameter its place, its default, and the pattern that takes it apart.
    items: Vec<(Span, Option<Form>, Option<Form>)>,
}

impl ParamForms {
    /// Required parameters of these names.
    pub(crate) fn of_names(names: &[Symbol], span: Span) -> ParamForms {
        let params = Params { names: names.to_vec(), required: names.len() as u8, ..Params::default() };
        ParamForms { params, items: names.iter().map(|_| (span, None, None)).collect() }
    }

    /// The same parameters for a body that hands them on as they were given.
    pub(crate) fn without_defaults(&self) -> ParamForms {
        let items = self.items.iter().map(|(span, ..)| (*span, None, None)).collect();
        ParamForms { params: self.params.clone(), items }
    }
}

/// Parameters of one function; more would not fit its registers with what it computes.
const MOST_PARAMS: usize = 100;

impl Compiler<'_> {
    /// Reads `(a (b c) &optional (d 1) &key e &rest f)`.
    pub(crate) fn param_forms(&mut self, form: &Form) -> ParamForms {
        let mut read = ParamForms::default();
        let items: &[Form] = match &form.kind {
            FormKind::List(items) => items,
            _ if form.is("nil") => &[],
            _ => {
                self.error(CompileError::Parameters {
                    problem: "the parameters are no list".into(),
                    at: form.span,
                });
                return read;
            }
        };
        let mut section = Section::Required;
        for (at, item) in items.iter().enumerate() {
            if read.params.names.len() >= MOST_PARAMS {
                let problem = format!("there are more than {MOST_PARAMS} parameters");
                self.error(CompileError::Parameters { problem, at: form.span });
                return ParamForms::default();
            }
            if item.is("&rest") && items.len() == at + 1 {
                let problem = "`&rest` is followed by no name".into();
                self.error(CompileError::Parameters { problem, at: item.span });
            }
            match item.symbol().and_then(|name| Section::of(&name)) {
                Some(next) if next > section => section = next,
                Some(_) => {
                    let problem = format!("`{}` is out of order", item.symbol().unwrap_or_default());
                    self.error(CompileError::Parameters { problem, at: item.span });
                }
                None => self.param(&mut read, section, item),
            }
        }
        let names = &read.params.names;
        for (i, name) in names.iter().enumerate() {
            let first = names[..i].iter().position(|other| other == name && !is_pattern(name));
            if let Some(first) = first {
                let (again, first) = (read.items[i].0, read.items[first].0);
                self.error(CompileError::BoundTwice { name: name.to_string(), again, first });
            }
        }
        read
    }

    fn param(&mut self, read: &mut ParamForms, section: Section, item: &Form) {
        let problem = |problem: &str| CompileError::Parameters { problem: problem.into(), at: item.span };
        let (name, default, pattern) = match (&item.kind, section) {
            (FormKind::Symbol(name), _) => (*name, None, None),
            (FormKind::List(_) | FormKind::Vector(_), Section::Required) => {
                (Symbol::from(&item.to_string()), None, Some(item.clone()))
            }
            (FormKind::List(parts), Section::Optional | Section::Key) => match parts.as_slice() {
                [name, default] if name.symbol().is_some() => {
                    (name.symbol().unwrap_or_default(), Some(default.clone()), None)
                }
                _ => return self.error(problem("an optional parameter is written (name default)")),
            },
            _ => return self.error(problem("a parameter is a name")),
        };
        if matches!(name.as_str(), "nil" | "true" | "false") || name.starts_with('&') {
            return self.error(problem(&format!("`{name}` cannot be a parameter")));
        }
        match section {
            Section::Required => read.params.required += 1,
            Section::Optional => read.params.optional += 1,
            Section::Key => read.params.keys += 1,
            Section::Rest if read.params.rest => {
                return self.error(problem("there is one parameter after `&rest`"));
            }
            Section::Rest => read.params.rest = true,
        }
        read.params.names.push(name);
        read.items.push((item.span, default, pattern));
    }

    /// Binds the parameters. Gives their variables with defaults, and what takes patterns apart.
    pub(super) fn bind_params(
        &mut self,
        scope: &mut Scope,
        params: &ParamForms,
    ) -> (Inputs, Vec<(VarId, Expr)>) {
        let mut inputs = Vec::new();
        let mut parts = Vec::new();
        // A default sees the parameters before it, so they are bound one after another.
        for (name, (span, default, _)) in params.params.names.iter().zip(&params.items) {
            let default = default.as_ref().map(|default| self.expr(scope, default));
            inputs.push((scope.bind(*name, *span), default));
        }
        for ((var, _), (span, _, pattern)) in inputs.iter().zip(&params.items) {
            if let Some(pattern) = pattern {
                let value = Expr::new(ExprKind::Var(*var), *span);
                self.take_apart(scope, pattern, value, &mut parts);
            }
        }
        (inputs, parts)
    }

    /// Binds the names of a pattern to the parts of a value: `(a (b c) &rest d)`, `[a b]`.
    pub(super) fn take_apart(
        &mut self,
        scope: &mut Scope,
        pattern: &Form,
        value: Expr,
        parts: &mut Vec<(VarId, Expr)>,
    ) {
        let span = pattern.span;
        let items = match &pattern.kind {
            FormKind::Symbol(name) => {
                let var = scope.bind(*name, span);
                return parts.push((var, value));
            }
            FormKind::List(items) | FormKind::Vector(items) => items,
            _ => {
                let problem = "a pattern is a name, or a list or vector of patterns".into();
                return self.error(CompileError::Parameters { problem, at: span });
            }
        };
        let (items, rest) = match items.iter().position(|item| item.is("&rest")) {
            Some(at) => (&items[..at], items.get(at + 1)),
            None => (items.as_slice(), None),
        };
        // The parts come as a list of as many elements as there are names, and the rest.
        let number = |n: usize| Some(Expr::new(ExprKind::Const(vm::Value::int(n as i64)), span));
        let with_rest = Some(Expr::new(ExprKind::Const(vm::Value::bool(rest.is_some())), span));
        let list = self.native_call("%take-apart", vec![Some(value), number(items.len()), with_rest], span);
        let mut cell = scope.hidden(span);
        parts.push((cell, list));
        for item in items.iter().chain(rest) {
            let here = Some(Expr::new(ExprKind::Var(cell), span));
            let first = self.native_call("first", vec![here.clone()], item.span);
            self.take_apart(scope, item, first, parts);
            let next = scope.hidden(span);
            let after = self.native_call("rest", vec![here], span);
            parts.push((next, after));
            cell = next;
        }
    }
}

/// The parts of a parameter list, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Section {
    Required,
    Optional,
    Key,
    Rest,
}

impl Section {
    fn of(name: &str) -> Option<Section> {
        match name {
            "&optional" => Some(Section::Optional),
            "&key" => Some(Section::Key),
            "&rest" => Some(Section::Rest),
            _ => None,
        }
    }
}
