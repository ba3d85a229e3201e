//! Joins: goals over a task tree that are answered together.
//!
//! The planner of clauses ([`super::plan`]) takes what stands in a row and only asks the table of the tree, and
//! makes one goal of it. How that is answered is decided when it is asked: with the columns of the tree at hand
//! it is known how many tasks each goal can give. An [`Order`] is a list of steps over an array of numbers, tasks
//! and values; a [`Run`] goes through them forwards and backwards.
//!
//! The answers come as if the goals had been asked one after another as they are written. Each goal gives
//! tasks in the order of the tree, and each once, so that is the order of the tuples of those tasks that are
//! looked for, in the order in which the goals look for them. So a run may look for them in another order if it
//! sorts. It keeps the first, and sorts what it finds for each of its tasks: the first answer comes at once.
//!
//! Invariants
//! 1. Every goal of a join is a relation between tasks and values: it holds once for each of them or not at all,
//!    and neither fails with an error nor goes on for ever.
//! 2. A run does a bounded number of steps before it lets the engine look at its fuel.

use std::cell::Cell as Counter;
use std::rc::Rc;

use crate::native::Raise;
use crate::value::{Imm, Value};

use super::clause::{Goal, GoalKind, Term};
use super::native::{Alternatives, Call, Found};
use super::store::Cell;
use super::tree::{TaskArg, task_arg};
use super::view::{Attr, Column, List, NONE, TreeView};

/// A variable of a join: a register of its runs.
pub type Var = u8;

/// The name of the predicate whose first argument says which join it is.
pub const NAME: &str = "%join";

/// A value that no column has.
const UNKNOWN: u32 = NONE - 1;
/// Steps between two looks at the fuel.
const STRETCH: u32 = 256;
/// What a row holds at most.
const WIDTH: usize = 8;
/// Rows that are sorted at most; where there are more, tasks are looked for in the order that is written.
const MOST_ROWS: usize = 1 << 18;

/// What a variable stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sort {
    /// Nobody has said.
    Unknown,
    /// A task.
    Task,
    /// A value of a column.
    Value,
}

/// A relation between tasks and values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rel {
    /// It is a task.
    Task(Var),
    /// An edit stands on it or below it.
    Edited(Var),
    /// What a task has of a kind: a position in [`Join::attrs`].
    Attr(u8, Var, Var),
    /// The second is directly below the first.
    Child(Var, Var),
    /// The second is somewhere below the first.
    Below(Var, Var),
    /// The first had ended when the second was called.
    Before(Var, Var),
    /// They are the same task, or the same value.
    Same(Var, Var),
    /// A value has a form: a position in [`Join::forms`].
    Form(Var, u8),
}

/// What may hold.
#[derive(Debug, Clone)]
pub enum Cond {
    /// A relation.
    Rel(Rel),
    /// All of them.
    All(Vec<Cond>),
    /// One of them, the first that does.
    Any(Vec<Cond>),
    /// It does not hold.
    Not(Box<Cond>),
    /// If the first does the second, else the third.
    If(Box<Cond>, Box<Cond>, Box<Cond>),
}

impl Cond {
    /// The same with other names for its variables.
    #[must_use]
    pub fn renamed(&self, name: &dyn Fn(Var) -> Var) -> Cond {
        let all = |all: &[Cond]| all.iter().map(|it| it.renamed(name)).collect();
        let boxed = |it: &Cond| Box::new(it.renamed(name));
        match self {
            Cond::Rel(rel) => Cond::Rel(match *rel {
                Rel::Task(a) => Rel::Task(name(a)),
                Rel::Edited(a) => Rel::Edited(name(a)),
                Rel::Attr(attr, a, b) => Rel::Attr(attr, name(a), name(b)),
                Rel::Child(a, b) => Rel::Child(name(a), name(b)),
                Rel::Below(a, b) => Rel::Below(name(a), name(b)),
                Rel::Before(a, b) => Rel::Before(name(a), name(b)),
                Rel::Same(a, b) => Rel::Same(name(a), name(b)),
                Rel::Form(a, form) => Rel::Form(name(a), form),
            }),
            Cond::All(parts) => Cond::All(all(parts)),
            Cond::Any(parts) => Cond::Any(all(parts)),
            Cond::Not(it) => Cond::Not(boxed(it)),
            Cond::If(a, b, c) => Cond::If(boxed(a), boxed(b), boxed(c)),
        }
    }
}

