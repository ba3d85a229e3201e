//! Poses and vectors of geometry. Metres, radians, unit quaternions; Z is up.
//!
//! A pose turns what is given in its own axes into what its frame sees. The frame is a name; where
//! the pose's own axes have a name, only the program knows it.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use vm::failure::{Builtin, Failure};
use vm::geometry::{Pose, Vec3};
use vm::native::{Raise, number, range_error, type_error};
use vm::value::{Imm, Obj, Symbol, Value};

use crate::table::natives;

natives! {
    "vec3" [3] => |args: &[Value]| Ok(vec_value(Vector3::new(coordinate(&args[0])?, coordinate(&args[1])?, coordinate(&args[2])?)));
    "vec3?" [1] => |args: &[Value]| Ok(Value::bool(matches!(args[0].obj(), Some(Obj::Vec3(_)))));
    "vec3-add" [2] => |args: &[Value]| finite(vec(&args[0])? + vec(&args[1])?);
    "vec3-sub" [2] => |args: &[Value]| finite(vec(&args[0])? - vec(&args[1])?);
    "vec3-scale" [2] => |args: &[Value]| finite(vec(&args[0])? * coordinate(&args[1])?);
    "vec3-dot" [2] => |args: &[Value]| Ok(Value::float(vec(&args[0])?.dot(&vec(&args[1])?)));
    "vec3-cross" [2] => |args: &[Value]| finite(vec(&args[0])?.cross(&vec(&args[1])?));
    "vec3-norm" [1] => |args: &[Value]| Ok(Value::float(norm(&vec(&args[0])?)));

    "pose" [3 ..] => make_pose;
    "pose?" [1] => |args: &[Value]| Ok(Value::bool(matches!(args[0].obj(), Some(Obj::Pose(_)))));
    "pose-frame" [1] => |args: &[Value]| Ok(Value::Imm(Imm::Symbol(pose(&args[0])?.frame)));
    "pose-x" [1] => |args: &[Value]| Ok(Value::float(pose(&args[0])?.isometry.translation.x));
    "pose-y" [1] => |args: &[Value]| Ok(Value::float(pose(&args[0])?.isometry.translation.y));
    "pose-z" [1] => |args: &[Value]| Ok(Value::float(pose(&args[0])?.isometry.translation.z));
    "pose-yaw" [1] => |args: &[Value]| Ok(Value::float(pose(&args[0])?.isometry.rotation.euler_angles().2));
    "pose-position" [1] => |args: &[Value]| Ok(vec_value(pose(&args[0])?.isometry.translation.vector));
    "pose-orientation" [1] => |args: &[Value]| Ok(Value::vector(pose(&args[0])?.numbers()[3..].iter().copied().map(Value::float)));
    "distance" [2] => distance;
    "angle" [2] => angle;
    "transform" [2] => transform;
    "inverse" [1 2] => inverse;
}

/// The frame of poses that name none: the world.
const WORLD: &str = "map";
/// The frame of an inverse that is given no name.
const LOCAL: &str = "local";

fn vec(value: &Value) -> Result<Vector3<f64>, Raise> {
    if let Some(Obj::Vec3(vec)) = value.obj() { Ok(vec.0) } else { Err(type_error("a vec3", value)) }
}

fn pose(value: &Value) -> Result<&Pose, Raise> {
    if let Some(Obj::Pose(pose)) = value.obj() { Ok(pose) } else { Err(type_error("a pose", value)) }
}

fn vec_value(vec: Vector3<f64>) -> Value {
    Value::new(Obj::Vec3(Box::new(Vec3(vec))))
}

fn pose_value(frame: Symbol, isometry: Isometry3<f64>) -> Result<Value, Raise> {
    if !isometry.translation.vector.iter().all(|x| x.is_finite()) {
        return Err(not_finite());
    }
    Ok(Value::new(Obj::Pose(Box::new(Pose { frame, isometry }))))
}

/// A number that can be a coordinate or an angle.
fn coordinate(value: &Value) -> Result<f64, Raise> {
    let x = number(value)?;
    if x.is_finite() { Ok(x) } else { Err(range_error("expected a finite number", value)) }
}

