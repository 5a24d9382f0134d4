//! Braking, force stops, and what is written down.

use palpate_kinematics::Frame;
use palpate_spatial::{JointVector, Vector3};

use super::{Shield, Stage};
use crate::ledger::{Cause, Entry};
use crate::shield::decision::{Decision, Proposal};
use crate::shield::headroom::Bounds;
use crate::shield::motion::Motion;
use crate::shield::retreat::Retreat;
use crate::{Excess, Measurement, Verdict};

/// Joint speed, rad/s, below which each joint stops by itself: its own law lands exactly.
const SLOW: f64 = 1e-3;

impl Shield {
    /// One tick of braking: all joints in step where that is legal, so that the tool does not swerve, and in any case
    /// the brake that was verified with the last accepted step.
    pub(super) fn brake(&mut self, here: &Motion) -> JointVector {
        let v = &self.verifier;
        if here.v.norm() > SLOW {
            let rest = JointVector::zeros();
            let step = here.in_step(&rest, &v.acceleration, &v.jerk, v.dt);
            if v.step_is_legal(here, &step)
                && let Ok(verified) =
                    v.brake_is_legal(&self.chain, here, &step, self.clearance(here))
            {
                self.settle(step, step.q, None, None, verified);
                return step.q;
            }
        }
        let motion = here.braked(&self.verifier.brakes, self.verifier.dt);
        (self.motion, self.clearance) = (Some(motion), None);
        self.stopping_time = (self.stopping_time - self.verifier.dt).max(0.0);
        (self.target, self.target_pose, self.manipulability) = (motion.q, None, None);
        motion.q
    }

    /// Force up to the nearer of the soft limits, N; of the raw and the filtered one the worse counts.
    pub(in crate::shield) fn force_left(&self, m: &Measurement) -> f64 {
        let soft = self.guard.soft();
        let left =
            |force: &Vector3| (soft.force - force.amax()).min(soft.force_norm - force.norm());
        left(&m.raw_wrench.force).min(left(&m.wrench.force))
    }

    /// How fast the tool may be told to move now.
    pub(in crate::shield) fn bounds(&self, m: &Measurement) -> Bounds {
        self.bounds_to(m, self.config.force.aim_ratio)
    }

    /// How fast it may move if the force is to stay within this part of its limit.
    fn bounds_to(&self, m: &Measurement, part: f64) -> Bounds {
        let limit = part * self.guard.soft().force;
        self.headroom.bounds(&m.raw_wrench, &m.wrench, limit, self.stopping_time)
    }

    /// The part of a turn (rad/s, base axes) that leaves room for force, with the tool's `velocity` (m/s).
    pub(in crate::shield) fn turned(
        &self,
        m: &Measurement,
        velocity: &Vector3,
        turn: &Vector3,
    ) -> Vector3 {
        let limits = self.guard.soft().scaled(self.config.force.aim_ratio);
        [&m.raw_wrench, &m.wrench].iter().fold(*turn, |turn, wrench| {
            self.headroom.turned(wrench, &limits, self.stopping_time, velocity, &turn)
        })
    }

    /// Joint speeds that take from the tool's approach what would exceed the force limit, and as little else as
    /// possible: that comes before everything else, the tool's direction included. None if nothing is too fast: half of
    /// what is kept back for the unforeseen may be used first.
    pub(super) fn limit_approach(&self, m: &Measurement, here: &Motion) -> Option<JointVector> {
        let J = self.chain.kinematics(&here.q).jacobian(Frame::BaseAligned);
        let bounds = self.bounds_to(m, 0.5 * (1.0 + self.config.force.aim_ratio));
        let mut speed = here.v;
        for axis in 0..3 {
            let row: JointVector = J.row(axis).transpose();
            let now = row.dot(&speed);
            let within = now.max(bounds.lower[axis]).min(bounds.upper[axis]);
            if within != now {
                let strong = row.component_mul(&self.verifier.acceleration);
                speed += strong * ((within - now) / row.dot(&strong));
            }
        }
        (speed != here.v).then_some(speed)
    }

    /// Velocity of the tool centre point at the target for joint speeds, m/s, base axes.
    pub(in crate::shield) fn tool_velocity(&self, speed: &JointVector) -> Vector3 {
        let J = self.chain.kinematics(&self.target).jacobian(Frame::BaseAligned);
        (J * speed).fixed_rows::<3>(0).into()
    }

    pub(super) fn executed(&self, here: &Motion) -> JointVector {
        self.motion.map_or(here.q, |m| m.q)
    }

    /// Latches a force stop; its brake begins in this very tick.
    pub(super) fn trip(
        &mut self,
        m: &Measurement,
        here: &Motion,
        excess: Excess,
        cause: Cause,
    ) -> Decision {
        self.stop = Some((excess, Stage::Braking));
        let executed = self.brake(here);
        self.record(m, cause, None, &executed, excess.limit - excess.value.abs());
        self.halted(excess, cause, executed)
    }

    /// Brake to rest, then retreat, then stand.
    pub(super) fn stopped(
        &mut self,
        m: &Measurement,
        here: &Motion,
        excess: Excess,
        stage: Stage,
    ) -> Decision {
        let dt = self.verifier.dt;
        let mut stage = match stage {
            Stage::Braking if here.is_at_rest() => {
                Stage::Retreating(Retreat::new(self.config.retreat))
            }
            other => other,
        };
        let mut moved = false;
        if let Stage::Retreating(retreat) = &mut stage {
            let trusted = self.bad.is_none();
            let away = retreat.step(&m.wrench.force, dt).filter(|_| trusted);
            moved = away.is_some_and(|v| self.give_way(m, here, &v));
            if !moved {
                stage = Stage::Standing;
            }
        }
        self.stop = Some((excess, stage));
        let executed = if moved { self.executed(here) } else { self.brake(here) };
        self.record(m, Cause::Stopped, None, &executed, excess.limit - excess.value.abs());
        self.halted(excess, Cause::Stopped, executed)
    }

    /// One tick of a retreat at `velocity`, through the same verification as any command.
    pub(super) fn give_way(&mut self, m: &Measurement, here: &Motion, velocity: &Vector3) -> bool {
        let mut pose = self.target_pose();
        pose.translation.vector += velocity * self.verifier.dt;
        let wish = self.wish(m, &Proposal::Pose(pose));
        wish.and_then(|wish| self.advance(m, here, &wish)).is_ok()
    }

    pub(super) fn halted(&self, excess: Excess, cause: Cause, executed: JointVector) -> Decision {
        Decision {
            verdict: Verdict::ForceExceeded(excess),
            executed,
            proposed: None,
            cause: Some(cause),
            governed: Some(self.target_pose()),
        }
    }

    pub(super) fn record(
        &mut self,
        m: &Measurement,
        cause: Cause,
        proposed: Option<JointVector>,
        executed: &JointVector,
        distance: f64,
    ) {
        let (time, executed, wrench) = (m.state.time, *executed, m.wrench);
        self.ledger.add(Entry { time, ticks: 1, cause, proposed, executed, wrench, distance });
    }
}
