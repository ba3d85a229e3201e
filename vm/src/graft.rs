//! Grafts: the edits below one call of a plan, apart from the tree that they were made in.
//!
//! An edit holds at a slot, and a slot is known by its key. A graft keeps the keys of the places that its edits need,
//! in words that a text can carry: a call site is "the second call of `deliver` in `set-table`". So the same edits can
//! be made below another call of the plan, in another tree, in another version of the program; the machine does that
//! when the call is made. A place that a program has no more is nowhere, and takes its edits along.
//!
//! ```text
//! (set-table                              the call itself
//!   (transporting :for milk               the round for milk of the loop around it
//!     (delivering :in transport))         in the body of `transport`, which performs it
//!   (transporting :call 2 :for cup))      what paths call `(transporting :call 2)`
//! (log :edit 1)                           beside the call, in the code of the first edit
//! ```

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use rustc_hash::FxHashMap;

use crate::code::{FnId, FnKind, Program, SiteId};
use crate::edit::{Edit, What};
use crate::key::{Element, Step};
use crate::path::{Path, PathStep};
use crate::print::{LIMIT, Printer};
use crate::tree::{ROOT, SlotId, Tree};
use crate::value::{Imm, Obj, Symbol, Value};

/// The place that the call stands in.
pub const AROUND: usize = 0;
/// The place of the call itself.
pub const CALL: usize = 1;

/// Edits below a call, and the places that they need.
#[derive(Debug, Clone, Default)]
pub struct Graft {
    /// Parents before children: [`AROUND`], [`CALL`], what is below these.
    pub places: Vec<Place>,
    /// In the order of making.
    pub edits: Vec<Change>,
    /// What has no place here, in sentences.
    pub lost: Vec<String>,
}

/// A place of a graft.
#[derive(Debug, Clone)]
pub struct Place {
    /// The one above.
    pub above: usize,
    /// What is called there, and what paths of the edits say for it.
    pub step: PathStep,
    /// The call site; none for the call and what is around it.
    pub site: Option<Words>,
    /// The site itself, if the graft comes from a tree of this program.
    pub known: Option<SiteId>,
    /// The way from the task above to the site.
    pub way: Vec<Link>,
    /// The plan that was called there, where the source does not say which.
    pub called: Option<FnId>,
}

impl Place {
    /// True if it stands in the code of this edit of the graft.
    #[must_use]
    pub fn comes_from(&self, edit: usize) -> bool {
        matches!(self.way.first(), Some(Link::Edit(number)) if *number as usize == edit)
    }
}

/// A call site in words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Words {
    /// The function that the call stands in; nothing for the code of the edit that it comes from.
    pub owner: Option<Symbol>,
    /// Which of the functions inside of that one: lambdas, branches; zero for itself.
    pub inner: u32,
    /// What is called.
    pub name: Symbol,
    /// Its number among the calls of that name there, from 1.
    pub nth: u32,
}

/// A step of a key.
#[derive(Debug, Clone, PartialEq)]
pub enum Link {
    /// One that says the same everywhere.
    Same(Step),
    /// The call of a function.
    Through(Words, Option<SiteId>),
    /// The code of an edit of the graft, from 1.
    Edit(u32),
}

/// An edit of a graft.
#[derive(Debug, Clone)]
pub struct Change {
    /// Where.
    pub place: usize,
    /// With the paths that the places have in the graft.
    pub edit: Rc<Edit>,
    /// The places that it waits for.
    pub after: Vec<usize>,
    /// The rounds that stood between.
    pub between: BTreeMap<usize, Vec<Step>>,
    /// Its code, if the graft comes from a tree of this program.
    pub code: Option<FnId>,
    /// Who made it, in words for people.
    pub origin: Rc<str>,
}

// ---------------------------------------------------------------------------------------------
// Sites in words

