//! What happened in a world: for a viewer ([`json`]) and for a person ([`picture`]); and how it is ([`moment`]).
//!
//! A [`Recording`] keeps the states that the world went through and the tracks that led from one to
//! the next; both writers play them again. States are persistent, so keeping them costs little.
//! Motions in worlds that are thrown away (`run-plan`, `with-hypothetical-world`) are not in it: the first is a
//! fork, which records nothing, and going back to a world takes its recording back, too.
//!
//! Invariants
//! 1. A recording changes nothing in the run that it is made of.
//! 2. The same run gives the same bytes.

pub mod json;
pub mod moment;
pub mod picture;
mod svg;

use std::sync::Arc;

use im::Vector;
use nalgebra::Isometry3;

use crate::motions::{Costs, Track, Trouble};
use crate::scene::ObjectId;
use crate::state::{Place, State};
use crate::world::Motion;

/// All that happened, in episodes: each begins with another scene or another robot.
#[derive(Clone, Default)]
pub struct Recording {
    episodes: Vector<Episode>,
}

/// What happened in one scene with one robot.
#[derive(Clone)]
pub struct Episode {
    /// When it began.
    pub began_ns: u64,
    /// How everything was then.
    pub start: State,
    /// What changed, in the order of the ends.
    pub steps: Vector<Step>,
}

/// The end of a motion, or a change that no motion made.
#[derive(Clone)]
pub struct Step {
    /// When.
    pub at_ns: u64,
    /// How everything was after it.
    pub after: State,
    /// The motion.
    pub done: Option<Arc<Done>>,
}

/// A motion that has ended.
pub struct Done {
    /// What was wanted.
    pub motion: Motion,
    /// When it began.
    pub began_ns: u64,
    /// How the state changed; what lies behind the end has not happened.
    pub track: Track,
    /// What it cost.
    pub costs: Costs,
    /// How it ended.
    pub end: End,
}

/// How a motion ended.
#[derive(Debug, Clone)]
pub enum End {
    /// Well; the objects that were seen.
    Succeeded(Vec<ObjectId>),
    /// With a failure.
    Failed(Trouble),
    /// It was stopped on its way.
    Stopped,
}

impl Recording {
    /// Another scene, or another robot. An episode in which nothing has happened is forgotten.
    pub(crate) fn begin(&mut self, at_ns: u64, start: &State) {
        if self.episodes.last().is_some_and(|last| last.steps.is_empty()) {
            self.episodes.pop_back();
        }
        self.episodes.push_back(Episode { began_ns: at_ns, start: start.clone(), steps: Vector::new() });
    }

    /// What is so after a motion, or after a change that none made.
    pub(crate) fn add(&mut self, step: Step) {
        if self.episodes.is_empty() {
            // Nothing is there, and nothing came of it: a motion without a robot.
            self.begin(0, &step.after);
        }
        if let Some(last) = self.episodes.back_mut() {
            last.steps.push_back(step);
        }
    }

    /// How everything was at a time, at the last end of a motion until then; nothing is known of what was before.
    #[must_use]
    pub fn state_at(&self, at_ns: u64) -> Option<&State> {
        let episode = self.episodes.iter().rev().find(|episode| episode.began_ns <= at_ns)?;
        let step = episode.steps.iter().rev().find(|step| step.at_ns <= at_ns);
        Some(step.map_or(&episode.start, |step| &step.after))
    }

    /// True if there was no world.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.episodes.is_empty()
    }

    /// The episodes, the first one first.
    pub fn episodes(&self) -> impl Iterator<Item = &Episode> {
        self.episodes.iter()
    }
}

/// Where an object is from a time on.
pub(crate) struct Seen {
    pub at_ns: u64,
    pub place: Place,
    pub pose: Isometry3<f64>,
}

impl Episode {
    /// Motions in the order in which they began; with when each ended.
    pub(crate) fn motions(&self) -> Vec<(&Done, u64)> {
        let mut all: Vec<(&Done, u64)> =
            self.steps.iter().filter_map(|step| Some((step.done.as_deref()?, step.at_ns))).collect();
        all.sort_by_key(|(done, at_ns)| (done.began_ns, *at_ns));
        all
    }

    /// How everything is in the end.
    pub(crate) fn end(&self) -> &State {
        self.steps.last().map_or(&self.start, |step| &step.after)
    }

    /// All moments at which something is given: the beginning, keys of tracks, ends.
    fn moments(&self) -> Vec<u64> {
        let mut all = vec![self.began_ns];
        all.extend(self.steps.iter().map(|step| step.at_ns));
        for (done, end_ns) in self.motions() {
            let keys = done.track.keys.iter().map(|key| done.began_ns + nanoseconds(key.at_s));
            all.extend(keys.filter(|at| *at < end_ns));
        }
        all.sort_unstable();
        all.dedup();
        all
    }

    /// How everything is at these moments, with all motions that go on then played up to them.
    fn states(&self) -> impl Iterator<Item = (u64, State)> {
        let motions = self.motions();
        let (mut steps, mut coming) = (self.steps.iter().peekable(), motions.into_iter().peekable());
        let (mut last, mut going) = (self.start.clone(), Vec::new());
        self.moments().into_iter().map(move |at_ns| {
            while let Some(step) = steps.next_if(|step| step.at_ns <= at_ns) {
                last = step.after.clone();
            }
            while let Some(motion) = coming.next_if(|(done, _)| done.began_ns < at_ns) {
                going.push(motion);
            }
            going.retain(|(_, end_ns)| at_ns < *end_ns);
            let mut state = last.clone();
            for (done, _) in &going {
                done.track.play(&mut state, seconds(at_ns - done.began_ns));
            }
            (at_ns, state)
        })
    }

    /// Where each object is, from the beginning on, at each change.
    pub(crate) fn objects(&self) -> Vec<(ObjectId, Vec<Seen>)> {
        let mut tracks: Vec<(ObjectId, Vec<Seen>)> =
            self.start.objects.keys().map(|object| (*object, Vec::new())).collect();
        for (at_ns, state) in self.states() {
            for (object, track) in &mut tracks {
                let Some(place) = state.objects.get(object).copied() else { continue };
                let pose = state.object_pose(*object);
                let moved =
                    track.last().is_none_or(|last| last.place.on != place.on || apart(&last.pose, &pose));
                if moved {
                    track.push(Seen { at_ns, place, pose });
                }
            }
        }
        tracks
    }

    /// All costs, added up.
    pub(crate) fn costs(&self) -> Costs {
        let mut all = Costs::default();
        self.steps.iter().filter_map(|step| step.done.as_ref()).for_each(|done| all += done.costs);
        all
    }
}

/// True if two poses are written with different numbers.
fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    json::pose_numbers(a) != json::pose_numbers(b)
}

pub(crate) fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

fn nanoseconds(s: f64) -> u64 {
    (s * 1e9) as u64
}
