//! The simulated robot: what becomes of a motion, and of the things near it, when rapier steps it.
//!
//! A motion is computed as in projection first: that says where joints, base and doors should be over time, and what is
//! impossible. Then the robot goes along that track as controllers do, a little late and a little beside it;
//! it is kinematic, nothing holds it up. What could be touched is dynamic: objects in hands, on trays, in drawers
//! that move, and all that is near the way. A hand holds by friction: a spring at the tool whose
//! force ends where friction does. More slides through the fingers, much more falls out.
//! When the time of the motion is over, what still moves comes to rest, so between two motions nothing moves and the
//! state is the truth, as in projection; what it takes to rest is not in the clock.
//!
//! Not simulated: fingers do not push what they are about to close around, motions of several parts at
//! once do not feel each other, and doors move with the hand.
//!
//! Invariants
//! 1. The same state, outcome and seed give the same bits.
//! 2. At most [`MAX_STEPS`] steps: motions that take longer go faster.

use nalgebra::{Isometry3, Translation3, Vector3};
use rapier3d::prelude::*;

use crate::parry::{Solid, pose as parry_pose};
use crate::robot::model::LinkId;
use crate::robot::path::between;
use crate::scene::{ContainerId, ObjectId};
use crate::setting::Machine;
use crate::shape::PosedShape;
use crate::state::{Grip, State, Support, fingers};

use super::hand::nearest_grasp;
use super::physics::{Physics, WOOD};
use super::settle::{ground, judge};
use super::{Draws, Event, MODEL, Outcome, Trouble};

/// Seconds of a step.
const STEP_S: f32 = 1.0 / 120.0;
/// Steps of a motion at most: two minutes.
const MAX_STEPS: usize = 14_400;
/// Steps to come to rest: at least until the robot has arrived, at most three seconds.
const LEAST_REST: usize = 96;
const MOST_REST: usize = 360;
/// What counts as rest, m/s and rad/s; so many steps in a row.
const REST: f32 = 0.01;
const REST_STEPS: usize = 10;
/// Controllers follow with two delays of this length, seconds: those of a heavy base, and of joints.
const BASE_DELAY_S: f64 = 0.1;
const JOINT_DELAY_S: f64 = 0.03;
/// Objects are dynamic that are this near to where something moves, metres; the others that stand this near to those stay where
/// they are.
const TOUCHED_M: f64 = 0.03;
const NEAR_M: f64 = 0.5;
/// The way of the robot is looked at so often to find what is near it.
const LOOKS: usize = 60;
/// A finger is in an object that is deeper below its surface than this, metres.
const INSIDE_M: f64 = 0.0005;
/// The spring of a grip, per unit of mass: it gives way by a tenth of a millimetre under an object's own weight.
const STIFFNESS: f32 = 1.0e5;
const DAMPING: f32 = 1.0e3;
/// Fingertips are so large that they hold a moment with this lever, metres.
const LEVER_M: f64 = 0.03;
/// What has moved less has not moved, metres and radians.
const SAME_M: f64 = 0.0005;
const SAME_RAD: f64 = 0.005;

/// What the simulation made of a motion.
#[derive(Default)]
pub(crate) struct Simulated {
    /// Where things are, at once after the track has been played.
    pub events: Vec<Event>,
    /// Joints that are not quite where they should be.
    pub joints: Vec<(crate::robot::model::VariableId, f64)>,
    /// How it failed.
    pub trouble: Option<Trouble>,
}

/// Steps a motion for `lasted_s` from `before`; `after`: what the track makes of that state.
pub(crate) fn simulate(
    before: &State,
    after: &State,
    outcome: &Outcome,
    lasted_s: f64,
    draws: &mut Draws,
) -> Simulated {
    let Some(machine) = before.machine() else { return Simulated::default() };
    let joints = errors(machine, outcome, after, draws);
    let mut bench = Bench::new(before, machine, outcome, lasted_s, draws);
    if bench.bodies_of_objects.is_empty() {
        return Simulated { joints, ..Simulated::default() };
    }
    bench.run(outcome, lasted_s);
    bench.judge(after, outcome, joints)
}

