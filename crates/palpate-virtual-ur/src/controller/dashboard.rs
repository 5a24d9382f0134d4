//! The dashboard server's commands: one line in, one line out.

use palpate_ur::proto::{RobotMode, RuntimeState, SafetyStatus};

use super::cycle::Controller;
use super::program::Severity;

/// What a new connection is greeted with.
pub const GREETING: &str = "Connected: Universal Robots Dashboard Server";

/// An answer, and whether the connection ends with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Without the newline.
    pub text: String,
    /// After `quit` and `shutdown`.
    pub close: bool,
}

impl Controller {
    /// Carries out one dashboard command.
    ///
    /// The answer comes before the state changes, as on the robot: a client must poll.
    pub fn dashboard(&mut self, line: &str) -> Answer {
        let line = line.trim();
        let close = matches!(line, "quit" | "exit" | "shutdown");
        Answer { text: self.command(line), close }
    }

    fn command(&mut self, line: &str) -> String {
        let failed = || format!("Failed to execute: {line}");
        if let Some(answer) = self.question(line) {
            return answer;
        }
        if let Some(text) = line.strip_prefix("popup ") {
            self.popup = Some(text.to_owned());
            return "showing popup".into();
        }
        if let Some(text) = line.strip_prefix("addToLog ") {
            self.note(Severity::Info, format!("log: {text}"));
            return "Added log message".into();
        }
        if matches!(line, "quit" | "exit") {
            return "Disconnected".into();
        }
        // What follows changes something: in local control only the pendant may.
        let acts = [
            "power on",
            "power off",
            "brake release",
            "unlock protective stop",
            "close safety popup",
            "close popup",
            "restart safety",
            "play",
            "pause",
            "stop",
            "shutdown",
            "saveLog",
            "clear operational mode",
        ];
        let loads = ["load ", "set operational mode "];
        if !acts.contains(&line) && !loads.iter().any(|p| line.starts_with(p)) {
            return format!("could not understand: '{line}'");
        }
        if !self.remote_control && !matches!(line, "close popup" | "close safety popup") {
            return failed();
        }
        match line {
            "power on" if self.power_on(false) => "Powering on".into(),
            "brake release" if self.power_on(true) => "Brake releasing".into(),
            "power off" => {
                self.power_off();
                "Powering off".into()
            }
            "unlock protective stop" => match self.unlock() {
                Ok(()) => "Protective stop releasing".into(),
                Err(reason) if reason.starts_with("Cannot") => reason,
                Err(_) => failed(),
            },
            "close safety popup" => "closing safety popup".into(),
            "close popup" => {
                if self.popup.take().is_some() && self.runtime == RuntimeState::Paused {
                    self.resume_program();
                }
                "closing popup".into()
            }
            "restart safety" => {
                self.restart_safety();
                "Restarting safety".into()
            }
            "play" if self.play() => "Starting program".into(),
            "pause" if self.pause_program() => "Pausing program".into(),
            "stop" if self.runtime != RuntimeState::Stopped => {
                self.stop_program("stopped from the dashboard");
                "Stopped".into()
            }
            "saveLog" => "Log saved to disk".into(),
            "shutdown" => {
                self.power_off();
                "Shutting down".into()
            }
            "clear operational mode" => {
                self.operational_mode = None;
                "No longer controlling the operational mode. Current operational mode: NONE".into()
            }
            _ => self.load_or_mode(line).unwrap_or_else(failed),
        }
    }

    fn load_or_mode(&mut self, line: &str) -> Option<String> {
        if let Some(mode) = line.strip_prefix("set operational mode ") {
            let mode =
                ["MANUAL", "AUTOMATIC"].into_iter().find(|m| m.eq_ignore_ascii_case(mode))?;
            self.operational_mode = Some(mode);
            return Some(format!("Operational mode {mode} is set"));
        }
        if let Some(name) = line.strip_prefix("load installation ") {
            return Some(format!("Loading installation: {name}"));
        }
        let name = line.strip_prefix("load ")?;
        let file = name.rsplit('/').next().unwrap_or(name);
        let Some(text) = self.config.programs.get(file) else {
            return Some(format!("File not found: {name}"));
        };
        if crate::script::compile(text).is_err() {
            return Some(format!("Error while loading program: {name}"));
        }
        self.stop_program("another program was loaded");
        self.loaded = Some(file.to_owned());
        Some(format!("Loading program: {name}"))
    }

    fn play(&mut self) -> bool {
        if self.runtime == RuntimeState::Paused {
            return self.resume_program();
        }
        let text = self.loaded.as_ref().and_then(|name| self.config.programs.get(name)).cloned();
        text.is_some_and(|text| self.start(&text))
    }

    fn question(&self, line: &str) -> Option<String> {
        let program = self.loaded.as_deref().unwrap_or_default();
        Some(match line {
            "robotmode" => format!("Robotmode: {}", self.robot_mode),
            "safetymode" | "safetystatus" => {
                let name = if line == "safetymode" { "Safetymode" } else { "Safetystatus" };
                format!("{name}: {}", self.safety)
            }
            "running" => format!("Program running: {}", self.runtime == RuntimeState::Playing),
            "programState" => {
                let state = match self.runtime {
                    RuntimeState::Playing => "PLAYING",
                    RuntimeState::Paused => "PAUSED",
                    _ => "STOPPED",
                };
                let running = self.machine.as_ref().map_or(program, |m| m.name());
                format!("{state} {running}").trim_end().to_owned()
            }
            "get loaded program" if program.is_empty() => "No program loaded".into(),
            "get loaded program" => format!("Loaded program: /programs/{program}"),
            "isProgramSaved" => format!("true {program}").trim_end().to_owned(),
            "PolyscopeVersion" => format!("URSoftware {} (Jan 01 2024)", self.config.version),
            "version" => self.config.version.to_string(),
            "is in remote control" => self.remote_control.to_string(),
            "get serial number" => self.config.serial_number.clone(),
            "get robot model" => self.config.model.name().trim_end_matches('e').to_owned(),
            "get operational mode" => self.operational_mode.unwrap_or("NONE").into(),
            _ => return None,
        })
    }

    /// `robot_status_bits`: power, program, teach button, power button.
    pub(crate) fn robot_status_bits(&self) -> u32 {
        let powered =
            matches!(self.robot_mode, RobotMode::Idle | RobotMode::Running | RobotMode::PowerOn);
        u32::from(powered) | u32::from(self.runtime == RuntimeState::Playing) << 1
    }

    /// `safety_status_bits`.
    pub(crate) fn safety_status_bits(&self) -> u32 {
        const STOPPED: u32 = 1 << 10;
        match self.safety {
            SafetyStatus::Normal => 1,
            SafetyStatus::Reduced => 1 << 1,
            SafetyStatus::ProtectiveStop => 1 << 2 | STOPPED,
            SafetyStatus::Recovery => 1 << 3,
            SafetyStatus::SafeguardStop => 1 << 4 | STOPPED,
            SafetyStatus::SystemEmergencyStop => 1 << 5 | 1 << 7 | STOPPED,
            SafetyStatus::RobotEmergencyStop => 1 << 6 | 1 << 7 | STOPPED,
            SafetyStatus::Violation => 1 << 8 | STOPPED,
            SafetyStatus::Fault => 1 << 9 | STOPPED,
            _ => STOPPED,
        }
    }
}
