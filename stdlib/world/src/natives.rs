//! The world for the language: what `plans/world.plan` declares is computed here.
//!
//! Natives find the world of their run in [`Ctx::world`] and make an empty one where there is none. Names
//! that do not exist are mistakes of the program (`range-error`, with what was probably meant); what
//! goes wrong with a motion is a typed failure of that file.

use nalgebra::{Isometry3, Translation3, Vector3};
use vm::failure::{Builtin, Failure};
use vm::geometry::Pose;
use vm::machine::{Ctx, TaskOp};
use vm::native::{Next, Raise, index, list, number, range_error, type_error};
use vm::natives;
use vm::value::{Map, Obj, Symbol, Value};

use crate::belief::Sight;
use crate::motions::hand::Target;
use crate::motions::tool::ToolWay;
use crate::motions::{Field, Trouble};
use crate::nav::Place;
use crate::read::Mistake;
use crate::read_robot;
use crate::robot::error::nearest;
use crate::robot::model::turn;
use crate::scene::grasp::{back, lifted};
use crate::scene::{ContainerId, Hands, ObjectId, Scene, SurfaceId};
use crate::state::{Around, Grip, State, Support};
use crate::world::{Ended, Mode, Motion, Wanted, World};

pub(crate) mod chances;
pub(crate) mod whereabouts;

natives! {
    "%checked-scene" [1] => checked_scene;
    "%checked-robot" [1] => checked_robot;
    "%use-scene" [1] in ctx World => use_scene;
    "%use-robot" [2] in ctx World => use_robot;
    "use-noise" [1] in ctx World => use_noise;

    "%begin-motion" [2] in ctx Motion => begin;
    "%end-motion" [1] in ctx Motion => end;
    "%motion-result" [1] in ctx Motion => result;
    "%keep-world" [0] in ctx World => keep;
    "%go-back" [1] in ctx World => go_back;
    "%world-of" [1] in ctx World => world_of;
    "%robot-mode" [1] in ctx World => robot_mode;
    "record-world" [0] in ctx World => |ctx: &mut Ctx<'_>, _args| { world(ctx)?.record_from_now(); Ok(Value::NIL.into()) };
    "%world-at" [1] in ctx World => world_at;

    "put-object" [2 5] in ctx World => put_object;
    "robot-arms" [0] in ctx Look => |ctx: &mut Ctx<'_>, _args| robot_arms(ctx);
    "park-position" [1] in ctx Look => park_position;
    "torso-range" [0] in ctx Look => |ctx: &mut Ctx<'_>, _args| torso_range(ctx);
    "robot-pose" [0] in ctx Look => |ctx: &mut Ctx<'_>, _args| pose_next(world(ctx)?.state.base);
    "tool-pose" [1] in ctx Look => |ctx: &mut Ctx<'_>, args| { let it = world(ctx)?; pose_next(it.state.tool(arm(&it.state, &args[0])?)) };
    "joint-position" [1] in ctx Look => joint_position;
    "true-pose" [1] in ctx Look => |ctx: &mut Ctx<'_>, args| { let it = world(ctx)?; pose_next(it.state.object_pose(object(&it.state, &args[0])?)) };
    "believed-pose" [1] in ctx Look => believed_pose;
    "seen-at" [1] in ctx Look => seen_at;
    "object-type" [1] in ctx Look => object_type;
    "objects" [0] in ctx Look => |ctx: &mut Ctx<'_>, _args| Ok(names(world(ctx)?.state.setting.scene.objects.iter().map(|it| it.name.as_str())).into());
    "where-is" [1] in ctx Look => where_is;
    "objects-on" [1] in ctx Look => objects_on;
    "held-by" [1] in ctx Look => held_by;
    "surface-pose" [1] in ctx Look => |ctx: &mut Ctx<'_>, args| { let it = world(ctx)?; pose_next(carrier(&it.state, &args[0])?.1) };
    "surfaces" [0] in ctx Look => |ctx: &mut Ctx<'_>, _args| Ok(names(world(ctx)?.state.setting.scene.surfaces.iter().map(|it| it.name.as_str())).into());
    "containers" [0] in ctx Look => |ctx: &mut Ctx<'_>, _args| Ok(names(world(ctx)?.state.setting.scene.containers.iter().map(|it| it.name.as_str())).into());
    "container-position" [1] in ctx Look => |ctx: &mut Ctx<'_>, args| { let it = world(ctx)?; Ok(Value::float(it.state.opening(container(&it.state, &args[0])?)).into()) };
    "container-open?" [1] in ctx Look => |ctx: &mut Ctx<'_>, args| { let it = world(ctx)?; Ok(Value::bool(it.state.opening(container(&it.state, &args[0])?) > 0.0).into()) };
    "believed-open?" [1] in ctx Look => |ctx: &mut Ctx<'_>, args| { let it = world(ctx)?; Ok(Value::bool(it.belief.open.contains_key(&container(&it.state, &args[0])?)).into()) };
    "height-above-ground" [1] in ctx Look => height_above_ground;
    "grasps" [1 2] in ctx Look => grasps;
    "handle-ways" [1 3] in ctx Look => handle_ways;
    "tool-to-put" [2] in ctx Look => tool_to_put;
    "object-types" [0] in ctx Look => |ctx: &mut Ctx<'_>, _args| Ok(names(world(ctx)?.state.setting.scene.kinds.iter().map(|it| it.name.as_str())).into());
    "motion-costs" [0] in ctx Look => costs;
    "world-version" [0] in ctx Look => |ctx: &mut Ctx<'_>, _args| Ok(Value::int(world(ctx)?.state.version as i64).into());
}

