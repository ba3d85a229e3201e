//! Special forms: one table of names, one function each.

use grammar::{Form, FormKind, Span};
use vm::desc::Match;
use vm::machine::ForkKind;
use vm::path::{Path, PathStep};
use vm::value::{Obj, Symbol, Value};

use super::{Around, Scope, queries};
use crate::Compiler;
use crate::ast::{Callee, Clause, Expr, ExprKind, VarId};
use crate::data::{MOST_NESTED, Places, to_value};
use crate::error::CompileError;
use crate::module::{Found, Meaning, nearest};

/// Resolves a special form from its arguments.
type Special = fn(&mut Compiler<'_>, &mut Scope, &Form, &[Form]) -> Expr;

macro_rules! specials {
    ($($name:literal $shape:literal $doc:literal => $function:expr;)+) => {
        /// The names of all special forms.
        pub(crate) const NAMES: &[&str] = &[$($name),+];
        /// How each special form is written.
        pub(crate) const SHAPES: &[(&str, &str)] = &[$(($name, $shape)),+];
        /// What each special form does, in a sentence or two.
        pub(crate) const DOCS: &[(&str, &str)] = &[$(($name, $doc)),+];
        /// The special form of this name.
        pub(super) fn find(name: &str) -> Option<Special> {
            match name { $($name => Some($function),)+ _ => None }
        }
    };
}

specials! {
    "quote" "(quote form) or 'form"
        "The form as data, not computed." => quote;
    "quasiquote" "(quasiquote form) or `form"
        "The form as data, in which `,form` is computed and `,@form` puts the elements of a list." => quasiquote;
    "seq" "(seq form …)"
        "Computes the forms one after another; the value of the last." => seq;
    "let" "(let ((name value) …) body…)"
        "Computes the body with new variables; no value sees the other names." => let_;
    "let*" "(let* ((name value) …) body…)"
        "As `let`, but each value sees the names before it." => let_star;
    "set!" "(set! name value)"
        "Gives a local variable another value. One that a function or a branch has captured keeps its value." => set;
    "lambda" "(lambda (params…) body…)"
        "A function without a name." => lambda;
    "if" "(if test then else)"
        "The value of one of two forms, by a test; nil and false are false." => if_;
    "when" "(when test body…)"
        "The body if the test is true, else nil." => when;
    "unless" "(unless test body…)"
        "The body if the test is false, else nil." => unless;
    "cond" "(cond (test body…) … (true body…))"
        "The body behind the first test that is true, else nil." => cond;
    "case" "(case value (key body…) ((key key) body…) (otherwise body…))"
        "The body behind the key that is equal to the value; keys are data." => case;
    "and" "(and form …)"
        "The first form that is false, else the last; the rest is not computed." => and;
    "or" "(or form …)"
        "The first form that is true, else the last; the rest is not computed." => or;
    "while" "(while test body…)"
        "Repeats the body while the test is true." => while_;
    "loop" "(loop body…)"
        "Repeats the body until `return` leaves it." => loop_;
    "dolist" "(dolist (name list) body…)"
        "The body for each element of a list, vector, map or string." => dolist;
    "dotimes" "(dotimes (name count) body…)"
        "The body for each number from 0 to below a count." => dotimes;
    "return" "(return value)"
        "Leaves the innermost loop, or the clause of a handler, with a value." => return_;
    "perform" "(perform description :goal expression)"
        "Does an action or motion, as a task, by the plan that `ground` gives for its description." => perform;
    "a" "(a location (key value) …)"
        "A description of an action, motion, location or object; `?x` and `,form` in it are computed." => describe;
    "an" "(an object (key value) …)"
        "As `a`." => describe;
    "matches" "(matches pattern value)"
        "What the variables of a pattern stand for, as a map, if the description has at least what the pattern has; else nil." => |it, scope, form, args| it.matching(scope, Match::Open, form, args);
    "==" "(== pattern value)"
        "As `matches`, for a description with the same keys." => |it, scope, form, args| it.matching(scope, Match::Closed, form, args);
    "with-failure-handling" "(with-failure-handling ((type (e) body…) …) body…)"
        "Computes the body; a failure of it goes to the first clause for its type, when all that the body began has ended. A clause that falls off its end lets the failure pass." => handle;
    "retry" "(retry)"
        "In a clause: begins the body again." => retry;
    "propagate" "(propagate)"
        "In a clause: lets the failure pass." => propagate;
    "fail" "(fail type :field value …)"
        "Raises a failure; in a clause with the handled one as its cause." => fail;
    "make-failure" "(make-failure type :field value …)"
        "A failure as a value, not raised." => make_failure;
    "unwind-protect" "(unwind-protect body clean-up…)"
        "Computes the body, then the clean-up, whether the body succeeded, failed or was stopped." => protect;
    "with-retry-counters" "(with-retry-counters ((name count) …) body…)"
        "Computes the body with counters for `do-retry`." => counters;
    "do-retry" "(do-retry counter body…)"
        "Computes the body, mostly `(retry)`, and counts down; nothing when the counter is at 0." => do_retry;
    "par" "(par form …)"
        "All forms at once, as tasks. The list of their values when all have succeeded; the first failure stops the others. `(:tag name form)` names a task." => |it, scope, form, args| it.parallel(scope, ForkKind::Par, form, args);
    "par-loop" "(par-loop (name list) body…)"
        "The body for all elements at once, as tasks; ends as `par`." => |it, scope, form, args| it.parallel_loop(scope, ForkKind::ParLoop, form, args);
    "pursue" "(pursue form …)"
        "All forms at once, as tasks. Ends as the first one does, and stops the others. `(:tag name form)` names a task." => |it, scope, form, args| it.parallel(scope, ForkKind::Pursue, form, args);
    "try-all" "(try-all form …)"
        "All forms at once, as tasks. The first success stops the others; `composite-failure` if all fail." => |it, scope, form, args| it.parallel(scope, ForkKind::TryAll, form, args);
    "try-in-order" "(try-in-order form …)"
        "The forms one after another until one succeeds; `composite-failure` if all fail." => |it, scope, form, args| it.parallel(scope, ForkKind::TryInOrder, form, args);
    "try-each" "(try-each (name list) body…)"
        "The body for one element after another until it succeeds; `composite-failure` if it fails for all." => |it, scope, form, args| it.parallel_loop(scope, ForkKind::TryEach, form, args);
    "partial-order" "(partial-order ((:tag name form) …) (:order name name) …)"
        "The steps at once, as tasks, as far as the orders allow: each begins when those before it have succeeded. Ends as `par`." => |it, scope, form, args| it.partial_order(scope, form, args);
    "with-timeout" "(with-timeout seconds body…)"
        "The body; when so many seconds are over it is stopped, and the failure is `timeout`." => |it, scope, form, args| it.with_timeout(scope, form, args);
    "fl" "(fl expression)"
        "A fluent of an expression in which fluents stand for what they hold: computed again when one of them changes." => |it, scope, form, args| it.derived_fluent(scope, form, args);
    "fl-world" "(fl-world goal)"
        "A fluent of whether a goal of rules about the world holds: asked again whenever the world changes." => |it, scope, form, args| it.world_fluent(scope, form, args);
    "ask" "(ask goal)"
        "Whether the goal of rules holds." => queries::ask;
    "answers" "(answers template goal)"
        "The template with the variables of each answer of the goal, as a list." => queries::answers;
    "query" "(query goal)"
        "The answers of the goal as a stream: each is looked for when somebody looks." => queries::query;
    "for-each-answer" "(for-each-answer (?x …) goal body…)"
        "Does the body for each answer, its variables bound." => queries::for_each_answer;
    "with-facts" "(with-facts ((predicate argument …) …) body…)"
        "Queries in the body see these facts as well." => queries::with_facts;
    "path" "(path name (name :call n) …)"
        "A place in a task tree, as data." => path;
    "original" "(original)"
        "In the code of an edit: what the edit has replaced or wrapped." => original;
    "expect" "(expect expression)"
        "In a test: fails unless the expression is true." => expect;
    "expect-failure" "(expect-failure type body…)"
        "In a test: fails unless the body fails with this type." => expect_failure;
    "module" "(module name \"doc\")"
        "Names the module of a file." => not_at_top;
    "use" "(use name … :as prefix :only (names…))"
        "Makes the names of other modules known." => not_at_top;
    "def-fun" "(def-fun name (params…) \"doc\" body…)"
        "Defines a function." => not_at_top;
    "def-plan" "(def-plan name (params…) \"doc\" body…)"
        "Defines a plan: a function whose calls are tasks of the tree." => not_at_top;
    "def-variant" "(def-variant name (:of plan) \"doc\" (places place…) (between n path…)… edit…)"
        "Defines a plan with the parameters of another one that calls that with edits." => not_at_top;
    "def-const" "(def-const name value \"doc\")"
        "Defines a constant, computed once." => not_at_top;
    "def-macro" "(def-macro name (params…) \"doc\" body…)"
        "Defines a macro: a function from forms to the form that stands in their place." => not_at_top;
    "def-failure" "(def-failure name (parents…) (fields…) \"doc\")"
        "Defines a type of failures." => not_at_top;
    "def-native" "(def-native name (params…) \"doc\")"
        "Declares a function of the library that is written in Rust." => not_at_top;
    "def-open-fun" "(def-open-fun name (params…) \"doc\")"
        "Defines a function that gets its cases by `extend`." => not_at_top;
    "extend" "(extend name (params…) body…)"
        "Adds a case to an open function; a case answers nil for what it does not know." => not_at_top;
    "def-test" "(def-test name body…)"
        "Defines a test, for `pleach test`." => not_at_top;
    "def-rules" "(def-rules name :tabled \"doc\" (<- (head …) goal…) …)"
        "Defines predicates by clauses." => not_at_top;
    "<-" "(<- (head …) :priority n goal…)"
        "A clause: the head holds if the goals do." => |it, _, form, _| it.outside(form, "`def-rules`", None);
    "def-facts" "(def-facts name \"doc\" (predicate argument …) …)"
        "Defines predicates by facts." => not_at_top;
    "def-open" "(def-open name arity \"doc\")"
        "A predicate that may get clauses from many files, or none." => not_at_top;
    "def-native-rule" "(def-native-rule name (?argument …) \"doc\")"
        "A predicate of the library that is written in Rust." => not_at_top;
    "use-rules" "(use-rules \"file.pl\")"
        "The clauses of a Prolog text are rules of this file." => not_at_top;
}

impl Compiler<'_> {
    /// The error of a form that does not have its shape.
    pub(super) fn shape(&mut self, form: &Form, problem: &str, shape: &str) -> Expr {
        self.shape_at(form, problem, shape, form.span)
    }

    pub(super) fn shape_at(&mut self, form: &Form, problem: &str, shape: &str, at: Span) -> Expr {
        let name = form.head().map_or_else(String::new, |head| head.to_string());
        let (problem, shape) = (problem.into(), shape.into());
        self.error(CompileError::Shape { form: name, problem, shape, at });
        Expr::nil(form.span)
    }

    /// The error of a special form, with its shape from the table.
    pub(super) fn misshapen(&mut self, form: &Form, problem: &str) -> Expr {
        let name = form.head().unwrap_or_default();
        let shape = SHAPES.iter().find(|(known, _)| name == *known).map_or("", |(_, shape)| shape);
        self.shape(form, problem, shape)
    }

    fn outside(&mut self, form: &Form, inside: &str, help: Option<&str>) -> Expr {
        let name = form.head().unwrap_or_default().to_string();
        let (inside, help) = (inside.into(), help.map(Into::into));
        self.error(CompileError::Outside { form: name, inside, at: form.span, help });
        Expr::nil(form.span)
    }
}

