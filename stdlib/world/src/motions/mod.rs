//! Motions in projection: what a robot does, computed before it is done.
//!
//! A motion is a function of the state, its parameters and a seed. It answers an [`Outcome`]: how the
//! state changes over time ([`track`]), how long that takes, what it costs, and perhaps a failure at its
//! end. Nothing is changed by it; [`crate::world::World`] lets time pass and then plays the track into the
//! state. A motion that is stopped is played up to then.
//!
//! Ways of tools are straight lines that are looked at step by step; the way of an arm to the first via
//! pose, and to a configuration, is a line in joint space if that is free, else a *leap*: only its end is
//! looked at, as in CRAM's projection. Leaps are counted in the costs.
//!
//! [`model`] has all speeds and all noise.

pub mod base;
pub mod container;
pub mod detect;
pub mod hand;
pub mod joints;
pub mod model;
mod physics;
pub mod settle;
mod simulate;
pub mod tool;
pub mod track;
pub(crate) mod view;

use nalgebra::Isometry3;

use crate::belief::Sight;
use crate::random::unit;
use crate::robot::collision::{Carried, Obstacles, Scratch, Touch};
use crate::robot::model::Variable;
use crate::scene::{ContainerId, ObjectId};
use crate::setting::Machine;
use crate::state::State;

pub use model::{MODEL, Model};
pub(crate) use simulate::simulate;
pub use track::{Event, Key, Track};

/// What a motion comes to.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    /// How the state changes.
    pub track: Track,
    /// How long it takes, seconds.
    pub duration_s: f64,
    /// What it costs.
    pub costs: Costs,
    /// The parts of the robot that it moves.
    pub parts: Vec<Part>,
    /// How it fails when its time is over.
    pub trouble: Option<Trouble>,
    /// What the robot sees.
    pub seen: Vec<(ObjectId, Sight)>,
    /// What else is in the image: not asked for, and known from now on.
    pub noticed: Vec<(ObjectId, Sight)>,
    /// What the robot believes to have opened or shut.
    pub opened: Option<(ContainerId, f64)>,
}

/// What motions cost, added up.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Costs {
    /// Metres that the base drove.
    pub path_m: f64,
    /// Metres between the places at which it stood: the measure of Kazhoyan and others (2020).
    pub straight_m: f64,
    /// Metres that tools moved between via poses.
    pub hand_m: f64,
    /// How many motions there were.
    pub actions: usize,
    /// How often an arm got somewhere on a way that nobody looked at.
    pub leaps: usize,
}

/// A part of the robot that one motion at a time has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// The wheels.
    Base,
    /// The torso.
    Torso,
    /// The head.
    Head,
    /// An arm with its hand.
    Arm(usize),
}

/// Why a motion fails: the name of a type of failures with its fields.
#[derive(Debug, Clone, PartialEq)]
pub struct Trouble {
    /// Its type, see `plans/world.plan`.
    pub kind: &'static str,
    /// For people.
    pub message: String,
    /// For handlers.
    pub fields: Vec<(&'static str, Field)>,
}

/// A field of a failure.
#[derive(Debug, Clone, PartialEq)]
pub enum Field {
    /// A name.
    Name(String),
    /// Several names.
    Names(Vec<String>),
    /// A number.
    Number(f64),
    /// A pose in the world.
    Pose(Isometry3<f64>),
}

impl Trouble {
    /// A failure without fields.
    #[must_use]
    pub fn new(kind: &'static str, message: impl Into<String>) -> Trouble {
        Trouble { kind, message: message.into(), fields: Vec::new() }
    }

    /// With a name in it.
    #[must_use]
    pub fn name(mut self, field: &'static str, name: impl Into<String>) -> Trouble {
        self.fields.push((field, Field::Name(name.into())));
        self
    }

    /// With a number in it.
    #[must_use]
    pub fn number(mut self, field: &'static str, number: f64) -> Trouble {
        self.fields.push((field, Field::Number(number)));
        self
    }

    /// With a pose in it.
    #[must_use]
    pub fn pose(mut self, field: &'static str, pose: Isometry3<f64>) -> Trouble {
        self.fields.push((field, Field::Pose(pose)));
        self
    }

    /// With names in it.
    #[must_use]
    pub fn names(mut self, field: &'static str, names: Vec<String>) -> Trouble {
        self.fields.push((field, Field::Names(names)));
        self
    }
}

impl Outcome {
    /// A motion that was refused: it takes the time to find that out, and changes nothing.
    #[must_use]
    pub fn refused(trouble: Trouble, parts: Vec<Part>) -> Outcome {
        let costs = Costs { actions: 1, ..Costs::default() };
        Outcome { duration_s: MODEL.refusal_s, trouble: Some(trouble), parts, costs, ..Outcome::default() }
    }

