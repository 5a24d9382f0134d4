//! The fail-safe layer: [`Safe`] stands between every command and every arm.
//!
//! A learning policy tries things. [`Safe`] owns the backend, so that nothing reaches the arm
//! without passing the paper's Algorithm 1: an inverse-kinematics solution exists, the joint speed
//! is within its limit, the contact force is within F_max, and every number is finite.
//!
//! Three modes: `paper` and `force-first` are Algorithm 1 in two orders, [`shield`] is what a real arm should have.
//!
//! An environment takes only a [`Guarded`] robot, and only [`Safe`] is one:
//!
//! ```compile_fail
//! use palpate_robot_io::{IdealArm, RobotBackend};
//! fn train(robot: impl palpate_safety::Guarded) {}
//! // A bare backend does not compile: it must be wrapped in `Safe` first.
//! train(IdealArm::at([0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into()));
//! ```
//!
//! # References
//! Beltran-Hernandez et al. 2020, Sect. III-E and Algorithm 1.

mod guarded;
mod ledger;
mod limits;
mod safe;
pub mod shield;
mod verdict;

pub use guarded::Guarded;
pub use ledger::{Cause, Counts, Entry, Ledger};
pub use limits::{LimitsError, Mode, ResetLimits, SafetyConfig, SpeedReference};
pub use safe::{Measurement, Safe, SafeError};
pub use verdict::{Excess, Refusal, Tally, Verdict};