fn boxed(expr: Expr) -> Box<Expr> {
    Box::new(expr)
}

// ---------------------------------------------------------------------------------------------
// Data

fn quote(it: &mut Compiler<'_>, _: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    match args {
        [data] => it.constant(data),
        _ => it.misshapen(form, "takes one form"),
    }
}

fn quasiquote(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    match args {
        [data] => it.quasi(scope, data, 1),
        _ => it.misshapen(form, "takes one form"),
    }
}

fn describe(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, _: &[Form]) -> Expr {
    it.description(scope, form, false)
}

/// `(path main (transporting :call 2) fetching)`
fn path(it: &mut Compiler<'_>, _: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let mut steps = Vec::new();
    for arg in args {
        let step = match &arg.kind {
            FormKind::Symbol(name) => Some(PathStep { name: *name, call: 1 }),
            FormKind::List(parts) => match parts.as_slice() {
                [name, key, Form { kind: FormKind::Int(call), .. }] if matches!(&key.kind, FormKind::Keyword(k) if *k == "call") =>
                {
                    let call = u32::try_from(*call).ok().filter(|call| *call > 0);
                    name.symbol().zip(call).map(|(name, call)| PathStep { name, call })
                }
                _ => None,
            },
            _ => None,
        };
        match step {
            Some(step) => steps.push(step),
            None => return it.misshapen(form, "has a step that is neither a name nor (name :call n)"),
        }
    }
    if steps.is_empty() {
        return it.misshapen(form, "has no steps");
    }
    Expr::new(ExprKind::Const(Value::new(Obj::Path(Box::new(Path::new(steps))))), form.span)
}

