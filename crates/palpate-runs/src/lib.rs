//! The run directory: configuration, metrics, checkpoints, plots and provenance.
//!
//! ```text
//! runs/2026-11-22_154500_peg-insertion_P-14_s1/
//! ├── config.toml        the resolved configuration, every key stated
//! ├── provenance.json    one entry per start: code, compiler, machine, arguments
//! ├── metrics.csv        one row per log step; same seed, same bytes
//! ├── episodes.csv       one row per episode
//! ├── replay.journal     every transition of a run on an arm, as it happened
//! ├── demonstrations.journal  what it was shown before it began, if anything
//! ├── tb/                the metrics again, as TensorBoard event files
//! ├── checkpoints/       step_0020000 (the last three), best_0018000 (the last two)
//! ├── plots/             SVG
//! ├── summary.json       how it ended
//! └── lock               held by the process that writes
//! ```
//!
//! ```
//! use palpate_runs::{Csv, Mark, Metrics, RunDir, Slot};
//!
//! # fn main() -> Result<(), palpate_runs::RunError> {
//! # let place = tempfile::tempdir().unwrap();
//! # let out = place.path().join("demo");
//! let run = RunDir::create(Some(&out), "demo", "seed = 1\n")?;
//! let mut metrics = Metrics::open(&run, &["step", "loss"], Mark::default())?;
//! for step in 0..100u32 {
//!     metrics.write(step.into(), &[Some(step.into()), Some(1.0 / f64::from(step + 1))])?;
//! }
//! metrics.sync()?;
//! // Whole or not at all, whatever happens while it is written.
//! run.checkpoints()?.save(Slot::Step(100), |dir| Ok(std::fs::write(dir.join("net"), "…")?))?;
//! let losses = Csv::read(&out.join("metrics.csv"))?.points("step", "loss")?;
//! assert_eq!(losses.last(), Some(&(99.0, 0.01)));
//! # Ok(())
//! # }
//! ```
//!
//! The crate knows no robot and no learner: callers name the columns and write the checkpoints' files.

mod checkpoint;
pub mod config;
mod console;
mod copy;
mod dir;
mod durable;
mod error;
mod inspect;
mod journal;
mod manifest;
mod metrics;
pub mod plot;
mod provenance;
pub mod stats;
mod table;
mod tensorboard;
mod time;

pub use checkpoint::{BEST, CheckpointStore, Entry, LAST, Slot};
pub use console::Console;
pub use copy::copy;
pub use dir::{RunDir, list};
pub use durable::write as write_whole;
pub use error::{Rejected, RunError};
pub use inspect::{DEMONSTRATIONS, Health, JOURNAL, Part, inspect, repair};
pub use journal::{Journal, Records};
pub use metrics::Metrics;
pub use table::{Csv, Mark, Table};
