//! Whether a sample allows to go on.

use super::{LinkStats, UrArm};
use crate::UrError;
use crate::config::ForcePoint;
use crate::proto::{RobotMode, RuntimeState, SafetyStatus};
use crate::registers::{Mode, SEQUENCE_END, Status};
use crate::sample::Sample;

/// Reduced mode counts as unsafe: its limits are not those that this side works with.
pub(super) fn is_safe(sample: &Sample) -> bool {
    sample.safety == SafetyStatus::Normal
}

/// Power, brakes and safety system.
pub(super) fn able(sample: &Sample) -> Result<(), UrError> {
    if !is_safe(sample) {
        return Err(UrError::Safety(sample.safety));
    }
    if sample.robot_mode != RobotMode::Running {
        return Err(UrError::Mode(sample.robot_mode));
    }
    Ok(())
}

/// Every number that is used is one.
fn finite(sample: &Sample) -> Result<(), UrError> {
    for q in [
        &sample.actual_q,
        &sample.actual_qd,
        &sample.target_q,
        &sample.tcp_pose,
        &sample.tcp_offset,
    ] {
        if !q.iter().all(|x| x.is_finite()) {
            return Err(UrError::JointReading((*q).into()));
        }
    }
    if !sample.tcp_force.iter().all(|x| x.is_finite()) {
        return Err(UrError::WrenchReading(sample.tcp_force));
    }
    Ok(())
}

/// Rounding of a wrench that was turned from axes to axes, N and N·m; far below a sensor's resolution.
const ROUNDING: f64 = 1e-9;

/// Whether two samples tell of the same reading: the same numbers as sent, in base axes, or in the sensor's own,
/// in which a frozen sensor stands still while the arm turns.
pub(super) fn same_wrench(a: &Sample, b: &Sample, point: ForcePoint) -> bool {
    let apart = || a.wrench(point).vector() - b.wrench(point).vector();
    a.tcp_force == b.tcp_force || apart().amax() <= ROUNDING
}

/// Whether the control program takes the commands.
#[derive(Debug, Default)]
pub(super) struct Echo {
    last: i32,
    silent: u32,
}

impl Echo {
    /// A sample came, and with it the sequence number that the program took last.
    pub(super) fn see(&mut self, sequence: i32, stats: &mut LinkStats) {
        if sequence == self.last {
            self.silent += 1;
            return;
        }
        let taken = (sequence - self.last).rem_euclid(SEQUENCE_END);
        stats.taken += 1;
        // After a pause the count says nothing.
        if taken < 1000 {
            stats.overwritten += taken as u64 - 1;
        }
        (self.last, self.silent) = (sequence, 0);
    }

    /// Forgets a silence that was to be expected.
    pub(super) fn forgive(&mut self) {
        self.silent = 0;
    }
}

impl UrArm {
    pub(super) fn judge(&self) -> Result<(), UrError> {
        let Some(token) = self.token else { return finite(&self.sample) };
        able(&self.sample)?;
        finite(&self.sample)?;
        if self.halted {
            return Ok(());
        }
        self.program_alive(token)?;
        match self.sample.report.status {
            Status::Idle | Status::Servo => {}
            other => return Err(UrError::Braked(other)),
        }
        // NaN is no full speed either.
        let full = self.sample.speed_slider > 0.999;
        if self.mode == Mode::Servo && !full {
            return Err(UrError::Slider(self.sample.speed_slider));
        }
        if self.echo.silent >= self.config.stale_ticks {
            return Err(UrError::NotHeard { ticks: self.echo.silent });
        }
        let behind = (self.sequence - self.sample.report.sequence).rem_euclid(SEQUENCE_END) as u32;
        if self.mode == Mode::Servo && behind > 2 * self.config.stale_ticks {
            return Err(UrError::Behind { ticks: behind });
        }
        if self.config.frozen_ticks > 0 && self.frozen >= self.config.frozen_ticks {
            return Err(UrError::WrenchFrozen { ticks: self.frozen });
        }
        Ok(())
    }

    /// Whether our control program runs.
    pub(super) fn program_alive(&self, token: i32) -> Result<(), UrError> {
        if self.sample.runtime != RuntimeState::Playing {
            return Err(UrError::Program(self.sample.runtime));
        }
        let got = self.sample.report.token;
        if got != token {
            return Err(UrError::Foreign { got, want: token });
        }
        Ok(())
    }
}
