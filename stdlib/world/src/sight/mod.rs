//! What a camera sees: how much of a thing is in the image with nothing before it, and what hides it.
//!
//! A thing is looked for at points all over its shapes ([`surface`]). Each that faces the camera counts
//! by the part of the image that it stands for: its area, seen at its angle, over the square of its
//! distance. So the share that is visible is that of the thing's picture, not of its surface. A point
//! outside of the image is lost; for the others a ray tells whether something is between, and what
//! is met first. Doors and walls of containers hide like anything else, by their shapes.
//!
//! Camera frames are optical ones (REP 103): Z ahead, X to the right of the image, Y down. Metres and
//! radians. Rays are parry's, against one shape after another; what is not near the cone from the eye
//! to the thing is left out first.

pub mod surface;

use nalgebra::{Isometry3, Point3, Vector3};

use crate::parry::Solid;
use crate::shape::PosedShape;

use surface::Patch;

/// How near a ray must come to a point of a surface, as a share of its length: what touches the
/// surface there does not hide it.
const TOUCHES: f64 = 1.0 - 1e-4;

/// What a camera takes in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Angle of the image from left to right, below π.
    pub width_rad: f64,
    /// Angle of the image from top to bottom, below π.
    pub height_rad: f64,
    /// Nothing is seen nearer than this along Z.
    pub near_m: f64,
    /// Nothing is seen farther than this along Z.
    pub far_m: f64,
}

impl Default for Camera {
    /// A wide-angle camera as on heads of service robots, as far as it tells one thing from another.
    fn default() -> Camera {
        Camera { width_rad: 1.57, height_rad: 1.2, near_m: 0.1, far_m: 3.5 }
    }
}

impl Camera {
    /// True if a point, in the camera's frame, is in the image.
    #[must_use]
    pub fn takes_in(&self, point: &Point3<f64>) -> bool {
        self.image().takes_in(point)
    }

    fn image(&self) -> Image {
        Image {
            camera: *self,
            across: libm::tan(self.width_rad * 0.5),
            down: libm::tan(self.height_rad * 0.5),
        }
    }
}

/// A camera with the tangents of its angles.
struct Image {
    camera: Camera,
    across: f64,
    down: f64,
}

impl Image {
    fn takes_in(&self, point: &Point3<f64>) -> bool {
        (self.camera.near_m..=self.camera.far_m).contains(&point.z)
            && point.x.abs() <= point.z * self.across
            && point.y.abs() <= point.z * self.down
    }
}

/// How a thing is seen. The shares add up to 1, unless it is not seen at all because no side of it
/// faces the camera: then all are 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sight {
    /// Share of its picture that is there.
    pub visible: f64,
    /// Share that is outside of the image, too near or too far.
    pub outside: f64,
    /// What is before it, the worst first: numbers of things, and which share each hides.
    pub hidden: Vec<(usize, f64)>,
}

/// Things that may hide one another.
#[derive(Clone, Default)]
pub struct Things {
    parts: Vec<Part>,
    count: usize,
}

/// A shape of a thing.
#[derive(Clone)]
struct Part {
    owner: usize,
    solid: Solid,
    /// Of the thing, in the world.
    pose: Isometry3<f64>,
    centre: Point3<f64>,
    radius: f64,
}

impl Things {
    /// Adds a thing and tells its number: `shapes` in its frame, which is at `pose` in the world.
    pub fn push(&mut self, pose: &Isometry3<f64>, shapes: &[PosedShape]) -> usize {
        let owner = self.count;
        self.count += 1;
        self.parts.extend(shapes.iter().map(|posed| Part {
            owner,
            solid: Solid::new(posed),
            pose: *pose,
            centre: pose * Point3::from(posed.pose.translation.vector),
            radius: posed.shape.bounding_radius(),
        }));
        owner
    }

