//! A recording as JSON, for viewers: `pleach run … --record FILE.json`.
//!
//! The format is described in `REFERENCE.md`; [`VERSION`] grows when a reader of the old one would go wrong.
//! Numbers are rounded to micrometres and microradians, so that files are small and can be compared.

use nalgebra::{Isometry3, Vector3};
use serde_json::{Map, Value as Json, json};

use crate::motions::hand::Target;
use crate::robot::model::JointKind;
use crate::robot::{Robot, VariableId};
use crate::scene::{ContainerId, Hinge, Scene};
use crate::setting::Machine;
use crate::shape::{PosedShape, Shape};
use crate::state::{Grip, State, Support};
use crate::world::{Motion, Wanted};

use super::{Done, End, Episode, Recording, seconds};

/// The version of the format.
pub const VERSION: u64 = 1;

/// Values below this depth stand on one line.
const LINES_TO: usize = 4;

impl Recording {
    /// As JSON. `about`: what else is said at its head; `end_ns`: when the run ended.
    #[must_use]
    pub fn json(&self, about: Map<String, Json>, end_ns: u64) -> String {
        let mut all = Map::new();
        all.insert("pleach-record".into(), json!(VERSION));
        all.extend(about);
        all.insert("end".into(), number(seconds(end_ns)));
        all.insert("episodes".into(), self.episodes().map(episode).collect());
        let mut text = String::new();
        write(&mut text, &Json::Object(all), 0);
        text.push('\n');
        text
    }
}

/// Outer values over several lines, so that a person finds something and tools compare line by line.
fn write(text: &mut String, value: &Json, depth: usize) {
    let line = |text: &mut String, depth: usize| {
        text.push('\n');
        text.push_str(&"  ".repeat(depth));
    };
    match value {
        Json::Object(entries) if depth < LINES_TO && !entries.is_empty() => {
            text.push('{');
            for (number, (key, value)) in entries.iter().enumerate() {
                text.push_str(if number > 0 { "," } else { "" });
                line(text, depth + 1);
                text.push_str(&format!("{}: ", json!(key)));
                write(text, value, depth + 1);
            }
            line(text, depth);
            text.push('}');
        }
        Json::Array(items) if depth < LINES_TO && !items.is_empty() => {
            text.push('[');
            for (number, item) in items.iter().enumerate() {
                text.push_str(if number > 0 { "," } else { "" });
                line(text, depth + 1);
                write(text, item, if depth == 1 { depth + 1 } else { LINES_TO });
            }
            line(text, depth);
            text.push(']');
        }
        _ => text.push_str(&value.to_string()),
    }
}

// ---------------------------------------------------------------------------------------------
// Numbers

/// Rounded to six digits; zero has no sign.
fn rounded(number: f64) -> f64 {
    libm::round(number * 1e6) / 1e6 + 0.0
}

pub(super) fn number(number: f64) -> Json {
    json!(rounded(number))
}

pub(super) fn pose_numbers(pose: &Isometry3<f64>) -> [f64; 7] {
    let (t, q) = (pose.translation, pose.rotation);
    [t.x, t.y, t.z, q.i, q.j, q.k, q.w].map(rounded)
}

pub(super) fn pose(pose: &Isometry3<f64>) -> Json {
    json!(pose_numbers(pose))
}

fn vector(vector: &Vector3<f64>) -> Json {
    json!([vector.x, vector.y, vector.z].map(rounded))
}

pub(super) fn named<T>(items: impl Iterator<Item = (String, T)>, value: impl Fn(T) -> Json) -> Json {
    Json::Object(items.map(|(name, it)| (name, value(it))).collect())
}

// ---------------------------------------------------------------------------------------------
// An episode

fn episode(it: &Episode) -> Json {
    let (start, scene) = (&it.start, &it.start.setting.scene);
    let objects = it.objects();
    let mut json = json!({
        "begin": number(seconds(it.began_ns)),
        "scene": scene_json(scene),
        "robot": start.machine().map(|machine| robot(&machine.robot)),
        "arms": start.machine().map_or_else(|| json!([]), arms),
        "start": start_json(start),
    });
    json["motions"] = it.motions().iter().map(|(done, end_ns)| motion(start, done, *end_ns)).collect();
    json["objects"] = objects
        .iter()
        .map(|(object, track)| {
            let at = |seen: &super::Seen| {
                json!({"at": number(seconds(seen.at_ns)), "on": start.support_name(seen.place.on), "pose": pose(&seen.pose)})
            };
            let it = &scene.objects[object.0];
            json!({"name": it.name, "type": scene.kind_of(*object).name, "poses": track.iter().map(at).collect::<Vec<_>>()})
        })
        .collect();
    json["hands"] = hands(it);
    json["put"] = put(it);
    json
}

/// What hands hold, at each change.
fn hands(it: &Episode) -> Json {
    let mut changes = Vec::new();
    let mut last = it.start.hands.clone();
    for step in &it.steps {
        if step.after.hands != last {
            last = step.after.hands.clone();
            changes.push(json!({"at": number(seconds(step.at_ns)), "hold": held(&step.after)}));
        }
    }
    json!(changes)
}

