//! Keys: what makes a place in a plan the same place in another run.
//!
//! The key of a slot is its call site and a **chain** of steps: the rounds of the loops around
//! it, the calls of functions between the plan and it, its occurrence where the site is reached
//! again. A round is named by its element and the rank of that element among equal ones, so a
//! shorter list, a skipped branch or a retry shifts nothing. Chains are interned: a key is two
//! integers.

use std::cell::RefCell;
use std::rc::Rc;

use hashbrown::HashTable;
use hashbrown::hash_table::Entry;
use rustc_hash::FxHashMap;

use crate::code::SiteId;
use crate::random::{hash_text, mix};
use crate::value::{Imm, Obj, Symbol, Value};

/// An element of a loop as part of a key: all that can be stored.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Element {
    /// An integer.
    Int(i64),
    /// A symbol.
    Symbol(Symbol),
    /// Any other value that prints as text that reads back, as that text. (Behind a thin pointer: there are
    /// many steps.)
    Text(Rc<Box<str>>),
}

impl Element {
    /// The element, if it can be stored.
    #[must_use]
    pub fn of(value: &Value) -> Option<Element> {
        match value {
            Value::Imm(Imm::Int(i)) => Some(Element::Int(*i)),
            Value::Imm(Imm::Symbol(name)) => Some(Element::Symbol(*name)),
            _ if is_storable(value) => Some(Element::Text(Rc::new(crate::print::write(value).into()))),
            _ => None,
        }
    }
}

/// How many parts an element of a loop may have to be its key.
const STORABLE_PARTS: usize = 1000;

/// True for numbers, strings, symbols, keywords, descriptions and collections of these.
fn is_storable(value: &Value) -> bool {
    let mut todo = vec![value.clone()];
    for _ in 0..STORABLE_PARTS {
        let Some(part) = todo.pop() else { return true };
        match &part {
            Value::Imm(Imm::Function(_) | Imm::Native(_)) => return false,
            Value::Imm(_) => {}
            Value::Obj(obj) => match &**obj {
                Obj::Str(_) | Obj::Pose(_) | Obj::Vec3(_) | Obj::Path(_) => {}
                Obj::Pair(first, rest) => todo.extend([first.clone(), rest.clone()]),
                Obj::Vector(items) => todo.extend(items.iter().take(STORABLE_PARTS).cloned()),
                Obj::Map(map) => {
                    todo.extend(map.iter().take(STORABLE_PARTS).flat_map(|(k, v)| [k.clone(), v.clone()]))
                }
                Obj::Desc(desc) => todo.extend(desc.values().cloned()),
                _ => return false,
            },
        }
    }
    false
}

/// A step on the way from a plan to a call in it.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Step {
    /// A round of a loop: its element, and the rank of that among equal ones before it.
    Round(Element, u32),
    /// A round of a loop over what cannot be stored: its number.
    Number(u32),
    /// A call of a function, by its site.
    Call(SiteId),
    /// What was called where the source does not say: the name of the plan or the action's type.
    Name(Symbol),
    /// The site was reached before with the same key, so many times.
    Again(u32),
    /// Code that an edit brought in, by the number of the edit.
    Edit(u32),
}

/// A chain of steps, as an index into [`Keys`]. Zero is the empty chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Chain(pub u32);

/// A round of `dotimes` directly in the plan is by far the most frequent chain: it is its number
/// with this bit set and is not looked up.
const DIRECT: u32 = 1 << 31;
/// The same for a call that is reached again.
const AGAIN: u32 = 1 << 30;

impl Chain {
    /// No steps.
    pub const EMPTY: Chain = Chain(0);

    /// The chain of a call that was reached so many times before.
    #[inline]
    #[must_use]
    pub fn again(times: u32) -> Option<Chain> {
        (times < AGAIN).then_some(Chain(times | AGAIN))
    }

