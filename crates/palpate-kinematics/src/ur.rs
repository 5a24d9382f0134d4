//! Universal Robots e-Series: the maker's figures.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::SVector;
use palpate_spatial::{Pose, UnitQuaternion, Vector3};

use crate::chain::{JointLimits, SerialChain};
use crate::dh::DhTable;
use crate::error::ModelError;

/// The arms whose figures are built in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum UrModel {
    /// 3 kg, 0.5 m.
    Ur3e,
    /// 5 kg, 0.85 m.
    Ur5e,
    /// 12.5 kg, 1.3 m.
    Ur10e,
}

/// Joint names of every UR, base to tip.
pub const UR_JOINTS: [&str; 6] = [
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
];

impl UrModel {
    /// All of them, small to large.
    pub const ALL: [Self; 3] = [Self::Ur3e, Self::Ur5e, Self::Ur10e];

    /// "UR3e" and so on.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ur3e => "UR3e",
            Self::Ur5e => "UR5e",
            Self::Ur10e => "UR10e",
        }
    }

    /// Nominal figures, from the controller's frame *Base* to the flange (`tool0`).
    ///
    /// # References
    /// Universal Robots, *DH parameters for calculations of kinematics and dynamics*.
    pub fn dh(self) -> DhTable<6> {
        let [d1, a2, a3, d4, d5, d6] = match self {
            Self::Ur3e => [0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921],
            Self::Ur5e => [0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996],
            Self::Ur10e => [0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655],
        };
        DhTable {
            theta: [0.0; 6],
            d: [d1, 0.0, 0.0, d4, d5, d6],
            a: [0.0, a2, a3, 0.0, 0.0, 0.0],
            alpha: [FRAC_PI_2, 0.0, 0.0, FRAC_PI_2, -FRAC_PI_2, 0.0],
        }
    }

    /// Joint limits: ±2π, the elbow by convention ±π, wrist 3 of the UR3e without end.
    pub fn limits(self) -> JointLimits<6> {
        let mut upper = SVector::from([TAU, TAU, PI, TAU, TAU, TAU]);
        if self == Self::Ur3e {
            upper[5] = f64::INFINITY;
        }
        let velocity = match self {
            Self::Ur3e => [PI, PI, PI, TAU, TAU, TAU],
            Self::Ur5e => [PI; 6],
            Self::Ur10e => [2.0 * PI / 3.0, 2.0 * PI / 3.0, PI, PI, PI, PI],
        };
        JointLimits { lower: -upper, upper, velocity: velocity.into() }
    }

    /// base_link_T_Base: UR's ROS frame `base_link` is the controller's frame *Base* turned by π about z.
    pub fn base_link_T_base() -> Pose {
        let half_turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI);
        Pose::from_parts(Vector3::zeros().into(), half_turn)
    }

    /// The chain from `base_link` to `tool0` with the figures of one particular arm.
    ///
    /// `delta` is what its controller reports as calibration: differences from [`dh`](Self::dh).
    ///
    /// ```
    /// # use palpate_kinematics::{DhTable, UrModel};
    /// # use palpate_spatial::JointVector;
    /// let zero = DhTable { theta: [0.0; 6], d: [0.0; 6], a: [0.0; 6], alpha: [0.0; 6] };
    /// // A tenth of a millimetre in the upper arm moves the tool by as much.
    /// let delta = DhTable { a: [0.0, 1e-4, 0.0, 0.0, 0.0, 0.0], ..zero };
    /// let (nominal, real) = (UrModel::Ur3e.calibrated_chain(&zero)?, UrModel::Ur3e.calibrated_chain(&delta)?);
    /// let q = JointVector::from([0.3, -1.2, 1.9, -2.0, -1.6, 0.4]);
    /// let shift = real.forward(&q).translation.vector - nominal.forward(&q).translation.vector;
    /// assert!((shift.norm() - 1e-4).abs() < 1e-12);
    /// # Ok::<(), palpate_kinematics::ModelError>(())
    /// ```
    ///
    /// # Errors
    /// A difference that is not finite.
    pub fn calibrated_chain(self, delta: &DhTable<6>) -> Result<SerialChain<6>, ModelError> {
        let dh = self.dh().calibrated(delta);
        SerialChain::from_dh(&dh, &Self::base_link_T_base(), &self.limits(), UR_JOINTS)
    }
}
