//! The command line: what can be said, and which file does it.
//!
//! Each command is a file with one function, from its options to an exit code: 0 all is well,
//! 1 a plan or a test failed or a file is not formatted, 2 errors in the program or in the call,
//! 130 stopped by Ctrl-C. Why a command could not do its work at all is [`Trouble`].

mod check;
mod console;
pub mod doc;
mod evaluate;
mod explain;
pub mod files;
mod fmt;
mod html;
pub mod interrupt;
mod journal;
pub mod json;
mod keep;
pub mod moment;
pub mod query;
mod records;
pub mod report;
mod resume;
pub mod run;
mod schedules;
pub mod settings;
mod store;
pub mod term;
mod test;
mod transfer;
mod transform;
mod tree;

use std::path::PathBuf;

use clap::{Parser, Subcommand};

/// A plan, a test or a comparison failed.
const FAILED: u8 = 1;
/// The program or the call has errors.
const ERRORS: u8 = 2;
/// Stopped by Ctrl-C, as shells count it.
const INTERRUPTED: u8 = 130;

/// Why a command could not do its work.
#[derive(Debug)]
pub struct Trouble {
    /// What is wrong, in one sentence.
    pub what: String,
    /// What to do next.
    pub help: Option<String>,
}

impl Trouble {
    /// What is wrong, and what to do next.
    pub fn new(what: impl Into<String>, help: impl Into<String>) -> Trouble {
        Trouble { what: what.into(), help: Some(help.into()) }
    }
}

impl From<String> for Trouble {
    fn from(what: String) -> Trouble {
        Trouble { what, help: None }
    }
}

/// An exit code, or why there was nothing to do.
pub type Answer = Result<u8, Trouble>;

const FIRST_STEPS: &str = "\
First steps:
  Write a file hello.plan:
      (def-plan greet (name) (print \"hello,\" name))
      (def-plan main () (greet 'Ada) (greet 'Grace))

  pleach run hello.plan         what it prints, then the tree of its tasks
  pleach check hello.plan       all that is wrong with it, without running it
  pleach repl hello.plan        try its plans by hand
  pleach query hello.plan --run '(task-name ?task greet)' --all
                                what its rules find, here in the tree of a run
  pleach doc with-failure-handling
                                what a word of the language or of the library means

Exit codes: 0 all is well · 1 the plan, a test or a check failed · 2 errors in the program or in
the call · 130 stopped by Ctrl-C. NO_COLOR switches colours off.";

/// A language for robot plans that can rewrite themselves.
#[derive(Parser)]
#[command(name = "pleach", version, after_help = FIRST_STEPS, max_term_width = 100)]
struct Line {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run a plan file, then show the tree of its tasks
    #[command(after_help = run::HELP)]
    Run(Box<run::Run>),
    /// Go on with a run that was stopped or killed, from its log or a store
    #[command(after_help = resume::RESUME_HELP)]
    Resume(resume::Resume),
    /// Run again from a log or a store, as far as a moment, and show that moment
    #[command(after_help = resume::REPLAY_HELP)]
    Replay(resume::Replay),
    /// Ask the rules of a file, over its facts and over task trees
    #[command(after_help = query::HELP)]
    Query(Box<query::Query>),
    /// Look at the trees of a store: list, show, compare
    #[command(after_help = tree::HELP)]
    Tree(Box<tree::Tree>),
    /// Rehearse a plan, and rewrite it where that pays
    #[command(after_help = transform::HELP)]
    Transform(Box<transform::Transform>),
    /// Run experiments: variants of a plan under many seeds, compared
    #[command(after_help = evaluate::HELP)]
    Evaluate(Box<evaluate::Evaluate>),
    /// Check, export, import and empty stores
    #[command(after_help = store::HELP)]
    Store(store::Command),
    /// Try forms by hand
    #[command(after_help = crate::repl::HELP)]
    Repl(crate::repl::Repl),
    /// Say all that is wrong with files, without running them
    #[command(after_help = check::HELP)]
    Check(check::Check),
    /// Lay files out
    #[command(after_help = fmt::HELP)]
    Fmt(fmt::Fmt),
    /// Run the tests in files: their `(def-test name …)`
    #[command(after_help = test::HELP)]
    Test(test::Test),
    /// Explain an error code or a type of failures
    #[command(after_help = explain::HELP)]
    Explain(explain::Explain),
    /// What a name means: special forms, functions, plans, modules, failures
    #[command(after_help = doc::HELP)]
    Doc(doc::Doc),
}

/// Reads the command line, does what it says, and answers the exit code.
pub fn main() -> u8 {
    let line = match Line::try_parse() {
        Ok(line) => line,
        Err(error) => {
            let _ = error.print();
            return if error.use_stderr() { ERRORS } else { 0 };
        }
    };
    let answer = match line.command {
        Command::Run(it) => run::run(*it),
        Command::Resume(it) => resume::resume(&it),
        Command::Replay(it) => resume::replay(&it),
        Command::Query(it) => query::run(*it),
        Command::Transform(it) => transform::run(&it),
        Command::Evaluate(it) => evaluate::run(&it),
        Command::Tree(it) => tree::run(&it),
        Command::Store(it) => store::run(&it),
        Command::Repl(it) => crate::repl::run(&it),
        Command::Check(it) => check::run(&it),
        Command::Fmt(it) => fmt::run(&it),
        Command::Test(it) => test::run(&it),
        Command::Explain(it) => explain::run(&it),
        Command::Doc(it) => doc::run(&it),
    };
    exit_code(answer)
}

/// The exit code of an answer. Trouble is said.
fn exit_code(answer: Answer) -> u8 {
    answer.unwrap_or_else(|trouble| {
        term::complain(&term::trouble(&trouble));
        ERRORS
    })
}

/// "1 error", "2 errors"
pub fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// One or more files or folders of plans, for the commands that take many.
#[derive(clap::Args)]
struct Paths {
    /// Plan files, or folders of them
    #[arg(required = true, value_name = "FILE|FOLDER")]
    paths: Vec<PathBuf>,
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_command_line_is_consistent() {
        <super::Line as clap::CommandFactory>::command().debug_assert();
    }
}
