//! Evaluations: many runs of variants of a plan, compared.

pub mod page;
pub mod plot;
