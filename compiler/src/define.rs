//! Definitions: the top level of files.

use grammar::{FileId, Form, FormKind, Span};
use vm::code::{FnId, FnKind, GlobalId, Params};
use vm::value::{Symbol, Value};

use crate::ast::{Callee, Expr, ExprKind, Function, VarId};
use crate::data::{Places, move_to, to_form};
use crate::error::CompileError;
use crate::module::{Definition, Meaning, ModuleId, Use, predicate_key};
use crate::resolve::{ParamForms, Scope, special};
use crate::rules::declare::{self, Group};
use crate::{Compiler, Loader, Pending, Report, Source};

/// What compiling a text gave.
#[derive(Debug, Default)]
pub struct Loaded {
    /// Functions to be run once, in this order: constants and top-level forms.
    pub init: Vec<FnId>,
    /// What is wrong with the text. It must not be run unless these are warnings only.
    pub reports: Vec<Report>,
}

/// The heads of definitions.
const DEFINITIONS: &[&str] = &[
    "def-fun",
    "def-plan",
    "def-const",
    "def-macro",
    "def-failure",
    "def-native",
    "def-open-fun",
    "extend",
    "def-test",
    "def-variant",
];

/// A top-level form that does something when the file is loaded.
enum Init {
    Const(FnId),
    Form(Form, Vec<ModuleId>),
}

/// Work on one text.
pub(crate) struct Text {
    pub(crate) module: ModuleId,
    /// Definitions may replace earlier ones, as in a REPL.
    pub(crate) again: bool,
    init: Vec<Init>,
    functions: Vec<FnId>,
    /// Functions that are defined again with other parameters, or as a plan.
    changed: Vec<FnId>,
    /// Rules and facts whose predicates are not declared yet, with the modules of the macros around them.
    pub(crate) rules: Vec<(Form, Vec<ModuleId>)>,
    /// Rules and facts whose clauses are not resolved yet.
    pub(crate) groups: Vec<Group>,
    /// Variants of plans that may stand further down, with the modules of the macros around them.
    variants: Vec<(Form, Vec<ModuleId>)>,
}

