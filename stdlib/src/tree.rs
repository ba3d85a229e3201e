//! Task trees as values: running a plan as a root, looking at what ran, changing places of it.

use std::rc::Rc;

use vm::edit::{Edit, What};
use vm::failure::{Builtin, Failure};
use vm::graft::{self, Graft};
use vm::host::Request;
use vm::machine::Ctx;
use vm::native::{Next, Raise, range_error, type_error};
use vm::path::{Path, PathStep};
use vm::tree::{ROOT, RecId, SlotId, Status, Tree};
use vm::value::{Imm, Map, Obj, Symbol, Value};

use crate::table::natives;

natives! {
    "run-plan" [1 ..] in ctx => run_plan;
    "project" [1 ..] in ctx => project;
    "edit-tree" [2 ..] in ctx => edit_tree;
    "call-with-edits" [2 ..] in ctx => call_with_edits;
    "%call-variant" [1] in ctx => call_variant;
    "variant-text" [2 3] in ctx => variant_text;
    "without-edits" [1] => |args: &[Value]| Ok(Value::new(Obj::Tree(Rc::new(tree(&args[0])?.without_edits()))));
    "tree-world?" [1] => |args: &[Value]| Ok(Value::bool(tree(&args[0])?.world.is_some()));
    "edit-path" [1] => |args: &[Value]| Ok(Value::new(Obj::Path(Box::new(an_edit(&args[0])?.at.clone()))));
    "edit-kind" [1] => |args: &[Value]| Ok(Value::symbol(an_edit(&args[0])?.word()));
    "edit-by" [1] => |args: &[Value]| Ok(an_edit(&args[0])?.by.map_or(Value::NIL, |by| Value::Imm(Imm::Symbol(by))));
    "edit-made-by" [2] => made_by;
    "edit-out-of" [2] => out_of;
    "tree?" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_tree().is_some()));
    "path?" [1] => |args: &[Value]| Ok(Value::bool(args[0].as_path().is_some()));
    "make-path" [1] => make_path;
    "path->list" [1] => path_list;
    "path->string" [1] => |args: &[Value]| Ok(Value::str(path(&args[0])?.show()));
    "tree-paths" [1] => tree_paths;
    "tree-status" [1 2] => |args: &[Value]| Ok(Value::symbol(record(args)?.status.word()));
    "tree-value" [1 2] => tree_value;
    "tree-failure" [1 2] => tree_failure;
    "tree-attempts" [1 2] => |args: &[Value]| Ok(Value::int(i64::from(record(args)?.attempt)));
    "tree-why" [1 2] => tree_why;
    "tree-start" [1 2] => |args: &[Value]| Ok(seconds(record(args)?.start));
    "tree-end" [1 2] => |args: &[Value]| Ok(seconds(record(args)?.end));
    "tree-failures" [1] => |args: &[Value]| Ok(Value::int(tree(&args[0])?.failures() as i64));
    "tree-params" [1 2] in ctx => tree_params;
    "tree-written" [1 2] in ctx => tree_written;
    "tree-notes" [1 2] => tree_notes;
    "tree-text" [1] in ctx => tree_text;
    "tree-edits" [1] => tree_edits;
    "load-tree" [2 ..] in ctx Read => load_tree;
    "save-tree" [3] in ctx Write => save_tree;
    "versions" [2] in ctx Read => versions;
    "diff-trees" [2] in ctx => diff_trees;
    "skip" [1 ..] => skip;
    "replace" [2 ..] => |args: &[Value]| with_code(args, What::Replace);
    "before" [2 ..] => |args: &[Value]| with_code(args, What::Before);
    "after" [2 ..] => |args: &[Value]| with_code(args, What::After);
    "wrap" [2 ..] => |args: &[Value]| with_code(args, What::Wrap);
    "with-param" [3 ..] => with_param;
    "defer" [3 ..] => defer;
    "owe" [2 ..] => owe;
}

fn tree(value: &Value) -> Result<&Rc<Tree>, Raise> {
    value.as_tree().ok_or_else(|| type_error("a tree", value))
}

fn path(value: &Value) -> Result<&Path, Raise> {
    value.as_path().ok_or_else(|| type_error("a path", value))
}

