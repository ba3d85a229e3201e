//! The log of a run: all that came from outside, and when.
//!
//! Program, seed and log give the same tree, so nothing else has to be saved to resume a run or
//! to look at any moment of it again. Events enter between rounds only; all that enter at one such point
//! are one entry. It names the round, the step and the clock, and is whole: written at once, used at once.
//! A log that had some answers of a round and not the others would be that of a run that never was.

use serde_json::{Value as Json, json};

use crate::host::Request;

/// What came from outside between two rounds of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// The round after which it entered.
    pub round: u64,
    /// Units of fuel used by then.
    pub step: u64,
    /// Nanoseconds of the task clock.
    pub clock: u64,
    /// In the order in which they were asked for.
    pub events: Vec<Event>,
}

/// A thing that came from outside.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Who asked for it, and what.
    pub question: Question,
    /// The answer, or why there is none.
    pub answer: Result<Json, String>,
}

/// Something asked of the outside: questions of two runs are the same if all of this is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Question {
    /// The number of the slot that asks.
    pub slot: u32,
    /// Its attempt.
    pub attempt: u32,
    /// How many things this attempt has asked, with this one.
    pub number: u32,
    /// What is asked, in words.
    pub request: String,
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
    /// The next entry to be used again, if the run asks for what is in it.
    ///
    /// # Errors
    /// A sentence that says how the run differs from the one that was logged.
    pub(crate) fn replay<'q>(
        &mut self,
        round: u64,
        questions: impl Iterator<Item = &'q Question>,
    ) -> Result<Option<Entry>, String> {
        let Some(entry) = self.entries.get(self.replayed) else { return Ok(None) };
        let mut logged = entry.events.iter().map(|event| &event.question);
        let mut asked = questions.fuse();
        loop {
            let (now, then) = (asked.next(), logged.next());
            if now != then || entry.round != round {
                let words = |question: Option<&Question>| {
                    question.map_or_else(|| "nothing more".into(), Question::show)
                };
                return Err(format!(
                    "the run differs from its log: in round {round} it asks for {}, the log has {} in round {}",
                    words(now),
                    words(then),
                    entry.round
                ));
            }
            if now.is_none() {
                break;
            }
        }
        self.replayed += 1;
        Ok(Some(entry.clone()))
    }

    pub(crate) fn add(&mut self, entry: Entry) {
        self.entries.push(entry);
        self.replayed = self.entries.len();
    }

    /// True while there is something left to be used again.
    pub(crate) fn is_replaying(&self) -> bool {
        self.replayed < self.entries.len()
    }

    /// The same log, to be used from the start.
    #[must_use]
    pub fn rewound(mut self) -> Log {
        self.replayed = 0;
        self
    }

    /// Forgets what has not been used again: from now on the run goes another way.
    pub fn forget_rest(&mut self) {
        self.entries.truncate(self.replayed);
    }
}

impl Question {
    /// For messages.
    fn show(&self) -> String {
        let Question { slot, attempt, number, request } = self;
        format!("{request} (slot {slot}, attempt {attempt}, number {number})")
    }
}

impl Entry {
    /// As one line of a log file.
    #[must_use]
    pub fn to_json(&self) -> Json {
        let events: Vec<Json> = self.events.iter().map(Event::to_json).collect();
        json!({"round": self.round, "step": self.step, "clock": self.clock, "events": events})
    }

    /// From a line of a log file.
    #[must_use]
    pub fn from_json(line: &Json) -> Option<Entry> {
        let number = |key: &str| line.get(key)?.as_u64();
        let events = line.get("events")?.as_array()?.iter().map(Event::from_json);
        Some(Entry {
            round: number("round")?,
            step: number("step")?,
            clock: number("clock")?,
            events: events.collect::<Option<_>>()?,
        })
    }
}

impl Event {
    fn to_json(&self) -> Json {
        let Question { slot, attempt, number, request } = &self.question;
        let (key, answer) = match &self.answer {
            Ok(answer) => ("answer", answer.clone()),
            Err(why) => ("refused", json!(why)),
        };
        json!({"slot": slot, "attempt": attempt, "number": number, "request": request, key: answer})
    }

    fn from_json(event: &Json) -> Option<Event> {
        let number = |key: &str| u32::try_from(event.get(key)?.as_u64()?).ok();
        let answer = match (event.get("answer"), event.get("refused")) {
            (Some(answer), None) => Ok(answer.clone()),
            (None, Some(why)) => Err(why.as_str()?.into()),
            _ => return None,
        };
        let question = Question {
            slot: number("slot")?,
            attempt: number("attempt")?,
            number: number("number")?,
            request: event.get("request")?.as_str()?.into(),
        };
        Some(Event { question, answer })
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
            Request::LoadTree { store, tree, version: None } => format!("load {tree} from {store}"),
            Request::LoadTree { store, tree, version: Some(version) } => {
                format!("load {tree}@{version} from {store}")
            }
            Request::SaveTree { store, tree, rows } => {
                let hash = crate::random::hash_text(&rows.rows().to_string());
                format!("save {tree} to {store} {hash:016x}")
            }
            Request::Versions { store, tree } => format!("versions of {tree} in {store}"),
        }
    }
}
