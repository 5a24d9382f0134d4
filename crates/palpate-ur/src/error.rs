//! Everything that can go wrong with the arm, with what to do about it.

use std::time::Duration;

use palpate_robot_io::{BackendError, FaultKind};
use palpate_spatial::JointVector;

use crate::proto::{
    ControllerVersion, DataType, RecipeError, RobotMode, RuntimeState, SafetyStatus, SessionError,
};
use crate::registers::Status;

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UrError {
    /// A setting outside its range.
    #[error("ur.{name} is {value}, it must be within {low} to {high}")]
    Config {
        /// The key.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Smallest allowed.
        low: f64,
        /// Largest allowed.
        high: f64,
    },
    /// No connection.
    #[error(
        "cannot connect to {service} at {address}: {source}; is the controller on, reachable, and the service enabled under Settings, Security, Services?"
    )]
    Connect {
        /// RTDE, script or dashboard.
        service: &'static str,
        /// Host and port.
        address: String,
        /// Why.
        source: std::io::Error,
    },
    /// The connection broke.
    #[error("the connection to the controller broke: {0}")]
    Io(#[from] std::io::Error),
    /// The controller closed the connection.
    #[error("the controller closed the connection")]
    Closed,
    /// The connection was lost earlier.
    #[error("there is no connection: call recover to connect again")]
    NotConnected,
    /// The controller does not speak the protocol, or not with us.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// A variable of another type than documented.
    #[error("the controller sends {name} as {got:?}, expected {want:?}")]
    Type {
        /// The variable.
        name: String,
        /// What the controller says.
        got: DataType,
        /// What the guide says.
        want: DataType,
    },
    /// Software too old for the upper registers.
    #[error("the controller runs {0}; the upper registers need 5.3 or newer")]
    TooOld(ControllerVersion),
    /// No sample in time.
    #[error("no sample for {waited:?}: the link or the controller stalls")]
    Stalled {
        /// How long was waited.
        waited: Duration,
    },
    /// Samples come, commands do not arrive.
    #[error(
        "the control program has taken no command for {ticks} samples: it does not hear this computer"
    )]
    NotHeard {
        /// Samples without progress.
        ticks: u32,
    },
    /// Commands arrive, but late.
    #[error(
        "the control program takes commands that are {ticks} cycles old: they queue up on the way, the controller does not read fast enough"
    )]
    Behind {
        /// Commands sent since the one that was taken last.
        ticks: u32,
    },
    /// The network takes no more bytes.
    #[error("{ticks} commands in a row could not be sent: the controller does not read")]
    SendBlocked {
        /// Commands dropped in a row.
        ticks: u32,
    },
    /// The controller's clock went back.
    #[error("the controller's clock went from {from} s to {to} s: it has restarted")]
    ClockBack {
        /// Before.
        from: f64,
        /// After.
        to: f64,
    },
    /// The safety system stopped the arm, or limits it.
    #[error(
        "safety status {0}: find the cause at the arm and clear it on the pendant, then acknowledge it here"
    )]
    Safety(SafetyStatus),
    /// Power or brakes.
    #[error("robot mode {0}: power the arm on and release its brakes")]
    Mode(RobotMode),
    /// The control program does not run.
    #[error(
        "the control program does not run ({0}): it was stopped on the pendant, by the watchdog or by a fault; recover loads it again"
    )]
    Program(RuntimeState),
    /// Another program writes the output registers.
    #[error(
        "the output registers are not ours (token {got}, expected {want}): another control program runs"
    )]
    Foreign {
        /// Found.
        got: i32,
        /// Ours.
        want: i32,
    },
    /// The control program braked.
    #[error("the control program has {0}")]
    Braked(Status),
    /// The control program did not report in time.
    #[error(
        "the control program did not start within {0:?}: remote control must be on, and the primary and secondary interface enabled under Settings, Security, Services"
    )]
    NotStarted(Duration),
    /// The speed slider is not at 100 %.
    #[error("the speed slider is at {:.0} %: set it to 100 %, set-points are times as well as places", .0 * 100.0)]
    Slider(f64),
    /// A joint reading that is no number.
    #[error("a joint reading is not finite: {0:?}")]
    JointReading(JointVector),
    /// A force/torque reading that is no number.
    #[error("the force/torque reading is not finite: {0:?}")]
    WrenchReading([f64; 6]),
    /// A force/torque reading that does not change.
    #[error(
        "the force/torque reading has been the same for {ticks} samples: the sensor is frozen (ur.frozen_ticks = 0 allows a sensor without noise)"
    )]
    WrenchFrozen {
        /// Samples.
        ticks: u32,
    },
    /// A command that is no number.
    #[error("joint command is not finite: {0:?}")]
    NotFinite(JointVector),
    /// A step longer than allowed.
    #[error("joint {joint} would step by {step:.4} rad, allowed is {limit:.4} rad")]
    Step {
        /// 0 at the base.
        joint: usize,
        /// Asked for.
        step: f64,
        /// Allowed.
        limit: f64,
    },
    /// A command after a stop or a fault.
    #[error("the arm is stopped: call recover first")]
    Stopped,
    /// A command through a connection that only reads.
    #[error("this connection only reads: no control program was loaded")]
    ReadOnly,
    /// A person has to look first.
    #[error(
        "the safety system stopped the arm ({0}): a person must look at it and acknowledge before it moves again"
    )]
    NeedsOperator(SafetyStatus),
    /// The arm moves and should not.
    #[error("the arm still moves at {speed:.3} rad/s after {waited:?}; it must rest for {what}")]
    Moving {
        /// Fastest joint.
        speed: f64,
        /// How long was waited.
        waited: Duration,
        /// What for.
        what: &'static str,
    },
    /// The control program did not do what it was asked to.
    #[error("the control program did not {what} within {waited:?} (status: {status})")]
    NoAnswer {
        /// What it was asked.
        what: &'static str,
        /// How long was waited.
        waited: Duration,
        /// What it says.
        status: Status,
    },
    /// A dashboard reply that is not the documented one.
    #[error("the dashboard answered {command:?} with {reply:?}")]
    Dashboard {
        /// What was sent.
        command: String,
        /// What came back.
        reply: String,
    },
    /// A dashboard state that was not reached.
    #[error("{what} did not become {want} within {waited:?}, it is {got}")]
    DashboardState {
        /// What was polled.
        what: &'static str,
        /// The aim.
        want: String,
        /// The last answer.
        got: String,
        /// How long was waited.
        waited: Duration,
    },
}

