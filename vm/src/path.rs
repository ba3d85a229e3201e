//! Paths: how slots are printed and read.
//!
//! `top-level / transporting :call 2 / fetching`: names from the root, with the rank among
//! siblings of one name where it is not 1. Attempts are never part of a path.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::tree::{ROOT, SlotId, Tree};
use crate::value::Symbol;

/// Of a longer path this many steps are shown to people from its start, and as many from its end.
const SHOWN_STEPS: usize = 20;

/// A path in a task tree.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Path {
    /// From the root, which is not named.
    pub steps: Vec<PathStep>,
}

/// One step down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PathStep {
    /// The name of the task.
    pub name: Symbol,
    /// Its rank among siblings of that name, from 1.
    pub call: u32,
}

impl Ord for Path {
    fn cmp(&self, other: &Path) -> std::cmp::Ordering {
        let words =
            |path: &Path| path.steps.iter().map(|step| (step.name.as_str(), step.call)).collect::<Vec<_>>();
        words(self).cmp(&words(other))
    }
}
impl PartialOrd for Path {
    fn partial_cmp(&self, other: &Path) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Path {
    /// The path of these steps. The root, `top-level`, may be named at the start.
    #[must_use]
    pub fn new(mut steps: Vec<PathStep>) -> Path {
        if steps.first().is_some_and(|step| step.name == "top-level" && step.call == 1) {
            steps.remove(0);
        }
        Path { steps }
    }

    /// As shown to people: `main / transporting :call 2 / fetching`.
    #[must_use]
    pub fn show(&self) -> String {
        let steps = self.steps.iter().map(|step| match step.call {
            1 => step.name.to_string(),
            call => format!("{} :call {call}", step.name),
        });
        let mut words: Vec<String> = std::iter::once("top-level".to_string()).chain(steps).collect();
        if words.len() > 2 * SHOWN_STEPS {
            let more = words.len() - 2 * SHOWN_STEPS;
            words.splice(SHOWN_STEPS..SHOWN_STEPS + more, [format!("… {more} more …")]);
        }
        words.join(" / ")
    }

    /// The path of a slot that the tree's run reached.
    #[must_use]
    pub fn of(tree: &Tree, slot: SlotId) -> Path {
        let mut steps = Vec::new();
        let mut at = slot;
        while at != ROOT && at.0 != 0 {
            let it = tree.slot(at);
            let same_name =
                tree.children(it.parent).into_iter().filter(|child| tree.slot(*child).name == it.name);
            let before = same_name.take_while(|child| *child != at).count();
            steps.push(PathStep { name: it.name, call: before as u32 + 1 });
            at = it.parent;
        }
        steps.reverse();
        Path { steps }
    }

    /// The slot at this path, or how far the path could be followed and what is there.
    ///
    /// # Errors
    /// A sentence that names the step that is missing and its siblings.
    pub fn find(&self, tree: &Tree) -> Result<SlotId, String> {
        let mut at = ROOT;
        for (depth, step) in self.steps.iter().enumerate() {
            if depth == 0 && step.name == "top-level" {
                continue;
            }
            let children = tree.children(at);
            let same_name: Vec<SlotId> =
                children.iter().copied().filter(|child| tree.slot(*child).name == step.name).collect();
            let found = (step.call as usize).checked_sub(1).and_then(|at| same_name.get(at));
            at = *found.ok_or_else(|| {
                let here = Path { steps: self.steps[..depth].to_vec() }.show();
                match same_name.len() {
                    0 => format!("there is no `{}` in {here}, {}", step.name, names(tree, &children)),
                    n => format!(
                        "`{}` was called {n} times in {here}, there is no call {}",
                        step.name, step.call
                    ),
                }
            })?;
        }
        Ok(at)
    }
}

/// The children of places that somebody has looked at, by their names: for many looks at one tree.
#[derive(Default)]
pub struct Places(FxHashMap<SlotId, FxHashMap<Symbol, Vec<SlotId>>>);

impl Path {
    /// The same as [`Path::find`] for many paths of one tree, which stays as it is.
    ///
    /// # Errors
    /// A sentence that names the step that is missing and its siblings.
    pub fn find_with(&self, tree: &Tree, places: &mut Places) -> Result<SlotId, String> {
        let mut at = ROOT;
        for (depth, step) in self.steps.iter().enumerate() {
            if depth == 0 && step.name == "top-level" {
                continue;
            }
            let below = places.0.entry(at).or_insert_with(|| {
                let mut by_name: FxHashMap<Symbol, Vec<SlotId>> = FxHashMap::default();
                for child in tree.children(at) {
                    by_name.entry(tree.slot(child).name).or_default().push(child);
                }
                by_name
            });
            let rank = (step.call as usize).checked_sub(1);
            match rank.and_then(|rank| below.get(&step.name)?.get(rank)) {
                Some(slot) => at = *slot,
                None => return self.find(tree),
            }
        }
        Ok(at)
    }
}

/// The end of a path: `fetch / drive`, `drive :call 2`. A step without a number is any call of that name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PathEnd {
    steps: Vec<(Symbol, Option<u32>)>,
}

