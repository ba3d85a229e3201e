//! Rules: Horn clauses over facts, trees and values.
//!
//! [`clause`] is what the compiler makes of the text, [`lower`] makes instructions of it ([`op`]),
//! [`engine`] runs them on the terms of a [`store`]: its loop is in [`steps`], its calls in [`call`], what it goes
//! back to in [`choice`]. [`index`] finds the clauses and facts that can answer a call; [`join`] answers goals that
//! stand in a row and ask a tree ([`view`]), which shows edits that have not run ([`overlay`]); [`control`] knows goals
//! that are data; [`gc`] takes away terms that nothing needs; [`tabling`] keeps what has been answered; [`native`] and
//! [`tree`] are predicates that are written in Rust; [`why`] explains, with the clauses as text ([`show`]).

mod call;
mod choice;
pub mod clause;
mod collect;
pub mod control;
mod copies;
pub mod engine;
mod gc;
pub mod index;
pub mod join;
mod live;
pub mod lower;
mod moves;
pub mod native;
pub mod nearest;
pub mod op;
mod overlay;
pub mod plan;
mod segment;
pub mod show;
mod steps;
pub mod store;
pub mod stream;
mod structure;
pub mod tabling;
pub mod tree;
pub mod view;
pub mod why;

use std::rc::Rc;

use rustc_hash::FxHashMap;

use clause::{Clause, Declared, Kind, PredId};
use index::{ClauseIndex, Facts};
use join::Join;
use lower::Keys;
use native::NativeRule;
use op::RuleOp;
use store::{CONSTANT, Cell, Outside};

use crate::code::{Pc, Place};
use crate::value::{Symbol, Value};
use view::TreeView;

/// The name of the predicate that says which plan performs an action.
pub const GROUNDING: &str = "action-grounding";

/// The name of the predicate that says whether the goal of an action holds, a list.
const GOAL: &str = "%goal-holds";

/// Four megabytes: most queries end before.
const COLLECT_FROM: usize = (4 << 20) / size_of::<Cell>();

/// Where code fails.
pub(crate) const FAIL: Pc = Pc(2);

/// All rules of a program. Like its code it only grows, but clauses may be taken away.
pub struct Rules {
    /// The predicates.
    pub predicates: Vec<Predicate>,
    /// Instructions of all clauses.
    pub code: Vec<RuleOp>,
    /// Where each instruction comes from.
    pub places: Vec<Place>,
    /// Which predicate the instructions from here on belong to.
    pub extents: Vec<(Pc, PredId)>,
    /// Lists of clauses that indexes refer to.
    pub lists: Vec<Pc>,
    /// Constants of clauses and facts.
    pub constants: Rc<Vec<Value>>,
    /// The same as cells.
    pub cells: Vec<Cell>,
    /// Shapes and keys of structures in clauses.
    pub templates: Vec<Keys>,
    /// The predicate that says which plan performs an action, if a module declares it.
    pub grounding: Option<PredId>,
    /// The predicate that says whether a goal holds that is data.
    pub(crate) goal: Option<PredId>,
    /// Cells that a query may have before it looks for garbage. Tests make it small.
    pub collect_from: usize,
    /// The predicates that look tasks up below another one: directly, and anywhere.
    pub(crate) look_ups: [Option<PredId>; 2],
    /// Goals over trees that are answered together: see [`join`].
    pub joins: Vec<Rc<Join>>,
    constant_index: FxHashMap<u64, Vec<u32>>,
    /// The predicate that solves goals of the language which are only known when they run.
    solver: Option<PredId>,
    /// What names in such goals mean, by the number of the module whose clause calls them: for those
    /// modules that do. The compiler fills it.
    pub scopes: FxHashMap<u32, control::Scope>,
    /// What they mean where that is not known.
    pub everywhere: control::Scope,
    /// Predicates that have changed since they were compiled.
    changed: Vec<PredId>,
}