impl Compiler<'_> {
    /// Loads a file as a module, unless it has been loaded.
    pub(crate) fn file(&mut self, loader: &mut dyn Loader, source: &Source) -> Vec<FnId> {
        let name = source.key.clone();
        let module = self.modules.add(short_name(&name));
        self.loaded.insert(source.key.clone(), module);
        self.loading.push(source.key.clone());
        let init = self.text(loader, module, source.file, &source.text, false);
        self.loading.pop();
        init
    }

    /// Compiles a text for a module. The functions to be run once, used modules first.
    pub(crate) fn text(
        &mut self,
        loader: &mut dyn Loader,
        module: ModuleId,
        file: FileId,
        text: &str,
        again: bool,
    ) -> Vec<FnId> {
        let parsed = grammar::parse(file, text);
        // Where a string or comment has no end, the words after it mean nothing.
        let is_garbled = parsed.errors.iter().any(|error| {
            use grammar::ParseError as E;
            matches!(error, E::UnclosedString { .. } | E::UnclosedSymbol { .. } | E::UnclosedComment { .. })
        });
        self.reports.extend(parsed.errors.into_iter().map(Report::Parse));
        if is_garbled {
            return Vec::new();
        }
        let mut init = Vec::new();
        let mut work = Text {
            module,
            again,
            init: Vec::new(),
            functions: Vec::new(),
            changed: Vec::new(),
            rules: Vec::new(),
            groups: Vec::new(),
            variants: Vec::new(),
        };
        let mut forms = Vec::new();
        for form in parsed.forms {
            match form.head().as_ref().map(|head| head.as_str()) {
                Some("module") => self.module_head(module, &form),
                Some("use") => init.extend(self.use_(loader, module, &form)),
                Some("use-rules") => forms.extend(self.use_rules(loader, &form)),
                _ => forms.push(form),
            }
        }
        let mut declared = Vec::new();
        for form in &forms {
            let at_once = is_definition(form);
            declared.push(at_once);
            if at_once {
                self.declare_form(&mut work, form);
            }
        }
        self.declare_groups(&mut work);
        for (form, declared) in forms.into_iter().zip(declared) {
            if !declared {
                self.top_form(&mut work, form, 0);
            }
        }
        self.declare_groups(&mut work);
        for (form, within) in std::mem::take(&mut work.variants) {
            self.within = within;
            self.def_variant(&mut work, &form);
            self.within.clear();
        }
        for id in std::mem::take(&mut work.functions) {
            self.compile(id);
        }
        self.compile_callers(&std::mem::take(&mut work.changed));
        self.texts += 1;
        for group in std::mem::take(&mut work.groups) {
            self.resolve_group(&group, self.texts);
        }
        init.extend(self.inits(&mut work, file));
        self.close_opens();
        init
    }

    // ------------------------------------------------------------------ modules

    fn module_head(&mut self, module: ModuleId, form: &Form) {
        let items = form.list().unwrap_or_default();
        let Some((name, doc)) = one_with_doc(items.get(1..).unwrap_or_default()) else {
            return self.misshapen_top(form, "takes a name and perhaps a text");
        };
        match name.symbol() {
            Some(name) => {
                let module = self.modules.get_mut(module);
                module.name = name.to_string();
                module.doc = doc;
            }
            None => self.misshapen_top(form, "needs a symbol as name"),
        }
    }

    fn use_(&mut self, loader: &mut dyn Loader, module: ModuleId, form: &Form) -> Vec<FnId> {
        let items = form.list().unwrap_or_default();
        let is_name = |item: &&Form| matches!(item.kind, FormKind::Symbol(_) | FormKind::Str(_));
        let names: Vec<&Form> = items[1..].iter().take_while(is_name).collect();
        if names.is_empty() {
            self.misshapen_top(form, "needs the name of a module, or a file as a string");
        }
        let (mut prefix, mut only) = (None, None);
        for pair in items[1 + names.len()..].chunks(2) {
            match pair {
                [Form { kind: FormKind::Keyword(key), .. }, value]
                    if *key == "as" && value.symbol().is_some() =>
                {
                    prefix = value.symbol();
                }
                [Form { kind: FormKind::Keyword(key), .. }, value]
                    if *key == "only" && value.list().is_some() =>
                {
                    only = value.list().map(|names| names.iter().filter_map(Form::symbol).collect());
                }
                _ => {
                    let problem = "takes `:as prefix` and `:only (names…)` after the names of modules";
                    self.misshapen_top(form, problem);
                    break;
                }
            }
        }
        let mut init = Vec::new();
        for item in names {
            let name = match &item.kind {
                FormKind::Str(path) => path.to_string(),
                _ => item.symbol().unwrap_or_default().to_string(),
            };
            if let Some((used, functions)) = self.find_module(loader, &name, form.span.file, item.span) {
                init.extend(functions);
                self.check_only(used, &items[1..]);
                let uses = Use { module: used, prefix, only: only.clone() };
                self.modules.get_mut(module).uses.push(uses);
            }
        }
        init
    }

    /// `(use-rules "file.pl")`: the definitions that Prolog text is read as.
    fn use_rules(&mut self, loader: &mut dyn Loader, form: &Form) -> Vec<Form> {
        let items = form.list().unwrap_or_default();
        let [_, Form { kind: FormKind::Str(name), span: at }] = items else {
            self.misshapen_top(form, "takes the name of a file as a string");
            return Vec::new();
        };
        match loader.load(name, form.span.file) {
            Ok(source) => {
                let parsed = grammar::prolog::parse(source.file, short_name(name), &source.text);
                self.reports.extend(parsed.errors.into_iter().map(Report::Parse));
                parsed.forms
            }
            Err(help) => {
                self.error(CompileError::ModuleMissing { name: name.to_string(), at: *at, help: Some(help) });
                Vec::new()
            }
        }
    }

    /// Names after `:only` must be there.
    fn check_only(&mut self, used: ModuleId, items: &[Form]) {
        let is_only = |item: &Form| matches!(&item.kind, FormKind::Keyword(key) if *key == "only");
        let Some(list) = items.iter().position(is_only).and_then(|at| items.get(at + 1)) else { return };
        for item in list.list().unwrap_or_default() {
            let Some(name) = item.symbol() else { continue };
            let module = self.modules.get(used);
            let is_predicate = |key: &Symbol| predicate_key(*key).is_some_and(|(known, _)| name == known);
            let is_known = module.names.contains_key(&name) || module.names.keys().any(is_predicate);
            if is_known && !crate::module::is_private(name) {
                continue;
            }
            let near = crate::module::nearest(&name, module.names.keys().map(|name| name.as_str()));
            let help = match near {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("the module `{}` does not define it", module.name),
            };
            self.error(CompileError::UnknownName { name: name.to_string(), at: item.span, help: Some(help) });
        }
    }

    fn find_module(
        &mut self,
        loader: &mut dyn Loader,
        name: &str,
        from: FileId,
        at: Span,
    ) -> Option<(ModuleId, Vec<FnId>)> {
        let source = match loader.load(name, from) {
            Ok(source) => source,
            Err(help) => {
                self.error(CompileError::ModuleMissing { name: name.into(), at, help: Some(help) });
                return None;
            }
        };
        if source.library {
            self.program.library.insert(source.file.0);
        }
        if let Some(start) = self.loading.iter().position(|key| *key == source.key) {
            let mut chain: Vec<&str> = self.loading[start..].iter().map(|key| short_name(key)).collect();
            chain.push(short_name(&source.key));
            let chain = chain.join(" uses ");
            self.error(CompileError::ModuleCycle { name: name.into(), chain, at });
            return None;
        }
        if let Some(module) = self.loaded.get(&source.key) {
            return Some((*module, Vec::new()));
        }
        let init = self.file(loader, &source);
        let module = *self.loaded.get(&source.key)?;
        Some((module, init))
    }

    pub(crate) fn misshapen_top(&mut self, form: &Form, problem: &str) {
        let name = form.head().unwrap_or_default();
        let shape = special::SHAPES.iter().find(|(known, _)| name == *known).map_or("", |(_, shape)| shape);
        let (problem, shape, form_name) = (problem.into(), shape.into(), name.to_string());
        self.error(CompileError::Shape { form: form_name, problem, shape, at: form.span });
    }

    // ------------------------------------------------------------------ definitions

    /// A form that is no definition as it stands: an expression, or a macro that makes some.
    fn top_form(&mut self, work: &mut Text, form: Form, level: usize) {
        if is_definition(&form) {
            return self.declare_form(work, &form);
        }
        if form.head().is_some_and(|head| head == "seq") && level > 0 {
            // Macros define several things with `seq`.
            for part in form.list().unwrap_or_default().iter().skip(1) {
                self.top_form(work, part.clone(), level);
            }
            return;
        }
        let name = form.head().unwrap_or_default();
        let meaning = match self.look_up(work.module, name) {
            crate::module::Found::One(definition) => Some(definition.meaning),
            _ => None,
        };
        if let Some(Meaning::Macro(function, params)) = meaning {
            if let Some(expansion) = self.expand(name, function, &params, &form) {
                self.within.push(self.home(function).unwrap_or(work.module));
                self.top_form(work, expansion, level + 1);
                self.within.pop();
            }
            return;
        }
        work.init.push(Init::Form(form, self.within.clone()));
    }

    fn declare_form(&mut self, work: &mut Text, form: &Form) {
        let items = form.list().unwrap_or_default();
        let head = form.head().unwrap_or_default();
        if declare::DEFINITIONS.contains(&head.as_str()) {
            return self.declare_rules(work, form);
        }
        let Some(name) = items.get(1).and_then(Form::symbol) else {
            return self.misshapen_top(form, "needs a symbol as name");
        };
        if matches!(name.as_str(), "nil" | "true" | "false") {
            return self.misshapen_top(form, "cannot define this name");
        }
        if let Some((_, shape)) = special::SHAPES.iter().find(|(known, _)| name == *known) {
            let (name, shape, at) = (name.to_string(), (*shape).to_string(), items[1].span);
            return self.error(CompileError::Reserved { name, shape, at });
        }
        let rest = &items[2..];
        match head.as_str() {
            "def-fun" => self.def_function(work, form, name, rest, FnKind::Function, Meaning::Function),
            "def-plan" => self.def_function(work, form, name, rest, FnKind::Plan, Meaning::Plan),
            "def-macro" => self.def_function(work, form, name, rest, FnKind::Function, Meaning::Macro),
            "def-const" => self.def_const(work, form, name, rest),
            "def-failure" => self.def_failure(work, form, name, rest),
            "def-native" => self.def_native(work, form, name, rest),
            "def-open-fun" => self.def_open(work, form, name, rest),
            "extend" => self.extend(work, form, name, rest),
            "def-variant" => work.variants.push((form.clone(), self.within.clone())),
            _ => self.def_test(work, form, name, rest),
        }
    }

    /// Adds a definition, or says that there is one. True if it holds now.
    fn define(
        &mut self,
        work: &Text,
        name: Symbol,
        meaning: Meaning,
        doc: Option<Box<str>>,
        form: &Form,
    ) -> bool {
        let span = form.list().and_then(|items| items.get(1)).map_or(form.span, |name| name.span);
        let known = self.modules.get(work.module).names.get(&name);
        if let Some(known) = known.filter(|_| !work.again) {
            let first = known.span;
            self.error(CompileError::Duplicate { name: name.to_string(), again: span, first });
            return false;
        }
        self.modules.get_mut(work.module).names.insert(name, Definition { meaning, doc, span });
        true
    }

    fn def_function(
        &mut self,
        work: &mut Text,
        form: &Form,
        name: Symbol,
        rest: &[Form],
        kind: FnKind,
        meaning: fn(FnId, Params) -> Meaning,
    ) {
        let Some((params, body)) = rest.split_first() else {
            return self.misshapen_top(form, "has no parameters");
        };
        let params = self.param_forms(params);
        let (doc, body) = split_doc(body);
        let shown = params.clone();
        self.define_function(work, form, name, Definable { params, shown, doc, body, kind, meaning });
    }

    fn define_function(&mut self, work: &mut Text, form: &Form, name: Symbol, it: Definable<'_>) {
        let Definable { params, shown, doc, body, kind, meaning } = it;
        // Redefined in a REPL: those who call it call the new one.
        let known = self.modules.get(work.module).names.get(&name).map(|known| known.meaning.clone());
        let id = match known {
            Some(Meaning::Function(id, _) | Meaning::Plan(id, _) | Meaning::Macro(id, _)) if work.again => id,
            _ => self.declare(name, kind, work.module),
        };
        if !self.define(work, name, meaning(id, params.params.clone()), doc, form) {
            return;
        }
        let (module, body, span) = (work.module, body.to_vec(), form.span);
        let proto = &mut self.program.functions[id.at()];
        let known = proto.place != Default::default();
        if known && (proto.kind, &proto.params) != (kind, &params.params) {
            work.changed.push(id);
        }
        (proto.kind, proto.params) = (kind, params.params.clone());
        if kind == FnKind::Plan {
            self.plan_params.insert(id, shown);
        }
        let within = self.within.clone();
        self.pending.insert(id, Pending { module, name, kind, params, body, span, within, defines: None });
        work.functions.push(id);
    }

    /// `(def-variant name (:of plan) "doc" (places …) (between …)… edit…)`: two functions. One gives the plan, the places
    /// and the edits; the other one, a plan with the same parameters, calls the plan with these.
    fn def_variant(&mut self, work: &mut Text, form: &Form) {
        let items = form.list().unwrap_or_default();
        let Some(name) = items.get(1).and_then(Form::symbol) else { return };
        let of = items.get(2).and_then(Form::list).unwrap_or_default();
        let (plan, plan_name) = match of {
            [Form { kind: FormKind::Keyword(key), .. }, plan] if *key == "of" && plan.symbol().is_some() => {
                (plan, plan.symbol().unwrap_or_default())
            }
            _ => return self.misshapen_top(form, "needs `(:of plan)` after its name"),
        };
        let id = match self.modules.look_up(work.module, plan_name) {
            crate::module::Found::One(Definition { meaning: Meaning::Plan(id, _), .. }) => id,
            crate::module::Found::One(definition) => {
                let (is, wanted) = (definition.meaning.words().into(), "a plan".into());
                let (name, at) = (plan_name.to_string(), plan.span);
                return self.error(CompileError::WrongKind { name, is, wanted, at, help: None });
            }
            _ => {
                let (name, at) = (plan_name.to_string(), plan.span);
                return self.error(CompileError::UnknownName { name, at, help: None });
            }
        };
        let Some(shown) = self.plan_params.get(&id).cloned() else { return };
        let (doc, rest) = match &items[3..] {
            [Form { kind: FormKind::Str(doc), .. }] => (Some(doc.clone()), &items[4..]),
            rest => split_doc(rest),
        };
        let (mut places, mut between, mut edits) = (Vec::new(), Vec::new(), Vec::new());
        for part in rest {
            match part.head().as_ref().map(|head| head.as_str()) {
                Some("places") => places.extend(part.list().unwrap_or_default().iter().skip(1)),
                Some("between") => between.push(part),
                Some(_) => edits.push(part.clone()),
                None => return self.misshapen_top(form, "is made of `(places …)`, `(between …)` and edits"),
            }
        }
        let at = |kind| Form { kind, span: form.span };
        let word = |word: &str| at(FormKind::Symbol(Symbol::from(word)));
        let rows = |forms: Vec<Form>| {
            at(FormKind::Prefixed(grammar::Prefix::Quasi, Box::new(at(FormKind::List(forms)))))
        };
        let places = places.into_iter().map(with_elements).collect();
        let between = between.into_iter().map(|row| {
            let items = row.list().unwrap_or_default().iter().skip(1).cloned();
            let row = Form { kind: FormKind::List(items.collect()), span: row.span };
            with_elements(&row)
        });
        let edits = std::iter::once(word("list")).chain(edits).collect();
        let parts = vec![
            word("list"),
            plan.clone(),
            rows(places),
            rows(between.collect()),
            at(FormKind::List(edits)),
        ];
        let parts_name = Symbol::from(&format!("%{name}-edits"));
        let parts = [at(FormKind::List(vec![])), at(FormKind::List(parts))];
        self.def_function(work, form, parts_name, &parts, FnKind::Function, Meaning::Function);
        let get = at(FormKind::List(vec![at(FormKind::Symbol(parts_name))]));
        let body = [at(FormKind::List(vec![word("%call-variant"), get]))];
        let tree = self.modules.prelude.iter().copied().find(|it| self.modules.get(*it).name == "tree");
        self.within.extend(tree);
        let (params, kind) = (shown.without_defaults(), FnKind::Plan);
        let it = Definable { params, shown, doc, body: &body, kind, meaning: Meaning::Plan };
        self.define_function(work, form, name, it);
    }

    fn def_const(&mut self, work: &mut Text, form: &Form, name: Symbol, rest: &[Form]) {
        let Some((value, doc)) = one_with_doc(rest) else {
            return self.misshapen_top(form, "takes a value and perhaps a text");
        };
        // Defined again in a REPL: those who read it read the new value.
        let known = self.modules.get(work.module).names.get(&name).map(|known| known.meaning.clone());
        let known =
            known.and_then(|meaning| if let Meaning::Const(global) = meaning { Some(global) } else { None });
        let global = known.filter(|_| work.again).unwrap_or(GlobalId(self.program.globals.len() as u32));
        if self.define(work, name, Meaning::Const(global), doc, form) {
            if global.at() == self.program.globals.len() {
                self.program.globals.push(name);
            }
            let id = self.declare(name, FnKind::TopLevel, work.module);
            let (module, kind, params, span) =
                (work.module, FnKind::TopLevel, ParamForms::default(), value.span);
            let (body, within) = (vec![value.clone()], self.within.clone());
            let pending = Pending { module, name, kind, params, body, span, within, defines: Some(global) };
            self.pending.insert(id, pending);
            self.constants.insert(global, id);
            work.init.push(Init::Const(id));
        }
    }

    fn def_failure(&mut self, work: &mut Text, form: &Form, name: Symbol, rest: &[Form]) {
        let (lists, doc) = match rest {
            [lists @ .., Form { kind: FormKind::Str(doc), .. }] => (lists, Some(doc.clone())),
            lists => (lists, None),
        };
        let list_of = |form: &Form| match form.list() {
            Some(items) => items.iter().map(Form::symbol).collect::<Option<Vec<Symbol>>>(),
            None => form.is("nil").then(Vec::new),
        };
        let (parents, fields) = match lists {
            [] => (Some(Vec::new()), Some(Vec::new())),
            [parents] => (list_of(parents), Some(Vec::new())),
            [parents, fields] => (list_of(parents), list_of(fields)),
            _ => (None, None),
        };
        let (Some(parents), Some(fields)) = (parents, fields) else {
            return self.misshapen_top(form, "takes a list of parents and a list of fields");
        };
        let scope = Scope::new(work.module, FnKind::TopLevel);
        let parent_forms = lists.first().and_then(Form::list).unwrap_or_default();
        let mut ids: Vec<_> =
            parent_forms.iter().filter_map(|parent| special::failure_type(self, &scope, parent)).collect();
        if ids.len() < parents.len() {
            return;
        }
        if ids.is_empty() {
            ids.push(vm::Builtin::PlanFailure.id());
        }
        let known = self.modules.get(work.module).names.get(&name).map(|known| known.meaning.clone());
        let id = match known {
            Some(Meaning::Failure(id)) if work.again => {
                self.program.failures.define_again(id, name, ids, fields, doc.clone());
                id
            }
            _ => self.program.failures.define(name, ids, fields, doc.clone()),
        };
        self.define(work, name, Meaning::Failure(id), doc, form);
    }

    fn def_native(&mut self, work: &mut Text, form: &Form, name: Symbol, rest: &[Form]) {
        let Some((params, doc)) = rest.split_first() else {
            return self.misshapen_top(form, "has no parameters");
        };
        let params = self.param_forms(params).params;
        let doc = match doc {
            [Form { kind: FormKind::Str(doc), .. }] => Some(doc.clone()),
            [] => None,
            _ => return self.misshapen_top(form, "takes parameters and a text"),
        };
        match self.program.native(&name) {
            Some(native) => drop(self.define(work, name, Meaning::Native(native, params), doc, form)),
            None => self.error(CompileError::NoSuchNative { name: name.to_string(), at: form.span }),
        }
    }

    fn def_test(&mut self, work: &mut Text, form: &Form, name: Symbol, rest: &[Form]) {
        let (doc, body) = split_doc(rest);
        let id = self.declare(name, FnKind::TopLevel, work.module);
        if self.define(work, name, Meaning::Test(id), doc, form) {
            let (module, kind, params, span) =
                (work.module, FnKind::TopLevel, ParamForms::default(), form.span);
            let within = self.within.clone();
            self.pending.insert(
                id,
                Pending { module, name, kind, params, body: body.to_vec(), span, within, defines: None },
            );
            work.functions.push(id);
        }
    }

    // ------------------------------------------------------------------ open functions

    fn def_open(&mut self, work: &mut Text, form: &Form, name: Symbol, rest: &[Form]) {
        let Some((params, doc)) = rest.split_first() else {
            return self.misshapen_top(form, "has no parameters");
        };
        let params = self.param_forms(params).params;
        let doc = match doc {
            [Form { kind: FormKind::Str(doc), .. }] => Some(doc.clone()),
            [] => None,
            _ => {
                return self
                    .misshapen_top(form, "takes parameters and a text; clauses are added with `extend`");
            }
        };
        let id = self.declare(name, FnKind::Function, work.module);
        if self.define(work, name, Meaning::Open(id, params.clone()), doc, form) {
            self.program.functions[id.at()].params = params;
            self.opens.insert(id, Vec::new());
            if name == "ground" && self.program.ground.is_none() {
                self.program.ground = Some(id);
            }
        }
    }

    fn extend(&mut self, work: &mut Text, form: &Form, name: Symbol, rest: &[Form]) {
        let Some((params, body)) = rest.split_first() else {
            return self.misshapen_top(form, "has no parameters");
        };
        let span = form.list().map_or(form.span, |items| items[1].span);
        let (open, wanted) = match self.modules.look_up(work.module, name) {
            crate::module::Found::One(Definition { meaning: Meaning::Open(open, wanted), .. }) => {
                (open, wanted)
            }
            crate::module::Found::One(definition) => {
                let (is, wanted) = (definition.meaning.words().into(), "an open function".into());
                return self.error(CompileError::WrongKind {
                    name: name.to_string(),
                    is,
                    wanted,
                    at: span,
                    help: None,
                });
            }
            _ => {
                let help = Some(format!("declare it: (def-open-fun {name} (…))"));
                return self.error(CompileError::UnknownName { name: name.to_string(), at: span, help });
            }
        };
        let params = self.param_forms(params);
        if params.params.names.len() != wanted.names.len() || params.params.required != wanted.required {
            return self.arity(name, &wanted, params.params.names.len(), form.span);
        }
        let (_, body) = split_doc(body);
        let id = self.declare(name, FnKind::Function, work.module);
        let (module, kind, body, span) = (work.module, FnKind::Function, body.to_vec(), form.span);
        let within = self.within.clone();
        self.pending.insert(id, Pending { module, name, kind, params, body, span, within, defines: None });
        self.opens.entry(open).or_default().push(id);
        work.functions.push(id);
    }

    /// Gives each open function its body: the clauses, last first, until one does not give nil.
    fn close_opens(&mut self) {
        for (open, clauses) in self.opens.clone() {
            let proto = &self.program.functions[open.at()];
            let (name, params) = (proto.name, proto.params.clone());
            let span = Span::default();
            let vars: Vec<VarId> = (0..params.names.len() as u32).map(VarId).collect();
            let var = |name: &Symbol| crate::ast::Var { name: *name, span, assigned: None, captured: None };
            let call = |clause: &FnId| {
                let args = vars.iter().map(|var| Some(Expr::new(ExprKind::Var(*var), span))).collect();
                Expr::new(ExprKind::Call(Callee::Function(*clause), args), span)
            };
            let body = match clauses.is_empty() {
                true => Expr::nil(span),
                false => Expr::new(ExprKind::Or(clauses.iter().rev().map(call).collect()), span),
            };
            let function = Function {
                name,
                kind: FnKind::Function,
                vars: params.names.iter().map(var).collect(),
                inputs: vars.iter().map(|var| (*var, None)).collect(),
                params,
                captures: Vec::new(),
                body: vec![body],
                span,
            };
            self.references.insert(open, clauses);
            self.lower(open, &function);
        }
    }

    // ------------------------------------------------------------------ what runs at load

    /// Functions for the constants and forms of a text, in its order.
    fn inits(&mut self, work: &mut Text, file: FileId) -> Vec<FnId> {
        let mut functions = Vec::new();
        let mut forms: Vec<(Form, Vec<ModuleId>)> = Vec::new();
        for init in std::mem::take(&mut work.init) {
            match init {
                Init::Form(form, within) => forms.push((form, within)),
                Init::Const(id) => {
                    functions.extend(self.init_forms(work.module, &mut forms, file));
                    self.compile(id);
                    functions.push(id);
                }
            }
        }
        functions.extend(self.init_forms(work.module, &mut forms, file));
        functions
    }

    fn init_forms(
        &mut self,
        module: ModuleId,
        forms: &mut Vec<(Form, Vec<ModuleId>)>,
        file: FileId,
    ) -> Option<FnId> {
        let first = forms.first()?.0.span;
        let mut scope = Scope::new(module, FnKind::TopLevel);
        let mut body = Vec::new();
        for (form, within) in std::mem::take(forms) {
            self.within = within;
            body.push(self.expr(&mut scope, &form));
        }
        self.within.clear();
        let name = Symbol::from(vm::code::TOP_LEVEL);
        let id = self.declare(name, FnKind::TopLevel, module);
        self.init_function(scope, id, name, body, Span { file, ..first });
        Some(id)
    }

    /// The function that computes a constant.
    pub(crate) fn constant_function(
        &mut self,
        mut scope: Scope,
        name: Symbol,
        global: GlobalId,
        value: &Form,
    ) -> Function {
        let value = self.expr(&mut scope, value);
        let span = value.span;
        let define = Expr::new(ExprKind::Define(global, Box::new(value)), span);
        self.finish_function(scope, name, Params::default(), Vec::new(), vec![define], span)
    }

    fn init_function(&mut self, scope: Scope, id: FnId, name: Symbol, body: Vec<Expr>, span: Span) {
        let function = self.finish_function(scope, name, Params::default(), Vec::new(), body, span);
        self.lower(id, &function);
    }

    /// The code of an edit.
    pub(crate) fn edit(&mut self, form: &Value, module: ModuleId, plan: FnId, original: bool) -> FnId {
        let proto = &self.program.functions[plan.at()];
        let (name, names) = (proto.name, proto.params.names.clone());
        let place = proto.place;
        let span = Span { file: FileId(place.file), start: place.start, end: place.end };
        let id = self.declare(name, FnKind::Inserted, module);
        let mut code = match to_form(form, span, &Places::default()) {
            Ok(code) => code,
            Err(_) => {
                let (what, shape) = (vm::print::brief(form), "(replace path '(code …))".into());
                let (form, problem) = ("edit".into(), format!("has the code {what}, which is no form"));
                self.error(CompileError::Shape { form, problem, shape, at: span });
                return id;
            }
        };
        move_to(&mut code, span);
        // What was not given has its default in the code as in the plan, in whose module it stands.
        let params = self.plan_params.get(&plan).cloned();
        let params = params.unwrap_or_else(|| ParamForms::of_names(&names, span));
        let at_home = self.home(plan).unwrap_or(module);
        let scope = Scope::new(at_home, FnKind::Inserted).with_original(original);
        // As in an expansion, what means nothing where the edit is made means what it means there, too.
        self.within.push(at_home);
        let function = self.function_in(scope, module, name, &params, std::slice::from_ref(&code), span);
        self.within.clear();
        self.lower(id, &function);
        id
    }
}