// ---------------------------------------------------------------------------------------------
// Variables and sequences

fn seq(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let body = it.body(scope, args);
    Expr::seq(body, form.span)
}

fn let_(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    bindings(it, scope, form, args, false)
}

fn let_star(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    bindings(it, scope, form, args, true)
}

/// A list of the form's own syntax. The empty one is nil where a macro or an edit has made it.
pub(super) fn list_or_nil(form: &Form) -> Option<&[Form]> {
    if form.is("nil") { Some(&[]) } else { form.list() }
}

fn bindings(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form], one_by_one: bool) -> Expr {
    let Some((list, body)) = args.split_first() else { return it.misshapen(form, "has no bindings") };
    let Some(pairs) = list_or_nil(list) else { return it.misshapen(form, "needs a list of bindings") };
    let in_sight = scope.names.len();
    let mut parts: Vec<(VarId, Expr)> = Vec::new();
    let mut targets: Vec<(&Form, VarId)> = Vec::new();
    for pair in pairs {
        let Some([target, value]) = pair.list() else {
            it.misshapen(form, "has a binding that is not written (name value)");
            continue;
        };
        let value = it.expr(scope, value);
        match (target.symbol(), one_by_one) {
            (Some(name), true) => {
                let var = scope.bind(name, target.span);
                parts.push((var, value));
            }
            (None, true) => it.take_apart(scope, target, value, &mut parts),
            // All values are computed before the first name can be seen.
            (_, false) => {
                let var = scope.hidden(target.span);
                parts.push((var, value));
                targets.push((target, var));
            }
        }
    }
    let mut names: Vec<(Symbol, Span)> = Vec::new();
    for (target, var) in targets {
        match target.symbol() {
            Some(name) => {
                if let Some((_, first)) = names.iter().find(|(known, _)| *known == name) {
                    let (again, first) = (target.span, *first);
                    it.error(CompileError::BoundTwice { name: name.to_string(), again, first });
                }
                names.push((name, target.span));
                scope.vars[var.0 as usize].name = name;
                scope.names.push((name, var));
            }
            None => {
                let value = Expr::new(ExprKind::Var(var), target.span);
                it.take_apart(scope, target, value, &mut parts);
            }
        }
    }
    let body = it.body(scope, body);
    scope.names.truncate(in_sight);
    Expr::new(ExprKind::Let(parts, body), form.span)
}

