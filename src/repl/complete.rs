//! Completion of names and commands.

use std::collections::BTreeSet;

use compiler::module::predicate_key;
use pleach::Session;

use super::commands;

/// All names that can be typed.
#[derive(Default)]
pub struct Names {
    /// In forms.
    all: Vec<String>,
    /// In goals, after a bracket.
    goals: Vec<String>,
}

impl Names {
    /// The names that a session sees.
    pub fn of(session: &Session) -> Names {
        let visible = session.front.modules.visible(session.module);
        // A predicate is typed without its number of arguments.
        let predicates = visible.iter().filter_map(|name| Some(predicate_key(*name)?.0.to_string()));
        let goal_forms = compiler::goal_forms().iter().map(|(name, _)| (*name).to_string());
        let goals: BTreeSet<String> = predicates.chain(goal_forms).collect();
        let others =
            visible.iter().filter(|name| predicate_key(**name).is_none()).map(|name| name.to_string());
        let forms = compiler::special_forms().iter().map(|(name, _)| (*name).to_string());
        let failures = session.machine.program.failures.iter().map(|it| it.name.to_string());
        let all: BTreeSet<String> =
            others.chain(forms).chain(failures).chain(goals.iter().cloned()).collect();
        Names { all: all.into_iter().collect(), goals: goals.into_iter().collect() }
    }
}

/// Where the word at `pos` begins, and what it could become.
pub fn candidates(names: &Names, line: &str, pos: usize) -> (usize, Vec<String>) {
    let before = &line[..pos];
    let start =
        before.rfind(|c: char| c.is_whitespace() || "()[]{}\"'`,;".contains(c)).map_or(0, |at| at + 1);
    let word = &before[start..];
    if start == 0 && word.starts_with(':') {
        let commands = commands::COMMANDS.iter().map(|(name, ..)| (*name).to_string());
        return (start, commands.filter(|name| name.starts_with(word)).collect());
    }
    let is_goal = before.trim_start().starts_with(super::query::MARK) && before[..start].ends_with('(');
    // After the bracket of a goal all goals can be seen: there are fewer of them.
    let (names, enough) = if is_goal { (&names.goals, true) } else { (&names.all, !word.is_empty()) };
    (start, names.iter().filter(|name| name.starts_with(word) && enough).cloned().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(line: &str, expected: &[&str]) {
        let list = |names: &[&str]| names.iter().map(|name| (*name).to_string()).collect();
        let names = Names { all: list(&["dolist", "dotimes", "greet", "on"]), goals: list(&["not", "on"]) };
        assert_eq!(candidates(&names, line, line.len()).1, expected);
    }

    #[test]
    fn a_bracket_in_a_goal_is_followed_by_a_goal() {
        check("?- (", &["not", "on"]);
        check("?- (on ?x) (no", &["not"]);
        check("?- (on do", &["dolist", "dotimes"]);
        check("?- (do", &[]);
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