/// The world of the run.
pub(crate) fn world<'a>(ctx: &'a mut Ctx<'_>) -> Result<&'a mut World, Raise> {
    let now_ns = ctx.now_ns();
    let slot = ctx.world().get_or_insert_with(|| Box::new(World::default()));
    let other = || Box::new(Failure::new(Builtin::ProgramError, "this run has a world of another kind"));
    let world = slot.as_any().downcast_mut::<World>().ok_or_else(other)?;
    world.now_ns = now_ns;
    Ok(world)
}

/// The world has become another: fluents about it are computed again. The value is nil.
fn changed() -> Result<Next, Raise> {
    Ok(Next::Task(TaskOp::WorldChanged(Value::NIL)))
}

// ---------------------------------------------------------------------------------------------
// Values

pub(crate) fn pose_value(isometry: Isometry3<f64>) -> Value {
    Value::new(Obj::Pose(Box::new(Pose { frame: Symbol::from("map"), isometry })))
}

pub(crate) fn pose_next(isometry: Isometry3<f64>) -> Result<Next, Raise> {
    Ok(pose_value(isometry).into())
}

/// A pose in the world.
pub(crate) fn pose(value: &Value) -> Result<Isometry3<f64>, Raise> {
    match value.obj() {
        Some(Obj::Pose(pose)) if pose.frame == "map" => Ok(pose.isometry),
        Some(Obj::Pose(pose)) => {
            let message = format!(
                "the pose is in the frame `{}`; motions take poses in `map`, see `in-map`",
                pose.frame
            );
            Err(range_error(message, value))
        }
        _ => Err(type_error("a pose", value)),
    }
}

/// A motion is computed between two instructions, so what it can be asked is bounded.
const MOST_POSES: usize = 256;

/// A pose, or a list of them.
pub(crate) fn poses(value: &Value) -> Result<Vec<Isometry3<f64>>, Raise> {
    if !value.is_list() {
        return Ok(vec![pose(value)?]);
    }
    let all = list(value)?;
    if all.len() > MOST_POSES {
        let message = format!("{} poses are more than one motion takes, which is {MOST_POSES}", all.len());
        return Err(range_error(message, &Value::int(all.len() as i64)));
    }
    all.iter().map(pose).collect()
}

