//! What could be, for the language: see [`crate::search`].
//!
//! Samples are keyed by the seed of the run, the place in the plan, and what is asked: who asks again, be it in
//! another attempt, is told the same.

use nalgebra::{Isometry3, Vector3};
use vm::machine::Ctx;
use vm::native::{Next, Raise, index, list};
use vm::random::hash_text;
use vm::value::{Obj, Value};

use super::{
    arm, around, believed, container, find, finite, names, object, point, pose, pose_next, pose_value, poses,
    raise, range_error, surface, symbol, world,
};
use crate::motions::tool::ToolWay;
use crate::nav::Place;
use crate::scene::ContainerId;
use crate::scene::grasp::{PRE_GRASP_M, back};
use crate::search::place::{Item, Wishes, free_poses, stands};
use crate::search::{reach, stand};
use crate::state::{State, Support};

/// The key of what is asked with these arguments.
fn key(ctx: &Ctx<'_>, args: &[Value]) -> u64 {
    let asked: Vec<String> = args.iter().map(|it| ctx.text(it, true)).collect();
    vm::random::mix(ctx.key() ^ hash_text(&asked.join(" ")))
}

/// The ways of tools: a list of arms with poses.
pub(super) fn ways(state: &State, value: &Value) -> Result<Vec<ToolWay>, Raise> {
    let pair = |pair: &Value| match list(pair)?.as_slice() {
        [arm_name, vias] => Ok(ToolWay { arm: arm(state, arm_name)?, vias: poses(vias)? }),
        _ => Err(vm::native::type_error("a list of arm and poses", pair)),
    };
    list(value)?.iter().map(pair).collect()
}

/// Where the base would stand; nothing for where it stands.
fn base(value: &Value) -> Result<Option<Place>, Raise> {
    if value.is_nil() { Ok(None) } else { Ok(Some(Place::of_pose(&pose(value)?))) }
}

/// nil, or a failure that is not raised.
fn problem(ctx: &Ctx<'_>, trouble: Option<crate::motions::Trouble>) -> Result<Next, Raise> {
    let failure = |trouble| Value::new(Obj::Failure(raise(ctx, &trouble)));
    Ok(trouble.map_or(Value::NIL, failure).into())
}

fn places(places: Vec<Place>) -> Value {
    Value::list(places.iter().map(|place| pose_value(place.pose())).collect::<Vec<_>>())
}

pub(super) fn reach_problem(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let seed = key(ctx, args);
    let it = world(ctx)?;
    let (base, ways, near) = (base(&args[0])?, ways(&it.state, &args[1])?, around(&it.state, &args[2])?);
    let trouble = reach::problem(&it.state, base, &ways, &near, seed);
    problem(ctx, trouble)
}

pub(super) fn container_problem(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let seed = key(ctx, args);
    let it = world(ctx)?;
    let (base, arm, container) =
        (base(&args[0])?, arm(&it.state, &args[1])?, container(&it.state, &args[2])?);
    let to = if args[3].is_nil() { it.state.setting.container(container).open } else { finite(&args[3])? };
    let trouble = reach::container_problem(&it.state, base, arm, container, to, seed);
    problem(ctx, trouble)
}

pub(super) fn base_to_reach(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let seed = key(ctx, args);
    let it = world(ctx)?;
    let (ways, near) = (ways(&it.state, &args[0])?, around(&it.state, &args[1])?);
    let found =
        it.ground().and_then(|(map, flood)| stand::to_reach(&it.state, (&map, &flood), &ways, &near, seed));
    found.map(|found| places(found).into()).map_err(|trouble| raise(ctx, &trouble))
}

pub(super) fn base_to_see(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let seed = key(ctx, args);
    let it = world(ctx)?;
    let at = point(&args[0])?;
    let found = it.ground().and_then(|(map, flood)| stand::to_see(&it.state, (&map, &flood), &at, seed));
    found.map(|found| places(found).into()).map_err(|trouble| raise(ctx, &trouble))
}

/// `(%base-to-open arm container position count)`
pub(super) fn base_to_open(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let seed = key(ctx, &args[..3]);
    let it = world(ctx)?;
    let (arm, container, most) =
        (arm(&it.state, &args[0])?, container(&it.state, &args[1])?, index(&args[3])?);
    let to = if args[2].is_nil() { it.state.setting.container(container).open } else { finite(&args[2])? };
    let found = it
        .ground()
        .and_then(|(map, flood)| stand::to_open(&it.state, (&map, &flood), (arm, container, to), most, seed));
    found.map(|found| places(found).into()).map_err(|trouble| raise(ctx, &trouble))
}

