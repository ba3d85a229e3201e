//! A clause whose goals the planner has put in another order gives the same answers in the same order.
//!
//! Random goals over random trees; next to each clause stands the same one behind a cut, which keeps it
//! as it is written.

use std::rc::Rc;

use vm::desc::Desc;
use vm::edit::{Edit, What};
use vm::path::Path;
use vm::rules::View;
use vm::rules::view::{Attr, Task, TreeView};
use vm::value::{Obj, Symbol, Value};

use super::answers::End;
use super::generate::Batch;
use super::{Session, ask_over, load};
use crate::dice::Dice;
use crate::oracle::with_large_stack;

const KEYS: [&str; 3] = ["location", "object", "arms"];
const VALUES: [&str; 4] = ["left", "right", "a", "b"];
const TYPES: [&str; 3] = ["fetching", "placing", "going"];
const STATUS: [&str; 5] = ["succeeded", "failed", "skipped", "deferred", "planned"];

fn tree(dice: &mut Dice) -> Rc<TreeView> {
    let mut tasks = vec![task(0, "top-level", "top-level")];
    // The way from the root to the newest task.
    let mut way = vec![0];
    let mut clock = 0.0;
    for number in 1..2 + dice.below(20) as u32 {
        way.truncate(1 + dice.below(way.len()));
        let kind = dice.pick(&TYPES);
        let mut params = Vec::new();
        for key in KEYS {
            if dice.chance(60) {
                params.push((Symbol::from(key), value(dice, key)));
            }
        }
        if dice.chance(80) {
            params.push((Symbol::from("type"), Value::symbol(kind)));
        }
        let mut it = task(way[way.len() - 1], kind, if dice.chance(50) { "action" } else { "plan" });
        it.status = if dice.chance(70) { "succeeded" } else { "failed" };
        it.params = params;
        it.start = clock;
        // Many take no time, some still run.
        clock += dice.below(2) as f64;
        it.end = Some(clock).filter(|_| !dice.chance(5));
        if dice.chance(10) {
            it.edits = vec![Value::symbol("skip")];
        }
        tasks.push(it);
        way.push(number);
    }
    for at in (1..tasks.len()).rev() {
        let (end, above) = (tasks[at].end, tasks[at].parent as usize);
        tasks[above].end = tasks[above].end.zip(end).map(|(a, b)| a.max(b));
    }
    if dice.chance(50) {
        add_edits(dice, &mut tasks);
    }
    Rc::new(TreeView::new(tasks))
}

/// Edits that have been made after the tasks ran.
fn add_edits(dice: &mut Dice, tasks: &mut [Task]) {
    let view = TreeView::new(tasks.to_vec());
    let paths: Vec<Path> = (0..tasks.len() as u32).map(|task| view.path(task)).collect();
    for _ in 0..1 + dice.below(4) {
        let at = 1 + dice.below(tasks.len() - 1);
        let key = Symbol::from(dice.pick(&KEYS));
        let later: Vec<Path> =
            (0..1 + dice.below(2)).map(|_| paths[dice.below(paths.len())].clone()).collect();
        let what = match dice.below(6) {
            0 => What::Skip(None),
            1 => What::Before(code(dice)),
            2 => What::After(code(dice)),
            3 => What::WithParam(key, value(dice, &key)),
            4 => What::Defer(later),
            _ => What::Owe { code: code(dice), after: later, name: Symbol::from(dice.pick(&TYPES)) },
        };
        let guard = match tasks[at].params.first() {
            Some(param) if dice.chance(20) => vec![param.clone()],
            _ => Vec::new(),
        };
        let edit = Value::new(Obj::Edit(Box::new(Edit {
            at: paths[at].clone(),
            what,
            guard,
            by: None,
            out_of: Vec::new(),
        })));
        tasks[at].edits.push(edit.clone());
        tasks[at].pending.push(edit);
    }
}

/// Calls that an edit puts somewhere.
fn code(dice: &mut Dice) -> Value {
    let call = |dice: &mut Dice| {
        let property = |key: &str, value: Value| Value::list([Value::symbol(key), value]);
        let kind = property("type", Value::symbol(dice.pick(&TYPES)));
        let key = dice.pick(&KEYS);
        let action = [Value::symbol("an"), Value::symbol("action"), kind, property(key, value(dice, key))];
        Value::list([Value::symbol("perform"), Value::list(action)])
    };
    match dice.chance(60) {
        true => call(dice),
        false => Value::list([Value::symbol("seq"), call(dice), call(dice)]),
    }
}

