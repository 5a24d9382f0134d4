//! Universal Robots arms.

pub mod proto;