    /// What a motion found, or its refusal.
    #[must_use]
    pub fn of(found: Result<Outcome, Trouble>, parts: Vec<Part>) -> Outcome {
        match found {
            Ok(mut outcome) => {
                (outcome.parts, outcome.costs.actions) = (parts, 1);
                outcome.duration_s = outcome.track.duration_s().max(outcome.duration_s);
                outcome
            }
            Err(trouble) => Outcome::refused(trouble, parts),
        }
    }
}

impl std::ops::AddAssign for Costs {
    fn add_assign(&mut self, other: Costs) {
        self.path_m += other.path_m;
        self.straight_m += other.straight_m;
        self.hand_m += other.hand_m;
        self.actions += other.actions;
        self.leaps += other.leaps;
    }
}

/// Errors that are cut are cut at so many standard deviations.
const MOST_DEVIATIONS: f64 = 3.0;

/// Random numbers of one motion: functions of its seed and their order.
#[derive(Debug, Clone)]
pub struct Draws {
    seed: u64,
    drawn: u64,
    hasty: bool,
    noise: f64,
}

impl Draws {
    /// The numbers of a seed.
    #[must_use]
    pub fn new(seed: u64) -> Draws {
        Draws { seed, drawn: 0, hasty: false, noise: 1.0 }
    }

    /// The same for a motion that is only thought of: whether there is a way around something it leaves open.
    #[must_use]
    pub fn hasty(seed: u64) -> Draws {
        Draws { hasty: true, ..Draws::new(seed) }
    }

    /// The same with errors that are so many times as great.
    #[must_use]
    pub fn noisy(self, noise: f64) -> Draws {
        Draws { noise, ..self }
    }

    /// Whether ways around what blocks an arm are looked for: the most costly search of all.
    #[must_use]
    pub fn looks_around(&self) -> bool {
        !self.hasty
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.drawn += 1;
        unit(self.seed, self.drawn)
    }

    /// An error: of the normal distribution around 0, its deviation times the noise of the world. How many numbers are
    /// drawn does not depend on that. Box and Muller, 1958; one of its two numbers is used.
    pub fn error(&mut self, deviation: f64) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.unit())).sqrt();
        deviation * self.noise * radius * libm::cos(std::f64::consts::TAU * self.unit())
    }

    /// The same, and never more than three deviations.
    pub fn small_error(&mut self, deviation: f64) -> f64 {
        let most = MOST_DEVIATIONS * deviation * self.noise;
        self.error(deviation).clamp(-most, most)
    }

    /// A seed for something that draws by itself.
    pub fn seed(&mut self) -> u64 {
        (self.unit() * (1_u64 << 53) as f64) as u64
    }
}

/// The robot among what stands around it, for many questions about touching.
pub(crate) struct Surroundings<'a> {
    pub machine: &'a Machine,
    pub obstacles: Obstacles,
    pub carried: Vec<Carried>,
    scratch: Scratch,
    links: Vec<Isometry3<f64>>,
}

impl<'a> Surroundings<'a> {
    pub fn new(machine: &'a Machine, obstacles: Obstacles, carried: Vec<Carried>) -> Surroundings<'a> {
        Surroundings { machine, obstacles, carried, scratch: Scratch::default(), links: Vec::new() }
    }

    /// What touches with the robot in a configuration.
    pub fn touch(&mut self, base: &Isometry3<f64>, configuration: &[f64]) -> Option<Touch> {
        self.machine.robot.forward(base, configuration, &mut self.links);
        self.machine.model.touch(&self.links, &self.carried, &self.obstacles, &mut self.scratch)
    }

    /// The names of two things that touch.
    pub fn names(&self, touch: &Touch) -> (String, String) {
        let (first, second) = touch.names(&self.machine.robot, &self.carried, &self.obstacles);
        (first.into(), second.into())
    }

    /// The failure of an arm, or of two, that would touch something.
    pub fn collision(&self, touch: &Touch, when: &str) -> Trouble {
        let (first, second) = self.names(touch);
        Trouble::new("arm-in-collision", format!("{when} `{first}` would touch `{second}`"))
            .name("first", first)
            .name("second", second)
    }
}

/// The robot of a state.
pub(crate) fn machine(state: &State) -> Result<&Machine, Trouble> {
    state.machine().ok_or_else(|| {
        Trouble::new("no-robot", "there is no robot in this world; begin with (use-robot pr2)")
    })
}

/// Seconds for a motion of joints from one configuration to another.
pub(crate) fn joint_time_s(machine: &Machine, from: &[f64], to: &[f64]) -> f64 {
    let speed = |variable: &Variable| {
        let turns = machine.robot.joints()[variable.joint.0].kind.turns();
        let share = if turns { MODEL.joint_share } else { 1.0 };
        (variable.velocity.min(MODEL.joint_limit) * share).max(1e-3)
    };
    let times = from.iter().zip(to).zip(machine.robot.variables());
    times.map(|((from, to), variable)| (to - from).abs() / speed(variable)).fold(0.0, f64::max)
}
