//! One joint's brake: the law that stops it, and in closed form what that stop will be.
//!
//! Everything is in the discrete time of the set-points, where q' = q + v'·dt and v' = v + a'·dt: what a
//! controller sees when it takes differences of the positions that it is sent. Within |a| ≤ A and
//! |a' − a| ≤ h = jerk·dt the law decelerates as hard as still allows it to land at v = 0, a = 0 without
//! overshoot:
//!
//! - A deceleration α that is ramped down by h per tick takes another R(α) = dt·Σ_{k≥1} (α − k·h)₊ off the
//!   speed, so α may be used for one more tick from a speed of at least G(α) = α·dt + R(α).
//! - The next deceleration is the least of α + h, A and G⁻¹(v). G is piecewise linear, so that G⁻¹ costs one
//!   square root and the landing is exact.
//!
//! The three phases (ramp up, hold, ramp down) are arithmetic series; [`Brake::stop`] sums them.

/// The brake of one joint.
#[derive(Clone, Copy, Debug)]
pub struct Brake {
    dt: f64,
    /// Largest change of the acceleration per tick, rad/s².
    ramp: f64,
    acceleration: f64,
    /// G(A): the speed from which full deceleration may be used for another tick.
    full: f64,
}

/// What a brake will do, from one state on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Ticks until speed and acceleration are zero.
    pub ticks: f64,
    /// Where the joint ends, from here, rad.
    pub travel: f64,
    /// Lowest position on the way, from here, rad (0 or negative).
    pub lowest: f64,
    /// Highest position on the way, from here, rad (0 or positive).
    pub highest: f64,
    /// Length of the way, rad.
    pub sweep: f64,
    /// Speed when the acceleration there is now has been ramped down, rad/s: the extreme on the way.
    pub run_out: f64,
}

/// Speeds below this are zero: the rounding of an exact landing, rad/s.
const LANDED: f64 = 1e-13;

impl Brake {
    /// A brake within `acceleration` (rad/s²) and `jerk` (rad/s³) for set-points every `dt` (s).
    pub fn new(acceleration: f64, jerk: f64, dt: f64) -> Self {
        let mut brake = Self { dt, ramp: jerk * dt, acceleration, full: 0.0 };
        brake.full = acceleration * dt + brake.loss(acceleration);
        brake
    }

    /// Speed and acceleration one tick on.
    #[inline]
    pub fn step(&self, v: f64, a: f64) -> (f64, f64) {
        let run_out = self.run_out(v, a);
        let sign = if run_out >= 0.0 { 1.0 } else { -1.0 };
        let (speed, alpha) = (sign * v, -sign * a);
        let mut next = alpha + self.ramp;
        if next > 0.0 {
            next = next.min(self.acceleration).min(self.entry(speed)).max(alpha - self.ramp);
        }
        let a = -sign * next;
        let v = v + a * self.dt;
        (if v.abs() <= LANDED { 0.0 } else { v }, a)
    }

    /// The whole stop from speed `v` (rad/s) and acceleration `a` (rad/s²) in closed form.
    #[inline]
    pub fn stop(&self, v: f64, a: f64) -> Stop {
        let (dt, h) = (self.dt, self.ramp);
        let run_out = self.run_out(v, a);
        let sign = if run_out >= 0.0 { 1.0 } else { -1.0 };
        let (v0, alpha0) = (sign * v, -sign * a);

        // 1. Ramp up: α₀ + i·h while v_i ≥ R(α_i), with α₀ = m₀·h + f₀.
        let m0 = (alpha0 / h).floor();
        let f0 = alpha0 - m0 * h;
        let c = v0 / dt + f0 * m0 + h * (m0 * m0 + m0) / 2.0;
        let last = if c < 0.0 { -1.0 } else { (((f0 * f0 + h * c).sqrt() - f0) / h).floor() };
        let by_speed = last - m0;
        let by_acceleration = ((self.acceleration - alpha0) / h).floor();
        let n1 = by_speed.min(by_acceleration).max(0.0);
        let steps = n1 * (n1 + 1.0) / 2.0;
        let mut x = n1 * v0 - dt * (alpha0 * steps + h * steps * (n1 + 2.0) / 3.0);
        let mut speed = v0 - dt * (n1 * alpha0 + h * steps);
        let mut alpha = alpha0 + n1 * h;

        // 2. Hold full deceleration.
        let mut n2 = 0.0;
        if by_acceleration <= by_speed && speed >= self.full {
            let lost = self.acceleration * dt;
            n2 = ((speed - self.full) / lost).floor() + 1.0;
            x += n2 * speed - lost * n2 * (n2 + 1.0) / 2.0;
            speed -= n2 * lost;
            alpha = self.acceleration;
        }

        // 3. Ramp down and land.
        let mut n3 = 0.0;
        if speed > LANDED {
            let m = self.segment(speed);
            alpha = speed / dt / (m + 1.0) + h * m / 2.0;
            n3 = m + 1.0;
            x += dt * m * (m + 1.0) * (alpha / 2.0 - h * (2.0 * m + 1.0) / 6.0);
        }
        // One more tick takes the acceleration to zero.
        let end = if alpha == 0.0 && n3 == 0.0 { 0.0 } else { 1.0 };

        let travel = x * dt;
        let back = if v0 < 0.0 { self.turn_round(v0, alpha0) } else { 0.0 };
        let (low, high) = ((-back).min(travel), travel.max(0.0));
        let (lowest, highest) = if sign > 0.0 { (low, high) } else { (-high, -low) };
        Stop {
            ticks: n1 + n2 + n3 + end,
            travel: sign * travel,
            lowest,
            highest,
            sweep: travel + 2.0 * back,
            run_out,
        }
    }

