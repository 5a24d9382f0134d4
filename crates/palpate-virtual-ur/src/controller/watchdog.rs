//! `rtde_set_watchdog`: a program's demand that a client keeps writing.

use super::registers::Registers;
use super::ticks;

/// What happens when the client falls silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WatchdogAction {
    /// Nothing.
    Ignore,
    /// The program is paused.
    Pause,
    /// The program is stopped.
    Stop,
}

#[derive(Clone, Debug)]
pub(crate) struct Watchdog {
    variable: String,
    within: u64,
    action: WatchdogAction,
    armed: u64,
}

impl Watchdog {
    pub(crate) fn new(
        variable: &str,
        frequency: f64,
        action: &str,
        now: u64,
    ) -> Result<Self, String> {
        #[expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN is no frequency")]
        if !(frequency > 0.0) {
            return Err(format!("a frequency of {frequency} Hz"));
        }
        let action = match action {
            "ignore" => WatchdogAction::Ignore,
            "pause" => WatchdogAction::Pause,
            "stop" => WatchdogAction::Stop,
            other => return Err(format!("{other:?} is not ignore, pause or stop")),
        };
        if !crate::rtde::is_input(variable) {
            return Err(format!("{variable} is no RTDE input"));
        }
        Ok(Self {
            variable: variable.to_owned(),
            within: ticks(1.0 / frequency),
            action,
            armed: now,
        })
    }

    pub(crate) fn variable(&self) -> &str {
        &self.variable
    }

    /// The action, if the variable has been silent for too long.
    pub(crate) fn check(&mut self, registers: &Registers, now: u64) -> Option<WatchdogAction> {
        let last = registers.last_write(&self.variable).unwrap_or(0).max(self.armed);
        if now.saturating_sub(last) <= self.within {
            return None;
        }
        // Once per silence.
        self.armed = now;
        Some(self.action)
    }
}
