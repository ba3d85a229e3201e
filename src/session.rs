//! A session: a program, the machine that runs it, and the files that it comes from.

use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use compiler::module::{Meaning, ModuleId};
use compiler::{Front, Loaded, Report};
use grammar::FileId;
use serde_json::{Value as Json, json};
use store::{Store, StoreError, Writer};
use vm::code::{FnId, Program, SiteId};
use vm::host::{CodeRequest, Host, Request};
use vm::limits::{Grants, Limits};
use vm::log::{Entry, Log};
use vm::machine::{Machine, Outcome, Progress, QUANTUM};
use vm::persist::{SavedEdit, SavedTree};
use vm::value::{Symbol, Value};

use crate::files::Files;
use crate::render::{self, Style};

/// How a session runs programs.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Limits of the run.
    pub limits: Limits,
    /// What the run may do besides computing.
    pub grants: Grants,
    /// Key of all random draws.
    pub seed: u64,
    /// Key of the order in which ready tasks have their turns; 0 is the order of the source.
    pub schedule: u64,
    /// How motions of robots are done.
    pub robot: world::world::Mode,
    /// Time passes as it does on the wall, not at once. What is replayed takes no time nevertheless.
    pub real_time: bool,
    /// Keep the syntax trees, for those who walk them.
    pub keep_ast: bool,
    /// How diagnostics are drawn.
    pub style: Style,
}

/// Where the text goes that programs print, and lines of a trace.
pub trait Output {
    /// Text that the program prints.
    fn print(&mut self, text: &str);
    /// A start or an end, as it happens.
    fn trace(&mut self, _line: &str) {}
    /// A mistake of the program that nothing else will show.
    fn complain(&mut self, _line: &str) {}
    /// What came from outside and is now part of the run's log.
    fn logged(&mut self, _entry: &Entry) {}
    /// Shown the machine between two stretches of work.
    fn looked(&mut self, _machine: &Machine) {}
    /// Who writes this store already, if it is the one that the run is kept in.
    fn store(&mut self, _store: &Path) -> Option<&mut Writer> {
        None
    }
    /// Asked between two rounds; false stops the run there.
    fn goes_on(&mut self) -> bool {
        true
    }
}

impl Output for String {
    fn print(&mut self, text: &str) {
        self.push_str(text);
    }
}

/// How a run ended.
#[derive(Debug, Clone)]
pub enum Ended {
    /// The program has errors and was not run.
    Errors(Vec<Report>),
    /// A top-level form failed before the plan was called.
    NotLoaded(Value),
    /// The plan, or the file without one, has run.
    Ran(Outcome),
    /// It was stopped between two instructions: at [`Session::stop_at`], or by its output.
    Stopped,
}

/// A run of a text, with what it printed.
#[derive(Debug)]
pub struct Run {
    /// What the program printed.
    pub printed: String,
    /// The value, or the failure as text.
    pub outcome: Result<Value, String>,
    /// The diagnostics as text.
    pub diagnostics: String,
}

/// A program, the machine that runs it, and the files that it comes from.
pub struct Session {
    /// The files of the program.
    pub files: Files,
    /// What the compiler knows.
    pub front: Front,
    /// The machine.
    pub machine: Machine,
    /// The module of the user's file, or of the REPL.
    pub module: ModuleId,
    /// Stop when the run has used so many units of fuel.
    pub stop_at: Option<u64>,
    /// Ask nothing of the outside: a run that comes to the end of its log is stopped.
    pub sealed: bool,
    /// A sealed run came to the end of its log: what happened after that step means nothing.
    pub log_ended: bool,
    /// The call of the plan, where it had to be compiled before the run began.
    prepared: Option<Loaded>,
    style: Style,
    /// Time passes as it does on the wall.
    real_time: bool,
}

/// The root's part of a run: prints, reads files, compiles the code of edits.
struct Door<'a> {
    front: &'a mut Front,
    files: &'a Files,
    grants: &'a Grants,
    output: &'a mut dyn Output,
    sealed: bool,
    log_ended: &'a mut bool,
    real_time: bool,
}

/// What places in the call of the plan are called: its text is no file of the program.
pub const CALL: &str = "the call of the plan";

