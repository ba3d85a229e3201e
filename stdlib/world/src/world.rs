//! The world of a run: truth, belief, what is going on, and worlds to go back to.
//!
//! A motion takes time. [`World::begin`] computes its outcome from the state as it is then; the plan
//! sleeps; [`World::end`] plays the track into the state as it has become meanwhile, up to the time that has
//! passed. So motions of different parts of the robot go on side by side, and one that is stopped leaves
//! what it had come to. Who looks at the world in between sees it as it was at the last end of a motion.
//!
//! Invariants
//! 1. No two motions that go on have a part of the robot in common.
//! 2. A version is given out once in the life of a world: a state that comes back keeps its number.

use std::any::Any;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

use nalgebra::{Isometry3, Translation3, Vector3};

use crate::belief::{Belief, Sight};
use crate::motions::base::Maps;
use crate::motions::hand::Target;
use crate::motions::tool::ToolWay;
use crate::motions::{self, Costs, Draws, Event, Outcome, Part, Surroundings, Trouble};
use crate::nav::{Flood, Map, Place};
use crate::record::{Done, End, Recording, Step};
use crate::scene::{ContainerId, ObjectId, Scene};
use crate::setting::{Machine, Setting};
use crate::stands;
use crate::state::{Around, State, Support};

/// The random numbers of a simulation are others than those of its motion.
const OF_SIMULATION: u64 = 0x5157_7e5a_0c1d_33b9;
/// Worlds in worlds that can be gone back to.
pub const MOST_KEPT: usize = 64;

/// Heights that are seen are wrong by no more than this.
const SEEN_OFF_M: f64 = 0.03;

/// A motion with its parameters.
#[derive(Debug, Clone)]
pub enum Motion {
    /// The base to the first place that it reaches.
    Going(Vec<Place>),
    /// The torso to a position of its joint.
    MovingTorso(f64),
    /// The head to a point in the world.
    Looking(Vector3<f64>),
    /// Arms to configurations.
    MovingArmJoints(Vec<(usize, Vec<f64>)>),
    /// Tools through via poses.
    MovingTcp(Vec<ToolWay>, Around),
    /// Hands around something.
    Gripping(Vec<usize>, Target),
    /// Hands let go.
    Releasing(Vec<usize>),
    /// A container whose handle a hand holds to a position of its joint; none is wide open.
    MovingContainer(usize, ContainerId, Option<f64>),
    /// Looking for objects of a type, or with a name, or for any.
    Detecting(Wanted),
}

/// How motions are done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// As they should go: things hold where they are held, and come to rest where they are let go.
    #[default]
    Projected,
    /// As they go when things have mass and friction.
    Simulated,
}

impl Mode {
    /// All modes by their names.
    pub const ALL: [(&'static str, Mode); 2] =
        [("projected", Mode::Projected), ("simulated", Mode::Simulated)];

    /// What plans call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        Mode::ALL.iter().find(|(_, mode)| *mode == self).map_or("", |(name, _)| name)
    }

    /// The mode with a name.
    #[must_use]
    pub fn named(name: &str) -> Option<Mode> {
        Mode::ALL.iter().find(|(other, _)| *other == name).map(|(_, mode)| *mode)
    }
}

/// What is looked for.
#[derive(Debug, Clone)]
pub enum Wanted {
    /// Anything.
    Any,
    /// A type of objects.
    Kind(String),
    /// One object.
    Object(ObjectId),
}

/// A motion that goes on.
struct Running {
    /// What was wanted, if that is recorded.
    motion: Option<Motion>,
    outcome: Outcome,
    began_ns: u64,
    version: u64,
    mode: Mode,
    seed: u64,
}

/// How a motion has ended.
#[derive(Debug, Clone)]
pub enum Ended {
    /// It was stopped on its way.
    Stopped,
    /// It succeeded; what was seen.
    Done(Vec<(ObjectId, Sight)>),
    /// It failed.
    Failed(Trouble),
}

/// The world of a run.
pub struct World {
    /// The truth.
    pub state: State,
    /// What the robot knows.
    pub belief: Belief,
    /// What its motions have cost.
    pub costs: Costs,
    /// How motions that begin now are done.
    pub mode: Mode,
    /// By how much the standard deviations of all errors are multiplied.
    pub noise: f64,
    /// The task clock when somebody last asked this world for something.
    pub now_ns: u64,
    /// What has happened, if anybody wants to know.
    pub recording: Option<Recording>,
    /// Motions are only thought of: see [`Draws::hasty`].
    pub hasty: bool,
    maps: Maps,
    running: BTreeMap<u64, Running>,
    ended: BTreeMap<u64, Ended>,
    kept: Vec<Kept>,
    last_version: u64,
    last_motion: u64,
}

/// What comes back with a world.
type Kept = (State, Belief, Costs, f64, Option<Recording>);

impl Default for World {
    fn default() -> World {
        World::new(State::new(Arc::new(Setting::new(Scene::default(), None)), Isometry3::identity()))
    }
}

impl vm::world::World for World {
    /// Motions of the run that forks belong to its tasks and do not go on in the fork; nothing of a rehearsal is
    /// recorded.
    fn fork(&self) -> Box<dyn vm::world::World> {
        let mut fork = World::new(self.state.clone());
        (fork.belief, fork.costs, fork.last_version) = (self.belief.clone(), self.costs, self.last_version);
        (fork.maps, fork.mode, fork.noise) = (self.maps.clone(), self.mode, self.noise);
        Box::new(fork)
    }