/// Functions in the order of their code: those inside of another one stand right before it.
fn with_inner(program: &Program, function: FnId) -> Option<(usize, usize)> {
    let entry = program.functions.get(function.at())?.entry;
    let first = program.extents.partition_point(|(at, _)| *at < entry);
    let same = program.extents[first..].iter().take_while(|(at, _)| *at == entry);
    let at = first + same.map(|(_, id)| *id).position(|id| id == function)?;
    let before = program.extents[..at].iter().rev();
    Some((at, before.take_while(|(_, id)| is_inner(program, *id)).count()))
}

fn is_inner(program: &Program, function: FnId) -> bool {
    matches!(program.functions[function.at()].kind, FnKind::Lambda | FnKind::Branch)
}

impl Words {
    /// The words for a site.
    #[must_use]
    pub fn of(program: &Program, site: SiteId) -> Option<Words> {
        let it = program.sites.get(site.at())?;
        let range = program.functions[it.owner.at()].sites.clone();
        let same = (range.start..=site.0).filter(|at| program.sites[*at as usize].name == it.name);
        let nth = same.count() as u32;
        let (mut owner, mut inner) = (it.owner, 0);
        if is_inner(program, owner) {
            let (at, before) = with_inner(program, owner)?;
            inner = before as u32 + 1;
            let outer = program.extents[at..].iter().map(|(_, id)| *id);
            owner = outer.into_iter().find(|id| !is_inner(program, *id))?;
        }
        let function = &program.functions[owner.at()];
        let owner = Some(function.name).filter(|_| function.kind != FnKind::Inserted);
        Some(Words { owner, inner, name: it.name, nth })
    }

    /// The site that they mean in the function `owner`, or in one inside of that.
    #[must_use]
    pub fn find_in(&self, program: &Program, owner: FnId) -> Option<SiteId> {
        let mut owner = owner;
        if let Some(inner) = self.inner.checked_sub(1) {
            let (at, before) = with_inner(program, owner)?;
            let inner = (inner as usize) < before;
            let first = at.checked_sub(before)?;
            owner = inner.then(|| program.extents[first + self.inner as usize - 1].1)?;
        }
        let range = program.functions[owner.at()].sites.clone();
        let mut same = range.filter(|at| program.sites[*at as usize].name == self.name);
        same.nth(self.nth.checked_sub(1)? as usize).map(SiteId)
    }

    /// The site that they mean: in the code of an edit, in the plan that is called above it, else in the first function
    /// of that name that has it.
    #[must_use]
    pub fn find(&self, program: &Program, code: Option<FnId>, above: Option<FnId>) -> Option<SiteId> {
        let Some(owner) = self.owner else { return self.find_in(program, code?) };
        let named = |id: &FnId| {
            let it = &program.functions[id.at()];
            it.name == owner && !matches!(it.kind, FnKind::Inserted | FnKind::Lambda | FnKind::Branch)
        };
        let all = (0..program.functions.len() as u32).map(FnId);
        let mut candidates = above.into_iter().chain(all).filter(named);
        candidates.find_map(|function| self.find_in(program, function))
    }
}

// ---------------------------------------------------------------------------------------------
// From a tree

impl Graft {
    /// A graft without edits.
    #[must_use]
    pub fn empty(plan: Symbol) -> Graft {
        let place = |name| Place {
            above: AROUND,
            step: PathStep { name, call: 1 },
            site: None,
            known: None,
            way: Vec::new(),
            called: None,
        };
        Graft { places: vec![place(Symbol::from("top-level")), place(plan)], ..Graft::default() }
    }

