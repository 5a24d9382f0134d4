//! The question behind every accepted step: can the arm still brake legally after it?
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must fail")]

use palpate_kinematics::SerialChain;
use palpate_spatial::{DOF, JointVector};

use super::brake::Brake;
use super::geometry::{Clearance, Geometry};
use super::motion::Motion;
use crate::Refusal;

/// Rounding of speeds that are at their limit by construction.
const ROUNDING: f64 = 1.0 + 1e-12;

/// Limits on motion and place.
#[derive(Clone, Debug)]
pub(crate) struct Verifier {
    pub(crate) dt: f64,
    pub(crate) brakes: [Brake; DOF],
    pub(crate) lower: JointVector,
    pub(crate) upper: JointVector,
    pub(crate) velocity: JointVector,
    pub(crate) acceleration: JointVector,
    pub(crate) jerk: JointVector,
    pub(crate) geometry: Geometry,
}

impl Verifier {
    /// Whether the step itself is within the limits of speed, acceleration and jerk.
    pub(crate) fn step_is_legal(&self, from: &Motion, to: &Motion) -> bool {
        (0..DOF).all(|i| {
            to.v[i].abs() <= self.velocity[i]
                && to.a[i].abs() <= self.acceleration[i]
                && (to.a[i] - from.a[i]).abs() <= self.jerk[i] * self.dt
        })
    }

    /// Whether `to` and the whole brake from there keep to joint ranges and speeds and out of every
    /// obstacle.
    ///
    /// An arm that is outside already (a start outside the box) may move as long as it comes no nearer:
    /// `floor` is the clearance it has, at most 0.
    pub(crate) fn brake_is_legal(
        &self,
        chain: &SerialChain<DOF>,
        from: &Motion,
        to: &Motion,
        floor: f64,
    ) -> Result<Clearance, Refusal> {
        let mut sweep = JointVector::zeros();
        for joint in 0..DOF {
            let (v, q) = (to.v[joint], to.q[joint]);
            let stop = self.brakes[joint].stop(v, to.a[joint]);
            let (speed, limit) = (v.abs().max(stop.run_out.abs()), self.velocity[joint]);
            if !(speed <= limit * ROUNDING && stop.run_out.is_finite()) {
                return Err(Refusal::JointSpeed { joint, speed, limit });
            }
            let lower = self.lower[joint].min(from.q[joint]);
            let upper = self.upper[joint].max(from.q[joint]);
            for value in [q + stop.lowest, q + stop.highest] {
                if !(value >= lower && value <= upper) {
                    return Err(Refusal::JointRange { joint, value, lower, upper });
                }
            }
            sweep[joint] = stop.sweep;
        }
        self.way_is_clear(chain, to, &sweep, floor)
    }

    /// Conservative advancement along the brake: as long as no point can have moved farther than the last
    /// measured clearance, nothing needs to be measured.
    fn way_is_clear(
        &self,
        chain: &SerialChain<DOF>,
        to: &Motion,
        sweep: &JointVector,
        floor: f64,
    ) -> Result<Clearance, Refusal> {
        let at = |q: &JointVector| {
            let clearance = self.geometry.clearance(chain, q);
            let Clearance { distance, obstacle } = clearance;
            if distance >= floor {
                Ok(clearance)
            } else {
                Err(Refusal::Obstacle { obstacle, distance })
            }
        };
        let here = at(&to.q)?;
        let mut left = here.distance - floor;
        if self.geometry.travel(sweep) <= left {
            return Ok(here);
        }
        let (mut nearest, mut motion) = (here, *to);
        while !motion.is_at_rest() {
            motion = motion.braked(&self.brakes, self.dt);
            left -= self.geometry.travel(&(motion.v.abs() * self.dt));
            if !(left >= 0.0) {
                let clearance = at(&motion.q)?;
                if clearance.distance < nearest.distance {
                    nearest = clearance;
                }
                left = clearance.distance - floor;
                if self.geometry.travel(&self.sweep(&motion)) <= left {
                    break;
                }
            }
        }
        Ok(nearest)
    }

    fn sweep(&self, motion: &Motion) -> JointVector {
        JointVector::from_fn(|i, _| self.brakes[i].stop(motion.v[i], motion.a[i]).sweep)
    }
}
