//! The task tree: places of a plan (slots) and what happened there (records).
//!
//! A **slot** is a place in the plan: parent, name, key. It owns the edits and survives from run
//! to run. A **record** is one run of a slot: attempt, parameters, status, value, start, end. It
//! never changes once it is final. The frame of a running plan names its record; nothing else
//! connects the two.
//!
//! The children of a slot are a list in order of creation, and the running record holds a
//! *cursor* in it: the next call is usually the next sibling, so a call costs no look-up. A miss
//! scans a few siblings, then builds an index for that slot.
//!
//! Invariants
//! 1. Keys are unique among siblings (the machine counts calls that could repeat one).
//! 2. A final status is never left.
//! 3. Parents have smaller numbers than their children, slots as well as records.

mod chunks;
mod record;

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use rustc_hash::FxHashMap;

use crate::code::{FnId, SiteId, TOP_LEVEL};
use crate::edit::Accepted;
use crate::key::{Key, Keys};
use crate::random::{hash_call, mix};
use crate::value::{Symbol, Value};
use crate::world::World;

use chunks::Chunks;
pub use record::{ATTEMPTED, CHANGED, COUNTED, DRIVEN, Extra, MOVED, NodeKind, RETRIED, Record, Status, Why};

/// A place in a plan. Zero is no slot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct SlotId(pub u32);

/// One run of a slot. Zero is no record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct RecId(pub u32);

/// The slot of `top-level`, the root of every tree.
pub const ROOT: SlotId = SlotId(1);

/// What is known of a place.
#[derive(Debug, Clone, Default)]
pub struct Slot {
    /// Stands for the path from the root in words; the key of random draws.
    pub hash: u64,
    /// What tells it from its siblings.
    pub key: Key,
    /// What was called here first.
    pub name: Symbol,
    /// The slot above.
    pub parent: SlotId,
    first: SlotId,
    last: SlotId,
    next: SlotId,
    /// The run that reached it last.
    run: u32,
    /// Its first record in that run.
    since: RecId,
    /// Its last record in that run.
    rec: RecId,
    /// Edits here: a position in [`Tree::edits_at`] plus one, or zero.
    edits: u32,
    /// Index of its children: a position in [`Tree::index`] plus one, or zero.
    index: u32,
    /// The plan that was called last, where the source does not say which; zero if it does.
    plan: FnId,
}

const _: () = assert!(size_of::<Record>() == 64);
const _: () = assert!(size_of::<Slot>() <= 72);

/// A task tree: all slots known, and the records of one run.
#[derive(Clone)]
pub struct Tree {
    slots: Chunks<Slot>,
    records: Chunks<Record>,
    params: Chunks<Value>,
    /// Chains of keys.
    pub keys: Keys,
    index: Vec<FxHashMap<Key, SlotId>>,
    extras: BTreeMap<RecId, Extra>,
    /// The edits, in the order in which they were accepted; their numbers begin at 1. Runs of a tree share
    /// them.
    pub edits: Rc<Vec<Accepted>>,
    edits_at: Rc<Vec<Vec<u32>>>,
    /// Counts changes: what was read of the tree holds as long as this stays the same.
    pub changes: u64,
    run: u32,
    /// How many edits there were when the run began: those after them show in no record.
    applied: u32,
    /// Slots from here on were made in this run.
    fresh_from: u32,
    /// The world as it was when the run had ended that grew it, if it had one and is over.
    pub world: Option<Rc<dyn World>>,
}

impl Default for Tree {
    fn default() -> Tree {
        let mut tree = Tree {
            slots: Chunks::default(),
            records: Chunks::default(),
            params: Chunks::default(),
            keys: Keys::default(),
            index: Vec::new(),
            extras: BTreeMap::new(),
            edits: Rc::default(),
            edits_at: Rc::default(),
            changes: 0,
            run: 0,
            applied: 0,
            fresh_from: 0,
            world: None,
        };
        tree.forget();
        tree.begin();
        tree
    }
}

impl Tree {
    /// Forgets all places and edits, and keeps the memory.
    pub fn forget(&mut self) {
        self.slots.clear();
        self.keys.forget();
        self.index.clear();
        self.edits = Rc::default();
        self.edits_at = Rc::default();
        let name = Symbol::from(TOP_LEVEL);
        self.slots.push(Slot { name, ..Slot::default() });
        self.slots.push(Slot { name, hash: crate::random::hash_text(&name), ..Slot::default() });
    }