    /// The edits of a tree.
    ///
    /// # Errors
    /// A sentence that says why there are none to be had.
    pub fn of_tree(program: &Program, tree: &Tree) -> Result<Graft, String> {
        let root = tree.root_plan();
        if root == ROOT {
            return Err("no plan has been run in the tree".into());
        }
        let mut graft = Graft::empty(tree.slot(root).name);
        graft.places[CALL].step.call = Labels::default().of(tree, root);
        let mut at: Vec<SlotId> = vec![SlotId(0); tree.edits.len() + 1];
        for slot in tree.slots().filter(|slot| !tree.edits_of(*slot).is_empty()) {
            tree.edits_of(slot).iter().for_each(|number| at[*number as usize] = slot);
        }
        let mut numbers = vec![0u32; tree.edits.len() + 1];
        // Edits that stand outside of the plan leave no number.
        let inside = |slot: SlotId| {
            let mut up =
                std::iter::successors(Some(slot), |at| Some(tree.slot(*at).parent).filter(|it| it.0 != 0));
            up.any(|at| at == root) || is_beside(tree, slot)
        };
        let mut last = 0;
        for (number, accepted) in (1..).zip(tree.edits.iter()) {
            if inside(at[number]) && accepted.after.iter().all(|slot| inside(*slot)) {
                last += 1;
                numbers[number] = last;
            }
        }
        let mut places =
            Taken { program, tree, root, known: FxHashMap::default(), labels: Labels::default() };
        // Places stand in the order of the slots, which are siblings in that order where a run does not tell them apart.
        let mut wanted: BTreeSet<SlotId> = BTreeSet::new();
        for (number, accepted) in (1..).zip(tree.edits.iter()) {
            if numbers[number] > 0 {
                wanted.insert(at[number]);
                wanted.extend(&accepted.after);
            }
        }
        let up = |slot: SlotId| {
            std::iter::successors(Some(slot), |at| Some(tree.slot(*at).parent).filter(|it| it.0 != 0))
        };
        let wanted: BTreeSet<SlotId> = wanted.into_iter().flat_map(up).collect();
        for slot in wanted {
            places.take(&mut graft, &numbers, slot);
        }
        for (number, accepted) in (1..).zip(tree.edits.iter()) {
            let place = places.take(&mut graft, &numbers, at[number]).filter(|_| numbers[number] > 0);
            let after =
                accepted.after.iter().map(|slot| Some((*slot, places.take(&mut graft, &numbers, *slot)?)));
            let after: Option<Vec<(SlotId, usize)>> = after.collect();
            let (Some(place), Some(after)) = (place, after) else {
                let why = "it stands outside of the plan";
                graft.lost.push(not_applied(accepted.edit.word(), &accepted.edit.at, why));
                continue;
            };
            let between = after
                .iter()
                .filter_map(|(slot, place)| Some((*place, accepted.between.get(slot)?.clone())))
                .collect();
            let after: Vec<usize> = after.into_iter().map(|(_, place)| place).collect();
            let edit = graft.with_paths(&accepted.edit, place, &after);
            graft.edits.push(Change {
                place,
                edit: Rc::new(edit),
                after,
                between,
                code: accepted.code,
                origin: accepted.origin.clone(),
            });
        }
        Ok(graft)
    }

    /// The path of a place, as the edits of the graft say it.
    #[must_use]
    pub fn path(&self, place: usize) -> Path {
        let up = std::iter::successors(Some(place), |at| Some(self.places[*at].above));
        let mut steps: Vec<PathStep> =
            up.take_while(|at| *at != AROUND).map(|at| self.places[at].step).collect();
        steps.reverse();
        Path { steps }
    }

    /// An edit with the paths that its places have in the graft.
    fn with_paths(&self, edit: &Edit, place: usize, after: &[usize]) -> Edit {
        let mut edit = Edit { at: self.path(place), ..edit.clone() };
        let paths = || after.iter().map(|place| self.path(*place)).collect();
        match &mut edit.what {
            What::Defer(after) => *after = paths(),
            What::Owe { after, .. } => *after = paths(),
            _ => {}
        }
        edit
    }
}

/// Why an edit does not hold here, for the notes of a task.
#[must_use]
pub fn not_applied(word: &str, at: &Path, why: &str) -> String {
    format!("{word} at {} not applied: {why}", at.show())
}

/// The places of a tree that a graft has.
struct Taken<'t> {
    program: &'t Program,
    tree: &'t Tree,
    root: SlotId,
    known: FxHashMap<SlotId, usize>,
    labels: Labels,
}

