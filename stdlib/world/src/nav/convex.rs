//! Convex polygons on the floor: what shapes look like from above.
//!
//! Corners go round against the clock and begin with the lowest one (of several, the leftmost), so
//! that two of them add up (Minkowski) by merging their edges, and rows are filled by walking up
//! both sides. Round outlines become polygons around them, at most 2 mm too large: what
//! is free here is free.

use nalgebra::{Isometry3, Vector2, Vector3};

use crate::shape::{PosedShape, Shape};

/// By how much the corners of a polygon may stand out from the circle that it stands for, metres.
pub(super) const ROUNDING_M: f64 = 0.002;

/// Edges shorter than this are left out, metres: their direction would be chance, and what lies beyond
/// an edge is taken as apart.
const SHORTEST_M: f64 = 1e-6;

/// A convex polygon with at least three corners.
#[derive(Debug, Clone, PartialEq)]
pub struct Polygon {
    corners: Vec<Vector2<f64>>,
    low: Vector2<f64>,
    high: Vector2<f64>,
}

impl Polygon {
    /// The smallest convex polygon around these points; `None` if they have no area, or a number is
    /// not finite.
    #[must_use]
    pub fn around(points: &[Vector2<f64>]) -> Option<Polygon> {
        if points.iter().any(|point| !(point.x.is_finite() && point.y.is_finite())) {
            return None;
        }
        let mut sorted = points.to_vec();
        sorted.sort_by(|a, b| a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x)));
        sorted.dedup();
        // Monotone chains (Andrew 1979): up the right side, down the left one.
        let mut corners: Vec<Vector2<f64>> = Vec::with_capacity(sorted.len() + 1);
        chain(sorted.iter(), &mut corners);
        chain(sorted.iter().rev(), &mut corners);
        corners.dedup_by(|a, b| (*a - *b).norm() < SHORTEST_M);
        while corners.len() > 1 && (corners[0] - corners[corners.len() - 1]).norm() < SHORTEST_M {
            corners.pop();
        }
        (corners.len() >= 3).then(|| Polygon::of_corners(corners))
    }

    /// A rectangle with edges along X and Y.
    #[must_use]
    pub fn rectangle(low: Vector2<f64>, high: Vector2<f64>) -> Option<Polygon> {
        Polygon::around(&[low, Vector2::new(high.x, low.y), high, Vector2::new(low.x, high.y)])
    }

    fn of_corners(corners: Vec<Vector2<f64>>) -> Polygon {
        let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        for corner in &corners {
            low = low.inf(corner);
            high = high.sup(corner);
        }
        Polygon { corners, low, high }
    }

    /// A shape seen from above.
    #[must_use]
    pub fn shadow(posed: &PosedShape) -> Option<Polygon> {
        let mut points = Vec::new();
        shadow_points(posed, &mut points);
        Polygon::around(&points)
    }

    /// The corners, against the clock.
    #[must_use]
    pub fn corners(&self) -> &[Vector2<f64>] {
        &self.corners
    }

    /// The box around it.
    #[must_use]
    pub fn bounds(&self) -> (Vector2<f64>, Vector2<f64>) {
        (self.low, self.high)
    }

    /// Metres from the origin to the farthest corner.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.corners.iter().map(|corner| corner.norm()).fold(0.0, f64::max)
    }

    /// Each point of the one plus each point of the other.
    #[must_use]
    pub fn plus(&self, other: &Polygon) -> Polygon {
        // The edges of both in the order of their directions.
        let (a, b) = (&self.corners, &other.corners);
        let mut corners = Vec::with_capacity(a.len() + b.len());
        let (mut i, mut j) = (0, 0);
        while i < a.len() || j < b.len() {
            let (from_a, from_b) = (a[i % a.len()], b[j % b.len()]);
            corners.push(from_a + from_b);
            let along_a = a[(i + 1) % a.len()] - from_a;
            let along_b = b[(j + 1) % b.len()] - from_b;
            if j == b.len() || (i < a.len() && along_a.perp(&along_b) >= 0.0) {
                i += 1;
            } else {
                j += 1;
            }
        }
        Polygon { corners, low: self.low + other.low, high: self.high + other.high }
    }

    /// What the polygon sweeps on a straight way.
    #[must_use]
    pub fn along(&self, way: Vector2<f64>) -> Polygon {
        if way.norm() < SHORTEST_M {
            return self.clone();
        }
        // Edges that face forward move; between them and the others the way itself is an edge. Edges
        // along the way must not be told apart by rounding.
        let count = self.corners.len();
        let least = 1e-9 * way.norm();
        let leads = |edge: usize| way.perp(&(self.corners[(edge + 1) % count] - self.corners[edge])) > least;
        let mut corners = Vec::with_capacity(count + 2);
        let mut before = leads(count - 1);
        for (number, corner) in self.corners.iter().enumerate() {
            let after = leads(number);
            match (before, after) {
                (false, false) => corners.push(*corner),
                (true, true) => corners.push(corner + way),
                (false, true) => corners.extend([*corner, corner + way]),
                (true, false) => corners.extend([corner + way, *corner]),
            }
            before = after;
        }
        Polygon::of_corners(lowest_first(corners))
    }

    /// A polygon around this one with fewer corners, none farther than this outside of it.
    ///
    /// The edge that costs least goes first: its neighbours are made longer until they meet.
    #[must_use]
    pub fn simpler(&self, tolerance_m: f64) -> Polygon {
        let mut corners = self.corners.clone();
        while corners.len() > 3 {
            let count = corners.len();
            let without = |edge: usize| {
                let at = |number: usize| corners[(edge + number) % count];
                let (a, b, c, d) = (at(0), at(1), at(2), at(3));
                let (first, second) = (b - a, c - d);
                let cross = first.perp(&second);
                let meet = b + first * ((c - b).perp(&second) / cross);
                let out = -self.depth(&meet);
                // The two must meet ahead, beyond the edge between.
                (cross < 0.0 && out <= tolerance_m).then_some((out, edge, meet))
            };
            let best = (0..count).filter_map(without).min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, edge, meet)) = best else { break };
            corners[(edge + 1) % count] = meet;
            corners.remove((edge + 2) % count);
        }
        Polygon::around(&corners).unwrap_or_else(|| self.clone())
    }

    /// The polygon turned half round the origin.
    #[must_use]
    pub fn mirrored(&self) -> Polygon {
        Polygon::of_corners(lowest_first(self.corners.iter().map(|corner| -corner).collect()))
    }

    /// The polygon turned by the angle of this sine and cosine, then moved.
    #[must_use]
    pub fn moved(&self, (sin, cos): (f64, f64), by: Vector2<f64>) -> Polygon {
        Polygon::of_corners(lowest_first(
            self.corners.iter().map(|corner| turned(corner, sin, cos) + by).collect(),
        ))
    }

    /// True if the two overlap or touch.
    #[must_use]
    pub fn touches(&self, other: &Polygon) -> bool {
        let apart = |axis: usize| self.low[axis] > other.high[axis] || self.high[axis] < other.low[axis];
        !apart(0) && !apart(1) && !self.has_edge_beside(other) && !other.has_edge_beside(self)
    }

    /// True if all of `other` lies beyond one edge.
    fn has_edge_beside(&self, other: &Polygon) -> bool {
        self.edges()
            .any(|(from, to)| other.corners.iter().all(|corner| (to - from).perp(&(corner - from)) < 0.0))
    }

    /// True if all of `other` is in this polygon.
    #[must_use]
    pub fn covers(&self, other: &Polygon) -> bool {
        (0..2).all(|axis| self.low[axis] <= other.low[axis] && self.high[axis] >= other.high[axis])
            && other.corners.iter().all(|corner| self.contains(corner))
    }

    /// True if the point is inside, or on an edge.
    #[must_use]
    pub fn contains(&self, point: &Vector2<f64>) -> bool {
        self.edges().all(|(from, to)| (to - from).perp(&(point - from)) >= 0.0)
    }

    /// Metres to the nearest edge: positive inside, negative outside.
    #[must_use]
    pub fn depth(&self, point: &Vector2<f64>) -> f64 {
        let gap = |(from, to): (Vector2<f64>, Vector2<f64>)| {
            let along = to - from;
            let share = ((point - from).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (point - from - along * share).norm()
        };
        let nearest = self.edges().map(gap).fold(f64::INFINITY, f64::min);
        if self.contains(point) { nearest } else { -nearest }
    }

    fn edges(&self) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> {
        let next = self.corners[1..].iter().chain(&self.corners[..1]);
        self.corners.iter().copied().zip(next.copied())
    }
}

