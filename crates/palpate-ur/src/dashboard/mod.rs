//! The dashboard server: power, brakes, queries. Never part of the control path.
//!
//! A line of text per command, a line per reply. The reply comes before the state changes, so every
//! command that changes something polls until it has.

mod command;
mod lines;

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

pub use command::{Command, PolyScope};
pub use lines::Lines;

use crate::UrError;
use crate::link::connect;
use crate::proto::{RobotMode, SafetyStatus};

/// What the server says first.
const GREETING: &str = "Connected: Universal Robots Dashboard Server";
const GREETING_TIMEOUT: Duration = Duration::from_secs(10);
const REPLY_TIMEOUT: Duration = Duration::from_secs(2);
const POLL: Duration = Duration::from_millis(100);

/// A person's word for one unlock of a protective stop.
///
/// The manufacturer prohibits automatic resets. Make one per key press of a person who has found the
/// cause, never in a loop.
#[derive(Debug)]
pub struct Confirmation(());

impl Confirmation {
    /// Says that a person has looked at the arm and wants it unlocked.
    pub fn by_a_person_at_the_arm() -> Self {
        Self(())
    }
}

/// A connection to the dashboard server of an e-Series controller.
#[derive(Debug)]
pub struct Dashboard {
    stream: TcpStream,
    lines: Lines,
    version: PolyScope,
}

impl Dashboard {
    /// Connects, and asks for the version that decides which commands exist.
    pub fn connect(host: &str, port: u16, timeout: Duration) -> Result<Self, UrError> {
        let stream = connect("the dashboard", host, port, timeout)?;
        let mut dashboard = Self { stream, lines: Lines::default(), version: PolyScope(5, 0, 0) };
        let greeting = dashboard.line(GREETING_TIMEOUT)?;
        if greeting != GREETING {
            return Err(refused("the greeting", greeting));
        }
        let reply = dashboard.exchange("PolyscopeVersion")?;
        dashboard.version =
            PolyScope::parse(&reply).ok_or_else(|| refused("PolyscopeVersion", reply))?;
        Ok(dashboard)
    }

    /// The controller's PolyScope version.
    pub fn version(&self) -> PolyScope {
        self.version
    }

    /// Sends a command and returns its reply, if it is the documented one.
    pub fn ask(&mut self, command: &Command<'_>) -> Result<String, UrError> {
        let text = command.text();
        if self.version < command.since() {
            let reply = format!(
                "nothing: it needs PolyScope {}, this is {}",
                command.since(),
                self.version
            );
            return Err(refused(&text, reply));
        }
        let reply = self.exchange(&text)?;
        if command.accepts(&reply) { Ok(reply) } else { Err(refused(&text, reply)) }
    }

    /// Power and brakes.
    pub fn robot_mode(&mut self) -> Result<RobotMode, UrError> {
        let reply = self.ask(&Command::RobotMode)?;
        let name = reply.trim_start_matches("Robotmode: ");
        let known = RobotMode::KNOWN.iter().find(|mode| mode.to_string() == name);
        known.copied().ok_or_else(|| refused("robotmode", reply))
    }

    /// The safety system. Needs PolyScope 5.4.
    pub fn safety_status(&mut self) -> Result<SafetyStatus, UrError> {
        let reply = self.ask(&Command::SafetyStatus)?;
        let name = reply.trim_start_matches("Safetystatus: ");
        let known = SafetyStatus::KNOWN.iter().find(|status| status.to_string() == name);
        known.copied().ok_or_else(|| refused("safetystatus", reply))
    }

    /// Whether programs may be sent over the network. Needs PolyScope 5.6.
    pub fn is_in_remote_control(&mut self) -> Result<bool, UrError> {
        Ok(self.ask(&Command::IsInRemoteControl)? == "true")
    }

    /// Model and serial number. Needs PolyScope 5.6.
    pub fn identity(&mut self) -> Result<(String, String), UrError> {
        Ok((self.ask(&Command::RobotModel)?, self.ask(&Command::SerialNumber)?))
    }

    /// Powers the arm on and releases the brakes: it can move afterwards.
    pub fn power_on(&mut self, timeout: Duration) -> Result<(), UrError> {
        let deadline = Instant::now() + timeout;
        if self.robot_mode()? == RobotMode::Running {
            return Ok(());
        }
        self.ask(&Command::PowerOn)?;
        self.reach(deadline, timeout, &[RobotMode::Idle, RobotMode::Running])?;
        self.ask(&Command::BrakeRelease)?;
        self.reach(deadline, timeout, &[RobotMode::Running])
    }

    /// Applies the brakes and cuts the power.
    pub fn power_off(&mut self, timeout: Duration) -> Result<(), UrError> {
        self.ask(&Command::PowerOff)?;
        self.reach(Instant::now() + timeout, timeout, &[RobotMode::PowerOff])
    }

    /// Unlocks a protective stop for the person who confirmed it. The controller refuses in the first 5 s.
    pub fn unlock(&mut self, _by: Confirmation, timeout: Duration) -> Result<(), UrError> {
        self.ask(&Command::CloseSafetyPopup)?;
        self.ask(&Command::UnlockProtectiveStop)?;
        let deadline = Instant::now() + timeout;
        loop {
            let status = self.safety_status()?;
            if status == SafetyStatus::Normal {
                return self.reach(deadline, timeout, &[RobotMode::Running]);
            }
            if Instant::now() >= deadline {
                return Err(UrError::DashboardState {
                    what: "safety status",
                    want: SafetyStatus::Normal.to_string(),
                    got: status.to_string(),
                    waited: timeout,
                });
            }
            std::thread::sleep(POLL);
        }
    }

    fn reach(
        &mut self,
        deadline: Instant,
        timeout: Duration,
        aims: &[RobotMode],
    ) -> Result<(), UrError> {
        loop {
            let mode = self.robot_mode()?;
            if aims.contains(&mode) {
                return Ok(());
            }
            if Instant::now() >= deadline {
                let want: Vec<String> = aims.iter().map(ToString::to_string).collect();
                return Err(UrError::DashboardState {
                    what: "robot mode",
                    want: want.join(" or "),
                    got: mode.to_string(),
                    waited: timeout,
                });
            }
            std::thread::sleep(POLL);
        }
    }

    fn exchange(&mut self, text: &str) -> Result<String, UrError> {
        self.stream.set_write_timeout(Some(REPLY_TIMEOUT))?;
        self.stream.write_all(format!("{text}\n").as_bytes())?;
        self.line(REPLY_TIMEOUT)
    }

    fn line(&mut self, timeout: Duration) -> Result<String, UrError> {
        let deadline = Instant::now() + timeout;
        let mut bytes = [0; 1024];
        loop {
            if let Some(line) = self.lines.next_line() {
                return Ok(line);
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() || self.lines.is_overlong() {
                return Err(std::io::Error::from(ErrorKind::TimedOut).into());
            }
            self.stream.set_read_timeout(Some(left))?;
            match self.stream.read(&mut bytes) {
                Ok(0) => return Err(UrError::Closed),
                Ok(n) => self.lines.push(&bytes[..n]),
                Err(e)
                    if matches!(
                        e.kind(),
                        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                    ) => {}
                Err(e) => return Err(e.into()),
            }
        }
    }
}

fn refused(command: &str, reply: String) -> UrError {
    UrError::Dashboard { command: command.into(), reply }
}
