//! What furniture hides: lines of sight in a room without objects and without the robot.

use nalgebra::{Isometry3, Vector3};

use crate::motions::MODEL;
use crate::scene::{ContainerId, boxed};
use crate::shape::PosedShape;
use crate::sight::Things;
use crate::state::State;

/// Edge of what is looked for at a point.
const SMALL_M: f64 = 0.05;

/// Furniture, walls, doors and drawers as they are.
pub(super) struct Open {
    things: Things,
    small: [PosedShape; 1],
}

impl Open {
    pub fn new(state: &State) -> Open {
        let mut things = Things::default();
        for fixture in &state.setting.scene.fixtures {
            things.push(&fixture.pose, &fixture.shapes);
        }
        for (number, container) in state.setting.scene.containers.iter().enumerate() {
            let id = ContainerId(number);
            things.push(&state.setting.container_pose(id, state.opening(id)), &container.shapes);
        }
        Open { things, small: [boxed(Vector3::repeat(SMALL_M), Vector3::new(0.0, 0.0, SMALL_M), 0.0)] }
    }

    /// True if a camera sees something small that stands at a point.
    pub fn sees(&self, eye: &Isometry3<f64>, point: &Vector3<f64>) -> bool {
        let pose = Isometry3::from_parts((*point).into(), nalgebra::UnitQuaternion::identity());
        let sight = self.things.sight(&MODEL.camera, eye, (&pose, &self.small), &[]);
        sight.visible >= MODEL.visible_share
    }
}