fn set(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let [target, value] = args else { return it.misshapen(form, "takes a name and a value") };
    let Some(name) = target.symbol() else { return it.misshapen(form, "changes a name, nothing else") };
    let value = it.expr(scope, value);
    match scope.variable(name, target.span) {
        Some(var) => {
            let captured = scope.captures.iter().any(|(_, ours)| *ours == var);
            scope.vars[var.0 as usize].assigned.get_or_insert(form.span);
            if captured {
                scope.vars[var.0 as usize].captured.get_or_insert((target.span, scope.kind));
            }
            Expr::new(ExprKind::Set(var, boxed(value)), form.span)
        }
        None => {
            match it.look_up(scope.module, name) {
                Found::One(definition) => {
                    let (name, is) = (name.to_string(), definition.meaning.words().to_string());
                    it.error(CompileError::SetConstant { name, is, at: form.span });
                }
                _ => it.unknown_name(scope, name, target.span),
            }
            value
        }
    }
}

fn lambda(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((params, body)) = args.split_first() else { return it.misshapen(form, "has no parameters") };
    let params = it.param_forms(params);
    let function = it.lambda(scope, &params, body, form.span);
    Expr::new(ExprKind::Lambda(Box::new(function)), form.span)
}

// ---------------------------------------------------------------------------------------------
// Branches

fn if_(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let (test, then, other) = match args {
        [test, then] => (test, then, None),
        [test, then, other] => (test, then, Some(other)),
        _ => return it.misshapen(form, "takes a test and one or two branches"),
    };
    let test = it.expr(scope, test);
    let then = it.expr(scope, then);
    let other = other.map_or_else(|| Expr::nil(form.span), |other| it.expr(scope, other));
    Expr::new(ExprKind::If(boxed(test), boxed(then), boxed(other)), form.span)
}

fn when(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((test, body)) = args.split_first() else { return it.misshapen(form, "has no test") };
    let test = it.expr(scope, test);
    let body = Expr::seq(it.body(scope, body), form.span);
    Expr::new(ExprKind::If(boxed(test), boxed(body), boxed(Expr::nil(form.span))), form.span)
}

fn unless(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((test, body)) = args.split_first() else { return it.misshapen(form, "has no test") };
    let test = it.expr(scope, test);
    let body = Expr::seq(it.body(scope, body), form.span);
    Expr::new(ExprKind::If(boxed(test), boxed(Expr::nil(form.span)), boxed(body)), form.span)
}

