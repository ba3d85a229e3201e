//! A session that rehearses variants and does runs.

use std::collections::BTreeMap;
use std::path::PathBuf;

use compiler::Report;
use serde_json::Value as Json;
use vm::code::FnId;
use vm::machine::Progress;
use vm::persist::SavedTree;
use vm::value::{Imm, Map, Obj, Symbol, Value};

use super::{Edits, Experiment, Run, Stop, list, texts};
use crate::rehearse::NoRehearsal;
use crate::render;
use crate::session::{Ended, Options, Output, Session};

/// What stands between the library and this file.
const STAGE: &str = include_str!("stage.plan");

/// What is evaluated, and how: all that a thread must know to begin.
#[derive(Debug, Clone, Default)]
pub struct Program {
    /// The plan file.
    pub file: PathBuf,
    /// Files with more transformations.
    pub rules: Vec<PathBuf>,
    /// A plan of the file instead of its experiments.
    pub plan: Option<String>,
    /// Arguments of that plan, as forms.
    pub args: Vec<String>,
    /// Names of variants instead of those of the experiments.
    pub variants: Vec<String>,
    /// Which check decides on edits, instead of what the experiments say.
    pub accept: Option<String>,
    /// Under how many seeds is rehearsed, instead of what the experiments say.
    pub seeds: Option<u64>,
    /// The first seed, instead of what the experiments say.
    pub seed: Option<u64>,
    /// How many runs, instead of what the experiments say.
    pub runs: Option<u64>,
    /// Limits, grants and style.
    pub options: Options,
}

/// A session with the program, its experiments, and the variants that it has run.
pub struct Worker<'a> {
    session: Session,
    args: Vec<String>,
    experiments: Vec<Value>,
    describe: FnId,
    rehearse: FnId,
    run: FnId,
    /// The trees of variants, by experiment and cell.
    trees: BTreeMap<(usize, usize), Value>,
    quiet: Quiet<'a>,
}

/// Nobody reads what plans print when they are evaluated.
struct Quiet<'a> {
    goes_on: &'a dyn Fn() -> bool,
}

impl Output for Quiet<'_> {
    fn print(&mut self, _text: &str) {}
    fn goes_on(&mut self) -> bool {
        (self.goes_on)()
    }
}

