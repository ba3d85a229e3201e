//! The numbers that compare the variants of an experiment.
//!
//! Each number is given twice: over all runs, and over those that succeeded. Runs that fail early are short and cheap; who
//! leaves them out measures what a plan costs when all goes well, who counts them in measures what happens. Variants are
//! compared with the first one by pairs of runs under the same seed, and once more as if the seeds were others.

use std::collections::BTreeMap;

use serde_json::{Map as JsonMap, Value as Json, json};
use stdlib::statistics::{
    self, Difference, Interval, Summary, TTest, effect, fisher, holm, mcnemar, newcombe_paired, paired_t,
    welch_t, wilcoxon, wilson,
};

use super::folder::{Head, Runs};
use super::{Edits, Experiment, Run};

/// What an experiment has come to.
#[derive(Debug, Clone)]
pub struct Table {
    /// What was evaluated.
    pub experiment: Experiment,
    /// In their order.
    pub cases: Vec<Case>,
    /// How many runs are wanted, and how many there are.
    pub wanted: usize,
    /// How many there are.
    pub done: usize,
}

/// The variants in one case.
#[derive(Debug, Clone)]
pub struct Case {
    /// The values of the factors in words.
    pub text: String,
    /// In their order; the first is what the others are compared with.
    pub variants: Vec<Column>,
}

/// A variant in one case.
#[derive(Debug, Clone)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// Its edits.
    pub edits: Edits,
    /// The variant that it runs alike, and whose runs are not done again.
    pub alike: Option<String>,
    /// How many runs there are.
    pub runs: u64,
    /// How many of these succeeded.
    pub succeeded: u64,
    /// Around the rate of success (Wilson).
    pub rate: Option<Interval>,
    /// Why runs failed, with how many; the most frequent first.
    pub whys: Vec<(String, u64)>,
    /// Its success, compared.
    pub against: Option<Success>,
    /// In the order of the experiment's.
    pub measures: Vec<Measure>,
}

/// Successes of a variant and those of the first, under the same seeds.
#[derive(Debug, Clone, Copy)]
pub struct Success {
    /// How many seeds both have run under.
    pub pairs: u64,
    /// Under how many only the first succeeded.
    pub lost: u64,
    /// Under how many only this one succeeded.
    pub won: u64,
    /// The exact test of McNemar.
    pub mcnemar: Option<f64>,
    /// The exact test of Fisher, as if the seeds were others.
    pub fisher: Option<f64>,
    /// Of the rates, with Newcombe's interval for pairs.
    pub difference: Option<Difference>,
}

/// A number of the runs of a variant.
#[derive(Debug, Clone)]
pub struct Measure {
    /// Its name.
    pub name: String,
    /// Over all runs.
    pub all: Scope,
    /// Over those that succeeded; compared where both runs of a pair did.
    pub succeeded: Scope,
}

/// A number over some of the runs.
#[derive(Debug, Clone, Default)]
pub struct Scope {
    /// What the values say together.
    pub summary: Option<Summary>,
    /// An interval around the median.
    pub median: Option<Interval>,
    /// Compared with the first variant.
    pub against: Option<Comparison>,
    /// The values themselves, for pictures, in the order of seeds.
    pub values: Vec<f64>,
    /// For each of them whether its run failed.
    pub failed: Vec<bool>,
}

/// A variant compared with the first: what is above 0 is more than that has.
#[derive(Debug, Clone)]
pub struct Comparison {
    /// How many pairs of runs.
    pub pairs: usize,
    /// Student's test of the pairs.
    pub paired: TTest,
    /// The p of it, corrected for all those of the experiment (Holm).
    pub corrected: Option<f64>,
    /// Wilcoxon's test of the pairs, which asks for no distribution.
    pub wilcoxon: Option<f64>,
    /// Welch's test, as if the seeds were others.
    pub welch: Option<TTest>,
    /// In per cent of the mean of the first, with its interval.
    pub percent: Option<(f64, Interval)>,
    /// Cohen's d, Hedges' g, d_z of the pairs, and Cliff's delta.
    pub effects: [Option<f64>; 4],
}

/// The names of [`Comparison::effects`].
const EFFECTS: [&str; 4] = ["d", "g", "dz", "delta"];

impl Table {
    /// Computes it.
    #[must_use]
    pub fn of(head: &Head, runs: &Runs) -> Table {
        let it = &head.experiment;
        let mut groups: Vec<BTreeMap<u64, &Run>> = vec![BTreeMap::new(); it.cells()];
        for run in runs.values() {
            groups[it.cell(run.case, run.variant)].insert(run.seed, run);
        }
        let nothing = Edits::default();
        let cases = (0..it.cases.len()).map(|case| {
            let first = &groups[it.cell(case, 0)];
            let column = |variant: usize| {
                let cell = it.cell(case, variant);
                let first = (variant > 0).then_some(first);
                let edits = head.edits[cell].as_ref().unwrap_or(&nothing);
                let alike = head.stands_for(case, variant).map(|other| it.variants[other].name.clone());
                let column = Column::of(it, &it.variants[variant].name, edits, &groups[cell], first);
                Column { alike, ..column }
            };
            Case { text: it.case_text(case), variants: (0..it.variants.len()).map(column).collect() }
        });
        let mut table = Table {
            experiment: it.clone(),
            cases: cases.collect(),
            wanted: head.wanted().len(),
            done: runs.len(),
        };
        table.correct();
        table
    }

