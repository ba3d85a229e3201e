//! The machine of Pleach: a register VM whose plan frames are the running halves of the nodes of
//! a task tree.
//!
//! Read in this order: [`value`] what programs compute with; [`op`] and [`code`] what the
//! compiler makes; [`tree`] and [`key`] what a run grows; [`machine`] how it runs; [`edit`] how
//! a place of a plan is changed.
//!
//! This crate does no input or output, reads no clock and draws no random number of its own:
//! the caller hands these in as a [`host::Host`]. The same program, seed and answers give the
//! same tree, to the bit.

pub mod arith;
pub mod desc;
pub mod failure;
pub mod fluent;
pub mod geometry;
pub mod pages;
pub mod print;
pub mod random;
pub mod rules;
pub mod value;

pub mod code;
pub mod disasm;
pub mod op;
pub mod verify;

pub mod edit;
pub mod graft;
pub mod key;
pub mod path;
pub mod persist;
pub mod show;
pub mod tree;

pub mod host;
pub mod limits;
pub mod log;
pub mod machine;
pub mod native;
pub mod world;

pub use code::{FnId, Place, Program};
pub use failure::{Builtin, Failure};
pub use machine::{Machine, Outcome, Progress};
pub use value::{Symbol, Value};
