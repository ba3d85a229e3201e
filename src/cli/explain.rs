//! `pleach explain`: a page for each error code and each type of failures.

use clap::Args;
use compiler::module::nearest;

use super::{Answer, Trouble, term};

pub const HELP: &str = "\
Examples:
  pleach explain resolve::unknown_name
  pleach explain type-error
  pleach explain                          all codes, one line each";

/// `pleach explain`
#[derive(Args)]
pub struct Explain {
    /// An error code, as in `parse::unclosed`, or a type of failures, as in `type-error`
    code: Option<String>,
}

/// Codes and their pages.
fn pages() -> impl Iterator<Item = &'static (&'static str, &'static str)> {
    grammar::pages::PAGES.iter().chain(compiler::pages::PAGES).chain(vm::pages::PAGES)
}

/// Shows a page, or all codes.
pub fn run(it: &Explain) -> Answer {
    match &it.code {
        Some(code) => term::say(&page(code)?),
        None => term::say(&list()),
    }
    Ok(0)
}

/// The page of a code.
pub fn page(code: &str) -> Result<String, Trouble> {
    if let Some((_, page)) = pages().find(|(known, _)| *known == code) {
        return Ok(page.to_string());
    }
    // The part after `::` is enough where it says which.
    let by_end: Vec<_> = pages().filter(|(known, _)| known.rsplit("::").next() == Some(code)).collect();
    if let [(_, page)] = by_end.as_slice() {
        return Ok(page.to_string());
    }
    let ends = pages().filter_map(|(known, _)| known.rsplit("::").next());
    let help = match nearest(code, pages().map(|(known, _)| *known).chain(ends)) {
        Some(near) => format!("did you mean `{near}`? `pleach explain` lists all codes"),
        None => "`pleach explain` lists all codes".into(),
    };
    Err(Trouble::new(format!("there is no error code `{}`", vm::show::safe(code)), help))
}

/// All codes with the titles of their pages.
fn list() -> String {
    let width = pages().map(|(code, _)| code.len()).max().unwrap_or(0);
    let line = |(code, page): &(&str, &str)| {
        let first = page.lines().next().unwrap_or_default().trim_start_matches("# ");
        let title = first.strip_prefix(code).map_or(first, |rest| rest.trim_start_matches([':', ' ']));
        format!("{code:width$}  {title}\n")
    };
    pages().map(line).collect()
}