fn cond(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    if it.depth + args.len() > MOST_NESTED {
        it.error(CompileError::TooDeep { limit: MOST_NESTED, at: form.span });
        return Expr::nil(form.span);
    }
    let mut branches = Vec::new();
    for clause in args {
        let Some((test, body)) = clause.list().and_then(<[Form]>::split_first) else {
            it.depth -= branches.len();
            return it.misshapen(form, "has a clause that is not written (test body…)");
        };
        // Each clause stands in the `else` of the one before it.
        it.depth += 1;
        let test = it.expr(scope, test);
        let body = it.body(scope, body);
        branches.push((test, body, clause.span));
    }
    it.depth -= branches.len();
    let mut value = Expr::nil(form.span);
    for (test, body, span) in branches.into_iter().rev() {
        value = match body.is_empty() {
            true => Expr::new(ExprKind::Or(vec![test, value]), span),
            false => Expr::new(ExprKind::If(boxed(test), boxed(Expr::seq(body, span)), boxed(value)), span),
        };
    }
    value
}

fn case(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((subject, clauses)) = args.split_first() else { return it.misshapen(form, "has no value") };
    let subject = it.expr(scope, subject);
    let mut arms = Vec::new();
    let mut otherwise = None;
    for clause in clauses {
        let Some((keys, body)) = clause.list().and_then(<[Form]>::split_first) else {
            return it.misshapen(form, "has a clause that is not written (key body…)");
        };
        if otherwise.is_some() {
            return it.misshapen(form, "has clauses after `otherwise`");
        }
        let body = it.body(scope, body);
        if keys.is("otherwise") || keys.is("t") {
            otherwise = Some(body);
            continue;
        }
        let keys: Vec<Value> = match keys.list() {
            Some(keys) => keys.iter().map(|key| to_value(key, &mut Places::default())).collect(),
            None => vec![to_value(keys, &mut Places::default())],
        };
        arms.push((keys, body));
    }
    Expr::new(ExprKind::Case(boxed(subject), arms, otherwise.unwrap_or_default()), form.span)
}

fn and(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let parts = it.body(scope, args);
    match parts.is_empty() {
        true => Expr::new(ExprKind::Const(Value::TRUE), form.span),
        false => Expr::new(ExprKind::And(parts), form.span),
    }
}

fn or(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let parts = it.body(scope, args);
    match parts.is_empty() {
        true => Expr::nil(form.span),
        false => Expr::new(ExprKind::Or(parts), form.span),
    }
}

// ---------------------------------------------------------------------------------------------
// Loops

/// Resolves the body of a loop.
pub(super) fn loop_body(it: &mut Compiler<'_>, scope: &mut Scope, body: &[Form]) -> Vec<Expr> {
    scope.around.push(Around::Loop);
    let body = it.body(scope, body);
    scope.around.pop();
    body
}

fn while_(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((test, body)) = args.split_first() else { return it.misshapen(form, "has no test") };
    let test = it.expr(scope, test);
    let body = loop_body(it, scope, body);
    Expr::new(ExprKind::While(boxed(test), body), form.span)
}

fn loop_(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let body = loop_body(it, scope, args);
    let always = Expr::new(ExprKind::Const(Value::TRUE), form.span);
    Expr::new(ExprKind::While(boxed(always), body), form.span)
}

/// The parts of `(name over result)` at the head of a loop.
fn loop_head<'f>(it: &mut Compiler<'_>, form: &Form, args: &'f [Form]) -> Option<(&'f [Form], &'f [Form])> {
    match args.split_first() {
        Some((head, body)) if head.list().is_some_and(|head| (2..=3).contains(&head.len())) => {
            Some((head.list()?, body))
        }
        _ => {
            it.misshapen(form, "needs a variable and what it goes over");
            None
        }
    }
}

fn dolist(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((head, body)) = loop_head(it, form, args) else { return Expr::nil(form.span) };
    let list = boxed(it.expr(scope, &head[1]));
    let in_sight = scope.names.len();
    let (var, body) = match head[0].symbol() {
        Some(name) => {
            let var = scope.bind(name, head[0].span);
            (var, loop_body(it, scope, body))
        }
        None => {
            let var = scope.hidden(head[0].span);
            let mut parts = Vec::new();
            it.take_apart(scope, &head[0], Expr::new(ExprKind::Var(var), head[0].span), &mut parts);
            let body = loop_body(it, scope, body);
            (var, vec![Expr::new(ExprKind::Let(parts, body), form.span)])
        }
    };
    scope.names.truncate(in_sight);
    let result = boxed(head.get(2).map_or_else(|| Expr::nil(form.span), |result| it.expr(scope, result)));
    Expr::new(ExprKind::Dolist { var, list, body, result }, form.span)
}

