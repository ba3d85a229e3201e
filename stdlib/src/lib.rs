//! The library of Pleach: what every file can use without saying so.
//!
//! A topic is two files with one stem. `plans/list.plan` declares and documents each name and says
//! in the language what can be said in it; `src/list.rs` computes the rest. All that calls a function
//! it was given (`map`, `sort`, `find-if` …) is written in the language, so that it can be a plan, be
//! interrupted, and fail like any other call; natives never call back.
//!
//! Invariants
//! 1. Every `def-native` of a plan file has a row in the table of its topic, and the other way round,
//!    with the same arity. A test reads both.
//! 2. A native is total: it ends for every input, and its result stays below the sizes in `limit`.
//! 3. No result depends on the machine: transcendental functions come from `libm`, random numbers
//!    from the run's own draws.

mod description;
mod failure;
mod format;
mod function;
mod geometry;
mod io;
mod language;
mod limit;
mod list;
mod map;
mod number;
mod random;
mod rule;
mod sequence;
pub mod statistics;
mod string;
mod symbol;
mod table;
mod task;
mod tree;
mod value;
mod vector;

use vm::native::Native;

/// All natives, topic by topic. Programs number them in this order.
#[must_use]
pub fn natives() -> Vec<Native> {
    let topics = [
        language::natives(),
        value::natives(),
        number::natives(),
        list::natives(),
        vector::natives(),
        map::natives(),
        sequence::natives(),
        symbol::natives(),
        string::natives(),
        format::natives(),
        function::natives(),
        description::natives(),
        geometry::natives(),
        failure::natives(),
        io::natives(),
        random::natives(),
        task::natives(),
        tree::natives(),
        rule::natives(),
        statistics::natives(),
    ];
    topics.into_iter().flatten().collect()
}

macro_rules! modules {
    ($(#[$doc:meta])* $name:ident: $($module:literal)+) => {
        $(#[$doc])*
        pub const $name: &[(&str, &str)] =
            &[$(($module, include_str!(concat!("../plans/", $module, ".plan")))),+];
    };
}

modules! {
    /// Name and text of each module that every file uses without saying so, in an order in which each uses
    /// only earlier ones.
    MODULES:
    "language" "value" "number" "list" "vector" "map" "function" "sequence"
    "symbol" "string" "format" "description" "geometry" "failure" "io" "random" "control" "task" "tree" "rule" "task-rule"
}

modules! {
    /// Name and text of each module of plans for robots in a world: `(use pick-place)`.
    PLANS:
    "location" "action" "pick-place" "statistics" "transformation" "household" "experiment"
}

#[cfg(test)]
mod tests;
