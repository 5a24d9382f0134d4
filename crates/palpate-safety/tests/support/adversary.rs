//! Proposals that try to break the arm.

use palpate_kinematics::{Frame, SerialChain};
use palpate_safety::shield::Proposal;
use palpate_spatial::{DOF, JointVector, Pose, UnitQuaternion, Vector3, integrate};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::DT;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Random,
    BangBang,
    Nan,
    LimitHugging,
    BoxHugging,
    Resonance,
    TowardSingularity,
    TowardSelf,
    Honest,
}

pub(crate) const KINDS: [Kind; 9] = [
    Kind::Random,
    Kind::BangBang,
    Kind::Nan,
    Kind::LimitHugging,
    Kind::BoxHugging,
    Kind::Resonance,
    Kind::TowardSingularity,
    Kind::TowardSelf,
    Kind::Honest,
];

/// One attack for a while.
#[derive(Clone, Debug)]
pub(crate) struct Adversary {
    pub(crate) kind: Kind,
    direction: Vector3,
    turn: Vector3,
    joint_direction: JointVector,
    period: f64,
    tick: u32,
    q: JointVector,
}

fn unit(rng: &mut ChaCha8Rng) -> Vector3 {
    Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)).normalize()
}

impl Adversary {
    /// An attack that begins at `q`.
    pub(crate) fn new(kind: Kind, q: &JointVector, rng: &mut ChaCha8Rng) -> Self {
        Self {
            kind,
            direction: unit(rng),
            turn: unit(rng),
            joint_direction: JointVector::from_fn(|_, _| rng.random_range(-1.0..1.0)),
            period: rng.random_range(2.0..400.0),
            tick: 0,
            q: *q,
        }
    }

    /// The next proposal, given where the shield says the arm is headed.
    pub(crate) fn next(
        &mut self,
        chain: &SerialChain<DOF>,
        headed: &JointVector,
        velocity_max: &JointVector,
        rng: &mut ChaCha8Rng,
    ) -> Proposal {
        self.tick += 1;
        let time = f64::from(self.tick);
        let along = |v: Vector3, w: Vector3| {
            let twist = palpate_spatial::Twist::new(v, w);
            Proposal::Pose(integrate(&chain.forward(headed), &twist, DT))
        };
        match self.kind {
            Kind::Random => match rng.random_range(0..4) {
                0 => Proposal::Joints(
                    headed + JointVector::from_fn(|_, _| rng.random_range(-0.12..0.12)),
                ),
                1 => along(
                    unit(rng) * rng.random_range(0.0..2.0),
                    unit(rng) * rng.random_range(0.0..8.0),
                ),
                2 => {
                    let turn = UnitQuaternion::from_scaled_axis(unit(rng) * 3.0);
                    Proposal::Pose(Pose::from_parts((unit(rng) * 0.5).into(), turn))
                }
                _ => Proposal::Joints(JointVector::from_fn(|_, _| rng.random_range(-7.0..7.0))),
            },
            Kind::BangBang => {
                let sign = if ((time / self.period) as u64).is_multiple_of(2) { 1.0 } else { -1.0 };
                along(self.direction * 0.5 * sign, self.turn * 3.0 * sign)
            }
            Kind::Nan => {
                let bad =
                    [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300][rng.random_range(0..4)];
                if rng.random_bool(0.5) {
                    return along(self.direction * 0.2, Vector3::zeros());
                }
                if rng.random_bool(0.5) {
                    let mut q = *headed;
                    q[rng.random_range(0..DOF)] = bad;
                    return Proposal::Joints(q);
                }
                let mut pose = chain.forward(headed);
                match rng.random_range(0..7) {
                    lane @ 0..3 => pose.translation.vector[lane] = bad,
                    lane => {
                        let mut q = *pose.rotation.quaternion();
                        q.coords[lane - 3] = bad;
                        pose.rotation = UnitQuaternion::new_unchecked(q);
                    }
                }
                Proposal::Pose(pose)
            }
            // One joint after another at more than full speed towards an end of its range.
            Kind::LimitHugging => {
                let mut q = *headed;
                let joint = (self.period as usize) % DOF;
                q[joint] += 1.5 * velocity_max[joint] * DT * self.joint_direction[joint].signum();
                Proposal::Joints(q)
            }
            Kind::BoxHugging => along(self.direction * 0.4, Vector3::zeros()),
            Kind::Resonance => {
                let phase = (time * std::f64::consts::TAU / self.period).sin();
                let speed = velocity_max.component_mul(&self.joint_direction);
                self.q += speed * (1.2 * phase * DT);
                // Around where the arm is, so that the range of the joints is not all that is found.
                self.q += (headed - self.q) * 0.05;
                Proposal::Joints(self.q)
            }
            // Down the gradient of |det J|.
            Kind::TowardSingularity => {
                let measure = |q: &JointVector| {
                    chain.kinematics(q).jacobian(Frame::BaseAligned).determinant().abs()
                };
                let here = measure(headed);
                let slope = JointVector::from_fn(|i, _| {
                    let mut q = *headed;
                    q[i] += 1e-5;
                    measure(&q) - here
                });
                let q = headed - slope.normalize() * (2.0 * DT);
                if self.period < 200.0 {
                    Proposal::Joints(q)
                } else {
                    Proposal::Pose(chain.forward(&q))
                }
            }
            // Fold everything up.
            Kind::TowardSelf => {
                let sign = self.joint_direction[0].signum();
                let folded = JointVector::from([
                    headed[0],
                    -1.5 * sign,
                    3.0 * sign,
                    1.5 * sign,
                    3.0 * self.joint_direction[1],
                    headed[5],
                ]);
                let step = (folded - headed).map(|x| x.clamp(-0.012, 0.012));
                Proposal::Joints(
                    headed + step.component_mul(&velocity_max.map(|v| v / velocity_max.amax())),
                )
            }
            // What a learner does: a new twist now and then.
            Kind::Honest => {
                if self.tick.is_multiple_of(25) {
                    (self.direction, self.turn) = (unit(rng), unit(rng));
                }
                along(self.direction * 0.1, self.turn * 0.3)
            }
        }
    }
}
