//! Values as text, for people ([`display`]) and to be read back ([`write()`]).
//!
//! What is written reads back in one of two ways. **Data** are written as they stand in a quoted form.
//! A value with a part in it that no quoted form has (a description, vec3, pose, path or edit, a cell
//! whose rest is no list) is written as an **expression** that computes it: `(list 'a (vec3 1.0 2.0 3.0))`.
//! Functions, failures and trees have no such text, but a mark: `#<…>`.
//!
//! Values share parts, so a small one can print as more text than there are atoms: printing
//! stops at a budget of bytes and of depth, and says so with `…`.

use std::fmt::Write as _;

use crate::code::Program;
use crate::desc::Desc;
use crate::edit::{Edit, What};
use crate::path::Path;
use crate::value::{Imm, Obj, Symbol, Value};

/// No text of a value is longer than this, in bytes.
pub const LIMIT: usize = 1 << 20;
/// Nor nested deeper.
const DEPTH: usize = 500;
/// What stands for parts that are left out.
const CUT: char = '…';

/// The text of a value that reads back as an equal value, where there is one.
#[must_use]
pub fn write(value: &Value) -> String {
    Printer::new(None, true, LIMIT).text(value)
}

/// The text of a value for people: strings without quotes, symbols in their own letters.
#[must_use]
pub fn display(value: &Value) -> String {
    Printer::new(None, false, LIMIT).text(value)
}

/// A short text of a value for messages: at most about 80 characters.
#[must_use]
pub fn brief(value: &Value) -> String {
    Printer::new(None, true, 80).text(value)
}

/// How values are turned into text.
pub struct Printer<'a> {
    /// Knows the names of functions.
    program: Option<&'a Program>,
    /// To be read back: strings in quotes, odd symbols in bars.
    readable: bool,
    limit: usize,
    /// How many more parts are looked at to find out how something is written.
    looks: usize,
    out: String,
    full: bool,
}

/// What the parts of a value, and those of its lists, vectors and maps, say about how it is written.
#[derive(Default)]
struct Parts {
    /// Some stand in no quoted form.
    computed: bool,
    /// Some have no text but a mark, so that nothing reads back.
    marked: bool,
    /// Some mean something else where they are not quoted: names and lists.
    quoted: bool,
    /// Some mean something else as data of a description: `?x`, `(a b)`, `(quote x)`.
    described: bool,
}

/// How many parts a printer looks at, at most, for each byte that it may write.
const LOOKS_PER_BYTE: usize = 8;

