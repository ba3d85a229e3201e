//! A robot as a tree of links, and where they all are: forward kinematics.
//!
//! Links stand in an order in which a parent comes before its children, so one pass from the root
//! places all of them. Joint `k` moves link `k + 1`. The root's pose in the world is the *base
//! pose*; it is no part of a configuration, because plans move the base in another way than joints.
//!
//! A *configuration* has one number for each joint that moves by itself (revolute and continuous:
//! radians, prismatic: metres); mimic joints are functions of these. Configurations are plain
//! slices; numbers that are missing count as 0, so that no length can make it panic.

use nalgebra::{Isometry3, Quaternion, Unit, UnitQuaternion, Vector3};

use crate::shape::PosedShape;

use super::error::Warning;

/// A link of one robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LinkId(pub(crate) usize);

/// A joint of one robot, fixed ones included.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JointId(pub(crate) usize);

/// A number of a configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct VariableId(pub(crate) usize);

impl LinkId {
    /// Its place in [`Robot::links`] and in the result of [`Robot::forward`].
    #[must_use]
    pub fn index(self) -> usize {
        self.0
    }
}

impl VariableId {
    /// Its place in a configuration.
    #[must_use]
    pub fn index(self) -> usize {
        self.0
    }
}

/// A rigid body of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// As in the file.
    pub name: String,
    /// The link that it hangs on; `None` for the root.
    pub parent: Option<LinkId>,
    /// What it collides with, in its own frame.
    pub shapes: Vec<PosedShape>,
    /// Kilograms; 0 if the file says nothing.
    pub mass: f64,
    /// Centre of mass in the link's frame, with the axes of [`Link::inertia`].
    pub centre_of_mass: Isometry3<f64>,
    /// Moments of inertia ixx, ixy, ixz, iyy, iyz, izz around the centre of mass, kg m².
    pub inertia: [f64; 6],
}

/// How a joint moves its child.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// Not at all.
    Fixed,
    /// Around its axis, within limits.
    Revolute,
    /// Around its axis, without end.
    Continuous,
    /// Along its axis, within limits.
    Prismatic,
}

/// What holds a link to its parent.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// As in the file.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// From the child's frame at position 0 to the parent's frame.
    pub origin: Isometry3<f64>,
    /// Direction of motion, in the child's frame.
    pub axis: Unit<Vector3<f64>>,
    /// What its position follows; `None` for a fixed joint.
    pub drive: Option<Drive>,
}

/// Position of a joint = `multiplier` × variable + `offset`. A joint that is no mimic has 1 and 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// The number of the configuration.
    pub variable: VariableId,
    /// 1, or that of the mimic.
    pub multiplier: f64,
    /// 0, or that of the mimic.
    pub offset: f64,
}

/// A number of the configuration: a joint that moves by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// The joint.
    pub joint: JointId,
    /// Least and greatest position; `None` turns without end.
    pub limits: Option<(f64, f64)>,
    /// Greatest speed, rad/s or m/s; infinite if the file says nothing.
    pub velocity: f64,
}

/// How the file lets the whole robot move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BaseJoint {
    /// The file does not say: the root stands where it is put.
    None,
    /// A planar joint above the root.
    Planar,
    /// A floating joint above the root.
    Floating,
}

/// A robot: a tree of links.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// As in the file.
    pub name: String,
    /// What it was read from, for messages.
    pub file: String,
    /// How the root may move.
    pub base_joint: BaseJoint,
    /// What was odd in the file.
    pub warnings: Vec<Warning>,
    pub(crate) links: Vec<Link>,
    pub(crate) joints: Vec<Joint>,
    pub(crate) variables: Vec<Variable>,
}

impl Robot {
    /// All links, the root first, each after its parent.
    #[must_use]
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// All joints; number `k` moves link `k + 1`.
    #[must_use]
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// What a configuration consists of.
    #[must_use]
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// The ids of all links.
    pub fn link_ids(&self) -> impl Iterator<Item = LinkId> + use<> {
        (0..self.links.len()).map(LinkId)
    }

    /// The link on which all others hang.
    #[must_use]
    pub fn root(&self) -> LinkId {
        LinkId(0)
    }

    /// The link with this name.
    #[must_use]
    pub fn link(&self, name: &str) -> Option<LinkId> {
        self.links.iter().position(|link| link.name == name).map(LinkId)
    }

