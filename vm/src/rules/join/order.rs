//! The order in which the tasks of a join are looked for.
//!
//! It is chosen when the join is asked. Steps that find one thing at the most come as soon as they can. Among the
//! tasks that are left to look for, the one comes next for which the tree has the fewest, as its columns count
//! them. The first that is written stays the first: so the answers for it can be given before the next is
//! looked for.

use std::cell::Cell as Counter;
use std::rc::Rc;

use crate::value::{Imm, Value};

use super::super::Rules;
use super::super::clause::{Goal, GoalKind, Term};
use super::super::view::{Column, List, NONE, TreeView};
use super::modes::binds;
use super::steps::{Op, Source, Step};
use super::{Cond, Join, NAME, Rel, Sort, Var, bit};

/// What a row holds at most.
pub(super) const WIDTH: usize = 8;
/// A value that no column has.
pub(super) const UNKNOWN: u32 = NONE - 1;

/// How a join is answered.
pub struct Order {
    pub(super) join: Rc<Join>,
    pub(super) steps: Vec<Step>,
    /// From this step on answers are sorted; the number of steps if they come in order.
    pub(super) sorted_from: usize,
    /// What a row holds: first what it is sorted by.
    pub(super) row: Vec<Var>,
    pub(super) columns: Vec<Rc<Column>>,
    /// What stands for something that is written.
    pub(super) fixed: Vec<(Var, u32)>,
    /// Something that is written is not in the tree.
    pub(super) is_empty: bool,
}

/// The goals of a join in the order in which a query over a tree has asked them, how often each step was
/// expected to hold, and how often it has; nothing for another goal. A goal that is no step of its own stands
/// with the one that answers it.
pub fn asked<'r>(rules: &'r Rules, view: &TreeView, goal: &Goal) -> Option<Vec<(Vec<&'r Goal>, f64, u64)>> {
    let GoalKind::Call(predicate, args) = &goal.kind else { return None };
    if rules.predicates[predicate.at()].declared.name != NAME {
        return None;
    }
    let Some(Term::Const(Value::Imm(Imm::Int(number)))) = args.first() else { return None };
    let join = rules.joins.get(*number as usize)?;
    let order = view.order_of(*number as u32).unwrap_or_else(|| Rc::new(Order::of(join, view, 0)));
    let mut shown = vec![false; join.goals.len()];
    let steps = order.steps.iter().filter_map(|step| {
        let new: Vec<usize> = step.goals.iter().copied().filter(|at| !shown[*at]).collect();
        new.iter().for_each(|at| shown[*at] = true);
        let goals: Vec<&Goal> = new.iter().map(|at| &join.goals[*at].1).collect();
        (!goals.is_empty()).then(|| (goals, step.expected, step.held.get()))
    });
    Some(steps.collect())
}

/// Puts the goals of a join in order.
struct Planner<'a> {
    join: &'a Join,
    view: &'a TreeView,
    columns: &'a [Rc<Column>],
    fixed: &'a [(Var, u32)],
    /// Tasks are looked for in the order in which the goals are written.
    as_written: bool,
    /// The first is, at least.
    keeps_first: bool,
}

/// A way to look for a task.
struct Way {
    cost: f64,
    source: Source,
    /// The goals that it is about, and those of them that need not be asked any more.
    shown: Vec<usize>,
    used: Vec<usize>,
}

impl Order {
    /// The order for a join when these variables are given: where one needs rows of too many columns, that which
    /// is written.
    pub(super) fn of(join: &Rc<Join>, view: &TreeView, given: u64) -> Order {
        let order = Order::new(join, view, given, false);
        if order.row.len() <= WIDTH { order } else { Order::as_written(join, view, given) }
    }

    /// The order that is written. Its answers need no rows.
    pub(super) fn as_written(join: &Rc<Join>, view: &TreeView, given: u64) -> Order {
        Order::new(join, view, given, true)
    }

