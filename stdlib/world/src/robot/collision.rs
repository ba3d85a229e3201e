//! What a robot touches: itself, what it carries, and what stands around it.
//!
//! A [`CollisionModel`] knows the shapes of all links and which pairs of them are worth a look. What
//! the robot holds is [`Carried`]; what stands around is in [`Obstacles`]. All of them consist of
//! [`Body`]s, shapes made ready once and shared by whoever has such a thing.
//!
//! From cheap to dear, for each pair of shapes: ball against ball (within a robot) or ball against
//! axis-parallel box (with obstacles), ball against the box around the other shape in that shape's
//! axes, parry's exact test.
//!
//! Shapes of the robot and of what it carries are taken 1 mm smaller than they are ([`SLACK_M`]),
//! so what stands on a table, or lies between two fingers, does not collide with it.
//!
//! A pose with a number that is not finite touches nothing: [`Robot::outside_limits`] finds such
//! configurations.
//!
//! Pairs are looked at in the order of links, of carried things and of obstacles, and the first one
//! that touches is the answer: the same on every machine.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};

use crate::parry::Solid;
use crate::random::unit;
use crate::shape::PosedShape;

use super::chain::Limbs;
use super::model::{LinkId, Robot};

/// By how much shapes that move are made smaller, metres.
pub const SLACK_M: f64 = 0.001;

/// Configurations that are looked at to find links that always touch.
const SAMPLES: u64 = 100;

// ---------------------------------------------------------------------------------------------
// Bodies

/// Shapes made ready for questions. Cheap to clone.
#[derive(Clone)]
pub struct Body {
    parts: Arc<[Part]>,
}

/// A shape in the frame of its body.
struct Part {
    solid: Solid,
    pose: Isometry3<f64>,
    half: Vector3<f64>,
    radius: f64,
}

impl Body {
    /// A body that stands still: its shapes as they are.
    #[must_use]
    pub fn new(shapes: &[PosedShape]) -> Body {
        let part = |posed: &PosedShape| Part {
            solid: Solid::new(posed),
            pose: posed.pose,
            half: posed.shape.half_extents(),
            radius: posed.shape.bounding_radius(),
        };
        Body { parts: shapes.iter().map(part).collect() }
    }

    /// A body of a robot, or one that it carries: its shapes a little smaller.
    #[must_use]
    pub fn moving(shapes: &[PosedShape]) -> Body {
        let smaller: Vec<PosedShape> = shapes
            .iter()
            .map(|posed| PosedShape { pose: posed.pose, shape: posed.shape.shrunk(SLACK_M) })
            .collect();
        Body::new(&smaller)
    }
}

/// Something in a gripper, or in two.
#[derive(Clone)]
pub struct Carried {
    /// What it is called.
    pub name: String,
    /// The link that it moves with.
    pub link: LinkId,
    /// From its own frame to that of the link.
    pub pose_in_link: Isometry3<f64>,
    /// Its shapes, see [`Body::moving`].
    pub body: Body,
    /// Links that may touch it: the fingers of all grippers that hold it.
    pub may_touch: Vec<LinkId>,
}

/// What stands around.
#[derive(Clone, Default)]
pub struct Obstacles {
    things: Vec<Obstacle>,
    parts: Vec<ObstaclePart>,
}

#[derive(Clone)]
struct Obstacle {
    name: String,
    may_touch: Vec<LinkId>,
}

/// A shape of an obstacle with the box around it, in the world.
#[derive(Clone)]
struct ObstaclePart {
    owner: usize,
    body: Body,
    part: usize,
    /// Of the obstacle.
    pose: Isometry3<f64>,
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Obstacles {
    /// Adds something at a pose in the world, which only the links in `may_touch` may touch.
    pub fn push(&mut self, name: &str, body: &Body, pose: &Isometry3<f64>, may_touch: &[LinkId]) {
        let owner = self.things.len();
        self.things.push(Obstacle { name: name.into(), may_touch: may_touch.into() });
        for (number, part) in body.parts.iter().enumerate() {
            let centred = pose * part.pose;
            let centre = centred.translation.vector;
            let half = centred.rotation.to_rotation_matrix().matrix().abs() * part.half;
            let (low, high) = (centre - half, centre + half);
            self.parts.push(ObstaclePart { owner, body: body.clone(), part: number, pose: *pose, low, high });
        }
    }

    /// How many things there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.things.len()
    }

    /// True if nothing stands around.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.things.is_empty()
    }
}