    fn project(&mut self) {
        self.mode = Mode::Projected;
    }

    fn version(&self) -> u64 {
        self.state.version
    }

    fn as_any(&mut self) -> &mut dyn Any {
        self
    }
}

impl World {
    /// A world that begins in a state.
    #[must_use]
    pub fn new(state: State) -> World {
        World {
            state,
            belief: Belief::default(),
            costs: Costs::default(),
            mode: Mode::default(),
            noise: 1.0,
            now_ns: 0,
            recording: None,
            hasty: false,
            maps: Maps::default(),
            running: BTreeMap::new(),
            ended: BTreeMap::new(),
            kept: Vec::new(),
            last_version: 0,
            last_motion: 0,
        }
    }

    /// The world as the robot believes it to be: objects that it has not seen are not there, the others where
    /// it saw them last. What is in its hands it feels; doors and drawers it sees.
    #[must_use]
    pub fn believed(&self) -> State {
        let truth = &self.state;
        let is_held = |object: ObjectId| matches!(truth.ground_of(object), Support::Hand(_));
        let mut state = truth.clone();
        // What carries others comes before them: where they stand on it follows from where it is believed to be.
        let mut others: Vec<ObjectId> = truth.objects.keys().copied().filter(|it| !is_held(*it)).collect();
        others.sort_by_key(|it| truth.carriers(*it));
        for object in others {
            let (Some(sight), Some(place)) = (self.belief.seen.get(&object), truth.objects.get(&object))
            else {
                state.objects.remove(&object);
                continue;
            };
            let on = match place.on {
                Support::Object(below) if !state.objects.contains_key(&below) => Support::Floor,
                on => on,
            };
            let mut pose = state.support_pose(on).inverse() * sight.pose;
            // What stands somewhere stands on it, however wrong its height looks; what has been moved since does not.
            if on == place.on && (pose.translation.z - place.pose.translation.z).abs() <= SEEN_OFF_M {
                pose.translation.z = place.pose.translation.z;
            }
            state.objects.insert(object, crate::state::Place { on, pose });
        }
        state
    }

    /// Maps of the floor that were asked for.
    #[must_use]
    pub fn maps(&self) -> &Maps {
        &self.maps
    }

    /// An empty world.
    #[must_use]
    pub fn empty(mode: Mode, recorded: bool) -> World {
        World { mode, recording: recorded.then(Recording::default), ..World::default() }
    }

    /// Another scene, everything where it is at first; the robot stays, at its start, and so does the noise.
    pub fn use_scene(&mut self, scene: Scene) {
        let machine = self.state.setting.machine.clone();
        let base = self.state.base;
        self.begin_anew(State::new(Arc::new(Setting::new(scene, machine)), base));
    }

