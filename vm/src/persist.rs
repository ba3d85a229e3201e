//! Trees to be kept: slots, records and edits as rows of plain data, and the way back.
//!
//! A row says in words what the machine has as numbers of its own: a call site is its hash, a function its
//! name, a value the text that reads back. So rows fit to another run of the program, and to the program after
//! a change: what is not found there any more is left out and listed. No input or output is done here; how
//! a text becomes a value is handed in.

use std::borrow::Cow;
use std::collections::BTreeMap;

use rustc_hash::FxHashMap;
use serde_json::{Map as JsonMap, Value as Json, json};

use crate::code::{Program, SiteId};
use crate::edit::Accepted;
use crate::failure::{Builtin, Failure, Task};
use crate::key::{Chain, Element, Key, Keys, Step};
use crate::print::{LIMIT, Printer};
use crate::show;
use crate::tree::{CHANGED, Extra, MOVED, NodeKind, ROOT, RecId, Record, SlotId, Status, Tree, Why};
use crate::value::{Obj, Symbol, Value};

/// A word of a fixed list, or what a file has in its place.
pub type Word = Cow<'static, str>;

/// A place in a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SavedSlot {
    /// Its number, from 1: that of `top-level`.
    pub slot: u32,
    /// The number of the slot above; 0 for the root.
    pub parent: u32,
    /// What was called here first.
    pub name: String,
    /// The hash of its call site.
    pub site: u64,
    /// The rest of its key: steps as JSON, empty for none.
    pub steps: String,
    /// The record that its place among its siblings comes from; 0 if the run did not reach it.
    pub place: u32,
}

/// A run of a slot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SavedRecord {
    /// Its number, from 1: that of `top-level`.
    pub record: u32,
    /// The number of its slot.
    pub slot: u32,
    /// The number of the record that it ran in; 0 for the root.
    pub parent: u32,
    /// 1 for the first run of the slot.
    pub attempt: u32,
    /// The word for its kind.
    pub kind: Word,
    /// The word for its status.
    pub status: Word,
    /// Why it was skipped or evaporated; empty where there is nothing to say.
    pub why: Word,
    /// When it was called, in nanoseconds of the task clock.
    pub start_ns: u64,
    /// When it became final.
    pub end_ns: Option<u64>,
    /// Parameters by their names, as a JSON object of texts; empty for none.
    pub params: String,
    /// What it returned, as text; nothing if it is not final or a failure left it.
    pub value: Option<String>,
    /// The failure that left it, as a JSON object.
    pub failure: Option<String>,
    /// What few records have, as a JSON object: called, grounded, written, written-params, performed-in, notes, goal.
    pub more: Option<String>,
}

/// A change to a place of a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SavedEdit {
    /// Its number, from 1, in the order of making.
    pub number: u32,
    /// The number of its slot.
    pub slot: u32,
    /// The edit, as text that reads back.
    pub edit: String,
    /// What was called at the slot when it was made.
    pub callee: String,
    /// The slots that it waits for, with the rounds that stood between, as JSON; empty for none.
    pub after: String,
}

/// All of a tree.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SavedTree {
    /// In the order of their numbers, which begin at 1 and leave out none.
    pub slots: Vec<SavedSlot>,
    /// In the order of their numbers, which begin at 1 and leave out none.
    pub records: Vec<SavedRecord>,
    /// In the order of making.
    pub edits: Vec<SavedEdit>,
}

/// Names of trees are told from versions and numbers of runs.
#[must_use]
pub fn is_tree_name(text: &str) -> bool {
    !text.contains('@') && text.chars().any(|c| !c.is_ascii_digit())
}

// ---------------------------------------------------------------------------------------------
// To rows

/// The row of a slot.
#[must_use]
pub fn slot(program: &Program, tree: &Tree, id: SlotId) -> SavedSlot {
    let it = tree.slot(id);
    SavedSlot {
        slot: id.0,
        parent: it.parent.0,
        name: it.name.to_string(),
        site: program.sites.get(it.key.site.at()).map_or(0, |site| site.hash),
        steps: steps_text(program, &tree.keys.steps(it.key.chain)),
        place: tree.place(id),
    }
}

