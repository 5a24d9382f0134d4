//! The registers that the computer and the control program share, numbered once for both.
//!
//! Upper range: no fieldbus owns registers 24 to 47. The layout is that of `scripts/palpate.script`; a
//! test compares the two.

/// Version of the layout and of the control program.
pub const VERSION: i32 = 1;

/// Integer input: what to do, see [`Mode`].
pub const MODE: u8 = 24;
/// Integer input: another number in every packet.
pub const SEQUENCE: u8 = 25;
/// Integer input: whose packets count.
pub const TOKEN: u8 = 26;
/// Float input: the first of six joint set-points.
pub const SET_POINT: u8 = 24;
/// Float input: sequence plus the sum of the set-point.
pub const CHECK: u8 = 30;

/// Integer outputs, in order: version, sequence taken, status, heartbeat, token, tares, reason.
pub const REPORT: std::ops::RangeInclusive<u8> = 24..=30;

/// Sequence numbers count from 0 and start again here.
pub const SEQUENCE_END: i32 = 1_000_000_000;

/// What the control program shall do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(i32)]
pub enum Mode {
    /// Rest; ends a latched stop.
    #[default]
    Idle = 0,
    /// Follow the set-points.
    Servo = 1,
    /// Brake and refuse motion until `Idle`.
    Stop = 2,
    /// Come to rest and zero the force/torque sensor.
    Tare = 3,
    /// Brake and end the program.
    End = 4,
}

/// What the control program says it is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// At rest, ready.
    Idle,
    /// Following set-points.
    Servo,
    /// Braked because it was asked to.
    Stopped,
    /// Braked because packets stopped.
    Stalled,
    /// Braked because of a set-point; the reason follows.
    Refused(Reason),
    /// Ended because it was asked to.
    Ended,
    /// A number that this version does not know; 0 before the program has run.
    Unknown(i32),
}

/// Why the control program refused a set-point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// Sequence, set-point and check value do not belong together.
    NotWhole,
    /// The first set-point is too far from where the arm is.
    FirstTooFar,
    /// A joint would have to be faster than its limit.
    StepTooLong,
    /// A number that this version does not know.
    Unknown(i32),
}

impl Status {
    /// From the registers.
    pub fn new(status: i32, reason: i32) -> Self {
        match status {
            1 => Self::Idle,
            2 => Self::Servo,
            5 => Self::Stopped,
            6 => Self::Stalled,
            7 => Self::Refused(match reason {
                1 => Reason::NotWhole,
                2 => Reason::FirstTooFar,
                3 => Reason::StepTooLong,
                other => Reason::Unknown(other),
            }),
            8 => Self::Ended,
            other => Self::Unknown(other),
        }
    }
}

impl std::fmt::Display for Status {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Idle => f.write_str("idle"),
            Self::Servo => f.write_str("following set-points"),
            Self::Stopped => f.write_str("stopped on request"),
            Self::Stalled => f.write_str("braked because set-points stopped coming"),
            Self::Refused(Reason::NotWhole) => f.write_str("braked because of a damaged packet"),
            Self::Refused(Reason::FirstTooFar) => {
                f.write_str("refused a first set-point that is too far from the arm")
            }
            Self::Refused(Reason::StepTooLong) => {
                f.write_str("braked because of a set-point beyond the joint speed limit")
            }
            Self::Refused(Reason::Unknown(n)) => write!(f, "braked for the unknown reason {n}"),
            Self::Ended => f.write_str("ended"),
            Self::Unknown(n) => write!(f, "in the unknown status {n}"),
        }
    }
}
