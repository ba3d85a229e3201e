//! Queries at the prompt: `?- goal`, then `;` for the next answer.

use pleach::Question;

use super::Prompt;
use super::debug::Typed;
use crate::cli::query;

/// How an input begins that is a goal.
pub const MARK: &str = "?-";

/// How far the answers of the last query have been shown.
#[derive(Default)]
pub enum Asked {
    /// The last input was no goal.
    #[default]
    Nothing,
    /// There may be more.
    More(Box<Question>),
    /// There are no more.
    All,
}

impl Prompt {
    /// `?- goal`: shows the first answer. The goal sees the tasks of the session, and those of a run that
    /// is stopped.
    pub fn ask(&mut self, text: &str) {
        self.script.push(Typed::Goal(text.to_string()));
        self.asked = Asked::Nothing;
        self.inputs += 1;
        // Places in the goal are those in the line.
        let goal = text.replacen(MARK, "  ", 1);
        match self.session.ask(&format!("input {}", self.inputs), &goal, None) {
            Ok(question) => self.answer(Box::new(question), true),
            Err(reports) => reports.iter().for_each(|it| self.screen.say(&self.session.report(it))),
        }
    }

    /// `:why goal` and `:why-not goal`: says what is so, whichever was asked.
    pub fn why(&mut self, goal: &str) {
        self.script.push(Typed::Why(goal.to_string()));
        self.inputs += 1;
        let mut question = match self.session.ask(&format!("input {}", self.inputs), goal, None) {
            Ok(question) => question,
            Err(reports) => {
                return reports.iter().for_each(|it| self.screen.say(&self.session.report(it)));
            }
        };
        self.fill_up();
        match self.session.explain(&mut question) {
            Ok(explained) => self.screen.say(&query::explanation_text(&self.session, &explained)),
            Err(failure) => self.failed(&failure),
        }
    }

    /// `;`: shows the next answer.
    pub fn more(&mut self) {
        match std::mem::take(&mut self.asked) {
            Asked::Nothing => self.screen.say("error: no query is open\n  help: ask one: ?- (goal ?x)\n"),
            Asked::More(question) => {
                self.script.push(Typed::More);
                self.answer(question, false);
            }
            Asked::All => {
                self.screen.say("no more answers\n");
                self.asked = Asked::All;
            }
        }
    }

    fn answer(&mut self, mut question: Box<Question>, is_first: bool) {
        self.fill_up();
        self.asked = Asked::All;
        match self.session.next_answer(&mut question) {
            Ok(None) => self.screen.say(if is_first { "false.\n" } else { "no more answers\n" }),
            Ok(Some(answer)) => {
                self.screen.say(&query::answer_text(&self.session, &answer, true));
                if !answer.is_last {
                    self.asked = Asked::More(question);
                    self.screen.say(if is_first { "; for the next answer\n" } else { "" });
                }
            }
            Err(failure) => self.failed(&failure),
        }
    }
}
