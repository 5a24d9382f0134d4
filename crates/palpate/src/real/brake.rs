//! A person's brake: Ctrl-C reaches the arm in the next control tick, whatever the program is doing.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use palpate_robot_io::{BackendError, FaultKind, JointCommand, RobotBackend, RobotState};

/// Why a braked arm does not move.
#[derive(Debug, thiserror::Error)]
pub enum BrakeError<E> {
    /// Ctrl-C.
    #[error("stopped by Ctrl-C")]
    Requested,
    /// The arm itself.
    #[error(transparent)]
    Arm(E),
}

impl<E: BackendError> BackendError for BrakeError<E> {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Requested => FaultKind::Stopped,
            Self::Arm(e) => e.kind(),
        }
    }
}

/// A backend that brakes as soon as a flag is raised.
#[derive(Debug)]
pub struct Brake<B> {
    arm: B,
    pulled: &'static AtomicBool,
}

impl<B: RobotBackend> Brake<B> {
    /// Puts a brake on `arm`.
    pub fn new(arm: B, pulled: &'static AtomicBool) -> Self {
        Self { arm, pulled }
    }

    /// The arm, to look at.
    pub fn arm(&self) -> &B {
        &self.arm
    }

    fn check(&mut self) -> Result<(), BrakeError<B::Error>> {
        if self.pulled.load(Ordering::Relaxed) {
            self.arm.stop().map_err(BrakeError::Arm)?;
            return Err(BrakeError::Requested);
        }
        Ok(())
    }
}

impl<B: RobotBackend> RobotBackend for Brake<B> {
    type Error = BrakeError<B::Error>;

    fn period(&self) -> Duration {
        self.arm.period()
    }

    fn read(&mut self) -> Result<RobotState, Self::Error> {
        self.check()?;
        self.arm.read().map_err(BrakeError::Arm)
    }

    fn write(&mut self, command: &JointCommand) -> Result<(), Self::Error> {
        self.check()?;
        self.arm.write(command).map_err(BrakeError::Arm)
    }

    fn stop(&mut self) -> Result<(), Self::Error> {
        self.arm.stop().map_err(BrakeError::Arm)
    }

    fn recover(&mut self) -> Result<(), Self::Error> {
        self.check()?;
        self.arm.recover().map_err(BrakeError::Arm)
    }

    fn tare(&mut self) -> Result<(), Self::Error> {
        self.check()?;
        self.arm.tare().map_err(BrakeError::Arm)
    }
}
