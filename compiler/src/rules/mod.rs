//! Rules: from forms to the clauses that the machine runs, [`vm::rules::clause`].
//!
//! [`declare`] finds out which predicates a text defines; [`clause`] resolves their clauses once all
//! names of the text are known, [`goal`] by [`goal`], down to [`term`]s, numbers and expressions
//! ([`number`]). [`flow`] then follows the values through each clause: which variables may have none
//! where one is needed. [`query`] makes clauses of the questions that plans ask.
//!
//! Predicates are names of their module like functions, under `name/arity`, for `member` is a
//! function, too. Clauses reach the program when the whole text has been compiled without an error:
//! until then they are [`Staged`], so a text with a mistake changes nothing.

mod clause;
pub(crate) mod declare;
mod flow;
pub(crate) mod goal;
mod number;
mod pure;
pub(crate) mod query;
mod term;

pub(crate) use number::Called;

use grammar::Span;
use rustc_hash::FxHashMap;
use vm::code::Place;
use vm::rules::Rules;
use vm::rules::clause::{Clause, PredId, VarNo};
use vm::rules::control::Scope;
use vm::value::{Symbol, Value};

use crate::Compiler;
use crate::data::MOST_NESTED;
use crate::module::{Definition, Found, Meaning, ModuleId};

/// The greatest number of arguments of a predicate.
const MOST_ARGS: usize = 100;
/// The greatest number of variables of a clause.
const MOST_VARS: usize = 10_000;

/// A change of the rules of a program that waits for the end of its text.
pub(crate) enum Staged {
    /// The predicate is defined again, or no more: what it had is forgotten.
    Clear(PredId),
    /// Clauses of an open predicate that stood at a place are forgotten.
    Forget(PredId, Place),
    /// A new clause.
    Clause(Clause),
    /// A new fact.
    Fact(PredId, Vec<Value>),
}

impl Staged {
    /// Does it.
    pub(crate) fn apply(self, rules: &mut Rules) {
        match self {
            Staged::Clear(id) => rules.clear(id),
            Staged::Forget(id, place) => rules.forget(id, place),
            Staged::Clause(clause) => rules.add(clause),
            Staged::Fact(id, args) => rules.add_fact(id, args),
        }
    }
}

/// A clause that is being resolved.
pub(crate) struct Rule {
    module: ModuleId,
    vars: Vec<Variable>,
    names: FxHashMap<Symbol, VarNo>,
    /// Names that `exists` has brought in, innermost last.
    locals: Vec<(Symbol, VarNo)>,
    /// The goals around that variables do not leave: `not`, `findall` …
    closed: usize,
    /// The goals around that a cut cannot leave.
    opaque: Vec<&'static str>,
    /// There were more variables than there may be, and that has been said.
    full: bool,
}

/// A variable of a clause.
struct Variable {
    name: Symbol,
    /// Where it occurs first.
    span: Span,
    /// How often it is written.
    count: usize,
    /// It occurs where its value can be seen from outside.
    seen: bool,
    /// It belongs to an `exists`, or the compiler has made it.
    local: bool,
}

impl Rule {
    fn new(module: ModuleId) -> Rule {
        Rule {
            module,
            vars: Vec::new(),
            names: FxHashMap::default(),
            locals: Vec::new(),
            closed: 0,
            opaque: Vec::new(),
            full: false,
        }
    }

    fn add(&mut self, name: Symbol, span: Span, local: bool) -> VarNo {
        // What is over the limit has been reported: any number will do.
        let number = self.vars.len().min(MOST_VARS) as VarNo;
        if self.vars.len() < MOST_VARS + 1 {
            self.vars.push(Variable { name, span, count: 0, seen: false, local });
        }
        number
    }

    /// The variable of this name, as it is written at a place.
    fn var(&mut self, name: Symbol, span: Span) -> VarNo {
        let local = self.locals.iter().rev().find(|(known, _)| *known == name);
        let known = local.map(|(_, var)| *var).or_else(|| self.names.get(&name).copied());
        let var = known.unwrap_or_else(|| {
            let var = self.add(name, span, false);
            self.names.insert(name, var);
            var
        });
        let variable = &mut self.vars[var as usize];
        variable.count += 1;
        variable.seen |= self.closed == 0;
        var
    }

    /// A variable that the compiler needs.
    fn hidden(&mut self, span: Span) -> VarNo {
        let name = Symbol::from(&format!("?%{}", self.vars.len()));
        self.add(name, span, true)
    }

    /// A variable of an `exists`. Its name is told from others of the clause where it is shown.
    fn local(&mut self, name: Symbol, span: Span) -> VarNo {
        let shown = match self.vars.iter().any(|var| var.name == name) {
            true => Symbol::from(&format!("{name}%{}", self.vars.len())),
            false => name,
        };
        let var = self.add(shown, span, true);
        self.locals.push((name, var));
        var
    }

