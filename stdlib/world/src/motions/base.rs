//! Driving.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use nalgebra::{Isometry3, Vector2};

use crate::nav::map::blocker_at;
use crate::nav::{Barrier, Blocker, Flood, Footprint, Map, NoWay, Place, Room, Settings};
use crate::robot::chain::DriveKind;
use crate::scene::{ContainerId, SurfaceId};
use crate::shape::PosedShape;
use crate::state::{Grip, State, Support};

use super::{Costs, Draws, Key, MODEL, Outcome, Part, Track, Trouble, machine};

/// Free floor around everything that stands in a scene, metres.
const AROUND_M: f64 = 1.0;
/// Half of the edge of a room with nothing in it.
const EMPTY_M: f64 = 10.0;
/// Keys of a track are so far apart, seconds.
const KEY_S: f64 = 0.25;

/// Maps of the states that were asked last, and floods through them. As long as only the base moves, one map holds;
/// where only doors and objects are elsewhere, what never moves is not computed again. Forks of a world share them.
#[derive(Clone, Default)]
pub struct Maps(Rc<RefCell<Known>>);

#[derive(Default)]
struct Known {
    maps: Vec<(State, Arc<Map>)>,
    floods: Vec<(Arc<Map>, Rc<Flood>)>,
}

/// Outlines for which maps are kept: with parked arms, and with this or that in the hands.
const KEPT: usize = 4;
/// Floods that are kept: from where the base is, and from where it is said to be.
const KEPT_FLOODS: usize = 2;

impl Maps {
    /// The map of a state.
    #[must_use]
    pub fn of(&self, state: &State) -> Arc<Map> {
        let known = &mut self.0.borrow_mut().maps;
        if let Some(place) = known.iter().position(|(other, _)| looks_alike(other, state)) {
            let found = known.remove(place);
            let map = Arc::clone(&found.1);
            known.push(found);
            return map;
        }
        let barriers = barriers(state);
        let (room, footprint) = (room(&barriers), footprint(state));
        let same = known.iter().rev().find(|(_, map)| *map.footprint() == footprint);
        let map = Arc::new(match same {
            Some((_, map)) => map.again(room, &barriers, footprint),
            None => Map::new(room, &barriers, footprint, Settings::default()),
        });
        if known.len() == KEPT {
            known.remove(0);
        }
        known.push((state.clone(), Arc::clone(&map)));
        map
    }

    /// The map of a state, and how far everything is from where its base stands.
    ///
    /// # Errors
    /// The base stands where it cannot.
    pub fn ground(&self, state: &State, drive: DriveKind) -> Result<(Arc<Map>, Rc<Flood>), NoWay> {
        let (map, start) = (self.of(state), Place::of_pose(&state.base));
        let floods = &mut self.0.borrow_mut().floods;
        let same = |(other, flood): &(Arc<Map>, Rc<Flood>)| {
            Arc::ptr_eq(other, &map) && flood.start() == start && flood.drive_kind() == drive
        };
        if let Some((_, flood)) = floods.iter().find(|it| same(it)) {
            return Ok((Arc::clone(&map), Rc::clone(flood)));
        }
        let flood = Rc::new(Flood::new(&map, start, drive)?);
        if floods.len() == KEPT_FLOODS {
            floods.remove(0);
        }
        floods.push((Arc::clone(&map), Rc::clone(&flood)));
        Ok((map, flood))
    }
}

/// What the base of a state touches where it stands; quicker than a map.
#[must_use]
pub fn blocker_of(state: &State) -> Option<Blocker> {
    blocker_at(&barriers(state), &footprint(state), &Place::of_pose(&state.base))
}

/// True if both have the same outline among the same obstacles.
fn looks_alike(a: &State, b: &State) -> bool {
    Arc::ptr_eq(&a.setting, &b.setting)
        && a.joints == b.joints
        && a.openings == b.openings
        && a.hands == b.hands
        && a.objects == b.objects
}

