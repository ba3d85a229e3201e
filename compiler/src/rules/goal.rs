//! Goals: one table of those that the language has, one function each; all others are predicates.

use grammar::{Form, FormKind, Span};
use vm::rules::clause::{Arith, Collect, Compare, Goal, GoalKind, PredId, Term};
use vm::value::Symbol;

use super::{Rule, arguments, place};
use crate::Compiler;
use crate::data::{Places, to_value};
use crate::error::CompileError;
use crate::module::{Found, Meaning, ModuleId, nearest, predicate_key};
use crate::resolve::special;

/// Resolves a goal from its parts; nothing if it does not have its shape.
type Resolve = fn(&mut Compiler<'_>, &mut Rule, &Form, &[Form]) -> Option<GoalKind>;

macro_rules! goals {
    ($($name:literal $shape:literal => $function:expr;)+) => {
        /// How each goal of the language is written.
        pub(crate) const SHAPES: &[(&str, &str)] = &[$(($name, $shape)),+];
        fn find(name: &str) -> Option<Resolve> {
            match name { $($name => Some($function),)+ _ => None }
        }
    };
}

goals! {
    "true" "(true)" => |_, _, _, args| args.is_empty().then_some(GoalKind::True);
    "false" "(false)" => |_, _, _, args| args.is_empty().then_some(GoalKind::False);
    "cut" "(cut)" => cut;
    "and" "(and goal …)" => |it, rule, _, args| Some(it.conjunction(rule, args));
    "or" "(or goal …)" => |it, rule, _, args| Some(GoalKind::Or(it.goals(rule, args)));
    "not" "(not goal)" => not;
    "->" "(-> test then else)" => |it, rule, _, args| it.if_goal(rule, args, false);
    "*->" "(*-> test then else)" => |it, rule, _, args| it.if_goal(rule, args, true);
    "once" "(once goal)" => once;
    "==" "(== a b)" => |it, rule, _, args| it.two_terms(rule, args, GoalKind::Unify);
    "matches" "(matches pattern value)" => |it, rule, _, args| it.two_terms(rule, args, GoalKind::Matches);
    "identical?" "(identical? a b)" => |it, rule, _, args| it.two_terms(rule, args, GoalKind::Identical);
    "<" "(< a b)" => |it, rule, form, args| it.comparison(rule, form, args, Compare::Less);
    "<=" "(<= a b)" => |it, rule, form, args| it.comparison(rule, form, args, Compare::LessEq);
    ">" "(> a b)" => |it, rule, form, args| it.comparison(rule, form, args, Compare::More);
    ">=" "(>= a b)" => |it, rule, form, args| it.comparison(rule, form, args, Compare::MoreEq);
    "=" "(= a b)" => |it, rule, form, args| it.comparison(rule, form, args, Compare::Equal);
    "/=" "(/= a b)" => |it, rule, form, args| it.comparison(rule, form, args, Compare::Unequal);
    "is" "(is ?x expression)" => |it, rule, form, args| it.is_goal(rule, form, args);
    "fun" "(fun function argument … ?result)" => |it, rule, form, args| it.fun_goal(rule, form, args);
    "findall" "(findall template goal list)" => |it, rule, _, args| it.collect(rule, args, Collect::List, "findall");
    "count" "(count goal n)" => |it, rule, _, args| it.collect(rule, args, Collect::Count, "count");
    "min" "(min template goal x)" => |it, rule, _, args| it.collect(rule, args, Collect::Min, "min");
    "max" "(max template goal x)" => |it, rule, _, args| it.collect(rule, args, Collect::Max, "max");
    "bagof" "(bagof template goal list)" => |it, rule, _, args| it.bag(rule, args, false);
    "setof" "(setof template goal list)" => |it, rule, _, args| it.bag(rule, args, true);
    "exists" "(exists (?x …) goal)" => |it, rule, _, args| it.exists(rule, args);
    "forall" "(forall test goal)" => for_all;
    "call" "(call ?goal argument …)" => call;
}

/// The sign of arithmetic that rule code does itself.
pub(super) fn arithmetic(name: &str) -> Option<Arith> {
    match name {
        "+" => Some(Arith::Add),
        "-" => Some(Arith::Sub),
        "*" => Some(Arith::Mul),
        "/" => Some(Arith::Div),
        _ => None,
    }
}

/// How the goal of the language that has this name is written.
pub(crate) fn shape(name: &str) -> Option<&'static str> {
    SHAPES.iter().find(|(known, _)| *known == name).map(|(_, shape)| *shape)
}

