//! Experiments: variants of a plan, each run under the same seeds, and what the runs have come to.
//!
//! What an experiment is, which edits a variant runs with, and what a run has come to is said in the language
//! (`stdlib/plans/experiment.plan`). Here it is done many times:
//!
//! - [`worker`]: a session that rehearses variants and does runs; one on each thread
//! - [`spread`]: jobs over threads
//! - [`work`]: does what is missing of an experiment
//! - [`folder`]: the runs of an experiment on disk, to be gone on with and merged; [`export`]: in more formats
//! - [`summary`]: the numbers that compare the variants
//! - [`text`], [`report`]: the summary for people; [`plot`] and [`page`] draw it
//!
//! A run is a function of program, case, variant and seed. Which thread or machine has done it cannot be seen in what it
//! gives, so a table is the same to the bit wherever it was made.

pub mod export;
pub mod folder;
pub mod page;
pub mod plot;
pub mod report;
pub mod spread;
pub mod summary;
pub mod text;
pub mod work;
pub mod worker;

use serde_json::{Value as Json, json};

/// An experiment, as its program says it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Experiment {
    /// Its name.
    pub name: String,
    /// What it is for.
    pub doc: String,
    /// The name of the plan.
    pub plan: String,
    /// Its arguments as forms, where it was named from outside.
    pub args: Vec<String>,
    /// The names of its factors.
    pub factors: Vec<String>,
    /// For each case the values of the factors, as `write` prints them.
    pub cases: Vec<Vec<String>>,
    /// The variants of the plan; the first is what the others are compared with.
    pub variants: Vec<Variant>,
    /// The names of the numbers that each run gives.
    pub measures: Vec<String>,
    /// How many runs of each variant in each case.
    pub runs: u64,
    /// The first seed.
    pub seed: u64,
    /// Which check decides on edits: `static`, `projected`, `paired`.
    pub accept: String,
    /// Under how many seeds variants are rehearsed.
    pub seeds: u64,
}

/// A variant of a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Variant {
    /// Its name.
    pub name: String,
    /// The transformations that take part; all if there is none.
    pub only: Vec<String>,
    /// Which check decides, where that is not the one of the experiment.
    pub accept: Option<String>,
    /// The plan, where that is another one.
    pub plan: Option<String>,
}

/// More runs of a variant in a case than this are a mistake: each takes some hundred bytes.
pub const MOST_RUNS: u64 = 1_000_000;

impl Experiment {
    /// Why it cannot be evaluated; nothing if it can.
    #[must_use]
    pub fn trouble(&self) -> Option<String> {
        let twice = |names: &[String]| {
            names
                .iter()
                .enumerate()
                .find(|(at, name)| names[..*at].contains(name))
                .map(|(_, name)| name.clone())
        };
        let variants: Vec<String> = self.variants.iter().map(|it| it.name.clone()).collect();
        let cases: Vec<String> = (0..self.cases.len()).map(|case| self.case_text(case)).collect();
        if let Some(name) = twice(&variants) {
            return Some(format!("it has the variant {name} twice"));
        }
        if let Some(case) = twice(&cases) {
            return Some(format!("it has the case {case} twice"));
        }
        if self.runs == 0 || self.runs > MOST_RUNS {
            return Some(format!("its runs are a number from 1 to {MOST_RUNS}, not {}", self.runs));
        }
        let last = self.seed.checked_add(self.runs).filter(|last| i64::try_from(*last).is_ok());
        last.is_none().then(|| format!("its seeds go up to {}", i64::MAX))
    }

    /// The values of a factor, if all of them are numbers.
    #[must_use]
    pub fn numbers(&self, factor: usize) -> Option<Vec<f64>> {
        let number = |case: &Vec<String>| case[factor].parse().ok().filter(|it: &f64| it.is_finite());
        self.cases.iter().map(number).collect()
    }

    /// A case in words: `way 4, arms 2`. Nothing where there are no factors.
    #[must_use]
    pub fn case_text(&self, case: usize) -> String {
        let values = self.cases.get(case).map_or(&[][..], Vec::as_slice);
        let pairs = self.factors.iter().zip(values).map(|(name, value)| format!("{name} {value}"));
        pairs.collect::<Vec<_>>().join(", ")
    }

    /// The place of a cell, a variant in a case, among all cells.
    #[must_use]
    pub fn cell(&self, case: usize, variant: usize) -> usize {
        case * self.variants.len() + variant
    }

