//! The border to parry: the only place where its types are made.
//!
//! Parry works in `f32`. Relative poses are computed in `f64` and rounded then, so nothing is lost
//! far from the world's origin: at arm's length a pose is good to a tenth of a micrometre.
//! Parry's cylinders and capsules stand along Y, ours along Z.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rapier3d::parry::math::{Pose, Rotation, Vector};
use rapier3d::parry::query::{DefaultQueryDispatcher, QueryDispatcher};
use rapier3d::parry::shape::SharedShape;

use crate::shape::{PosedShape, Shape};

/// A shape as parry knows it, and where its frame is seen from ours.
#[derive(Clone)]
pub(crate) struct Solid {
    shape: SharedShape,
    pose: Isometry3<f64>,
}

/// A pose in the types of parry and rapier.
#[must_use]
pub fn pose(pose: &Isometry3<f64>) -> Pose {
    let (t, r) = (pose.translation.vector, pose.rotation.coords);
    Pose::from_parts(
        Vector::new(t.x as f32, t.y as f32, t.z as f32),
        Rotation::from_xyzw(r.x as f32, r.y as f32, r.z as f32, r.w as f32),
    )
}

/// From parry's frame of a shape to ours.
fn upright(shape: &Shape) -> UnitQuaternion<f64> {
    match shape {
        // A quarter turn about X takes Y to Z; written out, so that no sine is computed.
        Shape::Cylinder { .. } | Shape::Capsule { .. } => {
            let half = std::f64::consts::FRAC_1_SQRT_2;
            UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(half, half, 0.0, 0.0))
        }
        Shape::Box { .. } | Shape::Sphere { .. } => UnitQuaternion::identity(),
    }
}

impl Solid {
    pub(crate) fn new(posed: &PosedShape) -> Solid {
        let shape = match posed.shape {
            Shape::Box { size } => {
                let half: Vector3<f64> = size * 0.5;
                SharedShape::cuboid(half.x as f32, half.y as f32, half.z as f32)
            }
            Shape::Cylinder { radius, length } => SharedShape::cylinder((length * 0.5) as f32, radius as f32),
            Shape::Sphere { radius } => SharedShape::ball(radius as f32),
            Shape::Capsule { radius, length } => SharedShape::capsule_y((length * 0.5) as f32, radius as f32),
        };
        Solid { shape, pose: posed.pose * upright(&posed.shape) }
    }

    /// True if the two overlap or touch, with the frames that they are given in at these poses.
    pub(crate) fn touches(&self, at: &Isometry3<f64>, other: &Solid, other_at: &Isometry3<f64>) -> bool {
        let Some(relative) = self.relative(at, other, other_at) else { return true };
        let answer = DefaultQueryDispatcher.intersection_test(&relative, &*self.shape, &*other.shape);
        // All pairs of our shapes are supported; were one not, touching is the safe answer.
        answer.map_or(true, |found| found.intersecting)
    }

    /// Metres between the two surfaces, 0 if they touch.
    pub(crate) fn distance(&self, at: &Isometry3<f64>, other: &Solid, other_at: &Isometry3<f64>) -> f64 {
        let Some(relative) = self.relative(at, other, other_at) else { return 0.0 };
        let answer = DefaultQueryDispatcher.distance(&relative, &*self.shape, &*other.shape);
        answer.map_or(0.0, |distance| f64::from(distance.distance).max(0.0))
    }

    /// `None` if parry cannot work on it, because a number is none or does not fit into `f32`.
    fn relative(&self, at: &Isometry3<f64>, other: &Solid, other_at: &Isometry3<f64>) -> Option<Pose> {
        let relative = pose(&(at * self.pose).inv_mul(&(other_at * other.pose)));
        relative.is_finite().then_some(relative)
    }

    /// Where the straight line from one point to another first meets the shape, as a share of its
    /// length; 0 if it begins inside.
    pub(crate) fn first_on_line(
        &self,
        at: &Isometry3<f64>,
        from: &nalgebra::Point3<f64>,
        to: &nalgebra::Point3<f64>,
    ) -> Option<f64> {
        let place = at * self.pose;
        let (from, to) = (place.inverse_transform_point(from), place.inverse_transform_point(to));
        let point = |p: nalgebra::Vector3<f64>| Vector::new(p.x as f32, p.y as f32, p.z as f32);
        let ray = rapier3d::parry::query::Ray::new(point(from.coords), point(to - from));
        if !(ray.origin.is_finite() && ray.dir.is_finite()) {
            return None;
        }
        self.shape.cast_local_ray(&ray, 1.0, true).map(f64::from)
    }

    /// The shape with its place, as parts of a compound are given.
    pub(crate) fn part(&self) -> (Pose, SharedShape) {
        (pose(&self.pose), self.shape.clone())
    }
}

/// One parry shape for several of ours, in the frame that they are given in; `None` if there are none.
#[must_use]
pub fn compound(shapes: &[PosedShape]) -> Option<SharedShape> {
    let parts: Vec<_> = shapes.iter().map(|posed| Solid::new(posed).part()).collect();
    (!parts.is_empty()).then(|| SharedShape::compound(parts))
}