pub(crate) fn symbol(name: &str) -> Value {
    Value::symbol(name)
}

fn names<'a>(names: impl Iterator<Item = &'a str>) -> Value {
    Value::list(names.map(symbol).collect::<Vec<_>>())
}

/// The place of a name among others.
fn find<'a>(what: &str, value: &Value, known: impl Iterator<Item = &'a str> + Clone) -> Result<usize, Raise> {
    let name = match (value.as_symbol(), value.as_str()) {
        (Some(name), _) => name.to_string(),
        (_, Some(name)) => name.to_string(),
        _ => return Err(type_error(&format!("the name of {what}"), value)),
    };
    known.clone().position(|it| it == name).ok_or_else(|| {
        let hint = nearest(&name, known).map_or_else(String::new, |it| format!("; probably `{it}` is meant"));
        range_error(
            format!(
                "this world has no {} `{name}`{hint}",
                what.trim_start_matches("an ").trim_start_matches("a ")
            ),
            value,
        )
    })
}

pub(crate) fn object(state: &State, value: &Value) -> Result<ObjectId, Raise> {
    // What was seen is a description with a name in it.
    let named = value.as_desc().and_then(|it| it.get(Symbol::from("name"))).unwrap_or(value);
    find("an object", named, state.setting.scene.objects.iter().map(|it| it.name.as_str())).map(ObjectId)
}

pub(crate) fn surface(state: &State, value: &Value) -> Result<SurfaceId, Raise> {
    find("a surface", value, state.setting.scene.surfaces.iter().map(|it| it.name.as_str())).map(SurfaceId)
}

pub(crate) fn container(state: &State, value: &Value) -> Result<ContainerId, Raise> {
    find("a container", value, state.setting.scene.containers.iter().map(|it| it.name.as_str()))
        .map(ContainerId)
}

/// A surface, or an object that may carry others.
pub(crate) fn support(state: &State, value: &Value) -> Result<Support, Raise> {
    surface(state, value).map(Support::Surface).or_else(|why| match object(state, value) {
        Ok(object) => Ok(Support::Object(object)),
        Err(_) => Err(why),
    })
}

/// What carries objects, and its middle.
fn carrier(state: &State, value: &Value) -> Result<(Support, Isometry3<f64>), Raise> {
    let support = support(state, value)?;
    let carries_nothing =
        || range_error("it carries nothing: a surface is needed, or something like a tray", value);
    crate::stands::plane(state, support).map(|plane| (support, plane)).ok_or_else(carries_nothing)
}

fn arm(state: &State, value: &Value) -> Result<usize, Raise> {
    let arms = state.machine().map_or(&[][..], |it| &it.limbs.arms);
    find("an arm", value, arms.iter().map(|it| it.name.as_str()))
}

fn arms(state: &State, value: &Value) -> Result<Vec<usize>, Raise> {
    let given = if value.is_list() { list(value)? } else { vec![value.clone()] };
    let arms: Vec<usize> = given.iter().map(|it| arm(state, it)).collect::<Result<_, _>>()?;
    let twice = arms.iter().enumerate().any(|(number, arm)| arms[..number].contains(arm));
    if arms.is_empty() || twice {
        Err(range_error("name each arm once, and at least one", value))
    } else {
        Ok(arms)
    }
}

// ---------------------------------------------------------------------------------------------
// Scenes and robots

/// Mistakes of a description as one failure of the program.
fn mistaken(mistakes: &[Mistake]) -> Raise {
    const SHOWN: usize = 10;
    let mut text: Vec<String> = mistakes.iter().take(SHOWN).map(Mistake::text).collect();
    if mistakes.len() > SHOWN {
        text.push(format!("and {} more", mistakes.len() - SHOWN));
    }
    let entries = mistakes.iter().map(|it| Value::str(it.entry.as_str())).collect::<Vec<_>>();
    let fields = vec![("message", Value::str(text.join("\n"))), ("entries", Value::list(entries))];
    Box::new(Failure::with(Builtin::RangeError, fields))
}

