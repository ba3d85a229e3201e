//! The crate from outside: reading, printing, laying out, and that nothing breaks it.

mod formatting;
mod random;
mod reading;