impl<'a> Worker<'a> {
    /// Loads the program. `goes_on` is asked between two rounds of what it does.
    ///
    /// # Errors
    /// What is wrong with the program, or the files of rules, as text.
    pub fn new(program: &Program, goes_on: &'a dyn Fn() -> bool) -> Result<Worker<'a>, Stop> {
        let mut session = Session::new(program.options.clone());
        let mut quiet = Quiet { goes_on };
        let loaded = session.load_file(&program.file)?;
        let said = |session: &Session, why| Stop::of(session, why);
        session.load_quietly(loaded, &mut quiet).map_err(|why| said(&session, why))?;
        for rules in &program.rules {
            session.load_rules(rules, &mut quiet).map_err(|why| said(&session, why))?;
        }
        let module = session.module;
        let stage = session.load_text("library/evaluation.plan", STAGE);
        session.load_quietly(stage, &mut quiet).map_err(|why| said(&session, why))?;
        let function = |name: &str| {
            session.plan(name).ok_or_else(|| Stop::Because("the library cannot be loaded".into()))
        };
        let (rehearse, run) = (function("%rehearsed")?, function("%ran")?);
        let (find, describe) = (function("%experiments")?, function("%described")?);
        session.module = module;
        let trees = BTreeMap::new();
        let mut it = Worker {
            session,
            args: program.args.clone(),
            experiments: Vec::new(),
            describe,
            rehearse,
            run,
            trees,
            quiet,
        };
        let own = match &program.plan {
            Some(plan) => it.own(plan, &program.args)?,
            None => Value::NIL,
        };
        it.experiments = it.find(find, own, program)?;
        if it.experiments.is_empty() && it.session.plan("main").is_some() {
            let main = it.own("main", &[])?;
            it.experiments = it.find(find, main, program)?;
        }
        Ok(it)
    }

    /// A plan of the file, with its arguments: name, plan, values.
    fn own(&mut self, name: &str, args: &[String]) -> Result<Value, Stop> {
        let plan = self.session.plan(name).ok_or_else(|| {
            let (what, help) = self.session.no_plan(name);
            Stop::Because(format!("{what}\n  help: {help}"))
        })?;
        let args = self.session.arguments(args, &mut self.quiet);
        let args = args.map_err(|why| Stop::of(&self.session, why))?;
        Ok(Value::list([Value::symbol(name), Value::Imm(Imm::Function(plan)), args]))
    }

    /// The experiments of the program, or of a plan of its `own`, with what is said about them from outside.
    fn find(&mut self, find: FnId, own: Value, program: &Program) -> Result<Vec<Value>, Stop> {
        let variants = program.variants.iter().map(|name| Value::symbol(name));
        let number = |it: Option<u64>| it.map_or(Value::NIL, integer);
        let said = [
            ("variants", Value::list(variants.collect::<Vec<_>>())),
            ("accept", program.accept.as_deref().map_or(Value::NIL, Value::symbol)),
            ("seeds", number(program.seeds)),
            ("seed", number(program.seed)),
            ("runs", number(program.runs)),
        ];
        let said: Map = said.into_iter().map(|(key, value)| (Value::keyword(key), value)).collect();
        let given = vec![own, Value::new(Obj::Map(Box::new(said)))];
        Ok(self.call(find, given)?.to_vec().unwrap_or_default())
    }

    /// The experiments, in their order.
    ///
    /// # Errors
    /// One of them cannot be understood.
    pub fn experiments(&mut self) -> Result<Vec<Experiment>, Stop> {
        let all = self.experiments.clone();
        let described = all.into_iter().map(|it| {
            let json = self.call(self.describe, vec![it])?;
            let json = self.session.as_json(&json);
            let runs = json["runs"].as_u64();
            let wrong = || {
                let name = &json["experiment"];
                Stop::Because(format!(
                    "the experiment {name} cannot be run: its `:runs`, `:seed` and `:seeds` are numbers from 0, and each factor has a value"
                ))
            };
            let experiment = runs.and_then(|runs| Experiment::from_json(&json, runs)).ok_or_else(wrong)?;
            Ok(Experiment { args: self.args.clone(), ..experiment })
        });
        described.collect()
    }

    /// A number that stands for the texts of the program and the library, and for the version of all else. What the program
    /// reads while it is loaded is not in it.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let files = self.session.files.iter().filter(|file| file.name != crate::session::CALL);
        let version = vm::random::hash_text(env!("CARGO_PKG_VERSION"));
        let sum = files.fold(version, |sum, file| vm::random::mix(sum ^ vm::random::hash_text(&file.text)));
        format!("{sum:016x}")
    }

    /// Rehearses a variant in a case: its edits, and the tree that carries them, if there is one.
    ///
    /// # Errors
    /// A failure, as text, or that it was stopped.
    pub fn rehearse(
        &mut self,
        experiment: usize,
        case: usize,
        variant: usize,
    ) -> Result<(Edits, Option<SavedTree>), Stop> {
        let given = vec![self.experiments[experiment].clone(), integer(case as u64), integer(variant as u64)];
        let value = self.call(self.rehearse, given)?;
        let Some(map) = value.as_map() else { return Ok((Edits::default(), None)) };
        let tree = map.get(&Value::keyword("tree")).and_then(Value::as_tree);
        let saved = tree.map(|tree| vm::persist::tree(&self.session.machine.program, tree));
        let report = self.session.as_json(&value);
        let why = report["why"].as_str().map(str::to_string);
        let mut edits = Edits { rehearsed: true, why, ..Edits::default() };
        for step in list(&report["steps"]).unwrap_or_default() {
            let word = |key: &str| step[key].as_str().unwrap_or_default().to_string();
            match step["verdict"] == "accepted" {
                true => edits.kept.extend(texts(&step["edits"]).unwrap_or_default()),
                false => edits.refused.push([word("transformation"), word("check"), word("why")]),
            }
        }
        let saved = saved.filter(|_| !edits.kept.is_empty());
        Ok((edits, saved))
    }