fn scene(value: &Value) -> Result<Scene, Raise> {
    Scene::read(value).map_err(|mistakes| mistaken(&mistakes))
}

fn checked_scene(args: &[Value]) -> Result<Value, Raise> {
    scene(&args[0]).map(|_| args[0].clone())
}

fn checked_robot(args: &[Value]) -> Result<Value, Raise> {
    // What its file is made of is looked at when it is used: that takes longer than loading should.
    match args[0].to_vec() {
        Some(entries) if !entries.is_empty() => Ok(args[0].clone()),
        _ => Err(type_error("the parts of a robot", &args[0])),
    }
}

fn use_scene(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let scene = scene(&args[0])?;
    world(ctx)?.use_scene(scene);
    changed()
}

fn use_robot(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let base = if args[1].is_nil() { Isometry3::identity() } else { Place::of_pose(&pose(&args[1])?).pose() };
    let machine = read_robot::machine(&args[0]).map_err(|mistake| mistaken(&[mistake]))?;
    world(ctx)?.use_robot(std::sync::Arc::new(machine), base);
    changed()
}

/// Errors that are greater than this are of no use: the base would come to stand a metre beside its goal.
const MOST_NOISE: f64 = 100.0;

/// `(use-noise factor)`: all standard deviations of errors times so much from now on.
fn use_noise(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let noise = finite(&args[0])?;
    if !(0.0..=MOST_NOISE).contains(&noise) {
        let message = format!("errors are multiplied by a number from 0 to {MOST_NOISE}");
        return Err(range_error(message, &args[0]));
    }
    world(ctx)?.noise = noise;
    Ok(args[0].clone().into())
}

/// `(put-object name surface x y yaw)`: as if a person had put it there.
fn put_object(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let object = object(&it.state, &args[0])?;
    let (support, on_world) = match args[1].obj() {
        Some(Obj::Pose(_)) => {
            let at = pose(&args[1])?;
            let mut there = it.state.clone();
            there.put(object, Support::Floor, &at);
            let below = crate::motions::hand::below(&there, object);
            let stands_on = below.filter(|(_, gap_m)| gap_m.abs() <= crate::stands::ON_M);
            (stands_on.map_or(Support::Floor, |(support, _)| support), at)
        }
        _ => {
            let (support, plane) = carrier(&it.state, &args[1])?;
            let given = |at: usize| args.get(at).map_or(Ok(0.0), finite);
            let height = it.state.setting.scene.kind_of(object).height_above_ground_m();
            let there = crate::scene::upright(Vector3::new(given(2)?, given(3)?, height), given(4)?);
            (support, plane * there)
        }
    };
    let mut after = it.state.clone();
    after.put(object, support, &on_world);
    it.state = after;
    it.changed();
    changed()
}

pub(crate) fn finite(value: &Value) -> Result<f64, Raise> {
    let number = number(value)?;
    if number.is_finite() { Ok(number) } else { Err(range_error("expected a finite number", value)) }
}

// ---------------------------------------------------------------------------------------------
// Motions

/// Begins the motion `kind` with `args`: `(number seconds)`.
fn begin(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let kind = args[0].as_symbol().ok_or_else(|| type_error("the name of a motion", &args[0]))?;
    let given = list(&args[1])?;
    let (now_ns, seed) = (ctx.now_ns(), ctx.draw());
    let it = world(ctx)?;
    let motion = motion(&it.state, &kind, &given)?;
    let (number, duration_s) = it.begin(&motion, now_ns, seed);
    Ok(Value::list([Value::int(number as i64), Value::float(duration_s)]).into())
}