    fn new(join: &Rc<Join>, view: &TreeView, given: u64, as_written: bool) -> Order {
        let columns: Vec<Rc<Column>> = join.attrs.iter().map(|attr| view.column(*attr)).collect();
        let mut is_empty = false;
        let mut fixed = Vec::new();
        for (var, value) in &join.fixed {
            let number = match join.vars[*var as usize] {
                Sort::Task => match value {
                    Value::Imm(Imm::Symbol(name)) if *name == "top-level" => Some(0),
                    value => value.as_path().and_then(|path| view.at(path)),
                },
                _ => Some(known(view, value)),
            };
            is_empty |= number.is_none();
            fixed.push((*var, number.unwrap_or(0)));
        }
        let given = fixed.iter().fold(given, |given, it| given | bit(it.0));
        let planner = Planner { join, view, columns: &columns, fixed: &fixed, as_written, keeps_first: true };
        // What holds holds once more.
        let mut seen = Vec::new();
        let goals = join.goals.iter().map(|goal| &goal.0).enumerate().filter(|(_, cond)| match cond {
            Cond::Rel(rel) if seen.contains(rel) => false,
            Cond::Rel(rel) => {
                seen.push(*rel);
                true
            }
            _ => true,
        });
        let goals: Vec<(usize, &Cond)> = goals.collect();
        let mut steps = planner.steps(&goals, given);
        let mut back = 0;
        for (at, step) in steps.iter_mut().enumerate() {
            step.back = back;
            if let Op::Find(..) = step.op {
                back = at + 1;
            }
        }
        let (sorted_from, row) = sorted(join, &steps, &looked_for(&goals, given), given);
        Order { join: join.clone(), steps, sorted_from, row, columns, fixed, is_empty }
    }
}

/// The tasks that goals look for as they are written.
fn looked_for(goals: &[(usize, &Cond)], mut known: u64) -> Vec<Var> {
    let mut found = Vec::new();
    for (_, cond) in goals {
        if let Cond::Rel(rel) = cond {
            for var in rel.looks_for(known) {
                if !found.contains(&var) {
                    found.push(var);
                }
            }
            known |= rel.vars();
        }
    }
    found
}

/// From which step on answers have to be sorted, and what a row of them holds.
fn sorted(join: &Join, steps: &[Step], written: &[Var], given: u64) -> (usize, Vec<Var>) {
    let mut known = given;
    let mut at = 0;
    let mut left = written.iter().copied();
    let mut keys = Vec::new();
    loop {
        // What is known follows from what has been found.
        while let Some(step) = steps.get(at) {
            match step.op {
                Op::Find(..) => break,
                Op::Get(d, ..) | Op::Parent(d, _) | Op::Copy(d, _) => known |= bit(d),
                _ => {}
            }
            at += 1;
        }
        let Some(var) = left.by_ref().find(|var| known & bit(*var) == 0) else { break };
        match steps.get(at) {
            Some(Step { op: Op::Find(found, _), .. }) if *found == var => {
                known |= bit(var);
                at += 1;
            }
            _ => {
                keys.push(var);
                keys.extend(left);
                break;
            }
        }
    }
    if keys.is_empty() {
        return (steps.len(), Vec::new());
    }
    let others = (0..join.args as Var).filter(|var| known & bit(*var) == 0 && !keys.contains(var));
    let others: Vec<Var> = others.collect();
    (at, keys.into_iter().chain(others).collect())
}

