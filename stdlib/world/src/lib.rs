//! The projected world: robots, and what they can reach and touch.
//!
//! Right-handed frames, Z up; metres, radians, seconds, kilograms. Poses are
//! [`nalgebra::Isometry3<f64>`] everywhere at the border of this crate; a pose named
//! `a_in_b` turns coordinates of `a` into coordinates of `b`.
//!
//! [`shape`] says what bodies look like, [`robot`] how machines of several bodies move,
//! [`nav`] where they can drive, [`sight`] what their cameras see; [`places`] and [`rehearse`] what could be done.
//!
//! Invariants
//! 1. The same calls give the same bits on every machine: transcendental functions come from
//!    `libm`, parry runs with `enhanced-determinism`, random numbers are functions of a seed that
//!    the caller hands in. No product of matrices whose size is known only at run time goes through
//!    nalgebra, for large ones are left to a kernel that is chosen by the processor.
//! 2. No file and no pose makes it panic.

pub mod belief;
pub mod motions;
mod natives;
pub mod nav;
pub mod parry;
pub mod places;
pub mod read;
pub mod read_robot;
pub mod record;
pub mod rehearse;
pub mod robot;
pub mod scene;
pub mod setting;
pub mod shape;
pub mod sight;
pub mod stands;
pub mod state;
pub mod world;

mod random;

/// What `plans/world.plan` declares.
#[must_use]
pub fn natives() -> Vec<vm::native::Native> {
    let mut all = natives::natives();
    all.extend(natives::chances::natives());
    all.extend(natives::whereabouts::natives());
    all
}

/// Name and text of each module: plans see them by `(use world)`.
pub const MODULES: &[(&str, &str)] = &[
    ("world", include_str!("../plans/world.plan")),
    ("robots", include_str!("../plans/robots.plan")),
    ("scenes/tableware", include_str!("../scenes/tableware.plan")),
    ("scenes/kitchen", include_str!("../scenes/kitchen.plan")),
];

#[cfg(test)]
mod tests;
