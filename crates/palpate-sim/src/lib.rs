//! A rapier simulation of an arm, its force/torque sensor and tight-clearance contact.
//!
//! [`SimArm`] is a [`RobotBackend`](palpate_robot_io::RobotBackend): joint set-points go through a servo
//! lag and the arm's kinematics to a flange; between flange and tool sits the sensor, a stiff six-axis
//! spring; the tool is a dynamic body that touches the board. What the spring carries is what the sensor
//! reads. [`ContactWorld`] is the contact part alone, for whoever brings an arm of their own.
//!
//! ```
//! use palpate_sim::{ContactWorld, SimConfig};
//! use palpate_spatial::{Pose, UnitQuaternion, Vector3};
//!
//! # let text = include_str!("../tests/contact/stiff.toml");
//! let config: SimConfig = toml::from_str(text)?;
//! config.validate()?;
//! // The tool points down: a 150 mm tool whose tip hovers 1 mm over the board, beside the hole.
//! let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
//! let flange = |tip| Pose::from_parts(Vector3::new(0.05, 0.0, tip + 0.150).into(), down);
//! let mut world = ContactWorld::new(&config, &flange(0.001))?;
//! let mut felt = palpate_spatial::Wrench::zero();
//! for tick in 0..500 {
//!     let tip = (0.001 - 2e-5 * f64::from(tick)).max(-1e-4);
//!     felt = world.tick(&flange(tip), 0.002)?;
//! }
//! // 0.1 mm into a spring of 100 N/mm: 10 N against the tool's z axis.
//! assert!((felt.force.z + 10.0).abs() < 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Parts
//!
//! A peg (round, square or hexagonal) in a hole of the same outline with any clearance from 2 mm down to
//! 0.01 mm; a ring in the tool over a bolt; either with a rigid or a sprung receptacle. Contact between the two
//! comes from closed forms that rapier's solver is given as shapes of its own: no facets, no seams.
//!
//! # Frames
//!
//! The sensor frame is tool0. The held part lies along tool0 +z and ends at `tool.length`; a prism's sides
//! lie across tool0 x and y. The hole frame has its origin in the middle of the mouth, or of the bolt's top, and
//! z out of it, so a tool about to enter has its z axis along hole −z.
//!
//! # Why the parameters are what they are
//!
//! rapier's defaults stop a perfectly aligned peg at the mouth with 20 N, because contacts are predicted
//! 20 mm ahead. What works at clearances of 0.05–1 mm: a prediction distance far below the clearance,
//! contacts as stiff as 1000 Hz, several Gauss-Seidel passes per substep, Coulomb friction that also acts while
//! overlaps are corrected (without it a wedged round peg walks out of its wedge), no contact recycling or
//! clustering. `docs/results/contact.md` holds the measurements.
//!
//! # Map
//!
//! `config` and `check` (what it takes and what it refuses), `profile` (faces of the parts), `round` and `prism`
//! (contacts in closed form), `touch` and `exact` (how rapier gets them), `build` (bodies), `contact` (the
//! world), `servo`, `sensor`, `arm` (the backend), `convert` (nalgebra ↔ glam), `error`.

mod arm;
mod build;
mod check;
mod config;
mod contact;
mod convert;
mod error;
mod exact;
mod prism;
mod profile;
mod round;
mod sensor;
mod servo;
mod spread;
mod touch;

pub use arm::SimArm;
pub use config::{
    ComplianceConfig, Holder, HoleConfig, ObstacleConfig, PegConfig, PegShape, ReceptacleConfig,
    SensorConfig, ServoConfig, SimConfig, SolverConfig, ToolConfig,
};
pub use contact::{ContactPoint, ContactWorld};
pub use error::{EngineFault, SimError};
pub use spread::SpreadConfig;