    /// The step of a chain that is not looked up.
    fn direct(self) -> Option<Step> {
        match self.0 & (DIRECT | AGAIN) {
            0 => None,
            AGAIN => Some(Step::Again(self.0 & !AGAIN)),
            _ => Some(Step::Round(Element::Int(i64::from(self.0 & !DIRECT)), 0)),
        }
    }

    /// The chain of one round of `dotimes`.
    #[inline(always)]
    #[must_use]
    pub fn round(number: i64) -> Option<Chain> {
        (0..i64::from(AGAIN)).contains(&number).then_some(Chain(number as u32 | DIRECT))
    }
}

/// The key of a slot among its siblings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Key {
    /// The call.
    pub site: SiteId,
    /// The way to it.
    pub chain: Chain,
}

/// All chains of a tree.
#[derive(Debug, Clone)]
pub struct Keys {
    links: Vec<Link>,
    /// The chains by the hashes of their links: four bytes for a chain, which need not be hashed again
    /// when the table grows.
    index: HashTable<Chain>,
}

#[derive(Debug, Clone)]
struct Link {
    before: Chain,
    step: Step,
    hash: u64,
}

/// A branch has a link of its own.
const _: () = assert!(size_of::<Link>() <= 40);

impl Default for Keys {
    fn default() -> Keys {
        let nothing = Link { before: Chain::EMPTY, step: Step::Number(0), hash: 0 };
        Keys { links: vec![nothing], index: HashTable::new() }
    }
}

impl Keys {
    /// The chain with one more step. `site_hash` says what a call site is in words.
    pub fn then(&mut self, chain: Chain, step: Step, site_hash: impl Fn(SiteId) -> u64) -> Chain {
        let direct = match step {
            Step::Round(Element::Int(number), 0) => Chain::round(number),
            Step::Again(times) => Chain::again(times),
            _ => None,
        };
        if let Some(direct) = direct.filter(|_| chain == Chain::EMPTY) {
            return direct;
        }
        let hash = mix(self.hash(chain) ^ step_hash(&step, site_hash));
        let Keys { links, index } = self;
        let is_it = |known: &Chain| {
            let link = &links[known.0 as usize];
            link.before == chain && link.step == step
        };
        match index.entry(hash, is_it, |known| links[known.0 as usize].hash) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(room) => {
                let next = Chain(links.len() as u32);
                room.insert(next);
                links.push(Link { before: chain, step, hash });
                next
            }
        }
    }

    /// Forgets all chains and keeps the memory.
    pub fn forget(&mut self) {
        self.links.truncate(1);
        self.index.clear();
    }

    /// The steps of a chain, first to last.
    #[must_use]
    pub fn steps(&self, mut chain: Chain) -> Vec<Step> {
        let mut steps = Vec::new();
        while chain != Chain::EMPTY {
            if let Some(step) = chain.direct() {
                steps.push(step);
                break;
            }
            let link = &self.links[chain.0 as usize];
            steps.push(link.step.clone());
            chain = link.before;
        }
        steps.reverse();
        steps
    }

    /// A number that stands for what the chain says, the same in every run of the program.
    #[inline]
    #[must_use]
    pub fn hash(&self, chain: Chain) -> u64 {
        if let Some(step) = chain.direct() {
            return mix(step_hash(&step, |_| 0));
        }
        self.links[chain.0 as usize].hash
    }
}

fn step_hash(step: &Step, site_hash: impl Fn(SiteId) -> u64) -> u64 {
    let (kind, what) = match step {
        Step::Round(Element::Int(i), rank) => (1, mix(*i as u64) ^ u64::from(*rank)),
        Step::Round(Element::Symbol(name), rank) => (2, hash_text(name) ^ u64::from(*rank)),
        Step::Round(Element::Text(text), rank) => (3, hash_text(text) ^ u64::from(*rank)),
        Step::Number(n) => (4, u64::from(*n)),
        Step::Call(site) => (5, site_hash(*site)),
        Step::Name(name) => (6, hash_text(name)),
        Step::Again(n) => (7, u64::from(*n)),
        Step::Edit(id) => (8, u64::from(*id)),
    };
    mix(what ^ mix(kind))
}

