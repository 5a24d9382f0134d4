//! Learned force control for position-controlled robot arms: the composition root.
//!
//! Everything below meets here: the simulated arm, the fail-safe layer, the environment and the
//! learner are built from one resolved [`Config`], trained by [`train`], measured by
//! [`evaluate::run`] and drawn by [`plot::run`]. The `palpate` binary is a thin command line over these.

pub mod baselines;
pub mod config;
pub mod evaluate;
pub mod interrupt;
pub mod ledger;
pub mod plot;
mod progress;
pub mod real;
pub mod record;
pub mod report;
pub mod runs;
pub mod stack;
pub mod train;
pub mod virtual_ur;

pub use config::Config;
