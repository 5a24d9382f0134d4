//! Poses, twists, wrenches and unit quaternions for manipulators.
//!
//! Every other crate speaks in these types, so that a force is never mistaken for a torque and a
//! frame is never left unsaid.
//!
//! ```
//! use palpate_spatial::{Pose, Twist, integrate};
//!
//! // A tool that moves 10 mm/s along base x for half a second.
//! let twist = Twist::new([0.01, 0.0, 0.0].into(), [0.0; 3].into());
//! let base_T_tool = integrate(&Pose::identity(), &twist, 0.5);
//! assert!((base_T_tool.translation.x - 0.005).abs() < 1e-15);
//! ```
//!
//! # Conventions
//!
//! - SI units: m, rad, s, N, N·m.
//! - `parent_T_child` maps child coordinates to parent coordinates.
//! - Six-vectors are ordered linear before angular: [`Twist`] is (v, ω), [`Wrench`] is (f, τ).
//! - Quaternions are Hamilton quaternions; q and −q are the same attitude everywhere here.

mod orientation;
mod twist;
mod wrench;

pub use orientation::{
    integrate, pose_error_log, pose_error_vector_part, rotation_error_log,
    rotation_error_vector_part,
};
pub use twist::Twist;
pub use wrench::Wrench;

/// A rigid transform, named `parent_T_child`.
pub type Pose = nalgebra::Isometry3<f64>;
/// Three coordinates in the frame that the variable's name says.
pub type Vector3 = nalgebra::Vector3<f64>;
/// Six coordinates, linear before angular.
pub type Vector6 = nalgebra::Vector6<f64>;
/// An attitude.
pub type UnitQuaternion = nalgebra::UnitQuaternion<f64>;

/// Joints of the arms this project drives.
pub const DOF: usize = 6;
/// One value per joint, base to tip; rad, rad/s or N·m as the name says.
pub type JointVector = nalgebra::SVector<f64, DOF>;
