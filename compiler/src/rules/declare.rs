//! Which predicates a text defines: `def-rules`, `def-facts`, `def-open`, `def-native-rule`.
//!
//! Clauses are only cut out here; [`super::clause`] resolves them when all names are known.

use grammar::{Form, FormKind, Span};
use vm::code::{Params, Place};
use vm::rules::clause::{Declared, Kind, PredId};
use vm::value::Symbol;

use super::{MOST_ARGS, Staged, goal, key, place};
use crate::Compiler;
use crate::define::{Text, one_with_doc};
use crate::error::CompileError;
use crate::module::{Definition, Found, Meaning, ModuleId};

/// The heads of the forms that are declared here.
pub(crate) const DEFINITIONS: [&str; 4] = ["def-rules", "def-facts", "def-open", "def-native-rule"];

/// A `def-rules` or `def-facts`.
pub(crate) struct Group {
    pub(super) module: ModuleId,
    /// The modules of the macros that made it.
    pub(super) within: Vec<ModuleId>,
    /// True for `def-facts`.
    pub(super) facts: bool,
    pub(super) clauses: Vec<(PredId, Form)>,
}

/// What a REPL remembers of a group, to replace it.
#[derive(Debug, Clone)]
pub(crate) struct Known {
    place: Place,
    predicates: Vec<(Symbol, PredId)>,
}

/// A group that is being declared.
struct Work<'f> {
    form: &'f Form,
    heading: Symbol,
    tabled: bool,
    facts: bool,
    doc: Option<Box<str>>,
    predicates: Vec<(Symbol, PredId)>,
    /// Predicates of the group that are not open.
    own: Vec<PredId>,
}

