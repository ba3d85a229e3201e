//! The log of a run: all that came from outside, and when.
//!
//! Program, seed and log give the same tree, so nothing else has to be saved to resume a run or
//! to look at any moment of it again. Events enter between rounds only; an entry names the round,
//! the step and the clock at which it entered, and is whole.

use serde_json::{Value as Json, json};

use crate::host::Request;

/// What came from outside at one point of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// The round after which it entered.
    pub round: u64,
    /// Units of fuel used by then.
    pub step: u64,
    /// Nanoseconds of the task clock.
    pub clock: u64,
    /// What the program asked for, in words.
    pub request: String,
    /// The answer, or why there is none.
    pub answer: Result<Json, String>,
}

/// All that came from outside.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Log {
    /// In the order of entering.
    pub entries: Vec<Entry>,
    /// How many of them have been used again.
    pub(crate) replayed: usize,
}

impl Log {
    /// The next entry to be used again, if it is one for this request.
    ///
    /// # Errors
    /// A sentence that says how the run differs from the one that was logged.
    pub(crate) fn replay(&mut self, round: u64, request: &str) -> Result<Option<Entry>, String> {
        let Some(entry) = self.entries.get(self.replayed) else { return Ok(None) };
        if entry.round != round || entry.request != request {
            return Err(format!(
                "the run differs from its log: in round {round} it asks for {request}, the log has {} in round {}",
                entry.request, entry.round
            ));
        }
        self.replayed += 1;
        Ok(Some(entry.clone()))
    }

    pub(crate) fn add(&mut self, entry: Entry) {
        self.entries.push(entry);
        self.replayed = self.entries.len();
    }

    /// The same log, to be used from the start.
    #[must_use]
    pub fn rewound(mut self) -> Log {
        self.replayed = 0;
        self
    }
}

impl Entry {
    /// As one line of a log file.
    #[must_use]
    pub fn to_json(&self) -> Json {
        let (key, answer) = match &self.answer {
            Ok(answer) => ("answer", answer.clone()),
            Err(why) => ("refused", json!(why)),
        };
        json!({"round": self.round, "step": self.step, "clock": self.clock, "request": self.request, key: answer})
    }

    /// From a line of a log file.
    #[must_use]
    pub fn from_json(line: &Json) -> Option<Entry> {
        let number = |key: &str| line.get(key)?.as_u64();
        let answer = match (line.get("answer"), line.get("refused")) {
            (Some(answer), None) => Ok(answer.clone()),
            (None, Some(why)) => Err(why.as_str()?.into()),
            _ => return None,
        };
        let request = line.get("request")?.as_str()?.into();
        Some(Entry {
            round: number("round")?,
            step: number("step")?,
            clock: number("clock")?,
            request,
            answer,
        })
    }
}

impl Request {
    /// In words, for the log: two requests are the same if their words are.
    #[must_use]
    pub fn describe(&self) -> String {
        match self {
            Request::ReadFile(path) => format!("read {path}"),
            Request::WriteFile { path, text } => {
                format!("write {path} {:016x}", crate::random::hash_text(text))
            }
            Request::Clock => "clock".into(),
        }
    }
}
