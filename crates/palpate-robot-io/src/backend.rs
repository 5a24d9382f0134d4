//! The trait.

use std::time::Duration;

use crate::{BackendError, JointCommand, RobotState};

/// An arm that can be sampled and commanded at a fixed rate.
///
/// # Contract
///
/// [`contract::check`](crate::contract::check) tests these points on any backend.
///
/// 1. [`read`](Self::read) blocks until a sample newer than the last one exists, and so paces the
///    loop. Samples are finite and their time strictly increases.
/// 2. A [`write`](Self::write) is followed during the next period. Without a further command the arm
///    comes to rest at the last one: silence is never "keep going".
/// 3. A command that is not finite is refused with [`FaultKind::InvalidCommand`] and changes nothing.
/// 4. After [`stop`](Self::stop) the arm comes to rest and `write` fails with
///    [`FaultKind::Stopped`] until [`recover`](Self::recover) succeeds; `stop` is idempotent and works in
///    every state.
/// 5. After any other `Err` from `read` or `write` the arm is stopped or stopping.
/// 6. After [`tare`](Self::tare) in free air at rest the sensor reads (noise apart) zero. A backend
///    that simulates contact also rebuilds its world there, so that an episode never depends on the
///    ones before it.
///
/// [`FaultKind::InvalidCommand`]: crate::FaultKind::InvalidCommand
/// [`FaultKind::Stopped`]: crate::FaultKind::Stopped
pub trait RobotBackend {
    /// This backend's error.
    type Error: BackendError;

    /// Time between samples.
    fn period(&self) -> Duration;

    /// Waits for the next sample.
    fn read(&mut self) -> Result<RobotState, Self::Error>;

    /// Sends the set-point for the next period.
    fn write(&mut self, command: &JointCommand) -> Result<(), Self::Error>;

    /// Brings the arm to rest and refuses motion until [`recover`](Self::recover).
    fn stop(&mut self) -> Result<(), Self::Error>;

    /// Makes the arm take commands again after a stop or a fault, if that needs no person.
    fn recover(&mut self) -> Result<(), Self::Error>;

    /// Zeroes the force/torque sensor. Call it at rest, in free air.
    fn tare(&mut self) -> Result<(), Self::Error>;

    /// Puts the arm back to its start in a fresh world, where a tool that is stuck would need a person. Whether
    /// that was done: only simulations can.
    fn rebuild(&mut self) -> bool {
        false
    }
}

macro_rules! forward {
    ($target:ty) => {
        impl<B: RobotBackend + ?Sized> RobotBackend for $target {
            type Error = B::Error;
            fn period(&self) -> Duration {
                (**self).period()
            }
            fn read(&mut self) -> Result<RobotState, Self::Error> {
                (**self).read()
            }
            fn write(&mut self, command: &JointCommand) -> Result<(), Self::Error> {
                (**self).write(command)
            }
            fn stop(&mut self) -> Result<(), Self::Error> {
                (**self).stop()
            }
            fn recover(&mut self) -> Result<(), Self::Error> {
                (**self).recover()
            }
            fn tare(&mut self) -> Result<(), Self::Error> {
                (**self).tare()
            }
            fn rebuild(&mut self) -> bool {
                (**self).rebuild()
            }
        }
    };
}
forward!(&mut B);
forward!(Box<B>);
