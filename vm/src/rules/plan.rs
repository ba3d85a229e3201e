//! The order of the goals of a clause.
//!
//! Goals over facts and trees are pure: any order gives the same answers. The one that is written may be
//! slow, like two loops over all tasks with the tests at the end. So before a clause becomes code, calls
//! of predicates with one clause are put in place, then tests move to where their variables have values,
//! goals with one answer at the most to where they have it, and where a loop over tasks would follow that
//! some other goal could look up, that goal goes first.
//!
//! Goals over the tree that stand in a row become a join (`segment.rs`, `join.rs`), which orders them itself
//! when it is asked. What follows is for the clauses in which there is none.
//!
//! The order of answers stays. What makes several answers, a *generator*, keeps its place among its
//! like; a look-up takes the place of another generator only if both give the same tasks in the order
//! of the tree. Goals that depend on what has a value when they are met, or that do something else than
//! answer (functions, collections, cuts), stay where they are.

use std::rc::Rc;

use super::Rules;
use super::clause::{Clause, Goal, GoalKind, Kind, PredId, Term, VarNo};
use super::join::Join;
use super::segment;
use super::tree::determined_by;
use super::view::{Attr, TreeView};
use super::why::conjuncts;
use crate::value::{Imm, Symbol, Value};

/// How deep predicates are put in place.
const DEPTH: usize = 8;
/// A body with more goals is left as it is.
const MOST: usize = 64;
/// Variables that a join shares with other goals.
pub const MOST_JOINED: usize = 20;

/// A clause whose goals stand in a better order, and the predicates that were put in place.
pub struct Planned {
    /// The clause.
    pub clause: Clause,
    /// What it depends on: if one of these changes, it has to be planned again.
    pub inlined: Vec<PredId>,
}

/// Plans a clause; nothing if it stays as it is. Its joins come behind those of the rules.
pub fn plan(rules: &Rules, clause: &Clause, joins: &mut Vec<Rc<Join>>) -> Option<Planned> {
    if clause.body.cuts() {
        return None;
    }
    let mut it = Inline { rules, vars: clause.vars.clone(), inlined: Vec::new(), goals: Vec::new() };
    let mut way = vec![clause.predicate];
    for goal in conjuncts(&clause.body) {
        it.goal(goal, &mut way);
    }
    let Inline { vars, mut inlined, goals, .. } = it;
    // Only goals over trees gain; what is a plain program stays as it is written.
    if goals.len() < 2 || goals.len() > MOST || !goals.iter().any(|goal| is_over_tree(rules, goal)) {
        return None;
    }
    let first = rules.joins.len();
    let goals = match segment::joined(rules, &clause.head, &goals, first, joins) {
        Some((goals, used)) => {
            inlined.extend(used);
            goals
        }
        None => Order::new(rules, &goals).arrange(goals),
    };
    let body = Goal { kind: GoalKind::And(goals), place: clause.body.place };
    let clause = Clause { body, vars, ..clause.clone() };
    Some(Planned { clause, inlined })
}

pub(super) fn tree_name<'r>(rules: &'r Rules, goal: &Goal) -> Option<&'r str> {
    let GoalKind::Call(predicate, _) = &goal.kind else { return None };
    let it = &rules.predicates[predicate.at()];
    (it.native.is_some() && determined_by(&it.declared.name).is_some()).then_some(it.declared.name.as_str())
}

fn is_over_tree(rules: &Rules, goal: &Goal) -> bool {
    tree_name(rules, goal).is_some()
}

/// How often each goal of a clause is expected to hold, when its first `given` arguments have values.
#[must_use]
pub fn expected(rules: &Rules, tree: &TreeView, clause: &Clause, given: usize) -> Vec<f64> {
    let mut bound = Bound::default();
    clause.head.iter().take(given).for_each(|term| bound.add(term));
    let mut rows = 1.0;
    let goals = conjuncts(&clause.body);
    goals
        .into_iter()
        .map(|goal| {
            rows *= answers(rules, tree, goal, &bound);
            bound.after(goal);
            rows
        })
        .collect()
}

