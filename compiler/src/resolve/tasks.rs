//! Parallel forms: each branch is a function of its own, run as a task.

use grammar::{Form, FormKind, Span};
use vm::code::FnKind;
use vm::machine::ForkKind;
use vm::value::{Symbol, Value};

use super::Scope;
use super::params::ParamForms;
use crate::Compiler;
use crate::ast::{Expr, ExprKind, Function, VarId};
use crate::data::{Places, to_value};
use crate::error::CompileError;

/// A branch of a parallel form as written.
struct Branch<'f> {
    /// The name of `(:tag name form)`.
    tag: Option<(Symbol, Span)>,
    /// The name of `(:node name form)`, which only names the node.
    node: Option<Symbol>,
    body: &'f [Form],
    span: Span,
}

impl Compiler<'_> {
    /// `(par form …)` and those like it.
    pub(super) fn parallel(&mut self, scope: &mut Scope, kind: ForkKind, form: &Form, args: &[Form]) -> Expr {
        if args.is_empty() {
            return self.misshapen(form, "has no branches");
        }
        let branches = self.tagged(form, args);
        self.fork(scope, kind, &branches, &[], form.span)
    }

    /// A form with these branches, each of which knows the names of all.
    fn fork(
        &mut self,
        scope: &mut Scope,
        kind: ForkKind,
        branches: &[Branch<'_>],
        edges: &[(usize, usize)],
        span: Span,
    ) -> Expr {
        let number = |at: usize| Value::int(at as i64);
        let tagged = (0..branches.len()).filter(|at| branches[*at].tag.is_some());
        let pairs = edges.iter().map(|(a, b)| Value::list([number(*a), number(*b)]));
        let lists = [tagged.map(number).collect::<Vec<_>>(), pairs.collect()];
        let spec = Expr::new(ExprKind::Const(Value::list(lists.map(Value::list))), span);
        let tags: Vec<Symbol> = branches.iter().filter_map(|it| it.tag).map(|(tag, _)| tag).collect();
        let params = ParamForms::of_names(&tags, span);
        let branches = branches.iter().map(|branch| self.branch(scope, kind, &params, branch)).collect();
        fork(kind, spec, branches, span)
    }

    /// `(par-loop (name list) body…)`, `(try-each (name list) body…)`
    pub(super) fn parallel_loop(
        &mut self,
        scope: &mut Scope,
        kind: ForkKind,
        form: &Form,
        args: &[Form],
    ) -> Expr {
        let head = args.split_first().and_then(|(head, body)| match &head.kind {
            FormKind::List(parts) if parts.len() == 2 => Some((head, parts, body)),
            _ => None,
        });
        let Some((head, parts, body)) = head else {
            return self.misshapen(form, "does not say what it goes over");
        };
        let list = self.expr(scope, &parts[1]);
        let params = Form { kind: FormKind::List(vec![parts[0].clone()]), ..head.clone() };
        let params = self.param_forms(&params);
        let mut function = self.inner_function(scope, FnKind::Branch, &params, body, form.span);
        function.name = Symbol::from(kind.word());
        fork(kind, list, vec![(function.name, function)], form.span)
    }

    /// `(partial-order ((:tag a form) …) (:order a b) …)`
    pub(super) fn partial_order(&mut self, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
        let steps = args.split_first().and_then(|(steps, orders)| match &steps.kind {
            FormKind::List(steps) if !steps.is_empty() => Some((steps, orders)),
            _ => None,
        });
        let Some((steps, orders)) = steps else { return self.misshapen(form, "has no steps") };
        let branches = self.tagged(form, steps);
        let mut edges: Vec<(usize, usize)> = Vec::new();
        for order in orders {
            let names = match &order.kind {
                FormKind::List(parts) => match parts.as_slice() {
                    [word, names @ ..] if is_keyword(word, "order") && names.len() >= 2 => names,
                    _ => &[],
                },
                _ => &[],
            };
            if names.is_empty() {
                self.shape_at(form, "has an order that is not written", "(:order first then …)", order.span);
                continue;
            }
            let mut places = Vec::new();
            for name in names {
                let (tag, at) = (name.symbol(), name.span);
                let step = branches.iter().position(|it| it.tag.is_some_and(|(known, _)| Some(known) == tag));
                match step {
                    Some(step) => places.push(step),
                    None => {
                        let steps = branches.iter().filter_map(|it| it.tag).map(|(name, _)| name.to_string());
                        let (steps, name) =
                            (steps.collect(), vm::print::brief(&to_value(name, &mut Places::default())));
                        self.error(CompileError::UnknownStep { name, steps, at });
                    }
                }
            }
            edges.extend(places.windows(2).map(|pair| (pair[0], pair[1])));
        }
        if let Some(cycle) = cycle_in(branches.len(), &edges) {
            let tag = |at: &usize| branches[*at].tag.map_or_else(String::new, |(name, _)| name.to_string());
            let steps = cycle.iter().map(tag).collect();
            self.error(CompileError::OrderCycle { steps, at: form.span });
            return Expr::nil(form.span);
        }
        self.fork(scope, ForkKind::PartialOrder, &branches, &edges, form.span)
    }

    /// `(with-timeout seconds body…)`
    pub(super) fn with_timeout(&mut self, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
        let Some((seconds, body)) = args.split_first() else {
            return self.misshapen(form, "does not say how long");
        };
        let seconds = self.expr(scope, seconds);
        let branch = Branch { tag: None, node: None, body, span: form.span };
        let branch = self.branch(scope, ForkKind::WithTimeout, &ParamForms::default(), &branch);
        fork(ForkKind::WithTimeout, seconds, vec![branch], form.span)
    }

    /// The branches of a form, with their tags.
    fn tagged<'f>(&mut self, form: &Form, args: &'f [Form]) -> Vec<Branch<'f>> {
        let mut branches: Vec<Branch<'f>> = Vec::new();
        for arg in args {
            let mut branch =
                Branch { tag: None, node: None, body: std::slice::from_ref(arg), span: arg.span };
            if let FormKind::List(parts) = &arg.kind
                && let [word, name, body @ ..] = parts.as_slice()
                && (is_keyword(word, "tag") || is_keyword(word, "node"))
            {
                match name.symbol() {
                    Some(node) if is_keyword(word, "node") => (branch.node, branch.body) = (Some(node), body),
                    Some(tag) => (branch.tag, branch.body) = (Some((tag, name.span)), body),
                    None => {
                        self.shape_at(form, "has a tag without a name", "(:tag name form)", arg.span);
                        branch.body = body;
                    }
                }
            }
            let first = branch.tag.and_then(|(tag, again)| {
                let first = branches.iter().find_map(|it| it.tag.filter(|(known, _)| *known == tag))?;
                Some((tag, again, first.1))
            });
            if let Some((name, again, first)) = first {
                self.error(CompileError::BoundTwice { name: name.to_string(), again, first });
            }
            branches.push(branch);
        }
        branches
    }

    fn branch(
        &mut self,
        scope: &mut Scope,
        kind: ForkKind,
        params: &ParamForms,
        branch: &Branch<'_>,
    ) -> (Symbol, Function) {
        let named = branch.tag.map(|(name, _)| name).or(branch.node);
        let name = named.unwrap_or_else(|| Symbol::from(kind.word()));
        let mut function = self.inner_function(scope, FnKind::Branch, params, branch.body, branch.span);
        function.name = name;
        (name, function)
    }

    /// `(fl expression)`: computed again whenever a fluent changes that it reads.
    pub(super) fn derived_fluent(&mut self, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
        let [expression] = args else { return self.misshapen(form, "takes one expression") };
        self.computed_fluent(scope, form, expression, None)
    }

    /// `(fl-world goal)`: asked again whenever the world changes, and whenever a fluent does that stands in it.
    pub(super) fn world_fluent(&mut self, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
        let [goal] = args else { return self.misshapen(form, "takes one goal") };
        let ask = Form::new(FormKind::Symbol(Symbol::from("ask")), form.span);
        let question = Form::new(FormKind::List(vec![ask, goal.clone()]), form.span);
        let world = self.native_call("%world-fluent", Vec::new(), form.span);
        self.computed_fluent(scope, form, &question, Some(world))
    }

    /// The fluent of an expression over those that stand in it and one more.
    fn computed_fluent(
        &mut self,
        scope: &mut Scope,
        form: &Form,
        expression: &Form,
        another: Option<Expr>,
    ) -> Expr {
        // The status of a task is a fluent as well, and so is a goal about the world: asked for once, outside.
        let in_sight = scope.names.len();
        let mut outside = Vec::new();
        let expression = &self.without_fluents(scope, expression, &mut outside);
        let around = self.reads_fluents.replace(Vec::new());
        let params = ParamForms::default();
        let function = self.lambda(scope, &params, std::slice::from_ref(expression), form.span);
        let globals = std::mem::replace(&mut self.reads_fluents, around).unwrap_or_default();
        let captured = function.captures.iter().map(|(outer, _)| ExprKind::Var(*outer));
        let read = captured.chain(globals.into_iter().map(ExprKind::Global));
        let read = read.map(|kind| Some(Expr::new(kind, form.span))).chain(another.map(Some)).collect();
        let inputs = self.list_of(read, form.span);
        let function = Expr::new(ExprKind::Lambda(Box::new(function)), form.span);
        let fluent = self.native_call("%derive", vec![Some(function), Some(inputs)], form.span);
        scope.names.truncate(in_sight);
        match outside.is_empty() {
            true => fluent,
            false => Expr::new(ExprKind::Let(outside, vec![fluent]), form.span),
        }
    }

    /// A form with a name in the place of each `(status task)` and `(fl-world goal)`, bound to its value.
    fn without_fluents(&mut self, scope: &mut Scope, form: &Form, outside: &mut Vec<(VarId, Expr)>) -> Form {
        let FormKind::List(parts) = &form.kind else { return form.clone() };
        match parts.first() {
            Some(head) if head.is("quote") => form.clone(),
            Some(head) if self.makes_fluent(scope, head) => {
                let value = self.expr(scope, form);
                let name = Symbol::from(&format!("%status-{}", outside.len()));
                outside.push((scope.bind(name, form.span), value));
                Form { kind: FormKind::Symbol(name), ..form.clone() }
            }
            _ => {
                let parts = parts.iter().map(|part| self.without_fluents(scope, part, outside)).collect();
                Form { kind: FormKind::List(parts), ..form.clone() }
            }
        }
    }

    /// True for the heads of forms that make fluents of what is no fluent.
    fn makes_fluent(&mut self, scope: &mut Scope, head: &Form) -> bool {
        let known = ["status", "fl-world"].into_iter().find(|name| head.is(name));
        known.is_some_and(|name| scope.variable(Symbol::from(name), head.span).is_none())
    }

    /// A variable or constant in an expression over fluents: what it holds, if it is a fluent.
    pub(super) fn read(&mut self, expr: Expr) -> Expr {
        let Some(globals) = &mut self.reads_fluents else { return expr };
        if let ExprKind::Global(global) = &expr.kind
            && !globals.contains(global)
        {
            globals.push(*global);
        }
        let span = expr.span;
        self.native_call("%read", vec![Some(expr)], span)
    }
}

