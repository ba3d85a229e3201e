//! Turning a head so that its camera looks at a point.
//!
//! The camera need not sit on the axes of pan and tilt, so there is no simple formula. Newton's method
//! on two numbers, where the point is seen to the right and below, does it in a few rounds for any two
//! joints; it begins with the best of a few directions all around, so it does not matter where the
//! head looks now.

use nalgebra::{Isometry3, Point3};
use thiserror::Error;

use super::chain::Head;
use super::model::{Robot, VariableId};

/// Radians from the middle of the image that are good enough.
pub const CLOSE_RAD: f64 = 1e-6;
/// Rounds of Newton's method at most.
const ROUNDS: usize = 20;
/// Directions to begin with.
const PANS: usize = 9;
const TILTS: usize = 5;

/// Where a head turns to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Position of the joint that pans, radians.
    pub pan: f64,
    /// Position of the joint that tilts, radians.
    pub tilt: f64,
}

/// A head does not get there.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("the head does not turn that far: at best the point is {off_rad:.2} rad off the middle of the image")]
pub struct TooFar {
    /// How far it gets.
    pub best: Look,
    /// Radians between the camera's axis and the point then.
    pub off_rad: f64,
}

impl Robot {
    /// How to look at a point with a head.
    ///
    /// `root`: pose of the robot in the world; `configuration`: its joints, of which those of the head
    /// do not matter; `point`: in the world.
    ///
    /// # Errors
    /// The point is beyond the limits of the joints; whether it is near enough to the middle of the
    /// image all the same is for the caller to say.
    pub fn look_at(
        &self,
        head: &Head,
        root: &Isometry3<f64>,
        configuration: &[f64],
        point: &Point3<f64>,
    ) -> Result<Look, TooFar> {
        let mut gaze = Gaze {
            robot: self,
            head,
            point: root.inverse_transform_point(point),
            configuration: configuration.to_vec(),
            poses: Vec::new(),
        };
        gaze.configuration.resize(self.variables().len(), 0.0);
        let (best, off_rad) = gaze.turn();
        if off_rad <= CLOSE_RAD { Ok(best) } else { Err(TooFar { best, off_rad }) }
    }
}

/// A search.
struct Gaze<'r> {
    robot: &'r Robot,
    head: &'r Head,
    /// In the frame of the root.
    point: Point3<f64>,
    configuration: Vec<f64>,
    poses: Vec<Isometry3<f64>>,
}

impl Gaze<'_> {
    /// Angles to the right and downwards at which the point is seen.
    fn off(&mut self, look: Look) -> (f64, f64) {
        for (variable, value) in [(self.head.pan, look.pan), (self.head.tilt, look.tilt)] {
            if let Some(number) = self.configuration.get_mut(variable.index()) {
                *number = value;
            }
        }
        self.robot.forward(&Isometry3::identity(), &self.configuration, &mut self.poses);
        let camera = self.poses.get(self.head.camera.index()).copied().unwrap_or_default();
        let seen = camera.inverse_transform_point(&self.point);
        (libm::atan2(seen.x, seen.z), libm::atan2(seen.y, libm::hypot(seen.x, seen.z)))
    }

    fn turn(&mut self) -> (Look, f64) {
        let mut look = self.begin();
        let mut off = self.off(look);
        let mut best = (look, size(off));
        for _ in 0..ROUNDS {
            if best.1 <= CLOSE_RAD {
                break;
            }
            const STEP: f64 = 1e-6;
            let by_pan = self.off(Look { pan: look.pan + STEP, ..look });
            let by_tilt = self.off(Look { tilt: look.tilt + STEP, ..look });
            let (a, b) = ((by_pan.0 - off.0) / STEP, (by_tilt.0 - off.0) / STEP);
            let (c, d) = ((by_pan.1 - off.1) / STEP, (by_tilt.1 - off.1) / STEP);
            let determinant = a * d - b * c;
            // Where the axes do not turn the view, right above the head, is no way on.
            if determinant.abs() < 1e-9 {
                break;
            }
            let pan = look.pan - (d * off.0 - b * off.1) / determinant;
            let tilt = look.tilt - (a * off.1 - c * off.0) / determinant;
            look = Look { pan: self.within(self.head.pan, pan), tilt: self.within(self.head.tilt, tilt) };
            off = self.off(look);
            if size(off) < best.1 {
                best = (look, size(off));
            }
        }
        best
    }

    /// The best of some directions all over the limits.
    fn begin(&mut self) -> Look {
        let values = |gaze: &Self, variable: VariableId, count: usize| -> Vec<f64> {
            let (low, high) = gaze.limits(variable);
            (0..count).map(|number| low + (high - low) * (number as f64 + 0.5) / count as f64).collect()
        };
        let mut best = (Look { pan: 0.0, tilt: 0.0 }, f64::INFINITY);
        for pan in values(self, self.head.pan, PANS) {
            for tilt in values(self, self.head.tilt, TILTS) {
                let look = Look { pan, tilt };
                let off = size(self.off(look));
                if off < best.1 {
                    best = (look, off);
                }
            }
        }
        best.0
    }

    fn limits(&self, variable: VariableId) -> (f64, f64) {
        use std::f64::consts::PI;
        self.robot.variables().get(variable.index()).and_then(|it| it.limits).unwrap_or((-PI, PI))
    }

    /// A joint without limits turns on to where it is the same.
    fn within(&self, variable: VariableId, value: f64) -> f64 {
        let free = self.robot.variables().get(variable.index()).is_some_and(|it| it.limits.is_none());
        let (low, high) = self.limits(variable);
        if free { crate::nav::normal_angle(value) } else { value.clamp(low, high) }
    }
}

/// The angle between the camera's axis and the point. Not the length of the two: one of them alone may
/// be behind the camera.
fn size((right, down): (f64, f64)) -> f64 {
    let ahead = libm::cos(right) * libm::cos(down);
    let beside = libm::hypot(libm::sin(right) * libm::cos(down), libm::sin(down));
    libm::atan2(beside, ahead)
}