impl Default for Rules {
    fn default() -> Rules {
        let mut rules = Rules {
            predicates: Vec::new(),
            // Where a query goes on when it holds, a clause of a table, and what has found nothing yet.
            code: vec![RuleOp::Answer, RuleOp::TableAnswer, RuleOp::Fail],
            places: vec![Place::default(); 3],
            extents: Vec::new(),
            lists: Vec::new(),
            constants: Rc::default(),
            cells: Vec::new(),
            templates: Vec::new(),
            grounding: None,
            goal: None,
            collect_from: COLLECT_FROM,
            look_ups: [None; 2],
            joins: Vec::new(),
            solver: None,
            scopes: FxHashMap::default(),
            everywhere: control::Scope::default(),
            constant_index: FxHashMap::default(),
            changed: Vec::new(),
        };
        // The goals of joins come first, so that their numbers follow from their arguments.
        for arity in 1..=plan::MOST_JOINED as u8 + 1 {
            let name = Symbol::from(join::NAME);
            let (kind, place) = (Kind::Native, Place::default());
            rules.declare(Declared { name, arity, kind, tabled: false, place });
        }
        rules
    }
}

/// A predicate with its clauses.
pub struct Predicate {
    /// What is known of it.
    pub declared: Declared,
    /// Its clauses, in the order in which they are tried.
    pub clauses: Vec<Clause>,
    /// The arguments of its facts.
    pub facts: Vec<Vec<Value>>,
    /// It is code, and nothing more has to be looked at.
    is_plain: bool,
    index: ClauseIndex,
    /// Where the code of each clause begins.
    entries: Vec<Pc>,
    /// The clauses as they are written, where the planner has changed some: for explanations.
    written: Option<ClauseIndex>,
    /// Clauses of which the planner has changed the order of goals.
    pub planned: Vec<Option<Clause>>,
    /// Predicates that stand in the place of calls in its clauses.
    inlined: Vec<PredId>,
    table: Rc<Facts>,
    native: Option<NativeRule>,
    /// A query for it may look at a tree.
    sees_tree: bool,
    /// A query for it may call functions, which may look at the world.
    sees_world: bool,
}

/// What a query asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ask {
    /// `(ask goal)`: true or false.
    Whether,
    /// `(answers template goal)`: a list of all.
    All,
    /// `(query goal)`: a stream.
    Stream,
}

/// What a query sees besides rules: all as it was when the query was opened.
#[derive(Clone, Default)]
pub struct View {
    /// Facts that are in force for a while, the newest first.
    pub scoped: Vec<(PredId, Rc<Facts>)>,
    /// The task tree.
    pub tree: Rc<TreeView>,
}

impl Outside for View {
    fn task(&self, task: u32) -> Value {
        self.tree.path_value(task)
    }
}

impl Rules {
    /// A new predicate without clauses.
    pub fn declare(&mut self, declared: Declared) -> PredId {
        let native = match declared.kind {
            Kind::Native => native::find(&declared.name, declared.arity),
            _ => None,
        };
        self.predicates.push(Predicate {
            declared,
            clauses: Vec::new(),
            facts: Vec::new(),
            is_plain: false,
            index: ClauseIndex::default(),
            entries: Vec::new(),
            written: None,
            planned: Vec::new(),
            inlined: Vec::new(),
            table: Rc::default(),
            native,
            sees_tree: false,
            sees_world: false,
        });
        let id = PredId(self.predicates.len() as u32 - 1);
        let it = &self.predicates[id.at()].declared;
        if it.name == GROUNDING && it.arity == 2 && self.grounding.is_none() {
            self.grounding = Some(id);
        }
        if it.name == GOAL && it.arity == 2 && self.goal.is_none() {
            self.goal = Some(id);
        }
        if (it.name.as_str(), it.arity) == control::SOLVER && self.solver.is_none() {
            self.solver = Some(id);
        }
        match (it.name.as_str(), it.arity, it.kind) {
            ("subtask-with", 4, Kind::Native) => self.look_ups[0] = Some(id),
            ("subtask+-with", 4, Kind::Native) => self.look_ups[1] = Some(id),
            _ => {}
        }
        id
    }

