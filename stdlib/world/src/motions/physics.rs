//! Rapier for things of the size of a hand: how its world is set up, for [`super::settle`] and [`super::simulate`].
//!
//! Coordinates are those around a place, so that nothing is lost in `f32` far from the origin of ours. What comes out is
//! in ours again.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use rapier3d::prelude::*;

use crate::parry::{Solid, pose as parry_pose};
use crate::scene::Kind;
use crate::shape::PosedShape;

/// Friction of furniture, of the floor, and of the robot.
pub(super) const WOOD: f64 = 0.6;

/// Bodies around a place.
pub(super) struct Physics {
    pub world: PhysicsWorld,
    local: Translation3<f64>,
}

impl Physics {
    /// Nothing, around the place that `local` moves to the origin.
    pub fn new(local: Translation3<f64>, step_s: f32) -> Physics {
        // By default contacts are those of things ten times as large, and one is used again until the two have moved by
        // 5 cm, with the normal that it had.
        let integration_parameters = IntegrationParameters {
            dt: step_s,
            length_unit: 0.1,
            contact_recycling: false,
            ..IntegrationParameters::default()
        };
        let gravity = Vector::new(0.0, 0.0, -9.81);
        Physics { world: PhysicsWorld { gravity, integration_parameters, ..PhysicsWorld::new() }, local }
    }

    /// A pose of ours, as rapier has it here.
    fn here(&self, pose: &Isometry3<f64>) -> Pose {
        parry_pose(&(self.local * pose))
    }

    /// Where a body is.
    pub fn pose_of(&self, body: RigidBodyHandle) -> Isometry3<f64> {
        let pose = self.world.bodies[body].position();
        let (t, r) = (pose.translation, pose.rotation);
        let turn = nalgebra::Quaternion::new(f64::from(r.w), f64::from(r.x), f64::from(r.y), f64::from(r.z));
        let at = Translation3::new(f64::from(t.x), f64::from(t.y), f64::from(t.z));
        self.local.inverse() * Isometry3::from_parts(at, UnitQuaternion::from_quaternion(turn))
    }

    /// Adds a shape that stands still: at `pose` in our world, with an own pose in there.
    pub fn stand(
        &mut self,
        pose: &Isometry3<f64>,
        shape: &PosedShape,
        friction: f64,
        groups: InteractionGroups,
    ) {
        let posed = PosedShape { pose: self.local * pose * shape.pose, shape: shape.shape };
        self.world.insert_collider(collider(&posed, friction).collision_groups(groups), None);
    }

    /// Adds an object that moves as physics wants, with shapes that `made` has the last word on.
    pub fn drop_in(
        &mut self,
        kind: &Kind,
        pose: &Isometry3<f64>,
        friction: f64,
        made: impl Fn(ColliderBuilder) -> ColliderBuilder,
    ) -> RigidBodyHandle {
        let body = RigidBodyBuilder::dynamic().pose(self.here(pose)).can_sleep(false);
        let body = self.world.insert_body(body);
        let volume: f64 = kind.shapes.iter().map(|it| it.shape.volume()).sum();
        let density = (kind.mass_kg / volume.max(1e-9)) as f32;
        for shape in &kind.shapes {
            self.world.insert_collider(made(collider(shape, friction).density(density)), Some(body));
        }
        body
    }

    /// Adds a body that goes where it is told to.
    pub fn lead(
        &mut self,
        pose: &Isometry3<f64>,
        shapes: &[PosedShape],
        groups: InteractionGroups,
    ) -> RigidBodyHandle {
        let body = RigidBodyBuilder::kinematic_position_based().pose(self.here(pose));
        let body = self.world.insert_body(body);
        for shape in shapes {
            self.world.insert_collider(collider(shape, WOOD).collision_groups(groups), Some(body));
        }
        body
    }

    /// Such a body goes there in the next step.
    pub fn go(&mut self, body: RigidBodyHandle, pose: &Isometry3<f64>) {
        let pose = self.here(pose);
        self.world.bodies[body].set_next_kinematic_position(pose);
    }

    /// True if a body is slower than `most`, m/s and rad/s.
    pub fn rests(&self, body: RigidBodyHandle, most: f32) -> bool {
        let body = &self.world.bodies[body];
        body.linvel().length() < most && body.angvel().length() < most
    }
}

fn collider(posed: &PosedShape, friction: f64) -> ColliderBuilder {
    let (at, solid) = Solid::new(posed).part();
    ColliderBuilder::new(solid).position(at).friction(friction as f32)
}
