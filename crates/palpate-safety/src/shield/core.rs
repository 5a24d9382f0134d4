//! The shield itself: sample and proposal in, verdict and set-point out.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must fail")]

mod stop;
#[cfg(test)]
mod tests;

use palpate_kinematics::SerialChain;
use palpate_robot_io::RobotState;
use palpate_spatial::{DOF, JointVector, Pose, UnitQuaternion, Wrench};

use super::brake::Brake;
use super::config::ShieldConfig;
use super::decision::{Decision, Proposal};
use super::force::{Contact, ForceGuard, WrenchLimits};
use super::geometry::Geometry;
use super::headroom::Headroom;
use super::motion::Motion;
use super::plausible::{Implausible, Watch};
use super::prove;
use super::recovery::Standing;
use super::retreat::Retreat;
use super::shape::ArmShape;
use super::verify::{Verified, Verifier};
use super::wish::Wish;
use crate::limits::{LimitsError, SafetyConfig};
use crate::{Cause, Excess, Ledger, Measurement, Refusal, Verdict};

/// Part of the catch-up speed per distance: what lags behind is made up for with a time constant of 25 ms.
const CATCH_UP: f64 = 40.0;
/// A lag of this part of jerk·dt³ is made up for at once.
const SNUG: f64 = 0.1;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Braking,
    Retreating(Retreat),
    Standing,
}

/// The pure shield. It reads no clock and does no input or output: see [`Safe`](crate::Safe) for that.
#[derive(Clone, Debug)]
pub struct Shield {
    pub(super) config: ShieldConfig,
    pub(super) chain: SerialChain<DOF>,
    pub(super) verifier: Verifier,
    headroom: Headroom,
    guard: ForceGuard,
    episode: WrenchLimits,
    reset: WrenchLimits,
    watch: Watch,
    bad: Option<Implausible>,
    bad_samples: u32,
    /// Set-points sent so far; none before the first tick.
    motion: Option<Motion>,
    /// Where the accepted proposals have led; the motion follows it.
    pub(super) target: JointVector,
    pub(super) target_pose: Option<Pose>,
    pub(super) manipulability: Option<f64>,
    /// Clearance of the set-point, where it is known.
    clearance: Option<f64>,
    /// How long the brake from here takes, s.
    pub(super) stopping_time: f64,
    stop: Option<(Excess, Stage)>,
    ledger: Ledger,
}

impl Shield {
    /// A shield for an arm with tool (`chain`: base to tool centre point) whose flange frame carries the tool
    /// centre point at `tool0_T_tool`, for set-points every `dt` (s).
    ///
    /// # Errors
    /// The first limit that makes no sense, by its key.
    pub fn new(
        safety: &SafetyConfig,
        chain: SerialChain<DOF>,
        tool0_T_tool: &Pose,
        dt: f64,
    ) -> Result<Self, LimitsError> {
        let config = safety.shield.clone().ok_or_else(LimitsError::no_shield)?;
        prove::consistent(safety, &config, &chain, dt)?;
        let shaped =
            |e: super::ShapeError| LimitsError::new("shield.shape", &config.shape, e.to_string());
        let shape = ArmShape::named(&config.shape).map_err(shaped)?;
        let shape = shape.with_tool(&config.tool, &last_T_tool0(&chain, tool0_T_tool));
        let geometry =
            Geometry::new(&chain, &shape, config.workspace, &config.planes, config.clearance)
                .map_err(shaped)?;
        let margin = JointVector::from_element(config.joint_margin);
        let (acceleration, jerk) = (config.joint_acceleration_max, config.joint_jerk_max);
        let verifier = Verifier {
            dt,
            brakes: std::array::from_fn(|i| Brake::new(acceleration[i], jerk[i], dt)),
            lower: chain.limits().lower + margin,
            upper: chain.limits().upper - margin,
            velocity: safety.joint_velocity_max,
            acceleration,
            jerk,
            geometry,
        };
        let f = config.force;
        let soft = |force: f64, torque: f64| WrenchLimits {
            force,
            torque,
            force_norm: force * f.force_norm_max / safety.force_max,
            torque_norm: torque * f.torque_norm_max / safety.torque_max,
        };
        let reset = soft(safety.reset.force_max, safety.reset.torque_max);
        let hard = WrenchLimits {
            force: f.force_hard_max,
            torque: f.torque_hard_max,
            force_norm: f.force_hard_max,
            torque_norm: f.torque_hard_max,
        };
        let rearm_samples = (f.rearm_time / dt).ceil() as u32;
        Ok(Self {
            guard: ForceGuard::new(reset, hard, f.reaction_time / dt, f.rearm_ratio, rearm_samples),
            episode: soft(safety.force_max, safety.torque_max),
            reset,
            headroom: Headroom::new(f.stiffness, f.reaction_time),
            watch: Watch::new(config.sensor, &chain.limits().velocity),
            ledger: Ledger::new(safety.ledger_entries, dt),
            config,
            chain,
            verifier,
            bad: None,
            bad_samples: 0,
            motion: None,
            target: JointVector::zeros(),
            target_pose: None,
            manipulability: None,
            clearance: None,
            stopping_time: 0.0,
            stop: None,
        })
    }