    /// Starts a run: slots and edits stay, records of the last run go. Returns the root's record.
    pub fn begin(&mut self) -> RecId {
        self.records.clear();
        self.params.clear();
        self.extras.clear();
        self.run += 1;
        self.applied = self.edits.len() as u32;
        // A root without children is as new as what is made in this run.
        self.fresh_from = if self.has_children(ROOT) { self.slots.len as u32 } else { ROOT.0 };
        self.records.push(Record::default());
        let root = Record { slot: ROOT, attempt: 1, status: Status::Running, ..Record::default() };
        let rec = RecId(self.records.push(root));
        let slot = self.slots.get_mut(ROOT.0);
        (slot.run, slot.since, slot.rec) = (self.run, rec, rec);
        rec
    }

    /// The root calls something else in the same run, beside what it has called.
    pub fn begin_again(&mut self) {
        if self.has_children(ROOT) {
            self.retried(RecId(1));
        }
    }

    fn has_children(&self, slot: SlotId) -> bool {
        self.slots.get(slot.0).first != SlotId(0)
    }

    /// A tree with the same slots and edits, for a run to begin in.
    #[must_use]
    pub fn for_next_run(&self) -> Tree {
        Tree {
            slots: self.slots.clone(),
            records: Chunks::default(),
            params: Chunks::default(),
            keys: self.keys.clone(),
            index: self.index.clone(),
            extras: BTreeMap::new(),
            edits: self.edits.clone(),
            edits_at: self.edits_at.clone(),
            changes: 0,
            run: self.run,
            applied: self.edits.len() as u32,
            fresh_from: self.fresh_from,
            world: None,
        }
    }

    /// The same without any edit.
    #[must_use]
    pub fn without_edits(&self) -> Tree {
        let mut tree = Tree { edits: Rc::default(), edits_at: Rc::default(), applied: 0, ..self.clone() };
        tree.slots.iter_mut().for_each(|slot| slot.edits = 0);
        tree.changes += 1;
        tree
    }

    // ------------------------------------------------------------------ growing

    /// The child slot of `rec` with this key, made if it is new.
    #[inline(always)]
    pub fn child(&mut self, rec: RecId, key: Key, name: Symbol, site_hash: u64) -> SlotId {
        let record = self.records.get_mut(rec.0);
        let above = record.slot;
        let expected = if record.cursor.0 == 0 {
            self.slots.get(above.0).first
        } else {
            self.slots.get(record.cursor.0).next
        };
        if expected.0 != 0 && self.slots.get(expected.0).key == key {
            record.cursor = expected;
            return expected;
        }
        let is_new = expected.0 == 0 && above.0 >= self.fresh_from && record.flags & RETRIED == 0;
        let slot = if is_new {
            self.append(above, key, name, site_hash)
        } else {
            self.find(above, key, name, site_hash)
        };
        self.records.get_mut(rec.0).cursor = slot;
        slot
    }

    #[inline(always)]
    fn append(&mut self, above: SlotId, key: Key, name: Symbol, site_hash: u64) -> SlotId {
        let slot = SlotId(self.slots.len as u32);
        let parent = self.slots.get_mut(above.0);
        let last = std::mem::replace(&mut parent.last, slot);
        if last.0 == 0 {
            parent.first = slot;
        }
        let (above_hash, index) = (parent.hash, parent.index);
        if last.0 != 0 {
            self.slots.get_mut(last.0).next = slot;
        }
        if index != 0 {
            self.index[index as usize - 1].insert(key, slot);
        }
        let hash = match key.site == SiteId(0) && above == ROOT {
            // A plan that the program does not call itself draws as it does when it is called at top level.
            true => mix(above_hash ^ hash_call(TOP_LEVEL, &name, 1)),
            false => mix(above_hash ^ site_hash ^ self.keys.hash(key.chain)),
        };
        // Every field by name: the default of a name is looked up in the table of names.
        let none = SlotId(0);
        self.slots.push(Slot {
            hash,
            key,
            name,
            parent: above,
            first: none,
            last: none,
            next: none,
            run: 0,
            since: RecId(0),
            rec: RecId(0),
            edits: 0,
            index: 0,
            plan: FnId(0),
        });
        slot
    }

    #[inline(never)]
    fn find(&mut self, above: SlotId, key: Key, name: Symbol, site_hash: u64) -> SlotId {
        match self.lookup(above, key) {
            Some(slot) => slot,
            None => self.append(above, key, name, site_hash),
        }
    }