    /// True of a number that is 0 in all runs: a plan without a robot drives no metres.
    #[must_use]
    pub fn is_void(&self, at: usize) -> bool {
        let columns = self.cases.iter().flat_map(|case| &case.variants);
        columns.flat_map(|it| &it.measures[at].all.values).all(|it| *it == 0.0)
    }

    /// Corrects the p of all paired tests of numbers over all runs, for the more is tested the more is found. What is 0 in
    /// all runs is no test.
    fn correct(&mut self) {
        let void: Vec<bool> = (0..self.experiment.measures.len()).map(|at| self.is_void(at)).collect();
        let columns = self.cases.iter_mut().flat_map(|case| &mut case.variants);
        let mut all: Vec<&mut Comparison> = columns
            .flat_map(|column| column.measures.iter_mut().zip(&void))
            .filter_map(|(measure, void)| measure.all.against.as_mut().filter(|_| !void))
            .collect();
        let ps: Vec<f64> = all.iter().map(|it| it.paired.p).collect();
        for (comparison, p) in all.iter_mut().zip(holm(&ps).unwrap_or_default()) {
            comparison.corrected = Some(p);
        }
    }

    /// As JSON.
    #[must_use]
    pub fn to_json(&self) -> Json {
        let it = &self.experiment;
        let case = |(case, values): (&Case, &Vec<String>)| {
            let factors: JsonMap<String, Json> =
                it.factors.iter().zip(values).map(|(name, value)| (name.clone(), json!(value))).collect();
            json!({"factors": factors, "variants": case.variants.iter().map(Column::to_json).collect::<Vec<_>>()})
        };
        json!({
            "experiment": it.name,
            "about": it.doc,
            "plan": it.plan,
            "runs": it.runs,
            "seed": it.seed,
            "wanted": self.wanted,
            "done": self.done,
            "cases": self.cases.iter().zip(&it.cases).map(case).collect::<Vec<_>>(),
        })
    }
}

impl Column {
    fn of(
        it: &Experiment,
        name: &str,
        edits: &Edits,
        runs: &BTreeMap<u64, &Run>,
        first: Option<&BTreeMap<u64, &Run>>,
    ) -> Column {
        let succeeded = count(runs.values(), |run| run.success);
        let mut whys: BTreeMap<&str, u64> = BTreeMap::new();
        for run in runs.values().filter(|run| !run.success) {
            *whys.entry(&run.why).or_default() += 1;
        }
        let mut whys: Vec<(String, u64)> = whys.into_iter().map(|(why, n)| (why.to_string(), n)).collect();
        whys.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
        // One pair for each seed that both have run under.
        let pairs: Vec<(&Run, &Run)> = first.map_or(Vec::new(), |first| {
            first.iter().filter_map(|(seed, a)| Some((*a, *runs.get(seed)?))).collect()
        });
        let measure = |(at, name): (usize, &String)| Measure {
            name: name.clone(),
            all: Scope::of(at, runs, first, &pairs, |_| true),
            succeeded: Scope::of(at, runs, first, &pairs, |run| run.success),
        };
        Column {
            name: name.into(),
            edits: edits.clone(),
            alike: None,
            runs: runs.len() as u64,
            succeeded,
            rate: wilson(succeeded, runs.len() as u64),
            whys,
            against: first.filter(|_| !pairs.is_empty()).map(|first| {
                let of_first = count(first.values(), |run| run.success);
                Success::of(&pairs, [succeeded, runs.len() as u64, of_first, first.len() as u64])
            }),
            measures: it.measures.iter().enumerate().map(measure).collect(),
        }
    }

    fn to_json(&self) -> Json {
        let measures: JsonMap<String, Json> = self
            .measures
            .iter()
            .map(|it| {
                (it.name.clone(), json!({"all": it.all.to_json(), "succeeded": it.succeeded.to_json()}))
            })
            .collect();
        json!({
            "variant": self.name,
            "edits": self.edits.to_json(),
            "runs-as": self.alike,
            "runs": self.runs,
            "succeeded": self.succeeded,
            "rate": self.rate.map(|it| interval(&it)),
            "failed-because": self.whys,
            "against": self.against.map(|it| it.to_json()),
            "measures": measures,
        })
    }
}