    /// Time to rest, s. See [`stop`](Self::stop).
    pub fn stopping_time(&self, v: f64, a: f64) -> f64 {
        self.stop(v, a).ticks * self.dt
    }

    /// Speed that is left when the acceleration has been ramped down.
    #[inline]
    fn run_out(&self, v: f64, a: f64) -> f64 {
        v + a.signum() * self.loss(a.abs())
    }

    /// R(α).
    #[inline]
    fn loss(&self, alpha: f64) -> f64 {
        let m = (alpha / self.ramp).floor();
        self.dt * m * (alpha - self.ramp * (m + 1.0) / 2.0)
    }

    /// The number of whole ramp steps in G⁻¹(v).
    #[inline]
    fn segment(&self, v: f64) -> f64 {
        (0.5 * (1.0 + 8.0 * v / (self.dt * self.ramp)).sqrt() - 0.5).floor()
    }

    /// G⁻¹(v).
    #[inline]
    fn entry(&self, v: f64) -> f64 {
        let v = v.max(0.0);
        let m = self.segment(v);
        v / self.dt / (m + 1.0) + self.ramp * m / 2.0
    }

    /// How far a joint still moves the wrong way before it turns round, rad.
    fn turn_round(&self, mut v: f64, mut alpha: f64) -> f64 {
        let mut back = 0.0;
        // Rounding may leave a last trace of speed when α is used up.
        while v < 0.0 && alpha + self.ramp < 0.0 {
            alpha += self.ramp;
            v -= alpha * self.dt;
            back -= v.min(0.0) * self.dt;
        }
        back
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DT: f64 = 0.002;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        /// The closed form against the law, tick by tick.
        #[test]
        fn the_closed_form_is_what_the_law_does(
            acceleration in 1.0..40.0f64,
            jerk in 100.0..5000.0f64,
            v in -7.0..7.0f64,
            a in -1.0..1.0f64,
            small in 0u8..4,
        ) {
            let brake = Brake::new(acceleration, jerk, DT);
            let (v0, a0) = match small {
                0 => (v, a * acceleration),
                1 => (v * 1e-3, a * acceleration),
                2 => (v, 0.0),
                _ => (0.0, a * acceleration),
            };
            let said = brake.stop(v0, a0);
            let (mut v, mut a, mut x) = (v0, a0, 0.0);
            let (mut lowest, mut highest, mut sweep, mut ticks) = (0.0f64, 0.0f64, 0.0, 0.0);
            while v != 0.0 || a != 0.0 {
                let before = a;
                (v, a) = brake.step(v, a);
                prop_assert!(a.abs() <= acceleration * (1.0 + 1e-12));
                prop_assert!((a - before).abs() <= jerk * DT * (1.0 + 1e-9), "jerk at {v0} {a0}");
                prop_assert!(v.abs() <= v0.abs().max(said.run_out.abs()) + 1e-12, "speed rises");
                x += v * DT;
                sweep += v.abs() * DT;
                lowest = lowest.min(x);
                highest = highest.max(x);
                ticks += 1.0;
                prop_assert!(ticks < 1e5, "never stops from {v0} {a0}");
            }
            prop_assert!((said.ticks - ticks).abs() <= 1.0, "{} ticks, said {}", ticks, said.ticks);
            for (told, seen) in [
                (said.travel, x),
                (said.lowest, lowest),
                (said.highest, highest),
                (said.sweep, sweep),
            ] {
                prop_assert!((told - seen).abs() < 1e-11, "{said:?} but {x} {lowest} {highest} {sweep}");
            }
        }

        /// No stop within the same limits is shorter: the continuous-time optimum plus a few ticks.
        #[test]
        fn a_stop_takes_the_least_time(v in 0.01..6.0f64, acceleration in 2.0..40.0f64, jerk in 100.0..5000.0f64) {
            let time = Brake::new(acceleration, jerk, DT).stopping_time(v, 0.0);
            let least = if v >= acceleration * acceleration / jerk {
                v / acceleration + acceleration / jerk
            } else {
                2.0 * (v / jerk).sqrt()
            };
            prop_assert!(time >= least - 1e-9 && time <= least + 3.0 * DT, "{time} s, at best {least} s");
        }
    }

    #[test]
    fn rest_stays_rest() {
        let brake = Brake::new(8.0, 500.0, DT);
        assert_eq!(brake.step(0.0, 0.0), (0.0, 0.0));
        let stop = brake.stop(0.0, 0.0);
        assert_eq!((stop.ticks, stop.travel, stop.sweep), (0.0, 0.0, 0.0));
    }

    #[test]
    fn nan_stays_visible() {
        let stop = Brake::new(8.0, 500.0, DT).stop(f64::NAN, 0.0);
        assert!(stop.travel.is_nan() && stop.run_out.is_nan());
    }
}
