//! Forms to code: macros, names, special forms, instructions.
//!
//! A file goes through four steps. Its definitions are *declared* ([`define`]), so that it may
//! use names that stand further down; each function is *resolved* from forms to [`ast`]
//! ([`resolve`]), macros being *expanded* on the way ([`expand`]); the AST is *lowered* to
//! instructions ([`lower`]). Functions that a macro needs are compiled before the rest. Rules become
//! clauses ([`rules`]).
//!
//! The compiler does no input or output: files come from a [`Loader`].

pub mod ast;
pub mod data;
mod define;
pub mod error;
mod expand;
mod live;
mod lower;
pub mod module;
pub mod pages;
mod resolve;
mod rules;

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use grammar::{FileId, Form, ParseError, Span};
use miette::Diagnostic;
use vm::code::{FnId, FnKind, Function as Proto, GlobalId, Params, Place, Program};
use vm::host::CodeRequest;
use vm::limits::{Grants, Limits};
use vm::machine::Machine;
use vm::rules::clause::PredId;
use vm::value::Symbol;

pub use define::Loaded;
pub use error::CompileError;
use module::{ModuleId, Modules};
use resolve::ParamForms;
pub use rules::query::CompiledGoal;

/// A file that a program uses.
pub struct Source {
    /// Its number, for places.
    pub file: FileId,
    /// Its text.
    pub text: String,
    /// What tells it from other files: using it twice loads it once.
    pub key: String,
    /// It belongs to the library: what fails in it is shown where the user's text called it.
    pub library: bool,
}

/// Finds the files that programs use.
pub trait Loader {
    /// The module `name`, or the file of that name, used by the file `from`.
    ///
    /// # Errors
    /// A sentence that says where it was looked for.
    fn load(&mut self, name: &str, from: FileId) -> Result<Source, String>;
}

/// Something that is wrong with the text of a program.
#[derive(Debug, Clone)]
pub enum Report {
    /// It cannot be read.
    Parse(ParseError),
    /// It can be read, but means nothing.
    Compile(CompileError),
}

impl Report {
    /// Its main place.
    #[must_use]
    pub fn span(&self) -> Span {
        match self {
            Report::Parse(error) => error.span(),
            Report::Compile(error) => error.span(),
        }
    }
    /// For rendering.
    #[must_use]
    pub fn diagnostic(&self) -> &(dyn Diagnostic + 'static) {
        match self {
            Report::Parse(error) => error,
            Report::Compile(error) => error,
        }
    }
    /// True for those that do not keep the program from running.
    #[must_use]
    pub fn is_warning(&self) -> bool {
        matches!(self, Report::Compile(error) if error.is_warning())
    }
}

/// What the compiler remembers from file to file.
pub struct Front {
    /// All modules.
    pub modules: Modules,
    /// The AST of every function, if it is kept.
    pub functions: BTreeMap<FnId, Rc<ast::Function>>,
    /// Keep the AST of every function.
    pub keep_ast: bool,
    /// The module that each function belongs to.
    homes: BTreeMap<FnId, ModuleId>,
    pending: BTreeMap<FnId, Pending>,
    /// Keep the forms of functions, so that a REPL can compile them again.
    pub keep_forms: bool,
    sources: BTreeMap<FnId, Rc<Pending>>,
    references: BTreeMap<FnId, Vec<FnId>>,
    /// The parameters of plans as written, for the code of edits.
    plan_params: BTreeMap<FnId, ParamForms>,
    opens: BTreeMap<FnId, Vec<FnId>>,
    /// The function that computes each constant.
    constants: BTreeMap<GlobalId, FnId>,
    expander: Expander,
    /// Predicates that may have clauses anywhere.
    open_predicates: BTreeSet<PredId>,
    /// Groups of rules and facts by their names, for a REPL that defines them again.
    groups: BTreeMap<(ModuleId, Symbol), rules::declare::Known>,
    /// How many texts there have been: clauses of later ones come first.
    texts: u32,
    loaded: BTreeMap<String, ModuleId>,
    /// Files being loaded, outermost first.
    loading: Vec<String>,
}

