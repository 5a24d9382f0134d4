//! Programs: loading, running, pausing, stopping; and what happens on the way.

use palpate_ur::proto::{RobotMode, RuntimeState, SafetyStatus};

use super::cycle::Controller;
use super::motion::Motion;
use crate::script::{Machine, Status, compile};

/// How much an event matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Something happened.
    Info,
    /// Something was refused.
    Warning,
    /// The arm was stopped.
    Error,
}

/// Something that a person at the pendant would see.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// On the controller's clock, s.
    pub time: f64,
    /// How much it matters.
    pub severity: Severity,
    /// What happened.
    pub text: String,
}

/// Events kept for those who have not asked yet.
const EVENTS_MAX: usize = 1000;

impl Controller {
    pub(crate) fn note(&mut self, severity: Severity, text: impl Into<String>) {
        if self.events.len() == EVENTS_MAX {
            self.events.pop_front();
        }
        self.events.push_back(Event { time: self.time(), severity, text: text.into() });
    }

    /// Starts a program as a script port does: a running one ends first.
    ///
    /// A program that is wrong, or that comes while the arm is not ready, is dropped with an event.
    pub fn run_script(&mut self, text: &str) {
        if !self.remote_control {
            return self.note(Severity::Warning, "script refused: the robot is in local control");
        }
        self.start(text);
    }

    /// Starts a program; whether it runs now.
    pub(crate) fn start(&mut self, text: &str) -> bool {
        if let Some(reason) = self.not_ready() {
            self.note(Severity::Warning, format!("script refused: {reason}"));
            return false;
        }
        match compile(text) {
            Err(error) => {
                self.note(Severity::Error, format!("script refused: {error}"));
                false
            }
            Ok(program) if program.is_secondary() => {
                self.secondary.push(Machine::new(program));
                true
            }
            Ok(program) => {
                if self.machine.is_some() {
                    self.stop_program("another program was sent");
                }
                self.note(Severity::Info, format!("program {} started", program.name()));
                self.machine = Some(Machine::new(program));
                self.runtime = RuntimeState::Playing;
                true
            }
        }
    }

    /// Why no program can run now.
    pub(crate) fn not_ready(&self) -> Option<String> {
        if self.robot_mode != RobotMode::Running {
            return Some(format!("the robot is in mode {}", self.robot_mode));
        }
        match self.safety {
            SafetyStatus::Normal | SafetyStatus::Reduced => None,
            other => Some(format!("safety status {other}")),
        }
    }

    /// Ends the program and brings the arm to rest.
    pub fn stop_program(&mut self, reason: &str) {
        if self.machine.take().is_some() {
            self.note(Severity::Info, format!("program stopped: {reason}"));
        }
        self.secondary.clear();
        self.watchdogs.clear();
        self.interrupted = None;
        self.runtime = RuntimeState::Stopped;
        self.brake();
    }

    /// Stops the arm and keeps the program.
    pub fn pause_program(&mut self) -> bool {
        if self.runtime != RuntimeState::Playing {
            return false;
        }
        self.runtime = RuntimeState::Paused;
        self.interrupted = Some(std::mem::replace(&mut self.motion, Motion::Hold));
        self.brake();
        true
    }

    /// Goes on after a pause.
    pub(crate) fn resume_program(&mut self) -> bool {
        if self.runtime != RuntimeState::Paused || self.not_ready().is_some() {
            return false;
        }
        self.runtime = RuntimeState::Playing;
        self.motion = self.interrupted.take().unwrap_or(Motion::Hold);
        self.motion.restart();
        true
    }

    /// Decelerates as fast as the limits say, from whatever the arm is doing.
    pub(crate) fn brake(&mut self) {
        self.motion = Motion::brake(self.config.limits.stop_deceleration);
    }

    /// One cycle of the program and of what runs beside it.
    pub(crate) fn run_programs(&mut self) {
        let mut secondary = std::mem::take(&mut self.secondary);
        secondary.retain_mut(|machine| match machine.tick(self) {
            Ok(Status::Running) => true,
            Ok(Status::Finished) => false,
            Err(error) => {
                self.note(
                    Severity::Error,
                    format!("secondary program {}: {error}", machine.name()),
                );
                false
            }
        });
        // What a secondary program started meanwhile does not exist; keep what is left.
        self.secondary = secondary;
        if self.runtime != RuntimeState::Playing {
            return;
        }
        let Some(mut machine) = self.machine.take() else { return };
        self.control_line = machine.line();
        match machine.tick(self) {
            // A protective stop or a popup inside the tick has ended or paused it.
            Ok(Status::Running) if self.runtime == RuntimeState::Stopped => {}
            Ok(Status::Running) => self.machine = Some(machine),
            Ok(Status::Finished) => {
                self.machine = Some(machine);
                self.stop_program("it came to its end");
            }
            Err(error) => {
                self.note(Severity::Error, format!("program {}: {error}", machine.name()));
                self.machine = Some(machine);
                self.stop_program("it had an error");
            }
        }
    }
}