    /// How many cells there are.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.cases.len() * self.variants.len()
    }

    /// As JSON, without the number of runs: what two evaluations must agree in to be one.
    #[must_use]
    pub fn to_json(&self) -> Json {
        let variants: Vec<Json> = self.variants.iter().map(Variant::to_json).collect();
        json!({
            "experiment": self.name,
            "about": self.doc,
            "plan": self.plan,
            "args": self.args,
            "factors": self.factors,
            "cases": self.cases,
            "variants": variants,
            "measures": self.measures,
            "seed": self.seed,
            "accept": self.accept,
            "seeds": self.seeds,
        })
    }

    /// From JSON, as the language or [`Experiment::to_json`] gives it.
    #[must_use]
    pub fn from_json(json: &Json, runs: u64) -> Option<Experiment> {
        let text = |key: &str| json[key].as_str().map(str::to_string);
        let variants: Vec<Variant> =
            list(&json["variants"])?.iter().map(Variant::from_json).collect::<Option<_>>()?;
        let cases: Vec<Vec<String>> = list(&json["cases"])?.iter().map(texts).collect::<Option<_>>()?;
        let it = Experiment {
            name: text("experiment")?,
            doc: text("about")?,
            plan: text("plan")?,
            args: texts(&json["args"])?,
            factors: texts(&json["factors"])?,
            cases,
            variants,
            measures: texts(&json["measures"])?,
            runs,
            seed: json["seed"].as_u64()?,
            accept: text("accept")?,
            seeds: json["seeds"].as_u64()?,
        };
        let fits = it.cases.iter().all(|case| case.len() == it.factors.len());
        Some(it).filter(|it| fits && !it.variants.is_empty() && !it.cases.is_empty())
    }
}

impl Variant {
    fn to_json(&self) -> Json {
        json!({"name": self.name, "only": self.only, "accept": self.accept, "plan": self.plan})
    }

    fn from_json(json: &Json) -> Option<Variant> {
        let text = |key: &str| json[key].as_str().map(str::to_string);
        Some(Variant {
            name: text("name")?,
            only: texts(&json["only"])?,
            accept: text("accept"),
            plan: text("plan"),
        })
    }
}

/// A name as that of a file or folder, which stays in its place.
#[must_use]
pub fn file_name(name: &str) -> String {
    let safe = |c: char| if c.is_alphanumeric() || "-_+.".contains(c) { c } else { '-' };
    match name.trim_start_matches('.') {
        "" => "-".into(),
        name => name.chars().map(safe).collect(),
    }
}

/// The elements of a list; the empty list of the language is nothing in JSON.
fn list(json: &Json) -> Option<&[Json]> {
    match json {
        Json::Null => Some(&[]),
        json => json.as_array().map(Vec::as_slice),
    }
}

fn texts(json: &Json) -> Option<Vec<String>> {
    list(json)?.iter().map(|it| it.as_str().map(str::to_string)).collect()
}

/// A run, and what it has come to.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Which case.
    pub case: usize,
    /// Which variant.
    pub variant: usize,
    /// Under which seed.
    pub seed: u64,
    /// How the plan ended: `succeeded`, `failed` …
    pub status: String,
    /// It has succeeded, and the goal holds.
    pub success: bool,
    /// Why not, else nothing.
    pub why: String,
    /// In the order of [`Experiment::measures`]; none where there is no such number.
    pub numbers: Vec<Option<f64>>,
}

/// The edits of a variant in a case, and how they were found.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Edits {
    /// The edits that were kept, as text.
    pub kept: Vec<String>,
    /// What was refused: transformation, check, and why.
    pub refused: Vec<[String; 3]>,
    /// The variant is rehearsed; otherwise it is a plan as it is written.
    pub rehearsed: bool,
    /// Why there is nothing to run.
    pub why: Option<String>,
}

impl Edits {
    /// True if runs of this variant would be those of the plan as it is written.
    #[must_use]
    pub fn is_void(&self) -> bool {
        self.rehearsed && self.kept.is_empty()
    }

    fn to_json(&self) -> Json {
        json!({"rehearsed": self.rehearsed, "kept": self.kept, "refused": self.refused, "why": self.why})
    }

    fn from_json(json: &Json) -> Option<Edits> {
        let refused = list(&json["refused"])?.iter().map(|it| texts(it)?.try_into().ok());
        Some(Edits {
            kept: texts(&json["kept"])?,
            refused: refused.collect::<Option<_>>()?,
            rehearsed: json["rehearsed"].as_bool()?,
            why: json["why"].as_str().map(str::to_string),
        })
    }
}

/// Why an evaluation did not come to its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stop {
    /// It was stopped from outside; what is done is kept.
    Asked,
    /// A sentence, and perhaps more lines of text.
    Because(String),
}

impl From<String> for Stop {
    fn from(why: String) -> Stop {
        Stop::Because(why)
    }
}
