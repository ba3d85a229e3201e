//! A tree that was written as JSON answers as the tree of the run does.

use std::path::Path;
use std::rc::Rc;

use expect_test::{Expect, expect};
use pleach::read::Reader;
use pleach::{Options, Session};
use vm::rules::view::TreeView;

use crate::expected::report;
use crate::program::{Program, files_below};

/// What is asked of each tree.
const GOALS: &[&str] = &[
    "(task-name ?task ?name)",
    "(task-kind ?task ?kind)",
    "(task-status ?task ?status)",
    "(task-param ?task ?key ?value)",
    "(task-param-written ?task ?key ?value)",
    "(task-value ?task ?value)",
    "(task-failure ?task ?failure)",
    "(task-grounded ?task ?call)",
    "(task-start ?task ?start)",
    "(task-end ?task ?end)",
    "(task-attempt ?task ?n ?attempt)",
    "(task-edit ?task ?edit)",
    "(subtask ?above ?task)",
    "(edited ?task)",
];

/// Larger trees are not compared.
const MOST_TASKS: usize = 5_000;

/// All answers of a goal over a tree. What has no text is shown as it is read back.
fn answers(session: &mut Session, reader: &Reader, goal: &str, tree: Option<Rc<TreeView>>) -> Vec<String> {
    session.machine.limits.fuel = u64::MAX;
    session.machine.limits.memory = usize::MAX;
    let mut question = session.ask("goal", goal, tree).expect("the goal has no errors");
    let mut rows = Vec::new();
    while let Ok(Some(answer)) = session.next_answer(&mut question) {
        let values = answer.values.iter().map(|(name, value)| {
            let text = session.write(&reader.value(&session.write(value)));
            // A mark in a mark is a text in a text.
            let text = if text.contains("#<") { text.replace(['\\', '"'], "") } else { text };
            format!("{name} {text}")
        });
        rows.push(values.collect::<Vec<_>>().join("  "));
    }
    rows
}

/// The first answer that differs.
fn difference(session: &mut Session, reader: &Reader) -> Option<String> {
    let json = vm::show::json(&session.machine.program, session.machine.tree()).to_string();
    let saved = match session.tree_of_json(&json) {
        Ok(saved) => saved,
        Err(why) => return Some(why),
    };
    GOALS.iter().find_map(|goal| {
        let one = answers(session, reader, goal, None);
        let other = answers(session, reader, goal, Some(saved.clone()));
        let at = (0..one.len().max(other.len())).find(|at| one.get(*at) != other.get(*at))?;
        Some(format!("{goal}\n  live  {:?}\n  saved {:?}", one.get(at), other.get(at)))
    })
}

/// Edits that have been added to a tree since it ran are part of what rules see.
#[test]
fn edits_that_wait_are_saved_with_the_tree() {
    let reader = Reader::default();
    // Those that move nothing are applied to the live tree where they stand.
    for (name, planned) in [("edited", 5), ("in-place", 0)] {
        let mut session = Program::read(Path::new("tests/run/rules/overlay.plan")).session();
        let mut output = String::new();
        let loaded = session.extend("input", name);
        let value = loaded.init.into_iter().map(|it| session.call(it, Vec::new(), &mut output)).last();
        let value = value.expect("there is an expression").expect("it has a value");
        let tree = value.as_tree().expect("it is a tree");
        let program = &session.machine.program;
        let json = vm::show::json(program, tree).to_string();
        let live = Rc::new(TreeView::of(program, tree));
        let saved = session.tree_of_json(&json).expect("it is a tree");
        for goal in GOALS.iter().chain(&["(before ?one ?other)", "(task-status ?task planned)"]) {
            let one = answers(&mut session, &reader, goal, Some(live.clone()));
            assert_eq!(one, answers(&mut session, &reader, goal, Some(saved.clone())), "{name}: {goal}");
        }
        let found = answers(&mut session, &reader, "(task-status ?task planned)", Some(saved));
        assert_eq!(found.len(), planned, "{name}");
    }
}

#[test]
fn saved_trees_answer_as_live_ones() {
    let reader = Reader::default();
    let mut problems = Vec::new();
    let mut count = 0;
    for path in files_below(Path::new("tests/run"), ".plan") {
        let mut session = Program::read(&path).session();
        if session.machine.tree().len() <= MOST_TASKS {
            count += 1;
            let why = difference(&mut session, &reader);
            problems.extend(why.map(|why| format!("{}: {why}", path.display())));
        }
    }
    assert!(count > 100, "only {count} trees");
    report(&problems);
}

#[track_caller]
fn check_error(json: &str, expected: Expect) {
    let session = Session::new(Options::default());
    let why = session.tree_of_json(json).err().unwrap_or_else(|| "no error".into());
    expected.assert_eq(&why);
}

#[test]
fn what_is_no_tree_is_named_with_its_place() {
    let root = r#"{"name":"top-level","kind":"top-level","status":"succeeded"}"#;
    let node =
        |more: &str| format!(r#"[{root},{{"name":"main","kind":"plan","status":"succeeded",{more}}}]"#);
    check_error("", expect!["it is no JSON: EOF while parsing a value at line 1 column 0"]);
    check_error("[[[", expect!["it is no JSON: EOF while parsing a list at line 1 column 3"]);
    check_error(
        &"[".repeat(1_000_000),
        expect!["it is no JSON: recursion limit exceeded at line 1 column 128"],
    );
    check_error("3", expect!["it is neither a list of tasks nor an object with one in `tree`"]);
    check_error("{}", expect!["there is no `tree` in it"]);
    check_error(r#"{"tree":{}}"#, expect!["`tree` is no list of tasks"]);
    check_error("[]", expect!["the list of tasks is empty: a tree has a root"]);
    check_error(r#"{"tree":[4]}"#, expect!["tree[0] is no object"]);
    check_error(r#"[{"kind":"plan"}]"#, expect!["[0].status is missing"]);
    check_error(r#"[{"kind":"flan"}]"#, expect!["[0].kind is none of top-level, plan, action, branch"]);
    check_error(&format!("[{root}]"), expect!["no error"]);
    check_error(&format!("[{root},{root}]"), expect!["[1].parent is missing: only the first task has none"]);
    check_error(&node(r#""parent":0"#), expect!["no error"]);
    check_error(
        &node(r#""parent":1"#),
        expect![[
            r#"[1].parent is neither the task before it nor one above that: each task comes after its parent and all that is below its earlier siblings"#
        ]],
    );
    check_error(&node(r#""parent":-1"#), expect!["[1].parent is no position in the list"]);
    check_error(&node(r#""parent":0,"start":"now""#), expect!["[1].start is no number"]);
    check_error(&node(r#""parent":0,"params":[1]"#), expect!["[1].params is no object"]);
    check_error(&node(r#""parent":0,"params":{"x":1}"#), expect!["[1].params has no text for `x`"]);
    check_error(&node(r#""parent":0,"edits":["(skip (path a))",5]"#), expect!["[1].edits[1] is no edit"]);
    check_error(
        &node(r#""parent":0,"attempts":[{"status":"failed"}]"#),
        expect!["[1].attempts[0].failure is missing"],
    );
    check_error(
        &node(r#""parent":0,"failure":{"type":"f","also":[{"type":7}]}"#),
        expect!["[1].failure.also[0].type is no text"],
    );
    check_error(&node(r#""parent":0,"value":"(((""#), expect!["no error"]);
}
