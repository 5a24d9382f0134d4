//! Force-control laws for position-controlled arms, with gains a policy can move.
//!
//! A law turns the pose error x_e, the contact wrench F_ext and a policy's motion a_x into a twist u
//! of the tool, in base axes. It is pure: no clock, no I/O, no allocation per tick.
//!
//! ```
//! use palpate_control::*;
//! use palpate_spatial::{Twist, Vector6, Wrench};
//!
//! let mut law = ParallelController::new(&ParallelConfig {
//!     action_placement: ActionPlacement::OutsideSelection,
//!     derivative_rule: DerivativeRule::None,
//!     integral_ratio: 0.01,
//!     integral_limit: 0.05,
//! });
//! law.set_gains(&Gains::Parallel(ParallelGains {
//!     kp_x: Vector6::repeat(1.0),
//!     kp_f: Vector6::repeat(5e-3),
//!     selection: Vector6::repeat(0.5),
//! }))?;
//! let mut error = Vector6::zeros();
//! error[2] = -0.010; // the goal is 10 mm below
//! let input = ControlInput { pose_error: error, wrench: Wrench::zero(), action: Twist::zero() };
//! let u = law.update(&input, 0.002);
//! assert!((u.linear.z + 0.005).abs() < 1e-12); // S·K_p·x_e = −5 mm/s
//! # Ok::<(), ControlError>(())
//! ```
//!
//! # Signs
//!
//! The wrench is what the environment does to the tool, so +K_p^f·F_ext moves the tool along the
//! measured force, away from the surface. The paper leaves the sign open; this is the stable one.
//!
//! # Where the paper and its authors' code differ
//!
//! | | printed (Sect. III-D) | authors' code | key |
//! |---|---|---|---|
//! | a_x | outside S | inside: S·(PD + a_x) | `action_placement` |
//! | K_d | 2√K_p | 0.1·K_p (later versions) | `derivative_rule` |
//! | gains from actions | base ± range | base × or ÷ range | `range_map` of the policy model |
//! | admittance output | a displacement | added as a velocity | `admittance.output` |

mod admittance;
mod config;
mod controller;
mod derivative;
mod filter;
mod law;
mod model;
mod parallel;

pub use admittance::AdmittanceController;
pub use config::{ActionPlacement, AdmittanceConfig, AdmittanceOutput, ControlConfig, DerivativeRule, ParallelConfig};
pub use controller::Controller;
pub use filter::LowPass;
pub use law::{AdmittanceGains, ControlError, ControlInput, ForceController, Gains, Law, ParallelGains};
pub use model::{ActionMap, Decoded, GainSpec, GainTable, MotionBounds, PolicyModel, RangeMap, Tie};
pub use parallel::ParallelController;