/// Goals that are answered together.
#[derive(Default)]
pub struct Join {
    /// The goals, as they are written.
    pub goals: Vec<(Cond, Goal)>,
    /// What each variable stands for. The first are the arguments of the goal, after the number of the join.
    pub vars: Vec<Sort>,
    /// How many arguments there are.
    pub args: usize,
    /// What is asked of tasks.
    pub attrs: Vec<Attr>,
    /// Forms of values.
    pub forms: Vec<Term>,
    /// Variables that stand for something that is written.
    pub fixed: Vec<(Var, Value)>,
}

fn bit(var: Var) -> u64 {
    1 << var
}

impl Rel {
    /// Its variables.
    fn vars(self) -> u64 {
        match self {
            Rel::Task(a) | Rel::Edited(a) | Rel::Form(a, _) => bit(a),
            Rel::Attr(_, a, b)
            | Rel::Child(a, b)
            | Rel::Below(a, b)
            | Rel::Before(a, b)
            | Rel::Same(a, b) => bit(a) | bit(b),
        }
    }

    /// The tasks that it looks for where it is written, in their order, if these variables are known.
    fn looks_for(self, known: u64) -> impl Iterator<Item = Var> {
        let pair = match self {
            Rel::Task(a) | Rel::Edited(a) | Rel::Attr(_, a, _) => [Some(a), None],
            // With a task the one above is known.
            Rel::Child(_, b) => [None, Some(b)],
            Rel::Below(a, b) | Rel::Before(a, b) => [Some(a), Some(b)],
            Rel::Same(..) | Rel::Form(..) => [None, None],
        };
        pair.into_iter().flatten().filter(move |var| known & bit(*var) == 0)
    }
}

impl Cond {
    /// Visits its relations.
    pub fn each_rel(&self, visit: &mut dyn FnMut(Rel)) {
        match self {
            Cond::Rel(rel) => visit(*rel),
            Cond::All(all) | Cond::Any(all) => all.iter().for_each(|it| it.each_rel(visit)),
            Cond::Not(it) => it.each_rel(visit),
            Cond::If(a, b, c) => [a, b, c].into_iter().for_each(|it| it.each_rel(visit)),
        }
    }

    /// Its variables.
    pub fn vars(&self) -> u64 {
        let mut vars = 0;
        self.each_rel(&mut |rel| vars |= rel.vars());
        vars
    }
}

// ---------------------------------------------------------------------------------------------
// Steps

/// Where tasks come from.
enum Source {
    All,
    /// Those that have something, or this value.
    Having(u8, Option<Var>),
    Children(Var),
    /// Those below a task; of them only those that have something, or this value.
    Below(Var, Option<(u8, Option<Var>)>),
    /// Those above a task.
    Above(Var),
}

enum Op {
    /// Looks for tasks.
    Find(Var, Source),
    /// What a task has.
    Get(Var, u8, Var),
    /// The task above.
    Parent(Var, Var),
    Copy(Var, Var),
    Test(Rel),
    Not(Vec<Op>),
    Any(Vec<Vec<Op>>),
    If(Vec<Op>, Vec<Op>, Vec<Op>),
}

/// A step, and what the plan of a query shows of it.
struct Step {
    op: Op,
    /// One past the last step before it that looks for tasks; 0 if there is none.
    back: usize,
    /// The goals that it answers.
    goals: Vec<usize>,
    expected: f64,
    held: Counter<u64>,
}

/// How a join is answered.
pub struct Order {
    join: Rc<Join>,
    steps: Vec<Step>,
    /// From this step on answers are sorted; the number of steps if they come in order.
    sorted_from: usize,
    /// What a row holds: first what it is sorted by.
    row: Vec<Var>,
    columns: Vec<Rc<Column>>,
    /// What stands for something that is written.
    fixed: Vec<(Var, u32)>,
    /// Something that is written is not in the tree.
    is_empty: bool,
}

