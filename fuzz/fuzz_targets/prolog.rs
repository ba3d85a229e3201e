//! Any bytes as Prolog text. Nothing panics, errors are in the text, and what is made of it are forms
//! that our own text could have.

#![no_main]

use grammar::{FileId, prolog};
use libfuzzer_sys::fuzz_target;

/// Forms as text: nan is not equal to itself, its text is.
fn lines(forms: &[grammar::Form]) -> String {
    forms.iter().map(|form| form.to_string() + "\n").collect()
}

fuzz_target!(|bytes: &[u8]| {
    let parsed = prolog::parse_bytes(FileId(0), "it", bytes);
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    for error in &parsed.errors {
        let span = error.span();
        assert!(text.get(span.start as usize..span.end as usize).is_some(), "{error:?}");
    }
    let printed = lines(&parsed.forms);
    let again = grammar::parse(FileId(0), &printed);
    assert_eq!((lines(&again.forms), again.errors), (printed, Vec::new()), "a printed form reads back");
});
