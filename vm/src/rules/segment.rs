//! From the goals of a clause to joins.
//!
//! Goals that stand in a row and only ask the table of a tree become one goal, a [`Join`]. What stands between
//! them and holds once at the most, whatever is asked before, like the path of a known task, goes behind it.
//! Everything else stays where it is written, and ends the row.

use std::rc::Rc;

use super::Rules;
use super::clause::{Goal, GoalKind, Kind, PredId, Term, VarNo};
use super::join::{Cond, Join, Modes, Rel, Sort, Var};
use super::plan::{Bound, MOST_JOINED, is_pure_test, tree_name};
use super::tree::determined_by;
use super::view::{Attr, symbol};
use crate::value::{Obj, Symbol, Value};

/// How deep predicates are looked into.
const DEPTH: usize = 8;
/// Variables of a join: they have to fit into a word of bits.
const MOST_VARS: usize = 60;
/// Clauses of a predicate that is a test.
const MOST_CLAUSES: usize = 4;

/// The goals with joins in the place of rows of them; nothing if there is none. The joins get the numbers from
/// `first` on.
pub fn joined(
    rules: &Rules,
    head: &[Term],
    goals: &[Goal],
    first: usize,
    joins: &mut Vec<Rc<Join>>,
) -> Option<(Vec<Goal>, Vec<PredId>)> {
    let mut it = Segments {
        rules,
        bound: Bound::default(),
        row: Row::new(rules),
        start: 0,
        used: Vec::new(),
        rows: Vec::new(),
    };
    for (at, goal) in goals.iter().enumerate() {
        it.goal(head, goals, at, goal);
        it.bound.after(goal);
    }
    it.end(goals.len());
    let mut out = Vec::new();
    let mut found = false;
    for (row, range) in it.rows {
        let joined: Vec<usize> = row.conds.iter().map(|cond| cond.0).collect();
        let is_worth = joined.len() > 1;
        let join = is_worth.then(|| row.join(head, goals, &joined, rules, first + joins.len())).flatten();
        match join {
            None => out.extend(goals[range].iter().cloned()),
            Some((join, call)) => {
                found = true;
                joins.push(Rc::new(join));
                let is_unify = |at: &usize| matches!(goals[*at].kind, GoalKind::Unify(..));
                let rest: Vec<usize> = range.filter(|at| !joined.contains(at)).collect();
                // What may give a variable its value goes before, as it makes fewer answers.
                out.extend(
                    rest.iter().filter(|at| row.is_passed(**at) && is_unify(at)).map(|at| goals[*at].clone()),
                );
                out.push(call);
                out.extend(
                    rest.iter()
                        .filter(|at| !(row.is_passed(**at) && is_unify(at)))
                        .map(|at| goals[*at].clone()),
                );
            }
        }
    }
    found.then_some((out, it.used))
}

struct Segments<'a> {
    rules: &'a Rules,
    bound: Bound,
    row: Row<'a>,
    start: usize,
    used: Vec<PredId>,
    rows: Vec<(Row<'a>, std::ops::Range<usize>)>,
}

