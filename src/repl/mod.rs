//! The REPL: reads forms, runs them, prints their values.
//!
//! It is the same program on a terminal and in a pipe, and says the same. In a pipe it also says
//! what it reads, so that what comes out is a transcript, which the tests run:
//!
//! ```text
//! > (def-fun twice (x)
//!     (* 2 x))
//! defined twice, a function
//! > (twice 21)
//! 42
//! ```
//!
//! The first line of an input stands behind `> `, each further one behind two spaces; a blank
//! input is `>`. Which lines are further ones follows from the brackets: an input ends with the line
//! in which all of them are closed. What the input prints, its value and its errors follow. Nothing
//! else is printed in a pipe, and all of it goes to stdout.
//!
//! [`commands`] does what begins with a colon, [`query`] what begins with `?-`; [`inspect`] describes
//! values, [`input`] gets the lines, [`complete`] and [`highlight`] help whoever types them.

mod commands;
mod complete;
mod debug;
mod highlight;
mod input;
mod inspect;
mod query;

use std::path::PathBuf;

use clap::Args;
use compiler::Loaded;
use compiler::Report;
use compiler::module::Definition;
use pleach::session::Output;
use pleach::{Options, Session, render};
use vm::code::FnId;
use vm::machine::Progress;
use vm::value::{Symbol, Value};

use crate::cli::settings::Settings;
use crate::cli::{Answer, files, interrupt, term};
use debug::{Stopped, Typed};
use input::Input;
use query::Asked;

pub const HELP: &str = "\
Examples:
  pleach repl
  pleach repl kitchen.plan          with the definitions of a file at hand
  pleach repl < session.txt         a transcript of what is typed there and what it gives

Type a form, and its value is printed; a form may go over several lines. `*1` is the last value,
`*2` and `*3` those before it, `*e` the last failure. `:help` lists the commands. Ctrl-C stops what
runs, `:continue` goes on with it, Ctrl-D leaves. The history is kept in $PLEACH_HISTORY, else in
$XDG_STATE_HOME/pleach/history, else in ~/.local/state/pleach/history; PLEACH_HISTORY= keeps none.";

/// `pleach repl`
#[derive(Args)]
pub struct Repl {
    /// A plan file whose definitions are at hand
    file: Option<PathBuf>,
    #[command(flatten)]
    settings: Settings,
}

/// The constants that hold the last values, and what they mean.
const CELLS: [(&str, &str); 4] = [
    ("*1", "The last value of the REPL."),
    ("*2", "The last value but one of the REPL."),
    ("*3", "The last value but two of the REPL."),
    ("*e", "The last failure at the prompt of the REPL."),
];

/// A REPL between two inputs.
struct Prompt {
    session: Session,
    options: Options,
    file: Option<PathBuf>,
    /// Functions that set the values of [`CELLS`].
    cells: Vec<FnId>,
    /// The last values, newest first.
    last: Vec<Value>,
    screen: Screen,
    inputs: usize,
    /// What is left of an input whose run is stopped.
    stopped: Option<Stopped>,
    /// The form of the input that was begun last.
    begun: FnId,
    /// What has been typed so far and run.
    script: Vec<Typed>,
    breaks: Vec<String>,
    asked: Asked,
}

/// What programs print at the prompt.
#[derive(Default)]
struct Screen {
    printed: usize,
    /// The last line has no end yet.
    open_line: bool,
    /// It runs again what it has shown before.
    mute: bool,
}

impl Output for Screen {
    fn print(&mut self, text: &str) {
        self.printed += text.len();
        self.open_line = if text.is_empty() { self.open_line } else { !text.ends_with('\n') };
        self.say(text);
    }
    fn complain(&mut self, line: &str) {
        self.say(&format!("warning: {line}\n"));
    }
    fn goes_on(&mut self) -> bool {
        !interrupt::asked()
    }
}

impl Screen {
    fn say(&self, text: &str) {
        if !self.mute {
            term::say(text);
        }
    }
}

/// Runs the REPL until its input ends.
pub fn run(it: &Repl) -> Answer {
    let options = it.settings.options(term::out_style())?;
    let mut input = Input::new();
    let mut prompt = Prompt::new(options, it.file.clone());
    interrupt::listen();
    if input.is_terminal() {
        term::say(&format!(
            "pleach {}; :help shows what can be typed, Ctrl-D leaves\n",
            env!("CARGO_PKG_VERSION")
        ));
    }
    prompt.load_first_file()?;
    loop {
        input.set_names(|| complete::Names::of(&prompt.session));
        let Some(text) = input.read() else { return Ok(0) };
        interrupt::answered();
        match text.trim() {
            "" => {}
            ";" if !matches!(prompt.asked, Asked::Nothing) => prompt.more(),
            line if line.starts_with(query::MARK) => prompt.ask(&text),
            line if commands::is_command(line) => {
                if commands::run(&mut prompt, line) == commands::After::Quit {
                    return Ok(0);
                }
            }
            _ => prompt.evaluate(&text),
        }
    }
}

impl Prompt {
    fn new(options: Options, file: Option<PathBuf>) -> Prompt {
        let session = Session::new(options.clone());
        let mut prompt = Prompt {
            session,
            options,
            file,
            cells: Vec::new(),
            last: Vec::new(),
            screen: Screen::default(),
            inputs: 0,
            stopped: None,
            begun: FnId(0),
            script: Vec::new(),
            breaks: Vec::new(),
            asked: Asked::default(),
        };
        prompt.session.front.keep_forms = true;
        prompt
    }

