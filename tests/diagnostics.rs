//! Mistakes: one a file in `diagnostics/`, and beside each what is said about it, as it is shown.
//!
//! A folder holds the files of one program, `main.plan` first. What only a generated text can do
//! wrong is made here.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use compiler::Report;
use grammar::FileId;
use pleach::{Ended, Options, Session};

use crate::expected::{check_file, report};

/// The programs, each with a mistake.
fn programs() -> Vec<PathBuf> {
    let entries = std::fs::read_dir("tests/diagnostics").expect("the programs are there");
    let mut programs: Vec<PathBuf> = entries
        .map(|entry| entry.expect("a folder can be listed").path())
        .filter_map(|path| match path.is_dir() {
            true => Some(path.join("main.plan")),
            false => path.extension().is_some_and(|end| end == "plan").then_some(path),
        })
        .collect();
    programs.sort();
    programs
}

/// What is wrong with a program, and as it is shown.
fn load(path: &Path) -> (Vec<Report>, String) {
    let mut session = Session::new(Options::default());
    let loaded = session.load_file(path).unwrap_or_else(|why| panic!("{why}"));
    let mut reports = loaded.reports.clone();
    if reports.is_empty()
        && let Ended::Errors(later) = session.run(loaded, None, &mut String::new())
    {
        reports = later;
    }
    let text = reports.iter().map(|report| session.report(report)).collect();
    (reports, text)
}

fn code(report: &Report) -> String {
    report.diagnostic().code().expect("each error has a code").to_string()
}

#[test]
fn mistakes_are_shown_with_their_places() {
    let mut problems = Vec::new();
    for path in programs() {
        let (reports, text) = load(&path);
        if reports.is_empty() {
            problems.push(format!("{} has no mistake", path.display()));
        }
        problems.extend(check_file(&path.with_extension("expected"), &text).err());
    }
    report(&problems);
}

/// The codes in a source file, from its attributes.
fn codes_in(source: &str) -> BTreeSet<String> {
    let text = std::fs::read_to_string(source).expect("the source is there");
    let codes = text.match_indices("code(").filter_map(|(at, _)| text[at + 5..].split(')').next());
    codes.filter(|code| code.contains("::")).map(|code| code.trim().into()).collect()
}

/// Codes that need a text too large, or bytes that are no text, or a bug of ours.
const GENERATED: [&str; 8] = [
    "parse::too_deep",
    "parse::too_large",
    "parse::too_many",
    "parse::utf8",
    "parse::internal",
    "limit::registers",
    "limit::clause",
    "limit::nesting",
];

#[test]
fn each_code_has_a_program() {
    let mut missing = codes_in("compiler/src/error.rs");
    missing.extend(codes_in("grammar/src/error.rs"));
    assert!(missing.len() > 30, "{missing:?}");
    for generated in GENERATED {
        assert!(missing.remove(generated), "{generated}");
    }
    // What only the library can do wrong: programs have no natives of their own.
    for path in programs() {
        for report in load(&path).0 {
            missing.remove(&code(&report));
        }
    }
    assert_eq!(missing.into_iter().collect::<Vec<_>>(), [""; 0]);
}

#[test]
fn each_expectation_has_a_program() {
    for path in crate::program::files_below(Path::new("tests/diagnostics"), ".expected") {
        assert!(path.with_extension("plan").exists(), "{}", path.display());
    }
}

// ---------------------------------------------------------------------------------------------
// Generated texts

/// The codes that a text raises, in order.
fn codes(text: &str) -> Vec<String> {
    let mut session = Session::new(Options::default());
    let loaded = session.load_text("generated.plan", text);
    // Each can be shown; a hundred are enough.
    for report in loaded.reports.iter().take(100) {
        assert!(!session.report(report).is_empty());
    }
    loaded.reports.iter().map(code).collect()
}

#[test]
fn a_million_brackets_are_one_error() {
    for open in ["(", "[", "{", "'", "`(", "(a "] {
        let text = open.repeat(1_000_000);
        let codes = codes(&text);
        assert!(codes.len() <= 101 && codes.contains(&"parse::too_deep".into()), "{open}: {codes:?}");
    }
    let closed = codes(&")".repeat(1_000_000));
    assert_eq!(closed, ["parse::stray_close"]);
}

#[test]
fn forms_as_deep_as_allowed_compile_and_one_deeper_do_not() {
    let most = grammar::parse::MAX_DEPTH;
    for open in ["(seq ", "(if true ", "(when 1 ", "(and 1 ", "'("] {
        let nested = |n: usize| format!("{}1{}", open.repeat(n), ")".repeat(n));
        let prefixes = usize::from(open.starts_with('\'')) + 1;
        assert_eq!(codes(&nested((most - 1) / prefixes)), [""; 0], "{open}");
        assert!(codes(&nested(most + 1)).contains(&"parse::too_deep".to_string()), "{open}");
    }
}

