//! A clause whose goals the planner has put in another order gives the same answers in the same order.
//!
//! Random goals over random trees; next to each clause stands the same one behind a cut, which keeps it
//! as it is written.

use std::rc::Rc;

use vm::rules::View;
use vm::rules::view::{Task, TreeView};
use vm::value::{Symbol, Value};

use super::generate::Batch;
use super::{Session, ask_over, load};
use crate::dice::Dice;
use crate::oracle::with_large_stack;

const KEYS: [&str; 3] = ["location", "object", "arms"];
const VALUES: [&str; 4] = ["left", "right", "a", "b"];
const TYPES: [&str; 3] = ["fetching", "placing", "going"];
const STATUS: [&str; 2] = ["succeeded", "failed"];

fn tree(dice: &mut Dice) -> Rc<TreeView> {
    let mut tasks = vec![task(0, "top-level", "top-level")];
    // The way from the root to the newest task.
    let mut way = vec![0];
    for number in 1..2 + dice.below(20) as u32 {
        way.truncate(1 + dice.below(way.len()));
        let kind = dice.pick(&TYPES);
        let mut params = Vec::new();
        for key in KEYS {
            if dice.chance(60) {
                params.push((Symbol::from(key), Value::symbol(dice.pick(&VALUES))));
            }
        }
        if dice.chance(80) {
            params.push((Symbol::from("type"), Value::symbol(kind)));
        }
        let mut it = task(way[way.len() - 1], kind, if dice.chance(50) { "action" } else { "plan" });
        it.status = if dice.chance(70) { "succeeded" } else { "failed" };
        it.params = params;
        tasks.push(it);
        way.push(number);
    }
    Rc::new(TreeView::new(tasks))
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
        match self.dice.below(10) {
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
        match self.dice.below(6) {
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
        inside(T, V) :- 'subtask+'(A, T), task_param(A, object, V).\n"
        .to_string();
    for number in 0..programs {
        let dice = Dice::new(seed * 1000 + number as u64);
        let mut it = Goals { dice, tasks: Vec::new(), values: Vec::new() };
        let mut goals = vec![it.over_tree()];
        for _ in 0..1 + it.dice.below(5) {
            let goal = if it.dice.chance(65) { it.over_tree() } else { it.test() };
            goals.push(goal);
        }
        let vars = [it.tasks, it.values].concat().join(", ");
        let goals = goals.join(", ");
        text += &format!("t{number}w([{vars}]) :- {goals}.\nt{number}u([{vars}]) :- true, !, {goals}.\n");
    }
    Batch { text, programs, tabled: false }
}

#[test]
fn planned_clauses_answer_as_written() {
    with_large_stack(|| {
        let (mut planned, mut answers) = (0, 0);
        for seed in 0..5 {
            let programs = 300;
            let batch = batch(seed, programs);
            let session = load(&batch);
            for number in 0..programs {
                let tree = tree(&mut Dice::new(seed * 77 + number as u64));
                let found = |name: &str| over(&session, &format!("t{number}{name}"), &tree);
                let (ours, as_written) = (found("w"), found("u"));
                let line =
                    batch.text.lines().find(|line| line.starts_with(&format!("t{number}w"))).unwrap_or("");
                assert_eq!(ours, as_written, "seed {seed}: {line}");
                answers += ours.answers.len();
                planned += usize::from(is_planned(&session, &format!("t{number}w")));
            }
        }
        println!("{planned} clauses were planned, {answers} answers");
        assert!(planned > 300 && answers > 1000);
    });
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
