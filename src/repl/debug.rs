//! Runs that are stopped: by a breakpoint, step by step, by Ctrl-C; and back in time by running again.
//!
//! A run is what its inputs and its log make of it, so a moment of the past is had by running all inputs
//! again in silence, as far as that step.

use vm::code::FnId;
use vm::path::PathEnd;

use super::{Prompt, Screen};
use crate::cli::{moment, report, term};

/// Something that was typed and ran.
#[derive(Debug, Clone)]
pub enum Typed {
    /// Forms, with the name of their text.
    Forms(String),
    /// `:load`
    Load(std::path::PathBuf),
    /// `?- goal`: a query uses fuel, too.
    Goal(String),
    /// `;`
    More,
    /// `:why goal`
    Why(String),
}

/// What is left of an input whose run is stopped.
pub struct Stopped {
    /// Its forms that have not been begun.
    pub rest: Vec<FnId>,
}

impl Prompt {
    /// Goes on with the run that is stopped, for so many steps or until something stops it.
    pub fn go_on(&mut self, steps: Option<u64>) {
        let Some(stopped) = self.stopped.take() else {
            return term::say(
                "error: nothing is stopped\n  help: :break NAME stops a run where a task of that name begins\n",
            );
        };
        let machine = &self.session.machine;
        self.session.stop_at = steps.map(|steps| machine.steps().saturating_add(steps));
        let progress = self.session.go_on(&mut self.screen);
        self.end_line();
        let value = self.proceed(progress, stopped.rest);
        self.session.stop_at = None;
        if let Some(Some(value)) = value {
            term::say(&format!("{}\n", self.text(&value)));
            self.remember(value);
        }
    }

    /// Something new is begun: what is still running is given up, and what a log has of another future.
    pub fn give_up(&mut self) {
        if !self.screen.mute {
            self.session.machine.log.forget_rest();
        }
        if self.stopped.take().is_some() {
            let why = vm::Failure::new(vm::failure::Builtin::PlanFailure, "given up at the prompt");
            self.session.machine.abandon(why);
            term::say("what was stopped is given up\n");
        }
    }

    /// Says where a run stands that has been stopped.
    pub fn say_where(&self) {
        let machine = &self.session.machine;
        let at = match machine.stopped_at() {
            Some(path) => format!(" where {} begins", path.show()),
            None => String::new(),
        };
        let clock = vm::show::seconds(machine.now());
        term::say(&format!("stopped at step {}, {clock} s{at}\n", machine.steps()));
        term::say(&report::place_text(&self.session));
    }

    /// `:back`: all inputs again, as far as some steps ago.
    pub fn back(&mut self, steps: u64) {
        let target = self.session.machine.steps().saturating_sub(steps);
        let mut old = std::mem::replace(self, Prompt::new(self.options.clone(), self.file.clone()));
        let log = std::mem::take(&mut old.session.machine.log);
        self.session.replay(log);
        self.session.sealed = true;
        self.screen.mute = true;
        // What the loading of the file says has been said.
        let loaded = self.load_first_file();
        self.session.stop_at = Some(target);
        for typed in loaded.map(|_| old.script).unwrap_or_default() {
            if self.stopped.is_some() || self.session.machine.steps() >= target {
                break;
            }
            match typed {
                Typed::Forms(text) => self.evaluate(&text),
                Typed::Load(path) => super::commands::load(self, &path),
                Typed::Goal(text) => self.ask(&text),
                Typed::More => self.more(),
                Typed::Why(text) => self.why(&text),
            }
        }
        self.session.stop_at = None;
        self.session.sealed = false;
        self.screen = Screen { printed: self.screen.printed, ..Screen::default() };
        self.set_breaks(old.breaks);
        match self.stopped {
            Some(_) => self.say_where(),
            None => term::say(&format!("back at step {}, before an input\n", self.session.machine.steps())),
        }
    }

    /// Tasks whose paths end like this stop the run where they begin.
    pub fn set_breaks(&mut self, breaks: Vec<String>) {
        self.session.machine.break_at(breaks.iter().filter_map(|text| PathEnd::parse(text)).collect());
        self.breaks = breaks;
    }

    /// `:break`
    pub fn break_at(&mut self, pattern: &str) {
        let mut breaks = self.breaks.clone();
        match pattern {
            "" => {}
            "none" => breaks.clear(),
            pattern if PathEnd::parse(pattern).is_none() => {
                return term::say(&format!(
                    "error: `{}` is not the end of a path\n  help: for example deliver, fetch / drive, drive :call 2\n",
                    vm::show::safe(pattern)
                ));
            }
            pattern => breaks.push(pattern.to_string()),
        }
        self.set_breaks(breaks);
        match self.breaks.is_empty() {
            true => term::say("no breakpoints\n"),
            false => term::say(&format!("breakpoints: {}\n", self.breaks.join(", "))),
        }
    }

    /// `:tasks`
    pub fn tasks(&self) {
        let tasks = self.stopped.as_ref().map_or_else(Vec::new, |_| moment::tasks(&self.session));
        say_lines(moment::task_lines(&tasks), "no task runs");
    }

    /// `:fluents`
    pub fn fluents(&self) {
        say_lines(moment::fluent_lines(&moment::fluents(&self.session)), "no fluent is in use");
    }
}

fn say_lines(lines: Vec<String>, none: &str) {
    if lines.is_empty() {
        term::say(&format!("{none}\n"));
    }
    lines.iter().for_each(|line| term::say(&format!("{line}\n")));
}