impl Taken<'_> {
    /// The place of a slot in the graft, made with those above if it is new.
    fn take(&mut self, graft: &mut Graft, numbers: &[u32], slot: SlotId) -> Option<usize> {
        let mut missing = Vec::new();
        let mut at = slot;
        let mut place = loop {
            if at == ROOT {
                break AROUND;
            }
            if at == self.root {
                break CALL;
            }
            if let Some(place) = self.known.get(&at) {
                break *place;
            }
            if at.0 == 0 {
                return None;
            }
            missing.push(at);
            at = self.tree.slot(at).parent;
        };
        for slot in missing.into_iter().rev() {
            let it = self.tree.slot(slot);
            let way = self.way(slot, numbers)?;
            if place == AROUND && !matches!(way.first(), Some(Link::Edit(_))) {
                return None;
            }
            graft.places.push(Place {
                above: place,
                step: PathStep { name: it.name, call: self.labels.of(self.tree, slot) },
                site: Some(Words::of(self.program, it.key.site)?),
                known: Some(it.key.site),
                way,
                called: self.tree.called(slot),
            });
            place = graft.places.len() - 1;
            self.known.insert(slot, place);
        }
        Some(place)
    }

    fn way(&self, slot: SlotId, numbers: &[u32]) -> Option<Vec<Link>> {
        let it = self.tree.slot(slot);
        let steps = self.tree.keys.steps(it.key.chain).into_iter().map(|step| match step {
            Step::Call(site) => Some(Link::Through(Words::of(self.program, site)?, Some(site))),
            Step::Edit(number) => {
                Some(Link::Edit(numbers.get(number as usize).copied().filter(|now| *now > 0)?))
            }
            other => Some(Link::Same(other)),
        });
        steps.collect()
    }
}

/// True for a slot of code that an edit has put beside the plan.
fn is_beside(tree: &Tree, slot: SlotId) -> bool {
    let mut up = std::iter::successors(Some(slot), |at| Some(tree.slot(*at).parent));
    let top = up.find(|at| at.0 == 0 || tree.slot(*at).parent == ROOT).unwrap_or_default();
    top.0 != 0 && matches!(tree.keys.steps(tree.slot(top).key.chain).first(), Some(Step::Edit(_)))
}

/// What tells slots of one name below one parent apart in paths: those that the run reached have their ranks, the
/// others come after them.
#[derive(Default)]
struct Labels(FxHashMap<SlotId, u32>);

impl Labels {
    fn of(&mut self, tree: &Tree, slot: SlotId) -> u32 {
        if let Some(call) = self.0.get(&slot) {
            return *call;
        }
        let parent = tree.slot(slot).parent;
        let reached = tree.children(parent);
        let seen: BTreeSet<SlotId> = reached.iter().copied().collect();
        let others = tree.all_children(parent).filter(|child| !seen.contains(child));
        let mut ranks: FxHashMap<Symbol, u32> = FxHashMap::default();
        for child in reached.iter().copied().chain(others) {
            let rank = ranks.entry(tree.slot(child).name).or_insert(0);
            *rank += 1;
            self.0.insert(child, *rank);
        }
        self.0.get(&slot).copied().unwrap_or(1)
    }
}

// ---------------------------------------------------------------------------------------------
// To text

impl Graft {
    /// What there is to say of it where nobody has said more: whose edits they are.
    #[must_use]
    pub fn doc(&self) -> String {
        let mut makers: Vec<&str> = Vec::new();
        for by in self.edits.iter().filter_map(|change| change.edit.by.as_ref()) {
            if !makers.contains(&by.as_str()) {
                makers.push(by.as_str());
            }
        }
        let name = self.places[CALL].step.name;
        match makers.split_last() {
            None => format!("`{name}` with edits."),
            Some((one, [])) => format!("`{name}` with the edits of {one}."),
            Some((last, others)) => format!("`{name}` with the edits of {} and {last}.", others.join(", ")),
        }
    }

