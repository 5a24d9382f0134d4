//! One configuration: tip pose and geometric Jacobian.

use nalgebra::SMatrix;
use palpate_spatial::{Pose, Vector3};

use crate::chain::JointKind;
use crate::rigid::Rigid;

/// Axes in which a Jacobian is expressed; the reference point is the tip's origin either way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// Axes of the base link (pinocchio's `LOCAL_WORLD_ALIGNED`).
    BaseAligned,
    /// Axes of the tip (pinocchio's `LOCAL`).
    Body,
}

/// One configuration of a chain, made by [`SerialChain::kinematics`](crate::SerialChain::kinematics).
#[derive(Clone, Copy, Debug)]
pub struct Kinematics<const N: usize> {
    pub(crate) tip: Rigid,
    /// A point on and the direction of each joint's axis, base axes.
    pub(crate) axes: [(Vector3, Vector3); N],
    pub(crate) kinds: [JointKind; N],
}

impl<const N: usize> Kinematics<N> {
    /// base_T_tip.
    pub fn pose(&self) -> Pose {
        self.tip.pose()
    }

    /// The geometric Jacobian: (v, ω) = J·q̇ of the tip's origin, one column per joint.
    ///
    /// Revolute: J_i = [z_i × (p − o_i); z_i]. Prismatic: J_i = [z_i; 0].
    /// (Siciliano et al., *Robotics: Modelling, Planning and Control*, Sect. 3.1.3.)
    ///
    /// ```
    /// # use palpate_kinematics::{Frame, SerialChain};
    /// # use palpate_spatial::JointVector;
    /// # let urdf = include_str!("../../../assets/robots/ur3e.urdf");
    /// let chain = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool0")?;
    /// let q = JointVector::from([0.3, -1.2, 1.9, -2.0, -1.6, 0.4]);
    /// let base_J = chain.kinematics(&q).jacobian(Frame::BaseAligned);
    /// // The first joint turns about the base's z axis.
    /// assert!((base_J[(5, 0)] - 1.0).abs() < 1e-15);
    /// # Ok::<(), palpate_kinematics::ModelError>(())
    /// ```
    #[inline]
    pub fn jacobian(&self, frame: Frame) -> SMatrix<f64, 6, N> {
        let mut J = SMatrix::<f64, 6, N>::zeros();
        for (i, (o, z)) in self.axes.iter().enumerate() {
            let (v, w) = match self.kinds[i] {
                JointKind::Revolute => (z.cross(&(self.tip.p - o)), *z),
                JointKind::Prismatic => (*z, Vector3::zeros()),
            };
            let (v, w) = match frame {
                Frame::BaseAligned => (v, w),
                Frame::Body => (self.tip.unrotate(&v), self.tip.unrotate(&w)),
            };
            J.column_mut(i).copy_from_slice(&[v.x, v.y, v.z, w.x, w.y, w.z]);
        }
        J
    }
}
