//! What a tick of the control thread costs, and where cycles of the controller went that it did not see.

use std::time::{Duration, Instant};

use palpate_robot_io::{JointCommand, RobotBackend, RobotState};
use palpate_ur::{LinkStats, UrArm, UrError};

/// Cycles of the controller between reads that followed each other, by what became of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Account {
    /// By the controller's clock.
    pub(super) cycles: u64,
    /// Their sample was acted on.
    pub(super) read: u64,
    /// Overtaken by a newer one while this thread still worked on the last, or was interrupted in it.
    pub(super) own: u64,
    /// Overtaken before this thread woke.
    pub(super) late: u64,
    /// Never arrived.
    pub(super) missed: u64,
}

impl Account {
    /// Whether nothing is left over.
    pub(super) fn is_balanced(&self) -> bool {
        self.cycles == self.read + self.own + self.late + self.missed
    }

    /// A read after a tick that cost this much, and how many cycles have gone by since the last one; `missed` of
    /// them never arrived.
    fn add(&mut self, cost: Duration, period: Duration, cycles: u64, missed: u64) {
        let overtaken = cycles.saturating_sub(1 + missed);
        let own = overtaken.min((cost.as_secs_f64() / period.as_secs_f64()) as u64);
        self.cycles += cycles;
        self.read += 1;
        self.own += own;
        self.late += overtaken - own;
        self.missed += missed;
    }
}

/// An arm that keeps accounts.
#[derive(Debug)]
pub(super) struct Timed {
    arm: UrArm,
    /// From a sample that is there to the next wait, ns; one per tick, until it is full.
    costs: Vec<u32>,
    account: Account,
    last: Option<Last>,
}

#[derive(Clone, Copy, Debug)]
struct Last {
    woken: Instant,
    timestamp: f64,
    missed: u64,
}

impl Timed {
    /// Room for so many ticks is taken here.
    pub(super) fn new(arm: UrArm, ticks: usize) -> Self {
        Self { arm, costs: Vec::with_capacity(ticks), account: Account::default(), last: None }
    }

    pub(super) fn stats(&self) -> LinkStats {
        self.arm.stats()
    }

    /// The controller's clock, s.
    pub(super) fn clock(&self) -> f64 {
        self.arm.sample().timestamp
    }

    pub(super) fn account(&self) -> Account {
        self.account
    }

    /// Costs of all ticks, sorted, ns.
    pub(super) fn costs(&self) -> Vec<u32> {
        let mut costs = self.costs.clone();
        costs.sort_unstable();
        costs
    }

    fn take_in(&mut self, asked: Instant) {
        let Some(woken) = self.arm.woken() else { return };
        let now = Last { woken, timestamp: self.clock(), missed: self.stats().missed };
        if let Some(last) = self.last {
            let cost = asked.saturating_duration_since(last.woken);
            if self.costs.len() < self.costs.capacity() {
                self.costs.push(u32::try_from(cost.as_nanos()).unwrap_or(u32::MAX));
            }
            let period = self.arm.period();
            let cycles = ((now.timestamp - last.timestamp) / period.as_secs_f64()).round() as u64;
            self.account.add(cost, period, cycles, now.missed - last.missed);
        }
        self.last = Some(now);
    }

    /// What reads by itself interrupts the sequence.
    fn interrupted<T>(
        &mut self,
        job: impl FnOnce(&mut UrArm) -> Result<T, UrError>,
    ) -> Result<T, UrError> {
        self.last = None;
        job(&mut self.arm)
    }
}

impl RobotBackend for Timed {
    type Error = UrError;

    fn period(&self) -> Duration {
        self.arm.period()
    }

    fn read(&mut self) -> Result<RobotState, UrError> {
        let asked = Instant::now();
        match self.arm.read() {
            Ok(state) => {
                self.take_in(asked);
                Ok(state)
            }
            Err(e) => self.interrupted(|_| Err(e)),
        }
    }

    fn write(&mut self, command: &JointCommand) -> Result<(), UrError> {
        self.arm.write(command)
    }

    fn stop(&mut self) -> Result<(), UrError> {
        self.interrupted(UrArm::stop)
    }

    fn recover(&mut self) -> Result<(), UrError> {
        self.interrupted(UrArm::recover)
    }

    fn tare(&mut self) -> Result<(), UrError> {
        self.interrupted(UrArm::tare)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cycle_has_one_fate() {
        let (tick, ms) = (Duration::from_millis(2), Duration::from_millis);
        let mut account = Account::default();
        account.add(ms(0), tick, 1, 0);
        // 7 ms of work: three cycles went by in it, one before the wake-up; one was lost.
        account.add(ms(7), tick, 6, 1);
        // Little work, and two cycles late.
        account.add(ms(1), tick, 3, 0);
        assert_eq!(account, Account { cycles: 10, read: 3, own: 3, late: 3, missed: 1 });
        assert!(account.is_balanced());
        account.cycles += 1;
        assert!(!account.is_balanced());
    }
}
