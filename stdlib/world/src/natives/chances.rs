//! For the language: where to stand, where to put, and what would work there.
//!
//! What `plans/world.plan` declares under "Chances". Samples are keyed by the seed of the run and the place in the
//! plan: who asks again, be it in another attempt, is told the same. The plans that ground locations and choose arms and
//! grasps are written in the language; here is only what takes geometry.

use nalgebra::{Isometry3, Vector3};
use vm::machine::Ctx;
use vm::native::{Next, Raise, index, list, range_error, type_error};
use vm::natives;
use vm::value::{Symbol, Value};

use super::{finite, map, motion, object, point, pose, pose_value, poses, raise, support, symbol, world};
use crate::motions::Trouble;
use crate::nav::Place;
use crate::places::{self, Distance};
use crate::rehearse::{moved, rehearse, seen, sees};
use crate::stands::{Item, stands};
use crate::state::State;
use crate::world::Motion;

natives! {
    "%places-to-stand" [5] in ctx Look => places_to_stand;
    "%places-to-put" [3 4] in ctx Look => places_to_put;
    "%first-that-works" [2] in ctx Look => first_that_works;
    "visible-from?" [2] in ctx Look => visible_from;
    "points-seen" [2] in ctx Look => points_seen;
    "way-length" [1] in ctx Look => way_length;
    "stands-at?" [2] in ctx Look => stands_at;
}

/// So many candidates at most: they are computed at once.
const MOST: usize = 100;
/// Ways times places that are tried at once.
const MOST_TRIES: usize = 2000;

fn count(value: &Value) -> Result<usize, Raise> {
    let count = index(value)?;
    if count <= MOST {
        Ok(count)
    } else {
        Err(range_error(format!("so many places are not computed at once, at most {MOST}"), value))
    }
}

/// `(%places-to-stand point least best most count)`
fn places_to_stand(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let goal = point(&args[0])?.xy();
    let distance =
        Distance { least_m: finite(&args[1])?, best_m: finite(&args[2])?, most_m: finite(&args[3])? };
    let (count, seed) = (count(&args[4])?, ctx.key());
    let it = world(ctx)?;
    let found = places::to_stand(&it.state, it.maps(), goal, distance, seed, count);
    answer(ctx, found.map(|places| places.iter().map(|place| pose_value(place.pose())).collect()))
}

/// `(%places-to-put object place count near)`
fn places_to_put(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let (count, seed) = (count(&args[2])?, ctx.key());
    let near = args.get(3).filter(|it| !it.is_nil()).map(point).transpose()?.map(|it| it.xy());
    let it = world(ctx)?;
    let thing = object(&it.state, &args[0])?;
    let on = support(&it.state, &args[1])?;
    let believed = it.believed();
    let found = places::to_put((&it.state, &believed), it.maps(), thing, on, near, seed, count);
    answer(ctx, found.map(|poses| poses.into_iter().map(pose_value).collect()))
}

fn answer(ctx: &Ctx<'_>, found: Result<Vec<Value>, Trouble>) -> Result<Next, Raise> {
    found.map(|values| Value::list(values).into()).map_err(|trouble| raise(ctx, &trouble))
}

/// `(%first-that-works bases alternatives)`: the numbers of a base and of a list of motions, or the failures of
/// the first base as `(type message)`.
fn first_that_works(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let now_ns = ctx.now_ns();
    let bases: Vec<Isometry3<f64>> = poses(&args[0])?;
    let it = world(ctx)?;
    let state = &it.state;
    let alternatives: Vec<Vec<Motion>> = list(&args[1])?
        .iter()
        .map(|way| list(way)?.iter().map(|it| read_motion(state, it)).collect())
        .collect::<Result<_, Raise>>()?;
    if bases.len().saturating_mul(alternatives.len()) > MOST_TRIES {
        let message = format!("places times ways are more than are tried at once, which is {MOST_TRIES}");
        return Err(range_error(message, &Value::int(alternatives.len() as i64)));
    }
    let believed = it.believed().parked();
    let mut why = Vec::new();
    for (number, base) in bases.iter().enumerate() {
        let there = moved(&believed, base);
        for (way, motions) in alternatives.iter().enumerate() {
            match rehearse(&there, &it.state, motions, now_ns) {
                Ok(()) => {
                    let found = [("place", number), ("way", way)];
                    return Ok(map(found.map(|(key, number)| (key, Value::int(number as i64)))).into());
                }
                Err(trouble) if number == 0 => {
                    why.push(Value::list([symbol(trouble.kind), Value::str(trouble.message)]));
                }
                Err(_) => {}
            }
        }
    }
    Ok(map([("why", Value::list(why))]).into())
}

