//! Forms to AST: names to what they mean, special forms to what they are, macros away.
//!
//! One [`Scope`] per function that is being resolved; the table of special forms is in
//! [`special`]. All errors are collected: a form with one becomes nil and resolving goes on.

mod desc;
mod params;
mod quasi;
mod queries;
pub(crate) mod special;
mod tasks;

use std::rc::Rc;

use grammar::{Form, FormKind, Prefix, Span};
use vm::code::FnKind;
use vm::value::{Symbol, Value};

use crate::Compiler;
use crate::ast::{Callee, Expr, ExprKind, Function, Var, VarId};
use crate::data::{MOST_NESTED, Places, to_value};
use crate::error::CompileError;
use crate::module::{Found, Meaning, ModuleId, nearest, predicate_key};
use crate::rules::goal;

pub(crate) use desc::is_description_in_rule;
pub(crate) use params::ParamForms;

/// Nobody reads the help of more errors than this, and finding it takes time.
pub(crate) const MOST_HELPED: usize = 100;

/// What `retry`, `return` and `propagate` mean at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Around {
    /// In a loop: `return` leaves it.
    Loop,
    /// In a clause of a handler: all three.
    Clause,
}

/// A function that is being resolved.
pub(crate) struct Scope {
    module: ModuleId,
    kind: FnKind,
    vars: Vec<Var>,
    /// Names in sight, innermost last.
    names: Vec<(Symbol, VarId)>,
    /// Names of captured variables.
    captured: Vec<(Symbol, VarId)>,
    captures: Vec<(VarId, VarId)>,
    around: Vec<Around>,
    /// `(original)` may stand here.
    original: bool,
    /// In an expression of a rule: its variables, as they are met.
    free: Option<Vec<(Symbol, VarId)>>,
    /// The function around, for lambdas.
    outer: Option<Box<Scope>>,
}

impl Scope {
    pub(crate) fn new(module: ModuleId, kind: FnKind) -> Scope {
        Scope {
            module,
            kind,
            vars: Vec::new(),
            names: Vec::new(),
            captured: Vec::new(),
            captures: Vec::new(),
            around: Vec::new(),
            original: false,
            free: None,
            outer: None,
        }
    }

    /// Lets `(original)` stand in it.
    pub(crate) fn with_original(mut self, original: bool) -> Scope {
        self.original = original;
        self
    }

    /// Lets each `?x` that nothing binds be a parameter.
    pub(crate) fn of_rule(mut self) -> Scope {
        self.free = Some(Vec::new());
        self
    }

    /// The parameters that were found, in the order of the text.
    pub(crate) fn take_free(&mut self) -> Vec<(Symbol, VarId)> {
        self.free.take().unwrap_or_default()
    }

    fn free_variable(&mut self, name: Symbol, span: Span) -> Option<VarId> {
        let free = self.free.as_mut().filter(|_| name.starts_with('?') && name != "?_")?;
        let var = VarId(self.vars.len() as u32);
        self.vars.push(Var { name, span, assigned: None, captured: None });
        self.captured.push((name, var));
        free.push((name, var));
        Some(var)
    }

    fn bind(&mut self, name: Symbol, span: Span) -> VarId {
        let var = VarId(self.vars.len() as u32);
        self.vars.push(Var { name, span, assigned: None, captured: None });
        self.names.push((name, var));
        var
    }

    /// A variable without a name that a program could write.
    fn hidden(&mut self, span: Span) -> VarId {
        let var = self.bind(Symbol::from(""), span);
        self.names.pop();
        var
    }

    /// The variable of this name; one of a function around is captured.
    fn variable(&mut self, name: Symbol, at: Span) -> Option<VarId> {
        let mut known = self.names.iter().rev().chain(&self.captured);
        if let Some((_, var)) = known.find(|(known, _)| *known == name) {
            return Some(*var);
        }
        let Some(outer) = self.outer.as_mut() else { return self.free_variable(name, at) };
        let theirs = outer.variable(name, at)?;
        outer.vars[theirs.0 as usize].captured.get_or_insert((at, self.kind));
        let ours = VarId(self.vars.len() as u32);
        let span = outer.vars[theirs.0 as usize].span;
        self.vars.push(Var { name, span, assigned: None, captured: None });
        self.captured.push((name, ours));
        self.captures.push((theirs, ours));
        Some(ours)
    }

