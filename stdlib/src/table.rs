//! The table of a topic: name, arity, effect and function of each native, once.

pub(crate) use vm::natives;