impl Compiler<'_> {
    /// `(def-rules …)` and its relatives; `name` is the one after the head.
    pub(crate) fn declare_rules(&mut self, work: &mut Text, form: &Form) {
        let items = form.list().unwrap_or_default();
        let Some(name) = items.get(1).and_then(Form::symbol) else {
            return self.misshapen_top(form, "needs a symbol as name");
        };
        match form.head().unwrap_or_default().as_str() {
            "def-open" => self.def_open_predicate(work, form, name, &items[2..]),
            "def-native-rule" => self.def_native_rule(work, form, name, &items[2..]),
            // Which of its predicates are open is known when all forms have been seen.
            _ => work.rules.push((form.clone(), self.within.clone())),
        }
    }

    /// Declares the predicates of the groups that wait for it.
    pub(crate) fn declare_groups(&mut self, work: &mut Text) {
        for (form, within) in std::mem::take(&mut work.rules) {
            let around = std::mem::replace(&mut self.within, within);
            self.declare_group(work, &form);
            self.within = around;
        }
    }

    fn declare_group(&mut self, work: &mut Text, form: &Form) {
        let items = form.list().unwrap_or_default();
        let heading = items[1].symbol().unwrap_or_default();
        let facts = form.head().is_some_and(|head| head == "def-facts");
        let mut group =
            Work { form, heading, tabled: false, facts, doc: None, predicates: Vec::new(), own: Vec::new() };
        let mut rest = &items[2..];
        loop {
            match rest {
                [Form { kind: FormKind::Keyword(word), .. }, after @ ..] if *word == "tabled" && !facts => {
                    group.tabled = true;
                    rest = after;
                }
                [Form { kind: FormKind::Str(doc), .. }, after @ ..] if group.doc.is_none() => {
                    group.doc = Some(doc.clone());
                    rest = after;
                }
                _ => break,
            }
        }
        let mut clauses = Vec::new();
        for clause in rest {
            let head = if facts { Some(clause) } else { self.head_of(form, clause) };
            let Some((name, args)) = head.and_then(|head| self.name_of(form, head)) else { continue };
            let Some(id) =
                self.predicate_of(work, &mut group, name, args, head.map_or(clause.span, |it| it.span))
            else {
                continue;
            };
            clauses.push((id, clause.clone()));
        }
        self.describe(work, &group, &clauses);
        self.replace_group(work, group);
        let (module, within) = (work.module, self.within.clone());
        work.groups.push(Group { module, within, facts, clauses });
    }

    /// The head of a clause.
    fn head_of<'f>(&mut self, group: &Form, clause: &'f Form) -> Option<&'f Form> {
        match clause.list() {
            Some([arrow, head, ..]) if arrow.is("<-") => Some(head),
            Some([arrow]) if arrow.is("<-") => {
                self.misshapen_top(clause, "has no head");
                None
            }
            _ => {
                let form = group.head().unwrap_or_default().to_string();
                let (problem, shape) = ("has a part that is no clause".into(), "(<- (head …) goal…)".into());
                self.error(CompileError::Shape { form, problem, shape, at: clause.span });
                None
            }
        }
    }

    /// Name and arguments of a head or fact.
    fn name_of<'f>(&mut self, group: &Form, head: &'f Form) -> Option<(Symbol, &'f [Form])> {
        let name = head.head().filter(|name| !name.starts_with('?') && *name != "<-");
        let Some((name, args)) = name.zip(head.list().and_then(|items| items.get(1..))) else {
            let form = group.head().unwrap_or_default().to_string();
            let problem = "has a head that is not written (predicate argument …)".into();
            let shape =
                if form == "def-facts" { "(predicate argument …)" } else { "(<- (head …) goal…)" };
            self.error(CompileError::Shape { form, problem, shape: shape.into(), at: head.span });
            return None;
        };
        if let Some(shape) = goal::shape(&name) {
            let (name, shape) = (name.to_string(), shape.to_string());
            self.error(CompileError::Reserved { name, shape, at: head.span });
            return None;
        }
        if args.len() > MOST_ARGS {
            let (has, got) = (format!("at most {MOST_ARGS} arguments"), args.len());
            let help = Some("put some of them into a list".into());
            self.error(CompileError::PredicateArity {
                name: name.to_string(),
                has,
                got,
                at: head.span,
                help,
            });
            return None;
        }
        Some((name, args))
    }

    /// The predicate that a clause belongs to, which is declared if this is its first clause.
    fn predicate_of(
        &mut self,
        work: &Text,
        group: &mut Work<'_>,
        name: Symbol,
        args: &[Form],
        span: Span,
    ) -> Option<PredId> {
        let key = key(name, args.len());
        if let Some((_, id)) = group.predicates.iter().find(|(known, _)| *known == key) {
            return Some(*id);
        }
        let own = self.modules.get(work.module).names.get(&key).cloned();
        let visible = match &own {
            Some(definition) => Some(definition.clone()),
            None => match self.look_up(work.module, key) {
                Found::One(definition) => Some(definition),
                _ => None,
            },
        };
        if let Some(Definition { meaning: Meaning::Predicate(id, _), .. }) = visible
            && self.open_predicates.contains(&id)
        {
            group.predicates.push((key, id));
            return Some(id);
        }
        let declared = Declared {
            name,
            arity: args.len() as u8,
            kind: if group.facts { Kind::Facts } else { Kind::Rules },
            tabled: group.tabled,
            place: place(group.form.span),
        };
        let id = self.declare_predicate(work, own, declared, span)?;
        group.predicates.push((key, id));
        group.own.push(id);
        Some(id)
    }

    /// A predicate of a module: a new one, or the one that a REPL defines again.
    fn declare_predicate(
        &mut self,
        work: &Text,
        known: Option<Definition>,
        declared: Declared,
        span: Span,
    ) -> Option<PredId> {
        let key = key(declared.name, declared.arity as usize);
        let id = match known {
            None => self.program.rules.declare(declared),
            // Each input of a REPL is a text of its own.
            Some(known) if work.again && known.span.file != span.file => match known.meaning {
                Meaning::Predicate(id, _) => {
                    self.program.rules.predicates[id.at()].declared = declared;
                    self.staged.push(Staged::Clear(id));
                    id
                }
                _ => self.program.rules.declare(declared),
            },
            Some(known) => {
                let open = format!("(def-open {} {})", declared.name, declared.arity);
                let (name, first) = (key.to_string(), known.span);
                self.error(CompileError::NotOpen { name, open, again: span, first });
                return None;
            }
        };
        let meaning = Meaning::Predicate(id, Params::default());
        self.modules.get_mut(work.module).names.insert(key, Definition { meaning, doc: None, span });
        Some(id)
    }

    /// Gives the predicates of a group their documentation: those that have the name of the group, or
    /// else all of them. Their arguments are called as the clauses call them.
    fn describe(&mut self, work: &Text, group: &Work<'_>, clauses: &[(PredId, Form)]) {
        let is_named = |id: &PredId| self.program.rules.predicates[id.at()].declared.name == group.heading;
        let named: Vec<PredId> = group.own.iter().copied().filter(is_named).collect();
        for (key, id) in &group.predicates {
            if !group.own.contains(id) {
                continue;
            }
            let heads = clauses.iter().filter(|(of, _)| of == id).map(|(_, clause)| match group.facts {
                true => clause,
                false => &clause.list().unwrap_or_default()[1],
            });
            let heads: Vec<&[Form]> = heads.map(|head| &head.list().unwrap_or_default()[1..]).collect();
            let params = params_of(&heads);
            let doc = group.doc.clone().filter(|_| named.is_empty() || named.contains(id));
            if let Some(known) = self.modules.get_mut(work.module).names.get_mut(key) {
                known.meaning = Meaning::Predicate(*id, params);
                known.doc = doc;
            }
        }
    }

    /// In a REPL a group takes the place of the one that had its name.
    fn replace_group(&mut self, work: &Text, group: Work<'_>) {
        let at = (work.module, group.heading);
        let here = place(group.form.span);
        let mut new = Known { place: here, predicates: group.predicates };
        if let Some(old) = self.groups.remove(&at) {
            if old.place.file == here.file {
                new.predicates.extend(old.predicates);
            } else if work.again {
                for (key, id) in old.predicates {
                    if self.open_predicates.contains(&id) {
                        self.staged.push(Staged::Forget(id, old.place));
                    } else if !new.predicates.contains(&(key, id)) {
                        self.staged.push(Staged::Clear(id));
                        self.modules.get_mut(work.module).names.remove(&key);
                    }
                }
            }
        }
        self.groups.insert(at, new);
    }

    // ------------------------------------------------------------------ single predicates

    fn def_open_predicate(&mut self, work: &mut Text, form: &Form, name: Symbol, rest: &[Form]) {
        let Some((arity, doc)) = one_with_doc(rest) else {
            return self.misshapen_top(form, "takes a name, a number of arguments, and perhaps a text");
        };
        let FormKind::Int(arity @ 0..=100) = arity.kind else {
            return self.misshapen_top(form, "needs a number of arguments up to 100");
        };
        let known = self.modules.get(work.module).names.get(&key(name, arity as usize));
        let known = known.map(|known| known.meaning.clone()).filter(|_| work.again);
        if let Some(Meaning::Predicate(id, _)) = known {
            // It keeps its clauses, and may get more.
            self.open_predicates.insert(id);
            return;
        }
        let declared =
            Declared { name, arity: arity as u8, kind: Kind::Rules, tabled: false, place: place(form.span) };
        if let Some(id) =
            self.single(work, form, declared, Params { required: arity as u8, ..Params::default() }, doc)
        {
            self.open_predicates.insert(id);
        }
    }

    fn def_native_rule(&mut self, work: &mut Text, form: &Form, name: Symbol, rest: &[Form]) {
        let Some((params, doc)) = one_with_doc(rest) else {
            return self.misshapen_top(form, "takes a name, arguments and a text");
        };
        let params = self.param_forms(params).params;
        let arity = params.names.len() as u8;
        if vm::rules::native::find(&name, arity).is_none() {
            let name = key(name, arity as usize).to_string();
            return self.error(CompileError::NoSuchNative { name, at: form.span });
        }
        let declared = Declared { name, arity, kind: Kind::Native, tabled: false, place: place(form.span) };
        self.single(work, form, declared, params, doc);
    }

    /// A predicate that a form of its own declares.
    fn single(
        &mut self,
        work: &Text,
        form: &Form,
        declared: Declared,
        params: Params,
        doc: Option<Box<str>>,
    ) -> Option<PredId> {
        let span = form.list().map_or(form.span, |items| items[1].span);
        if let Some(shape) = goal::shape(&declared.name) {
            let (name, shape) = (declared.name.to_string(), shape.to_string());
            self.error(CompileError::Reserved { name, shape, at: span });
            return None;
        }
        let key = key(declared.name, declared.arity as usize);
        let known = self.modules.get(work.module).names.get(&key).cloned();
        let id = self.declare_predicate(work, known, declared, span)?;
        if let Some(known) = self.modules.get_mut(work.module).names.get_mut(&key) {
            known.meaning = Meaning::Predicate(id, params);
            known.doc = doc;
        }
        Some(id)
    }
}

/// What the arguments are called: by the first variable that stands in their place, or else as they are
/// written in the first clause that has more than `()` there.
fn params_of(heads: &[&[Form]]) -> Params {
    let arity = heads.first().map_or(0, |head| head.len());
    let is_variable = |name: &Symbol| name.starts_with('?') && !name.starts_with("?_");
    let name = |at: usize| {
        let variable = heads.iter().filter_map(|head| head[at].symbol()).find(is_variable);
        let mut patterns = heads.iter().map(|head| &head[at]);
        let pattern = patterns.find(|form| form.list() != Some(&[])).unwrap_or(&heads[0][at]);
        variable.unwrap_or_else(|| Symbol::from(&pattern.to_string()))
    };
    Params { names: (0..arity).map(name).collect(), required: arity as u8, ..Params::default() }
}
