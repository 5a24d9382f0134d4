//! Where every link is.

use nalgebra::{Matrix3, SVector};
use palpate_spatial::Vector3;

use crate::chain::{JointKind, SerialChain};
use crate::rigid::Rigid;
use crate::trig::sin_cos;

/// A frame in base axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkFrame {
    /// Its axes, as columns.
    pub rotation: Matrix3<f64>,
    /// Its origin, m.
    pub origin: Vector3,
}

impl LinkFrame {
    /// A point given in this frame, in base axes.
    #[inline]
    pub fn point(&self, local: &Vector3) -> Vector3 {
        self.rotation * local + self.origin
    }
}

impl From<&Rigid> for LinkFrame {
    fn from(T: &Rigid) -> Self {
        Self { rotation: T.matrix(), origin: T.p }
    }
}

impl<const N: usize> SerialChain<N> {
    /// base_T_link of every moving link, base to tip, and base_T_tip: for collision geometry.
    ///
    /// A link's frame has its joint's axis as +z and the point of that axis nearest to the joint before as
    /// its origin, and moves with the joint. It is the URDF's frame of the link where the joint's axis is z
    /// and its origin has no part along it, as in the URDFs of this project; other URDFs of the same arm, and
    /// calibrations with δd of many metres, still have their links' origins in the same places.
    ///
    /// ```
    /// # use palpate_kinematics::SerialChain;
    /// # use palpate_spatial::JointVector;
    /// # let urdf = include_str!("../../../assets/robots/ur3e.urdf");
    /// let chain = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool0")?;
    /// let q = JointVector::from([0.3, -1.2, 1.9, -2.0, -1.6, 0.4]);
    /// let (links, tip) = chain.frames(&q);
    /// // The elbow is an upper arm's length away from the shoulder.
    /// assert!(((links[2].origin - links[1].origin).norm() - 0.24355).abs() < 1e-12);
    /// assert!((tip.origin - chain.forward(&q).translation.vector).norm() < 1e-12);
    /// # Ok::<(), palpate_kinematics::ModelError>(())
    /// ```
    #[inline]
    pub fn frames(&self, q: &SVector<f64, N>) -> ([LinkFrame; N], LinkFrame) {
        let (sin, cos) = sin_cos(q);
        let zero = LinkFrame { rotation: Matrix3::zeros(), origin: Vector3::zeros() };
        let mut frames = [zero; N];
        let mut T =
            Rigid { x: Vector3::x(), y: Vector3::y(), z: Vector3::z(), p: Vector3::zeros() };
        for (i, link) in self.links.iter().enumerate() {
            T = if i == 0 { link.before } else { T.then(&link.before) };
            match link.kind {
                JointKind::Revolute => T.turn(sin[i], cos[i]),
                JointKind::Prismatic => T.p += T.z * q[i],
            }
            frames[i] = LinkFrame::from(&T);
        }
        (frames, LinkFrame::from(&T.then(&self.after)))
    }
}