/// Joints of arms stop a little beside their goals.
fn errors(
    machine: &Machine,
    outcome: &Outcome,
    after: &State,
    draws: &mut Draws,
) -> Vec<(crate::robot::model::VariableId, f64)> {
    let Some(key) = outcome.track.keys.last() else { return Vec::new() };
    let of_arms: Vec<_> = machine.limbs.arms.iter().flat_map(|arm| arm.chain.variables()).collect();
    let mut joints = Vec::new();
    for (id, _) in key.joints.iter().filter(|(id, _)| of_arms.contains(&id)) {
        let error = draws.small_error(MODEL.joint_rad);
        let (low, high) =
            machine.robot.variables()[id.index()].limits.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        let at = after.joints.get(id.index()).copied().unwrap_or(0.0);
        joints.push((*id, (at + error).clamp(low, high)));
    }
    joints
}

/// An object that the simulation moves.
struct Loose {
    object: ObjectId,
    body: RigidBodyHandle,
    friction: f64,
}

/// A hand on an object.
struct Held {
    arm: usize,
    object: ObjectId,
    joint: ImpulseJointHandle,
    /// The object's pose in the tool when it was taken.
    in_tool: Isometry3<f64>,
}

/// Bodies around the place where the base was, and how the robot moves among them.
struct Bench<'a> {
    machine: &'a Machine,
    before: &'a State,
    physics: Physics,
    /// Links with a body.
    links: Vec<(LinkId, RigidBodyHandle)>,
    /// The tools: bodies without shapes that grips hang on.
    tools: Vec<RigidBodyHandle>,
    door: Option<(ContainerId, RigidBodyHandle)>,
    bodies_of_objects: Vec<Loose>,
    held: Vec<Held>,
    /// Objects that hands have lost.
    lost: Vec<(usize, ObjectId)>,
    /// The robot as it goes: the first and the second delay, and what it should do.
    follows: [State; 2],
}

/// Bits of what a collider is.
const THINGS: u32 = 1;
const ROBOT: u32 = 2;

/// Fingers of an arm; robots with more arms share the last one.
fn hand_bit(arm: usize) -> u32 {
    4 << arm.min(20)
}

fn groups(member: u32, meets: u32) -> InteractionGroups {
    InteractionGroups::new(
        Group::from_bits_truncate(member),
        Group::from_bits_truncate(meets),
        InteractionTestMode::And,
    )
}