/// The row of a record.
#[must_use]
pub fn record(program: &Program, tree: &Tree, id: RecId) -> SavedRecord {
    let it = tree.record(id);
    let is_final = it.status.is_final();
    let failed = matches!(it.status, Status::Failed | Status::Evaporated);
    let failure = it.value.as_failure().filter(|_| is_final && failed);
    SavedRecord {
        record: id.0,
        slot: it.slot.0,
        parent: it.parent.0,
        attempt: it.attempt,
        kind: it.kind.word().into(),
        status: it.status.word().into(),
        why: it.why.word().into(),
        start_ns: it.start,
        end_ns: is_final.then_some(it.end),
        params: match it.args() {
            0 => String::new(),
            _ => by_name(program, show::params(program, tree, id)),
        },
        value: (is_final && failure.is_none()).then(|| text(program, &it.value)),
        failure: failure.map(|_| show::failure_json(program, &it.value, 0).to_string()),
        more: more(program, tree, id, it),
    }
}

fn by_name(program: &Program, params: Vec<(Symbol, Value)>) -> String {
    let mut out = String::from("{");
    for (name, value) in params {
        if out.len() > 1 {
            out.push(',');
        }
        out += &Json::String(name.to_string()).to_string();
        out.push(':');
        out += &Json::String(text(program, &value)).to_string();
    }
    out.push('}');
    out
}

fn text(program: &Program, value: &Value) -> String {
    match value.is_nil() {
        true => "nil".into(),
        false => Printer::new(Some(program), true, LIMIT).text(value),
    }
}

fn more(program: &Program, tree: &Tree, id: RecId, it: &Record) -> Option<String> {
    let mut more = JsonMap::new();
    let write = |value: &Value| Json::String(text(program, value));
    if let Some(plan) = tree.called(it.slot).filter(|_| it.kind == NodeKind::Plan) {
        more.insert("called".into(), json!(program.functions.get(plan.at())?.name.as_str()));
    }
    if it.flags & MOVED != 0 {
        more.insert("goal".into(), json!("moved"));
    }
    let extra = tree.extra(id);
    if let Some(grounded) = extra.and_then(|it| it.grounded.as_ref()) {
        more.insert("grounded".into(), write(grounded));
    }
    if it.flags & CHANGED != 0 {
        more.insert("written".into(), show::written(program, tree, id).iter().map(write).collect());
        let params = show::written_params(program, tree, id).unwrap_or_default();
        let params = params.iter().map(|(name, value)| (name.to_string(), write(value)));
        more.insert("written-params".into(), Json::Object(params.collect()));
    }
    if let Some(slot) = extra.and_then(|it| it.performed_in) {
        more.insert("performed-in".into(), json!(slot.0));
    }
    if let Some(extra) = extra.filter(|it| !it.notes.is_empty()) {
        more.insert("notes".into(), json!(extra.notes));
    }
    (!more.is_empty()).then(|| Json::Object(more).to_string())
}

/// The rows of all edits.
#[must_use]
pub fn edits(program: &Program, tree: &Tree) -> Vec<SavedEdit> {
    let mut saved = Vec::new();
    if tree.edits.is_empty() {
        return saved;
    }
    for slot in tree.slots() {
        for number in tree.edits_of(slot) {
            let it = &tree.edits[*number as usize - 1];
            let after = it.after.iter().map(|after| {
                let between = it.between.get(after).map(|steps| steps_json(program, steps));
                json!([after.0, between])
            });
            saved.push(SavedEdit {
                number: *number,
                slot: slot.0,
                edit: text(program, &Value::new(Obj::Edit(Box::new((*it.edit).clone())))),
                callee: it.callee.to_string(),
                after: if it.after.is_empty() { String::new() } else { after.collect::<Json>().to_string() },
            });
        }
    }
    saved.sort_by_key(|edit| edit.number);
    saved
}

