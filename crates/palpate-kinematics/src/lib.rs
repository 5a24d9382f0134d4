//! Forward kinematics, Jacobians and inverse kinematics of serial arms described by a URDF.
//!
//! A fail-safe layer asks, five hundred times a second: is there a joint configuration for this
//! pose, close to the one I have? [`SerialChain::solve_near`] answers deterministically, without
//! allocation, and gives a typed reason when the answer is no.
//!
//! ```
//! use palpate_kinematics::{IkOptions, SerialChain};
//! use palpate_spatial::JointVector;
//!
//! let urdf = include_str!("../../../assets/robots/ur3e.urdf");
//! let chain = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool0")?;
//! let q = JointVector::from([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
//! let mut base_T_tool = chain.forward(&q);
//! base_T_tool.translation.z -= 0.001;
//! let solution = chain.solve_near(&base_T_tool, &q, &IkOptions::default())?;
//! assert!((solution.q - q).amax() < 0.01);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What is where
//!
//! - [`SerialChain`]: an arm from a URDF or a [`DhTable`]; forward kinematics; tracking IK for any number of
//!   joints.
//! - [`Kinematics`]: pose, Jacobian, manipulability and smallest singular value of one configuration.
//! - [`LinkFrame`]: where each link is, for collision geometry.
//! - [`UrSolver`]: tracking IK with all eight branches of a UR to fall back on, calibrated or not.
//! - [`UrModel`], [`UrAnalytic`]: the maker's figures and the closed form that they allow.
//!
//! # Conventions
//!
//! - SI units. A joint is in rad, a prismatic one in m.
//! - `base_T_tip` is the tip link's pose in base-link axes.
//! - Jacobian rows are linear then angular velocity of the tip's origin, in the axes of a [`Frame`].
//! - UR's controller reports poses in its frame *Base*, which is `base_link` turned by π about z.
//! - NaN and infinity are never solved: they come back as a refusal.

mod builder;
mod chain;
mod dh;
mod error;
mod frames;
mod inverse;
mod jacobian;
mod ldl;
mod levenberg;
mod rigid;
mod singular;
mod trig;
mod ur;
mod ur_analytic;
mod ur_solver;
mod urdf;

pub use chain::{JointLimits, SerialChain};
pub use dh::DhTable;
pub use error::{IkError, ModelError};
pub use frames::LinkFrame;
pub use inverse::{IkOptions, IkSolution};
pub use jacobian::{Frame, Kinematics};
pub use ur::{UR_JOINTS, UrModel};
pub use ur_analytic::{UrAnalytic, UrBranch, UrSolutions};
pub use ur_solver::UrSolver;
