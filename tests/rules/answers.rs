//! What a query found, and when two of them say the same.

/// How the search for answers ended.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum End {
    /// There are no more.
    #[default]
    No,
    /// A goal did something wrong.
    Error,
    /// It took too long, or there were too many.
    Limit,
    /// The machine has a bug.
    Panic,
}

/// The answers of a program, as texts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Found {
    pub answers: Vec<String>,
    pub end: End,
}

/// What two searches of one query say of each other.
#[derive(Debug, PartialEq)]
pub enum Verdict {
    Same,
    /// The same as far as both went.
    SameSoFar,
    Different,
}

impl Found {
    /// Compares in order, as far as both went.
    pub fn compare(&self, other: &Found) -> Verdict {
        if self.end == End::Panic {
            return Verdict::Different;
        }
        let n = self.answers.len().min(other.answers.len());
        if self.answers[..n] != other.answers[..n] {
            return Verdict::Different;
        }
        match (self.end, other.end) {
            (End::Limit, End::Limit) => Verdict::SameSoFar,
            (End::Limit, _) if self.answers.len() <= other.answers.len() => Verdict::SameSoFar,
            (_, End::Limit) if other.answers.len() <= self.answers.len() => Verdict::SameSoFar,
            (a, b) if a == b && self.answers.len() == other.answers.len() => Verdict::Same,
            _ => Verdict::Different,
        }
    }

    /// Compares sets of answers.
    pub fn compare_as_sets(mut self, mut other: Found) -> Verdict {
        if self.end != End::No || other.end != End::No {
            return if self.end == other.end { Verdict::SameSoFar } else { Verdict::Different };
        }
        for found in [&mut self, &mut other] {
            found.answers.sort();
            found.answers.dedup();
        }
        if self == other { Verdict::Same } else { Verdict::Different }
    }
}
