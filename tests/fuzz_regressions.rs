//! Texts that once broke something: each is formatted, loaded and run with little fuel. Whatever
//! comes out, nothing may panic, and a formatted text reads as the same forms.

use std::path::Path;

use grammar::FileId;
use pleach::{Options, Session};

use crate::program::files_below;

#[test]
fn texts_that_broke_something_do_not_do_so_again() {
    for path in files_below(Path::new("tests/fuzz-regressions"), "") {
        println!("{}", path.display());
        let bytes = std::fs::read(&path).expect("it was listed");
        let _ = grammar::parse_bytes(FileId(0), &bytes);
        let _ = grammar::prolog::parse_bytes(FileId(0), "regression", &bytes);
        check(&String::from_utf8_lossy(&bytes));
    }
}

/// Formats a text and runs it.
fn check(text: &str) {
    if let Ok(formatted) = grammar::format(text) {
        let forms = |text: &str| grammar::parse(FileId(0), text).forms;
        assert_eq!(forms(&formatted), forms(text));
        assert_eq!(grammar::format(&formatted).as_ref(), Ok(&formatted));
    }
    let mut options = Options::default();
    options.limits.fuel = 100_000;
    options.limits.memory = 256 << 20;
    Session::new(options).run_text("regression.plan", text);
}