/// How many answers a goal is expected to have.
fn answers(rules: &Rules, tree: &TreeView, goal: &Goal, bound: &Bound) -> f64 {
    /// A test holds every other time.
    const TEST: f64 = 0.5;
    let tasks = tree.len() as f64;
    let GoalKind::Call(predicate, args) = &goal.kind else {
        return if let GoalKind::Unify(..) | GoalKind::Is(..) = goal.kind { 1.0 } else { TEST };
    };
    let has = |at: usize| args.get(at).is_some_and(|term| bound.has_term(term));
    let constant = |at: usize| match args.get(at) {
        Some(Term::Const(value)) => super::view::symbol(value),
        _ => None,
    };
    let Some(name) = tree_name(rules, goal) else {
        let facts = rules.predicates[predicate.at()].facts.len().max(1) as f64;
        let given = (0..args.len()).filter(|at| has(*at)).count();
        return facts.powf(1.0 - given as f64 / args.len().max(1) as f64);
    };
    let is_test = (0..args.len()).all(has);
    match name {
        _ if is_test => TEST,
        "task-param" | "task-type" => {
            let (key, value) = match name {
                "task-type" => (Some(Symbol::from("type")), 1),
                _ => (constant(1), 2),
            };
            let Some(key) = key else { return if has(0) { 3.0 } else { 3.0 * tasks } };
            match (has(0), has(value)) {
                (true, _) => 1.0,
                (false, true) => match args.get(value) {
                    Some(Term::Const(value)) => tree.with(key, value).len() as f64,
                    _ => having(tree, key) / tree.column(Attr::Param(key)).distinct.max(1) as f64,
                },
                (false, false) => having(tree, key),
            }
        }
        "task-name" if !has(0) => constant(1).map_or(tasks, |name| named(tree, name)),
        "subtask" if has(0) => 3.0,
        "subtask+" | "before" if has(0) || has(1) => tasks / 2.0,
        _ if has(0) => 1.0,
        _ => tasks,
    }
}

fn having(tree: &TreeView, key: Symbol) -> f64 {
    tree.column(Attr::Param(key)).having().len() as f64
}

fn named(tree: &TreeView, name: Symbol) -> f64 {
    tree.column(Attr::Name).with(tree.number(&Value::Imm(Imm::Symbol(name)))).len() as f64
}

// ---------------------------------------------------------------------------------------------
// Putting predicates in place

struct Inline<'a> {
    rules: &'a Rules,
    vars: Vec<Symbol>,
    inlined: Vec<PredId>,
    goals: Vec<Goal>,
}

impl Inline<'_> {
    fn goal(&mut self, goal: &Goal, way: &mut Vec<PredId>) {
        let GoalKind::Call(predicate, args) = &goal.kind else { return self.goals.push(goal.clone()) };
        let Some(callee) = self.can_inline(*predicate, way) else { return self.goals.push(goal.clone()) };
        let callee = callee.clone();
        self.inlined.push(*predicate);
        let first = self.vars.len();
        for name in &callee.vars {
            let name = self.fresh_name(*name);
            self.vars.push(name);
        }
        let mut known: Vec<Option<Term>> = vec![None; callee.vars.len()];
        let mut equal = Vec::new();
        for (param, arg) in callee.head.iter().zip(args) {
            match param {
                Term::Var(var) if known[*var as usize].is_none() => known[*var as usize] = Some(arg.clone()),
                Term::Any => {}
                param => equal.push((param, arg)),
            }
        }
        let mut rename = |term: &Term| match term {
            Term::Var(var) => match &known[*var as usize] {
                // Each `?_` of the call stands for itself, but within the clause it is one variable.
                Some(Term::Any) | None => Term::Var((first + usize::from(*var)) as VarNo),
                Some(term) => term.clone(),
            },
            term => term.clone(),
        };
        for (param, arg) in equal {
            let kind = GoalKind::Unify(arg.clone(), param.map(&mut rename));
            self.goals.push(Goal { kind, place: goal.place });
        }
        way.push(*predicate);
        for goal in conjuncts(&callee.body) {
            let goal = rename_shared(&goal.map(&mut rename), first, &known);
            self.goal(&goal, way);
        }
        way.pop();
    }

    /// A name that no other variable has.
    fn fresh_name(&self, name: Symbol) -> Symbol {
        let mut fresh = name;
        let mut n = 1;
        while self.vars.contains(&fresh) {
            n += 1;
            fresh = Symbol::from(&format!("{name}.{n}"));
        }
        fresh
    }

    /// The one clause of a predicate that can stand in the place of its call.
    fn can_inline(&self, predicate: PredId, way: &[PredId]) -> Option<&Clause> {
        let it = &self.rules.predicates[predicate.at()];
        let [clause] = &it.clauses[..] else { return None };
        let fits = it.declared.kind == Kind::Rules
            && !it.declared.tabled
            && !clause.open
            && way.len() < DEPTH
            && !way.contains(&predicate)
            && self.vars.len() + clause.vars.len() < 150
            && conjuncts(&clause.body).iter().all(|goal| is_movable_kind(goal));
        fits.then_some(clause)
    }
}