fn not_finite() -> Raise {
    vm::native::arithmetic_error("a coordinate of the result is too large")
}

fn finite(vec: Vector3<f64>) -> Result<Value, Raise> {
    if vec.iter().all(|x| x.is_finite()) { Ok(vec_value(vec)) } else { Err(not_finite()) }
}

/// Not nalgebra's, which overflows where a part is beyond 1e154.
fn norm(vec: &Vector3<f64>) -> f64 {
    libm::hypot(libm::hypot(vec.x, vec.y), vec.z)
}

// ---------------------------------------------------------------------------------------------
// Making poses

/// `([frame] x y z)`, then nothing, or `qx qy qz qw`, or angles by keyword.
fn make_pose(args: &[Value]) -> Result<Value, Raise> {
    let (frame, args) = match args[0].as_symbol() {
        Some(frame) => (frame, &args[1..]),
        None => (Symbol::from(WORLD), args),
    };
    let [x, y, z, turn @ ..] = args else { return Err(wrong_call()) };
    let place = Translation3::new(coordinate(x)?, coordinate(y)?, coordinate(z)?);
    let rotation = match turn {
        [] => UnitQuaternion::identity(),
        [first, ..] if first.as_keyword().is_some() => rotation_of_angles(turn)?,
        [x, y, z, w] => rotation_of_quaternion(
            [coordinate(x)?, coordinate(y)?, coordinate(z)?, coordinate(w)?],
            &turn[3],
        )?,
        _ => return Err(wrong_call()),
    };
    pose_value(frame, Isometry3::from_parts(place, rotation))
}

fn wrong_call() -> Raise {
    let message = "a pose is made as (pose x y z), (pose x y z qx qy qz qw) or (pose x y z :yaw a), with the name of a frame before x";
    Box::new(Failure::new(Builtin::ArityError, message))
}

fn rotation_of_angles(turn: &[Value]) -> Result<UnitQuaternion<f64>, Raise> {
    let (mut roll, mut pitch, mut yaw) = (0.0, 0.0, 0.0);
    for pair in turn.chunks(2) {
        let [name, angle] = pair else { return Err(wrong_call()) };
        let angle = coordinate(angle)?;
        match name.as_keyword().as_ref().map(|name| name.as_str()) {
            Some("roll") => roll = angle,
            Some("pitch") => pitch = angle,
            Some("yaw") => yaw = angle,
            _ => return Err(range_error("the angles of a pose are :roll, :pitch and :yaw", name)),
        }
    }
    Ok(UnitQuaternion::from_euler_angles(roll, pitch, yaw))
}

/// A quaternion of length one up to rounding is kept to the bit, so that poses read back as printed.
fn rotation_of_quaternion(xyzw: [f64; 4], shown: &Value) -> Result<UnitQuaternion<f64>, Raise> {
    let largest = xyzw.iter().fold(0.0, |max: f64, x| max.max(x.abs()));
    if largest < 1e-9 {
        return Err(range_error("a quaternion of zeros is no orientation", shown));
    }
    let squares = |parts: [f64; 4]| parts.iter().map(|x| x * x).sum::<f64>();
    if (squares(xyzw) - 1.0).abs() <= 8.0 * f64::EPSILON {
        let [x, y, z, w] = xyzw;
        return Ok(UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)));
    }
    let scaled = xyzw.map(|x| x / largest);
    let length = squares(scaled).sqrt();
    let [x, y, z, w] = scaled.map(|x| x / length);
    Ok(UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)))
}

// ---------------------------------------------------------------------------------------------
// Using them