/// All rows of a tree.
#[must_use]
pub fn tree(program: &Program, tree: &Tree) -> SavedTree {
    for id in tree.records() {
        crate::failure::name_tasks(tree, &tree.record(id).value);
    }
    SavedTree {
        slots: tree.slots().map(|id| slot(program, tree, id)).collect(),
        records: tree.records().map(|id| record(program, tree, id)).collect(),
        edits: edits(program, tree),
    }
}

fn steps_text(program: &Program, steps: &[Step]) -> String {
    match steps {
        [] => String::new(),
        steps => steps_json(program, steps).to_string(),
    }
}

fn steps_json(program: &Program, steps: &[Step]) -> Json {
    let site = |site: &SiteId| program.sites.get(site.at()).map_or(0, |site| site.hash);
    let step = |step: &Step| match step {
        Step::Round(Element::Int(element), rank) => json!(["int", element, rank]),
        Step::Round(Element::Symbol(element), rank) => json!(["symbol", element.as_str(), rank]),
        Step::Round(Element::Text(element), rank) => json!(["text", &***element, rank]),
        Step::Number(number) => json!(["number", number]),
        Step::Call(id) => json!(["call", format!("{:016x}", site(id))]),
        Step::Name(name) => json!(["name", name.as_str()]),
        Step::Again(times) => json!(["again", times]),
        Step::Edit(number) => json!(["edit", number]),
    };
    steps.iter().map(step).collect()
}

// ---------------------------------------------------------------------------------------------
// To JSON

impl SavedTree {
    /// The same list of nodes that [`show::json`] gives.
    ///
    /// # Errors
    /// A sentence that says which row does not fit to the others.
    pub fn json(&self) -> Result<Json, String> {
        let places = self.places()?;
        let mut nodes = Vec::new();
        let mut todo = vec![(ROOT.0, None::<usize>, String::from("top-level"))];
        while let Some((slot, parent, path)) = todo.pop() {
            let Some(last) = places.records.get(slot as usize).and_then(|all| all.last()) else { continue };
            let number = nodes.len();
            let mut node = self.node(slot, *last, parent, &path)?;
            let all = &places.records[slot as usize];
            if all.len() > 1 {
                let all: Result<Vec<Json>, String> = all.iter().map(|at| self.attempt(*at)).collect();
                node.insert("attempts".into(), Json::Array(all?));
            }
            nodes.push(Json::Object(node));
            let mut ranks: BTreeMap<&str, usize> = BTreeMap::new();
            let mut below = Vec::new();
            for child in &places.children[slot as usize] {
                let name = self.slots[*child as usize - 1].name.as_str();
                let rank = ranks.entry(name).or_insert(0);
                *rank += 1;
                let call = if *rank == 1 { String::new() } else { format!(" :call {rank}") };
                let longer = match path.is_empty() || path.len() > show::LONGEST_PATH {
                    true => String::new(),
                    false => format!("{path} / {name}{call}"),
                };
                below.push((*child, Some(number), longer));
            }
            todo.extend(below.into_iter().rev());
        }
        Ok(Json::Array(nodes))
    }

    /// What stands where, if the numbers of the rows fit together.
    fn places(&self) -> Result<Places, String> {
        let mut places = Places {
            children: vec![Vec::new(); self.slots.len() + 1],
            records: vec![Vec::new(); self.slots.len() + 1],
        };
        for (at, slot) in (1..).zip(&self.slots) {
            let is_root = at == ROOT.0;
            if slot.slot != at || (slot.parent == 0) != is_root || slot.parent >= at {
                return Err(format!("slot {at} does not fit to those before it"));
            }
            if !is_root && slot.place > 0 {
                places.children[slot.parent as usize].push(at);
            }
        }
        for children in &mut places.children {
            children.sort_by_key(|child| self.slots[*child as usize - 1].place);
        }
        for (at, record) in (1..).zip(&self.records) {
            let known = record.slot >= 1 && (record.slot as usize) <= self.slots.len();
            if record.record != at || !known || record.parent >= at || (record.parent == 0) != (at == 1) {
                return Err(format!("record {at} does not fit to those before it"));
            }
            places.records[record.slot as usize].push(at);
        }
        match self.records.first() {
            Some(root) if root.slot == ROOT.0 => Ok(places),
            // Of a run that was killed before its first batch there is nothing.
            None if self.slots.is_empty() => Ok(places),
            _ => Err("there is no record of the root".into()),
        }
    }

