//! From rows back to a tree of a program, which may be another one by now: what it does not have any more is left out.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;
use serde_json::{Map as JsonMap, Value as Json};

use super::{SavedRecord, SavedTree};
use crate::code::{Program, SiteId};
use crate::edit::Accepted;
use crate::failure::{Builtin, Failure, FailureTypes, Task};
use crate::key::{Chain, Element, Key, Keys, Step};
use crate::show;
use crate::tree::{Extra, MOVED, NodeKind, ROOT, RecId, SlotId, Status, Tree, Why};
use crate::value::{Symbol, Value};

/// A tree on its way back: its places first, then its records; edits are for the machine to accept.
pub struct Restored {
    /// The tree.
    pub tree: Tree,
    /// The new number of each slot; zero for those that the program does not have any more.
    pub slots: Vec<SlotId>,
    /// The new number of each edit; zero for those that are not accepted.
    pub edits: Vec<u32>,
}

/// The slots that an edit waits for, and the rounds that stood between.
pub type Awaited = (Vec<SlotId>, BTreeMap<SlotId, Vec<Step>>);

impl Restored {
    /// An empty tree to take up a saved one.
    ///
    /// # Errors
    /// A sentence that says which row does not fit to the others.
    pub fn new(saved: &SavedTree) -> Result<Restored, String> {
        saved.places()?;
        let mut slots = vec![SlotId(0); saved.slots.len().max(1) + 1];
        slots[ROOT.0 as usize] = ROOT;
        let mut tree = Tree::default();
        tree.begin();
        let most = saved.edits.iter().map(|edit| edit.number as usize).max().unwrap_or(0);
        if most > saved.edits.len() {
            return Err("the numbers of the edits have gaps".into());
        }
        Ok(Restored { tree, slots, edits: vec![0; most + 1] })
    }

    /// Adds the slots that the program has, as far as the edits that they come from are there. `top` is the site that
    /// stands for the call of the plan, in whatever way that was called. True if there was something to add.
    pub fn add_slots(&mut self, program: &Program, saved: &SavedTree, top: Option<SiteId>) -> bool {
        let mut sites: FxHashMap<u64, SiteId> = FxHashMap::default();
        for (at, site) in (0..).zip(&program.sites) {
            sites.entry(site.hash).or_insert(SiteId(at));
        }
        let plan = root_plan(program, saved);
        let mut added = false;
        for it in &saved.slots {
            let above = self.slots[it.parent as usize];
            if self.slots[it.slot as usize].0 != 0 || above.0 == 0 {
                continue;
            }
            let site = match plan == Some(it.slot) {
                true => top.filter(|top| program.sites[top.at()].name == it.name.as_str() || top.0 == 0),
                false => sites.get(&it.site).copied(),
            };
            let Some(site) = site else { continue };
            let chain = match plan == Some(it.slot) {
                // `run-plan` names its plan in the key, a call in the source does not.
                true if site.0 == 0 => {
                    let name = Step::Name(Symbol::from(&it.name));
                    Some(self.tree.keys.then(Chain::EMPTY, name, |_| 0))
                }
                true => Some(Chain::EMPTY),
                false => self.chain(&it.steps, program, &sites),
            };
            let Some(chain) = chain else { continue };
            let key = Key { site, chain };
            let hash = program.sites[site.at()].hash;
            self.slots[it.slot as usize] = self.tree.restore_slot(above, key, Symbol::from(&it.name), hash);
            added = true;
        }
        added
    }

    fn chain(&mut self, steps: &str, program: &Program, sites: &FxHashMap<u64, SiteId>) -> Option<Chain> {
        if steps.is_empty() {
            return Some(Chain::EMPTY);
        }
        let steps = self.steps(&serde_json::from_str(steps).ok()?, sites)?;
        let keys: &mut Keys = &mut self.tree.keys;
        let hash = |site: SiteId| program.sites[site.at()].hash;
        Some(steps.into_iter().fold(Chain::EMPTY, |chain, step| keys.then(chain, step, hash)))
    }

