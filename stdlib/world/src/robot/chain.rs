//! Parts of a robot: a base that drives, a torso that lifts, a head, arms with grippers.
//!
//! [`Chains`] is plain data that says which names of the file are which part; each robot needs one,
//! since URDF has no words for this. [`Robot::limbs`] looks the names up and complains about what
//! does not fit. A [`Chain`] is a path down the tree with the fixed joints folded away, which is
//! what inverse kinematics works on: forward kinematics of one arm and its Jacobian.

use nalgebra::{Isometry3, Unit, Vector3, Vector6};

use super::error::{Mistake, RobotError, nearest};
use super::model::{JointKind, LinkId, Robot, VariableId};

/// Moving joints of a chain; longer ones are refused, so that solvers need no heap.
pub const MAX_JOINTS: usize = 16;

const OUTSIDE: &str = "is outside of its limits";

// ---------------------------------------------------------------------------------------------
// Names, as data

/// Which names of a robot's file are which part.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chains {
    /// How the base moves over the floor.
    pub drive: DriveKind,
    /// The joint that lifts the torso.
    pub torso: Option<String>,
    /// The head.
    pub head: Option<HeadNames>,
    /// The arms, in the order in which plans try them.
    pub arms: Vec<ArmNames>,
}

/// How a base moves over the floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DriveKind {
    /// It stands where it is.
    #[default]
    Fixed,
    /// Forward, backward, and on the spot: two driven wheels.
    Differential,
    /// In all directions.
    Omnidirectional,
}

/// A head that pans and tilts.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadNames {
    /// The joint that turns it left and right.
    pub pan: String,
    /// The joint that turns it up and down.
    pub tilt: String,
    /// The link of the camera: looks along its Z, X to the right, as cameras of ROS do.
    pub camera: String,
}

/// An arm.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmNames {
    /// What plans call it: "left".
    pub name: String,
    /// The link that the arm is mounted on.
    pub base: String,
    /// The tool's frame: X is the direction of approach.
    pub tool: String,
    /// The hand at its end.
    pub gripper: Option<GripperNames>,
    /// Where the arm is out of the way: a position for each moving joint, base first.
    pub park: Vec<f64>,
}

/// A gripper that one joint opens.
#[derive(Debug, Clone, PartialEq)]
pub struct GripperNames {
    /// The joint.
    pub joint: String,
    /// Its position with the fingers together.
    pub closed: f64,
    /// Its position with the fingers apart.
    pub open: f64,
    /// Metres between the fingers then.
    pub width_m: f64,
    /// The links that may touch what is held.
    pub fingers: Vec<String>,
}

impl Chains {
    /// The parts of `robots/pr2.urdf`; they fit the PR2's own file, too.
    #[must_use]
    pub fn pr2() -> Chains {
        let arm = |name: &str, side: &str, park: [f64; 7]| ArmNames {
            name: name.into(),
            base: "torso_lift_link".into(),
            tool: format!("{side}_gripper_tool_frame"),
            gripper: Some(GripperNames {
                joint: format!("{side}_gripper_l_finger_joint"),
                closed: 0.0,
                open: 0.548,
                width_m: 0.09,
                fingers: [
                    "gripper_palm",
                    "gripper_l_finger",
                    "gripper_r_finger",
                    "gripper_l_finger_tip",
                    "gripper_r_finger_tip",
                ]
                .map(|part| format!("{side}_{part}_link"))
                .into(),
            }),
            park: park.into(),
        };
        Chains {
            drive: DriveKind::Omnidirectional,
            torso: Some("torso_lift_joint".into()),
            head: Some(HeadNames {
                pan: "head_pan_joint".into(),
                tilt: "head_tilt_joint".into(),
                camera: "wide_stereo_optical_frame".into(),
            }),
            arms: vec![
                arm("left", "l", [1.712, -0.264, 1.38, -2.12, -1.9, -1.3, 0.0]),
                arm("right", "r", [-1.712, -0.264, -1.38, -2.12, 1.9, -1.3, 0.0]),
            ],
        }
    }

