//! Why a query has an answer, and why it has none.
//!
//! An answer is explained by its proof. What came out of a table is proved by asking its clauses once more: of
//! their answers the first is taken that rests on nothing that it is to prove. Why there is none is found out by asking: of each clause that
//! could answer, the goals of its body one more at a time, until there is no answer; then the last one is
//! to blame, with the values that it had, and is asked why in its turn.

use crate::code::Place;
use crate::host::Host;
use crate::native::{Raise, type_error};
use crate::rules::clause::{Clause, Declared, Goal, GoalKind, Kind, PredId, Term};
use crate::rules::control;
use crate::rules::engine::Engine;
use crate::rules::show;
use crate::rules::tree::determined_by;
use crate::rules::why::{Bindings, Explanation, conjuncts};
use crate::value::{Imm, Obj, Value};

use super::{Machine, Query};

/// How deep reasons are asked for.
const DEPTH: usize = 6;
/// Variables without names that a called goal can have in an explanation.
const FREE: usize = 20;
/// How many clauses and facts are named for one goal.
const MOST: usize = 5;

/// How many goals out of tables are proved for one answer.
const MOST_PROOFS: usize = 500;
/// How many answers of one clause are looked at for a proof.
const MOST_WAYS: usize = 200;

/// A goal of a query in the order in which it is asked.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanStep {
    /// The goal.
    pub goal: String,
    /// How often it was expected to hold.
    pub expected: f64,
    /// How often it held.
    pub held: u64,
}

/// A clause that does not answer: the share of its goals that hold, and what is to blame.
struct Blame {
    reached: usize,
    goals: usize,
    explanation: Explanation,
}

/// What is being asked why it does not hold, and how much deeper may be asked.
#[derive(Clone, Copy)]
struct Above<'a> {
    depth: usize,
    goals: Option<&'a Goals<'a>>,
}

/// A goal below others.
struct Goals<'a> {
    text: String,
    above: Option<&'a Goals<'a>>,
}

impl Above<'_> {
    fn deeper(self) -> Self {
        Above { depth: self.depth - 1, ..self }
    }

    /// True if the same goal is asked about already.
    fn has(&self, text: &str) -> bool {
        std::iter::successors(self.goals, |it| it.above).any(|it| it.text == text)
    }
}

impl Machine {
    /// Why the query of a stream has an answer, or with `holds` false why it has none; nil if that is not so.
    pub(super) fn explain(
        &mut self,
        host: &mut dyn Host,
        stream: &Value,
        holds: bool,
    ) -> Result<Value, Raise> {
        let asked = match stream.obj() {
            Some(Obj::Stream(it)) => it.asked(),
            _ => None,
        };
        let Some((predicate, inputs)) = asked else {
            return Err(type_error("a query that nobody has looked at", stream));
        };
        let parts = match holds {
            true => self.why(host, predicate, &inputs).map(Option::unwrap_or_default),
            false => self.why_not(host, predicate, &inputs),
        };
        match parts {
            Ok(parts) if parts.is_empty() => Ok(Value::NIL),
            Ok(parts) => Ok(Value::str(crate::rules::why::text(&parts, &|_| None))),
            Err(failure) => match failure.as_failure() {
                Some(failure) => Err(Box::new(failure.clone())),
                None => Ok(Value::NIL),
            },
        }
    }

    /// The proof of the first answer of a query, or nothing without an answer.
    ///
    /// # Errors
    /// A failure, as of the query itself.
    pub fn why(
        &mut self,
        host: &mut dyn Host,
        predicate: PredId,
        inputs: &[Value],
    ) -> Result<Option<Vec<Explanation>>, Value> {
        let mut query = self.open_query(predicate, inputs, None);
        self.why_of(host, &mut query)
    }

    /// The proof of the next answer of a query that has just been opened.
    ///
    /// # Errors
    /// A failure, as of the query itself.
    pub fn why_of(
        &mut self,
        host: &mut dyn Host,
        query: &mut Query,
    ) -> Result<Option<Vec<Explanation>>, Value> {
        query.engine.watch();
        if self.next_answer_of(host, query)?.is_none() {
            return Ok(None);
        }
        let mut parts = query.engine.proof(&self.program);
        let mut left = MOST_PROOFS;
        self.prove_all(host, &mut parts, &query.engine.view.clone(), &mut Vec::new(), &mut left)?;
        Ok(Some(parts))
    }

