//! The oracle's task tree: slots and records in plain vectors.
//!
//! It has no cursor and no interned chains: a key is written out in full and compared in full.
//! Natives that look at trees, and keyed draws, want the machine's tree: a mirror of each slot and
//! record goes there, and the oracle never reads it back.

use std::collections::HashMap;
use std::rc::Rc;

use vm::code::{FnId, SiteId};
use vm::key::{Chain, Key, Step};
use vm::path::{Path, PathStep};
use vm::tree::{Extra, NodeKind, ROOT, RecId, SlotId, Status, Why};
use vm::value::{Symbol, Value};

use super::edits::Accepted;
use super::forms::Place;

/// What a place in a plan is called by its siblings: its call and the way to it.
pub type FullKey = (SiteId, Vec<Step>);

/// How often keys were called.
pub type Counts = HashMap<FullKey, u32>;

/// A place in a plan. The root is number 0.
#[derive(Clone, Default)]
pub struct Slot {
    pub parent: Option<usize>,
    pub name: Symbol,
    pub key: FullKey,
    /// The forms around it, from the root, as they stood when it was called last.
    pub place: Place,
    /// The plan that was called here last; none for a description.
    pub plan: Option<FnId>,
    /// True if the value of the call is used.
    pub value_used: bool,
    /// Numbers of the edits here.
    pub edits: Vec<usize>,
    /// Its records in this run.
    pub records: Vec<usize>,
    /// The slots below it that this run reached, in the order of their first calls.
    pub children: Vec<usize>,
    pub mirror: SlotId,
}

impl Slot {
    /// How often the same was called before.
    pub fn occurrence(&self) -> u32 {
        if let Some(Step::Again(n)) = self.key.1.last() { *n } else { 0 }
    }
}

/// One run of a slot. The root's is number 0.
#[derive(Clone, Default)]
pub struct Record {
    pub slot: usize,
    pub parent: Option<usize>,
    pub attempt: usize,
    pub kind: NodeKind,
    pub args: Vec<Value>,
    pub status: Status,
    pub why: Why,
    /// The value, or the failure that left it.
    pub value: Value,
    pub start: u64,
    pub end: u64,
    /// The parameters as the plan gives them, where an edit changed them.
    pub written: Option<Vec<Value>>,
    /// What a description was grounded to.
    pub grounded: Option<Value>,
    pub notes: Vec<String>,
    /// The slot of the form in which it was performed, if it was deferred.
    pub performed_in: Option<usize>,
    /// The check of its goal has moved to an obligation.
    pub moved: bool,
    /// How often each key was called in it.
    pub counts: Counts,
    pub mirror: RecId,
}

/// A tree: the slots of all runs, the records of one.
#[derive(Clone)]
pub struct Tree {
    pub slots: Vec<Slot>,
    pub records: Vec<Record>,
    pub edits: Vec<Rc<Accepted>>,
    /// The rounds of the loops that this run came to.
    pub loops: Vec<(Place, Rc<Vec<Step>>)>,
    by_key: HashMap<(usize, FullKey), usize>,
    pub mirror: vm::tree::Tree,
}

impl Tree {
    /// A tree whose root runs, with the slots and edits of `start`.
    pub fn begin(start: Option<&Tree>) -> Tree {
        let mut tree = match start {
            Some(start) => Tree {
                records: Vec::new(),
                loops: Vec::new(),
                mirror: start.mirror.for_next_run(),
                ..start.clone()
            },
            None => Tree {
                slots: vec![Slot { name: Symbol::from("top-level"), mirror: ROOT, ..Slot::default() }],
                records: Vec::new(),
                edits: Vec::new(),
                loops: Vec::new(),
                by_key: HashMap::new(),
                mirror: vm::tree::Tree::default(),
            },
        };
        for slot in &mut tree.slots {
            slot.records.clear();
            slot.children.clear();
        }
        let mirror = tree.mirror.begin();
        tree.slots[0].records.push(0);
        tree.records.push(Record { attempt: 1, status: Status::Running, mirror, ..Record::default() });
        tree
    }

    /// The slot with this key below that of a record, made if it is new.
    pub fn slot(
        &mut self,
        parent: usize,
        key: FullKey,
        name: Symbol,
        site_hash: impl Fn(SiteId) -> u64,
    ) -> usize {
        let above = self.records[parent].slot;
        if let Some(known) = self.by_key.get(&(above, key.clone())) {
            return *known;
        }
        let mut chain = Chain::EMPTY;
        for step in &key.1 {
            chain = self.mirror.keys.then(chain, step.clone(), &site_hash);
        }
        let rec = self.records[parent].mirror;
        self.mirror.retried(rec);
        let mirror = self.mirror.child(rec, Key { site: key.0, chain }, name, site_hash(key.0));
        self.by_key.insert((above, key.clone()), self.slots.len());
        self.slots.push(Slot { parent: Some(above), name, key, mirror, ..Slot::default() });
        self.slots.len() - 1
    }

