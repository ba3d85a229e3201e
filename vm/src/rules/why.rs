//! What an engine has to note so that an answer can be explained.
//!
//! While it is watched, each goal that is called gets a node below the clause that calls it. When the
//! engine goes back, the nodes since the choice go, so that at an answer those that are left are its proof.

use crate::code::{Pc, Place, Program};
use crate::value::Value;

use super::clause::{Clause, Goal, GoalKind, PredId, Term, VarNo};
use super::engine::Engine;
use super::show;
use super::store::Cell;

/// Something with its reasons.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Explanation {
    /// A goal, or a sentence.
    pub text: String,
    /// The clause or goal in the source that it is about.
    pub place: Option<Place>,
    /// Its reasons, in order.
    pub parts: Vec<Explanation>,
    /// It came out of a table, which knows that it holds and not why: the predicate and its arguments.
    pub tabled: Option<(PredId, Vec<Value>)>,
}

/// Explanations as text, a line each; `place` says where something stands in the source.
#[must_use]
pub fn text(parts: &[Explanation], place: &dyn Fn(Place) -> Option<String>) -> String {
    let mut out = String::new();
    let mut todo: Vec<(&Explanation, String, String)> =
        parts.iter().rev().map(|part| (part, String::new(), String::new())).collect();
    while let Some((part, lead, indent)) = todo.pop() {
        let at = part.place.and_then(place).map(|at| format!("  [{at}]")).unwrap_or_default();
        out += &format!("{lead}{}{at}\n", crate::show::safe(&part.text));
        for (n, below) in part.parts.iter().enumerate().rev() {
            let (branch, further) =
                if n + 1 == part.parts.len() { ("└─ ", "   ") } else { ("├─ ", "│  ") };
            todo.push((below, format!("{indent}{branch}"), format!("{indent}{further}")));
        }
    }
    out.truncate(out.trim_end().len());
    out
}

/// A goal that is open or holds.
struct Node {
    parent: u32,
    predicate: PredId,
    args: Vec<Cell>,
    /// The code of the clause that answers it; none for facts and what is written in Rust.
    entry: Option<Pc>,
}

/// The goals of an engine that is watched.
#[derive(Default)]
pub(super) struct Trace {
    nodes: Vec<Node>,
    /// The goal whose clause is running.
    current: u32,
    /// The goal whose clause goes on in each frame.
    frames: Vec<u32>,
    /// For each choice how many nodes there were, and the current one.
    choices: Vec<(usize, u32)>,
}

impl Trace {
    /// The arguments of the goals.
    pub fn terms(&mut self) -> impl Iterator<Item = &mut Cell> {
        self.nodes.iter_mut().flat_map(|node| &mut node.args)
    }

    /// A frame for the rest of the current goal's clause.
    pub fn begin(&mut self, frame: u32) {
        self.frames.resize(self.frames.len().max(frame as usize + 1), 0);
        self.frames[frame as usize] = self.current;
    }

    /// The current goal's clause calls another goal.
    pub fn call(&mut self, predicate: PredId, args: &[Cell]) {
        let parent = if self.nodes.is_empty() { u32::MAX } else { self.current };
        self.current = self.nodes.len() as u32;
        self.nodes.push(Node { parent, predicate, args: args.to_vec(), entry: None });
    }

    /// The current goal is answered by the clause whose code is here.
    pub fn enter(&mut self, entry: Pc) {
        if let Some(node) = self.nodes.get_mut(self.current as usize) {
            node.entry = Some(entry);
        }
    }

    /// The current goal holds: the clause goes on to which the frame belongs.
    pub fn leave(&mut self, frame: u32) {
        self.current = self.frames.get(frame as usize).copied().unwrap_or(0);
    }

    pub fn choice(&mut self) {
        self.choices.push((self.nodes.len(), self.current));
    }

    pub fn cut(&mut self, n: usize) {
        self.choices.truncate(n);
    }

    /// The newest choice goes on.
    pub fn back(&mut self) {
        if let Some((nodes, current)) = self.choices.last() {
            self.nodes.truncate(*nodes);
            self.current = *current;
        }
    }
}

impl Engine {
    /// From now on answers can be explained. To be called before the first.
    pub fn watch(&mut self) {
        self.trace = Some(Box::default());
    }

    /// Why the answer that has been found is one: the goals of the query, each with its proof.
    #[must_use]
    pub fn proof(&self, program: &Program) -> Vec<Explanation> {
        let Some(trace) = &self.trace else { return Vec::new() };
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); trace.nodes.len()];
        for (at, node) in trace.nodes.iter().enumerate() {
            if let Some(list) = children.get_mut(node.parent as usize) {
                list.push(at);
            }
        }
        // Children have greater numbers: their explanations are there first.
        let mut done: Vec<Explanation> = Vec::new();
        done.resize_with(trace.nodes.len(), Explanation::default);
        for (at, node) in trace.nodes.iter().enumerate().rev() {
            let values = |node: &Node| -> Vec<Value> {
                node.args.iter().map(|arg| self.store.export(*arg, &self.view).unwrap_or_default()).collect()
            };
            let args = values(node);
            // What is private to a module is nobody's reason; the solver of goals only passes theirs on.
            let is_solver = |predicate: PredId| program.rules.solver == Some(predicate);
            let is_public = |at: &&usize| {
                let predicate = trace.nodes[**at].predicate;
                is_solver(predicate)
                    || !program.rules.predicates[predicate.at()].declared.name.starts_with('%')
            };
            let below: Vec<(PredId, Vec<Value>, Explanation)> = children[at]
                .iter()
                .filter(is_public)
                .flat_map(|at| {
                    let (node, it) = (&trace.nodes[*at], std::mem::take(&mut done[*at]));
                    let parts = match is_solver(node.predicate) {
                        true => it.parts,
                        false => vec![it],
                    };
                    parts.into_iter().map(|part| (node.predicate, values(node), part)).collect::<Vec<_>>()
                })
                .collect();
            let text = show::fact(program, node.predicate, &args);
            let is_tabled = program.rules.predicates[node.predicate.at()].declared.tabled;
            // The clause that a table was filled by last has nothing to do with the answer.
            done[at] = match clause_at(program, node.predicate, node.entry.filter(|_| !is_tabled)) {
                Some(clause) => {
                    let parts = with_tests(program, clause, &args, below);
                    Explanation { text, place: Some(clause.place), parts, tabled: None }
                }
                None => {
                    let parts = below.into_iter().map(|it| it.2).collect();
                    let tabled = is_tabled.then_some((node.predicate, args));
                    Explanation { text, parts, tabled, ..Explanation::default() }
                }
            };
        }
        done.into_iter().next().map(|query| query.parts).unwrap_or_default()
    }
}

