//! Whether a stream of set-points was legal, by other means than the shield's.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use palpate_kinematics::SerialChain;
use palpate_safety::SafetyConfig;
use palpate_safety::shield::{ArmShape, ShieldConfig};
use palpate_spatial::{DOF, JointVector};

use super::{DT, TCP, urdf};

pub(crate) const TOLERANCE: f64 = 1e-9;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Violation {
    NonFinite,
    Position,
    Velocity,
    Acceleration,
    Jerk,
    Workspace,
    Plane,
    SelfCollision,
}

pub(crate) const KINDS: [Violation; 8] = [
    Violation::NonFinite,
    Violation::Position,
    Violation::Velocity,
    Violation::Acceleration,
    Violation::Jerk,
    Violation::Workspace,
    Violation::Plane,
    Violation::SelfCollision,
];

struct Body {
    name: String,
    joint: usize,
    ends: [Point3<f64>; 2],
    radius: f64,
}

pub(crate) struct Judge {
    origins: Vec<Isometry3<f64>>,
    flange: Isometry3<f64>,
    bodies: Vec<Body>,
    pairs: Vec<(usize, usize)>,
    planes: Vec<(Vector3<f64>, f64, Vec<usize>)>,
    shield: ShieldConfig,
    velocity: JointVector,
    lower: JointVector,
    upper: JointVector,
    history: Vec<JointVector>,
    pub(crate) counts: [u64; KINDS.len()],
    /// Largest part of the limits of speed, acceleration and jerk that was seen.
    pub(crate) peaks: [f64; 3],
    /// Least clearance of the box, the planes and the arm from itself that was seen, m.
    pub(crate) least: [f64; 3],
}

impl Judge {
    pub(crate) fn new(safety: &SafetyConfig, chain: &SerialChain<DOF>) -> Self {
        let shield = safety.shield.clone().unwrap();
        let robot = urdf_rs::read_from_string(&urdf()).unwrap();
        let pose = |origin: &urdf_rs::Pose| {
            let (r, p, y) = (origin.rpy[0], origin.rpy[1], origin.rpy[2]);
            let t = Translation3::new(origin.xyz[0], origin.xyz[1], origin.xyz[2]);
            Isometry3::from_parts(t, UnitQuaternion::from_euler_angles(r, p, y))
        };
        let joints: Vec<_> =
            robot.joints.iter().filter(|j| j.joint_type != urdf_rs::JointType::Fixed).collect();
        let flange = pose(&robot.joints.iter().find(|j| j.child.link == "tool0").unwrap().origin);
        let shape = ArmShape::named(&shield.shape).unwrap();
        let mut bodies: Vec<Body> = shape
            .capsules
            .iter()
            .map(|c| Body {
                name: c.name.clone(),
                joint: c.joint,
                ends: [c.from.into(), c.to.into()],
                radius: c.radius,
            })
            .collect();
        let tool = shield.tool;
        let ends = [flange * Point3::from(tool.from), flange * Point3::from(tool.to)];
        bodies.push(Body { name: "tool".into(), joint: 6, ends, radius: tool.radius });
        let find = |name: &String| bodies.iter().position(|b| b.name == *name).unwrap();
        let pairs = shape.pairs.iter().map(|[a, b]| (find(a), find(b))).collect();
        let planes = shield
            .planes
            .iter()
            .map(|p| (p.normal, p.offset, p.capsules.iter().map(find).collect()))
            .collect();
        let margin = JointVector::from_element(shield.joint_margin);
        Self {
            origins: joints.iter().map(|j| pose(&j.origin)).collect(),
            flange,
            pairs,
            planes,
            bodies,
            velocity: safety.joint_velocity_max,
            lower: chain.limits().lower + margin,
            upper: chain.limits().upper - margin,
            shield,
            history: Vec::new(),
            counts: [0; KINDS.len()],
            peaks: [0.0; 3],
            least: [f64::INFINITY; 3],
        }
    }

    /// Forgets the motion so far: the arm stands at `q`.
    pub(crate) fn place(&mut self, q: &JointVector) {
        self.history = vec![*q; 3];
    }

