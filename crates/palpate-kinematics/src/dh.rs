//! Denavit-Hartenberg tables and their calibration.

use nalgebra::SVector;
use palpate_spatial::{Pose, UnitQuaternion, Vector3};

use crate::builder::{ChainBuilder, Limit};
use crate::chain::{JointKind, JointLimits, SerialChain};
use crate::error::ModelError;

/// Revolute joints in the standard (distal) convention: T_i = Rz(q_i + θ_i)·Tz(d_i)·Tx(a_i)·Rx(α_i).
///
/// # References
/// Siciliano et al., *Robotics: Modelling, Planning and Control*, Sect. 2.8.2; Universal Robots, *DH
/// parameters for calculations of kinematics and dynamics*.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DhTable<const N: usize> {
    /// Joint offsets θ, rad.
    pub theta: [f64; N],
    /// Offsets along the joint axis d, m.
    pub d: [f64; N],
    /// Offsets along the common normal a, m.
    pub a: [f64; N],
    /// Twists α, rad.
    pub alpha: [f64; N],
}

impl<const N: usize> DhTable<N> {
    /// The table of one particular arm: every figure plus its measured difference from the nominal one.
    ///
    /// UR controllers report these differences (delta DH). Near the parallel shoulder, elbow and wrist 1
    /// axes δd can be hundreds of metres for a δα of milliradians; the sums are what matters.
    ///
    /// ```
    /// # use palpate_kinematics::{DhTable, SerialChain, UrModel};
    /// let zero = DhTable { theta: [0.0; 6], d: [0.0; 6], a: [0.0; 6], alpha: [0.0; 6] };
    /// let delta = DhTable { d: [0.0, 0.0, 0.0, 2e-4, -1e-4, 0.0], ..zero };
    /// let calibrated = UrModel::Ur3e.dh().calibrated(&delta);
    /// assert!((calibrated.d[3] - 0.13125).abs() < 1e-15);
    /// ```
    pub fn calibrated(&self, delta: &Self) -> Self {
        let sum = |a: &[f64; N], b: &[f64; N]| std::array::from_fn(|i| a[i] + b[i]);
        Self {
            theta: sum(&self.theta, &delta.theta),
            d: sum(&self.d, &delta.d),
            a: sum(&self.a, &delta.a),
            alpha: sum(&self.alpha, &delta.alpha),
        }
    }

    /// base_T_tip by multiplying the table out: slower than a [`SerialChain`], for checks.
    pub fn forward(&self, q: &SVector<f64, N>) -> Pose {
        let turns = (0..N).map(|i| about_z(self.theta[i] + q[i]) * self.after_joint(i));
        turns.fold(Pose::identity(), |T, link| T * link)
    }

    /// Tz(d)·Tx(a)·Rx(α).
    fn after_joint(&self, i: usize) -> Pose {
        let roll = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), self.alpha[i]);
        Pose::from_parts(Vector3::new(self.a[i], 0.0, self.d[i]).into(), roll)
    }
}

impl<const N: usize> SerialChain<N> {
    /// Builds the chain of a Denavit-Hartenberg table whose first frame stands at `base_T_dh`.
    ///
    /// ```
    /// # use palpate_kinematics::{DhTable, SerialChain, UR_JOINTS, UrModel};
    /// # use palpate_spatial::{JointVector, Pose};
    /// let (dh, limits) = (UrModel::Ur5e.dh(), UrModel::Ur5e.limits());
    /// let on_a_table = Pose::translation(0.0, 0.0, 0.8);
    /// let chain = SerialChain::from_dh(&dh, &on_a_table, &limits, UR_JOINTS)?;
    /// let q = JointVector::from([0.3, -1.2, 1.9, -2.0, -1.6, 0.4]);
    /// let expected = on_a_table * dh.forward(&q);
    /// assert!((chain.forward(&q).translation.vector - expected.translation.vector).norm() < 1e-12);
    /// # Ok::<(), palpate_kinematics::ModelError>(())
    /// ```
    ///
    /// # Errors
    /// A figure that is not finite, or a limit that is empty or not positive.
    pub fn from_dh(
        dh: &DhTable<N>,
        base_T_dh: &Pose,
        limits: &JointLimits<N>,
        names: [&str; N],
    ) -> Result<Self, ModelError> {
        let mut chain = ChainBuilder::new();
        chain.fixed(base_T_dh);
        for (i, name) in names.into_iter().enumerate() {
            let bad = |what| ModelError::BadJoint { joint: name.into(), what };
            let row = [dh.theta[i], dh.d[i], dh.a[i], dh.alpha[i]];
            if !row.iter().all(|x| x.is_finite()) {
                return Err(bad(format!("its figures θ, d, a, α = {row:?} are not finite")));
            }
            let (lower, upper, velocity) = (limits.lower[i], limits.upper[i], limits.velocity[i]);
            if !(lower < upper && velocity > 0.0) {
                return Err(bad(format!(
                    "its limits [{lower}, {upper}] or its speed {velocity} are empty"
                )));
            }
            chain.fixed(&about_z(dh.theta[i]));
            let limit = Limit { lower, upper, velocity };
            chain.joint(name, JointKind::Revolute, UnitQuaternion::identity(), limit);
            chain.fixed(&dh.after_joint(i));
        }
        chain.finish()
    }
}

fn about_z(angle: f64) -> Pose {
    Pose::from_parts(
        Vector3::zeros().into(),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle),
    )
}
