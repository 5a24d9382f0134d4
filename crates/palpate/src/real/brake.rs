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

/// A backend that brakes as soon as a flag is raised, says so once, and moves no more. It can still be read.
#[derive(Debug)]
pub struct Brake<B> {
    arm: B,
    pulled: &'static AtomicBool,
    told: bool,
}

impl<B: RobotBackend> Brake<B> {
    /// Puts a brake on `arm`.
    pub fn new(arm: B, pulled: &'static AtomicBool) -> Self {
        Self { arm, pulled, told: false }
    }

    /// The arm, to look at.
    pub fn arm(&self) -> &B {
        &self.arm
    }

    fn check(&mut self) -> Result<(), BrakeError<B::Error>> {
        if self.pulled.load(Ordering::Relaxed) {
            self.told = true;
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
        if !self.told {
            self.check()?;
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_robot_io::IdealArm;
    use palpate_spatial::JointVector;

    #[test]
    fn it_stops_a_moving_arm_within_a_tick_and_for_good() {
        let flag: &'static AtomicBool = Box::leak(Box::default());
        let mut arm = Brake::new(IdealArm::at(JointVector::zeros()), flag);
        let to = |x: f64| JointCommand { q: JointVector::repeat(x) };
        arm.read().unwrap();
        arm.write(&to(1e-3)).unwrap();
        let before = arm.read().unwrap().q;
        flag.store(true, Ordering::Relaxed);
        assert!(matches!(arm.write(&to(2e-3)), Err(BrakeError::Requested)));
        // What it reads now is an arm that stays.
        for _ in 0..10 {
            assert_eq!(arm.read().unwrap().q, before);
            assert_eq!(arm.write(&to(2e-3)).unwrap_err().kind(), FaultKind::Stopped);
        }
        assert!(arm.recover().is_err() && arm.tare().is_err());
    }

    #[test]
    fn a_loop_that_only_reads_hears_of_it_once() {
        let flag: &'static AtomicBool = Box::leak(Box::default());
        let mut arm = Brake::new(IdealArm::at(JointVector::zeros()), flag);
        arm.read().unwrap();
        flag.store(true, Ordering::Relaxed);
        assert!(matches!(arm.read(), Err(BrakeError::Requested)));
        arm.read().unwrap();
    }
}