    fn all_names(&self) -> Vec<Symbol> {
        let mut names: Vec<Symbol> = self.names.iter().map(|(name, _)| *name).collect();
        if let Some(outer) = &self.outer {
            names.extend(outer.all_names());
        }
        names
    }
}

impl Compiler<'_> {
    /// Resolves a form. What is wrong with it goes to the errors.
    pub(crate) fn expr(&mut self, scope: &mut Scope, form: &Form) -> Expr {
        self.depth += 1;
        let expr = if self.depth > MOST_NESTED + 1 {
            self.error(CompileError::TooDeep { limit: MOST_NESTED, at: form.span });
            Expr::nil(form.span)
        } else {
            self.expr_of(scope, form)
        };
        self.depth -= 1;
        expr
    }

    fn expr_of(&mut self, scope: &mut Scope, form: &Form) -> Expr {
        let span = form.span;
        match &form.kind {
            FormKind::Symbol(name) => self.name(scope, *name, span),
            FormKind::Keyword(_) | FormKind::Int(_) | FormKind::Float(_) | FormKind::Str(_) => {
                self.constant(form)
            }
            FormKind::List(items) => match items.split_first() {
                None => Expr::nil(span),
                Some((head, args)) => self.list(scope, form, head, args),
            },
            FormKind::Vector(items) => {
                let items: Vec<Expr> = items.iter().map(|item| self.expr(scope, item)).collect();
                if items.len() <= MOST_IN_A_ROW {
                    return Expr::new(ExprKind::Vector(items), span);
                }
                let list = self.list_of(items.into_iter().map(Some).collect(), span);
                self.native_call("list->vec", vec![Some(list)], span)
            }
            FormKind::Map(pairs) => {
                let parts = pairs.iter().flat_map(|(key, value)| [key, value]);
                let parts: Vec<Expr> = parts.map(|part| self.expr(scope, part)).collect();
                if parts.len() <= MOST_IN_A_ROW {
                    return Expr::new(ExprKind::Map(parts), span);
                }
                let maps = in_rows(parts, |row| Some(Expr::new(ExprKind::Map(row), span)));
                self.in_few("merge", maps, span)
            }
            FormKind::Prefixed(Prefix::Quote, inner) => self.constant(inner),
            FormKind::Prefixed(Prefix::Quasi, inner) => self.quasi(scope, inner, 1),
            FormKind::Prefixed(prefix @ (Prefix::Unquote | Prefix::Splice), _) => {
                self.error(CompileError::Outside {
                    form: prefix.sign().into(),
                    inside: "a quasi-quote".into(),
                    at: span,
                    help: Some("write ` before the form that it is a part of".into()),
                });
                Expr::nil(span)
            }
        }
    }

    /// A form as data.
    pub(crate) fn constant(&mut self, form: &Form) -> Expr {
        Expr::new(ExprKind::Const(to_value(form, &mut Places::default())), form.span)
    }

    /// Several forms in a row.
    pub(crate) fn body(&mut self, scope: &mut Scope, forms: &[Form]) -> Vec<Expr> {
        forms.iter().map(|form| self.expr(scope, form)).collect()
    }

    // ------------------------------------------------------------------ names

    fn name(&mut self, scope: &mut Scope, name: Symbol, span: Span) -> Expr {
        let constant = |value| Expr::new(ExprKind::Const(value), span);
        match name.as_str() {
            "nil" => return constant(Value::NIL),
            "true" => return constant(Value::TRUE),
            "false" => return constant(Value::FALSE),
            _ => {}
        }
        if let Some(var) = scope.variable(name, span) {
            return self.read(Expr::new(ExprKind::Var(var), span));
        }
        match self.meaning(scope, name, span) {
            Some(Meaning::Const(global)) => {
                self.mention_constant(global);
                self.read(Expr::new(ExprKind::Global(global), span))
            }
            Some(Meaning::Function(f, _) | Meaning::Plan(f, _) | Meaning::Open(f, _)) => {
                self.mention(f);
                constant(Value::Imm(vm::value::Imm::Function(f)))
            }
            Some(Meaning::Native(native, _)) => constant(Value::Imm(vm::value::Imm::Native(native))),
            Some(other) => {
                self.wrong_kind(name, &other, "a value", span);
                Expr::nil(span)
            }
            None => Expr::nil(span),
        }
    }

    /// What a name means in a module, or else where the macros around it are defined.
    pub(crate) fn look_up(&self, module: ModuleId, name: Symbol) -> Found {
        match self.modules.look_up(module, name) {
            Found::None => {
                let mut found = self.within.iter().rev().map(|home| self.modules.look_up(*home, name));
                found.find(|found| !matches!(found, Found::None)).unwrap_or(Found::None)
            }
            found => found,
        }
    }

    /// What a name means at the top level, or an error that says it means nothing.
    pub(crate) fn meaning(&mut self, scope: &Scope, name: Symbol, at: Span) -> Option<Meaning> {
        match self.look_up(scope.module, name) {
            Found::One(definition) => Some(definition.meaning),
            Found::Two(one, other) => {
                self.error(CompileError::Ambiguous { name: name.to_string(), one, other, at });
                None
            }
            Found::None => {
                self.unknown_name(scope, name, at);
                None
            }
        }
    }

    fn unknown_name(&mut self, scope: &Scope, name: Symbol, at: Span) {
        if self.reports.len() >= MOST_HELPED {
            return self.error(CompileError::UnknownName { name: name.to_string(), at, help: None });
        }
        let visible = self.modules.visible(scope.module);
        let visible = visible.iter().filter(|name| predicate_key(**name).is_none());
        let locals = scope.all_names();
        let candidates = locals.iter().chain(visible).map(|it| it.as_str());
        let near = nearest(&name, candidates.chain(special::NAMES.iter().copied()));
        let form = special::SHAPES.iter().find(|(known, _)| name == *known);
        let arities = self.arities(scope.module, name);
        if let Some(arity) = arities.first() {
            let args = if *arity > 0 { " …" } else { "" };
            let help = Some(format!(
                "ask it: (ask ({name}{args})) says whether it holds, (answers ?x ({name}{args})) gives the answers"
            ));
            let (name, is, wanted) = (name.to_string(), "a predicate".into(), "a value or a function".into());
            return self.error(CompileError::WrongKind { name, is, wanted, at, help });
        }
        let help = match near {
            _ if name == "." => Some("outside of rules and quoted data (a . b) is written (cons a b)".into()),
            _ if goal::shape(&name).is_some() => {
                Some(format!("it is a goal of rules and queries: {}", goal::shape(&name).unwrap_or_default()))
            }
            _ if form.is_some() => form.map(|(_, shape)| format!("it is the head of a form: {shape}")),
            Some(near) => Some(format!("did you mean `{near}`?")),
            None if name.starts_with('?') => {
                Some(format!("bind `{name}`, for example with `let` or `dolist`"))
            }
            None => self.elsewhere(name),
        };
        self.error(CompileError::UnknownName { name: name.to_string(), at, help });
    }

    /// A module that defines the name and could be used.
    fn elsewhere(&self, name: Symbol) -> Option<String> {
        if crate::module::is_private(name) {
            return None;
        }
        let module = self.modules.iter().find(|(_, module)| module.names.contains_key(&name))?.1;
        Some(format!("the module `{}` defines it: write (use {})", module.name, module.name))
    }

    pub(crate) fn wrong_kind(&mut self, name: Symbol, is: &Meaning, wanted: &str, at: Span) {
        let help = match is {
            Meaning::Macro(..) => Some("a macro can only be called; wrap the call in a `lambda`".into()),
            Meaning::Failure(_) => Some(format!("write `'{name}` for the name as a symbol")),
            _ => None,
        };
        let (name, is, wanted) = (name.to_string(), is.words().to_string(), wanted.to_string());
        self.error(CompileError::WrongKind { name, is, wanted, at, help });
    }

    // ------------------------------------------------------------------ calls

    fn list(&mut self, scope: &mut Scope, form: &Form, head: &Form, args: &[Form]) -> Expr {
        let value = ["nil", "true", "false"].into_iter().find(|name| head.is(name));
        if value.is_some() && self.reports.iter().any(|report| matches!(report, crate::Report::Parse(_))) {
            // nil stands for what could not be read, and that has been said.
            return Expr::nil(form.span);
        }
        if let Some(name) = head.symbol().filter(|_| value.is_none()) {
            if scope.variable(name, head.span).is_none() {
                if let Some(special) = special::find(&name) {
                    return special(self, scope, form, args);
                }
                return self.named_call(scope, form, name, head.span, args);
            }
        } else if !matches!(head.kind, FormKind::List(_)) {
            let what = vm::print::brief(&to_value(head, &mut Places::default()));
            self.error(CompileError::NotCallable { what: format!("`{what}`"), at: head.span });
            return Expr::nil(form.span);
        }
        let callee = self.expr(scope, head);
        let args = args.iter().map(|arg| Some(self.expr(scope, arg))).collect();
        Expr::new(ExprKind::Call(Callee::Value(Box::new(callee)), args), form.span)
    }

    fn named_call(&mut self, scope: &mut Scope, form: &Form, name: Symbol, at: Span, args: &[Form]) -> Expr {
        let Some(meaning) = self.meaning(scope, name, at) else {
            // The arguments may have mistakes of their own; those of a misspelled form mean something else.
            if nearest(&name, special::NAMES.iter().copied()).is_none() {
                self.body(scope, args);
            }
            return Expr::nil(form.span);
        };
        match meaning {
            Meaning::Macro(function, params) => match self.expand(name, function, &params, form) {
                Some(expansion) => {
                    let home = self.home(function).unwrap_or(scope.module);
                    self.within.push(home);
                    let expr = self.expr(scope, &expansion);
                    self.within.pop();
                    expr
                }
                None => Expr::nil(form.span),
            },
            Meaning::Function(f, params) | Meaning::Open(f, params) => {
                self.mention(f);
                self.call(scope, Callee::Function(f), name, &params, form.span, args)
            }
            Meaning::Plan(f, params) => {
                self.mention(f);
                self.call(scope, Callee::Plan(f), name, &params, form.span, args)
            }
            Meaning::Native(native, params) => {
                let given = args.len();
                let args: Vec<Option<Expr>> = args.iter().map(|arg| Some(self.expr(scope, arg))).collect();
                if !accepts(&params, given) {
                    self.arity(name, &params, given, form.span);
                }
                if given > MOST_IN_A_ROW && self.program.natives[native.at()].name == "list" {
                    return self.list_of(args, form.span);
                }
                Expr::new(ExprKind::Call(Callee::Native(native), args), form.span)
            }
            Meaning::Const(global) => {
                self.mention_constant(global);
                let callee = Expr::new(ExprKind::Global(global), at);
                let args = args.iter().map(|arg| Some(self.expr(scope, arg))).collect();
                Expr::new(ExprKind::Call(Callee::Value(Box::new(callee)), args), form.span)
            }
            other @ (Meaning::Failure(_) | Meaning::Test(_) | Meaning::Predicate(..)) => {
                self.wrong_kind(name, &other, "a function", at);
                Expr::nil(form.span)
            }
        }
    }

    pub(crate) fn arity(&mut self, name: Symbol, params: &vm::code::Params, got: usize, at: Span) {
        let help =
            (!params.names.is_empty()).then(|| format!("its parameters are {}", crate::show_params(params)));
        let takes = vm::machine::takes(params);
        self.error(CompileError::Arity { name: name.to_string(), takes, got, at, help });
    }

    /// A call of a function of the program, with its arguments in the order of the parameters.
    fn call(
        &mut self,
        scope: &mut Scope,
        callee: Callee,
        name: Symbol,
        params: &vm::code::Params,
        span: Span,
        args: &[Form],
    ) -> Expr {
        let (required, optional) = (params.required as usize, params.optional as usize);
        if args.len() < required || (args.len() > required + optional && params.keys == 0 && !params.rest) {
            self.arity(name, params, args.len(), span);
            self.body(scope, args);
            return Expr::nil(span);
        }
        let positional = args.len().min(required + optional);
        let (first, more) = args.split_at(positional);
        if params.keys > 0 && more.chunks(2).any(|pair| !matches!(pair[0].kind, FormKind::Keyword(_))) {
            return self.late_call(scope, callee, span, args);
        }
        let mut given: Vec<Option<Expr>> = first.iter().map(|arg| Some(self.expr(scope, arg))).collect();
        given.resize(required + optional, None);
        let mut values: Vec<Option<Expr>> = more.iter().map(|arg| Some(self.expr(scope, arg))).collect();
        let mut parts = Vec::new();
        if params.keys > 0 && (params.rest || !in_order(params.key_names(), more)) {
            // Arguments are computed once, in the order in which they are written.
            for value in given.iter_mut().chain(&mut values).flatten() {
                self.name_it(scope, value, &mut parts);
            }
        }
        if params.keys > 0 {
            given.extend(self.keyword_args(name, params, span, more, &values));
        }
        if params.rest {
            given.push(Some(self.list_of(values, span)));
        }
        let call = Expr::new(ExprKind::Call(callee, given), span);
        match parts.is_empty() {
            true => call,
            false => Expr::new(ExprKind::Let(parts, vec![call]), span),
        }
    }

    /// Puts a variable in the place of an expression, which is computed before.
    fn name_it(&mut self, scope: &mut Scope, expr: &mut Expr, parts: &mut Vec<(VarId, Expr)>) {
        if !matches!(expr.kind, ExprKind::Const(_)) {
            let var = scope.hidden(expr.span);
            let named = Expr::new(ExprKind::Var(var), expr.span);
            parts.push((var, std::mem::replace(expr, named)));
        }
    }

    /// Keywords that are not written out: the arguments are arranged when the call is made.
    fn late_call(&mut self, scope: &mut Scope, callee: Callee, span: Span, args: &[Form]) -> Expr {
        let (Callee::Function(f) | Callee::Plan(f)) = callee else { return Expr::nil(span) };
        let callee = Expr::new(ExprKind::Const(Value::Imm(vm::value::Imm::Function(f))), span);
        let args = args.iter().map(|arg| Some(self.expr(scope, arg))).collect();
        Expr::new(ExprKind::Call(Callee::Value(Box::new(callee)), args), span)
    }

    /// The values for the keyword parameters, in their order.
    fn keyword_args(
        &mut self,
        name: Symbol,
        params: &vm::code::Params,
        span: Span,
        args: &[Form],
        values: &[Option<Expr>],
    ) -> Vec<Option<Expr>> {
        let names = params.key_names();
        let mut given: Vec<Option<Expr>> = vec![None; names.len()];
        for (i, pair) in args.chunks(2).enumerate() {
            let FormKind::Keyword(key) = pair[0].kind else { continue };
            let Some(value) = values.get(2 * i + 1) else {
                let problem = format!("has `:{key}` without a value");
                let shape = format!("({name} … :{key} value)");
                self.error(CompileError::Shape { form: name.to_string(), problem, shape, at: pair[0].span });
                continue;
            };
            match names.iter().position(|known| *known == key) {
                Some(at) if given[at].is_none() => given[at] = value.clone(),
                Some(_) => {
                    let (again, first) = (pair[0].span, first_of(key, &args[..2 * i]).unwrap_or(span));
                    self.error(CompileError::BoundTwice { name: format!(":{key}"), again, first });
                }
                None if params.rest => {}
                None => {
                    let known: Vec<String> = names.iter().map(|name| format!(":{name}")).collect();
                    let near = nearest(&key, names.iter().map(|name| name.as_str()));
                    let help = match near {
                        Some(near) => format!("did you mean `:{near}`?"),
                        None => format!("it has {}", known.join(", ")),
                    };
                    let (name, key, at) = (name.to_string(), key.to_string(), pair[0].span);
                    self.error(CompileError::UnknownKeyword { name, key, at, help: Some(help) });
                }
            }
        }
        given
    }

    /// `(list a b)` with the library's native.
    pub(crate) fn list_of(&mut self, items: Vec<Option<Expr>>, span: Span) -> Expr {
        if items.is_empty() {
            return Expr::nil(span);
        }
        if items.len() <= MOST_IN_A_ROW {
            return self.native_call("list", items, span);
        }
        let lists = in_rows(items, |row| Some(self.native_call("list", row, span)));
        self.in_few("append", lists, span)
    }

    /// A call of a native that puts its arguments together, however many there are.
    fn in_few(&mut self, name: &str, mut parts: Vec<Option<Expr>>, span: Span) -> Expr {
        while parts.len() > MOST_IN_A_ROW {
            parts = in_rows(parts, |row| Some(self.native_call(name, row, span)));
        }
        self.native_call(name, parts, span)
    }

    /// A call of a native that the compiler itself needs.
    pub(crate) fn native_call(&mut self, name: &str, args: Vec<Option<Expr>>, span: Span) -> Expr {
        match self.program.native(name) {
            Some(native) => Expr::new(ExprKind::Call(Callee::Native(native), args), span),
            None => {
                self.error(CompileError::NoSuchNative { name: name.into(), at: span });
                Expr::nil(span)
            }
        }
    }

    // ------------------------------------------------------------------ functions

    /// Resolves a function with its parameters.
    pub(crate) fn function(
        &mut self,
        scope: Scope,
        name: Symbol,
        params: &ParamForms,
        body: &[Form],
        span: Span,
    ) -> Function {
        let module = scope.module;
        self.function_in(scope, module, name, params, body, span)
    }

    /// The same, where the body means what it means in another module than the parameters.
    pub(crate) fn function_in(
        &mut self,
        mut scope: Scope,
        module: ModuleId,
        name: Symbol,
        params: &ParamForms,
        body: &[Form],
        span: Span,
    ) -> Function {
        let (inputs, destructured) = self.bind_params(&mut scope, params);
        scope.module = module;
        let mut body = self.body(&mut scope, body);
        if !destructured.is_empty() {
            let inner = std::mem::take(&mut body);
            body = vec![Expr::new(ExprKind::Let(destructured, inner), span)];
        }
        self.finish_function(scope, name, params.params.clone(), inputs, body, span)
    }

    pub(crate) fn finish_function(
        &mut self,
        scope: Scope,
        name: Symbol,
        params: vm::code::Params,
        inputs: Vec<(VarId, Option<Expr>)>,
        body: Vec<Expr>,
        span: Span,
    ) -> Function {
        for var in &scope.vars {
            if let (Some(at), Some((captured, by))) = (var.assigned, var.captured) {
                let by =
                    if by == FnKind::Branch { "a branch of a parallel form" } else { "a function inside" };
                self.error(CompileError::SetCaptured { name: var.name.to_string(), by, at, captured });
            }
        }
        Function {
            name,
            kind: scope.kind,
            params,
            inputs,
            captures: scope.captures,
            vars: scope.vars,
            body,
            span,
        }
    }

    /// A function inside another one. Gives the scope of the other one back.
    pub(crate) fn lambda(
        &mut self,
        scope: &mut Scope,
        params: &ParamForms,
        body: &[Form],
        span: Span,
    ) -> Function {
        self.inner_function(scope, FnKind::Lambda, params, body, span)
    }

    /// A function inside of another one: a lambda, or a branch.
    fn inner_function(
        &mut self,
        scope: &mut Scope,
        kind: FnKind,
        params: &ParamForms,
        body: &[Form],
        span: Span,
    ) -> Function {
        let placeholder = Scope::new(scope.module, scope.kind);
        let outer = std::mem::replace(scope, placeholder);
        let mut inner =
            Scope::new(outer.module, kind).with_original(kind == FnKind::Branch && outer.original);
        inner.outer = Some(Box::new(outer));
        let (inputs, destructured) = self.bind_params(&mut inner, params);
        let mut body = self.body(&mut inner, body);
        if !destructured.is_empty() {
            let parts = std::mem::take(&mut body);
            body = vec![Expr::new(ExprKind::Let(destructured, parts), span)];
        }
        *scope = *inner.outer.take().unwrap_or_else(|| Box::new(Scope::new(inner.module, FnKind::Lambda)));
        self.finish_function(inner, Symbol::from("lambda"), params.params.clone(), inputs, body, span)
    }

    /// Keeps the AST of a function for those who walk it.
    pub(crate) fn keep(&mut self, id: vm::code::FnId, function: &Function) {
        if self.keep_ast {
            self.functions.insert(id, Rc::new(function.clone()));
        }
    }
}