    /// The child of `above` with this key, if there is one.
    fn lookup(&mut self, above: SlotId, key: Key) -> Option<SlotId> {
        const SCAN: usize = 8;
        let parent = self.slots.get(above.0);
        let (index, mut at) = (parent.index, parent.first);
        if index != 0 {
            return self.index[index as usize - 1].get(&key).copied();
        }
        for _ in 0..SCAN {
            if at.0 == 0 {
                return None;
            }
            let slot = self.slots.get(at.0);
            if slot.key == key {
                return Some(at);
            }
            at = slot.next;
        }
        let index: FxHashMap<Key, SlotId> =
            self.all_children(above).map(|child| (self.slots.get(child.0).key, child)).collect();
        let found = index.get(&key).copied();
        self.index.push(index);
        self.slots.get_mut(above.0).index = self.index.len() as u32;
        found
    }

    /// The record of a new call of `slot`, with these parameters.
    #[inline(always)]
    pub fn enter(&mut self, parent: RecId, slot: SlotId, kind: NodeKind, args: &[Value], now: u64) -> RecId {
        self.changes += 1;
        let rec = RecId(self.records.len as u32);
        let run = self.run;
        let it = self.slots.get_mut(slot.0);
        let (mut attempt, mut flags) = (1, 0);
        if it.run == run {
            attempt = self.records.get(it.rec.0).attempt + 1;
            flags = RETRIED;
        } else {
            it.since = rec;
        }
        it.run = run;
        it.rec = rec;
        let params = self.params.len as u32;
        for arg in args {
            self.params.push(arg.clone());
        }
        let args = args.len() as u8;
        let status = Status::Running;
        self.records.push(Record {
            slot,
            parent,
            params,
            attempt,
            args,
            status,
            flags,
            kind,
            start: now,
            ..Record::default()
        });
        rec
    }

    /// The record of another attempt of a call that edits are made for: its parameters, as written and as
    /// changed, and where it is performed are those of the attempt before.
    pub fn enter_again(&mut self, before: RecId, now: u64) -> RecId {
        let Record { slot, parent, kind, flags, .. } = *self.record(before);
        let performed_in = self.extra(before).and_then(|extra| extra.performed_in);
        let written = self.written_args(before);
        let changed = self.is_changed(before).then(|| self.args(before));
        let rec = self.enter(parent, slot, kind, &written, now);
        self.record_mut(rec).flags |= DRIVEN | (flags & COUNTED);
        if let Some(args) = changed {
            self.change_args(rec, &args);
        }
        if performed_in.is_some() {
            self.extra_mut(rec).performed_in = performed_in;
        }
        rec
    }

    /// Makes a record final.
    #[inline(always)]
    pub fn end(&mut self, rec: RecId, status: Status, value: Value, now: u64) {
        self.changes += 1;
        let stamp = self.records.len as u32;
        let record = self.records.get_mut(rec.0);
        debug_assert!(!record.status.is_final(), "a final status is never left");
        record.status = status;
        record.end = now;
        record.stamp = stamp;
        record.value = value;
    }

    /// A slot begins only now, after what edits have put before it: that is its place among its
    /// siblings.
    pub fn begins(&mut self, slot: SlotId) {
        let next = RecId(self.records.len as u32);
        self.slots.get_mut(slot.0).since = next;
    }

    /// A slot has its place among its siblings where `first` has it, whenever it begins: branches of one form
    /// stand in the order of their making.
    pub fn stands_with(&mut self, slot: SlotId, first: SlotId) {
        if slot == first {
            return;
        }
        let since = self.slots.get(first.0).since;
        self.slots.get_mut(slot.0).since = since;
    }

    /// The children of `rec` may be called again: look before a slot is added.
    pub fn retried(&mut self, rec: RecId) {
        self.records.get_mut(rec.0).flags |= RETRIED;
    }

    /// A record, to be changed while it is not final.
    pub fn record_mut(&mut self, rec: RecId) -> &mut Record {
        self.changes += 1;
        self.records.get_mut(rec.0)
    }

    /// What few records have, made if it is missing.
    pub fn extra_mut(&mut self, rec: RecId) -> &mut Extra {
        self.changes += 1;
        self.extras.entry(rec).or_default()
    }

    /// How many failures were raised in the tasks of the run, those that it has recovered from included.
    #[must_use]
    pub fn failures(&self) -> usize {
        let raised = self.records().filter_map(|rec| self.record(rec).value.as_failure()?.task.as_ref());
        raised.map(Rc::as_ptr).collect::<BTreeSet<_>>().len()
    }

