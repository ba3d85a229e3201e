//! What names mean: for `pleach doc` and for `:doc` in the REPL.

use std::path::PathBuf;

use clap::Args;
use compiler::module::{Definition, Found, Meaning, ModuleId, is_private, nearest, predicate_key};
use pleach::{Options, Session};
use vm::failure::{FailureType, TypeId};
use vm::value::Symbol;

use super::{Answer, Trouble, files, term};

pub const HELP: &str = "\
Examples:
  pleach doc dolist                 a special form
  pleach doc map                    a function of the library
  pleach doc list                   a function, and a module with all its names
  pleach doc type-error             a type of failures
  pleach doc greet hello.plan       a plan of a file
  pleach doc                        all modules and all special forms";

/// `pleach doc`
#[derive(Args)]
pub struct Doc {
    /// The name of a special form, function, plan, macro, constant, module or type of failures
    name: Option<String>,
    /// Look in this file first
    file: Option<PathBuf>,
}

/// Shows what a name means.
pub fn run(it: &Doc) -> Answer {
    let mut session = Session::new(Options { style: term::error_style(), ..Options::default() });
    if let Some(path) = &it.file {
        let loaded = session.load_file(path).map_err(|why| files::unreadable(path, why))?;
        loaded.reports.iter().for_each(|report| term::complain(&session.report(report)));
    }
    match &it.name {
        Some(name) => {
            // Words of the world are there for those who use it: looked at when nothing else has the name.
            let said = page(&session, name).or_else(|unknown| {
                session.extend("the library", "(use world)");
                page(&session, name).map_err(|_| unknown)
            });
            term::say(&said?);
        }
        None => term::say(&overview(&session)),
    }
    Ok(0)
}

/// All that a name means, or what is called nearly so.
pub fn page(session: &Session, name: &str) -> Result<String, Trouble> {
    let mut parts = Vec::new();
    if let Some((_, shape)) = compiler::special_forms().iter().find(|(known, _)| *known == name) {
        let doc = compiler::special_form_doc(name);
        parts.push(format!("{shape}\n  a special form\n{}", indented(doc)));
    }
    if let Some((_, shape)) = compiler::goal_forms().iter().find(|(known, _)| *known == name) {
        parts.push(format!("{shape}\n  a goal of rules and queries\n"));
    }
    let symbol = Symbol::from(name);
    if let Found::One(definition) = session.front.modules.look_up(session.module, symbol) {
        parts.push(definition_page(session, symbol, &definition));
    } else if let Some(id) = session.machine.program.failures.find(symbol) {
        parts.push(failure_page(session, id));
    }
    for key in session.front.modules.visible(session.module) {
        let has_name = predicate_key(key).is_some_and(|(known, _)| known == name);
        if let Found::One(definition) = session.front.modules.look_up(session.module, key)
            && has_name
        {
            parts.push(definition_page(session, key, &definition));
        }
    }
    if let Some(id) = session.front.modules.find(name) {
        parts.push(module_page(session, id));
    }
    if parts.is_empty() {
        return Err(unknown(session, name));
    }
    Ok(parts.join("\n"))
}

fn unknown(session: &Session, name: &str) -> Trouble {
    let visible = session.front.modules.visible(session.module);
    let failures = session.machine.program.failures.iter().map(|it| it.name);
    let modules = session.front.modules.iter().map(|(_, module)| module.name.as_str());
    let forms = compiler::special_forms().iter().chain(compiler::goal_forms());
    let words = forms.map(|(name, _)| *name).chain(modules);
    let bare = |name: &Symbol| predicate_key(*name).map_or(*name, |(name, _)| Symbol::from(name));
    let names: Vec<Symbol> = visible.iter().map(bare).chain(failures).collect();
    let help = match nearest(name, names.iter().map(|name| name.as_str()).chain(words)) {
        Some(near) => format!("did you mean `{near}`?"),
        None => {
            "`pleach doc` lists modules and special forms; `pleach doc MODULE` lists the names of a module"
                .into()
        }
    };
    Trouble::new(format!("nothing is called `{}`", vm::show::safe(name)), help)
}

fn definition_page(session: &Session, name: Symbol, definition: &Definition) -> String {
    if let Meaning::Failure(id) = definition.meaning {
        return failure_page(session, id);
    }
    let home = home(session, name, definition);
    let prelude = home.filter(|id| session.front.modules.prelude.contains(id));
    let span = definition.span;
    let whence = match prelude {
        Some(id) => format!(" of the module {}", session.front.modules.get(id).name),
        None if span == grammar::Span::default() => String::new(),
        None => format!(
            ", defined at {}",
            session.files.show(vm::Place { file: span.file.0, start: span.start, end: span.end })
        ),
    };
    format!(
        "{}\n  {}{whence}\n{}",
        signature(name, definition),
        definition.meaning.words(),
        indented(definition.doc.as_deref())
    )
}

