//! Clauses to forms.
//!
//! A term means different things in different places: `X - 1` behind `is` is computed, in an
//! argument it is data; `p` is a goal in a body, a symbol in an argument. So there is a function
//! for each place: [`Translator::goal`], [`Translator::number`], [`Translator::term`]. The operators
//! of goals get our names as arguments, too, since an argument may be called later.

use std::collections::HashSet;

use super::error::PrologError;
use super::names::{Names, Variables};
use super::table;
use super::term::{Name, Term, TermKind};
use crate::error::ParseError;
use crate::form::{Form, FormKind, Symbol};
use crate::span::Span;
use crate::token::{Report, show};

/// The greatest number of terms with commas between them in arguments: as data `a, b, c` is a
/// pair in a pair, and so one deeper for each.
const MAX_TUPLE: usize = 150;

/// Name and number of arguments of a predicate, as the text has them.
type Predicate = (Symbol, usize);

/// What stands where: a goal to prove, or data.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    Goal,
    Data,
}

/// Turns the clauses of a text into forms.
pub(super) struct Translator {
    pub(super) report: Report,
    names: Names,
    variables: Variables,
    /// The predicates to which the text gives clauses.
    defined: HashSet<Predicate>,
    /// The predicates of `table` directives.
    tabled: HashSet<Predicate>,
    /// Commas in arguments around the term that is looked at.
    commas: usize,
    /// The goal is one of `bagof`, which groups by its variables: those without a name, too.
    grouping: bool,
}

/// Where a term stands, and in it the name that becomes the head of a list.
#[derive(Clone, Copy)]
struct At {
    head: Span,
    whole: Span,
}

/// For what no name of the text stands for.
impl From<Span> for At {
    fn from(whole: Span) -> At {
        At { head: whole, whole }
    }
}

/// `head :- body`
struct Clause<'t> {
    predicate: Predicate,
    head: &'t Term,
    body: Option<&'t Term>,
    at: At,
}

impl Translator {
    pub(super) fn new(report: Report) -> Translator {
        Translator {
            report,
            names: Names::default(),
            variables: Variables::default(),
            defined: HashSet::new(),
            tabled: HashSet::new(),
            commas: 0,
            grouping: false,
        }
    }

    /// The forms of a text with the clauses and directives `terms`.
    pub(super) fn program(&mut self, name: &str, terms: &[Term]) -> Vec<Form> {
        let mut forms = Vec::new();
        let clauses: Vec<Clause> = terms.iter().filter_map(|term| self.sort(term, &mut forms)).collect();
        self.defined = clauses.iter().map(|clause| clause.predicate).collect();
        let (mut plain, mut tabled) = (Vec::new(), Vec::new());
        for clause in &clauses {
            let group = if self.tabled.contains(&clause.predicate) { &mut tabled } else { &mut plain };
            group.push(self.clause(clause));
        }
        let tabled_name = if plain.is_empty() { name.into() } else { format!("{name}-tabled") };
        forms.extend(self.group(name, None, plain));
        forms.extend(self.group(&tabled_name, Some("tabled"), tabled));
        forms
    }

    /// `(def-rules name clause…)`, if there are clauses.
    fn group(&self, name: &str, option: Option<&str>, clauses: Vec<Form>) -> Option<Form> {
        let span = clauses.first()?.span.to(clauses.last()?.span);
        let start = Span { end: span.start, ..span };
        let mut items = vec![symbol("def-rules", start), symbol(name, start)];
        items.extend(option.map(|option| Form::new(FormKind::Keyword(option.into()), start)));
        items.extend(clauses);
        Some(Form::new(FormKind::List(items), span))
    }

    // ----------------------------------------------------------------------------------------
    // Clauses and directives

