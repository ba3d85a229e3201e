//! A graft from the parts of `def-variant`.

use std::collections::BTreeMap;
use std::rc::Rc;

use rustc_hash::FxHashMap;

use super::{AROUND, CALL, Change, Graft, Link, Place, Words, not_applied};

use crate::edit::What;
use crate::key::{Element, Step};
use crate::path::{Path, PathStep};
use crate::value::{Obj, Symbol, Value};

impl Graft {
    /// What `def-variant` says: places, the rounds between them, and edits.
    ///
    /// # Errors
    /// A sentence that says what has no meaning.
    pub fn read(plan: Symbol, places: &Value, between: &Value, edits: &Value) -> Result<Graft, String> {
        let mut graft = Graft::empty(plan);
        let mut todo: Vec<(usize, Value)> = items(places)?.into_iter().rev().map(|it| (AROUND, it)).collect();
        let mut is_call = true;
        while let Some((above, form)) = todo.pop() {
            // A name alone is a place with nothing below.
            let parts = if form.as_symbol().is_some() { vec![form.clone()] } else { items(&form)? };
            let (place, below) = read_place(&graft, above, &form, &parts)?;
            let at = if std::mem::take(&mut is_call) {
                graft.places[CALL].step = place.step;
                CALL
            } else {
                graft.places.push(place);
                graft.places.len() - 1
            };
            todo.extend(below.iter().rev().map(|it| (at, it.clone())));
        }
        let known: FxHashMap<(usize, Symbol, u32), usize> = (CALL..graft.places.len())
            .map(|at| ((graft.places[at].above, graft.places[at].step.name, graft.places[at].step.call), at))
            .collect();
        let find = |path: &Path| {
            let mut at = AROUND;
            for step in &path.steps {
                at = *known.get(&(at, step.name, step.call))?;
            }
            Some(at).filter(|at| *at != AROUND)
        };
        let mut rounds: BTreeMap<(usize, usize), Vec<Step>> = BTreeMap::new();
        for row in items(between)? {
            let parts = items(&row)?;
            let [number, path, steps @ ..] = parts.as_slice() else { return Err(odd(&row)) };
            let number = number.as_int().and_then(|it| usize::try_from(it).ok()).ok_or_else(|| odd(&row))?;
            let place = path.as_path().and_then(find).ok_or_else(|| odd(&row))?;
            let (way, rest) = read_way(&row, steps)?;
            let way = way.into_iter().map(|link| match link {
                Link::Same(step) => Some(step),
                _ => None,
            });
            match way.collect::<Option<Vec<Step>>>() {
                Some(steps) if rest.is_empty() => rounds.insert((number, place), steps),
                _ => return Err(odd(&row)),
            };
        }
        for (number, value) in (1..).zip(items(edits)?) {
            let Some(Obj::Edit(edit)) = value.obj() else {
                return Err(format!("{} is no edit", crate::print::brief(&value)));
            };
            let lost = |path: &Path| {
                let why = format!("`places` does not say where {} is", path.show());
                not_applied(edit.word(), &edit.at, &why)
            };
            let paths: &[Path] = match &edit.what {
                What::Defer(after) => after,
                What::Owe { after, .. } => after,
                _ => &[],
            };
            let missing = std::iter::once(&edit.at).chain(paths).find(|path| find(path).is_none());
            if let Some(missing) = missing {
                graft.lost.push(lost(missing));
            }
            let place = find(&edit.at).unwrap_or(AROUND);
            let after: Vec<usize> = match missing {
                None => paths.iter().filter_map(find).collect(),
                Some(_) => Vec::new(),
            };
            let between = after
                .iter()
                .filter_map(|place| Some((*place, rounds.get(&(number, *place))?.clone())))
                .collect();
            // One that is lost keeps its number.
            let place = if missing.is_some() { AROUND } else { place };
            let origin = edit.by.map(|by| format!("transformation {by}")).unwrap_or_default().into();
            let edit = Rc::new((**edit).clone());
            graft.edits.push(Change { place, edit, after, between, code: None, origin });
        }
        Ok(graft)
    }
}

