//! Completion of names and commands.

use std::collections::BTreeSet;

use compiler::module::predicate_key;
use pleach::Session;
use vm::value::Symbol;

use super::commands;

/// All names that can be typed.
pub fn names(session: &Session) -> Vec<String> {
    let visible = session.front.modules.visible(session.module).into_iter().map(|name| name.to_string());
    // A predicate is typed without its number of arguments.
    let bare = |name: String| predicate_key(Symbol::from(&name)).map_or(name, |(name, _)| name.to_string());
    let visible = visible.map(bare);
    let forms = compiler::special_forms().iter().chain(compiler::goal_forms());
    let forms = forms.map(|(name, _)| (*name).to_string());
    let failures = session.machine.program.failures.iter().map(|it| it.name.to_string());
    let all: BTreeSet<String> = visible.chain(forms).chain(failures).collect();
    all.into_iter().collect()
}

/// Where the word at `pos` begins, and what it could become.
pub fn candidates(names: &[String], line: &str, pos: usize) -> (usize, Vec<String>) {
    let before = &line[..pos];
    let start =
        before.rfind(|c: char| c.is_whitespace() || "()[]{}\"'`,;".contains(c)).map_or(0, |at| at + 1);
    let word = &before[start..];
    if start == 0 && word.starts_with(':') {
        let commands = commands::COMMANDS.iter().map(|(name, ..)| (*name).to_string());
        return (start, commands.filter(|name| name.starts_with(word)).collect());
    }
    (start, names.iter().filter(|name| name.starts_with(word) && !word.is_empty()).cloned().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(line: &str, expected: &[&str]) {
        let names: Vec<String> =
            ["dolist", "dotimes", "greet"].iter().map(|name| (*name).to_string()).collect();
        assert_eq!(candidates(&names, line, line.len()).1, expected);
    }

    #[test]
    fn words_end_at_brackets_and_quotes() {
        check("(do", &["dolist", "dotimes"]);
        check("(list 'gr", &["greet"]);
        check("(greet ", &[]);
        check("größe(gr", &["greet"]);
    }

    #[test]
    fn a_colon_at_the_start_begins_a_command() {
        check(":lo", &[":load"]);
        check("(f :lo", &[]);
    }
}
