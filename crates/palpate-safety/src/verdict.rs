//! What the layer says about a command, and how often it said it.

use palpate_kinematics::IkError;

use crate::Cause;
use crate::shield::{Implausible, Obstacle};

/// The fate of one command.
#[derive(Clone, Debug, PartialEq)]
#[must_use]
pub enum Verdict {
    /// Sent to the arm. In shield mode perhaps slowed: [`Guarded::decision`](crate::Guarded::decision) tells.
    Accepted,
    /// Not sent; the arm holds its last set-point for this period, or in shield mode brakes.
    Refused(Refusal),
    /// The contact force is beyond its limit: not sent, and nothing is until the next reset.
    ForceExceeded(Excess),
}

impl Verdict {
    /// Why it was not simply accepted, as far as a verdict alone tells: a shield's
    /// [`Decision`](crate::shield::Decision) says more.
    pub fn cause(&self) -> Option<Cause> {
        match self {
            Self::Accepted => None,
            Self::Refused(refusal) => Some(refusal.cause().0),
            Self::ForceExceeded(_) => Some(Cause::ForceSoft),
        }
    }
}

/// Why a command was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// The command has a component that is not finite.
    #[error("the command is not finite")]
    NonFinite,
    /// No joint configuration reaches the commanded pose from here.
    #[error("no inverse-kinematics solution: {0}")]
    NoIk(IkError),
    /// A joint would have to move too fast.
    #[error("joint {joint} would move at {speed:.3} rad/s, above its limit of {limit:.3} rad/s")]
    JointSpeed {
        /// Joint index, 0 at the base.
        joint: usize,
        /// Required speed, rad/s.
        speed: f64,
        /// Limit, rad/s.
        limit: f64,
    },
    /// A joint would leave its range.
    #[error("joint {joint} would move to {value:.3} rad, outside [{lower:.3}, {upper:.3}]")]
    JointRange {
        /// Joint index, 0 at the base.
        joint: usize,
        /// Commanded position, rad.
        value: f64,
        /// Lower limit, rad.
        lower: f64,
        /// Upper limit, rad.
        upper: f64,
    },
    /// A joint would have to jump (shield mode).
    #[error("joint {joint} would jump by {step:.4} rad, more than {limit:.4} rad in one command")]
    Jump {
        /// Joint index, 0 at the base.
        joint: usize,
        /// Step, rad.
        step: f64,
        /// Limit, rad.
        limit: f64,
    },
    /// The tool would have to jump (shield mode).
    #[error("the tool would jump by {step:.4} m, more than {limit:.4} m in one command")]
    ToolJump {
        /// Step, m.
        step: f64,
        /// Limit, m.
        limit: f64,
    },
    /// The arm, or its brake, would come too near to something (shield mode).
    #[error("the arm would come too near to {obstacle}: clearance {distance:.4} m")]
    Obstacle {
        /// To what.
        obstacle: Obstacle,
        /// Clearance that would be left, m.
        distance: f64,
    },
    /// The contact force is rising towards its limit too fast (shield mode).
    #[error("after the reaction time: {0}")]
    ForceRising(Excess),
    /// The sample is not to be believed (shield mode).
    #[error("{0}")]
    Implausible(Implausible),
    /// A joint is too far from its set-point (shield mode).
    #[error("joint {joint} is {error:.4} rad away from its set-point, more than {limit:.4} rad")]
    Tracking {
        /// Joint index, 0 at the base.
        joint: usize,
        /// Distance, rad.
        error: f64,
        /// Limit, rad.
        limit: f64,
    },
}

impl Refusal {
    /// The cause in the ledger, and the distance to the limit (negative: beyond it; NaN: not a distance).
    pub(crate) fn cause(&self) -> (Cause, f64) {
        match *self {
            Self::NonFinite => (Cause::NonFinite, f64::NAN),
            Self::NoIk(IkError::Discontinuous { step, allowed, .. }) => {
                (Cause::Branch, allowed - step)
            }
            Self::NoIk(_) => (Cause::NoIk, f64::NAN),
            Self::JointSpeed { speed, limit, .. } => (Cause::JointSpeed, limit - speed),
            Self::JointRange { value, lower, upper, .. } => {
                (Cause::JointRange, (value - lower).min(upper - value))
            }
            Self::Jump { step, limit, .. } | Self::ToolJump { step, limit } => {
                (Cause::Branch, limit - step)
            }
            Self::Obstacle { obstacle, distance } => match obstacle {
                Obstacle::Workspace { .. } => (Cause::Workspace, distance),
                Obstacle::Plane(_) => (Cause::Plane, distance),
                Obstacle::Pair(..) => (Cause::SelfCollision, distance),
            },
            Self::ForceRising(excess) => (Cause::ForceRising, excess.limit - excess.value.abs()),
            Self::Implausible(_) => (Cause::Implausible, f64::NAN),
            Self::Tracking { error, limit, .. } => (Cause::Tracking, limit - error),
        }
    }
}

/// A wrench component, or a norm, beyond its limit.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("contact {} is {value:.2}, beyond the limit of {limit:.2}", Self::component(*axis))]
pub struct Excess {
    /// 0–2 force, 3–5 torque, base axes; [`FORCE_NORM`](Self::FORCE_NORM), [`TORQUE_NORM`](Self::TORQUE_NORM).
    pub axis: usize,
    /// Value, N or N·m.
    pub value: f64,
    /// Limit, N or N·m.
    pub limit: f64,
}

impl Excess {
    /// The norm of the force.
    pub const FORCE_NORM: usize = 6;
    /// The norm of the torque.
    pub const TORQUE_NORM: usize = 7;

    fn component(axis: usize) -> &'static str {
        const NAMES: [&str; 8] = [
            "force along base axis 0",
            "force along base axis 1",
            "force along base axis 2",
            "torque along base axis 0",
            "torque along base axis 1",
            "torque along base axis 2",
            "force",
            "torque",
        ];
        NAMES[axis.min(7)]
    }
}

/// Refusals and force stops counted by cause, in control ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Tally {
    /// Commands that were not finite.
    pub non_finite: u64,
    /// Commands without an IK solution, or outside the joint range.
    pub no_ik: u64,
    /// Commands that asked for too much joint speed.
    pub joint_speed: u64,
    /// Force limits exceeded (once per latch).
    pub force: u64,
    /// Commands refused for a reason that only the shield knows; its ledger tells which.
    #[serde(default)]
    pub shield: u64,
}

impl Tally {
    /// Refused commands of every cause.
    pub fn refusals(&self) -> u64 {
        self.non_finite + self.no_ik + self.joint_speed + self.shield
    }

    pub(crate) fn add(&mut self, refusal: &Refusal) {
        match refusal {
            Refusal::NonFinite => self.non_finite += 1,
            Refusal::NoIk(_) | Refusal::JointRange { .. } => self.no_ik += 1,
            Refusal::JointSpeed { .. } => self.joint_speed += 1,
            _ => self.shield += 1,
        }
    }
}

impl std::ops::Sub for Tally {
    type Output = Self;
    fn sub(self, earlier: Self) -> Self {
        Self {
            non_finite: self.non_finite - earlier.non_finite,
            no_ik: self.no_ik - earlier.no_ik,
            joint_speed: self.joint_speed - earlier.joint_speed,
            force: self.force - earlier.force,
            shield: self.shield - earlier.shield,
        }
    }
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.non_finite += other.non_finite;
        self.no_ik += other.no_ik;
        self.joint_speed += other.joint_speed;
        self.force += other.force;
        self.shield += other.shield;
    }
}
