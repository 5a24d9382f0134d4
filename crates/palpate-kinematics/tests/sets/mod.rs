//! Arms and seeded test sets shared by the integration tests and the report.
#![expect(dead_code, unreachable_pub, reason = "every user takes what it needs")]
#![expect(clippy::unwrap_used, reason = "our own arms load")]

use std::f64::consts::{PI, TAU};

use palpate_kinematics::{DhTable, Frame, SerialChain, UR_JOINTS, UrModel, UrSolver};
use palpate_spatial::{JointVector, Pose, UnitQuaternion, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub type Stream = ChaCha8Rng;

pub fn stream(seed: u64) -> Stream {
    ChaCha8Rng::seed_from_u64(seed)
}

pub const URDFS: [(UrModel, &str); 3] = [
    (UrModel::Ur3e, include_str!("../../../../assets/robots/ur3e.urdf")),
    (UrModel::Ur5e, include_str!("../../../../assets/robots/ur5e.urdf")),
    (UrModel::Ur10e, include_str!("../../../../assets/robots/ur10e.urdf")),
];
pub const ODD_ARM: &str = include_str!("../data/odd_arm.urdf");

pub fn ur(model: UrModel) -> SerialChain<6> {
    let (_, urdf) = URDFS.into_iter().find(|(m, _)| *m == model).unwrap();
    SerialChain::from_urdf_str(urdf, "base_link", "tool0").unwrap()
}

pub fn odd_arm() -> SerialChain<7> {
    SerialChain::from_urdf_str(ODD_ARM, "plate", "tool").unwrap()
}

/// Magnitudes of a calibration: lengths (m) and angles (rad), normal with this deviation.
#[derive(Clone, Copy, Debug)]
pub struct Calibration {
    pub length: f64,
    pub angle: f64,
}

pub const CALIBRATIONS: [Calibration; 3] = [
    Calibration { length: 1e-4, angle: 2e-4 },
    Calibration { length: 5e-4, angle: 1e-3 },
    Calibration { length: 1e-3, angle: 3e-3 },
];

/// A UR whose every Denavit-Hartenberg figure, and a sixth degree of freedom per link, is a little off.
///
/// Magnitudes are assumed, not taken from a robot. Built through URDF text, as a calibrated arm is.
pub fn calibrated(model: UrModel, size: Calibration, rng: &mut Stream) -> SerialChain<6> {
    let (_, urdf) = URDFS.into_iter().find(|(m, _)| *m == model).unwrap();
    let mut robot = urdf_rs::read_from_string(urdf).unwrap();
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    for joint in &mut robot.joints {
        let turn = Vector3::from_fn(|_, _| normal() * size.angle);
        let [roll, pitch, yaw] = *joint.origin.rpy;
        let turned = UnitQuaternion::from_euler_angles(roll, pitch, yaw)
            * UnitQuaternion::from_scaled_axis(turn);
        let (roll, pitch, yaw) = turned.euler_angles();
        *joint.origin.rpy = [roll, pitch, yaw];
        *joint.origin.xyz = joint.origin.xyz.map(|x| x + normal() * size.length);
    }
    SerialChain::from_urdf(&robot, "base_link", "tool0").unwrap()
}

/// Delta DH as UR controllers report it: a little of everything, and the long δd of nearly parallel axes.
///
/// The elbow axis is tilted by β against the shoulder lift axis, and their common normal lies L = 0.1 m / β
/// away. That moves the elbow by L·sin β, which δθ and δa take back, as they do in a real report.
pub fn delta_dh(model: UrModel, size: Calibration, rng: &mut Stream) -> DhTable<6> {
    let mut normal = |scale: f64| scale * Distribution::<f64>::sample(&StandardNormal, rng);
    let mut column = |scale: f64| std::array::from_fn(|_| normal(scale));
    let mut delta = DhTable {
        theta: column(size.angle),
        d: column(size.length),
        a: column(size.length),
        alpha: column(size.angle),
    };
    let (tilt, away, a2) = (size.angle, 0.1 / size.angle, model.dh().a[1]);
    let turn = (-away * tilt.sin() / a2).asin();
    delta.alpha[1] = tilt;
    delta.d[1] += away;
    delta.d[2] -= away;
    delta.theta[1] += turn;
    delta.theta[2] -= turn;
    delta.a[1] += a2 * (turn.cos() - 1.0);
    delta
}

pub fn solver(chain: SerialChain<6>) -> UrSolver {
    UrSolver::new(chain, UrModel::Ur3e).unwrap()
}

/// Uniform within the limits; endless joints within ±2π.
pub fn configuration<const N: usize>(
    chain: &SerialChain<N>,
    rng: &mut Stream,
) -> nalgebra::SVector<f64, N> {
    let limits = chain.limits();
    nalgebra::SVector::from_fn(|i, _| {
        let (lower, upper) = (limits.lower[i].max(-TAU), limits.upper[i].min(TAU));
        rng.random_range(lower..=upper)
    })
}

/// A goal configuration and a seed for it.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    pub goal: JointVector,
    pub seed: JointVector,
}

