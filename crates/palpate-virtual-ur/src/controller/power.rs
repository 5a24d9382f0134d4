//! Power, brakes, stops and their release.

use palpate_ur::proto::{RobotMode, SafetyStatus};

use super::cycle::Controller;
use super::program::Severity;
use super::protection::StopCause;
use super::ticks;

impl Controller {
    /// A protective stop: the arm decelerates, the program ends, and nothing but a person's unlock undoes it.
    pub fn protective_stop(&mut self, cause: StopCause) {
        if !matches!(
            self.safety,
            SafetyStatus::Normal | SafetyStatus::Reduced | SafetyStatus::SafeguardStop
        ) {
            return;
        }
        self.safety = SafetyStatus::ProtectiveStop;
        self.stopped_at = self.tick;
        self.protective_stops += 1;
        self.stop_program("protective stop");
        self.note(Severity::Error, cause.to_string());
        self.last_stop = Some(cause);
    }

    /// An emergency stop: the arm decelerates and loses its power.
    pub fn emergency_stop(&mut self) {
        if matches!(self.safety, SafetyStatus::RobotEmergencyStop | SafetyStatus::Fault) {
            return;
        }
        self.safety = SafetyStatus::RobotEmergencyStop;
        self.stop_program("emergency stop");
        self.note(Severity::Error, "Emergency stop");
        self.powering = None;
        if self.robot_mode != RobotMode::Disconnected {
            self.robot_mode = RobotMode::PowerOff;
        }
    }

    /// The emergency stop button is pulled out again; the power stays off.
    pub fn release_emergency_stop(&mut self) {
        if self.safety == SafetyStatus::RobotEmergencyStop {
            self.safety = SafetyStatus::Normal;
            self.note(Severity::Info, "Emergency stop released");
        }
    }

    /// A light curtain or a door: the program pauses.
    pub fn safeguard_stop(&mut self) {
        if matches!(self.safety, SafetyStatus::Normal | SafetyStatus::Reduced) {
            self.safety = SafetyStatus::SafeguardStop;
            self.pause_program();
            self.brake();
            self.note(Severity::Warning, "Safeguard stop");
        }
    }

    /// The safeguard is closed and reset; the program stays paused until `play`.
    pub fn release_safeguard(&mut self) {
        if self.safety == SafetyStatus::SafeguardStop {
            self.safety = SafetyStatus::Normal;
            self.note(Severity::Info, "Safeguard reset");
        }
    }

    /// A fault of the safety system: only `restart safety` ends it.
    pub fn safety_fault(&mut self, what: &str) {
        self.safety = SafetyStatus::Fault;
        self.stop_program("safety fault");
        self.note(Severity::Error, format!("Safety fault: {what}"));
        self.powering = None;
        self.robot_mode = RobotMode::PowerOff;
    }

    /// What `unlock protective stop` does.
    ///
    /// # Errors
    /// Too early, or nothing to unlock.
    pub(crate) fn unlock(&mut self) -> Result<(), String> {
        if self.safety != SafetyStatus::ProtectiveStop {
            return Err("no protective stop".into());
        }
        if self.tick - self.stopped_at < ticks(self.config.delays.unlock) {
            return Err(format!(
                "Cannot unlock protective stop until {}s after occurrence. Always inspect cause of protective stop before unlocking",
                self.config.delays.unlock
            ));
        }
        self.safety = SafetyStatus::Normal;
        self.unlocks += 1;
        self.note(Severity::Info, "Protective stop unlocked");
        Ok(())
    }

    pub(crate) fn restart_safety(&mut self) {
        if matches!(self.safety, SafetyStatus::Fault | SafetyStatus::Violation) {
            self.safety = SafetyStatus::Normal;
        }
        self.stop_program("safety restart");
        self.restart_plant();
        self.powering = None;
        self.robot_mode = RobotMode::PowerOff;
    }

    pub(crate) fn power_off(&mut self) {
        self.stop_program("power off");
        self.powering = None;
        self.robot_mode = RobotMode::PowerOff;
    }

    /// Towards idle, or with the brakes released towards running; whether that is allowed now.
    pub(crate) fn power_on(&mut self, release_brakes: bool) -> bool {
        let barred = !matches!(
            self.safety,
            SafetyStatus::Normal | SafetyStatus::Reduced | SafetyStatus::Recovery
        );
        if barred {
            return false;
        }
        let delays = self.config.delays;
        let goal = if release_brakes { RobotMode::Running } else { RobotMode::Idle };
        match self.robot_mode {
            RobotMode::PowerOff => {
                let brakes = if release_brakes { delays.brake_release } else { 0.0 };
                self.robot_mode = RobotMode::Booting;
                self.powering = Some((self.tick + ticks(delays.power_on + brakes), goal));
            }
            RobotMode::Idle if release_brakes => {
                self.powering = Some((self.tick + ticks(delays.brake_release), goal));
            }
            RobotMode::Booting | RobotMode::PowerOn => {
                if let (Some((_, to)), true) = (&mut self.powering, release_brakes) {
                    *to = RobotMode::Running;
                }
            }
            _ => {}
        }
        true
    }

    /// Advances a power sequence.
    pub(crate) fn tick_power(&mut self) {
        if let Some((when, mode)) = self.powering
            && self.tick >= when
        {
            self.powering = None;
            self.robot_mode = mode;
        }
    }
}