    /// The parts of `robots/one-arm.urdf`.
    #[must_use]
    pub fn one_arm() -> Chains {
        Chains {
            drive: DriveKind::Differential,
            torso: Some("lift_joint".into()),
            head: Some(HeadNames {
                pan: "camera_pan_joint".into(),
                tilt: "camera_tilt_joint".into(),
                camera: "camera_optical_frame".into(),
            }),
            arms: vec![ArmNames {
                name: "arm".into(),
                base: "carriage_link".into(),
                tool: "tool_frame".into(),
                gripper: Some(GripperNames {
                    joint: "left_finger_joint".into(),
                    closed: 0.0,
                    open: 0.05,
                    width_m: 0.1,
                    fingers: ["hand_link", "left_finger_link", "right_finger_link"].map(String::from).into(),
                }),
                park: vec![0.0, -1.6, 2.4, 0.0, 0.8, 0.0],
            }],
        }
    }
}

// ---------------------------------------------------------------------------------------------
// Parts, looked up

/// The parts of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Limbs {
    /// How the base moves.
    pub drive: DriveKind,
    /// The torso's variable.
    pub torso: Option<VariableId>,
    /// The head.
    pub head: Option<Head>,
    /// The arms.
    pub arms: Vec<Arm>,
}

/// A head that pans and tilts.
#[derive(Debug, Clone, PartialEq)]
pub struct Head {
    /// Variable that turns it left and right.
    pub pan: VariableId,
    /// Variable that turns it up and down.
    pub tilt: VariableId,
    /// The camera's link.
    pub camera: LinkId,
}

/// An arm.
#[derive(Debug, Clone, PartialEq)]
pub struct Arm {
    /// What plans call it.
    pub name: String,
    /// From its mount to its tool.
    pub chain: Chain,
    /// The hand at its end.
    pub gripper: Option<Gripper>,
    /// Where it is out of the way; the order is that of [`Chain::variables`].
    pub park: Vec<f64>,
}

/// A gripper.
#[derive(Debug, Clone, PartialEq)]
pub struct Gripper {
    /// Variable that opens it.
    pub variable: VariableId,
    /// Value with the fingers together.
    pub closed: f64,
    /// Value with the fingers apart.
    pub open: f64,
    /// Metres between the fingers then.
    pub width_m: f64,
    /// Links that may touch what is held.
    pub fingers: Vec<LinkId>,
}

impl Gripper {
    /// The variable's value for fingers this far apart, between closed and open. Linear, which is
    /// exact for sliding fingers and good to 3 mm for those of the PR2.
    #[must_use]
    pub fn value_for_width(&self, width_m: f64) -> f64 {
        let share = (width_m / self.width_m).clamp(0.0, 1.0);
        self.closed + (self.open - self.closed) * share
    }
}

impl Robot {
    /// Looks up the parts of this robot.
    ///
    /// # Errors
    /// Names that the robot does not have, chains that are not connected, joints of a wrong kind.
    pub fn limbs(&self, chains: &Chains) -> Result<Limbs, RobotError> {
        self.look_up(chains).map_err(|mistake| mistake.of(&self.file))
    }

    fn look_up(&self, chains: &Chains) -> Result<Limbs, Mistake> {
        let torso = match &chains.torso {
            Some(joint) => Some(self.moving("the torso", joint)?),
            None => None,
        };
        let head = match &chains.head {
            Some(names) => Some(Head {
                pan: self.moving("the head", &names.pan)?,
                tilt: self.moving("the head", &names.tilt)?,
                camera: self.known_link("the head", &names.camera)?,
            }),
            None => None,
        };
        let mut arms: Vec<Arm> = Vec::new();
        for names in &chains.arms {
            if arms.iter().any(|arm| arm.name == names.name) {
                return Err(Mistake::Duplicate { kind: "arm", name: names.name.clone() });
            }
            arms.push(self.arm(names)?);
        }
        Ok(Limbs { drive: chains.drive, torso, head, arms })
    }

    fn arm(&self, names: &ArmNames) -> Result<Arm, Mistake> {
        let part = format!("the arm `{}`", names.name);
        let chain = self.chain_of(&part, &names.base, &names.tool)?;
        let (given, needed) = (names.park.len(), chain.variables().len());
        if given != needed {
            return Err(Mistake::WrongCount { part, given, needed });
        }
        for ((value, limits), variable) in names.park.iter().zip(chain.limits()).zip(chain.variables()) {
            let inside = limits.is_none_or(|(low, high)| (low..=high).contains(value));
            if !(value.is_finite() && inside) {
                let joint = self.joints[self.variables[variable.0].joint.0].name.clone();
                return Err(Mistake::BadValue { part, joint, what: "the parked position", why: OUTSIDE });
            }
        }
        let gripper = match &names.gripper {
            Some(names) => Some(self.gripper(&part, names)?),
            None => None,
        };
        Ok(Arm { name: names.name.clone(), chain, gripper, park: names.park.clone() })
    }