/// A value of a parameter: two that are equal are not shared.
fn value(dice: &mut Dice, key: &str) -> Value {
    let word = Value::symbol(dice.pick(&VALUES));
    match key {
        "location" if dice.chance(50) => {
            Value::desc(Desc::new(Symbol::from("location"), vec![(Symbol::from("on"), word)]))
        }
        "arms" if dice.chance(30) => Value::symbol("both"),
        "arms" if dice.chance(30) => Value::list([word.clone(), word]),
        _ => word,
    }
}

fn task(parent: u32, name: &str, kind: &'static str) -> Task {
    let mut task = Task::default();
    (task.parent, task.name, task.kind) = (parent, Symbol::from(name), kind);
    task
}

struct Goals {
    dice: Dice,
    tasks: Vec<String>,
    values: Vec<String>,
    fresh: usize,
}

impl Goals {
    fn task(&mut self) -> String {
        let known = self.dice.below(4);
        let var = format!("T{known}");
        if !self.tasks.contains(&var) {
            self.tasks.push(var.clone());
        }
        var
    }

    fn value(&mut self, of: &[&str]) -> String {
        if self.dice.chance(40) {
            return self.dice.pick(of).into();
        }
        let var = format!("V{}", self.dice.below(3));
        if !self.values.contains(&var) {
            self.values.push(var.clone());
        }
        var
    }

    fn known_task(&mut self) -> String {
        self.tasks[self.dice.below(self.tasks.len())].clone()
    }

    fn over_tree(&mut self) -> String {
        let task = self.task();
        match self.dice.below(15) {
            10 => format!("action_task({task}, {}, {})", self.value(&TYPES), self.task()),
            11 => format!("fetch_task({task}, {})", self.task()),
            12 => format!("fetch_from_same_loc({task}, {})", self.task()),
            13 => format!("task_action_param({task}, {}, {})", self.dice.pick(&KEYS), self.value(&VALUES)),
            14 => format!("task_kind({task}, {})", self.value(&["action", "plan"])),
            0 => format!("task({task})"),
            1 => format!("task_name({task}, {})", self.value(&TYPES)),
            2 => format!("task_type({task}, {})", self.value(&TYPES)),
            3 | 4 => format!("task_param({task}, {}, {})", self.dice.pick(&KEYS), self.value(&VALUES)),
            5 => format!("subtask({task}, {})", self.task()),
            6 => format!("'subtask+'({task}, {})", self.task()),
            7 => format!("task_status({task}, {})", self.value(&STATUS)),
            8 => format!("before({task}, {})", self.task()),
            _ => format!("{}({task}, {})", self.dice.pick(&["at", "inside"]), self.value(&VALUES)),
        }
    }

    fn test(&mut self) -> String {
        let task = self.known_task();
        match self.dice.below(11) {
            6 => format!("not_transformed({task})"),
            7 => format!("one_arm_action({task})"),
            8 => format!("one_way({task})"),
            9 => {
                // A variable of its own: two negations with one would share it.
                self.fresh += 1;
                let below = format!("Below{}", self.fresh);
                format!("\\+ (subtask({task}, {below}), task_type({below}, {}))", self.dice.pick(&TYPES))
            }
            10 => format!("known({task}, {})", self.dice.pick(&VALUES)),
            0 => format!("{task} == {}", self.known_task()),
            1 => format!("{task} \\== {}", self.known_task()),
            2 => format!("\\+ task_param({task}, arms, {})", self.dice.pick(&VALUES)),
            3 => format!("\\+ subtask({task}, _)"),
            4 => format!("{} = {}", self.value(&VALUES), self.value(&VALUES)),
            _ => format!("\\+ task_status({task}, failed)"),
        }
    }
}

