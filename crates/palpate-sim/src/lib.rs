//! A rapier simulation of an arm, its force/torque sensor and tight-clearance contact.
//!
//! [`SimArm`] is a [`palpate_robot_io::RobotBackend`]: joint set-points go through a servo lag and the
//! arm's kinematics to a flange; between flange and tool sits the sensor, a stiff six-axis spring; the tool
//! is a dynamic body that touches the board. What the spring carries is what the sensor reads.
//!
//! [`ContactWorld`] is the contact part alone, for whoever brings an arm of their own.
//!
//! # Why the parameters are what they are
//!
//! rapier's defaults stop a perfectly aligned peg at the mouth with 20 N, because contacts are predicted
//! 20 mm ahead. What works at clearances of 0.05–1 mm: a prediction distance far below the clearance, stiff
//! contacts, several solver passes, Coulomb friction, no contact recycling or clustering.
//! `docs/results/contact.md` holds the measurements.

mod arm;
mod board;
mod config;
mod contact;
mod convert;

pub use arm::{SimArm, SimError};
pub use board::Board;
pub use config::{
    ComplianceConfig, ConfigError, HoleConfig, PegConfig, SensorConfig, ServoConfig, SimConfig, SolverConfig, ToolConfig,
};
pub use contact::ContactWorld;
