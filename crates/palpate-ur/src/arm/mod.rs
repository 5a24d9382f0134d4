//! The arm as a [`RobotBackend`].

mod judge;
mod operator;
mod program;
mod stats;

use std::time::{Duration, Instant};

use palpate_robot_io::{JointCommand, RobotBackend, RobotState};
use palpate_spatial::JointVector;

pub use operator::Operator;
pub use stats::LinkStats;

use crate::proto::{ControllerVersion, Level, Setup, Value};
use crate::registers::{self, Mode, SEQUENCE_END};
use crate::script::Upload;
use crate::{RtdeClient, Sample, UrConfig, UrError};
use judge::Echo;

/// The oldest controller with the upper registers.
const OLDEST: ControllerVersion = ControllerVersion { major: 5, minor: 3, bugfix: 0, build: 0 };
/// A controller that has run for less may restart its RTDE server once, s.
const BOOT: f64 = 40.0;
/// Pause before connecting again, doubled every time up to [`PAUSE_MAX`].
const PAUSE: Duration = Duration::from_millis(100);
const PAUSE_MAX: Duration = Duration::from_secs(5);

/// A UR arm driven through RTDE and this crate's control program.
///
/// One thread calls [`read`](RobotBackend::read) and [`write`](RobotBackend::write); `read` waits for the
/// controller's packet, which paces the loop, and nothing else ever waits. Neither takes anything from the
/// heap.
///
/// # When something goes wrong
///
/// `read` says so in the same tick, the control program is told to brake, and commands are refused until
/// [`recover`](RobotBackend::recover) succeeds; nothing moves again by itself. If the controller cannot be
/// told, its program brakes by itself after [`stall_ticks`](UrConfig::stall_ticks) cycles without a packet.
/// After a stop of the safety system `recover` also needs a person: see [`Operator`].
///
/// A `read` without a `write` since the last one repeats the last set-point, so that the arm comes to rest
/// there. A thread that stops reading stops the arm.
#[derive(Debug)]
pub struct UrArm {
    config: UrConfig,
    client: Option<RtdeClient>,
    upload: Option<Upload>,
    /// Of the control program; `None` where the connection only reads.
    token: Option<i32>,
    sample: Sample,
    arrived: Instant,
    mode: Mode,
    sequence: i32,
    q_goal: Option<JointVector>,
    wrote: bool,
    unsent: u32,
    echo: Echo,
    /// Samples in a row with the same wrench.
    frozen: u32,
    halted: bool,
    /// The halt is the safety system's.
    unsafe_halt: bool,
    operator: Operator,
    stats: LinkStats,
}

impl UrArm {
    /// Connects, loads the control program and waits until it reports. The arm does not move.
    ///
    /// # Errors
    ///
    /// Whatever is not as it must be, with what to do: see [`UrError`].
    pub fn connect(config: UrConfig) -> Result<Self, UrError> {
        let mut arm = Self::open(config, true)?;
        arm.recover()?;
        Ok(arm)
    }

    /// Connects to look only: loads no program, takes no inputs, works in every mode. Commands are refused.
    pub fn observe(config: UrConfig) -> Result<Self, UrError> {
        Self::open(config, false)
    }

    fn open(config: UrConfig, control: bool) -> Result<Self, UrError> {
        config.validate()?;
        let (client, sample) = open_patiently(&config, control)?;
        Ok(Self {
            token: control.then_some(0),
            client: Some(client),
            upload: None,
            sample,
            arrived: Instant::now(),
            mode: Mode::Idle,
            sequence: 0,
            q_goal: None,
            wrote: false,
            unsent: 0,
            echo: Echo::default(),
            frozen: 0,
            halted: control,
            unsafe_halt: false,
            operator: Operator::default(),
            stats: LinkStats::default(),
            config,
        })
    }

    /// The newest packet, whole.
    pub fn sample(&self) -> &Sample {
        &self.sample
    }

    /// Time since the newest packet was read. Data that is older than a few periods says where the arm
    /// was, not where it is.
    pub fn age(&self) -> Duration {
        self.arrived.elapsed()
    }

    /// When the newest packet was there to be read: what a tick costs counts from here. `None` without a connection.
    pub fn woken(&self) -> Option<Instant> {
        self.client.as_ref().map(RtdeClient::woken)
    }

    /// What the link has done so far.
    pub fn stats(&self) -> LinkStats {
        self.stats
    }

    /// The settings in force.
    pub fn config(&self) -> &UrConfig {
        &self.config
    }