    fn path(&self, slot: u32) -> String {
        let chain = std::iter::successors(Some(slot), |at| {
            self.slots.get(*at as usize - 1).map(|it| it.parent).filter(|up| *up != 0)
        });
        let steps: Vec<u32> = chain.collect();
        let words = steps.iter().rev().filter_map(|at| {
            let it = self.slots.get(*at as usize - 1)?;
            let same =
                |other: &&SavedSlot| other.parent == it.parent && other.name == it.name && other.place > 0;
            let before = self.slots.iter().filter(same);
            let rank = before.filter(|other| (other.place, other.slot) < (it.place, it.slot)).count() + 1;
            Some(if rank == 1 { it.name.clone() } else { format!("{} :call {rank}", it.name) })
        });
        words.collect::<Vec<_>>().join(" / ")
    }

    fn node(
        &self,
        slot: u32,
        at: u32,
        parent: Option<usize>,
        path: &str,
    ) -> Result<JsonMap<String, Json>, String> {
        let it = &self.records[at as usize - 1];
        let bad = |what: &str| format!("the {what} of record {at} are no JSON");
        let mut node = JsonMap::new();
        node.insert("name".into(), json!(self.slots[slot as usize - 1].name));
        node.insert("path".into(), if path.is_empty() { Json::Null } else { json!(path) });
        node.insert("parent".into(), json!(parent));
        node.insert("kind".into(), json!(it.kind));
        node.insert("status".into(), json!(it.status));
        node.insert("attempt".into(), json!(it.attempt));
        let params = match it.params.as_str() {
            "" => Json::Object(JsonMap::new()),
            text => serde_json::from_str(text).map_err(|_| bad("parameters"))?,
        };
        node.insert("params".into(), params);
        let (key, result) = result(it)?;
        node.insert(key.into(), result);
        if !it.why.is_empty() {
            node.insert("why".into(), json!(it.why));
        }
        let more: JsonMap<String, Json> = match &it.more {
            None => JsonMap::new(),
            Some(text) => serde_json::from_str(text).map_err(|_| bad("extras"))?,
        };
        let copy = |node: &mut JsonMap<String, Json>, key: &str| {
            if let Some(json) = more.get(key) {
                node.insert(key.into(), json.clone());
            }
        };
        copy(&mut node, "goal");
        node.insert("start".into(), json!(it.start_ns as f64 / 1e9));
        node.insert("end".into(), json!(it.end_ns.map(|end| end as f64 / 1e9)));
        ["grounded", "written", "written-params"].iter().for_each(|key| copy(&mut node, key));
        if let Some(slot) = more.get("performed-in").and_then(Json::as_u64) {
            let slot = u32::try_from(slot).ok().filter(|slot| (*slot as usize) <= self.slots.len());
            node.insert("performed-in".into(), json!(slot.map(|slot| self.path(slot))));
        }
        copy(&mut node, "notes");
        let edits: Vec<&str> =
            self.edits.iter().filter(|edit| edit.slot == slot).map(|edit| edit.edit.as_str()).collect();
        if !edits.is_empty() {
            node.insert("edits".into(), json!(edits));
        }
        Ok(node)
    }

    fn attempt(&self, at: u32) -> Result<Json, String> {
        let it = &self.records[at as usize - 1];
        let mut json = json!({"status": it.status});
        let (key, result) = result(it)?;
        json[key] = result;
        json["start"] = json!(it.start_ns as f64 / 1e9);
        json["end"] = json!(it.end_ns.unwrap_or(0) as f64 / 1e9);
        Ok(json)
    }
}

