//! Values from their text: the way back of `write`, for what files keep as text.
//!
//! Nothing is run here. A text is either data, which mean themselves, or an expression made of nothing
//! but data and of what makes a value that data cannot say: a description, vec3, pose, path, edit. A
//! function, a fluent or a task has no text but a mark, `#<…>`: what comes back is that mark, as a string.
//! So is a text that was cut off.

use std::borrow::Cow;
use std::collections::HashMap;

use compiler::data::{Places, to_value};
use grammar::{FileId, Form, FormKind, Prefix};
use vm::code::Program;
use vm::desc::{Desc, KINDS};
use vm::host::NoHost;
use vm::machine::{Ctx, CtxParts, Draws};
use vm::native::{Native, Next};
use vm::path::{Path, PathStep};
use vm::tree::{RecId, Tree};
use vm::value::{Imm, Obj, Symbol, Value};

/// Functions that make a value of what is given to them, and do nothing else.
const MAKERS: &[&str] = &[
    "list",
    "list*",
    "cons",
    "vec3",
    "pose",
    "make-path",
    "skip",
    "replace",
    "before",
    "after",
    "wrap",
    "with-param",
    "defer",
    "owe",
];

/// Reads values.
pub struct Reader {
    makers: HashMap<&'static str, Native>,
    program: Program,
    tree: Tree,
}

impl Default for Reader {
    fn default() -> Reader {
        let natives = stdlib::natives().into_iter();
        let makers = natives.filter(|it| MAKERS.contains(&it.name)).map(|it| (it.name, it)).collect();
        Reader { makers, program: Program::default(), tree: Tree::default() }
    }
}

/// A value, and whether no quoted form has it.
struct Read {
    value: Value,
    computed: bool,
}

impl Reader {
    /// The value that `write` has given this text; a string of the text if it says no value.
    #[must_use]
    pub fn value(&self, text: &str) -> Value {
        let parsed = grammar::parse(FileId(0), &without_marks(text));
        let [form] = parsed.forms.as_slice() else { return Value::str(text) };
        if !parsed.errors.is_empty() {
            return Value::str(text);
        }
        match self.expression(form) {
            Some(Read { value, computed: true }) => value,
            _ => data(form),
        }
    }

    /// What an expression computes; nothing if it is none that `write` gives.
    fn expression(&self, form: &Form) -> Option<Read> {
        let plain = |value| Some(Read { value, computed: false });
        match &form.kind {
            FormKind::Symbol(name) if !matches!(name.as_str(), "nil" | "true" | "false") => None,
            FormKind::Prefixed(Prefix::Quote, quoted) => plain(data(quoted)),
            FormKind::Prefixed(..) => None,
            FormKind::Vector(items) => {
                let (items, computed) = self.expressions(items)?;
                Some(Read { value: Value::vector(items), computed })
            }
            FormKind::Map(pairs) => {
                let (keys, one): (Vec<Value>, bool) = self.expressions(pairs.iter().map(|pair| &pair.0))?;
                let (values, other) = self.expressions(pairs.iter().map(|pair| &pair.1))?;
                let value = Value::map(keys.into_iter().zip(values).collect());
                Some(Read { value, computed: one || other })
            }
            FormKind::List(items) => {
                let value = |value| Some(Read { value, computed: true });
                let (head, args) = (form.head()?, items.get(1..)?);
                match head.as_str() {
                    "a" | "an" => value(self.description(args)?),
                    "path" => value(path(args)?),
                    _ => {
                        let (values, computed) = self.expressions(args)?;
                        // A list of plain data has a quoted form, and would have been written as that.
                        let computed = computed || head != "list";
                        Some(Read { value: self.make(&head, &values)?, computed })
                    }
                }
            }
            _ => plain(data(form)),
        }
    }

    fn expressions<'f>(&self, forms: impl IntoIterator<Item = &'f Form>) -> Option<(Vec<Value>, bool)> {
        let mut computed = false;
        let values = forms.into_iter().map(|form| {
            let read = self.expression(form)?;
            computed |= read.computed;
            Some(read.value)
        });
        let values: Option<Vec<Value>> = values.collect();
        Some((values?, computed))
    }

    /// What a function makes of its arguments.
    fn make(&self, name: &str, args: &[Value]) -> Option<Value> {
        let maker = self.makers.get(name)?;
        let (least, most) = maker.arity;
        if args.len() < least.into() || most.is_some_and(|most| args.len() > most.into()) {
            return None;
        }
        let (mut draws, mut printed, mut fresh, mut host) = (Draws::default(), 0, 0, NoHost);
        let mut no_world = None;
        let mut ctx = Ctx::new(CtxParts {
            program: &self.program,
            tree: &self.tree,
            rec: RecId(0),
            draws: &mut draws,
            seed: 0,
            projected: false,
            now: 0,
            printed: &mut printed,
            fresh: &mut fresh,
            output_limit: 0,
            host: &mut host,
            world: &mut no_world,
        });
        match (maker.run)(&mut ctx, args) {
            Ok(Next::Return(value)) => Some(value),
            _ => None,
        }
    }

    /// `(an object (type milk))`, without its first word.
    fn description(&self, parts: &[Form]) -> Option<Value> {
        let (kind, parts) = parts.split_first()?;
        let kind = kind.symbol().filter(|kind| KINDS.contains(&kind.as_str()))?;
        let property = |part: &Form| match part.list()? {
            [key, value] => Some((key.symbol()?, self.property(value)?)),
            _ => None,
        };
        let properties: Option<Vec<(Symbol, Value)>> = parts.iter().map(property).collect();
        Some(Value::desc(Desc::new(kind, properties?)))
    }

    /// A value within a description: data, descriptions, and expressions behind a comma.
    fn property(&self, form: &Form) -> Option<Value> {
        let all =
            |items: &[Form]| items.iter().map(|item| self.property(item)).collect::<Option<Vec<Value>>>();
        match &form.kind {
            FormKind::Prefixed(Prefix::Unquote, inner) => Some(self.expression(inner)?.value),
            FormKind::Prefixed(..) => None,
            FormKind::Vector(items) => Some(Value::vector(all(items)?)),
            FormKind::List(items) => match form.head().as_ref().map(|head| head.as_str()) {
                Some("a" | "an") => self.description(items.get(1..)?),
                _ => Some(Value::list(all(items)?)),
            },
            _ => Some(data(form)),
        }
    }
}

