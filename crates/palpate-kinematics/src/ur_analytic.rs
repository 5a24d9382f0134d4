//! The closed form of a UR arm with nominal figures: all eight configurations that reach a pose.
//!
//! Three axes (shoulder lift, elbow, wrist 1) are parallel; that is what makes a closed form possible, and
//! what no calibrated arm has exactly. Use it for cold starts, to list the branches, and to prove that a
//! nominal arm cannot reach a pose.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN reaches nothing")]

use palpate_spatial::{JointVector, Pose, Vector3};

use crate::dh::DhTable;
use crate::rigid::Rigid;

/// Which of the eight families a configuration belongs to, by the signs that a square root leaves open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct UrBranch {
    /// The wrist is in front of the shoulder: o5·x1 ≥ 0, in UR's mathematical axes.
    pub shoulder: bool,
    /// sin q3 ≥ 0.
    pub elbow: bool,
    /// sin q5 ≥ 0.
    pub wrist: bool,
}

/// Up to eight configurations that reach one pose, joints in (−π, π].
#[derive(Clone, Copy, Debug)]
pub struct UrSolutions {
    all: [(UrBranch, JointVector); 8],
    len: usize,
    shortfall: f64,
}

impl UrSolutions {
    /// The configurations and their branches.
    pub fn as_slice(&self) -> &[(UrBranch, JointVector)] {
        &self.all[..self.len]
    }

    /// By how much the arm is too short (or too long) for the branch that comes nearest, m; 0 if one reaches.
    pub fn shortfall(&self) -> f64 {
        if self.len == 0 { self.shortfall } else { 0.0 }
    }
}

/// The closed form, from the controller's frame *Base* to the flange.
///
/// ```
/// use palpate_kinematics::{UrAnalytic, UrModel};
/// use palpate_spatial::JointVector;
///
/// let arm = UrAnalytic::new(UrModel::Ur5e);
/// let q = JointVector::from([0.3, -1.2, 1.9, -2.0, -1.6, 0.4]);
/// let base_T_flange = UrModel::Ur5e.dh().forward(&q);
/// let solutions = arm.solve_all(&base_T_flange, 0.0);
/// assert_eq!(solutions.as_slice().len(), 8);
/// let (_, same) = solutions.as_slice().iter().find(|(branch, _)| *branch == arm.branch(&q)).unwrap();
/// assert!((same - q).amax() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct UrAnalytic {
    dh: DhTable<6>,
}

/// Lengths by which a pose may miss the reach and still count as stretched out, m.
pub(crate) const SLACK: f64 = 1e-9;

/// Below this sine of wrist 2, wrist 3 is free; above the 1e-9 of rounded URDFs, below what IK accepts.
const FREE_WRIST: f64 = 1e-6;

impl UrAnalytic {
    /// The closed form of one arm.
    pub fn new(model: crate::UrModel) -> Self {
        Self { dh: model.dh() }
    }

    /// All configurations that reach `base_T_flange`; where wrist 3 is free it takes `q6_if_free`.
    ///
    /// # References
    /// Hawkins 2013, *Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms*; here with atan2
    /// in place of acos, so that no angle loses digits next to a branch point.
    pub fn solve_all(&self, base_T_flange: &Pose, q6_if_free: f64) -> UrSolutions {
        self.solve_with_slack(&Rigid::from(base_T_flange), q6_if_free, SLACK)
    }

    /// The branch of a configuration.
    pub fn branch(&self, q: &JointVector) -> UrBranch {
        let [_, a2, a3, ..] = self.dh.a;
        let (s234, _) = (q[1] + q[2] + q[3]).sin_cos();
        let forward = a2 * q[1].cos() + a3 * (q[1] + q[2]).cos() + self.dh.d[4] * s234;
        UrBranch { shoulder: forward >= 0.0, elbow: q[2].sin() >= 0.0, wrist: q[4].sin() >= 0.0 }
    }

