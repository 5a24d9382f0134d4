//! The seam between this project and an arm: [`RobotBackend`].
//!
//! A control law, a fail-safe layer and an environment are written once against this trait; a
//! simulator, a recorded arm and a real controller implement it. The vocabulary is the usual one:
//! read → update → write, five hundred times a second.
//!
//! ```
//! use palpate_robot_io::{IdealArm, JointCommand, RobotBackend};
//!
//! let mut arm = IdealArm::at([0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into());
//! let state = arm.read()?; // blocks until a new sample: the arm paces the loop
//! let mut q = state.q;
//! q[5] += 0.001;
//! arm.write(&JointCommand { q })?;
//! assert!(arm.read()?.q[5] > 0.0);
//! # Ok::<(), palpate_robot_io::IdealArmError>(())
//! ```
//!
//! Modules: the trait, its data and its faults; [`contract`], the suite that every backend must
//! pass; [`IdealArm`], the smallest backend that passes it; [`Recorder`] and [`Replay`] around any other.

mod backend;
pub mod contract;
mod fault;
mod ideal;
mod record;
mod state;

pub use backend::RobotBackend;
pub use fault::{BackendError, FaultKind};
pub use ideal::{IdealArm, IdealArmError};
pub use record::{Call, Outcome, Recorder, Replay, ReplayError};
pub use state::{JointCommand, RobotState};
