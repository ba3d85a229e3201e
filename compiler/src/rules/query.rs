//! Queries: a goal becomes a hidden predicate of one clause, whose head takes the values that the
//! goal has from outside and gives, as its last argument, what is asked for.

use grammar::{FileId, Form, Span};
use vm::code::Place;
use vm::rules::clause::{Clause, Declared, Goal, Kind, PredId, Term, VarNo};
use vm::value::{Map, Symbol, Value};

use super::{Rule, place};
use crate::error::CompileError;
use crate::module::ModuleId;
use crate::{Compiler, Front, Program, Report};

/// A goal that is not part of a plan: typed at a prompt, or given to `pleach query`.
#[derive(Debug, Clone)]
pub struct CompiledGoal {
    /// Its predicate: one argument, the list of the values of its variables.
    pub predicate: PredId,
    /// Its variables, in the order of the text.
    pub variables: Vec<Symbol>,
}

/// What a query gives for each answer.
#[derive(Clone, Copy)]
pub(crate) enum Template<'f> {
    /// That there is one.
    True,
    /// A term.
    Term(&'f Form),
    /// The values of these variables, as a list.
    List(&'f [Form]),
    /// The values of all variables that are not bound: a map.
    Map,
    /// The same as a list.
    All,
}

/// A variable of a query that gets its value from outside, if it can.
pub(crate) type Input = (Symbol, Span);

/// A query whose goal has been resolved.
pub(crate) struct Question {
    rule: Rule,
    body: Goal,
    template: Term,
    /// Variables of the template.
    asked: Vec<VarNo>,
    /// The mistakes that there were before it.
    before: usize,
}

impl Compiler<'_> {
    /// Resolves the goals of a query.
    pub(crate) fn question(
        &mut self,
        module: ModuleId,
        goals: &[Form],
        span: Span,
        of: Template<'_>,
    ) -> Question {
        let before = self.reports.len();
        let mut rule = Rule::new(module);
        let kind = self.conjunction(&mut rule, goals);
        let body = Goal { kind, place: place(span) };
        let known = rule.vars.len();
        // What only the template has is no answer.
        rule.closed += 1;
        let template = match of {
            Template::Term(form) => self.term(&mut rule, form),
            Template::List(forms) => list(self.terms(&mut rule, forms)),
            Template::True => Term::Const(Value::TRUE),
            Template::Map | Template::All => Term::Const(Value::NIL),
        };
        rule.closed -= 1;
        let mut asked = Vec::new();
        template.each_var(&mut |var| asked.push(var));
        asked.retain(|var| (*var as usize) < known);
        Question { rule, body, template, asked, before }
    }
}

impl Question {
    /// The variables that have their values from outside, if they have values there.
    pub(crate) fn inputs(&self) -> Vec<(VarNo, Input)> {
        let vars = self.rule.vars.iter().enumerate();
        let vars = vars.filter(|(at, var)| !var.local && !self.asked.contains(&(*at as VarNo)));
        vars.map(|(at, var)| (at as VarNo, (var.name, var.span))).collect()
    }

    /// Asks for variables that are not bound: all that can be seen from outside.
    fn ask_for(&mut self, bound: &[VarNo], of: Template<'_>) {
        let is_free = |(at, _): &(VarNo, Input)| !bound.contains(at) && self.rule.vars[*at as usize].seen;
        let free: Vec<(VarNo, Input)> = self.inputs().into_iter().filter(is_free).collect();
        self.asked.extend(free.iter().map(|(at, _)| *at));
        self.template = match of {
            Template::Map => map(free),
            _ => list(free.into_iter().map(|(at, _)| Term::Var(at)).collect()),
        };
    }
}