    fn steps(&self, json: &Json, sites: &FxHashMap<u64, SiteId>) -> Option<Vec<Step>> {
        let number = |json: &Json| u32::try_from(json.as_u64()?).ok();
        let step = |step: &Json| {
            let step = step.as_array()?;
            let (kind, what) = (step.first()?.as_str()?, step.get(1)?);
            let rank = || number(step.get(2)?);
            Some(match kind {
                "int" => Step::Round(Element::Int(what.as_i64()?), rank()?),
                "symbol" => Step::Round(Element::Symbol(Symbol::from(what.as_str()?)), rank()?),
                "text" => Step::Round(Element::Text(std::rc::Rc::new(what.as_str()?.into())), rank()?),
                "number" => Step::Number(number(what)?),
                "call" => Step::Call(*sites.get(&u64::from_str_radix(what.as_str()?, 16).ok()?)?),
                "name" => Step::Name(Symbol::from(what.as_str()?)),
                "again" => Step::Again(number(what)?),
                "edit" => {
                    let now = self.edits.get(number(what)? as usize).copied().filter(|now| *now != 0)?;
                    Step::Edit(now)
                }
                _ => return None,
            })
        };
        json.as_array()?.iter().map(step).collect()
    }

    /// The slots that an edit waits for and the rounds between; nothing if one is not there.
    #[must_use]
    pub fn after(&self, program: &Program, after: &str) -> Option<Awaited> {
        let (mut slots, mut between) = (Vec::new(), BTreeMap::new());
        if after.is_empty() {
            return Some((slots, between));
        }
        let sites = (0..).zip(&program.sites).map(|(at, site)| (site.hash, SiteId(at))).collect();
        let json: Json = serde_json::from_str(after).ok()?;
        for pair in json.as_array()? {
            let slot = pair.get(0)?.as_u64().and_then(|slot| self.slots.get(usize::try_from(slot).ok()?))?;
            if slot.0 == 0 {
                return None;
            }
            slots.push(*slot);
            if let Some(steps) = pair.get(1).filter(|steps| !steps.is_null()) {
                between.insert(*slot, self.steps(steps, &sites)?);
            }
        }
        Some((slots, between))
    }

    /// Adds an edit that has been accepted.
    pub fn add_edit(&mut self, number: u32, slot: SlotId, edit: Accepted) {
        self.edits[number as usize] = self.tree.add_edit(slot, edit);
    }

    /// Adds the records of the slots that are there.
    pub fn add_records(&mut self, program: &Program, saved: &SavedTree, read: &dyn Fn(&str) -> Value) {
        let mut recs = vec![RecId(0); saved.records.len() + 1];
        for it in &saved.records {
            let slot = self.slots[it.slot as usize];
            let parent = recs[it.parent as usize];
            if slot.0 == 0 || (parent.0 == 0 && it.record != 1) {
                continue;
            }
            let rec = match it.record {
                1 => RecId(1),
                _ => self.tree.restore_record(
                    parent,
                    slot,
                    word(NodeKind::ALL, NodeKind::word, &it.kind),
                    it.start_ns,
                ),
            };
            recs[it.record as usize] = rec;
            self.fill(program, rec, it, read);
        }
        // A place is that of a record: those of one form stand in the order of its branches.
        for it in &saved.slots {
            let place = recs.get(it.place as usize).copied().unwrap_or_default();
            if self.slots[it.slot as usize].0 != 0 && place.0 != 0 {
                self.tree.restore_place(self.slots[it.slot as usize], place);
            }
        }
    }