    /// Another robot, at `base`; the scene begins anew.
    pub fn use_robot(&mut self, machine: Arc<Machine>, base: Isometry3<f64>) {
        let scene = self.state.setting.scene.clone();
        self.begin_anew(State::new(Arc::new(Setting::new(scene, Some(machine))), base));
    }

    fn begin_anew(&mut self, state: State) {
        self.state = state;
        (self.belief, self.costs) = (Belief::default(), Costs::default());
        self.running.clear();
        self.renumber();
        if let Some(recording) = &mut self.recording {
            recording.begin(self.now_ns, &self.state);
        }
    }

    /// Gives the state a number of its own after a change that no motion has made.
    pub fn changed(&mut self) {
        self.renumber();
        self.record(None);
    }

    fn renumber(&mut self) {
        self.last_version += 1;
        self.state.version = self.last_version;
    }

    /// The floor as it is, and how far everything is from where the base stands.
    ///
    /// # Errors
    /// There is no robot, or it stands where it cannot.
    pub fn ground(&self) -> Result<(Arc<Map>, Rc<Flood>), Trouble> {
        let machine = motions::machine(&self.state)?;
        let ground = self.maps.ground(&self.state, machine.limbs.drive);
        ground.map_err(|why| Trouble::new("base-goal-unreachable", why.to_string()))
    }

    fn record(&mut self, done: Option<Done>) {
        if let Some(recording) = &mut self.recording {
            recording.add(Step { at_ns: self.now_ns, after: self.state.clone(), done: done.map(Arc::new) });
        }
    }

    // ------------------------------------------------------------------ to try and go back

    /// Keeps the world as it is; how many are kept then.
    ///
    /// # Errors
    /// If too many are.
    pub fn keep(&mut self) -> Result<usize, Trouble> {
        if self.kept.len() >= MOST_KEPT {
            let message = format!("worlds are nested deeper than {MOST_KEPT}");
            return Err(Trouble::new("world-failure", message));
        }
        let kept = (self.state.clone(), self.belief.clone(), self.costs, self.noise, self.recording.clone());
        self.kept.push(kept);
        Ok(self.kept.len())
    }

    /// Goes back to the world that was kept as number `kept`. Motions of others that go on will be played into it.
    pub fn go_back(&mut self, kept: usize) {
        self.kept.truncate(kept);
        if let Some(kept) = self.kept.pop() {
            (self.state, self.belief, self.costs, self.noise, self.recording) = kept;
        }
    }

    /// Keeps how it is at each time from now on, unless it does so already.
    pub fn record_from_now(&mut self) {
        if self.recording.is_none() {
            let mut recording = Recording::default();
            recording.begin(self.now_ns, &self.state);
            self.recording = Some(recording);
        }
    }

    /// Becomes as another world is: what is in it, and what the robot believes.
    pub fn become_like(&mut self, other: &World) {
        (self.state, self.belief, self.costs) = (other.state.clone(), other.belief.clone(), other.costs);
        self.noise = other.noise;
        self.renumber();
    }

    /// Becomes as it was at a time of the task clock.
    ///
    /// # Errors
    /// It has not been kept.
    pub fn as_at(&mut self, at_ns: u64) -> Result<(), Trouble> {
        let kept = self.recording.as_ref().and_then(|recording| recording.state_at(at_ns));
        let Some(state) = kept else {
            let message = "how the world was then was not kept; begin with (record-world)";
            return Err(Trouble::new("world-failure", message));
        };
        self.state = state.clone();
        self.renumber();
        Ok(())
    }

    // ------------------------------------------------------------------ motions

    /// Begins a motion: its number, and how long it takes, seconds.
    ///
    /// `now_ns`: the task clock. `seed`: of its random numbers.
    pub fn begin(&mut self, motion: &Motion, now_ns: u64, seed: u64) -> (u64, f64) {
        let mut outcome = self.outcome(motion, now_ns, seed);
        if let Some(part) = self.busy(&outcome.parts) {
            let message = format!("{part} is still in motion");
            outcome = Outcome::refused(Trouble::new("robot-busy", message).name("part", part), Vec::new());
        }
        self.last_motion += 1;
        let duration_s = outcome.duration_s;
        let motion = self.recording.is_some().then(|| motion.clone());
        let running =
            Running { motion, outcome, began_ns: now_ns, version: self.state.version, mode: self.mode, seed };
        self.running.insert(self.last_motion, running);
        (self.last_motion, duration_s)
    }

