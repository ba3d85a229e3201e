//! What a REPL needs: texts that are taken back when they have errors, functions that are compiled
//! again when what they call has another shape now, cells for the last values, expansions to look at.
//!
//! A call knows its callee's parameters when it is compiled. So when a definition of a REPL changes
//! them, or makes a plan of a function, its callers are compiled again from their forms, which are
//! kept for this. A caller that does not fit any more becomes a function that fails and says why.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use grammar::{FileId, Form, Span};
use vm::code::{FnId, FnKind, Function as Proto, GlobalId, Params, Program};
use vm::failure::FailureTypes;
use vm::rules::clause::{Declared, PredId};
use vm::value::{Symbol, Value};

use crate::ast::{Expr, ExprKind, Function, Var, VarId};
use crate::module::{Definition, Found, Meaning, Module, ModuleId};
use crate::rules::declare::Known;
use crate::{Compiler, Front, Pending, Report};

/// What a text may have changed.
pub(crate) struct Before {
    module: Module,
    opens: BTreeMap<FnId, Vec<FnId>>,
    loaded: BTreeMap<String, ModuleId>,
    sources: BTreeMap<FnId, Rc<Pending>>,
    constants: BTreeMap<GlobalId, FnId>,
    ground: Option<FnId>,
    failures: FailureTypes,
    functions: Vec<(FnId, Proto)>,
    open_predicates: BTreeSet<PredId>,
    groups: BTreeMap<(ModuleId, Symbol), Known>,
    predicates: Vec<(PredId, Declared)>,
}

impl Front {
    /// What there is before a text.
    pub(crate) fn before(&self, program: &Program, module: ModuleId) -> Before {
        let all = self.homes.iter().filter(|(_, home)| **home == module).map(|(id, _)| *id);
        let opens = self.opens.keys().copied();
        let meanings = self.modules.get(module).names.values().map(|definition| &definition.meaning);
        let predicates = meanings.filter_map(|meaning| match meaning {
            Meaning::Predicate(id, _) => Some((*id, program.rules.predicates[id.at()].declared.clone())),
            _ => None,
        });
        Before {
            module: self.modules.get(module).clone(),
            opens: self.opens.clone(),
            loaded: self.loaded.clone(),
            sources: self.sources.clone(),
            constants: self.constants.clone(),
            ground: program.ground,
            failures: program.failures.clone(),
            open_predicates: self.open_predicates.clone(),
            groups: self.groups.clone(),
            predicates: predicates.collect(),
            functions: all.chain(opens).map(|id| (id, program.functions[id.at()].clone())).collect(),
        }
    }

    /// As if the text had never been there. Code and functions that it added stay, unknown to all.
    pub(crate) fn take_back(&mut self, program: &mut Program, module: ModuleId, before: Before) {
        *self.modules.get_mut(module) = before.module;
        self.opens = before.opens;
        self.loaded = before.loaded;
        self.sources = before.sources;
        self.constants = before.constants;
        program.ground = before.ground;
        program.failures = before.failures;
        self.open_predicates = before.open_predicates;
        self.groups = before.groups;
        for (id, declared) in before.predicates {
            program.rules.predicates[id.at()].declared = declared;
        }
        for (id, proto) in before.functions {
            program.functions[id.at()] = proto;
        }
    }

    /// A constant of a module whose value is given from outside: the function returned takes it.
    pub fn cell(&mut self, program: &mut Program, module: ModuleId, name: &str, doc: &str) -> FnId {
        let mut cell = FnId(0);
        self.with(program, |compiler| {
            cell = compiler.cell(module, Symbol::from(name), doc);
            Vec::new()
        });
        cell
    }

