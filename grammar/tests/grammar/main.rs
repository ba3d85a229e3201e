//! The crate from outside: reading, printing, laying out, Prolog text, and that nothing breaks it.

mod formatting;
mod prolog;
mod random;
mod reading;
