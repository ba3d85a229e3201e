//! Descriptions of scenes and robots, as the language writes them, read entry by entry.
//!
//! An entry is a list `(a surface (name sink_area) (size 1.2 0.5))`: a kind, then properties with their
//! values; a value may be an entry again. Readers ask an [`Entry`] for the properties that they know;
//! [`Entry::done`] complains about those that nobody asked for, so that no typing error is passed over.
//! Whatever is wrong is said with the way to the entry, what is wrong there, and what to write.

use std::cell::RefCell;
use std::collections::BTreeSet;

use nalgebra::Vector3;
use thiserror::Error;
use vm::value::Value;

use crate::robot::error::nearest;

/// A mistake in a description.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{entry}: {problem}")]
pub struct Mistake {
    /// The way to the entry: "the furniture `fridge`, its door".
    pub entry: String,
    /// What is wrong there.
    pub problem: String,
    /// What to write.
    pub help: Option<String>,
}

impl Mistake {
    /// A mistake with what to write.
    #[must_use]
    pub fn new(entry: &str, problem: impl Into<String>, help: impl Into<String>) -> Mistake {
        Mistake { entry: entry.into(), problem: problem.into(), help: Some(help.into()) }
    }

    /// Problem and help in one text.
    #[must_use]
    pub fn text(&self) -> String {
        self.help.as_ref().map_or_else(|| self.to_string(), |help| format!("{self}; {help}"))
    }
}

/// A kind with its properties.
pub struct Entry {
    /// How messages call it.
    pub path: String,
    /// `wall`, `surface`, …; `grasp` and `box` have no article.
    pub kind: String,
    /// Keys with what follows them.
    properties: Vec<(String, Vec<Value>)>,
    asked: RefCell<BTreeSet<String>>,
}

/// Numbers beyond this are no lengths in a room, in metres.
const FAR_M: f64 = 1000.0;

impl Entry {
    /// Reads a list with a head. `inside` is what it stands in, `number` its place there from 1.
    ///
    /// # Errors
    /// If it is no list of properties.
    pub fn of(value: &Value, inside: &str, number: usize) -> Result<Entry, Mistake> {
        let place = format!("{inside}, entry {number}");
        let shape = || {
            Mistake::new(
                &place,
                format!("expected an entry, got {}", vm::print::brief(value)),
                "an entry is written (a surface (name worktop) (size 1 0.6))",
            )
        };
        // Where the data was not quoted, an entry about objects is a description already.
        let items = match value.as_desc() {
            Some(desc) => {
                let parts = desc.properties().map(|(key, value)| {
                    let rest = if value.is_list() && !value.is_nil() {
                        value.clone()
                    } else {
                        Value::list([value.clone()])
                    };
                    Value::cons(Value::symbol(&key), rest)
                });
                let mut items = vec![Value::symbol(&desc.kind)];
                items.extend(parts);
                items
            }
            None => value.to_vec().ok_or_else(shape)?,
        };
        let article = |value: &Value| value.as_symbol().is_some_and(|it| it == "a" || it == "an");
        let items = if items.first().is_some_and(article) { &items[1..] } else { &items[..] };
        let kind = items.first().and_then(Value::as_symbol).ok_or_else(shape)?.to_string();
        let mut properties: Vec<(String, Vec<Value>)> = Vec::new();
        for item in &items[1..] {
            let parts = item.to_vec().unwrap_or_default();
            let Some(key) = parts.first().and_then(Value::as_symbol) else {
                let problem = format!("expected a property, got {}", vm::print::brief(item));
                return Err(Mistake::new(
                    &format!("{place}, {kind}"),
                    problem,
                    "a property is written (name value…)",
                ));
            };
            // `(a surface …)` inside of an entry goes by its kind.
            match key == "a" || key == "an" {
                true => {
                    let inner = parts.get(1).and_then(Value::as_symbol).ok_or_else(shape)?;
                    properties.push((inner.to_string(), parts[2..].to_vec()));
                }
                false => properties.push((key.to_string(), parts[1..].to_vec())),
            }
        }
        let mut entry = Entry { path: String::new(), kind, properties, asked: RefCell::default() };
        entry.path = match entry.peek_name() {
            Some(name) => format!("{inside}, {} `{name}`", entry.kind),
            None => format!("{inside}, entry {number} ({})", entry.kind),
        };
        Ok(entry)
    }

    fn peek_name(&self) -> Option<String> {
        let (_, values) = self.properties.iter().find(|(key, _)| key == "name")?;
        values.first()?.as_symbol().map(|name| name.to_string())
    }

    /// A mistake in this entry.
    pub fn wrong(&self, problem: impl Into<String>, help: impl Into<String>) -> Mistake {
        Mistake::new(&self.path, problem, help)
    }

    /// The mistake that a property is not there; perhaps it is, misspelled.
    #[must_use]
    pub fn missing(&self, key: &str, help: impl Into<String>) -> Mistake {
        let asked = self.asked.borrow();
        let others =
            self.properties.iter().map(|(name, _)| name.as_str()).filter(|name| !asked.contains(*name));
        match nearest(key, others.collect::<Vec<_>>().into_iter()) {
            Some(meant) => {
                self.wrong(format!("has no `{key}`"), format!("probably `{meant}` is it; {}", help.into()))
            }
            None => self.wrong(format!("has no `{key}`"), help),
        }
    }

    /// What follows a key; `None` if it is not there.
    ///
    /// # Errors
    /// If it stands there twice.
    pub fn get(&self, key: &str) -> Result<Option<&[Value]>, Mistake> {
        self.asked.borrow_mut().insert(key.into());
        let mut found = self.properties.iter().filter(|(name, _)| name == key);
        let first = found.next();
        match found.next() {
            Some(_) => Err(self.wrong(format!("has `{key}` twice"), "leave one of them out")),
            None => Ok(first.map(|(_, values)| values.as_slice())),
        }
    }