/// What hands hold.
pub(super) fn held(state: &State) -> Json {
    let held = state.hands.iter().map(|(arm, grip)| (state.support_name(Support::Hand(*arm)), *grip));
    named(held, |grip| match grip {
        Grip::Object(object, _) => json!(state.setting.scene.objects[object.0].name),
        Grip::Handle(container) => json!(state.setting.container(container).name),
    })
}

/// Changes that no motion made.
fn put(it: &Episode) -> Json {
    let steps = it.steps.iter().filter(|step| step.done.is_none());
    steps.map(|step| number(seconds(step.at_ns))).collect()
}

fn start_json(state: &State) -> Json {
    let joints = state.machine().map_or_else(|| json!({}), |machine| joints(state, &machine.robot));
    json!({"base": pose(&state.base), "joints": joints, "containers": openings(state)})
}

/// The configuration of a robot.
pub(super) fn joints(state: &State, robot: &Robot) -> Json {
    let values = robot.variables().iter().zip(state.joints.iter());
    named(values.map(|(it, value)| (joint_name(robot, it.joint.0), *value)), number)
}

pub(super) fn openings(state: &State) -> Json {
    let all = (0..state.setting.scene.containers.len()).map(ContainerId);
    named(all.map(|id| (state.setting.container(id).name.clone(), id)), |id| number(state.opening(id)))
}

fn joint_name(robot: &Robot, joint: usize) -> String {
    robot.joints()[joint].name.clone()
}

// ---------------------------------------------------------------------------------------------
// Scene and robot

fn shapes(shapes: &[PosedShape]) -> Json {
    let shape = |it: &PosedShape| {
        let mut json = match it.shape {
            Shape::Box { size } => json!({"box": vector(&size)}),
            Shape::Cylinder { radius, length } => json!({"cylinder": [rounded(radius), rounded(length)]}),
            Shape::Sphere { radius } => json!({"sphere": number(radius)}),
            Shape::Capsule { radius, length } => json!({"capsule": [rounded(radius), rounded(length)]}),
        };
        json["pose"] = pose(&it.pose);
        json
    };
    shapes.iter().map(shape).collect()
}

fn scene_json(scene: &Scene) -> Json {
    let fixture = |it: &crate::scene::Fixture| json!({"name": it.name, "pose": pose(&it.pose), "shapes": shapes(&it.shapes)});
    let container = |it: &crate::scene::Container| {
        let joint = match it.joint {
            Hinge::Turn { at, axis } => json!({"turn": vector(&axis), "through": vector(&at)}),
            Hinge::Slide { along } => json!({"slide": vector(&along)}),
        };
        json!({"name": it.name, "part-of": scene.fixtures[it.owner.0].name, "joint": joint, "open": number(it.open), "shapes": shapes(&it.shapes)})
    };
    let surface = |it: &crate::scene::Surface| {
        let container = |id: Option<ContainerId>| id.map(|id| scene.containers[id.0].name.clone());
        json!({"name": it.name, "part-of": scene.fixtures[it.owner.0].name, "moves-with": container(it.moves_with), "inside": container(it.inside),
               "pose": pose(&it.pose), "size": it.size.map(rounded)})
    };
    let used: Vec<usize> =
        (0..scene.kinds.len()).filter(|kind| scene.objects.iter().any(|it| it.kind.0 == *kind)).collect();
    let kinds = used.iter().map(|kind| &scene.kinds[*kind]);
    json!({
        "fixtures": scene.fixtures.iter().map(fixture).collect::<Vec<_>>(),
        "containers": scene.containers.iter().map(container).collect::<Vec<_>>(),
        "surfaces": scene.surfaces.iter().map(surface).collect::<Vec<_>>(),
        "types": kinds.map(|it| json!({"name": it.name, "shapes": shapes(&it.shapes)})).collect::<Vec<_>>(),
    })
}

fn robot(robot: &Robot) -> Json {
    let link = |id: crate::robot::LinkId| {
        let it = &robot.links()[id.index()];
        let joint = robot.joint_of(id).map(|joint| {
            let kind = match joint.kind {
                JointKind::Fixed => "fixed",
                JointKind::Revolute | JointKind::Continuous => "turn",
                JointKind::Prismatic => "slide",
            };
            let mut json = json!({"name": joint.name, "kind": kind, "origin": pose(&joint.origin)});
            if let Some(drive) = joint.drive {
                json["axis"] = vector(&joint.axis);
                let of = robot.variables()[drive.variable.index()].joint;
                json["follows"] =
                    json!([joint_name(robot, of.0), rounded(drive.multiplier), rounded(drive.offset)]);
            }
            json
        });
        json!({"name": it.name, "parent": it.parent.map(|it| robot.link_name(it)), "joint": joint, "shapes": shapes(&it.shapes)})
    };
    json!({"name": robot.name, "links": robot.link_ids().map(link).collect::<Vec<_>>()})
}

