//! Prolog text to rules, and what is said about mistakes and about what is not taken.

use expect_test::{Expect, expect};
use grammar::{FileId, Form, parse, prolog};

use crate::reading::{lines, render};

mod meaning;
mod mistakes;
mod wild;

/// The rules that `source` is read as, laid out.
#[track_caller]
fn check(source: &str, expected: Expect) {
    let parsed = prolog::parse(FileId(0), "it", source);
    assert_eq!(parsed.errors, [], "in\n{source}");
    check_read_back(&parsed.forms);
    expected.assert_eq(&grammar::format(&lines(&parsed.forms)).expect("it reads back"));
}

/// The clauses of `source` that have one goal, or are facts, a line each: `head` or the goal.
#[track_caller]
fn check_goals(source: &str, expected: Expect) {
    let parsed = prolog::parse(FileId(0), "it", source);
    assert_eq!(parsed.errors, [], "in\n{source}");
    check_read_back(&parsed.forms);
    let clauses = parsed.forms.iter().flat_map(|form| form.list().unwrap_or_default().iter().skip(2));
    let goals: Vec<String> = clauses.filter_map(|clause| Some(clause.list()?.last()?.to_string())).collect();
    expected.assert_eq(&lines(&goals));
}

/// What is said about `source`.
#[track_caller]
fn check_errors(source: &str, expected: Expect) {
    let parsed = prolog::parse(FileId(0), "it", source);
    let errors: String = parsed.errors.iter().map(|error| render(source, error)).collect();
    expected.assert_eq(&errors);
}

/// The heads of the clauses that were read, and how many errors there were.
fn heads(source: &str) -> (Vec<String>, usize) {
    let parsed = prolog::parse(FileId(0), "it", source);
    let clauses = parsed.forms.iter().flat_map(|form| form.list().unwrap_or_default().iter().skip(2));
    (clauses.filter_map(|clause| Some(clause.list()?.get(1)?.to_string())).collect(), parsed.errors.len())
}

/// What is made of Prolog text could have been read from our own.
fn check_read_back(forms: &[Form]) {
    let printed = lines(forms);
    let again = parse(FileId(0), &printed);
    assert_eq!((lines(&again.forms), again.errors), (printed, Vec::new()));
}