/// The variables that negations and groups name, under their new numbers.
fn rename_shared(goal: &Goal, first: usize, known: &[Option<Term>]) -> Goal {
    let number = |var: &VarNo| match known.get(*var as usize) {
        Some(Some(Term::Var(outer))) => Some(*outer),
        Some(Some(Term::Any) | None) => Some((first + usize::from(*var)) as VarNo),
        // It has a value, or is put together from variables that are asked one by one.
        _ => None,
    };
    let mut goal = goal.clone();
    if let GoalKind::Not(_, vars) = &mut goal.kind {
        *vars = vars.iter().filter_map(number).collect();
    }
    goal
}

/// Goals that only answer, as far as their form tells.
fn is_movable_kind(goal: &Goal) -> bool {
    match &goal.kind {
        GoalKind::True
        | GoalKind::False
        | GoalKind::Call(..)
        | GoalKind::Unify(..)
        | GoalKind::Identical(..)
        | GoalKind::Matches(..)
        | GoalKind::Compare(..) => true,
        GoalKind::Not(goal, _) => conjuncts(goal).iter().all(|goal| is_movable_kind(goal)),
        _ => false,
    }
}

// ---------------------------------------------------------------------------------------------
// Ordering

/// One half of a look-up of tasks.
enum Half {
    /// Those below a task: 0 directly, 1 anywhere.
    Below(usize, Term),
    /// Those with a value under a key.
    With(Term, Term),
}
use Half::{Below, With};

/// What a goal is to the order.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Role {
    /// It holds or not, once its variables have values.
    Test,
    /// It makes two terms the same.
    Unify,
    /// It is over the tree.
    Tree,
    /// It stays among those that stay.
    Stays,
}

struct Order<'a> {
    rules: &'a Rules,
    roles: Vec<Role>,
}

