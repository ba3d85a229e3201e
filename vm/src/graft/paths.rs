//! Paths in the code of edits, which name places from the root of a run.

use crate::path::{Path, PathStep};
use crate::value::{Imm, Obj, Value};

/// A value with the paths in it that begin at the plan of a graft as they are below a call: `below` is the path of the
/// call, `root` the step that stands for it. Nothing if there is no such path.
#[must_use]
pub fn move_paths(value: &Value, root: PathStep, below: &[PathStep], depth: usize) -> Option<Value> {
    const DEPTH: usize = 1000;
    let Value::Obj(obj) = value else { return None };
    if depth > DEPTH {
        return None;
    }
    let inner = |value: &Value| move_paths(value, root, below, depth + 1);
    let all = |items: &mut dyn Iterator<Item = &Value>| {
        let moved: Vec<(Value, bool)> =
            items.map(|it| inner(it).map_or_else(|| (it.clone(), false), |it| (it, true))).collect();
        let changed = moved.iter().any(|it| it.1);
        changed.then(|| moved.into_iter().map(|it| it.0).collect::<Vec<Value>>())
    };
    match &**obj {
        Obj::Path(path) => moved_path(path, root, below).map(|path| Value::new(Obj::Path(Box::new(path)))),
        Obj::Pair(head, _) if head.as_symbol().is_some_and(|head| head == "path") => {
            let steps = value.to_vec()?;
            let first = steps.get(1)?;
            let skip = usize::from(first.as_symbol().is_some_and(|it| it == "top-level"));
            if path_step(steps.get(1 + skip)?)? != root {
                return None;
            }
            let below = below.iter().map(|step| match step.call {
                1 => Value::Imm(Imm::Symbol(step.name)),
                call => Value::list([
                    Value::Imm(Imm::Symbol(step.name)),
                    Value::keyword("call"),
                    Value::int(i64::from(call)),
                ]),
            });
            let rest = steps.iter().skip(2 + skip).cloned();
            Some(Value::list(steps.first().cloned().into_iter().chain(below).chain(rest).collect::<Vec<_>>()))
        }
        Obj::Pair(..) => {
            let items = value.to_vec()?;
            all(&mut items.iter()).map(Value::list)
        }
        Obj::Vector(items) => all(&mut items.iter()).map(Value::vector),
        Obj::Map(map) => {
            let values = all(&mut map.iter().map(|(_, value)| value))?;
            Some(Value::map(map.iter().map(|(key, _)| key.clone()).zip(values).collect()))
        }
        Obj::Desc(desc) => {
            let values = all(&mut desc.properties().map(|(_, value)| value))?;
            let keys = desc.properties().map(|(key, _)| key);
            Some(Value::desc(crate::desc::Desc::new(desc.kind, keys.zip(values).collect())))
        }
        _ => None,
    }
}

fn path_step(form: &Value) -> Option<PathStep> {
    if let Some(name) = form.as_symbol() {
        return Some(PathStep { name, call: 1 });
    }
    let parts = form.to_vec()?;
    let [name, key, call] = parts.as_slice() else { return None };
    key.as_keyword().filter(|key| *key == "call")?;
    Some(PathStep { name: name.as_symbol()?, call: u32::try_from(call.as_int()?).ok()? })
}

fn moved_path(path: &Path, root: PathStep, below: &[PathStep]) -> Option<Path> {
    let (first, rest) = path.steps.split_first()?;
    (*first == root).then(|| Path { steps: below.iter().chain(rest).copied().collect() })
}