fn arms(machine: &Machine) -> Json {
    let arm = |it: &crate::robot::chain::Arm| json!({"name": it.name, "tool": machine.robot.link_name(it.chain.tip())});
    machine.limbs.arms.iter().map(arm).collect()
}

// ---------------------------------------------------------------------------------------------
// A motion

fn motion(state: &State, done: &Done, end_ns: u64) -> Json {
    let mut json = json!({"motion": name(&done.motion), "begin": number(seconds(done.began_ns)), "end": number(seconds(end_ns))});
    json["outcome"] = json!(match done.end {
        End::Succeeded(_) => "succeeded",
        End::Failed(_) => "failed",
        End::Stopped => "stopped",
    });
    if let End::Failed(trouble) = &done.end {
        json["failure"] = json!({"type": trouble.kind, "message": trouble.message});
    }
    json["wanted"] = wanted(state, &done.motion);
    if let (Motion::Detecting(_), End::Succeeded(seen)) = (&done.motion, &done.end) {
        json["seen"] = seen.iter().map(|it| json!(state.setting.scene.objects[it.0].name)).collect();
    }
    let costs = &done.costs;
    json["costs"] =
        json!({"path-m": number(costs.path_m), "hand-m": number(costs.hand_m), "leaps": costs.leaps});
    json["keys"] = keys(state, done, seconds(end_ns - done.began_ns));
    json
}

/// The keys up to the end; where a motion was stopped in between, one at that moment.
fn keys(state: &State, done: &Done, lasted_s: f64) -> Json {
    let Some(machine) = state.machine() else { return json!([]) };
    let name = |id: &VariableId| joint_name(&machine.robot, machine.robot.variables()[id.index()].joint.0);
    let key = |key: &crate::motions::Key| {
        let mut json = json!({"at": number(seconds(done.began_ns) + key.at_s)});
        if let Some(base) = &key.base {
            json["base"] = pose(base);
        }
        if !key.joints.is_empty() {
            json["joints"] = named(key.joints.iter().map(|(id, value)| (name(id), value)), |it| number(*it));
        }
        if let Some((container, position)) = key.opening {
            json["containers"] = json!({state.setting.container(container).name.as_str(): rounded(position)});
        }
        json
    };
    done.track.until(lasted_s).iter().map(key).collect()
}

/// What plans call a motion.
pub(super) fn name(motion: &Motion) -> &'static str {
    match motion {
        Motion::Going(_) => "going",
        Motion::MovingTorso(_) => "moving-torso",
        Motion::Looking(_) => "looking",
        Motion::MovingArmJoints(_) => "moving-arm-joints",
        Motion::MovingTcp(..) => "moving-tcp",
        Motion::Gripping(..) => "gripping",
        Motion::Releasing(_) => "releasing",
        Motion::MovingContainer(_, _, Some(0.0)) => "closing",
        Motion::MovingContainer(..) => "opening",
        Motion::Detecting(_) => "detecting",
    }
}

fn wanted(state: &State, motion: &Motion) -> Json {
    let scene = &state.setting.scene;
    let arm = |arm: usize| state.support_name(Support::Hand(arm));
    let arms = |arms: &[usize]| arms.iter().map(|it| arm(*it)).collect::<Vec<_>>();
    match motion {
        Motion::Going(places) => {
            json!({"poses": places.iter().map(|it| pose(&it.pose())).collect::<Vec<_>>()})
        }
        Motion::MovingTorso(position) => json!({"position": number(*position)}),
        Motion::Looking(at) => json!({"at": vector(at)}),
        Motion::MovingArmJoints(all) => {
            let numbers = |values: &Vec<f64>| values.iter().map(|it| number(*it)).collect();
            json!({"positions": named(all.iter().map(|(it, values)| (arm(*it), values)), numbers)})
        }
        Motion::MovingTcp(ways, _) => {
            let vias = |vias: &Vec<Isometry3<f64>>| vias.iter().map(pose).collect();
            json!({"vias": named(ways.iter().map(|way| (arm(way.arm), &way.vias)), vias)})
        }
        Motion::Gripping(which, Target::Object(object)) => {
            json!({"arms": arms(which), "object": scene.objects[object.0].name})
        }
        Motion::Gripping(which, Target::Handle(container)) => {
            json!({"arms": arms(which), "container": scene.containers[container.0].name})
        }
        Motion::Releasing(which) => json!({"arms": arms(which)}),
        Motion::MovingContainer(which, container, to) => {
            json!({"arms": [arm(*which)], "container": scene.containers[container.0].name, "position": to.map(rounded)})
        }
        Motion::Detecting(Wanted::Any) => json!({}),
        Motion::Detecting(Wanted::Kind(kind)) => json!({"type": kind}),
        Motion::Detecting(Wanted::Object(object)) => json!({"object": scene.objects[object.0].name}),
    }
}