    /// Adds a clause; see [`Clause::priority`] for the order.
    pub fn add(&mut self, clause: Clause) {
        let Some(predicate) = self.predicates.get_mut(clause.predicate.at()) else { return };
        let rank = |it: &Clause| (std::cmp::Reverse(it.priority), std::cmp::Reverse(it.text));
        let at = predicate.clauses.partition_point(|it| rank(it) <= rank(&clause));
        self.changed.push(clause.predicate);
        predicate.clauses.insert(at, clause);
    }

    /// Adds a fact.
    pub fn add_fact(&mut self, predicate: PredId, args: Vec<Value>) {
        if let Some(it) = self.predicates.get_mut(predicate.at()) {
            it.facts.push(args);
            self.changed.push(predicate);
        }
    }

    /// Forgets the clauses and facts of a predicate.
    pub fn clear(&mut self, predicate: PredId) {
        if let Some(it) = self.predicates.get_mut(predicate.at()) {
            it.clauses.clear();
            it.facts.clear();
            self.changed.push(predicate);
        }
    }

    /// Forgets those clauses of a predicate that stand at a place.
    pub fn forget(&mut self, predicate: PredId, place: Place) {
        let inside = |it: Place| it.file == place.file && place.start <= it.start && it.end <= place.end;
        if let Some(it) = self.predicates.get_mut(predicate.at()) {
            it.clauses.retain(|clause| !inside(clause.place));
            self.changed.push(predicate);
        }
    }

    /// Compiles what has changed. Returns the clauses that have too many variables.
    pub fn link(&mut self) -> Vec<Place> {
        let mut changed = std::mem::take(&mut self.changed);
        self.add_dependents(&mut changed);
        changed.sort();
        changed.dedup();
        let mut refused = Vec::new();
        for id in changed {
            let mut joins = Vec::new();
            let planned: Vec<_> = (self.predicates[id.at()].clauses.iter())
                .map(|clause| plan::plan(self, clause, &mut joins))
                .collect();
            self.joins.extend(joins);
            let clauses = std::mem::take(&mut self.predicates[id.at()].clauses);
            let written = self.compile(clauses.iter(), &mut refused);
            let entries = written.iter().map(|clause| clause.0).collect();
            let is_planned = planned.iter().any(Option::is_some);
            let (code, plain) = match is_planned {
                true => {
                    let better = clauses.iter().zip(&planned);
                    let better = better.map(|(it, planned)| planned.as_ref().map_or(it, |it| &it.clause));
                    let code = self.compile(better, &mut refused);
                    (code, Some(ClauseIndex::new(&written, &mut self.lists)))
                }
                false => (written, None),
            };
            let inlined = planned.iter().flatten().flat_map(|it| it.inlined.iter().copied()).collect();
            let facts = std::mem::take(&mut self.predicates[id.at()].facts);
            let cells = facts.iter().flatten().map(|value| self.cell(value)).collect();
            let index = ClauseIndex::new(&code, &mut self.lists);
            let it = &mut self.predicates[id.at()];
            (it.entries, it.written, it.inlined) = (entries, plain, inlined);
            it.planned = planned.into_iter().map(|it| it.map(|it| it.clause)).collect();
            it.table = Rc::new(Facts::new(it.declared.arity.into(), cells));
            (it.clauses, it.facts, it.index) = (clauses, facts, index);
            it.is_plain = it.table.is_empty() && it.native.is_none() && !it.declared.tabled;
        }
        self.look_around();
        refused
    }