/// Keywords and values after the arguments that have a place, each keyword one of `known`.
fn keywords<'a>(args: &'a [Value], known: &[&str]) -> Result<Vec<(Symbol, &'a Value)>, Raise> {
    let mut pairs = Vec::new();
    for pair in args.chunks(2) {
        let key = pair[0].as_keyword().filter(|key| known.is_empty() || known.contains(&key.as_str()));
        match (key, pair.get(1)) {
            (Some(key), Some(value)) => pairs.push((key, value)),
            (Some(_), None) => return Err(range_error("a keyword without a value", &pair[0])),
            (None, _) => {
                let names: Vec<String> = known.iter().map(|name| format!(":{name}")).collect();
                return Err(range_error(format!("expected one of {}", names.join(" ")), &pair[0]));
            }
        }
    }
    Ok(pairs)
}

fn find<'a>(pairs: &[(Symbol, &'a Value)], key: &str) -> Option<&'a Value> {
    pairs.iter().find(|(name, _)| *name == key).map(|(_, value)| *value)
}

// ---------------------------------------------------------------------------------------------
// Running

fn run_plan(_: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    run(args, false)
}

fn project(_: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    run(args, true)
}

fn run(args: &[Value], projected: bool) -> Result<Next, Raise> {
    let pairs = keywords(&args[1..], &["args", "tree", "seed"])?;
    let given = find(&pairs, "args").map_or(Ok(Vec::new()), vm::native::list)?;
    let tree = find(&pairs, "tree").filter(|tree| !tree.is_nil()).cloned();
    let seed = match find(&pairs, "seed").filter(|seed| !seed.is_nil()) {
        None => None,
        Some(seed) => Some(seed.as_int().ok_or_else(|| type_error("an integer", seed))? as u64),
    };
    Ok(Next::RunPlan { plan: args[0].clone(), args: given, tree, seed, projected })
}

fn edit_tree(_: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let origin = find(&keywords(&args[2..], &["origin"])?, "origin").map(text_or_symbol).transpose()?;
    let origin = origin.unwrap_or_default();
    Ok(Next::EditTree { tree: args[0].clone(), edits: args[1].clone(), origin })
}

/// `(call-with-edits tree plan argument …)`: in this run. Without a tree it is an ordinary call.
fn call_with_edits(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let plan = args[1].clone();
    let name = plan_name(ctx, &plan)?;
    let graft = match args[0].is_nil() {
        true => Graft::empty(name),
        false => Graft::of_tree(ctx.program, tree(&args[0])?).map_err(|why| range_error(why, &args[0]))?,
    };
    let of = graft.places[graft::CALL].step.name;
    if of != name {
        return Err(range_error(format!("the tree is one of `{of}`, not of `{name}`"), &args[0]));
    }
    Ok(Next::WithEdits { plan, args: Some(args[2..].to_vec()), graft: Rc::new(graft) })
}

fn plan_name(ctx: &Ctx<'_>, plan: &Value) -> Result<Symbol, Raise> {
    match plan {
        Value::Imm(Imm::Function(function)) => {
            Ok(ctx.program.functions.get(function.at()).map(|it| it.name).unwrap_or_default())
        }
        _ => Err(type_error("a plan", plan)),
    }
}

/// What the compiler makes of `def-variant`: a plan, places, rounds between places, edits.
fn call_variant(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let parts = vm::native::list(&args[0])?;
    let [plan, places, between, edits] = parts.as_slice() else {
        return Err(type_error("a variant", &args[0]));
    };
    let name = plan_name(ctx, plan)?;
    let graft = Graft::read(name, places, between, edits)
        .map_err(|why| Box::new(Failure::new(Builtin::ProgramError, why)))?;
    Ok(Next::WithEdits { plan: plan.clone(), args: None, graft: Rc::new(graft) })
}

/// `(variant-text tree name doc)`
fn variant_text(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let graft = Graft::of_tree(ctx.program, tree(&args[0])?).map_err(|why| range_error(why, &args[0]))?;
    let name = args[1].as_symbol().ok_or_else(|| type_error("a symbol", &args[1]))?;
    let doc = match args.get(2).filter(|doc| !doc.is_nil()) {
        Some(doc) => vm::native::str(doc)?.to_string(),
        None => graft.doc(),
    };
    let text = graft.text(ctx.program, name, &doc, &*ctx.reader());
    Ok(Value::str(ctx.lay_out(text)).into())
}