fn data(form: &Form) -> Value {
    to_value(form, &mut Places::default())
}

/// `(path main (fetching :call 2))`, without its first word.
fn path(steps: &[Form]) -> Option<Value> {
    let step =
        |form: &Form| match form.list() {
            None => Some(PathStep { name: form.symbol()?, call: 1 }),
            Some(
                [name, Form { kind: FormKind::Keyword(key), .. }, Form { kind: FormKind::Int(call), .. }],
            ) if *key == "call" => Some(PathStep { name: name.symbol()?, call: u32::try_from(*call).ok()? }),
            Some(_) => None,
        };
    let steps: Option<Vec<PathStep>> = steps.iter().map(step).collect();
    Some(Value::new(Obj::Path(Box::new(Path::new(steps?)))))
}

/// The text with each mark `#<…>` as a string.
fn without_marks(text: &str) -> Cow<'_, str> {
    if !text.contains("#<") {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 2);
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = match first {
            '"' | '|' => quoted_length(rest, first),
            '#' if rest.starts_with("#<") => mark_length(rest),
            _ => first.len_utf8(),
        };
        let (piece, after) = rest.split_at(length);
        match first {
            '#' if piece.len() > 1 => out.push_str(&vm::print::quoted(piece)),
            _ => out.push_str(piece),
        }
        rest = after;
    }
    Cow::Owned(out)
}

/// How long a text in quotes or bars is that stands at the start, in bytes.
fn quoted_length(text: &str, quote: char) -> usize {
    let mut escaped = false;
    let end = text.char_indices().skip(1).find(|(_, c)| {
        let ends = *c == quote && !escaped;
        escaped = *c == '\\' && !escaped;
        ends
    });
    end.map_or(text.len(), |(at, _)| at + 1)
}

/// How long the mark at the start is. Names may have `>` in them, so its end is one that something else
/// than a name follows.
fn mark_length(text: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while let Some(first) = text[at..].chars().next() {
        let rest = &text[at..];
        match first {
            '"' | '|' => at += quoted_length(rest, first),
            '#' if rest.starts_with("#<") => {
                depth += 1;
                at += 2;
            }
            '>' if rest[1..].chars().next().is_none_or(|c| c.is_whitespace() || ">)]}".contains(c)) => {
                depth -= 1;
                at += 1;
                if depth == 0 {
                    return at;
                }
            }
            c => at += c.len_utf8(),
        }
    }
    text.len()
}

/// True for the mark of something that has no text.
#[must_use]
pub fn is_mark(value: &Value) -> bool {
    value.as_str().is_some_and(|text| text.starts_with("#<")) || matches!(value, Value::Imm(Imm::Unset))
}

#[cfg(test)]
mod tests {
    use super::*;
    use vm::print::write;

    /// Reads a text and writes the value again, with what kind of value it is.
    #[track_caller]
    fn check(text: &str, expected: &str) {
        let value = Reader::default().value(text);
        assert_eq!(format!("{} {}", value.type_name(), write(&value)), expected);
    }

    #[test]
    fn data_mean_themselves() {
        check("(list a (b 'c) \"d\" :e 1.0)", "list (list a (b 'c) \"d\" :e 1.0)");
        check("nil", "nil nil");
        check("|left hand|", "symbol |left hand|");
        check("{:a [1 ?x]}", "map {:a [1 ?x]}");
        check("(an x y)", "list (an x y)");
    }

    #[test]
    fn expressions_are_computed() {
        check(
            "(an object (at ,(vec3 1.0 2.0 3.0)) (arms (left right)))",
            "description (an object (arms (left right)) (at ,(vec3 1.0 2.0 3.0)))",
        );
        check("(list 'a (path main (fetching :call 2)))", "list (list 'a (path main (fetching :call 2)))");
        check("(cons 1 2)", "list (cons 1 2)");
        check(
            "(defer (path a) :after (list (path b) (path c)))",
            "edit (defer (path a) :after (list (path b) (path c)))",
        );
        check(
            "(before (path a) '(print (an object (type milk))))",
            "edit (before (path a) '(print (an object (type milk))))",
        );
        check("(pose 'map 1.0 2.0 3.0 0.0 0.0 0.0 1.0)", "pose (pose 'map 1.0 2.0 3.0 0.0 0.0 0.0 1.0)");
    }

    #[test]
    fn what_has_no_text_stays_a_mark() {
        check("#<plan wash>", "string \"#<plan wash>\"");
        check(
            "(a #<function symbol->string> \"#<no>\")",
            "list (a \"#<function symbol->string>\" \"#<no>\")",
        );
        check(
            "#<plan-failure :message \"a > b\" :of #<fluent 3>>",
            "string \"#<plan-failure :message \\\"a > b\\\" :of #<fluent 3>>\"",
        );
        check("(a b …", "string \"(a b …\"");
        check("", "string \"\"");
        check("(vec3 1 a)", "list (vec3 1 a)");
        check("(skip)", "list (skip)");
    }
}
