//! What is asked of the control program and waited for: to start, to rest, to tare.

use std::time::{Duration, Instant, SystemTime};

use super::{UrArm, judge, open_patiently};
use crate::UrError;
use crate::registers::{Mode, Status, VERSION};
use crate::script::{Upload, control_program};

/// Joints slower than this are at rest, rad/s.
const AT_REST: f64 = 0.01;
/// Longer than any braking: 2π rad/s at 1 rad/s² apart, nothing takes that long at default settings.
const REST_TIMEOUT: Duration = Duration::from_secs(3);
const TARE_TIMEOUT: Duration = Duration::from_secs(3);
/// How long a single sample may take while something is waited for.
const PATIENCE: Duration = Duration::from_millis(500);

impl UrArm {
    /// From any state to idle, at rest and ready for commands.
    pub(super) fn ready(&mut self) -> Result<(), UrError> {
        if self.client.is_none() {
            let (client, sample) = open_patiently(&self.config, self.token.is_some())?;
            (self.client, self.sample) = (Some(client), sample);
            self.arrived = Instant::now();
        }
        let Some(token) = self.token else { return Ok(()) };
        match self.receive(PATIENCE.max(self.config.stale())) {
            // Old news: the samples that waited here are those of the stop that is known.
            Err(UrError::Safety(_)) if self.unsafe_halt => {}
            other => other?,
        }
        judge::able(&self.sample)?;
        self.operator.check()?;
        (self.mode, self.q_goal) = (Mode::Idle, None);
        if self.program_alive(token).is_err() || self.sample.report.version != VERSION {
            self.load()?;
        }
        self.wait(REST_TIMEOUT, "come to rest", |arm| {
            arm.sample.report.status == Status::Idle && arm.is_at_rest()
        })?;
        (self.halted, self.unsafe_halt) = (false, false);
        Ok(())
    }

    /// Uploads the control program and waits for its first report.
    fn load(&mut self) -> Result<(), UrError> {
        let token = fresh_token();
        let timeout = Duration::from_secs_f64(self.config.program_timeout);
        self.token = Some(token);
        self.upload = Some(Upload::send(
            &self.config.host,
            self.config.ports.script,
            &control_program(&self.config, token),
            timeout,
        )?);
        let ready = self.wait(timeout, "start", |arm| {
            if let Some(upload) = arm.upload.as_mut() {
                upload.drain();
            }
            arm.program_alive(token).is_ok() && arm.sample.report.version == VERSION
        });
        self.upload = None;
        match ready {
            Err(UrError::NoAnswer { waited, .. }) => Err(UrError::NotStarted(waited)),
            other => other,
        }
    }

    /// Lets the arm come to rest at its set-point, then has the sensor zeroed.
    pub(super) fn zero_sensor(&mut self) -> Result<(), UrError> {
        if self.token.is_none() {
            return Err(UrError::ReadOnly);
        }
        if self.halted {
            return Err(UrError::Stopped);
        }
        self.wait(REST_TIMEOUT, "come to rest", Self::is_at_rest).map_err(|error| match error {
            UrError::NoAnswer { waited, .. } => {
                UrError::Moving { speed: self.sample.dq().amax(), waited, what: "a tare" }
            }
            other => other,
        })?;
        let before = self.sample.report.tares;
        (self.mode, self.q_goal) = (Mode::Tare, None);
        let done =
            self.wait(TARE_TIMEOUT, "zero the sensor", |arm| arm.sample.report.tares != before);
        self.mode = Mode::Idle;
        done?;
        self.wait(REST_TIMEOUT, "come to rest", |arm| {
            arm.sample.report.status == Status::Idle && arm.is_at_rest()
        })
    }

    fn is_at_rest(&mut self) -> bool {
        self.sample.dq().iter().all(|speed| speed.abs() < AT_REST)
    }

    /// Keeps sending the mode in force until `done`.
    fn wait(
        &mut self,
        timeout: Duration,
        what: &'static str,
        mut done: impl FnMut(&mut Self) -> bool,
    ) -> Result<(), UrError> {
        let deadline = Instant::now() + timeout;
        loop {
            self.send()?;
            self.receive(PATIENCE.max(self.config.stale()))?;
            judge::able(&self.sample)?;
            if done(self) {
                self.echo.forgive();
                // The sample of that command is read: the next read needs another.
                self.wrote = false;
                return Ok(());
            }
            if Instant::now() >= deadline {
                let status = self.sample.report.status;
                return Err(UrError::NoAnswer { what, waited: timeout, status });
            }
        }
    }
}

/// A number that no earlier program on this controller is likely to have used, and never 0, which the
/// registers hold at first.
fn fresh_token() -> i32 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let mixed = (since.as_nanos() as u64 ^ u64::from(std::process::id()) << 32)
        .wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (mixed >> 33) as i32 | 1
}
