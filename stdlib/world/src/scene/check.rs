//! Whether a scene could stand in a house: nothing overlaps, objects stand where they are said to stand.

use nalgebra::Isometry3;

use crate::parry::Solid;
use crate::read::Mistake;
use crate::robot::collision::SLACK_M;
use crate::shape::PosedShape;

use super::{ContainerId, ObjectId, Scene};

/// A body at its place.
struct Standing<'a> {
    what: String,
    pose: Isometry3<f64>,
    shapes: &'a [PosedShape],
    /// Walls and furniture are built into one another as people like.
    fixed: bool,
    /// Of a container: the object that stands in it must not overlap with it, its furniture must not either.
    container: Option<ContainerId>,
}

/// What is wrong with a scene whose entries are right each by itself.
#[must_use]
pub fn mistakes(scene: &Scene) -> Vec<Mistake> {
    let mut mistakes = Vec::new();
    for (number, object) in scene.objects.iter().enumerate() {
        let Some(surface) = object.on.map(|on| &scene.surfaces[on.0]) else { continue };
        let at = object.pose.translation.vector;
        if at.x.abs() > surface.size[0] * 0.5 || at.y.abs() > surface.size[1] * 0.5 {
            let [x, y] = surface.size.map(|edge| edge * 0.5);
            mistakes.push(Mistake::new(
                &format!("the object `{}`", scene.objects[number].name),
                format!("stands beside the surface `{}`", surface.name),
                format!("`at` lies within {x} and {y} m of its middle"),
            ));
        }
    }
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let there = scene.objects.iter().filter(|object| object.on == Some(super::SurfaceId(index))).count();
        if surface.capacity.is_some_and(|capacity| there > capacity) {
            mistakes.push(Mistake::new(
                &format!("the surface `{}`", surface.name),
                format!("has {there} objects on it, more than its capacity"),
                "put some of them elsewhere",
            ));
        }
    }
    let bodies = bodies(scene);
    for (second, b) in bodies.iter().enumerate() {
        for a in &bodies[..second] {
            if !(a.fixed && b.fixed) && overlap(a, b) {
                let problem = format!("overlaps with {}", a.what);
                mistakes.push(Mistake::new(&b.what, problem, "move one of them by its `at`"));
            }
        }
    }
    mistakes
}

fn bodies(scene: &Scene) -> Vec<Standing<'_>> {
    let fixtures = scene.fixtures.iter().map(|it| Standing {
        what: format!("the furniture `{}`", it.name),
        pose: it.pose,
        shapes: &it.shapes,
        fixed: true,
        container: None,
    });
    let containers = scene.containers.iter().enumerate().map(|(index, it)| Standing {
        what: format!("the container `{}`", it.name),
        pose: scene.fixtures[it.owner.0].pose,
        shapes: &it.shapes,
        fixed: false,
        container: Some(ContainerId(index)),
    });
    let objects = scene.objects.iter().enumerate().map(|(index, it)| Standing {
        what: format!("the object `{}`", it.name),
        pose: scene.start_pose(ObjectId(index)),
        shapes: &scene.kind_of(ObjectId(index)).shapes,
        fixed: false,
        container: None,
    });
    fixtures.chain(containers).chain(objects).collect()
}

fn overlap(a: &Standing<'_>, b: &Standing<'_>) -> bool {
    // Doors of one piece of furniture stand edge to edge, as their maker likes.
    if a.container.is_some() && b.container.is_some() {
        return false;
    }
    b.shapes.iter().any(|shape| {
        let smaller = PosedShape { pose: shape.pose, shape: shape.shape.shrunk(SLACK_M) };
        let solid = Solid::new(&smaller);
        a.shapes.iter().any(|other| {
            let reach = shape.shape.bounding_radius() + other.shape.bounding_radius();
            let between = (b.pose * shape.pose).translation.vector - (a.pose * other.pose).translation.vector;
            between.norm() <= reach && solid.touches(&b.pose, &Solid::new(other), &a.pose)
        })
    })
}

impl Scene {
    /// Where an object is at first, everything shut.
    #[must_use]
    pub fn start_pose(&self, object: ObjectId) -> Isometry3<f64> {
        let it = &self.objects[object.0];
        it.on.map_or(it.pose, |on| {
            let surface = &self.surfaces[on.0];
            self.fixtures[surface.owner.0].pose * surface.pose * it.pose
        })
    }
}