    /// The joint with this name.
    #[must_use]
    pub fn joint(&self, name: &str) -> Option<JointId> {
        self.joints.iter().position(|joint| joint.name == name).map(JointId)
    }

    /// The variable that moves the joint with this name: its own, or that which it mimics.
    #[must_use]
    pub fn variable(&self, joint: &str) -> Option<VariableId> {
        let JointId(index) = self.joint(joint)?;
        self.joints[index].drive.map(|drive| drive.variable)
    }

    /// The name of a link; empty for that of another robot.
    #[must_use]
    pub fn link_name(&self, link: LinkId) -> &str {
        self.links.get(link.0).map_or("", |link| &link.name)
    }

    /// The joint that moves a link; `None` for the root.
    #[must_use]
    pub fn joint_of(&self, link: LinkId) -> Option<&Joint> {
        self.joints.get(link.0.checked_sub(1)?)
    }

    /// The configuration with all joints at 0, or as near as their limits allow.
    #[must_use]
    pub fn zero(&self) -> Vec<f64> {
        let nearest = |(low, high): (f64, f64)| 0.0_f64.clamp(low, high);
        self.variables.iter().map(|variable| variable.limits.map_or(0.0, nearest)).collect()
    }

    /// The first variable that is outside of its limits by more than `tolerance`, or no number.
    #[must_use]
    pub fn outside_limits(&self, configuration: &[f64], tolerance: f64) -> Option<VariableId> {
        let bad = |(variable, value): (&Variable, &f64)| match variable.limits {
            _ if !value.is_finite() => true,
            Some((low, high)) => *value < low - tolerance || *value > high + tolerance,
            None => false,
        };
        self.variables.iter().zip(configuration).position(bad).map(VariableId)
    }

    /// Poses of all links in the world, in the order of [`Robot::links`].
    ///
    /// `base`: pose of the root in the world. `poses` is overwritten; nothing is allocated if it
    /// was used for this robot before.
    pub fn forward(&self, base: &Isometry3<f64>, configuration: &[f64], poses: &mut Vec<Isometry3<f64>>) {
        poses.clear();
        poses.push(*base);
        for (link, joint) in self.links[1..].iter().zip(&self.joints) {
            // A parent comes before its children; were it not so, the base would be the answer.
            let parent = link.parent.and_then(|LinkId(parent)| poses.get(parent)).unwrap_or(base);
            let mut pose = parent * joint.origin;
            if let Some(drive) = joint.drive {
                let value = configuration.get(drive.variable.0).copied().unwrap_or(0.0);
                joint.kind.apply(&joint.axis, drive.multiplier * value + drive.offset, &mut pose);
            }
            poses.push(pose);
        }
    }

    /// Pose of one link in the frame of the root.
    #[must_use]
    pub fn link_in_root(&self, link: LinkId, configuration: &[f64]) -> Isometry3<f64> {
        let mut poses = Vec::with_capacity(self.links.len());
        self.forward(&Isometry3::identity(), configuration, &mut poses);
        poses.get(link.0).copied().unwrap_or_default()
    }

    /// True if `link` is `above` or hangs on it.
    #[must_use]
    pub fn hangs_on(&self, link: LinkId, above: LinkId) -> bool {
        std::iter::successors(Some(link), |link| self.links.get(link.0)?.parent).any(|each| each == above)
    }
}

impl JointKind {
    /// Moves `pose`, that of the child at position 0, to position `value`.
    #[inline]
    pub(crate) fn apply(self, axis: &Unit<Vector3<f64>>, value: f64, pose: &mut Isometry3<f64>) {
        match self {
            JointKind::Fixed => {}
            JointKind::Prismatic => pose.translation.vector += pose.rotation * (axis.into_inner() * value),
            JointKind::Revolute | JointKind::Continuous => pose.rotation *= turn(axis, value),
        }
    }

    /// True if it turns.
    #[must_use]
    pub fn turns(self) -> bool {
        matches!(self, JointKind::Revolute | JointKind::Continuous)
    }
}

/// A rotation, its sine and cosine from `libm`.
#[inline]
pub(crate) fn turn(axis: &Unit<Vector3<f64>>, angle_rad: f64) -> UnitQuaternion<f64> {
    let (sin, cos) = libm::sincos(angle_rad * 0.5);
    UnitQuaternion::new_unchecked(Quaternion::new(cos, axis.x * sin, axis.y * sin, axis.z * sin))
}
