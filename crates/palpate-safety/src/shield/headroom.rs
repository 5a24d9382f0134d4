//! How fast the tool may move: no faster than the force that is left allows.
//!
//! Against a contact of stiffness k, a motion at v goes on for the reaction time t and then brakes, which is as
//! long a way as going on for half the stopping time t_b: it adds k·v·(t + t_b/2) to the force. With F what the
//! environment does to the tool, each axis must keep |F − k·v·(t + t_b/2)| ≤ F_max: a bound on the approach that
//! closes as the force grows. Motion that takes force away is free, up to the same bound on the other side.
//!
//! A turn presses too, by the lever of the contact. Where that is nobody needs to know: a wrench (F, τ) about the tool
//! centre point comes nearer along F at −τ·ω/|F| by the turn ω alone, its power over its force.

use palpate_spatial::{Vector3, Wrench};

use super::force::WrenchLimits;

/// Speed that is too small to matter and too large to be rounding, m/s.
const SLACK: f64 = 1e-4;

/// The rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Headroom {
    stiffness: f64,
    reaction_time: f64,
}

/// The rule at one moment: speed bounds per axis, m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least velocity, 0 or negative.
    pub lower: Vector3,
    /// Largest velocity, 0 or positive.
    pub upper: Vector3,
}

impl Headroom {
    /// Stiffest contact to be expected (N/m) and time until the brake begins to work (s).
    pub fn new(stiffness: f64, reaction_time: f64) -> Self {
        Self { stiffness, reaction_time }
    }

    /// Approach speed in free air for a force limit (N) at a stopping time (s), m/s.
    pub fn free_speed(&self, force_max: f64, stopping_time: f64) -> f64 {
        force_max / (self.stiffness * (self.reaction_time + 0.5 * stopping_time))
    }

    /// `turn` (rad/s, base axes, about the tool centre point) without what would press too hard together with
    /// `velocity` (m/s) against the contact that does `wrench`: the force then reaches its limits along the
    /// direction it has.
    #[inline]
    pub fn turned(
        &self,
        wrench: &Wrench,
        limits: &WrenchLimits,
        stopping_time: f64,
        velocity: &Vector3,
        turn: &Vector3,
    ) -> Vector3 {
        let (force, torque) = (wrench.force.norm(), wrench.torque.norm());
        let load = (wrench.force.amax() / limits.force).max(force / limits.force_norm);
        let turning_in = -wrench.torque.dot(turn) / force;
        // Free air, or a turn that takes force away.
        if !(load > 0.0 && torque > 0.0 && turning_in > 0.0) {
            return *turn;
        }
        let left = force * (1.0 / load - 1.0).max(0.0);
        let allowed = left * self.free_speed(1.0, stopping_time);
        let excess = turning_in - wrench.force.dot(velocity) / force - allowed;
        let withheld = excess.clamp(0.0, turning_in);
        turn + wrench.torque * (withheld * force / torque.powi(2))
    }

    /// The bounds at a stopping time (s). Of the raw and the filtered force the worse one counts, each way.
    #[inline]
    pub fn bounds(
        &self,
        raw: &Wrench,
        filtered: &Wrench,
        force_max: f64,
        stopping_time: f64,
    ) -> Bounds {
        let per_newton = self.free_speed(1.0, stopping_time);
        let speed = |force_left: f64| (force_left * per_newton).max(0.0);
        let (high, low) = (raw.force.sup(&filtered.force), raw.force.inf(&filtered.force));
        Bounds {
            lower: high.map(|f| -speed(force_max - f)),
            upper: low.map(|f| speed(force_max + f)),
        }
    }
}

impl Bounds {
    /// `velocity` (m/s, base axes) with every component brought within its bounds.
    #[inline]
    pub fn limited(&self, velocity: &Vector3) -> Vector3 {
        velocity.sup(&self.lower).inf(&self.upper)
    }