    /// What a motion would come to.
    #[must_use]
    pub fn outcome(&self, motion: &Motion, now_ns: u64, seed: u64) -> Outcome {
        let state = &self.state;
        let draws = if self.hasty { Draws::hasty(seed) } else { Draws::new(seed) };
        let mut draws = draws.noisy(self.noise);
        match motion {
            Motion::Going(goals) => motions::base::going(state, goals, &self.maps, &mut draws),
            Motion::MovingTorso(position) => motions::joints::moving_torso(state, *position),
            Motion::Looking(at) => motions::joints::looking(state, at),
            Motion::MovingArmJoints(arms) => motions::joints::moving_arm_joints(state, arms, &draws),
            Motion::MovingTcp(ways, around) => motions::tool::moving_tcp(state, ways, around, &mut draws),
            Motion::Gripping(arms, target) => motions::hand::gripping(state, arms, *target, &mut draws),
            Motion::Releasing(arms) => motions::hand::releasing(state, arms),
            Motion::MovingContainer(arm, container, to) => {
                let to = to.unwrap_or(state.setting.container(*container).open);
                motions::container::moving_container(state, *arm, *container, to, &mut draws)
            }
            Motion::Detecting(wanted) => {
                let scene = &state.setting.scene;
                let what = match wanted {
                    Wanted::Any => "object".to_string(),
                    Wanted::Kind(kind) => kind.clone(),
                    Wanted::Object(object) => scene.objects[object.0].name.clone(),
                };
                let is_wanted = |object: ObjectId| match wanted {
                    Wanted::Any => true,
                    Wanted::Kind(kind) => scene.kind_of(object).name == *kind,
                    Wanted::Object(it) => object == *it,
                };
                motions::detect::detecting(state, &is_wanted, &what, now_ns as f64 / 1e9, &mut draws)
            }
        }
    }

    /// A part that another motion has.
    fn busy(&self, parts: &[Part]) -> Option<String> {
        let taken = self.running.values().flat_map(|running| &running.outcome.parts);
        let part = taken.into_iter().find(|part| parts.contains(part))?;
        Some(match part {
            Part::Base => "the base".into(),
            Part::Torso => "the torso".into(),
            Part::Head => "the head".into(),
            Part::Arm(arm) => format!("the arm {}", self.state.support_name(Support::Hand(*arm))),
        })
    }

    /// Ends a motion at this time of the task clock: before its duration is over it was stopped.
    pub fn end(&mut self, number: u64, now_ns: u64) {
        let Some(running) = self.running.remove(&number) else { return };
        let Running { motion, mut outcome, began_ns, version, mode, seed } = running;
        self.now_ns = now_ns;
        let passed_s = now_ns.saturating_sub(began_ns) as f64 / 1e9;
        // The clock has nanoseconds.
        let over = passed_s + 1e-9 >= outcome.duration_s;
        let share = if over { 1.0 } else { passed_s / outcome.duration_s };
        let before = self.state.clone();
        let lasted_s = if over { f64::INFINITY } else { passed_s };
        outcome.track.play(&mut self.state, lasted_s);
        if mode == Mode::Simulated && !outcome.track.keys.is_empty() {
            self.simulate(&before, &mut outcome, lasted_s, seed);
        }
        let costs = Costs {
            path_m: outcome.costs.path_m * share,
            straight_m: outcome.costs.straight_m * share,
            hand_m: outcome.costs.hand_m * share,
            ..outcome.costs
        };
        self.costs += costs;
        self.renumber();
        self.move_beliefs(&before);
        let ended = match over {
            false => Ended::Stopped,
            true => {
                self.learn(&outcome, &before, now_ns);
                let met = if before.version == version { None } else { self.meets(&outcome) };
                outcome.trouble.or(met).map_or(Ended::Done(outcome.seen), Ended::Failed)
            }
        };
        if let Some(motion) = motion {
            let end = match &ended {
                Ended::Stopped => End::Stopped,
                Ended::Done(seen) => End::Succeeded(seen.iter().map(|(object, _)| *object).collect()),
                Ended::Failed(trouble) => End::Failed(trouble.clone()),
            };
            self.record(Some(Done { motion, began_ns, track: outcome.track, costs, end }));
        }
        self.ended.insert(number, ended);
    }