// ---------------------------------------------------------------------------------------------
// Answers

/// One side of a touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Thing {
    /// A link of the robot.
    Link(LinkId),
    /// Something that it carries, by its place in the list.
    Carried(usize),
    /// Something that stands around, by the order in which it was added.
    Obstacle(usize),
}

/// Two things that touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Touch {
    /// A part of the robot, or something that it carries.
    pub first: Thing,
    /// What that touches.
    pub second: Thing,
}

impl Touch {
    /// The names of the two.
    #[must_use]
    pub fn names<'a>(
        &self,
        robot: &'a Robot,
        carried: &'a [Carried],
        obstacles: &'a Obstacles,
    ) -> (&'a str, &'a str) {
        let name = |thing| match thing {
            Thing::Link(link) => robot.link_name(link),
            Thing::Carried(place) => carried.get(place).map_or("", |thing| thing.name.as_str()),
            Thing::Obstacle(place) => obstacles.things.get(place).map_or("", |thing| thing.name.as_str()),
        };
        (name(self.first), name(self.second))
    }
}

// ---------------------------------------------------------------------------------------------
// The model

/// The shapes of a robot, and which of them may touch.
pub struct CollisionModel {
    /// Links that have shapes, in the order of links.
    bodies: Vec<(LinkId, Body)>,
    /// Pairs of `bodies` that must not touch.
    pairs: Vec<(usize, usize)>,
}

/// Memory that checks use again and again.
#[derive(Default)]
pub struct Scratch {
    /// Parts of all bodies, then of what is carried: where they are.
    parts: Vec<Placed>,
    /// For each body and carried thing: where its parts begin; one more at the end.
    starts: Vec<usize>,
    /// Parts of obstacles that are near the robot at all.
    near: Vec<usize>,
}

/// A part of a body in the world.
#[derive(Clone, Copy)]
struct Placed {
    /// Of the body.
    pose: Isometry3<f64>,
    centre: Point3<f64>,
    radius: f64,
}

impl CollisionModel {
    /// The model of a robot.
    ///
    /// May touch: a link and the next one above it that has shapes; the links of one gripper; links
    /// that touch in each of a hundred random configurations, as their shapes overlap by design.
    #[must_use]
    pub fn new(robot: &Robot, limbs: &Limbs) -> CollisionModel {
        let shaped = robot.link_ids().filter(|link| !robot.links()[link.index()].shapes.is_empty());
        let bodies: Vec<(LinkId, Body)> =
            shaped.map(|link| (link, Body::moving(&robot.links()[link.index()].shapes))).collect();
        let same_gripper = |a: LinkId, b: LinkId| {
            let fingers =
                limbs.arms.iter().filter_map(|arm| arm.gripper.as_ref()).map(|gripper| &gripper.fingers);
            fingers.into_iter().any(|fingers| fingers.contains(&a) && fingers.contains(&b))
        };
        let mut pairs = Vec::new();
        for (second, (link, _)) in bodies.iter().enumerate() {
            let above = above(robot, *link);
            for (first, (other, _)) in bodies[..second].iter().enumerate() {
                if above != Some(*other) && !same_gripper(*link, *other) {
                    pairs.push((first, second));
                }
            }
        }
        let mut model = CollisionModel { bodies, pairs };
        model.allow_what_always_touches(robot);
        model
    }

    /// From now on these two links may touch.
    pub fn allow(&mut self, a: LinkId, b: LinkId) {
        let bodies = &self.bodies;
        self.pairs.retain(|(first, second)| {
            let (first, second) = (bodies[*first].0, bodies[*second].0);
            (first, second) != (a, b) && (first, second) != (b, a)
        });
    }

    /// Pairs of links that must not touch.
    pub fn pairs(&self) -> impl Iterator<Item = (LinkId, LinkId)> {
        self.pairs.iter().map(|(first, second)| (self.bodies[*first].0, self.bodies[*second].0))
    }

    fn allow_what_always_touches(&mut self, robot: &Robot) {
        let (mut poses, mut scratch) = (Vec::new(), Scratch::default());
        let mut always = self.pairs.clone();
        for sample in 0..SAMPLES {
            if always.is_empty() {
                return;
            }
            let configuration = random_configuration(robot, sample);
            robot.forward(&Isometry3::identity(), &configuration, &mut poses);
            self.place(&poses, &[], &mut scratch);
            always.retain(|(first, second)| self.bodies_touch(*first, *second, &[], &scratch));
        }
        self.pairs.retain(|pair| !always.contains(pair));
    }