impl<'a> Order<'a> {
    fn new(rules: &'a Rules, goals: &[Goal]) -> Order<'a> {
        // A test is one only if its variables have values where it is written.
        let mut bound = Bound::default();
        let mut roles = Vec::new();
        for goal in goals {
            let role = match &goal.kind {
                GoalKind::Unify(..) => Role::Unify,
                GoalKind::Call(..) if is_over_tree(rules, goal) => Role::Tree,
                GoalKind::Identical(..) | GoalKind::Compare(..) => match bound.has_all(goal) {
                    true => Role::Test,
                    false => Role::Stays,
                },
                GoalKind::Not(_, shared) => {
                    match is_pure_test(rules, goal)
                        && bound.has_needed(goal)
                        && shared.iter().all(|var| bound.has(*var))
                    {
                        true => Role::Test,
                        false => Role::Stays,
                    }
                }
                _ => Role::Stays,
            };
            bound.after(goal);
            roles.push(role);
        }
        Order { rules, roles }
    }

    /// The goals in their new order.
    fn arrange(&self, goals: Vec<Goal>) -> Vec<Goal> {
        let mut left: Vec<(Goal, Role)> = goals.into_iter().zip(self.roles.iter().copied()).collect();
        let mut bound = Bound::default();
        let mut arranged = Vec::new();
        while !left.is_empty() {
            let ready = left.iter().position(|(goal, role)| match role {
                Role::Unify => true,
                Role::Test => bound.has_needed(goal),
                Role::Tree => self.is_determined(goal, &bound),
                Role::Stays => false,
            });
            let at = ready.unwrap_or_else(|| self.next_generator(&left, &bound));
            let goal = match ready.is_none().then(|| self.look_up(&left, at, &bound)).flatten() {
                Some((goal, other)) => {
                    left.remove(at.max(other));
                    left.remove(at.min(other));
                    goal
                }
                None => left.remove(at).0,
            };
            // What has been found out already need not be asked again.
            let is_known =
                self.is_determined(&goal, &bound) && arranged.iter().any(|it| same_call(it, &goal));
            bound.after(&goal);
            if !is_known {
                arranged.push(goal);
            }
        }
        arranged
    }

    /// True if a goal over the tree has one answer at the most.
    fn is_determined(&self, goal: &Goal, bound: &Bound) -> bool {
        let (Some(name), GoalKind::Call(_, args)) = (tree_name(self.rules, goal), &goal.kind) else {
            return false;
        };
        determined_by(name).is_some_and(|needs| needs.iter().all(|at| bound.has_term(&args[*at])))
    }

    /// The generator that is next: the first that is written, or a better look-up of the same tasks.
    fn next_generator(&self, left: &[(Goal, Role)], bound: &Bound) -> usize {
        let first = left.iter().position(|(_, role)| *role != Role::Test).unwrap_or(0);
        let Some((var, cost)) = self.tasks_of(&left[first].0, bound) else { return first };
        let others = left.iter().enumerate().filter(|(_, (_, role))| *role == Role::Tree);
        let costs = others.filter_map(|(at, (goal, _))| {
            let (other, cost) = self.tasks_of(goal, bound)?;
            (other == var).then_some((cost, at))
        });
        costs.min().filter(|best| best.0 < cost).map_or(first, |best| best.1)
    }

    /// A generator of tasks below one and one of tasks with a value are one look-up: the goal for both, and
    /// where the other one stands.
    fn look_up(&self, left: &[(Goal, Role)], at: usize, bound: &Bound) -> Option<(Goal, usize)> {
        let (var, _) = self.tasks_of(&left[at].0, bound)?;
        let part = |goal: &Goal| {
            let (name, GoalKind::Call(_, args)) = (tree_name(self.rules, goal)?, &goal.kind) else {
                return None;
            };
            (self.tasks_of(goal, bound)?.0 == var).then_some(())?;
            let has = |at: usize| bound.has_term(&args[at]);
            match name {
                "subtask" if has(0) => Some(Below(0, args[0].clone())),
                "subtask+" if has(0) => Some(Below(1, args[0].clone())),
                "task-type" if has(1) => Some(With(Term::Const(Value::symbol("type")), args[1].clone())),
                "task-param" if has(1) && has(2) => Some(With(args[1].clone(), args[2].clone())),
                _ => None,
            }
        };
        let first = part(&left[at].0)?;
        let fits = |other: &Half| matches!((&first, other), (Below(..), With(..)) | (With(..), Below(..)));
        let (other, second) = left.iter().enumerate().find_map(|(n, (goal, role))| {
            let half = (n != at && *role == Role::Tree).then(|| part(goal)).flatten()?;
            fits(&half).then_some((n, half))
        })?;
        let ((Below(depth, above), With(key, value)) | (With(key, value), Below(depth, above))) =
            (first, second)
        else {
            return None;
        };
        // Everything is below the root.
        if matches!(&above, Term::Const(value) if value.as_symbol().is_some_and(|it| it == "top-level"))
            && depth == 1
        {
            return None;
        }
        let predicate = self.rules.look_ups[depth]?;
        let kind = GoalKind::Call(predicate, vec![above, Term::Var(var), key, value]);
        Some((Goal { kind, place: left[at].0.place }, other))
    }

    /// The variable whose tasks a goal gives, each once and in the order of the tree, and how many that
    /// may be: less is fewer.
    fn tasks_of(&self, goal: &Goal, bound: &Bound) -> Option<(VarNo, u8)> {
        let (name, GoalKind::Call(_, args)) = (tree_name(self.rules, goal)?, &goal.kind) else { return None };
        let free = |at: usize| match args.get(at) {
            Some(Term::Var(var)) if !bound.has(*var) => Some(*var),
            _ => None,
        };
        let has = |at: usize| args.get(at).is_some_and(|term| bound.has_term(term));
        match name {
            "task-param" if has(1) => Some((free(0)?, if has(2) { 0 } else { 4 })),
            "subtask" if has(0) => Some((free(1)?, 1)),
            "subtask" => Some((free(1)?, 6)),
            "task-type" => Some((free(0)?, if has(1) { 2 } else { 4 })),
            "task-name" => Some((free(0)?, if has(1) { 3 } else { 6 })),
            "subtask+" if has(0) => Some((free(1)?, 5)),
            "task" | "edited" | "task-status" | "task-kind" | "task-value" | "task-start" => {
                Some((free(0)?, 6))
            }
            _ => None,
        }
    }
}

/// True for a negation of goals that only answer.
pub(super) fn is_pure_test(rules: &Rules, goal: &Goal) -> bool {
    let GoalKind::Not(inner, _) = &goal.kind else { return false };
    conjuncts(inner).iter().all(|goal| is_movable_kind(goal) && is_total(rules, goal))
}

/// True if a goal neither fails with an error nor goes on for ever.
fn is_total(rules: &Rules, goal: &Goal) -> bool {
    match &goal.kind {
        GoalKind::Call(predicate, _) => {
            let it = &rules.predicates[predicate.at()];
            it.native.is_some() || it.declared.kind == Kind::Facts
        }
        _ => true,
    }
}

/// True if two goals call the same predicate with the same arguments.
fn same_call(a: &Goal, b: &Goal) -> bool {
    match (&a.kind, &b.kind) {
        (GoalKind::Call(p, x), GoalKind::Call(q, y)) => p == q && x == y && !x.iter().any(contains_any),
        _ => false,
    }
}

/// The variables that have values.
#[derive(Default, Clone)]
pub(super) struct Bound(Vec<VarNo>);

impl Bound {
    pub(super) fn has(&self, var: VarNo) -> bool {
        self.0.contains(&var)
    }