    /// A form with the macro at its head expanded, and the macro at the head of that, and so on.
    ///
    /// # Errors
    /// What is wrong with the form, or with its macros.
    pub fn expand(
        &mut self,
        program: &mut Program,
        module: ModuleId,
        file: FileId,
        text: &str,
    ) -> Result<Form, Vec<Report>> {
        self.made(program, |compiler| {
            let parsed = grammar::parse(file, text);
            compiler.reports.extend(parsed.errors.into_iter().map(Report::Parse));
            parsed.forms.into_iter().next().map(|form| compiler.expand_head(module, form))
        })
    }
}

impl Compiler<'_> {
    fn cell(&mut self, module: ModuleId, name: Symbol, doc: &str) -> FnId {
        let span = Span::default();
        let global = GlobalId(self.program.globals.len() as u32);
        self.program.globals.push(name);
        let definition = Definition { meaning: Meaning::Const(global), doc: Some(doc.into()), span };
        self.modules.get_mut(module).names.insert(name, definition);
        let value = Expr::new(ExprKind::Var(VarId(0)), span);
        let body = Expr::new(ExprKind::Define(global, Box::new(value)), span);
        let function = function_of(name, &[Symbol::from("value")], FnKind::Function, body, span);
        let id = self.declare(name, FnKind::Function, module);
        self.lower(id, &function);
        id
    }

    fn expand_head(&mut self, module: ModuleId, mut form: Form) -> Form {
        let within = std::mem::take(&mut self.within);
        while let Some(name) = form.head() {
            let Found::One(Definition { meaning: Meaning::Macro(function, params), .. }) =
                self.modules.look_up(module, name)
            else {
                break;
            };
            match self.expand(name, function, &params, &form) {
                Some(expansion) => form = expansion,
                None => break,
            }
            self.within.push(module);
        }
        self.within = within;
        form
    }

    /// Compiles the callers of functions that have other parameters now, or are plans now.
    pub(crate) fn compile_callers(&mut self, changed: &[FnId]) {
        let mentions =
            |(_, references): &(&FnId, &Vec<FnId>)| references.iter().any(|id| changed.contains(id));
        let callers: Vec<FnId> = self.references.iter().filter(mentions).map(|(caller, _)| *caller).collect();
        for caller in callers {
            let Some(source) = self.sources.get(&caller).cloned() else { continue };
            let (name, kind, span) = (source.name, source.kind, source.span);
            let names = source.params.params.names.clone();
            let before = self.reports.len();
            self.pending.insert(caller, Pending::clone(&source));
            self.compile(caller);
            if self.reports[before..].iter().all(Report::is_warning) {
                continue;
            }
            let why = self
                .reports
                .drain(before..)
                .find(|it| !it.is_warning())
                .map(|it| it.diagnostic().to_string());
            self.make_stale(caller, name, &names, kind, span, &why.unwrap_or_default());
        }
    }

    /// Makes a function of one that does not fit any more: it fails and says why.
    fn make_stale(&mut self, id: FnId, name: Symbol, params: &[Symbol], kind: FnKind, span: Span, why: &str) {
        let message = format!("`{name}` does not fit any more: {why}; define it again");
        let field = (Symbol::from("message"), Expr::new(ExprKind::Const(Value::str(message)), span));
        let body = Expr::new(ExprKind::Fail(vm::Builtin::ProgramError.id(), vec![field]), span);
        let shape = self.program.functions[id.at()].params.clone();
        let function = Function { params: shape, ..function_of(name, params, kind, body, span) };
        self.lower(id, &function);
    }
}

/// A function with these parameters and this body.
fn function_of(name: Symbol, params: &[Symbol], kind: FnKind, body: Expr, span: Span) -> Function {
    let var = |name: &Symbol| Var { name: *name, span, assigned: None, captured: None };
    Function {
        name,
        kind,
        params: Params { names: params.to_vec(), required: params.len() as u8, ..Params::default() },
        inputs: (0..params.len() as u32).map(|at| (VarId(at), None)).collect(),
        captures: Vec::new(),
        vars: params.iter().map(var).collect(),
        body: vec![body],
        span,
    }
}