    fn compile<'c>(
        &mut self,
        clauses: impl Iterator<Item = &'c Clause>,
        refused: &mut Vec<Place>,
    ) -> Vec<(Pc, Vec<Option<index::Key>>)> {
        let mut code = Vec::new();
        for clause in clauses {
            match lower::lower(self, clause) {
                Ok(lowered) => code.push((lowered.entry, lowered.keys)),
                Err(lower::TooManyVariables) => refused.push(clause.place),
            }
        }
        code
    }

    /// What has been put in the place of a call has to be put there again when it changes.
    fn add_dependents(&self, changed: &mut Vec<PredId>) {
        let mut at = 0;
        while let Some(id) = changed.get(at).copied() {
            at += 1;
            let dependents = self.predicates.iter().enumerate().filter(|it| it.1.inlined.contains(&id));
            let new: Vec<PredId> =
                dependents.map(|it| PredId(it.0 as u32)).filter(|id| !changed.contains(id)).collect();
            changed.extend(new);
        }
    }

    /// Finds out which predicates may look at a tree, and which at the world.
    fn look_around(&mut self) {
        let on_trees = |it: &Predicate| tree::TABLE.iter().any(|native| it.declared.name == native.0);
        let asks = |it: &Predicate| it.clauses.iter().any(|clause| clause.body.calls_functions());
        for it in &mut self.predicates {
            it.sees_tree = it.native.is_some() && on_trees(it);
            it.sees_world = asks(it);
        }
        loop {
            let calls = |it: &Predicate, sees: &dyn Fn(&Predicate) -> bool| {
                let sees = |id: PredId| sees(&self.predicates[id.at()]);
                it.clauses.iter().any(|clause| clause.body.calls(&sees))
            };
            let more = |it: &Predicate| {
                let tree = !it.sees_tree && calls(it, &|other| other.sees_tree);
                let world = !it.sees_world && calls(it, &|other| other.sees_world);
                (tree || world).then_some((tree, world))
            };
            let all = self.predicates.iter().enumerate();
            let found: Vec<_> = all.filter_map(|(at, it)| Some((at, more(it)?))).collect();
            if found.is_empty() {
                return;
            }
            for (at, (tree, world)) in found {
                self.predicates[at].sees_tree |= tree;
                self.predicates[at].sees_world |= world;
            }
        }
    }

    /// The predicate of joins with so many arguments.
    pub(crate) fn join_of(&self, args: usize) -> PredId {
        PredId(args as u32)
    }

    /// True if the predicate is written in Rust.
    #[must_use]
    pub fn is_native(&self, predicate: PredId) -> bool {
        self.predicates.get(predicate.at()).is_some_and(|it| it.native.is_some())
    }

    /// True if a query for the predicate may look at a tree.
    #[must_use]
    pub fn sees_tree(&self, predicate: PredId) -> bool {
        self.predicates.get(predicate.at()).is_some_and(|it| it.sees_tree)
    }

    /// True if a query for the predicate may look at the world.
    #[must_use]
    pub fn sees_world(&self, predicate: PredId) -> bool {
        self.predicates.get(predicate.at()).is_some_and(|it| it.sees_world)
    }

    /// A constant as its number.
    pub fn constant(&mut self, value: &Value) -> u32 {
        let known = self.constant_index.entry(index::hash_value(value)).or_default();
        if let Some(at) = known.iter().find(|at| self.constants[**at as usize] == *value) {
            return *at;
        }
        let at = self.constants.len() as u32;
        known.push(at);
        Rc::make_mut(&mut self.constants).push(value.clone());
        self.cells.push(match value {
            Value::Imm(imm) => Cell::Imm(*imm),
            Value::Obj(_) => Cell::Obj(CONSTANT + at),
        });
        at
    }

    /// A constant as a cell.
    pub fn cell(&mut self, value: &Value) -> Cell {
        match value {
            Value::Imm(imm) => Cell::Imm(*imm),
            Value::Obj(_) => {
                let at = self.constant(value);
                self.cells[at as usize]
            }
        }
    }

    /// The predicate of this name and number of arguments that was declared last.
    #[must_use]
    pub fn find(&self, name: Symbol, arity: usize) -> Option<PredId> {
        let at = self
            .predicates
            .iter()
            .rposition(|it| it.declared.name == name && usize::from(it.declared.arity) == arity)?;
        Some(PredId(at as u32))
    }

    /// One past the last instruction of a clause.
    fn clause_end(&self, pc: Pc) -> Pc {
        let after = self.extents.partition_point(|(entry, _)| *entry <= pc);
        self.extents.get(after).map_or(Pc(self.code.len() as u32), |next| next.0)
    }

    /// The predicate that an instruction belongs to.
    #[must_use]
    pub fn predicate_at(&self, pc: Pc) -> Option<PredId> {
        let after = self.extents.partition_point(|(entry, _)| *entry <= pc);
        Some(self.extents.get(after.checked_sub(1)?)?.1)
    }
}