impl UrError {
    /// Whether the connection is of no more use.
    pub(crate) fn ends_link(&self) -> bool {
        matches!(
            self,
            Self::Io(_)
                | Self::Closed
                | Self::Session(_)
                | Self::ClockBack { .. }
                | Self::Type { .. }
        )
    }

    /// Whether the controller may be there in a moment.
    pub(crate) fn is_away(&self) -> bool {
        matches!(self, Self::Connect { .. } | Self::Io(_) | Self::Closed | Self::Stalled { .. })
    }

    /// Whether an input belongs to another client.
    pub(crate) fn is_in_use(&self) -> bool {
        matches!(self, Self::Session(SessionError::Recipe(RecipeError::InUse(_))))
    }
}

impl BackendError for UrError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Connect { .. }
            | Self::Io(_)
            | Self::Closed
            | Self::NotConnected
            | Self::Stalled { .. }
            | Self::NotHeard { .. }
            | Self::Behind { .. }
            | Self::SendBlocked { .. }
            | Self::ClockBack { .. }
            | Self::Session(SessionError::Timeout { .. }) => FaultKind::Link,
            Self::Session(_) | Self::Type { .. } | Self::TooOld(_) | Self::JointReading(_) => {
                FaultKind::Protocol
            }
            Self::Braked(Status::Stalled) => FaultKind::Timing,
            Self::Braked(_)
            | Self::Safety(_)
            | Self::Mode(_)
            | Self::Program(_)
            | Self::Foreign { .. }
            | Self::NotStarted(_)
            | Self::Slider(_)
            | Self::NeedsOperator(_)
            | Self::Moving { .. }
            | Self::NoAnswer { .. }
            | Self::Dashboard { .. }
            | Self::DashboardState { .. } => FaultKind::RobotState,
            Self::WrenchReading(_) | Self::WrenchFrozen { .. } => FaultKind::Sensor,
            Self::NotFinite(_) | Self::Step { .. } => FaultKind::InvalidCommand,
            Self::Stopped | Self::ReadOnly => FaultKind::Stopped,
            Self::Config { .. } => FaultKind::Internal,
        }
    }
}