/// Goals in a row; those in an `and` are of the row.
pub(super) fn row(goals: Vec<Goal>) -> GoalKind {
    let mut flat = Vec::new();
    for goal in goals {
        match goal.kind {
            GoalKind::And(inner) => flat.extend(inner),
            kind => flat.push(Goal { kind, place: goal.place }),
        }
    }
    match flat.len() {
        0 => GoalKind::True,
        1 => flat.remove(0).kind,
        _ => GoalKind::And(flat),
    }
}

impl Compiler<'_> {
    /// Resolves a goal.
    pub(super) fn goal(&mut self, rule: &mut Rule, form: &Form) -> Goal {
        let kind = self.nested(form.span, GoalKind::True, |it| it.goal_of(rule, form));
        Goal { kind, place: place(form.span) }
    }

    pub(super) fn goals(&mut self, rule: &mut Rule, forms: &[Form]) -> Vec<Goal> {
        forms.iter().map(|form| self.goal(rule, form)).collect()
    }

    pub(super) fn conjunction(&mut self, rule: &mut Rule, forms: &[Form]) -> GoalKind {
        row(self.goals(rule, forms))
    }

    fn goal_of(&mut self, rule: &mut Rule, form: &Form) -> GoalKind {
        let Some((name, args)) = form.head().zip(form.list().and_then(|items| items.get(1..))) else {
            self.no_goal(rule, form);
            return GoalKind::True;
        };
        if let Some(resolve) = find(&name) {
            return resolve(self, rule, form, args).unwrap_or_else(|| {
                let (shape, name) = (shape(&name).unwrap_or_default().to_string(), name.to_string());
                let parts = arguments(&[args.len()]);
                let problem = format!("cannot have {parts}");
                self.error(CompileError::Shape { form: name, problem, shape, at: form.span });
                GoalKind::True
            });
        }
        let before = self.reports.len();
        if let Some(predicate) = self.predicate(rule.module, name, args.len(), form.span) {
            let args = self.terms(rule, args);
            return GoalKind::Call(predicate, args);
        }
        if self.reports.len() == before {
            return self.unknown_goal(rule, form, name, args);
        }
        GoalKind::True
    }

    /// A predicate with its arguments, and the variables in them: a fact of `with-facts`.
    pub(crate) fn fact_pattern(
        &mut self,
        module: ModuleId,
        form: &Form,
    ) -> Option<(PredId, Vec<Term>, Rule)> {
        let mut rule = Rule::new(module);
        let name = form.head()?;
        if let Some(shape) = shape(&name) {
            let (name, shape) = (name.to_string(), shape.to_string());
            self.error(CompileError::Reserved { name, shape, at: form.span });
            return None;
        }
        match self.goal(&mut rule, form).kind {
            GoalKind::Call(predicate, args) => Some((predicate, args, rule)),
            _ => None,
        }
    }

    /// A goal whose head is no predicate: a macro, or a mistake.
    fn unknown_goal(&mut self, rule: &mut Rule, form: &Form, name: Symbol, args: &[Form]) -> GoalKind {
        let at = form.list().map_or(form.span, |items| items[0].span);
        let meaning = match self.look_up(rule.module, name) {
            Found::One(definition) => Some(definition.meaning),
            _ => None,
        };
        if let Some(Meaning::Macro(function, params)) = meaning {
            let Some(expansion) = self.expand(name, function, &params, form) else { return GoalKind::True };
            self.within.push(self.home(function).unwrap_or(rule.module));
            let kind = self.goal(rule, &expansion).kind;
            self.within.pop();
            return kind;
        }
        let arities = self.arities(rule.module, name);
        if !arities.is_empty() {
            let (has, got) = (arguments(&arities), args.len());
            let help = None;
            self.error(CompileError::PredicateArity {
                name: name.to_string(),
                has,
                got,
                at: form.span,
                help,
            });
        } else if matches!(meaning, Some(Meaning::Plan(..))) {
            let what = format!("the plan `{name}`");
            let help =
                Some("a plan asks rules with `ask`, `answers` and `query`, not the other way round".into());
            self.error(CompileError::PlanForm { what, at, help });
        } else if let Some(help) = instead(&name) {
            let what = format!("`{name}`");
            self.error(CompileError::PlanForm { what, at, help: Some(help) });
        } else {
            let help = self.nearest_goal(rule, name, meaning.as_ref(), args.len());
            self.error(CompileError::UnknownPredicate { name: name.to_string(), at, help });
        }
        // Its arguments may have mistakes of their own, and its variables are none.
        self.terms(rule, args);
        GoalKind::True
    }

    fn nearest_goal(
        &self,
        rule: &Rule,
        name: Symbol,
        meaning: Option<&Meaning>,
        args: usize,
    ) -> Option<String> {
        if let Some(meaning) = meaning.filter(|meaning| meaning.params().is_some()) {
            let words = meaning.words();
            let args = if args > 0 { " …" } else { "" };
            return Some(format!(
                "{words} has this name: (fun {name}{args} ?result) calls it, and `(is ?x expression)` computes"
            ));
        }
        if self.reports.len() >= crate::resolve::MOST_HELPED {
            return None;
        }
        let visible = self.modules.visible(rule.module);
        let predicates = visible.iter().filter_map(|key| predicate_key(*key)).map(|(name, _)| name);
        let near = nearest(&name, predicates.chain(SHAPES.iter().map(|(name, _)| *name)));
        match near {
            Some(near) => Some(format!("did you mean `{near}`?")),
            None if visible.contains(&name) => None,
            None => Some(format!(
                "define it with `def-rules` or `def-facts`, or declare that it may have no clauses: (def-open {name} {args})"
            )),
        }
    }

    /// The error of a form that cannot be a goal at all.
    fn no_goal(&mut self, rule: &Rule, form: &Form) {
        let shown = vm::print::brief(&to_value(form, &mut Places::default()));
        let name = form.symbol();
        let help = match name.as_ref().map(|name| name.as_str()) {
            Some("!") => "a cut is written (cut)".into(),
            Some("fail") => "it is written (false)".into(),
            Some(name @ ("true" | "false" | "cut")) => format!("it is written ({name})"),
            Some(name) if name.starts_with('?') => {
                format!("(call {name}) proves the goal that a variable holds")
            }
            Some(name) if self.arities(rule.module, Symbol::from(name)).contains(&0) => {
                format!("a goal stands in brackets: ({name})")
            }
            _ => "a goal is written (predicate argument …)".into(),
        };
        let what = match &form.kind {
            FormKind::List(items) if items.is_empty() => "an empty list".into(),
            _ => format!("`{shown}`"),
        };
        self.error(CompileError::NotAGoal { what, at: form.span, help: Some(help) });
    }

    // ------------------------------------------------------------------ goals of the language

    /// A goal that a cut cannot leave.
    fn opaque(&mut self, rule: &mut Rule, name: &'static str, form: &Form) -> Box<Goal> {
        rule.opaque.push(name);
        let goal = self.goal(rule, form);
        rule.opaque.pop();
        Box::new(goal)
    }

    /// The same for one whose variables stay inside, too.
    fn closed(&mut self, rule: &mut Rule, name: &'static str, form: &Form) -> Box<Goal> {
        rule.closed += 1;
        let goal = self.opaque(rule, name, form);
        rule.closed -= 1;
        goal
    }

    fn if_goal(&mut self, rule: &mut Rule, args: &[Form], soft: bool) -> Option<GoalKind> {
        let (test, then, otherwise) = match args {
            [test, then] => (test, then, None),
            [test, then, otherwise] => (test, then, Some(otherwise)),
            _ => return None,
        };
        let test = self.opaque(rule, if soft { "*->" } else { "->" }, test);
        let then = Box::new(self.goal(rule, then));
        let otherwise = otherwise.map(|goal| Box::new(self.goal(rule, goal)));
        Some(GoalKind::If { test, then, otherwise, soft })
    }

    fn two_terms(
        &mut self,
        rule: &mut Rule,
        args: &[Form],
        make: fn(Term, Term) -> GoalKind,
    ) -> Option<GoalKind> {
        let [a, b] = args else { return None };
        let a = self.term(rule, a);
        let b = self.term(rule, b);
        Some(make(a, b))
    }

    fn collect(
        &mut self,
        rule: &mut Rule,
        args: &[Form],
        what: Collect,
        name: &'static str,
    ) -> Option<GoalKind> {
        let (template, goal, result) = match (what, args) {
            (Collect::Count, [goal, result]) => (None, goal, result),
            (Collect::Count, _) => return None,
            (_, [template, goal, result]) => (Some(template), goal, result),
            _ => return None,
        };
        rule.closed += 1;
        let template = template.map_or(Term::Any, |template| self.term(rule, template));
        rule.closed -= 1;
        let goal = self.closed(rule, name, goal);
        let result = self.term(rule, result);
        Some(GoalKind::Collect(what, template, goal, result))
    }

    fn bag(&mut self, rule: &mut Rule, args: &[Form], set: bool) -> Option<GoalKind> {
        let [template, goal, list] = args else { return None };
        rule.closed += 1;
        let template = self.term(rule, template);
        rule.closed -= 1;
        let first = rule.vars.len();
        let seen: Vec<bool> = rule.vars.iter().map(|var| var.seen).collect();
        let goal = self.opaque(rule, if set { "setof" } else { "bagof" }, goal);
        let mut by = Vec::new();
        goal.each_var(&mut |var| by.push(var));
        // A variable of the template does not leave the goal, so the goal shows nothing of it.
        template.each_var(&mut |var| {
            by.retain(|other| *other != var);
            rule.vars[var as usize].seen = seen[var as usize];
        });
        // What `exists` has brought in inside of the goal groups nothing.
        by.retain(|var| (*var as usize) < first || !rule.vars[*var as usize].local);
        by.sort_unstable();
        by.dedup();
        let list = self.term(rule, list);
        Some(GoalKind::Bag { template, by, goal, list, set })
    }

    fn exists(&mut self, rule: &mut Rule, args: &[Form]) -> Option<GoalKind> {
        let [names, goals @ ..] = args else { return None };
        let names = names.list().filter(|_| !goals.is_empty())?;
        let in_sight = rule.locals.len();
        for name in names {
            match name.symbol().filter(|symbol| symbol.starts_with('?') && *symbol != "?_") {
                Some(symbol) => drop(rule.local(symbol, name.span)),
                None => {
                    self.no_term("`exists` names variables", name.span, Some("(exists (?x ?y) goal)"));
                }
            }
        }
        let kind = self.conjunction(rule, goals);
        rule.locals.truncate(in_sight);
        Some(kind)
    }
}

