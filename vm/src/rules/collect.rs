//! What is collected from all answers of a goal: `findall`, `count`, `min`, `max`, `bagof`, `setof`.
//!
//! Answers are copied, for the terms go when the next answer is looked for. Those that are compared are kept as values.

use std::cmp::Ordering;

use crate::value::Value;

use super::clause::Collect;
use super::copies::Copies;
use super::store::{Cell, Outside, Store, TooLarge};

/// A collection that is being made.
pub(super) struct Collecting {
    kind: Collect,
    /// The least or greatest so far.
    best: Option<Value>,
    /// All of them, and where each is.
    copies: Copies,
    items: Vec<u32>,
    count: i64,
    /// An item has variables in it.
    open: bool,
}

impl Collecting {
    pub fn new(kind: Collect) -> Collecting {
        Collecting { kind, best: None, copies: Copies::default(), items: Vec::new(), count: 0, open: false }
    }

    pub fn bytes(&self) -> usize {
        self.items.len() * 4 + self.copies.bytes()
    }

    /// One more answer.
    pub fn add(&mut self, store: &Store, term: Cell, outside: &dyn Outside) -> Result<(), TooLarge> {
        self.count += 1;
        let wanted = match self.kind {
            Collect::Count => return Ok(()),
            Collect::List => {
                self.items.push(self.copies.add(store, term, outside)?);
                return Ok(());
            }
            Collect::Min => Ordering::Less,
            Collect::Max => Ordering::Greater,
        };
        let mut vars = Vec::new();
        let value = store.export_with(term, outside, &mut vars)?;
        self.open |= !vars.is_empty();
        if self.best.as_ref().is_none_or(|best| value.cmp(best) == wanted) {
            self.best = Some(value);
        }
        Ok(())
    }

    /// The result; nothing for the least or greatest of nothing.
    pub fn finish(&mut self, store: &mut Store) -> Result<Option<Cell>, TooLarge> {
        Ok(match self.kind {
            Collect::Count => Some(Cell::int(self.count)),
            Collect::Min | Collect::Max => match &self.best {
                Some(item) => Some(import(store, item, self.open)?),
                None => None,
            },
            Collect::List => {
                let start = self.copies.put_back(store);
                let items = self.items.drain(..).rev();
                Some(items.fold(Cell::NIL, |list, at| {
                    let first = store.heap[(start + at) as usize];
                    store.pair(first, list)
                }))
            }
        })
    }
}

fn import(store: &mut Store, value: &Value, open: bool) -> Result<Cell, TooLarge> {
    if open { store.import_open(value, &mut Vec::new()) } else { Ok(store.import(value)) }
}

fn list(store: &mut Store, items: &[Value], open: bool) -> Result<Cell, TooLarge> {
    let mut list = Cell::NIL;
    for item in items.iter().rev() {
        let first = import(store, item, open)?;
        list = store.pair(first, list);
    }
    Ok(list)
}

/// The groups of `bagof` that are still to come: what they have in common, and their instances.
pub(super) struct Groups {
    groups: Vec<(Value, Vec<Value>)>,
    next: usize,
    /// What takes the common part. The register that it came in may hold something else by then.
    pub key: Cell,
    /// Where the clause goes on.
    pub pc: u32,
}

impl Groups {
    /// `all` is a list of pairs of what answers have in common, which is unified with `key`, and their
    /// instances.
    pub fn new(
        store: &Store,
        key: Cell,
        all: Cell,
        set: bool,
        pc: u32,
        outside: &dyn Outside,
    ) -> Result<Groups, TooLarge> {
        let all = store.export(all, outside)?;
        let mut pairs: Vec<(Value, Value)> =
            all.iter().filter_map(|it| it.as_pair().map(|(key, item)| (key.clone(), item.clone()))).collect();
        pairs.sort_by(|a, b| a.0.cmp(&b.0));
        let mut groups: Vec<(Value, Vec<Value>)> = Vec::new();
        for (key, item) in pairs {
            match groups.last_mut() {
                Some((known, items)) if *known == key => items.push(item),
                _ => groups.push((key, vec![item])),
            }
        }
        if set {
            for (_, items) in &mut groups {
                items.sort();
                items.dedup();
            }
        }
        Ok(Groups { groups, next: 0, key, pc })
    }

    /// The instances of the next group whose common part fits, and whether there are more groups.
    pub fn next(&mut self, store: &mut Store) -> Result<Option<(Cell, bool)>, TooLarge> {
        while let Some((common, items)) = self.groups.get(self.next) {
            self.next += 1;
            let mark = store.mark();
            let common = store.import_open(common, &mut Vec::new())?;
            if store.unify(self.key, common)? {
                let items = list(store, items, true)?;
                return Ok(Some((items, self.next < self.groups.len())));
            }
            store.back_to(mark);
        }
        Ok(None)
    }
}