/// The goals of a join in the order in which a query over a tree has asked them, how often each step was
/// expected to hold, and how often it has; nothing for another goal. A goal that is no step of its own stands
/// with the one that answers it.
pub fn asked<'r>(
    rules: &'r super::Rules,
    view: &TreeView,
    goal: &Goal,
) -> Option<Vec<(Vec<&'r Goal>, f64, u64)>> {
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
    /// An order for a join when these variables are given.
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

/// What is known of variables while goals are read as they are written.
#[derive(Debug, Clone, Copy, Default)]
pub struct Modes {
    /// Those that have values.
    pub known: u64,
    /// Those that stand for something inside of a test only: nobody else may look at them.
    pub hidden: u64,
}

impl Modes {
    /// True if a goal holds once at the most, and never looks for something without end. Then its variables are
    /// known after it.
    pub fn is_single(&mut self, cond: &Cond) -> bool {
        let mut finds = 0;
        self.walk(cond, true, &mut finds) && finds == 0
    }

    /// `single`: it must hold once at the most; else it is only asked whether it holds, and may look for the
    /// tasks of one list.
    fn walk(&mut self, cond: &Cond, single: bool, finds: &mut u32) -> bool {
        if cond.vars() & self.hidden != 0 {
            return false;
        }
        match cond {
            Cond::Rel(rel) => {
                let is_known = rel.vars() & !self.known == 0;
                let looks = rel.looks_for(self.known).count() as u32;
                let is_test = matches!(rel, Rel::Same(..)) && rel.vars() & self.known != 0;
                *finds += looks;
                self.known |= rel.vars();
                let fits = match rel {
                    Rel::Same(..) => is_test || is_known,
                    Rel::Form(..) => is_known,
                    _ => true,
                };
                fits && (looks == 0 || !single && *finds <= 1)
            }
            Cond::All(all) => all.iter().all(|it| self.walk(it, single, finds)),
            Cond::Any(all) => {
                let mut after = u64::MAX;
                let mut inside = 0;
                for it in all {
                    let mut modes = *self;
                    if !modes.walk(it, single, finds) {
                        return false;
                    }
                    after &= modes.known;
                    inside |= it.vars();
                }
                if !all.is_empty() {
                    self.known |= after & inside;
                    self.hidden |= inside & !self.known;
                }
                !single || all.len() < 2
            }
            Cond::Not(it) => {
                let mut modes = *self;
                let mut inner = 0;
                let fits = modes.walk(it, false, &mut inner);
                *finds += if single { 0 } else { inner };
                self.hidden |= it.vars() & !self.known;
                fits
            }
            Cond::If(test, then, otherwise) => {
                let (mut yes, mut no) = (*self, *self);
                let mut inner = 0;
                let fits = yes.walk(test, false, &mut inner) && yes.walk(then, true, &mut 0);
                *finds += if single { 0 } else { inner };
                self.hidden |= cond.vars() & !self.known;
                fits && no.walk(otherwise, true, &mut 0)
            }
        }
    }
}

/// The variables that have values when a test holds.
fn binds(cond: &Cond) -> u64 {
    match cond {
        Cond::Rel(rel) => rel.vars(),
        Cond::All(all) => all.iter().fold(0, |vars, it| vars | binds(it)),
        Cond::Any(all) => all.iter().map(binds).reduce(|a, b| a & b).unwrap_or(0),
        Cond::Not(_) => 0,
        // Nobody looks at what it finds.
        Cond::If(..) => 0,
    }
}

// ---------------------------------------------------------------------------------------------
// Running

/// What a run goes through at a step that looks for tasks.
#[derive(Default)]
struct Cursor {
    list: List,
    next: u32,
    end: u32,
    above: Vec<u32>,
}

/// What steps work on.
struct Work<'a> {
    view: &'a TreeView,
    join: &'a Join,
    columns: &'a [Rc<Column>],
    /// Tasks that tests have looked at.
    spent: Counter<u32>,
}

/// The goals that come after those of a list.
struct After<'a> {
    ops: &'a [Op],
    after: Option<&'a After<'a>>,
}