    /// The controller's software; `None` without a connection.
    pub fn controller(&self) -> Option<ControllerVersion> {
        self.client.as_ref().map(RtdeClient::controller)
    }

    /// How a person acknowledges a stop of the safety system. Take it before the arm is wrapped.
    pub fn operator(&self) -> Operator {
        self.operator.clone()
    }

    /// Texts that the controller has sent since the last call.
    pub fn take_texts(&mut self) -> Vec<(Level, String)> {
        self.client.as_mut().map(RtdeClient::take_texts).unwrap_or_default()
    }

    /// One tick: keep the program fed, wait for a newer sample, judge it.
    fn tick(&mut self) -> Result<(), UrError> {
        if !std::mem::replace(&mut self.wrote, false) && self.token.is_some() {
            self.send()?;
        }
        self.receive(self.config.stale())?;
        self.judge()
    }

    /// Waits for a sample that is newer than the last one.
    fn receive(&mut self, patience: Duration) -> Result<(), UrError> {
        let client = self.client.as_mut().ok_or(UrError::NotConnected)?;
        let deadline = Instant::now() + patience;
        let mut newest = self.sample;
        let (mut fresh, mut back, mut unsafe_on_the_way) = (0_u64, None, None);
        let stats = &mut self.stats;
        while fresh == 0 {
            let count = client.receive(deadline, |record| {
                let sample = Sample::read(&record);
                let step = sample.timestamp - newest.timestamp;
                if step > 0.0 {
                    stats.missed +=
                        ((step * self.config.frequency).round() as u64).saturating_sub(1);
                    fresh += 1;
                    if !judge::is_safe(&sample) {
                        unsafe_on_the_way = Some(sample.safety);
                    }
                    newest = sample;
                } else if step == 0.0 {
                    stats.duplicates += 1;
                } else {
                    back = Some((newest.timestamp, sample.timestamp));
                }
            })?;
            if let Some((from, to)) = back {
                return Err(UrError::ClockBack { from, to });
            }
            if count == 0 {
                return Err(UrError::Stalled { waited: patience });
            }
        }
        stats.samples += fresh;
        stats.skipped += fresh - 1;
        let same = judge::same_wrench(&self.sample, &newest, self.config.force_point);
        self.frozen = if same { self.frozen + 1 } else { 0 };
        self.sample = newest;
        self.arrived = Instant::now();
        if Some(newest.report.token) == self.token {
            self.echo.see(newest.report.sequence, stats);
        }
        // A stop that is over by now was still a stop.
        unsafe_on_the_way
            .map_or(Ok(()), |status| Err(UrError::Safety(status)))
            .or_else(|error| if self.token.is_some() { Err(error) } else { Ok(()) })
    }

    /// Sends the mode and set-point in force under a new sequence number, without waiting.
    fn send(&mut self) -> Result<(), UrError> {
        let (Some(client), Some(token)) = (self.client.as_mut(), self.token) else {
            return Err(UrError::NotConnected);
        };
        self.sequence = (self.sequence + 1) % SEQUENCE_END;
        let q = self.q_goal.unwrap_or_else(JointVector::zeros);
        // In the order in which the control program adds.
        let check = q.iter().fold(f64::from(self.sequence), |sum, x| sum + x);
        let mut values = [Value::Double(check); 10];
        values[0] = Value::Int32(self.mode as i32);
        values[1] = Value::Int32(self.sequence);
        values[2] = Value::Int32(token);
        for (value, x) in values[3..9].iter_mut().zip(q.iter()) {
            *value = Value::Double(*x);
        }
        if client.write(0, &values)? {
            self.unsent = 0;
            self.stats.sent += 1;
        } else {
            self.unsent += 1;
            self.stats.unsent += 1;
            if self.unsent >= self.config.stale_ticks {
                return Err(UrError::SendBlocked { ticks: self.unsent });
            }
        }
        Ok(())
    }

    /// Brakes and refuses commands from here on.
    fn halt(&mut self, error: &UrError) {
        if let UrError::Safety(status) = error {
            self.unsafe_halt = true;
            self.operator.require(*status);
        }
        if error.ends_link() {
            // Closing the socket also frees our registers for the next connection.
            self.client = None;
        }
        self.brake();
    }

    fn brake(&mut self) {
        self.halted = true;
        self.q_goal = None;
        self.mode = Mode::Stop;
        // If this does not arrive, the control program brakes by itself.
        if self.token.is_some() && self.send().is_ok() {
            self.wrote = true;
        }
    }