impl<'a> Bench<'a> {
    fn new(
        before: &'a State,
        machine: &'a Machine,
        outcome: &Outcome,
        lasted_s: f64,
        draws: &mut Draws,
    ) -> Bench<'a> {
        let at = before.base.translation.vector;
        let mut bench = Bench {
            machine,
            before,
            physics: Physics::new(Translation3::new(-at.x, -at.y, 0.0), STEP_S),
            links: Vec::new(),
            tools: Vec::new(),
            door: None,
            bodies_of_objects: Vec::new(),
            held: Vec::new(),
            lost: Vec::new(),
            follows: [before.clone(), before.clone()],
        };
        let sweep = Sweep::new(before, machine, outcome, lasted_s);
        let loose = bench.loose(&sweep, outcome);
        if loose.is_empty() {
            return bench;
        }
        let near: Vec<Bounds> = loose
            .iter()
            .map(|object| bounds_of(before, *object).wider(NEAR_M))
            .chain([sweep.carried])
            .collect();
        bench.stand(&loose, &near, outcome);
        bench.robot(&near, &sweep);
        for object in loose {
            let friction = before.setting.scene.kind_of(object).friction
                * (1.0 + draws.error(MODEL.friction_share)).max(0.1);
            bench.drop_in(object, friction, outcome);
        }
        for (arm, grip) in &before.hands {
            if let Grip::Object(object, _) = grip {
                bench.hold(*arm, *object);
            }
        }
        bench
    }

    /// What moves, or may be moved.
    fn loose(&self, sweep: &Sweep, outcome: &Outcome) -> Vec<ObjectId> {
        let state = self.before;
        let released = |object: ObjectId| {
            outcome
                .track
                .events
                .iter()
                .any(|(_, event)| matches!(event, Event::Put(put, ..) if *put == object))
        };
        let moving_door = opens(outcome);
        let is_loose = |object: &ObjectId| {
            let carried = matches!(state.ground_of(*object), Support::Hand(_));
            let pulled = moving_door.is_some() && state.drawer_of(*object) == moving_door;
            (carried && sweep.moves) || pulled || released(*object) || {
                let near = bounds_of(state, *object).wider(TOUCHED_M);
                !carried && sweep.looks.iter().flatten().any(|swept| swept.meets(&near))
            }
        };
        state.objects.keys().copied().filter(|object| is_loose(object)).collect()
    }

    fn stand(&mut self, loose: &[ObjectId], near: &[Bounds], outcome: &Outcome) {
        let state = self.before;
        let scene = &state.setting.scene;
        let moving = opens(outcome);
        let (physics, meet_all) = (&mut self.physics, groups(THINGS, u32::MAX));
        let mut stand = |pose: &Isometry3<f64>, shapes: &[PosedShape], friction: f64| {
            for shape in shapes {
                let bounds = Bounds::of(&PosedShape { pose: pose * shape.pose, shape: shape.shape });
                if near.iter().any(|it| it.over(&bounds)) {
                    physics.stand(pose, shape, friction, meet_all);
                }
            }
        };
        for fixture in &scene.fixtures {
            stand(&fixture.pose, &fixture.shapes, WOOD);
        }
        for (number, container) in scene.containers.iter().enumerate() {
            let id = ContainerId(number);
            if moving != Some(id) {
                stand(&state.setting.container_pose(id, state.opening(id)), &container.shapes, WOOD);
            }
        }
        for other in state.objects.keys().filter(|other| !loose.contains(other)) {
            let kind = scene.kind_of(*other);
            stand(&state.object_pose(*other), &kind.shapes, kind.friction);
        }
        let floor = crate::scene::boxed(Vector3::new(200.0, 200.0, 1.0), Vector3::new(0.0, 0.0, -0.5), 0.0);
        let at = state.base.translation;
        physics.stand(&Isometry3::translation(at.x, at.y, 0.0), &floor, WOOD, meet_all);
        if let Some(id) = moving {
            let pose = state.setting.container_pose(id, state.opening(id));
            let body = physics.lead(&pose, &scene.containers[id.0].shapes, meet_all);
            self.door = Some((id, body));
        }
    }

    /// Links that come near to something loose, and all tools.
    fn robot(&mut self, near: &[Bounds], sweep: &Sweep) {
        let poses = self.before.links();
        for (id, link) in self.machine.robot.link_ids().zip(self.machine.robot.links()) {
            let comes_near =
                near.iter().any(|it| sweep.boxes.get(id.index()).is_some_and(|swept| swept.meets(it)));
            if link.shapes.is_empty() || !comes_near {
                continue;
            }
            let of = |arm: &usize| fingers(self.machine, *arm).contains(&id);
            let hand = (0..self.machine.limbs.arms.len()).find(of);
            let body = self.physics.lead(
                &poses[id.index()],
                &link.shapes,
                groups(hand.map_or(ROBOT, hand_bit), u32::MAX),
            );
            self.links.push((id, body));
        }
        for arm in &self.machine.limbs.arms {
            let body = self.physics.lead(&poses[arm.chain.tip().index()], &[], groups(ROBOT, u32::MAX));
            self.tools.push(body);
        }
    }

    fn drop_in(&mut self, object: ObjectId, friction: f64, outcome: &Outcome) {
        let kind = self.before.setting.scene.kind_of(object);
        // Hands that hold it, or take or release it now, are inside of its outline; so are
        // fingers that a grasp has in a bowl.
        let taking = outcome.track.events.iter().flat_map(|(_, event)| match event {
            Event::Take(taken, arms) if *taken == object => arms.clone(),
            _ => Vec::new(),
        });
        let inside = (0..self.machine.limbs.arms.len()).filter(|arm| self.is_inside(*arm, object, outcome));
        let hands = taking.chain(self.before.holders(object)).chain(inside);
        let hands = hands.fold(0, |bits, arm| bits | hand_bit(arm));
        let body = self.physics.drop_in(kind, &self.before.object_pose(object), friction, |collider| {
            // The smoother of two things decides.
            let collider = collider.friction_combine_rule(CoefficientCombineRule::Min);
            collider.collision_groups(groups(THINGS, !hands))
        });
        self.bodies_of_objects.push(Loose { object, body, friction });
    }

    /// True if fingers begin or end in an object where a grasp has them.
    fn is_inside(&self, arm: usize, object: ObjectId, outcome: &Outcome) -> bool {
        let mut after = self.before.clone();
        outcome.track.play_keys(&mut after, f64::INFINITY);
        let shapes = &self.before.setting.scene.kind_of(object).shapes;
        let core: Vec<Solid> = shapes
            .iter()
            .map(|it| Solid::new(&PosedShape { pose: it.pose, shape: it.shape.shrunk(INSIDE_M) }))
            .collect();
        let pose = self.before.object_pose(object);
        let links = self.machine.robot.links();
        let grasps = &self.before.setting.scene.kind_of(object).grasps;
        [self.before, &after].iter().any(|state| {
            let (_, off_m) = nearest_grasp(grasps, &pose, &[state.tool(arm)]);
            let poses = state.links();
            off_m <= 2.0 * MODEL.grasp_m
                && fingers(self.machine, arm).iter().any(|link| {
                    let mut of_link = links[link.index()].shapes.iter().map(Solid::new);
                    of_link
                        .any(|finger| core.iter().any(|it| it.touches(&pose, &finger, &poses[link.index()])))
                })
        })
    }

    fn loose_one(&self, object: ObjectId) -> Option<&Loose> {
        self.bodies_of_objects.iter().find(|it| it.object == object)
    }

    /// A hand closes around an object where both are.
    fn hold(&mut self, arm: usize, object: ObjectId) {
        let (Some(loose), Some(tool)) = (self.loose_one(object), self.tools.get(arm).copied()) else {
            return;
        };
        let (body, friction) = (loose.body, loose.friction);
        let in_tool = self.physics.pose_of(tool).inverse() * self.physics.pose_of(body);
        let force = (2.0 * friction * MODEL.grip_n) as f32;
        let mut joint = GenericJointBuilder::new(JointAxesMask::empty())
            .local_frame1(parry_pose(&in_tool))
            .local_frame2(Pose::IDENTITY)
            .contacts_enabled(false);
        for axis in [JointAxis::LinX, JointAxis::LinY, JointAxis::LinZ] {
            joint = joint.motor_position(axis, 0.0, STIFFNESS, DAMPING).motor_max_force(axis, force);
        }
        for axis in [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ] {
            let moment = force * LEVER_M as f32;
            joint = joint.motor_position(axis, 0.0, STIFFNESS, DAMPING).motor_max_force(axis, moment);
        }
        let joint = self.physics.world.impulse_joints.insert(tool, body, joint.build(), true);
        self.held.push(Held { arm, object, joint, in_tool });
    }

    fn let_go(&mut self, object: ObjectId, but: &[usize]) {
        let (keep, gone): (Vec<Held>, Vec<Held>) =
            self.held.drain(..).partition(|held| held.object != object || but.contains(&held.arm));
        self.held = keep;
        for held in gone {
            self.physics.world.impulse_joints.remove(held.joint, true);
        }
    }

    /// Through the time of the motion, and until all rests.
    fn run(&mut self, outcome: &Outcome, lasted_s: f64) {
        let lasted_s = lasted_s.min(outcome.duration_s);
        let steps = (libm::ceil(lasted_s / f64::from(STEP_S)) as usize).min(MAX_STEPS);
        let mut events = outcome.track.events.iter().filter(|(at, _)| *at <= lasted_s + 1e-9).peekable();
        let mut resting = 0;
        let step_s = lasted_s / steps.max(1) as f64;
        for step in 1..=steps + MOST_REST {
            let time_s = (step as f64 * step_s).min(lasted_s);
            while let Some((_, event)) = events.next_if(|(at, _)| step >= steps || *at <= time_s) {
                match event {
                    Event::Take(object, arms) => {
                        self.let_go(*object, arms);
                        for arm in arms {
                            if !self.held.iter().any(|it| it.object == *object && it.arm == *arm) {
                                self.hold(*arm, *object);
                            }
                        }
                    }
                    Event::Put(object, ..) => self.let_go(*object, &[]),
                    Event::Hold(..) | Event::Open(_) => {}
                }
            }
            self.follow(outcome, time_s);
            self.physics.world.step();
            self.slip();
            if step > steps + LEAST_REST {
                let still = |it: &Loose| self.physics.rests(it.body, REST);
                resting = if self.bodies_of_objects.iter().all(still) { resting + 1 } else { 0 };
                if resting >= REST_STEPS {
                    return;
                }
            }
        }
    }

    /// The robot goes where it should be at this time, a little late.
    fn follow(&mut self, outcome: &Outcome, time_s: f64) {
        let mut wanted = self.before.clone();
        outcome.track.play_keys(&mut wanted, time_s);
        let share = f64::from(STEP_S) / JOINT_DELAY_S;
        let mut target = wanted;
        for late in &mut self.follows {
            late.base = between(&late.base, &target.base, f64::from(STEP_S) / BASE_DELAY_S);
            let joints =
                late.joints.iter().zip(target.joints.iter()).map(|(from, to)| from + (to - from) * share);
            late.joints = joints.collect();
            if let Some((id, _)) = self.door {
                let (from, to) = (late.opening(id), target.opening(id));
                late.openings.insert(id, from + (to - from) * share);
            }
            target = late.clone();
        }
        let links = target.links();
        for (id, body) in &self.links {
            self.physics.go(*body, &links[id.index()]);
        }
        for (arm, body) in self.machine.limbs.arms.iter().zip(&self.tools) {
            self.physics.go(*body, &links[arm.chain.tip().index()]);
        }
        if let Some((id, body)) = self.door {
            self.physics.go(body, &target.setting.container_pose(id, target.opening(id)));
        }
    }

    /// What has slid too far through the fingers is not held any more.
    fn slip(&mut self) {
        let mut gone = Vec::new();
        for held in &self.held {
            let Some(loose) = self.loose_one(held.object) else { continue };
            let now = self.physics.pose_of(self.tools[held.arm]).inverse() * self.physics.pose_of(loose.body);
            let off_m = (now.translation.vector - held.in_tool.translation.vector).norm();
            if off_m > MODEL.grasp_m || now.rotation.angle_to(&held.in_tool.rotation) > MODEL.hold_rad {
                gone.push((held.arm, held.object));
            }
        }
        for (arm, object) in gone {
            self.let_go(object, &[]);
            if !self.lost.iter().any(|(_, other)| *other == object) {
                self.lost.push((arm, object));
            }
        }
    }

    // -------------------------------------------------------------- afterwards

    /// What of it is written into the state, and whether it is a failure.
    fn judge(
        &self,
        after: &State,
        outcome: &Outcome,
        joints: Vec<(crate::robot::model::VariableId, f64)>,
    ) -> Simulated {
        let mut simulated = Simulated { joints, ..Simulated::default() };
        let mut state = after.clone();
        state.set_joints(&simulated.joints);
        let mut all: Vec<(ObjectId, Isometry3<f64>)> =
            self.bodies_of_objects.iter().map(|it| (it.object, self.physics.pose_of(it.body))).collect();
        // What carries comes before what stands on it.
        all.sort_by(|a, b| a.1.translation.z.total_cmp(&b.1.translation.z).then(a.0.cmp(&b.0)));
        let (held, free): (Vec<_>, Vec<_>) =
            all.into_iter().partition(|(object, _)| self.held.iter().any(|it| it.object == *object));
        for (object, pose) in held {
            let arms: Vec<usize> =
                self.held.iter().filter(|it| it.object == object).map(|it| it.arm).collect();
            if !same(&state.object_pose(object), &pose) && pose_is_sound(&pose) {
                for event in [Event::Put(object, Support::Floor, pose), Event::Take(object, arms)] {
                    event.play(&mut state);
                    simulated.events.push(event);
                }
            }
        }
        for (object, pose) in free {
            let taken = self.lost.iter().any(|(_, it)| *it == object);
            if !pose_is_sound(&pose) || (!taken && same(&state.object_pose(object), &pose)) {
                continue;
            }
            let (on, pose) = ground(&state, object, &pose);
            let event = Event::Put(object, on, pose);
            event.play(&mut state);
            simulated.events.push(event);
        }
        simulated.trouble = self.trouble(&state, outcome);
        simulated
    }

    fn trouble(&self, state: &State, outcome: &Outcome) -> Option<Trouble> {
        if let Some((arm, object)) = self.lost.first() {
            let name = &state.setting.scene.objects[object.0].name;
            let arm = state.support_name(Support::Hand(*arm));
            let message = format!("`{name}` slipped out of the hand `{arm}`");
            return Some(Trouble::new("object-slipped", message).name("arm", arm).name("object", name));
        }
        outcome.track.events.iter().find_map(|(_, event)| {
            let Event::Put(object, ..) = event else { return None };
            let on = state.objects.get(object).map_or(Support::Floor, |place| place.on);
            judge(self.before, *object, &self.before.object_pose(*object), &state.object_pose(*object), on)
        })
    }
}

