//! Where the output of a run goes while it runs: the terminal, its log, its store.

use std::io::{BufWriter, IsTerminal as _, Write};
use std::path::Path;

use pleach::session::Output;
use store::{StoreError, Writer};
use vm::log::Entry;
use vm::machine::Machine;

use super::journal::Journal;
use super::keep::Keeper;
use super::run::Show;
use super::{interrupt, term};

/// After how many rounds output that waits is written.
const PATIENCE: u32 = 500;

/// Why a run was stopped from outside.
pub(super) enum Halt {
    Interrupted,
    /// Nobody reads the output.
    NoReader,
    /// Output or log cannot be written.
    Broken(String),
}

/// Where the output of a run goes.
pub struct Console {
    out: BufWriter<Box<dyn Write>>,
    /// Each line at once: somebody is watching.
    watched: bool,
    pub(super) trace: bool,
    pub(super) journal: Option<Journal>,
    pub(super) keeper: Option<Keeper>,
    pub(super) halt: Option<Halt>,
    rounds: u32,
}

impl Console {
    /// A console that keeps a log and a store.
    pub(super) fn new(show: &Show, journal: Option<Journal>, keeper: Option<Keeper>) -> Console {
        let (out, watched): (Box<dyn Write>, bool) = match show.json {
            true => (Box::new(std::io::stderr()), std::io::stderr().is_terminal()),
            false => (Box::new(std::io::stdout()), std::io::stdout().is_terminal()),
        };
        Console {
            out: BufWriter::with_capacity(1 << 16, out),
            watched,
            trace: show.trace,
            journal,
            keeper,
            halt: None,
            rounds: 0,
        }
    }

    fn wrote(&mut self, result: std::io::Result<()>) {
        if let Err(error) = result {
            self.halt.get_or_insert(match error.kind() {
                std::io::ErrorKind::BrokenPipe => Halt::NoReader,
                _ => {
                    Halt::Broken(format!("cannot write the program's output: {}", pleach::files::why(&error)))
                }
            });
        }
    }

    pub(super) fn kept(&mut self, result: Result<(), StoreError>) {
        if let Err(error) = result {
            let help = error.help().map_or(String::new(), |help| format!("\n  help: {help}"));
            self.halt.get_or_insert(Halt::Broken(format!("{error}{help}")));
            // What is not written any more does not become half of a run.
            self.keeper = None;
        }
    }

    pub(super) fn flush(&mut self) {
        let result = self.out.flush();
        self.wrote(result);
    }
}

impl Output for Console {
    fn print(&mut self, text: &str) {
        let result = self.out.write_all(text.as_bytes());
        self.wrote(result);
        if self.watched && text.contains('\n') {
            self.flush();
        }
    }
    fn trace(&mut self, line: &str) {
        if self.trace {
            self.flush();
            term::complain(&format!("{line}\n"));
        }
    }
    fn complain(&mut self, line: &str) {
        self.flush();
        term::complain(&format!("warning: {line}\n"));
    }
    fn logged(&mut self, entry: &Entry) {
        if let Some(journal) = &mut self.journal
            && let Err(error) = journal.add(entry)
        {
            let why =
                format!("cannot write the log {}: {}", journal.path.display(), pleach::files::why(&error));
            self.halt.get_or_insert(Halt::Broken(why));
        }
        if let Some(keeper) = &mut self.keeper {
            keeper.logged(entry);
        }
    }
    fn looked(&mut self, machine: &Machine) {
        if let Some(keeper) = &mut self.keeper {
            let result = keeper.look(machine);
            self.kept(result);
        }
    }
    fn store(&mut self, store: &Path) -> Option<&mut Writer> {
        let keeper = self.keeper.as_mut()?;
        keeper.is_in(store).then(|| keeper.writer())
    }
    fn goes_on(&mut self) -> bool {
        self.rounds += 1;
        if let Some(keeper) = &mut self.keeper {
            let result = keeper.nap();
            self.kept(result);
        }
        if self.rounds.is_multiple_of(PATIENCE) {
            self.flush();
        }
        if interrupt::asked() {
            self.halt.get_or_insert(Halt::Interrupted);
        }
        self.halt.is_none()
    }
}