    pub(super) fn has_term(&self, term: &Term) -> bool {
        let mut all = !matches!(term, Term::Any);
        term.each_var(&mut |var| all &= self.has(var));
        all && !contains_any(term)
    }

    pub(super) fn has_all(&self, goal: &Goal) -> bool {
        let mut all = true;
        goal.each_var(&mut |var| all &= self.has(var));
        all
    }

    /// True if what a test needs has values: all variables, for a negation those that it shares.
    pub(super) fn has_needed(&self, goal: &Goal) -> bool {
        match &goal.kind {
            GoalKind::Not(inner, _) if matches!(inner.kind, GoalKind::Identical(..)) => self.has_all(goal),
            GoalKind::Not(_, shared) => shared.iter().all(|var| self.has(*var)),
            _ => self.has_all(goal),
        }
    }

    fn add(&mut self, term: &Term) {
        term.each_var(&mut |var| {
            if !self.0.contains(&var) {
                self.0.push(var);
            }
        });
    }

    /// The goal has held.
    pub(super) fn after(&mut self, goal: &Goal) {
        match &goal.kind {
            // What is not known to give values is taken to give them: it stays where it is written.
            GoalKind::Call(_, args) | GoalKind::Fun(_, args, _) => {
                args.iter().for_each(|term| self.add(term));
                if let GoalKind::Fun(_, _, result) = &goal.kind {
                    self.add(result);
                }
            }
            GoalKind::Unify(a, b) => {
                if self.has_term(a) {
                    self.add(b);
                } else if self.has_term(b) {
                    self.add(a);
                }
            }
            GoalKind::Is(term, _) => self.add(term),
            GoalKind::Matches(pattern, _) => self.add(pattern),
            GoalKind::Collect(_, _, _, result) => self.add(result),
            GoalKind::Bag { by, list, .. } => {
                by.iter().for_each(|var| self.add(&Term::Var(*var)));
                self.add(list);
            }
            GoalKind::And(goals) => goals.iter().for_each(|goal| self.after(goal)),
            GoalKind::Once(goal) => self.after(goal),
            _ => {}
        }
    }
}

fn contains_any(term: &Term) -> bool {
    match term {
        Term::Any => true,
        Term::Var(_) | Term::Const(_) => false,
        Term::Pair(first, rest) => contains_any(first) || contains_any(rest),
        Term::Vector(items) => items.iter().any(contains_any),
        Term::Map(entries) => entries.iter().any(|entry| contains_any(&entry.1)),
        Term::Desc(_, properties) => properties.iter().any(|property| contains_any(&property.1)),
    }
}