pub(super) fn is_keyword(form: &Form, word: &str) -> bool {
    matches!(&form.kind, FormKind::Keyword(name) if name == word)
}

fn fork(kind: ForkKind, extra: Expr, branches: Vec<(Symbol, Function)>, span: Span) -> Expr {
    Expr::new(ExprKind::Fork { kind, extra: Box::new(extra), branches }, span)
}

/// Steps that would all have to come before each other.
fn cycle_in(steps: usize, edges: &[(usize, usize)]) -> Option<Vec<usize>> {
    let mut left: Vec<usize> = (0..steps).collect();
    loop {
        let waits = |at: &usize| edges.iter().any(|(before, after)| after == at && left.contains(before));
        let (waiting, free): (Vec<usize>, Vec<usize>) = left.iter().partition(|at| waits(at));
        if waiting.is_empty() {
            return None;
        }
        left = waiting;
        if free.is_empty() {
            break;
        }
    }
    // Those that only come after the circle are no part of it.
    loop {
        let goes_on = |at: &usize| edges.iter().any(|(before, after)| before == at && left.contains(after));
        let (circle, after): (Vec<usize>, Vec<usize>) = left.iter().partition(|at| goes_on(at));
        left = circle;
        if after.is_empty() {
            return Some(left);
        }
    }
}
