//! The fail-safe layer: [`Safe`] stands between every command and every arm.
//!
//! A learning policy tries things. [`Safe`] owns the backend, so that nothing reaches the arm
//! without passing the paper's Algorithm 1: an inverse-kinematics solution exists, the joint speed
//! is within its limit, the contact force is within F_max, and every number is finite.
//!
//! ```
//! use palpate_kinematics::SerialChain;
//! use palpate_robot_io::IdealArm;
//! use palpate_safety::{Mode, ResetLimits, Safe, SafetyConfig, SpeedReference, Verdict};
//! use palpate_spatial::{JointVector, Pose};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let urdf = include_str!("../../../assets/robots/ur3e.urdf");
//! let chain = SerialChain::from_urdf_str(urdf, "base_link", "tool0")?;
//! let home = JointVector::from([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
//! // Limits have no defaults: state every one.
//! let limits = SafetyConfig {
//!     mode: Mode::ForceFirst,
//!     force_max: 25.0,
//!     torque_max: 2.0,
//!     joint_velocity_max: JointVector::from_element(1.0),
//!     speed_reference: SpeedReference::Commanded,
//!     force_filter_cutoff: 50.0,
//!     ledger_entries: 100,
//!     reset: ResetLimits { force_max: 60.0, torque_max: 6.0 },
//!     shield: None, // only for mode = shield
//! };
//! let mut robot = Safe::new(IdealArm::at(home), chain, Pose::identity(), limits)?;
//! robot.begin_episode()?;
//! let mut target = robot.sense()?.base_T_tool;
//! target.translation.z += 1e-4;
//! assert_eq!(robot.command(&target)?, Verdict::Accepted);
//! target.translation.z += 0.1;
//! assert!(matches!(robot.command(&target)?, Verdict::Refused(_)));
//! # Ok(())
//! # }
//! ```
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
