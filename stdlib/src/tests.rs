//! The two files of each topic agree. The plan files are read as text here, not by the parser, for
//! this crate stands below it: a definition begins at the start of a line.

use std::collections::BTreeMap;

use crate::{MODULES, PLANS, natives};

/// A top-level definition of a plan file.
struct Definition<'a> {
    form: &'a str,
    name: &'a str,
    /// What follows the name, up to the next definition.
    rest: &'a str,
}

fn definitions(text: &str) -> Vec<Definition<'_>> {
    let starts: Vec<_> = text.match_indices("\n(def-").map(|(at, _)| at + 1).collect();
    let ends = starts.iter().skip(1).copied().chain([text.len()]);
    starts.iter().zip(ends).map(|(start, end)| Definition::of(&text[*start + 1..end])).collect()
}

impl<'a> Definition<'a> {
    fn of(text: &'a str) -> Definition<'a> {
        let (form, rest) = text.split_once(' ').expect("a definition has a name");
        let end = rest.find(char::is_whitespace).expect("and more than a name");
        Definition { form, name: &rest[..end], rest: &rest[end..] }
    }

    /// Fewest and most arguments, as its parameters say.
    fn arity(&self) -> (u8, Option<u8>) {
        let params = self.rest.trim_start().trim_start_matches('(');
        let (params, _) = params.split_once(')').expect("parameters end");
        let mut words = params.split_whitespace();
        let required =
            words.by_ref().take_while(|word| *word != "&optional" && *word != "&rest").count() as u8;
        let optional = words.take_while(|word| *word != "&rest").count() as u8;
        (required, (!params.contains("&rest")).then_some(required + optional))
    }
}

#[test]
fn plans_declare_the_natives_that_exist() {
    let mut missing: BTreeMap<_, _> = natives().iter().map(|native| (native.name, native.arity)).collect();
    assert_eq!(missing.len(), natives().len(), "a name stands twice in the tables");
    for (module, text) in MODULES.iter().chain(PLANS) {
        for definition in definitions(text).iter().filter(|definition| definition.form == "def-native") {
            let arity = missing.remove(definition.name);
            assert_eq!(arity, Some(definition.arity()), "{} in {module}.plan", definition.name);
        }
    }
    assert!(missing.is_empty(), "not declared: {missing:?}");
}

#[test]
fn every_public_name_has_an_example() {
    for (module, text) in MODULES {
        assert!(
            text.starts_with(&format!("(module {module}\n  \"")),
            "{module}.plan begins with its name and what it is"
        );
        for definition in definitions(text).iter().filter(|definition| !definition.name.starts_with('%')) {
            let example = definition.rest.contains("\n   ex: ") || definition.rest.contains("\n   ex! ");
            assert!(example, "{} in {module}.plan", definition.name);
        }
    }
}

#[test]
fn no_name_is_defined_twice() {
    let mut seen = BTreeMap::new();
    for (module, text) in MODULES {
        for definition in definitions(text).iter().filter(|definition| !definition.name.starts_with('%')) {
            // Predicates have names of their own.
            let of_rules = matches!(definition.form, "def-rules" | "def-native-rule" | "def-open");
            let other = seen.insert((of_rules, definition.name.to_string()), module);
            assert_eq!(other, None, "{} in {module}.plan", definition.name);
        }
    }
}
