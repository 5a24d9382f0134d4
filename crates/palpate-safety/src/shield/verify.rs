//! The question behind every accepted step: can the arm still brake legally after it?
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must fail")]

use palpate_kinematics::SerialChain;
use palpate_spatial::{DOF, JointVector};

use super::brake::Brake;
use super::geometry::{Clearance, Geometry};
use super::motion::Motion;
use crate::Refusal;

/// The arm settles this far inside its walls, m. The joints do not brake in step, so a brake swerves a little;
/// without room for that an arm at a wall could not even leave it.
pub(crate) const GUARD: f64 = 5e-5;

/// Rounding of speeds that are at their limit by construction.
const ROUNDING: f64 = 1.0 + 1e-12;

/// Limits on motion and place.
#[derive(Clone, Debug)]
pub(crate) struct Verifier {
    pub(crate) dt: f64,
    pub(crate) brakes: [Brake; DOF],
    /// Weak brakes for what is across the way, see [`Motion::together`].
    pub(crate) side: [Brake; DOF],
    pub(crate) lower: JointVector,
    pub(crate) upper: JointVector,
    pub(crate) velocity: JointVector,
    pub(crate) acceleration: JointVector,
    pub(crate) jerk: JointVector,
    pub(crate) geometry: Geometry,
}

/// What a legal step leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Verified {
    /// Clearance at its end, m.
    pub(crate) clearance: f64,
    /// Time until the brake has stopped every joint, s.
    pub(crate) stopping_time: f64,
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
    /// `clearance` is what the arm has now. One that is outside already (a start outside the box) may move as
    /// long as it comes no nearer.
    pub(crate) fn brake_is_legal(
        &self,
        chain: &SerialChain<DOF>,
        from: &Motion,
        to: &Motion,
        clearance: f64,
    ) -> Result<Verified, Refusal> {
        let mut sweep = JointVector::zeros();
        let mut ticks: f64 = 0.0;
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
            ticks = ticks.max(stop.ticks);
        }
        let clearance = self.way_is_clear(chain, to, &sweep, clearance)?.distance;
        Ok(Verified { clearance, stopping_time: ticks * self.dt })
    }

    /// Conservative advancement along the brake: as long as no point can have moved farther than the last
    /// measured clearance, nothing needs to be measured.
    fn way_is_clear(
        &self,
        chain: &SerialChain<DOF>,
        to: &Motion,
        sweep: &JointVector,
        clearance: f64,
    ) -> Result<Clearance, Refusal> {
        let at = |q: &JointVector, floor: f64| {
            let clearance = self.geometry.clearance(chain, q);
            let Clearance { distance, obstacle } = clearance;
            if distance >= floor {
                Ok(clearance)
            } else {
                Err(Refusal::Obstacle { obstacle, distance })
            }
        };
        // The step ends a guard's width inside, or no farther outside than it began; the brake may use the guard.
        let here = at(&to.q, clearance.clamp(0.0, GUARD).min(clearance))?;
        let floor = clearance.min(0.0);
        let mut left = here.distance - floor;
        if self.geometry.travel(sweep) <= left {
            return Ok(here);
        }
        let mut motion = *to;
        while !motion.is_at_rest() {
            motion = motion.braked(&self.brakes, self.dt);
            left -= self.geometry.travel(&(motion.v.abs() * self.dt));
            if !(left >= 0.0) {
                let clearance = at(&motion.q, floor)?;
                left = clearance.distance - floor;
                if self.geometry.travel(&self.sweep(&motion)) <= left {
                    break;
                }
            }
        }
        Ok(here)
    }

    fn sweep(&self, motion: &Motion) -> JointVector {
        JointVector::from_fn(|i, _| self.brakes[i].stop(motion.v[i], motion.a[i]).sweep)
    }
}
