//! The world of a run, as the machine knows it: something that natives use and that forks.
//!
//! The machine neither looks into it nor writes it into the log: it is a part of the deterministic run, as
//! the tree is. Same program, same seed, same log, same world. A run inside of a run (`run-plan`) begins
//! with a fork of its caller's world, which goes away with it.

use std::any::Any;

/// A world that a run carries along.
pub trait World: Any {
    /// A world that begins as this one is now, and shares nothing that changes.
    fn fork(&self) -> Box<dyn World>;

    /// Motions are projected from now on.
    fn project(&mut self);

    /// Another number after each change.
    fn version(&self) -> u64;

    /// Itself, for the natives that made it and know its type.
    fn as_any(&mut self) -> &mut dyn Any;
}

/// Where a run keeps its world; empty until a native puts one there.
pub type WorldSlot = Option<Box<dyn World>>;