impl PathEnd {
    /// Reads one as paths are shown; `name[*]` is any call of that name, too.
    #[must_use]
    pub fn parse(text: &str) -> Option<PathEnd> {
        let step = |text: &str| {
            let mut words = text.split_whitespace();
            let (name, call) = (words.next()?, words.next());
            let call = match call {
                None => None,
                Some(":call") => Some(words.next()?.parse().ok().filter(|call| *call > 0)?),
                Some(_) => return None,
            };
            let name = name.strip_suffix("[*]").filter(|_| call.is_none()).unwrap_or(name);
            let is_name = !name.is_empty() && !name.contains(['[', ']', '(', ')', ':']);
            (is_name && words.next().is_none()).then(|| (Symbol::from(name), call))
        };
        Some(PathEnd { steps: text.split('/').map(step).collect::<Option<_>>()? })
    }

    /// True if the path of a slot ends so.
    #[must_use]
    pub fn is_of(&self, tree: &Tree, slot: SlotId) -> bool {
        let mut at = Some(slot);
        let mut names = self.steps.iter().rev().map(|(name, _)| {
            let it = tree.slot(at?);
            at = Some(it.parent).filter(|_| at != Some(ROOT));
            (it.name == *name).then_some(())
        });
        if names.any(|it| it.is_none()) {
            return false;
        }
        // Ranks take a walk over siblings.
        self.steps.iter().all(|(_, call)| call.is_none()) || {
            let path = Path::of(tree, slot);
            let mut steps = self.steps.iter().rev().zip(path.steps.iter().rev());
            steps.all(|((_, call), step)| call.is_none_or(|call| call == step.call))
        }
    }
}

/// Paths of many slots of one tree: the siblings of each are counted once.
pub(crate) struct Paths<'t> {
    tree: &'t Tree,
    counted: FxHashSet<SlotId>,
    calls: FxHashMap<SlotId, u32>,
}

impl<'t> Paths<'t> {
    pub(crate) fn of(tree: &'t Tree) -> Paths<'t> {
        Paths { tree, counted: FxHashSet::default(), calls: FxHashMap::default() }
    }

    /// What [`Path::of`] gives.
    pub(crate) fn path(&mut self, slot: SlotId) -> Path {
        let mut steps = Vec::new();
        let mut at = slot;
        while at != ROOT && at.0 != 0 {
            let it = self.tree.slot(at);
            if self.counted.insert(it.parent) {
                self.count(it.parent);
            }
            steps.push(PathStep { name: it.name, call: self.calls.get(&at).copied().unwrap_or(1) });
            at = it.parent;
        }
        steps.reverse();
        Path { steps }
    }

    fn count(&mut self, parent: SlotId) {
        let mut ranks: FxHashMap<Symbol, u32> = FxHashMap::default();
        for child in self.tree.children(parent) {
            let rank = ranks.entry(self.tree.slot(child).name).or_insert(0);
            *rank += 1;
            self.calls.insert(child, *rank);
        }
    }
}

/// The different names of some slots, for a message.
fn names(tree: &Tree, slots: &[SlotId]) -> String {
    let mut names: Vec<&str> = slots.iter().map(|slot| tree.slot(*slot).name.as_str()).collect();
    names.dedup();
    if names.is_empty() { "nor any other task".into() } else { format!("only {}", names.join(", ")) }
}