    fn state(&self) -> RobotState {
        RobotState {
            time: self.sample.timestamp,
            q: self.sample.q(),
            dq: self.sample.dq(),
            q_target: self.q_goal.unwrap_or_else(|| self.sample.target_q.into()),
            sensor_wrench: self.sample.wrench(self.config.force_point),
        }
    }
}

impl RobotBackend for UrArm {
    type Error = UrError;

    fn period(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.config.frequency)
    }

    fn read(&mut self) -> Result<RobotState, UrError> {
        match self.tick() {
            Ok(()) => Ok(self.state()),
            Err(error) => {
                self.halt(&error);
                Err(error)
            }
        }
    }

    fn write(&mut self, command: &JointCommand) -> Result<(), UrError> {
        if self.token.is_none() {
            return Err(UrError::ReadOnly);
        }
        if self.halted {
            return Err(UrError::Stopped);
        }
        let q = command.q;
        if !q.iter().all(|x| x.is_finite()) {
            return Err(UrError::NotFinite(q));
        }
        let (from, limits) = match self.q_goal {
            Some(goal) => (goal, self.config.step_max()),
            None => (self.sample.q(), [self.config.first_step_max; 6]),
        };
        for (joint, limit) in limits.into_iter().enumerate() {
            let step = (q[joint] - from[joint]).abs();
            if step > limit {
                return Err(UrError::Step { joint, step, limit });
            }
        }
        self.q_goal = Some(q);
        self.mode = Mode::Servo;
        self.wrote = true;
        self.send().inspect_err(|error| self.halt(error))
    }

    fn stop(&mut self) -> Result<(), UrError> {
        self.brake();
        Ok(())
    }

    /// Connects again if need be, loads the control program again if it no longer runs, and waits until
    /// the arm is at rest and ready. The first command after it must be near the measured joints.
    fn recover(&mut self) -> Result<(), UrError> {
        self.ready().inspect_err(|error| self.halt(error))
    }

    fn tare(&mut self) -> Result<(), UrError> {
        self.zero_sensor().inspect_err(|error| self.halt(error))
    }
}

/// Commands to end: one is consumed by coming to rest, one by ending, one may be lost.
const END_CYCLES: u32 = 3;

impl Drop for UrArm {
    /// Ends the control program; it brakes first.
    fn drop(&mut self) {
        if self.token.is_some() {
            self.mode = Mode::End;
            // A socket closed with unread data resets the connection, and the last command with it: hence the reads.
            for _ in 0..END_CYCLES {
                let _ = self.send();
                let _ = self.receive(self.config.stale());
            }
        }
    }
}

/// Connects, again and again while the controller is away or still holds our registers.
fn open_patiently(config: &UrConfig, control: bool) -> Result<(RtdeClient, Sample), UrError> {
    let mut pause = PAUSE;
    let mut attempt = 1;
    loop {
        match open_once(config, control) {
            Err(error) if attempt < config.attempts && (error.is_in_use() || error.is_away()) => {
                std::thread::sleep(pause);
                pause = (pause * 2).min(PAUSE_MAX);
                attempt += 1;
            }
            other => return other,
        }
    }
}

fn open_once(config: &UrConfig, control: bool) -> Result<(RtdeClient, Sample), UrError> {
    let timeout = Duration::from_secs_f64(config.answer_timeout);
    let inputs = [registers::MODE, registers::SEQUENCE, registers::TOKEN]
        .map(|n| format!("input_int_register_{n}"))
        .into_iter()
        .chain(
            (registers::SET_POINT..=registers::CHECK).map(|n| format!("input_double_register_{n}")),
        );
    let mut client = RtdeClient::connect(
        &config.host,
        config.ports.rtde,
        Setup {
            frequency: config.frequency,
            outputs: Sample::outputs(),
            inputs: if control { vec![inputs.collect()] } else { vec![] },
            timeout,
        },
    )?;
    if client.controller() < OLDEST {
        return Err(UrError::TooOld(client.controller()));
    }
    Sample::check(client.outputs())?;
    let mut sample = None;
    let first = Instant::now();
    loop {
        if client
            .receive(Instant::now() + timeout, |record| sample = Some(Sample::read(&record)))?
            == 0
        {
            return Err(UrError::Stalled { waited: timeout });
        }
        if let Some(sample) = sample
            && (sample.timestamp >= BOOT || first.elapsed().as_secs_f64() >= config.boot_settle)
        {
            return Ok((client, sample));
        }
    }
}
