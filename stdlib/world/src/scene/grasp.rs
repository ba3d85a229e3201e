//! Grasps: where a hand is when it holds an object.
//!
//! A tool's X is the direction in which it comes, its Y the direction in which the fingers close. A grasp
//! is the tool's pose in the frame of the object. It comes from a *side*: `front` is the object's +X,
//! `back` −X, `left` +Y, `right` −Y, `top` +Z, `bottom` −Z; hands that come from the sides are held level.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// How far the tool's frame goes into the object from the side that it comes from, metres.
const DEPTH_M: f64 = 0.03;
/// Fingertips reach beyond the tool's frame by a little less than this; they must not touch the ground.
const FINGERTIPS_M: f64 = 0.027;
/// Where a hand is before it grasps: so far back.
pub const PRE_GRASP_M: f64 = 0.1;
/// How far an object is lifted before anything else is done with it.
pub const LIFT_M: f64 = 0.06;

/// The side that a hand comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Side {
    /// +X of the object.
    Front,
    /// −X.
    Back,
    /// +Y.
    Left,
    /// −Y.
    Right,
    /// +Z.
    Top,
    /// −Z.
    Bottom,
}

/// How hands hold an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grasp {
    /// The side.
    pub side: Side,
    /// The hands' tools in the frame of the object.
    pub hands: Hands,
    /// How far the fingers are apart then.
    pub width_m: f64,
    /// How far back the hand is before.
    pub pre_m: f64,
    /// How far the object is lifted after.
    pub lift_m: f64,
}

/// One hand or two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hands {
    /// Any hand.
    One(Isometry3<f64>),
    /// The robot's first hand and its second.
    Two(Isometry3<f64>, Isometry3<f64>),
}

impl Side {
    /// All sides.
    pub const ALL: [Side; 6] = [Side::Front, Side::Back, Side::Left, Side::Right, Side::Top, Side::Bottom];

    /// Its word in the language.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Side::Front => "front",
            Side::Back => "back",
            Side::Left => "left",
            Side::Right => "right",
            Side::Top => "top",
            Side::Bottom => "bottom",
        }
    }

    /// The side of this name.
    #[must_use]
    pub fn of(name: &str) -> Option<Side> {
        Side::ALL.into_iter().find(|side| side.name() == name)
    }

    /// The direction in which a hand comes from it.
    #[must_use]
    pub fn approach(self) -> Vector3<f64> {
        match self {
            Side::Front => -Vector3::x(),
            Side::Back => Vector3::x(),
            Side::Left => -Vector3::y(),
            Side::Right => Vector3::y(),
            Side::Top => -Vector3::z(),
            Side::Bottom => Vector3::z(),
        }
    }

    /// How the fingers close where nothing else is said: level, or across the narrower edge.
    #[must_use]
    pub fn fingers(self, size: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Side::Front => -Vector3::y(),
            Side::Back => Vector3::y(),
            Side::Left => Vector3::x(),
            Side::Right => -Vector3::x(),
            Side::Top | Side::Bottom if size.x <= size.y => Vector3::x(),
            Side::Top | Side::Bottom => Vector3::y(),
        }
    }

    /// Where the tool's frame is where nothing else is said: a little inside, but off the ground.
    #[must_use]
    pub fn place(self, low: &Vector3<f64>, high: &Vector3<f64>) -> Vector3<f64> {
        let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
        let approach = self.approach();
        let extent = half.dot(&approach.abs());
        let mut at = middle - approach * (extent - DEPTH_M).max(0.0);
        if self == Side::Top {
            at.z = at.z.max(low.z + FINGERTIPS_M);
        }
        at
    }
}

/// The pose of a tool; `None` if the two directions are one.
#[must_use]
pub fn tool(at: Vector3<f64>, approach: Vector3<f64>, fingers: Vector3<f64>) -> Option<Isometry3<f64>> {
    let x = approach.try_normalize(1e-9)?;
    let y = (fingers - x * x.dot(&fingers)).try_normalize(1e-6)?;
    let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Some(Isometry3::from_parts(Translation3::from(at), rotation))
}

/// The same tool further back.
#[must_use]
pub fn back(tool: &Isometry3<f64>, by_m: f64) -> Isometry3<f64> {
    tool * Translation3::new(-by_m, 0.0, 0.0)
}

/// The same pose higher up in the world.
#[must_use]
pub fn lifted(pose: &Isometry3<f64>, by_m: f64) -> Isometry3<f64> {
    Translation3::new(0.0, 0.0, by_m) * pose
}
