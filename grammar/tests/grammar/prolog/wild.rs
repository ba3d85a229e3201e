//! Text that is large, deep, or no Prolog at all.

use proptest::prelude::*;

use super::*;
use crate::random::check_order;

/// Runs `work` with no more stack than the forms themselves are allowed to need.
fn with_little_stack(work: fn()) {
    let thread = std::thread::Builder::new().stack_size(1 << 20).spawn(work).expect("a thread starts");
    thread.join().expect("1 MiB of stack is enough");
}

#[test]
fn a_million_of_anything_is_one_error() {
    with_little_stack(|| {
        for (before, part) in [
            ("p :- ", "("),
            ("p([", "["),
            ("p(", "f("),
            ("p(", "- "),
            ("p :- ", "\\+ "),
            ("p :- X is ", "1+"),
            ("p(", "a:"),
            ("p :- ", "a->"),
            ("p :- ", "(a,b;c->"),
            ("p(", "[a|"),
            ("p(", "X^"),
            ("p(", "a->"),
            ("p(", "a,b->[c,d->"),
        ] {
            let source = format!("{before}{} .\nz.\n", part.repeat(1_000_000));
            assert_eq!(heads(&source), (vec!["(z)".into()], 1), "{part}");
        }
    });
}

#[test]
fn what_is_long_is_not_deep() {
    with_little_stack(|| {
        for (before, part, after) in [
            ("p :- ", "b, ", "b"),
            ("p :- ", "b; ", "b"),
            ("p([", "b, ", "b])"),
            ("p(", "b, ", "b)"),
            ("p([", "a->b, ", "b])"),
        ] {
            let parsed = prolog::parse(FileId(0), "it", &format!("{before}{}{after}.", part.repeat(100_000)));
            assert_eq!(parsed.errors, []);
            check_read_back(&parsed.forms);
        }
    });
}

#[test]
fn the_deepest_terms_give_forms_that_are_not_too_deep() {
    with_little_stack(|| {
        let nested = |open: &str, inner: &str, close: &str, times: usize| {
            let source = format!("p :- {}{inner}{}.", open.repeat(times), close.repeat(times));
            prolog::parse(FileId(0), "it", &source)
        };
        for (open, inner, close) in [
            ("f(", "a", ")"),
            ("(", "1", "=\\= 1)"),
            ("(", "1", "\\= 1)"),
            ("(", "1", "@=< 1)"),
            ("\\+ (", "a", ")"),
            ("\\+ ", "a", ""),
            ("a ; b -> c ; d, e, (", "f", ")"),
            ("(a ; b, c -> d ; ", "e", ")"),
            ("a -> b ; ", "c", ""),
            ("q([a,", "b", "])"),
            ("X is (1 >> ", "2", ")"),
            ("bagof(X, Y^", "a", ", L)"),
            ("ignore((a, ", "b", "))"),
            ("memberchk(a, ", "b", ")"),
            ("f((a, ", "b", "))"),
            ("f(a -> b ; ", "b", ", c)"),
            ("f(a, b -> c -> ", "b", ")"),
        ] {
            let fits = (1..=400).rev().map(|times| nested(open, inner, close, times));
            let deepest = fits.into_iter().find(|parsed| parsed.errors.is_empty());
            check_read_back(&deepest.unwrap_or_else(|| panic!("{open} is never taken")).forms);
        }
        // A pair for each comma comes on top of that.
        let pairs = format!("f(({}", "a, ".repeat(70));
        let parsed = nested(&pairs, "b", "))", 2);
        assert_eq!(parsed.errors, []);
        check_read_back(&parsed.forms);
        assert_eq!(nested(&pairs, "b", "))", 3).errors.len(), 1);
    });
}

const SOUP: &[&str] = &[
    "p",
    "q(",
    "(",
    ")",
    "[",
    "]",
    "|",
    "{",
    "}",
    ",",
    ".",
    ".\n",
    ".\n",
    " ",
    ":-",
    " :- ",
    "-->",
    "?-",
    ";",
    "->",
    "\\+",
    "-",
    "- ",
    "+",
    "=",
    " is ",
    "==",
    "@<",
    "*",
    "**",
    "^",
    ":",
    "X",
    "_",
    "Y_z",
    "a_b",
    "'a_b'",
    "1",
    "1.5",
    "0'a",
    "0x",
    "\"s\"",
    "'",
    "\"",
    "`",
    "%",
    "/*",
    "*/",
    "\\",
    "not(",
    "findall(",
    "bagof(X,",
    "table ",
    ":- table p/1.\n",
    ":- dynamic ",
    "p/2",
    "!",
    "...",
    "ö",
    "“",
    "\u{0}",
    "\u{202e}",
    "nil",
    "[]",
    "call(",
    "log(2,",
    "round(",
];

/// Errors are within the text and in order, and what was read are forms.
fn check_wild(text: &str) -> Result<(), TestCaseError> {
    let parsed = prolog::parse(FileId(0), "it", text);
    check_order(text, &parsed.errors)?;
    check_read_back(&parsed.forms);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 400 } else { 20_000 }))]

    #[test]
    fn any_text_never_panics(text in any::<String>()) {
        check_wild(&text)?;
    }

    #[test]
    fn bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = prolog::parse_bytes(FileId(0), "it", &bytes);
        check_wild(&String::from_utf8_lossy(&bytes))?;
    }

    #[test]
    fn tokens_in_any_order_never_panic(tokens in prop::collection::vec(prop::sample::select(SOUP), 0..60)) {
        check_wild(&tokens.concat())?;
    }
}
