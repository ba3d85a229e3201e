//! Tests of the crate, one file for each module that they are about.

mod chances;
mod collision;
mod ik;
mod kinematics;
mod kitchen;
mod motions;
mod nav;
mod path;

mod sight;
mod simulate;
mod text;
mod urdf;

use nalgebra::Isometry3;

use crate::random::unit;
use crate::robot::chain::{ArmNames, Chains, GripperNames};
use crate::robot::urdf::{ONE_ARM, PR2};
use crate::robot::{Chain, Limbs, Robot};

/// Numbers from 0 to 1, the same in each run.
pub(super) struct Dice {
    seed: u64,
    thrown: u64,
}

impl Dice {
    pub(super) fn new(seed: u64) -> Dice {
        Dice { seed, thrown: 0 }
    }

    pub(super) fn unit(&mut self) -> f64 {
        self.thrown += 1;
        unit(self.seed, self.thrown)
    }

    pub(super) fn below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count.saturating_sub(1))
    }

    pub(super) fn within(&mut self, limits: Option<(f64, f64)>) -> f64 {
        let (low, high) = limits.unwrap_or((-3.0, 3.0));
        low + (high - low) * self.unit()
    }

    pub(super) fn values(&mut self, chain: &Chain) -> Vec<f64> {
        chain.limits().iter().map(|limits| self.within(*limits)).collect()
    }

    pub(super) fn configuration(&mut self, robot: &Robot) -> Vec<f64> {
        robot.variables().iter().map(|variable| self.within(variable.limits)).collect()
    }
}

pub(super) fn pr2() -> (Robot, Limbs) {
    let robot = Robot::from_urdf("pr2.urdf", PR2).expect("the shipped robot is read");
    let limbs = robot.limbs(&Chains::pr2()).expect("its parts are there");
    (robot, limbs)
}

pub(super) fn one_arm() -> (Robot, Limbs) {
    let robot = Robot::from_urdf("one-arm.urdf", ONE_ARM).expect("the shipped robot is read");
    let limbs = robot.limbs(&Chains::one_arm()).expect("its parts are there");
    (robot, limbs)
}

/// Metres and radians between two poses.
pub(super) fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    // The angle from the vector part: arcus cosinus is blind below 1e-8.
    let turn = (a.rotation.inverse() * b.rotation).into_inner();
    (
        (a.translation.vector - b.translation.vector).norm(),
        2.0 * libm::atan2(turn.imag().norm(), turn.w.abs()),
    )
}

#[track_caller]
pub(super) fn assert_same_pose(a: &Isometry3<f64>, b: &Isometry3<f64>, tolerance: f64) {
    let (distance_m, angle_rad) = apart(a, b);
    assert!(distance_m < tolerance && angle_rad < tolerance, "{distance_m:e} m and {angle_rad:e} rad apart");
}

/// An arm without a gripper.
pub(super) fn bare_arm(base: &str, tool: &str, joints: usize) -> ArmNames {
    ArmNames {
        name: "arm".into(),
        base: base.into(),
        tool: tool.into(),
        gripper: None::<GripperNames>,
        park: vec![0.0; joints],
    }
}