    fn fill(&mut self, program: &Program, rec: RecId, it: &SavedRecord, read: &dyn Fn(&str) -> Value) {
        let more: JsonMap<String, Json> =
            it.more.as_deref().and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default();
        let called = more.get("called").and_then(Json::as_str);
        if let Some(plan) = called.and_then(|name| program.functions.iter().position(|it| it.name == name)) {
            self.tree.calls(self.tree.record(rec).slot, crate::code::FnId(plan as u32));
        }
        let texts = |json: JsonMap<String, Json>| -> Vec<(Symbol, Value)> {
            let value = |json: Json| json.as_str().map(read).unwrap_or(Value::NIL);
            json.into_iter().map(|(name, json)| (Symbol::from(&name), value(json))).collect()
        };
        let params = texts(serde_json::from_str(&it.params).unwrap_or_default());
        let written = more.get("written-params").and_then(Json::as_object).cloned().map(texts);
        let args = |tree: &Tree, params| show::args_of_names(program, tree, rec, params);
        match written {
            None => {
                let args = args(&self.tree, params);
                self.tree.restore_args(rec, &args);
            }
            Some(written) => {
                let (written, now) = (args(&self.tree, written), args(&self.tree, params));
                self.tree.restore_args(rec, &written);
                if written.len() == now.len() {
                    self.tree.change_args(rec, &now);
                }
            }
        }
        let extra = Extra {
            grounded: more.get("grounded").and_then(Json::as_str).map(read),
            performed_in: more
                .get("performed-in")
                .and_then(Json::as_u64)
                .and_then(|slot| self.slots.get(usize::try_from(slot).ok()?).copied())
                .filter(|slot| slot.0 != 0),
            notes: more
                .get("notes")
                .and_then(Json::as_array)
                .map(|notes| notes.iter().filter_map(|it| it.as_str().map(str::to_string)).collect())
                .unwrap_or_default(),
        };
        if extra.grounded.is_some() || extra.performed_in.is_some() || !extra.notes.is_empty() {
            *self.tree.extra_mut(rec) = extra;
        }
        let value = match (&it.failure, &it.value) {
            (Some(json), _) => {
                failure(&program.failures, &serde_json::from_str(json).unwrap_or_default(), read, 0)
            }
            (None, Some(text)) => read(text),
            (None, None) => Value::NIL,
        };
        let status = word(Status::ALL, Status::word, &it.status);
        let record = self.tree.record_mut(rec);
        record.attempt = it.attempt;
        record.why = word(Why::ALL, Why::word, &it.why);
        if more.contains_key("goal") {
            record.flags |= MOVED;
        }
        match it.end_ns.filter(|_| status.is_final()) {
            Some(end) => {
                record.status = Status::Running;
                self.tree.end(rec, status, value, end);
            }
            None => record.status = status,
        }
    }
}

/// The plan that was run: the one that `run-plan` ran, else the last task of the root.
fn root_plan(program: &Program, saved: &SavedTree) -> Option<u32> {
    let root_site = program.sites.first().map_or(0, |site| site.hash);
    let below = || saved.slots.iter().filter(|it| it.parent == ROOT.0);
    let by_run_plan = below().find(|it| it.site == root_site);
    by_run_plan.or(below().filter(|it| it.place > 0).max_by_key(|it| it.place)).map(|it| it.slot)
}

/// The one that has this word; the first if none has.
fn word<T: Copy>(all: &[T], word: fn(T) -> &'static str, text: &str) -> T {
    all.iter().copied().find(|it| word(*it) == text).unwrap_or(all[0])
}

/// A failure from its JSON.
pub(crate) fn failure(
    types: &FailureTypes,
    json: &Json,
    read: &dyn Fn(&str) -> Value,
    depth: usize,
) -> Value {
    const DEPTH: usize = 20;
    let Some(name) = json["type"].as_str().filter(|_| depth < DEPTH) else { return Value::NIL };
    let name = Symbol::from(name);
    let kind = types.find(name).unwrap_or(Builtin::PlanFailure.id());
    let fields = json["fields"].as_object().into_iter().flatten();
    let fields = fields.map(|(key, value)| (Symbol::from(key), read(value.as_str().unwrap_or("nil"))));
    let mut it = Failure::of_type(kind, name, fields.collect());
    it.task = json["task"].as_str().map(|path| std::rc::Rc::new(Task::of_path(path)));
    if json["cause"].is_object() {
        it.cause = Some(failure(types, &json["cause"], read, depth + 1));
    }
    let also = json["also"].as_array().into_iter().flatten();
    it.also = also.map(|json| failure(types, json, read, depth + 1)).collect();
    Value::failure(it)
}
