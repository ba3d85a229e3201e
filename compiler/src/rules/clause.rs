//! Clauses and facts, and what can be said against them.

use std::collections::BTreeMap;

use grammar::{Form, FormKind, Span};
use vm::rules::clause::{Clause, Goal, GoalKind, Kind, PredId, Term};
use vm::rules::show;
use vm::value::{Imm, Symbol, Value};

use super::declare::Group;
use super::flow::Flow;
use super::{Rule, Staged, place};
use crate::error::CompileError;
use crate::module::{Definition, Found, Meaning, ModuleId, nearest};
use crate::{Compiler, Report};

/// What has been seen of a group, to find clauses that nothing reaches.
#[derive(Default)]
struct Seen {
    /// Clauses by their text, with variables by number.
    clauses: BTreeMap<String, Span>,
    facts: BTreeMap<(PredId, Vec<Value>), Span>,
    /// The clause of a predicate that takes everything and cuts, and its priority.
    last: BTreeMap<PredId, (i64, Span)>,
}

impl Compiler<'_> {
    /// Resolves the clauses of a group; `text` is the number of the text that they stand in.
    pub(crate) fn resolve_group(&mut self, group: &Group, text: u32) {
        let around = std::mem::replace(&mut self.within, group.within.clone());
        let mut seen = Seen::default();
        for (predicate, form) in &group.clauses {
            if group.facts {
                self.fact(group, *predicate, form, text, &mut seen);
                continue;
            }
            if let Some(clause) = self.clause(group, *predicate, form, text) {
                self.check_reached(&clause, form.span, &mut seen);
                self.staged.push(Staged::Clause(clause));
            }
        }
        self.within = around;
        self.mentioned.clear();
    }

    /// A fact: a row of constants, or a clause of an open predicate.
    fn fact(&mut self, group: &Group, predicate: PredId, form: &Form, text: u32, seen: &mut Seen) {
        let mut rule = Rule::new(group.module);
        let before = self.reports.len();
        let args = form.list().unwrap_or_default();
        let mut values = Vec::new();
        for arg in args.iter().skip(1) {
            match self.term(&mut rule, arg) {
                Term::Const(value) => values.push(value),
                _ if self.reports.len() > before => return,
                _ => {
                    let help = "what holds for all values is a clause: (def-rules … (<- (p ?x)))";
                    self.no_term("a fact has a variable in it", arg.span, Some(help));
                    return;
                }
            }
        }
        if let Some(first) = seen.facts.insert((predicate, values.clone()), form.span) {
            self.unreachable(
                "the second of two equal facts",
                form.span,
                "the same",
                first,
                "leave out one of the two",
            );
        }
        let declared = &self.program.rules.predicates[predicate.at()].declared;
        self.staged.push(match declared.kind {
            Kind::Facts => Staged::Fact(predicate, values),
            _ => Staged::Clause(Clause {
                predicate,
                head: values.into_iter().map(Term::Const).collect(),
                open: false,
                body: Goal { kind: GoalKind::True, place: place(form.span) },
                vars: Vec::new(),
                priority: 0,
                text,
                place: place(form.span),
            }),
        });
    }

    /// `(<- (head …) :priority n goal…)`
    fn clause(&mut self, group: &Group, predicate: PredId, form: &Form, text: u32) -> Option<Clause> {
        let items = form.list().unwrap_or_default();
        let mut rule = Rule::new(group.module);
        let before = self.reports.len();
        let forms = &items.get(1)?.list()?[1..];
        let mut head = self.terms(&mut rule, forms);
        let name = self.program.rules.predicates[predicate.at()].declared.name;
        if let (vm::rules::GROUNDING, [_, call]) = (name.as_str(), &mut head[..]) {
            self.name_plan(group.module, call, forms.last().map_or(form.span, |call| call.span));
        }
        let (priority, goals) = match &items[2..] {
            [Form { kind: FormKind::Keyword(word), .. }, Form { kind: FormKind::Int(n), .. }, goals @ ..]
                if *word == "priority" =>
            {
                (*n, goals)
            }
            [Form { kind: FormKind::Keyword(_), span }, ..] => {
                let problem = "takes `:priority` and an integer after its head".into();
                let shape = "(<- (head …) :priority 10 goal…)".into();
                self.error(CompileError::Shape { form: "<-".into(), problem, shape, at: *span });
                return None;
            }
            goals => (0, goals),
        };
        let kind = self.conjunction(&mut rule, goals);
        // What goes wrong in the only goal is shown there.
        let body = Goal { kind, place: place(if let [goal] = goals { goal.span } else { form.span }) };
        let vars = rule.var_names();
        // Its clauses match descriptions that say more than their heads.
        let open = name == vm::rules::GROUNDING;
        let place = place(form.span);
        let mut clause = Clause { predicate, head, open, body, vars, priority, text, place };
        if self.reports[before..].iter().all(Report::is_warning) {
            self.check_flow(&mut clause, None);
            self.check_singletons(&rule);
        }
        Some(clause)
    }

    /// In what an action is grounded to the name of a plan means the plan.
    fn name_plan(&mut self, module: ModuleId, call: &mut Term, at: Span) {
        let name = match &*call {
            Term::Pair(first, _) => match &**first {
                Term::Const(value) => value.as_symbol(),
                _ => None,
            },
            Term::Const(value) => value.as_pair().and_then(|(first, _)| first.as_symbol()),
            _ => None,
        };
        let Some(name) = name else { return };
        let plan = match self.look_up(module, name) {
            Found::One(Definition { meaning: Meaning::Plan(id, _) | Meaning::Function(id, _), .. }) => {
                Value::Imm(Imm::Function(id))
            }
            _ => {
                let names = self.modules.visible(module);
                let near = nearest(&name, names.iter().map(|it| it.as_str()));
                let help = near.map(|near| format!("did you mean `{near}`?"));
                self.error(CompileError::UnknownName { name: name.to_string(), at, help });
                return;
            }
        };
        match call {
            Term::Pair(first, _) => **first = Term::Const(plan),
            Term::Const(value) => {
                let args = value.as_pair().map_or(Value::NIL, |pair| pair.1.clone());
                *value = Value::cons(plan, args);
            }
            _ => {}
        }
    }

    /// Follows the values through a clause; a query has values for its first `given` arguments.
    pub(super) fn check_flow(&mut self, clause: &mut Clause, given: Option<usize>) {
        let mut flow = Flow::new(self.program, &clause.vars);
        flow.clause(&clause.head, given, &mut clause.body);
        self.reports.extend(flow.errors.into_iter().map(Report::Compile));
    }

    fn check_singletons(&mut self, rule: &Rule) {
        for var in &rule.vars {
            if var.count <= 1 && !var.local && !var.name.starts_with("?_") {
                self.error(CompileError::Singleton { name: var.name.to_string(), at: var.span });
            }
        }
    }

    fn unreachable(&mut self, what: &str, at: Span, because: &str, of: Span, help: &str) {
        let (what, because, help) = (what.into(), because.into(), Some(help.into()));
        self.error(CompileError::Unreachable { what, at, because, of, help });
    }

    /// Says so if the clauses before one leave nothing for it.
    fn check_reached(&mut self, clause: &Clause, at: Span, seen: &mut Seen) {
        let by_number = (0..clause.vars.len()).map(|n| Symbol::from(&format!("?{n}"))).collect();
        let text = show::clause(self.program, &Clause { vars: by_number, ..clause.clone() });
        if let Some(first) = seen.clauses.insert(text, at) {
            let what = "the second of two equal clauses";
            return self.unreachable(what, at, "the same", first, "leave out one of the two");
        }
        if let Some((priority, last)) = seen.last.get(&clause.predicate)
            && clause.priority <= *priority
        {
            let help =
                "a cut at the start of a clause that takes everything lets no clause after it be tried";
            self.unreachable("this clause", at, "takes everything and cuts", *last, help);
        } else if takes_everything(&clause.head) && cuts_first(&clause.body) {
            seen.last.insert(clause.predicate, (clause.priority, at));
        }
    }
}

/// True if a head takes all arguments: variables only, each once.
fn takes_everything(head: &[Term]) -> bool {
    let mut vars = Vec::new();
    head.iter().all(|term| match term {
        Term::Any => true,
        Term::Var(var) => {
            let is_new = !vars.contains(var);
            vars.push(*var);
            is_new
        }
        _ => false,
    })
}

fn cuts_first(body: &Goal) -> bool {
    match &body.kind {
        GoalKind::Cut => true,
        GoalKind::And(goals) => goals.first().is_some_and(|goal| matches!(goal.kind, GoalKind::Cut)),
        _ => false,
    }
}