impl Success {
    /// `counts`: how many succeeded of how many, of this variant and of the first.
    fn of(pairs: &[(&Run, &Run)], [ours, runs, theirs, of]: [u64; 4]) -> Success {
        let lost = count(pairs, |(a, b)| a.success && !b.success);
        let won = count(pairs, |(a, b)| !a.success && b.success);
        let both = count(pairs, |(a, b)| a.success && b.success);
        let neither = pairs.len() as u64 - lost - won - both;
        Success {
            pairs: pairs.len() as u64,
            lost,
            won,
            mcnemar: mcnemar(lost, won),
            fisher: fisher(ours, runs - ours, theirs, of - theirs),
            difference: newcombe_paired(both, won, lost, neither),
        }
    }

    fn to_json(self) -> Json {
        json!({
            "pairs": self.pairs,
            "lost": self.lost,
            "won": self.won,
            "mcnemar-p": number(self.mcnemar),
            "fisher-p": number(self.fisher),
            "difference": self.difference.map(|it| json!({"mean": round(it.difference), "low": round(it.low), "high": round(it.high)})),
        })
    }
}

impl Scope {
    fn of(
        at: usize,
        runs: &BTreeMap<u64, &Run>,
        first: Option<&BTreeMap<u64, &Run>>,
        pairs: &[(&Run, &Run)],
        counts: impl Fn(&Run) -> bool,
    ) -> Scope {
        let value = |run: &Run| run.numbers.get(at).copied().flatten().filter(|it| it.is_finite());
        let values = |runs: &BTreeMap<u64, &Run>| -> Vec<f64> {
            runs.values().filter(|run| counts(run)).filter_map(|run| value(run)).collect()
        };
        let ours = values(runs);
        let (a, b): (Vec<f64>, Vec<f64>) = pairs
            .iter()
            .filter(|(a, b)| counts(a) && counts(b))
            .filter_map(|(a, b)| Some((value(a)?, value(b)?)))
            .unzip();
        Scope {
            summary: Summary::of(&ours),
            median: statistics::median_interval(&ours),
            against: first.and_then(|first| Comparison::of(&a, &b, &values(first), &ours)),
            failed: runs
                .values()
                .filter(|run| counts(run) && value(run).is_some())
                .map(|run| !run.success)
                .collect(),
            values: ours,
        }
    }

    fn to_json(&self) -> Json {
        let Some(it) = self.summary else { return json!({"n": 0}) };
        json!({
            "n": it.n,
            "mean": round(it.mean),
            "low": number(it.low),
            "high": number(it.high),
            "sd": number(it.sd),
            "median": round(it.median),
            "median-interval": self.median.map(|it| interval(&it)),
            "min": round(it.min),
            "q1": round(it.q1),
            "q3": round(it.q3),
            "max": round(it.max),
            "against": self.against.as_ref().map(Comparison::to_json),
        })
    }
}

impl Comparison {
    /// `a` and `b`: pairs of the first variant and this one; `first` and `ours`: all values.
    fn of(a: &[f64], b: &[f64], first: &[f64], ours: &[f64]) -> Option<Comparison> {
        let paired = paired_t(b, a)?;
        let mean = statistics::mean(a)?;
        let percent = (mean > 0.0).then(|| {
            let of_mean = |it: f64| 100.0 * it / mean;
            (of_mean(paired.difference), Interval { low: of_mean(paired.low), high: of_mean(paired.high) })
        });
        Some(Comparison {
            pairs: a.len(),
            paired,
            corrected: None,
            wilcoxon: wilcoxon(b, a).map(|it| it.p),
            welch: welch_t(ours, first),
            percent,
            effects: [
                effect::cohens_d(ours, first),
                effect::hedges_g(ours, first),
                effect::d_z(b, a),
                effect::cliffs_delta(ours, first),
            ],
        })
    }

    fn to_json(&self) -> Json {
        let test = |it: &TTest| {
            json!({"difference": round(it.difference), "low": round(it.low), "high": round(it.high),
                   "t": round(it.t), "degrees": round(it.degrees), "p": round(it.p)})
        };
        let effects: JsonMap<String, Json> =
            EFFECTS.iter().zip(self.effects).map(|(name, it)| ((*name).to_string(), number(it))).collect();
        json!({
            "pairs": self.pairs,
            "percent": self.percent.map(|(it, within)| json!({"mean": round(it), "low": round(within.low), "high": round(within.high)})),
            "paired": test(&self.paired),
            "paired-p-holm": number(self.corrected),
            "wilcoxon-p": number(self.wilcoxon),
            "welch": self.welch.as_ref().map(test),
            "effects": effects,
        })
    }
}

fn count<T>(items: impl IntoIterator<Item = T>, holds: impl Fn(&T) -> bool) -> u64 {
    items.into_iter().filter(|it| holds(it)).count() as u64
}

fn interval(it: &Interval) -> Json {
    json!([round(it.low), round(it.high)])
}

fn number(it: Option<f64>) -> Json {
    it.map_or(Json::Null, round)
}

/// Ten digits: the last ones of a logarithm are another machine's.
fn round(it: f64) -> Json {
    if !it.is_finite() {
        return json!(if it > 0.0 { "Infinity" } else { "-Infinity" });
    }
    json!(format!("{it:.9e}").parse::<f64>().unwrap_or(it))
}