    fn gripper(&self, part: &str, names: &GripperNames) -> Result<Gripper, Mistake> {
        let part = format!("the gripper of {part}");
        let variable = self.moving(&part, &names.joint)?;
        let bad = |what, why| Mistake::BadValue { part: part.clone(), joint: names.joint.clone(), what, why };
        let inside = |value: f64| {
            value.is_finite()
                && self.variables[variable.0].limits.is_none_or(|(low, high)| (low..=high).contains(&value))
        };
        for (what, value) in [("the open position", names.open), ("the closed position", names.closed)] {
            if !inside(value) {
                return Err(bad(what, OUTSIDE));
            }
        }
        if !(names.width_m.is_finite() && names.width_m > 0.0) {
            return Err(bad("the width", "is not above 0"));
        }
        let fingers = names.fingers.iter().map(|finger| self.known_link(&part, finger));
        Ok(Gripper {
            variable,
            closed: names.closed,
            open: names.open,
            width_m: names.width_m,
            fingers: fingers.collect::<Result<_, _>>()?,
        })
    }

    fn known_link(&self, part: &str, name: &str) -> Result<LinkId, Mistake> {
        self.link(name).ok_or_else(|| Mistake::UnknownName {
            part: part.into(),
            kind: "link",
            name: name.into(),
            did_you_mean: nearest(name, self.links.iter().map(|link| link.name.as_str())),
        })
    }

    /// The variable of a joint that moves by itself.
    fn moving(&self, part: &str, name: &str) -> Result<VariableId, Mistake> {
        let id = self.joint(name).ok_or_else(|| Mistake::UnknownName {
            part: part.into(),
            kind: "joint",
            name: name.into(),
            did_you_mean: nearest(name, self.joints.iter().map(|joint| joint.name.as_str())),
        })?;
        let wrong = |why| Mistake::WrongJoint { part: part.into(), joint: name.into(), why };
        let drive = self.joints[id.0].drive.ok_or_else(|| wrong("is fixed"))?;
        match self.variables[drive.variable.0].joint == id {
            true => Ok(drive.variable),
            false => Err(wrong("only mimics another one; name that one")),
        }
    }

    /// The chain from link `base` down to link `tip`.
    ///
    /// # Errors
    /// Unknown links, links that are not connected, nothing that moves between them.
    pub fn chain(&self, base: &str, tip: &str) -> Result<Chain, RobotError> {
        self.chain_of("the chain", base, tip).map_err(|mistake| mistake.of(&self.file))
    }

    fn chain_of(&self, part: &str, base: &str, tip: &str) -> Result<Chain, Mistake> {
        let (base_id, tip_id) = (self.known_link(part, base)?, self.known_link(part, tip)?);
        if !self.hangs_on(tip_id, base_id) {
            return Err(Mistake::NotConnected { part: part.into(), base: base.into(), tip: tip.into() });
        }
        let mut path: Vec<LinkId> = std::iter::successors(Some(tip_id), |link| self.links[link.0].parent)
            .take_while(|link| *link != base_id)
            .collect();
        path.reverse();
        let chain = Chain::of(self, base_id, tip_id, &path);
        if chain.segments.is_empty() {
            return Err(Mistake::NothingMoves { part: part.into(), base: base.into(), tip: tip.into() });
        }
        let joints = chain.segments.len();
        if joints > MAX_JOINTS {
            return Err(Mistake::ChainTooLong { part: part.into(), joints, limit: MAX_JOINTS });
        }
        Ok(chain)
    }
}

// ---------------------------------------------------------------------------------------------
// A path down the tree

/// A path down the tree of links. Its own configurations have one number for each variable on the
/// path, base first.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    base: LinkId,
    tip: LinkId,
    variables: Vec<VariableId>,
    limits: Vec<Option<(f64, f64)>>,
    pub(crate) segments: Vec<Segment>,
    pub(crate) tool: Isometry3<f64>,
}

/// A moving joint with the fixed ones before it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Segment {
    /// From the joint's frame at position 0 to the frame of the moving joint before.
    pub origin: Isometry3<f64>,
    pub axis: Unit<Vector3<f64>>,
    pub kind: JointKind,
    /// Which number of the chain's configuration moves it, and how.
    pub column: usize,
    pub multiplier: f64,
    pub offset: f64,
}

