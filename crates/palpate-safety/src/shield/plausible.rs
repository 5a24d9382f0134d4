//! Whether a sample can be true.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must fail")]

use palpate_robot_io::RobotState;
use palpate_spatial::{DOF, JointVector};

use super::config::SensorConfig;

/// Why a sample is not believed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Implausible {
    /// A component is not finite.
    #[error("the sample is not finite")]
    NonFinite,
    /// The robot's clock did not advance.
    #[error("the robot's clock stands at {time:.4} s: the sample is stale")]
    Stale {
        /// Its time, s.
        time: f64,
    },
    /// Samples are missing.
    #[error("{gap:.4} s between two samples, more than {limit:.4} s")]
    Gap {
        /// Time between the samples, s.
        gap: f64,
        /// Limit, s.
        limit: f64,
    },
    /// The wrench has not changed.
    #[error("the wrench has not changed for {samples} samples: the sensor is frozen")]
    Stuck {
        /// Samples.
        samples: u32,
    },
    /// The sensor is at the end of its range.
    #[error("sensor axis {axis} reads {value:.2}, the end of its range")]
    Saturated {
        /// 0–2 force, 3–5 torque, tool0 axes.
        axis: usize,
        /// N or N·m.
        value: f64,
    },
    /// A joint is where it cannot have gone.
    #[error("joint {joint} moved by {step:.4} rad between two samples, more than {limit:.4} rad")]
    JointJump {
        /// Joint index.
        joint: usize,
        /// rad.
        step: f64,
        /// rad.
        limit: f64,
    },
    /// A joint reports a speed that the arm does not have.
    #[error(
        "joint {joint} reports {speed:.3} rad/s, beyond anything the arm can do ({limit:.3} rad/s)"
    )]
    JointSpeed {
        /// Joint index.
        joint: usize,
        /// rad/s.
        speed: f64,
        /// rad/s.
        limit: f64,
    },
    /// The wrench changed faster than a contact can.
    #[error("sensor axis {axis} changed by {step:.2} between two samples, more than {limit:.2}")]
    WrenchJump {
        /// 0–2 force, 3–5 torque, tool0 axes.
        axis: usize,
        /// N or N·m.
        step: f64,
        /// N or N·m.
        limit: f64,
    },
}

/// Rounding of a reading that was turned into other axes and back while the arm moved, N and N·m: a frozen sensor
/// is not the same to the last bit.
const ROUNDING: f64 = 1e-9;

/// Part of the range at which a sensor counts as saturated.
pub(crate) const SATURATED: f64 = 0.999;

/// The last believed sample and what follows from it.
#[derive(Clone, Debug)]
pub struct Watch {
    config: SensorConfig,
    /// Twice the arm's rated joint speeds, rad/s.
    speed: JointVector,
    previous: Option<RobotState>,
    same: u32,
}

impl Watch {
    /// A watch over an arm with these rated joint speeds (rad/s).
    pub fn new(config: SensorConfig, rated: &JointVector) -> Self {
        Self { config, speed: rated * 2.0, previous: None, same: 0 }
    }

    /// Forgets the past: after a stop, or after the sensor was zeroed.
    pub fn restart(&mut self) {
        (self.previous, self.same) = (None, 0);
    }

    /// Takes in a sample.
    pub fn check(&mut self, state: &RobotState) -> Result<(), Implausible> {
        if !state.is_finite() {
            return Err(Implausible::NonFinite);
        }
        let previous = self.previous.replace(*state);
        let wrench = state.sensor_wrench.vector();
        for axis in 0..6 {
            let (range, value) = (
                if axis < 3 { self.config.force_range } else { self.config.torque_range },
                wrench[axis],
            );
            if !(value.abs() < range * SATURATED) {
                return Err(Implausible::Saturated { axis, value });
            }
        }
        for joint in 0..DOF {
            let (speed, limit) = (state.dq[joint].abs(), self.speed[joint]);
            if !(speed <= limit) {
                return Err(Implausible::JointSpeed { joint, speed, limit });
            }
        }
        previous.map_or(Ok(()), |p| self.change(&p, state))
    }

