//! `pleach store export` and `import`: versions with their runs, logs and programs as one JSON file.
//!
//! ```text
//! {"pleach-trees": 2,
//!  "programs": {HASH: [{file, hash, text}]},
//!  "versions": [{id, tree, own, version, base, steps, rows, orphans: [[edit, why]], log,
//!                run: {file, plan, program, seed, schedule, robot, head, outcome, value, clock}}]}
//! ```
//! The file may come from anywhere, so all of it is read and judged before the first version is written; what
//! does not fit is an error that says where it stands, as in `versions[3].run.seed`.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Map, Value as Json, json};
use store::{Import, RunRow, Source, Store, StoreError, VersionRow, Writer};
use vm::log::Entry;
use vm::persist::{SavedEdit, SavedTree};
use vm::show::safe;

use super::{Answer, FAILED, Trouble, count, journal, term};

/// The version of the format.
const EXPORT: u64 = 2;
/// Who has made an edit of which the file does not say it.
const FROM_ELSEWHERE: &str = "import";

/// Writes all versions that are whole.
pub fn export(store: &Store, file: &Path) -> Answer {
    let (mut versions, mut programs) = (Vec::new(), Map::new());
    let mut left_out = 0;
    for finding in store.check()? {
        let version = &finding.version;
        if let Some(trouble) = finding.trouble {
            left_out += 1;
            term::complain(&format!("left out: {trouble}\n"));
            continue;
        }
        let run = run_of(store, version)?;
        if let Some(run) = run.as_ref().filter(|run| !programs.contains_key(&run.program)) {
            let source = |it: &Source| json!({"file": it.file, "hash": it.hash, "text": it.text});
            let sources = store.program(version, &run.program)?;
            programs.insert(run.program.clone(), sources.iter().map(source).collect());
        }
        versions.push(version_json(store, version, run.as_ref())?);
    }
    let exported = json!({"pleach-trees": EXPORT, "programs": programs, "versions": versions});
    let made = std::fs::File::create_new(file)
        .and_then(|mut file| std::io::Write::write_all(&mut file, format!("{exported}\n").as_bytes()));
    made.map_err(|error| match error.kind() {
        std::io::ErrorKind::AlreadyExists => Trouble::new(
            format!("{} is there already, and is not overwritten", file.display()),
            "choose another name",
        ),
        _ => Trouble::from(pleach::files::cannot_write(file, &error)),
    })?;
    term::complain(&format!("{} in {}\n", count(versions.len(), "version"), file.display()));
    Ok(if left_out > 0 { FAILED } else { 0 })
}

