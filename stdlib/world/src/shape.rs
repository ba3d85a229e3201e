//! Shapes of bodies: boxes, cylinders, spheres and capsules.
//!
//! Data in `f64`; [`crate::parry`] makes what the collision library works on.

use nalgebra::{Isometry3, Vector3};

/// A solid around the origin of its own frame. Lengths in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A box by its whole edges along X, Y and Z.
    Box {
        /// Edges, each greater than 0.
        size: Vector3<f64>,
    },
    /// A cylinder around Z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Extent along Z.
        length: f64,
    },
    /// A ball.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A cylinder around Z with half a ball at each end.
    Capsule {
        /// Radius.
        radius: f64,
        /// Extent of the cylinder along Z, the balls not counted.
        length: f64,
    },
}

/// A shape somewhere: in the frame of a link, of an object, or of the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PosedShape {
    /// From the frame of the shape to the frame that it is given in.
    pub pose: Isometry3<f64>,
    /// What is there.
    pub shape: Shape,
}

impl Shape {
    /// Half of the box around the shape in its own frame.
    #[must_use]
    pub fn half_extents(&self) -> Vector3<f64> {
        match *self {
            Shape::Box { size } => size * 0.5,
            Shape::Cylinder { radius, length } => Vector3::new(radius, radius, length * 0.5),
            Shape::Sphere { radius } => Vector3::repeat(radius),
            Shape::Capsule { radius, length } => Vector3::new(radius, radius, length * 0.5 + radius),
        }
    }

    /// Radius of the smallest ball around the origin that holds the shape.
    #[must_use]
    pub fn bounding_radius(&self) -> f64 {
        match *self {
            Shape::Box { .. } => self.half_extents().norm(),
            Shape::Cylinder { radius, length } => (radius * radius + length * length * 0.25).sqrt(),
            Shape::Sphere { radius } => radius,
            Shape::Capsule { radius, length } => radius + length * 0.5,
        }
    }

    /// Cubic metres.
    #[must_use]
    pub fn volume(&self) -> f64 {
        use std::f64::consts::PI;
        let ball = |radius: f64| 4.0 / 3.0 * PI * radius * radius * radius;
        match *self {
            Shape::Box { size } => size.x * size.y * size.z,
            Shape::Cylinder { radius, length } => PI * radius * radius * length,
            Shape::Sphere { radius } => ball(radius),
            Shape::Capsule { radius, length } => ball(radius) + PI * radius * radius * length,
        }
    }

    /// The shape with its surface moved inwards by `slack_m`, but never by more than a quarter of
    /// its thickness.
    #[must_use]
    pub fn shrunk(&self, slack_m: f64) -> Shape {
        let half = self.half_extents();
        let slack = slack_m.min(half.min() * 0.5);
        match *self {
            Shape::Box { size } => Shape::Box { size: size - Vector3::repeat(2.0 * slack) },
            Shape::Cylinder { radius, length } => {
                Shape::Cylinder { radius: radius - slack, length: length - 2.0 * slack }
            }
            Shape::Sphere { radius } => Shape::Sphere { radius: radius - slack },
            Shape::Capsule { radius, length } => Shape::Capsule { radius: radius - slack, length },
        }
    }

    /// True if all lengths are finite and greater than 0 (the cylinder of a capsule may be 0).
    #[must_use]
    pub fn is_solid(&self) -> bool {
        let positive = |length: f64| length.is_finite() && length > 0.0;
        match *self {
            Shape::Box { size } => size.iter().all(|edge| positive(*edge)),
            Shape::Cylinder { radius, length } => positive(radius) && positive(length),
            Shape::Sphere { radius } => positive(radius),
            Shape::Capsule { radius, length } => positive(radius) && length.is_finite() && length >= 0.0,
        }
    }
}

impl PosedShape {
    /// The corners of the axis-parallel box around the shape, in the frame that it is given in.
    #[must_use]
    pub fn bounds(&self) -> (Vector3<f64>, Vector3<f64>) {
        let centre = self.pose.translation.vector;
        let half = match self.shape {
            Shape::Sphere { radius } => Vector3::repeat(radius),
            _ => self.pose.rotation.to_rotation_matrix().matrix().abs() * self.shape.half_extents(),
        };
        (centre - half, centre + half)
    }
}
