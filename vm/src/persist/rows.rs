//! From a tree to rows.

use serde_json::{Map as JsonMap, Value as Json, json};

use super::{SavedEdit, SavedRecord, SavedSlot, SavedTree};
use crate::code::{Program, SiteId};
use crate::key::{Chain, Element, Step};
use crate::print::{LIMIT, Printer};
use crate::show;
use crate::tree::{CHANGED, MOVED, NodeKind, RecId, Record, SlotId, Status, Tree};
use crate::value::{Obj, Value};

/// The row of a slot.
#[must_use]
pub fn slot(program: &Program, tree: &Tree, id: SlotId) -> SavedSlot {
    let it = tree.slot(id);
    SavedSlot {
        slot: id.0,
        parent: it.parent.0,
        name: it.name,
        site: program.sites.get(it.key.site.at()).map_or(0, |site| site.hash),
        steps: made(|out| steps_onto(out, program, tree, it.key.chain)),
        place: tree.place(id),
    }
}

/// The row of a record.
#[must_use]
pub fn record(program: &Program, tree: &Tree, id: RecId) -> SavedRecord {
    let it = tree.record(id);
    let is_final = it.status.is_final();
    let failed = has_failed(it);
    SavedRecord {
        record: id.0,
        slot: it.slot.0,
        parent: it.parent.0,
        attempt: it.attempt,
        kind: it.kind.word().into(),
        status: it.status.word().into(),
        why: it.why.word().into(),
        start_ns: it.start,
        end_ns: is_final.then_some(it.end),
        params: made(|out| params_onto(out, program, tree, id)),
        value: (is_final && !failed).then(|| text(program, &it.value)),
        failure: failed.then(|| failure(program, it)),
        more: more(program, tree, id, it),
    }
}

fn made(put: impl FnOnce(&mut String)) -> String {
    let mut out = String::new();
    put(&mut out);
    out
}

/// True if what a record has as its value is the failure that left it.
pub(super) fn has_failed(it: &Record) -> bool {
    matches!(it.status, Status::Failed | Status::Evaporated) && it.value.as_failure().is_some()
}

/// The failure that left a record, as a JSON object.
pub(super) fn failure(program: &Program, it: &Record) -> String {
    show::failure_json(program, &it.value, 0).to_string()
}

/// The parameters of a record as a JSON object of texts; nothing if it has none.
pub(super) fn params_onto(out: &mut String, program: &Program, tree: &Tree, id: RecId) {
    if tree.record(id).args() == 0 {
        return;
    }
    let mut lead = '{';
    show::each_named(program, tree, id, &mut |name, value| {
        out.push(lead);
        lead = ',';
        put_text(out, name);
        out.push(':');
        put_value(out, program, value);
    });
    out.push_str(if lead == '{' { "{}" } else { "}" });
}

/// A text as JSON.
pub(super) fn put_text(out: &mut String, text: &str) {
    out.push('"');
    out.push_str(text);
    quote_from(out, out.len() - text.len());
}

/// The text of a value as JSON.
pub(super) fn put_value(out: &mut String, program: &Program, value: &Value) {
    out.push('"');
    let from = out.len();
    Printer::new(Some(program), true, LIMIT).text_onto(out, value);
    quote_from(out, from);
}

/// Makes the end of `out` the rest of a text in JSON.
fn quote_from(out: &mut String, from: usize) {
    if out.as_bytes()[from..].iter().any(|byte| matches!(byte, b'"' | b'\\' | 0..0x20)) {
        let text = out.split_off(from);
        out.pop();
        *out += &Json::String(text).to_string();
    } else {
        out.push('"');
    }
}

/// A number as JSON.
pub(super) fn put_number(out: &mut String, number: impl itoa::Integer) {
    out.push_str(itoa::Buffer::new().format(number));
}

fn text(program: &Program, value: &Value) -> String {
    match value.is_nil() {
        true => "nil".into(),
        false => Printer::new(Some(program), true, LIMIT).text(value),
    }
}

