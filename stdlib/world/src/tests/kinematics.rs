//! Forward kinematics and Jacobians.

use nalgebra::{Isometry3, Vector3, Vector6};

use super::{Dice, assert_same_pose, one_arm, pr2};
use crate::robot::{Chain, Robot};

/// The arms of the shipped robots, and a chain with a lift before its arm.
fn chains() -> Vec<(Robot, Chain)> {
    let (pr2, limbs) = pr2();
    let with_torso = pr2.chain("base_link", "r_gripper_tool_frame").expect("it is connected");
    let fingertip = pr2.chain("l_wrist_roll_link", "l_gripper_r_finger_tip_link").expect("it is connected");
    let mut chains: Vec<(Robot, Chain)> =
        limbs.arms.iter().map(|arm| (pr2.clone(), arm.chain.clone())).collect();
    chains.extend([(pr2.clone(), with_torso), (pr2, fingertip)]);
    let (one_arm, limbs) = one_arm();
    chains.push((one_arm, limbs.arms[0].chain.clone()));
    chains
}

#[test]
fn a_chain_and_its_robot_agree() {
    let mut dice = Dice::new(1);
    let mut poses = Vec::new();
    for (robot, chain) in chains() {
        for _ in 0..50 {
            let configuration = dice.configuration(&robot);
            let base =
                Isometry3::new(Vector3::new(dice.unit(), dice.unit(), 0.0), Vector3::z() * dice.unit());
            robot.forward(&base, &configuration, &mut poses);
            let tip_in_base = poses[chain.base().index()].inv_mul(&poses[chain.tip().index()]);
            assert_same_pose(&chain.forward(&chain.pick(&configuration)), &tip_in_base, 1e-12);
        }
    }
}

#[test]
fn jacobians_are_derivatives() {
    let mut dice = Dice::new(2);
    for (_, chain) in chains() {
        let count = chain.variables().len();
        let mut columns = vec![Vector6::zeros(); count];
        for _ in 0..20 {
            let values = dice.values(&chain);
            assert_same_pose(&chain.jacobian(&values, &mut columns), &chain.forward(&values), 1e-12);
            for column in 0..count {
                let step = 1e-6;
                let at = |sign: f64| {
                    let mut moved = values.clone();
                    moved[column] += sign * step;
                    chain.forward(&moved)
                };
                let (before, after) = (at(-1.0), at(1.0));
                let linear = (after.translation.vector - before.translation.vector) / (2.0 * step);
                let angular = (after.rotation * before.rotation.inverse()).scaled_axis() / (2.0 * step);
                let expected = Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z);
                assert!((columns[column] - expected).norm() < 1e-6, "column {column}");
            }
        }
    }
}

#[test]
fn values_go_into_a_configuration_and_come_back() {
    let (robot, limbs) = pr2();
    let arm = &limbs.arms[1];
    let mut configuration = robot.zero();
    arm.chain.place(&arm.park, &mut configuration);
    assert_eq!(arm.chain.pick(&configuration), arm.park);
    assert_eq!(robot.outside_limits(&configuration, 0.0), None);
    configuration[arm.chain.variables()[3].index()] = 0.1;
    assert_eq!(robot.outside_limits(&configuration, 1e-6), Some(arm.chain.variables()[3]));
}

#[test]
fn wrong_lengths_do_not_panic() {
    let (robot, limbs) = pr2();
    let mut poses = Vec::new();
    robot.forward(&Isometry3::identity(), &[], &mut poses);
    assert_eq!(poses.len(), robot.links().len());
    let chain = &limbs.arms[0].chain;
    chain.place(&[1.0; 99], &mut []);
    chain.jacobian(&[], &mut []);
    assert_eq!(chain.pick(&[]), [0.0; 7]);
}