    /// Proves what came out of tables among some reasons and theirs. False if something of it could only be proved
    /// by one of the goals on the `path`, which are to be proved.
    fn prove_all(
        &mut self,
        host: &mut dyn Host,
        parts: &mut [Explanation],
        view: &crate::rules::View,
        path: &mut Vec<(PredId, Vec<Value>)>,
        left: &mut usize,
    ) -> Result<bool, Value> {
        for part in parts {
            let holds = match part.tabled.take() {
                Some(goal) => self.prove(host, part, goal, view, path, left)?,
                None => self.prove_all(host, &mut part.parts, view, path, left)?,
            };
            if !holds {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Proves a goal that came out of a table.
    fn prove(
        &mut self,
        host: &mut dyn Host,
        part: &mut Explanation,
        goal: (PredId, Vec<Value>),
        view: &crate::rules::View,
        path: &mut Vec<(PredId, Vec<Value>)>,
        left: &mut usize,
    ) -> Result<bool, Value> {
        if path.contains(&goal) {
            return Ok(false);
        }
        if *left == 0 {
            part.parts = vec![sentence("it holds for more reasons than are shown".into(), None)];
            return Ok(true);
        }
        *left -= 1;
        let (predicate, args) = goal.clone();
        path.push(goal);
        for clause in self.program.rules.predicates[predicate.at()].clauses.clone() {
            let place = clause.place;
            let asked = self.hidden(clause);
            let mut query = Query { engine: Engine::new(asked, &args, view.clone(), false) };
            query.engine.watch();
            for _ in 0..MOST_WAYS {
                if self.next_answer_of(host, &mut query)?.is_none() {
                    break;
                }
                let mut parts = query.engine.proof(&self.program);
                if self.prove_all(host, &mut parts, view, path, left)? {
                    path.pop();
                    (part.parts, part.place) = (parts, Some(place));
                    return Ok(true);
                }
            }
        }
        path.pop();
        Ok(false)
    }

    /// Why a query has no answer: for the goals of its body the one that is to blame.
    ///
    /// # Errors
    /// A failure, as of the query itself.
    pub fn why_not(
        &mut self,
        host: &mut dyn Host,
        predicate: PredId,
        inputs: &[Value],
    ) -> Result<Vec<Explanation>, Value> {
        let view = self.view(predicate);
        self.why_not_in(host, predicate, inputs, &view)
    }

    /// The same for a query that sees another tree.
    ///
    /// # Errors
    /// A failure, as of the query itself.
    pub fn why_not_in(
        &mut self,
        host: &mut dyn Host,
        predicate: PredId,
        inputs: &[Value],
        view: &crate::rules::View,
    ) -> Result<Vec<Explanation>, Value> {
        let mut args = inputs.to_vec();
        args.push(free(0));
        let clauses = self.program.rules.predicates[predicate.at()].clauses.clone();
        let mut all = Vec::new();
        for clause in &clauses {
            let blame = self.blame(host, clause, &args, view, Above { depth: DEPTH, goals: None })?;
            // The clause of a query is nobody's: what fails in it is what is asked for.
            all.extend(blame.into_iter().flat_map(|blame| blame.explanation.parts));
        }
        Ok(all)
    }

    /// The order in which the goals of a query are asked, how often each was expected to hold, and how often it
    /// did when all answers were asked for.
    ///
    /// # Errors
    /// A failure, as of the query itself.
    pub fn plan_of(
        &mut self,
        host: &mut dyn Host,
        predicate: PredId,
        inputs: &[Value],
        view: &crate::rules::View,
    ) -> Result<Vec<PlanStep>, Value> {
        let it = &self.program.rules.predicates[predicate.at()];
        let Some(clause) = it.planned.first().cloned().flatten().or_else(|| it.clauses.first().cloned())
        else {
            return Ok(Vec::new());
        };
        let goals: Vec<Goal> = conjuncts(&clause.body).into_iter().cloned().collect();
        let expected = crate::rules::plan::expected(&self.program.rules, &view.tree, &clause, inputs.len());
        let ticked = (0..)
            .zip(&goals)
            .flat_map(|(n, goal)| [goal.clone(), Goal { kind: GoalKind::Tick(n), place: goal.place }]);
        let body = Goal { kind: GoalKind::And(ticked.collect()), place: clause.place };
        let head = clause.head.clone();
        let counted = self.hidden(Clause { head, body, ..clause.clone() });
        let mut query = Query { engine: Engine::new(counted, inputs, view.clone(), false) };
        view.tree.forget_orders();
        while self.next_answer_of(host, &mut query)?.is_some() {}
        let mut steps = Vec::new();
        for (n, (goal, expected)) in goals.iter().zip(expected).enumerate() {
            let text = |goal: &Goal| show::goal(&self.program, goal, &clause.vars);
            match crate::rules::join::asked(&self.program.rules, &view.tree, goal) {
                Some(parts) => steps.extend(parts.into_iter().map(|(goals, expected, held)| {
                    let goals: Vec<String> = goals.into_iter().map(text).collect();
                    PlanStep { goal: goals.join(" "), expected, held }
                })),
                None => {
                    let held = query.engine.ticks.get(n).copied().unwrap_or(0);
                    steps.push(PlanStep { goal: text(goal), expected, held });
                }
            }
        }
        Ok(steps)
    }

    /// Why a goal has no answer.
    fn why_not_goal(
        &mut self,
        host: &mut dyn Host,
        predicate: PredId,
        args: &[Value],
        view: &crate::rules::View,
        above: Above<'_>,
    ) -> Result<Vec<Explanation>, Value> {
        if above.depth == 0 {
            return Ok(Vec::new());
        }
        let text = show::fact(&self.program, predicate, args);
        if above.has(&text) {
            return Ok(vec![sentence("as above".into(), None)]);
        }
        let goals = Goals { text, above: above.goals };
        let above = Above { depth: above.depth, goals: Some(&goals) };
        let it = &self.program.rules.predicates[predicate.at()];
        let (kind, name, arity) = (it.declared.kind, it.declared.name, it.declared.arity);
        if kind == Kind::Native {
            return self.why_not_native(host, predicate, args, view);
        }
        if !it.facts.is_empty() {
            return Ok(self.nearest_facts(predicate, args));
        }
        if it.clauses.is_empty() {
            return Ok(vec![sentence(format!("`{name}` has no clauses of {arity} arguments"), None)]);
        }
        let mut blames = Vec::new();
        for clause in self.program.rules.predicates[predicate.at()].clauses.clone() {
            blames.extend(self.blame(host, &clause, args, view, above)?);
        }
        // The nearest first: that of which most holds.
        blames.sort_by(|a, b| (b.reached * (a.goals + 1)).cmp(&(a.reached * (b.goals + 1))));
        let more = blames.len().saturating_sub(MOST);
        let mut parts: Vec<Explanation> =
            blames.into_iter().take(MOST).map(|blame| blame.explanation).collect();
        if more > 0 {
            parts.push(sentence(format!("{more} more clauses do not hold either"), None));
        }
        Ok(parts)
    }

    /// What of a clause does not hold for these arguments; nothing if all of it does.
    fn blame(
        &mut self,
        host: &mut dyn Host,
        clause: &Clause,
        args: &[Value],
        view: &crate::rules::View,
        above: Above<'_>,
    ) -> Result<Option<Blame>, Value> {
        let goals: Vec<Goal> = conjuncts(&clause.body).into_iter().cloned().collect();
        let mut known: Option<Value> = None;
        for n in 0..=goals.len() {
            // A cut says nothing about what holds; without it all ways are looked at.
            if n > 0 && matches!(goals[n - 1].kind, GoalKind::Cut) {
                continue;
            }
            let answer = self.holds_up_to(host, clause, &goals[..n], args, view)?;
            if let Some(values) = answer {
                known = Some(values);
                continue;
            }
            let Some(values) = known else {
                let text = format!("{} does not match", self.head(clause));
                let explanation = sentence(text, Some(clause.place));
                return Ok(Some(Blame { reached: 0, goals: goals.len(), explanation }));
            };
            let mut bindings = Bindings::new(clause);
            for (var, value) in (0..).zip(values.as_vector().into_iter().flatten()) {
                if !is_free(value) {
                    bindings.set(var, value.clone());
                }
            }
            let failed = bindings.fill(&goals[n - 1]);
            let parts = self.why_not_part(host, &failed, clause, view, above)?;
            let text = show::goal(&self.program, &failed, &clause.vars);
            let because = Explanation {
                text: format!("{text} does not hold"),
                place: Some(failed.place),
                parts,
                tabled: None,
            };
            let head = self.head(clause);
            let text = match n {
                1 => format!("{head} matches"),
                2 => format!("{head} matches, its first goal holds"),
                n => format!("{head} matches, its first {} goals hold", n - 1),
            };
            let explanation =
                Explanation { text, place: Some(clause.place), parts: vec![because], tabled: None };
            return Ok(Some(Blame { reached: n, goals: goals.len(), explanation }));
        }
        Ok(None)
    }

    /// Why one goal of a clause does not hold.
    fn why_not_part(
        &mut self,
        host: &mut dyn Host,
        goal: &Goal,
        clause: &Clause,
        view: &crate::rules::View,
        above: Above<'_>,
    ) -> Result<Vec<Explanation>, Value> {
        match &goal.kind {
            GoalKind::Call(predicate, terms) => {
                let mut next = clause.vars.len();
                let args: Vec<Value> = terms.iter().map(|term| value_of(term, &mut next)).collect();
                self.why_not_goal(host, *predicate, &args, view, above.deeper())
            }
            GoalKind::Not(inner, _) => {
                // It holds: that is why.
                let asked = self.ask_goals(clause, std::slice::from_ref(&**inner));
                let mut query = Query { engine: Engine::new(asked, &[], view.clone(), true) };
                Ok(self.why_of(host, &mut query)?.unwrap_or_default())
            }
            GoalKind::Or(goals) if above.depth > 1 => {
                let mut parts = Vec::new();
                for goal in goals {
                    let text = format!("{} does not hold", show::goal(&self.program, goal, &clause.vars));
                    let reasons = self.why_not_part(host, goal, clause, view, above.deeper())?;
                    parts.push(Explanation { text, place: Some(goal.place), parts: reasons, tabled: None });
                }
                Ok(parts)
            }
            GoalKind::Once(inner) => self.why_not_part(host, inner, clause, view, above),
            GoalKind::CallValue(called, more, scope) if above.depth > 1 => {
                // Variables without names are new ones of the clause.
                let free = clause.vars.len() as u16..(clause.vars.len() + FREE) as u16;
                let names = (0..FREE).map(|n| crate::value::Symbol::from(&format!("?_{n}")));
                let clause =
                    &Clause { vars: clause.vars.iter().copied().chain(names).collect(), ..clause.clone() };
                let rules = &self.program.rules;
                match control::written_out(rules, called, more, *scope, goal.place, &free) {
                    Some(kind @ GoalKind::And(_)) => {
                        let body = Goal { kind, place: goal.place };
                        let row = Clause { head: Vec::new(), body, ..clause.clone() };
                        let blame = self.blame(host, &row, &[], view, above.deeper())?;
                        Ok(blame.map(|blame| blame.explanation.parts).unwrap_or_default())
                    }
                    Some(kind) => {
                        let written = Goal { kind, place: goal.place };
                        self.why_not_part(host, &written, clause, view, above.deeper())
                    }
                    None => Ok(Vec::new()),
                }
            }
            _ => Ok(Vec::new()),
        }
    }

    /// For a predicate that is written in Rust: what holds instead, where that is one thing.
    fn why_not_native(
        &mut self,
        host: &mut dyn Host,
        predicate: PredId,
        args: &[Value],
        view: &crate::rules::View,
    ) -> Result<Vec<Explanation>, Value> {
        let name = self.program.rules.predicates[predicate.at()].declared.name;
        let Some(needs) = determined_by(&name) else { return Ok(Vec::new()) };
        if needs.len() == args.len() || needs.iter().any(|at| is_free(&args[*at])) {
            return Ok(Vec::new());
        }
        let asked: Vec<Value> =
            (0..args.len()).map(|at| if needs.contains(&at) { args[at].clone() } else { free(at) }).collect();
        let goal = Goal {
            kind: GoalKind::Call(predicate, (0..args.len() as u16).map(Term::Var).collect()),
            place: Place::default(),
        };
        let all = Clause {
            predicate,
            head: (0..args.len() as u16).map(Term::Var).collect(),
            open: false,
            body: goal.clone(),
            vars: (0..args.len()).map(|n| crate::value::Symbol::from(&format!("?_{n}"))).collect(),
            priority: 0,
            text: 0,
            place: Place::default(),
        };
        let found = self.holds_up_to(host, &all, &[goal], &asked, view)?;
        Ok(match found.as_ref().and_then(Value::as_vector) {
            Some(values) => {
                let values: Vec<Value> = values.iter().cloned().collect();
                vec![sentence(format!("{} holds", show::fact(&self.program, predicate, &values)), None)]
            }
            None => vec![sentence(format!("there is no such task, or it has no {name}"), None)],
        })
    }

    /// The facts that are most like a goal.
    fn nearest_facts(&self, predicate: PredId, args: &[Value]) -> Vec<Explanation> {
        let it = &self.program.rules.predicates[predicate.at()];
        let alike = |fact: &Vec<Value>| fact.iter().zip(args).filter(|(a, b)| a == b).count();
        let mut facts: Vec<(usize, &Vec<Value>)> = it.facts.iter().map(|fact| (alike(fact), fact)).collect();
        facts.sort_by_key(|fact| std::cmp::Reverse(fact.0));
        let best = facts.first().map_or(0, |fact| fact.0);
        let near = facts.into_iter().filter(|fact| fact.0 == best && best > 0).take(MOST);
        let text = |fact: &Vec<Value>| format!("near: {}", show::fact(&self.program, predicate, fact));
        let parts: Vec<Explanation> =
            near.map(|(_, fact)| sentence(text(fact), Some(it.declared.place))).collect();
        match parts.is_empty() {
            true => vec![sentence(
                format!("none of the {} facts of `{}` is like it", it.facts.len(), it.declared.name),
                Some(it.declared.place),
            )],
            false => parts,
        }
    }

    /// The head of a clause as it is written.
    fn head(&self, clause: &Clause) -> String {
        let goal = Goal { kind: GoalKind::Call(clause.predicate, clause.head.clone()), place: clause.place };
        format!("clause {}", show::goal(&self.program, &goal, &clause.vars))
    }

    /// The values of the variables of a clause in the first answer of its head and `goals`.
    fn holds_up_to(
        &mut self,
        host: &mut dyn Host,
        clause: &Clause,
        goals: &[Goal],
        args: &[Value],
        view: &crate::rules::View,
    ) -> Result<Option<Value>, Value> {
        let asked = self.ask_goals_of(clause, clause.head.clone(), goals);
        let mut query = Query { engine: Engine::new(asked, args, view.clone(), true) };
        self.next_answer_of(host, &mut query)
    }

    /// A predicate whose answers are those of some goals of a clause.
    fn ask_goals(&mut self, clause: &Clause, goals: &[Goal]) -> PredId {
        self.ask_goals_of(clause, Vec::new(), goals)
    }

    fn ask_goals_of(&mut self, clause: &Clause, mut head: Vec<Term>, goals: &[Goal]) -> PredId {
        head.push(Term::Vector((0..clause.vars.len() as u16).map(Term::Var).collect()));
        let place = clause.place;
        let goals = goals.iter().filter(|goal| !matches!(goal.kind, GoalKind::Cut)).cloned().collect();
        let body = Goal { kind: GoalKind::And(goals), place };
        self.hidden(Clause { head, body, ..clause.clone() })
    }

    /// A predicate of its own for a clause.
    fn hidden(&mut self, clause: Clause) -> PredId {
        let predicate = self.program.rules.declare(Declared {
            name: crate::value::Symbol::from("%asked"),
            arity: clause.head.len() as u8,
            kind: Kind::Rules,
            tabled: false,
            place: clause.place,
        });
        self.program.rules.add(Clause { predicate, ..clause });
        self.program.rules.link();
        predicate
    }
}

fn sentence(text: String, place: Option<Place>) -> Explanation {
    Explanation { text, place, ..Explanation::default() }
}

/// The name of a variable without a value.
fn free(n: usize) -> Value {
    Value::Imm(Imm::Var(crate::value::Symbol::from(&format!("?_{n}"))))
}

fn is_free(value: &Value) -> bool {
    matches!(value, Value::Imm(Imm::Var(name)) if name.starts_with("?_"))
}

/// A term as a value, its variables by their numbers; those without names have the next ones.
fn value_of(term: &Term, next: &mut usize) -> Value {
    match term {
        Term::Var(var) => free(usize::from(*var)),
        Term::Any => {
            *next += 1;
            free(*next - 1)
        }
        Term::Const(value) => value.clone(),
        Term::Pair(first, rest) => Value::cons(value_of(first, next), value_of(rest, next)),
        Term::Vector(items) => {
            Value::vector(items.iter().map(|item| value_of(item, next)).collect::<Vec<_>>())
        }
        Term::Map(entries) => {
            Value::map(entries.iter().map(|(key, item)| (key.clone(), value_of(item, next))).collect())
        }
        Term::Desc(kind, properties) => {
            let properties = properties.iter().map(|(key, item)| (*key, value_of(item, next))).collect();
            Value::desc(crate::desc::Desc::new(*kind, properties))
        }
    }
}