/// What few records have, as a JSON object.
pub(super) fn more(program: &Program, tree: &Tree, id: RecId, it: &Record) -> Option<String> {
    let called = tree.called(it.slot).filter(|_| it.kind == NodeKind::Plan);
    let extra = tree.extra(id);
    if called.is_none() && extra.is_none() && it.flags & (MOVED | CHANGED) == 0 {
        return None;
    }
    let mut more = JsonMap::new();
    let write = |value: &Value| Json::String(text(program, value));
    if let Some(plan) = called {
        more.insert("called".into(), json!(program.functions.get(plan.at())?.name.as_str()));
    }
    if it.flags & MOVED != 0 {
        more.insert("goal".into(), json!("moved"));
    }
    if let Some(grounded) = extra.and_then(|it| it.grounded.as_ref()) {
        more.insert("grounded".into(), write(grounded));
    }
    if it.flags & CHANGED != 0 {
        more.insert("written".into(), show::written(program, tree, id).iter().map(write).collect());
        let params = show::written_params(program, tree, id).unwrap_or_default();
        let params = params.iter().map(|(name, value)| (name.to_string(), write(value)));
        more.insert("written-params".into(), Json::Object(params.collect()));
    }
    if let Some(slot) = extra.and_then(|it| it.performed_in) {
        more.insert("performed-in".into(), json!(slot.0));
    }
    if let Some(extra) = extra.filter(|it| !it.notes.is_empty()) {
        more.insert("notes".into(), json!(extra.notes));
    }
    (!more.is_empty()).then(|| Json::Object(more).to_string())
}

/// The rows of all edits.
#[must_use]
pub fn edits(program: &Program, tree: &Tree) -> Vec<SavedEdit> {
    let mut saved = Vec::new();
    if tree.edits.is_empty() {
        return saved;
    }
    for slot in tree.slots() {
        for number in tree.edits_of(slot) {
            let it = &tree.edits[*number as usize - 1];
            let after = it.after.iter().map(|after| {
                let between = it.between.get(after).map(|steps| steps_json(program, steps));
                json!([after.0, between])
            });
            saved.push(SavedEdit {
                number: *number,
                slot: slot.0,
                edit: text(program, &Value::new(Obj::Edit(Box::new((*it.edit).clone())))),
                callee: it.callee.to_string(),
                after: if it.after.is_empty() { String::new() } else { after.collect::<Json>().to_string() },
                origin: it.origin.to_string(),
            });
        }
    }
    saved.sort_by_key(|edit| edit.number);
    saved
}

/// All rows of a tree.
#[must_use]
pub fn tree(program: &Program, tree: &Tree) -> SavedTree {
    for id in tree.records() {
        crate::failure::name_tasks(tree, &tree.record(id).value);
    }
    SavedTree {
        slots: tree.slots().map(|id| slot(program, tree, id)).collect(),
        records: tree.records().map(|id| record(program, tree, id)).collect(),
        edits: edits(program, tree),
    }
}

/// The steps of a chain as JSON; nothing if there are none.
pub(super) fn steps_onto(out: &mut String, program: &Program, tree: &Tree, chain: Chain) {
    if chain == Chain::EMPTY {
        return;
    }
    match tree.keys.steps(chain)[..] {
        // By far the most frequent.
        [Step::Round(Element::Int(element), rank)] => {
            out.push_str("[[\"int\",");
            put_number(out, element);
            out.push(',');
            put_number(out, rank);
            out.push_str("]]");
        }
        ref steps => *out += &steps_json(program, steps).to_string(),
    }
}

fn steps_json(program: &Program, steps: &[Step]) -> Json {
    let site = |site: &SiteId| program.sites.get(site.at()).map_or(0, |site| site.hash);
    let step = |step: &Step| match step {
        Step::Round(Element::Int(element), rank) => json!(["int", element, rank]),
        Step::Round(Element::Symbol(element), rank) => json!(["symbol", element.as_str(), rank]),
        Step::Round(Element::Text(element), rank) => json!(["text", &***element, rank]),
        Step::Number(number) => json!(["number", number]),
        Step::Call(id) => json!(["call", format!("{:016x}", site(id))]),
        Step::Name(name) => json!(["name", name.as_str()]),
        Step::Again(times) => json!(["again", times]),
        Step::Edit(number) => json!(["edit", number]),
    };
    steps.iter().map(step).collect()
}