    /// `(def-variant name (:of plan) "doc" (places …) (between …) edits…)`. `read` makes values of the texts that keys
    /// have for elements of loops.
    #[must_use]
    pub fn text(&self, program: &Program, name: Symbol, doc: &str, read: &dyn Fn(&str) -> Value) -> String {
        let mut out =
            format!("(def-variant {} (:of {})\n", symbol(name), symbol(self.places[CALL].step.name));
        out += &crate::print::quoted(doc);
        let needed = self.places.len() > CALL + 1 || self.places[CALL].step.call != 1;
        if needed {
            out += "\n(places";
            self.write_places(program, read, &mut out);
            out += ")";
        }
        for (number, change) in (1..).zip(&self.edits) {
            for (place, steps) in &change.between {
                let path = Value::new(Obj::Path(Box::new(self.path(*place))));
                out += &format!("\n(between {number} {}", crate::print::write(&path));
                steps.iter().for_each(|step| write_step(step, read, &mut out));
                out += ")";
            }
        }
        for change in &self.edits {
            let edit = Value::new(Obj::Edit(Box::new((*change.edit).clone())));
            out += "\n";
            out += &Printer::new(Some(program), true, LIMIT).text(&edit);
        }
        out + ")"
    }

    fn write_places(&self, program: &Program, read: &dyn Fn(&str) -> Value, out: &mut String) {
        let mut below: Vec<Vec<usize>> = vec![Vec::new(); self.places.len()];
        for (at, place) in self.places.iter().enumerate().skip(CALL) {
            below[place.above].push(at);
        }
        enum Part {
            Open(usize),
            Close,
        }
        let mut todo: Vec<Part> = below[AROUND].iter().rev().map(|at| Part::Open(*at)).collect();
        while let Some(part) = todo.pop() {
            match part {
                Part::Close => out.push(')'),
                Part::Open(at) => {
                    *out += "\n(";
                    self.write_place(program, at, read, out);
                    todo.push(Part::Close);
                    todo.extend(below[at].iter().rev().map(|at| Part::Open(*at)));
                }
            }
        }
    }

    fn write_place(&self, program: &Program, at: usize, read: &dyn Fn(&str) -> Value, out: &mut String) {
        let place = &self.places[at];
        *out += &symbol(place.step.name);
        if place.step.call != 1 {
            *out += &format!(" :call {}", place.step.call);
        }
        let Some(site) = place.site else { return };
        // Mostly the call stands in the body of the plan above.
        let owner = if place.above == AROUND { None } else { Some(self.places[place.above].step.name) };
        if (site.owner, site.inner) != (owner, 0) && site.owner.is_some() {
            let name = symbol(site.owner.unwrap_or_default());
            match site.inner {
                0 => *out += &format!(" :in {name}"),
                inner => *out += &format!(" :in ({name} {inner})"),
            }
        } else if site.inner > 0 {
            *out += &format!(" :inner {}", site.inner);
        }
        if site.name != place.step.name {
            *out += &format!(" :site {}", symbol(site.name));
        }
        if site.nth > 1 {
            *out += &format!(" :nth {}", site.nth);
        }
        let named = place.known.is_some_and(|site| program.sites[site.at()].callee.is_none());
        let last = place.way.iter().rposition(|link| matches!(link, Link::Same(Step::Name(_))));
        for (number, link) in place.way.iter().enumerate() {
            match link {
                // What is called where the source does not say stands before.
                Link::Same(Step::Name(name)) if named && Some(number) == last && *name == place.step.name => {
                }
                Link::Same(step) => write_step(step, read, out),
                Link::Edit(number) => *out += &format!(" :edit {number}"),
                Link::Through(words, _) => {
                    let mut parts = vec![symbol(words.name)];
                    parts.push(words.nth.to_string());
                    parts.extend(words.owner.map(symbol));
                    if words.inner > 0 {
                        parts.push(words.inner.to_string());
                    }
                    *out += &format!(" :through ({})", parts.join(" "));
                }
            }
        }
    }
}

fn symbol(name: Symbol) -> String {
    crate::print::write(&Value::Imm(Imm::Symbol(name)))
}