    /// Lengths may miss by `slack` and are then clamped: next best on an arm that is not quite nominal.
    pub(crate) fn solve_with_slack(&self, T: &Rigid, q6_if_free: f64, slack: f64) -> UrSolutions {
        let empty = (UrBranch { shoulder: true, elbow: true, wrist: true }, JointVector::zeros());
        let mut found = UrSolutions { all: [empty; 8], len: 0, shortfall: f64::INFINITY };
        let [d1, _, _, d4, d5, d6] = self.dh.d;
        // The axes of wrist 2 and the flange meet at o5; z1, the shoulder lift axis, sees it at d4.
        let o5 = T.p - T.z * d6;
        let radius = o5.x.hypot(o5.y);
        let Some(forward) = other_leg(radius, d4, slack, &mut found.shortfall) else {
            return found;
        };
        for shoulder in [true, false] {
            let q1 = o5.y.atan2(o5.x) + d4.atan2(if shoulder { forward } else { -forward });
            let (s1, c1) = q1.sin_cos();
            let (x1, z1) = (Vector3::new(c1, s1, 0.0), Vector3::new(s1, -c1, 0.0));
            let (rx, ry, rz) = (T.x.dot(&z1), T.y.dot(&z1), T.z.dot(&z1));
            let s5_size = rx.hypot(ry);
            for wrist in [true, false] {
                let sign = if wrist { 1.0 } else { -1.0 };
                let q5 = (sign * s5_size).atan2(rz);
                let q6 =
                    if s5_size < FREE_WRIST { q6_if_free } else { (-ry * sign).atan2(rx * sign) };
                let ((s5, c5), (s6, c6)) = (q5.sin_cos(), q6.sin_cos());
                // Axes of wrist 1's frame and its origin, from the flange backwards.
                let x4 = T.rotate(&Vector3::new(c5 * c6, -c5 * s6, -s5));
                let z4 = T.rotate(&Vector3::new(-s6, -c6, 0.0));
                let o4 = o5 - z4 * d5;
                let q234 = x4.z.atan2(x4.dot(&x1));
                let (x, y) = (o4.dot(&x1), o4.z - d1);
                for (elbow, q2, q3) in
                    self.two_links(x, y, slack, &mut found.shortfall).into_iter().flatten()
                {
                    let q = JointVector::from([q1, q2, q3, q234 - q2 - q3, q5, q6]);
                    found.all[found.len] =
                        (UrBranch { shoulder, elbow, wrist }, q.map(half_turn_window));
                    found.len += 1;
                }
            }
        }
        found
    }

    /// Shoulder lift and elbow that put the end of two links at (x, y) in the arm's plane.
    fn two_links(
        &self,
        x: f64,
        y: f64,
        slack: f64,
        shortfall: &mut f64,
    ) -> [Option<(bool, f64, f64)>; 2] {
        let [_, a2, a3, ..] = self.dh.a;
        let (longest, shortest) = (a2.abs() + a3.abs(), (a2.abs() - a3.abs()).abs());
        let radius = x.hypot(y);
        let missing = (radius - longest).max(shortest - radius);
        if !(missing <= slack) {
            *shortfall = shortfall.min(missing);
            return [None; 2];
        }
        // 4a2²a3² − (r² − a2² − a3²)², in factors that lose no digits when stretched out or folded.
        let sine2 =
            (longest - radius) * (longest + radius) * (radius - shortest) * (radius + shortest);
        let sine = sine2.max(0.0).sqrt();
        let cosine = radius * radius - a2 * a2 - a3 * a3;
        [true, false].map(|elbow| {
            // a2·a3 > 0, so the common divisor 2a2a3 drops out of atan2.
            let q3 = (if elbow { sine } else { -sine }).atan2(cosine);
            let q2 = y.atan2(x) - (a3 * q3.sin()).atan2(a2 + a3 * q3.cos());
            Some((elbow, q2, q3))
        })
    }
}

/// √(hypotenuse² − leg²), or None when the leg is longer by more than `slack`.
fn other_leg(hypotenuse: f64, leg: f64, slack: f64, shortfall: &mut f64) -> Option<f64> {
    let missing = leg - hypotenuse;
    if !(missing <= slack) {
        *shortfall = missing;
        return None;
    }
    Some(((hypotenuse - leg) * (hypotenuse + leg)).max(0.0).sqrt())
}

/// Into (−π, π].
fn half_turn_window(angle: f64) -> f64 {
    use std::f64::consts::TAU;
    let turned = angle - TAU * (angle / TAU).round();
    if turned <= -0.5 * TAU { turned + TAU } else { turned }
}
