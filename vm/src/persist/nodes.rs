//! From rows to the list of nodes that people and programs look at, without a tree in between: a saved tree can be shown
//! where its program is not.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;
use serde_json::{Map as JsonMap, Value as Json, json};

use super::{SavedRecord, SavedSlot, SavedTree};
use crate::show;
use crate::tree::ROOT;

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
            let all = places.records(slot);
            let Some(last) = all.last() else { continue };
            let number = nodes.len();
            let mut node = self.node(slot, *last, parent, &path)?;
            if all.len() > 1 {
                let all: Result<Vec<Json>, String> = all.iter().map(|at| self.attempt(*at)).collect();
                node.insert("attempts".into(), Json::Array(all?));
            }
            nodes.push(Json::Object(node));
            let mut ranks: BTreeMap<&str, usize> = BTreeMap::new();
            let mut below = Vec::new();
            for child in places.children(slot) {
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
    pub(crate) fn places(&self) -> Result<Places, String> {
        let slots = self.slots.len() + 1;
        let mut places = Places { ends: vec![0; slots + 1], ..Places::default() };
        for (at, slot) in (1..).zip(&self.slots) {
            let is_root = at == ROOT.0;
            if slot.slot != at || (slot.parent == 0) != is_root || slot.parent >= at {
                return Err(format!("slot {at} does not fit to those before it"));
            }
            if !is_root && slot.place > 0 {
                places.ends[slot.parent as usize + 1] += 1;
            }
        }
        for at in 1..places.ends.len() {
            places.ends[at] += places.ends[at - 1];
        }
        places.children = vec![0; *places.ends.last().unwrap_or(&0) as usize];
        let mut next = places.ends.clone();
        for slot in self.slots.iter().filter(|slot| slot.slot != ROOT.0 && slot.place > 0) {
            let at = &mut next[slot.parent as usize];
            places.children[*at as usize] = slot.slot;
            *at += 1;
        }
        let place = |child: &u32| self.slots[*child as usize - 1].place;
        for ends in places.ends.windows(2) {
            let children = &mut places.children[ends[0] as usize..ends[1] as usize];
            // Nearly always they were made in this order.
            if !children.is_sorted_by_key(place) {
                children.sort_by_key(place);
            }
        }
        places.last = vec![0; slots];
        for (at, record) in (1..).zip(&self.records) {
            let known = record.slot >= 1 && (record.slot as usize) <= self.slots.len();
            if record.record != at || !known || record.parent >= at || (record.parent == 0) != (at == 1) {
                return Err(format!("record {at} does not fit to those before it"));
            }
            let last = std::mem::replace(&mut places.last[record.slot as usize], at);
            if last != 0 {
                places.several.entry(record.slot).or_insert_with(|| vec![last]).push(at);
            }
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
            Some(if rank == 1 { it.name.to_string() } else { format!("{} :call {rank}", it.name) })
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
        node.insert("name".into(), json!(self.slots[slot as usize - 1].name.as_str()));
        node.insert("path".into(), if path.is_empty() { Json::Null } else { json!(path) });
        node.insert("parent".into(), json!(parent));
        node.insert("kind".into(), json!(it.kind.as_str()));
        node.insert("status".into(), json!(it.status.as_str()));
        node.insert("attempt".into(), json!(it.attempt));
        let params = match it.params.as_str() {
            "" => Json::Object(JsonMap::new()),
            text => serde_json::from_str(text).map_err(|_| bad("parameters"))?,
        };
        node.insert("params".into(), params);
        let (key, result) = result(it)?;
        node.insert(key.into(), result);
        if !it.why.is_empty() {
            node.insert("why".into(), json!(it.why.as_str()));
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
        let mut json = json!({"status": it.status.as_str()});
        let (key, result) = result(it)?;
        json[key] = result;
        json["start"] = json!(it.start_ns as f64 / 1e9);
        json["end"] = json!(it.end_ns.unwrap_or(0) as f64 / 1e9);
        Ok(json)
    }
}

/// Children of slots and records of slots, by their numbers.
#[derive(Default)]
pub(crate) struct Places {
    /// Where the children of each slot end; those of the next one begin there.
    ends: Vec<u32>,
    children: Vec<u32>,
    /// The last record of each slot; 0 for none.
    last: Vec<u32>,
    /// All of them where there are several.
    several: FxHashMap<u32, Vec<u32>>,
}

impl Places {
    /// The slots below one, in the order of their calls.
    pub(crate) fn children(&self, slot: u32) -> &[u32] {
        &self.children[self.ends[slot as usize] as usize..self.ends[slot as usize + 1] as usize]
    }

    /// The records of a slot, the one that is shown last.
    pub(crate) fn records(&self, slot: u32) -> &[u32] {
        match self.several.get(&slot) {
            Some(all) => all,
            None => self.last.get(slot as usize..=slot as usize).filter(|it| it[0] != 0).unwrap_or_default(),
        }
    }
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
