//! Motions tried in the robot's mind: would that work from there?
//!
//! A plan asks this of several ways to do one thing before it begins: the same motions, the same geometry, in
//! the world as the robot believes it to be. Nothing changes, no time passes, no task is made.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::motions::base::{blocker_name, blocker_of};
use crate::motions::view::View;
use crate::motions::{MODEL, Trouble, machine};
use crate::scene::ObjectId;
use crate::shape::{PosedShape, Shape};
use crate::state::State;
use crate::world::{Ended, Motion, World};

/// The motions do not draw errors that matter to a rehearsal: all of them draw the same, and what the world has of noise
/// the robot does not know.
const SEED: u64 = 0;

/// The state with the base elsewhere.
#[must_use]
pub fn moved(state: &State, base: &Isometry3<f64>) -> State {
    State { base: *base, ..state.clone() }
}

/// Whether motions succeed, one after the other, and leave the base where it can drive off; else why not.
///
/// # Errors
/// The first failure.
pub fn rehearse(state: &State, truth: &State, motions: &[Motion], now_ns: u64) -> Result<(), Trouble> {
    within_reach(state, motions)?;
    let mut world = World::new(state.clone());
    world.hasty = true;
    let mut now_ns = now_ns;
    for motion in motions {
        let (number, seconds) = world.begin(motion, now_ns, SEED);
        now_ns += (seconds * 1e9) as u64 + 1;
        world.end(number, now_ns);
        if let Some(Ended::Failed(trouble)) = world.take_end(number) {
            return Err(trouble);
        }
    }
    can_drive_off(world.state, truth)
}

/// With its arms as they are then, and with what they hold, the base must touch nothing where it stands. What is in
/// its way it sees, as it does when it drives: objects that it has not looked at stand there all the same.
fn can_drive_off(mut state: State, truth: &State) -> Result<(), Trouble> {
    for (object, place) in &truth.objects {
        if !state.objects.contains_key(object) {
            state.objects.insert(*object, *place);
        }
    }
    let state = &state;
    let Some(blocker) = blocker_of(state) else { return Ok(()) };
    let by = blocker_name(state, &blocker);
    let message = format!("the base could not drive off after that: `{by}` is in the way");
    Err(Trouble::new("base-goal-in-collision", message).pose("goal", state.base).name("by", by))
}

/// Most ways fail because something is too far away. That is seen without looking at ways: are there configurations
/// for the poses at all? The torso, if it moves first, moves first here, too.
fn within_reach(state: &State, motions: &[Motion]) -> Result<(), Trouble> {
    let machine = machine(state)?;
    let mut joints = state.joints.to_vec();
    for motion in motions {
        match motion {
            Motion::MovingTorso(position) => {
                if let Some(torso) = machine.limbs.torso {
                    joints[torso.index()] = *position;
                }
            }
            Motion::MovingTcp(ways, _) => {
                for way in ways {
                    let Some(solver) = machine.solvers.get(way.arm) else { continue };
                    let in_root = machine.robot.link_in_root(solver.chain().base(), &joints);
                    let into_base = (state.base * in_root).inverse();
                    let mut out = solver.chain().pick(&joints);
                    for via in &way.vias {
                        let seed = out.clone();
                        if let Err(why) = solver.solve(&(into_base * via), &seed, SEED, &mut out) {
                            let name = &machine.limbs.arms[way.arm].name;
                            let message = format!("the arm `{name}` does not get there: {why}");
                            return Err(Trouble::new("arm-goal-unreachable", message)
                                .name("arm", name)
                                .pose("goal", *via));
                        }
                    }
                }
            }
            _ => {}
        }
    }
    Ok(())
}

/// Half the edge of the small body that stands for a point, metres.
const SPOT_M: f64 = 0.01;

/// How many of the points the camera would see when the head looks at their middle.
///
/// # Errors
/// There is no robot, or it has no camera.
pub fn seen(state: &State, points: &[Vector3<f64>]) -> Result<usize, Trouble> {
    let middle = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let (turned, camera) = looking_at(state, &middle)?;
    let view = View::new(&turned);
    let spot = [PosedShape {
        pose: Isometry3::identity(),
        shape: Shape::Box { size: Vector3::repeat(2.0 * SPOT_M) },
    }];
    let is_seen = |point: &&Vector3<f64>| {
        let pose = Isometry3::translation(point.x, point.y, point.z + SPOT_M);
        view.sight_of(&pose, &spot, &camera).visible > 0.5
    };
    Ok(points.iter().filter(is_seen).count())
}

/// Whether the camera would see enough of an object when the head looks at it.
///
/// # Errors
/// There is no robot, or it has no camera.
pub fn sees(state: &State, object: ObjectId) -> Result<bool, Trouble> {
    let (turned, camera) = looking_at(state, &state.object_pose(object).translation.vector)?;
    Ok(View::new(&turned).sight(object, &camera).visible >= MODEL.visible_share)
}

/// The state with the head turned to a point as far as it goes, and the frame of its camera then.
fn looking_at(state: &State, point: &Vector3<f64>) -> Result<(State, Isometry3<f64>), Trouble> {
    let machine = machine(state)?;
    let Some(head) = &machine.limbs.head else {
        return Err(Trouble::new("object-not-found", "this robot has no camera"));
    };
    let look = machine.robot.look_at(head, &state.base, &state.joints, &Point3::from(*point));
    let look = look.unwrap_or_else(|far| far.best);
    let mut turned = state.clone();
    turned.set_joints(&[(head.pan, look.pan), (head.tilt, look.tilt)]);
    let camera = turned.links().get(head.camera.index()).copied().unwrap_or_default();
    Ok((turned, camera))
}
