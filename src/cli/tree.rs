//! `pleach tree`: looks at the trees of a store.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value as Json, json};
use store::{Decision, Store, StoreError, VersionRow};
use vm::persist::SavedEdit;
use vm::show::safe;

use super::{Answer, FAILED, Trouble, html, keep, term};

pub const HELP: &str = "\
Examples:
  pleach tree runs.store                             all trees and their versions
  pleach tree runs.store kitchen                     the last version of a tree
  pleach tree runs.store kitchen --version 2         another one; also: kitchen@2, or the number of its run
  pleach tree runs.store kitchen --path 'fetching'   what is at paths that end so, and below
  pleach tree runs.store kitchen --path 'transporting :call 2 / fetching'
  pleach tree runs.store kitchen --at 12.5           as it was at 12.5 s of the task clock
  pleach tree runs.store --diff kitchen@1 kitchen@2
  pleach tree runs.store kitchen --dot | dot -Tsvg > kitchen.svg
  pleach tree runs.store kitchen --html > kitchen.html

With --at the tree is shown when all had happened that happened until that time, what happened just
then included. Tasks that had not begun are left out. Tasks that had not ended are `running`, also
those that waited, were suspended or deferred; they have parameters, but no value, failure or notes
yet. Of several attempts those are there that had begun. Edits hold from the beginning of a run. What
tasks waited for then, values of fluents and the world: pleach replay STORE RUN --to 12.5s

--html is one file without anything from elsewhere, to be opened in a browser: tasks are folded, a
search opens what it finds, colours are outcomes, bars say when a task ran.

Below the tree its edits are listed, each with who made it, and those that hold no more with the reason.
With --json stdout is one object: {versions: [{run, tree, version, base, file, plan, seed, outcome, value,
nodes, edits, steps, clock}]}, {tree: […], edits: [{edit, origin, orphan}],
decisions: [{what, decision, why, numbers}]} with the
tree as `pleach run --json` has it, or with --diff {differences:
[{path, kind, fields: {field: [first, second]}}]}, where kind is gone, new or changed.
Exit codes: 0 shown, or no difference · 1 there are differences · 2 it cannot be shown.";

/// Longer texts in a line are cut, in characters.
const LONGEST: usize = 60;
/// How many nodes are shown without --all.
const MOST_NODES: usize = 500;

/// `pleach tree`
#[derive(Args)]
pub struct Tree {
    /// The store
    store: PathBuf,
    /// A tree, NAME@VERSION, or the number of a run; without, all are listed
    name: Option<String>,
    /// The version of the tree; without, the last one
    #[arg(long, value_name = "N", requires = "name")]
    version: Option<i64>,
    /// Only what is at paths that end so: `fetching`, `transporting[*] / fetching`, `a :call 2 / b`
    #[arg(long, value_name = "PATTERN", requires = "name")]
    path: Option<String>,
    /// As it was then: seconds of the task clock
    #[arg(long, value_name = "TIME", requires = "name", value_parser = super::settings::time)]
    at: Option<u64>,
    /// What differs between two versions
    #[arg(long, num_args = 2, value_names = ["A", "B"], conflicts_with_all = ["name", "dot", "html"])]
    diff: Option<Vec<String>>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Print a graph for Graphviz
    #[arg(long, requires = "name", conflicts_with = "json")]
    dot: bool,
    /// Print a page for a browser
    #[arg(long, requires = "name", conflicts_with_all = ["json", "dot"])]
    html: bool,
    /// Show the whole tree, however large
    #[arg(long)]
    all: bool,
}

/// Shows.
pub fn run(it: &Tree) -> Answer {
    let store = Store::read(&it.store)?;
    if let Some(pair) = &it.diff {
        return diff(&store, pair, it.json);
    }
    let Some(name) = &it.name else { return list(&store, it.json) };
    let version = keep::version(&store, Some(name), it.version)?;
    let mut nodes = nodes_at(&store, &version, it.at)?;
    if let Some(pattern) = &it.path {
        nodes = below(nodes, pattern)?;
    }
    let edits = store.edits(&version)?;
    let decisions = store.decisions(&version)?;
    match it {
        Tree { json: true, .. } => {
            let mut json = json!({"tree": nodes});
            if !edits.is_empty() {
                json["edits"] = edits_json(&edits);
            }
            if !decisions.is_empty() {
                json["decisions"] = decisions.iter().map(decision_json).collect();
            }
            term::say(&format!("{json}\n"));
        }
        Tree { dot: true, .. } => term::say(&dot(&nodes)),
        Tree { html: true, .. } => {
            let (title, about) = (title(&version, it.at), about(&store, &version)?);
            term::say(&html::page(&title, &about, &nodes, &edit_lines(&edits)));
        }
        _ => {
            let most = if it.all { usize::MAX } else { MOST_NODES };
            term::say(&term::paint_tree(&text(&nodes, most), term::out_style()));
            let refused = decisions.iter().filter(|it| !it.why.is_empty());
            let refused = refused.map(|it| format!("{}: {}; {}", it.decision, it.why, it.what));
            let lines = edit_lines(&edits).into_iter().chain(refused);
            lines.for_each(|line| term::say(&format!("{}\n", safe(&line))));
        }
    }
    Ok(0)
}