impl Chain {
    fn of(robot: &Robot, base: LinkId, tip: LinkId, path: &[LinkId]) -> Chain {
        let mut chain = Chain {
            base,
            tip,
            variables: Vec::new(),
            limits: Vec::new(),
            segments: Vec::new(),
            tool: Isometry3::identity(),
        };
        for joint in path.iter().filter_map(|link| robot.joint_of(*link)) {
            chain.tool *= joint.origin;
            let Some(drive) = joint.drive else { continue };
            let known = chain.variables.iter().position(|variable| *variable == drive.variable);
            let column = known.unwrap_or_else(|| {
                chain.variables.push(drive.variable);
                chain.limits.push(robot.variables[drive.variable.0].limits);
                chain.variables.len() - 1
            });
            chain.segments.push(Segment {
                origin: std::mem::replace(&mut chain.tool, Isometry3::identity()),
                axis: joint.axis,
                kind: joint.kind,
                column,
                multiplier: drive.multiplier,
                offset: drive.offset,
            });
        }
        chain
    }

    /// The link that poses of the tip are given in.
    #[must_use]
    pub fn base(&self) -> LinkId {
        self.base
    }

    /// The link that is moved.
    #[must_use]
    pub fn tip(&self) -> LinkId {
        self.tip
    }

    /// Which numbers of the robot's configuration move it.
    #[must_use]
    pub fn variables(&self) -> &[VariableId] {
        &self.variables
    }

    /// Their limits; `None` turns without end.
    #[must_use]
    pub fn limits(&self) -> &[Option<(f64, f64)>] {
        &self.limits
    }

    /// This chain's part of a configuration of the robot.
    #[must_use]
    pub fn pick(&self, configuration: &[f64]) -> Vec<f64> {
        self.variables.iter().map(|variable| configuration.get(variable.0).copied().unwrap_or(0.0)).collect()
    }

    /// Writes this chain's part into a configuration of the robot.
    pub fn place(&self, values: &[f64], configuration: &mut [f64]) {
        for (variable, value) in self.variables.iter().zip(values) {
            if let Some(number) = configuration.get_mut(variable.0) {
                *number = *value;
            }
        }
    }

    /// Pose of the tip in the frame of the base.
    #[must_use]
    pub fn forward(&self, values: &[f64]) -> Isometry3<f64> {
        let mut pose = Isometry3::identity();
        for segment in &self.segments {
            pose *= segment.origin;
            segment.kind.apply(&segment.axis, segment.position(values), &mut pose);
        }
        pose * self.tool
    }

    /// Pose of the tip in the frame of the base, and how it moves: `columns[k]` is the velocity
    /// (m/s, then rad/s, in the axes of the base) of the tip for unit speed of variable `k`.
    ///
    /// `columns` needs the length of [`Chain::variables`]; those that are missing are left out.
    pub fn jacobian(&self, values: &[f64], columns: &mut [Vector6<f64>]) -> Isometry3<f64> {
        let mut axes = [(Vector3::zeros(), Vector3::zeros()); MAX_JOINTS];
        let mut pose = Isometry3::identity();
        for (segment, place) in self.segments.iter().zip(&mut axes) {
            pose *= segment.origin;
            *place =
                (pose.rotation * segment.axis.into_inner() * segment.multiplier, pose.translation.vector);
            segment.kind.apply(&segment.axis, segment.position(values), &mut pose);
        }
        pose *= self.tool;
        columns.fill(Vector6::zeros());
        for (segment, (axis, at)) in self.segments.iter().zip(&axes) {
            let Some(column) = columns.get_mut(segment.column) else { continue };
            let (linear, angular) = match segment.kind.turns() {
                true => (axis.cross(&(pose.translation.vector - at)), *axis),
                false => (*axis, Vector3::zeros()),
            };
            *column += Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z);
        }
        pose
    }

    /// Metres from the first moving joint to the tip at most.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        let slide = |segment: &Segment| match (segment.kind, self.limits[segment.column]) {
            (JointKind::Prismatic, Some((low, high))) => {
                (low.abs().max(high.abs()) * segment.multiplier.abs()) + segment.offset.abs()
            }
            _ => 0.0,
        };
        let offsets = self.segments.iter().skip(1).map(|segment| segment.origin.translation.vector.norm());
        let slides: f64 = self.segments.iter().map(slide).sum();
        offsets.sum::<f64>() + slides + self.tool.translation.vector.norm()
    }
}

impl Segment {
    #[inline]
    pub(crate) fn position(&self, values: &[f64]) -> f64 {
        self.multiplier * values.get(self.column).copied().unwrap_or(0.0) + self.offset
    }
}
