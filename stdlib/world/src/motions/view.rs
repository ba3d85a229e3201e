//! How much of an object a camera sees.

use nalgebra::{Isometry3, Point3};

use crate::scene::ObjectId;
use crate::state::{Around, State};

use super::MODEL;

/// Points along each edge of the box around an object that are looked for.
const POINTS: usize = 3;

/// The share of an object, from 0 to 1, that is in the image with nothing before it. The camera looks
/// along its Z, X to the right. Points inside of the box around the object stand for it: what hides
/// all of them hides the object.
pub(super) fn visible_share(state: &State, object: ObjectId, camera: &Isometry3<f64>) -> f64 {
    let kind = state.setting.scene.kind_of(object);
    let pose = state.object_pose(object);
    let at = |index: usize, axis: usize| {
        let share = 0.1 + 0.8 * index as f64 / (POINTS - 1) as f64;
        kind.low[axis] + (kind.high[axis] - kind.low[axis]) * share
    };
    let eye = Point3::from(camera.translation.vector);
    let mut around = None;
    let mut seen = 0;
    for index in 0..POINTS.pow(3) {
        let point = Point3::new(
            at(index % POINTS, 0),
            at(index / POINTS % POINTS, 1),
            at(index / (POINTS * POINTS), 2),
        );
        let point = pose * point;
        let local = camera.inverse_transform_point(&point);
        let (right, up) = (libm::atan2(local.x, local.z), libm::atan2(local.y, local.z));
        if local.coords.norm() > MODEL.view_m || right.abs() > MODEL.view_rad || up.abs() > MODEL.view_up_rad
        {
            continue;
        }
        let around = around
            .get_or_insert_with(|| state.obstacles(&Around { without: Some(object), ..Around::default() }));
        if !around.are_between(&eye, &point) {
            seen += 1;
        }
    }
    f64::from(seen) / (POINTS.pow(3) as f64)
}
