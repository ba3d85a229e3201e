//! x
pub struct CollisionModel;