impl Segments<'_> {
    fn goal(&mut self, head: &[Term], goals: &[Goal], at: usize, goal: &Goal) {
        if self.joins(head, goals, at, goal) {
            return;
        }
        if self.may_wait(goal) {
            self.row.passed.push(at);
            return;
        }
        // It stays where it is written.
        self.end(at);
        self.rows.push((Row::new(self.rules), at..at + 1));
        self.start = at + 1;
        self.row = Row::new(self.rules);
    }

    fn end(&mut self, at: usize) {
        let row = std::mem::replace(&mut self.row, Row::new(self.rules));
        self.rows.push((row, self.start..at));
        self.start = at;
    }

    /// Takes a goal into the row, if that can be.
    fn joins(&mut self, head: &[Term], goals: &[Goal], at: usize, goal: &Goal) -> bool {
        let before = self.row.clone();
        let (start, used) = (self.start, self.used.len());
        let mut way = Vec::new();
        let cond = self.row.cond(goal, None, &mut way);
        let fits = cond.as_ref().is_some_and(|cond| self.fits(head, goals, start, at, cond));
        match cond.filter(|_| fits) {
            Some(cond) => {
                self.row.conds.push((at, cond));
                self.used.append(&mut self.row.used);
                true
            }
            None => {
                self.row = before;
                self.used.truncate(used);
                false
            }
        }
    }

    /// True if a goal is a relation, or a test of what the row finds.
    fn fits(&mut self, head: &[Term], goals: &[Goal], start: usize, at: usize, cond: &Cond) -> bool {
        let row = &mut self.row;
        if row.sorts.len() > MOST_VARS {
            return false;
        }
        // Only what the row itself finds is surely known.
        row.fixed.iter().for_each(|(var, _)| row.modes.known |= 1 << var);
        let (before, sorts) = (row.modes, row.sorts.clone());
        let is_outside = |var: Var| {
            let no = row.names.iter().find(|name| name.1 == var).map(|name| name.0);
            no.is_some_and(|no| {
                head.iter().any(|term| term.has_var(no)) || goals[..start].iter().any(|it| has_var(it, no))
            })
        };
        // Outside of a join a task may be written as a path, which is another thing.
        let mut is_sure = true;
        cond.each_rel(&mut |rel| match rel {
            Rel::Same(a, b) if sorts[usize::from(a)] == Sort::Task => {
                is_sure &= !is_outside(a) && !is_outside(b)
            }
            _ => {}
        });
        if !is_sure {
            return false;
        }
        if let Cond::Rel(rel) = cond {
            if cond.vars() & row.modes.hidden != 0 {
                return false;
            }
            let fits = match rel {
                Rel::Same(..) | Rel::Form(..) => row.modes.is_single(cond),
                _ => true,
            };
            row.modes.known |= cond.vars();
            return fits;
        }
        if !row.modes.is_single(cond) {
            return false;
        }
        // Nobody else may look at what it has for itself.
        let own = row.modes.hidden & !before.hidden;
        !row.names.iter().any(|(no, var)| {
            own >> var & 1 != 0
                && (head.iter().any(|term| term.has_var(*no))
                    || goals.iter().enumerate().any(|(other, it)| other != at && has_var(it, *no)))
        })
    }

    /// True for a goal that holds once at the most, whenever it is asked, and needs no search.
    fn may_wait(&self, goal: &Goal) -> bool {
        match &goal.kind {
            GoalKind::Unify(..) | GoalKind::True => true,
            GoalKind::Identical(..) => self.bound.has_all(goal),
            GoalKind::Call(_, args) => tree_name(self.rules, goal)
                .and_then(determined_by)
                .is_some_and(|needs| needs.iter().all(|at| self.bound.has_term(&args[*at]))),
            GoalKind::Not(_, shared) => {
                is_pure_test(self.rules, goal)
                    && self.bound.has_needed(goal)
                    && shared.iter().all(|var| self.bound.has(*var))
            }
            _ => false,
        }
    }
}

fn has_var(goal: &Goal, var: VarNo) -> bool {
    let mut found = false;
    goal.each_var(&mut |it| found |= it == var);
    found
}

/// What a variable of a clause that is looked into stands for.
#[derive(Clone)]
enum Arg {
    Var(Var),
    Const(Value),
}

/// Variables of a clause, as far as something is known of them.
type Scope = Vec<Option<Arg>>;

/// Goals that may become a join.
#[derive(Clone)]
struct Row<'a> {
    rules: &'a Rules,
    conds: Vec<(usize, Cond)>,
    /// Goals that wait.
    passed: Vec<usize>,
    sorts: Vec<Sort>,
    attrs: Vec<Attr>,
    forms: Vec<Term>,
    fixed: Vec<(Var, Value)>,
    /// The variables of the clause that have one here.
    names: Vec<(VarNo, Var)>,
    modes: Modes,
    used: Vec<PredId>,
}