/// The run that made a version, if one did.
fn run_of(store: &Store, version: &VersionRow) -> Result<Option<RunRow>, Trouble> {
    match store.run(version) {
        Ok(run) => Ok(Some(run)),
        Err(StoreError::Missing { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Edits that hold no more, each with the reason.
fn orphans(store: &Store, version: &VersionRow) -> Result<Vec<(SavedEdit, String)>, Trouble> {
    let edits = store.edits(version)?.into_iter();
    Ok(edits.filter_map(|(edit, why)| Some((edit, why?))).collect())
}

fn version_json(store: &Store, version: &VersionRow, run: Option<&RunRow>) -> Result<Json, Trouble> {
    let run = run.map(|it| {
        json!({
            "file": it.file, "plan": it.plan, "program": it.program, "seed": it.seed, "schedule": it.schedule,
            "robot": it.robot, "head": it.head, "outcome": it.outcome, "value": it.value, "clock": it.clock_ns,
        })
    });
    let orphans = orphans(store, version)?;
    let orphans: Json = orphans.iter().map(|(edit, why)| json!([edit.row(), why])).collect();
    let log: Json = store.log(version)?.entries.iter().map(Entry::to_json).collect();
    Ok(json!({
        "id": version.id, "tree": version.tree, "own": version.tree == store::own_name(version.id),
        "version": version.version, "base": version.base, "steps": version.steps,
        "rows": store.tree(version)?.rows(), "orphans": orphans, "log": log, "run": run,
    }))
}

/// Takes all versions of a file into a store.
pub fn import(path: &Path, file: &Path) -> Answer {
    let text = std::fs::read_to_string(file).map_err(|error| {
        Trouble::from(format!("cannot read {}: {}", file.display(), pleach::files::why(&error)))
    })?;
    let wrong = |why: String| {
        let what = format!("{} holds no exported trees: {why}", file.display());
        Trouble::new(what, "write some with: pleach store export STORE FILE")
    };
    let json = serde_json::from_str(&text).map_err(|error| wrong(format!("it is no JSON: {error}")))?;
    // All are read before the first is written.
    let versions = read(&json).map_err(wrong)?;
    drop(json);
    let mut numbers = BTreeMap::new();
    let mut incomplete = false;
    for (id, base, mut it) in versions {
        it.base = base.and_then(|base| numbers.get(&base).copied());
        if base.is_some() && it.base.is_none() && it.run.is_some() {
            incomplete = true;
            let name = name(&it);
            term::complain(&format!("{name}: without its run, for what that went on with is not there\n"));
            (it.run, it.log, it.steps) = (None, vm::log::Log::default(), 0);
        }
        let store = Store::write(path)?;
        let number = match same(&store, &it)? {
            Some(there) => {
                term::say(&format!("{}: is there already\n", named(&there.tree, there.version)));
                there.id
            }
            None => {
                let writer = Writer::import(store, &it)?;
                let (old, new) = (name(&it), named(&writer.tree, writer.version));
                let other = it.tree.is_some() && old != new;
                term::say(&if other { format!("{old}: as {new}\n") } else { format!("{new}\n") });
                writer.id
            }
        };
        numbers.insert(id, number);
    }
    Ok(if incomplete { FAILED } else { 0 })
}

fn named(tree: &str, version: i64) -> String {
    format!("{}@{version}", safe(tree))
}

fn name(it: &Import) -> String {
    named(it.tree.as_deref().unwrap_or("a run without a name"), it.version)
}

/// The version of a store that has the same tree, run and log.
fn same(store: &Store, it: &Import) -> Result<Option<VersionRow>, Trouble> {
    for version in store.versions()? {
        let own = version.tree == store::own_name(version.id);
        let alike = it.tree.as_ref().map_or(own, |tree| *tree == version.tree)
            && version.slots == it.saved.slots.len() as i64
            && version.records == it.saved.records.len() as i64
            && version.edits == it.saved.edits.len() as i64
            && version.entries == it.log.entries.len() as i64;
        // A version that is damaged here is taken once more.
        let same = || -> Result<bool, Trouble> {
            Ok(run_of(store, &version)? == it.run
                && store.log(&version)?.entries == it.log.entries
                && store.tree(&version)?.rows() == it.saved.rows())
        };
        if alike && same().unwrap_or(false) {
            return Ok(Some(version));
        }
    }
    Ok(None)
}

// ---------------------------------------------------------------------------------------------
// Reading

/// Versions with their numbers in the file, and those of what they go on with.
type Versions = Vec<(i64, Option<i64>, Import)>;

fn read(json: &Json) -> Result<Versions, String> {
    match json["pleach-trees"].as_u64() {
        Some(EXPORT) => {}
        Some(other) => {
            return Err(format!(
                "it is of version {other} of the format, and this pleach reads version {EXPORT}"
            ));
        }
        None => return Err("it has no `pleach-trees`".into()),
    }
    let programs = json["programs"].as_object().ok_or("programs is no object")?;
    let programs = programs.iter().map(|(hash, sources)| {
        let sources = sources.as_array().into_iter().flatten().enumerate();
        let source = |(at, json): (usize, &Json)| {
            let it = Node { json, at: format!("programs.{hash}[{at}]") };
            Ok(Source { file: it.text("file")?, hash: it.text("hash")?, text: it.maybe_text("text")? })
        };
        Ok((hash.as_str(), sources.map(source).collect::<Result<Vec<_>, String>>()?))
    });
    let programs: BTreeMap<&str, Vec<Source>> = programs.collect::<Result<_, String>>()?;
    let versions = json["versions"].as_array().ok_or("versions is no list")?;
    let versions = versions.iter().enumerate();
    versions.map(|(at, json)| version(Node { json, at: format!("versions[{at}]") }, &programs)).collect()
}

fn version(
    it: Node<'_>,
    programs: &BTreeMap<&str, Vec<Source>>,
) -> Result<(i64, Option<i64>, Import), String> {
    let tree = it.text("tree")?;
    let own = it.json["own"].as_bool().unwrap_or(false);
    if !own && !vm::persist::is_tree_name(&tree) {
        return Err(format!("{}.tree is no name of a tree: it is a number or has an `@` in it", it.at));
    }
    let mut saved = SavedTree::from_rows(&it.json["rows"]).map_err(|why| format!("{}.rows: {why}", it.at))?;
    saved.json().map_err(|why| format!("{}.rows: {why}", it.at))?;
    for edit in saved.edits.iter_mut().filter(|edit| edit.origin.is_empty()) {
        edit.origin = FROM_ELSEWHERE.into();
    }
    let run = it.json.get("run").filter(|run| !run.is_null());
    let run = run.map(|json| run_row(&Node { json, at: format!("{}.run", it.at) })).transpose()?;
    let sources = run.as_ref().and_then(|run| programs.get(run.program.as_str()));
    if let Some(run) = &run {
        let at = format!("{}.run.program", it.at);
        let sources =
            sources.ok_or_else(|| format!("{at} is {}, which is not in programs", safe(&run.program)))?;
        let head = serde_json::from_str(&run.head).unwrap_or_default();
        if !journal::is_program(&head, &run.program, sources) {
            return Err(format!("{at}: the texts in programs are not those that the run had"));
        }
    }
    let mut log = vm::log::Log::default();
    for (number, line) in it.list("log")?.iter().enumerate() {
        let entry = Entry::from_json(line);
        log.entries.push(entry.ok_or_else(|| format!("{}.log[{number}] is no entry of a log", it.at))?);
    }
    let orphan = |(number, pair): (usize, &Json)| {
        let edit = pair.get(0).and_then(SavedEdit::from_row).zip(pair.get(1).and_then(Json::as_str));
        let (edit, why) = edit.ok_or_else(|| format!("{}.orphans[{number}] is no edit", it.at))?;
        Ok((edit, why.to_string()))
    };
    let orphans: Result<Vec<_>, String> = it.list("orphans")?.iter().enumerate().map(orphan).collect();
    let base = it.json.get("base").filter(|base| !base.is_null());
    let base = base.map(|_| it.number("base")).transpose()?;
    let import = Import {
        tree: Some(tree).filter(|_| !own),
        version: if own { 1 } else { it.number("version")?.clamp(1, i64::from(u32::MAX)) },
        base: None,
        saved,
        orphans: orphans?,
        sources: sources.cloned().unwrap_or_default(),
        run,
        log,
        steps: it.number("steps")? as u64,
    };
    Ok((it.number("id")?, base, import))
}

fn run_row(it: &Node<'_>) -> Result<RunRow, String> {
    let key = |name: &str| {
        let text = it.text(name)?;
        text.parse::<u64>().map_err(|_| format!("{}.{name} is no number", it.at))?;
        Ok::<_, String>(text)
    };
    let head = it.text("head")?;
    if !serde_json::from_str::<Json>(&head).is_ok_and(|head| head.is_object()) {
        return Err(format!("{}.head is no JSON object", it.at));
    }
    Ok(RunRow {
        file: it.text("file")?,
        plan: it.maybe_text("plan")?,
        program: it.text("program")?,
        seed: key("seed")?,
        schedule: key("schedule")?,
        robot: it.text("robot")?,
        head,
        outcome: it.text("outcome")?,
        value: it.maybe_text("value")?,
        clock_ns: it.number("clock")?,
    })
}

/// A part of the file, and where it stands.
struct Node<'j> {
    json: &'j Json,
    at: String,
}

impl Node<'_> {
    fn text(&self, key: &str) -> Result<String, String> {
        self.maybe_text(key)?.ok_or_else(|| format!("{}.{key} is not there", self.at))
    }
    fn maybe_text(&self, key: &str) -> Result<Option<String>, String> {
        match self.json.get(key) {
            None | Some(Json::Null) => Ok(None),
            Some(Json::String(text)) => Ok(Some(text.clone())),
            Some(_) => Err(format!("{}.{key} is no text", self.at)),
        }
    }
    fn number(&self, key: &str) -> Result<i64, String> {
        let number = self.json.get(key).and_then(Json::as_i64).filter(|number| *number >= 0);
        number.ok_or_else(|| format!("{}.{key} is no number", self.at))
    }
    fn list(&self, key: &str) -> Result<&Vec<Json>, String> {
        self.json.get(key).and_then(Json::as_array).ok_or_else(|| format!("{}.{key} is no list", self.at))
    }
}