pub(crate) fn motion(state: &State, kind: &str, args: &[Value]) -> Result<Motion, Raise> {
    let given = |at: usize| args.get(at).cloned().unwrap_or_default();
    Ok(match kind {
        "going" => Motion::Going(poses(&given(0))?.iter().map(Place::of_pose).collect()),
        "moving-torso" => Motion::MovingTorso(finite(&given(0))?),
        "looking" => Motion::Looking(point(&given(0))?),
        "moving-arm-joints" => {
            let values = |value: &Value| list(value)?.iter().map(finite).collect::<Result<Vec<_>, _>>();
            let pairs = list(&given(0))?;
            let pair = |pair: &Value| match list(pair)?.as_slice() {
                [arm_name, positions] => Ok((arm(state, arm_name)?, values(positions)?)),
                _ => Err(type_error("a list of arm and positions", pair)),
            };
            Motion::MovingArmJoints(pairs.iter().map(pair).collect::<Result<_, Raise>>()?)
        }
        "moving-tcp" => Motion::MovingTcp(ways(state, &given(0))?, around(state, &given(1))?),
        "gripping" => Motion::Gripping(arms(state, &given(0))?, target(state, &given(1))?),
        "releasing" => Motion::Releasing(arms(state, &given(0))?),
        "moving-container" => {
            let to = given(2);
            let to = if to.is_nil() { None } else { Some(finite(&to)?) };
            Motion::MovingContainer(arm(state, &given(0))?, container(state, &given(1))?, to)
        }
        "detecting" => Motion::Detecting(wanted(state, &given(0))?),
        _ => return Err(range_error(format!("there is no motion `{kind}`"), &symbol(kind))),
    })
}

/// The ways of tools: a list of arms with poses.
fn ways(state: &State, value: &Value) -> Result<Vec<ToolWay>, Raise> {
    let pair = |pair: &Value| match list(pair)?.as_slice() {
        [arm_name, vias] => Ok(ToolWay { arm: arm(state, arm_name)?, vias: poses(vias)? }),
        _ => Err(type_error("a list of arm and poses", pair)),
    };
    list(value)?.iter().map(pair).collect()
}

pub(crate) fn point(value: &Value) -> Result<Vector3<f64>, Raise> {
    match value.obj() {
        Some(Obj::Vec3(vec)) => Ok(vec.0),
        _ => pose(value).map(|pose| pose.translation.vector),
    }
}

/// An object or a container.
fn target(state: &State, value: &Value) -> Result<Target, Raise> {
    match container(state, value) {
        Ok(container) => Ok(Target::Handle(container)),
        Err(_) => object(state, value).map(Target::Object),
    }
}

fn around(state: &State, value: &Value) -> Result<Around, Raise> {
    let mut around = Around::default();
    let given = if value.is_list() { list(value)? } else { vec![value.clone()] };
    for each in &given {
        match target(state, each)? {
            Target::Object(object) => around.touchable.push(object),
            Target::Handle(container) => around.handles.push(container),
        }
    }
    Ok(around)
}

/// A description `(an object (type milk) (name milk-1))`, a name of one, or nil for any.
fn wanted(state: &State, value: &Value) -> Result<Wanted, Raise> {
    if value.is_nil() {
        return Ok(Wanted::Any);
    }
    let property = |key: &str| value.as_desc().and_then(|it| it.get(Symbol::from(key)));
    match (value.as_desc(), property("name"), property("type")) {
        (Some(_), Some(name), _) => object(state, name).map(Wanted::Object),
        (Some(_), None, Some(kind)) => {
            let kinds = state.setting.scene.kinds.iter().map(|it| it.name.as_str());
            let at = find("a type of objects", kind, kinds)?;
            Ok(Wanted::Kind(state.setting.scene.kinds[at].name.clone()))
        }
        (Some(_), None, None) => Ok(Wanted::Any),
        (None, ..) => object(state, value).map(Wanted::Object),
    }
}

