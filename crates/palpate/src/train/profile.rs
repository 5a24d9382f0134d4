//! Where the time of a training goes.

use std::fmt::{Display, Formatter};
use std::time::{Duration, Instant};

use palpate_robot_io::{JointCommand, RobotBackend, RobotState};
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
}

impl Serialize for Profile {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_map(self.parts())
    }
}

/// Where the time of a training went, since it was started or resumed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeSpent {
    pub(crate) profile: Profile,
    pub(crate) steps: u64,
    /// In all.
    pub(crate) seconds: f64,
}

impl Display for TimeSpent {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let parts = self.profile.parts();
        let known: f64 = parts.iter().map(|(_, s)| s).sum();
        writeln!(f, "{:<14}{:>10}{:>9}{:>14}", "time spent on", "total", "share", "each step")?;
        let rest = [("the rest", self.seconds - known), ("all", self.seconds)];
        for (name, s) in parts.into_iter().chain(rest) {
            let share = 100.0 * s / self.seconds;
            let each = 1e3 * s / self.steps.max(1) as f64;
            writeln!(f, "{name:<14}{s:>8.1} s{share:>7.1} %{each:>11.3} ms")?;
        }
        Ok(())
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
        let said = TimeSpent { profile, steps: 500, seconds: 6.0 }.to_string();
        assert!(said.contains("update             1.5 s   25.0 %      3.000 ms"), "{said}");
        assert!(said.contains("the rest           4.5 s   75.0 %"), "{said}");
    }
}