fn items(value: &Value) -> Result<Vec<Value>, String> {
    value.to_vec().ok_or_else(|| odd(value))
}

fn odd(value: &Value) -> String {
    format!("{} says no place", crate::print::brief(value))
}

/// A place, and the forms of those below it.
fn read_place<'v>(
    graft: &Graft,
    above: usize,
    form: &Value,
    parts: &'v [Value],
) -> Result<(Place, &'v [Value]), String> {
    let wrong = || odd(form);
    let (name, mut rest) = parts.split_first().ok_or_else(wrong)?;
    let name = name.as_symbol().ok_or_else(wrong)?;
    let owner = (above != AROUND).then(|| graft.places[above].step.name);
    let mut site = Words { owner, inner: 0, name, nth: 1 };
    let mut call = 1;
    while let [key, value, more @ ..] = rest {
        let number = || value.as_int().and_then(|it| u32::try_from(it).ok()).ok_or_else(wrong);
        match key.as_keyword().as_ref().map(|key| key.as_str()) {
            Some("call") => call = number()?,
            Some("nth") => site.nth = number()?,
            Some("inner") => (site.owner, site.inner) = (None, number()?),
            Some("site") => site.name = value.as_symbol().ok_or_else(wrong)?,
            Some("in") => match value.as_symbol() {
                Some(owner) => (site.owner, site.inner) = (Some(owner), 0),
                None => {
                    let parts = items(value)?;
                    let [owner, inner] = parts.as_slice() else { return Err(wrong()) };
                    let inner = inner.as_int().and_then(|it| u32::try_from(it).ok()).ok_or_else(wrong)?;
                    (site.owner, site.inner) = (Some(owner.as_symbol().ok_or_else(wrong)?), inner);
                }
            },
            _ => break,
        }
        rest = more;
    }
    let (way, below) = read_way(form, rest)?;
    if matches!(way.first(), Some(Link::Edit(_))) && owner.is_none_or(|owner| site.owner == Some(owner)) {
        // It stands in the code of the edit.
        site.owner = None;
    }
    let step = PathStep { name, call };
    Ok((Place { above, step, site: Some(site), known: None, way, called: None }, below))
}

/// The steps of a key, and what stands after them.
fn read_way<'v>(form: &Value, parts: &'v [Value]) -> Result<(Vec<Link>, &'v [Value]), String> {
    let wrong = || odd(form);
    let (mut way, mut rest) = (Vec::new(), parts);
    while let [key, value, more @ ..] = rest {
        let Some(key) = key.as_keyword() else { break };
        let number = || value.as_int().and_then(|it| u32::try_from(it).ok()).ok_or_else(wrong);
        match key.as_str() {
            "for" => {
                let element = Element::of(value).ok_or_else(wrong)?;
                way.push(Link::Same(Step::Round(element, 0)));
            }
            "rank" => match way.last_mut() {
                Some(Link::Same(Step::Round(_, rank))) => *rank = number()?,
                _ => return Err(wrong()),
            },
            "round" => way.push(Link::Same(Step::Number(number()?))),
            "named" => way.push(Link::Same(Step::Name(value.as_symbol().ok_or_else(wrong)?))),
            "again" => way.push(Link::Same(Step::Again(number()?))),
            "edit" => way.push(Link::Edit(number()?)),
            "through" => {
                let parts = items(value)?;
                let [name, nth, more @ ..] = parts.as_slice() else { return Err(wrong()) };
                let count = |it: &Value| it.as_int().and_then(|it| u32::try_from(it).ok()).ok_or_else(wrong);
                let owner = more.first().and_then(Value::as_symbol);
                let inner = more.get(usize::from(owner.is_some())).map_or(Ok(0), count)?;
                let name = name.as_symbol().ok_or_else(wrong)?;
                way.push(Link::Through(Words { owner, inner, name, nth: count(nth)? }, None));
            }
            _ => return Err(wrong()),
        }
        rest = more;
    }
    if rest.first().is_some_and(|it| it.as_keyword().is_some()) { Err(wrong()) } else { Ok((way, rest)) }
}
