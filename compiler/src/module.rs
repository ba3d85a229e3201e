//! Modules: which names a file defines, and which it sees.

use std::collections::BTreeMap;

use grammar::Span;
use vm::code::{FnId, GlobalId, NativeId, Params};
use vm::failure::TypeId;
use vm::rules::clause::PredId;
use vm::value::Symbol;

/// A module, as an index into [`Modules`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ModuleId(pub u32);

/// What a name stands for.
#[derive(Debug, Clone, PartialEq)]
pub enum Meaning {
    /// `def-fun`
    Function(FnId, Params),
    /// `def-plan`
    Plan(FnId, Params),
    /// `def-open-fun`
    Open(FnId, Params),
    /// `def-macro`
    Macro(FnId, Params),
    /// `def-const`
    Const(GlobalId),
    /// `def-native`
    Native(NativeId, Params),
    /// `def-failure`
    Failure(TypeId),
    /// `def-test`
    Test(FnId),
    /// `def-rules`, `def-facts`, `def-open`, `def-native-rule`. Modules know it as `name/arity`.
    Predicate(PredId, Params),
}

impl Meaning {
    /// In words: "a plan".
    #[must_use]
    pub fn words(&self) -> &'static str {
        match self {
            Meaning::Function(..) | Meaning::Native(..) => "a function",
            Meaning::Open(..) => "an open function",
            Meaning::Plan(..) => "a plan",
            Meaning::Macro(..) => "a macro",
            Meaning::Const(_) => "a constant",
            Meaning::Failure(_) => "a type of failures",
            Meaning::Test(_) => "a test",
            Meaning::Predicate(..) => "a predicate",
        }
    }
    /// Its parameters, if it can be called; the arguments of a predicate.
    #[must_use]
    pub fn params(&self) -> Option<&Params> {
        match self {
            Meaning::Function(_, params)
            | Meaning::Plan(_, params)
            | Meaning::Open(_, params)
            | Meaning::Macro(_, params)
            | Meaning::Native(_, params)
            | Meaning::Predicate(_, params) => Some(params),
            Meaning::Const(_) | Meaning::Failure(_) | Meaning::Test(_) => None,
        }
    }
}

/// A name that a module defines.
#[derive(Debug, Clone)]
pub struct Definition {
    /// What it stands for.
    pub meaning: Meaning,
    /// Its documentation.
    pub doc: Option<Box<str>>,
    /// Where it is defined.
    pub span: Span,
}

/// A module that another one uses.
#[derive(Debug, Clone)]
pub struct Use {
    /// The module.
    pub module: ModuleId,
    /// `:as g`: its names are written `g/name`.
    pub prefix: Option<Symbol>,
    /// `:only (a b)`
    pub only: Option<Vec<Symbol>>,
}

/// A file of definitions.
#[derive(Debug, Clone, Default)]
pub struct Module {
    /// Its name.
    pub name: String,
    /// Its documentation.
    pub doc: Option<Box<str>>,
    /// What it defines.
    pub names: BTreeMap<Symbol, Definition>,
    /// What it uses, in the order of the text.
    pub uses: Vec<Use>,
}

/// All modules of a program.
#[derive(Debug, Clone, Default)]
pub struct Modules {
    modules: Vec<Module>,
    /// Those that every module sees.
    pub prelude: Vec<ModuleId>,
}

/// What a look-up found.
#[derive(Debug, Clone)]
pub enum Found {
    /// One definition.
    One(Definition),
    /// Two used modules define the name.
    Two(String, String),
    /// Nothing.
    None,
}

