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
//! # Conventions
//!
//! - `base_T_tip` is the tip link's pose in base-link axes.
//! - Jacobian rows are linear then angular velocity of the tip's origin.
//! - UR's controller reports poses in its frame *Base*, which is `base_link` turned by π about z.

mod chain;
mod error;
mod inverse;
mod model;

pub use chain::{Frame, JointLimits, Kinematics, SerialChain};
pub use error::{IkError, ModelError};
pub use inverse::{IkOptions, IkSolution};
