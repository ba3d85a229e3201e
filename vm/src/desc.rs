//! Entity descriptions: `(an action (type fetching) (object (an object (type milk))))`.
//!
//! A description is a value. Its properties have no order: they are kept sorted by key, so
//! equality and matching walk both sides once.

use crate::value::{Map, Symbol, Value, equal};

/// The kinds of entities that can be described.
pub const KINDS: [&str; 4] = ["action", "location", "motion", "object"];

/// What is said about an entity.
#[derive(Clone)]
pub struct Desc {
    /// `action`, `motion`, `location` or `object`.
    pub kind: Symbol,
    /// Sorted by the letters of the key; each key once.
    properties: Vec<(Symbol, Value)>,
}

impl Desc {
    /// A description; the later of two properties with one key holds.
    #[must_use]
    pub fn new(kind: Symbol, mut properties: Vec<(Symbol, Value)>) -> Desc {
        properties.reverse();
        properties.sort_by(|a, b| a.0.as_str().cmp(b.0.as_str()));
        properties.dedup_by_key(|property| property.0);
        Desc { kind, properties }
    }

    /// The value of a property.
    #[must_use]
    pub fn get(&self, key: Symbol) -> Option<&Value> {
        self.properties.iter().find(|property| property.0 == key).map(|property| &property.1)
    }

    /// The same description with one property added or changed.
    #[must_use]
    pub fn with(&self, key: Symbol, value: Value) -> Desc {
        let mut properties = self.properties.clone();
        properties.push((key, value));
        Desc::new(self.kind, properties)
    }

    /// The same description without one property.
    #[must_use]
    pub fn without(&self, key: Symbol) -> Desc {
        let properties = self.properties.iter().filter(|property| property.0 != key).cloned().collect();
        Desc { kind: self.kind, properties }
    }

    /// The `type` of the entity, if one is given as a symbol.
    #[must_use]
    pub fn entity_type(&self) -> Option<Symbol> {
        self.get(Symbol::from("type"))?.as_symbol()
    }

    /// Keys and values, sorted by key.
    pub fn properties(&self) -> impl Iterator<Item = (Symbol, &Value)> {
        self.properties.iter().map(|(key, value)| (*key, value))
    }

    /// The values, in the order of their keys.
    pub(crate) fn values(&self) -> impl DoubleEndedIterator<Item = &Value> + ExactSizeIterator {
        self.properties.iter().map(|property| &property.1)
    }

    /// Kind and keys: two descriptions of one shape can be compared value by value.
    pub(crate) fn shape(&self) -> (&str, Vec<&str>) {
        (self.kind.as_str(), self.properties.iter().map(|property| property.0.as_str()).collect())
    }

    pub(crate) fn take_values(&mut self) -> Vec<Value> {
        std::mem::take(&mut self.properties).into_iter().map(|property| property.1).collect()
    }
}

/// How a pattern is compared with a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Match {
    /// `==`: descriptions have the same keys.
    Closed,
    /// `matches`: the value's descriptions may say more than the pattern's.
    Open,
}

/// The variables of `pattern` for which it is the same as `value`, or nothing.
///
/// Variables stand in the pattern only (`Imm::Var`); one that occurs twice must stand for equal
/// values. Nested descriptions match by the same `mode`.
#[must_use]
pub fn matches(mode: Match, pattern: &Value, value: &Value, limit: usize) -> Option<Map> {
    let mut bindings = Map::new();
    let mut todo = vec![(pattern.clone(), value.clone())];
    for _ in 0..limit {
        let Some((pattern, value)) = todo.pop() else { return Some(bindings) };
        if let Value::Imm(crate::value::Imm::Var(name)) = pattern {
            if name == "?_" {
                continue;
            }
            let key = Value::symbol(&name);
            match bindings.get(&key) {
                Some(bound) if equal(bound, &value, limit)? => {}
                Some(_) => return None,
                None => drop(bindings.insert(key, value)),
            }
        } else if let (Some(open), Some(other)) = (pattern.as_desc(), value.as_desc()) {
            if open.kind != other.kind
                || (mode == Match::Closed && open.properties.len() != other.properties.len())
            {
                return None;
            }
            for (key, part) in open.properties() {
                todo.push((part.clone(), other.get(key)?.clone()));
            }
        } else if let (Some((a0, a1)), Some((b0, b1))) = (pattern.as_pair(), value.as_pair()) {
            todo.push((a1.clone(), b1.clone()));
            todo.push((a0.clone(), b0.clone()));
        } else if let (Some(a), Some(b)) = (pattern.as_vector(), value.as_vector()) {
            if a.len() != b.len() {
                return None;
            }
            todo.extend(a.iter().cloned().zip(b.iter().cloned()));
        } else if !equal(&pattern, &value, limit)? {
            return None;
        }
    }
    None
}
