//! Plans with edits worked in: what is written, what is left and why; and that what is written does the same.

use std::fmt::Write as _;
use std::path::Path;

use pleach::{Ended, Options, Session};

use crate::expected::{check_file, report};

/// A program defines a plan `work` and a function `edits` of the edits; each is tried alone, then all together.
fn inlined(text: &str) -> String {
    let mut out = String::new();
    let count: usize = text.matches("; edit\n").count();
    for n in 0..=count {
        let mut session = Session::new(Options::default());
        let which = if n < count { format!("(list (nth {n} (edits)))") } else { "(edits)".into() };
        let more = format!(
            "{text}\n(def-const the-tree (edit-tree (run-plan work) {which}))\n(def-const ran (run-plan work :tree the-tree))"
        );
        let loaded = session.load_text("inlined", &more);
        let mut printed = String::new();
        let ended = session.load_only(loaded, &mut printed);
        assert!(matches!(ended, Ended::Ran(Ok(_))), "{ended:?}\n{printed}\n{more}");
        let tree = constant(&session, "the-tree");
        let made =
            session.inline(tree.as_tree().expect("a tree"), "work/inlined").expect("it can be written");
        let _ = writeln!(
            out,
            "{}\n{}",
            if n < count { format!("--- edit {}", n + 1) } else { "--- all".into() },
            made.text.trim_end()
        );
        for (edit, why) in &made.left {
            let _ = writeln!(out, "; left: {edit}\n;   {why}");
        }
        for remark in &made.remarks {
            let _ = writeln!(out, "; {remark}");
        }
        if made.left.is_empty() && !made.text.contains("/inlined/") {
            let both = format!(
                "{more}\n{}\n(write-string (tree-text ran))\n(print \"@@\")\n(write-string (tree-text (run-plan work/inlined)))",
                made.text
            );
            let ran = Session::new(Options::default()).run_text("both", &both);
            let (one, other) = ran.printed.split_once("@@\n").unwrap_or_default();
            let below = |tree: &str| tree.lines().skip(2).map(str::to_string).collect::<Vec<_>>().join("\n");
            // A call that is left out has no node, one that is moved has it elsewhere.
            let calls = |tree: &str| {
                let lines = tree.lines().skip(2).filter(|line| !line.contains("  skipped"));
                let name = |line: &str| line.trim_start_matches(['│', '├', '└', '─', ' ']).to_string();
                let mut calls: Vec<String> =
                    lines.map(|line| name(line.split("  (").next().unwrap_or(line))).collect();
                calls.sort();
                calls
            };
            let _ = match (below(one) == below(other), calls(one) == calls(other)) {
                (true, _) => writeln!(out, "; the same tree"),
                (_, true) => writeln!(out, "; the same calls"),
                _ => writeln!(out, "; other calls:\n{one}{other}{}", ran.diagnostics),
            };
        }
    }
    out
}

fn constant(session: &Session, name: &str) -> vm::Value {
    let found = session.front.modules.look_up(session.module, name.into());
    let compiler::module::Found::One(definition) = found else { panic!("{name} is not defined") };
    let compiler::module::Meaning::Const(id) = definition.meaning else { panic!("{name} is no constant") };
    session.machine.global(id).cloned().expect("it has been computed")
}

#[test]
fn edits_are_worked_into_the_text() {
    let path = Path::new("tests/inline/work.plan");
    let text = std::fs::read_to_string(path).expect("it is there");
    report(
        &check_file(&path.with_extension("expected"), &inlined(&text)).err().into_iter().collect::<Vec<_>>(),
    );
}