/// Children of slots and records of slots, by their numbers.
struct Places {
    children: Vec<Vec<u32>>,
    records: Vec<Vec<u32>>,
}

fn result(it: &SavedRecord) -> Result<(&'static str, Json), String> {
    Ok(match &it.failure {
        Some(text) => {
            let bad = |_| format!("the failure of record {} is no JSON", it.record);
            ("failure", serde_json::from_str(text).map_err(bad)?)
        }
        None => ("value", json!(it.value.as_deref().unwrap_or("nil"))),
    })
}

// ---------------------------------------------------------------------------------------------
// Back to a tree

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
            (Some(json), _) => failure(program, &serde_json::from_str(json).unwrap_or_default(), read, 0),
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
fn failure(program: &Program, json: &Json, read: &dyn Fn(&str) -> Value, depth: usize) -> Value {
    const DEPTH: usize = 20;
    let Some(name) = json["type"].as_str().filter(|_| depth < DEPTH) else { return Value::NIL };
    let name = Symbol::from(name);
    let kind = program.failures.find(name).unwrap_or(Builtin::PlanFailure.id());
    let fields = json["fields"].as_object().into_iter().flatten();
    let fields = fields.map(|(key, value)| (Symbol::from(key), read(value.as_str().unwrap_or("nil"))));
    let mut it = Failure::of_type(kind, name, fields.collect());
    it.task = json["task"].as_str().map(|path| std::rc::Rc::new(Task::of_path(path)));
    if json["cause"].is_object() {
        it.cause = Some(failure(program, &json["cause"], read, depth + 1));
    }
    let also = json["also"].as_array().into_iter().flatten();
    it.also = also.map(|json| failure(program, json, read, depth + 1)).collect();
    Value::failure(it)
}

// ---------------------------------------------------------------------------------------------
// Rows as JSON

impl SavedTree {
    /// All rows as one JSON object, to be taken elsewhere.
    #[must_use]
    pub fn rows(&self) -> Json {
        let slots = self
            .slots
            .iter()
            .map(|it| json!([it.slot, it.parent, it.name, format!("{:016x}", it.site), it.steps, it.place]));
        let records = self.records.iter().map(|it| {
            json!([
                it.record,
                it.slot,
                it.parent,
                it.attempt,
                it.kind,
                it.status,
                it.why,
                it.start_ns,
                it.end_ns,
                it.params,
                it.value,
                it.failure,
                it.more
            ])
        });
        let edits = self.edits.iter().map(|it| json!([it.number, it.slot, it.edit, it.callee, it.after]));
        json!({
            "slots": slots.collect::<Json>(),
            "records": records.collect::<Json>(),
            "edits": edits.collect::<Json>(),
        })
    }

