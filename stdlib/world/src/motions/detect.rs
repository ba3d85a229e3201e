//! Seeing objects.

use nalgebra::{Translation3, Vector3};

use crate::belief::Sight;
use crate::robot::model::turn;
use crate::scene::ObjectId;
use crate::state::State;

use super::view::View;
use super::{Draws, MODEL, Outcome, Part, Trouble, machine};

/// Looks for objects that are `wanted`, and answers all that are visible; at least one must be.
///
/// `what`: the words for them in messages. `now_s`: the stamp of what is seen.
#[must_use]
pub fn detecting(
    state: &State,
    wanted: &dyn Fn(ObjectId) -> bool,
    what: &str,
    now_s: f64,
    draws: &mut Draws,
) -> Outcome {
    Outcome::of(detect(state, wanted, what, now_s, draws), vec![Part::Head])
}

/// True if the camera, as the head is turned now, has enough of an object in its image.
#[must_use]
pub fn is_visible(state: &State, object: ObjectId) -> bool {
    let Some(head) = state.machine().and_then(|machine| machine.limbs.head.as_ref()) else { return false };
    let camera = state.links().get(head.camera.index()).copied().unwrap_or_default();
    View::new(state).sight(object, &camera).visible >= MODEL.visible_share
}

fn detect(
    state: &State,
    wanted: &dyn Fn(ObjectId) -> bool,
    what: &str,
    now_s: f64,
    draws: &mut Draws,
) -> Result<Outcome, Trouble> {
    let machine = machine(state)?;
    let Some(head) = &machine.limbs.head else {
        return Err(Trouble::new("object-not-found", "this robot has no camera").name("what", what));
    };
    let camera = state.links().get(head.camera.index()).copied().unwrap_or_default();
    let view = View::new(state);
    let (mut seen, mut noticed, mut hidden_by) = (Vec::new(), Vec::new(), Vec::new());
    for object in state.objects.keys().copied() {
        // Drawn for each object, seen or not: what one sees does not change the errors of the others.
        let at =
            Vector3::new(draws.error(MODEL.seen_m), draws.error(MODEL.seen_m), draws.error(MODEL.seen_m));
        let yaw = draws.error(MODEL.seen_rad);
        let sight = view.sight(object, &camera);
        if sight.visible < MODEL.visible_share {
            hidden_by.extend(view.hides(&sight).filter(|_| wanted(object)).map(String::from));
            continue;
        }
        let pose = state.object_pose(object);
        let mut off = pose;
        off.rotation = turn(&Vector3::z_axis(), yaw) * pose.rotation;
        let sight = Sight { pose: Translation3::from(at) * off, at_s: now_s + MODEL.detect_s };
        let list = if wanted(object) { &mut seen } else { &mut noticed };
        list.push((object, sight));
    }
    if seen.is_empty() {
        hidden_by.sort();
        hidden_by.dedup();
        let hint = match hidden_by.first() {
            Some(name) => format!(": `{name}` hides it"),
            None => String::new(),
        };
        let trouble = Trouble::new("object-not-found", format!("no {what} is in sight{hint}"));
        return Err(trouble.name("what", what).names("hidden-by", hidden_by));
    }
    Ok(Outcome { duration_s: MODEL.detect_s, seen, noticed, ..Outcome::default() })
}
