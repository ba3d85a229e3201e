//! Poses and vectors of geometry as values. Metres, radians; unit quaternions.

use std::cmp::Ordering;

use crate::value::Symbol;

/// A vector of three numbers, in metres where it is a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vec3(pub nalgebra::Vector3<f64>);

/// A place and orientation, in the reference frame that it names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// The frame that the numbers are relative to; `map` is the world.
    pub frame: Symbol,
    /// From the pose's own axes to the axes of the frame.
    pub isometry: nalgebra::Isometry3<f64>,
}

impl Vec3 {
    /// x, y, z.
    #[must_use]
    pub fn numbers(&self) -> [f64; 3] {
        [self.0.x, self.0.y, self.0.z]
    }
    pub(crate) fn total_cmp(&self, other: &Vec3) -> Ordering {
        total_cmp(&self.numbers(), &other.numbers())
    }
}

impl Pose {
    /// x, y, z of the place, then x, y, z, w of the quaternion.
    #[must_use]
    pub fn numbers(&self) -> [f64; 7] {
        let (place, turn) = (&self.isometry.translation, &self.isometry.rotation);
        [place.x, place.y, place.z, turn.i, turn.j, turn.k, turn.w]
    }
    pub(crate) fn total_cmp(&self, other: &Pose) -> Ordering {
        (self.frame.as_str().cmp(other.frame.as_str()))
            .then_with(|| total_cmp(&self.numbers(), &other.numbers()))
    }
}

fn total_cmp(a: &[f64], b: &[f64]) -> Ordering {
    (a.iter().zip(b)).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
}