fn number_of(value: &Value) -> Result<u64, Raise> {
    Ok(index(value)? as u64)
}

fn end(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let now_ns = ctx.now_ns();
    world(ctx)?.end(number_of(&args[0])?, now_ns);
    changed()
}

/// What a motion that has ended gives: its value, or its failure.
fn result(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let ended = it.take_end(number_of(&args[0])?);
    match ended {
        Some(Ended::Done(seen)) => {
            let described = seen.iter().map(|(object, sight)| described(it, *object, sight));
            Ok(Value::list(described.collect::<Vec<_>>()).into())
        }
        Some(Ended::Failed(trouble)) => Err(raise(ctx, &trouble)),
        Some(Ended::Stopped) | None => Ok(Value::NIL.into()),
    }
}

/// `(an object (name milk-1) (type milk) (pose …) (seen-at 3.5))`
fn described(it: &World, object: ObjectId, sight: &Sight) -> Value {
    let scene = &it.state.setting.scene;
    let properties = vec![
        (Symbol::from("name"), symbol(&scene.objects[object.0].name)),
        (Symbol::from("type"), symbol(&scene.kind_of(object).name)),
        (Symbol::from("pose"), pose_value(sight.pose)),
        (Symbol::from("seen-at"), Value::float(sight.at_s)),
    ];
    Value::desc(vm::desc::Desc::new(Symbol::from("object"), properties))
}

/// A failure of the type of this name below `world-failure`.
pub(crate) fn raise(ctx: &Ctx<'_>, trouble: &Trouble) -> Raise {
    let types = &ctx.program.failures;
    let root = Symbol::from("world-failure");
    let of = |name: &str| {
        let found = types
            .iter()
            .enumerate()
            .find(|(at, it)| it.name == name && types.is_named(vm::failure::TypeId(*at as u32), root));
        found.map(|(at, it)| (vm::failure::TypeId(at as u32), it.name))
    };
    let (kind, name) = of(trouble.kind)
        .or_else(|| of("world-failure"))
        .unwrap_or((Builtin::PlanFailure.id(), Symbol::from(Builtin::PlanFailure.name())));
    let mut fields = vec![(Symbol::from("message"), Value::str(trouble.message.as_str()))];
    for (field, value) in &trouble.fields {
        let value = match value {
            Field::Name(name) => symbol(name),
            Field::Names(several) => names(several.iter().map(String::as_str)),
            Field::Number(number) => Value::float(*number),
            Field::Pose(pose) => pose_value(*pose),
        };
        fields.push((Symbol::from(field), value));
    }
    Box::new(Failure::of_type(kind, name, fields))
}

fn keep(ctx: &mut Ctx<'_>, _args: &[Value]) -> Result<Next, Raise> {
    match world(ctx)?.keep() {
        Ok(kept) => Ok(Value::int(kept as i64).into()),
        Err(trouble) => Err(raise(ctx, &trouble)),
    }
}

fn world_at(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let seconds = finite(&args[0])?;
    match world(ctx)?.as_at((seconds.max(0.0) * 1e9).round() as u64) {
        Ok(()) => Ok(Value::NIL.into()),
        Err(trouble) => Err(raise(ctx, &trouble)),
    }
}

/// `(%world-of tree)`: the world is as that of the tree's run was at its end.
fn world_of(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let tree = args[0].as_tree().ok_or_else(|| type_error("a tree", &args[0]))?;
    let Some(mut ended) = tree.world.as_ref().map(|world| world.fork()) else {
        let why = "the tree has no world: it ran without one, or it comes from a store";
        return Err(raise(ctx, &Trouble::new("world-failure", why)));
    };
    match ended.as_any().downcast_ref::<World>() {
        Some(ended) => world(ctx)?.become_like(ended),
        None => return Err(range_error("this world is of another kind", &args[0])),
    }
    changed()
}

