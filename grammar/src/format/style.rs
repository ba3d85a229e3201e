//! Which form is broken how: a table of heads.
//!
//! Names that are not listed follow a rule: `def-…` and `with-…` have a body, the rest are calls.

use crate::form::{Form, FormKind};

/// How a bracketed form is laid out when it does not stay on one line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Style {
    /// `(f a b)`: arguments below the first one. `:key value` stays together.
    Call,
    /// The same, but a line break of the author's stays: `(if …)`, `(<- …)`.
    Aligned,
    /// `(when test body…)`
    Body(Body),
    /// `(a b c)` as data: as many on a line as fit, and the author's line breaks.
    Data,
    /// One element a line: the bindings of `let`, clauses of handlers.
    Rows,
    /// One pair a line.
    Map,
}

/// A form with a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Body {
    /// How many forms after the first stay on its line.
    pub(super) signature: usize,
    /// How far the body is indented.
    pub(super) indent: usize,
    /// When the body starts on a new line though all would fit.
    pub(super) breaks: Breaks,
    /// The body is made of `:key value`.
    pub(super) pairs: bool,
}

/// When a body is put on lines of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Breaks {
    /// Only where it does not fit or the author did so.
    Author,
    /// Also if it has more than one form.
    Several,
    /// Always.
    Always,
}

/// What a form is to the form around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// Something to run: its head says how it is laid out.
    Code,
    /// A list of data, a list of parameters.
    Data,
    /// Behind a quote: data, unless the head is one of those that the table knows.
    Quoted,
    /// `((a 1) (b 2))`
    Bindings,
    /// `(a 1)`
    Binding,
    /// A list of code, a form a line: the steps of `partial-order`, the facts of `with-facts`.
    Steps,
    /// `(test body…)` of `cond`, `(key body…)` of `case`
    Clause,
    /// The clauses of `with-failure-handling`
    Handlers,
    /// `(type (e) body…)`
    Handler,
}

const fn body(signature: usize, breaks: Breaks) -> Style {
    Style::Body(Body { signature, indent: 2, breaks, pairs: false })
}

const fn properties(signature: usize, breaks: Breaks) -> Style {
    Style::Body(Body { signature, indent: 2, breaks, pairs: true })
}

/// The style of heads that are known by name.
fn known(head: &str) -> Option<Style> {
    use Breaks::{Always, Author, Several};
    Some(match head {
        "if" | "<-" | "and" | "or" | "not" | "->" | "*->" => Style::Aligned,
        "seq" | "progn" | "par" | "pursue" | "try-all" | "try-in-order" | "loop" | "cond" | "perform"
        | "unwind-protect" | "partial-order" => body(0, Several),
        "let" | "let*" | "when" | "unless" | "while" | "until" | "dolist" | "dotimes" | "lambda" | "case"
        | "par-loop" | "try-each" | "do-retry" | "whenever" => body(1, Several),
        "for-each-answer" => body(2, Several),
        "module" => body(1, Author),
        "def-fun" | "def-plan" | "def-macro" | "def-native" | "def-native-rule" | "def-open-fun"
        | "extend" => body(2, Always),
        "def-test" => body(1, Always),
        "if-let" | "when-let" | "expect-failure" => body(1, Several),
        "def-rules" => body(1, Always),
        "def-const" => body(1, Author),
        "def-open" => body(2, Author),
        "def-failure" => body(3, Author),
        "def-facts" => body(1, Several),
        "def-policy" => body(2, Several),
        "def-task" | "def-fluent-predicate" => properties(1, Author),
        "def-action" | "def-transformation" => properties(1, Several),
        "def-method" | "def-variant" => properties(2, Several),
        _ => return None,
    })
}

/// The style of the list `items`.
pub(super) fn of_list(items: &[&Form], role: Role) -> Style {
    let head = items.first().and_then(|form| form.symbol());
    match role {
        Role::Data => Style::Data,
        Role::Bindings | Role::Handlers | Role::Steps => Style::Rows,
        Role::Binding => Style::Call,
        Role::Clause => Style::Body(Body { signature: 0, indent: 1, breaks: Breaks::Several, pairs: false }),
        Role::Handler => body(1, Breaks::Several),
        Role::Quoted => {
            let style = head.and_then(|head| known(head.as_str()));
            style.or_else(|| description(items)).unwrap_or(Style::Data)
        }
        Role::Code => of_code(items),
    }
}

fn of_code(items: &[&Form]) -> Style {
    match items.first().map(|form| &form.kind) {
        Some(FormKind::Symbol(head)) => {
            let named = known(head.as_str()).or_else(|| description(items));
            named.unwrap_or_else(|| by_prefix(head.as_str(), items))
        }
        Some(FormKind::Keyword(head)) => match head.as_str() {
            "tag" => body(1, Breaks::Author),
            "init" | "check" | "recover" | "clean-up" => body(0, Breaks::Several),
            _ => Style::Call,
        },
        _ => Style::Data,
    }
}

/// `(an action (type x) …)`
fn description(items: &[&Form]) -> Option<Style> {
    let [article, kind, properties @ ..] = items else { return None };
    let fits = (article.is("a") || article.is("an"))
        && kind.symbol().is_some()
        && properties.iter().all(|property| property.list().is_some());
    fits.then_some(body(1, Breaks::Author))
}

fn by_prefix(head: &str, items: &[&Form]) -> Style {
    if head.starts_with("with-") && !matches!(head, "with-param" | "with-property") {
        body(1, Breaks::Several)
    } else if head.starts_with("def-") {
        // `(def-something name (parameters) body…)`
        let has_parameters =
            matches!(items, [_, name, list, _, ..] if name.symbol().is_some() && list.list().is_some());
        properties(if has_parameters { 2 } else { 1 }, Breaks::Several)
    } else {
        Style::Call
    }
}

/// What the element `index` of the list `items`, itself in `role`, is to it.
pub(super) fn role_of(items: &[&Form], role: Role, style: Style, index: usize) -> Role {
    match role {
        Role::Bindings => return Role::Binding,
        Role::Handlers => return Role::Handler,
        Role::Data => return Role::Data,
        Role::Quoted if style == Style::Data => return Role::Quoted,
        Role::Binding | Role::Steps | Role::Clause => return Role::Code,
        Role::Handler => return if index == 1 { Role::Data } else { Role::Code },
        Role::Code | Role::Quoted => {}
    }
    let head = items.first().and_then(|form| form.symbol());
    match (head.map_or("", |head| head.as_str()), index) {
        ("let" | "let*" | "with-retry-counters", 1) => Role::Bindings,
        ("dolist" | "dotimes" | "par-loop" | "try-each", 1) => Role::Binding,
        ("with-failure-handling", 1) => Role::Handlers,
        ("partial-order" | "with-facts", 1) => Role::Steps,
        ("cond", 1..) | ("case", 2..) => Role::Clause,
        ("lambda" | "for-each-answer" | "exists", 1) => Role::Data,
        (
            "def-fun" | "def-plan" | "def-macro" | "def-policy" | "def-native" | "def-native-rule"
            | "def-open-fun" | "extend",
            2,
        ) => Role::Data,
        ("def-failure", 2..) => Role::Data,
        _ => Role::Code,
    }
}

/// True for forms that stand apart from their neighbours by a blank line.
pub(super) fn is_definition(form: &Form) -> bool {
    form.head().is_some_and(|head| head.starts_with("def-"))
}