/// How long a run in real time sleeps before it asks whether it is to stop.
const NAP: Duration = Duration::from_millis(20);

impl Host for Door<'_> {
    fn print(&mut self, text: &str) {
        if !*self.log_ended {
            self.output.print(text);
        }
    }
    fn trace(&mut self, line: &str) {
        if !*self.log_ended {
            self.output.trace(line);
        }
    }
    fn complain(&mut self, line: &str) {
        if !*self.log_ended {
            self.output.complain(line);
        }
    }
    fn answer(&mut self, request: &Request) -> Result<Json, String> {
        if self.sealed {
            *self.log_ended = true;
            return Err("the log ends here".into());
        }
        match request {
            Request::ReadFile(path) => {
                granted("read", path, &self.grants.read)?;
                crate::files::read_text(Path::new(path)).map(Json::String)
            }
            Request::WriteFile { path, text } => {
                granted("write", path, &self.grants.write)?;
                std::fs::write(path, text)
                    .map_err(|error| crate::files::cannot_write(Path::new(path), &error))?;
                Ok(Json::Null)
            }
            Request::LoadTree { store, tree, version } => {
                granted("read", store, &self.grants.read)?;
                let load = || {
                    let store = Store::read(Path::new(store))?;
                    store.tree(&store.version(tree, *version)?)
                };
                load().map(|tree| tree.rows()).map_err(|error: StoreError| error.to_string())
            }
            Request::SaveTree { store, tree, rows } => {
                granted("write", store, &self.grants.write)?;
                let path = Path::new(store);
                // Edits of which the program has not said who made them are its own.
                let own = self.files.iter().find(|file| !file.name.starts_with("library/"));
                let origin = own.map_or("program".into(), |file| format!("program {}", file.name));
                let version = match self.output.store(path) {
                    Some(writer) => writer.put_beside(tree, rows, &origin),
                    None => Store::write(path)
                        .and_then(|store| Writer::put(store, tree, None, rows, &origin))
                        .map(|writer| writer.version),
                };
                version.map(|version| json!(version)).map_err(|error| error.to_string())
            }
            Request::Versions { store, tree } => {
                granted("read", store, &self.grants.read)?;
                let store = Store::read(Path::new(store)).map_err(|error| error.to_string())?;
                let versions = store.versions().map_err(|error| error.to_string())?;
                Ok(versions.iter().filter(|it| it.tree == *tree).map(|it| json!(it.version)).collect())
            }
            Request::Clock => {
                let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
                Ok(json!(now.as_secs_f64()))
            }
        }
    }
    fn pass(&mut self, ns: u64) -> bool {
        if !self.real_time || self.sealed {
            return true;
        }
        let end = Instant::now() + Duration::from_nanos(ns);
        while let Some(left) = end.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
            if !self.output.goes_on() {
                return false;
            }
            std::thread::sleep(left.min(NAP));
        }
        true
    }
    fn commit(&mut self, entry: &Entry) {
        if !*self.log_ended {
            self.output.logged(entry);
        }
    }
    fn reader(&self) -> Rc<dyn Fn(&str) -> Value> {
        let reader = crate::read::Reader::default();
        Rc::new(move |text| reader.value(text))
    }
    fn lay_out(&self, text: String) -> String {
        grammar::format(&text).unwrap_or(text)
    }
    fn compile(&mut self, program: &mut Program, code: CodeRequest<'_>) -> Result<FnId, String> {
        let compiled = self.front.compile_edit(program, &code);
        compiled.map_err(|reports| {
            // The code is data: there is no text to show.
            let texts = reports.iter().map(|report| {
                let help = report.diagnostic().help().map_or(String::new(), |help| format!(" ({help})"));
                format!("{}{help}", report.diagnostic())
            });
            texts.collect::<Vec<_>>().join("; ")
        })
    }
}

