//! The interpreter: many small programs against what they must do.

mod any_text;
mod common;
mod expressions;
mod flow;
mod refused;
mod threads;