/// How far the base drives to a place, about; nil if it does not get there.
pub(super) fn way_length(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
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

// ---------------------------------------------------------------------------------------------
// Places of objects

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

pub(super) fn support(state: &State, value: &Value) -> Result<Support, Raise> {
    match surface(state, value) {
        Ok(surface) => Ok(Support::Surface(surface)),
        Err(why) => {
            let tray = object(state, value).map_err(|_| why)?;
            match state.setting.scene.kind_of(tray).carries {
                Some(_) => Ok(Support::Object(tray)),
                None => Err(range_error(
                    "it carries nothing: a surface is needed, or something like a tray",
                    value,
                )),
            }
        }
    }
}

/// The middle of what carries objects.
pub(super) fn plane(state: &State, support: Support) -> Isometry3<f64> {
    crate::search::place::plane(state, support).map_or_else(Isometry3::identity, |plane| plane.pose)
}

fn points(value: &Value) -> Result<Vec<Vector3<f64>>, Raise> {
    if value.is_list() { list(value)?.iter().map(point).collect() } else { Ok(vec![point(value)?]) }
}

/// `(%free-poses object surface near far-from yaws)`
pub(super) fn free(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let seed = key(ctx, args);
    let state = &world(ctx)?.state;
    let (item, support) = (item(state, &args[0])?, support(state, &args[1])?);
    let yaws = if args[4].is_list() { list(&args[4])? } else { vec![args[4].clone()] };
    let yaws = yaws.iter().map(finite).collect::<Result<_, _>>()?;
    let wishes = Wishes { near: points(&args[2])?, far: points(&args[3])?, yaws };
    let found = free_poses(state, &item, support, &wishes, seed);
    Ok(Value::list(found.into_iter().map(pose_value).collect::<Vec<_>>()).into())
}

pub(super) fn stands_at(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let state = &world(ctx)?.state;
    Ok(Value::bool(stands(state, &item(state, &args[0])?, &pose(&args[1])?)).into())
}

pub(super) fn visible(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let state = &world(ctx)?.state;
    let object = object(state, &args[0])?;
    Ok(Value::bool(crate::motions::detect::is_visible(state, object)).into())
}

pub(super) fn container_of(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let state = &world(ctx)?.state;
    let scene = &state.setting.scene;
    let inside = match surface(state, &args[0]) {
        Ok(surface) => scene.surfaces[surface.0].inside,
        Err(_) => state.container_of(object(state, &args[0])?),
    };
    Ok(inside.map_or(Value::NIL, |it| symbol(&scene.containers[it.0].name)).into())
}

pub(super) fn surfaces_of(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let state = &world(ctx)?.state;
    let id = container(state, &args[0])?;
    let inside = state.setting.scene.surfaces.iter().filter(|it| it.inside == Some(id));
    Ok(names(inside.map(|it| it.name.as_str())).into())
}

/// What is below where an object is believed to be.
pub(super) fn believed_place(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let (state, object) = (&it.state, object(&it.state, &args[0])?);
    if let Support::Hand(arm) = state.ground_of(object) {
        return Ok(symbol(&state.support_name(Support::Hand(arm))).into());
    }
    let Some(sight) = it.belief.seen.get(&object) else { return Ok(Value::NIL.into()) };
    // What may carry it is where it is believed to be, too.
    let mut believed = state.clone();
    for (other, sight) in it.belief.seen.iter().filter(|(other, _)| **other != object) {
        if !matches!(state.ground_of(*other), Support::Hand(_)) {
            believed.put(*other, Support::Floor, &sight.pose);
        }
    }
    believed.put(object, Support::Floor, &sight.pose);
    let below = crate::motions::hand::below(&believed, object);
    Ok(below.map_or(symbol("floor"), |(support, _)| symbol(&state.support_name(support))).into())
}

// ---------------------------------------------------------------------------------------------
// Frames and handles

/// The pose of a frame in `map`.
pub(super) fn frame_pose(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let state = &it.state;
    let named = args[0].as_desc().and_then(|it| it.get("name".into())).unwrap_or(&args[0]);
    let Some(name) = named.as_symbol() else {
        return Err(vm::native::type_error("the name of a frame", &args[0]));
    };
    match name.as_str() {
        "map" => return pose_next(Isometry3::identity()),
        "base" => return pose_next(state.base),
        _ => {}
    }
    if let Some(machine) = state.machine() {
        if let Some(arm) = machine.arm(&name) {
            return pose_next(state.tool(arm));
        }
        if let Some(link) = machine.robot.links().iter().position(|it| it.name == name.as_str()) {
            return pose_next(state.links().get(link).copied().unwrap_or_default());
        }
    }
    let scene = &state.setting.scene;
    if let Some(surface) = scene.surface(&name) {
        return pose_next(state.surface_pose(surface));
    }
    if let Some(container) = scene.container(&name) {
        return pose_next(state.setting.container_pose(container, state.opening(container)));
    }
    if let Some(fixture) = scene.fixtures.iter().find(|it| it.name == name.as_str()) {
        return pose_next(fixture.pose);
    }
    let all = scene.objects.iter().map(|it| &it.name).chain(scene.surfaces.iter().map(|it| &it.name));
    let all =
        all.chain(scene.containers.iter().map(|it| &it.name)).map(String::as_str).chain(["map", "base"]);
    find("a frame", named, all)?;
    let object = object(state, named)?;
    match believed(it, object) {
        Some(pose) => pose_next(pose),
        None => {
            let message =
                format!("nobody knows where `{name}` is: it has not been seen; the truth is `true-pose`");
            Err(range_error(message, &args[0]))
        }
    }
}

/// Poses of a tool at the handle from shut, or from where it is, to a position, with the one before it.
pub(super) fn handle_poses(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    const MOST: usize = 64;
    let state = &world(ctx)?.state;
    let id = container(state, &args[0])?;
    let it = state.setting.container(id);
    let to = args.get(1).filter(|it| !it.is_nil()).map_or(Ok(it.open), finite)?;
    if !(0.0..=it.open).contains(&to) {
        return Err(range_error(format!("`{}` opens from 0 to {}, not to {to}", it.name, it.open), &args[1]));
    }
    let steps = args.get(2).filter(|it| !it.is_nil()).map_or(Ok(6), index)?.clamp(1, MOST);
    let from = state.opening(id);
    let tool = |id: ContainerId, at: f64| state.setting.container_pose(id, at) * it.handle.tool;
    let along = (0..=steps).map(|step| tool(id, from + (to - from) * step as f64 / steps as f64));
    let all: Vec<Value> =
        std::iter::once(back(&tool(id, from), PRE_GRASP_M)).chain(along).map(pose_value).collect();
    Ok(Value::list(all).into())
}

/// The position of a container's joint when it is wide open.
pub(super) fn container_range(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let state = &world(ctx)?.state;
    Ok(Value::float(state.setting.container(container(state, &args[0])?).open).into())
}
