//! Soft actor-critic on candle, seeded, resumable and gradient-checked.
//!
//! Learning time is update time. candle holds the networks, differentiates the losses and defines
//! the file format; the networks themselves are computed by one hand-written operation each, which
//! is several times faster on a CPU and is checked against candle's own operations, against finite
//! differences and against PyTorch.
//!
//! ```
//! use palpate_sac::{Mode, Sac, SacConfig, Transition};
//!
//! let config = SacConfig { hidden: vec![16], batch_size: 8, start_training: 8, ..SacConfig::default() };
//! let mut agent = Sac::new(&config, 2, 1, 7)?;
//! let (observation, mut action) = ([0.5, -0.5], [0.0]);
//! for _ in 0..20 {
//!     agent.act(&observation, Mode::Explore, &mut action)?;
//!     agent.observe(&Transition {
//!         observation: &observation,
//!         action: &action,
//!         executed: &action,
//!         reward: -action[0].abs(),
//!         next_observation: &observation,
//!         terminal: false,
//!         episode_end: false,
//!     })?;
//!     agent.update()?; // Some(statistics) once there is enough to learn from
//! }
//! assert_eq!(agent.updates(), 26);
//! # Ok::<(), palpate_sac::SacError>(())
//! ```
//!
//! # Where things are
//!
//! - [`Sac`] acts, remembers, learns, saves; [`Policy`] is its actor alone, for the control loop.
//! - `learner` is one update, top to bottom: critics, actor, temperature, targets.
//! - `network` computes a network through `op` (fused: `work`, over `product`, `norm` and `kernel`) or plain candle;
//!   `team` is the threads that do it.
//! - `squash` is the tanh-Gaussian; `replay` the ring and its n-step returns; `memory` the shares of a batch:
//!   own experience, demonstrations, danger; `diagnosis` says how the learner is; `checkpoint` the files (through `tensors`).
//!
//! # Conventions
//!
//! - Observations are scaled to O(1) by the caller; actions are in [−1, 1]; numbers are f32.
//! - Every random number comes from one of four ChaCha8 streams of the seed, saved with the agent.
//! - With the feature `cuda` and [`Processor::Cuda`] candle computes the updates on an NVIDIA GPU, by plain
//!   operations; Adam's steps are taken on the CPU, where its moments are saved from.
//! - With [`Ops::Fused`] everything runs on the calling thread and, where [`SacConfig::threads`] is 2, on one of our own, which has
//!   the priority of the first caller of [`Sac::update`], stays awake for a millisecond after an update and is left out while
//!   others have its processor. candle's matrix product and its element-wise operations on 65,536 numbers or more use thread pools;
//!   the fused operations keep such work inside their own loops, so that none of these is ever started, whatever
//!   `RAYON_NUM_THREADS` and `CANDLE_NUM_THREADS` say. ([`Ops::Plain`] does start them; and a batch
//!   times action dimension of 65,536 would.)

mod agent;
mod aligned;
mod checkpoint;
mod config;
mod diagnosis;
mod error;
#[cfg(test)]
mod golden;
mod heap;
mod kernel;
mod lanes;
mod learner;
mod memory;
mod mlp;
mod network;
mod norm;
mod op;
mod optimiser;
mod policy;
mod processor;
mod product;
mod replay;
mod rng;
mod squash;
mod team;
mod tensors;
mod turn;
mod work;

pub use agent::{Mode, Sac};
pub use config::{LearnFrom, Ops, SacConfig, TargetEntropy};
pub use diagnosis::Diagnosis;
pub use error::SacError;
pub use learner::UpdateStats;
pub use policy::Policy;
pub use processor::Processor;
pub use replay::Transition;