// ---------------------------------------------------------------------------------------------
// In a store

/// A symbol or a text, as a text.
fn text_or_symbol(value: &Value) -> Result<String, Raise> {
    match value.as_symbol() {
        Some(name) => Ok(name.to_string()),
        None => Ok(vm::native::str(value)?.to_string()),
    }
}

/// The host answers with the rows of the tree.
fn load_tree(_: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let pairs = keywords(&args[2..], &["version"])?;
    let version = match find(&pairs, "version").filter(|version| !version.is_nil()) {
        None => None,
        Some(version) => Some(version.as_int().ok_or_else(|| type_error("a number of a version", version))?),
    };
    let store = vm::native::str(&args[0])?.into();
    Ok(Next::Ask(Request::LoadTree { store, tree: text_or_symbol(&args[1])?, version }))
}

/// The host answers with the number of the version.
fn save_tree(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let (store, name) = (vm::native::str(&args[0])?.into(), text_or_symbol(&args[1])?);
    if !vm::persist::is_tree_name(&name) {
        return Err(range_error("a tree has a name that is no number and has no `@` in it", &args[1]));
    }
    let saved = vm::persist::tree(ctx.program, tree(&args[2])?);
    Ok(Next::Ask(Request::SaveTree { store, tree: name, rows: Rc::new(saved) }))
}

/// The host answers with a list of numbers.
fn versions(_: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let store = vm::native::str(&args[0])?.into();
    Ok(Next::Ask(Request::Versions { store, tree: text_or_symbol(&args[1])? }))
}

fn diff_trees(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let nodes = |value: &Value| Ok::<_, Raise>(vm::show::json(ctx.program, tree(value)?));
    let found = vm::persist::diff(&nodes(&args[0])?, &nodes(&args[1])?);
    let difference = |it: vm::persist::Difference| {
        let fields = it.fields.iter().map(|(field, one, other)| {
            Value::list(vec![Value::symbol(field), Value::str(one.as_str()), Value::str(other.as_str())])
        });
        let head = [Value::str(it.path.as_str()), Value::symbol(it.kind.word())];
        Value::list(head.into_iter().chain(fields).collect::<Vec<_>>())
    };
    Ok(Value::list(found.into_iter().map(difference).collect::<Vec<_>>()).into())
}

// ---------------------------------------------------------------------------------------------
// Looking

/// The slot at a path; without one, the plan that the tree is of.
fn slot(args: &[Value]) -> Result<(&Rc<Tree>, SlotId), Raise> {
    let tree = tree(&args[0])?;
    let slot = match args.get(1) {
        Some(at) => path(at)?.find(tree).map_err(|why| range_error(why, at))?,
        None => tree.root_plan(),
    };
    Ok((tree, slot))
}

fn record(args: &[Value]) -> Result<&vm::tree::Record, Raise> {
    let (tree, rec) = record_id(args)?;
    Ok(tree.record(rec))
}

fn record_id(args: &[Value]) -> Result<(&Rc<Tree>, RecId), Raise> {
    let (tree, slot) = slot(args)?;
    let rec = tree.shown(slot).ok_or_else(|| range_error("the run did not reach this place", &args[0]))?;
    Ok((tree, rec))
}

fn tree_value(args: &[Value]) -> Result<Value, Raise> {
    let record = record(args)?;
    let failed = matches!(record.status, Status::Failed | Status::Evaporated);
    Ok(if failed { Value::NIL } else { record.value.clone() })
}

fn tree_failure(args: &[Value]) -> Result<Value, Raise> {
    let (tree, rec) = record_id(args)?;
    let record = tree.record(rec);
    // That of an evaporated task is the failure of its clean-up.
    if !matches!(record.status, Status::Failed | Status::Evaporated) {
        return Ok(Value::NIL);
    }
    vm::failure::name_tasks(tree, &record.value);
    Ok(record.value.clone())
}

fn tree_why(args: &[Value]) -> Result<Value, Raise> {
    let why = record(args)?.why.word();
    Ok(if why.is_empty() { Value::NIL } else { Value::symbol(why) })
}

fn seconds(ns: u64) -> Value {
    Value::float(ns as f64 / 1e9)
}

