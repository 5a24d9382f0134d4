//! What frees a jammed tool on the way out: pull gently, and give way in every other direction.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "what is NaN makes no progress")]

use palpate_spatial::{Twist, Vector3, Wrench};

/// Part of the reset's force limit at which pulling ends.
const PULL: f64 = 0.7;

/// Load that is none, speed per load beyond it, largest speed: m/s from N, rad/s from N·m. Gentle: a contact of
/// 10 N/mm is given way to within 0.3 s, so that a servo's lag does no harm.
const SHIFT: (f64, f64, f64) = (3.0, 3e-4, 0.01);
const TURN: (f64, f64, f64) = (0.3, 0.03, 0.1);

/// Time without progress after which the way counts as blocked, s.
const PATIENCE: f64 = 2.0;
/// Progress that counts, m; of a path in ticks any does.
const LEAST: f64 = 1e-4;

/// Velocity of the tool (base axes, about its centre point) out along `axis` at up to `speed` (m/s): the slower the
/// harder it pulls already; across the axis and around it as the contact wants.
pub(super) fn give(wrench: &Wrench, axis: &Vector3, speed: f64, pull_max: f64) -> Twist {
    let along = wrench.force.dot(axis);
    let out = speed * (1.0 + along.min(0.0) / (PULL * pull_max)).max(0.0);
    let across = wrench.force - axis * along;
    Twist::new(axis * out + eased(&across, SHIFT), eased(&wrench.torque, TURN))
}

fn eased(load: &Vector3, (none, per_load, most): (f64, f64, f64)) -> Vector3 {
    let norm = load.norm();
    if !(norm > none) {
        return Vector3::zeros();
    }
    load * ((per_load * (norm - none)).min(most) / norm)
}

/// Whether something gets further.
#[derive(Debug)]
pub(super) struct Progress {
    best: f64,
    waited: f64,
    dt: f64,
}

impl Progress {
    /// Asked every `dt` (s).
    pub(super) fn new(dt: f64) -> Self {
        Self { best: f64::NEG_INFINITY, waited: 0.0, dt }
    }

    /// Whether `x` has grown lately.
    pub(super) fn made(&mut self, x: f64) -> bool {
        if x >= self.best + LEAST {
            (self.best, self.waited) = (x, 0.0);
        } else {
            self.waited += self.dt;
        }
        self.waited <= PATIENCE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_air_is_a_straight_way_out() {
        let out = give(&Wrench::zero(), &Vector3::z(), 0.1, 60.0);
        assert_eq!(out, Twist::new(Vector3::z() * 0.1, Vector3::zeros()));
    }

    #[test]
    fn it_pulls_less_the_harder_it_is_held_and_gives_way_elsewhere() {
        let held = |force: f64| Wrench::new(Vector3::new(8.0, 0.0, -force), Vector3::z() * -2.0);
        let out = give(&held(21.0), &Vector3::z(), 0.1, 60.0);
        assert!((out.linear.z - 0.05).abs() < 1e-12, "{out:?}");
        assert!((out.linear.x - 1.5e-3).abs() < 1e-12, "{out:?}");
        assert!((out.angular.z + 0.051).abs() < 1e-12, "{out:?}");
        assert_eq!(give(&held(50.0), &Vector3::z(), 0.1, 60.0).linear.z, 0.0);
        // What pushes it out does not make it faster.
        assert_eq!(give(&held(-50.0), &Vector3::z(), 0.1, 60.0).linear.z, 0.1);
        let most =
            give(&Wrench::new(Vector3::x() * 1e3, Vector3::y() * 1e3), &Vector3::z(), 0.1, 60.0);
        assert!((most.linear.x - 0.01).abs() < 1e-12 && (most.angular.y - 0.1).abs() < 1e-12);
    }

    #[test]
    fn two_seconds_without_progress_are_enough() {
        let mut progress = Progress::new(0.002);
        assert!((0..500).all(|i| progress.made(2e-7 * f64::from(i))), "slow is not stuck");
        let stuck = (0..2000).take_while(|_| progress.made(0.0)).count();
        assert!((400..=1000).contains(&stuck), "{stuck}");
        assert!(!progress.made(f64::NAN));
    }
}