fn distance(args: &[Value]) -> Result<Value, Raise> {
    let difference = match (args[0].obj(), args[1].obj()) {
        (Some(Obj::Vec3(a)), Some(Obj::Vec3(b))) => a.0 - b.0,
        (Some(Obj::Pose(a)), Some(Obj::Pose(b))) => {
            same_frame(a, b, &args[1])?;
            a.isometry.translation.vector - b.isometry.translation.vector
        }
        (Some(Obj::Vec3(_)), _) => return Err(type_error("a vec3", &args[1])),
        (Some(Obj::Pose(_)), _) => return Err(type_error("a pose", &args[1])),
        _ => return Err(type_error("a vec3 or pose", &args[0])),
    };
    Ok(Value::float(norm(&difference)))
}

fn angle(args: &[Value]) -> Result<Value, Raise> {
    let (across, along) = match (args[0].obj(), args[1].obj()) {
        (Some(Obj::Vec3(a)), Some(Obj::Vec3(b))) => {
            for (it, value) in [(a, &args[0]), (b, &args[1])] {
                if norm(&it.0) == 0.0 {
                    return Err(range_error("a vector of length 0 has no direction", value));
                }
            }
            (norm(&a.0.cross(&b.0)), a.0.dot(&b.0))
        }
        (Some(Obj::Pose(a)), Some(Obj::Pose(b))) => {
            same_frame(a, b, &args[1])?;
            let turn = a.isometry.rotation.inverse() * b.isometry.rotation;
            let half = libm::atan2(norm(&Vector3::new(turn.i, turn.j, turn.k)), turn.w.abs());
            return Ok(Value::float(2.0 * half));
        }
        (Some(Obj::Vec3(_)), _) => return Err(type_error("a vec3", &args[1])),
        (Some(Obj::Pose(_)), _) => return Err(type_error("a pose", &args[1])),
        _ => return Err(type_error("a vec3 or pose", &args[0])),
    };
    Ok(Value::float(libm::atan2(across, along)))
}

fn same_frame(a: &Pose, b: &Pose, value: &Value) -> Result<(), Raise> {
    if a.frame == b.frame {
        return Ok(());
    }
    let message = format!("the poses are in different frames, `{}` and `{}`", a.frame, b.frame);
    Err(range_error(message, value))
}

fn transform(args: &[Value]) -> Result<Value, Raise> {
    let by = pose(&args[0])?;
    match args[1].obj() {
        Some(Obj::Vec3(point)) => finite(by.isometry.rotation * point.0 + by.isometry.translation.vector),
        Some(Obj::Pose(inner)) => pose_value(by.frame, by.isometry * inner.isometry),
        _ => Err(type_error("a vec3 or pose", &args[1])),
    }
}

fn inverse(args: &[Value]) -> Result<Value, Raise> {
    let frame = match args.get(1) {
        Some(frame) => frame.as_symbol().ok_or_else(|| type_error("a symbol", frame))?,
        None => Symbol::from(LOCAL),
    };
    pose_value(frame, pose(&args[0])?.isometry.inverse())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose_of(numbers: &[f64]) -> Option<Value> {
        make_pose(&numbers.iter().copied().map(Value::float).collect::<Vec<_>>()).ok()
    }

    #[test]
    fn a_pose_reads_back_as_it_was_printed() {
        let mut state = 1u64;
        for _ in 0..2000 {
            let mut numbers = [0.0; 7];
            for number in &mut numbers {
                state = vm::random::mix(state.wrapping_add(1));
                *number = (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0;
            }
            let once = pose_of(&numbers).expect("the numbers are finite");
            let printed = pose(&once).ok().expect("it is a pose").numbers();
            assert_eq!(pose_of(&printed).expect("as before"), once);
        }
    }

    #[test]
    fn tiny_and_huge_quaternions() {
        assert!(pose_of(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).is_none());
        let huge = pose_of(&[0.0, 0.0, 0.0, 0.0, 0.0, 1e300, 1e300]).expect("it has a direction");
        let [.., z, w] = pose(&huge).ok().expect("it is a pose").numbers();
        assert!((z - w).abs() < 1e-15 && (z * z + w * w - 1.0).abs() < 1e-15);
        assert!(pose_of(&[f64::NAN, 0.0, 0.0]).is_none());
        assert!(pose_of(&[0.0, 0.0, 0.0, 1.0]).is_none());
    }
}