    /// Takes in a raw sample, before anything is computed from it. The arm brakes while samples are bad.
    ///
    /// # Errors
    /// Why the sample is not to be believed.
    pub fn watch(&mut self, state: &RobotState) -> Result<(), Implausible> {
        let said = self.watch.check(state);
        self.bad = said.err();
        self.bad_samples = if said.is_err() { self.bad_samples.saturating_add(1) } else { 0 };
        said
    }

    /// Whether there were too many bad samples in a row to go on without a person.
    pub fn is_blind(&self) -> bool {
        self.bad_samples >= self.config.sensor.bad_samples_max
    }

    /// Decides about one period. Call it once per period, whatever happens.
    pub fn tick(&mut self, m: &Measurement, proposal: &Proposal) -> Decision {
        let contact = self.guard.update(&m.raw_wrench, &m.wrench);
        let here = self.here(m);
        if self.stop.is_none() {
            match contact {
                Contact::Hard(excess) => return self.trip(m, &here, excess, Cause::ForceHard),
                Contact::Soft(excess) => return self.trip(m, &here, excess, Cause::ForceSoft),
                Contact::Fine | Contact::Rising(_) => {}
            }
        }
        if let Some((excess, stage)) = self.stop {
            return self.stopped(m, &here, excess, stage);
        }
        if *proposal == Proposal::Rest {
            let executed = self.brake(&here);
            return Decision {
                verdict: Verdict::Accepted,
                executed,
                proposed: None,
                cause: None,
                governed: None,
            };
        }
        let mut proposed = None;
        let step = self.believe(m, &here, contact).and_then(|()| self.wish(m, proposal)).and_then(
            |wish| {
                proposed = Some(wish.proposed);
                self.advance(m, &here, &wish)
            },
        );
        match step {
            Ok(cause) => {
                let executed = self.executed(&here);
                if let Some(cause) = cause {
                    let distance = match cause {
                        Cause::SlowedByForce => self.force_left(m),
                        Cause::SlowedByObstacle => self.clearance.unwrap_or(f64::NAN),
                        _ => f64::NAN,
                    };
                    self.record(m, cause, proposed, &executed, distance);
                }
                let governed = cause.map(|_| self.target_pose());
                Decision { verdict: Verdict::Accepted, executed, proposed, cause, governed }
            }
            Err(refusal) => {
                let executed = self.brake(&here);
                let (cause, distance) = refusal.cause();
                self.record(m, cause, proposed, &executed, distance);
                let governed = Some(self.target_pose());
                Decision {
                    verdict: Verdict::Refused(refusal),
                    executed,
                    proposed,
                    cause: Some(cause),
                    governed,
                }
            }
        }
    }

    /// What the arm's set-point is doing.
    pub fn standing(&self) -> Standing {
        match (&self.stop, &self.motion) {
            (Some((_, Stage::Retreating(_))), _) => Standing::Retreating,
            (Some((_, Stage::Braking)), _) => Standing::Moving,
            (_, Some(motion)) if !motion.is_at_rest() => Standing::Moving,
            _ => Standing::AtRest,
        }
    }

    /// Whether a force stop is latched.
    pub fn is_stopped(&self) -> bool {
        self.stop.is_some()
    }

    /// The reset's force limits from now on; clears a force stop.
    pub fn begin_reset(&mut self) {
        self.stop = None;
        self.guard.set_soft(self.reset);
    }

    /// The episode's force limits from now on.
    pub fn begin_episode(&mut self) {
        self.stop = None;
        self.guard.set_soft(self.episode);
    }

    /// Whether the sensor may be zeroed: at rest, armed and in free air by the last sample.
    pub fn may_tare(&self, wrench: &Wrench) -> bool {
        let air = &self.config.recovery;
        let free = wrench.force.norm() <= air.free_air_force
            && wrench.torque.norm() <= air.free_air_torque;
        self.standing() == Standing::AtRest && self.guard.is_armed() && free
    }

    /// Whether the contact force has been below its re-arm level for long enough.
    pub fn is_armed(&self) -> bool {
        self.guard.is_armed()
    }

    /// The sensor was zeroed: what was known about its readings no longer holds.
    pub fn tared(&mut self) {
        self.watch.restart();
        self.guard.restart();
    }

    /// The arm was stopped and recovered: the next tick starts at rest from its set-point then.
    pub fn restart(&mut self) {
        self.tared();
        (self.bad, self.bad_samples) = (None, 0);
        (self.motion, self.stop, self.clearance, self.stopping_time) = (None, None, None, 0.0);
    }