    /// Loads the file of the command line, whose module is then the one of the prompt.
    fn load_first_file(&mut self) -> Answer {
        if let Some(path) = self.file.clone() {
            let loaded = self.session.load_file(&path).map_err(|why| files::unreadable(&path, why))?;
            self.execute(loaded);
        }
        let Session { front, machine, module, .. } = &mut self.session;
        self.cells =
            CELLS.iter().map(|(name, doc)| front.cell(&mut machine.program, *module, name, doc)).collect();
        self.cells.clone().into_iter().for_each(|cell| self.set(cell, Value::NIL));
        self.last.clear();
        Ok(0)
    }

    /// Starts again with nothing but the file of the command line.
    fn reset(&mut self) {
        let old = std::mem::replace(self, Prompt::new(self.options.clone(), self.file.clone()));
        self.inputs = old.inputs;
        if let Err(trouble) = self.load_first_file() {
            term::say(&term::trouble(&trouble));
        }
    }

    fn set(&mut self, cell: FnId, value: Value) {
        // Setting a constant calls nothing, so nothing can go wrong.
        let _ = self.session.call(cell, vec![value], &mut self.screen);
    }

    /// Runs forms, and prints the value of the last one.
    fn evaluate(&mut self, text: &str) {
        self.give_up();
        self.asked = Asked::Nothing;
        self.script.push(Typed::Forms(text.to_string()));
        self.inputs += 1;
        let before = self.session.files.iter().count() as u32;
        let loaded = self.session.extend(&format!("input {}", self.inputs), text);
        let Some(value) = self.execute(loaded) else { return };
        for (name, definition) in self.defined_in(grammar::FileId(before)) {
            self.screen.say(&format!("defined {name}, {}\n", definition.meaning.words()));
        }
        if let Some(value) = value {
            self.screen.say(&format!("{}\n", self.text(&value)));
            self.remember(value);
        }
    }

    /// Runs what a text gave. Nothing if it has errors or failed; else the value of its last form.
    fn execute(&mut self, loaded: Loaded) -> Option<Option<Value>> {
        loaded.reports.iter().for_each(|report| self.screen.say(&self.session.report(report)));
        if !loaded.reports.iter().all(Report::is_warning) {
            return None;
        }
        self.fill_up();
        let mut rest = loaded.init;
        if rest.is_empty() {
            return Some(None);
        }
        let first = rest.remove(0);
        let progress = self.session.call_until(first, Vec::new(), &mut self.screen);
        self.begun = first;
        self.end_line();
        self.proceed(progress, rest)
    }

    /// Limits hold for each input.
    fn fill_up(&mut self) {
        let machine = &mut self.session.machine;
        machine.limits.fuel = machine.steps().saturating_add(self.options.limits.fuel);
        machine.limits.output = self.screen.printed.saturating_add(self.options.limits.output);
    }

    /// Does what an input does after a form of it has ended or been stopped.
    fn proceed(&mut self, mut progress: Progress, rest: Vec<FnId>) -> Option<Option<Value>> {
        let mut rest = rest.into_iter();
        loop {
            let is_form = self.session.machine.program.functions[self.begun.at()].name == "top-level";
            let last = match progress {
                Progress::Ended(Ok(value)) => is_form.then_some(value),
                Progress::Ended(Err(failure)) => {
                    self.failed(&failure);
                    return None;
                }
                Progress::Stopped => {
                    self.stopped = Some(Stopped { rest: rest.collect() });
                    if !self.screen.mute {
                        self.say_where();
                    }
                    return None;
                }
            };
            let Some(next) = rest.next() else { return Some(last) };
            progress = self.session.call_until(next, Vec::new(), &mut self.screen);
            self.begun = next;
            self.end_line();
        }
    }

    /// Shows a failure that nothing handled, and remembers it.
    fn failed(&mut self, failure: &Value) {
        let text = render::failure_in_source(&self.session.files, failure, term::out_style());
        self.screen.say(&text);
        let cell = self.cells.last().copied();
        cell.into_iter().for_each(|cell| self.set(cell, failure.clone()));
    }

    /// Ends the line that a program has left open.
    fn end_line(&mut self) {
        if std::mem::take(&mut self.screen.open_line) {
            self.screen.say("\n");
        }
    }

    /// What a file has defined in the module of the prompt, in the order of its text.
    fn defined_in(&self, file: grammar::FileId) -> Vec<(Symbol, &Definition)> {
        let names = &self.session.front.modules.get(self.session.module).names;
        let mut defined: Vec<_> =
            names.iter().filter(|(_, it)| it.span.file == file).map(|(name, it)| (*name, it)).collect();
        defined.sort_by_key(|(_, it)| it.span.start);
        defined
    }

    /// Moves the last values one on.
    fn remember(&mut self, value: Value) {
        self.last.insert(0, value);
        self.last.truncate(3);
        for (cell, value) in self.cells.clone().into_iter().zip(self.last.clone()) {
            self.set(cell, value);
        }
    }

    /// The text of a value that reads back, with the names of functions.
    fn text(&self, value: &Value) -> String {
        self.session.write(value)
    }
}
