//! A page for each error code: what it says, why, a wrong and a right example.
//!
//! The pages are files in `errors/`, so that people find them without the program. The wrong example
//! stands in a block marked `pleach,fails` and raises the code; the right one, in a block marked
//! `pleach`, runs. Examples need the library, which stands above this crate, so the tests of the
//! whole run them; the tests here hold that each code has its page.

/// Codes and their pages, in Markdown.
pub const PAGES: &[(&str, &str)] = &[
    ("resolve::unknown_name", include_str!("../errors/resolve-unknown_name.md")),
    ("resolve::unknown_failure", include_str!("../errors/resolve-unknown_failure.md")),
    ("resolve::duplicate", include_str!("../errors/resolve-duplicate.md")),
    ("resolve::wrong_kind", include_str!("../errors/resolve-wrong_kind.md")),
    ("resolve::ambiguous", include_str!("../errors/resolve-ambiguous.md")),
    ("resolve::reserved", include_str!("../errors/resolve-reserved.md")),
    ("resolve::set_constant", include_str!("../errors/resolve-set_constant.md")),
    ("resolve::set_captured", include_str!("../errors/resolve-set_captured.md")),
    ("form::shape", include_str!("../errors/form-shape.md")),
    ("form::arity", include_str!("../errors/form-arity.md")),
    ("form::unknown_keyword", include_str!("../errors/form-unknown_keyword.md")),
    ("form::not_callable", include_str!("../errors/form-not_callable.md")),
    ("form::outside", include_str!("../errors/form-outside.md")),
    ("form::not_at_top", include_str!("../errors/form-not_at_top.md")),
    ("form::unknown_step", include_str!("../errors/form-unknown_step.md")),
    ("form::order_cycle", include_str!("../errors/form-order_cycle.md")),
    ("form::bound_twice", include_str!("../errors/form-bound_twice.md")),
    ("form::parameters", include_str!("../errors/form-parameters.md")),
    ("desc::kind", include_str!("../errors/desc-kind.md")),
    ("desc::property", include_str!("../errors/desc-property.md")),
    ("desc::duplicate", include_str!("../errors/desc-duplicate.md")),
    ("desc::misplaced", include_str!("../errors/desc-misplaced.md")),
    ("rule::unknown_predicate", include_str!("../errors/rule-unknown_predicate.md")),
    ("rule::arity", include_str!("../errors/rule-arity.md")),
    ("rule::goal", include_str!("../errors/rule-goal.md")),
    ("rule::term", include_str!("../errors/rule-term.md")),
    ("rule::plan_form", include_str!("../errors/rule-plan_form.md")),
    ("rule::impure", include_str!("../errors/rule-impure.md")),
    ("rule::singleton", include_str!("../errors/rule-singleton.md")),
    ("rule::unreachable", include_str!("../errors/rule-unreachable.md")),
    ("rule::floundering", include_str!("../errors/rule-floundering.md")),
    ("rule::table_cut", include_str!("../errors/rule-table_cut.md")),
    ("rule::cut", include_str!("../errors/rule-cut.md")),
    ("rule::not_open", include_str!("../errors/rule-not_open.md")),
    ("rule::unbound", include_str!("../errors/rule-unbound.md")),
    ("expand::failed", include_str!("../errors/expand-failed.md")),
    ("expand::too_deep", include_str!("../errors/expand-too_deep.md")),
    ("expand::too_often", include_str!("../errors/expand-too_often.md")),
    ("expand::not_a_form", include_str!("../errors/expand-not_a_form.md")),
    ("expand::not_yet", include_str!("../errors/expand-not_yet.md")),
    ("module::missing", include_str!("../errors/module-missing.md")),
    ("module::cycle", include_str!("../errors/module-cycle.md")),
    ("module::native", include_str!("../errors/module-native.md")),
    ("limit::registers", include_str!("../errors/limit-registers.md")),
    ("limit::clause", include_str!("../errors/limit-clause.md")),
    ("limit::nesting", include_str!("../errors/limit-nesting.md")),
];

/// The page of `code`, which is written as in `form::shape`.
#[must_use]
pub fn page(code: &str) -> Option<&'static str> {
    PAGES.iter().find(|(known, _)| *known == code).map(|(_, page)| *page)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What stands between `code(` and the bracket that closes it.
    fn codes(source: &str) -> Vec<&str> {
        source.split("code(").skip(1).filter_map(|rest| rest.split(')').next()).collect()
    }

    #[test]
    fn each_code_has_its_page() {
        let known: Vec<&str> = PAGES.iter().map(|(code, _)| *code).collect();
        assert_eq!(codes(include_str!("error.rs")), known);
        for (code, page) in PAGES {
            assert!(page.starts_with(&format!("# {code}: ")), "{code}");
        }
        assert!(page("form::shape").is_some() && page("form::nothing").is_none());
    }

    #[test]
    fn each_page_shows_wrong_and_right() {
        for (code, page) in PAGES {
            assert!(page.contains("\nWrong:\n\n```"), "{code}");
            assert!(page.contains("\n```pleach\n"), "{code}");
        }
    }
}
