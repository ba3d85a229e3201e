//! The graft of a tree: its edits, and the places that they need.

use std::collections::BTreeSet;
use std::rc::Rc;

use rustc_hash::FxHashMap;

use super::{AROUND, CALL, Change, Graft, Link, Place, Words, not_applied};

use crate::code::Program;
use crate::key::Step;
use crate::path::PathStep;
use crate::tree::{ROOT, SlotId, Tree};
use crate::value::Symbol;

impl Graft {
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