impl<'a> Row<'a> {
    fn new(rules: &'a Rules) -> Row<'a> {
        Row {
            rules,
            conds: Vec::new(),
            passed: Vec::new(),
            sorts: Vec::new(),
            attrs: Vec::new(),
            forms: Vec::new(),
            fixed: Vec::new(),
            names: Vec::new(),
            modes: Modes::default(),
            used: Vec::new(),
        }
    }

    fn is_passed(&self, at: usize) -> bool {
        self.passed.contains(&at)
    }

    fn fresh(&mut self) -> Option<Var> {
        let var = self.sorts.len();
        (var < MOST_VARS).then(|| {
            self.sorts.push(Sort::Unknown);
            var as Var
        })
    }

    fn arg(&mut self, term: &Term, scope: Option<&mut Scope>) -> Option<Arg> {
        match (term, scope) {
            (Term::Const(value), _) => Some(Arg::Const(value.clone())),
            (Term::Any, _) => Some(Arg::Var(self.fresh()?)),
            (Term::Var(no), None) => {
                if let Some((_, var)) = self.names.iter().find(|name| name.0 == *no) {
                    return Some(Arg::Var(*var));
                }
                let var = self.fresh()?;
                self.names.push((*no, var));
                Some(Arg::Var(var))
            }
            (Term::Var(no), Some(scope)) => {
                let place = scope.get_mut(usize::from(*no))?;
                if place.is_none() {
                    *place = Some(Arg::Var(self.fresh()?));
                }
                place.clone()
            }
            _ => None,
        }
    }

    fn sorted(&mut self, arg: Arg, sort: Sort) -> Option<Var> {
        match arg {
            Arg::Var(var) => {
                let place = &mut self.sorts[usize::from(var)];
                if *place == Sort::Unknown {
                    *place = sort;
                }
                (*place == sort).then_some(var)
            }
            Arg::Const(value) => {
                let is_task =
                    value.as_symbol().is_some_and(|it| it == "top-level") || value.as_path().is_some();
                if sort == Sort::Task && !is_task {
                    return None;
                }
                let known =
                    self.fixed.iter().find(|it| it.1 == value && self.sorts[usize::from(it.0)] == sort);
                if let Some((var, _)) = known {
                    return Some(*var);
                }
                let var = self.fresh()?;
                self.sorts[usize::from(var)] = sort;
                self.fixed.push((var, value));
                Some(var)
            }
        }
    }

    fn var(&mut self, term: &Term, sort: Sort, scope: Option<&mut Scope>) -> Option<Var> {
        let arg = self.arg(term, scope)?;
        self.sorted(arg, sort)
    }

    /// A goal as a condition over the variables of the row; `scope` are those of a clause that is looked into.
    fn cond(&mut self, goal: &Goal, mut scope: Option<&mut Scope>, way: &mut Vec<PredId>) -> Option<Cond> {
        match &goal.kind {
            GoalKind::True => Some(Cond::All(Vec::new())),
            GoalKind::False => Some(Cond::Any(Vec::new())),
            GoalKind::And(goals) => {
                let all = goals.iter().map(|goal| self.cond(goal, scope.as_deref_mut(), way));
                Some(Cond::All(all.collect::<Option<_>>()?))
            }
            GoalKind::Or(goals) => {
                let all = goals.iter().map(|goal| self.cond(goal, scope.as_deref_mut(), way));
                Some(Cond::Any(all.collect::<Option<_>>()?))
            }
            GoalKind::Not(inner, _) => Some(Cond::Not(Box::new(self.cond(inner, scope, way)?))),
            GoalKind::If { test, then, otherwise, soft: false } => {
                let test = self.cond(test, scope.as_deref_mut(), way)?;
                let then = self.cond(then, scope.as_deref_mut(), way)?;
                let otherwise = match otherwise {
                    Some(goal) => self.cond(goal, scope, way)?,
                    None => Cond::Any(Vec::new()),
                };
                Some(Cond::If(Box::new(test), Box::new(then), Box::new(otherwise)))
            }
            GoalKind::Unify(a, b) => self.unify(a, b, scope),
            GoalKind::Identical(a @ Term::Var(_), b @ (Term::Var(_) | Term::Const(_))) => {
                self.unify(a, b, scope)
            }
            GoalKind::Call(predicate, args) => match tree_name(self.rules, goal) {
                Some(name) => self.over_tree(name, args, scope),
                None => self.predicate(*predicate, args, scope, way),
            },
            _ => None,
        }
    }

    fn over_tree(&mut self, name: &str, args: &[Term], mut scope: Option<&mut Scope>) -> Option<Cond> {
        let attr = match name {
            "task-name" => Some((Attr::Name, 1)),
            "task-kind" => Some((Attr::Kind, 1)),
            "task-status" => Some((Attr::Status, 1)),
            "task-type" => Some((Attr::Param(Symbol::from("type")), 1)),
            "task-param" => match self.arg(args.get(1)?, scope.as_deref_mut())? {
                Arg::Const(key) => Some((Attr::Param(symbol(&key)?), 2)),
                Arg::Var(_) => return None,
            },
            _ => None,
        };
        let task = self.var(args.first()?, Sort::Task, scope.as_deref_mut())?;
        let rel = match (attr, name) {
            (Some((attr, value)), _) => {
                let value = self.var(args.get(value)?, Sort::Value, scope)?;
                let known = self.attrs.iter().position(|it| *it == attr);
                let at = known.unwrap_or_else(|| {
                    self.attrs.push(attr);
                    self.attrs.len() - 1
                });
                Rel::Attr(u8::try_from(at).ok()?, task, value)
            }
            (None, "task") => Rel::Task(task),
            (None, "edited") => Rel::Edited(task),
            (None, "subtask" | "subtask+" | "before") => {
                let other = self.var(args.get(1)?, Sort::Task, scope)?;
                match name {
                    "subtask" => Rel::Child(task, other),
                    "subtask+" => Rel::Below(task, other),
                    _ => Rel::Before(task, other),
                }
            }
            _ => return None,
        };
        Some(Cond::Rel(rel))
    }

    fn unify(&mut self, a: &Term, b: &Term, mut scope: Option<&mut Scope>) -> Option<Cond> {
        let of_form = |it: &Term| matches!(it, Term::Pair(..)) && is_form(it);
        let (term, form) = if of_form(a) { (b, a) } else { (a, b) };
        if of_form(form) {
            let arg = self.arg(term, scope)?;
            return self.same(arg, Err(form.clone()));
        }
        let (a, b) = (self.arg(a, scope.as_deref_mut())?, self.arg(b, scope)?);
        self.same(a, Ok(b))
    }

    /// Something is the same as something else, or has a form.
    fn same(&mut self, a: Arg, b: Result<Arg, Term>) -> Option<Cond> {
        let sort = |it: &Self, arg: &Arg| match arg {
            Arg::Var(var) => it.sorts[usize::from(*var)],
            Arg::Const(_) => Sort::Unknown,
        };
        let b = match b {
            Ok(b) => b,
            Err(form) => {
                if let Arg::Const(value) = &a {
                    let holds = super::join::has_form(&form, value);
                    return Some(if holds { Cond::All(Vec::new()) } else { Cond::Any(Vec::new()) });
                }
                if sort(self, &a) != Sort::Value {
                    return None;
                }
                let value = self.sorted(a, Sort::Value)?;
                self.forms.push(form);
                return Some(Cond::Rel(Rel::Form(value, u8::try_from(self.forms.len() - 1).ok()?)));
            }
        };
        if let (Arg::Const(a), Arg::Const(b)) = (&a, &b) {
            return Some(if a == b { Cond::All(Vec::new()) } else { Cond::Any(Vec::new()) });
        }
        let sort = match (sort(self, &a), sort(self, &b)) {
            (Sort::Unknown, Sort::Unknown) => return None,
            (Sort::Unknown, sort) | (sort, _) => sort,
        };
        // A task is not what is written for it.
        if sort == Sort::Task && matches!((&a, &b), (Arg::Const(_), _) | (_, Arg::Const(_))) {
            return None;
        }
        Some(Cond::Rel(Rel::Same(self.sorted(a, sort)?, self.sorted(b, sort)?)))
    }

    /// The clauses of a predicate, in the place of its call.
    fn predicate(
        &mut self,
        predicate: PredId,
        args: &[Term],
        mut scope: Option<&mut Scope>,
        way: &mut Vec<PredId>,
    ) -> Option<Cond> {
        let rules = self.rules;
        let it = rules.predicates.get(predicate.at())?;
        let fits = it.declared.kind == Kind::Rules
            && !it.declared.tabled
            && it.facts.is_empty()
            && (1..=MOST_CLAUSES).contains(&it.clauses.len())
            && way.len() < DEPTH
            && !way.contains(&predicate);
        if !fits {
            return None;
        }
        self.used.push(predicate);
        way.push(predicate);
        let args: Option<Vec<Arg>> = args.iter().map(|arg| self.arg(arg, scope.as_deref_mut())).collect();
        let args = args?;
        let mut all = Vec::new();
        for clause in &it.clauses {
            if clause.open {
                return None;
            }
            let mut inner: Scope = vec![None; clause.vars.len()];
            let mut conds = Vec::new();
            for (param, arg) in clause.head.iter().zip(&args) {
                match param {
                    Term::Any => {}
                    Term::Var(no) if inner[usize::from(*no)].is_none() => {
                        inner[usize::from(*no)] = Some(arg.clone());
                    }
                    Term::Var(no) => {
                        let known = inner[usize::from(*no)].clone()?;
                        conds.push(self.same(arg.clone(), Ok(known))?);
                    }
                    Term::Const(value) => conds.push(self.same(arg.clone(), Ok(Arg::Const(value.clone())))?),
                    form if is_form(form) => conds.push(self.same(arg.clone(), Err(form.clone()))?),
                    _ => return None,
                }
            }
            conds.push(self.cond(&clause.body, Some(&mut inner), way)?);
            all.push(Cond::All(conds));
        }
        way.pop();
        Some(if all.len() == 1 { all.remove(0) } else { Cond::Any(all) })
    }

    /// The join of these goals, and its call.
    fn join(
        &self,
        head: &[Term],
        goals: &[Goal],
        joined: &[usize],
        rules: &Rules,
        number: usize,
    ) -> Option<(Join, Goal)> {
        // What somebody else looks at is an argument.
        let is_seen = |no: VarNo| {
            let others = goals.iter().enumerate().filter(|goal| !joined.contains(&goal.0));
            head.iter().any(|term| term.has_var(no)) || others.into_iter().any(|goal| has_var(goal.1, no))
        };
        // Of a variable without a sort the join says nothing.
        let has_sort = |var: Var| self.sorts[usize::from(var)] != Sort::Unknown;
        let seen = self.names.iter().copied().filter(|name| has_sort(name.1) && is_seen(name.0));
        let seen: Vec<(VarNo, Var)> = seen.collect();
        if seen.len() > MOST_JOINED {
            return None;
        }
        let mut order: Vec<Var> = seen.iter().map(|name| name.1).collect();
        order.extend((0..self.sorts.len() as Var).filter(|var| !seen.iter().any(|name| name.1 == *var)));
        let name = |var: Var| order.iter().position(|it| *it == var).unwrap_or_default() as Var;
        let join = Join {
            goals: self.conds.iter().map(|(at, cond)| (cond.renamed(&name), goals[*at].clone())).collect(),
            vars: order.iter().map(|var| self.sorts[usize::from(*var)]).collect(),
            args: seen.len(),
            attrs: self.attrs.clone(),
            forms: self.forms.clone(),
            fixed: self.fixed.iter().map(|(var, value)| (name(*var), value.clone())).collect(),
        };
        let args = seen.iter().map(|name| Term::Var(name.0));
        let args = std::iter::once(Term::Const(Value::int(number as i64))).chain(args).collect();
        let kind = GoalKind::Call(rules.join_of(seen.len()), args);
        Some((join, Goal { kind, place: goals[*joined.first()?].place }))
    }
}

/// True for a term whose only variables are `?_`.
fn is_form(term: &Term) -> bool {
    match term {
        Term::Any => true,
        Term::Const(value) => !matches!(value.obj(), Some(Obj::Path(_))),
        Term::Pair(first, rest) => is_form(first) && is_form(rest),
        _ => false,
    }
}
