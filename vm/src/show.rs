//! Trees for people and programs: text, JSON, lines of a trace.
//!
//! Names and values come from programs: control characters are escaped, so showing a tree is safe
//! on any terminal.

use rustc_hash::FxHashMap;
use serde_json::{Map as JsonMap, Value as Json, json};

use crate::code::{Params, Program};
use crate::path::Path;
use crate::print::Printer;
use crate::tree::{NodeKind, ROOT, RecId, SlotId, Status, Tree};
use crate::value::{Symbol, Value};

/// A value in one short line.
fn brief(program: &Program, value: &Value, most: usize) -> String {
    Printer::new(Some(program), true, most).text(value)
}

/// Text from elsewhere without control characters.
#[must_use]
pub fn safe(text: &str) -> String {
    text.chars().flat_map(|c| if c.is_control() { c.escape_default().collect() } else { vec![c] }).collect()
}

/// Text from elsewhere as text or attribute of HTML and XML, which can have control characters in no way.
#[must_use]
pub fn markup(text: &str) -> String {
    let mut markup = String::with_capacity(text.len());
    for letter in safe(text).chars() {
        match letter {
            '&' => markup.push_str("&amp;"),
            '<' => markup.push_str("&lt;"),
            '>' => markup.push_str("&gt;"),
            '"' => markup.push_str("&quot;"),
            '\'' => markup.push_str("&#39;"),
            '\u{FFFE}' | '\u{FFFF}' => markup.push('\u{FFFD}'),
            _ => markup.push(letter),
        }
    }
    markup
}

/// The parameter of a performed action, as the code of edits names it, too.
const DESCRIPTION: &str = "description";

/// Names and values of the parameters of a record; those not given are left out.
#[must_use]
pub fn params(program: &Program, tree: &Tree, rec: RecId) -> Vec<(Symbol, Value)> {
    named(program, tree, rec, tree.args(rec))
}

/// Visits what [`params`] gives, without a list in between.
pub(crate) fn each_named(program: &Program, tree: &Tree, rec: RecId, visit: &mut dyn FnMut(&str, &Value)) {
    let record = tree.record(rec);
    let names = match record.kind {
        NodeKind::Action => &[],
        _ => plan_params(program, tree, rec).map_or(&[][..], |params| &params.names),
    };
    for at in 0..record.args() {
        let Some(value) = tree.arg(rec, at).filter(|value| !value.is_unset()) else { continue };
        match names.get(usize::from(at)) {
            Some(name) => visit(name, value),
            None if record.kind == NodeKind::Action && at == 0 => visit(DESCRIPTION, value),
            None => visit(itoa::Buffer::new().format(at), value),
        }
    }
}

/// The arguments of a record as its call gives them: called with these, the plan gets them again.
#[must_use]
pub fn written(program: &Program, tree: &Tree, rec: RecId) -> Vec<Value> {
    let args = tree.written_args(rec);
    match plan_params(program, tree, rec) {
        Some(params) if tree.record(rec).kind == NodeKind::Plan => params.written(args),
        _ => args,
    }
}

/// The parameters as the call gives them, by their names, where edits have changed them.
#[must_use]
pub fn written_params(program: &Program, tree: &Tree, rec: RecId) -> Option<Vec<(Symbol, Value)>> {
    let args = tree.is_changed(rec).then(|| tree.written_args(rec))?;
    Some(named(program, tree, rec, args))
}

/// Arguments with the names of the parameters of a record; those not given are left out.
fn named(program: &Program, tree: &Tree, rec: RecId, args: Vec<Value>) -> Vec<(Symbol, Value)> {
    let names = match tree.record(rec).kind {
        NodeKind::Action => vec![Symbol::from(DESCRIPTION)],
        _ => plan_params(program, tree, rec).map_or_else(Vec::new, |params| params.names.clone()),
    };
    let named = args.into_iter().enumerate().map(|(i, value)| {
        let name = names.get(i).copied().unwrap_or_else(|| Symbol::from(&i.to_string()));
        (name, value)
    });
    named.filter(|(_, value)| !value.is_unset()).collect()
}

