//! Forms: what the text of a program is made of before anything is known of its meaning.
//!
//! A form keeps its place. Nothing here knows special forms: `(if a b)` is a list of three.

use crate::span::Span;

/// A name. Two symbols are the same if their letters are; case matters.
pub type Symbol = ustr::Ustr;

/// A form and its place.
#[derive(Debug, Clone)]
pub struct Form {
    /// What it is.
    pub kind: FormKind,
    /// The text that it was read from, brackets and prefixes included.
    pub span: Span,
}

/// What a form is.
#[derive(Debug, Clone, PartialEq)]
pub enum FormKind {
    /// `milk`, `+`, `?type`, `|with blank|`
    Symbol(Symbol),
    /// `:on`, without its colon
    Keyword(Symbol),
    /// `42`, `-7`, `0xff`
    Int(i64),
    /// `1.5`, `2e3`, `+inf`
    Float(f64),
    /// `"text"`, with its escapes resolved
    Str(Box<str>),
    /// `(a b c)`
    List(Vec<Form>),
    /// `[a b c]`
    Vector(Vec<Form>),
    /// `{k v k v}`, in the order of the text
    Map(Vec<(Form, Form)>),
    /// `'a`, `` `a ``, `,a`, `,@a`
    Prefixed(Prefix, Box<Form>),
}

/// The signs that stand before a form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Prefix {
    /// `'`, read as `(quote …)`
    Quote,
    /// `` ` ``, read as `(quasiquote …)`
    Quasi,
    /// `,`, read as `(unquote …)`
    Unquote,
    /// `,@`, read as `(unquote-splicing …)`
    Splice,
}

impl Prefix {
    /// The sign.
    #[must_use]
    pub fn sign(self) -> &'static str {
        match self {
            Prefix::Quote => "'",
            Prefix::Quasi => "`",
            Prefix::Unquote => ",",
            Prefix::Splice => ",@",
        }
    }

    /// The name of the form that the sign stands for.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Prefix::Quote => "quote",
            Prefix::Quasi => "quasiquote",
            Prefix::Unquote => "unquote",
            Prefix::Splice => "unquote-splicing",
        }
    }
}

/// Equal if the same was written, wherever it stands.
impl PartialEq for Form {
    fn eq(&self, other: &Form) -> bool {
        self.kind == other.kind
    }
}

impl Form {
    /// A form at a place.
    #[must_use]
    pub fn new(kind: FormKind, span: Span) -> Form {
        Form { kind, span }
    }

    /// The symbol that this form is, if it is one.
    #[must_use]
    pub fn symbol(&self) -> Option<Symbol> {
        if let FormKind::Symbol(name) = self.kind { Some(name) } else { None }
    }

    /// True if this form is the symbol `name`.
    #[must_use]
    pub fn is(&self, name: &str) -> bool {
        self.symbol().is_some_and(|symbol| symbol == name)
    }

    /// The elements, if this form is a list.
    #[must_use]
    pub fn list(&self) -> Option<&[Form]> {
        if let FormKind::List(items) = &self.kind { Some(items) } else { None }
    }

    /// The name at the head of a list: `if` of `(if a b)`.
    #[must_use]
    pub fn head(&self) -> Option<Symbol> {
        self.list()?.first()?.symbol()
    }
}
