//! The only robot an environment accepts.

use std::time::Duration;

use palpate_kinematics::SerialChain;
use palpate_robot_io::{FaultKind, RobotBackend};
use palpate_spatial::{DOF, JointVector, Pose};

use crate::shield::{Decision, Standing};
use crate::{Ledger, Measurement, Safe, SafeError, SafetyConfig, Tally, Verdict};

mod sealed {
    pub trait Sealed {}
    impl<B: palpate_robot_io::RobotBackend> Sealed for crate::Safe<B> {}
}

/// A robot that cannot be commanded around its fail-safe layer. Implemented by [`Safe`] alone.
pub trait Guarded: sealed::Sealed {
    /// Error of the layer or of the backend below.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Time between samples.
    fn period(&self) -> Duration;
    /// Waits for the next sample and measures. See [`Safe::sense`].
    fn sense(&mut self) -> Result<Measurement, Self::Error>;
    /// Commands a tool pose for the next period. See [`Safe::command`].
    fn command(&mut self, base_T_tool: &Pose) -> Result<Verdict, Self::Error>;
    /// Commands joints for the next period. See [`Safe::command_joints`].
    fn command_joints(&mut self, q: &JointVector) -> Result<Verdict, Self::Error>;
    /// Starts driving back. See [`Safe::begin_reset`].
    fn begin_reset(&mut self);
    /// Tares and arms the episode's limits. See [`Safe::begin_episode`].
    fn begin_episode(&mut self) -> Result<(), Self::Error>;
    /// Clears a fault of the backend.
    fn recover(&mut self) -> Result<(), Self::Error>;
    /// Puts the arm back to its start in a fresh world, if this is a simulation. See [`Safe::rebuild`].
    fn rebuild(&mut self) -> bool;
    /// Brings the arm to rest.
    fn stop(&mut self) -> Result<(), Self::Error>;
    /// Brakes for the next period. See [`Safe::brake`].
    fn brake(&mut self) -> Result<Verdict, Self::Error>;
    /// Zeroes the sensor on the way. See [`Safe::tare`].
    fn tare(&mut self) -> Result<(), Self::Error>;
    /// What the set-point is doing. See [`Safe::standing`].
    fn standing(&self) -> Standing;
    /// Whether the contact force has been below its re-arm level for long enough. See [`Safe::is_armed`].
    fn is_armed(&self) -> bool;
    /// The last verdict with what was executed, in shield mode. See [`Safe::decision`].
    fn decision(&self) -> Option<&Decision>;
    /// Every verdict other than a pass. See [`Safe::ledger`].
    fn ledger(&self) -> &Ledger;
    /// The same, to empty it once it is written.
    fn ledger_mut(&mut self) -> &mut Ledger;
    /// Refusals and force stops so far.
    fn tally(&self) -> Tally;
    /// Kinematics from the base to the tool centre point.
    fn chain(&self) -> &SerialChain<DOF>;
    /// The limits in force.
    fn limits(&self) -> &SafetyConfig;
    /// The backend's fault behind an error, if it is one.
    fn fault(error: &Self::Error) -> Option<FaultKind>;
}

impl<B: RobotBackend> Guarded for Safe<B> {
    type Error = SafeError<B::Error>;

    fn period(&self) -> Duration {
        Self::period(self)
    }
    fn sense(&mut self) -> Result<Measurement, Self::Error> {
        Self::sense(self)
    }
    fn command(&mut self, base_T_tool: &Pose) -> Result<Verdict, Self::Error> {
        Self::command(self, base_T_tool)
    }
    fn command_joints(&mut self, q: &JointVector) -> Result<Verdict, Self::Error> {
        Self::command_joints(self, q)
    }
    fn begin_reset(&mut self) {
        Self::begin_reset(self);
    }
    fn begin_episode(&mut self) -> Result<(), Self::Error> {
        Self::begin_episode(self)
    }
    fn recover(&mut self) -> Result<(), Self::Error> {
        Self::recover(self)
    }
    fn rebuild(&mut self) -> bool {
        Self::rebuild(self)
    }
    fn stop(&mut self) -> Result<(), Self::Error> {
        Self::stop(self)
    }
    fn brake(&mut self) -> Result<Verdict, Self::Error> {
        Self::brake(self)
    }
    fn tare(&mut self) -> Result<(), Self::Error> {
        Self::tare(self)
    }
    fn standing(&self) -> Standing {
        Self::standing(self)
    }
    fn is_armed(&self) -> bool {
        Self::is_armed(self)
    }
    fn decision(&self) -> Option<&Decision> {
        Self::decision(self)
    }
    fn ledger(&self) -> &Ledger {
        Self::ledger(self)
    }
    fn ledger_mut(&mut self) -> &mut Ledger {
        Self::ledger_mut(self)
    }
    fn tally(&self) -> Tally {
        Self::tally(self)
    }
    fn chain(&self) -> &SerialChain<DOF> {
        Self::chain(self)
    }
    fn limits(&self) -> &SafetyConfig {
        Self::limits(self)
    }
    fn fault(error: &Self::Error) -> Option<FaultKind> {
        error.fault()
    }
}