impl Work<'_> {
    fn open(&self, source: &Source, regs: &[u32], cursor: &mut Cursor) {
        let at = |var: Var| regs[var as usize];
        let list = |attr: u8, value: Option<Var>| {
            let column = &self.columns[usize::from(attr)];
            value.map_or_else(|| column.having(), |value| column.with(at(value)))
        };
        match source {
            Source::All => (cursor.next, cursor.end) = (0, self.view.len() as u32),
            Source::Having(attr, value) => cursor.list = list(*attr, *value),
            Source::Below(above, Some((attr, value))) => {
                cursor.list = list(*attr, *value).within(&self.view.below(at(*above)));
            }
            Source::Children(above) | Source::Below(above, None) => {
                let below = self.view.below(at(*above));
                (cursor.next, cursor.end) = (below.start, below.end);
            }
            Source::Above(task) => {
                cursor.above.clear();
                let mut task = at(*task);
                while task != 0 {
                    task = self.view.parent(task);
                    cursor.above.push(task);
                }
            }
        }
    }

    fn next(&self, source: &Source, cursor: &mut Cursor) -> Option<u32> {
        match source {
            Source::Having(..) | Source::Below(_, Some(_)) => cursor.list.next(),
            Source::Above(_) => cursor.above.pop(),
            Source::All | Source::Below(_, None) | Source::Children(_) => {
                let task = cursor.next;
                (task < cursor.end).then(|| {
                    cursor.next = match source {
                        Source::Children(_) => self.view.below(task).end,
                        _ => task + 1,
                    };
                    task
                })
            }
        }
    }

    /// A step that finds one thing at the most.
    #[inline]
    fn holds(&self, op: &Op, regs: &mut [u32]) -> bool {
        match op {
            Op::Get(value, attr, task) => {
                let found = self.columns[usize::from(*attr)].of[regs[*task as usize] as usize];
                regs[*value as usize] = found;
                found != NONE
            }
            Op::Parent(above, task) => {
                let task = regs[*task as usize];
                regs[*above as usize] = self.view.parent(task);
                task != 0
            }
            Op::Copy(to, from) => {
                regs[*to as usize] = regs[*from as usize];
                true
            }
            Op::Test(rel) => self.test(*rel, regs),
            Op::Not(ops) => !self.exists(ops, None, regs),
            Op::Any(all) => all.iter().any(|ops| self.exists(ops, None, regs)),
            Op::If(test, then, otherwise) => match self.exists(test, None, regs) {
                true => self.exists(then, None, regs),
                false => self.exists(otherwise, None, regs),
            },
            Op::Find(..) => false,
        }
    }

    #[inline]
    fn test(&self, rel: Rel, regs: &[u32]) -> bool {
        let at = |var: Var| regs[var as usize];
        match rel {
            Rel::Task(_) => true,
            Rel::Edited(task) => self.view.is_edited(at(task)),
            Rel::Attr(attr, task, value) => {
                self.columns[usize::from(attr)].of[at(task) as usize] == at(value)
            }
            Rel::Child(above, task) => at(task) != 0 && self.view.parent(at(task)) == at(above),
            Rel::Below(above, task) => self.view.is_above(at(above), at(task)),
            Rel::Before(a, b) => self.view.is_before(at(a), at(b)),
            Rel::Same(a, b) => at(a) == at(b),
            Rel::Form(value, form) => {
                has_form(&self.join.forms[usize::from(form)], &self.view.value_of(at(value)))
            }
        }
    }

    /// True if steps hold and those after them, for the first tasks for which they do. Its depth is that of what
    /// is written.
    fn exists(&self, ops: &[Op], after: Option<&After<'_>>, regs: &mut [u32]) -> bool {
        let Some((op, rest)) = ops.split_first() else {
            return match after {
                Some(next) => self.exists(next.ops, next.after, regs),
                None => true,
            };
        };
        match op {
            Op::Find(var, source) => {
                let mut cursor = Cursor::default();
                self.open(source, regs, &mut cursor);
                while let Some(task) = self.next(source, &mut cursor) {
                    self.spent.set(self.spent.get().saturating_add(1));
                    regs[*var as usize] = task;
                    if self.exists(rest, after, regs) {
                        return true;
                    }
                }
                false
            }
            // What is found in an alternative is seen by what comes after it.
            Op::Any(all) => {
                let after = After { ops: rest, after };
                all.iter().any(|ops| self.exists(ops, Some(&after), regs))
            }
            op => self.holds(op, regs) && self.exists(rest, after, regs),
        }
    }
}

/// True if a value has the form of a term whose only variables are `?_`.
pub(super) fn has_form(form: &Term, value: &Value) -> bool {
    let (mut form, mut value) = (form, value);
    loop {
        match (form, value.as_pair()) {
            (Term::Any, _) => return true,
            (Term::Const(constant), _) => return constant == value,
            (Term::Pair(first, rest), Some((a, b))) => {
                if !has_form(first, a) {
                    return false;
                }
                (form, value) = (rest, b);
            }
            _ => return false,
        }
    }
}

/// The number of a value; of one that the tree does not have [`UNKNOWN`].
fn known(view: &TreeView, value: &Value) -> u32 {
    match view.number(value) {
        NONE => UNKNOWN,
        number => number,
    }
}

/// A join that is being answered.
struct Run {
    order: Rc<Order>,
    given: u64,
    regs: Vec<u32>,
    cursors: Vec<Cursor>,
    at: usize,
    forward: bool,
    rows: Vec<[u32; WIDTH]>,
    next_row: usize,
    collecting: bool,
    /// Answers that have been given, and those that are to be left out.
    given_out: u64,
    left_out: u64,
    /// The registers are an answer that nobody has taken.
    is_ready: bool,
    is_busy: bool,
}

