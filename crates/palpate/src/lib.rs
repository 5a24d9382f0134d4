//! Learned force control for position-controlled robot arms: the composition root.
//!
//! ```
//! use palpate::baselines::Actor;
//! use palpate::config::{Choice, Config};
//! use palpate::evaluate::rollouts;
//! use palpate::stack::{Purpose, sim_env};
//!
//! # fn main() -> anyhow::Result<()> {
//! let config = Config::load(&Choice {
//!     preset: "palpate".into(),
//!     task: "peg-insertion".into(),
//!     model: "P-14".into(),
//!     file: None,
//!     set: vec!["sim.friction=0.2".into()],
//! })?;
//! let mut env = sim_env(&config, 7, Purpose::Evaluate)?;
//! let mut script = Actor::scripted(&config, env.action_dim());
//! for episode in rollouts(&mut env, &mut script, 3, |_, _| {})? {
//!     println!("{:?} after {:.2} s", episode.outcome, episode.seconds);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! Everything below meets here: the simulated arm, the fail-safe layer, the environment and the
//! learner are built from one resolved [`Config`], trained by [`train`], measured by
//! [`evaluate::run`] and drawn by [`plot::run`]; [`demonstrate`] records what there is to learn from beside its own steps. The `palpate` binary is a thin command line over these.

pub mod baselines;
pub mod config;
pub mod demonstrate;
pub mod evaluate;
mod flat;
pub mod interrupt;
pub mod ledger;
mod parallel;
pub mod plot;
mod progress;
pub mod real;
pub mod record;
pub mod report;
pub mod runs;
pub mod stack;
pub mod study;
pub mod train;
pub mod virtual_ur;

pub use config::Config;