/// The nodes of a stored version.
pub fn nodes(store: &Store, version: &VersionRow) -> Result<Vec<Json>, Trouble> {
    nodes_at(store, version, None)
}

/// The same as it was at a time, in nanoseconds of the task clock.
fn nodes_at(store: &Store, version: &VersionRow, at_ns: Option<u64>) -> Result<Vec<Json>, Trouble> {
    let wrong = |what| {
        let (path, tree) = (store.path.clone(), version.tree.clone());
        let version = version.version.to_string();
        Trouble::from(StoreError::Damaged { path, tree, version, batch: None, what })
    };
    let mut tree = store.tree(version)?;
    if let Some(at_ns) = at_ns {
        let last_ns = tree.last_ns();
        if at_ns > last_ns {
            let last = vm::show::seconds(last_ns);
            term::complain(&format!("note: the last task began or ended at {last} s\n"));
        }
        tree = tree.at(at_ns);
    }
    match tree.json().map_err(wrong)? {
        Json::Array(nodes) => Ok(nodes),
        _ => Ok(Vec::new()),
    }
}

/// A line for each edit, with who made it; those that hold no more have a reason.
fn edit_lines(edits: &[(SavedEdit, Option<String>)]) -> Vec<String> {
    let line = |(edit, orphan): &(SavedEdit, Option<String>)| match orphan {
        None => format!("edit {} by {}", edit.edit, edit.origin),
        Some(why) => format!("an edit holds no more: {} by {}: {why}", edit.edit, edit.origin),
    };
    edits.iter().map(line).collect()
}

fn edits_json(edits: &[(SavedEdit, Option<String>)]) -> Json {
    let json = |(it, orphan): &(SavedEdit, Option<String>)| json!({"edit": it.edit, "origin": it.origin, "orphan": orphan});
    edits.iter().map(json).collect()
}

fn decision_json(it: &Decision) -> Json {
    let numbers: Json = serde_json::from_str(&it.numbers).unwrap_or_default();
    json!({"what": it.what, "decision": it.decision, "why": it.why, "numbers": numbers})
}

fn title(version: &VersionRow, at_ns: Option<u64>) -> String {
    let at = at_ns.map_or_else(String::new, |at| format!(" at {} s", vm::show::seconds(at)));
    format!("{}@{}{at}", version.tree, version.version)
}

/// What is known of the run of a version, in a line.
fn about(store: &Store, version: &VersionRow) -> Result<String, Trouble> {
    Ok(match store.run(version) {
        Ok(run) => {
            let plan = run.plan.unwrap_or_default();
            format!("run {} of {} {plan}: {}, seed {}", version.id, run.file, run.outcome, run.seed)
        }
        Err(StoreError::Missing { .. }) => "saved by a program or imported".into(),
        Err(error) => return Err(error.into()),
    })
}

/// All versions.
fn list(store: &Store, as_json: bool) -> Answer {
    let mut rows = Vec::new();
    for version in store.versions()? {
        let run = match store.run(&version) {
            Ok(run) => Some(run),
            Err(StoreError::Missing { .. }) => None,
            Err(error) => return Err(error.into()),
        };
        rows.push(json!({
            "run": version.id, "tree": version.tree, "version": version.version, "base": version.base,
            "file": run.as_ref().map(|run| &run.file), "plan": run.as_ref().map(|run| &run.plan),
            "seed": run.as_ref().map(|run| &run.seed),
            "outcome": run.as_ref().map_or("saved", |run| &run.outcome),
            "value": run.as_ref().map(|run| &run.value), "nodes": version.records, "edits": version.edits,
            "steps": version.steps, "clock": run.as_ref().map(|run| run.clock_ns as f64 / 1e9),
        }));
    }
    if as_json {
        term::say(&format!("{}\n", json!({"versions": rows})));
        return Ok(0);
    }
    if rows.is_empty() {
        term::say("the store is empty\n");
        return Ok(0);
    }
    term::say(&format!(
        "{:>5}  {:<24} {:<12} {:>9} {:>6}  file\n",
        "run", "tree", "outcome", "nodes", "edits"
    ));
    for row in rows {
        let name = format!("{}@{}", safe(row["tree"].as_str().unwrap_or_default()), row["version"]);
        let word = |key: &str| safe(row[key].as_str().unwrap_or_default());
        let line = format!(
            "{:>5}  {name:<24} {:<12} {:>9} {:>6}  {} {}",
            row["run"].to_string(),
            word("outcome"),
            row["nodes"].to_string(),
            row["edits"].to_string(),
            word("file"),
            word("plan"),
        );
        term::say(&format!("{}\n", line.trim_end()));
    }
    Ok(0)
}

