//! Questions that plans ask of rules: `ask`, `answers`, `query`, `for-each-answer`, and `with-facts`.
//!
//! The goal becomes a predicate of its own, [`crate::rules::query`]; what is left in the plan is a call
//! of a native with the number of the predicate and the values that the goal needs.

use grammar::{Form, FormKind, Prefix, Span};
use vm::rules::clause::Term;
use vm::value::{Symbol, Value};

use super::Scope;
use super::special::loop_body;
use crate::Compiler;
use crate::ast::{Expr, ExprKind};
use crate::error::CompileError;
use crate::rules::query::Template;

/// Forms behind a comma in a goal, each with the variable that stands for its value.
type Commas = Vec<(Symbol, Expr)>;

/// `(ask goal)`
pub(super) fn ask(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    match args {
        [goal] => it.query(scope, "%ask", goal, Template::True, form),
        _ => it.misshapen(form, "takes one goal"),
    }
}

/// `(answers template goal)`
pub(super) fn answers(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    match args {
        [template, goal] => it.query(scope, "%answers", goal, Template::Term(template), form),
        _ => it.misshapen(form, "takes a template and a goal"),
    }
}

/// `(query goal)`
pub(super) fn query(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    match args {
        [goal] => it.query(scope, "%query", goal, Template::Map, form),
        _ => it.misshapen(form, "takes one goal"),
    }
}

/// `(for-each-answer (?x …) goal body…)`: a loop over the lists of the values.
pub(super) fn for_each_answer(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let [names, goal, body @ ..] = args else { return it.misshapen(form, "needs variables and a goal") };
    let Some(variables) = super::special::list_or_nil(names) else {
        return it.misshapen(form, "needs a list of variables");
    };
    for (at, name) in variables.iter().enumerate() {
        let Some(symbol) = name.symbol().filter(|name| name.starts_with('?') && *name != "?_") else {
            return it.misshapen(form, "lists something that is no variable `?x`");
        };
        if let Some(first) = variables[..at].iter().find(|other| other.is(&symbol)) {
            let (again, first) = (name.span, first.span);
            it.error(CompileError::BoundTwice { name: symbol.to_string(), again, first });
        }
    }
    let answers = it.query(scope, "%query", goal, Template::List(variables), form);
    let in_sight = scope.names.len();
    let var = scope.hidden(names.span);
    let mut parts = Vec::new();
    let pattern = Form::new(FormKind::List(variables.to_vec()), names.span);
    it.take_apart(scope, &pattern, Expr::new(ExprKind::Var(var), names.span), &mut parts);
    let body = loop_body(it, scope, body);
    scope.names.truncate(in_sight);
    let body = vec![Expr::new(ExprKind::Let(parts, body), form.span)];
    let result = Box::new(Expr::nil(form.span));
    Expr::new(ExprKind::Dolist { var, list: Box::new(answers), body, result }, form.span)
}

/// `(with-facts ((predicate argument …) …) body…)`
pub(super) fn with_facts(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((facts, body)) = args.split_first() else { return it.misshapen(form, "has no facts") };
    let Some(facts) = super::special::list_or_nil(facts) else {
        return it.misshapen(form, "needs a list of facts");
    };
    let span = form.span;
    let facts: Vec<Option<Expr>> = facts.iter().map(|fact| it.scoped_fact(scope, form, fact)).collect();
    let body = it.body(scope, body);
    if facts.is_empty() {
        return Expr::seq(body, span);
    }
    let list = it.list_of(facts, span);
    let var = scope.hidden(span);
    let push = it.native_call("%push-facts", vec![Some(Expr::new(ExprKind::Var(var), span))], span);
    let pop = it.native_call("%pop-scope", Vec::new(), span);
    let body = Expr::seq(std::iter::once(push).chain(body).collect(), span);
    let guarded = Expr::new(ExprKind::Protect(Box::new(body), vec![pop], Symbol::from("with-facts")), span);
    Expr::new(ExprKind::Let(vec![(var, list)], vec![guarded]), span)
}

