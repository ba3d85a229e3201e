//! A page for each built-in type of failures: what it says, why, a wrong and a right example.
//!
//! The pages are files in `errors/`, so that people find them without the program. The wrong example
//! stands in a block marked `pleach,fails` and raises the failure; the right one, in a block marked
//! `pleach`, runs. Examples need the compiler and the library, which stand beside and above this
//! crate, so the tests of the whole run them; the tests here hold that each type has its page.

/// Codes, which are `failure::` and the name of the type, and their pages, in Markdown.
pub const PAGES: &[(&str, &str)] = &[
    ("failure::failure", include_str!("../errors/failure-failure.md")),
    ("failure::plan-failure", include_str!("../errors/failure-plan-failure.md")),
    ("failure::program-error", include_str!("../errors/failure-program-error.md")),
    ("failure::resource-failure", include_str!("../errors/failure-resource-failure.md")),
    ("failure::type-error", include_str!("../errors/failure-type-error.md")),
    ("failure::arity-error", include_str!("../errors/failure-arity-error.md")),
    ("failure::arithmetic-error", include_str!("../errors/failure-arithmetic-error.md")),
    ("failure::range-error", include_str!("../errors/failure-range-error.md")),
    ("failure::parse-error", include_str!("../errors/failure-parse-error.md")),
    ("failure::edit-refused", include_str!("../errors/failure-edit-refused.md")),
    ("failure::action-not-grounded", include_str!("../errors/failure-action-not-grounded.md")),
    ("failure::goal-not-reached", include_str!("../errors/failure-goal-not-reached.md")),
    ("failure::unbound-variable", include_str!("../errors/failure-unbound-variable.md")),
    ("failure::floundering", include_str!("../errors/failure-floundering.md")),
    ("failure::file-failure", include_str!("../errors/failure-file-failure.md")),
    ("failure::not-allowed", include_str!("../errors/failure-not-allowed.md")),
    ("failure::fuel-exhausted", include_str!("../errors/failure-fuel-exhausted.md")),
    ("failure::too-deep", include_str!("../errors/failure-too-deep.md")),
    ("failure::memory-exhausted", include_str!("../errors/failure-memory-exhausted.md")),
    ("failure::tree-too-large", include_str!("../errors/failure-tree-too-large.md")),
    ("failure::output-too-large", include_str!("../errors/failure-output-too-large.md")),
    ("failure::composite-failure", include_str!("../errors/failure-composite-failure.md")),
    ("failure::timeout", include_str!("../errors/failure-timeout.md")),
    ("failure::policy-violated", include_str!("../errors/failure-policy-violated.md")),
    ("failure::deadlock", include_str!("../errors/failure-deadlock.md")),
    ("failure::clean-up-timeout", include_str!("../errors/failure-clean-up-timeout.md")),
    ("failure::expectation-failed", include_str!("../errors/failure-expectation-failed.md")),
];

/// The page of `code`, which is written as in `failure::type-error`.
#[must_use]
pub fn page(code: &str) -> Option<&'static str> {
    PAGES.iter().find(|(known, _)| *known == code).map(|(_, page)| *page)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Builtin;

    #[test]
    fn each_type_has_its_page() {
        let types: Vec<String> = Builtin::ALL.iter().map(|it| format!("failure::{}", it.name())).collect();
        let known: Vec<&str> = PAGES.iter().map(|(code, _)| *code).collect();
        assert_eq!(types, known);
        for (code, page) in PAGES {
            assert!(page.starts_with(&format!("# {code}: ")), "{code}");
        }
        assert!(page("failure::type-error").is_some() && page("failure::nothing").is_none());
    }

    #[test]
    fn each_page_shows_wrong_and_right() {
        for (code, page) in PAGES {
            assert!(page.contains("\nWrong:\n\n```"), "{code}");
            assert!(page.contains("\nRight:\n\n```pleach\n"), "{code}");
        }
    }
}