    /// A clause is given back, a directive is obeyed; what it makes is added to `forms`.
    fn sort<'t>(&mut self, term: &'t Term, forms: &mut Vec<Form>) -> Option<Clause<'t>> {
        let start = Span { end: term.span.start, ..term.span };
        let (arrow, head, body) = match term.call() {
            Some((name, [directive])) if name.text == ":-" => {
                self.directive(directive, forms);
                return None;
            }
            Some((name, [_])) if name.text == "?-" => {
                let help = "delete it; ask with `(ask goal)` in a plan, or on the command line";
                self.not_taken("a query".into(), term.span, help);
                return None;
            }
            Some((name, [_, _])) if name.text == "-->" => {
                let help = "write a rule with the lists as two more arguments";
                self.not_taken("a grammar rule `-->`".into(), term.span, help);
                return None;
            }
            Some((name, [head, body])) if name.text == ":-" => (name.span, head, Some(body)),
            _ => (start, term, None),
        };
        let predicate = self.predicate(head)?;
        Some(Clause { predicate, head, body, at: At { head: arrow, whole: term.span } })
    }

    /// The predicate of a head, if it may get clauses.
    fn predicate(&mut self, head: &Term) -> Option<Predicate> {
        let Some((name, arguments)) = head.call() else {
            let help = "a head is a name with its arguments, such as `p(X)`";
            self.not_callable(head, "head of a clause", help);
            return None;
        };
        let count = arguments.len();
        // A chain has more than two parts.
        let count = if matches!(name.text.as_str(), "," | ";") { count.min(2) } else { count };
        if name.text == ":" {
            self.not_taken("the module of a predicate".into(), name.span, "write the name alone");
            return None;
        }
        if table::is_built_in(&name.text, count) {
            let what = format!("a clause of the built-in `{}`", show(&name.text));
            self.not_taken(what, head.span, "give your predicate another name");
            return None;
        }
        Some((name.text, count))
    }

    fn clause(&mut self, clause: &Clause) -> Form {
        self.variables.clear();
        let head = self.data(clause.head);
        // A name alone is a symbol as data, and a list of one as a head.
        let alone = matches!(clause.head.kind, TermKind::Atom(_));
        let mut items = vec![if alone { list(vec![head], clause.head.span) } else { head }];
        if let Some(body) = clause.body {
            items.extend(body.parts(",").into_iter().map(|goal| self.goal(goal)));
        }
        call("<-", items, clause.at)
    }

    fn directive(&mut self, term: &Term, forms: &mut Vec<Form>) {
        let Some((name, arguments)) = term.call() else {
            return self.not_callable(term, "directive", "a directive is a name with its arguments");
        };
        let help = match (name.text.as_str(), arguments) {
            ("dynamic" | "discontiguous" | "multifile", [_, ..]) => return self.open(arguments, forms),
            ("table", [_, ..]) => {
                let predicates = self.indicators(arguments);
                self.tabled.extend(predicates.iter().map(|(name, count)| (name.text, *count)));
                return;
            }
            ("use_module" | "ensure_loaded", [library, ..]) if is_list_library(library) => return,
            ("use_module" | "ensure_loaded", _) => {
                "the predicates for lists are always there, other libraries are not; load your own files with `use-rules`"
            }
            ("op", _) => "operators cannot be added: write such terms as `name(a, b)`",
            ("initialization", _) => "delete it and ask from a plan",
            ("module", _) => "delete it: all predicates of a file are seen by who uses it",
            _ => "delete it, or say in a plan what it does",
        };
        self.not_taken(format!("the directive `{}`", show(&name.text)), term.span, help);
    }

    /// `:- dynamic p/2, q/1.`
    fn open(&mut self, arguments: &[Term], forms: &mut Vec<Form>) {
        for (name, count) in self.indicators(arguments) {
            let predicate = Form::new(FormKind::Symbol(self.names.of(&name, &mut self.report)), name.span);
            let count = Form::new(FormKind::Int(i64::try_from(count).unwrap_or(i64::MAX)), name.span);
            let form = list(vec![symbol("def-open", name.span), predicate, count], name.span);
            if !forms.contains(&form) {
                forms.push(form);
            }
        }
    }

    /// The predicates `p/2, q/1` or `[p/2, q/1]`.
    fn indicators(&mut self, arguments: &[Term]) -> Vec<(Name, usize)> {
        let mut found = Vec::new();
        for part in arguments.iter().flat_map(|argument| argument.parts(",")) {
            let items = match &part.kind {
                TermKind::List(items, None) => items.as_slice(),
                _ => std::slice::from_ref(part),
            };
            for item in items {
                match indicator(item) {
                    Some(predicate) => found.push(predicate),
                    None => {
                        let help = "write names with their numbers of arguments: `p/2, q/1`";
                        self.not_taken("this form of a declaration".into(), item.span, help);
                    }
                }
            }
        }
        found
    }

    // ----------------------------------------------------------------------------------------
    // Goals

    fn goal(&mut self, term: &Term) -> Form {
        if let TermKind::Variable(_) = term.kind {
            let goal = self.data(term);
            return call("call", vec![goal], term.span);
        }
        let Some((name, arguments)) = term.call().filter(|(name, _)| name.text != "[]") else {
            self.not_callable(term, "goal", "a goal is a name with its arguments, such as `p(X)`");
            return call("true", Vec::new(), term.span);
        };
        let at = At { head: name.span, whole: term.span };
        if let Some(form) = self.operators(name, arguments, at, Place::Goal) {
            return form;
        }
        if let Some(form) = self.control(name, arguments, at) {
            return form;
        }
        let predicate = (name.text, arguments.len());
        if let Some(ours) = table::goal(&name.text, arguments.len()) {
            return call(ours, self.all_data(arguments), at);
        }
        if let Some(help) = table::not_taken(&name.text).filter(|_| !self.defined.contains(&predicate)) {
            return self.left_out(format!("`{}`", show(&name.text)), term.span, help);
        }
        match (name.text.as_str(), arguments) {
            ("\\+" | "not", _) => {
                let help = "write `\\+ (a, b)` with a blank, or `not((a, b))`, for more than one goal";
                self.left_out(format!("`{}` of {} arguments", name.text, predicate.1), term.span, help)
            }
            (":", [_, _]) => self.left_out("the module of a goal".into(), term.span, "write the goal alone"),
            ("...", []) => {
                self.left_out("`...`".into(), term.span, "write the goals that it stands for, or delete it")
            }
            _ => {
                let mut items = vec![self.name(&name)];
                items.extend(self.all_data(arguments));
                list(items, term.span)
            }
        }
    }

    /// Built-in predicates that take goals, or whose shape changes.
    fn control(&mut self, name: Name, arguments: &[Term], at: At) -> Option<Form> {
        let text = name.text.as_str();
        let defined = self.defined.contains(&(name.text, arguments.len()));
        Some(match (text, arguments) {
            ("not", [goal]) => call("not", vec![self.inside(false, |it| it.goal(goal))], at),
            ("call", [Term { kind: TermKind::Variable(_), .. }]) => {
                call("call", self.all_data(arguments), at)
            }
            ("once" | "call", [goal]) => call(text, vec![self.goal(goal)], at),
            ("call", [_, _, ..]) => call("call", self.all_data(arguments), at),
            ("ignore", [goal]) if !defined => {
                let truth = || call("true", Vec::new(), at);
                call("->", vec![self.goal(goal), truth(), truth()], at)
            }
            ("nonvar", [value]) => call("bound?", vec![self.data(value)], at),
            ("memberchk", [_, _]) if !defined => {
                let member = call("member", self.all_data(arguments), at);
                call("once", vec![member], at)
            }
            ("forall", [condition, goal]) => {
                let items = self.inside(false, |it| vec![it.goal(condition), it.goal(goal)]);
                call("forall", items, at)
            }
            ("findall", [template, goal, all]) => {
                let template = self.inside(false, |it| it.data(template));
                let goal = self.inside(false, |it| it.goal(goal));
                let items = vec![template, goal, self.data(all)];
                call("findall", items, at)
            }
            ("bagof" | "setof", [template, goal, all]) => {
                let template = self.inside(false, |it| it.data(template));
                let items = vec![template, self.quantified(goal), self.data(all)];
                call(text, items, at)
            }
            _ => return None,
        })
    }

    /// What is inside of a goal that groups by its variables, or of one that lets none out.
    fn inside<T>(&mut self, grouping: bool, work: impl FnOnce(&mut Self) -> T) -> T {
        let around = std::mem::replace(&mut self.grouping, grouping);
        let done = work(self);
        self.grouping = around;
        done
    }

    /// `V^G` as `(exists (?v) g)`.
    fn quantified(&mut self, term: &Term) -> Form {
        let (mut goal, mut bound) = (term, Vec::new());
        while let Some([variables, rest]) = goal.arguments("^", 2) {
            self.variables_of(variables, &mut bound);
            goal = rest;
        }
        let form = self.inside(true, |it| it.goal(goal));
        if bound.is_empty() { form } else { call("exists", vec![list(bound, term.span), form], term.span) }
    }

    /// Adds the variables of `term` that are not yet in `found`.
    fn variables_of(&mut self, term: &Term, found: &mut Vec<Form>) {
        match &term.kind {
            TermKind::Variable(_) => {
                let form = self.data(term);
                if !found.contains(&form) {
                    found.push(form);
                }
            }
            TermKind::Compound(_, terms) => terms.iter().for_each(|term| self.variables_of(term, found)),
            TermKind::List(items, rest) => {
                items.iter().chain(rest.as_deref()).for_each(|term| self.variables_of(term, found));
            }
            _ => {}
        }
    }

    /// Operators between goals and comparisons; `None` if `name` is none.
    fn operators(&mut self, name: Name, arguments: &[Term], at: At, place: Place) -> Option<Form> {
        let text = name.text.as_str();
        Some(match (text, arguments) {
            (",", [_, _, ..]) if place == Place::Goal => {
                let mut goals = Vec::new();
                for term in arguments {
                    goals.extend(term.parts(",").into_iter().map(|goal| self.goal(goal)));
                }
                call("and", goals, at)
            }
            (",", [_, _, ..]) => self.pairs(arguments, at.whole),
            (";", [_, _, ..]) => self.alternatives(arguments, place),
            ("->" | "*->", [test, then]) => call(text, self.both(test, then, place), at),
            ("\\+", [goal]) => call("not", vec![self.inside(false, |it| it.part(goal, place))], at),
            ("\\=", [_, _]) => {
                let same = call("==", self.all_data(arguments), at);
                call("not", vec![same], at)
            }
            ("\\==", [_, _]) => {
                let same = call("identical?", self.all_data(arguments), at);
                call("not", vec![same], at)
            }
            ("=" | "==" | "@<", [_, _]) => {
                call(table::goal(text, 2).unwrap_or(text), self.all_data(arguments), at)
            }
            ("@>", [left, right]) => self.comes_before(right, left, at),
            ("@=<", [left, right]) => {
                let before = self.comes_before(right, left, at);
                call("not", vec![before], at)
            }
            ("@>=", [left, right]) => {
                let before = self.comes_before(left, right, at);
                call("not", vec![before], at)
            }
            ("is", [result, value]) => {
                let items = vec![self.data(result), self.value(value, place)];
                call("is", items, at)
            }
            (_, [left, right]) => {
                let ours = table::comparison(text, 2)?;
                let items = vec![self.value(left, place), self.value(right, place)];
                call(ours, items, at)
            }
            _ => return None,
        })
    }

    fn comes_before(&mut self, first: &Term, second: &Term, at: At) -> Form {
        let items = vec![self.data(first), self.data(second)];
        call("comes-before?", items, at)
    }

    /// `a ; b ; c`, in which `c -> t ; e` is one alternative.
    fn alternatives(&mut self, terms: &[Term], place: Place) -> Form {
        let mut forms = Vec::new();
        for (index, term) in terms.iter().enumerate() {
            let rest = &terms[index + 1..];
            match term.call() {
                Some((name, [test, then]))
                    if matches!(name.text.as_str(), "->" | "*->") && !rest.is_empty() =>
                {
                    let mut items = self.both(test, then, place);
                    items.push(self.alternatives(rest, place));
                    let span = term.span.to(rest.last().map_or(term.span, |last| last.span));
                    forms.push(call(&name.text, items, At { head: name.span, whole: span }));
                    break;
                }
                _ => forms.push(self.part(term, place)),
            }
        }
        match (forms.pop(), forms.is_empty()) {
            (Some(only), true) => only,
            (last, _) => {
                forms.extend(last);
                let (first, last) = (forms.first(), forms.last());
                let span = first.zip(last).map_or(Span::default(), |(first, last)| first.span.to(last.span));
                call("or", forms, span)
            }
        }
    }

    fn both(&mut self, one: &Term, other: &Term, place: Place) -> Vec<Form> {
        vec![self.part(one, place), self.part(other, place)]
    }

    fn part(&mut self, term: &Term, place: Place) -> Form {
        if place == Place::Goal { self.goal(term) } else { self.data(term) }
    }

    // ----------------------------------------------------------------------------------------
    // Numbers

    /// What an operator on numbers computes with, if it is a goal.
    fn value(&mut self, term: &Term, place: Place) -> Form {
        if place == Place::Goal { self.number(term) } else { self.data(term) }
    }

    /// An expression.
    fn number(&mut self, term: &Term) -> Form {
        let Some((name, arguments)) = term.call() else { return self.data(term) };
        let (span, at) = (term.span, At { head: name.span, whole: term.span });
        let constant = table::constant(&name.text).filter(|_| arguments.is_empty());
        match (name.text.as_str(), arguments) {
            _ if constant.is_some() => Form::new(FormKind::Float(constant.unwrap_or_default()), span),
            ("max_integer", []) => Form::new(FormKind::Int(i64::MAX), span),
            ("min_integer", []) => Form::new(FormKind::Int(i64::MIN), span),
            (_, []) => self.data(term),
            (">>", [bits, by]) => {
                let by = call("-", vec![self.number(by)], at);
                call("shift", vec![self.number(bits), by], at)
            }
            ("log", [base, x]) => call("log", vec![self.number(x), self.number(base)], at),
            ("log2", [x]) => call("log", vec![self.number(x), Form::new(FormKind::Int(2), span)], at),
            ("round" | "integer", [_]) => {
                let what = format!("the function `{}`", name.text);
                let help = "halves go to the even number in our `round`: write `floor(X + 0.5)`";
                self.left_out(what, span, help)
            }
            _ => {
                let head = match table::function(&name.text, arguments.len()) {
                    Some(ours) => symbol(ours, name.span),
                    None => self.name(&name),
                };
                let mut items = vec![head];
                items.extend(arguments.iter().map(|argument| self.number(argument)));
                list(items, span)
            }
        }
    }

    // ----------------------------------------------------------------------------------------
    // Data

    fn all_data(&mut self, terms: &[Term]) -> Vec<Form> {
        terms.iter().map(|term| self.data(term)).collect()
    }

    fn data(&mut self, term: &Term) -> Form {
        let kind = match &term.kind {
            TermKind::Variable(name) if *name == "_" && self.grouping => {
                FormKind::Symbol(self.variables.new_one())
            }
            TermKind::Variable(name) => FormKind::Symbol(self.variables.of(*name)),
            TermKind::Atom(name) => return self.name(name),
            TermKind::Int(value) => FormKind::Int(*value),
            TermKind::Float(value) => FormKind::Float(*value),
            TermKind::Str(text) => FormKind::Str(text.clone()),
            TermKind::List(items, rest) => return self.list(items, rest.as_deref(), term.span),
            TermKind::Curly => {
                let help = "write a compound term or a list";
                return self.left_out("a term in curly brackets".into(), term.span, help);
            }
            TermKind::Compound(name, arguments) => {
                let at = At { head: name.span, whole: term.span };
                if let Some(form) = self.operators(*name, arguments, at, Place::Data) {
                    return form;
                }
                let mut items = vec![self.name(name)];
                items.extend(self.all_data(arguments));
                FormKind::List(items)
            }
        };
        Form::new(kind, term.span)
    }

    /// A name as a symbol, `[]` as the empty list.
    fn name(&mut self, name: &Name) -> Form {
        let ours = self.names.of(name, &mut self.report);
        let kind = if name.text == "[]" { FormKind::List(Vec::new()) } else { FormKind::Symbol(ours) };
        Form::new(kind, name.span)
    }

    /// `[a, B|Rest]`; a rest that is a list again goes on with it.
    fn list(&mut self, items: &[Term], rest: Option<&Term>, span: Span) -> Form {
        let mut forms = self.all_data(items);
        let mut rest = rest;
        while let Some(Term { kind: TermKind::List(items, next), .. }) = rest {
            forms.extend(self.all_data(items));
            rest = next.as_deref();
        }
        if let Some(rest) = rest {
            forms.push(symbol(".", rest.span));
            forms.push(self.data(rest));
        }
        if forms.is_empty() {
            return self.name(&Name { text: "[]".into(), quoted: false, span });
        }
        list(forms, span)
    }

    /// `a, b, c` as data: a pair whose second part is a pair.
    fn pairs(&mut self, terms: &[Term], span: Span) -> Form {
        let commas = terms.len() - 1;
        if self.commas + commas > MAX_TUPLE {
            self.report.push(ParseError::TooDeep { limit: MAX_TUPLE, at: span });
            return symbol("nil", span);
        }
        self.commas += commas;
        let forms = self.all_data(terms);
        self.commas -= commas;
        let pair = |rest: Form, first: Form| {
            let span = first.span.to(rest.span);
            call("and", vec![first, rest], span)
        };
        forms.into_iter().rev().reduce(pair).unwrap_or_else(|| symbol("nil", span))
    }

    // ----------------------------------------------------------------------------------------
    // What is not taken

    fn not_taken(&mut self, what: String, at: Span, help: &'static str) {
        self.report.push(PrologError::NotTaken { what, at, help }.into());
    }

    /// Stands in for what is not taken, so that the rest of the clause is still looked at.
    fn left_out(&mut self, what: String, at: Span, help: &'static str) -> Form {
        self.not_taken(what, at, help);
        call("true", Vec::new(), at)
    }

    fn not_callable(&mut self, term: &Term, wanted: &'static str, help: &'static str) {
        let what = match &term.kind {
            TermKind::Variable(_) => "a variable",
            TermKind::Int(_) | TermKind::Float(_) => "a number",
            TermKind::Str(_) => "a string",
            _ => "this term",
        };
        self.report.push(PrologError::NotCallable { what, wanted, at: term.span, help }.into());
    }
}

/// `p/2`
fn indicator(term: &Term) -> Option<(Name, usize)> {
    let [name, count] = term.arguments("/", 2)? else { return None };
    let (TermKind::Atom(name), TermKind::Int(count)) = (&name.kind, &count.kind) else { return None };
    Some((*name, usize::try_from(*count).ok()?))
}

/// `library(lists)`: what it defines is always there.
fn is_list_library(term: &Term) -> bool {
    let name = term.arguments("library", 1).and_then(|arguments| arguments.first()?.call());
    name.is_some_and(|(name, _)| name.text == "lists")
}

fn symbol(name: &str, span: Span) -> Form {
    Form::new(FormKind::Symbol(name.into()), span)
}

fn list(items: Vec<Form>, span: Span) -> Form {
    Form::new(FormKind::List(items), span)
}

/// `(head items…)`
fn call(head: &str, mut items: Vec<Form>, at: impl Into<At>) -> Form {
    let at = at.into();
    items.insert(0, symbol(head, at.head));
    list(items, at.whole)
}
