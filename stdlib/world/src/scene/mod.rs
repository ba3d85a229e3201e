//! Scenes: rooms, furniture, containers that open, surfaces with names, and objects with their grasps.
//!
//! A scene is data. [`read`] makes it of what a `.plan` file says, [`check`] looks whether bodies
//! overlap; nothing of it changes while a plan runs: what changes is in [`crate::state`].
//!
//! Frames: that of a piece of furniture lies on the floor below its middle, X to its front, where a
//! person stands who uses it. That of a surface lies in it, that of an object where its shapes were
//! drawn around, usually its middle. The world is `map`, Z up.

pub mod check;
pub mod grasp;
pub mod read;

use nalgebra::{Isometry3, Translation3, Unit, Vector3};

use crate::robot::model::turn;
use crate::shape::{PosedShape, Shape};

pub use grasp::{Grasp, Hands, Side};

/// A wall or a piece of furniture, by its place in [`Scene::fixtures`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct FixtureId(pub usize);
/// A supporting plane, by its place in [`Scene::surfaces`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct SurfaceId(pub usize);
/// A door or drawer, by its place in [`Scene::containers`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct ContainerId(pub usize);
/// A kind of objects, by its place in [`Scene::kinds`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct KindId(pub usize);
/// An object, by its place in [`Scene::objects`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct ObjectId(pub usize);

/// A room with all that is in it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scene {
    /// Walls and furniture.
    pub fixtures: Vec<Fixture>,
    /// Planes on which objects can stand.
    pub surfaces: Vec<Surface>,
    /// What opens.
    pub containers: Vec<Container>,
    /// Kinds of objects.
    pub kinds: Vec<Kind>,
    /// Objects and where they are at first.
    pub objects: Vec<Object>,
}

/// What stands still.
#[derive(Debug, Clone, PartialEq)]
pub struct Fixture {
    /// Its name.
    pub name: String,
    /// From its frame to the world.
    pub pose: Isometry3<f64>,
    /// Its shapes, in its frame.
    pub shapes: Vec<PosedShape>,
}

/// A rectangle that carries objects.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// Its name.
    pub name: String,
    /// Whose it is.
    pub owner: FixtureId,
    /// The drawer that it moves with.
    pub moves_with: Option<ContainerId>,
    /// The container that it is in: shut, nobody sees or reaches it.
    pub inside: Option<ContainerId>,
    /// From its frame to its owner's, the drawer shut.
    pub pose: Isometry3<f64>,
    /// Edges along its X and Y, metres.
    pub size: [f64; 2],
    /// How many objects may stand on it.
    pub capacity: Option<usize>,
}

/// A door or drawer.
#[derive(Debug, Clone, PartialEq)]
pub struct Container {
    /// Its name.
    pub name: String,
    /// What it is a part of.
    pub owner: FixtureId,
    /// How it moves.
    pub joint: Hinge,
    /// Its joint when it is wide open, radians or metres, above 0; shut is 0.
    pub open: f64,
    /// What moves, in the frame of the owner, shut.
    pub shapes: Vec<PosedShape>,
    /// Where hands hold it.
    pub handle: Handle,
}

/// The joint of a container, in the frame of its owner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hinge {
    /// Turns about an axis through a point, by the right hand.
    Turn {
        /// A point of the axis.
        at: Vector3<f64>,
        /// Its direction.
        axis: Unit<Vector3<f64>>,
    },
    /// Slides.
    Slide {
        /// Where to.
        along: Unit<Vector3<f64>>,
    },
}

/// A bar that a hand closes around.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Handle {
    /// Tool pose of a hand that holds it, in the frame of the owner, shut.
    pub tool: Isometry3<f64>,
    /// The bar's direction: a hand may turn about it.
    pub bar: Unit<Vector3<f64>>,
    /// How thick it is between the fingers.
    pub width_m: f64,
}

/// What objects of one type have in common.
#[derive(Debug, Clone, PartialEq)]
pub struct Kind {
    /// Its name: `milk`.
    pub name: String,
    /// Its shapes, in the frame of the object.
    pub shapes: Vec<PosedShape>,
    /// Corners of the box around them.
    pub low: Vector3<f64>,
    /// The other corner.
    pub high: Vector3<f64>,
    /// Kilograms.
    pub mass_kg: f64,
    /// Coefficient of friction against fingers and furniture.
    pub friction: f64,
    /// How hands hold it.
    pub grasps: Vec<Grasp>,
    /// What it can carry, as a tray does.
    pub carries: Option<Tray>,
}

/// The upper side of an object that carries others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tray {
    /// The middle of the plane, in the frame of the object.
    pub at: Vector3<f64>,
    /// Edges along X and Y.
    pub size: [f64; 2],
    /// How many objects fit.
    pub capacity: usize,
}

/// An object at the beginning.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Its name: `milk-1`.
    pub name: String,
    /// What it is.
    pub kind: KindId,
    /// On which surface; none is the floor, or in the air.
    pub on: Option<SurfaceId>,
    /// Its pose, in the frame of the surface, or in the world.
    pub pose: Isometry3<f64>,
}

impl Hinge {
    /// What the joint's position makes of a pose in the frame of the owner that it has when shut.
    #[must_use]
    pub fn moved(&self, position: f64) -> Isometry3<f64> {
        match self {
            Hinge::Slide { along } => Isometry3::from_parts(
                Translation3::from(along.into_inner() * position),
                nalgebra::UnitQuaternion::identity(),
            ),
            Hinge::Turn { at, axis } => {
                let rotation = turn(axis, position);
                Isometry3::from_parts(Translation3::from(at - rotation * at), rotation)
            }
        }
    }

    /// True if it turns: its position is in radians.
    #[must_use]
    pub fn turns(&self) -> bool {
        matches!(self, Hinge::Turn { .. })
    }
}

impl Kind {
    /// The box around it.
    #[must_use]
    pub fn size(&self) -> Vector3<f64> {
        self.high - self.low
    }

    /// How far its frame is above what it stands on.
    #[must_use]
    pub fn height_above_ground_m(&self) -> f64 {
        -self.low.z
    }
}

impl Scene {
    /// The surface with this name.
    #[must_use]
    pub fn surface(&self, name: &str) -> Option<SurfaceId> {
        self.surfaces.iter().position(|it| it.name == name).map(SurfaceId)
    }
    /// The container with this name.
    #[must_use]
    pub fn container(&self, name: &str) -> Option<ContainerId> {
        self.containers.iter().position(|it| it.name == name).map(ContainerId)
    }
    /// The kind with this name.
    #[must_use]
    pub fn kind(&self, name: &str) -> Option<KindId> {
        self.kinds.iter().position(|it| it.name == name).map(KindId)
    }
    /// The object with this name.
    #[must_use]
    pub fn object(&self, name: &str) -> Option<ObjectId> {
        self.objects.iter().position(|it| it.name == name).map(ObjectId)
    }
    /// The kind of an object.
    #[must_use]
    pub fn kind_of(&self, object: ObjectId) -> &Kind {
        &self.kinds[self.objects[object.0].kind.0]
    }
}

/// A pose from x, y, z and a turn about Z.
#[must_use]
pub fn upright(at: Vector3<f64>, yaw_rad: f64) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(at), turn(&Vector3::z_axis(), yaw_rad))
}

/// A box with its middle at `at`, turned by `yaw_rad`.
#[must_use]
pub fn boxed(size: Vector3<f64>, at: Vector3<f64>, yaw_rad: f64) -> PosedShape {
    PosedShape { pose: upright(at, yaw_rad), shape: Shape::Box { size } }
}
