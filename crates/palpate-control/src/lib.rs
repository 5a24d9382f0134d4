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
//! measured force, away from the surface, and the admittance model is pushed the same way. The paper
//! leaves the sign open; this is the stable one.
//!
//! # Where the paper and its authors' code differ
//!
//! The paper: Beltran-Hernandez et al., "Learning Force Control for Contact-rich Manipulation Tasks with
//! Rigid Position-controlled Robots", RA-L 5(4) 2020, arXiv 2003.00628. Its authors have released later
//! versions of their controllers; each difference is a key.
//!
//! | | printed (Sect. III-D) | authors' code | key |
//! |---|---|---|---|
//! | a_x | outside S | inside: S·(PD + a_x) | `control.parallel.action_placement` |
//! | K_d | 2√K_p | √(K_p·e), later 0.1·K_p | `derivative_rule` of either law |
//! | integral | not bounded | bounded by 1 (never binds) | `control.parallel.integral_limit` |
//! | gains from actions | base ± range | base × or ÷ range | `policy.range_map` |
//! | admittance output | a displacement | added as a velocity | `control.admittance.output` |
//! | force filter | "a simple low-pass" | Butterworth, 2.5 Hz | the fail-safe layer's cut-off |
//! | derivative at the first tick | – | a kick, in the versions of 2020 | none here |
//!
//! # Modules
//!
//! The trait and its data, the two laws, either of them as one type ([`Controller`]); [`LowPass`];
//! [`PolicyModel`] and [`ActionMap`], from a policy's numbers to gains; what a model may do that is
//! unwise ([`Warning`]); how stiff a contact the loop stands ([`ForceLoop`]).

mod action;
mod admittance;
mod config;
mod contact;
mod controller;
mod error;
mod filter;
mod force_loop;
mod law;
mod model;
mod oscillator;
mod parallel;
mod pd;
mod warning;

pub use action::{ActionMap, Decoded};
pub use admittance::AdmittanceController;
pub use config::{
    ActionPlacement, AdmittanceConfig, AdmittanceOutput, ControlConfig, DerivativeRule,
    ParallelConfig,
};
pub use controller::Controller;
pub use error::ControlError;
pub use filter::LowPass;
pub use force_loop::ForceLoop;
pub use law::{AdmittanceGains, ControlInput, ForceController, Gains, Law, ParallelGains};
pub use model::{GainSpec, GainTable, MotionBounds, PolicyModel, RangeMap, Tie};
pub use parallel::ParallelController;
pub use warning::Warning;