/// A machine of its own for macros, and the constants it has computed.
struct Expander {
    machine: Machine,
    computed: BTreeSet<FnId>,
}

/// A function that is declared but not compiled.
#[derive(Clone)]
pub(crate) struct Pending {
    module: ModuleId,
    name: Symbol,
    kind: FnKind,
    params: ParamForms,
    body: Vec<Form>,
    span: Span,
    /// The modules of the macros that made it.
    within: Vec<ModuleId>,
    /// The constant that gets its value.
    defines: Option<GlobalId>,
}

impl Default for Front {
    fn default() -> Front {
        let machine = Machine::new(Limits::for_expansion(), Grants::default(), 0);
        Front {
            modules: Modules::default(),
            functions: BTreeMap::new(),
            keep_ast: false,
            homes: BTreeMap::new(),
            pending: BTreeMap::new(),
            keep_forms: false,
            sources: BTreeMap::new(),
            references: BTreeMap::new(),
            plan_params: BTreeMap::new(),
            opens: BTreeMap::new(),
            constants: BTreeMap::new(),
            expander: Expander { machine, computed: BTreeSet::new() },
            open_predicates: BTreeSet::new(),
            groups: BTreeMap::new(),
            texts: 0,
            loaded: BTreeMap::new(),
            loading: Vec::new(),
        }
    }
}

/// So many mistakes are told apart, as in a text that cannot be read; nobody reads more.
const MOST_REPORTS: usize = grammar::parse::MAX_ERRORS + 1;

/// The compiler at work on a program.
pub(crate) struct Compiler<'p> {
    front: &'p mut Front,
    program: &'p mut Program,
    reports: Vec<Report>,
    /// The modules of the macros whose expansions are around the form that is being resolved. A name
    /// that means nothing where the macro is called means what it means there.
    within: Vec<ModuleId>,
    /// In an expression over fluents: the constants that it reads.
    reads_fluents: Option<Vec<GlobalId>>,
    /// The functions that the one being resolved mentions.
    mentioned: Vec<FnId>,
    /// How deep the forms are nested that are being resolved, those of functions that wait for others
    /// included.
    depth: usize,
    /// What expanding macros has taken so far.
    taken: expand::Taken,
    /// Clauses that reach the program if there are no errors.
    staged: Vec<rules::Staged>,
    /// Functions that rules call.
    called: Vec<rules::Called>,
}

impl std::ops::Deref for Compiler<'_> {
    type Target = Front;
    fn deref(&self) -> &Front {
        self.front
    }
}

impl std::ops::DerefMut for Compiler<'_> {
    fn deref_mut(&mut self) -> &mut Front {
        self.front
    }
}