fn tree_params(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let (tree, rec) = record_id(args)?;
    let params = vm::show::params(ctx.program, tree, rec);
    let named = params.into_iter().filter(|(name, _)| !vm::code::is_pattern(name));
    let map: Map = named.map(|(name, value)| (Value::Imm(Imm::Keyword(name)), value)).collect();
    Ok(Value::map(map).into())
}

fn tree_written(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let (tree, rec) = record_id(args)?;
    Ok(Value::list(vm::show::written(ctx.program, tree, rec)).into())
}

fn tree_notes(args: &[Value]) -> Result<Value, Raise> {
    let (tree, rec) = record_id(args)?;
    let notes = tree.extra(rec).map_or(&[][..], |extra| &extra.notes);
    Ok(Value::list(notes.iter().map(|note| Value::str(note.as_str())).collect::<Vec<_>>()))
}

fn tree_text(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    const MOST: usize = 10_000;
    Ok(Value::str(vm::show::text(ctx.program, tree(&args[0])?, MOST)).into())
}

fn tree_edits(args: &[Value]) -> Result<Value, Raise> {
    let edits = tree(&args[0])?.edits.iter();
    let edits = edits.map(|accepted| Value::new(Obj::Edit(Box::new((*accepted.edit).clone()))));
    Ok(Value::list(edits.collect::<Vec<_>>()))
}

/// All paths that the run reached, parents before children.
fn tree_paths(args: &[Value]) -> Result<Value, Raise> {
    let tree = tree(&args[0])?;
    let mut paths = Vec::new();
    let mut todo: Vec<(SlotId, Vec<PathStep>)> = vec![(ROOT, Vec::new())];
    while let Some((slot, steps)) = todo.pop() {
        if !steps.is_empty() {
            paths.push(Value::new(Obj::Path(Box::new(Path { steps: steps.clone() }))));
        }
        let mut ranks: std::collections::BTreeMap<&str, u32> = std::collections::BTreeMap::new();
        let mut below = Vec::new();
        for child in tree.children(slot) {
            let name = tree.slot(child).name;
            let call = ranks.entry(name.as_str()).or_insert(0);
            *call += 1;
            let mut steps = steps.clone();
            steps.push(PathStep { name, call: *call });
            below.push((child, steps));
        }
        todo.extend(below.into_iter().rev());
    }
    Ok(Value::list(paths))
}

/// `(make-path '(main (transporting 2)))`: names, or names with the number of the call.
fn make_path(args: &[Value]) -> Result<Value, Raise> {
    let step = |value: &Value| {
        let wrong = || type_error("a name, or a list of a name and the number of the call", value);
        if let Some(name) = value.as_symbol() {
            return Ok(PathStep { name, call: 1 });
        }
        let parts = value.to_vec().ok_or_else(wrong)?;
        match parts.as_slice() {
            [name, call] => {
                let call = call.as_int().and_then(|call| u32::try_from(call).ok()).filter(|call| *call > 0);
                Ok(PathStep { name: name.as_symbol().ok_or_else(wrong)?, call: call.ok_or_else(wrong)? })
            }
            _ => Err(wrong()),
        }
    };
    let steps = vm::native::list(&args[0])?.iter().map(step).collect::<Result<Vec<_>, Raise>>()?;
    Ok(Value::new(Obj::Path(Box::new(Path::new(steps)))))
}

fn path_list(args: &[Value]) -> Result<Value, Raise> {
    let steps = path(&args[0])?.steps.iter().map(|step| match step.call {
        1 => Value::Imm(Imm::Symbol(step.name)),
        call => Value::list([Value::Imm(Imm::Symbol(step.name)), Value::int(i64::from(call))]),
    });
    Ok(Value::list(steps.collect::<Vec<_>>()))
}

// ---------------------------------------------------------------------------------------------
// Edits