/// Goals within the limits whose seed differs by 1–5 mm at the tool, for any configuration source.
pub fn near(
    chain: &SerialChain<6>,
    count: usize,
    rng: &mut Stream,
    mut goal: impl FnMut(&mut Stream) -> JointVector,
) -> Vec<Case> {
    let mut cases = Vec::with_capacity(count);
    while cases.len() < count {
        let goal = goal(rng);
        let direction = JointVector::from_fn(|_, _| rng.random_range(-1.0..1.0)).normalize();
        // A seed is as far as its tool is: scale the joint step until that is 1–5 mm.
        let wanted = rng.random_range(1e-3..5e-3);
        let tool = |q: &JointVector| chain.forward(q).translation.vector;
        let per_radian = (tool(&(goal + direction * 1e-3)) - tool(&goal)).norm() / 1e-3;
        let seed = goal + direction * (wanted / per_radian).min(0.045);
        let moved = (tool(&seed) - tool(&goal)).norm();
        let inside = |q: &JointVector| {
            (0..6).all(|i| q[i] >= chain.limits().lower[i] && q[i] <= chain.limits().upper[i])
        };
        if inside(&goal) && inside(&seed) && (1e-3..=5e-3).contains(&moved) {
            cases.push(Case { goal, seed });
        }
    }
    cases
}

/// The three singularities of a UR.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Singularity {
    /// sin q5 = 0.
    Wrist,
    /// sin q3 = 0.
    Elbow,
    /// The wrist centre on the cylinder about the base axis: o5·x1 = 0.
    Shoulder,
}

pub const SINGULARITIES: [Singularity; 3] =
    [Singularity::Wrist, Singularity::Elbow, Singularity::Shoulder];
pub const DISTANCES: [f64; 9] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 0.0];

/// [`singular_of`] the UR3e.
pub fn singular(kind: Singularity, distance: f64, rng: &mut Stream) -> JointVector {
    singular_of(UrModel::Ur3e, kind, distance, rng)
}

/// A random configuration of a nominal arm at a distance (rad, at the shoulder m) from a singularity.
pub fn singular_of(
    model: UrModel,
    kind: Singularity,
    distance: f64,
    rng: &mut Stream,
) -> JointVector {
    let mut q = JointVector::from_fn(|_, _| rng.random_range(-6.0..6.0));
    q[2] = rng.random_range(-3.0..3.0);
    let side: f64 = if rng.random() { distance } else { -distance };
    match kind {
        // −π, 0 or π: also folded and flipped arms are singular.
        Singularity::Wrist => q[4] = f64::from(rng.random_range(-1..=1)) * PI + side,
        Singularity::Elbow => q[2] = side,
        Singularity::Shoulder => {
            // a2·c2 + a3·c23 + d5·s234 = side, solved for q2.
            let dh = model.dh();
            let (s34, c34) = (q[2] + q[3]).sin_cos();
            let along = dh.a[1] + dh.a[2] * q[2].cos() + dh.d[4] * s34;
            let across = dh.d[4] * c34 - dh.a[2] * q[2].sin();
            let turn = (side / along.hypot(across)).clamp(-1.0, 1.0).acos();
            q[1] = across.atan2(along) + if rng.random() { turn } else { -turn };
        }
    }
    q
}