fn pose_is_sound(pose: &Isometry3<f64>) -> bool {
    pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|it| it.is_finite())
}

fn same(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    (a.translation.vector - b.translation.vector).norm() < SAME_M
        && a.rotation.angle_to(&b.rotation) < SAME_RAD
}

// ---------------------------------------------------------------------------------------------
// What is near

/// A box along the axes of the world.
#[derive(Clone, Copy)]
struct Bounds {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Bounds {
    const NONE: Bounds = Bounds {
        low: Vector3::new(f64::MAX, f64::MAX, f64::MAX),
        high: Vector3::new(f64::MIN, f64::MIN, f64::MIN),
    };

    fn of(posed: &PosedShape) -> Bounds {
        let (low, high) = posed.bounds();
        Bounds { low, high }
    }

    fn with(&self, other: &Bounds) -> Bounds {
        Bounds { low: self.low.inf(&other.low), high: self.high.sup(&other.high) }
    }

    fn near(&self, other: &Bounds) -> bool {
        (self.low - other.low).amax() < SAME_M && (self.high - other.high).amax() < SAME_M
    }

    fn wider(self, by_m: f64) -> Bounds {
        Bounds { low: self.low.add_scalar(-by_m), high: self.high.add_scalar(by_m) }
    }

    fn meets(&self, other: &Bounds) -> bool {
        (0..3).all(|axis| self.low[axis] <= other.high[axis] && other.low[axis] <= self.high[axis])
    }