    /// The largest part of `velocity`, 0 to 1, that is within its bounds (and a tenth of a millimetre per second).
    #[inline]
    pub fn scale(&self, velocity: &Vector3) -> f64 {
        let mut scale: f64 = 1.0;
        for i in 0..3 {
            let bound =
                if velocity[i] < 0.0 { SLACK - self.lower[i] } else { SLACK + self.upper[i] };
            scale = scale.min(bound / velocity[i].abs());
        }
        scale
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
            stopping in 0.0..0.1f64,
        ) {
            let rule = Headroom::new(5.0e4, 0.03);
            let (filtered, raw) = (Vector3::from(f), Vector3::from(f) + Vector3::from(more));
            let bounds = rule.bounds(&force(raw), &force(filtered), 25.0, stopping);
            let allowed = bounds.limited(&v.into());
            for i in 0..3 {
                for now in [raw[i], filtered[i]] {
                    prop_assert!((now - 5.0e4 * (0.03 + stopping / 2.0) * allowed[i]).abs() <= 25.0 + 1e-9);
                }
                prop_assert!(allowed[i] * v[i] >= 0.0 && allowed[i].abs() <= v[i].abs());
            }
            let scale = bounds.scale(&v.into());
            prop_assert!((0.0..=1.0).contains(&scale));
            for i in 0..3 {
                prop_assert!((scale * v[i]).abs() <= allowed[i].abs() + SLACK + 1e-12);
            }
        }
    }

    /// A tool that presses on a wall with a point beside its centre, and turns into it.
    #[test]
    fn a_turn_presses_by_its_lever_and_no_more_than_is_left() {
        let rule = Headroom::new(1.0e4, 0.025);
        let limits = WrenchLimits { force: 20.0, torque: 2.0, force_norm: 30.0, torque_norm: 3.0 };
        let lever = Vector3::new(0.01, 0.0, 0.0);
        let pressed = |newton: f64| {
            let force = Vector3::new(0.0, 0.0, newton);
            Wrench::new(force, lever.cross(&force))
        };
        let still = Vector3::zeros();
        // ω × lever has a z of −ω_y·lever: this turn drives the point into the wall.
        let into = Vector3::new(0.3, 2.0, 0.1);
        let point = |turn: Vector3| turn.cross(&lever).z;
        let turn = |newton: f64, velocity: &Vector3, turn: &Vector3| {
            rule.turned(&pressed(newton), &limits, 0.0, velocity, turn)
        };
        for newton in [1.0, 10.0, 18.0] {
            let left: f64 = -(20.0 - newton) / (1.0e4 * 0.025);
            let expected = left.max(point(into));
            assert!((point(turn(newton, &still, &into)) - expected).abs() < 1e-12, "{newton}");
            // What the tool's own approach takes is not there twice.
            let approach = Vector3::new(0.0, 0.0, 0.5 * expected);
            let both = point(turn(newton, &approach, &into)) + approach.z;
            assert!(both >= left - 1e-12, "{newton}: {both} {left}");
        }
        assert!(point(turn(25.0, &still, &into)).abs() < 1e-12, "beyond the limit no further");
        assert_eq!(turn(25.0, &still, &-into), -into, "away is free");
        let across = turn(25.0, &still, &into);
        assert!((across.x - 0.3).abs() < 1e-12 && (across.z - 0.1).abs() < 1e-12, "{across}");
        assert_eq!(rule.turned(&Wrench::zero(), &limits, 0.0, &still, &into), into, "free air");
    }

    /// By hand: 10 N left of 20, so 10 / (10⁴ · 0.03) m/s; the turn comes nearer at 2 · 0.5 / 10 m/s and the tool leaves at
    /// 0.02 m/s, so 0.0467 m/s of the turn are too much.
    #[test]
    fn a_turn_counts_what_the_tool_does_besides() {
        let rule = Headroom::new(1.0e4, 0.03);
        let limits = WrenchLimits { force: 20.0, torque: 9.0, force_norm: 40.0, torque_norm: 9.0 };
        let wrench = Wrench::new(Vector3::z() * 10.0, Vector3::x() * 2.0);
        let (velocity, turn) = (Vector3::z() * 0.02, Vector3::x() * -0.5);
        let allowed = rule.turned(&wrench, &limits, 0.0, &velocity, &turn);
        let withheld: f64 = 0.1 - 0.02 - 10.0 / 300.0;
        assert!((allowed - Vector3::x() * (-0.5 + 5.0 * withheld)).norm() < 1e-12, "{allowed}");
        // A torque without a force has no lever.
        let twist = Wrench::new(Vector3::zeros(), Vector3::x() * 2.0);
        assert_eq!(rule.turned(&twist, &limits, 0.0, &velocity, &turn), turn);
    }

    #[test]
    fn pressing_ends_at_the_limit_and_leaving_never_does() {
        let rule = Headroom::new(1.0e4, 0.025);
        let pressed = force(Vector3::new(0.0, 0.0, 30.0));
        let bounds = rule.bounds(&pressed, &pressed, 25.0, 0.0);
        let along = |z: f64| bounds.limited(&Vector3::new(0.0, 0.0, z)).z;
        assert_eq!(along(-0.05), 0.0, "the table pushes up: no further down");
        assert_eq!(along(0.05), 0.05, "away is free");
        assert!((rule.free_speed(25.0, 0.0) - 0.1).abs() < 1e-15);
        assert!((rule.free_speed(25.0, 0.05) - 0.05).abs() < 1e-15, "a brake of 50 ms counts half");
        assert_eq!(bounds.scale(&Vector3::new(0.1, 0.0, -1e-9)), 1.0, "rounding stops nothing");
    }
}
