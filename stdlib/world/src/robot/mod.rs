//! Robots: from a URDF file to what they can reach and what they touch.
//!
//! [`urdf`] reads a file into a [`Robot`] ([`model`]), which places its links: forward kinematics.
//! [`chain`] names its parts, [`Chains`] for the caller, [`Limbs`] for the machine, and has the
//! Jacobian. [`ik`] inverts a chain; [`look`] turns
//! a head to a point; [`collision`] asks what touches; [`path`] goes from one
//! configuration to another and looks where that leads.
//!
//! Frames follow REP 103 and 105: X forward, Y left, Z up; a tool points along its X. The pose of a
//! robot in the world is that of its root link.

pub mod chain;
pub mod collision;
pub mod error;
pub mod ik;
pub mod look;
pub mod model;
pub mod path;
pub mod urdf;

pub use chain::{Chain, Chains, Limbs};
pub use collision::CollisionModel;
pub use error::{Mistake, RobotError, Warning};
pub use model::{LinkId, Robot, VariableId};