    /// How many things there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count
    }

    /// True if there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// How a camera sees a thing.
    ///
    /// `eye`: the camera's frame in the world. `without`: numbers of things that do not hide it, first of
    /// all its own.
    #[must_use]
    pub fn sight(
        &self,
        camera: &Camera,
        eye: &Isometry3<f64>,
        (pose, shapes): (&Isometry3<f64>, &[PosedShape]),
        without: &[usize],
    ) -> Sight {
        let image = camera.image();
        let at = Point3::from(eye.translation.vector);
        let mut patches: Vec<Patch> = Vec::new();
        for posed in shapes {
            surface::patches(&PosedShape { pose: pose * posed.pose, shape: posed.shape }, &mut patches);
        }
        let weighed: Vec<(Point3<f64>, f64)> = patches
            .iter()
            .map(|patch| (patch.point, patch.weight_from(&at)))
            .filter(|(point, weight)| *weight > 0.0 && !is_inside(point, pose, shapes))
            .collect();
        let all: f64 = weighed.iter().map(|(_, weight)| weight).sum();
        if !(all.is_finite() && all > 0.0) {
            return Sight::default();
        }
        let near = self.beside(&at, weighed.iter().map(|(point, _)| point), without);
        let mut sight = Sight::default();
        // Divided at the end: what is seen whole has a share of exactly 1.
        for (point, weight) in &weighed {
            if !image.takes_in(&eye.inverse_transform_point(point)) {
                sight.outside += weight;
            } else if let Some(owner) = self.first(&near, &at, point) {
                match sight.hidden.iter_mut().find(|(other, _)| *other == owner) {
                    Some((_, hides)) => *hides += weight,
                    None => sight.hidden.push((owner, *weight)),
                }
            } else {
                sight.visible += weight;
            }
        }
        for share in [&mut sight.visible, &mut sight.outside]
            .into_iter()
            .chain(sight.hidden.iter_mut().map(|it| &mut it.1))
        {
            *share /= all;
        }
        sight.hidden.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        sight
    }

    /// The first thing on the straight line from one point to another; what only touches the far end
    /// does not count.
    #[must_use]
    pub fn between(&self, from: &Point3<f64>, to: &Point3<f64>, without: &[usize]) -> Option<usize> {
        let near = self.beside(from, std::iter::once(to), without);
        self.first(&near, from, to)
    }

    /// Parts that a line from the eye to one of the points may meet: those that are near the capsule
    /// from the eye to the middle of the points that holds all these lines.
    fn beside<'a>(
        &self,
        eye: &Point3<f64>,
        points: impl Iterator<Item = &'a Point3<f64>> + Clone,
        without: &[usize],
    ) -> Vec<usize> {
        let count = points.clone().count().max(1) as f64;
        let middle = eye + points.clone().map(|point| point - eye).sum::<Vector3<f64>>() / count;
        let around = points.map(|point| (point - middle).norm()).fold(0.0, f64::max);
        let along = middle - eye;
        let near = |part: &Part| {
            let share = (part.centre - eye).dot(&along) / along.norm_squared();
            let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
            // The lines go apart from the eye on, as wide as the points at the end.
            (part.centre - (eye + along * share)).norm() <= part.radius + around
        };
        let counts = |part: &Part| !without.contains(&part.owner) && near(part);
        (0..self.parts.len()).filter(|place| counts(&self.parts[*place])).collect()
    }

    fn first(&self, near: &[usize], from: &Point3<f64>, to: &Point3<f64>) -> Option<usize> {
        let along = to - from;
        let length_squared = along.norm_squared();
        let mut best: Option<(f64, usize)> = None;
        for part in near.iter().map(|place| &self.parts[*place]) {
            let share = ((part.centre - from).dot(&along) / length_squared).clamp(0.0, 1.0);
            if (part.centre - (from + along * share)).norm_squared() > part.radius * part.radius {
                continue;
            }
            let hit = part.solid.first_on_line(&part.pose, from, to).filter(|share| *share < TOUCHES);
            if let Some(share) = hit.filter(|share| best.is_none_or(|(least, _)| *share < least)) {
                best = Some((share, part.owner));
            }
        }
        best.map(|(_, owner)| owner)
    }
}

/// True if a point of one shape lies in another shape of the same thing, where nothing is to be seen.
fn is_inside(point: &Point3<f64>, pose: &Isometry3<f64>, shapes: &[PosedShape]) -> bool {
    shapes.len() > 1
        && shapes.iter().any(|posed| {
            let local = (pose * posed.pose).inverse_transform_point(point);
            surface::is_inside(&posed.shape, &local)
        })
}
