//! What holds of every run, whatever the program: of its tree, and of what it printed.

use std::collections::BTreeMap;
use std::rc::Rc;

use vm::tree::{RecId, SlotId, Status, Tree, Why};
use vm::value::{Obj, Value};

/// What is wrong with a tree: a word for the invariant, and where it does not hold.
pub fn of_tree(tree: &Tree) -> Option<(&'static str, String)> {
    let mut attempts: BTreeMap<SlotId, u32> = BTreeMap::new();
    for rec in tree.records() {
        let record = tree.record(rec);
        let wrong = |what| Some((what, show(tree, rec)));
        if !record.status.is_final() {
            return wrong("a record is not final");
        }
        if record.end < record.start {
            return wrong("a record ends before it starts");
        }
        let attempt = attempts.entry(record.slot).or_insert(0);
        *attempt += 1;
        if record.attempt != *attempt {
            return wrong("attempts are not 1 to n");
        }
        if record.parent == RecId(0) {
            continue;
        }
        let parent = tree.record(record.parent);
        if record.parent >= rec {
            return wrong("a parent has a greater number");
        }
        if record.start < parent.start {
            return wrong("a record starts before its parent");
        }
        if !ends_within(tree, rec) {
            return wrong("a record outlives its parent");
        }
    }
    None
}

/// A child ends before its parent, one that was put off before the task that performs it.
fn ends_within(tree: &Tree, rec: RecId) -> bool {
    let record = tree.record(rec);
    if (record.status, record.why) == (Status::Evaporated, Why::Superseded) {
        return true;
    }
    match tree.extra(rec).and_then(|extra| extra.performed_in) {
        None => record.end <= tree.record(record.parent).end,
        Some(slot) => tree
            .records()
            .map(|other| tree.record(other))
            .any(|other| other.slot == slot && other.start <= record.start && record.end <= other.end),
    }
}

fn show(tree: &Tree, rec: RecId) -> String {
    let line = |rec: RecId| {
        let record = tree.record(rec);
        let path = vm::path::Path::of(tree, record.slot);
        let (status, why) = (record.status.word(), record.why.word());
        format!("{} #{} {status} {why} {}–{}", path.show(), record.attempt, record.start, record.end)
    };
    format!("{}, in {}", line(rec), line(tree.record(rec).parent.max(RecId(1))))
}

/// What is wrong with the clean-ups that the lines tell of: each runs once for each time its body was
/// entered, and to its end if it cannot fail.
pub fn of_clean_ups(printed: &str) -> Option<(&'static str, String)> {
    let mut counts: BTreeMap<&str, [i64; 4]> = BTreeMap::new();
    for line in printed.lines() {
        if let Some((word, number)) = line.split_once(' ')
            && let Some(at) = ["enter", "clean", "begin", "done"].iter().position(|known| *known == word)
        {
            counts.entry(number).or_default()[at] += 1;
        }
    }
    for (number, [entered, cleaned, begun, done]) in counts {
        let what =
            format!("number {number}: entered {entered}, cleaned {cleaned}, begun {begun}, done {done}");
        if entered != cleaned {
            return Some(("a clean-up did not run once", what));
        }
        if begun != done {
            return Some(("a clean-up did not run to its end", what));
        }
    }
    None
}

/// The trees in a value.
pub fn trees_in(value: &Value) -> Vec<Rc<Tree>> {
    match value.obj() {
        Some(Obj::Tree(tree)) => vec![tree.clone()],
        _ => value.to_vec().unwrap_or_default().iter().flat_map(trees_in).collect(),
    }
}
