//! Clauses, goals and terms as source text: for explanations, for plans of queries, for tests.
//!
//! What is printed reads back as the same clause. Only expressions that became functions are shown
//! as they were written: such a function has the text of its expression as its name.

use crate::code::{FnId, Program};
use crate::print;
use crate::value::{Imm, Obj, Symbol, Value};

use super::clause::{Arith, Clause, Collect, Goal, GoalKind, Number, PredId, Term, VarNo};

/// No text is longer than this, in bytes.
const LIMIT: usize = 1 << 20;
/// Nor nested deeper.
const DEPTH: usize = 200;

/// A whole clause: `(<- (head …) goal…)`.
#[must_use]
pub fn clause(program: &Program, clause: &Clause) -> String {
    let mut text = Text::new(program, &clause.vars);
    text.put("(<- ");
    text.call(clause.predicate, &clause.head);
    if clause.priority != 0 {
        text.put(&format!(" :priority {}", clause.priority));
    }
    text.body(&clause.body);
    text.put(")");
    text.out
}

/// A goal; `vars` are the names of the variables of its clause.
#[must_use]
pub fn goal(program: &Program, goal: &Goal, vars: &[Symbol]) -> String {
    let mut text = Text::new(program, vars);
    text.goal(goal);
    text.out
}

/// A term; `vars` are the names of the variables of its clause.
#[must_use]
pub fn term(program: &Program, term: &Term, vars: &[Symbol]) -> String {
    let mut text = Text::new(program, vars);
    text.term(term);
    text.out
}

/// A call of a predicate, or a fact: `(on milk table)`.
#[must_use]
pub fn fact(program: &Program, predicate: PredId, args: &[Value]) -> String {
    let mut text = Text::new(program, &[]);
    text.put("(");
    text.name(predicate);
    for arg in args {
        text.put(" ");
        text.value(arg);
    }
    text.put(")");
    text.out
}

/// A value as it stands in a rule, where nothing is quoted.
#[must_use]
pub fn value(program: &Program, value: &Value) -> String {
    let mut text = Text::new(program, &[]);
    text.value(value);
    text.out
}

/// Text that grows.
struct Text<'a> {
    program: &'a Program,
    vars: &'a [Symbol],
    out: String,
    depth: usize,
}