fn go_back(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let kept = index(&args[0])?;
    world(ctx)?.go_back(kept);
    changed()
}

/// `(%robot-mode 'simulated)`: from now on; the mode until now.
fn robot_mode(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let known = Mode::ALL.iter().map(|(name, _)| *name);
    let mode = find("a robot", &args[0], known)?;
    let mode = if ctx.is_projected() { Mode::Projected } else { Mode::ALL[mode].1 };
    let last = std::mem::replace(&mut world(ctx)?.mode, mode);
    Ok(symbol(last.name()).into())
}

// ---------------------------------------------------------------------------------------------
// Questions

fn robot_arms(ctx: &mut Ctx<'_>) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let arms = it.state.machine().map_or(&[][..], |it| &it.limbs.arms);
    Ok(names(arms.iter().map(|it| it.name.as_str())).into())
}

fn park_position(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let arm = arm(&it.state, &args[0])?;
    let park = it.state.machine().map_or(&[][..], |it| &it.limbs.arms[arm].park);
    Ok(Value::list(park.iter().copied().map(Value::float).collect::<Vec<_>>()).into())
}

fn joint_position(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let Some(machine) = it.state.machine() else {
        return Err(range_error("there is no robot in this world", &args[0]));
    };
    let robot = &machine.robot;
    let joints = robot.joints().iter().map(|it| it.name.as_str());
    let at = find("a joint", &args[0], joints)?;
    let variable = robot.variable(&robot.joints()[at].name);
    let position = variable.and_then(|id| it.state.joints.get(id.index())).copied();
    Ok(position.map_or(Value::NIL, Value::float).into())
}

fn torso_range(ctx: &mut Ctx<'_>) -> Result<Next, Raise> {
    let state = &world(ctx)?.state;
    let Some((machine, torso)) = state.machine().and_then(|it| Some((it, it.limbs.torso?))) else {
        return Ok(Value::NIL.into());
    };
    let at = state.joints.get(torso.index()).copied().unwrap_or_default();
    let (low, high) = machine.robot.variables()[torso.index()].limits.unwrap_or((at, at));
    Ok(Value::list([low, high, at].map(Value::float)).into())
}

fn believed_pose(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let object = object(&it.state, &args[0])?;
    Ok(believed(it, object).map_or(Value::NIL, pose_value).into())
}

/// What a hand holds is where the hand is; the robot feels that.
fn believed(it: &World, object: ObjectId) -> Option<Isometry3<f64>> {
    match it.state.ground_of(object) {
        Support::Hand(_) => Some(it.state.object_pose(object)),
        _ => it.belief.seen.get(&object).map(|sight| sight.pose),
    }
}

fn seen_at(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let object = object(&it.state, &args[0])?;
    Ok(it.belief.seen.get(&object).map_or(Value::NIL, |sight| Value::float(sight.at_s)).into())
}

pub(crate) fn object_type(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let object = object(&it.state, &args[0])?;
    Ok(symbol(&it.state.setting.scene.kind_of(object).name).into())
}

fn where_is(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let object = object(&it.state, &args[0])?;
    let on = it.state.objects.get(&object).map_or(Support::Floor, |place| place.on);
    Ok(symbol(&it.state.support_name(on)).into())
}

/// The objects right on a surface or on another object.
pub(crate) fn objects_on(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let support = match surface(&it.state, &args[0]) {
        Ok(surface) => Support::Surface(surface),
        Err(why) => Support::Object(object(&it.state, &args[0]).map_err(|_| why)?),
    };
    let there = it.state.objects.iter().filter(|(_, place)| place.on == support);
    Ok(names(there.map(|(object, _)| it.state.setting.scene.objects[object.0].name.as_str())).into())
}

