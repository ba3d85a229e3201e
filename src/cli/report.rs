//! What is said of a run when it has ended: outcome, tree, what its motions have cost, failures.

use compiler::Report;
use pleach::render::Style;
use pleach::{Ended, Session, render};
use serde_json::{Value as Json, json};
use vm::value::Value;
use world::motions::Costs;

use super::console::{Console, Halt};
use super::moment::Moment;
use super::run::{Job, Show};
use super::{Answer, ERRORS, FAILED, INTERRUPTED, json, term};

/// How many nodes of a tree are shown.
const MOST_NODES: usize = 500;
/// Of how many calls a stopped run says where they stand.
const MOST_CALLS: usize = 10;

/// What is shown besides the tree and the outcome.
pub(super) struct Extra {
    /// What motions have cost.
    pub costs: Option<Costs>,
    /// The moment at which the run stands.
    pub moment: Option<Moment>,
    /// What came of the rehearsal.
    pub rehearsal: Option<Json>,
}

/// Shows errors of the program.
pub fn errors(session: &Session, reports: &[Report], show: &Show) -> u8 {
    if show.json {
        let errors: Vec<Json> = reports.iter().map(|it| json::report(&session.files, it)).collect();
        term::say(&format!("{}\n", json!({"outcome": "errors", "errors": errors})));
    }
    reports.iter().for_each(|it| term::complain(&session.report(it)));
    ERRORS
}

/// The word for how a run ended, and the exit code.
fn outcome(ended: &Ended, console: &Console) -> (&'static str, u8) {
    match ended {
        Ended::Errors(_) => ("errors", ERRORS),
        Ended::Ran(Ok(_)) => ("succeeded", 0),
        Ended::Ran(Err(_)) => ("failed", FAILED),
        Ended::NotLoaded(_) => ("not-loaded", ERRORS),
        Ended::Stopped if console.halt.is_some() => ("interrupted", INTERRUPTED),
        Ended::Stopped => ("stopped", 0),
    }
}

/// Writes the end of the run into the store.
pub(super) fn keep_end(session: &Session, ended: &Ended, console: &mut Console) {
    let (word, _) = outcome(ended, console);
    let Some(keeper) = &mut console.keeper else { return };
    let machine = &session.machine;
    let value = match ended {
        Ended::Ran(Ok(value)) => {
            Some(vm::print::Printer::new(Some(&machine.program), true, vm::print::LIMIT).text(value))
        }
        _ => None,
    };
    let result = keeper.end(machine, word, value.as_deref());
    console.kept(result);
}

/// Reports how a run has ended, and answers the exit code.
pub(super) fn report(
    session: &Session,
    ended: &Ended,
    show: &Show,
    console: &mut Console,
    job: &Job,
    extra: Extra,
) -> Answer {
    let Extra { costs, moment, rehearsal } = extra;
    console.flush();
    match &console.halt {
        Some(Halt::NoReader) => return Ok(141),
        Some(Halt::Broken(why)) => return Err(why.clone().into()),
        Some(Halt::Interrupted) | None => {}
    }
    if let Ended::Errors(reports) = ended {
        return Ok(errors(session, reports, show));
    }
    let (outcome, code) = outcome(ended, console);
    if show.json {
        let mut json = result_json(session, ended, outcome, show, job);
        if let Some(costs) = costs {
            json["motions"] = costs_json(session, &costs);
        }
        if let Some(rehearsal) = rehearsal {
            json["rehearsal"] = rehearsal;
        }
        if let Some(moment) = moment {
            moment.add_to(&mut json);
        }
        term::say(&format!("{json}\n"));
        return Ok(code);
    }
    if show.timeline {
        let most = if show.all { usize::MAX } else { MOST_NODES };
        let machine = &session.machine;
        term::complain(&vm::show::timeline(&machine.program, machine.tree(), machine.now(), most));
    } else if !show.quiet {
        term::complain(&tree_text(session, show.all, "--all", term::error_style()));
    }
    if let Some(costs) = costs.filter(|_| !show.quiet) {
        term::complain(&costs_text(session, &costs));
    }
    match ended {
        Ended::Ran(Err(failure)) => term::complain(&failure_text(session, failure)),
        Ended::NotLoaded(failure) => {
            term::complain("error: the file could not be loaded: one of its top-level forms failed\n");
            term::complain(&failure_text(session, failure));
        }
        Ended::Stopped => term::complain(&stopped_text(session, console)),
        _ => {}
    }
    if let Some(moment) = moment.filter(|_| !show.quiet) {
        term::complain(&moment.text());
    }
    Ok(code)
}