    /// Notes the plan that is called at a slot whose site does not say which.
    pub fn calls(&mut self, slot: SlotId, plan: FnId) {
        self.slots.get_mut(slot.0).plan = plan;
    }

    /// The plan that was called at a slot, where the source does not say which.
    #[must_use]
    pub fn called(&self, slot: SlotId) -> Option<FnId> {
        Some(self.slots.get(slot.0).plan).filter(|plan| *plan != FnId(0))
    }

    /// Puts other parameters in the place of those of a record, which stay beside them.
    pub fn change_args(&mut self, rec: RecId, args: &[Value]) {
        let written = self.place_of_written(rec);
        let end = written + u32::from(self.record(rec).args);
        if end as usize != self.params.len {
            for at in written..end {
                let value = self.params.get(at).clone();
                self.params.push(value);
            }
        }
        let params = self.params.len as u32;
        for arg in args {
            self.params.push(arg.clone());
        }
        let record = self.records.get_mut(rec.0);
        record.params = params;
        record.flags |= CHANGED;
        debug_assert!(args.len() == record.args as usize, "edits change parameters, not their number");
    }

    /// True if edits have changed the parameters of a record.
    #[must_use]
    pub fn is_changed(&self, rec: RecId) -> bool {
        self.record(rec).flags & CHANGED != 0
    }

    fn place_of_written(&self, rec: RecId) -> u32 {
        let record = self.record(rec);
        record.params - if self.is_changed(rec) { u32::from(record.args) } else { 0 }
    }

    // ------------------------------------------------------------------ from rows

    /// A slot of a saved tree, found or made.
    pub(crate) fn restore_slot(&mut self, above: SlotId, key: Key, name: Symbol, site_hash: u64) -> SlotId {
        self.find(above, key, name, site_hash)
    }

    /// A record of a saved tree, without parameters.
    pub(crate) fn restore_record(
        &mut self,
        parent: RecId,
        slot: SlotId,
        kind: NodeKind,
        start: u64,
    ) -> RecId {
        self.enter(parent, slot, kind, &[], start)
    }

    /// Gives a record without parameters these.
    pub(crate) fn restore_args(&mut self, rec: RecId, args: &[Value]) {
        let params = self.params.len as u32;
        for arg in args {
            self.params.push(arg.clone());
        }
        let record = self.records.get_mut(rec.0);
        (record.params, record.args) = (params, args.len() as u8);
    }

    /// A slot has its place among its siblings where this record has it.
    pub(crate) fn restore_place(&mut self, slot: SlotId, place: RecId) {
        self.slots.get_mut(slot.0).since = place;
    }

    // ------------------------------------------------------------------ edits

    /// The same of those that have been added since the run began.
    #[must_use]
    pub fn pending_edits_of(&self, slot: SlotId) -> &[u32] {
        let all = self.edits_of(slot);
        &all[all.partition_point(|id| *id <= self.applied)..]
    }

    /// Numbers of the edits at a slot, as positions in [`Tree::edits`] plus one.
    #[inline(always)]
    #[must_use]
    pub fn edits_of(&self, slot: SlotId) -> &[u32] {
        match self.slots.get(slot.0).edits {
            0 => &[],
            at => &self.edits_at[at as usize - 1],
        }
    }

    /// Adds an edit at a slot. Returns its number.
    pub fn add_edit(&mut self, slot: SlotId, edit: Accepted) -> u32 {
        self.changes += 1;
        Rc::make_mut(&mut self.edits).push(edit);
        let id = self.edits.len() as u32;
        let edits_at = Rc::make_mut(&mut self.edits_at);
        let it = self.slots.get_mut(slot.0);
        if it.edits == 0 {
            edits_at.push(Vec::new());
            it.edits = edits_at.len() as u32;
        }
        edits_at[it.edits as usize - 1].push(id);
        id
    }

    /// Slots and edits have been added to a tree that runs: there may be more below a slot than its cursor has seen, and
    /// the edits hold in this run.
    pub(crate) fn grafted(&mut self) {
        self.changes += 1;
        self.fresh_from = self.slots.len as u32;
        self.applied = self.edits.len() as u32;
    }

    // ------------------------------------------------------------------ looking