/// Nodes whose paths end so, with all below them.
fn below(nodes: Vec<Json>, pattern: &str) -> Result<Vec<Json>, Trouble> {
    let steps: Option<Vec<(String, Option<String>)>> = pattern.split('/').map(step).collect();
    let Some(steps) = steps else {
        let what = format!("`{}` is no pattern of paths", safe(pattern));
        return Err(Trouble::new(
            what,
            "for example: --path 'transporting :call 2 / fetching', --path 'fetching[*]'",
        ));
    };
    let ends = |path: &str| {
        let path: Option<Vec<_>> = path.split(" / ").map(step).collect();
        let Some(path) = path.filter(|path| path.len() >= steps.len()) else { return false };
        let ended = path[path.len() - steps.len()..].iter().zip(&steps);
        ended.into_iter().all(|((name, call), (wanted, rank))| {
            let call = call.as_deref().unwrap_or("1");
            name == wanted && rank.as_deref().is_none_or(|rank| rank == call)
        })
    };
    // A node is kept if it fits or its parent is kept; numbers of parents change with what is left out.
    let mut kept: Vec<Option<usize>> = vec![None; nodes.len()];
    let mut out = Vec::new();
    for (at, mut node) in nodes.into_iter().enumerate() {
        let parent = node["parent"].as_u64().and_then(|parent| *kept.get(parent as usize)?);
        if parent.is_none() && !node["path"].as_str().is_some_and(ends) {
            continue;
        }
        node["parent"] = json!(parent);
        kept[at] = Some(out.len());
        out.push(node);
    }
    match out.is_empty() {
        true => {
            Err(Trouble::from(format!("no task of the tree has a path that ends with `{}`", safe(pattern))))
        }
        false => Ok(out),
    }
}

/// A step of a path or a pattern: a name, and the number of the call where it is given.
fn step(text: &str) -> Option<(String, Option<String>)> {
    let text = text.trim();
    let (name, call) = match text.rsplit_once(" :call ") {
        Some((name, call)) => (name, Some(call.trim().to_string())),
        None => (text.strip_suffix("[*]").unwrap_or(text), None),
    };
    (!name.is_empty()).then(|| (name.trim().to_string(), call))
}

fn brief(text: &str) -> String {
    cut(text, LONGEST)
}

/// A text of so many characters at most.
pub fn cut(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((at, _)) => format!("{} …", &text[..at]),
        None => text.to_string(),
    }
}

/// What became of a node, in a few words.
fn outcome(node: &Json) -> String {
    let word = |key: &str| node[key].as_str().unwrap_or_default();
    let mut words = word("status").to_string();
    if !word("why").is_empty() {
        words += &format!(" ({})", word("why"));
    }
    match (word("status"), node["failure"]["type"].as_str()) {
        ("failed", Some(failure)) => words += &format!(": {failure}"),
        ("evaporated", Some(failure)) => words += &format!(", its clean-up failed: {failure}"),
        ("succeeded" | "skipped", _) if word("value") != "nil" => {
            words += &format!(" → {}", brief(word("value")));
        }
        _ => {}
    }
    words
}

fn line(node: &Json) -> String {
    let params = node["params"].as_object().into_iter().flatten();
    let params = params.filter_map(|(_, value)| value.as_str()).map(brief);
    let words: Vec<String> = node["name"].as_str().map(str::to_string).into_iter().chain(params).collect();
    let mut line = format!("{}  {}", words.join(" "), outcome(node));
    if let Some(attempt) = node["attempt"].as_u64().filter(|attempt| *attempt > 1) {
        line += &format!(", attempt {attempt}");
    }
    match (node["start"].as_f64(), node["end"].as_f64()) {
        (Some(start), Some(end)) if start != end => {
            line += &format!("  [{start} – {end} s, {} s]", took(start, end));
        }
        (Some(start), None) => line += &format!("  [since {start} s]"),
        _ => {}
    }
    for note in node["notes"].as_array().into_iter().flatten().filter_map(Json::as_str) {
        line += &format!("  ({note})");
    }
    safe(&line)
}