/// One side of a hull; its last point begins the next side and is left out.
fn chain<'a>(points: impl Iterator<Item = &'a Vector2<f64>>, corners: &mut Vec<Vector2<f64>>) {
    let start = corners.len();
    for point in points {
        while let [.., before, last] = corners[start..] {
            if (last - before).perp(&(point - before)) > 0.0 {
                break;
            }
            corners.pop();
        }
        corners.push(*point);
    }
    corners.pop();
}

fn lowest_first(mut corners: Vec<Vector2<f64>>) -> Vec<Vector2<f64>> {
    let lower = |a: &Vector2<f64>, b: &Vector2<f64>| a.y.total_cmp(&b.y).then(a.x.total_cmp(&b.x));
    let lowest = (0..corners.len()).min_by(|a, b| lower(&corners[*a], &corners[*b]));
    corners.rotate_left(lowest.unwrap_or(0));
    corners
}

pub(super) fn turned(point: &Vector2<f64>, sin: f64, cos: f64) -> Vector2<f64> {
    Vector2::new(cos * point.x - sin * point.y, sin * point.x + cos * point.y)
}

/// Points whose hull is the outline of a shape from above.
pub(super) fn shadow_points(posed: &PosedShape, points: &mut Vec<Vector2<f64>>) {
    let at = |point: Vector3<f64>| (posed.pose * nalgebra::Point3::from(point)).coords.xy();
    match posed.shape {
        Shape::Box { size } => {
            let half = size * 0.5;
            for x in [-half.x, half.x] {
                for y in [-half.y, half.y] {
                    points.extend([-half.z, half.z].map(|z| at(Vector3::new(x, y, z))));
                }
            }
        }
        Shape::Cylinder { radius, length } => {
            for z in [-length * 0.5, length * 0.5] {
                points.extend(circle(radius).map(|corner| at(Vector3::new(corner.x, corner.y, z))));
            }
        }
        Shape::Sphere { radius } => {
            points.extend(circle(radius).map(|corner| posed.pose.translation.vector.xy() + corner));
        }
        Shape::Capsule { radius, length } => {
            for z in [-length * 0.5, length * 0.5] {
                let end = at(Vector3::new(0.0, 0.0, z));
                points.extend(circle(radius).map(|corner| end + corner));
            }
        }
    }
}

