//! Where the time of a training goes.

use std::fmt::{Display, Formatter};
use std::time::{Duration, Instant};

use palpate_robot_io::{JointCommand, RobotBackend, RobotState};
use palpate_runs::Console;
use serde::Serialize;

/// Time by what it was spent on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Profile {
    /// The simulated world: physics, arm and sensor, on the way to the start as well.
    pub(crate) simulation: Duration,
    /// Force controller, fail-safe layer, observation and reward.
    pub(crate) control: Duration,
    /// Choosing actions.
    pub(crate) inference: Duration,
    /// Remembering a step and learning from others.
    pub(crate) update: Duration,
    /// Tables, ledger and the line on the screen.
    pub(crate) logging: Duration,
    /// Frozen starts of the evaluations, recordings included.
    pub(crate) evaluation: Duration,
    /// Checkpoints.
    pub(crate) checkpoints: Duration,
}

impl Profile {
    /// The parts by name, s.
    pub(crate) fn parts(&self) -> [(&'static str, f64); 7] {
        [
            ("simulation", self.simulation),
            ("control", self.control),
            ("inference", self.inference),
            ("update", self.update),
            ("logging", self.logging),
            ("evaluation", self.evaluation),
            ("checkpoints", self.checkpoints),
        ]
        .map(|(name, time)| (name, time.as_secs_f64()))
    }

    /// A table of the parts of a training of so many steps that took `seconds`.
    pub(crate) fn show(&self, console: &mut Console, steps: u64, seconds: f64) {
        let known: f64 = self.parts().iter().map(|(_, s)| s).sum();
        let rest = ("the rest", seconds - known);
        let rows: Vec<(&str, String)> = self
            .parts()
            .into_iter()
            .chain([rest, ("all", seconds)])
            .map(|(name, s)| (name, Row { s, share: s / seconds, steps }.to_string()))
            .collect();
        let rows: Vec<_> =
            std::iter::once(("time spent on", "   total   share   each step".into()))
                .chain(rows)
                .collect();
        console.table(&rows);
    }
}

impl Serialize for Profile {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_map(self.parts())
    }
}

struct Row {
    s: f64,
    share: f64,
    steps: u64,
}

impl Display for Row {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let each = 1e3 * self.s / self.steps.max(1) as f64;
        write!(f, "{:>6.1} s {:>5.1} % {each:>8.3} ms", self.s, 100.0 * self.share)
    }
}

/// A clock for what follows each other.
#[derive(Debug)]
pub(crate) struct Laps(Instant);

impl Laps {
    pub(crate) fn begin() -> Self {
        Self(Instant::now())
    }

    /// Time since the last call, or the beginning.
    pub(crate) fn lap(&mut self) -> Duration {
        let now = Instant::now();
        now - std::mem::replace(&mut self.0, now)
    }
}

/// A backend that knows how long it was at work.
#[derive(Debug)]
pub(crate) struct Timed<B> {
    backend: B,
    spent: Duration,
}

impl<B> Timed<B> {
    pub(crate) fn new(backend: B) -> Self {
        Self { backend, spent: Duration::ZERO }
    }

    /// Time inside the backend so far.
    pub(crate) fn spent(&self) -> Duration {
        self.spent
    }

    fn timed<T>(&mut self, work: impl FnOnce(&mut B) -> T) -> T {
        let began = Instant::now();
        let result = work(&mut self.backend);
        self.spent += began.elapsed();
        result
    }
}

impl<B: RobotBackend> RobotBackend for Timed<B> {
    type Error = B::Error;
    fn period(&self) -> Duration {
        self.backend.period()
    }
    fn read(&mut self) -> Result<RobotState, B::Error> {
        self.timed(B::read)
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), B::Error> {
        self.timed(|backend| backend.write(command))
    }
    fn stop(&mut self) -> Result<(), B::Error> {
        self.timed(B::stop)
    }
    fn recover(&mut self) -> Result<(), B::Error> {
        self.timed(B::recover)
    }
    fn tare(&mut self) -> Result<(), B::Error> {
        self.timed(B::tare)
    }
    fn rebuild(&mut self) -> bool {
        self.timed(B::rebuild)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_robot_io::IdealArm;

    #[test]
    fn a_timed_backend_passes_the_contract_and_counts() {
        let mut arm = Timed::new(IdealArm::at([0.0, -1.57, 1.57, -1.57, -1.57, 0.0].into()));
        for _ in 0..100 {
            let q = arm.read().unwrap().q;
            arm.write(&JointCommand { q }).unwrap();
        }
        assert!(arm.spent() > Duration::ZERO);
        palpate_robot_io::contract::check(&mut arm).unwrap();
    }

    #[test]
    fn parts_have_names_in_the_summary() {
        let profile = Profile { update: Duration::from_millis(1500), ..Profile::default() };
        let json = serde_json::to_value(profile).unwrap();
        assert_eq!(json["update"], 1.5);
        assert_eq!(json.as_object().unwrap().len(), 7);
    }
}