impl Compiler<'_> {
    /// Makes the predicate of a query whose `inputs` have values. `head` is the form that asks.
    pub(crate) fn answer(
        &mut self,
        mut question: Question,
        inputs: &[VarNo],
        of: Template<'_>,
        head: &str,
        span: Span,
    ) -> PredId {
        if matches!(of, Template::Map | Template::All) {
            question.ask_for(inputs, of);
        }
        let unbound: Vec<Input> = question
            .inputs()
            .into_iter()
            .filter(|(at, _)| !inputs.contains(at))
            // A variable that does not leave `not` or `findall` needs no value; one of the template does.
            .filter(|(at, _)| question.rule.vars[*at as usize].seen || in_term(&question.template, *at))
            .map(|(_, input)| input)
            .collect();
        for (name, at) in unbound {
            let is_asked = question.rule.vars.iter().any(|var| var.name == name && !var.seen);
            let help = match (head, is_asked) {
                (_, true) => format!("the goal does not mention `{name}`"),
                ("for-each-answer", _) => format!(
                    "list it, bind it with `let` around the form, or write `?_`: (for-each-answer ({name} …) …)"
                ),
                ("ask", _) => "bind it with `let` or a parameter, or write `?_` if any value will do".into(),
                _ => format!(
                    "put `{name}` into the template, bind it with `let` around the form, or write `?_`"
                ),
            };
            self.error(CompileError::Unbound { name: name.to_string(), at, help: Some(help) });
        }
        let vars = inputs.iter().map(|var| Term::Var(*var));
        let args: Vec<Term> = vars.chain([question.template]).collect();
        if args.len() > super::MOST_ARGS {
            self.error(CompileError::ClauseTooLarge { limit: super::MOST_ARGS, at: span });
        }
        let place = place(span);
        let predicate = self.hidden_predicate(head, args.len(), place);
        let vars = question.rule.var_names();
        let mut clause = Clause {
            predicate,
            head: args,
            open: false,
            body: question.body,
            vars,
            priority: 0,
            text: 0,
            place,
        };
        if self.reports[question.before..].iter().all(Report::is_warning) {
            self.check_flow(&mut clause, Some(inputs.len()));
            self.program.rules.add(clause);
        }
        predicate
    }

    /// A predicate that has no name in any module.
    fn hidden_predicate(&mut self, name: &str, arity: usize, place: Place) -> PredId {
        let name = Symbol::from(name);
        self.program.rules.declare(Declared {
            name,
            arity: arity as u8,
            kind: Kind::Rules,
            tabled: false,
            place,
        })
    }

    /// A goal as it is typed.
    fn typed_goal(&mut self, module: ModuleId, file: FileId, text: &str) -> Option<CompiledGoal> {
        let parsed = grammar::parse(file, text);
        self.reports.extend(parsed.errors.into_iter().map(Report::Parse));
        if !self.reports.is_empty() {
            return None;
        }
        let span = match parsed.forms.as_slice() {
            [] => {
                let (form, problem) = ("?-".to_string(), "has no goal".to_string());
                let (shape, at) = ("?- (predicate ?x …)".to_string(), Span::new(file, 0, text.len()));
                self.error(CompileError::Shape { form, problem, shape, at });
                return None;
            }
            [first, ..] => parsed.forms.last().map_or(first.span, |last| first.span.to(last.span)),
        };
        let question = self.question(module, &parsed.forms, span, Template::All);
        let seen = question.rule.vars.iter().filter(|var| !var.local && var.seen);
        let variables = seen.map(|var| var.name).collect();
        let predicate = self.answer(question, &[], Template::All, "query", span);
        Some(CompiledGoal { predicate, variables })
    }
}

impl Front {
    /// Compiles a goal, all of whose variables are asked for.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn compile_goal(
        &mut self,
        program: &mut Program,
        module: ModuleId,
        file: FileId,
        text: &str,
    ) -> Result<CompiledGoal, Vec<Report>> {
        self.made(program, |compiler| compiler.typed_goal(module, file, text))
    }
}

fn in_term(term: &Term, var: VarNo) -> bool {
    let mut found = false;
    term.each_var(&mut |other| found |= other == var);
    found
}

fn list(terms: Vec<Term>) -> Term {
    let end = Term::Const(Value::NIL);
    terms.into_iter().rev().fold(end, |rest, first| Term::Pair(Box::new(first), Box::new(rest)))
}

/// `{?x value …}`
fn map(vars: Vec<(VarNo, Input)>) -> Term {
    if vars.is_empty() {
        return Term::Const(Value::map(Map::new()));
    }
    let mut pairs: Vec<(Value, Term)> =
        vars.into_iter().map(|(at, (name, _))| (Value::symbol(&name), Term::Var(at))).collect();
    pairs.sort_by(|a, b| a.0.cmp(&b.0));
    Term::Map(pairs)
}
