//! What hides objects from a camera: all that stands around, the robot itself, and what it carries.

use nalgebra::Isometry3;

use crate::robot::model::{Joint, LinkId};
use crate::scene::{ContainerId, ObjectId};
use crate::setting::Machine;
use crate::shape::PosedShape;
use crate::sight::{Sight, Things};
use crate::state::State;

use super::MODEL;

/// All that could hide something, made once for a look around.
pub(crate) struct View<'s> {
    state: &'s State,
    things: Things,
    names: Vec<String>,
    /// The first object's number.
    objects: usize,
}

impl<'s> View<'s> {
    pub fn new(state: &'s State) -> View<'s> {
        let (scene, mut things, mut names) = (&state.setting.scene, Things::default(), Vec::new());
        for fixture in &scene.fixtures {
            things.push(&fixture.pose, &fixture.shapes);
            names.push(fixture.name.clone());
        }
        for (number, container) in scene.containers.iter().enumerate() {
            let id = ContainerId(number);
            things.push(&state.setting.container_pose(id, state.opening(id)), &container.shapes);
            names.push(container.name.clone());
        }
        if let Some(machine) = state.machine() {
            for ((id, link), pose) in machine.robot.link_ids().zip(machine.robot.links()).zip(state.links()) {
                // A camera looks out of its head.
                if !is_of_the_head(machine, id) {
                    things.push(&pose, &link.shapes);
                    names.push(link.name.clone());
                }
            }
        }
        let objects = things.len();
        for object in state.objects.keys() {
            things.push(&state.object_pose(*object), &scene.kind_of(*object).shapes);
            names.push(scene.objects[object.0].name.clone());
        }
        View { state, things, names, objects }
    }

    /// How a camera, whose frame is at `eye`, sees an object.
    pub fn sight(&self, object: ObjectId, eye: &Isometry3<f64>) -> Sight {
        let own = self.state.objects.keys().position(|it| *it == object).unwrap_or(0);
        let shapes = &self.state.setting.scene.kind_of(object).shapes;
        let pose = self.state.object_pose(object);
        self.things.sight(&MODEL.camera, eye, (&pose, shapes), &[self.objects + own])
    }

    /// How a camera sees a body that is not there: what is at its place.
    pub fn sight_of(&self, pose: &Isometry3<f64>, shapes: &[PosedShape], eye: &Isometry3<f64>) -> Sight {
        self.things.sight(&MODEL.camera, eye, (pose, shapes), &[])
    }

    /// What hides most of something.
    pub fn hides(&self, sight: &Sight) -> Option<&str> {
        let (number, share) = sight.hidden.first()?;
        (*share > sight.outside).then(|| self.names[*number].as_str())
    }
}

/// True for what turns with the camera.
fn is_of_the_head(machine: &Machine, link: LinkId) -> bool {
    let Some(head) = &machine.limbs.head else { return false };
    let pans = |joint: &Joint| joint.drive.is_some_and(|drive| drive.variable == head.pan);
    // Joint `k` moves link `k + 1`.
    let neck = machine.robot.joints().iter().position(pans).map(|joint| LinkId(joint + 1));
    neck.is_some_and(|neck| machine.robot.hangs_on(link, neck))
}
