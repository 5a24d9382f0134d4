//! How fast the tool may move: no faster than the force that is left allows.
//!
//! Against a contact of stiffness k, a motion v that takes the reaction time t to end adds k·v·t to the
//! force. With F what the environment does to the tool, each axis must keep |F − k·v·t| ≤ F_max: a bound on
//! the approach that closes as the force grows, in free air F_max/(k·t). Motion that takes force away is
//! free, up to the same bound on the other side.

use palpate_spatial::{Vector3, Wrench};

/// The rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Headroom {
    /// k·t, N per m/s.
    gain: f64,
}

impl Headroom {
    /// Stiffest contact to be expected (N/m) and time to react (s).
    pub fn new(stiffness: f64, reaction_time: f64) -> Self {
        Self { gain: stiffness * reaction_time }
    }

    /// Approach speed in free air for a force limit (N), m/s.
    pub fn free_speed(&self, force_max: f64) -> f64 {
        force_max / self.gain
    }

    /// `velocity` (m/s, base axes) with every component brought within its bounds.
    ///
    /// Of the raw and the filtered force the worse one counts, each way.
    #[inline]
    pub fn limited(
        &self,
        velocity: &Vector3,
        raw: &Wrench,
        filtered: &Wrench,
        force_max: f64,
    ) -> Vector3 {
        Vector3::from_fn(|i, _| {
            let (high, low) =
                (raw.force[i].max(filtered.force[i]), raw.force[i].min(filtered.force[i]));
            let down = ((force_max - high) / self.gain).max(0.0);
            let up = ((force_max + low) / self.gain).max(0.0);
            velocity[i].max(-down).min(up)
        })
    }

    /// The largest part of `velocity`, 0 to 1, that is within its bounds on every axis.
    pub fn scale(
        &self,
        velocity: &Vector3,
        raw: &Wrench,
        filtered: &Wrench,
        force_max: f64,
    ) -> f64 {
        let limited = self.limited(velocity, raw, filtered, force_max);
        (0..3).filter(|&i| velocity[i] != 0.0).map(|i| limited[i] / velocity[i]).fold(1.0, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn force(f: Vector3) -> Wrench {
        Wrench::new(f, Vector3::zeros())
    }

    proptest! {
        #[test]
        fn the_predicted_force_stays_within_its_limit(
            v in prop::array::uniform3(-1.0..1.0f64),
            f in prop::array::uniform3(-24.0..24.0f64),
            more in prop::array::uniform3(-1.0..1.0f64),
        ) {
            let rule = Headroom::new(5.0e4, 0.03);
            let (filtered, raw) = (Vector3::from(f), Vector3::from(f) + Vector3::from(more));
            let allowed = rule.limited(&v.into(), &force(raw), &force(filtered), 25.0);
            for i in 0..3 {
                for now in [raw[i], filtered[i]] {
                    prop_assert!((now - 1500.0 * allowed[i]).abs() <= 25.0 + 1e-9);
                }
                prop_assert!(allowed[i] * v[i] >= 0.0 && allowed[i].abs() <= v[i].abs());
            }
            let scale = rule.scale(&v.into(), &force(raw), &force(filtered), 25.0);
            prop_assert!((0.0..=1.0).contains(&scale));
            for i in 0..3 {
                prop_assert!((scale * v[i]).abs() <= allowed[i].abs() + 1e-12);
            }
        }
    }

    #[test]
    fn pressing_ends_at_the_limit_and_leaving_never_does() {
        let rule = Headroom::new(1.0e4, 0.025);
        let pressed = force(Vector3::new(0.0, 0.0, 30.0));
        let along = |z: f64| rule.limited(&Vector3::new(0.0, 0.0, z), &pressed, &pressed, 25.0).z;
        assert_eq!(along(-0.05), 0.0, "the table pushes up: no further down");
        assert_eq!(along(0.05), 0.05, "away is free");
        assert!((rule.free_speed(25.0) - 0.1).abs() < 1e-15);
    }
}