    /// The first two things of the robot and what it carries that touch, or anything that touches
    /// an obstacle; `None` if all is free.
    ///
    /// `poses`: of all links in the world, as [`Robot::forward`] gives them.
    pub fn touch(
        &self,
        poses: &[Isometry3<f64>],
        carried: &[Carried],
        obstacles: &Obstacles,
        scratch: &mut Scratch,
    ) -> Option<Touch> {
        self.place(poses, carried, scratch);
        self.self_touch_of(carried, scratch).or_else(|| self.obstacle_touch_of(carried, obstacles, scratch))
    }

    /// The first two things of the robot and what it carries that touch.
    pub fn self_touch(
        &self,
        poses: &[Isometry3<f64>],
        carried: &[Carried],
        scratch: &mut Scratch,
    ) -> Option<Touch> {
        self.place(poses, carried, scratch);
        self.self_touch_of(carried, scratch)
    }

    /// The first thing of the robot and what it carries that touches an obstacle.
    pub fn obstacle_touch(
        &self,
        poses: &[Isometry3<f64>],
        carried: &[Carried],
        obstacles: &Obstacles,
        scratch: &mut Scratch,
    ) -> Option<Touch> {
        self.place(poses, carried, scratch);
        self.obstacle_touch_of(carried, obstacles, scratch)
    }

    /// Metres between the robot, with what it carries, and the nearest obstacle: 0 if they touch,
    /// `most_m` if nothing is nearer than that. Things that may touch count as well. The robot is
    /// taken [`SLACK_M`] smaller here, too.
    pub fn distance(
        &self,
        poses: &[Isometry3<f64>],
        carried: &[Carried],
        obstacles: &Obstacles,
        most_m: f64,
        scratch: &mut Scratch,
    ) -> f64 {
        self.place(poses, carried, scratch);
        let mut least = most_m;
        for index in 0..self.bodies.len() + carried.len() {
            let body = self.body(index, carried);
            for (part, placed) in body.parts.iter().zip(scratch.parts_of(index)) {
                for other in &obstacles.parts {
                    let gap = gap_to_box(&placed.centre, &other.low, &other.high) - placed.radius;
                    if gap < least {
                        let solid = &other.body.parts[other.part].solid;
                        least = least.min(part.solid.distance(&placed.pose, solid, &other.pose));
                    }
                }
            }
        }
        least
    }

    // -----------------------------------------------------------------------------------------

    /// Bodies are numbered: those of links, then what is carried.
    fn body<'a>(&'a self, index: usize, carried: &'a [Carried]) -> &'a Body {
        self.bodies.get(index).map_or_else(|| &carried[index - self.bodies.len()].body, |(_, body)| body)
    }

    fn thing(&self, index: usize) -> Thing {
        self.bodies
            .get(index)
            .map_or_else(|| Thing::Carried(index - self.bodies.len()), |(link, _)| Thing::Link(*link))
    }

    fn place(&self, poses: &[Isometry3<f64>], carried: &[Carried], scratch: &mut Scratch) {
        scratch.parts.clear();
        scratch.starts.clear();
        let at = |link: LinkId| poses.get(link.0).copied().unwrap_or_default();
        let links = self.bodies.iter().map(|(link, body)| (at(*link), body));
        let things = carried.iter().map(|thing| (at(thing.link) * thing.pose_in_link, &thing.body));
        for (pose, body) in links.chain(things) {
            scratch.starts.push(scratch.parts.len());
            scratch.parts.extend(body.parts.iter().map(|part| Placed {
                pose,
                centre: pose * Point3::from(part.pose.translation.vector),
                radius: part.radius,
            }));
        }
        scratch.starts.push(scratch.parts.len());
    }

    fn self_touch_of(&self, carried: &[Carried], scratch: &Scratch) -> Option<Touch> {
        let touch = |first, second| Touch { first: self.thing(first), second: self.thing(second) };
        for (first, second) in &self.pairs {
            if self.bodies_touch(*first, *second, carried, scratch) {
                return Some(touch(*first, *second));
            }
        }
        for (place, thing) in carried.iter().enumerate() {
            let first = self.bodies.len() + place;
            for (second, (link, _)) in self.bodies.iter().enumerate() {
                let allowed = *link == thing.link || thing.may_touch.contains(link);
                if !allowed && self.bodies_touch(first, second, carried, scratch) {
                    return Some(touch(first, second));
                }
            }
            for second in self.bodies.len()..first {
                if self.bodies_touch(first, second, carried, scratch) {
                    return Some(touch(first, second));
                }
            }
        }
        None
    }