fn dotimes(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((head, body)) = loop_head(it, form, args) else { return Expr::nil(form.span) };
    let Some(name) = head[0].symbol() else { return it.misshapen(form, "counts with a name") };
    let count = boxed(it.expr(scope, &head[1]));
    let in_sight = scope.names.len();
    let var = scope.bind(name, head[0].span);
    let body = loop_body(it, scope, body);
    scope.names.truncate(in_sight);
    let result = boxed(head.get(2).map_or_else(|| Expr::nil(form.span), |result| it.expr(scope, result)));
    Expr::new(ExprKind::Dotimes { var, count, body, result }, form.span)
}

fn return_(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let value = match args {
        [] => Expr::nil(form.span),
        [value] => it.expr(scope, value),
        _ => return it.misshapen(form, "takes one value"),
    };
    if scope.around.is_empty() {
        let help = "a function returns the value of its last form; `return` leaves a loop or ends a handler";
        return it.outside(form, "a loop or a handler", Some(help));
    }
    Expr::new(ExprKind::Return(boxed(value)), form.span)
}

// ---------------------------------------------------------------------------------------------
// Plans

fn perform(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let (desc, goal) = match args {
        [desc] => (desc, None),
        [desc, key, goal] if matches!(&key.kind, FormKind::Keyword(key) if *key == "goal") => {
            (desc, Some(goal))
        }
        _ => return it.misshapen(form, "takes a description, and perhaps a goal"),
    };
    let desc = it.expr(scope, desc);
    let none = super::ParamForms::default();
    let goal = goal.map(|goal| Box::new(it.lambda(scope, &none, std::slice::from_ref(goal), goal.span)));
    Expr::new(ExprKind::Perform(boxed(desc), goal), form.span)
}

fn original(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    if !args.is_empty() {
        return it.misshapen(form, "takes nothing");
    }
    if !scope.original {
        return it.outside(form, "the code of a `wrap` or `replace`", None);
    }
    Expr::new(ExprKind::Original, form.span)
}

// ---------------------------------------------------------------------------------------------
// Failures

fn handle(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((clauses, body)) = args.split_first() else { return it.misshapen(form, "has no clauses") };
    let Some(clauses) = list_or_nil(clauses) else {
        return it.misshapen(form, "needs a list of clauses");
    };
    // `return` in the body means a loop around the form; only the clauses end the form.
    let body = it.body(scope, body);
    let mut resolved = Vec::new();
    for clause in clauses {
        let (kinds, var, rest) = match clause.list() {
            Some([kinds, var, rest @ ..]) if list_or_nil(var).is_some_and(|var| var.len() <= 1) => {
                (kinds, var, rest)
            }
            _ => {
                it.misshapen(form, "has a clause that is not written (type (e) body…)");
                continue;
            }
        };
        let kinds = kinds_of(it, scope, kinds);
        let in_sight = scope.names.len();
        let var = match var.list().and_then(<[Form]>::first) {
            Some(name) => match name.symbol() {
                Some(symbol) => Some(scope.bind(symbol, name.span)),
                None => {
                    it.misshapen(form, "binds the failure to a name");
                    None
                }
            },
            None => None,
        };
        scope.around.push(Around::Clause);
        let body = it.body(scope, rest);
        scope.around.pop();
        scope.names.truncate(in_sight);
        resolved.push(Clause { kinds, var, body, span: clause.span });
    }
    Expr::new(ExprKind::Handle(resolved, body), form.span)
}

/// `type` or `(or type type)`
fn kinds_of(it: &mut Compiler<'_>, scope: &Scope, form: &Form) -> Vec<vm::failure::TypeId> {
    let names = match form.list() {
        Some([or, names @ ..]) if or.is("or") => names,
        _ => std::slice::from_ref(form),
    };
    names.iter().filter_map(|name| failure_type(it, scope, name)).collect()
}