/// The ranks of the elements of a list that a `dolist` walks, counted as far as it has come.
///
/// A loop that calls no plan never makes one; one that does counts each element once.
#[derive(Debug)]
pub struct Ranks(RefCell<Counted>);

#[derive(Debug)]
struct Counted {
    /// What follows the last element counted.
    rest: Value,
    /// The step of the last element counted.
    step: Step,
    rounds: Rounds,
}

/// Gives the rounds of a loop over a list their steps.
#[derive(Debug, Clone, Default)]
pub struct Rounds {
    /// Number of the last round.
    number: u32,
    /// How often each element came.
    seen: FxHashMap<Element, u32>,
}

impl Rounds {
    /// Room for so many.
    #[must_use]
    pub fn with_capacity(n: usize) -> Rounds {
        Rounds { number: 0, seen: FxHashMap::with_capacity_and_hasher(n, Default::default()) }
    }

    /// The step of the next round, which is for this element.
    pub fn next(&mut self, value: &Value) -> Step {
        self.number += 1;
        let Some(element) = Element::of(value) else { return Step::Number(self.number) };
        let count = self.seen.entry(element.clone()).or_insert(0);
        let step = Step::Round(element, *count);
        *count += 1;
        step
    }
}

impl Ranks {
    /// Ranks for the elements of `list`, none counted.
    #[must_use]
    pub fn new(list: Value) -> Ranks {
        Ranks(RefCell::new(Counted { rest: list, step: Step::Number(0), rounds: Rounds::default() }))
    }

    /// The step of the round after whose element `rest` is left.
    #[must_use]
    pub fn step(&self, rest: &Value) -> Step {
        let counted = &mut *self.0.borrow_mut();
        while !counted.rest.identical(rest) {
            let Some((first, after)) = counted.rest.cell() else { break };
            counted.step = counted.rounds.next(&first);
            counted.rest = after;
        }
        counted.step.clone()
    }

    /// Ranks for a loop that is not gone on with after that round: nothing is left of its list.
    #[must_use]
    pub fn left_after(&self, rest: &Value) -> Ranks {
        Ranks(RefCell::new(Counted { rest: Value::NIL, step: self.step(rest), rounds: Rounds::default() }))
    }

    /// The steps of the rounds that follow, when `rest` is left.
    #[must_use]
    pub fn to_come(&self, rest: &Value) -> Vec<Step> {
        let _ = self.step(rest);
        let mut ahead = self.0.borrow().rounds.clone();
        rest.iter().map(|element| ahead.next(element)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_elements_are_told_apart_by_rank() {
        let list = Value::list(["a", "b", "a"].map(Value::symbol));
        let ranks = Ranks::new(list.clone());
        let rests: Vec<Value> =
            std::iter::successors(Some(list), |it| Some(it.as_pair()?.1.clone())).skip(1).collect();
        let step = |name: &str, rank| Step::Round(Element::Symbol(name.into()), rank);
        assert_eq!(ranks.step(&rests[1]), step("b", 0));
        assert_eq!(ranks.step(&rests[2]), step("a", 1));
    }

    #[test]
    fn chains_are_interned_and_read_back() {
        let mut keys = Keys::default();
        let one = keys.then(Chain::EMPTY, Step::Call(SiteId(3)), |_| 7);
        let two = keys.then(one, Step::Again(1), |_| 7);
        assert_eq!(keys.then(one, Step::Again(1), |_| 7), two);
        assert_eq!(keys.steps(two), [Step::Call(SiteId(3)), Step::Again(1)]);
        assert_eq!(keys.steps(Chain::round(5).expect("small")), [Step::Round(Element::Int(5), 0)]);
    }
}