impl<'a> Printer<'a> {
    /// A printer that stops after about `limit` bytes.
    #[must_use]
    pub fn new(program: Option<&'a Program>, readable: bool, limit: usize) -> Printer<'a> {
        let looks = limit.saturating_mul(LOOKS_PER_BYTE);
        Printer { program, readable, limit, looks, out: String::new(), full: false }
    }

    /// Puts the text of one value after what is there.
    pub(crate) fn text_onto(mut self, out: &mut String, value: &Value) {
        self.limit = self.limit.saturating_add(out.len());
        std::mem::swap(&mut self.out, out);
        self.written(value, 0);
        std::mem::swap(&mut self.out, out);
    }

    /// The text of one value.
    #[must_use]
    pub fn text(mut self, value: &Value) -> String {
        self.written(value, 0);
        self.out
    }

    /// The text of an expression that computes the value.
    #[must_use]
    pub fn expression(mut self, value: &Value) -> String {
        self.computed(value, 0);
        self.out
    }

    fn put(&mut self, text: &str) {
        if self.full {
            return;
        }
        if self.out.len() + text.len() <= self.limit {
            self.out.push_str(text);
            return;
        }
        self.full = true;
        let mut room = self.limit.saturating_sub(self.out.len()).min(text.len());
        while !text.is_char_boundary(room) {
            room -= 1;
        }
        self.out.push_str(&text[..room]);
        self.out.push(CUT);
    }

    /// A value by itself: as data if it can be quoted, else as an expression.
    fn written(&mut self, value: &Value, depth: usize) {
        if self.readable && is_collection(value) {
            let parts = self.parts(value);
            if parts.computed && !parts.marked {
                return self.computed(value, depth);
            }
        }
        self.value(value, depth);
    }

    /// How a value can be written. What is too large to be looked at is written with most care.
    fn parts(&mut self, value: &Value) -> Parts {
        let mut parts = Parts::default();
        let mut todo = vec![value];
        while let Some(part) = todo.pop() {
            let Some(left) = self.looks.checked_sub(1) else {
                return Parts { computed: true, marked: true, quoted: true, described: true };
            };
            self.looks = left;
            match part {
                Value::Imm(Imm::Symbol(name)) => {
                    parts.quoted = true;
                    parts.described |= name.starts_with('?');
                }
                Value::Imm(imm) => parts.marked |= matches!(imm, Imm::Function(_) | Imm::Native(_)),
                Value::Obj(obj) => match &**obj {
                    Obj::Pair(first, _) => {
                        parts.quoted = true;
                        parts.described |= is_special_head(first);
                        let mut cells = part.iter();
                        todo.extend(cells.by_ref().take(left));
                        parts.computed |= !cells.rest.is_list();
                    }
                    Obj::Vector(items) => todo.extend(items.iter().take(left)),
                    Obj::Map(map) => todo.extend(map.iter().take(left).flat_map(|(key, value)| [key, value])),
                    Obj::Str(_) => {}
                    other if is_expression(other) => parts.computed = true,
                    _ => parts.marked = true,
                },
            }
        }
        parts
    }

    /// An expression whose value this is.
    fn computed(&mut self, value: &Value, depth: usize) {
        if self.full {
            return;
        }
        if !is_collection(value) {
            if value.as_symbol().is_some() {
                self.put("'");
            }
            return self.value(value, depth);
        }
        let parts = self.parts(value);
        match value.obj() {
            _ if !parts.computed => {
                if parts.quoted {
                    self.put("'");
                }
                self.value(value, depth);
            }
            _ if depth > DEPTH => self.put("…"),
            Some(Obj::Vector(items)) => {
                self.sequence("[", items.iter(), "]", |it, item| it.computed(item, depth + 1));
            }
            Some(Obj::Map(map)) => {
                let entries = map.iter().flat_map(|(key, value)| [key, value]);
                self.sequence("{", entries, "}", |it, item| it.computed(item, depth + 1));
            }
            _ => {
                let end = self.end_of(value);
                let is_cell = value.as_pair().is_some_and(|(_, rest)| !rest.is_list());
                self.put(match end {
                    None => "(list ",
                    Some(_) if is_cell => "(cons ",
                    Some(_) => "(list* ",
                });
                self.sequence("", value.iter().chain(end), ")", |it, item| it.computed(item, depth + 1));
            }
        }
    }

    /// What stands in the place of nil at the end of a list, as far as there is room for its elements.
    fn end_of<'v>(&self, list: &'v Value) -> Option<&'v Value> {
        let mut cells = list.iter();
        cells.by_ref().take(self.limit).for_each(drop);
        Some(cells.rest).filter(|rest| !rest.is_list())
    }

    fn value(&mut self, value: &Value, depth: usize) {
        if self.full {
            return;
        }
        match value {
            Value::Imm(imm) => self.imm(*imm),
            Value::Obj(_) if depth > DEPTH => self.put("…"),
            Value::Obj(obj) => self.obj(value, obj, depth + 1),
        }
    }

    fn imm(&mut self, imm: Imm) {
        match imm {
            Imm::Unset => self.put("#<unset>"),
            Imm::Nil => self.put("nil"),
            Imm::Bool(true) => self.put("true"),
            Imm::Bool(false) => self.put("false"),
            Imm::Int(i) => {
                self.put(itoa::Buffer::new().format(i));
            }
            Imm::Float(f) => self.put(&float(f)),
            Imm::Symbol(name) | Imm::Var(name) => self.name(&name),
            Imm::Keyword(name) => {
                self.put(":");
                self.name(&name);
            }
            Imm::Function(id) => {
                let function = self.program.and_then(|program| program.functions.get(id.0 as usize));
                let text =
                    function.map_or("#<function>".into(), |it| format!("#<{} {}>", it.kind.word(), it.name));
                self.put(&text);
            }
            Imm::Native(id) => {
                let native = self.program.and_then(|program| program.natives.get(id.0 as usize));
                let text = native.map_or("#<function>".into(), |it| format!("#<function {}>", it.name));
                self.put(&text);
            }
        }
    }

    fn obj(&mut self, value: &Value, obj: &Obj, depth: usize) {
        match obj {
            Obj::Pair(..) => self.list(value, depth),
            Obj::Str(text) if self.readable => self.put(&quoted(text)),
            Obj::Str(text) => self.put(text),
            Obj::Vector(items) => self.sequence("[", items.iter(), "]", |it, item| it.value(item, depth)),
            Obj::Map(map) => {
                let entries = map.iter().flat_map(|(key, value)| [key, value]);
                self.sequence("{", entries, "}", |it, item| it.value(item, depth));
            }
            Obj::Desc(desc) => self.desc(desc, depth),
            Obj::Failure(failure) => {
                self.put("#<");
                self.put(&failure.name);
                for (key, value) in &failure.fields {
                    self.put(" :");
                    self.put(key);
                    self.put(" ");
                    self.written(value, depth);
                }
                self.put(">");
            }
            Obj::Closure(id, _) => self.imm(Imm::Function(*id)),
            Obj::Vec3(vec) => self.numbers("(vec3", &vec.numbers()),
            Obj::Pose(pose) => {
                self.put("(pose '");
                self.name(&pose.frame);
                self.numbers("", &pose.numbers());
            }
            Obj::Counter(left) => self.put(&format!("#<counter {}>", left.get())),
            Obj::Ranks(_) => self.put("#<ranks>"),
            Obj::Fluent(fluent) => self.put(&format!("#<fluent {}>", fluent.id)),
            Obj::Task(task) => self.put(&format!("#<task {}>", task.task)),
            Obj::Stream(stream) => self.put(&format!("#<answers {}>", stream.id.0)),
            Obj::Path(path) => self.path(path),
            Obj::Edit(edit) => self.edit(edit, depth),
            Obj::Tree(tree) => self.put(&format!("#<tree {}>", tree.summary())),
            Obj::Gone => self.put("#<gone>"),
        }
    }

    fn list(&mut self, value: &Value, depth: usize) {
        if self.readable
            && let Some(quoted) = quoted_form(value)
        {
            self.put("'");
            return self.value(quoted, depth);
        }
        let mut cells = value.iter();
        self.sequence("(", cells.by_ref(), "", |it, item| it.value(item, depth));
        if self.full {
            return;
        }
        if !cells.rest.is_nil() {
            self.put(" . ");
            self.value(cells.rest, depth);
        }
        self.put(")");
    }

    fn desc(&mut self, desc: &Desc, depth: usize) {
        let article = if desc.kind.starts_with(['a', 'e', 'i', 'o', 'u']) { "(an " } else { "(a " };
        self.put(article);
        self.name(&desc.kind);
        for (key, value) in desc.properties() {
            self.put(" (");
            self.name(&key);
            self.put(" ");
            if self.readable {
                self.property(value, depth);
            } else {
                self.value(value, depth);
            }
            self.put(")");
        }
        self.put(")");
    }

    /// A value within a description: data and descriptions stand there as they are, lists and vectors
    /// of these, too; all else has a comma before it.
    fn property(&mut self, value: &Value, depth: usize) {
        if self.full {
            return;
        }
        let plain = match value.obj() {
            None => !value.as_symbol().is_some_and(|name| name.starts_with('?')),
            Some(Obj::Pair(..) | Obj::Vector(_) | Obj::Map(_)) => {
                let parts = self.parts(value);
                !parts.computed && !parts.described
            }
            Some(other) => !is_expression(other) || matches!(other, Obj::Desc(_)),
        };
        match value.obj() {
            _ if plain => self.value(value, depth),
            Some(_) if depth > DEPTH => self.put("…"),
            Some(Obj::Vector(items)) => {
                self.sequence("[", items.iter(), "]", |it, item| it.property(item, depth + 1));
            }
            Some(Obj::Pair(first, _)) if !is_special_head(first) && self.end_of(value).is_none() => {
                self.sequence("(", value.iter(), ")", |it, item| it.property(item, depth + 1));
            }
            _ => {
                self.put(",");
                self.computed(value, depth);
            }
        }
    }

    /// As a form that makes an equal path.
    fn path(&mut self, path: &Path) {
        if path.steps.is_empty() {
            return self.put("(path top-level)");
        }
        self.put("(path");
        for step in &path.steps {
            self.put(if step.call == 1 { " " } else { " (" });
            self.name(&step.name);
            if step.call != 1 {
                self.put(&format!(" :call {})", step.call));
            }
        }
        self.put(")");
    }

    /// As a form that makes an equal edit, also where people read it.
    fn edit(&mut self, edit: &Edit, depth: usize) {
        let readable = std::mem::replace(&mut self.readable, true);
        self.put("(");
        self.put(edit.word());
        self.put(" ");
        self.path(&edit.at);
        match &edit.what {
            What::Skip(None) => {}
            What::Skip(Some(value)) => self.option("value", value, depth),
            What::Replace(code) | What::Before(code) | What::After(code) | What::Wrap(code) => {
                self.code(code, depth);
            }
            What::WithParam(key, value) => self.option(key, value, depth),
            What::Defer(after) => self.after(after),
            What::Owe { code, after, name } => {
                self.code(code, depth);
                self.after(after);
                self.option("as", &Value::Imm(Imm::Symbol(*name)), depth);
            }
        }
        for (at, (key, value)) in edit.guard.iter().enumerate() {
            self.put(if at == 0 { " :guard {" } else { " " });
            self.entry(key, value, depth);
        }
        if !edit.guard.is_empty() {
            self.put("}");
        }
        if let Some(by) = edit.by {
            self.option("by", &Value::Imm(Imm::Symbol(by)), depth);
        }
        if !edit.out_of.is_empty() {
            let names = edit.out_of.iter().map(|name| Value::Imm(Imm::Symbol(*name)));
            self.option("out-of", &Value::list(names.collect::<Vec<_>>()), depth);
        }
        self.put(")");
        self.readable = readable;
    }

    fn code(&mut self, code: &Value, depth: usize) {
        self.put(" ");
        if self.parts(code).computed {
            return self.computed(code, depth);
        }
        self.put("'");
        self.value(code, depth);
    }

    fn after(&mut self, paths: &[Path]) {
        self.put(" :after ");
        if let [path] = paths {
            return self.path(path);
        }
        self.put("(list");
        for path in paths {
            self.put(" ");
            self.path(path);
        }
        self.put(")");
    }

    fn option(&mut self, key: &str, value: &Value, depth: usize) {
        self.put(" ");
        self.entry(key, value, depth);
    }

    fn entry(&mut self, key: &str, value: &Value, depth: usize) {
        self.imm(Imm::Keyword(Symbol::from(key)));
        self.put(" ");
        self.computed(value, depth);
    }

    fn sequence<'v>(
        &mut self,
        open: &str,
        items: impl Iterator<Item = &'v Value>,
        close: &str,
        mut print: impl FnMut(&mut Self, &'v Value),
    ) {
        self.put(open);
        for (i, item) in items.enumerate() {
            if i > 0 {
                self.put(" ");
            }
            print(self, item);
            if self.full {
                return;
            }
        }
        self.put(close);
    }

    fn numbers(&mut self, head: &str, numbers: &[f64]) {
        self.put(head);
        for number in numbers {
            self.put(" ");
            self.put(&float(*number));
        }
        self.put(")");
    }

    fn name(&mut self, name: &str) {
        if self.readable && needs_bars(name) {
            self.put(&escaped(name, '|'));
        } else {
            self.put(name);
        }
    }
}