impl Modules {
    /// Adds an empty module.
    pub fn add(&mut self, name: &str) -> ModuleId {
        self.modules.push(Module { name: name.into(), ..Module::default() });
        ModuleId(self.modules.len() as u32 - 1)
    }
    /// A module.
    #[must_use]
    pub fn get(&self, id: ModuleId) -> &Module {
        &self.modules[id.0 as usize]
    }
    /// A module, to be changed.
    pub fn get_mut(&mut self, id: ModuleId) -> &mut Module {
        &mut self.modules[id.0 as usize]
    }
    /// The module of this name.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<ModuleId> {
        self.modules.iter().position(|module| module.name == name).map(|at| ModuleId(at as u32))
    }
    /// All modules, in the order of loading.
    pub fn iter(&self) -> impl Iterator<Item = (ModuleId, &Module)> {
        self.modules.iter().enumerate().map(|(at, module)| (ModuleId(at as u32), module))
    }

    /// What a name means in a module: its own definition, else that of a module it uses, else
    /// that of the prelude.
    #[must_use]
    pub fn look_up(&self, module: ModuleId, name: Symbol) -> Found {
        let own = self.get(module);
        if let Some(definition) = own.names.get(&name) {
            return Found::One(definition.clone());
        }
        let mut found: Option<(&Module, &Definition)> = None;
        for used in &own.uses {
            let Some(visible) = used.visible_name(name) else { continue };
            let other = self.get(used.module);
            let Some(definition) = other.names.get(&visible) else { continue };
            match found {
                Some((first, known)) if known.meaning != definition.meaning => {
                    return Found::Two(first.name.clone(), other.name.clone());
                }
                _ => found = Some((other, definition)),
            }
        }
        let prelude = self.prelude.iter().filter(|_| !is_private(name)).map(|id| self.get(*id));
        let from_prelude = prelude.filter_map(|module| module.names.get(&name)).next();
        match found.map(|(_, definition)| definition).or(from_prelude) {
            Some(definition) => Found::One(definition.clone()),
            None => Found::None,
        }
    }

    /// All names that a module sees.
    #[must_use]
    pub fn visible(&self, module: ModuleId) -> Vec<Symbol> {
        let own = self.get(module);
        let mut names: Vec<Symbol> = own.names.keys().copied().collect();
        for used in &own.uses {
            let public = self.get(used.module).names.keys().filter(|name| !is_private(**name));
            names.extend(public.filter_map(|name| match (&used.prefix, &used.only) {
                (Some(prefix), _) => Some(Symbol::from(&format!("{prefix}/{name}"))),
                (None, Some(only)) => lists(only, *name).then_some(*name),
                (None, None) => Some(*name),
            }));
        }
        for module in &self.prelude {
            names.extend(self.get(*module).names.keys().filter(|name| !is_private(**name)));
        }
        names.sort_by(|a, b| a.as_str().cmp(b.as_str()));
        names.dedup();
        names
    }
}

impl Use {
    /// The name that `name` has in the used module, if it can be seen.
    fn visible_name(&self, name: Symbol) -> Option<Symbol> {
        let inner = match self.prefix {
            Some(prefix) => Symbol::from(name.strip_prefix(prefix.as_str())?.strip_prefix('/')?),
            None => name,
        };
        let listed = self.only.as_ref().is_none_or(|only| lists(only, inner));
        (listed && !is_private(inner)).then_some(inner)
    }
}

/// True if `:only` lists a name; that of a predicate may stand there without its arity.
fn lists(only: &[Symbol], name: Symbol) -> bool {
    let is_predicate =
        || predicate_key(name).is_some_and(|(name, _)| only.iter().any(|known| *known == name));
    only.contains(&name) || is_predicate()
}

/// Name and arity of what modules know as `name/arity`.
#[must_use]
pub fn predicate_key(key: Symbol) -> Option<(&'static str, usize)> {
    let (name, arity) = key.as_str().rsplit_once('/')?;
    let is_number = !arity.is_empty() && arity.bytes().all(|byte| byte.is_ascii_digit());
    (is_number && !name.is_empty()).then(|| arity.parse().ok().map(|arity| (name, arity)))?
}

/// Names that begin with `%` belong to their module alone.
#[must_use]
pub fn is_private(name: Symbol) -> bool {
    name.starts_with('%')
}

/// The name among `names` that is most like `name`, if one is like it.
#[must_use]
pub fn nearest<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let most = (name.chars().count() / 3).clamp(1, 3);
    // A letter is not like another letter, and `?x` is like other variables only.
    let alike = |other: &str| name.starts_with('?') == other.starts_with('?');
    let far_from_empty =
        |distance: usize, other: &str| distance < name.chars().count().max(other.chars().count());
    let names =
        names.into_iter().filter(|other| alike(other)).map(|other| (distance(name, other, most), other));
    let near = names.filter(|(distance, other)| *distance <= most && far_from_empty(*distance, other));
    near.min_by_key(|(distance, other)| (*distance, *other)).map(|(_, other)| other)
}

/// How many letters have to be added, left out, changed or swapped, counted up to `most` + 1.
/// Source: optimal string alignment distance.
fn distance(a: &str, b: &str, most: usize) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    if a.len().abs_diff(b.len()) > most || a.len().max(b.len()) > 200 {
        return most + 1;
    }
    let mut rows = vec![(0..=b.len()).collect::<Vec<usize>>()];
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let change = usize::from(a[i - 1] != b[j - 1]);
            let mut best = (rows[i - 1][j] + 1).min(row[j - 1] + 1).min(rows[i - 1][j - 1] + change);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(rows[i - 2][j - 2] + 1);
            }
            row.push(best);
        }
        rows.push(row);
    }
    rows[a.len()][b.len()]
}
