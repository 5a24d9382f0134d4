//! The suite that every [`RobotBackend`] must pass: the numbered points of the trait's contract.
//!
//! ```
//! use palpate_robot_io::{IdealArm, contract};
//!
//! contract::check(&mut IdealArm::at([0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into()))?;
//! # Ok::<(), contract::Violation>(())
//! ```

#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must fail")]

use palpate_spatial::JointVector;

use crate::{BackendError, FaultKind, JointCommand, RobotBackend, RobotState};

/// A broken point of the contract.
#[derive(Debug, thiserror::Error)]
#[error("point {point} of the backend contract is broken: {what}")]
pub struct Violation {
    /// The number in [`RobotBackend`]'s documentation.
    pub point: u8,
    /// What was seen.
    pub what: String,
}

/// Sensor noise allowed after a tare: N and N·m.
const NOISE: (f64, f64) = (1.0, 0.1);
/// Time a backend has to come to rest, s.
const SETTLE: f64 = 1.0;
const AT_REST: f64 = 1e-3;
const REACHED: f64 = 1e-3;

/// Checks all points. The arm must be at rest in free air and able to turn its last joint by 0.02 rad.
pub fn check<B: RobotBackend>(arm: &mut B) -> Result<(), Violation> {
    samples_are_finite_and_advance(arm)?;
    commands_are_followed_and_silence_is_rest(arm)?;
    non_finite_commands_change_nothing(arm)?;
    stop_latches_until_recover(arm)?;
    tare_zeroes_the_sensor(arm)
}

fn samples_are_finite_and_advance<B: RobotBackend>(arm: &mut B) -> Result<(), Violation> {
    let mut last = read(arm, 1)?;
    for _ in 0..50 {
        let state = read(arm, 1)?;
        if !state.is_finite() {
            return broken(1, format!("a sample is not finite: {state:?}"));
        }
        if !(state.time > last.time) {
            return broken(1, format!("time went from {} s to {} s", last.time, state.time));
        }
        last = state;
    }
    Ok(())
}

fn commands_are_followed_and_silence_is_rest<B: RobotBackend>(
    arm: &mut B,
) -> Result<(), Violation> {
    let start = read(arm, 2)?.q;
    let mut goal = start;
    for _ in 0..20 {
        goal[5] += 1e-3;
        write(arm, 2, &goal)?;
        read(arm, 2)?;
    }
    let state = settle(arm, 2)?;
    let error = (state.q - goal).amax();
    if !(error < REACHED) {
        return broken(2, format!("{error:.2e} rad away from the last command after silence"));
    }
    if !((state.q_target - goal).amax() < 1e-9) {
        return broken(2, "q_target is not the last command".into());
    }
    Ok(())
}

fn non_finite_commands_change_nothing<B: RobotBackend>(arm: &mut B) -> Result<(), Violation> {
    let before = settle(arm, 3)?;
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for joint in 0..before.q.len() {
            let mut q = before.q;
            q[joint] = bad;
            match arm.write(&JointCommand { q }) {
                Err(e) if e.kind() == FaultKind::InvalidCommand => {}
                other => return broken(3, format!("{bad} on joint {joint} gave {other:?}")),
            }
        }
    }
    let after = settle(arm, 3)?;
    if !((after.q - before.q).amax() < REACHED && after.q_target == before.q_target) {
        return broken(3, "the arm moved on a refused command".into());
    }
    Ok(())
}

fn stop_latches_until_recover<B: RobotBackend>(arm: &mut B) -> Result<(), Violation> {
    for _ in 0..2 {
        arm.stop().or_else(|e| broken(4, format!("stop failed: {e}")))?;
    }
    let rest = settle(arm, 4)?;
    match arm.write(&JointCommand { q: rest.q }) {
        Err(e) if e.kind() == FaultKind::Stopped => {}
        other => return broken(4, format!("a write after stop gave {other:?}")),
    }
    arm.recover().or_else(|e| broken(4, format!("recover failed: {e}")))?;
    write(arm, 4, &rest.q)
}

fn tare_zeroes_the_sensor<B: RobotBackend>(arm: &mut B) -> Result<(), Violation> {
    settle(arm, 6)?;
    arm.tare().or_else(|e| broken(6, format!("tare failed: {e}")))?;
    let wrench = read(arm, 6)?.sensor_wrench;
    if !(wrench.force.norm() <= NOISE.0 && wrench.torque.norm() <= NOISE.1) {
        return broken(6, format!("the sensor reads {wrench:?} after a tare"));
    }
    Ok(())
}

/// Reads without writing until the joints are at rest.
fn settle<B: RobotBackend>(arm: &mut B, point: u8) -> Result<RobotState, Violation> {
    let ticks = (SETTLE / arm.period().as_secs_f64()) as usize;
    let mut state = read(arm, point)?;
    for _ in 0..ticks {
        state = read(arm, point)?;
    }
    if !(state.dq.amax() < AT_REST) {
        return broken(
            point,
            format!("still moving at {:.2e} rad/s after {SETTLE} s", state.dq.amax()),
        );
    }
    Ok(state)
}

fn read<B: RobotBackend>(arm: &mut B, point: u8) -> Result<RobotState, Violation> {
    arm.read().or_else(|e| broken(point, format!("read failed: {e}")))
}

fn write<B: RobotBackend>(arm: &mut B, point: u8, q: &JointVector) -> Result<(), Violation> {
    arm.write(&JointCommand { q: *q }).or_else(|e| broken(point, format!("write failed: {e}")))
}

fn broken<T>(point: u8, what: String) -> Result<T, Violation> {
    Err(Violation { point, what })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::IdealArm;

    #[test]
    fn the_ideal_arm_passes() {
        check(&mut IdealArm::at(JointVector::zeros())).unwrap();
    }

    /// An arm with one fault, to see that the suite notices.
    struct Faulty {
        inner: IdealArm,
        fault: u8,
    }

    impl RobotBackend for Faulty {
        type Error = crate::IdealArmError;
        fn period(&self) -> std::time::Duration {
            self.inner.period()
        }
        fn read(&mut self) -> Result<RobotState, Self::Error> {
            let mut state = self.inner.read()?;
            if self.fault == 1 {
                state.time = 0.0;
            }
            if self.fault == 2 {
                state.q *= 1.5;
            }
            Ok(state)
        }
        fn write(&mut self, command: &JointCommand) -> Result<(), Self::Error> {
            match self.inner.write(command) {
                Err(crate::IdealArmError::NotFinite(_)) if self.fault == 3 => Ok(()),
                Err(crate::IdealArmError::Stopped) if self.fault == 4 => Ok(()),
                other => other,
            }
        }
        fn stop(&mut self) -> Result<(), Self::Error> {
            self.inner.stop()
        }
        fn recover(&mut self) -> Result<(), Self::Error> {
            self.inner.recover()
        }
        fn tare(&mut self) -> Result<(), Self::Error> {
            if self.fault == 6 { Ok(()) } else { self.inner.tare() }
        }
    }

    #[test]
    fn each_broken_point_is_named() {
        for fault in [1, 2, 3, 4, 6] {
            let mut inner = IdealArm::at(JointVector::from_element(0.3));
            inner.load.force.z = 5.0;
            let violation = check(&mut Faulty { inner, fault }).unwrap_err();
            assert_eq!(violation.point, fault, "{violation}");
        }
    }
}