/// `x` of `(quote x)`.
fn quoted_form(value: &Value) -> Option<&Value> {
    let (head, rest) = value.as_pair()?;
    let (form, end) = rest.as_pair()?;
    (end.is_nil() && head.as_symbol()? == "quote").then_some(form)
}

/// A float that reads back as the same float.
#[must_use]
pub fn float(f: f64) -> String {
    if f.is_nan() {
        "+nan".into()
    } else if f.is_infinite() {
        if f > 0.0 { "+inf".into() } else { "-inf".into() }
    } else {
        format!("{f:?}")
    }
}

/// A string with quotes and escapes.
#[must_use]
pub fn quoted(text: &str) -> String {
    escaped(text, '"')
}

/// A text between two quotes or bars.
fn escaped(text: &str, quote: char) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push(quote);
    for c in text.chars() {
        match c {
            '\n' => out.push_str("\\n"),
            '\t' => out.push_str("\\t"),
            '\r' => out.push_str("\\r"),
            c if c == quote || c == '\\' => out.extend(['\\', c]),
            c if is_hidden(c) || (quote == '|' && is_unseen(c)) => {
                write!(out, "\\u{{{:x}}}", c as u32).expect("a string takes all");
            }
            c => out.push(c),
        }
    }
    out.push(quote);
    out
}