/// True if keyword arguments are written in the order of the parameters.
fn in_order(names: &[Symbol], pairs: &[Form]) -> bool {
    let places = pairs.iter().step_by(2).map(|form| match form.kind {
        FormKind::Keyword(key) => names.iter().position(|name| *name == key),
        _ => None,
    });
    places.is_sorted()
}

/// Where a keyword stands among keywords and values.
fn first_of(key: Symbol, pairs: &[Form]) -> Option<Span> {
    let mut keys = pairs.iter().step_by(2);
    keys.find(|form| matches!(form.kind, FormKind::Keyword(known) if known == key)).map(|form| form.span)
}

/// How many values may be made side by side before they are put together: each takes a register.
const MOST_IN_A_ROW: usize = 100;

/// One expression for each row of at most [`MOST_IN_A_ROW`] items.
fn in_rows<T>(items: Vec<T>, row_of: impl FnMut(Vec<T>) -> Option<Expr>) -> Vec<Option<Expr>> {
    let mut items = items.into_iter();
    let rows = std::iter::from_fn(|| {
        let row: Vec<T> = items.by_ref().take(MOST_IN_A_ROW).collect();
        (!row.is_empty()).then_some(row)
    });
    rows.map(row_of).collect()
}

/// True if a call with `n` arguments fits, as far as their number goes.
pub(crate) fn accepts(params: &vm::code::Params, n: usize) -> bool {
    let most = params.required as usize + params.optional as usize + 2 * params.keys as usize;
    n >= params.required as usize && (params.rest || n <= most)
}