fn write_step(step: &Step, read: &dyn Fn(&str) -> Value, out: &mut String) {
    let rank = match step {
        Step::Round(element, rank) => {
            *out += &match element {
                Element::Int(i) => format!(" :for {i}"),
                Element::Symbol(name) => format!(" :for {}", symbol(*name)),
                Element::Text(text) => {
                    format!(" :for {}", Printer::new(None, true, LIMIT).expression(&read(text)))
                }
            };
            *rank
        }
        Step::Number(number) => return *out += &format!(" :round {number}"),
        Step::Name(name) => return *out += &format!(" :named {}", symbol(*name)),
        Step::Again(times) => return *out += &format!(" :again {times}"),
        // These are links of their own.
        Step::Call(_) | Step::Edit(_) => return,
    };
    if rank > 0 {
        *out += &format!(" :rank {rank}");
    }
}

// ---------------------------------------------------------------------------------------------
// From text

impl Graft {
    /// What `def-variant` says: places, the rounds between them, and edits.
    ///
    /// # Errors
    /// A sentence that says what has no meaning.
    pub fn read(plan: Symbol, places: &Value, between: &Value, edits: &Value) -> Result<Graft, String> {
        let mut graft = Graft::empty(plan);
        let mut todo: Vec<(usize, Value)> = items(places)?.into_iter().rev().map(|it| (AROUND, it)).collect();
        let mut is_call = true;
        while let Some((above, form)) = todo.pop() {
            // A name alone is a place with nothing below.
            let parts = if form.as_symbol().is_some() { vec![form.clone()] } else { items(&form)? };
            let (place, below) = read_place(&graft, above, &form, &parts)?;
            let at = if std::mem::take(&mut is_call) {
                graft.places[CALL].step = place.step;
                CALL
            } else {
                graft.places.push(place);
                graft.places.len() - 1
            };
            todo.extend(below.iter().rev().map(|it| (at, it.clone())));
        }
        let known: FxHashMap<(usize, Symbol, u32), usize> = (CALL..graft.places.len())
            .map(|at| ((graft.places[at].above, graft.places[at].step.name, graft.places[at].step.call), at))
            .collect();
        let find = |path: &Path| {
            let mut at = AROUND;
            for step in &path.steps {
                at = *known.get(&(at, step.name, step.call))?;
            }
            Some(at).filter(|at| *at != AROUND)
        };
        let mut rounds: BTreeMap<(usize, usize), Vec<Step>> = BTreeMap::new();
        for row in items(between)? {
            let parts = items(&row)?;
            let [number, path, steps @ ..] = parts.as_slice() else { return Err(odd(&row)) };
            let number = number.as_int().and_then(|it| usize::try_from(it).ok()).ok_or_else(|| odd(&row))?;
            let place = path.as_path().and_then(find).ok_or_else(|| odd(&row))?;
            let (way, rest) = read_way(&row, steps)?;
            let way = way.into_iter().map(|link| match link {
                Link::Same(step) => Some(step),
                _ => None,
            });
            match way.collect::<Option<Vec<Step>>>() {
                Some(steps) if rest.is_empty() => rounds.insert((number, place), steps),
                _ => return Err(odd(&row)),
            };
        }
        for (number, value) in (1..).zip(items(edits)?) {
            let Some(Obj::Edit(edit)) = value.obj() else {
                return Err(format!("{} is no edit", crate::print::brief(&value)));
            };
            let lost = |path: &Path| {
                let why = format!("`places` does not say where {} is", path.show());
                not_applied(edit.word(), &edit.at, &why)
            };
            let paths: &[Path] = match &edit.what {
                What::Defer(after) => after,
                What::Owe { after, .. } => after,
                _ => &[],
            };
            let missing = std::iter::once(&edit.at).chain(paths).find(|path| find(path).is_none());
            if let Some(missing) = missing {
                graft.lost.push(lost(missing));
            }
            let place = find(&edit.at).unwrap_or(AROUND);
            let after: Vec<usize> = match missing {
                None => paths.iter().filter_map(find).collect(),
                Some(_) => Vec::new(),
            };
            let between = after
                .iter()
                .filter_map(|place| Some((*place, rounds.get(&(number, *place))?.clone())))
                .collect();
            // One that is lost keeps its number.
            let place = if missing.is_some() { AROUND } else { place };
            let origin = edit.by.map(|by| format!("transformation {by}")).unwrap_or_default().into();
            let edit = Rc::new((**edit).clone());
            graft.edits.push(Change { place, edit, after, between, code: None, origin });
        }
        Ok(graft)
    }
}