    pub(crate) fn var_names(&self) -> Vec<Symbol> {
        self.vars.iter().map(|var| var.name).collect()
    }

    /// Where each variable occurs first.
    pub(crate) fn var_spans(&self) -> Vec<Span> {
        self.vars.iter().map(|var| var.span).collect()
    }
}

/// A span as the machine keeps it.
pub(crate) fn place(span: Span) -> Place {
    Place { file: span.file.0, start: span.start, end: span.end }
}

/// The name under which modules know a predicate.
pub(crate) fn key(name: Symbol, arity: usize) -> Symbol {
    Symbol::from(&format!("{name}/{arity}"))
}

impl Compiler<'_> {
    /// The predicate of this name and number of arguments that a module sees; an error has been
    /// reported if two have this name.
    fn predicate(&mut self, module: ModuleId, name: Symbol, arity: usize, at: Span) -> Option<PredId> {
        match self.look_up(module, key(name, arity)) {
            Found::One(definition) => match definition.meaning {
                Meaning::Predicate(id, _) => Some(id),
                _ => None,
            },
            Found::Two(one, other) => {
                let name = key(name, arity).to_string();
                self.error(crate::CompileError::Ambiguous { name, one, other, at });
                None
            }
            Found::None => None,
        }
    }

    /// What is nested in another form; `too_deep` is what stands for what is nested in too many.
    fn nested<T>(&mut self, at: Span, too_deep: T, inner: impl FnOnce(&mut Self) -> T) -> T {
        self.depth += 1;
        let it = if self.depth > MOST_NESTED + 1 {
            self.error(crate::CompileError::TooDeep { limit: MOST_NESTED, at });
            too_deep
        } else {
            inner(self)
        };
        self.depth -= 1;
        it
    }

    /// The scope of goals that are only known when they run, for a clause of this module.
    fn scope(&mut self, module: ModuleId) -> u32 {
        self.program.rules.scopes.entry(module.0).or_default();
        module.0
    }

    /// Says what names mean in goals that are only known when they run.
    fn fill_scopes(&mut self) {
        let mut modules: Vec<u32> = self.program.rules.scopes.keys().copied().collect();
        if modules.is_empty() {
            return;
        }
        modules.sort_unstable();
        let as_rules_have_it = |key: Symbol| {
            let (name, arity) = crate::module::predicate_key(key)?;
            Some((Symbol::from(name), u8::try_from(arity).ok()?))
        };
        for module in modules {
            let id = ModuleId(module);
            let mut scope = Scope::default();
            for key in self.modules.visible(id) {
                let Some(name) = as_rules_have_it(key) else { continue };
                let meant = match self.modules.look_up(id, key) {
                    Found::One(Definition { meaning: Meaning::Predicate(predicate, _), .. }) => {
                        Some(predicate)
                    }
                    Found::Two(..) => None,
                    _ => continue,
                };
                scope.insert(name, meant);
            }
            self.program.rules.scopes.insert(module, scope);
        }
        let mut everywhere = Scope::default();
        let names = self.modules.iter().flat_map(|(_, module)| &module.names);
        for (key, definition) in names.filter(|(key, _)| !crate::module::is_private(**key)) {
            if let (Some(name), Meaning::Predicate(predicate, _)) =
                (as_rules_have_it(*key), &definition.meaning)
            {
                let known = everywhere.entry(name).or_insert(Some(*predicate));
                *known = known.filter(|known| known == predicate);
            }
        }
        self.program.rules.everywhere = everywhere;
    }

    /// Makes rule code of the clauses that have changed.
    pub(crate) fn link_rules(&mut self) {
        const MOST: usize = 200;
        self.fill_scopes();
        for place in self.program.rules.link() {
            let at = Span { file: grammar::FileId(place.file), start: place.start, end: place.end };
            self.error(crate::CompileError::ClauseTooLarge { limit: MOST, at });
        }
    }

    /// The numbers of arguments that predicates of this name have.
    pub(crate) fn arities(&self, module: ModuleId, name: Symbol) -> Vec<usize> {
        let arity = |key: &Symbol| {
            let (known, arity) = crate::module::predicate_key(*key)?;
            (known == name.as_str()).then_some(arity)
        };
        let modules = std::iter::once(module).chain(self.within.iter().copied());
        let visible = modules.flat_map(|module| self.modules.visible(module));
        let mut arities: Vec<usize> = visible.collect::<Vec<_>>().iter().filter_map(arity).collect();
        arities.sort_unstable();
        arities.dedup();
        arities
    }
}

/// `a, b and c`
pub(crate) fn in_words(items: &[String], last: &str) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., end] => format!("{} {last} {end}", first.join(", ")),
    }
}

/// `1 argument`, `2 or 3 arguments`
pub(crate) fn arguments(arities: &[usize]) -> String {
    let words: Vec<String> = arities.iter().map(usize::to_string).collect();
    let plural = if arities == [1] { "" } else { "s" };
    format!("{} argument{plural}", in_words(&words, "or"))
}