fn clause_at(program: &Program, predicate: PredId, entry: Option<Pc>) -> Option<&Clause> {
    let it = &program.rules.predicates[predicate.at()];
    let at = it.entries.iter().position(|pc| Some(*pc) == entry)?;
    it.clauses.get(at)
}

/// The goals of a clause's body in their order: those that were called with their proofs, the others
/// with the values of their variables.
fn with_tests(
    program: &Program,
    clause: &Clause,
    args: &[Value],
    below: Vec<(PredId, Vec<Value>, Explanation)>,
) -> Vec<Explanation> {
    let mut known = Bindings::new(clause);
    clause.head.iter().zip(args).for_each(|(term, value)| known.bind(term, value));
    let goals = conjuncts(&clause.body);
    let mut calls = below.into_iter().peekable();
    let mut parts: Vec<(usize, Result<Explanation, &Goal>)> = Vec::new();
    for (at, goal) in goals.iter().enumerate() {
        match &goal.kind {
            GoalKind::True | GoalKind::Cut => {}
            GoalKind::Call(predicate, terms) => {
                if let Some((_, values, explanation)) = calls.next_if(|call| call.0 == *predicate) {
                    terms.iter().zip(&values).for_each(|(term, value)| known.bind(term, value));
                    parts.push((at, Ok(explanation)));
                }
            }
            GoalKind::Or(_) | GoalKind::If { .. } | GoalKind::Once(_) | GoalKind::CallValue(..) => {
                // What was called in it, up to what the next goal calls.
                let next = goals[at + 1..].iter().find_map(|goal| match &goal.kind {
                    GoalKind::Call(predicate, _) => Some(*predicate),
                    _ => None,
                });
                while let Some((_, _, explanation)) = calls.next_if(|call| Some(call.0) != next) {
                    parts.push((at, Ok(explanation)));
                }
            }
            _ => parts.push((at, Err(goal))),
        }
    }
    parts.extend(calls.map(|call| (goals.len(), Ok(call.2))));
    parts
        .into_iter()
        .map(|(_, part)| match part {
            Ok(explanation) => explanation,
            Err(goal) => Explanation {
                text: show::goal(program, &known.fill(goal), &clause.vars),
                place: Some(goal.place),
                ..Explanation::default()
            },
        })
        .collect()
}

/// The goals of a body one after another.
#[must_use]
pub fn conjuncts(body: &Goal) -> Vec<&Goal> {
    match &body.kind {
        GoalKind::And(goals) => goals.iter().flat_map(conjuncts).collect(),
        GoalKind::True => Vec::new(),
        _ => vec![body],
    }
}

/// What is known of the variables of a clause.
pub(crate) struct Bindings(Vec<Option<Value>>);

impl Bindings {
    pub fn new(clause: &Clause) -> Bindings {
        Bindings(vec![None; clause.vars.len()])
    }

    pub fn set(&mut self, var: VarNo, value: Value) {
        if let Some(known) = self.0.get_mut(var as usize) {
            *known = Some(value);
        }
    }

    /// The variables of a term are what stands in their places in a value.
    pub fn bind(&mut self, term: &Term, value: &Value) {
        match term {
            Term::Var(var) => self.set(*var, value.clone()),
            Term::Pair(first, rest) => {
                if let Some((a, b)) = value.as_pair() {
                    self.bind(first, a);
                    self.bind(rest, b);
                }
            }
            Term::Vector(items) => {
                if let Some(values) = value.as_vector() {
                    items.iter().zip(values.iter()).for_each(|(item, value)| self.bind(item, value));
                }
            }
            Term::Map(entries) => {
                for (key, item) in entries {
                    if let Some(value) = value.as_map().and_then(|map| map.get(key)) {
                        self.bind(item, value);
                    }
                }
            }
            Term::Desc(_, properties) => {
                for (key, item) in properties {
                    if let Some(value) = value.as_desc().and_then(|desc| desc.get(*key)) {
                        self.bind(item, value);
                    }
                }
            }
            Term::Any | Term::Const(_) => {}
        }
    }

    /// A goal with what is known in the places of variables.
    pub fn fill(&self, goal: &Goal) -> Goal {
        goal.map(&mut |term| match term {
            Term::Var(var) => match self.0.get(*var as usize) {
                Some(Some(value)) => Term::Const(value.clone()),
                _ => term.clone(),
            },
            _ => term.clone(),
        })
    }
}