/// A function or plan to be defined.
struct Definable<'f> {
    /// What its body sees.
    params: ParamForms,
    /// What its callers see.
    shown: ParamForms,
    doc: Option<Box<str>>,
    body: &'f [Form],
    kind: FnKind,
    meaning: fn(FnId, Params) -> Meaning,
}

/// The places of a variant as a template: what stands after `:for`, and paths, are computed.
fn with_elements(form: &Form) -> Form {
    let FormKind::List(items) = &form.kind else { return form.clone() };
    let mut is_element = false;
    let items = items.iter().map(|item| {
        let after =
            std::mem::replace(&mut is_element, matches!(&item.kind, FormKind::Keyword(key) if *key == "for"));
        let computed = (after && item.symbol().is_none()) || item.head().is_some_and(|head| head == "path");
        match computed {
            true => {
                let kind = FormKind::Prefixed(grammar::Prefix::Unquote, Box::new(item.clone()));
                Form { kind, span: item.span }
            }
            false => with_elements(item),
        }
    });
    Form { kind: FormKind::List(items.collect()), span: form.span }
}

/// What people call a file: its name without folders and ending.
fn short_name(key: &str) -> &str {
    let name = key.rsplit(['/', '\\']).next().unwrap_or(key);
    [".plan", ".pl"].into_iter().find_map(|end| name.strip_suffix(end)).unwrap_or(name)
}

fn is_definition(form: &Form) -> bool {
    let defines = |head: &str| DEFINITIONS.contains(&head) || declare::DEFINITIONS.contains(&head);
    form.head().is_some_and(|head| defines(&head))
}

/// A form, and the text after it, if there is one.
pub(crate) fn one_with_doc(forms: &[Form]) -> Option<(&Form, Option<Box<str>>)> {
    match forms {
        [form] => Some((form, None)),
        [form, Form { kind: FormKind::Str(doc), .. }] => Some((form, Some(doc.clone()))),
        _ => None,
    }
}

/// A text before other forms is the documentation.
fn split_doc(body: &[Form]) -> (Option<Box<str>>, &[Form]) {
    match body {
        [Form { kind: FormKind::Str(doc), .. }, rest @ ..] if !rest.is_empty() => (Some(doc.clone()), rest),
        _ => (None, body),
    }
}