    /// What physics makes of a motion that has been played into the state.
    fn simulate(&mut self, before: &State, outcome: &mut Outcome, lasted_s: f64, seed: u64) {
        let mut draws = Draws::new(seed ^ OF_SIMULATION).noisy(self.noise);
        let simulated = motions::simulate(before, &self.state, outcome, lasted_s, &mut draws);
        self.state.set_joints(&simulated.joints);
        simulated.events.iter().for_each(|event| event.play(&mut self.state));
        // Where projection has let things fall, they have fallen here.
        let falls = outcome.track.events.iter().any(|(_, event)| matches!(event, Event::Put(..)));
        outcome.trouble = match falls {
            true => simulated.trouble,
            false => outcome.trouble.take().or(simulated.trouble),
        };
    }

    /// Motions that go on: what was wanted if that is recorded, how the state changes, when it began, how long it
    /// lasts in seconds.
    pub(crate) fn going_on(&self) -> impl Iterator<Item = (Option<&Motion>, &motions::Track, u64, f64)> {
        self.running
            .values()
            .map(|it| (it.motion.as_ref(), &it.outcome.track, it.began_ns, it.outcome.duration_s))
    }

    /// How a motion has ended, once.
    pub fn take_end(&mut self, number: u64) -> Option<Ended> {
        self.ended.remove(&number)
    }

    /// What the robot has seen in a drawer comes along with it.
    fn move_beliefs(&mut self, before: &State) {
        let setting = &before.setting;
        for id in (0..setting.scene.containers.len()).map(ContainerId) {
            let (from, to) = (before.opening(id), self.state.opening(id));
            if from == to {
                continue;
            }
            let moved = setting.container_pose(id, to) * setting.container_pose(id, from).inverse();
            let comes_along = |object: ObjectId, sight: &Sight| {
                let foot = sight.pose * Translation3::new(0.0, 0.0, setting.scene.kind_of(object).low.z);
                match before.support_below(&foot.translation.vector, stands::ON_M, object) {
                    Some((Support::Surface(on), _)) => setting.scene.surfaces[on.0].moves_with == Some(id),
                    _ => false,
                }
            };
            let seen = self.belief.seen.clone();
            for (object, sight) in seen.into_iter().filter(|(object, sight)| comes_along(*object, sight)) {
                self.belief.seen.insert(object, Sight { pose: moved * sight.pose, ..sight });
            }
        }
    }

    fn learn(&mut self, outcome: &Outcome, before: &State, now_ns: u64) {
        for (object, sight) in outcome.seen.iter().chain(&outcome.noticed) {
            self.belief.seen.insert(*object, *sight);
        }
        if let Some((container, position)) = outcome.opened {
            match position > 0.0 {
                true => self.belief.open.insert(container, position),
                false => self.belief.open.remove(&container),
            };
        }
        for (_, event) in &outcome.track.events {
            if let Event::Put(object, ..) = event {
                // It thinks that things are where it let them go.
                let sight = Sight { pose: before.object_pose(*object), at_s: now_ns as f64 / 1e9 };
                self.belief.seen.insert(*object, sight);
            }
        }
    }

    /// Something else has moved meanwhile: what touches now.
    fn meets(&self, outcome: &Outcome) -> Option<Trouble> {
        let machine = self.state.machine()?;
        let moved = !outcome.track.keys.is_empty();
        // What hands hold or have just let go is touched by fingers.
        let near = Around {
            touchable: self.state.objects.keys().copied().collect(),
            handles: (0..self.state.setting.scene.containers.len()).map(ContainerId).collect(),
            ..Around::default()
        };
        let mut around = Surroundings::new(machine, self.state.obstacles(&near), self.state.carried());
        let touch = moved.then(|| around.touch(&self.state.base, &self.state.joints))??;
        Some(around.collision(&touch, "two motions at once met:"))
    }
}
