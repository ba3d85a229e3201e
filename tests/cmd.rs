//! The command line: `cmd/NAME.cmd` says which files there are, what is called and what that gives.
//!
//! ```text
//! # What this shows.
//! === hello.plan
//! (def-plan main () (print "hello"))
//! === commands
//! $ pleach run hello.plan
//! hello
//! --- stderr
//! top-level  succeeded
//! └─ main  succeeded
//! --- exit 0
//! ```
//! A command is one for `sh`, in an empty folder with these files. What stands for the folder's name
//! in the output is `[FOLDER]`; for numbers that differ from run to run the case uses `sed`.

use std::path::Path;

use crate::expected::{check_file, report};
use crate::folder::Folder;
use crate::program::files_below;

/// The parts of a case: comments, files with their names, commands.
struct Case<'t> {
    head: &'t str,
    files: Vec<(&'t str, &'t str)>,
    commands: Vec<&'t str>,
}

fn parse(text: &str) -> Case<'_> {
    let (head, commands) = text.split_once("=== commands\n").expect("a case has commands");
    let files = head.split("\n=== ").skip(1).map(|part| part.split_once('\n').unwrap_or((part, "")));
    let commands = commands.lines().filter_map(|line| line.strip_prefix("$ ")).collect();
    Case { head, files: files.collect(), commands }
}

/// Calls one command and writes down what it gives.
fn call(command: &str, folder: &Folder) -> String {
    let output = folder.shell(command);
    let shown = |bytes: &[u8]| {
        let text = String::from_utf8_lossy(bytes).replace(&folder.0.display().to_string(), "[FOLDER]");
        if text.is_empty() || text.ends_with('\n') { text } else { text + "⏎\n" }
    };
    let stderr = shown(&output.stderr);
    let stderr = if stderr.is_empty() { stderr } else { format!("--- stderr\n{stderr}") };
    let code = output.status.code().map_or("by a signal".into(), |code| code.to_string());
    format!("$ {command}\n{}{stderr}--- exit {code}\n", shown(&output.stdout))
}

/// Runs a case: the text that its file should have.
fn run(path: &Path) -> String {
    let text = std::fs::read_to_string(path).expect("it was listed");
    let case = parse(&text);
    let name = path.file_stem().expect("a case has a name").to_string_lossy();
    let folder = Folder::new(&format!("cmd-{name}"), &case.files);
    let ran: String = case.commands.iter().map(|command| call(command, &folder)).collect();
    format!("{}=== commands\n{ran}", case.head)
}

#[test]
fn commands_do_what_their_cases_say() {
    let paths = files_below(Path::new("tests/cmd"), ".cmd");
    assert!(!paths.is_empty());
    let problems = paths.iter().filter_map(|path| check_file(path, &run(path)).err());
    report(&problems.collect::<Vec<_>>());
}