impl<'a> Text<'a> {
    fn new(program: &'a Program, vars: &'a [Symbol]) -> Text<'a> {
        Text { program, vars, out: String::new(), depth: 0 }
    }

    fn put(&mut self, text: &str) {
        if self.out.len() + text.len() <= LIMIT {
            self.out.push_str(text);
        } else if !self.out.ends_with('…') {
            self.out.push('…');
        }
    }

    /// Something nested, unless it is too deep or there is no room for it.
    fn inner(&mut self, work: impl FnOnce(&mut Self)) {
        if self.depth >= DEPTH || self.out.len() >= LIMIT {
            return self.put("…");
        }
        self.depth += 1;
        work(self);
        self.depth -= 1;
    }

    fn name(&mut self, predicate: PredId) {
        let known = self.program.rules.predicates.get(predicate.at());
        let name = known.map_or("?", |known| known.declared.name.as_str());
        self.value(&Value::symbol(name));
    }

    fn call(&mut self, predicate: PredId, args: &[Term]) {
        self.put("(");
        self.name(predicate);
        self.terms(args);
        self.put(")");
    }

    /// Terms, a blank before each.
    fn terms(&mut self, terms: &[Term]) {
        for term in terms {
            self.put(" ");
            self.term(term);
        }
    }

    // ------------------------------------------------------------------ goals

    /// The goals of a body, a blank before each.
    fn body(&mut self, body: &Goal) {
        match &body.kind {
            GoalKind::True => {}
            GoalKind::And(goals) => self.goals(goals),
            _ => self.goals(std::slice::from_ref(body)),
        }
    }

    fn goals<'g>(&mut self, goals: impl IntoIterator<Item = &'g Goal>) {
        for goal in goals {
            self.put(" ");
            self.goal(goal);
        }
    }

    fn goal(&mut self, goal: &Goal) {
        self.inner(|it| it.goal_of(goal));
    }

    fn goal_of(&mut self, goal: &Goal) {
        match &goal.kind {
            GoalKind::Tick(_) => {}
            GoalKind::True => self.put("(true)"),
            GoalKind::False => self.put("(false)"),
            GoalKind::Cut => self.put("(cut)"),
            GoalKind::And(goals) => self.nested("and", goals),
            GoalKind::Or(goals) => self.nested("or", goals),
            GoalKind::Not(goal, _) => self.nested("not", [&**goal]),
            GoalKind::Once(goal) => self.nested("once", [&**goal]),
            GoalKind::ForAll(test, goal) => self.nested("forall", [&**test, &**goal]),
            GoalKind::If { test, then, otherwise, soft } => {
                let goals = [test, then].into_iter().chain(otherwise).map(|goal| &**goal);
                self.nested(if *soft { "*->" } else { "->" }, goals);
            }
            GoalKind::Call(predicate, args) => self.call(*predicate, args),
            GoalKind::CallValue(goal, more, _) => match super::control::without_scope(goal) {
                Some(goal) => self.term(&goal),
                None => self.with_terms("call", std::iter::once(goal).chain(more)),
            },
            GoalKind::Unify(a, b) => self.with_terms("==", [a, b]),
            GoalKind::Matches(a, b) => self.with_terms("matches", [a, b]),
            GoalKind::Identical(a, b) => self.with_terms("identical?", [a, b]),
            GoalKind::Compare(how, a, b) => self.with_numbers(how.sign(), a, b),
            GoalKind::Is(result, number) => {
                self.put("(is ");
                self.term(result);
                self.put(" ");
                self.number(number);
                self.put(")");
            }
            GoalKind::Fun(f, args, result) => self.fun(*f, args, result),
            GoalKind::Collect(what, template, goal, result) => self.collect(*what, template, goal, result),
            GoalKind::Bag { template, by, goal, list, set } => self.bag(template, by, goal, list, *set),
        }
    }

    fn nested<'g>(&mut self, head: &str, goals: impl IntoIterator<Item = &'g Goal>) {
        self.put("(");
        self.put(head);
        self.goals(goals);
        self.put(")");
    }

    fn with_terms<'t>(&mut self, head: &str, terms: impl IntoIterator<Item = &'t Term>) {
        self.put("(");
        self.put(head);
        for term in terms {
            self.put(" ");
            self.term(term);
        }
        self.put(")");
    }

    fn with_numbers(&mut self, head: &str, a: &Number, b: &Number) {
        self.put("(");
        self.put(head);
        for number in [a, b] {
            self.put(" ");
            self.number(number);
        }
        self.put(")");
    }

    fn fun(&mut self, f: FnId, args: &[Term], result: &Term) {
        let name = self.program.functions.get(f.at()).map_or(Symbol::from("?"), |function| function.name);
        if name.starts_with(['(', '[', '{']) {
            self.put("(is ");
            self.term(result);
            self.put(" ");
            self.put(&name);
            return self.put(")");
        }
        self.with_terms(&format!("fun {name}"), args.iter().chain([result]));
    }

    fn collect(&mut self, what: Collect, template: &Term, goal: &Goal, result: &Term) {
        let head = match what {
            Collect::List => "findall",
            Collect::Count => "count",
            Collect::Min => "min",
            Collect::Max => "max",
        };
        self.put("(");
        self.put(head);
        if what != Collect::Count {
            self.put(" ");
            self.term(template);
        }
        self.put(" ");
        self.goal(goal);
        self.put(" ");
        self.term(result);
        self.put(")");
    }

    /// Variables of the goal that are neither in the template nor group the answers stand under `exists`.
    fn bag(&mut self, template: &Term, by: &[VarNo], goal: &Goal, list: &Term, set: bool) {
        let mut inside = Vec::new();
        goal.each_var(&mut |var| inside.push(var));
        template.each_var(&mut |var| inside.retain(|other| *other != var));
        inside.retain(|var| !by.contains(var));
        inside.sort_unstable();
        inside.dedup();
        self.put(if set { "(setof " } else { "(bagof " });
        self.term(template);
        self.put(" ");
        if inside.is_empty() {
            self.goal(goal);
        } else {
            let names: Vec<&str> = inside.iter().map(|var| self.var(*var)).collect();
            let names = names.join(" ");
            self.put(&format!("(exists ({names}) "));
            self.goal(goal);
            self.put(")");
        }
        self.put(" ");
        self.term(list);
        self.put(")");
    }

    fn number(&mut self, number: &Number) {
        match number {
            Number::Term(term) => self.term(term),
            Number::Op(op, a, b) => self.inner(|it| it.with_numbers(arith_sign(*op), a, b)),
        }
    }

    // ------------------------------------------------------------------ terms

    fn var(&self, var: VarNo) -> &'a str {
        self.vars.get(var as usize).map_or("?", |name| name.as_str())
    }

    fn term(&mut self, term: &Term) {
        self.inner(|it| it.term_of(term));
    }

    fn term_of(&mut self, term: &Term) {
        match term {
            Term::Var(var) => self.put(self.var(*var)),
            Term::Any => self.put("?_"),
            Term::Const(value) => self.value(value),
            Term::Pair(first, rest) => self.list(first, rest),
            Term::Vector(items) => self.vector(items, Self::term),
            Term::Map(pairs) => self.map(pairs.iter().map(|pair| (&pair.0, &pair.1)), Self::term),
            Term::Desc(kind, properties) => {
                self.description(*kind, properties.iter().map(|it| (it.0, &it.1)), Self::term);
            }
        }
    }

    /// `[item…]`, for terms and values.
    fn vector<T>(&mut self, items: impl IntoIterator<Item = T>, show: fn(&mut Self, T)) {
        self.row("[", items, show, "]");
    }

    /// `{key value…}`
    fn map<'v, T>(&mut self, pairs: impl Iterator<Item = (&'v Value, T)>, show: fn(&mut Self, T)) {
        let pair = |it: &mut Self, (key, item): (&Value, T)| {
            it.value(key);
            it.put(" ");
            show(it, item);
        };
        self.row("{", pairs, pair, "}");
    }

    fn row<T>(
        &mut self,
        open: &str,
        items: impl IntoIterator<Item = T>,
        mut show: impl FnMut(&mut Self, T),
        close: &str,
    ) {
        self.put(open);
        for (at, item) in items.into_iter().enumerate() {
            self.put(if at > 0 { " " } else { "" });
            show(self, item);
        }
        self.put(close);
    }

    /// `(a kind (key value)…)`
    fn description<T>(
        &mut self,
        kind: Symbol,
        properties: impl Iterator<Item = (Symbol, T)>,
        show: fn(&mut Self, T),
    ) {
        self.put(if kind.starts_with(['a', 'o']) { "(an " } else { "(a " });
        self.put(&kind);
        for (key, item) in properties {
            self.put(&format!(" ({} ", print::write(&Value::Imm(Imm::Symbol(key)))));
            show(self, item);
            self.put(")");
        }
        self.put(")");
    }

    fn list(&mut self, first: &Term, rest: &Term) {
        self.put("(");
        self.term(first);
        let mut rest = rest;
        loop {
            match rest {
                Term::Pair(first, after) => {
                    self.put(" ");
                    self.term(first);
                    rest = after;
                }
                Term::Const(value) => {
                    self.elements(value, " ");
                    break;
                }
                other => {
                    self.put(" . ");
                    self.term(other);
                    break;
                }
            }
        }
        self.put(")");
    }

    /// The elements of a list with what stands before the first one.
    fn elements(&mut self, list: &Value, before: &str) {
        let mut before = before;
        let mut items = list.iter();
        for item in items.by_ref() {
            self.put(before);
            self.value(item);
            before = " ";
            if self.out.len() >= LIMIT {
                return;
            }
        }
        if !items.rest.is_nil() {
            self.put(" . ");
            self.value(items.rest);
        }
    }

    fn value(&mut self, value: &Value) {
        self.inner(|it| it.value_of(value));
    }

    fn value_of(&mut self, value: &Value) {
        match value {
            Value::Imm(Imm::Nil) => self.put("()"),
            Value::Imm(Imm::Var(name)) => self.put(name),
            Value::Imm(_) => self.put(&print::write(value)),
            Value::Obj(obj) => match &**obj {
                Obj::Pair(..) => {
                    self.put("(");
                    self.elements(value, "");
                    self.put(")");
                }
                Obj::Vector(items) => self.vector(items.iter(), Self::value),
                Obj::Map(map) => self.map(map.iter(), Self::value),
                Obj::Desc(desc) => self.description(desc.kind, desc.properties(), Self::value),
                _ => self.put(&print::Printer::new(Some(self.program), true, LIMIT).text(value)),
            },
        }
    }
}

fn arith_sign(op: Arith) -> &'static str {
    match op {
        Arith::Add => "+",
        Arith::Sub => "-",
        Arith::Mul => "*",
        Arith::Div => "/",
    }
}
