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

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::expected::{check_file, report};
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

/// A folder of its own for a case, with its files.
fn make_folder(path: &Path, case: &Case<'_>) -> PathBuf {
    let name = path.file_stem().expect("a case has a name").to_string_lossy();
    let folder = std::env::temp_dir().join(format!("pleach-cmd-{}-{name}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    for (name, text) in &case.files {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().expect("it is below the folder"))
            .expect("a folder can be made");
        std::fs::write(path, text).expect("a file can be written");
    }
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    folder.canonicalize().expect("it was made just now")
}

/// Calls one command and writes down what it gives.
fn call(command: &str, folder: &Path) -> String {
    let binary = Path::new(env!("CARGO_BIN_EXE_pleach")).parent().expect("it is in a folder");
    let path = format!("{}:{}", binary.display(), std::env::var("PATH").unwrap_or_default());
    let output = Command::new("sh")
        .args(["-c", command])
        .current_dir(folder)
        .env("PATH", path)
        .env("COLUMNS", "100")
        .stdin(std::process::Stdio::null())
        .output()
        .expect("there is a shell");
    let shown = |bytes: &[u8]| {
        let text = String::from_utf8_lossy(bytes).replace(&folder.display().to_string(), "[FOLDER]");
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
    let folder = make_folder(path, &case);
    let ran: String = case.commands.iter().map(|command| call(command, &folder)).collect();
    let _ = std::fs::remove_dir_all(&folder);
    format!("{}=== commands\n{ran}", case.head)
}

#[test]
fn commands_do_what_their_cases_say() {
    let paths = files_below(Path::new("tests/cmd"), ".cmd");
    assert!(!paths.is_empty());
    let problems = paths.iter().filter_map(|path| check_file(path, &run(path)).err());
    report(&problems.collect::<Vec<_>>());
}