    /// Clearance of a configuration: box, planes, itself; m.
    pub(crate) fn clearances(&self, q: &JointVector) -> [f64; 3] {
        let mut links = vec![Isometry3::identity()];
        for (i, origin) in self.origins.iter().enumerate() {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), q[i]);
            links.push(links[i] * origin * turn);
        }
        let tip = (links[DOF] * self.flange * Point3::new(0.0, 0.0, TCP)).coords;
        let (min, max) = (self.shield.workspace.min, self.shield.workspace.max);
        let inside = (tip - min).inf(&(max - tip)).min();
        let ends: Vec<_> =
            self.bodies.iter().map(|b| b.ends.map(|e| (links[b.joint] * e).coords)).collect();
        let mut plane = f64::INFINITY;
        for (normal, offset, members) in &self.planes {
            for &b in members {
                for end in &ends[b] {
                    plane = plane.min(
                        normal.dot(end) - offset - self.bodies[b].radius - self.shield.clearance,
                    );
                }
            }
        }
        let mut own = f64::INFINITY;
        for &(a, b) in &self.pairs {
            let radii = self.bodies[a].radius + self.bodies[b].radius;
            own = own.min(distance(&ends[a], &ends[b]) - radii - self.shield.clearance);
        }
        [inside, plane, own]
    }

    /// Takes in the next set-point; counts what it violates.
    pub(crate) fn see(&mut self, q: &JointVector) {
        let mut found = |kind: Violation, yes: bool| self.counts[kind as usize] += u64::from(yes);
        if !q.iter().all(|x| x.is_finite()) {
            found(Violation::NonFinite, true);
            return;
        }
        let [a, b, c] = [self.history[0], self.history[1], self.history[2]];
        for i in 0..DOF {
            // Rounding of the positions, as it shows in the differences.
            let ulp = q[i].abs().max(c[i].abs()) * f64::EPSILON;
            let v = (q[i] - c[i]) / DT;
            let acc = (q[i] - 2.0 * c[i] + b[i]) / (DT * DT);
            let jerk = (q[i] - 3.0 * c[i] + 3.0 * b[i] - a[i]) / (DT * DT * DT);
            let over = |value: f64, limit: f64, rounding: f64| {
                value.abs() > limit * (1.0 + TOLERANCE) + rounding
            };
            found(
                Violation::Position,
                q[i] > self.upper[i] + TOLERANCE || q[i] < self.lower[i] - TOLERANCE,
            );
            found(Violation::Velocity, over(v, self.velocity[i], 2.0 * ulp / DT));
            let limit = self.shield.joint_acceleration_max[i];
            found(Violation::Acceleration, over(acc, limit, 4.0 * ulp / DT.powi(2)));
            let limit = self.shield.joint_jerk_max[i];
            found(Violation::Jerk, over(jerk, limit, 8.0 * ulp / DT.powi(3)));
            let parts =
                [v / self.velocity[i], acc / self.shield.joint_acceleration_max[i], jerk / limit];
            for (peak, part) in self.peaks.iter_mut().zip(parts) {
                *peak = peak.max(part.abs());
            }
        }
        self.history = vec![b, c, *q];
        let [inside, plane, own] = self.clearances(q);
        for (least, now) in self.least.iter_mut().zip([inside, plane, own]) {
            *least = least.min(now);
        }
        let mut found = |kind: Violation, yes: bool| self.counts[kind as usize] += u64::from(yes);
        found(Violation::Workspace, inside < -TOLERANCE);
        found(Violation::Plane, plane < -TOLERANCE);
        found(Violation::SelfCollision, own < -TOLERANCE);
    }

    pub(crate) fn total(&self) -> u64 {
        self.counts.iter().sum()
    }
}

/// Of two segments: the least of the four distances of an end to the other segment, and of the common
/// perpendicular where it meets both.
fn distance(a: &[Vector3<f64>; 2], b: &[Vector3<f64>; 2]) -> f64 {
    let to_segment = |p: &Vector3<f64>, s: &[Vector3<f64>; 2]| {
        let u = s[1] - s[0];
        let t = ((p - s[0]).dot(&u) / u.norm_squared()).clamp(0.0, 1.0);
        (p - s[0] - u * t).norm()
    };
    let ends = to_segment(&a[0], b)
        .min(to_segment(&a[1], b))
        .min(to_segment(&b[0], a))
        .min(to_segment(&b[1], a));
    let (u, w, r) = (a[1] - a[0], b[1] - b[0], b[0] - a[0]);
    let n = u.cross(&w);
    if n.norm_squared() < 1e-16 {
        return ends;
    }
    let s = r.cross(&w).dot(&n) / n.norm_squared();
    let t = r.cross(&u).dot(&n) / n.norm_squared();
    let both = (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t);
    if both { ends.min(r.dot(&n).abs() / n.norm()) } else { ends }
}
