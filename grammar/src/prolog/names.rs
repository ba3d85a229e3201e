//! What names of Prolog are called here.
//!
//! A name without quotes is spelled as Prolog people spell names, so it gets our spelling:
//! `transport_task` becomes `transport-task`. A name in quotes is kept to the letter: who quotes it
//! means a name that comes from elsewhere, such as a type or frame of the world (`'CounterTop'`,
//! `'sink_area'`), and these do not change with the language of the rules.
//!
//! So two names could become one or one name two, and rules would silently not match. Both are found.

use std::collections::{HashMap, HashSet};

use super::error::PrologError;
use super::term::Name;
use crate::form::Symbol;
use crate::span::Span;
use crate::token::{Report, show};

/// The names of a text so far.
#[derive(Default)]
pub(super) struct Names {
    /// From the letters of a Prolog name to ours.
    ours: HashMap<Symbol, (Symbol, Span)>,
    /// And back.
    theirs: HashMap<Symbol, (Symbol, Span)>,
    /// Names about which something was said.
    told: HashSet<Symbol>,
}

impl Names {
    /// Our symbol for a name.
    pub(super) fn of(&mut self, name: &Name, report: &mut Report) -> Symbol {
        let ours = match name.text.as_str() {
            // Prolog's empty list is a name.
            "[]" => "nil".into(),
            text if name.quoted || !text.contains('_') => name.text,
            text => text.replace('_', "-").as_str().into(),
        };
        let reserved = match ours.as_str() {
            "." => Some("a list of one is written `[X]`, a pair `[X|Y]`"),
            text if text.starts_with('?') => Some("it would be a variable here; give it another name"),
            _ => None,
        };
        if let Some(help) = reserved {
            if self.told.insert(name.text) {
                let what = format!("the name `{}`", show(&name.text));
                report.push(PrologError::NotTaken { what, at: name.span, help }.into());
            }
            return "nil".into();
        }
        self.compare(name, ours, report);
        ours
    }

    fn compare(&mut self, name: &Name, ours: Symbol, report: &mut Report) {
        let (known, first) = *self.ours.entry(name.text).or_insert((ours, name.span));
        if known != ours && self.told.insert(name.text) {
            let text = show(&name.text);
            let why = format!("`{text}` and `'{text}'` are one name in Prolog and two here");
            let help = "write both with quotes to keep the `_`, or both without to get `-` for it";
            report.push(PrologError::TwoNames { why, at: name.span, first, help }.into());
        }
        let (known, first) = *self.theirs.entry(ours).or_insert((name.text, name.span));
        if known != name.text && self.told.insert(name.text) {
            let (known, text) = (show(&known), show(&name.text));
            let why = format!("`{known}` and `{text}` are two names in Prolog and both `{ours}` here");
            let help = "give one of the two another name";
            report.push(PrologError::TwoNames { why, at: name.span, first, help }.into());
        }
    }
}

/// The variables of a clause.
#[derive(Default)]
pub(super) struct Variables {
    ours: HashMap<Symbol, Symbol>,
    taken: HashSet<Symbol>,
}

impl Variables {
    pub(super) fn clear(&mut self) {
        self.ours.clear();
        self.taken.clear();
    }

    /// A variable that nothing else in the clause means.
    pub(super) fn new_one(&mut self) -> Symbol {
        let number = (1..).find(|n| !self.taken.contains(&format!("?_{n}").as_str().into()));
        let name: Symbol = format!("?_{}", number.unwrap_or(0)).as_str().into();
        self.taken.insert(name);
        name
    }

    /// `?first-task` for `First_task`. An underscore at the start stays: who writes it says that the
    /// variable is there for nothing else than to have a name.
    pub(super) fn of(&mut self, text: Symbol) -> Symbol {
        if text == "_" {
            return "?_".into();
        }
        if let Some(known) = self.ours.get(&text) {
            return *known;
        }
        let (mark, rest) = text.strip_prefix('_').map_or(("", text.as_str()), |rest| ("_", rest));
        let plain = format!("?{mark}{}", rest.to_lowercase().replace('_', "-"));
        // `First_task` and `First_Task` are two variables.
        let mut ours: Symbol = plain.as_str().into();
        let mut number = 2;
        while !self.taken.insert(ours) {
            ours = format!("{plain}-{number}").as_str().into();
            number += 1;
        }
        self.ours.insert(text, ours);
        ours
    }
}