fn cut(it: &mut Compiler<'_>, rule: &mut Rule, form: &Form, args: &[Form]) -> Option<GoalKind> {
    if let Some(inside) = rule.opaque.last() {
        it.error(CompileError::CutInside { inside: (*inside).to_string(), at: form.span });
    }
    args.is_empty().then_some(GoalKind::Cut)
}

fn not(it: &mut Compiler<'_>, rule: &mut Rule, _: &Form, args: &[Form]) -> Option<GoalKind> {
    let [goal] = args else { return None };
    Some(GoalKind::Not(it.closed(rule, "not", goal), Vec::new()))
}

fn once(it: &mut Compiler<'_>, rule: &mut Rule, _: &Form, args: &[Form]) -> Option<GoalKind> {
    let [goal] = args else { return None };
    Some(GoalKind::Once(it.opaque(rule, "once", goal)))
}

fn for_all(it: &mut Compiler<'_>, rule: &mut Rule, _: &Form, args: &[Form]) -> Option<GoalKind> {
    let [test, goal] = args else { return None };
    let test = it.closed(rule, "forall", test);
    let goal = it.closed(rule, "forall", goal);
    Some(GoalKind::ForAll(test, goal))
}

/// `(call ?goal argument …)`. A goal that is written out is that goal with more arguments; `(%in scope goal)`,
/// which the library writes, brings its scope along.
fn call(it: &mut Compiler<'_>, rule: &mut Rule, form: &Form, args: &[Form]) -> Option<GoalKind> {
    let (goal, more) = args.split_first()?;
    let brings_scope = goal.head().is_some_and(|head| head == "%in");
    if !brings_scope && goal.head().is_some_and(|head| !head.starts_with('?')) {
        let items = goal.list().unwrap_or_default().iter().chain(more).cloned().collect();
        let goal = Form::new(FormKind::List(items), form.span);
        return Some(it.opaque(rule, "call", &goal).kind);
    }
    let goal = it.term(rule, goal);
    let more = it.terms(rule, more);
    let scope = if brings_scope { u32::MAX } else { it.scope(rule.module) };
    Some(GoalKind::CallValue(goal, more, scope))
}