/// A whole tree, a line for each node.
pub fn outline(nodes: &Json) -> String {
    text(nodes.as_array().map_or(&[], Vec::as_slice), MOST_NODES)
}

/// How long, in seconds; without the errors that a difference of two numbers has.
fn took(start: f64, end: f64) -> f64 {
    ((end - start) * 1e9).round() / 1e9
}

/// A line for each node.
fn text(nodes: &[Json], most: usize) -> String {
    let parent = |node: &Json| node["parent"].as_u64().and_then(|at| usize::try_from(at).ok());
    // The last child of each node has nothing below it on its level.
    let mut last: Vec<Option<usize>> = vec![None; nodes.len()];
    for (at, node) in nodes.iter().enumerate() {
        if let Some(parent) = parent(node) {
            last[parent] = Some(at);
        }
    }
    const WIDEST: usize = 400;
    let mut indents: Vec<String> = Vec::with_capacity(nodes.len());
    let mut out = String::new();
    for (at, node) in nodes.iter().enumerate() {
        if at == most {
            out += &format!("… and more: {} nodes in all; --all shows them\n", nodes.len());
            break;
        }
        let (lead, below) = match parent(node) {
            None => (String::new(), String::new()),
            Some(above) => {
                let indent = &indents[above];
                let (branch, below) =
                    if last[above] == Some(at) { ("└─ ", "   ") } else { ("├─ ", "│  ") };
                let deeper = if indent.len() < WIDEST { format!("{indent}{below}") } else { indent.clone() };
                (format!("{indent}{branch}"), deeper)
            }
        };
        indents.push(below);
        out += &format!("{lead}{}\n", line(node));
    }
    out
}

/// The tree as a graph in the language of Graphviz.
fn dot(nodes: &[Json]) -> String {
    let quoted = |text: &str| safe(text).replace('\\', "\\\\").replace('"', "\\\"");
    let mut out =
        String::from("digraph tree {\n  node [shape=box, style=filled, fontname=\"sans-serif\"];\n");
    for (at, node) in nodes.iter().enumerate() {
        let colour = match node["status"].as_str() {
            Some("succeeded") => "#d5f0d5",
            Some("failed") => "#f5c8c8",
            Some("skipped" | "evaporated" | "deferred") => "#f5ecc0",
            _ => "#d0e4f5",
        };
        let name = quoted(node["name"].as_str().unwrap_or_default());
        out += &format!("  n{at} [label=\"{name}\\n{}\", fillcolor=\"{colour}\"];\n", quoted(&outcome(node)));
        if let Some(parent) = node["parent"].as_u64() {
            out += &format!("  n{parent} -> n{at};\n");
        }
    }
    out + "}\n"
}

fn diff(store: &Store, pair: &[String], as_json: bool) -> Answer {
    let [one, other] = pair else { return Ok(FAILED) };
    let of = |word: &str| -> Result<Json, Trouble> {
        Ok(Json::Array(nodes(store, &keep::version(store, Some(word), None)?)?))
    };
    let found = vm::persist::diff(&of(one)?, &of(other)?);
    if as_json {
        let differences = found.iter().map(|it| {
            let fields = it.fields.iter().map(|(field, a, b)| (field.clone(), json!([a, b])));
            json!({"path": it.path, "kind": it.kind.word(), "fields": Json::Object(fields.collect())})
        });
        term::say(&format!("{}\n", json!({"differences": differences.collect::<Json>()})));
    } else {
        for it in &found {
            let sign = match it.kind {
                vm::persist::DifferenceKind::Gone => "-",
                vm::persist::DifferenceKind::New => "+",
                vm::persist::DifferenceKind::Changed => "~",
            };
            let fields: Vec<String> = it
                .fields
                .iter()
                .map(|(field, a, b)| match (a.as_str(), b.as_str()) {
                    ("", b) => format!("{field} {}", brief(b)),
                    (a, "") => format!("{field} {}", brief(a)),
                    (a, b) => format!("{field} {} → {}", brief(a), brief(b)),
                })
                .collect();
            term::say(&format!("{sign} {}  {}\n", safe(&it.path), safe(&fields.join(", "))));
        }
    }
    Ok(if found.is_empty() { 0 } else { FAILED })
}
