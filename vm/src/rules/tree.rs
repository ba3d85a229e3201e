//! Predicates over task trees.

use super::native::NativeRule;

/// The table of all of them.
pub const TABLE: &[(&str, u8, NativeRule)] = &[];