/// The failure type that a form names, or an error.
pub(crate) fn failure_type(it: &mut Compiler<'_>, scope: &Scope, form: &Form) -> Option<vm::failure::TypeId> {
    let Some(name) = form.symbol() else {
        it.shape_at(form, "is no name of a failure type", "plan-failure", form.span);
        return None;
    };
    match it.look_up(scope.module, name) {
        Found::One(definition) => match definition.meaning {
            Meaning::Failure(kind) => return Some(kind),
            other => {
                it.wrong_kind(name, &other, "a type of failures", form.span);
                return None;
            }
        },
        Found::Two(one, other) => {
            it.error(CompileError::Ambiguous { name: name.to_string(), one, other, at: form.span });
            return None;
        }
        Found::None => {}
    }
    if let Some(kind) =
        it.program.failures.find(name).filter(|kind| (kind.0 as usize) < vm::Builtin::ALL.len())
    {
        return Some(kind);
    }
    let known: Vec<Symbol> = it.program.failures.iter().map(|kind| kind.name).collect();
    let help = match nearest(&name, known.iter().map(|name| name.as_str())) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("define it: (def-failure {name})"),
    };
    it.error(CompileError::UnknownFailure { name: name.to_string(), at: form.span, help: Some(help) });
    None
}

fn in_clause(scope: &Scope) -> bool {
    scope.around.contains(&Around::Clause)
}

fn retry(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    if !args.is_empty() {
        return it.misshapen(form, "takes nothing");
    }
    if !in_clause(scope) {
        return it.outside(form, "a clause of `with-failure-handling`", None);
    }
    Expr::new(ExprKind::Retry, form.span)
}

fn propagate(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    if !args.is_empty() {
        return it.misshapen(form, "takes nothing");
    }
    if !in_clause(scope) {
        return it.outside(form, "a clause of `with-failure-handling`", None);
    }
    Expr::new(ExprKind::Propagate, form.span)
}

fn fail(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((kind, fields)) = args.split_first() else { return it.misshapen(form, "has no type") };
    let is_value = kind.symbol().is_none_or(|name| {
        let found = it.look_up(scope.module, name);
        let is_constant = matches!(&found, Found::One(found) if matches!(found.meaning, Meaning::Const(_)));
        scope.variable(name, kind.span).is_some() || is_constant
    });
    if is_value && fields.is_empty() {
        let failure = it.expr(scope, kind);
        return Expr::new(ExprKind::Raise(boxed(failure)), form.span);
    }
    let Some(id) = failure_type(it, scope, kind) else {
        fields_of(it, scope, form, fields);
        return Expr::nil(form.span);
    };
    let fields = fields_of(it, scope, form, fields);
    Expr::new(ExprKind::Fail(id, fields), form.span)
}

fn make_failure(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((kind, fields)) = args.split_first() else { return it.misshapen(form, "has no type") };
    let id = failure_type(it, scope, kind);
    let fields = fields_of(it, scope, form, fields);
    match id {
        Some(id) => Expr::new(ExprKind::MakeFailure(id, fields), form.span),
        None => Expr::nil(form.span),
    }
}