/// Lowest and highest point of a shape, metres in Z.
pub(crate) fn heights(posed: &PosedShape) -> (f64, f64) {
    let centre = posed.pose.translation.vector.z;
    let up: Vector3<f64> = posed.pose.rotation.inverse() * Vector3::z();
    let half = match posed.shape {
        Shape::Sphere { radius } => radius,
        Shape::Box { size } => up.abs().dot(&size) * 0.5,
        Shape::Cylinder { radius, length } => radius * up.xy().norm() + up.z.abs() * length * 0.5,
        Shape::Capsule { radius, length } => radius + up.z.abs() * length * 0.5,
    };
    (centre - half, centre + half)
}

/// Corners of a regular polygon around a circle.
fn circle(radius: f64) -> impl Iterator<Item = Vector2<f64>> {
    use std::f64::consts::PI;
    let corners = libm::ceil(PI * (radius / (2.0 * ROUNDING_M)).sqrt()).clamp(8.0, 32.0);
    let outer = radius / libm::cos(PI / corners);
    (0..corners as usize).map(move |number| {
        let (sin, cos) = libm::sincos(2.0 * PI * number as f64 / corners);
        Vector2::new(outer * cos, outer * sin)
    })
}

/// The shapes of a body at a pose.
pub(crate) fn placed(pose: &Isometry3<f64>, posed: &PosedShape) -> PosedShape {
    PosedShape { pose: pose * posed.pose, shape: posed.shape }
}