/// What a stretch of steps has come to.
#[derive(PartialEq)]
enum Came {
    Answer,
    End,
    Later,
}

impl Run {
    /// Goes on for a stretch.
    fn go(&mut self, view: &TreeView) -> Came {
        let order = self.order.clone();
        let work = Work { view, join: &order.join, columns: &order.columns, spent: Counter::new(0) };
        let mut left = STRETCH;
        loop {
            if let Some(row) = self.rows.get(self.next_row).filter(|_| !self.collecting) {
                for (var, number) in order.row.iter().zip(row) {
                    self.regs[*var as usize] = *number;
                }
                self.next_row += 1;
                return Came::Answer;
            }
            if left == 0 {
                return Came::Later;
            }
            left = (left - 1).saturating_sub(work.spent.take());
            if !self.forward {
                // The last step before this one that looks for tasks has more, or the one before that.
                let back = order.steps.get(self.at).map_or_else(|| last_find(&order.steps), |step| step.back);
                if self.collecting && back <= order.sorted_from {
                    self.collecting = false;
                    self.rows.sort_unstable();
                    self.next_row = 0;
                    self.at = order.sorted_from;
                    continue;
                }
                let Some(at) = back.checked_sub(1) else { return Came::End };
                let step = &order.steps[at];
                self.at = at;
                if let Op::Find(var, source) = &step.op
                    && let Some(task) = work.next(source, &mut self.cursors[at])
                {
                    self.regs[*var as usize] = task;
                    step.held.set(step.held.get() + 1);
                    (self.at, self.forward) = (at + 1, true);
                }
                continue;
            }
            if self.at == order.sorted_from && !self.collecting && self.at < order.steps.len() {
                self.collecting = true;
                self.rows.clear();
                self.next_row = 0;
            }
            let Some(step) = order.steps.get(self.at) else {
                self.forward = false;
                if !self.collecting {
                    return Came::Answer;
                }
                if self.rows.len() == MOST_ROWS {
                    self.begin_as_written(view);
                    return Came::Later;
                }
                let mut row = [0; WIDTH];
                for (cell, var) in row.iter_mut().zip(&order.row) {
                    *cell = self.regs[*var as usize];
                }
                self.rows.push(row);
                continue;
            };
            match &step.op {
                Op::Find(_, source) => {
                    work.open(source, &self.regs, &mut self.cursors[self.at]);
                    // It is the last one before the step after it.
                    self.at += 1;
                    self.forward = false;
                    if let Some(task) = work.next(source, &mut self.cursors[self.at - 1])
                        && let Op::Find(var, _) = &step.op
                    {
                        self.regs[*var as usize] = task;
                        step.held.set(step.held.get() + 1);
                        self.forward = true;
                    } else {
                        self.at -= 1;
                    }
                }
                op => match work.holds(op, &mut self.regs) {
                    true => {
                        step.held.set(step.held.get() + 1);
                        self.at += 1;
                    }
                    false => self.forward = false,
                },
            }
        }
    }

    /// Begins once more, in the order that is written: nothing has to be kept for that.
    fn begin_as_written(&mut self, view: &TreeView) {
        self.order = Rc::new(Order::new(&self.order.join, view, self.given, true));
        self.cursors = self.order.steps.iter().map(|_| Cursor::default()).collect();
        (self.rows, self.next_row, self.collecting) = (Vec::new(), 0, false);
        (self.at, self.forward) = (0, true);
        (self.left_out, self.given_out) = (self.given_out, 0);
    }

    /// The same, until there is an answer that has not been given.
    fn go_on(&mut self, view: &TreeView) -> Came {
        loop {
            let came = self.go(view);
            if came != Came::Answer {
                return came;
            }
            self.given_out += 1;
            if self.left_out == 0 {
                return came;
            }
            self.left_out -= 1;
        }
    }

    /// True if there may be more answers.
    fn has_more(&self) -> bool {
        let steps = self.order.steps.iter().zip(&self.cursors).take(self.order.sorted_from);
        let may_go_on = |(step, cursor): (&Step, &Cursor)| match &step.op {
            Op::Find(_, Source::Having(..) | Source::Below(_, Some(_))) => !cursor.list.is_empty(),
            Op::Find(_, Source::Above(_)) => !cursor.above.is_empty(),
            Op::Find(..) => cursor.next < cursor.end,
            _ => false,
        };
        self.next_row < self.rows.len() || steps.into_iter().any(may_go_on)
    }