impl Compiler<'_> {
    /// A call of a native that answers a goal.
    fn query(
        &mut self,
        scope: &mut Scope,
        native: &str,
        goal: &Form,
        template: Template<'_>,
        form: &Form,
    ) -> Expr {
        let mut commas = Commas::new();
        let goal = self.without_commas(scope, goal, &mut commas);
        let template_form = match template {
            Template::Term(term) => Some(self.without_commas(scope, term, &mut commas)),
            _ => None,
        };
        let template = template_form.as_ref().map_or(template, Template::Term);
        let question = self.question(scope.module, std::slice::from_ref(&goal), form.span, template);
        let mut inputs = Vec::new();
        let mut values = Vec::new();
        for (var, (name, at)) in question.inputs() {
            if let Some(value) = self.outer_value(scope, &commas, name, at) {
                inputs.push(var);
                values.push(Some(value));
            }
        }
        let head = form.head().unwrap_or_default();
        let predicate = self.answer(question, &inputs, template, &head, form.span);
        let predicate = Expr::new(ExprKind::Const(Value::int(predicate.0.into())), form.span);
        self.native_call(native, std::iter::once(Some(predicate)).chain(values).collect(), form.span)
    }

    /// The value that a variable of a goal has in the plan around it.
    fn outer_value(&mut self, scope: &mut Scope, commas: &Commas, name: Symbol, at: Span) -> Option<Expr> {
        if let Some((_, value)) = commas.iter().find(|(known, _)| *known == name) {
            return Some(value.clone());
        }
        let var = scope.variable(name, at)?;
        Some(self.read(Expr::new(ExprKind::Var(var), at)))
    }

    /// A form with a variable in the place of each `,expression`.
    fn without_commas(&mut self, scope: &mut Scope, form: &Form, commas: &mut Commas) -> Form {
        let kind = match &form.kind {
            FormKind::Prefixed(Prefix::Unquote, inner) => {
                let name = Symbol::from(&format!("?,{}", commas.len()));
                let value = self.expr(scope, inner);
                commas.push((name, value));
                FormKind::Symbol(name)
            }
            FormKind::List(items) => FormKind::List(self.all_without_commas(scope, items, commas)),
            FormKind::Vector(items) => FormKind::Vector(self.all_without_commas(scope, items, commas)),
            FormKind::Map(pairs) => {
                let pair =
                    |(key, value): &(Form, Form)| (key.clone(), self.without_commas(scope, value, commas));
                FormKind::Map(pairs.iter().map(pair).collect())
            }
            _ => return form.clone(),
        };
        Form::new(kind, form.span)
    }

    fn all_without_commas(&mut self, scope: &mut Scope, items: &[Form], commas: &mut Commas) -> Vec<Form> {
        items.iter().map(|item| self.without_commas(scope, item, commas)).collect()
    }

    /// `(predicate argument …)` as a cell of the predicate's number and the values.
    fn scoped_fact(&mut self, scope: &mut Scope, form: &Form, fact: &Form) -> Option<Expr> {
        let mut commas = Commas::new();
        let fact = self.without_commas(scope, fact, &mut commas);
        let Some((predicate, args, rule)) = self.fact_pattern(scope.module, &fact) else {
            if fact.head().is_none() {
                self.shape_at(
                    form,
                    "has a fact that is not written (predicate argument …)",
                    "(with-facts ((on milk table)) body…)",
                    fact.span,
                );
            }
            return None;
        };
        let span = fact.span;
        let names = rule.var_names();
        let mut values = Vec::new();
        for (name, at) in names.into_iter().zip(rule.var_spans()) {
            let value = self.outer_value(scope, &commas, name, at);
            if value.is_none() {
                let help = Some("bind it with `let` or a parameter".into());
                self.error(CompileError::Unbound { name: name.to_string(), at, help });
            }
            values.push(value.unwrap_or_else(|| Expr::nil(at)));
        }
        let number = Expr::new(ExprKind::Const(Value::int(predicate.0.into())), span);
        let args = args.iter().map(|arg| Some(self.value_of(arg, &values, span))).collect();
        let args = self.list_of(args, span);
        Some(self.native_call("cons", vec![Some(number), Some(args)], span))
    }

    /// An expression for the value of a term whose variables have these values.
    fn value_of(&mut self, term: &Term, values: &[Expr], span: Span) -> Expr {
        let kind = match term {
            Term::Var(var) => return values.get(*var as usize).cloned().unwrap_or_else(|| Expr::nil(span)),
            Term::Any => {
                let (name, help) =
                    ("?_".into(), Some("a fact says what holds: each argument has a value".into()));
                self.error(CompileError::Unbound { name, at: span, help });
                return Expr::nil(span);
            }
            Term::Const(value) => ExprKind::Const(value.clone()),
            Term::Pair(first, rest) => {
                let first = self.value_of(first, values, span);
                let rest = self.value_of(rest, values, span);
                return self.native_call("cons", vec![Some(first), Some(rest)], span);
            }
            Term::Vector(items) => {
                ExprKind::Vector(items.iter().map(|item| self.value_of(item, values, span)).collect())
            }
            Term::Map(pairs) => {
                let key = |key: &Value| Expr::new(ExprKind::Const(key.clone()), span);
                let pairs =
                    pairs.iter().flat_map(|(it, value)| [key(it), self.value_of(value, values, span)]);
                ExprKind::Map(pairs.collect())
            }
            Term::Desc(kind, properties) => {
                let properties =
                    properties.iter().map(|(key, value)| (*key, self.value_of(value, values, span)));
                ExprKind::Desc(*kind, properties.collect())
            }
        };
        Expr::new(kind, span)
    }
}
