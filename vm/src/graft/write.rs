//! A graft as text: the form `def-variant`.

use super::{AROUND, CALL, Graft, Link};

use crate::code::Program;
use crate::key::{Element, Step};
use crate::print::{LIMIT, Printer};
use crate::value::{Imm, Obj, Symbol, Value};

impl Graft {
    /// What there is to say of it where nobody has said more: whose edits they are.
    #[must_use]
    pub fn doc(&self) -> String {
        let mut makers: Vec<&str> = Vec::new();
        for by in self.edits.iter().filter_map(|change| change.edit.by.as_ref()) {
            if !makers.contains(&by.as_str()) {
                makers.push(by.as_str());
            }
        }
        let name = self.places[CALL].step.name;
        match makers.split_last() {
            None => format!("`{name}` with edits."),
            Some((one, [])) => format!("`{name}` with the edits of {one}."),
            Some((last, others)) => format!("`{name}` with the edits of {} and {last}.", others.join(", ")),
        }
    }

    /// `(def-variant name (:of plan) "doc" (places …) (between …) edits…)`. `read` makes values of the texts that keys
    /// have for elements of loops.
    #[must_use]
    pub fn text(&self, program: &Program, name: Symbol, doc: &str, read: &dyn Fn(&str) -> Value) -> String {
        let mut out =
            format!("(def-variant {} (:of {})\n", symbol(name), symbol(self.places[CALL].step.name));
        out += &crate::print::quoted(doc);
        let needed = self.places.len() > CALL + 1 || self.places[CALL].step.call != 1;
        if needed {
            out += "\n(places";
            self.write_places(program, read, &mut out);
            out += ")";
        }
        for (number, change) in (1..).zip(&self.edits) {
            for (place, steps) in &change.between {
                let path = Value::new(Obj::Path(Box::new(self.path(*place))));
                out += &format!("\n(between {number} {}", crate::print::write(&path));
                steps.iter().for_each(|step| write_step(step, read, &mut out));
                out += ")";
            }
        }
        for change in &self.edits {
            let edit = Value::new(Obj::Edit(Box::new((*change.edit).clone())));
            out += "\n";
            out += &Printer::new(Some(program), true, LIMIT).text(&edit);
        }
        out + ")"
    }

    fn write_places(&self, program: &Program, read: &dyn Fn(&str) -> Value, out: &mut String) {
        let mut below: Vec<Vec<usize>> = vec![Vec::new(); self.places.len()];
        for (at, place) in self.places.iter().enumerate().skip(CALL) {
            below[place.above].push(at);
        }
        enum Part {
            Open(usize),
            Close,
        }
        let mut todo: Vec<Part> = below[AROUND].iter().rev().map(|at| Part::Open(*at)).collect();
        while let Some(part) = todo.pop() {
            match part {
                Part::Close => out.push(')'),
                Part::Open(at) => {
                    *out += "\n(";
                    self.write_place(program, at, read, out);
                    todo.push(Part::Close);
                    todo.extend(below[at].iter().rev().map(|at| Part::Open(*at)));
                }
            }
        }
    }

    fn write_place(&self, program: &Program, at: usize, read: &dyn Fn(&str) -> Value, out: &mut String) {
        let place = &self.places[at];
        *out += &symbol(place.step.name);
        if place.step.call != 1 {
            *out += &format!(" :call {}", place.step.call);
        }
        let Some(site) = place.site else { return };
        // Mostly the call stands in the body of the plan above.
        let owner = if place.above == AROUND { None } else { Some(self.places[place.above].step.name) };
        if (site.owner, site.inner) != (owner, 0) && site.owner.is_some() {
            let name = symbol(site.owner.unwrap_or_default());
            match site.inner {
                0 => *out += &format!(" :in {name}"),
                inner => *out += &format!(" :in ({name} {inner})"),
            }
        } else if site.inner > 0 {
            *out += &format!(" :inner {}", site.inner);
        }
        if site.name != place.step.name {
            *out += &format!(" :site {}", symbol(site.name));
        }
        if site.nth > 1 {
            *out += &format!(" :nth {}", site.nth);
        }
        let named = place.known.is_some_and(|site| program.sites[site.at()].callee.is_none());
        let last = place.way.iter().rposition(|link| matches!(link, Link::Same(Step::Name(_))));
        for (number, link) in place.way.iter().enumerate() {
            match link {
                // What is called where the source does not say stands before.
                Link::Same(Step::Name(name)) if named && Some(number) == last && *name == place.step.name => {
                }
                Link::Same(step) => write_step(step, read, out),
                Link::Edit(number) => *out += &format!(" :edit {number}"),
                Link::Through(words, _) => {
                    let mut parts = vec![symbol(words.name)];
                    parts.push(words.nth.to_string());
                    parts.extend(words.owner.map(symbol));
                    if words.inner > 0 {
                        parts.push(words.inner.to_string());
                    }
                    *out += &format!(" :through ({})", parts.join(" "));
                }
            }
        }
    }
}

fn symbol(name: Symbol) -> String {
    crate::print::write(&Value::Imm(Imm::Symbol(name)))
}

fn write_step(step: &Step, read: &dyn Fn(&str) -> Value, out: &mut String) {
    let rank = match step {
        Step::Round(element, rank) => {
            *out += &match element {
                Element::Int(i) => format!(" :for {i}"),
                Element::Symbol(name) => format!(" :for {}", symbol(*name)),
                Element::Text(text) => {
                    format!(" :for {}", Printer::new(None, true, LIMIT).expression(&read(text)))
                }
            };
            *rank
        }
        Step::Number(number) => return *out += &format!(" :round {number}"),
        Step::Name(name) => return *out += &format!(" :named {}", symbol(*name)),
        Step::Again(times) => return *out += &format!(" :again {times}"),
        // These are links of their own.
        Step::Call(_) | Step::Edit(_) => return,
    };
    if rank > 0 {
        *out += &format!(" :rank {rank}");
    }
}
