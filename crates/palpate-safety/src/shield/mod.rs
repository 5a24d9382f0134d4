//! `mode = "shield"`: only commands from which the arm can still brake legally are let through.
//!
//! [`Shield`] is pure: state, proposal and the robot's time in, verdict and set-point out. Its parts, one idea
//! each: the [`Brake`] of a joint, the [`Motion`] commanded so far, [`Geometry`] of capsules, box and planes,
//! [`ForceGuard`] and [`Headroom`] for contact, [`Watch`] over the samples, [`Retreat`] after a force stop,
//! [`Recovery`] between tries, the [`Ledger`](crate::Ledger).
//!
//! # The argument
//! Call a state legal if the brake from it keeps every set-point legal. A step is executed only if it is within
//! the limits and leads to a legal state. Everything else executes a tick of braking: with the joints in step if that
//! is such a step too, and if not, of the brake whose remainder was verified with the last one. By induction every
//! set-point is legal, whatever is proposed.

mod brake;
mod capsule;
mod config;
mod core;
mod decision;
mod force;
mod geometry;
mod headroom;
mod motion;
mod plausible;
mod prove;
mod recovery;
mod retreat;
mod shape;
mod verify;
mod wish;

pub use brake::{Brake, Stop};
pub use capsule::Capsule;
pub use config::{
    ForceConfig, Plane, RecoveryConfig, RetreatConfig, SensorConfig, ShieldConfig,
    SingularityConfig, Workspace,
};
pub use core::Shield;
pub use decision::{Decision, Proposal};
pub use force::{Contact, ForceGuard, WrenchLimits};
pub use geometry::{Clearance, Geometry, Obstacle};
pub use headroom::{Bounds, Headroom};
pub use motion::Motion;
pub use plausible::{Implausible, Watch};
pub use recovery::{Action, Recovery, Seen, Standing};
pub use retreat::Retreat;
pub use shape::{ArmShape, LinkCapsule, ShapeError};