fn items(value: &Value) -> Result<Vec<Value>, String> {
    value.to_vec().ok_or_else(|| odd(value))
}

fn odd(value: &Value) -> String {
    format!("{} says no place", crate::print::brief(value))
}

/// A place, and the forms of those below it.
fn read_place<'v>(
    graft: &Graft,
    above: usize,
    form: &Value,
    parts: &'v [Value],
) -> Result<(Place, &'v [Value]), String> {
    let wrong = || odd(form);
    let (name, mut rest) = parts.split_first().ok_or_else(wrong)?;
    let name = name.as_symbol().ok_or_else(wrong)?;
    let owner = (above != AROUND).then(|| graft.places[above].step.name);
    let mut site = Words { owner, inner: 0, name, nth: 1 };
    let mut call = 1;
    while let [key, value, more @ ..] = rest {
        let number = || value.as_int().and_then(|it| u32::try_from(it).ok()).ok_or_else(wrong);
        match key.as_keyword().as_ref().map(|key| key.as_str()) {
            Some("call") => call = number()?,
            Some("nth") => site.nth = number()?,
            Some("inner") => (site.owner, site.inner) = (None, number()?),
            Some("site") => site.name = value.as_symbol().ok_or_else(wrong)?,
            Some("in") => match value.as_symbol() {
                Some(owner) => (site.owner, site.inner) = (Some(owner), 0),
                None => {
                    let parts = items(value)?;
                    let [owner, inner] = parts.as_slice() else { return Err(wrong()) };
                    let inner = inner.as_int().and_then(|it| u32::try_from(it).ok()).ok_or_else(wrong)?;
                    (site.owner, site.inner) = (Some(owner.as_symbol().ok_or_else(wrong)?), inner);
                }
            },
            _ => break,
        }
        rest = more;
    }
    let (way, below) = read_way(form, rest)?;
    if matches!(way.first(), Some(Link::Edit(_))) && owner.is_none_or(|owner| site.owner == Some(owner)) {
        // It stands in the code of the edit.
        site.owner = None;
    }
    let step = PathStep { name, call };
    Ok((Place { above, step, site: Some(site), known: None, way, called: None }, below))
}

/// The steps of a key, and what stands after them.
fn read_way<'v>(form: &Value, parts: &'v [Value]) -> Result<(Vec<Link>, &'v [Value]), String> {
    let wrong = || odd(form);
    let (mut way, mut rest) = (Vec::new(), parts);
    while let [key, value, more @ ..] = rest {
        let Some(key) = key.as_keyword() else { break };
        let number = || value.as_int().and_then(|it| u32::try_from(it).ok()).ok_or_else(wrong);
        match key.as_str() {
            "for" => {
                let element = Element::of(value).ok_or_else(wrong)?;
                way.push(Link::Same(Step::Round(element, 0)));
            }
            "rank" => match way.last_mut() {
                Some(Link::Same(Step::Round(_, rank))) => *rank = number()?,
                _ => return Err(wrong()),
            },
            "round" => way.push(Link::Same(Step::Number(number()?))),
            "named" => way.push(Link::Same(Step::Name(value.as_symbol().ok_or_else(wrong)?))),
            "again" => way.push(Link::Same(Step::Again(number()?))),
            "edit" => way.push(Link::Edit(number()?)),
            "through" => {
                let parts = items(value)?;
                let [name, nth, more @ ..] = parts.as_slice() else { return Err(wrong()) };
                let count = |it: &Value| it.as_int().and_then(|it| u32::try_from(it).ok()).ok_or_else(wrong);
                let owner = more.first().and_then(Value::as_symbol);
                let inner = more.get(usize::from(owner.is_some())).map_or(Ok(0), count)?;
                let name = name.as_symbol().ok_or_else(wrong)?;
                way.push(Link::Through(Words { owner, inner, name, nth: count(nth)? }, None));
            }
            _ => return Err(wrong()),
        }
        rest = more;
    }
    if rest.first().is_some_and(|it| it.as_keyword().is_some()) { Err(wrong()) } else { Ok((way, rest)) }
}