impl Compiler<'_> {
    fn error(&mut self, error: CompileError) {
        self.reports.push(Report::Compile(error));
    }

    /// The function that is being resolved refers to another one.
    fn mention(&mut self, f: FnId) {
        self.mentioned.push(f);
    }

    /// The function that is being resolved refers to a constant.
    fn mention_constant(&mut self, global: GlobalId) {
        let computes = self.constants.get(&global).copied();
        self.mentioned.extend(computes);
    }

    /// Compiles a function that has been declared, unless that has been done.
    fn compile(&mut self, id: FnId) {
        // A function that a macro needs is compiled while another one waits: on top of it, on the stack.
        const WAITS: usize = 5;
        let Some(pending) = self.pending.remove(&id) else { return };
        self.depth += WAITS;
        let mentioned = std::mem::take(&mut self.mentioned);
        let within = std::mem::replace(&mut self.within, pending.within.clone());
        let scope = resolve::Scope::new(pending.module, pending.kind);
        let function = match pending.defines {
            Some(global) => self.constant_function(scope, pending.name, global, &pending.body[0]),
            None => self.function(scope, pending.name, &pending.params, &pending.body, pending.span),
        };
        self.lower(id, &function);
        let references = std::mem::replace(&mut self.mentioned, mentioned);
        self.within = within;
        self.depth -= WAITS;
        self.references.insert(id, references);
        if self.keep_forms && pending.defines.is_none() {
            self.sources.insert(id, Rc::new(pending));
        }
    }

    fn lower(&mut self, id: FnId, function: &ast::Function) {
        self.keep(id, function);
        let inner = self.program.functions.len() as u32;
        let errors = lower::lower(self.program, id, function);
        // The functions inside of it are at home where it is.
        if let Some(home) = self.home(id) {
            let inner = inner..self.program.functions.len() as u32;
            self.homes.extend(inner.map(|id| (FnId(id), home)));
        }
        self.reports.extend(errors.into_iter().map(Report::Compile));
        debug_assert!(
            !self.reports.iter().all(Report::is_warning) || vm::verify::function(self.program, id).is_empty(),
            "{:?}\n{}",
            vm::verify::function(self.program, id),
            vm::disasm::function(self.program, id)
        );
    }

    /// A new function without code.
    fn declare(&mut self, name: Symbol, kind: FnKind, module: ModuleId) -> FnId {
        let id = FnId(self.program.functions.len() as u32);
        self.program.functions.push(placeholder(name, kind));
        self.homes.insert(id, module);
        id
    }
}

/// A function before it is compiled.
pub(crate) fn placeholder(name: Symbol, kind: FnKind) -> Proto {
    Proto {
        name,
        kind,
        entry: Default::default(),
        end: Default::default(),
        registers: 0,
        params: Params::default(),
        captures: 0,
        guards: false,
        forms: 0..0,
        sites: 0..0,
        place: Place::default(),
    }
}

/// A parameter list as it is written.
#[must_use]
pub fn show_params(params: &Params) -> String {
    let mut words = Vec::new();
    let (required, optional, keys) =
        (params.required as usize, params.optional as usize, params.keys as usize);
    for (at, name) in params.names.iter().enumerate() {
        if at == required && optional > 0 {
            words.push("&optional");
        }
        if at == required + optional && keys > 0 {
            words.push("&key");
        }
        if params.rest && at + 1 == params.names.len() {
            words.push("&rest");
        }
        words.push(name.as_str());
    }
    format!("({})", words.join(" "))
}

impl Front {
    /// Loads a file as a module: all that it uses, then itself.
    pub fn load(&mut self, program: &mut Program, loader: &mut dyn Loader, source: &Source) -> Loaded {
        self.with(program, |compiler| compiler.file(loader, source))
    }

    /// Compiles text for an existing module, as the REPL does. Definitions may replace earlier ones;
    /// a text with errors defines nothing.
    pub fn extend(
        &mut self,
        program: &mut Program,
        loader: &mut dyn Loader,
        module: ModuleId,
        file: FileId,
        text: &str,
    ) -> Loaded {
        let before = self.before(program, module);
        let loaded = self.with(program, |compiler| compiler.text(loader, module, file, text, true));
        if !loaded.reports.iter().all(Report::is_warning) {
            self.take_back(program, module, before);
        }
        loaded
    }

    /// Loads a module of the library that every later module sees.
    pub fn new_prelude(&mut self, program: &mut Program, loader: &mut dyn Loader, name: &str) -> Loaded {
        let source = match loader.load(name, FileId(0)) {
            Ok(source) => source,
            Err(help) => {
                let at = Span::default();
                let error = CompileError::ModuleMissing { name: name.into(), at, help: Some(help) };
                return Loaded { init: Vec::new(), reports: vec![Report::Compile(error)] };
            }
        };
        let loaded = match self.loaded.contains_key(&source.key) {
            true => Loaded::default(),
            false => {
                program.library.insert(source.file.0);
                self.load(program, loader, &source)
            }
        };
        if let Some(module) = self.loaded.get(&source.key) {
            self.modules.prelude.push(*module);
        }
        loaded
    }