    /// A slot.
    #[must_use]
    pub fn slot(&self, slot: SlotId) -> &Slot {
        self.slots.get(slot.0)
    }
    /// A record.
    #[inline(always)]
    #[must_use]
    pub fn record(&self, rec: RecId) -> &Record {
        self.records.get(rec.0)
    }
    /// What few records have.
    #[must_use]
    pub fn extra(&self, rec: RecId) -> Option<&Extra> {
        self.extras.get(&rec)
    }
    /// The parameters of a record.
    #[must_use]
    pub fn args(&self, rec: RecId) -> Vec<Value> {
        let record = self.record(rec);
        (0..u32::from(record.args)).map(|i| self.params.get(record.params + i).clone()).collect()
    }
    /// The parameters of a record as the plan gives them, before edits have changed them.
    #[must_use]
    pub fn written_args(&self, rec: RecId) -> Vec<Value> {
        let first = self.place_of_written(rec);
        (0..u32::from(self.record(rec).args)).map(|i| self.params.get(first + i).clone()).collect()
    }
    /// One of the parameters of a record, by its number.
    #[must_use]
    pub fn arg(&self, rec: RecId, at: u8) -> Option<&Value> {
        let record = self.record(rec);
        (at < record.args).then(|| self.params.get(record.params + u32::from(at)))
    }
    /// How many records this run has made.
    #[must_use]
    pub fn len(&self) -> usize {
        self.records.len - 1
    }
    /// False: a tree has its root at least.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        false
    }
    /// All records of this run, in the order of their calls.
    pub fn records(&self) -> impl Iterator<Item = RecId> {
        (1..self.records.len as u32).map(RecId)
    }
    /// The last record of a slot in this run, if the run reached it.
    #[must_use]
    pub fn shown(&self, slot: SlotId) -> Option<RecId> {
        let it = self.slots.get(slot.0);
        (it.run == self.run && it.rec.0 != 0).then_some(it.rec)
    }
    /// All slots, in the order of their making.
    pub fn slots(&self) -> impl Iterator<Item = SlotId> + use<> {
        (ROOT.0..self.slots.len as u32).map(SlotId)
    }
    /// The slot that was made last.
    #[must_use]
    pub fn last_slot(&self) -> SlotId {
        SlotId(self.slots.len as u32 - 1)
    }
    /// The number of the record that the place of a slot among its siblings comes from; 0 if this run has
    /// not reached it.
    #[must_use]
    pub fn place(&self, slot: SlotId) -> u32 {
        let it = self.slots.get(slot.0);
        if it.run == self.run { it.since.0 } else { 0 }
    }
    /// The children of a slot, also those that this run has not reached, in the order of their making.
    pub(crate) fn all_children(&self, slot: SlotId) -> impl Iterator<Item = SlotId> {
        let mut next = self.slots.get(slot.0).first;
        std::iter::from_fn(move || {
            let at = next;
            (at.0 != 0).then(|| {
                next = self.slots.get(at.0).next;
                at
            })
        })
    }
    /// The children of a slot that this run reached, in the order of their first calls.
    #[must_use]
    pub fn children(&self, slot: SlotId) -> Vec<SlotId> {
        let mut children = Vec::new();
        self.children_into(slot, &mut children);
        children
    }
    /// The same into memory that is there.
    pub fn children_into(&self, slot: SlotId, children: &mut Vec<SlotId>) {
        children.clear();
        let since = |child: &SlotId| self.slots.get(child.0).since;
        children.extend(self.all_children(slot).filter(|child| self.slots.get(child.0).run == self.run));
        // Nearly always they were made in this order.
        if !children.is_sorted_by_key(since) {
            children.sort_by_key(since);
        }
    }
    /// The plan that `run-plan` ran, beside which edits may have put other tasks; without one, the
    /// last task of the root.
    #[must_use]
    pub fn root_plan(&self) -> SlotId {
        let children = self.children(ROOT);
        let by_run_plan = children.iter().find(|child| self.slot(**child).key.site.0 == 0);
        by_run_plan.or(children.last()).copied().unwrap_or(ROOT)
    }
    /// Memory of slots and records, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.slots.len * size_of::<Slot>()
            + self.records.len * size_of::<Record>()
            + self.params.len * size_of::<Value>()
    }
    /// Two integers that say which tree this is.
    #[must_use]
    pub fn fingerprint(&self) -> (usize, u32) {
        (self.records.len, self.run)
    }
    /// A few words: what ran, and what became of it.
    #[must_use]
    pub fn summary(&self) -> String {
        let root = self.root_plan();
        let status = self.shown(root).map_or("not run", |rec| self.record(rec).status.word());
        format!("{} {status}, {} nodes", self.slot(root).name, self.len())
    }
}