fn batch(seed: u64, programs: usize) -> Batch {
    let mut text = "at(T, V) :- task_type(T, _), task_param(T, location, V).\n\
        inside(T, V) :- 'subtask+'(A, T), task_param(A, object, V).\n\
        one_way(T) :- ( way(T, V) -> \\+ wide(V) ; \\+ ('subtask+'(T, B), way(B, V), wide(V)) ).\n\
        way(T, V) :- task_param(T, arms, V).\n\
        way(T, V) :- task_param(T, object, V).\n\
        wide(both).\n\
        wide([_, _|_]).\n\
        known(T, V) :- task_param(T, object, W), W = V.\n"
        .to_string();
    for number in 0..programs {
        let dice = Dice::new(seed * 1000 + number as u64);
        let mut it = Goals { dice, tasks: Vec::new(), values: Vec::new(), fresh: 0 };
        let mut goals = vec![it.over_tree()];
        for _ in 0..1 + it.dice.below(7) {
            let goal = if it.dice.chance(65) { it.over_tree() } else { it.test() };
            goals.push(goal);
        }
        let given = it.dice.pick(&["task(T0)", "task_param(_, object, V0)", "task_param(T1, location, V1)"]);
        let vars = [it.tasks, it.values].concat().join(", ");
        let goals = goals.join(", ");
        text += &format!("t{number}w([{vars}]) :- {goals}.\nt{number}u([{vars}]) :- true, !, {goals}.\n");
        // The same where something has a value already.
        text += &format!(
            "t{number}b([{vars}]) :- {given}, call(t{number}w, [{vars}]).\n\
             t{number}c([{vars}]) :- {given}, call(t{number}u, [{vars}]).\n"
        );
    }
    Batch { text, programs, tabled: false }
}

#[test]
fn planned_clauses_answer_as_written() {
    with_large_stack(|| {
        let (mut planned, mut joined, mut answers, mut edited) = (0, 0, 0, 0);
        for seed in super::more(0..5) {
            let programs = 300;
            let batch = batch(seed, programs);
            let session = load(&batch);
            for number in 0..programs {
                let tree = tree(&mut Dice::new(seed * 77 + number as u64));
                for task in 0..tree.len() as u32 {
                    assert_eq!(tree.at(&tree.path(task)), Some(task), "the path of each is its own");
                    edited += usize::from(tree.attr(task, Attr::Status) == Some(Value::symbol("planned")));
                }
                let found = |name: &str| over(&session, &format!("t{number}{name}"), &tree);
                let (ours, as_written) = (found("w"), found("u"));
                let line = |name: &str| {
                    let start = format!("t{number}{name}");
                    batch.text.lines().find(|line| line.starts_with(&start)).unwrap_or("").to_string()
                };
                answers += ours.answers.len();
                compare(ours, as_written, &format!("seed {seed}: {}", line("w")));
                compare(found("b"), found("c"), &format!("seed {seed}: {} {}", line("b"), line("w")));
                joined += usize::from(is_joined(&session, &format!("t{number}w")));
                planned += usize::from(is_planned(&session, &format!("t{number}w")));
            }
        }
        println!("{planned} clauses were planned, {joined} of them with joins; {answers} answers");
        assert!(planned > 300 && joined > 300 && answers > 1000 && edited > 300);
    });
}

/// As it is written a clause may not come to its end within the limit.
#[track_caller]
fn compare(ours: super::Found, as_written: super::Found, what: &str) {
    if ours.end == End::Limit || as_written.end == End::Limit {
        let known = ours.answers.iter().zip(&as_written.answers);
        return known.into_iter().for_each(|(ours, theirs)| assert_eq!(ours, theirs, "{what}"));
    }
    assert_eq!(ours, as_written, "{what}");
}

fn over(session: &Session, name: &str, tree: &Rc<TreeView>) -> super::Found {
    let predicate = session.machine.program.rules.find(Symbol::from(name), 1).expect("it is there");
    ask_over(session, predicate, &View { scoped: Vec::new(), tree: tree.clone() })
}

fn is_planned(session: &Session, name: &str) -> bool {
    let rules = &session.machine.program.rules;
    let predicate = rules.find(Symbol::from(name), 1).expect("it is there");
    rules.predicates[predicate.at()].planned.iter().any(Option::is_some)
}

fn is_joined(session: &Session, name: &str) -> bool {
    let rules = &session.machine.program.rules;
    let predicate = rules.find(Symbol::from(name), 1).expect("it is there");
    let calls_join = |clause: &vm::rules::clause::Clause| {
        clause.body.calls(&|callee| rules.predicates[callee.at()].declared.name == "%join")
    };
    rules.predicates[predicate.at()].planned.iter().flatten().any(calls_join)
}