    /// The verdicts so far.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// The verdicts, to empty the ring once they are written.
    pub fn ledger_mut(&mut self) -> &mut Ledger {
        &mut self.ledger
    }

    /// The commanded motion; none before the first tick.
    pub fn motion(&self) -> Option<&Motion> {
        self.motion.as_ref()
    }

    /// Box, planes and capsules.
    pub fn geometry(&self) -> &Geometry {
        &self.verifier.geometry
    }

    /// base_T_tool at the target.
    pub(super) fn target_pose(&self) -> Pose {
        self.target_pose.unwrap_or_else(|| self.chain.forward(&self.target))
    }

    fn here(&mut self, m: &Measurement) -> Motion {
        if let Some(motion) = self.motion {
            return motion;
        }
        let motion = Motion::at_rest(m.state.q_target);
        self.motion = Some(motion);
        (self.target, self.target_pose, self.manipulability) = (motion.q, None, None);
        motion
    }

    /// Everything that must be true before a proposal is even looked at.
    fn believe(&self, m: &Measurement, here: &Motion, contact: Contact) -> Result<(), Refusal> {
        if let Some(implausible) = self.bad {
            return Err(Refusal::Implausible(implausible));
        }
        if let Contact::Rising(excess) = contact {
            return Err(Refusal::ForceRising(excess));
        }
        let limit = self.config.tracking_error_max;
        for joint in 0..DOF {
            let error = (here.q[joint] - m.state.q[joint]).abs();
            if !(error <= limit) {
                return Err(Refusal::Tracking { joint, error, limit });
            }
        }
        Ok(())
    }

    /// Follows the wish: exactly if that is legal, else as fast as the limits allow, with all joints in step if
    /// possible.
    fn advance(
        &mut self,
        m: &Measurement,
        here: &Motion,
        wish: &Wish,
    ) -> Result<Option<Cause>, Refusal> {
        let clearance = self.clearance(here);
        let v = &self.verifier;
        let lag = self.target - here.q;
        let snug = (0..DOF).all(|i| lag[i].abs() <= SNUG * v.jerk[i] * v.dt.powi(3));
        if snug {
            let exact = here.reaching(&wish.target, v.dt);
            if v.step_is_legal(here, &exact)
                && let Ok(verified) = v.brake_is_legal(&self.chain, here, &exact, clearance)
            {
                self.settle(exact, wish.target, wish.pose, wish.manipulability, verified);
                return Ok(wish.slowed);
            }
        }
        let mut speed = wish.velocity + lag * CATCH_UP;
        if !snug {
            // What is made up for counts as approach, too.
            speed *= self.bounds(m).scale(&self.tool_velocity(&speed));
        }
        speed = self.limit_approach(m, here).unwrap_or(speed);
        let excess = speed.component_div(&v.velocity).amax();
        if excess > 1.0 {
            speed /= excess;
        }
        let in_step = here.in_step(&speed, &v.acceleration, &v.jerk, v.dt);
        let verified = v
            .step_is_legal(here, &in_step)
            .then(|| v.brake_is_legal(&self.chain, here, &in_step, clearance));
        let (step, verified) = if let Some(Ok(verified)) = verified {
            (in_step, verified)
        } else {
            // At a wall the joints may still get along it one by one; the tool may swerve.
            let step = here.approaching(&speed, &v.brakes, v.dt);
            (step, v.brake_is_legal(&self.chain, here, &step, clearance)?)
        };
        // A path of joints is caught up with; a tool command is answered by where the arm got to.
        let target = if wish.absolute { wish.target } else { step.q };
        self.settle(step, target, None, None, verified);
        Ok(wish.slowed.or(Some(Cause::Shaped)))
    }

    /// Clearance of the set-point.
    pub(super) fn clearance(&self, here: &Motion) -> f64 {
        self.clearance
            .unwrap_or_else(|| self.verifier.geometry.clearance(&self.chain, &here.q).distance)
    }

    fn settle(
        &mut self,
        motion: Motion,
        target: JointVector,
        pose: Option<Pose>,
        manipulability: Option<f64>,
        verified: Verified,
    ) {
        self.motion = Some(motion);
        self.clearance = Some(verified.clearance);
        self.stopping_time = verified.stopping_time;
        (self.target, self.target_pose, self.manipulability) = (target, pose, manipulability);
    }
}

/// tool0 axes in the last link's, which turns with the last joint.
fn last_T_tool0(chain: &SerialChain<DOF>, tool0_T_tool: &Pose) -> Pose {
    let (links, _) = chain.frames(&JointVector::zeros());
    let last = &links[DOF - 1];
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(last.rotation);
    let base_T_last =
        Pose::from_parts(last.origin.into(), UnitQuaternion::from_rotation_matrix(&rotation));
    base_T_last.inverse() * chain.forward(&JointVector::zeros()) * tool0_T_tool.inverse()
}