    /// All entries in this one that have the kind `key`.
    ///
    /// # Errors
    /// If one of them has another shape.
    pub fn entries(&self, key: &str) -> Result<Vec<Entry>, Mistake> {
        self.asked.borrow_mut().insert(key.into());
        let found = self.properties.iter().filter(|(name, _)| name == key);
        let entry = |(number, (name, values)): (usize, &(String, Vec<Value>))| {
            Entry::of(
                &Value::list_onto([Value::symbol(name)], Value::list(values.clone())),
                &self.path,
                number + 1,
            )
        };
        found.enumerate().map(entry).collect()
    }

    /// A name.
    ///
    /// # Errors
    /// If it is no symbol.
    pub fn name(&self, key: &str) -> Result<Option<String>, Mistake> {
        match self.get(key)? {
            None => Ok(None),
            Some([value]) if value.as_symbol().is_some() => Ok(value.as_symbol().map(|it| it.to_string())),
            Some(_) => Err(self.wrong(format!("`{key}` is no name"), format!("write ({key} sink_area)"))),
        }
    }

    /// A name that must be there.
    ///
    /// # Errors
    /// If it is not, or no symbol.
    pub fn needed_name(&self, key: &str) -> Result<String, Mistake> {
        self.name(key)?.ok_or_else(|| self.missing(key, format!("write ({key} some_name)")))
    }

    /// All words of a property that is a list of names.
    ///
    /// # Errors
    /// If one of them is no symbol.
    pub fn names(&self, key: &str) -> Result<Vec<String>, Mistake> {
        let words = self.get(key)?.unwrap_or_default().iter().map(|value| {
            value.as_symbol().map(|it| it.to_string()).ok_or_else(|| {
                self.wrong(format!("`{key}` has something that is no name"), format!("write ({key} one two)"))
            })
        });
        words.collect()
    }

    /// Finite numbers, `least` to `most` of them.
    ///
    /// # Errors
    /// If there are more or fewer, or something that is no number.
    pub fn numbers(&self, key: &str, least: usize, most: usize) -> Result<Option<Vec<f64>>, Mistake> {
        let Some(values) = self.get(key)? else { return Ok(None) };
        let count = if least == most { format!("{least}") } else { format!("{least} to {most}") };
        let example =
            ["1", "0.5", "0.2", "0.1"].repeat(most.div_ceil(4).min(4))[..least.clamp(1, 16)].join(" ");
        let help = format!("write ({key} {example})");
        if !(least..=most).contains(&values.len()) {
            return Err(self.wrong(format!("`{key}` takes {count} numbers, got {}", values.len()), help));
        }
        let number = |value: &Value| {
            value.as_number().filter(|it| it.is_finite() && it.abs() <= FAR_M).ok_or_else(|| {
                let shown = vm::print::brief(value);
                self.wrong(format!("{shown} in `{key}` is no number from -{FAR_M} to {FAR_M}"), help.clone())
            })
        };
        values.iter().map(number).collect::<Result<_, _>>().map(Some)
    }

    /// One number; `otherwise` if it is not there.
    ///
    /// # Errors
    /// If it is no number.
    pub fn number(&self, key: &str, otherwise: f64) -> Result<f64, Mistake> {
        Ok(self.numbers(key, 1, 1)?.map_or(otherwise, |it| it[0]))
    }

    /// A number above 0; one must be there if there is no `otherwise`.
    ///
    /// # Errors
    /// If it is none, or not above 0.
    pub fn positive(&self, key: &str, otherwise: Option<f64>) -> Result<f64, Mistake> {
        let given = self.numbers(key, 1, 1)?.map(|it| it[0]).or(otherwise);
        let number = given.ok_or_else(|| self.missing(key, format!("write ({key} 0.5)")))?;
        match number > 0.0 {
            true => Ok(number),
            false => Err(self.wrong(format!("`{key}` is not above 0"), format!("write ({key} 0.5)"))),
        }
    }

    /// Three numbers.
    ///
    /// # Errors
    /// If they are not three.
    pub fn vector(&self, key: &str) -> Result<Option<Vector3<f64>>, Mistake> {
        Ok(self.numbers(key, 3, 3)?.map(|it| Vector3::new(it[0], it[1], it[2])))
    }

    /// Two or three lengths above 0.
    ///
    /// # Errors
    /// If they are not there, or not above 0.
    pub fn size(&self, key: &str, count: usize) -> Result<Vec<f64>, Mistake> {
        let example = ["0.6", "0.4", "0.2"][..count.min(3)].join(" ");
        let help = format!("write ({key} {example}), in metres");
        let given = self.numbers(key, count, count)?;
        let size = given.ok_or_else(|| self.missing(key, help.clone()))?;
        match size.iter().all(|edge| *edge > 0.0) {
            true => Ok(size),
            false => Err(self.wrong(format!("an edge in `{key}` is not above 0"), help)),
        }
    }

    /// Complains about the first property that nobody asked for.
    ///
    /// # Errors
    /// With the property that was probably meant.
    pub fn done(&self) -> Result<(), Mistake> {
        let asked = self.asked.borrow();
        let Some((key, _)) = self.properties.iter().find(|(key, _)| !asked.contains(key)) else {
            return Ok(());
        };
        let known = asked.iter().map(String::as_str);
        let help = match nearest(key, known.clone()) {
            Some(meant) => format!("probably `{meant}` is meant"),
            None => format!("there are: {}", known.collect::<Vec<_>>().join(", ")),
        };
        Err(self.wrong(format!("a {} has no property `{key}`", self.kind), help))
    }
}