/// All that is in the way of a base, in a fixed order.
fn barriers(state: &State) -> Vec<Barrier<'_>> {
    let scene = &state.setting.scene;
    let mut barriers: Vec<Barrier<'_>> = Vec::new();
    for fixture in &scene.fixtures {
        barriers.push(Barrier { pose: fixture.pose, shapes: &fixture.shapes, fixed: true });
    }
    for (number, container) in scene.containers.iter().enumerate() {
        let id = ContainerId(number);
        let pose = state.setting.container_pose(id, state.opening(id));
        barriers.push(Barrier { pose, shapes: &container.shapes, fixed: false });
    }
    for object in state.objects.keys().filter(|it| !matches!(state.ground_of(**it), Support::Hand(_))) {
        let shapes = &scene.kind_of(*object).shapes;
        barriers.push(Barrier { pose: state.object_pose(*object), shapes, fixed: false });
    }
    barriers
}

/// The floor around what never moves.
fn room(barriers: &[Barrier<'_>]) -> Room {
    let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
    for barrier in barriers.iter().filter(|it| it.fixed) {
        for shape in barrier.shapes {
            let (least, most) = PosedShape { pose: barrier.pose * shape.pose, shape: shape.shape }.bounds();
            (low, high) = (low.inf(&least.xy()), high.sup(&most.xy()));
        }
    }
    if low.x > high.x {
        (low, high) = (Vector2::repeat(-EMPTY_M), Vector2::repeat(EMPTY_M));
    }
    Room { low: low.add_scalar(-AROUND_M), high: high.add_scalar(AROUND_M) }
}

/// The outlines of the robot with what it carries, cut above the worktops that stand around: an arm above one
/// must not count as an arm in it.
fn footprint(state: &State) -> Footprint {
    let Some(machine) = state.machine() else { return Footprint::new(&[], &[]) };
    let scene = &state.setting.scene;
    let links = state.links();
    let into_root = state.base.inverse();
    let mut shapes = Vec::new();
    for (link, pose) in machine.robot.links().iter().zip(&links) {
        shapes.extend(
            link.shapes.iter().map(|it| PosedShape { pose: into_root * pose * it.pose, shape: it.shape }),
        );
    }
    for object in state.objects.keys().filter(|it| matches!(state.ground_of(**it), Support::Hand(_))) {
        let pose = into_root * state.object_pose(*object);
        let kind = scene.kind_of(*object);
        shapes.extend(kind.shapes.iter().map(|it| PosedShape { pose: pose * it.pose, shape: it.shape }));
    }
    Footprint::new(&shapes, &cuts(state))
}

/// Heights at which outlines are cut: above bases, and a little above each open worktop.
fn cuts(state: &State) -> Vec<f64> {
    const ABOVE_BASES_M: f64 = 0.4;
    const ABOVE_M: f64 = 0.005;
    const MOST: usize = 3;
    let surfaces = state.setting.scene.surfaces.iter().enumerate().filter(|(_, it)| it.inside.is_none());
    let heights = surfaces.map(|(number, _)| state.surface_pose(SurfaceId(number)).translation.z + ABOVE_M);
    let mut cuts: Vec<f64> = heights.filter(|height| *height > ABOVE_BASES_M + 0.1).collect();
    cuts.sort_by(f64::total_cmp);
    cuts.dedup_by(|a, b| (*a - *b).abs() < 0.03);
    cuts.truncate(MOST);
    cuts.insert(0, ABOVE_BASES_M);
    cuts
}

/// The base to the first of the `goals` that is reached; they are asked in their order.
#[must_use]
pub fn going(state: &State, goals: &[Place], maps: &Maps, draws: &mut Draws) -> Outcome {
    Outcome::of(go(state, goals, maps, draws), vec![Part::Base])
}

fn go(state: &State, goals: &[Place], maps: &Maps, draws: &mut Draws) -> Result<Outcome, Trouble> {
    let machine = machine(state)?;
    for (arm, grip) in &state.hands {
        if let Grip::Handle(container) = grip {
            let (arm, container) =
                (state.support_name(Support::Hand(*arm)), &state.setting.container(*container).name);
            let message = format!("the hand `{arm}` holds the handle of `{container}`; let go first");
            return Err(Trouble::new("hands-bound", message).name("arm", arm));
        }
    }
    let Some(first) = goals.first() else {
        return Err(Trouble::new("base-goal-unreachable", "there is no place to go to"));
    };
    let ground = maps.ground(state, machine.limbs.drive);
    let (map, flood) = ground.map_err(|why| no_way(state, &why, first))?;
    let mut why = None;
    for goal in goals {
        match flood.drive(&map, *goal, &MODEL.drive) {
            Err(no) => {
                why.get_or_insert_with(|| no_way(state, &no, goal));
            }
            Ok(drive) => {
                let arrived = with_error(&map, goal, draws);
                let time_s = drive.duration_s(&MODEL.drive);
                let keys = libm::ceil(time_s / KEY_S).max(1.0) as usize;
                let mut track = Track::default();
                for key in 0..=keys {
                    let place = drive.place_at(time_s * key as f64 / keys as f64, &MODEL.drive);
                    let base = if key == keys { arrived.pose() } else { place.pose() };
                    let after_s = if key == 0 { 0.0 } else { time_s / keys as f64 };
                    track.push(after_s, Key { base: Some(base), ..Key::default() });
                }
                let costs =
                    Costs { path_m: drive.length_m, straight_m: drive.straight_m, ..Costs::default() };
                return Ok(Outcome { track, costs, ..Outcome::default() });
            }
        }
    }
    Err(why.unwrap_or_else(|| Trouble::new("base-goal-unreachable", "there is no place to go to")))
}

/// Where the base comes to stand: a little beside the goal, if it is free there.
fn with_error(map: &Map, goal: &Place, draws: &mut Draws) -> Place {
    let at = Place::new(
        goal.x + draws.small_error(MODEL.drive_m),
        goal.y + draws.small_error(MODEL.drive_m),
        goal.yaw + draws.small_error(MODEL.drive_rad),
    );
    if map.blocker(&at).is_none() { at } else { *goal }
}

fn no_way(state: &State, why: &NoWay, goal: &Place) -> Trouble {
    let name = |blocker: &Blocker| blocker_name(state, blocker);
    let at: Isometry3<f64> = goal.pose();
    let trouble =
        |kind, by: String| Trouble::new(kind, format!("{why}: `{by}`")).pose("goal", at).name("by", by);
    match why {
        NoWay::OutsideRoom { .. } => Trouble::new("base-goal-unreachable", why.to_string())
            .pose("goal", at)
            .name("by", "the edge of the room"),
        NoWay::StartBlocked { by } | NoWay::Blocked { by, .. } => trouble("base-goal-unreachable", name(by)),
        NoWay::GoalBlocked { by } => trouble("base-goal-in-collision", name(by)),
    }
}

/// What a blocker is called.
pub(crate) fn blocker_name(state: &State, blocker: &Blocker) -> String {
    match blocker {
        Blocker::Bounds => "the edge of the room".to_string(),
        Blocker::Barrier(number) => barrier_name(state, *number),
    }
}

/// The name of a barrier, by the order in which [`barriers`] lists them.
fn barrier_name(state: &State, number: usize) -> String {
    let scene = &state.setting.scene;
    let (fixtures, containers) = (scene.fixtures.len(), scene.containers.len());
    if number < fixtures {
        return scene.fixtures[number].name.clone();
    }
    if number < fixtures + containers {
        return scene.containers[number - fixtures].name.clone();
    }
    let mut objects = state.objects.keys().filter(|it| !matches!(state.ground_of(**it), Support::Hand(_)));
    objects
        .nth(number - fixtures - containers)
        .map_or_else(String::new, |it| scene.objects[it.0].name.clone())
}
