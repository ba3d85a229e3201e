//! `pleach query`: asks the rules of a file, over facts and trees.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use clap::Args;
use compiler::{Loaded, Report};
use pleach::session::Output;
use pleach::{Answer as Found, Ended, Explained, Question, Session};
use serde_json::{Map, Value as Json, json};
use store::{Store, StoreError, VersionRow};
use vm::rules::view::TreeView;
use vm::rules::why::Explanation;
use vm::value::Value;

use super::report;
use super::run::{self, Job};
use super::settings::Settings;
use super::{Answer, ERRORS, FAILED, INTERRUPTED, Trouble, files, interrupt, json, keep, term};

pub const HELP: &str = "\
Examples:
  pleach query family.plan '(ancestor ?x eve)'
  pleach query family.plan '(parent ?x ?y) (not (parent ?y ?_))' --all
  pleach query family.pl   '(ancestor ?x eve)' --most 3
  pleach query kitchen.plan '(task-status ?task failed)' --run --all
  pleach query kitchen.plan '(transport-task top-level ?task)' --run=set-table --seed 7
  pleach query family.plan '(ancestor seth ?x)' --why
  pleach query kitchen.plan '(both-hands ?a ?b)' --run --plan
  pleach run kitchen.plan --json > monday.json
  pleach query rules.plan '(both-hands ?one ?other)' --tree monday.json --all
  pleach query runs.store '(task-status ?task failed)' --all
  pleach query runs.store '(task-status ?task failed)' --stored kitchen@2
  pleach query runs.store '(task-status ?task failed)' --each --all
  pleach query runs.store '(both-hands ?one ?other)' --rules rules.plan --each --all
  pleach query rules.plan '(both-hands ?one ?other)' --tree runs.store --stored kitchen

The goal is what could stand after a head in `def-rules`; several goals must hold together. Words
that begin with `?` are asked for, `?_` is anything. The file is a plan file, or Prolog text that ends
in .pl; its top-level forms are run first. Goals about tasks see the tree of that, with --run that of
the plan, with --tree that of an earlier run. Of a store they see the last tree, or the one that --stored
names; the rules are those of its program. With --each every version is asked with the rules of the last one,
and a line `% NAME@VERSION` stands before its answers; with --json there is a line with an object for each. --rules adds the predicates of more files,
which may use those of the program, or define them again. `pleach doc rule` lists predicates of the library,
`pleach doc task-rule` those about tasks.