/// An edit at a path, with the guard that the call must pass, and who made it.
fn edit(at: &Value, what: What, pairs: &[(Symbol, &Value)]) -> Result<Value, Raise> {
    let guard = match find(pairs, "guard") {
        None => Vec::new(),
        Some(value) => {
            let map = value.as_map().ok_or_else(|| type_error("a map from keywords to values", value))?;
            let pair = |(key, wanted): (&Value, &Value)| {
                let key = key.as_keyword().ok_or_else(|| type_error("a keyword", key))?;
                Ok((key, wanted.clone()))
            };
            map.iter().map(pair).collect::<Result<Vec<_>, Raise>>()?
        }
    };
    let by = match find(pairs, "by") {
        None => None,
        Some(by) => Some(by.as_symbol().ok_or_else(|| type_error("a symbol", by))?),
    };
    let out_of = find(pairs, "out-of").map(names).transpose()?.unwrap_or_default();
    Ok(Value::new(Obj::Edit(Box::new(Edit { at: path(at)?.clone(), what, guard, by, out_of }))))
}

/// A list of symbols.
fn names(value: &Value) -> Result<Vec<Symbol>, Raise> {
    let name = |it: &Value| it.as_symbol().ok_or_else(|| type_error("a symbol", it));
    vm::native::list(value)?.iter().map(name).collect()
}

fn an_edit(value: &Value) -> Result<&Edit, Raise> {
    match value.obj() {
        Some(Obj::Edit(edit)) => Ok(edit),
        _ => Err(type_error("an edit", value)),
    }
}

/// `(edit-made-by edit name)`: the edit as that transformation's.
fn made_by(args: &[Value]) -> Result<Value, Raise> {
    let by = args[1].as_symbol().ok_or_else(|| type_error("a symbol", &args[1]))?;
    Ok(Value::new(Obj::Edit(Box::new(Edit { by: Some(by), ..an_edit(&args[0])?.clone() }))))
}

/// `(edit-out-of edit names)`: the edit as one that may move work out of these, too.
fn out_of(args: &[Value]) -> Result<Value, Raise> {
    let mut edit = an_edit(&args[0])?.clone();
    if matches!(edit.what, What::Defer(_) | What::Owe { .. }) {
        for name in names(&args[1])? {
            if !edit.out_of.contains(&name) {
                edit.out_of.push(name);
            }
        }
    }
    Ok(Value::new(Obj::Edit(Box::new(edit))))
}

fn skip(args: &[Value]) -> Result<Value, Raise> {
    let pairs = keywords(&args[1..], &["value", "guard", "by"])?;
    edit(&args[0], What::Skip(find(&pairs, "value").cloned()), &pairs)
}

fn with_code(args: &[Value], what: fn(Value) -> What) -> Result<Value, Raise> {
    let pairs = keywords(&args[2..], &["guard", "by"])?;
    edit(&args[0], what(args[1].clone()), &pairs)
}

fn with_param(args: &[Value]) -> Result<Value, Raise> {
    let pairs = keywords(&args[1..], &[])?;
    let mut changes = pairs.iter().filter(|(key, _)| *key != "guard" && *key != "by");
    let (Some((key, value)), None) = (changes.next(), changes.next()) else {
        return Err(range_error("with-param changes one parameter", &args[0]));
    };
    edit(&args[0], What::WithParam(*key, (*value).clone()), &pairs)
}

/// A path, or a list of paths.
fn paths(value: &Value) -> Result<Vec<Path>, Raise> {
    match value.as_path() {
        Some(path) => Ok(vec![path.clone()]),
        None => vm::native::list(value)?.iter().map(|item| path(item).cloned()).collect(),
    }
}

fn required<'a>(pairs: &[(Symbol, &'a Value)], key: &str, of: &Value) -> Result<&'a Value, Raise> {
    find(pairs, key).ok_or_else(|| range_error(format!("the edit needs :{key}"), of))
}

fn defer(args: &[Value]) -> Result<Value, Raise> {
    let pairs = keywords(&args[1..], &["after", "out-of", "guard", "by"])?;
    let after = paths(required(&pairs, "after", &args[0])?)?;
    edit(&args[0], What::Defer(after), &pairs)
}

fn owe(args: &[Value]) -> Result<Value, Raise> {
    let pairs = keywords(&args[2..], &["after", "as", "out-of", "guard", "by"])?;
    let after = paths(required(&pairs, "after", &args[0])?)?;
    let name = required(&pairs, "as", &args[0])?;
    let name = name.as_symbol().ok_or_else(|| type_error("a symbol", name))?;
    edit(&args[0], What::Owe { code: args[1].clone(), after, name }, &pairs)
}