    /// The answer goes to the arguments of the call.
    fn bind(&self, call: &mut Call<'_>) -> Result<bool, Raise> {
        let join = &self.order.join;
        for var in 0..join.args {
            let number = self.regs[var];
            let holds = match join.vars[var] {
                _ if self.given & bit(var as Var) != 0 => true,
                Sort::Task => call.unify(var + 1, Cell::Task(number))?,
                _ => call.unify_value(var + 1, &call.view.tree.value_of(number))?,
            };
            if !holds {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

fn last_find(steps: &[Step]) -> usize {
    match steps.last() {
        Some(Step { op: Op::Find(..), .. }) => steps.len(),
        Some(step) => step.back,
        None => 0,
    }
}

impl Alternatives for Run {
    fn next(&mut self, call: &mut Call<'_>) -> Result<Option<bool>, Raise> {
        loop {
            if !std::mem::take(&mut self.is_ready) {
                let came = self.go_on(&call.view.tree);
                self.is_busy = came == Came::Later;
                if came != Came::Answer {
                    return Ok(None);
                }
            }
            let mark = call.store.mark();
            if self.bind(call)? {
                return Ok(Some(self.has_more()));
            }
            call.store.back_to(mark);
        }
    }

    fn is_busy(&self) -> bool {
        self.is_busy
    }
}

/// `(%join number variable …)`
pub fn call(call: &mut Call<'_>) -> Result<Found, Raise> {
    let Cell::Imm(Imm::Int(number)) = call.arg(0) else { return Ok(Found::No) };
    let Some(join) = call.program.rules.joins.get(number as usize) else { return Ok(Found::No) };
    let view = call.view.tree.clone();
    if view.is_empty() {
        return Ok(Found::No);
    }
    let mut given = 0;
    let mut regs = vec![NONE; join.vars.len()];
    for (var, sort) in join.vars[..join.args].iter().enumerate() {
        let is_given = match sort {
            Sort::Task => match task_arg(call, var + 1) {
                TaskArg::Free => false,
                TaskArg::Task(task) => {
                    regs[var] = task;
                    true
                }
                TaskArg::None => return Ok(Found::No),
            },
            // A term that may have variables is compared with what is found.
            _ => matches!(call.arg(var + 1), Cell::Imm(_) | Cell::Obj(_)),
        };
        given |= u64::from(is_given) << var;
    }
    let key = (number as u32, given);
    let cached = view.orders.borrow().get(&key).cloned();
    // The number may be another join's where two programs look at one tree.
    let cached = cached.filter(|order| Rc::ptr_eq(&order.join, join));
    let order = cached.unwrap_or_else(|| {
        let order = Rc::new(Order::of(join, &view, given));
        view.orders.borrow_mut().insert(key, order.clone());
        order
    });
    if order.is_empty {
        return Ok(Found::No);
    }
    // Now the columns are there, in which values have numbers.
    for var in (0..join.args).filter(|var| given >> var & 1 != 0) {
        regs[var] = match call.arg(var + 1) {
            _ if join.vars[var] == Sort::Task => regs[var],
            Cell::Imm(imm) => known(&view, &Value::Imm(imm)),
            Cell::Obj(at) => known(&view, call.store.object(at)),
            _ => UNKNOWN,
        };
    }
    order.fixed.iter().for_each(|(var, number)| regs[*var as usize] = *number);
    let cursors = order.steps.iter().map(|_| Cursor::default()).collect();
    let mut run = Run {
        order,
        given,
        regs,
        cursors,
        at: 0,
        forward: true,
        rows: Vec::new(),
        next_row: 0,
        collecting: false,
        given_out: 0,
        left_out: 0,
        is_ready: false,
        is_busy: false,
    };
    Ok(match run.go_on(&view) {
        Came::End => Found::No,
        Came::Answer if !run.has_more() => match run.bind(call)? {
            true => Found::Yes,
            false => Found::No,
        },
        came => {
            run.is_ready = came == Came::Answer;
            Found::Many(Box::new(run))
        }
    })
}

impl Order {
    /// The order for a join: one that needs rows of too many columns is that which is written.
    fn of(join: &Rc<Join>, view: &TreeView, given: u64) -> Order {
        let order = Order::new(join, view, given, false);
        if order.row.len() <= WIDTH { order } else { Order::new(join, view, given, true) }
    }
}