    /// The same, but for how deep below it the other is.
    fn over(&self, other: &Bounds) -> bool {
        (0..2).all(|axis| self.low[axis] <= other.high[axis] && other.low[axis] <= self.high[axis])
            && other.low.z <= self.high.z
    }
}

fn bounds_of(state: &State, object: ObjectId) -> Bounds {
    let pose = state.object_pose(object);
    let shapes = &state.setting.scene.kind_of(object).shapes;
    let posed = shapes.iter().map(|it| PosedShape { pose: pose * it.pose, shape: it.shape });
    posed.fold(Bounds::NONE, |sum, it| sum.with(&Bounds::of(&it)))
}

/// What the robot's links, what they carry, and a moving door pass through.
struct Sweep {
    /// By the number of the link.
    boxes: Vec<Bounds>,
    /// The same from each look to the next, and after the links what is carried and the door; what does not move is left out.
    looks: Vec<Vec<Bounds>>,
    /// All that is carried, and around it.
    carried: Bounds,
    /// Something moves at all.
    moves: bool,
}

impl Sweep {
    fn new(before: &State, machine: &Machine, outcome: &Outcome, lasted_s: f64) -> Sweep {
        let lasted_s = lasted_s.min(outcome.duration_s);
        let at_look = |look: usize| {
            let mut state = before.clone();
            outcome.track.play_keys(&mut state, lasted_s * look as f64 / LOOKS as f64);
            boxes(&state, machine, outcome)
        };
        let all: Vec<Vec<Bounds>> = (0..=LOOKS).map(at_look).collect();
        let still: Vec<bool> = (0..all[0].len())
            .map(|number| all.iter().all(|look| look[number].near(&all[0][number])))
            .collect();
        let looks = all.windows(2).map(|pair| {
            let moving = pair[0].iter().zip(&pair[1]).zip(&still).filter(|(_, still)| !**still);
            moving.map(|((from, to), _)| from.with(to)).collect()
        });
        let links = machine.robot.links().len();
        let union = |number: usize| all.iter().fold(Bounds::NONE, |sum, look| sum.with(&look[number]));
        Sweep {
            looks: looks.collect(),
            boxes: (0..links).map(union).collect(),
            carried: union(links).wider(NEAR_M),
            moves: still.iter().any(|it| !it),
        }
    }
}

/// Around each link, around what is carried, around a moving door.
fn boxes(state: &State, machine: &Machine, outcome: &Outcome) -> Vec<Bounds> {
    let around = |pose: &Isometry3<f64>, shapes: &[PosedShape]| {
        let posed = shapes.iter().map(|it| PosedShape { pose: pose * it.pose, shape: it.shape });
        posed.fold(Bounds::NONE, |sum, it| sum.with(&Bounds::of(&it)))
    };
    let links = machine.robot.links().iter().zip(state.links());
    let mut boxes: Vec<Bounds> = links.map(|(link, pose)| around(&pose, &link.shapes)).collect();
    let carried = state.objects.keys().filter(|it| matches!(state.ground_of(**it), Support::Hand(_)));
    boxes.push(carried.fold(Bounds::NONE, |sum, object| sum.with(&bounds_of(state, *object))));
    boxes.push(opens(outcome).map_or(Bounds::NONE, |id| {
        around(&state.setting.container_pose(id, state.opening(id)), &state.setting.container(id).shapes)
    }));
    boxes
}

/// The container that a motion moves.
fn opens(outcome: &Outcome) -> Option<ContainerId> {
    outcome.track.keys.first().and_then(|key| key.opening).map(|(id, _)| id)
}
