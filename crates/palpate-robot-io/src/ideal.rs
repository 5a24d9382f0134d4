//! The smallest backend: an arm that goes where it is told, behind a first-order lag.

use std::time::Duration;

use palpate_spatial::{JointVector, Wrench};

use crate::{BackendError, FaultKind, JointCommand, RobotBackend, RobotState};

/// An arm without dynamics or surroundings, whose sensor reads what you put there.
///
/// For tests, tutorials and dry runs. Each [`read`](RobotBackend::read) advances its clock by 2 ms.
#[derive(Clone, Debug)]
pub struct IdealArm {
    /// What the sensor will read, before taring; tool0 axes.
    pub load: Wrench,
    tare: Wrench,
    ticks: u64,
    q: JointVector,
    dq: JointVector,
    q_target: JointVector,
    stopped: bool,
}

/// Why an [`IdealArm`] refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IdealArmError {
    /// A command that is not finite.
    #[error("joint command is not finite: {0:?}")]
    NotFinite(JointVector),
    /// A command after `stop`.
    #[error("the arm is stopped: call recover first")]
    Stopped,
}

impl BackendError for IdealArmError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::NotFinite(_) => FaultKind::InvalidCommand,
            Self::Stopped => FaultKind::Stopped,
        }
    }
}

impl IdealArm {
    const PERIOD: Duration = Duration::from_millis(2);
    /// Part of the remaining distance covered each period: a lag of about 4 ms.
    const FOLLOW: f64 = 0.4;
    /// Remaining distance that counts as none, rad.
    const AT_REST: f64 = 1e-6;

    /// An arm at rest at `q` (rad), in free air.
    pub fn at(q: JointVector) -> Self {
        Self {
            load: Wrench::zero(),
            tare: Wrench::zero(),
            ticks: 0,
            q,
            dq: JointVector::zeros(),
            q_target: q,
            stopped: false,
        }
    }
}

impl RobotBackend for IdealArm {
    type Error = IdealArmError;

    fn period(&self) -> Duration {
        Self::PERIOD
    }

    fn read(&mut self) -> Result<RobotState, Self::Error> {
        self.ticks += 1;
        let dt = Self::PERIOD.as_secs_f64();
        let step = (self.q_target - self.q) * Self::FOLLOW;
        self.q += step;
        self.dq = step / dt;
        Ok(RobotState {
            time: self.ticks as f64 * dt,
            q: self.q,
            dq: self.dq,
            q_target: self.q_target,
            sensor_wrench: self.load - self.tare,
        })
    }

    fn write(&mut self, command: &JointCommand) -> Result<(), Self::Error> {
        if self.stopped {
            return Err(IdealArmError::Stopped);
        }
        if !command.q.iter().all(|x| x.is_finite()) {
            return Err(IdealArmError::NotFinite(command.q));
        }
        self.q_target = command.q;
        Ok(())
    }

    fn stop(&mut self) -> Result<(), Self::Error> {
        self.q_target = self.q;
        self.stopped = true;
        Ok(())
    }

    fn recover(&mut self) -> Result<(), Self::Error> {
        self.stopped = false;
        Ok(())
    }

    fn tare(&mut self) -> Result<(), Self::Error> {
        self.tare = self.load;
        // The lag only ever approaches the set-point: land on it, so that what follows is exact.
        if (self.q_target - self.q).amax() < Self::AT_REST {
            self.q = self.q_target;
            self.dq.fill(0.0);
        }
        Ok(())
    }
}