    /// A new record of a slot.
    pub fn enter(&mut self, parent: usize, slot: usize, kind: NodeKind, args: Vec<Value>, now: u64) -> usize {
        let number = self.records.len();
        if self.slots[slot].records.is_empty() {
            let above = self.records[parent].slot;
            self.slots[above].children.push(slot);
        }
        self.slots[slot].records.push(number);
        let attempt = self.slots[slot].records.len();
        let mirror =
            self.mirror.enter(self.records[parent].mirror, self.slots[slot].mirror, kind, &args, now);
        let (parent, status) = (Some(parent), Status::Running);
        self.records.push(Record {
            slot,
            parent,
            attempt,
            kind,
            args,
            status,
            start: now,
            mirror,
            ..Record::default()
        });
        number
    }

    /// A slot begins only now, after what edits have put before it: that is its place among its
    /// siblings.
    pub fn begins(&mut self, slot: usize) {
        let parent = self.slots[slot].parent.expect("the root is not called");
        self.slots[parent].children.retain(|child| *child != slot);
        self.slots[parent].children.push(slot);
        self.mirror.begins(self.slots[slot].mirror);
    }

    /// A slot stands where `first` does among its siblings, in the order of the text with those of its form
    /// that have begun.
    pub fn stands_with(&mut self, slot: usize, first: usize, begun: &[usize]) {
        let parent = self.slots[slot].parent.expect("the root is not called");
        let children = &mut self.slots[parent].children;
        let mut together: Vec<usize> = children.iter().copied().filter(|it| begun.contains(it)).collect();
        together.sort_unstable();
        let before = children.iter().take_while(|it| !begun.contains(it)).count();
        children.retain(|it| !begun.contains(it));
        children.splice(before..before, together);
        self.mirror.stands_with(self.slots[slot].mirror, self.slots[first].mirror);
    }

    /// Lets the mirror show what has become of each record.
    pub fn polish(&mut self) {
        for record in &self.records {
            let it = self.mirror.record_mut(record.mirror);
            (it.why, it.start) = (record.why, record.start);
            if record.written.is_some() {
                self.mirror.change_args(record.mirror, &record.args);
            }
            let performed_in = record.performed_in.map(|slot| self.slots[slot].mirror);
            let (grounded, notes) = (record.grounded.clone(), record.notes.clone());
            *self.mirror.extra_mut(record.mirror) = Extra { grounded, performed_in, notes };
        }
    }

    /// Makes a record final.
    pub fn end(&mut self, record: usize, status: Status, value: Value, now: u64) {
        let it = &mut self.records[record];
        assert!(!it.status.is_final(), "a final status is never left");
        (it.status, it.value, it.end) = (status, value.clone(), now);
        self.mirror.end(it.mirror, status, value, now);
    }

    /// Adds an edit at a slot.
    pub fn add_edit(&mut self, slot: usize, accepted: Accepted) {
        let (edit, code) = (Rc::new(accepted.edit.clone()), accepted.code.map(|(id, _)| id));
        let mirror = vm::edit::Accepted {
            origin: "".into(),
            edit,
            callee: accepted.callee,
            plan: None,
            code,
            after: Vec::new(),
            between: Default::default(),
        };
        self.mirror.add_edit(self.slots[slot].mirror, mirror);
        self.slots[slot].edits.push(self.edits.len());
        self.edits.push(Rc::new(accepted));
    }

    /// The path of a slot that this run reached.
    pub fn path(&self, slot: usize) -> Path {
        let mut steps = Vec::new();
        let mut at = slot;
        while let Some(parent) = self.slots[at].parent {
            let name = self.slots[at].name;
            let same_name =
                self.slots[parent].children.iter().filter(|other| self.slots[**other].name == name);
            let before = same_name.take_while(|other| **other != at).count();
            steps.push(PathStep { name, call: before as u32 + 1 });
            at = parent;
        }
        steps.reverse();
        Path { steps }
    }

    /// The slot at a path, if this run reached it.
    pub fn find(&self, path: &Path) -> Option<usize> {
        let from_root = path.steps.first().is_some_and(|step| step.name == "top-level");
        let mut at = 0;
        for step in path.steps.iter().skip(usize::from(from_root)) {
            let mut same_name =
                self.slots[at].children.iter().filter(|child| self.slots[**child].name == step.name);
            at = *same_name.nth(step.call.checked_sub(1)? as usize)?;
        }
        Some(at)
    }

    /// True if `slot` is `of` or below it.
    pub fn is_within(&self, slot: usize, of: usize) -> bool {
        std::iter::successors(Some(slot), |at| self.slots[*at].parent).any(|at| at == of)
    }
}
