//! What to do between a stop and the next try, and when to ask a person.
//!
//! ```text
//! brake → retreat → free-air check → tare → safe path ──ok──→ done
//!   ↑                    └─ not free in time ─→ ↑ │
//!   └───────────── tries left ─────────────── failed ── none left ──→ ask a person
//! ```
//!
//! A tool that cannot come free where it stands (a jam) skips the tare and is driven out along the safe
//! path, under the reset's force limits.

use palpate_spatial::Wrench;

use super::config::RecoveryConfig;

/// What the arm is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// Its set-point moves.
    Moving,
    /// It backs out of a contact after a force stop.
    Retreating,
    /// Its set-point rests.
    AtRest,
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Brake for a tick.
    Brake,
    /// Retreat for a tick.
    Retreat,
    /// Stand for a tick and watch the force.
    Watch,
    /// Zero the sensor.
    Tare,
    /// Drive the safe path to the start, and tell how it went.
    Path,
    /// At the start.
    Done,
    /// Stay at rest: a person must look.
    AskHuman,
}

/// What was seen since the last action.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// The arm.
    pub standing: Standing,
    /// Filtered contact wrench.
    pub wrench: Wrench,
    /// The force has been below its re-arm level for long enough.
    pub armed: bool,
    /// After [`Action::Path`]: whether the start was reached.
    pub arrived: bool,
}

/// The state machine. One [`step`](Self::step) per action.
#[derive(Clone, Debug)]
pub struct Recovery {
    config: RecoveryConfig,
    dt: f64,
    last: Option<Action>,
    tries: u32,
    calm: f64,
    waited: f64,
}

impl Recovery {
    /// After a force stop or a fault: begins with the brake. `dt` is the time of one tick, s.
    pub fn after_stop(config: RecoveryConfig, dt: f64) -> Self {
        Self { config, dt, last: None, tries: 0, calm: 0.0, waited: 0.0 }
    }

    /// After an ordinary end: begins with the safe path.
    pub fn after_rest(config: RecoveryConfig, dt: f64) -> Self {
        Self { last: Some(Action::Tare), ..Self::after_stop(config, dt) }
    }

    /// Tries of the path so far.
    pub fn tries(&self) -> u32 {
        self.tries
    }

    /// The next action.
    pub fn step(&mut self, seen: &Seen) -> Action {
        let next = match self.last {
            None | Some(Action::Brake | Action::Retreat) => self.come_to_rest(seen),
            Some(Action::Watch) => self.free_air(seen),
            Some(Action::Tare) => self.path(),
            Some(Action::Path) if seen.arrived => Action::Done,
            Some(Action::Path) => {
                (self.calm, self.waited) = (0.0, 0.0);
                self.come_to_rest(seen)
            }
            Some(Action::AskHuman) => Action::AskHuman,
            Some(Action::Done) => Action::Done,
        };
        self.last = Some(next);
        next
    }

    fn come_to_rest(&mut self, seen: &Seen) -> Action {
        match seen.standing {
            Standing::Moving => Action::Brake,
            Standing::Retreating => Action::Retreat,
            Standing::AtRest if self.tries >= self.config.tries => Action::AskHuman,
            Standing::AtRest => self.free_air(seen),
        }
    }

    fn free_air(&mut self, seen: &Seen) -> Action {
        let RecoveryConfig { free_air_force, free_air_torque, free_air_time, patience, .. } =
            self.config;
        let free = seen.wrench.force.norm() <= free_air_force
            && seen.wrench.torque.norm() <= free_air_torque;
        self.calm = if free { self.calm + self.dt } else { 0.0 };
        self.waited += self.dt;
        if self.calm >= free_air_time && seen.armed {
            Action::Tare
        } else if self.waited >= patience {
            self.path()
        } else {
            Action::Watch
        }
    }

    fn path(&mut self) -> Action {
        self.tries += 1;
        Action::Path
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_spatial::Vector3;

    const CONFIG: RecoveryConfig = RecoveryConfig {
        tries: 2,
        free_air_force: 3.0,
        free_air_torque: 0.3,
        free_air_time: 0.006,
        patience: 0.02,
    };

    fn seen(standing: Standing, force: f64, arrived: bool) -> Seen {
        let wrench = Wrench::new(Vector3::new(force, 0.0, 0.0), Vector3::zeros());
        Seen { standing, wrench, armed: true, arrived }
    }

    #[test]
    fn a_stop_goes_through_every_stage_in_order() {
        use Action as A;
        use Standing as S;
        let mut r = Recovery::after_stop(CONFIG, 0.002);
        let story = [
            (S::Moving, 30.0, A::Brake),
            (S::Moving, 30.0, A::Brake),
            (S::Retreating, 20.0, A::Retreat),
            (S::AtRest, 2.0, A::Watch),
            (S::AtRest, 5.0, A::Watch), // not free after all: the time starts anew
            (S::AtRest, 2.0, A::Watch),
            (S::AtRest, 2.0, A::Watch),
            (S::AtRest, 2.0, A::Tare),
            (S::AtRest, 0.0, A::Path),
        ];
        for (i, (standing, force, action)) in story.into_iter().enumerate() {
            assert_eq!(r.step(&seen(standing, force, false)), action, "line {i}");
        }
        assert_eq!(r.step(&seen(S::AtRest, 0.0, true)), A::Done);
        assert_eq!(r.step(&seen(S::AtRest, 0.0, true)), A::Done);
    }

    #[test]
    fn a_jam_is_driven_out_without_a_tare_and_a_person_is_asked_in_the_end() {
        let mut r = Recovery::after_stop(CONFIG, 0.002);
        let mut actions = Vec::new();
        for _ in 0..200 {
            actions.push(r.step(&seen(Standing::AtRest, 9.0, false)));
        }
        assert!(!actions.contains(&Action::Tare));
        assert_eq!(actions.iter().filter(|a| **a == Action::Path).count(), 2);
        assert_eq!(r.tries(), 2);
        assert_eq!(actions.last(), Some(&Action::AskHuman));
        assert_eq!(
            r.step(&seen(Standing::AtRest, 0.0, true)),
            Action::AskHuman,
            "and stays with it"
        );
    }

    #[test]
    fn an_ordinary_end_starts_with_the_path() {
        let mut r = Recovery::after_rest(CONFIG, 0.002);
        assert_eq!(r.step(&seen(Standing::AtRest, 9.0, false)), Action::Path);
        assert_eq!(
            r.step(&seen(Standing::Retreating, 9.0, false)),
            Action::Retreat,
            "a failed path"
        );
    }

    #[test]
    fn nan_is_never_free_air() {
        let mut r = Recovery::after_stop(CONFIG, 0.002);
        let said: Vec<_> =
            (0..9).map(|_| r.step(&seen(Standing::AtRest, f64::NAN, false))).collect();
        assert!(said.iter().all(|a| *a == Action::Watch), "{said:?}");
    }
}
