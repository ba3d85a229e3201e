//! `pleach run --schedules`: one program in many orders of its ready tasks, to find races.

use std::collections::BTreeMap;
use std::ops::Range;

use compiler::Report;
use pleach::session::Output;
use pleach::{Ended, Session};
use serde_json::json;

use super::report::{errors, failure_text};
use super::run::{Job, Show, call};
use super::{Answer, FAILED, INTERRUPTED, files, interrupt, term};

/// `0..200`, or `200` for as many from 0 on.
pub fn range(text: &str) -> Result<Range<u64>, String> {
    let number = |text: &str| super::settings::count(text.trim());
    let range = match text.split_once("..") {
        Some((first, end)) => number(first)?..number(end)?,
        None => 0..number(text)?,
    };
    if range.is_empty() {
        return Err("there is no schedule in it; write 0..200".into());
    }
    Ok(range)
}

/// What a schedule led to, in words that can be compared.
struct Seen {
    schedules: Vec<u64>,
    printed: String,
}

/// Runs a program once for each schedule, and says which outcomes there were.
pub fn explore(job: &Job, show: &Show, schedules: Range<u64>) -> Answer {
    let mut outcomes: BTreeMap<String, Seen> = BTreeMap::new();
    let (mut done, mut other_output) = (0, None);
    interrupt::listen();
    for schedule in schedules.clone() {
        let mut options = job.settings.options(term::error_style())?;
        options.schedule = schedule;
        let mut session = Session::new(options);
        let loaded = session.load_file(&job.file).map_err(|why| files::unreadable(&job.file, why))?;
        if !loaded.reports.iter().all(Report::is_warning) {
            return Ok(errors(&session, &loaded.reports, show));
        }
        let call = call(&session, job)?;
        let mut printed = Silent::default();
        let outcome = match session.run_call(loaded, call.as_deref(), &mut printed) {
            Ended::Ran(Ok(value)) => {
                let printer = vm::print::Printer::new(Some(&session.machine.program), true, vm::print::LIMIT);
                format!("succeeded → {}\n", printer.text(&value))
            }
            Ended::Ran(Err(failure)) | Ended::NotLoaded(failure) => {
                format!("failed\n{}", failure_text(&session, &failure))
            }
            Ended::Errors(reports) => return Ok(errors(&session, &reports, show)),
            Ended::Stopped => break,
        };
        // A short run does not ask by itself.
        if interrupt::asked() {
            break;
        }
        done += 1;
        let first = outcomes.values().next();
        if other_output.is_none() && first.is_some_and(|first| first.printed != printed.text) {
            other_output = Some(schedule);
        }
        let seen =
            outcomes.entry(outcome).or_insert_with(|| Seen { schedules: vec![], printed: printed.text });
        seen.schedules.push(schedule);
    }
    if show.json() {
        let list: Vec<_> = outcomes
            .iter()
            .map(|(outcome, seen)| json!({"outcome": outcome.trim_end(), "schedules": seen.schedules}))
            .collect();
        term::say(&format!("{}\n", json!({"schedules": done, "outcomes": list})));
    } else {
        term::say(&text(done, &outcomes, other_output));
    }
    Ok(match outcomes.len() {
        _ if interrupt::asked() => INTERRUPTED,
        0 | 1 => 0,
        _ => FAILED,
    })
}

fn text(done: usize, outcomes: &BTreeMap<String, Seen>, other_output: Option<u64>) -> String {
    let interrupted = if interrupt::asked() { "interrupted after " } else { "" };
    let mut text = match outcomes.len() {
        0 => format!("{interrupted}{done} schedules\n"),
        1 => format!("{interrupted}{done} schedules, one outcome\n"),
        n => format!(
            "{interrupted}{done} schedules, {n} outcomes: the program depends on the order of its tasks\n"
        ),
    };
    let mut by_number: Vec<_> = outcomes.iter().collect();
    by_number.sort_by_key(|(_, seen)| (std::cmp::Reverse(seen.schedules.len()), seen.schedules[0]));
    for (outcome, seen) in by_number {
        let first = seen.schedules[0];
        text += &format!("\n{} times, for example with --schedule {first}:\n{outcome}", seen.schedules.len());
    }
    if let (1, Some(schedule)) = (outcomes.len(), other_output) {
        text += &format!("\nwhat is printed differs, for example with --schedule {schedule}\n");
    }
    text
}

/// Keeps what is printed.
#[derive(Default)]
struct Silent {
    text: String,
}

impl Output for Silent {
    fn print(&mut self, text: &str) {
        self.text.push_str(text);
    }
    fn goes_on(&mut self) -> bool {
        !interrupt::asked()
    }
}
