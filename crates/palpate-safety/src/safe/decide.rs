//! The checks of one command, in their order, and what follows from them.

use palpate_robot_io::{JointCommand, RobotBackend};
use palpate_spatial::JointVector;

use super::{Measurement, Phase, Safe, SafeError};
use crate::limits::{Mode, SpeedReference, check_speed, check_wrench};
use crate::shield::Proposal;
use crate::{Cause, Entry, Excess, Refusal, Verdict};

impl<B: RobotBackend> Safe<B> {
    /// The shield's verdict, then the actuation.
    pub(super) fn shielded(
        &mut self,
        last: &Measurement,
        proposal: &Proposal,
    ) -> Result<Verdict, SafeError<B::Error>> {
        let Some(shield) = &mut self.shield else { return Err(SafeError::NotSensed) };
        let latched = shield.is_stopped();
        let decision = shield.tick(last, proposal);
        match &decision.verdict {
            Verdict::Accepted => {}
            Verdict::Refused(refusal) => self.tally.add(refusal),
            Verdict::ForceExceeded(_) => self.tally.force += u64::from(!latched),
        }
        let (q, verdict) = (decision.executed, decision.verdict.clone());
        self.decision = Some(decision);
        self.write(&q)?;
        Ok(verdict)
    }

    /// The checks in the configured order, then the actuation.
    pub(super) fn decide(
        &mut self,
        last: &Measurement,
        solve: impl FnOnce(&Self) -> Result<JointVector, Refusal>,
    ) -> Result<Verdict, SafeError<B::Error>> {
        if let Phase::Latched(excess) = self.phase {
            self.record(last, Cause::Stopped, None, excess.limit - excess.value.abs());
            self.hold(last)?;
            return Ok(Verdict::ForceExceeded(excess));
        }
        if self.limits.mode == Mode::ForceFirst
            && let Err(excess) = self.force_in_range(last)
        {
            return self.latch(last, excess);
        }
        let from = match self.limits.speed_reference {
            SpeedReference::Measured => last.state.q,
            SpeedReference::Commanded => self.q_commanded.unwrap_or(last.state.q_target),
        };
        let dt = self.period().as_secs_f64();
        let solved = solve(self);
        let proposed = solved.as_ref().ok().copied();
        let accepted = solved
            .and_then(|q| check_speed(&from, &q, dt, &self.limits.joint_velocity_max).map(|()| q));
        let q = match accepted {
            Ok(q) => q,
            Err(refusal) => {
                self.tally.add(&refusal);
                let (cause, distance) = refusal.cause();
                self.record(last, cause, proposed, distance);
                self.hold(last)?;
                return Ok(Verdict::Refused(refusal));
            }
        };
        // In force-first mode this repeats a check that has passed.
        if let Err(excess) = self.force_in_range(last) {
            return self.latch(last, excess);
        }
        self.write(&q)?;
        Ok(Verdict::Accepted)
    }

    fn force_in_range(&self, last: &Measurement) -> Result<(), Excess> {
        match self.phase {
            Phase::Reset => check_wrench(
                &last.wrench,
                self.limits.reset.force_max,
                self.limits.reset.torque_max,
            ),
            _ => check_wrench(&last.wrench, self.limits.force_max, self.limits.torque_max),
        }
    }

    fn latch(
        &mut self,
        last: &Measurement,
        excess: Excess,
    ) -> Result<Verdict, SafeError<B::Error>> {
        self.tally.force += 1;
        self.phase = Phase::Latched(excess);
        self.record(last, Cause::ForceSoft, None, excess.limit - excess.value.abs());
        self.hold(last)?;
        Ok(Verdict::ForceExceeded(excess))
    }

    /// Puts a verdict after which the arm holds its set-point into the ledger.
    fn record(
        &mut self,
        last: &Measurement,
        cause: Cause,
        proposed: Option<JointVector>,
        distance: f64,
    ) {
        let (time, wrench) = (last.state.time, last.wrench);
        let executed = self.q_commanded.unwrap_or(last.state.q_target);
        self.ledger.add(Entry { time, ticks: 1, cause, proposed, executed, wrench, distance });
    }

    pub(super) fn hold(&mut self, last: &Measurement) -> Result<(), SafeError<B::Error>> {
        let q = self.q_commanded.unwrap_or(last.state.q_target);
        self.write(&q)
    }

    fn write(&mut self, q: &JointVector) -> Result<(), SafeError<B::Error>> {
        match self.backend.write(&JointCommand { q: *q }) {
            Ok(()) => {
                self.q_commanded = Some(*q);
                Ok(())
            }
            Err(e) => Err(self.stopped_by(e)),
        }
    }

    /// Any backend error stops the arm; the first error is the one to report.
    pub(super) fn stopped_by(&mut self, error: B::Error) -> SafeError<B::Error> {
        let _ = self.backend.stop();
        SafeError::Backend(error)
    }
}