/// A motion as a plan calls it: `(moving-tcp left (pose pose) :touching milk-1)`.
fn read_motion(state: &State, value: &Value) -> Result<Motion, Raise> {
    let parts = list(value)?;
    let Some((kind, args)) = parts.split_first() else {
        return Err(type_error("a motion with its arguments", value));
    };
    let name: Symbol = kind.as_symbol().ok_or_else(|| type_error("the name of a motion", kind))?;
    let given = |at: usize| args.get(at).cloned().unwrap_or_default();
    match &*name {
        "moving-tcp" => {
            let touching = args.iter().position(|it| *it == Value::keyword("touching"));
            let touching = touching.map_or_else(Value::default, |at| given(at + 1));
            let arms = if given(0).is_list() { list(&given(0))? } else { vec![given(0)] };
            let vias = if given(0).is_list() { list(&given(1))? } else { vec![given(1)] };
            let pairs = arms.into_iter().zip(vias).map(|(arm, vias)| Value::list([arm, vias]));
            motion(state, &name, &[Value::list(pairs.collect::<Vec<_>>()), touching])
        }
        "moving-arm-joints" => motion(state, &name, &[Value::list([Value::list(args.to_vec())])]),
        "parking-arms" => {
            let all = state.machine().map_or(&[][..], |it| &it.limbs.arms);
            Ok(Motion::MovingArmJoints(all.iter().map(|arm| arm.park.clone()).enumerate().collect()))
        }
        "opening" => motion(state, "moving-container", args),
        "closing" => motion(state, "moving-container", &[given(0), given(1), Value::int(0)]),
        other => motion(state, other, args),
    }
}

/// `(points-seen base points)`
fn points_seen(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let base = pose(&args[0])?;
    let points: Vec<Vector3<f64>> = list(&args[1])?.iter().map(point).collect::<Result<_, _>>()?;
    let it = world(ctx)?;
    let found = seen(&moved(&it.believed(), &base), &points);
    found.map(|count| Value::int(count as i64).into()).map_err(|trouble| raise(ctx, &trouble))
}

/// How far the base drives to a place, about; nil if it does not get there.
fn way_length(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let goal = Place::of_pose(&pose(&args[0])?);
    match it.ground() {
        Ok((map, flood)) => {
            let length_m =
                flood.cost_m(&map, goal).and_then(|_| flood.reach(&map, goal).ok()).map(|it| it.length_m);
            Ok(length_m.map_or(Value::NIL, Value::float).into())
        }
        Err(trouble) if trouble.kind == "no-robot" => Err(raise(ctx, &trouble)),
        Err(_) => Ok(Value::NIL.into()),
    }
}

fn stands_at(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let state = &world(ctx)?.state;
    Ok(Value::bool(stands(state, &item(state, &args[0])?, &pose(&args[1])?)).into())
}

/// An object, or any of a type.
fn item<'s>(state: &'s State, value: &Value) -> Result<Item<'s>, Raise> {
    let scene = &state.setting.scene;
    match object(state, value) {
        Ok(object) => Ok(Item { kind: scene.kind_of(object), object: Some(object) }),
        Err(why) => {
            let kind = value.as_symbol().and_then(|name| scene.kind(name.as_str()));
            kind.map(|kind| Item { kind: &scene.kinds[kind.0], object: None }).ok_or(why)
        }
    }
}

/// `(visible-from? object base)`
fn visible_from(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let base = pose(&args[1])?;
    let it = world(ctx)?;
    let object = object(&it.state, &args[0])?;
    if !it.belief.seen.contains_key(&object) {
        return Ok(Value::bool(false).into());
    }
    let found = sees(&moved(&it.believed().parked(), &base), object);
    found.map(|sees| Value::bool(sees).into()).map_err(|trouble| raise(ctx, &trouble))
}
