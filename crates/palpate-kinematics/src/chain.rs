//! The chain and its forward kinematics.

use nalgebra::SVector;
use palpate_spatial::{Pose, Vector3};

use crate::jacobian::Kinematics;
use crate::rigid::Rigid;
use crate::trig::sin_cos;

/// Limits of the joints; joints without an end have infinite positions.
#[derive(Clone, Debug, PartialEq)]
pub struct JointLimits<const N: usize> {
    /// Lower positions, rad or m.
    pub lower: SVector<f64, N>,
    /// Upper positions, rad or m.
    pub upper: SVector<f64, N>,
    /// Speeds, rad/s or m/s.
    pub velocity: SVector<f64, N>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum JointKind {
    Revolute,
    Prismatic,
}

/// A joint that turns about or slides along +z of its frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    /// From the frame after the previous joint to this joint's frame at zero.
    pub(crate) before: Rigid,
    pub(crate) kind: JointKind,
}

/// A serial arm with `N` moving joints.
///
/// Built by [`from_urdf`](Self::from_urdf) and its siblings, or from Denavit-Hartenberg figures by
/// [`from_dh`](Self::from_dh). Immutable: one chain serves any number of threads.
///
/// ```
/// # use palpate_kinematics::SerialChain;
/// # let urdf = include_str!("../../../assets/robots/ur5e.urdf");
/// let chain = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool0")?;
/// assert_eq!(chain.joint_names()[2], "elbow_joint");
/// # Ok::<(), palpate_kinematics::ModelError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SerialChain<const N: usize> {
    pub(crate) links: [Link; N],
    pub(crate) after: Rigid,
    limits: JointLimits<N>,
    names: Vec<String>,
    reach: f64,
}

impl<const N: usize> SerialChain<N> {
    pub(crate) fn new(
        links: [Link; N],
        after: Rigid,
        limits: JointLimits<N>,
        names: Vec<String>,
    ) -> Self {
        let reach = reach(&links, &after, &limits);
        Self { links, after, limits, names, reach }
    }

    /// The same chain with a tool mounted on its tip: from now on the tip is the tool.
    ///
    /// ```
    /// # use palpate_kinematics::SerialChain;
    /// # use palpate_spatial::{JointVector, Pose};
    /// # let urdf = include_str!("../../../assets/robots/ur3e.urdf");
    /// let arm = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool0")?;
    /// let tool0_T_tool = Pose::translation(0.0, 0.0, 0.15);
    /// let q = JointVector::from([0.3, -1.2, 1.9, -2.0, -1.6, 0.4]);
    /// let expected = arm.forward(&q) * tool0_T_tool;
    /// let with_tool = arm.with_tool(tool0_T_tool);
    /// assert!((with_tool.forward(&q).translation.vector - expected.translation.vector).norm() < 1e-14);
    /// # Ok::<(), palpate_kinematics::ModelError>(())
    /// ```
    pub fn with_tool(mut self, tip_T_tool: Pose) -> Self {
        self.after = self.after.then(&Rigid::from(&tip_T_tool));
        self.reach = reach(&self.links, &self.after, &self.limits);
        self
    }

    /// Joint limits.
    pub fn limits(&self) -> &JointLimits<N> {
        &self.limits
    }

    /// Joint names, base to tip.
    pub fn joint_names(&self) -> &[String] {
        &self.names
    }

    /// No tip position farther from the base's origin than this exists, m; infinite with an endless
    /// prismatic joint.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// base_T_tip at joints `q` (rad or m).
    ///
    /// Not finite where `q` is not.
    ///
    /// ```
    /// # use palpate_kinematics::SerialChain;
    /// # use palpate_spatial::JointVector;
    /// # let urdf = include_str!("../../../assets/robots/ur3e.urdf");
    /// let chain = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool0")?;
    /// // Stretched straight up: d1 − a2 − a3 + d5 above the base, d4 + d6 in front of it.
    /// let up = JointVector::from([0.0, -90.0, 0.0, -90.0, 0.0, 0.0].map(f64::to_radians));
    /// let base_T_tool = chain.forward(&up);
    /// assert!((base_T_tool.translation.z - (0.15185 + 0.24355 + 0.2132 + 0.08535)).abs() < 1e-12);
    /// assert!((base_T_tool.translation.y - (0.13105 + 0.0921)).abs() < 1e-12);
    /// # Ok::<(), palpate_kinematics::ModelError>(())
    /// ```
    pub fn forward(&self, q: &SVector<f64, N>) -> Pose {
        self.kinematics(q).pose()
    }

    /// Everything about one configuration, computed once: pose, Jacobian, singularity measures.
    ///
    /// ```
    /// # use palpate_kinematics::{Frame, SerialChain};
    /// # use palpate_spatial::JointVector;
    /// # let urdf = include_str!("../../../assets/robots/ur3e.urdf");
    /// let chain = SerialChain::<6>::from_urdf_str(urdf, "base_link", "tool0")?;
    /// let q = JointVector::from([0.3, -1.2, 1.9, -2.0, -1.6, 0.4]);
    /// let here = chain.kinematics(&q);
    /// assert_eq!(here.pose(), chain.forward(&q));
    /// // (v, ω) of the tool while the shoulder pans at 1 rad/s.
    /// let twist = here.jacobian(Frame::BaseAligned) * JointVector::from([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    /// assert!((twist[0] + here.pose().translation.y).abs() < 1e-12);
    /// # Ok::<(), palpate_kinematics::ModelError>(())
    /// ```
    #[inline]
    pub fn kinematics(&self, q: &SVector<f64, N>) -> Kinematics<N> {
        let (sin, cos) = sin_cos(q);
        let mut axes = [(Vector3::zeros(), Vector3::zeros()); N];
        let mut kinds = [JointKind::Revolute; N];
        let mut T =
            Rigid { x: Vector3::x(), y: Vector3::y(), z: Vector3::z(), p: Vector3::zeros() };
        for (i, link) in self.links.iter().enumerate() {
            T = if i == 0 { link.before } else { T.then(&link.before) };
            axes[i] = (T.p, T.z);
            kinds[i] = link.kind;
            match link.kind {
                JointKind::Revolute => T.turn(sin[i], cos[i]),
                JointKind::Prismatic => T.p += T.z * q[i],
            }
        }
        Kinematics { tip: T.then(&self.after), axes, kinds }
    }

    #[inline]
    pub(crate) fn is_revolute(&self, joint: usize) -> bool {
        self.links[joint].kind == JointKind::Revolute
    }
}

/// The triangle inequality over all offsets and slides.
fn reach<const N: usize>(links: &[Link; N], after: &Rigid, limits: &JointLimits<N>) -> f64 {
    let slide = |i: usize| match links[i].kind {
        JointKind::Revolute => 0.0,
        JointKind::Prismatic => limits.lower[i].abs().max(limits.upper[i].abs()),
    };
    (0..N).map(|i| links[i].before.p.norm() + slide(i)).sum::<f64>() + after.p.norm()
}
