//! Where the lines come from: a terminal with history and completion, or a pipe.

use std::borrow::Cow;
use std::io::{BufRead as _, IsTerminal as _};
use std::path::PathBuf;

use grammar::Completeness;
use rustyline::completion::{Completer, FilenameCompleter, Pair};
use rustyline::error::ReadlineError;
use rustyline::highlight::{CmdKind, Highlighter};
use rustyline::hint::Hinter;
use rustyline::history::FileHistory;
use rustyline::validate::{ValidationContext, ValidationResult, Validator};
use rustyline::{CompletionType, Config, Context, Editor, Helper};

use super::{commands, complete, highlight};
use crate::cli::term;

/// How many inputs the history keeps.
const HISTORY: usize = 10_000;

/// Where the lines come from.
pub enum Input {
    /// Somebody types them.
    Terminal(Box<Editor<Typing, FileHistory>>, Option<PathBuf>),
    /// They are in a pipe or a file.
    Pipe,
}

impl Input {
    /// A terminal if both ends are one.
    pub fn new() -> Input {
        if !std::io::stdin().is_terminal() || !std::io::stdout().is_terminal() {
            return Input::Pipe;
        }
        let config = Config::builder().completion_type(CompletionType::List).auto_add_history(true);
        let editor = config.max_history_size(HISTORY).and_then(|config| {
            let mut editor: Editor<Typing, FileHistory> = Editor::with_config(config.build())?;
            editor.set_helper(Some(Typing::default()));
            Ok(editor)
        });
        let Ok(mut editor) = editor else { return Input::Pipe };
        let history = history_file();
        if let Some(path) = &history {
            if let Some(folder) = path.parent() {
                let _ = std::fs::create_dir_all(folder);
            }
            // There is none at the first start.
            let _ = editor.load_history(path);
        }
        Input::Terminal(Box::new(editor), history)
    }

    /// True if somebody types.
    pub fn is_terminal(&self) -> bool {
        matches!(self, Input::Terminal(..))
    }

    /// The names that can be completed; asked for only where somebody types.
    pub fn set_names(&mut self, names: impl FnOnce() -> complete::Names) {
        if let Input::Terminal(editor, _) = self
            && let Some(helper) = editor.helper_mut()
        {
            helper.names = names();
        }
    }

    /// The next input; nothing at the end.
    pub fn read(&mut self) -> Option<String> {
        match self {
            Input::Terminal(editor, history) => loop {
                match editor.readline("> ") {
                    Ok(text) => {
                        if let Some(path) = history {
                            // A history that cannot be kept is no reason to stop.
                            let _ = editor.append_history(path);
                        }
                        return Some(text);
                    }
                    Err(ReadlineError::Interrupted) => {}
                    Err(_) => return None,
                }
            },
            Input::Pipe => read_pipe(),
        }
    }
}

/// Reads lines until all brackets are closed, and says them.
fn read_pipe() -> Option<String> {
    let mut text = String::new();
    loop {
        let mut line = Vec::new();
        let read = std::io::stdin().lock().read_until(b'\n', &mut line);
        if !matches!(read, Ok(1..)) {
            return (!text.is_empty()).then_some(text);
        }
        let line = String::from_utf8_lossy(&line);
        let line = line.trim_end_matches(['\n', '\r']);
        let mark = if text.is_empty() { "> " } else { "  " };
        term::say(&format!("{}\n", format!("{mark}{line}").trim_end()));
        text += line;
        text.push('\n');
        if !is_open(&text) {
            return Some(text);
        }
    }
}

/// True if more must follow.
fn is_open(text: &str) -> bool {
    let forms = commands::argument(text).unwrap_or(text);
    matches!(grammar::completeness(forms), Completeness::Incomplete { .. })
}

/// The file of the history, if one is to be kept.
fn history_file() -> Option<PathBuf> {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    if std::env::var_os("PLEACH_HISTORY").is_some() {
        return set("PLEACH_HISTORY");
    }
    let state = set("XDG_STATE_HOME").or_else(|| Some(set("HOME")?.join(".local/state")))?;
    Some(state.join("pleach/history"))
}

/// What helps whoever types.
#[derive(Default)]
pub struct Typing {
    names: complete::Names,
    files: FilenameCompleter,
}

impl Helper for Typing {}

impl Hinter for Typing {
    type Hint = String;
}

impl Validator for Typing {
    fn validate(&self, ctx: &mut ValidationContext<'_>) -> rustyline::Result<ValidationResult> {
        Ok(if is_open(ctx.input()) { ValidationResult::Incomplete } else { ValidationResult::Valid(None) })
    }
}

impl Completer for Typing {
    type Candidate = Pair;
    fn complete(&self, line: &str, pos: usize, ctx: &Context<'_>) -> rustyline::Result<(usize, Vec<Pair>)> {
        if line.starts_with(":load ") {
            return self.files.complete(line, pos, ctx);
        }
        let (start, found) = complete::candidates(&self.names, line, pos);
        let pair = |name: String| {
            // A command that wants something is followed by it.
            let wants =
                commands::COMMANDS.iter().any(|(known, wants, _)| *known == name && !wants.is_empty());
            let replacement = if wants { format!("{name} ") } else { name.clone() };
            Pair { display: name, replacement }
        };
        Ok((start, found.into_iter().map(pair).collect()))
    }
}

impl Highlighter for Typing {
    fn highlight<'l>(&self, line: &'l str, pos: usize) -> Cow<'l, str> {
        match term::out_style().colour {
            true => Cow::Owned(highlight::paint(line, pos)),
            false => Cow::Borrowed(line),
        }
    }
    fn highlight_char(&self, _line: &str, _pos: usize, _kind: CmdKind) -> bool {
        term::out_style().colour
    }
}
