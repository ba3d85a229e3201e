//! The world and what the robot believes of it at one moment, as JSON.
//!
//! Keys and numbers are those of a recording; see [`super::json`].

use serde_json::{Value as Json, json};

use crate::robot::Robot;
use crate::state::State;
use crate::world::World;

use super::json::{held, joints, named, number, openings, pose};
use super::{json, seconds};

impl World {
    /// The truth at a time of the task clock, with all motions that go on played up to it; nothing where there is
    /// neither robot nor scene. Motions are played as they should go: what physics makes of one is computed at its end.
    #[must_use]
    pub fn moment(&self, now_ns: u64) -> Option<Json> {
        let scene = &self.state.setting.scene;
        if self.state.machine().is_none() && scene.objects.is_empty() && scene.fixtures.is_empty() {
            return None;
        }
        let mut state = self.state.clone();
        let mut motions = Vec::new();
        for (motion, track, began_ns, lasts_s) in self.going_on() {
            let passed_s = seconds(now_ns.saturating_sub(began_ns));
            if passed_s > 0.0 {
                track.play(&mut state, passed_s);
            }
            let name = motion.map(json::name);
            motions
                .push(json!({"motion": name, "begin": number(seconds(began_ns)), "lasts": number(lasts_s)}));
        }
        let robot = state.machine().map(|machine| robot(&state, &machine.robot));
        Some(json!({
            "robot": robot, "hands": held(&state), "objects": objects(&state), "containers": openings(&state),
            "motions": motions,
        }))
    }

    /// What the robot knows: objects as it saw them last, containers that it left open.
    #[must_use]
    pub fn beliefs(&self) -> Json {
        let scene = &self.state.setting.scene;
        let seen = self.belief.seen.iter().filter_map(|(object, sight)| {
            let name = &scene.objects.get(object.0)?.name;
            Some(json!({"name": name, "at": number(sight.at_s), "pose": pose(&sight.pose)}))
        });
        let open = self.belief.open.iter();
        let open = open.map(|(id, by)| (self.state.setting.container(*id).name.clone(), *by));
        json!({"seen": seen.collect::<Json>(), "open": named(open, number)})
    }
}

fn robot(state: &State, robot: &Robot) -> Json {
    json!({"name": robot.name, "base": pose(&state.base), "joints": joints(state, robot)})
}

fn objects(state: &State) -> Json {
    let scene = &state.setting.scene;
    let object = |(id, place): (&crate::scene::ObjectId, &crate::state::Place)| {
        json!({
            "name": scene.objects[id.0].name, "type": scene.kind_of(*id).name, "on": state.support_name(place.on),
            "pose": pose(&state.object_pose(*id)),
        })
    };
    state.objects.iter().map(object).collect()
}
