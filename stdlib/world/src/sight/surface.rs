//! Points all over the surface of a shape.

use nalgebra::{Isometry3, Point3, Unit, Vector3};

use crate::shape::{PosedShape, Shape};

/// How far inside a point must be not to be on the surface, metres.
const SKIN_M: f64 = 1e-4;
/// Around a cylinder.
const SIDES: usize = 12;
/// All over a ball.
const BALL: usize = 32;

/// A part of a surface, as flat as a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patch {
    /// Its middle.
    pub point: Point3<f64>,
    /// Outwards.
    pub normal: Vector3<f64>,
    /// Square metres.
    pub area: f64,
}

impl Patch {
    /// The part of the view from a point that it takes (steradians, roughly); 0 if it faces away.
    #[must_use]
    pub fn weight_from(&self, eye: &Point3<f64>) -> f64 {
        let towards = eye - self.point;
        let distance = towards.norm();
        (self.area * self.normal.dot(&towards) / (distance * distance * distance)).max(0.0)
    }
}

/// Adds the patches of a shape, always the same ones in the same order. Their areas add up to that of
/// the surface.
pub fn patches(posed: &PosedShape, out: &mut Vec<Patch>) {
    let pose = &posed.pose;
    match posed.shape {
        Shape::Box { size } => {
            for axis in 0..3 {
                for sign in [-1.0, 1.0] {
                    face(pose, &(size * 0.5), axis, sign, out);
                }
            }
        }
        Shape::Cylinder { radius, length } => {
            side(pose, radius, length, out);
            for sign in [-1.0, 1.0] {
                cap(pose, radius, sign * length * 0.5, out);
            }
        }
        Shape::Sphere { radius } => ball(pose, radius, 0.0, out),
        Shape::Capsule { radius, length } => {
            if length > 0.0 {
                side(pose, radius, length, out);
            }
            ball(pose, radius, length * 0.5, out);
        }
    }
}

/// True if a point, in the frame of the shape, is well inside of it.
pub(super) fn is_inside(shape: &Shape, point: &Point3<f64>) -> bool {
    let across = libm::hypot(point.x, point.y);
    match *shape {
        Shape::Box { size } => (0..3).all(|axis| point[axis].abs() < size[axis] * 0.5 - SKIN_M),
        Shape::Cylinder { radius, length } => {
            across < radius - SKIN_M && point.z.abs() < length * 0.5 - SKIN_M
        }
        Shape::Sphere { radius } => point.coords.norm() < radius - SKIN_M,
        Shape::Capsule { radius, length } => {
            libm::hypot(across, (point.z.abs() - length * 0.5).max(0.0)) < radius - SKIN_M
        }
    }
}

fn push(pose: &Isometry3<f64>, point: Vector3<f64>, normal: Vector3<f64>, area: f64, out: &mut Vec<Patch>) {
    out.push(Patch { point: pose * Point3::from(point), normal: pose.rotation * normal, area });
}

/// Nine patches of one side of a box.
fn face(pose: &Isometry3<f64>, half: &Vector3<f64>, axis: usize, sign: f64, out: &mut Vec<Patch>) {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut normal = Vector3::zeros();
    normal[axis] = sign;
    let thirds = [-2.0 / 3.0, 0.0, 2.0 / 3.0];
    for across in thirds {
        for up in thirds {
            let mut point = normal * half[axis];
            (point[u], point[v]) = (across * half[u], up * half[v]);
            push(pose, point, normal, 4.0 * half[u] * half[v] / 9.0, out);
        }
    }
}

/// The round side of a cylinder, in three rings.
fn side(pose: &Isometry3<f64>, radius: f64, length: f64, out: &mut Vec<Patch>) {
    use std::f64::consts::TAU;
    let area = TAU * radius * length / (3 * SIDES) as f64;
    for number in 0..SIDES {
        let (sin, cos) = libm::sincos(TAU * number as f64 / SIDES as f64);
        let normal = Vector3::new(cos, sin, 0.0);
        for up in [-1.0 / 3.0, 0.0, 1.0 / 3.0] {
            push(pose, normal * radius + Vector3::z() * (up * length), normal, area, out);
        }
    }
}

/// The flat end of a cylinder: the middle and a ring, each standing for a seventh of it.
fn cap(pose: &Isometry3<f64>, radius: f64, z: f64, out: &mut Vec<Patch>) {
    use std::f64::consts::{PI, TAU};
    let normal = Vector3::z() * z.signum();
    let area = PI * radius * radius / 7.0;
    push(pose, Vector3::z() * z, normal, area, out);
    for number in 0..6 {
        let (sin, cos) = libm::sincos(TAU * f64::from(number) / 6.0);
        // The mean radius of what the ring stands for.
        push(pose, Vector3::new(cos, sin, 0.0) * (0.72 * radius) + Vector3::z() * z, normal, area, out);
    }
}

/// A ball, its halves drawn apart along Z by `apart` each: points of a Fibonacci lattice, which have
/// equal areas.
fn ball(pose: &Isometry3<f64>, radius: f64, apart: f64, out: &mut Vec<Patch>) {
    use std::f64::consts::PI;
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let area = 4.0 * PI * radius * radius / BALL as f64;
    for number in 0..BALL {
        let z = 1.0 - (2 * number + 1) as f64 / BALL as f64;
        let across = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = libm::sincos(golden * number as f64);
        let normal = Unit::new_normalize(Vector3::new(across * cos, across * sin, z)).into_inner();
        push(pose, normal * radius + Vector3::z() * (apart * z.signum()), normal, area, out);
    }
}