#[test]
fn calls_in_arguments_nest_as_deep_as_there_are_registers() {
    let nested = |n: usize| format!("{}1{}", "(list ".repeat(n), ")".repeat(n));
    assert_eq!(codes(&nested(200)), [""; 0]);
    assert_eq!(codes(&nested(300)), ["limit::registers"]);
}

#[test]
fn expansions_may_not_nest_deeper_than_texts() {
    let text = "
        (def-macro deep (n) (if (= n 0) 1 `(list (deep ,(- n 1)))))
        (deep 150)
        (def-macro deeper (n) (let ((form 1)) (dotimes (i n) (set! form (list 'not form))) form))
        (deeper 200)
        (deeper 2000)";
    assert_eq!(codes(text), ["expand::too_deep"]);
}

#[test]
fn a_function_has_room_for_so_many_variables() {
    let names = |n: usize| (0..n).map(|i| format!("(v{i} (first '({i})))")).collect::<String>();
    let text = |n: usize| format!("(def-fun f () (let* ({}) (+ v0 v{})))", names(n), n - 1);
    assert_eq!(codes(&text(200)), [""; 0]);
    assert_eq!(codes(&text(300)).first().map(String::as_str), Some("limit::registers"));
}

#[test]
fn a_clause_has_room_for_so_many_variables() {
    let names = |n: usize| (0..n).map(|i| format!("?v{i} ?v{i} ")).collect::<String>();
    let text = |n: usize| format!("(def-rules r (<- (p ({}))))", names(n));
    assert_eq!(codes(&text(60)), [""; 0]);
    assert_eq!(codes(&text(400)), ["limit::clause"]);
    let many = (0..20_000).map(|i| format!("(p ?v{i} ?v{i})")).collect::<String>();
    assert_eq!(codes(&format!("(def-rules r (<- (p ?x ?x) {many}))")), ["limit::clause"]);
}

#[test]
fn rules_nest_as_deep_as_texts_and_may_be_long() {
    let most = grammar::parse::MAX_DEPTH;
    let deep = |open: &str, n: usize| {
        format!("(def-open q 1) (def-rules r (<- (p ?x) {}(q ?x){}))", open.repeat(n), ")".repeat(n))
    };
    assert_eq!(codes(&deep("(and ", most - 10)), [""; 0]);
    assert!(codes(&deep("(not ", most + 10)).contains(&"parse::too_deep".to_string()));
    let row = |head: &str, part: &str, n: usize| {
        format!("(def-open q 1) (def-rules r (<- (p ?x) ({head} {})))", part.repeat(n))
    };
    assert_eq!(codes(&row("and", "(q ?x) ", 20_000)), [""; 0]);
    assert_eq!(codes(&row("or", "(q ?x) ", 5_000)), [""; 0]);
    assert_eq!(codes(&row("q (f", "?x ", 5_000).replace(")))", "))))")), ["rule::term"]);
    assert_eq!(codes(&row("is ?x (+", "1 ", 5_000).replace(")))", "))))")), ["rule::term"]);
    let facts = (0..20_000).map(|i| format!("(edge n{i} {i})")).collect::<String>();
    assert_eq!(codes(&format!("(def-facts f {facts})")), [""; 0]);
}

#[test]
fn bytes_that_are_no_text_are_refused_with_their_place() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("latin-1.plan");
    std::fs::write(&path, b"(print 1)\n(print \"gr\xf6\xdfe\")").expect("files can be written");
    let why = Session::new(Options::default()).load_file(&path).expect_err("it is no text");
    assert!(why.ends_with("it is no UTF-8 text; the first wrong byte is number 20, in line 2"), "{why}");
    let parsed = grammar::parse_bytes(FileId(0), b"(print \"gr\xf6\xdfe\")");
    assert_eq!(
        Report::Parse(parsed.errors[0].clone()).diagnostic().code().map(|it| it.to_string()),
        Some("parse::utf8".into())
    );
}

#[test]
fn texts_over_the_limit_are_refused() {
    let text = " ".repeat(grammar::parse::MAX_BYTES + 1);
    assert_eq!(codes(&text), ["parse::too_large"]);
}

#[test]
fn many_errors_are_counted_after_the_first_hundred() {
    let codes = codes(&"1x ".repeat(5_000));
    assert_eq!(codes.len(), 101);
    assert_eq!(codes.last().map(String::as_str), Some("parse::too_many"));
}

#[test]
fn of_ten_thousand_mistakes_of_meaning_a_hundred_are_told() {
    let text = "(def-fun f () (no-such-name))\n".repeat(10_000);
    let codes = codes(&text);
    assert_eq!(codes.len(), 102);
    assert_eq!(codes.last().map(String::as_str), Some("parse::too_many"));
}

#[test]
fn a_folder_or_a_missing_file_is_no_program() {
    let mut session = Session::new(Options::default());
    let folder = session.load_file(Path::new("tests")).expect_err("a folder is no text");
    assert_eq!(folder, "cannot read tests: it is a folder");
    let missing = session.load_file(Path::new("no-such.plan")).expect_err("there is none");
    assert!(missing.starts_with("cannot read no-such.plan: "), "{missing}");
}