    fn bodies_touch(&self, first: usize, second: usize, carried: &[Carried], scratch: &Scratch) -> bool {
        let (a, b) = (self.body(first, carried), self.body(second, carried));
        for (part, placed) in a.parts.iter().zip(scratch.parts_of(first)) {
            for (other, other_placed) in b.parts.iter().zip(scratch.parts_of(second)) {
                let reach = placed.radius + other_placed.radius;
                if (placed.centre - other_placed.centre).norm_squared() <= reach * reach
                    && part.is_near(&placed.pose, &other_placed.centre, other_placed.radius)
                    && other.is_near(&other_placed.pose, &placed.centre, placed.radius)
                    && part.solid.touches(&placed.pose, &other.solid, &other_placed.pose)
                {
                    return true;
                }
            }
        }
        false
    }

    fn obstacle_touch_of(
        &self,
        carried: &[Carried],
        obstacles: &Obstacles,
        scratch: &mut Scratch,
    ) -> Option<Touch> {
        let (low, high) = scratch.bounds();
        let is_near = |part: &ObstaclePart| {
            (0..3).all(|axis| part.low[axis] <= high[axis] && part.high[axis] >= low[axis])
        };
        scratch.near.clear();
        scratch.near.extend((0..obstacles.parts.len()).filter(|part| is_near(&obstacles.parts[*part])));
        for index in 0..self.bodies.len() + carried.len() {
            let body = self.body(index, carried);
            let link = self.bodies.get(index).map(|(link, _)| *link);
            for (part, placed) in body.parts.iter().zip(scratch.parts_of(index)) {
                for other in scratch.near.iter().map(|near| &obstacles.parts[*near]) {
                    let other_part = &other.body.parts[other.part];
                    if gap_to_box(&placed.centre, &other.low, &other.high) <= placed.radius
                        && other_part.is_near(&other.pose, &placed.centre, placed.radius)
                        && !link.is_some_and(|link| obstacles.things[other.owner].may_touch.contains(&link))
                        && part.solid.touches(&placed.pose, &other_part.solid, &other.pose)
                    {
                        return Some(Touch {
                            first: self.thing(index),
                            second: Thing::Obstacle(other.owner),
                        });
                    }
                }
            }
        }
        None
    }
}

impl Part {
    /// False if a ball is certainly apart from this shape.
    #[inline]
    fn is_near(&self, body_pose: &Isometry3<f64>, centre: &Point3<f64>, radius: f64) -> bool {
        let local = self.pose.inverse_transform_point(&body_pose.inverse_transform_point(centre));
        gap_to_box(&local, &-self.half, &self.half) <= radius
    }
}

impl Scratch {
    fn parts_of(&self, body: usize) -> &[Placed] {
        &self.parts[self.starts[body]..self.starts[body + 1]]
    }

    /// The box around all balls.
    fn bounds(&self) -> (Vector3<f64>, Vector3<f64>) {
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        for part in &self.parts {
            low = low.inf(&part.centre.coords.add_scalar(-part.radius));
            high = high.sup(&part.centre.coords.add_scalar(part.radius));
        }
        (low, high)
    }
}

/// Metres from a point to a box.
#[inline]
fn gap_to_box(point: &Point3<f64>, low: &Vector3<f64>, high: &Vector3<f64>) -> f64 {
    let beyond = (low - point.coords).sup(&(point.coords - high)).sup(&Vector3::zeros());
    beyond.norm()
}

/// The next link above that has shapes.
fn above(robot: &Robot, link: LinkId) -> Option<LinkId> {
    let parent = |link: &LinkId| robot.links()[link.index()].parent;
    std::iter::successors(parent(&link), parent).find(|link| !robot.links()[link.index()].shapes.is_empty())
}

/// A configuration within the limits, a function of its number.
fn random_configuration(robot: &Robot, sample: u64) -> Vec<f64> {
    use std::f64::consts::PI;
    let count = robot.variables().len() as u64;
    let value = |(place, limits): (usize, Option<(f64, f64)>)| {
        let (low, high) = limits.unwrap_or((-PI, PI));
        low + (high - low) * unit(0, sample * count + place as u64)
    };
    robot.variables().iter().map(|variable| variable.limits).enumerate().map(value).collect()
}
