//! Driving: where a base can stand, how far it is from here to there, and on which way.
//!
//! A [`Map`] is made once for each version of the world, on a [`Ground`] that is made once for each
//! outline of the robot ([`Footprint`], with what it carries): which cells of a grid are free at which headings, and how
//! far each is from the nearest obstacle. A [`Flood`] from where the robot stands answers for all
//! places at once how far they are; [`Flood::drive`] makes one of these ways smooth. [`Costmap`]s on
//! the same grid say which places are good to stand at.
//!
//! The floor is level. Frames: X, Y and yaw (left turns are positive) in the world; outlines in the
//! frame of the robot's root. Metres, radians, seconds.
//!
//! Invariants
//! 1. What is called free is free: cells and turns are checked with a margin ([`Settings`]), the
//!    poses that the caller asked for and each leg of a [`Drive`] exactly, without steps.
//! 2. Answers do not depend on how often or in which order was asked.

pub mod convex;
pub mod costmap;
pub mod drive;
pub mod flood;
pub mod footprint;
pub mod grid;
pub mod map;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector2, Vector3};
use thiserror::Error;

pub use costmap::Costmap;
pub use drive::{Drive, Speeds};
pub use flood::Flood;
pub use footprint::Footprint;
pub use grid::Grid;
pub use map::{Barrier, Ground, Map, Room, Settings};

/// Where a base stands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Place {
    /// Metres.
    pub x: f64,
    /// Metres.
    pub y: f64,
    /// Radians from the X axis to the left.
    pub yaw: f64,
}

impl Place {
    /// A place by its numbers.
    #[must_use]
    pub fn new(x: f64, y: f64, yaw: f64) -> Place {
        Place { x, y, yaw }
    }

    /// Where the frame of this pose stands on the floor: its X axis from above.
    #[must_use]
    pub fn of_pose(pose: &Isometry3<f64>) -> Place {
        let ahead: Vector3<f64> = pose.rotation * Vector3::x();
        Place { x: pose.translation.x, y: pose.translation.y, yaw: libm::atan2(ahead.y, ahead.x) }
    }

    /// The pose at this place, upright on the floor.
    #[must_use]
    pub fn pose(&self) -> Isometry3<f64> {
        let (sin, cos) = libm::sincos(self.yaw * 0.5);
        let turn = UnitQuaternion::new_unchecked(Quaternion::new(cos, 0.0, 0.0, sin));
        Isometry3::from_parts(Translation3::new(self.x, self.y, 0.0), turn)
    }

    /// Without the heading.
    #[must_use]
    pub fn point(&self) -> Vector2<f64> {
        Vector2::new(self.x, self.y)
    }

    fn is_finite(&self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.yaw.is_finite()
    }
}

/// What is in the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Blocker {
    /// One of the barriers, by its place in the list.
    Barrier(usize),
    /// The edge of the room.
    Bounds,
}

/// Why a base does not get there.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum NoWay {
    /// The goal, or the start, is no place in the room.
    #[error("({:.2}, {:.2}) is outside of the room", at.x, at.y)]
    OutsideRoom {
        /// Which place.
        at: Place,
    },
    /// Where the base stands, it touches something.
    #[error("the base touches something where it stands")]
    StartBlocked {
        /// What.
        by: Blocker,
    },
    /// Where it should stand, it would touch something.
    #[error("the base would touch something at its goal")]
    GoalBlocked {
        /// What.
        by: Blocker,
    },
    /// Both are free, and there is no way between.
    #[error("no way there: blocked near ({:.2}, {:.2})", at.x, at.y)]
    Blocked {
        /// What stands in the way, on the way that would be freed most easily.
        by: Blocker,
        /// Where the base would touch it.
        at: Place,
    },
}

/// An angle between -π and π.
#[must_use]
pub fn normal_angle(angle_rad: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    // No `%`: what is within bounds must keep its bits.
    if (-PI..=PI).contains(&angle_rad) { angle_rad } else { angle_rad - TAU * libm::round(angle_rad / TAU) }
}

/// The short turn from one heading to another.
#[must_use]
pub fn turn_between(from_rad: f64, to_rad: f64) -> f64 {
    normal_angle(to_rad - from_rad)
}
