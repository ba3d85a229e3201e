//! What does not change while a plan runs: the scene, the robot, and bodies made ready for questions.
//!
//! Made once by `use-scene` and `use-robot` and shared by all forks of a world.

use std::sync::Arc;

use nalgebra::Isometry3;

use crate::robot::collision::{Body, CollisionModel};
use crate::robot::ik::Solver;
use crate::robot::{Chains, Limbs, Robot, RobotError};
use crate::scene::{Container, ContainerId, KindId, ObjectId, Scene, SurfaceId};

/// Scene and robot.
pub struct Setting {
    /// The scene.
    pub scene: Scene,
    /// The robot, once there is one.
    pub machine: Option<Arc<Machine>>,
    /// Bodies of fixtures, of the moving parts of containers, of kinds: as they stand around.
    pub(crate) fixtures: Vec<Body>,
    pub(crate) containers: Vec<Body>,
    pub(crate) kinds: Vec<Body>,
    /// The same a little smaller, as they are when a robot moves them.
    pub(crate) moving_containers: Vec<Body>,
    pub(crate) moving_kinds: Vec<Body>,
}

/// A robot with all that is computed from it once.
pub struct Machine {
    /// Its links and joints.
    pub robot: Robot,
    /// Its parts.
    pub limbs: Limbs,
    /// What may touch what.
    pub model: CollisionModel,
    /// Inverse kinematics, one for each arm.
    pub solvers: Vec<Solver>,
}

impl Machine {
    /// Looks the parts up and prepares what motions ask for.
    ///
    /// # Errors
    /// Parts that the robot does not have.
    pub fn new(robot: Robot, chains: &Chains) -> Result<Machine, RobotError> {
        let limbs = robot.limbs(chains)?;
        let model = CollisionModel::new(&robot, &limbs);
        let solvers = limbs.arms.iter().map(|arm| Solver::new(&arm.chain)).collect();
        Ok(Machine { robot, limbs, model, solvers })
    }

    /// The arm with this name.
    #[must_use]
    pub fn arm(&self, name: &str) -> Option<usize> {
        self.limbs.arms.iter().position(|arm| arm.name == name)
    }

    /// How it begins: arms parked, grippers shut, all else as near to zero as the limits allow.
    #[must_use]
    pub fn start(&self) -> Vec<f64> {
        let mut configuration = self.robot.zero();
        for arm in &self.limbs.arms {
            arm.chain.place(&arm.park, &mut configuration);
            if let Some(gripper) = &arm.gripper {
                configuration[gripper.variable.index()] = gripper.closed;
            }
        }
        configuration
    }
}

impl Setting {
    /// A setting with bodies for all that is in the scene.
    #[must_use]
    pub fn new(scene: Scene, machine: Option<Arc<Machine>>) -> Setting {
        Setting {
            fixtures: scene.fixtures.iter().map(|it| Body::new(&it.shapes)).collect(),
            containers: scene.containers.iter().map(|it| Body::new(&it.shapes)).collect(),
            kinds: scene.kinds.iter().map(|it| Body::new(&it.shapes)).collect(),
            moving_containers: scene.containers.iter().map(|it| Body::moving(&it.shapes)).collect(),
            moving_kinds: scene.kinds.iter().map(|it| Body::moving(&it.shapes)).collect(),
            scene,
            machine,
        }
    }

    /// A container.
    #[must_use]
    pub fn container(&self, id: ContainerId) -> &Container {
        &self.scene.containers[id.0]
    }

    /// The kind of an object.
    #[must_use]
    pub fn kind_id(&self, object: ObjectId) -> KindId {
        self.scene.objects[object.0].kind
    }

    /// Pose of a container's moving part in the world; that of its owner if it is shut.
    #[must_use]
    pub fn container_pose(&self, id: ContainerId, position: f64) -> Isometry3<f64> {
        let it = self.container(id);
        self.scene.fixtures[it.owner.0].pose * it.joint.moved(position)
    }

    /// Name of a surface.
    #[must_use]
    pub fn surface_name(&self, id: SurfaceId) -> &str {
        &self.scene.surfaces[id.0].name
    }
}
