//! The commands of the REPL: lines that begin with a colon and a known word.

use std::path::Path;

use compiler::module::{Found, Meaning, nearest};
use vm::value::Symbol;

use super::{Prompt, inspect};
use crate::cli::{doc, files, report, term};

/// Name, what follows it, and what it does, of each command.
pub const COMMANDS: &[(&str, &str, &str)] = &[
    (":help", "", "this list"),
    (":doc", "NAME", "what a name means"),
    (":type", "FORM", "what kind of value a form gives, and what is in it"),
    ("?-", "GOAL", "what makes a goal of rules hold; `;` on the next line gives the next answer"),
    (":more", "", "the next answer of the last goal, as `;` does"),
    (":why", "GOAL", "why a goal holds: the proof of its first answer"),
    (":why-not", "GOAL", "why a goal does not hold: what fails in which clause, the nearest first"),
    (":tree", "[all]", "the tasks of this session, and what became of them"),
    (":load", "FILE", "define what a file defines, again if need be"),
    (":code", "NAME", "the instructions of a function or plan"),
    (":expand", "FORM", "a form with the macro at its head expanded"),
    (
        ":break",
        "[NAME]",
        "stop where a task begins whose path ends so: deliver, fetch / drive, drive :call 2; `none`: nowhere",
    ),
    (":continue", "", "go on with what is stopped"),
    (":step", "[N]", "go on for so many calls and backward jumps, 1 if not said"),
    (":back", "[N]", "go back in time for so many, by running all inputs again"),
    (":tasks", "", "the tasks that run, and what they wait for"),
    (":fluents", "", "the fluents in use, and what they hold"),
    (":reset", "", "forget all that was typed; load the file of the start again"),
    (":quit", "", "leave, as Ctrl-D does"),
];

/// Whether the REPL goes on.
#[derive(Debug, PartialEq, Eq)]
pub enum After {
    GoOn,
    Quit,
}

/// True for a line that is a command, known or not. A keyword that forms follow is one too; a
/// keyword as a value can be had with a quote before it.
pub fn is_command(line: &str) -> bool {
    line.starts_with(':')
}

/// What follows the word of a command; nothing if the line is no command.
pub fn argument(line: &str) -> Option<&str> {
    let line = line.trim_start();
    line.starts_with(':').then(|| line.split_once(char::is_whitespace).map_or("", |(_, rest)| rest.trim()))
}

/// Does what a command says.
pub fn run(prompt: &mut Prompt, line: &str) -> After {
    let word = line.split_whitespace().next().unwrap_or_default();
    let argument = argument(line).unwrap_or_default();
    let wants = COMMANDS.iter().find(|(name, ..)| *name == word).map_or("", |(_, wants, _)| wants);
    if argument.is_empty() && wants.starts_with(char::is_uppercase) {
        term::say(&format!("error: {word} needs something: {word} {wants}\n"));
        return After::GoOn;
    }
    if word != ":more" {
        prompt.asked = super::query::Asked::Nothing;
    }
    match word {
        ":help" => term::say(&help()),
        ":more" => prompt.more(),
        ":why" | ":why-not" => prompt.why(argument),
        ":doc" => document(prompt, argument),
        ":type" => describe(prompt, argument),
        ":tree" => {
            term::say(&report::tree_text(&prompt.session, argument == "all", ":tree all", term::out_style()))
        }
        ":load" => load(prompt, Path::new(argument)),
        ":break" => prompt.break_at(argument),
        ":continue" => prompt.go_on(None),
        ":step" => number(argument).into_iter().for_each(|n| prompt.go_on(Some(n))),
        ":back" => number(argument).into_iter().for_each(|n| prompt.back(n)),
        ":tasks" => prompt.tasks(),
        ":fluents" => prompt.fluents(),
        ":code" => code(prompt, argument),
        ":expand" => expand(prompt, argument),
        ":reset" => prompt.reset(),
        ":quit" => return After::Quit,
        _ => unknown(word),
    }
    After::GoOn
}

fn unknown(word: &str) {
    let near = nearest(word, COMMANDS.iter().map(|(name, ..)| *name));
    let help = near.map_or("`:help` lists the commands.".into(), |name| format!("did you mean {name}?"));
    term::say(&format!(
        "error: there is no command {}\n  help: {help} A keyword as a value is written '{0}\n",
        vm::show::safe(word)
    ));
}

fn help() -> String {
    let line =
        |(name, wants, does): &(&str, &str, &str)| format!("  {:16} {does}\n", format!("{name} {wants}"));
    let commands: String = COMMANDS.iter().map(line).collect();
    format!(
        "Type a form to see its value, or one of\n{commands}*1 *2 *3 are the last values, *e is the last failure.\n"
    )
}

fn document(prompt: &Prompt, name: &str) {
    match doc::page(&prompt.session, name) {
        Ok(page) => term::say(&page),
        Err(trouble) => term::say(&term::trouble(&trouble)),
    }
}

fn describe(prompt: &mut Prompt, form: &str) {
    prompt.give_up();
    prompt.script.push(super::debug::Typed::Forms(form.to_string()));
    prompt.inputs += 1;
    let loaded = prompt.session.extend(&format!("input {}", prompt.inputs), form);
    if let Some(value) = prompt.execute(loaded) {
        match value {
            Some(value) => term::say(&inspect::describe(&prompt.session, &value)),
            None => term::say("error: this has no value\n  help: :type wants a form\n"),
        }
    }
}

/// How many steps: 1 if not said.
fn number(text: &str) -> Option<u64> {
    match text {
        "" => Some(1),
        text => match crate::cli::settings::count(text) {
            Ok(number) => Some(number),
            Err(why) => {
                term::say(&format!("error: {why}\n"));
                None
            }
        },
    }
}

pub fn load(prompt: &mut Prompt, path: &Path) {
    prompt.give_up();
    prompt.script.push(super::debug::Typed::Load(path.to_path_buf()));
    match prompt.session.extend_file(path) {
        Ok(loaded) => {
            if prompt.execute(loaded).is_some() {
                prompt.screen.say(&format!("loaded {}\n", path.display()));
            }
        }
        Err(why) => term::say(&term::trouble(&files::unreadable(path, why))),
    }
}

fn code(prompt: &Prompt, name: &str) {
    let session = &prompt.session;
    match session.front.modules.look_up(session.module, Symbol::from(name)) {
        Found::One(definition) => match definition.meaning {
            Meaning::Function(id, _)
            | Meaning::Plan(id, _)
            | Meaning::Open(id, _)
            | Meaning::Macro(id, _)
            | Meaning::Test(id) => {
                term::say(&vm::disasm::function(&session.machine.program, id));
            }
            Meaning::Native(..) => term::say(&format!("{name} is written in Rust: it has no instructions\n")),
            Meaning::Const(_) | Meaning::Failure(_) | Meaning::Predicate(..) => {
                term::say(&format!("{name} is {}: it has no instructions\n", definition.meaning.words()))
            }
        },
        _ => document(prompt, name),
    }
}

fn expand(prompt: &mut Prompt, text: &str) {
    prompt.inputs += 1;
    let file = prompt.session.files.add(&format!("input {}", prompt.inputs), text);
    let session = &mut prompt.session;
    match session.front.expand(&mut session.machine.program, session.module, file, text) {
        Ok(form) => {
            let text = form.to_string();
            term::say(&grammar::format(&text).unwrap_or(text));
        }
        Err(reports) => reports.iter().for_each(|report| term::say(&prompt.session.report(report))),
    }
}
