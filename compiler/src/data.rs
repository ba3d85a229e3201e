//! Forms as data and data as forms: what `quote` makes, what macros take and give.

use std::rc::Rc;

use grammar::{Form, FormKind, Prefix, Span};
use rustc_hash::FxHashMap;
use vm::value::{Imm, Obj, Symbol, Value};

/// Where lists that came from the source stand, so that a macro's expansion keeps the places of
/// its arguments. Lists are known by their address, which is theirs while the map lives.
#[derive(Default)]
pub struct Places {
    spans: FxHashMap<*const Obj, Span>,
    alive: Vec<Value>,
}

impl Places {
    fn note(&mut self, value: &Value, span: Span) {
        if let Value::Obj(obj) = value {
            self.spans.insert(Rc::as_ptr(obj), span);
            self.alive.push(value.clone());
        }
    }
    fn of(&self, value: &Value) -> Option<Span> {
        let Value::Obj(obj) = value else { return None };
        self.spans.get(&Rc::as_ptr(obj)).copied()
    }
}

/// The value of a quoted form.
pub fn to_value(form: &Form, places: &mut Places) -> Value {
    let value = match &form.kind {
        FormKind::Symbol(name) => return symbol(*name),
        FormKind::Keyword(name) => return Value::Imm(Imm::Keyword(*name)),
        FormKind::Int(i) => return Value::int(*i),
        FormKind::Float(f) => return Value::float(*f),
        FormKind::Str(text) => return Value::str(text.clone()),
        FormKind::List(items) => {
            Value::list(items.iter().map(|item| to_value(item, places)).collect::<Vec<_>>())
        }
        FormKind::Vector(items) => {
            Value::vector(items.iter().map(|item| to_value(item, places)).collect::<Vec<_>>())
        }
        FormKind::Map(pairs) => Value::map(
            pairs.iter().map(|(key, value)| (to_value(key, places), to_value(value, places))).collect(),
        ),
        FormKind::Prefixed(prefix, inner) => {
            Value::list([Value::symbol(prefix.name()), to_value(inner, places)])
        }
    };
    places.note(&value, form.span);
    value
}

/// nil, true and false are values, not names.
fn symbol(name: Symbol) -> Value {
    match name.as_str() {
        "nil" => Value::NIL,
        "true" => Value::TRUE,
        "false" => Value::FALSE,
        _ => Value::Imm(Imm::Symbol(name)),
    }
}

/// Why data is no form.
#[derive(Debug)]
pub enum NoForm {
    /// A value that cannot be written, in words.
    Value(String),
    /// Nested too deep, or too large.
    TooLarge,
}

/// How deep forms may nest.
pub const MOST_NESTED: usize = 1000;
/// How many parts an expansion may have.
const MOST_PARTS: usize = 5_000_000;

/// Data as a form. Parts without a place of their own stand at `span`.
///
/// # Errors
/// If a part is a value that has no form: a function, a tree.
pub fn to_form(value: &Value, span: Span, places: &Places) -> Result<Form, NoForm> {
    let mut parts = 0;
    form_of(value, span, places, 0, &mut parts)
}

fn form_of(
    value: &Value,
    span: Span,
    places: &Places,
    depth: usize,
    parts: &mut usize,
) -> Result<Form, NoForm> {
    *parts += 1;
    if depth > MOST_NESTED || *parts > MOST_PARTS {
        return Err(NoForm::TooLarge);
    }
    let span = places.of(value).unwrap_or(span);
    let mut inner = |value: &Value| form_of(value, span, places, depth + 1, parts);
    let name = |name: &str| FormKind::Symbol(Symbol::from(name));
    let kind = match value {
        Value::Imm(Imm::Nil) => name("nil"),
        Value::Imm(Imm::Bool(b)) => name(if *b { "true" } else { "false" }),
        Value::Imm(Imm::Int(i)) => FormKind::Int(*i),
        Value::Imm(Imm::Float(f)) => FormKind::Float(*f),
        Value::Imm(Imm::Symbol(name) | Imm::Var(name)) => FormKind::Symbol(*name),
        Value::Imm(Imm::Keyword(name)) => FormKind::Keyword(*name),
        Value::Imm(_) => return Err(NoForm::Value(format!("a {}", value.type_name()))),
        Value::Obj(obj) => match &**obj {
            Obj::Str(text) => FormKind::Str(text.clone()),
            Obj::Pair(..) => {
                let items = value.to_vec().ok_or_else(|| NoForm::Value("a list with a dotted end".into()))?;
                match prefix_of(&items) {
                    Some(prefix) => FormKind::Prefixed(prefix, Box::new(inner(&items[1])?)),
                    None => FormKind::List(items.iter().map(inner).collect::<Result<_, _>>()?),
                }
            }
            Obj::Vector(items) => FormKind::Vector(items.iter().map(inner).collect::<Result<_, _>>()?),
            Obj::Map(map) => FormKind::Map(
                map.iter().map(|(key, value)| Ok((inner(key)?, inner(value)?))).collect::<Result<_, _>>()?,
            ),
            Obj::Desc(_) | Obj::Pose(_) | Obj::Vec3(_) | Obj::Path(_) | Obj::Edit(_) => {
                return reread(value, span);
            }
            _ => return Err(NoForm::Value(format!("a {}", value.type_name()))),
        },
    };
    Ok(Form::new(kind, span))
}

fn prefix_of(items: &[Value]) -> Option<Prefix> {
    let [head, _] = items else { return None };
    let head = head.as_symbol()?;
    [Prefix::Quote, Prefix::Quasi, Prefix::Unquote, Prefix::Splice]
        .into_iter()
        .find(|prefix| head == prefix.name())
}

/// Values that print as a form that makes them: that form.
fn reread(value: &Value, span: Span) -> Result<Form, NoForm> {
    let parsed = grammar::parse(span.file, &vm::print::write(value));
    let form = parsed.forms.into_iter().next().filter(|_| parsed.errors.is_empty());
    let mut form = form.ok_or_else(|| NoForm::Value(format!("a {}", value.type_name())))?;
    move_to(&mut form, span);
    Ok(form)
}

/// Gives a form and its parts another place.
pub fn move_to(form: &mut Form, span: Span) {
    form.span = span;
    match &mut form.kind {
        FormKind::List(items) | FormKind::Vector(items) => {
            items.iter_mut().for_each(|item| move_to(item, span))
        }
        FormKind::Map(pairs) => pairs.iter_mut().for_each(|(key, value)| {
            move_to(key, span);
            move_to(value, span);
        }),
        FormKind::Prefixed(_, inner) => move_to(inner, span),
        _ => {}
    }
}