    /// The way back of [`SavedTree::rows`].
    ///
    /// # Errors
    /// A sentence that says which row is none.
    pub fn from_rows(json: &Json) -> Result<SavedTree, String> {
        fn rows<T>(json: &Json, key: &str, row: impl Fn(&Json) -> Option<T>) -> Result<Vec<T>, String> {
            let rows = json[key].as_array().ok_or_else(|| format!("there is no list of {key}"))?;
            let row = |(at, json)| row(json).ok_or_else(|| format!("{key}[{at}] is no row of them"));
            rows.iter().enumerate().map(row).collect()
        }
        let number = |json: &Json, at: usize| u32::try_from(json.get(at)?.as_u64()?).ok();
        let text = |json: &Json, at: usize| json.get(at)?.as_str().map(str::to_string);
        // Nothing for what is no text, and nothing inside for what is not there.
        let maybe = |json: &Json, at: usize| match json.get(at)? {
            Json::Null => Some(None),
            Json::String(text) => Some(Some(text.clone())),
            _ => None,
        };
        let slot = |it: &Json| {
            Some(SavedSlot {
                slot: number(it, 0)?,
                parent: number(it, 1)?,
                name: text(it, 2)?,
                site: u64::from_str_radix(&text(it, 3)?, 16).ok()?,
                steps: text(it, 4)?,
                place: number(it, 5)?,
            })
        };
        let record = |it: &Json| {
            Some(SavedRecord {
                record: number(it, 0)?,
                slot: number(it, 1)?,
                parent: number(it, 2)?,
                attempt: number(it, 3)?,
                kind: text(it, 4)?.into(),
                status: text(it, 5)?.into(),
                why: text(it, 6)?.into(),
                start_ns: it.get(7)?.as_u64()?,
                end_ns: it.get(8)?.as_u64(),
                params: text(it, 9)?,
                value: maybe(it, 10)?,
                failure: maybe(it, 11)?,
                more: maybe(it, 12)?,
            })
        };
        let edit = |it: &Json| {
            Some(SavedEdit {
                number: number(it, 0)?,
                slot: number(it, 1)?,
                edit: text(it, 2)?,
                callee: text(it, 3)?,
                after: text(it, 4)?,
            })
        };
        let tree = SavedTree {
            slots: rows(json, "slots", slot)?,
            records: rows(json, "records", record)?,
            edits: rows(json, "edits", edit)?,
        };
        tree.places()?;
        Ok(tree)
    }
}

// ---------------------------------------------------------------------------------------------
// Comparing

/// A difference between two trees.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// The path of the task.
    pub path: String,
    /// Only in the first, only in the second, or in both but not the same.
    pub kind: DifferenceKind,
    /// What is said of it in the first tree and in the second: fields that differ, with their texts.
    pub fields: Vec<(String, String, String)>,
}

/// Where a task is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DifferenceKind {
    /// Only in the first tree.
    Gone,
    /// Only in the second.
    New,
    /// In both.
    Changed,
}

impl DifferenceKind {
    /// The word for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            DifferenceKind::Gone => "gone",
            DifferenceKind::New => "new",
            DifferenceKind::Changed => "changed",
        }
    }
}

/// What differs between two trees, given as the nodes of [`show::json`]: tasks are the same if their paths are.
/// When they ran is no difference.
#[must_use]
pub fn diff(one: &Json, other: &Json) -> Vec<Difference> {
    const FIELDS: &[&str] =
        &["status", "why", "attempt", "params", "value", "failure", "grounded", "edits", "notes"];
    fn nodes(json: &Json) -> impl Iterator<Item = (&str, &Json)> {
        json.as_array().into_iter().flatten().filter_map(|node| Some((node["path"].as_str()?, node)))
    }
    fn text(json: &Json) -> String {
        match json {
            Json::Null => String::new(),
            Json::String(text) => text.clone(),
            other => other.to_string(),
        }
    }
    let before: BTreeMap<&str, &Json> = nodes(one).collect();
    let after: BTreeMap<&str, &Json> = nodes(other).collect();
    let status = |node: &Json| text(&node["status"]);
    let mut found = Vec::new();
    for (path, node) in nodes(one) {
        let difference = |kind, fields| Difference { path: path.into(), kind, fields };
        match after.get(path) {
            None => {
                let fields = vec![("status".to_string(), status(node), String::new())];
                found.push(difference(DifferenceKind::Gone, fields));
            }
            Some(other) => {
                let differing = FIELDS.iter().filter(|field| node[**field] != other[**field]);
                let fields: Vec<_> = differing
                    .map(|field| ((*field).to_string(), text(&node[*field]), text(&other[*field])))
                    .collect();
                if !fields.is_empty() {
                    found.push(difference(DifferenceKind::Changed, fields));
                }
            }
        }
    }
    for (path, node) in nodes(other).filter(|(path, _)| !before.contains_key(path)) {
        let fields = vec![("status".to_string(), String::new(), status(node))];
        found.push(Difference { path: path.into(), kind: DifferenceKind::New, fields });
    }
    found
}
