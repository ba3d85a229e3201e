//! The projected world: robots, and what they can reach and touch.
//!
//! Right-handed frames, Z up; metres, radians, seconds, kilograms. Poses are
//! [`nalgebra::Isometry3<f64>`] everywhere at the border of this crate; a pose named
//! `a_in_b` turns coordinates of `a` into coordinates of `b`.
//!
//! [`shape`] says what bodies look like, [`robot`] how machines of several bodies move,
//! [`nav`] where they can drive, [`sight`] what their cameras see.
//!
//! Invariants
//! 1. The same calls give the same bits on every machine: transcendental functions come from
//!    `libm`, parry runs with `enhanced-determinism`, random numbers are functions of a seed that
//!    the caller hands in. No product of matrices whose size is known only at run time goes through
//!    nalgebra, for large ones are left to a kernel that is chosen by the processor.
//! 2. No file and no pose makes it panic.

pub mod nav;
pub mod parry;
pub mod robot;
pub mod shape;
pub mod sight;

mod random;

#[cfg(test)]
mod tests;