/// A path is granted if it lies below a granted folder, links resolved.
fn granted(word: &str, path: &str, folders: &[String]) -> Result<(), String> {
    let resolve = |path: &Path| path.canonicalize().ok();
    let path_buf = PathBuf::from(path);
    let full = resolve(&path_buf).or_else(|| {
        // A file to be written may not exist: its folder must.
        let folder =
            path_buf.parent().map(|it| if it.as_os_str().is_empty() { Path::new(".") } else { it })?;
        Some(resolve(folder)?.join(path_buf.file_name()?))
    });
    let inside = full.is_some_and(|full| {
        folders.iter().filter_map(|it| resolve(Path::new(it))).any(|it| full.starts_with(it))
    });
    if inside {
        Ok(())
    } else {
        Err(format!("cannot {word} {path}: no grant for it; allow it with --allow {word}=DIR"))
    }
}

impl Session {
    /// A session with the library loaded.
    ///
    /// # Panics
    /// If the library has errors: it is tested to have none.
    #[must_use]
    pub fn new(options: Options) -> Session {
        let mut machine = Machine::new(options.limits, options.grants, options.seed);
        machine.schedule = options.schedule;
        if options.robot != world::world::Mode::default() {
            *machine.world() = Some(Box::new(world::world::World::empty(options.robot, false)));
        }
        machine.program.natives = stdlib::natives();
        machine.program.natives.extend(world::natives());
        let mut front = Front::default();
        front.keep_ast = options.keep_ast;
        let mut files = Files::default();
        let mut library = Vec::new();
        for (name, _) in stdlib::MODULES {
            let module = front.new_prelude(&mut machine.program, &mut files, name);
            library.push(module);
        }
        let module = front.new_module("user");
        let mut session = Session {
            files,
            front,
            machine,
            module,
            stop_at: None,
            sealed: false,
            log_ended: false,
            prepared: None,
            style: options.style,
            real_time: options.real_time,
        };
        for loaded in library {
            let errors: Vec<String> = loaded.reports.iter().map(|it| session.report(it)).collect();
            assert!(errors.is_empty(), "the library has errors:\n{}", errors.join("\n"));
            for init in loaded.init {
                let mut ignored = String::new();
                let outcome = session.call(init, Vec::new(), &mut ignored);
                assert!(outcome.is_ok(), "the library cannot be loaded: {:?}", outcome.err());
            }
        }
        session
    }

    /// Tell the output of every start and end.
    pub fn trace(&mut self) {
        self.machine.trace();
    }

    /// A diagnostic as text.
    #[must_use]
    pub fn report(&self, report: &Report) -> String {
        render::report(&self.files, report, self.style)
    }

    /// Loads a file as the user's program: a plan file, or the rules of Prolog text that ends in `.pl`.
    ///
    /// # Errors
    /// A sentence that says why the file cannot be read.
    pub fn load_file(&mut self, path: &Path) -> Result<Loaded, String> {
        let source = self.files.read_program(path)?;
        let Session { files, front, machine, .. } = self;
        let loaded = front.load(&mut machine.program, files, &source);
        self.module = self.front.module_of(&source.key).unwrap_or(self.module);
        Ok(loaded)
    }

    /// Loads a text as the user's program.
    pub fn load_text(&mut self, name: &str, text: &str) -> Loaded {
        let file = self.files.add(name, text);
        let key = format!("{name}#{}", file.0);
        let source = compiler::Source { file, text: text.into(), key, library: false };
        let Session { files, front, machine, .. } = self;
        let loaded = front.load(&mut machine.program, files, &source);
        self.module = self.front.module_of(&source.key).unwrap_or(self.module);
        loaded
    }

    /// Compiles a text into the module of the session, where it may define things again.
    pub fn extend(&mut self, name: &str, text: &str) -> Loaded {
        let file = self.files.add(name, text);
        let Session { files, front, machine, module, .. } = self;
        front.extend(&mut machine.program, files, *module, file, text)
    }

    /// Compiles a file into the module of the session, where it may define things again.
    ///
    /// # Errors
    /// A sentence that says why the file cannot be read.
    pub fn extend_file(&mut self, path: &Path) -> Result<Loaded, String> {
        let source = self.files.read_program(path)?;
        let Session { files, front, machine, module, .. } = self;
        Ok(front.extend(&mut machine.program, files, *module, source.file, &source.text))
    }