/// What rules have in the place of a form of plans.
fn instead(name: &str) -> Option<String> {
    let (_, shape) = special::SHAPES.iter().find(|(known, _)| *known == name)?;
    Some(match name {
        "if" | "cond" | "case" | "when" | "unless" => "write (-> test then else)".into(),
        "let" | "let*" | "set!" => "write (is ?x expression) or (== ?x term)".into(),
        "seq" => "write (and goal …)".into(),
        "fail" => "a goal that never holds is written (false)".into(),
        "query" | "ask" | "answers" | "for-each-answer" => "write the goal itself, or `findall`".into(),
        "dolist" | "dotimes" | "while" | "loop" => {
            "write `findall` or `forall`, or a rule that calls itself".into()
        }
        "<-" => "clauses stand in `def-rules`, one beside the other".into(),
        _ => format!("it is a form of plans: {shape}"),
    })
}

/// A span that begins where the first goal does and ends with the last.
pub(super) fn whole(goals: &[Goal]) -> Span {
    let span = |goal: &Goal| Span {
        file: grammar::FileId(goal.place.file),
        start: goal.place.start,
        end: goal.place.end,
    };
    match goals {
        [] => Span::default(),
        [first, .., last] => span(first).to(span(last)),
        [one] => span(one),
    }
}