// ---------------------------------------------------------------------------------------------
// Paths in code

/// A value with the paths in it that begin at the plan of a graft as they are below a call: `below` is the path of the
/// call, `root` the step that stands for it. Nothing if there is no such path.
#[must_use]
pub fn move_paths(value: &Value, root: PathStep, below: &[PathStep], depth: usize) -> Option<Value> {
    const DEPTH: usize = 1000;
    let Value::Obj(obj) = value else { return None };
    if depth > DEPTH {
        return None;
    }
    let inner = |value: &Value| move_paths(value, root, below, depth + 1);
    let all = |items: &mut dyn Iterator<Item = &Value>| {
        let moved: Vec<(Value, bool)> =
            items.map(|it| inner(it).map_or_else(|| (it.clone(), false), |it| (it, true))).collect();
        let changed = moved.iter().any(|it| it.1);
        changed.then(|| moved.into_iter().map(|it| it.0).collect::<Vec<Value>>())
    };
    match &**obj {
        Obj::Path(path) => moved_path(path, root, below).map(|path| Value::new(Obj::Path(Box::new(path)))),
        Obj::Pair(head, _) if head.as_symbol().is_some_and(|head| head == "path") => {
            let steps = value.to_vec()?;
            let first = steps.get(1)?;
            let skip = usize::from(first.as_symbol().is_some_and(|it| it == "top-level"));
            if path_step(steps.get(1 + skip)?)? != root {
                return None;
            }
            let below = below.iter().map(|step| match step.call {
                1 => Value::Imm(Imm::Symbol(step.name)),
                call => Value::list([
                    Value::Imm(Imm::Symbol(step.name)),
                    Value::keyword("call"),
                    Value::int(i64::from(call)),
                ]),
            });
            let rest = steps.iter().skip(2 + skip).cloned();
            Some(Value::list(steps.first().cloned().into_iter().chain(below).chain(rest).collect::<Vec<_>>()))
        }
        Obj::Pair(..) => {
            let items = value.to_vec()?;
            all(&mut items.iter()).map(Value::list)
        }
        Obj::Vector(items) => all(&mut items.iter()).map(Value::vector),
        Obj::Map(map) => {
            let values = all(&mut map.iter().map(|(_, value)| value))?;
            Some(Value::map(map.iter().map(|(key, _)| key.clone()).zip(values).collect()))
        }
        Obj::Desc(desc) => {
            let values = all(&mut desc.properties().map(|(_, value)| value))?;
            let keys = desc.properties().map(|(key, _)| key);
            Some(Value::desc(crate::desc::Desc::new(desc.kind, keys.zip(values).collect())))
        }
        _ => None,
    }
}

fn path_step(form: &Value) -> Option<PathStep> {
    if let Some(name) = form.as_symbol() {
        return Some(PathStep { name, call: 1 });
    }
    let parts = form.to_vec()?;
    let [name, key, call] = parts.as_slice() else { return None };
    key.as_keyword().filter(|key| *key == "call")?;
    Some(PathStep { name: name.as_symbol()?, call: u32::try_from(call.as_int()?).ok()? })
}

fn moved_path(path: &Path, root: PathStep, below: &[PathStep]) -> Option<Path> {
    let (first, rest) = path.steps.split_first()?;
    (*first == root).then(|| Path { steps: below.iter().chain(rest).copied().collect() })
}
