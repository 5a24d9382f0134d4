//! The chain: forward kinematics and the geometric Jacobian.

use nalgebra::{Matrix3, SMatrix, SVector};
use palpate_spatial::{Pose, UnitQuaternion, Vector3};

/// Axes in which a Jacobian is expressed; the reference point is the tip's origin either way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// Axes of the base link.
    BaseAligned,
    /// Axes of the tip.
    Body,
}

/// Limits of the joints; unbounded joints have infinite positions.
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

/// A moving joint about or along +z of its frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    /// From the frame after the previous joint to this joint's frame.
    pub(crate) before: Rigid,
    pub(crate) kind: JointKind,
}

/// A rigid transform as matrix and vector: composing these is cheaper than composing quaternions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rigid {
    pub(crate) R: Matrix3<f64>,
    pub(crate) p: Vector3,
}

impl From<Pose> for Rigid {
    fn from(pose: Pose) -> Self {
        Self { R: pose.rotation.to_rotation_matrix().into_inner(), p: pose.translation.vector }
    }
}

impl Rigid {
    fn then(&self, next: &Self) -> Self {
        Self { R: self.R * next.R, p: self.p + self.R * next.p }
    }

    /// Turns about the own z axis.
    fn turn(&mut self, angle: f64) {
        let (sin, cos) = angle.sin_cos();
        let (x, y) = (self.R.column(0).into_owned(), self.R.column(1).into_owned());
        self.R.set_column(0, &(x * cos + y * sin));
        self.R.set_column(1, &(y * cos - x * sin));
    }
}

/// A serial arm with `N` moving joints, built by [`from_urdf`](Self::from_urdf) and its siblings.
#[derive(Clone, Debug)]
pub struct SerialChain<const N: usize> {
    links: [Link; N],
    after: Rigid,
    limits: JointLimits<N>,
    names: Vec<String>,
}

impl<const N: usize> SerialChain<N> {
    pub(crate) fn new(links: [Link; N], after: Pose, limits: JointLimits<N>, names: Vec<String>) -> Self {
        Self { links, after: after.into(), limits, names }
    }

    /// The same chain with a tool mounted on its tip: from now on the tip is the tool.
    pub fn with_tool(mut self, tip_T_tool: Pose) -> Self {
        self.after = self.after.then(&tip_T_tool.into());
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

    /// base_T_tip at joints `q` (rad or m).
    pub fn forward(&self, q: &SVector<f64, N>) -> Pose {
        self.kinematics(q).pose()
    }

    /// Everything about one configuration, computed once.
    pub fn kinematics(&self, q: &SVector<f64, N>) -> Kinematics<N> {
        let mut axes = [(Vector3::zeros(), Vector3::zeros()); N];
        let mut T = Rigid { R: Matrix3::identity(), p: Vector3::zeros() };
        for (i, link) in self.links.iter().enumerate() {
            T = T.then(&link.before);
            let z = T.R.column(2).into_owned();
            axes[i] = (T.p, z);
            match link.kind {
                JointKind::Revolute => T.turn(q[i]),
                JointKind::Prismatic => T.p += z * q[i],
            }
        }
        Kinematics { tip: T.then(&self.after), axes, kinds: self.links.map(|l| l.kind) }
    }

    pub(crate) fn is_revolute(&self, joint: usize) -> bool {
        self.links[joint].kind == JointKind::Revolute
    }

    /// No target farther from the base than this can be reached, m; infinite with a prismatic joint.
    pub fn reach(&self) -> f64 {
        if self.links.iter().any(|l| l.kind == JointKind::Prismatic) {
            return f64::INFINITY;
        }
        self.links.iter().map(|l| l.before.p.norm()).sum::<f64>() + self.after.p.norm()
    }
}

/// One configuration of a chain.
#[derive(Clone, Copy, Debug)]
pub struct Kinematics<const N: usize> {
    pub(crate) tip: Rigid,
    /// Origin and axis of each joint, base axes.
    axes: [(Vector3, Vector3); N],
    kinds: [JointKind; N],
}

impl<const N: usize> Kinematics<N> {
    /// base_T_tip.
    pub fn pose(&self) -> Pose {
        let rotation = UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(self.tip.R));
        Pose::from_parts(self.tip.p.into(), rotation)
    }

    /// The geometric Jacobian: rows v then ω of the tip's origin, one column per joint.
    ///
    /// Revolute: J_i = [z_i × (p − o_i); z_i]. Prismatic: J_i = [z_i; 0].
    /// (Siciliano et al., *Robotics*, Sect. 3.1.3.)
    pub fn jacobian(&self, frame: Frame) -> SMatrix<f64, 6, N> {
        let mut J = SMatrix::<f64, 6, N>::zeros();
        for (i, (o, z)) in self.axes.iter().enumerate() {
            let (v, w) = match self.kinds[i] {
                JointKind::Revolute => (z.cross(&(self.tip.p - o)), *z),
                JointKind::Prismatic => (*z, Vector3::zeros()),
            };
            let (v, w) = match frame {
                Frame::BaseAligned => (v, w),
                Frame::Body => (self.tip.R.tr_mul(&v), self.tip.R.tr_mul(&w)),
            };
            J.fixed_view_mut::<3, 1>(0, i).copy_from(&v);
            J.fixed_view_mut::<3, 1>(3, i).copy_from(&w);
        }
        J
    }

    /// Singular values of the Jacobian, largest first. Near zero: a direction is lost. Allocates.
    pub fn singular_values(&self) -> Vec<f64> {
        let J = self.jacobian(Frame::BaseAligned);
        let J = faer::Mat::from_fn(6, N, |row, column| J[(row, column)]);
        // The only failure is no convergence, which a finite 6×N matrix does not show; NaN says so.
        J.singular_values().unwrap_or_else(|_| vec![f64::NAN; N.min(6)])
    }

    /// Yoshikawa's manipulability: the product of the singular values.
    pub fn manipulability(&self) -> f64 {
        self.singular_values().into_iter().product()
    }
}
