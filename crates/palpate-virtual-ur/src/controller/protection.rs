//! When the controller stops the arm by itself.

use std::fmt;

use palpate_kinematics::UrModel;
use palpate_spatial::{DOF, JointVector};

use super::DT;
use super::motion::SetPoint;

/// Limits beyond which the controller makes a protective stop.
///
/// The maker publishes joint speeds and positions and lets the installation choose a force; how large a jump it takes
/// for "sudden stop" it does not say. The figures here are generous.
#[derive(Clone, Debug, PartialEq)]
pub struct ControllerLimits {
    /// rad/s.
    pub speed: JointVector,
    /// Change of the set-points' speed, rad/s².
    pub acceleration: f64,
    /// |q|, rad.
    pub position: JointVector,
    /// Set-point minus measured, rad: path deviation.
    pub deviation: f64,
    /// Force at the tool, N.
    pub force: f64,
    /// How fast a protective or emergency stop decelerates the leading axis, rad/s².
    pub stop_deceleration: f64,
}

impl ControllerLimits {
    /// The maker's speeds and ranges, 150 rad/s², 0.2 rad, 150 N, 30 rad/s².
    pub fn for_model(model: UrModel) -> Self {
        let published = model.limits();
        Self {
            speed: published.velocity,
            acceleration: 150.0,
            // The elbow's ±π is a convention of the description, not a limit of the joint.
            position: published
                .upper
                .map(|q| if q.is_finite() { std::f64::consts::TAU } else { q }),
            deviation: 0.2,
            force: 150.0,
            stop_deceleration: 30.0,
        }
    }

    /// Whether the arm may be sent to `next`.
    pub(crate) fn check_set_point(&self, now: &SetPoint, next: &SetPoint) -> Result<(), StopCause> {
        for joint in 0..DOF {
            let (position, speed) = (next.q[joint], next.dq[joint]);
            #[expect(
                clippy::neg_cmp_op_on_partial_ord,
                reason = "a NaN set-point must stop the arm"
            )]
            if !(position.abs() <= self.position[joint]) {
                return Err(StopCause::Position { joint, position, limit: self.position[joint] });
            }
            let acceleration = (speed - now.dq[joint]) / DT;
            #[expect(clippy::neg_cmp_op_on_partial_ord, reason = "a NaN jump must stop the arm")]
            if !(acceleration.abs() <= self.acceleration) {
                return Err(StopCause::Jump { joint, acceleration, limit: self.acceleration });
            }
            #[expect(clippy::neg_cmp_op_on_partial_ord, reason = "a NaN speed must stop the arm")]
            if !(speed.abs() <= self.speed[joint] * 1.001) {
                return Err(StopCause::Speed { joint, speed, limit: self.speed[joint] });
            }
        }
        Ok(())
    }

    /// Whether what is measured is still in order.
    pub(crate) fn check_measured(
        &self,
        set: &JointVector,
        q: &JointVector,
        force: f64,
    ) -> Result<(), StopCause> {
        for joint in 0..DOF {
            let deviation = set[joint] - q[joint];
            #[expect(clippy::neg_cmp_op_on_partial_ord, reason = "a NaN must stop the arm")]
            if !(deviation.abs() <= self.deviation) {
                return Err(StopCause::Deviation { joint, deviation, limit: self.deviation });
            }
        }
        #[expect(clippy::neg_cmp_op_on_partial_ord, reason = "a NaN force must stop the arm")]
        if !(force <= self.force) {
            return Err(StopCause::Force { force, limit: self.force });
        }
        Ok(())
    }
}

/// Why the controller made a protective stop.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum StopCause {
    /// A set-point outside a joint's range.
    Position {
        /// From 0, base to tip.
        joint: usize,
        /// rad.
        position: f64,
        /// rad.
        limit: f64,
    },
    /// Set-points too fast.
    Speed {
        /// From 0, base to tip.
        joint: usize,
        /// rad/s.
        speed: f64,
        /// rad/s.
        limit: f64,
    },
    /// A step in the set-points' speed.
    Jump {
        /// From 0, base to tip.
        joint: usize,
        /// rad/s².
        acceleration: f64,
        /// rad/s².
        limit: f64,
    },
    /// The arm is not where it was sent.
    Deviation {
        /// From 0, base to tip.
        joint: usize,
        /// rad.
        deviation: f64,
        /// rad.
        limit: f64,
    },
    /// The tool presses too hard.
    Force {
        /// N.
        force: f64,
        /// N.
        limit: f64,
    },
    /// A straight line that the arm cannot follow.
    Path(String),
    /// The program or a fault asked for it.
    Requested,
}

impl fmt::Display for StopCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Position { joint, position, limit } => {
                write!(
                    f,
                    "Protective Stop: joint {joint} to {position:.3} rad, limit {limit:.3} rad"
                )
            }
            Self::Speed { joint, speed, limit } => {
                write!(
                    f,
                    "Protective Stop: joint {joint} at {speed:.3} rad/s, limit {limit:.3} rad/s"
                )
            }
            Self::Jump { joint, acceleration, limit } => write!(
                f,
                "C204A3: Protective Stop: Invalid setpoints: Sudden stop (joint {joint}: {acceleration:.0} rad/s^2, limit {limit:.0})"
            ),
            Self::Deviation { joint, deviation, limit } => write!(
                f,
                "C157: Protective Stop: Position deviates from path (joint {joint}: {deviation:.3} rad, limit {limit:.3})"
            ),
            Self::Force { force, limit } => {
                write!(f, "C153: Protective Stop: {force:.1} N at the tool, limit {limit:.1} N")
            }
            Self::Path(problem) => write!(f, "Protective Stop: no way along the line: {problem}"),
            Self::Requested => f.write_str("Protective Stop: requested"),
        }
    }
}