    /// Calls a function of the program and waits for it; nil if it was stopped.
    pub fn call(&mut self, function: FnId, args: Vec<Value>, output: &mut dyn Output) -> Outcome {
        match self.call_until(function, args, output) {
            Progress::Ended(outcome) => outcome,
            Progress::Stopped => Ok(Value::NIL),
        }
    }

    /// Calls a function of the program until it ends, is stopped by its output, or comes to
    /// [`Session::stop_at`].
    pub fn call_until(&mut self, function: FnId, args: Vec<Value>, output: &mut dyn Output) -> Progress {
        self.machine.start(function, args);
        self.go_on(output)
    }

    /// The same for a call that has been stopped.
    pub fn go_on(&mut self, output: &mut dyn Output) -> Progress {
        loop {
            let round = self.machine.steps() + QUANTUM;
            let stop = self.stop_at.map_or(round, |stop| stop.min(round));
            let progress = self.go(output, Some(stop));
            if !self.log_ended {
                output.looked(&self.machine);
            }
            // Who looks at a run again means its own tasks, not those of plans that it tries out.
            let broke = self.machine.stopped_at().is_some() && !(self.sealed && self.machine.is_inside());
            let there = broke
                || self.machine.is_at_end_of_clock()
                || self.stop_at.is_some_and(|stop| self.machine.steps() >= stop);
            if self.log_ended {
                return Progress::Stopped;
            }
            if matches!(progress, Progress::Ended(_)) || there || !output.goes_on() {
                return progress;
            }
        }
    }

    /// Goes on with what the machine does, until it ends or until `stop` units of fuel are used.
    pub fn go(&mut self, output: &mut dyn Output, stop: Option<u64>) -> Progress {
        self.with_door(output, |machine, door| machine.go(door, stop))
    }

    /// The machine at work, and what it may ask of the outside.
    pub(crate) fn with_door<T>(
        &mut self,
        output: &mut dyn Output,
        work: impl FnOnce(&mut Machine, &mut dyn Host) -> T,
    ) -> T {
        let Session { files, front, machine, sealed, log_ended, real_time, .. } = self;
        let grants = machine.grants.clone();
        let mut door =
            Door { front, files, grants: &grants, output, sealed: *sealed, log_ended, real_time: *real_time };
        work(machine, &mut door)
    }

    /// The run that [`Session::run_call`] begins goes on with a saved tree: its edits hold in it. Answers the edits that
    /// do not any more, each with the reason.
    ///
    /// # Errors
    /// A sentence that says what is wrong with the tree.
    pub fn take_up(
        &mut self,
        saved: &SavedTree,
        call: Option<&str>,
    ) -> Result<Vec<(SavedEdit, String)>, String> {
        let call = call.or(self.plan("main").map(|_| "(main)"));
        let prepared = call.map(|call| self.extend(CALL, call));
        let sites = &self.machine.program.sites;
        let owner = prepared.as_ref().and_then(|it| it.init.last());
        // The call of the plan is the last of its form; before it stand those in its arguments.
        let top = owner.and_then(|owner| sites.iter().rposition(|site| site.owner == *owner));
        let top = top.map(|at| SiteId(at as u32));
        self.prepared = prepared;
        let reader = crate::read::Reader::default();
        let mut ignored = String::new();
        self.with_door(&mut ignored, |machine, host| {
            machine.take_up(host, saved, top, &|text| reader.value(text))
        })
    }

    /// Uses what came from outside in an earlier run instead of asking again.
    pub fn replay(&mut self, log: Log) {
        self.machine.log = log.rewound();
    }

    /// The plan of this name in the user's module.
    #[must_use]
    pub fn plan(&self, name: &str) -> Option<FnId> {
        match self.front.modules.look_up(self.module, Symbol::from(name)) {
            compiler::module::Found::One(definition) => match definition.meaning {
                Meaning::Plan(id, _) | Meaning::Function(id, _) => Some(id),
                _ => None,
            },
            _ => None,
        }
    }

