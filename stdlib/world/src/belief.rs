//! What the robot knows of the world: what it has seen and what it has opened. It may be wrong.
//!
//! Apart from the truth on purpose: a plan that reads a pose gets the one that was seen, with its error and
//! its age. Forks with the world, so each run has its own.

use im::OrdMap;
use nalgebra::Isometry3;

use crate::scene::{ContainerId, ObjectId};

/// What the robot believes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Belief {
    /// Objects that have been seen.
    pub seen: OrdMap<ObjectId, Sight>,
    /// Containers that it left open, by how far.
    pub open: OrdMap<ContainerId, f64>,
}

/// An object as it was seen last, or as a hand put it down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// Its pose in the world, with the error of the camera.
    pub pose: Isometry3<f64>,
    /// Seconds of the task clock then.
    pub at_s: f64,
}