    fn change(&mut self, previous: &RobotState, state: &RobotState) -> Result<(), Implausible> {
        let (gap, limit) = (state.time - previous.time, self.config.gap_max);
        if !(gap > 0.0) {
            return Err(Implausible::Stale { time: state.time });
        }
        if !(gap <= limit) {
            return Err(Implausible::Gap { gap, limit });
        }
        for joint in 0..DOF {
            let (step, limit) =
                ((state.q[joint] - previous.q[joint]).abs(), self.config.joint_jump_max);
            if !(step <= limit) {
                return Err(Implausible::JointJump { joint, step, limit });
            }
        }
        let (now, before) = (state.sensor_wrench.vector(), previous.sensor_wrench.vector());
        for axis in 0..6 {
            let step = (now[axis] - before[axis]).abs();
            let limit =
                if axis < 3 { self.config.force_jump_max } else { self.config.torque_jump_max };
            if !(step <= limit) {
                return Err(Implausible::WrenchJump { axis, step, limit });
            }
        }
        self.same = if (now - before).amax() <= ROUNDING { self.same.saturating_add(1) } else { 0 };
        let allowed = self.config.stuck_samples;
        if allowed > 0 && self.same >= allowed {
            return Err(Implausible::Stuck { samples: self.same });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_spatial::Wrench;

    fn watch() -> Watch {
        let config = SensorConfig {
            force_range: 150.0,
            torque_range: 10.0,
            force_jump_max: 40.0,
            torque_jump_max: 4.0,
            joint_jump_max: 0.02,
            gap_max: 0.01,
            stuck_samples: 5,
            bad_samples_max: 10,
        };
        Watch::new(config, &JointVector::from_element(3.0))
    }

    fn sample(tick: u32) -> RobotState {
        let mut wrench = Wrench::zero();
        wrench.force.x = f64::from(tick) * 1e-3;
        RobotState {
            time: f64::from(tick) * 0.002,
            q: JointVector::from_element(0.3),
            dq: JointVector::zeros(),
            q_target: JointVector::from_element(0.3),
            sensor_wrench: wrench,
        }
    }

    /// What is said about a second sample that was changed.
    fn second(change: impl Fn(&mut RobotState)) -> Result<(), Implausible> {
        let mut w = watch();
        w.check(&sample(1)).unwrap();
        let mut state = sample(2);
        change(&mut state);
        w.check(&state)
    }

    #[test]
    fn a_good_sample_is_believed_and_each_bad_one_is_named() {
        use Implausible as I;
        assert_eq!(second(|_| {}), Ok(()));
        assert!(matches!(second(|s| s.sensor_wrench.torque.z = f64::NAN), Err(I::NonFinite)));
        assert!(matches!(second(|s| s.time = 0.002), Err(I::Stale { .. })));
        assert!(matches!(second(|s| s.time = 0.001), Err(I::Stale { .. })));
        assert!(matches!(second(|s| s.time = 0.0125), Err(I::Gap { .. })));
        assert!(matches!(second(|s| s.q[4] += 0.021), Err(I::JointJump { joint: 4, .. })));
        assert!(matches!(second(|s| s.dq[2] = -6.1), Err(I::JointSpeed { joint: 2, .. })));
        assert!(matches!(
            second(|s| s.sensor_wrench.force.y = -41.0),
            Err(I::WrenchJump { axis: 1, .. })
        ));
        assert!(matches!(
            second(|s| s.sensor_wrench.torque.x = 4.1),
            Err(I::WrenchJump { axis: 3, .. })
        ));
        assert!(matches!(
            second(|s| s.sensor_wrench.force.z = -150.0),
            Err(I::Saturated { axis: 2, .. })
        ));
        assert!(matches!(
            second(|s| s.sensor_wrench.torque.y = 10.0),
            Err(I::Saturated { axis: 4, .. })
        ));
    }

    #[test]
    fn forces_and_torques_are_held_against_their_own_limits() {
        use Implausible as I;
        // A force may jump farther than a torque may be, and the other way round.
        assert_eq!(second(|s| s.sensor_wrench.force.z = 39.0), Ok(()));
        assert_eq!(second(|s| s.sensor_wrench.torque.z = 3.9), Ok(()));
        let at = |change: fn(&mut RobotState)| {
            let mut state = sample(1);
            change(&mut state);
            watch().check(&state)
        };
        assert_eq!(at(|s| s.sensor_wrench.force.z = 149.0), Ok(()));
        assert_eq!(at(|s| s.sensor_wrench.torque.x = 9.9), Ok(()));
        assert!(matches!(
            at(|s| s.sensor_wrench.torque.x = 10.0),
            Err(I::Saturated { axis: 3, .. })
        ));
        assert!(matches!(
            at(|s| s.sensor_wrench.force.z = 150.0 * SATURATED),
            Err(I::Saturated { axis: 2, .. })
        ));
    }

    #[test]
    fn a_large_reading_is_no_jump_and_a_change_of_sign_may_be_one() {
        let after = |before: f64, now: f64| {
            let mut w = watch();
            let reading = |tick: u32, z: f64| {
                let mut state = sample(tick);
                state.sensor_wrench.force.z = z;
                state
            };
            w.check(&reading(1, before)).unwrap();
            w.check(&reading(2, now))
        };
        assert_eq!(after(30.0, 30.0), Ok(()));
        assert_eq!(after(-100.0, -61.0), Ok(()));
        let jump = after(30.0, -11.0);
        assert_eq!(jump, Err(Implausible::WrenchJump { axis: 2, step: 41.0, limit: 40.0 }));
    }

    #[test]
    fn a_reading_may_be_frozen_anywhere() {
        let mut w = watch();
        let pressed = Wrench::new([5.0, -3.0, 20.0].into(), [0.1, 0.2, -0.3].into());
        let said =
            (1..9).map(|tick| w.check(&RobotState { sensor_wrench: pressed, ..sample(tick) }));
        assert!(said.last().unwrap().is_err());
    }

    #[test]
    fn a_frozen_wrench_is_noticed_unless_the_sensor_has_no_noise() {
        for (allowed, noticed) in [(5, true), (0, false)] {
            let mut w = watch();
            w.config.stuck_samples = allowed;
            let said: Vec<_> = (1..9)
                .map(|tick| {
                    w.check(&RobotState { sensor_wrench: Wrench::zero(), ..sample(tick) }).is_err()
                })
                .collect();
            assert_eq!(said.iter().any(|&bad| bad), noticed, "{said:?}");
            assert!(!said[4] && said[5] == noticed, "the first sample has no predecessor");
        }
    }

    #[test]
    fn a_restart_forgets() {
        let mut w = watch();
        w.check(&sample(5)).unwrap();
        w.restart();
        assert_eq!(w.check(&sample(1)), Ok(()), "time may start anew");
    }
}
