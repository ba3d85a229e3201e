//! What kind of value something is, and what is in it.

use compiler::module::{Found, Meaning};
use pleach::Session;
use vm::code::FnId;
use vm::print::Printer;
use vm::value::{Imm, Obj, Symbol, Value};

use crate::cli::doc;

/// How many parts are shown.
const MOST_PARTS: usize = 10;

/// A value in a few lines: its type, then what people want to know of such a value.
pub fn describe(session: &Session, value: &Value) -> String {
    let mut text = String::new();
    let headline = |size: Option<(usize, &str)>| match size {
        Some((n, what)) => format!("{}, {}\n", value.type_name(), crate::cli::count(n, what)),
        None => format!("{}\n", value.type_name()),
    };
    match value {
        Value::Imm(Imm::Function(id)) => text += &function(session, *id),
        Value::Imm(Imm::Native(id)) => {
            let name = session.machine.program.natives.get(id.at()).map_or("", |native| native.name);
            text += &named(session, Symbol::from(name));
        }
        Value::Imm(_) => text += &headline(None),
        Value::Obj(obj) => match &**obj {
            Obj::Str(string) => text += &headline(Some((string.chars().count(), "character"))),
            Obj::Pair(..) => {
                let items: Vec<&Value> = value.iter().collect();
                text += &headline(Some((items.len(), "element")));
                text += &parts(
                    session,
                    items.iter().enumerate().map(|(at, item)| (at.to_string(), *item)),
                    items.len(),
                );
            }
            Obj::Vector(items) => {
                text += &headline(Some((items.len(), "element")));
                text += &parts(
                    session,
                    items.iter().enumerate().map(|(at, item)| (at.to_string(), item)),
                    items.len(),
                );
            }
            Obj::Map(map) => {
                let entries = map.iter().map(|(key, value)| (brief(session, key), value));
                text += &format!(
                    "{}, {}\n",
                    value.type_name(),
                    if map.len() == 1 { "1 entry".into() } else { format!("{} entries", map.len()) }
                );
                text += &parts(session, entries, map.len());
            }
            Obj::Desc(desc) => {
                let properties: Vec<_> = desc.properties().collect();
                text += &format!(
                    "description of {} {}\n",
                    if desc.kind.starts_with(['a', 'o']) { "an" } else { "a" },
                    desc.kind
                );
                text += &parts(
                    session,
                    properties.iter().map(|(key, value)| (key.to_string(), *value)),
                    properties.len(),
                );
            }
            Obj::Failure(failure) => {
                text += &format!("failure of type {}\n", failure.name);
                text += &parts(
                    session,
                    failure.fields.iter().map(|(key, value)| (key.to_string(), value)),
                    failure.fields.len(),
                );
                if let Some(place) = failure.place {
                    text += &format!("  raised at {}\n", session.files.show(place));
                }
            }
            Obj::Closure(id, captured) => {
                text += &function(session, *id);
                text += &format!("  with {}\n", crate::cli::count(captured.len(), "captured value"));
            }
            Obj::Tree(tree) => text += &format!("tree: {}\n", vm::show::safe(&tree.summary())),
            Obj::Path(path) => {
                text += &format!(
                    "path, {}\n  {}\n",
                    crate::cli::count(path.steps.len(), "step"),
                    vm::show::safe(&path.show())
                )
            }
            _ => text += &headline(None),
        },
    }
    text
}

/// The first parts, a line for each.
fn parts<'v>(session: &Session, parts: impl Iterator<Item = (String, &'v Value)>, all: usize) -> String {
    let line = |(name, value): (String, &Value)| format!("  {name}: {}\n", brief(session, value));
    let mut text: String = parts.take(MOST_PARTS).map(line).collect();
    if all > MOST_PARTS {
        text += &format!("  … {} more\n", all - MOST_PARTS);
    }
    text
}

fn brief(session: &Session, value: &Value) -> String {
    Printer::new(Some(&session.machine.program), true, 70).text(value)
}

/// A function by its name, with its documentation; one without a name by its parameters.
fn function(session: &Session, id: FnId) -> String {
    let Some(it) = session.machine.program.functions.get(id.at()) else { return String::new() };
    let known = session.front.home(id).and_then(|home| session.front.modules.get(home).names.get(&it.name));
    let same = known.filter(|definition| {
        matches!(definition.meaning, Meaning::Function(f, _) | Meaning::Plan(f, _) | Meaning::Open(f, _) | Meaning::Macro(f, _) if f == id)
    });
    match same {
        Some(definition) => {
            let doc = doc::indented(definition.doc.as_deref());
            format!("{}: {}\n{doc}", definition.meaning.words(), doc::signature(it.name, definition))
        }
        None => format!("a {}: {} {}\n", it.kind.word(), it.name, compiler::show_params(&it.params)),
    }
}

/// A native, by the name that the library gives it.
fn named(session: &Session, name: Symbol) -> String {
    match session.front.modules.look_up(session.module, name) {
        Found::One(definition) => {
            let doc = doc::indented(definition.doc.as_deref());
            format!("{}: {}\n{doc}", definition.meaning.words(), doc::signature(name, &definition))
        }
        _ => format!("a function: {name}\n"),
    }
}