    /// The module that was loaded from the source with this key.
    #[must_use]
    pub fn module_of(&self, key: &str) -> Option<ModuleId> {
        self.loaded.get(key).copied()
    }

    /// Makes a module with this name that sees the prelude.
    pub fn new_module(&mut self, name: &str) -> ModuleId {
        self.modules.add(name)
    }

    /// Compiles the code of an edit: a function with the parameters of the plan that it edits.
    ///
    /// # Errors
    /// What is wrong with the code.
    pub fn compile_edit(
        &mut self,
        program: &mut Program,
        code: &CodeRequest<'_>,
    ) -> Result<FnId, Vec<Report>> {
        let module = self.homes.get(&code.home).copied().unwrap_or(ModuleId(0));
        self.made(program, |compiler| Some(compiler.edit(code.form, module, code.plan, code.original)))
    }

    /// What `work` makes of something that defines nothing, or what is wrong with it.
    fn made<T>(
        &mut self,
        program: &mut Program,
        work: impl FnOnce(&mut Compiler<'_>) -> Option<T>,
    ) -> Result<T, Vec<Report>> {
        let mut made = None;
        let loaded = self.with(program, |compiler| {
            made = work(compiler);
            Vec::new()
        });
        let is_right = loaded.reports.iter().all(Report::is_warning);
        made.filter(|_| is_right).ok_or(loaded.reports)
    }

    fn with(&mut self, program: &mut Program, work: impl FnOnce(&mut Compiler<'_>) -> Vec<FnId>) -> Loaded {
        let mut compiler = Compiler {
            front: self,
            program,
            reports: Vec::new(),
            within: Vec::new(),
            reads_fluents: None,
            mentioned: Vec::new(),
            depth: 0,
            taken: expand::Taken::default(),
            staged: Vec::new(),
            called: Vec::new(),
        };
        let init = work(&mut compiler);
        compiler.check_called();
        if compiler.reports.iter().all(Report::is_warning) {
            let staged = std::mem::take(&mut compiler.staged);
            staged.into_iter().for_each(|staged| staged.apply(&mut compiler.program.rules));
        }
        compiler.link_rules();
        let mut reports = compiler.reports;
        reports.sort_by_key(|report| (report.span().file, report.span().start, report.span().end));
        if reports.len() > MOST_REPORTS && !reports.iter().all(Report::is_warning) {
            // Warnings must not hide the errors.
            reports.retain(|report| !report.is_warning());
        }
        if reports.len() > MOST_REPORTS && !reports.iter().all(Report::is_warning) {
            let (more, at) = (reports.len() - MOST_REPORTS, reports[MOST_REPORTS - 1].span());
            reports.truncate(MOST_REPORTS);
            reports.push(Report::Parse(ParseError::TooMany { more, at }));
        }
        Loaded { init, reports }
    }

    /// The module that a function belongs to.
    #[must_use]
    pub fn home(&self, function: FnId) -> Option<ModuleId> {
        self.homes.get(&function).copied()
    }

    /// The global constant behind a definition, for those who look from outside.
    #[must_use]
    pub fn global(&self, module: ModuleId, name: Symbol) -> Option<GlobalId> {
        match self.modules.get(module).names.get(&name)?.meaning {
            module::Meaning::Const(global) => Some(global),
            _ => None,
        }
    }
}

/// Names and shapes of the goals that the language has, for completion and documentation.
#[must_use]
pub fn goal_forms() -> &'static [(&'static str, &'static str)] {
    rules::goal::SHAPES
}

/// Names and shapes of all special forms, for completion and documentation.
#[must_use]
pub fn special_forms() -> &'static [(&'static str, &'static str)] {
    resolve::special::SHAPES
}

/// What a special form does, in a sentence or two.
#[must_use]
pub fn special_form_doc(name: &str) -> Option<&'static str> {
    resolve::special::DOCS.iter().find(|(known, _)| *known == name).map(|(_, doc)| *doc)
}