/// `:field value …`
fn fields_of(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Vec<(Symbol, Expr)> {
    let mut fields: Vec<(Symbol, Expr)> = Vec::new();
    for (i, pair) in args.chunks(2).enumerate() {
        let (FormKind::Keyword(key), Some(value)) = (&pair[0].kind, pair.get(1)) else {
            it.misshapen(form, "has fields that are not written :field value");
            continue;
        };
        let value = it.expr(scope, value);
        if fields.iter().any(|(known, _)| known == key) {
            let (again, first) = (pair[0].span, super::first_of(*key, &args[..2 * i]).unwrap_or(form.span));
            it.error(CompileError::BoundTwice { name: format!(":{key}"), again, first });
        }
        fields.push((*key, value));
    }
    fields
}

fn protect(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((body, cleanup)) = args.split_first() else { return it.misshapen(form, "has no body") };
    // `(:node name form…)` says of which form it is a part, as it does of a branch.
    let (name, body) = match body.list() {
        Some([word, name, body @ ..]) if super::tasks::is_keyword(word, "node") => {
            (name.symbol(), Expr::seq(it.body(scope, body), form.span))
        }
        _ => (None, it.expr(scope, body)),
    };
    let name = name.unwrap_or_else(|| Symbol::from("clean-up"));
    let cleanup = it.body(scope, cleanup);
    Expr::new(ExprKind::Protect(boxed(body), cleanup, name), form.span)
}

fn counters(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((list, body)) = args.split_first() else { return it.misshapen(form, "has no counters") };
    let Some(pairs) = list_or_nil(list) else { return it.misshapen(form, "needs a list of counters") };
    let in_sight = scope.names.len();
    let mut parts = Vec::new();
    for pair in pairs {
        let Some([name, count]) = pair.list().and_then(|pair| <&[Form; 2]>::try_from(pair).ok()) else {
            it.misshapen(form, "has a counter that is not written (name count)");
            continue;
        };
        let count = it.expr(scope, count);
        let Some(symbol) = name.symbol() else {
            it.misshapen(form, "has a counter without a name");
            continue;
        };
        let var = scope.bind(symbol, name.span);
        parts.push((var, Expr::new(ExprKind::Counter(boxed(count)), pair.span)));
    }
    let body = it.body(scope, body);
    scope.names.truncate(in_sight);
    Expr::new(ExprKind::Let(parts, body), form.span)
}

fn do_retry(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((counter, body)) = args.split_first() else { return it.misshapen(form, "has no counter") };
    let var = counter.symbol().and_then(|name| scope.variable(name, counter.span));
    let Some(var) = var else {
        return it.misshapen(form, "counts with a name that `with-retry-counters` has bound");
    };
    let body = Expr::seq(it.body(scope, body), form.span);
    let more = Expr::new(ExprKind::CountDown(var), counter.span);
    Expr::new(ExprKind::If(boxed(more), boxed(body), boxed(Expr::nil(form.span))), form.span)
}

// ---------------------------------------------------------------------------------------------
// Tests

/// `(expect (= a b))` computes both sides once, so that a failed test can show them.
fn expect(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let [what] = args else { return it.misshapen(form, "takes one expression") };
    let span = form.span;
    let written = it.constant(what);
    let expr = it.expr(scope, what);
    let kind = vm::Builtin::ExpectationFailed.id();
    let (parts, test, shown) = match expr.kind {
        // A comparison of two values: `expected` and `actual` are known.
        ExprKind::Call(callee @ (Callee::Native(_) | Callee::Function(_)), sides)
            if sides.len() == 2 && sides.iter().all(Option::is_some) =>
        {
            let vars: Vec<VarId> = sides.iter().map(|_| scope.hidden(span)).collect();
            let again = |i: usize| Expr::new(ExprKind::Var(vars[i]), span);
            let test = Expr::new(ExprKind::Call(callee, vec![Some(again(0)), Some(again(1))]), expr.span);
            let shown = vec![(Symbol::from("actual"), again(0)), (Symbol::from("expected"), again(1))];
            (vars.iter().copied().zip(sides.into_iter().flatten()).collect(), test, shown)
        }
        _ => {
            let var = scope.hidden(span);
            let value = Expr::new(ExprKind::Var(var), span);
            (vec![(var, expr)], value.clone(), vec![(Symbol::from("actual"), value)])
        }
    };
    let fields = std::iter::once((Symbol::from("form"), written)).chain(shown).collect();
    let failed = Expr::new(ExprKind::Fail(kind, fields), span);
    let yes = Expr::new(ExprKind::Const(Value::TRUE), span);
    let check = Expr::new(ExprKind::If(boxed(test), boxed(yes), boxed(failed)), span);
    Expr::new(ExprKind::Let(parts, vec![check]), span)
}

/// `(expect-failure type body…)`: the value is the failure.
fn expect_failure(it: &mut Compiler<'_>, scope: &mut Scope, form: &Form, args: &[Form]) -> Expr {
    let Some((kind, body)) = args.split_first() else { return it.misshapen(form, "has no type") };
    let span = form.span;
    let written = it.constant(form);
    let kinds = kinds_of(it, scope, kind);
    let body = it.body(scope, body);
    let failure = scope.hidden(span);
    let caught = Expr::new(ExprKind::Return(boxed(Expr::new(ExprKind::Var(failure), span))), span);
    let clause = Clause { kinds, var: Some(failure), body: vec![caught], span };
    // The body without a failure has the value nil; a failure is never nil.
    let mut body = body;
    body.push(Expr::nil(span));
    let result = scope.hidden(span);
    let value = Expr::new(ExprKind::Var(result), span);
    let nothing = Expr::new(ExprKind::Const(Value::str("no failure")), span);
    let fields = vec![(Symbol::from("form"), written), (Symbol::from("actual"), nothing)];
    let failed = Expr::new(ExprKind::Fail(vm::Builtin::ExpectationFailed.id(), fields), span);
    let check = Expr::new(ExprKind::If(boxed(value.clone()), boxed(value), boxed(failed)), span);
    let handled = Expr::new(ExprKind::Handle(vec![clause], body), span);
    Expr::new(ExprKind::Let(vec![(result, handled)], vec![check]), span)
}

fn not_at_top(it: &mut Compiler<'_>, _: &mut Scope, form: &Form, _: &[Form]) -> Expr {
    let name = form.head().unwrap_or_default().to_string();
    it.error(CompileError::NotAtTop { form: name, at: form.span });
    Expr::nil(form.span)
}
