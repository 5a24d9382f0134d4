//! What the layer says about a command, and how often it said it.

use palpate_kinematics::IkError;

/// The fate of one command.
#[derive(Clone, Debug, PartialEq)]
#[must_use]
pub enum Verdict {
    /// Sent to the arm.
    Accepted,
    /// Not sent; the arm holds its last set-point for this period.
    Refused(Refusal),
    /// The contact force is beyond its limit: not sent, and nothing is until the next reset.
    ForceExceeded(Excess),
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
}

/// A wrench component beyond its limit.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("contact {} along base axis {} is {value:.2}, beyond the limit of {limit:.2}", if *axis < 3 { "force" } else { "torque" }, axis % 3)]
pub struct Excess {
    /// 0–2 force, 3–5 torque, base axes.
    pub axis: usize,
    /// Filtered value, N or N·m.
    pub value: f64,
    /// Limit, N or N·m.
    pub limit: f64,
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
}

impl Tally {
    /// Refused commands of every cause.
    pub fn refusals(&self) -> u64 {
        self.non_finite + self.no_ik + self.joint_speed
    }

    pub(crate) fn add(&mut self, refusal: &Refusal) {
        match refusal {
            Refusal::NonFinite => self.non_finite += 1,
            Refusal::NoIk(_) | Refusal::JointRange { .. } => self.no_ik += 1,
            Refusal::JointSpeed { .. } => self.joint_speed += 1,
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
        }
    }
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.non_finite += other.non_finite;
        self.no_ik += other.no_ik;
        self.joint_speed += other.joint_speed;
        self.force += other.force;
    }
}