/// What the motions of a run have cost; nothing if none has begun.
pub(super) fn motion_costs(session: &mut Session) -> Option<Costs> {
    let world = session.machine.world().as_mut()?.as_any().downcast_mut::<world::world::World>()?;
    Some(world.costs).filter(|costs| costs.actions > 0)
}

fn costs_json(session: &Session, costs: &Costs) -> Json {
    json!({
        "count": costs.actions,
        "path-m": costs.path_m,
        "straight-m": costs.straight_m,
        "hand-m": costs.hand_m,
        "leaps": costs.leaps,
        "failures": session.machine.tree().failures(),
    })
}

fn costs_text(session: &Session, costs: &Costs) -> String {
    let failures = session.machine.tree().failures();
    format!(
        "{:.1} s, {} motions, {:.1} m driven ({:.1} m straight), hands {:.1} m, {failures} failure{}\n",
        session.machine.now() as f64 / 1e9,
        costs.actions,
        costs.path_m,
        costs.straight_m,
        costs.hand_m,
        if failures == 1 { "" } else { "s" },
    )
}

/// A failure with the lines of the source that it comes from.
pub fn failure_text(session: &Session, failure: &Value) -> String {
    render::failure_in_source(&session.files, failure, term::error_style())
}

/// The tree as far as it is shown; `more` shows the rest.
pub fn tree_text(session: &Session, all: bool, more: &str, style: Style) -> String {
    let most = if all { usize::MAX } else { MOST_NODES };
    let tree = session.machine.tree();
    let mut text = vm::show::text(&session.machine.program, tree, most);
    if tree.len() > most && text.ends_with(" nodes in all\n") {
        text.pop();
        text += &format!("; {more} shows them\n");
    }
    term::paint_tree(&text, style)
}

/// Where a stopped run stands, and how to go on.
fn stopped_text(session: &Session, console: &Console) -> String {
    let machine = &session.machine;
    let why = match (&console.halt, session.log_ended) {
        (Some(_), _) => "interrupted",
        (None, true) => "the log ends here: stopped",
        (None, false) => "stopped",
    };
    let begins =
        machine.stopped_at().map_or_else(String::new, |path| format!(" where {} begins", path.show()));
    let clock = vm::show::seconds(machine.now());
    let mut text = format!("{why} at step {}, {clock} s of the task clock{begins}\n", machine.steps());
    text += &place_text(session);
    if let Some(journal) = &console.journal {
        text += &format!("go on with: pleach resume {}\n", journal.path.display());
    }
    if let Some(keeper) = &console.keeper {
        text += &format!("go on with: {}\n", keeper.resume_words());
    }
    text
}

/// The calls in which a stopped run stands, innermost first.
pub fn place_text(session: &Session) -> String {
    let machine = &session.machine;
    let mut text = String::new();
    let calls = machine.backtrace(MOST_CALLS + 1);
    for (function, pc) in calls.iter().take(MOST_CALLS) {
        let function = &machine.program.functions[function.at()];
        let place = machine.program.places.get(pc.at()).copied().unwrap_or_default();
        text +=
            &format!("  in {} {} at {}\n", function.kind.word(), function.name, session.files.show(place));
    }
    if calls.len() > MOST_CALLS {
        text += "  …\n";
    }
    text
}

/// See [`HELP`].
fn result_json(session: &Session, ended: &Ended, outcome: &str, show: &Show, job: &Job) -> Json {
    let machine = &session.machine;
    let mut json = json!({"outcome": outcome});
    match ended {
        Ended::Ran(Ok(value)) => {
            let printer = vm::print::Printer::new(Some(&machine.program), true, vm::print::LIMIT);
            json["value"] = json!(printer.text(value));
        }
        Ended::Ran(Err(failure)) | Ended::NotLoaded(failure) => {
            json["failure"] = json::failure(&session.files, &machine.program, failure);
        }
        Ended::Errors(_) | Ended::Stopped => {}
    }
    let main = session.plan("main").map(|_| "main".to_string());
    json["file"] = json!(job.file);
    json["plan"] = json!(job.plan.clone().or(main));
    json["seed"] = json!(job.settings.seed);
    json["steps"] = json!(machine.steps());
    json["clock"] = json!(machine.now() as f64 / 1e9);
    if !show.quiet {
        json["tree"] = vm::show::json(&machine.program, machine.tree());
    }
    json
}
