//! A plan called with the edits of a tree does what `run-plan` with the tree does, whether the edits come from the tree
//! or from the text that says them.
//!
//! In each program of `run/edits`, and in random ones, one call of `run-plan` with a tree after the other is made in
//! two other ways: the plan is called with the edits of the tree below another plan, and as the variant whose text is
//! added to the program. What is printed and the tree below must be the same.

use std::path::Path;

use pleach::{Options, Session};

use crate::expected::difference;
use crate::oracle::random::random_program;
use crate::oracle::with_large_stack;
use crate::program::files_below;

/// How many random programs are looked at.
const PROGRAMS: u64 = 240;
/// How many runs of one program.
const RUNS: usize = 40;

/// What stands in the place of `run-plan`: the run with this number is made in the way that is looked at, and printed.
const HELP: &str = "
(def-const %runs (fluent 0))
(def-plan %around (tree plan args) (apply call-with-edits tree plan args))
(def-fun look-at (plan &key args tree seed)
  (let ((n (value %runs)))
    (cond ((not tree) (run-plan plan :args args :seed seed))
          (true
           (set-value %runs (+ n 1))
           (when (= n %looked-at) (print \"@@run\"))
           (let ((run (if (= n %looked-at) (%run plan args tree seed) (run-plan plan :args args :tree tree :seed seed))))
             (when (= n %looked-at)
               (print \"@@tree\")
               (write-string (tree-text run))
               (print \"@@text\")
               (write-string (variant-text tree 'the-variant))
               (print \"@@end\"))
             run)))))
";

const PLAIN: &str = "(def-fun %run (plan args tree seed) (run-plan plan :args args :tree tree :seed seed))";
const GRAFTED: &str =
    "(def-fun %run (plan args tree seed) (run-plan %around :args (list tree plan args) :seed seed))";
const VARIANT: &str = "(def-fun %run (plan args tree seed) (run-plan the-variant :args args :seed seed))";

/// What one run printed, and the lines of its tree; the text of the variant.
struct Looked {
    printed: String,
    tree: Vec<String>,
    text: String,
}

/// The run number `n` of a program, made as `how` says.
fn look(program: &str, n: usize, how: &str, more: &str) -> Option<Looked> {
    let program = program.replace("(run-plan ", "(look-at ");
    let text = format!("{HELP}\n(def-const %looked-at {n})\n{how}\n{program}\n{more}\n");
    let mut session = Session::new(Options::default());
    let ran = session.run_text("looked-at", &text);
    assert!(!ran.diagnostics.contains('×'), "{}\n{text}", ran.diagnostics);
    let part = |from: &str, to: &str| {
        let start = ran.printed.find(from)? + from.len();
        Some(ran.printed[start..start + ran.printed[start..].find(to)?].to_string())
    };
    let tree = part("@@tree\n", "@@text\n")?;
    Some(Looked {
        printed: part("@@run\n", "@@tree\n")?,
        tree: tree.lines().map(str::to_string).collect(),
        text: part("@@text\n", "@@end\n")?,
    })
}

/// The tree below the root, or below the plan that stands around what is looked at.
fn below(tree: &[String], levels: usize) -> Vec<String> {
    let deeper = |line: &String| line.chars().skip(3 * (levels - 1)).collect::<String>();
    let names = |line: String| {
        line.replace("top-level / %around", "top-level").replace("top-level / the-variant", "top-level")
    };
    tree.iter().skip(levels).map(deeper).map(names).collect()
}

/// Looks at all runs of a program. Answers how many there were.
fn check(name: &str, program: &str) -> usize {
    for n in 0..RUNS {
        let Some(plain) = look(program, n, PLAIN, "") else { return n };
        let wanted = below(&plain.tree, 1);
        for (how, more) in [(GRAFTED, ""), (VARIANT, plain.text.as_str())] {
            let other = look(program, n, how, more);
            let other = other.unwrap_or_else(|| panic!("{name}, run {n}: nothing with {how}\n{more}"));
            let found = below(&other.tree, 2);
            let as_text = |printed: &str, tree: &[String]| format!("{printed}{}\n", tree.join("\n"));
            let (wanted, found) = (as_text(&plain.printed, &wanted), as_text(&other.printed, &found));
            assert!(
                wanted == found,
                "{name}, run {n}, {how}\n{}\n{}",
                plain.text,
                difference(&wanted, &found)
            );
        }
    }
    RUNS
}

#[test]
fn variants_do_what_run_plan_does() {
    with_large_stack(|| {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/run/edits");
        let mut runs = 0;
        for path in files_below(&root, "plan") {
            let text = std::fs::read_to_string(&path).expect("a file");
            runs += check(&path.display().to_string(), &text);
        }
        println!("{runs} runs");
        assert!(runs > 100, "only {runs} runs were looked at");
    });
}

#[test]
fn variants_of_random_plans_do_what_run_plan_does() {
    with_large_stack(|| {
        let mut runs = 0;
        for seed in (0..PROGRAMS).filter(|seed| seed % 3 > 0) {
            // What is drawn belongs to a place, and the places are others.
            let program =
                random_program(seed).replace("(random ", "(min 1 ").replace("(random-float)", "0.3");
            runs += check(&format!("seed {seed}\n{program}"), &program);
        }
        println!("{runs} runs");
        assert!(runs > 200, "only {runs} runs were looked at");
    });
}
