//! A virtual UR.
pub mod script;