    /// One run of a variant in a case.
    ///
    /// # Errors
    /// A failure that is none of the plan's, as text, or that it was stopped.
    pub fn run(
        &mut self,
        experiment: (usize, &Experiment),
        (case, variant, seed): (usize, usize, u64),
        tree: Option<&SavedTree>,
    ) -> Result<Run, Stop> {
        let (at, it) = experiment;
        let tree = match (tree, self.trees.get(&(at, it.cell(case, variant)))) {
            (None, _) => Value::NIL,
            (Some(_), Some(known)) => known.clone(),
            (Some(saved), None) => {
                let tree = self.session.restored(saved).map_err(|why| Stop::of(&self.session, why))?;
                self.trees.insert((at, it.cell(case, variant)), tree.clone());
                tree
            }
        };
        let [case_value, variant_value, seed_value] = [case as u64, variant as u64, seed].map(integer);
        let given = vec![self.experiments[at].clone(), case_value, variant_value, seed_value, tree];
        let value = self.call(self.run, given).map_err(|stop| match stop {
            Stop::Because(why) => Stop::Because(format!(
                "the run of {} under seed {seed} could not be measured: {why}",
                it.variants[variant].name
            )),
            stop => stop,
        })?;
        let json = self.session.as_json(&value);
        let text = |key: &str| json[key].as_str().unwrap_or_default().to_string();
        let numbers: Vec<Option<f64>> =
            list(&json["numbers"]).unwrap_or_default().iter().map(Json::as_f64).collect();
        Ok(Run {
            case,
            variant,
            seed,
            status: text("status"),
            success: json["success"] == true,
            // One run, one line.
            why: text("why").replace(['\n', '\r'], " "),
            numbers,
        })
    }

    fn call(&mut self, function: FnId, args: Vec<Value>) -> Result<Value, Stop> {
        match self.session.call_until(function, args, &mut self.quiet) {
            Progress::Ended(Ok(value)) => Ok(value),
            Progress::Ended(Err(failure)) => Err(Stop::Because(said(&self.session, &failure))),
            Progress::Stopped => Err(Stop::Asked),
        }
    }
}

/// What failures of these types say is meant for people, and the places that they come from are the library's.
const PLAIN: [&str; 2] = ["experiment-failure", "transformation-failure"];

fn said(session: &Session, failure: &Value) -> String {
    let types = &session.machine.program.failures;
    let plain = failure
        .as_failure()
        .filter(|it| PLAIN.iter().any(|name| types.is_named(it.kind, Symbol::from(name))));
    let fields = plain.map_or(&[][..], |it| &it.fields);
    match fields.iter().find(|(field, _)| *field == "message").and_then(|(_, value)| value.as_str()) {
        Some(message) => message.to_string(),
        None => render::failure(&session.files, failure),
    }
}

/// Numbers that are too large for the language are refused before: see [`Experiment::trouble`].
fn integer(n: u64) -> Value {
    Value::int(i64::try_from(n).unwrap_or(i64::MAX))
}

impl Stop {
    /// Why a program was not loaded, as text.
    fn of(session: &Session, why: NoRehearsal) -> Stop {
        match why {
            NoRehearsal::Because(why) => Stop::Because(why),
            NoRehearsal::Stopped | NoRehearsal::NotLoaded(Ended::Stopped) => Stop::Asked,
            NoRehearsal::Failed(failure)
            | NoRehearsal::NotLoaded(Ended::NotLoaded(failure) | Ended::Ran(Err(failure))) => {
                Stop::Because(said(session, &failure))
            }
            NoRehearsal::NotLoaded(Ended::Errors(reports)) => {
                let wrong = reports.iter().filter(|it| !Report::is_warning(it));
                Stop::Because(wrong.map(|report| session.report(report)).collect())
            }
            NoRehearsal::NotLoaded(Ended::Ran(Ok(_))) => Stop::Because("the program was not loaded".into()),
        }
    }
}
