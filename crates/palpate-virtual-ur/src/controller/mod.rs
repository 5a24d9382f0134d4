//! The controller itself: modes, program, motion, protection. No socket, no clock: 500 times a second
//! somebody calls [`Controller::tick`].

mod arm;
mod config;
mod cycle;
pub mod dashboard;
mod motion;
mod power;
mod program;
mod protection;
mod registers;
mod sensor;
mod watchdog;
mod world;

pub use arm::{ArmModel, Sample};
pub use config::{ControllerConfig, Delays};
pub use cycle::Controller;
pub use motion::Motion;
pub use program::{Event, Severity};
pub use protection::{ControllerLimits, StopCause};
pub use registers::{Bank, Registers};
pub use sensor::{SensorFault, SensorFaults};
pub use watchdog::WatchdogAction;

/// The control period of an e-Series, s.
pub const DT: f64 = 0.002;

/// Control cycles in `seconds`, at least one for anything above zero.
pub(crate) fn ticks(seconds: f64) -> u64 {
    // A hair less, so that 0.01 s are five cycles and not six.
    (seconds / DT - 1e-9).ceil().max(0.0) as u64
}