/// The arguments of a record from their names: the way back of [`params`].
pub(crate) fn args_of_names(
    program: &Program,
    tree: &Tree,
    rec: RecId,
    params: Vec<(Symbol, Value)>,
) -> Vec<Value> {
    let names = match tree.record(rec).kind {
        NodeKind::Action => vec![Symbol::from(DESCRIPTION)],
        _ => plan_params(program, tree, rec).map_or_else(Vec::new, |params| params.names.clone()),
    };
    let place = |name: &Symbol| names.iter().position(|known| known == name).or_else(|| name.parse().ok());
    let mut args: Vec<Value> = Vec::new();
    for (name, value) in params {
        let Some(at) = place(&name).filter(|at| *at < usize::from(u8::MAX)) else { continue };
        args.resize(args.len().max(at + 1), Value::UNSET);
        args[at] = value;
    }
    let known = names.len().min(usize::from(u8::MAX));
    args.resize(args.len().max(known), Value::UNSET);
    args
}

/// Visits what rules see of the parameters of a record, without a copy of them. True for the description of an
/// action: what rules see are its properties.
pub(crate) fn each_param(
    program: &Program,
    tree: &Tree,
    rec: RecId,
    visit: &mut dyn FnMut(Symbol, &Value),
) -> bool {
    let record = tree.record(rec);
    if record.kind == NodeKind::Action
        && let Some(desc) = tree.arg(rec, 0)
        && desc.as_desc().is_some()
    {
        // Its name says nothing; this one need not be looked up.
        visit(tree.slot(record.slot).name, desc);
        return true;
    }
    if record.kind == NodeKind::Action || record.args() == 0 {
        let named = params(program, tree, rec);
        named.iter().for_each(|(name, value)| visit(*name, value));
        return false;
    }
    let names = plan_params(program, tree, rec).map_or(&[][..], |params| &params.names);
    for at in 0..record.args() {
        let Some(value) = tree.arg(rec, at).filter(|value| !value.is_unset()) else { continue };
        match names.get(usize::from(at)) {
            Some(name) if crate::code::is_pattern(name) => {}
            Some(name) => visit(*name, value),
            None => visit(Symbol::from(&at.to_string()), value),
        }
    }
    false
}

fn plan_params<'p>(program: &'p Program, tree: &Tree, rec: RecId) -> Option<&'p Params> {
    let slot = tree.record(rec).slot;
    let site = program.sites.get(tree.slot(slot).key.site.at());
    let callee = site.and_then(|site| site.callee).or_else(|| tree.called(slot));
    callee.and_then(|callee| program.functions.get(callee.at())).map(|function| &function.params)
}

