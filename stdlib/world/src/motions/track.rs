//! How a motion changes the state over its time: keys between which numbers go evenly, and events.

use nalgebra::Isometry3;

use crate::robot::model::VariableId;
use crate::robot::path::between;
use crate::scene::{ContainerId, ObjectId};
use crate::state::{Grip, State, Support};

/// A motion over time. The first key is at 0 and says how things are then.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// In the order of time; all keys name the same things.
    pub keys: Vec<Key>,
    /// What happens at once, in the order of time.
    pub events: Vec<(f64, Event)>,
}

/// Numbers at a time.
#[derive(Debug, Clone, Default)]
pub struct Key {
    /// Seconds from the beginning.
    pub at_s: f64,
    /// Joints of the robot.
    pub joints: Vec<(VariableId, f64)>,
    /// Pose of its root in the world.
    pub base: Option<Isometry3<f64>>,
    /// The joint of a container.
    pub opening: Option<(ContainerId, f64)>,
}

/// What happens at once.
#[derive(Debug, Clone)]
pub enum Event {
    /// These hands hold an object.
    Take(ObjectId, Vec<usize>),
    /// An object is at this pose in the world, in no hand.
    Put(ObjectId, Support, Isometry3<f64>),
    /// A hand holds a handle.
    Hold(usize, ContainerId),
    /// A hand holds nothing.
    Open(usize),
}

impl Track {
    /// When the last key or event is, seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        let key = self.keys.last().map_or(0.0, |key| key.at_s);
        self.events.last().map_or(key, |(at, _)| key.max(*at))
    }

    /// Adds a key so many seconds after the last one.
    pub fn push(&mut self, after_s: f64, key: Key) {
        let at_s = self.keys.last().map_or(0.0, |last| last.at_s + after_s);
        self.keys.push(Key { at_s, ..key });
    }

    /// The keys up to a time; if that lies between two, one for it.
    #[must_use]
    pub fn until(&self, at_s: f64) -> Vec<Key> {
        let next = self.keys.iter().position(|key| key.at_s > at_s).unwrap_or(self.keys.len());
        let mut keys = self.keys[..next].to_vec();
        if let (Some(last), Some(to)) = (keys.last(), self.keys.get(next))
            && last.at_s < at_s
        {
            keys.push(last.mixed(to, (at_s - last.at_s) / (to.at_s - last.at_s).max(1e-12)));
        }
        keys
    }

    /// What the motion has made of a state after so many seconds. A motion that has just begun has changed
    /// nothing.
    pub fn play(&self, state: &mut State, at_s: f64) {
        self.play_keys(state, at_s);
        for (_, event) in self.events.iter().filter(|(at, _)| *at <= at_s) {
            event.play(state);
        }
    }

    /// The same without events.
    pub(super) fn play_keys(&self, state: &mut State, at_s: f64) {
        let next = self.keys.iter().position(|key| key.at_s > at_s);
        match next {
            Some(0) => {}
            Some(next) => {
                let (from, to) = (&self.keys[next - 1], &self.keys[next]);
                let share = (at_s - from.at_s) / (to.at_s - from.at_s).max(1e-12);
                from.mixed(to, share).play(state);
            }
            None => {
                if let Some(last) = self.keys.last() {
                    last.play(state);
                }
            }
        }
    }
}

impl Key {
    fn mixed(&self, to: &Key, share: f64) -> Key {
        let mix = |a: f64, b: f64| a + (b - a) * share;
        Key {
            at_s: mix(self.at_s, to.at_s),
            joints: self.joints.iter().zip(&to.joints).map(|((id, a), (_, b))| (*id, mix(*a, *b))).collect(),
            base: self.base.zip(to.base).map(|(a, b)| between(&a, &b, share)),
            opening: self.opening.zip(to.opening).map(|((id, a), (_, b))| (id, mix(a, b))),
        }
    }

    fn play(&self, state: &mut State) {
        state.set_joints(&self.joints);
        if let Some(base) = self.base {
            state.base = base;
        }
        if let Some((container, position)) = self.opening {
            state.openings.insert(container, position);
        }
    }
}

impl Event {
    pub(crate) fn play(&self, state: &mut State) {
        match self {
            Event::Take(object, arms) => state.take(*object, arms),
            Event::Put(object, on, pose) => state.put(*object, *on, pose),
            Event::Hold(arm, container) => {
                state.hands.insert(*arm, Grip::Handle(*container));
            }
            Event::Open(arm) => {
                state.hands.remove(arm);
            }
        }
    }
}