An answer is a line `?x = value` for each variable, `true.` where there is none to ask for; if there
is no answer, `false.`. What the plan of --run prints goes to stderr.
With --why the proof of the first answer is printed, or for each clause what fails in it, the nearest first.
With --json stdout is one object:
  tree      which tree was asked, as NAME@VERSION; with --each
  answers   [{\"?x\": \"value\"}], values as `write` prints them
  more      whether there may be more answers than were asked for
  why       {holds, parts: [{text, place, parts}]}; with --why
  plan      [{goal, expected, held}]; with --plan
  failure   {type, fields, task, place, cause, also}; where looking for answers failed
  errors    [{severity, code, message, help, file, line, column, labels}]; where there are some
Exit codes: 0 there is an answer · 1 there is none, or the query failed · 2 errors in the file or
goal · 130 stopped by Ctrl-C.";

/// `pleach query`
#[derive(Args)]
pub struct Query {
    /// A plan file, Prolog text (.pl), or a store
    file: PathBuf,
    /// What is to hold: (predicate ?x …)
    goal: String,
    /// All answers, not only the first
    #[arg(long, conflicts_with = "most")]
    all: bool,
    /// So many answers at most
    #[arg(long, value_name = "N", value_parser = super::settings::count)]
    most: Option<u64>,
    /// Run a plan of the file first, `main` if not said: goals about tasks see its tree
    #[arg(long, value_name = "PLAN", num_args = 0..=1, require_equals = true, default_missing_value = "main", conflicts_with = "tree")]
    run: Option<String>,
    /// An argument of the plan, as a form; once for each
    #[arg(long = "arg", value_name = "FORM", allow_hyphen_values = true, requires = "run")]
    args: Vec<String>,
    /// A file that `pleach run --json` wrote, or a store: goals about tasks see its tree
    #[arg(long, value_name = "FILE")]
    tree: Option<PathBuf>,
    /// More rules: a plan file or Prolog text (.pl) whose predicates the goal can use; once for each
    #[arg(long, value_name = "FILE")]
    rules: Vec<PathBuf>,
    /// Which tree of the store: NAME, NAME@VERSION, or the number of a run
    #[arg(long, value_name = "NAME")]
    stored: Option<String>,
    /// Ask each version of each tree of the store
    #[arg(long, conflicts_with = "stored")]
    each: bool,
    /// Why the goal holds, with the places of the rules; or why it does not
    #[arg(long, conflicts_with_all = ["all", "most", "plan"])]
    why: bool,
    /// The order in which the goals are solved, with how often each was expected to hold and how often it did
    #[arg(long, conflicts_with_all = ["all", "most"])]
    plan: bool,
    /// Print the answers as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    settings: Settings,
}

/// What programs print goes to where it does not mix with answers.
struct Aside;

impl Output for Aside {
    fn print(&mut self, text: &str) {
        term::complain(text);
    }
    fn goes_on(&mut self) -> bool {
        !interrupt::asked()
    }
}

/// Asks.
pub fn run(it: Query) -> Answer {
    interrupt::listen();
    let mut session = Session::new(it.settings.options(term::error_style())?);
    let trees = trees(&session, &it)?;
    let mut loaded = load(&mut session, &it)?;
    add_rules(&mut session, &it, &mut loaded)?;
    if !loaded.reports.iter().all(Report::is_warning) {
        return Ok(errors(&session, &it, &loaded.reports));
    }
    loaded.reports.iter().for_each(|warning| term::complain(&session.report(warning)));
    let job = Job {
        file: it.file.clone(),
        plan: it.run.clone(),
        args: it.args.clone(),
        settings: it.settings.clone(),
        rehearse: None,
    };
    let ended = match it.run {
        Some(_) => {
            let call = run::call(&session, &job)?;
            session.run_call(loaded, call.as_deref(), &mut Aside)
        }
        None => session.load_only(loaded, &mut Aside),
    };
    match ended {
        Ended::Errors(reports) => return Ok(errors(&session, &it, &reports)),
        Ended::NotLoaded(failure) => {
            term::complain("error: the file could not be loaded: one of its top-level forms failed\n");
            return failed(&session, &it, "", &failure, Vec::new()).map(|_| ERRORS);
        }
        Ended::Stopped => return Ok(INTERRUPTED),
        // What became of the plan can be asked.
        Ended::Ran(Err(failure)) => term::complain(&format!(
            "note: the plan failed: {}\n",
            failure.as_failure().map_or_else(String::new, |failure| vm::show::safe(&failure.name))
        )),
        Ended::Ran(Ok(_)) => {}
    }
    let code = ask_all(&mut session, &it, trees);
    // Freeing a large tree takes longer than leaving that to the system.
    std::mem::forget(session);
    code
}

/// A tree that goals see, with its name; none for that of the run.
type Asked = (String, Option<Rc<TreeView>>);

/// The store that is asked.
fn store_of(it: &Query) -> Option<&Path> {
    let named = it.tree.as_deref().unwrap_or(&it.file);
    Some(named).filter(|path| store::is_store(path))
}

/// The trees that goals see, each with its name where there are several; none for that of the run.
fn trees(session: &Session, it: &Query) -> Result<Vec<Asked>, Trouble> {
    let Some(path) = store_of(it) else {
        if it.stored.is_some() || it.each {
            let option = if it.each { "--each" } else { "--stored" };
            let help = "name a store in the place of the file, or after --tree";
            return Err(Trouble::new(format!("{option} is about a store, and there is none"), help));
        }
        let tree = it.tree.as_deref().map(|path| read_tree(session, path)).transpose()?;
        return Ok(vec![(String::new(), tree)]);
    };
    let store = Rc::new(Store::read(path)?);
    let versions = match it.each {
        true => store.versions()?,
        false => vec![keep::version(&store, it.stored.as_deref(), None)?],
    };
    let tree = |version: VersionRow| {
        let name = format!("{}@{}", vm::show::safe(&version.tree), version.version);
        let view = match store.outline(&version)? {
            Some(tasks) => {
                let store = store.clone();
                session.tree_of_outline(tasks, move || store.tree(&version).map_err(|it| it.to_string()))
            }
            None => {
                let view = session.tree_of_saved(&store.tree(&version)?);
                view.map_err(|why| Trouble::from(format!("{name}: {why}")))?
            }
        };
        Ok((name, Some(view)))
    };
    versions.into_iter().map(tree).collect()
}

/// The rules: those of the file, or those of the program that a store has.
fn load(session: &mut Session, it: &Query) -> Result<Loaded, Trouble> {
    if !store::is_store(&it.file) {
        return session.load_file(&it.file).map_err(|why| files::unreadable(&it.file, why));
    }
    if it.run.is_some() {
        let help = "name the plan file in its place";
        return Err(Trouble::new("--run needs a program, and a store is none", help));
    }
    let store = Store::read(&it.file)?;
    let version = keep::version(&store, it.stored.as_deref(), None)?;
    let run = match store.run(&version) {
        Ok(run) => run,
        Err(StoreError::Missing { .. }) => return Ok(session.load_text("the program of the store", "")),
        Err(error) => return Err(error.into()),
    };
    session.files.use_shelf(Some(keep::texts(&store, &version, &run.program)?));
    let loaded = session.load_file(Path::new(&run.file)).map_err(Trouble::from);
    session.files.use_shelf(None);
    loaded
}

/// Adds the rules of more files, which see those of the program and may define them again.
fn add_rules(session: &mut Session, it: &Query, loaded: &mut Loaded) -> Result<(), Trouble> {
    for file in &it.rules {
        let more = session.extend_file(file).map_err(|why| files::unreadable(file, why))?;
        loaded.init.extend(more.init);
        loaded.reports.extend(more.reports);
    }
    Ok(())
}

/// Prints an object; of several trees it says which one was asked.
fn say_json(it: &Query, name: &str, json: Json) {
    let mut all = Map::new();
    if it.each {
        all.insert("tree".into(), json!(name));
    }
    all.extend(json.as_object().cloned().unwrap_or_default());
    term::say(&format!("{}\n", Json::Object(all)));
}

/// Asks each tree; the exit code is that of the best answer.
fn ask_all(session: &mut Session, it: &Query, trees: Vec<Asked>) -> Answer {
    let mut best = None;
    for (name, tree) in trees {
        if it.each && !it.json {
            term::say(&format!("% {}\n", vm::show::safe(&name)));
        }
        let code = ask(session, it, &name, tree)?;
        if matches!(code, ERRORS | INTERRUPTED) {
            // The next tree has the same to say.
            return Ok(code);
        }
        best = Some(best.map_or(code, |best: u8| best.min(code)));
    }
    Ok(best.unwrap_or(FAILED))
}

fn read_tree(session: &Session, path: &Path) -> Result<Rc<TreeView>, Trouble> {
    session.read_tree(path).map_err(|why| {
        let help = "write one with: pleach run FILE.plan --json > tree.json";
        if path.exists() {
            Trouble::new(why, help)
        } else {
            Trouble::new(why, "check the name, and the folder that you are in")
        }
    })
}

fn ask(session: &mut Session, it: &Query, name: &str, tree: Option<Rc<TreeView>>) -> Answer {
    let whole = |tree: &Option<Rc<TreeView>>| {
        let trouble = tree.as_ref().and_then(|tree| tree.trouble().map(|it| Trouble::from(it.to_string())));
        trouble.map_or(Ok(()), Err)
    };
    let mut question = match session.ask("goal", &it.goal, tree.clone()) {
        Ok(question) => question,
        Err(reports) => return Ok(errors(session, it, &reports)),
    };
    if it.why {
        let code = explain(session, it, name, &mut question);
        return whole(&tree).and(code);
    }
    if it.plan {
        let code = plan(session, it, name, &mut question);
        return whole(&tree).and(code);
    }
    let most = if it.all { u64::MAX } else { it.most.unwrap_or(1) };
    // Limits hold for the query by itself.
    let machine = &mut session.machine;
    machine.limits.fuel = machine.limits.fuel.saturating_add(machine.steps());
    let (mut answers, mut count, mut more) = (Vec::new(), 0, true);
    while more && count < most {
        let answer = session.next_answer(&mut question);
        // What cannot be read is found out when a goal asks for it.
        whole(&tree)?;
        let answer = match answer {
            Ok(Some(answer)) => answer,
            Ok(None) => {
                more = false;
                break;
            }
            Err(failure) => return failed(session, it, name, &failure, answers),
        };
        more = !answer.is_last;
        match it.json {
            true => answers.push(answer_json(session, &answer)),
            false => term::say(&answer_text(session, &answer, count == 0)),
        }
        count += 1;
        if interrupt::asked() {
            return Ok(INTERRUPTED);
        }
    }
    if it.json {
        say_json(it, name, json!({"answers": answers, "more": more}));
    } else if count == 0 && most > 0 {
        term::say("false.\n");
    } else if more && it.most.is_none() {
        term::complain("there may be more answers: --all shows them\n");
    } else if more {
        term::complain("there may be more answers\n");
    }
    Ok(if count == 0 { FAILED } else { 0 })
}

/// `--why`
fn explain(session: &mut Session, it: &Query, name: &str, question: &mut Question) -> Answer {
    let explained = match session.explain(question) {
        Ok(explained) => explained,
        Err(failure) => return failed(session, it, name, &failure, Vec::new()),
    };
    match it.json {
        true => {
            let parts: Vec<Json> =
                explained.parts.iter().map(|part| explanation_json(session, part)).collect();
            say_json(it, name, json!({"why": {"holds": explained.holds, "parts": parts}}));
        }
        false => term::say(&explanation_text(session, &explained)),
    }
    Ok(if explained.holds { 0 } else { FAILED })
}

/// The text of an explanation.
pub fn explanation_text(session: &Session, explained: &Explained) -> String {
    match (explained.holds, explained.parts.is_empty()) {
        (true, true) => "true: there is nothing to show\n".into(),
        (false, true) => "false: no clause of the goal was near\n".into(),
        _ => format!("{}\n", session.explanation(&explained.parts)),
    }
}

fn explanation_json(session: &Session, part: &Explanation) -> Json {
    let place = part.place.map(|place| session.files.show(place)).filter(|at| !at.is_empty());
    let parts: Vec<Json> = part.parts.iter().map(|part| explanation_json(session, part)).collect();
    json!({"text": part.text, "place": place, "parts": parts})
}

/// `--plan`
fn plan(session: &mut Session, it: &Query, name: &str, question: &mut Question) -> Answer {
    let steps = match session.plan_of(question) {
        Ok(steps) => steps,
        Err(failure) => return failed(session, it, name, &failure, Vec::new()),
    };
    if it.json {
        let steps: Vec<Json> = steps
            .iter()
            .map(|step| json!({"goal": step.goal, "expected": step.expected, "held": step.held}))
            .collect();
        say_json(it, name, json!({"plan": steps}));
    } else {
        term::say(&format!("{:>10} {:>10}  goal\n", "expected", "held"));
        for step in &steps {
            term::say(&format!(
                "{:>10.0} {:>10}  {}\n",
                step.expected,
                step.held,
                vm::show::safe(&step.goal)
            ));
        }
    }
    Ok(if steps.last().is_some_and(|step| step.held > 0) { 0 } else { FAILED })
}

/// A line for each variable; an empty one between answers of several.
pub fn answer_text(session: &Session, answer: &Found, is_first: bool) -> String {
    let lines: Vec<String> =
        answer.values.iter().map(|(name, value)| format!("{name} = {}\n", session.write(value))).collect();
    match lines.len() {
        0 => "true.\n".into(),
        1 => lines.concat(),
        _ => format!("{}{}", if is_first { "" } else { "\n" }, lines.concat()),
    }
}

fn answer_json(session: &Session, answer: &Found) -> Json {
    let pairs = answer.values.iter().map(|(name, value)| (name.to_string(), json!(session.write(value))));
    Json::Object(pairs.collect::<Map<String, Json>>())
}

/// Shows what is wrong with the file or the goal.
fn errors(session: &Session, it: &Query, reports: &[Report]) -> u8 {
    if it.json {
        let errors: Vec<Json> = reports.iter().map(|it| json::report(&session.files, it)).collect();
        term::say(&format!("{}\n", json!({"errors": errors})));
    }
    reports.iter().for_each(|it| term::complain(&session.report(it)));
    ERRORS
}

/// Shows why there are no more answers.
fn failed(session: &Session, it: &Query, name: &str, failure: &Value, answers: Vec<Json>) -> Answer {
    if it.json {
        let failure = json::failure(&session.files, &session.machine.program, failure);
        say_json(it, name, json!({"answers": answers, "more": false, "failure": failure}));
    }
    term::complain(&report::failure_text(session, failure));
    Ok(FAILED)
}