impl Planner<'_> {
    /// The steps for goals when these variables are known.
    fn steps(&self, goals: &[(usize, &Cond)], mut known: u64) -> Vec<Step> {
        let mut left = goals.to_vec();
        let written = looked_for(goals, known);
        let mut steps = Vec::new();
        let mut rows = 1.0;
        let mut is_first = self.keeps_first;
        loop {
            while let Some((at, op, binds, share)) = self.ready(&left, known) {
                known |= binds;
                rows *= share;
                steps.push(Step {
                    op,
                    back: 0,
                    goals: vec![left[at].0],
                    expected: rows,
                    held: Counter::new(0),
                });
                left.remove(at);
            }
            let mut free = written.iter().copied().filter(|var| known & bit(*var) == 0);
            let ways: Vec<(Var, Way)> = match self.as_written || is_first {
                true => free.next().map(|var| (var, self.way(var, &left, known))).into_iter().collect(),
                false => free.map(|var| (var, self.way(var, &left, known))).collect(),
            };
            is_first = false;
            let best = ways.into_iter().min_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
            let Some((var, way)) = best else {
                debug_assert!(left.is_empty(), "tests are about what has been found");
                return steps;
            };
            known |= bit(var);
            rows *= way.cost;
            steps.push(Step {
                op: Op::Find(var, way.source),
                back: 0,
                expected: rows,
                goals: way.shown.iter().map(|at| left[*at].0).collect(),
                held: Counter::new(0),
            });
            let mut at = 0;
            left.retain(|_| {
                at += 1;
                !way.used.contains(&(at - 1))
            });
        }
    }

    /// A goal that needs no search: where it is, its step, what is known after it, and how often it holds.
    fn ready(&self, left: &[(usize, &Cond)], known: u64) -> Option<(usize, Op, u64, f64)> {
        let has = |var: Var| known & bit(var) != 0;
        let simple = left.iter().enumerate().find_map(|(at, (_, cond))| {
            let Cond::Rel(rel) = cond else { return None };
            if rel.vars() & !known == 0 {
                return Some((at, Op::Test(*rel), 0, self.share(*rel)));
            }
            match *rel {
                Rel::Attr(attr, task, value) if has(task) => {
                    let column = &self.columns[usize::from(attr)];
                    let share = column.having().len() as f64 / self.view.len() as f64;
                    Some((at, Op::Get(value, attr, task), bit(value), share))
                }
                Rel::Child(above, task) if has(task) => Some((at, Op::Parent(above, task), bit(above), 1.0)),
                Rel::Same(a, b) if has(a) => Some((at, Op::Copy(b, a), bit(b), 1.0)),
                Rel::Same(a, b) if has(b) => Some((at, Op::Copy(a, b), bit(a), 1.0)),
                _ => None,
            }
        });
        simple.or_else(|| {
            left.iter().enumerate().find_map(|(at, (_, cond))| {
                // Variables of its own are not known; those that it shares are, where it is written.
                let is_ready = !matches!(cond, Cond::Rel(_)) && self.shared(cond) & !known == 0;
                is_ready.then(|| (at, self.test(cond, known), 0, 0.5))
            })
        })
    }

    /// The variables of a test that other goals have, too.
    fn shared(&self, cond: &Cond) -> u64 {
        let others = self.join.goals.iter().filter(|goal| !std::ptr::eq(&raw const goal.0, cond));
        let others = others.fold(0, |vars, goal| vars | goal.0.vars());
        cond.vars() & others
    }

    fn test(&self, cond: &Cond, known: u64) -> Op {
        let free = Planner { keeps_first: false, as_written: false, ..*self };
        let ops = |cond: &Cond| free.inner(cond, known);
        match cond {
            Cond::Rel(rel) => Op::Test(*rel),
            Cond::Not(it) => Op::Not(ops(it)),
            Cond::All(_) => Op::Any(vec![ops(cond)]),
            Cond::Any(all) => Op::Any(all.iter().map(ops).collect()),
            Cond::If(test, then, otherwise) => {
                // What the test finds first counts, so it is asked as it is written.
                let written = Planner { as_written: true, ..*self };
                let first = written.inner(test, known);
                let after = free.inner(then, known | binds(test));
                Op::If(first, after, ops(otherwise))
            }
        }
    }

    /// The steps of goals inside of a test: the relations of nested rows, and tests between them.
    fn inner(&self, cond: &Cond, known: u64) -> Vec<Op> {
        let mut flat = Vec::new();
        let mut todo = vec![cond];
        while let Some(cond) = todo.pop() {
            match cond {
                Cond::All(all) => todo.extend(all.iter().rev()),
                cond => flat.push((0, cond)),
            }
        }
        let mut ops = Vec::new();
        let mut known = known;
        let mut rels: Vec<(usize, &Cond)> = Vec::new();
        // What is between two tests is put in order; a test stays behind what is before it.
        for goal in flat.into_iter().map(Some).chain([None]) {
            match goal {
                Some((_, cond @ Cond::Rel(_))) => rels.push((0, cond)),
                other => {
                    ops.extend(self.steps(&rels, known).into_iter().map(|step| step.op));
                    known = rels.drain(..).fold(known, |known, goal| known | goal.1.vars());
                    if let Some((_, cond)) = other {
                        ops.push(self.test(cond, known));
                        known |= binds(cond);
                    }
                }
            }
        }
        ops
    }

    /// How much of all a test lets through.
    fn share(&self, rel: Rel) -> f64 {
        let all = self.view.len() as f64;
        match rel {
            Rel::Task(_) => 1.0,
            Rel::Attr(attr, _, value) => self.with(attr, Some(value)) / all,
            _ => 0.5,
        }
    }

    /// How many tasks have something, or a value of it.
    fn with(&self, attr: u8, value: Option<Var>) -> f64 {
        let column = &self.columns[usize::from(attr)];
        match value {
            Some(value) => match self.fixed.iter().find(|it| it.0 == value) {
                Some((_, number)) => column.with(*number).len() as f64,
                None => column.having().len() as f64 / column.distinct.max(1) as f64,
            },
            None => column.having().len() as f64,
        }
    }

    /// The best way to look for a task.
    fn way(&self, var: Var, left: &[(usize, &Cond)], known: u64) -> Way {
        let has = |var: Var| known & bit(var) != 0;
        let all = self.view.len() as f64;
        let rels = || {
            left.iter().enumerate().filter_map(|(at, goal)| match goal.1 {
                Cond::Rel(rel) => Some((at, *rel)),
                _ => None,
            })
        };
        let about = left.iter().position(|goal| goal.1.vars() & bit(var) != 0);
        let mut best =
            Way { cost: all, source: Source::All, shown: about.into_iter().collect(), used: Vec::new() };
        let mut take = |way: Way| {
            if way.cost < best.cost {
                best = way;
            }
        };
        // Whatever is unknown of a column has to be fetched afterwards.
        let lists: Vec<(usize, u8, Option<Var>)> = rels()
            .filter_map(|(at, rel)| match rel {
                Rel::Attr(attr, task, value) if task == var => {
                    Some((at, attr, Some(value).filter(|it| has(*it))))
                }
                _ => None,
            })
            .collect();
        let used = |at: usize, value: Option<Var>| if value.is_some() { vec![at] } else { Vec::new() };
        for (at, attr, value) in &lists {
            let cost = self.with(*attr, *value);
            let source = Source::Having(*attr, *value);
            take(Way { cost, source, shown: vec![*at], used: used(*at, *value) });
        }
        for (at, rel) in rels() {
            match rel {
                Rel::Child(above, task) if task == var && has(above) => {
                    take(Way { cost: 3.0, source: Source::Children(above), shown: vec![at], used: vec![at] });
                }
                Rel::Below(above, task) if task == var && has(above) => {
                    let below = self.size(above);
                    take(Way {
                        cost: below,
                        source: Source::Below(above, None),
                        shown: vec![at],
                        used: vec![at],
                    });
                    for (list, attr, value) in &lists {
                        let cost = self.with(*attr, *value) * below / all;
                        let source = Source::Below(above, Some((*attr, *value)));
                        let used = [vec![at], used(*list, *value)].concat();
                        take(Way { cost, source, shown: vec![at, *list], used });
                    }
                }
                Rel::Below(above, task) if above == var && has(task) => {
                    take(Way { cost: 4.0, source: Source::Above(task), shown: vec![at], used: vec![at] });
                }
                _ => {}
            }
        }
        best
    }

    /// How many tasks are below a task of a variable.
    fn size(&self, var: Var) -> f64 {
        const SAMPLE: usize = 16;
        if let Some((_, task)) = self.fixed.iter().find(|it| it.0 == var) {
            return self.view.below(*task).len() as f64;
        }
        let lists = self.join.goals.iter().filter_map(|goal| match goal.0 {
            Cond::Rel(Rel::Attr(attr, task, value)) if task == var => {
                let number = self.fixed.iter().find(|it| it.0 == value)?.1;
                Some(self.columns[usize::from(attr)].with(number))
            }
            _ => None,
        });
        let list = lists.min_by_key(List::len).unwrap_or_else(|| List::new(self.view.all()));
        let (mut sum, mut n) = (0, 0);
        for task in list.some(SAMPLE) {
            sum += self.view.below(task).len();
            n += 1;
        }
        sum as f64 / f64::from(n.max(1))
    }
}

/// The number of a value; of one that the tree does not have [`UNKNOWN`].
pub(super) fn known(view: &TreeView, value: &Value) -> u32 {
    match view.number(value) {
        NONE => UNKNOWN,
        number => number,
    }
}
