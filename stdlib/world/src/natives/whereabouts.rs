//! What is where, for the language: what is in what, in sight, and the frames of things.

use nalgebra::Isometry3;
use vm::machine::Ctx;
use vm::native::{Next, Raise, range_error, type_error};
use vm::natives;
use vm::value::Value;

use super::{believed, container, find, names, object, pose_next, surface, symbol, world};
use crate::state::Support;

natives! {
    "visible?" [1] in ctx Look => visible;
    "container-of" [1] in ctx Look => container_of;
    "surfaces-of" [1] in ctx Look => surfaces_of;
    "surface-size" [1] in ctx Look => surface_size;
    "container-range" [1] in ctx Look => container_range;
    "drawer?" [1] in ctx Look => is_drawer;
    "believed-place" [1] in ctx Look => believed_place;
    "frame-pose" [1] in ctx Look => frame_pose;
}

fn visible(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let state = &world(ctx)?.state;
    let object = object(state, &args[0])?;
    Ok(Value::bool(crate::motions::detect::is_visible(state, object)).into())
}

fn container_of(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let state = &world(ctx)?.state;
    let scene = &state.setting.scene;
    let inside = match surface(state, &args[0]) {
        Ok(surface) => scene.surfaces[surface.0].inside,
        Err(_) => state.container_of(object(state, &args[0])?),
    };
    Ok(inside.map_or(Value::NIL, |it| symbol(&scene.containers[it.0].name)).into())
}

fn surfaces_of(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let state = &world(ctx)?.state;
    let id = container(state, &args[0])?;
    let inside = state.setting.scene.surfaces.iter().filter(|it| it.inside == Some(id));
    Ok(names(inside.map(|it| it.name.as_str())).into())
}

fn surface_size(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let size = it.state.setting.scene.surfaces[surface(&it.state, &args[0])?.0].size;
    Ok(Value::list(size.map(Value::float)).into())
}

/// The position of a container's joint when it is wide open.
fn container_range(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let state = &world(ctx)?.state;
    Ok(Value::float(state.setting.container(container(state, &args[0])?).open).into())
}

fn is_drawer(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let state = &world(ctx)?.state;
    let joint = state.setting.container(container(state, &args[0])?).joint;
    Ok(Value::bool(!joint.turns()).into())
}

/// What is below where an object is believed to be.
fn believed_place(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let (state, object) = (&it.state, object(&it.state, &args[0])?);
    if let hand @ Support::Hand(_) = state.ground_of(object) {
        return Ok(symbol(&state.support_name(hand)).into());
    }
    if !it.belief.seen.contains_key(&object) {
        return Ok(Value::NIL.into());
    }
    // What may carry it is where it is believed to be, too.
    let below = crate::motions::hand::below(&it.believed(), object);
    Ok(below.map_or(symbol("floor"), |(support, _)| symbol(&state.support_name(support))).into())
}

/// The pose of a frame in `map`.
fn frame_pose(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let state = &it.state;
    let named = args[0].as_desc().and_then(|it| it.get("name".into())).unwrap_or(&args[0]);
    let Some(name) = named.as_symbol() else {
        return Err(type_error("the name of a frame", &args[0]));
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