/// As [`singular_of`], at a distance (rad, all of them) from where `chain` itself, not its nominal arm, is
/// singular: det J = 0, found by secants along the joint that leads there.
pub fn singular_itself(
    chain: &SerialChain<6>,
    model: UrModel,
    kind: Singularity,
    distance: f64,
    rng: &mut Stream,
) -> JointVector {
    let joint = match kind {
        Singularity::Wrist => 4,
        Singularity::Elbow => 2,
        Singularity::Shoulder => 1,
    };
    loop {
        let nominal = singular_of(model, kind, 0.0, rng);
        let with = |x: f64| JointVector::from_fn(|i, _| if i == joint { x } else { nominal[i] });
        let det = |x: f64| chain.kinematics(&with(x)).jacobian(Frame::BaseAligned).determinant();
        let (mut a, mut b) = (nominal[joint] - 1e-3, nominal[joint]);
        for _ in 0..30 {
            let (at_a, at_b) = (det(a), det(b));
            if at_a == at_b {
                break;
            }
            (a, b) = (b, b - at_b * (b - a) / (at_b - at_a));
        }
        // Next to a second singularity the root may be far away or not exist.
        let sigma_min = chain.kinematics(&with(b)).smallest_singular_value();
        if (b - nominal[joint]).abs() < 0.05 && sigma_min < 1e-13 {
            return with(if rng.random() { b + distance } else { b - distance });
        }
    }
}

/// Far seeds: goal and seed both anywhere within the limits.
pub fn random(chain: &SerialChain<6>, count: usize, rng: &mut Stream) -> Vec<Case> {
    (0..count)
        .map(|_| Case { goal: configuration(chain, rng), seed: configuration(chain, rng) })
        .collect()
}

/// Whether `q` reaches `target` within 1e-6 m and 1e-6 rad, and the limits.
pub fn reaches(chain: &SerialChain<6>, q: &JointVector, target: &Pose) -> bool {
    let limits = chain.limits();
    let (position, rotation) = apart(&chain.forward(q), target);
    position <= 1e-6
        && rotation <= 1e-6
        && (0..6).all(|i| q[i] >= limits.lower[i] && q[i] <= limits.upper[i])
}

/// Distance (m) and angle (rad) between two poses.
pub fn apart(a: &Pose, b: &Pose) -> (f64, f64) {
    let e = a.rotation.inverse() * b.rotation;
    let angle = 2.0 * e.imag().norm().atan2(e.w.abs());
    ((a.translation.vector - b.translation.vector).norm(), angle)
}

/// A straight Cartesian line at 0.1 m/s and 0.2 rad/s, sampled at 500 Hz.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    pub start: JointVector,
    base_T_start: Pose,
    velocity: Vector3,
    spin: Vector3,
}

impl Line {
    pub fn random(chain: &SerialChain<6>, rng: &mut Stream) -> Self {
        let start = configuration(chain, rng);
        let mut direction = || Vector3::from_fn(|_, _| StandardNormal.sample(rng)).normalize();
        let (velocity, spin) = (direction() * 0.1, direction() * 0.2);
        Self { start, base_T_start: chain.forward(&start), velocity, spin }
    }

    pub fn at(&self, step: u32) -> Pose {
        let t = f64::from(step) * PERIOD;
        let rotation = UnitQuaternion::from_scaled_axis(self.spin * t) * self.base_T_start.rotation;
        Pose::from_parts(
            (self.base_T_start.translation.vector + self.velocity * t).into(),
            rotation,
        )
    }
}

pub const PERIOD: f64 = 0.002;

/// The chain of a table at the usual base, with the limits of `model`.
pub fn dh_chain(model: UrModel, dh: &DhTable<6>) -> SerialChain<6> {
    SerialChain::from_dh(dh, &UrModel::base_link_T_base(), &model.limits(), UR_JOINTS).unwrap()
}
