//! Any bytes: read, formatted, read again. Nothing panics, forms and comments stay.

#![no_main]

use grammar::FileId;
use libfuzzer_sys::fuzz_target;

/// Forms as text: nan is not equal to itself, its text is.
fn lines(forms: &[grammar::Form]) -> String {
    forms.iter().map(|form| form.to_string()).collect::<Vec<_>>().join("\n")
}

fuzz_target!(|bytes: &[u8]| {
    let parsed = grammar::parse_bytes(FileId(0), bytes);
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    for form in &parsed.forms {
        let printed = form.to_string();
        if parsed.errors.is_empty() {
            let again = grammar::parse(FileId(0), &printed);
            assert_eq!(
                (lines(&again.forms), again.errors),
                (printed, Vec::new()),
                "a printed form reads back"
            );
        }
    }
    let _ = grammar::completeness(text);
    match grammar::format(text) {
        Err(errors) => assert_eq!(errors, parsed.errors),
        Ok(formatted) => {
            let again = grammar::parse(FileId(0), &formatted);
            assert_eq!(
                (lines(&again.forms), again.errors),
                (lines(&parsed.forms), Vec::new()),
                "the same forms"
            );
            assert_eq!(again.comments.len(), parsed.comments.len(), "the same comments");
            assert_eq!(grammar::format(&formatted), Ok(formatted), "formatted twice is formatted once");
        }
    }
});
