//! A page for each error code: what it says, why, a wrong and a right example.
//!
//! The pages are files in `errors/`, so that people find them without the program. The wrong example
//! stands in a block marked `pleach,fails` and raises the code; the right one, in a block marked
//! `pleach`, raises nothing. For Prolog text these are `prolog,fails` and `prolog`. The tests hold this.

/// Codes and their pages, in Markdown.
pub const PAGES: &[(&str, &str)] = &[
    ("parse::unclosed", include_str!("../errors/parse-unclosed.md")),
    ("parse::unclosed_string", include_str!("../errors/parse-unclosed_string.md")),
    ("parse::unclosed_symbol", include_str!("../errors/parse-unclosed_symbol.md")),
    ("parse::unclosed_comment", include_str!("../errors/parse-unclosed_comment.md")),
    ("parse::mismatched", include_str!("../errors/parse-mismatched.md")),
    ("parse::stray_close", include_str!("../errors/parse-stray_close.md")),
    ("parse::number", include_str!("../errors/parse-number.md")),
    ("parse::escape", include_str!("../errors/parse-escape.md")),
    ("parse::character", include_str!("../errors/parse-character.md")),
    ("parse::too_deep", include_str!("../errors/parse-too_deep.md")),
    ("parse::prefix", include_str!("../errors/parse-prefix.md")),
    ("parse::odd_map", include_str!("../errors/parse-odd_map.md")),
    ("parse::utf8", include_str!("../errors/parse-utf8.md")),
    ("parse::too_large", include_str!("../errors/parse-too_large.md")),
    ("parse::too_many", include_str!("../errors/parse-too_many.md")),
    ("parse::internal", include_str!("../errors/parse-internal.md")),
    ("prolog::unclosed", include_str!("../errors/prolog-unclosed.md")),
    ("prolog::unexpected", include_str!("../errors/prolog-unexpected.md")),
    ("prolog::no_end", include_str!("../errors/prolog-no_end.md")),
    ("prolog::not_callable", include_str!("../errors/prolog-not_callable.md")),
    ("prolog::not_taken", include_str!("../errors/prolog-not_taken.md")),
    ("prolog::two_names", include_str!("../errors/prolog-two_names.md")),
];

/// The page of `code`, which is written as in `parse::unclosed`.
#[must_use]
pub fn page(code: &str) -> Option<&'static str> {
    PAGES.iter().find(|(known, _)| *known == code).map(|(_, page)| *page)
}

#[cfg(test)]
mod tests {
    use miette::Diagnostic;

    use super::*;
    use crate::parse::{MAX_BYTES, parse_bytes};
    use crate::prolog;
    use crate::span::FileId;

    /// The language in which the examples on the page of `code` are written.
    fn language(code: &str) -> &'static str {
        if code.starts_with("prolog::") { "prolog" } else { "pleach" }
    }

    /// The text of the block that starts with a line "```" and `mark`.
    fn block<'p>(page: &'p str, mark: &str) -> Option<&'p str> {
        let (_, rest) = page.split_once(&format!("```{mark}\n"))?;
        Some(rest.split_once("```").expect("a block ends").0)
    }

    /// The wrong example on a page.
    fn wrong_block<'p>(code: &str, page: &'p str) -> Option<&'p str> {
        block(page, &format!("{},fails", language(code)))
    }

    /// The codes that `source` raises, in the language of `code`.
    fn codes(code: &str, source: &[u8]) -> Vec<String> {
        let parsed = match language(code) {
            "prolog" => prolog::parse_bytes(FileId(0), "it", source),
            _ => parse_bytes(FileId(0), source),
        };
        let errors = parsed.errors;
        errors.iter().map(|error| error.code().expect("each error has a code").to_string()).collect()
    }

    /// Wrong texts that do not fit on a page.
    fn made_up(code: &str) -> Option<Vec<u8>> {
        Some(match code {
            "parse::too_deep" => [b"(".repeat(1_001), b")".repeat(1_001)].concat(),
            "parse::utf8" => b"(print \"gr\xf6\xdfe\")".to_vec(),
            "parse::too_large" => vec![b' '; MAX_BYTES + 1],
            "parse::too_many" => b"1x ".repeat(250),
            _ => return None,
        })
    }

    #[test]
    fn each_code_has_its_page() {
        let raised: Vec<&str> = [include_str!("error.rs"), include_str!("prolog/error.rs")]
            .iter()
            .flat_map(|source| source.split("code(").skip(1))
            .filter_map(|rest| rest.split(')').next())
            .collect();
        let known: Vec<&str> = PAGES.iter().map(|(code, _)| *code).collect();
        assert_eq!(raised, known);
        for (code, page) in PAGES {
            assert!(page.starts_with(&format!("# {code}: ")), "{code}");
        }
        assert!(page("parse::unclosed").is_some() && page("parse::nothing").is_none());
    }

    #[test]
    fn wrong_examples_raise_their_code_and_right_ones_nothing() {
        for (code, page) in PAGES {
            let right = block(page, language(code)).expect("a page has a right example");
            assert_eq!(codes(code, right.as_bytes()), [""; 0], "{code}");
            let wrong =
                wrong_block(code, page).map(|text| text.as_bytes().to_vec()).or_else(|| made_up(code));
            match wrong {
                Some(wrong) => assert!(codes(code, &wrong).iter().any(|raised| raised == code), "{code}"),
                // A bug of ours: nobody knows how to raise it.
                None => assert_eq!(*code, "parse::internal"),
            }
        }
    }

    #[test]
    fn wrong_examples_make_one_mistake() {
        for (code, page) in PAGES {
            let Some(wrong) = wrong_block(code, page) else { continue };
            let raised = codes(code, wrong.as_bytes());
            assert!(raised.iter().all(|other| other == code), "{code}: {raised:?}");
        }
    }
}
