//! What rules compute: numbers, expressions, calls of functions.
//!
//! `+ - * /` are rule code. Every other expression becomes a function of the variables in it, which
//! is called before the goal that needs its value.

use grammar::{Form, FormKind, Prefix, Span};
use vm::code::{FnId, FnKind, Params};
use vm::rules::clause::{Compare, Goal, GoalKind, Number, Term};
use vm::value::{Imm, Symbol, Value};

use super::goal::{arithmetic, row};
use super::{Rule, place};
use crate::Compiler;
use crate::ast::{Callee, Expr, ExprKind, Function, Var, VarId};
use crate::data::MOST_NESTED;
use crate::error::CompileError;
use crate::module::{Found, Meaning};
use crate::resolve::{Scope, accepts};

/// A function that a rule calls: it must be pure, which is looked at when it has been compiled.
pub(crate) struct Called {
    pub(super) function: FnId,
    pub(super) name: Symbol,
    pub(super) at: Span,
}

impl Compiler<'_> {
    pub(super) fn comparison(
        &mut self,
        rule: &mut Rule,
        form: &Form,
        args: &[Form],
        how: Compare,
    ) -> Option<GoalKind> {
        let [a, b] = args else { return None };
        let mut goals = Vec::new();
        let a = self.number(rule, a, &mut goals);
        let b = self.number(rule, b, &mut goals);
        goals.push(Goal { kind: GoalKind::Compare(how, a, b), place: place(form.span) });
        Some(row(goals))
    }

    /// `(is ?x expression)`
    pub(super) fn is_goal(&mut self, rule: &mut Rule, form: &Form, args: &[Form]) -> Option<GoalKind> {
        let [result, expression] = args else { return None };
        let result = self.term(rule, result);
        let is_name = |name: &str| expression.is(name);
        match &expression.kind {
            FormKind::Str(_) | FormKind::Keyword(_) | FormKind::Prefixed(Prefix::Quote, _) => {
                let value = self.term(rule, expression);
                return Some(GoalKind::Unify(result, value));
            }
            FormKind::Symbol(_) if ["nil", "true", "false"].into_iter().any(is_name) => {
                let value = self.term(rule, expression);
                return Some(GoalKind::Unify(result, value));
            }
            _ => {}
        }
        if self.is_number(rule, expression) {
            let mut goals = Vec::new();
            let number = self.number(rule, expression, &mut goals);
            goals.push(Goal { kind: GoalKind::Is(result, number), place: place(form.span) });
            return Some(row(goals));
        }
        let (function, args) = self.expression(rule, expression);
        Some(GoalKind::Fun(function, args, result))
    }

    /// True for what rule code computes itself.
    fn is_number(&self, rule: &Rule, form: &Form) -> bool {
        match &form.kind {
            FormKind::Int(_) | FormKind::Float(_) => true,
            FormKind::Symbol(name) => name.starts_with('?'),
            FormKind::List(_) => form.head().is_some_and(|head| self.is_arithmetic(rule, head)),
            _ => false,
        }
    }

    /// True for a sign that has its meaning of the library here.
    fn is_arithmetic(&self, rule: &Rule, head: Symbol) -> bool {
        let native = |meaning: &Meaning| match meaning {
            Meaning::Native(native, _) => self.program.natives[native.at()].name == head.as_str(),
            _ => false,
        };
        arithmetic(&head).is_some()
            && matches!(self.look_up(rule.module, head), Found::One(definition) if native(&definition.meaning))
    }

    /// A number; what rule code cannot compute is computed by goals `before`.
    fn number(&mut self, rule: &mut Rule, form: &Form, before: &mut Vec<Goal>) -> Number {
        self.depth += 1;
        let number = if self.depth > MOST_NESTED + 1 {
            self.error(CompileError::TooDeep { limit: MOST_NESTED, at: form.span });
            Number::Term(Term::Any)
        } else {
            self.number_of(rule, form, before)
        };
        self.depth -= 1;
        number
    }

    fn number_of(&mut self, rule: &mut Rule, form: &Form, before: &mut Vec<Goal>) -> Number {
        match &form.kind {
            FormKind::Int(i) => return constant(*i),
            FormKind::Float(f) => return Number::Term(Term::Const(Value::float(*f))),
            FormKind::Symbol(name) if name == "?_" => {
                let help = Some("name the variable: its value is needed");
                return Number::Term(self.no_term("`?_` has no value", form.span, help));
            }
            FormKind::Symbol(name) if name.starts_with('?') => {
                return Number::Term(Term::Var(self.variable(rule, *name, form.span)));
            }
            FormKind::List(items) if self.is_number(rule, form) => {
                return self.arithmetic_of(rule, items, before);
            }
            _ => {}
        }
        let (function, args) = self.expression(rule, form);
        let value = Term::Var(rule.hidden(form.span));
        let kind = GoalKind::Fun(function, args, value.clone());
        before.push(Goal { kind, place: place(form.span) });
        Number::Term(value)
    }

    /// `(+ a b c)` as `(+ (+ a b) c)`; what there is without operands and with one is as in plans.
    fn arithmetic_of(&mut self, rule: &mut Rule, items: &[Form], before: &mut Vec<Goal>) -> Number {
        let head = items[0].symbol().unwrap_or_default();
        let Some(sign) = arithmetic(&head) else { return constant(0) };
        if items.len() > MOST_NESTED {
            // It becomes as deep as it is long.
            let problem = format!("a sum or product has more than {MOST_NESTED} parts");
            return Number::Term(self.no_term(problem, items[0].span, None));
        }
        let numbers: Vec<Number> = items[1..].iter().map(|item| self.number(rule, item, before)).collect();
        let is_sum = matches!(head.as_str(), "+" | "-");
        let mut numbers = numbers.into_iter();
        let Some(first) = numbers.next() else {
            if matches!(head.as_str(), "-" | "/") {
                let (name, shape) = (head.to_string(), format!("({head} a b)"));
                let problem = "has no operands".into();
                self.error(CompileError::Shape { form: name, problem, shape, at: items[0].span });
            }
            return constant(if is_sum { 0 } else { 1 });
        };
        let op = |sign, a, b| Number::Op(sign, Box::new(a), Box::new(b));
        let Some(second) = numbers.next() else {
            return match head.as_str() {
                "-" => op(vm::rules::clause::Arith::Mul, constant(-1), first),
                "/" => op(sign, constant(1), first),
                _ => first,
            };
        };
        numbers.fold(op(sign, first, second), |sum, next| op(sign, sum, next))
    }

    // ------------------------------------------------------------------ functions

    /// An expression as a function of its variables, with these as arguments.
    fn expression(&mut self, rule: &mut Rule, form: &Form) -> (FnId, Vec<Term>) {
        let around = (std::mem::take(&mut self.mentioned), self.reads_fluents.take());
        let mut scope = Scope::new(rule.module, FnKind::Function).of_rule();
        let body = self.expr(&mut scope, form);
        let free = scope.take_free();
        let name = Symbol::from(&shown(form));
        let params = Params {
            names: free.iter().map(|(name, _)| *name).collect(),
            required: free.len() as u8,
            ..Params::default()
        };
        let inputs = free.iter().map(|(_, var)| (*var, None)).collect();
        let function = self.finish_function(scope, name, params, inputs, vec![body], form.span);
        let id = self.add_function(rule, &function);
        let mentioned;
        (mentioned, self.reads_fluents) = (std::mem::replace(&mut self.mentioned, around.0), around.1);
        self.references.insert(id, mentioned);
        self.mention(id);
        self.called.push(Called { function: id, name, at: form.span });
        (id, free.iter().map(|(name, _)| Term::Var(self.variable(rule, *name, form.span))).collect())
    }

    fn add_function(&mut self, rule: &Rule, function: &Function) -> FnId {
        let id = self.declare(function.name, FnKind::Function, rule.module);
        self.lower(id, function);
        id
    }

    /// `(fun function argument … ?result)`
    pub(super) fn fun_goal(&mut self, rule: &mut Rule, form: &Form, args: &[Form]) -> Option<GoalKind> {
        let [name, args @ .., result] = args else { return None };
        let args_given = self.terms(rule, args);
        let result = self.term(rule, result);
        let Some(symbol) = name.symbol() else {
            let what = format!("`{}`", shown(name));
            let help =
                Some("after `fun` stands the name of a function; `(is ?x expression)` computes".into());
            self.error(CompileError::NotAGoal { what, at: name.span, help });
            return Some(GoalKind::True);
        };
        let function = self.function_for(rule, symbol, args.len(), name.span, form.span)?;
        self.mention(function);
        self.called.push(Called { function, name: symbol, at: name.span });
        Some(GoalKind::Fun(function, args_given, result))
    }

    /// A function of the program that does with `n` arguments what the one of this name does.
    fn function_for(&mut self, rule: &Rule, name: Symbol, n: usize, at: Span, goal: Span) -> Option<FnId> {
        let known = self.look_up(rule.module, name);
        if matches!(known, Found::None) && !self.arities(rule.module, name).is_empty() {
            let (name, is, wanted) = (name.to_string(), "a predicate".to_string(), "a function".to_string());
            let help = Some(format!("a predicate is a goal itself: ({name} …)"));
            self.error(CompileError::WrongKind { name, is, wanted, at, help });
            return Some(FnId(0));
        }
        let scope = Scope::new(rule.module, FnKind::Function);
        let Some(meaning) = self.meaning(&scope, name, at) else { return Some(FnId(0)) };
        let callee = match &meaning {
            Meaning::Function(f, params) | Meaning::Open(f, params) if params.is_plain(n) => return Some(*f),
            Meaning::Function(f, _) | Meaning::Open(f, _) => {
                self.mention(*f);
                ExprKind::Const(Value::Imm(Imm::Function(*f)))
            }
            Meaning::Native(native, _) => ExprKind::Const(Value::Imm(Imm::Native(*native))),
            Meaning::Const(global) => {
                self.mention_constant(*global);
                ExprKind::Global(*global)
            }
            Meaning::Plan(..) => {
                let what = format!("the plan `{name}`");
                let help = Some("only functions that compute can be called in rules".into());
                self.error(CompileError::PlanForm { what, at, help });
                return Some(FnId(0));
            }
            other => {
                self.wrong_kind(name, other, "a function", at);
                return Some(FnId(0));
            }
        };
        if let Some(params) = meaning.params().filter(|params| !accepts(params, n)) {
            self.arity(name, params, n, goal);
            return Some(FnId(0));
        }
        let callee = match callee {
            ExprKind::Const(Value::Imm(Imm::Native(native))) => Callee::Native(native),
            kind => Callee::Value(Box::new(Expr::new(kind, at))),
        };
        Some(self.add_function(rule, &calling(name, callee, n, at)))
    }
}

/// A function of `n` parameters that hands them on.
fn calling(name: Symbol, callee: Callee, n: usize, span: Span) -> Function {
    let names: Vec<Symbol> = (0..n).map(|at| Symbol::from(&format!("?{at}"))).collect();
    let vars: Vec<VarId> = (0..n as u32).map(VarId).collect();
    let args = vars.iter().map(|var| Some(Expr::new(ExprKind::Var(*var), span))).collect();
    Function {
        name,
        kind: FnKind::Function,
        vars: names.iter().map(|name| Var { name: *name, span, assigned: None, captured: None }).collect(),
        params: Params { names, required: n as u8, ..Params::default() },
        inputs: vars.iter().map(|var| (*var, None)).collect(),
        captures: Vec::new(),
        body: vec![Expr::new(ExprKind::Call(callee, args), span)],
        span,
    }
}

fn constant(i: i64) -> Number {
    Number::Term(Term::Const(Value::int(i)))
}

/// A form on one line, cut off where it is long: the name of the function that it becomes.
fn shown(form: &Form) -> String {
    const LONGEST: usize = 100;
    let text = form.to_string();
    match text.char_indices().nth(LONGEST) {
        Some((at, _)) => format!("{}…", &text[..at]),
        None => text,
    }
}