/// `(name params…)` of what can be called, else the name.
pub fn signature(name: Symbol, definition: &Definition) -> String {
    let name = match (&definition.meaning, predicate_key(name)) {
        (Meaning::Predicate(_, params), Some(_)) if params.names.is_empty() && params.required > 0 => name,
        (Meaning::Predicate(..), Some((name, _))) => Symbol::from(name),
        _ => name,
    };
    match definition.meaning.params() {
        Some(params) => match compiler::show_params(params).get(1..) {
            None | Some(")") => format!("({name})"),
            Some(params) => format!("({name} {params}"),
        },
        None => name.to_string(),
    }
}

/// The module that a definition stands in.
fn home(session: &Session, name: Symbol, definition: &Definition) -> Option<ModuleId> {
    let inner = name.rsplit('/').next().map(Symbol::from).unwrap_or(name);
    let same = |known: &&Definition| known.span == definition.span && known.meaning == definition.meaning;
    let has = |name| {
        session
            .front
            .modules
            .iter()
            .find(|(_, it)| it.names.get(&name).filter(same).is_some())
            .map(|(id, _)| id)
    };
    has(name).or_else(|| has(inner))
}

/// A docstring, its lines two columns in, whatever their place in the source was.
pub fn indented(doc: Option<&str>) -> String {
    doc.into_iter().flat_map(str::lines).map(|line| format!("  {}\n", line.trim())).collect()
}

fn failure_page(session: &Session, id: TypeId) -> String {
    let types = &session.machine.program.failures;
    let Some(it) = types.get(id) else { return String::new() };
    let parents = ancestors(session, it);
    let below = if parents.is_empty() { String::new() } else { format!(", below {}", parents.join(", ")) };
    let fields: Vec<&str> = it.fields.iter().map(|field| field.as_str()).collect();
    let children: Vec<&str> =
        types.iter().filter(|other| other.parents.contains(&id)).map(|other| other.name.as_str()).collect();
    let mut page = format!("{}\n  a type of failures{below}\n{}", it.name, indented(it.doc.as_deref()));
    if !fields.is_empty() {
        page += &format!("  fields: {}\n", fields.join(" "));
    }
    if !children.is_empty() {
        page += &format!("  types below it: {}\n", children.join(" "));
    }
    page
}

/// The names of the types above a type, nearest first.
fn ancestors(session: &Session, it: &FailureType) -> Vec<String> {
    let types = &session.machine.program.failures;
    let mut names: Vec<String> = Vec::new();
    let mut todo: std::collections::VecDeque<TypeId> = it.parents.iter().copied().collect();
    while let Some(parent) = todo.pop_front().and_then(|id| types.get(id)) {
        if !names.iter().any(|name| parent.name == name.as_str()) {
            names.push(parent.name.to_string());
            todo.extend(&parent.parents);
        }
    }
    names
}

fn module_page(session: &Session, id: ModuleId) -> String {
    let module = session.front.modules.get(id);
    let mut page = format!("module {}\n{}", module.name, indented(module.doc.as_deref()));
    let mut names: Vec<_> = module.names.iter().filter(|(name, _)| !is_private(**name)).collect();
    names.sort_by_key(|(name, _)| name.as_str());
    for (name, definition) in names {
        page += &format!("  {}\n", brief(&signature(*name, definition), definition.doc.as_deref()));
    }
    page
}

/// A name with the first sentence about it.
fn brief(what: &str, doc: Option<&str>) -> String {
    let line = doc.and_then(|doc| doc.lines().next()).unwrap_or_default();
    let sentence = line.split_inclusive(['.', ';']).next().unwrap_or_default().trim_end_matches(['.', ';']);
    format!("{what:34} {sentence}").trim_end().to_string()
}

fn overview(session: &Session) -> String {
    let mut text = String::from("Modules, whose names every file sees:\n");
    for id in &session.front.modules.prelude {
        let module = session.front.modules.get(*id);
        text += &format!("  {:12} {}\n", module.name, brief("", module.doc.as_deref()).trim());
    }
    text += "\nModules of the world, for files that say so with `(use world)`:\n";
    for (name, _) in world::MODULES {
        text += &format!("  {name}\n");
    }
    text += "\nSpecial forms:\n";
    for (_, shape) in compiler::special_forms() {
        text += &format!("  {shape}\n");
    }
    text += "\nGoals of rules and queries:\n";
    for (_, shape) in compiler::goal_forms() {
        text += &format!("  {shape}\n");
    }
    text + "\n`pleach doc NAME` says more about each of them.\n"
}
