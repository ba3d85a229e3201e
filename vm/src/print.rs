//! Values as text, for people ([`display`]) and to be read back ([`write()`]).
//!
//! Values share parts, so a small one can print as more text than there are atoms: printing
//! stops at a budget of bytes and of depth, and says so with `…`.

use std::fmt::Write as _;

use crate::code::Program;
use crate::value::{Imm, Obj, Value};

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
    out: String,
    full: bool,
}

impl<'a> Printer<'a> {
    /// A printer that stops after about `limit` bytes.
    #[must_use]
    pub fn new(program: Option<&'a Program>, readable: bool, limit: usize) -> Printer<'a> {
        Printer { program, readable, limit, out: String::new(), full: false }
    }

    /// The text of one value.
    #[must_use]
    pub fn text(mut self, value: &Value) -> String {
        self.value(value, 0);
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
                let text = i.to_string();
                self.put(&text);
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
            Obj::Vector(items) => self.sequence("[", items.iter(), "]", depth),
            Obj::Map(map) => self.sequence("{", map.iter().flat_map(|(key, value)| [key, value]), "}", depth),
            Obj::Desc(desc) => {
                let article = if desc.kind.starts_with(['a', 'e', 'i', 'o', 'u']) { "(an " } else { "(a " };
                self.put(article);
                self.name(&desc.kind);
                for (key, value) in desc.properties() {
                    self.put(" (");
                    self.name(&key);
                    self.put(" ");
                    self.value(value, depth);
                    self.put(")");
                }
                self.put(")");
            }
            Obj::Failure(failure) => {
                self.put("#<");
                self.put(&failure.name);
                for (key, value) in &failure.fields {
                    self.put(" :");
                    self.put(key);
                    self.put(" ");
                    self.value(value, depth);
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
            Obj::Path(path) => self.put(&path.print()),
            Obj::Edit(edit) => self.put(&edit.print()),
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
        self.put("(");
        let mut iter = value.iter();
        for (i, item) in iter.by_ref().enumerate() {
            if i > 0 {
                self.put(" ");
            }
            self.value(item, depth);
            if self.full {
                return;
            }
        }
        if !iter.rest.is_nil() {
            self.put(" . ");
            self.value(iter.rest, depth);
        }
        self.put(")");
    }

    fn sequence<'v>(
        &mut self,
        open: &str,
        items: impl Iterator<Item = &'v Value>,
        close: &str,
        depth: usize,
    ) {
        self.put(open);
        for (i, item) in items.enumerate() {
            if i > 0 {
                self.put(" ");
            }
            self.value(item, depth);
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
            self.put(&format!("|{}|", name.replace('\\', "\\\\").replace('|', "\\|")));
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
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\t' => out.push_str("\\t"),
            '\r' => out.push_str("\\r"),
            c if c.is_control() => write!(out, "\\u{{{:x}}}", c as u32).expect("a string takes all"),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// True for names that would not be read back as one symbol.
fn needs_bars(name: &str) -> bool {
    let odd = |c: char| c.is_whitespace() || c.is_control() || "()[]{}\"';`,|#\\".contains(c);
    let numeric = |name: &str| {
        let digits = name.strip_prefix(['+', '-']).unwrap_or(name);
        digits.starts_with(|c: char| c.is_ascii_digit())
            || digits.strip_prefix('.').is_some_and(|it| it.starts_with(|c: char| c.is_ascii_digit()))
    };
    let number = numeric(name) && !matches!(name, "1+" | "1-");
    name.is_empty()
        || name.contains(odd)
        || name.starts_with(':')
        || number
        || matches!(name, "+inf" | "-inf" | "+nan" | ".")
}
