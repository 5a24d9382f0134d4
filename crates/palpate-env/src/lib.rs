//! The reinforcement-learning environment: what the policy sees, does and is paid for.
//!
//! [`Env`] runs the paper's two loops: a policy acts 20 times a second, and between two actions a
//! force-control law runs at the robot's rate (500 Hz) behind the fail-safe layer. It works on any
//! [`palpate_safety::Guarded`] robot and knows nothing of simulators.
//!
//! ```
//! use palpate_env::{Env, EnvError, Summary};
//! use palpate_safety::Guarded;
//!
//! /// An episode without a policy: the force controller alone, at its base gains.
//! fn episode<R: Guarded>(env: &mut Env<R>) -> Result<Summary, EnvError<R::Error>> {
//!     env.reset()?;
//!     let action = vec![0.0; env.action_dim()];
//!     loop {
//!         let step = env.step(&action)?;
//!         if let Some(summary) = step.summary {
//!             return Ok(summary);
//!         }
//!     }
//! }
//! ```
//!
//! Gymnasium's vocabulary in Rust's shape: [`Env::reset`] and [`Env::step`], `terminated` against
//! `truncated`, and a typed [`Step`] instead of an info map.
//!
//! # References
//! Beltran-Hernandez et al. 2020, Sect. III.

mod config;
mod environment;
mod episode;
mod error;
mod observation;
mod reset;
mod reward;
mod scripted;
mod tape;
mod task;

pub use config::{ConfigError, EnvConfig, Reference, ResetConfig};
pub use environment::{Env, Step};
pub use episode::{Outcome, Summary};
pub use error::EnvError;
pub use observation::ObservationConfig;
pub use reward::{RewardConfig, RewardForm, RewardTerms, RewardWeights};
pub use scripted::ScriptedPolicy;
pub use tape::{Beat, Tape, Tick};
pub use task::{Distribution, EpisodeStart, Spread, TaskConfig};