    /// That there is no plan of this name, and what could be meant.
    #[must_use]
    pub fn no_plan(&self, name: &str) -> (String, String) {
        let module = self.front.modules.get(self.module);
        let plans = module
            .names
            .iter()
            .filter(|(_, it)| matches!(it.meaning, Meaning::Plan(..)))
            .map(|(name, _)| name.as_str());
        let plans: Vec<&str> = plans.take(20).collect();
        let help = match (compiler::module::nearest(name, plans.iter().copied()), plans.as_slice()) {
            (Some(near), _) => format!("did you mean `{near}`?"),
            (None, []) => "the file defines no plan; define one: (def-plan main () …)".into(),
            (None, plans) => format!("its plans are: {}", plans.join(" ")),
        };
        (format!("the program has no plan called `{}`", vm::show::safe(name)), help)
    }

    /// Runs what a text gave: its top-level forms, then the plan. The tree is the machine's.
    pub fn run(&mut self, loaded: Loaded, plan: Option<&str>, output: &mut dyn Output) -> Ended {
        let call = plan.map(|name| format!("({name})"));
        self.run_call(loaded, call.as_deref(), output)
    }

    /// Runs the top-level forms of what a text gave, and no plan.
    pub fn load_only(&mut self, loaded: Loaded, output: &mut dyn Output) -> Ended {
        if !loaded.reports.iter().all(Report::is_warning) {
            return Ended::Errors(loaded.reports);
        }
        let ended = self.load_forms(loaded, output);
        if let Ended::Ran(outcome) = &ended {
            self.machine.finish(outcome);
        }
        ended
    }

    pub(crate) fn load_forms(&mut self, loaded: Loaded, output: &mut dyn Output) -> Ended {
        let mut last = Value::NIL;
        for init in loaded.init {
            match self.call_until(init, Vec::new(), output) {
                Progress::Ended(Ok(value)) => last = value,
                Progress::Ended(Err(failure)) => {
                    self.machine.finish(&Err(failure.clone()));
                    return Ended::NotLoaded(failure);
                }
                Progress::Stopped => return Ended::Stopped,
            }
        }
        Ended::Ran(Ok(last))
    }

    /// Runs what a text gave: its top-level forms, then the form `call`; without one the plan
    /// `main`, where there is one.
    pub fn run_call(&mut self, loaded: Loaded, call: Option<&str>, output: &mut dyn Output) -> Ended {
        if !loaded.reports.iter().all(Report::is_warning) {
            return Ended::Errors(loaded.reports);
        }
        let last = match self.load_forms(loaded, output) {
            Ended::Ran(Ok(last)) => last,
            ended => return ended,
        };
        let main = self.plan("main").map(|_| "(main)");
        let Some(call) = call.or(main) else {
            self.machine.finish(&Ok(last.clone()));
            return Ended::Ran(Ok(last));
        };
        let loaded = match self.prepared.take() {
            Some(prepared) => prepared,
            None => self.extend(CALL, call),
        };
        if !loaded.reports.iter().all(Report::is_warning) {
            return Ended::Errors(loaded.reports);
        }
        let Some(init) = loaded.init.last() else { return Ended::Ran(Ok(last)) };
        match self.call_until(*init, Vec::new(), output) {
            Progress::Ended(outcome) => {
                self.machine.finish(&outcome);
                Ended::Ran(outcome)
            }
            Progress::Stopped => Ended::Stopped,
        }
    }

    /// Runs a text as a program of its own: for tests and for embedding.
    pub fn run_text(&mut self, name: &str, text: &str) -> Run {
        let mut printed = String::new();
        let loaded = self.load_text(name, text);
        let diagnostics: String = loaded.reports.iter().map(|report| self.report(report)).collect();
        let outcome = match self.run(loaded, None, &mut printed) {
            Ended::Ran(Ok(value)) => Ok(value),
            Ended::Ran(Err(failure)) | Ended::NotLoaded(failure) => {
                Err(render::failure(&self.files, &failure))
            }
            Ended::Errors(reports) => Err(reports.iter().map(|report| self.report(report)).collect()),
            Ended::Stopped => Err("stopped".into()),
        };
        Run { printed, outcome, diagnostics }
    }

    /// The text of a file, by its number.
    #[must_use]
    pub fn text(&self, file: FileId) -> Option<&str> {
        self.files.get(file).map(|file| file.text.as_str())
    }
}