/// True for what the reader does not take as it is within quotes.
fn is_hidden(c: char) -> bool {
    c.is_control() || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// True for what people cannot see in a name, or not tell from a blank.
fn is_unseen(c: char) -> bool {
    !c.is_ascii()
        && !is_symbol_char(c)
        && !matches!(c, '\u{ab}' | '\u{bb}' | '\u{2010}'..='\u{201f}' | '\u{2039}' | '\u{203a}')
}

/// True for what stands in a name without bars. The reader takes the same, and a bar within a name: it
/// knows nothing of this crate nor this crate of it, so a test of both holds them together.
fn is_symbol_char(c: char) -> bool {
    match c {
        '\0'..='\x7f' => c.is_ascii_alphanumeric() || "/?!*<>=+-_%&.:@~^$".contains(c),
        '\u{ab}' | '\u{bb}' | '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{feff}' => false,
        '\u{2020}'..='\u{2027}' | '\u{2030}'..='\u{2038}' | '\u{203b}'..='\u{205e}' => true,
        '\u{200b}'..='\u{206f}' | '\u{fff0}'..='\u{ffff}' => false,
        '\u{e000}'..='\u{f8ff}' | '\u{e0000}'.. => false,
        _ => !c.is_whitespace() && !c.is_control(),
    }
}

/// True for what stands in no quoted form, but has an expression that computes it.
fn is_expression(obj: &Obj) -> bool {
    matches!(obj, Obj::Desc(_) | Obj::Vec3(_) | Obj::Pose(_) | Obj::Path(_) | Obj::Edit(_))
}

/// True for the first element of a list that is no data within a description.
fn is_special_head(first: &Value) -> bool {
    first.as_symbol().is_some_and(|head| matches!(head.as_str(), "a" | "an" | "quote"))
}

/// True for lists, vectors and maps.
fn is_collection(value: &Value) -> bool {
    matches!(value.obj(), Some(Obj::Pair(..) | Obj::Vector(_) | Obj::Map(_)))
}

/// True for names that would not be read back as one symbol.
fn needs_bars(name: &str) -> bool {
    let numeric = |name: &str| {
        let digits = name.strip_prefix(['+', '-']).unwrap_or(name);
        digits.starts_with(|c: char| c.is_ascii_digit())
            || digits.strip_prefix('.').is_some_and(|it| it.starts_with(|c: char| c.is_ascii_digit()))
    };
    let number = numeric(name) && !matches!(name, "1+" | "1-");
    name.is_empty()
        || name.starts_with([':', '@'])
        || !name.chars().all(is_symbol_char)
        || number
        || matches!(name, "+inf" | "-inf" | "+nan" | ".")
}