/// Seconds with as many digits as they need, at most nine.
#[must_use]
pub fn seconds(ns: u64) -> String {
    let text = format!("{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000);
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

/// What became of a task, in a few words.
fn outcome(program: &Program, tree: &Tree, rec: RecId) -> String {
    let record = tree.record(rec);
    let mut words = record.status.word().to_string();
    if !record.why.word().is_empty() {
        words += &format!(" ({})", record.why.word());
    }
    match record.status {
        Status::Succeeded | Status::Skipped if !record.value.is_nil() => {
            words += &format!(" → {}", brief(program, &record.value, 60));
        }
        Status::Failed => {
            if let Some(failure) = record.value.as_failure() {
                words += &format!(": {}", failure.name);
            }
        }
        Status::Evaporated => {
            if let Some(failure) = record.value.as_failure() {
                words += &format!(", its clean-up failed: {}", failure.name);
            }
        }
        _ => {}
    }
    words
}

/// One line of text for a node.
fn line(program: &Program, tree: &Tree, slot: SlotId, rec: RecId) -> String {
    let record = tree.record(rec);
    let mut line = tree.slot(slot).name.to_string();
    let shown: Vec<String> = match record.kind {
        NodeKind::Action => tree.args(rec).first().and_then(Value::as_desc).map_or_else(Vec::new, |desc| {
            let others = desc.properties().filter(|(key, _)| *key != "type");
            others.map(|(key, value)| format!("({key} {})", brief(program, value, 40))).collect()
        }),
        _ => params(program, tree, rec).iter().map(|(_, value)| brief(program, value, 40)).collect(),
    };
    if !shown.is_empty() {
        line += &format!(" {}", shown.join(" "));
    }
    line += &format!("  {}", outcome(program, tree, rec));
    if record.attempt > 1 {
        line += &format!(", attempt {}", record.attempt);
    }
    if !record.status.is_final() {
        if record.start > 0 && record.status != Status::Deferred {
            line += &format!("  [since {} s]", seconds(record.start));
        }
    } else if record.start != record.end {
        line += &format!("  [{} – {} s]", seconds(record.start), seconds(record.end));
    }
    if record.flags & crate::tree::MOVED != 0 {
        line += "  (its goal is checked later)";
    }
    if let Some(extra) = tree.extra(rec) {
        if let Some(slot) = extra.performed_in {
            line += &format!("  (deferred, performed in {})", tree.slot(slot).name);
        }
        for note in &extra.notes {
            line += &format!("  ({note})");
        }
    }
    safe(&line)
}

/// Characters that a timeline gives to the whole run.
const TIMELINE: u64 = 40;

/// Which task ran when, a line per node in the order of their starts: a bar on the task clock up to
/// `now`, start and end in seconds, path, outcome.
#[must_use]
pub fn timeline(program: &Program, tree: &Tree, now: u64, most: usize) -> String {
    let mut rows: Vec<(u64, usize, usize, SlotId, RecId)> = Vec::new();
    let mut todo = vec![(ROOT, 0)];
    while let Some((slot, depth)) = todo.pop() {
        let Some(rec) = tree.shown(slot) else { continue };
        rows.push((tree.record(rec).start, rows.len(), depth, slot, rec));
        todo.extend(tree.children(slot).into_iter().rev().map(|child| (child, depth + 1)));
    }
    rows.sort();
    let whole = now.max(1);
    let column = |ns: u64| (u128::from(ns) * u128::from(TIMELINE) / u128::from(whole)) as usize;
    let mut out = String::new();
    for (start, _, depth, slot, rec) in rows.iter().take(most) {
        let record = tree.record(*rec);
        let end = if record.status.is_final() { record.end } else { now };
        let (from, to) = (column(*start), column(end));
        let bar = if to > from { "━".repeat(to - from) } else { "·".to_string() };
        let bar = format!("{}{bar}", " ".repeat(from));
        let name = tree.slot(*slot).name;
        let words = outcome(program, tree, *rec);
        let line = format!(
            "{:>9} {:>9}  {bar:<width$}  {:indent$}{name}  {words}",
            seconds(*start),
            seconds(end),
            "",
            width = TIMELINE as usize + 1,
            indent = 2 * depth.min(&20),
        );
        out += &format!("{}\n", safe(line.trim_end()));
    }
    if rows.len() > most {
        out += &format!("… and more: {} nodes in all\n", rows.len());
    }
    out
}

/// The tree as text, a line per node, at most `most` nodes.
#[must_use]
pub fn text(program: &Program, tree: &Tree, most: usize) -> String {
    let mut out = String::new();
    let mut todo = vec![(ROOT, String::new(), String::new())];
    let mut shown = 0;
    while let Some((slot, lead, indent)) = todo.pop() {
        let Some(rec) = tree.shown(slot) else { continue };
        if shown == most {
            out += &format!("… and more: {} nodes in all\n", tree.len());
            break;
        }
        shown += 1;
        out += &format!("{lead}{}\n", line(program, tree, slot, rec));
        let children = tree.children(slot);
        for (i, child) in children.iter().enumerate().rev() {
            let (branch, below) =
                if i + 1 == children.len() { ("└─ ", "   ") } else { ("├─ ", "│  ") };
            let below =
                if indent.len() < WIDEST_INDENT { format!("{indent}{below}") } else { indent.clone() };
            todo.push((*child, format!("{indent}{branch}"), below));
        }
    }
    out
}

/// Longer paths are left out of JSON, in bytes.
pub(crate) const LONGEST_PATH: usize = 4000;
/// Deeper nodes are not indented further, in bytes.
const WIDEST_INDENT: usize = 400;

/// The tree as JSON: an array of nodes, each with the number of its parent in the array, and its
/// path unless it is very long.
#[must_use]
pub fn json(program: &Program, tree: &Tree) -> Json {
    let attempts = attempts(tree);
    let mut nodes = Vec::new();
    let mut todo = vec![(ROOT, None, String::from("top-level"))];
    while let Some((slot, parent, path)) = todo.pop() {
        let Some(rec) = tree.shown(slot) else { continue };
        let number = nodes.len();
        let mut node = node_json(program, tree, slot, rec, parent, &path);
        if let Some(all) = attempts.get(&slot) {
            node["attempts"] = all.iter().map(|rec| attempt_json(program, tree, *rec)).collect();
        }
        nodes.push(node);
        let children = tree.children(slot);
        let mut ranks: std::collections::BTreeMap<&str, usize> = std::collections::BTreeMap::new();
        let mut below = Vec::new();
        for child in children {
            let name = tree.slot(child).name;
            let rank = ranks.entry(name.as_str()).or_insert(0);
            *rank += 1;
            let call = if *rank == 1 { String::new() } else { format!(" :call {rank}") };
            let longer = match path.is_empty() || path.len() > LONGEST_PATH {
                true => String::new(),
                false => format!("{path} / {name}{call}"),
            };
            below.push((child, Some(number), longer));
        }
        todo.extend(below.into_iter().rev());
    }
    Json::Array(nodes)
}

/// The records of each slot that was run more than once, in the order of their calls.
fn attempts(tree: &Tree) -> FxHashMap<SlotId, Vec<RecId>> {
    let again = tree.records().filter(|rec| tree.record(*rec).attempt > 1);
    let mut attempts: FxHashMap<SlotId, Vec<RecId>> =
        again.map(|rec| (tree.record(rec).slot, Vec::new())).collect();
    if !attempts.is_empty() {
        for rec in tree.records() {
            if let Some(all) = attempts.get_mut(&tree.record(rec).slot) {
                all.push(rec);
            }
        }
    }
    attempts
}

/// What became of one run of a slot.
fn attempt_json(program: &Program, tree: &Tree, rec: RecId) -> Json {
    let record = tree.record(rec);
    let mut json = json!({"status": record.status.word()});
    let (key, result) = result_json(program, tree, rec);
    json[key] = result;
    json["start"] = json!(record.start as f64 / 1e9);
    json["end"] = json!(record.end as f64 / 1e9);
    json
}

/// Under which key a record has what became of it, and that.
fn result_json(program: &Program, tree: &Tree, rec: RecId) -> (&'static str, Json) {
    let record = tree.record(rec);
    match record.value.as_failure() {
        // That of an evaporated task is the failure of its clean-up.
        Some(_) if matches!(record.status, Status::Failed | Status::Evaporated) => {
            crate::failure::name_tasks(tree, &record.value);
            ("failure", failure_json(program, &record.value, 0))
        }
        _ => ("value", written_json(program, &record.value)),
    }
}

fn written_json(program: &Program, value: &Value) -> Json {
    Json::String(Printer::new(Some(program), true, crate::print::LIMIT).text(value))
}

fn node_json(
    program: &Program,
    tree: &Tree,
    slot: SlotId,
    rec: RecId,
    parent: Option<usize>,
    path: &str,
) -> Json {
    let record = tree.record(rec);
    let write = |value: &Value| written_json(program, value);
    let by_name = |params: Vec<(Symbol, Value)>| -> JsonMap<String, Json> {
        params.iter().map(|(name, value)| (name.to_string(), write(value))).collect()
    };
    let mut node = JsonMap::new();
    node.insert("name".into(), json!(tree.slot(slot).name.as_str()));
    // The path of a node a million calls deep would be longer than all that is worth saying.
    node.insert("path".into(), if path.is_empty() { Json::Null } else { json!(path) });
    node.insert("parent".into(), json!(parent));
    node.insert("kind".into(), json!(record.kind.word()));
    node.insert("status".into(), json!(record.status.word()));
    node.insert("attempt".into(), json!(record.attempt));
    node.insert("params".into(), Json::Object(by_name(params(program, tree, rec))));
    let (key, result) = result_json(program, tree, rec);
    node.insert(key.into(), result);
    if !record.why.word().is_empty() {
        node.insert("why".into(), json!(record.why.word()));
    }
    if record.flags & crate::tree::MOVED != 0 {
        node.insert("goal".into(), json!("moved"));
    }
    node.insert("start".into(), json!(record.start as f64 / 1e9));
    let end = record.status.is_final().then_some(record.end as f64 / 1e9);
    node.insert("end".into(), json!(end));
    let extra = tree.extra(rec);
    if let Some(grounded) = extra.and_then(|it| it.grounded.as_ref()) {
        node.insert("grounded".into(), write(grounded));
    }
    if tree.is_changed(rec) {
        let written = written(program, tree, rec);
        node.insert("written".into(), Json::Array(written.iter().map(write).collect()));
    }
    if let Some(params) = written_params(program, tree, rec) {
        node.insert("written-params".into(), Json::Object(by_name(params)));
    }
    if let Some(slot) = extra.and_then(|it| it.performed_in) {
        node.insert("performed-in".into(), json!(Path::of(tree, slot).show()));
    }
    if let Some(extra) = extra.filter(|it| !it.notes.is_empty()) {
        node.insert("notes".into(), json!(extra.notes));
    }
    for (key, ids) in [("edits", tree.edits_of(slot)), ("pending", tree.pending_edits_of(slot))] {
        let edits = ids.iter().map(|id| &tree.edits[*id as usize - 1].edit);
        let edits: Vec<Json> = edits
            .map(|edit| write(&Value::new(crate::value::Obj::Edit(Box::new((**edit).clone())))))
            .collect();
        if !edits.is_empty() {
            node.insert(key.into(), Json::Array(edits));
        }
    }
    Json::Object(node)
}

/// A failure as JSON, with its causes and what failed beside it.
#[must_use]
pub fn failure_json(program: &Program, failure: &Value, depth: usize) -> Json {
    const DEPTH: usize = 20;
    let Some(it) = failure.as_failure().filter(|_| depth < DEPTH) else { return Json::Null };
    let write = |value: &Value| Json::String(brief(program, value, 10_000));
    let fields: JsonMap<String, Json> =
        it.fields.iter().map(|(key, value)| (key.to_string(), write(value))).collect();
    let mut json = json!({"type": it.name.as_str(), "fields": fields});
    if let Some(path) = it.path() {
        json["task"] = json!(path);
    }
    if let Some(cause) = &it.cause {
        json["cause"] = failure_json(program, cause, depth + 1);
    }
    if !it.also.is_empty() {
        json["also"] = it.also.iter().map(|also| failure_json(program, also, depth + 1)).collect();
    }
    json
}

/// A line for the start of a record.
#[must_use]
pub fn trace_start(program: &Program, tree: &Tree, rec: RecId) -> String {
    let record = tree.record(rec);
    let args: Vec<String> =
        params(program, tree, rec).iter().map(|(_, value)| brief(program, value, 60)).collect();
    let path = Path::of(tree, record.slot).show();
    safe(&format!("{:>9} start {path} {}", seconds(record.start), args.join(" "))).trim_end().to_string()
}

/// A line for the end of a record.
#[must_use]
pub fn trace_end(program: &Program, tree: &Tree, rec: RecId) -> String {
    let record = tree.record(rec);
    let path = Path::of(tree, record.slot).show();
    safe(&format!("{:>9} end   {path} {}", seconds(record.end), outcome(program, tree, rec)))
}