fn held_by(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let scene = &it.state.setting.scene;
    Ok(match it.state.hands.get(&arm(&it.state, &args[0])?) {
        None => Value::NIL,
        Some(Grip::Object(object, _)) => symbol(&scene.objects[object.0].name),
        Some(Grip::Handle(container)) => symbol(&scene.containers[container.0].name),
    }
    .into())
}

fn height_above_ground(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let object = object(&it.state, &args[0])?;
    Ok(Value::float(it.state.setting.scene.kind_of(object).height_above_ground_m()).into())
}

/// The grasps of an object that is at a pose: maps with `:side` and `:hands`, for each hand the poses of
/// its tool before, at the object, and lifted.
fn grasps(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let object = object(&it.state, &args[0])?;
    let at = match args.get(1).filter(|it| !it.is_nil()) {
        Some(given) => pose(given)?,
        None => match believed(it, object) {
            Some(pose) => pose,
            None => {
                let name = &it.state.setting.scene.objects[object.0].name;
                let message = format!("nobody knows where `{name}` is: it has not been seen; give a pose");
                return Err(range_error(message, &args[0]));
            }
        },
    };
    let all = it.state.setting.scene.kind_of(object).grasps.iter().map(|grasp| {
        let ways = |tool: &Isometry3<f64>| {
            let tool = at * tool;
            Value::list([back(&tool, grasp.pre_m), tool, lifted(&tool, grasp.lift_m)].map(pose_value))
        };
        let hands = match &grasp.hands {
            Hands::One(tool) => vec![ways(tool)],
            Hands::Two(left, right) => vec![ways(left), ways(right)],
        };
        map([
            ("side", symbol(grasp.side.name())),
            ("hands", Value::list(hands)),
            ("width", Value::float(grasp.width_m)),
        ])
    });
    Ok(Value::list(all.collect::<Vec<_>>()).into())
}

pub(crate) fn map<const N: usize>(entries: [(&str, Value); N]) -> Value {
    Value::map(entries.into_iter().map(|(key, value)| (Value::keyword(key), value)).collect::<Map>())
}

/// Poses of a tool before a handle and at it.
fn handle_ways(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let id = container(&it.state, &args[0])?;
    let handle = it.state.setting.container(id).handle;
    let position = match args.get(1).filter(|it| !it.is_nil()) {
        Some(position) => finite(position)?,
        None => it.state.opening(id),
    };
    let about_bar = match args.get(2).filter(|it| !it.is_nil()) {
        Some(turn) => finite(turn)?,
        None => 0.0,
    };
    let held = Translation3::from(handle.tool.translation.vector);
    let turned = held * turn(&handle.bar, about_bar) * held.inverse() * handle.tool;
    let tool = it.state.setting.container_pose(id, position) * turned;
    Ok(Value::list([back(&tool, crate::scene::grasp::PRE_GRASP_M), tool].map(pose_value)).into())
}

/// Where the tool of an arm is when the object in its hand is at a pose.
fn tool_to_put(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let it = world(ctx)?;
    let arm = arm(&it.state, &args[0])?;
    match it.state.hands.get(&arm) {
        Some(Grip::Object(_, in_tool)) => pose_next(pose(&args[1])? * in_tool.inverse()),
        _ => {
            let name = it.state.support_name(Support::Hand(arm));
            let trouble =
                Trouble::new("hand-empty", format!("the hand `{name}` holds no object")).name("arm", name);
            Err(raise(ctx, &trouble))
        }
    }
}

fn costs(ctx: &mut Ctx<'_>, _args: &[Value]) -> Result<Next, Raise> {
    let costs = world(ctx)?.costs;
    Ok(map([
        ("path-m", Value::float(costs.path_m)),
        ("straight-m", Value::float(costs.straight_m)),
        ("hand-m", Value::float(costs.hand_m)),
        ("actions", Value::int(costs.actions as i64)),
        ("leaps", Value::int(costs.leaps as i64)),
    ])
    .into())
}
