//! Force supervision: one tick after another, raw and filtered, per axis and norm.
#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must exceed")]

use palpate_spatial::Wrench;

use crate::Excess;

/// Limits on a wrench.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchLimits {
    /// Per axis, N.
    pub force: f64,
    /// Per axis, N·m.
    pub torque: f64,
    /// Norm, N.
    pub force_norm: f64,
    /// Norm, N·m.
    pub torque_norm: f64,
}

impl WrenchLimits {
    /// The first component or norm beyond its limit; NaN exceeds.
    #[inline]
    pub fn exceeded(&self, wrench: &Wrench) -> Option<Excess> {
        let components = wrench.vector();
        for (axis, value) in components.iter().copied().enumerate() {
            let limit = if axis < 3 { self.force } else { self.torque };
            if !(value.abs() <= limit) {
                return Some(Excess { axis, value, limit });
            }
        }
        let norms = [
            (Excess::FORCE_NORM, wrench.force.norm(), self.force_norm),
            (Excess::TORQUE_NORM, wrench.torque.norm(), self.torque_norm),
        ];
        let (axis, value, limit) = *norms.iter().find(|(_, value, limit)| !(value <= limit))?;
        Some(Excess { axis, value, limit })
    }

    /// Every limit times `ratio`.
    pub fn scaled(&self, ratio: f64) -> Self {
        Self {
            force: self.force * ratio,
            torque: self.torque * ratio,
            force_norm: self.force_norm * ratio,
            torque_norm: self.torque_norm * ratio,
        }
    }
}

/// What one sample means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Contact {
    /// Within the limits.
    Fine,
    /// Within the limits now, but not after the reaction time if the force keeps rising.
    Rising(Excess),
    /// Beyond the soft limit in 2 of 3 samples.
    Soft(Excess),
    /// Beyond the hard limit now, or after the reaction time by 2 of 3 samples.
    Hard(Excess),
}

/// The supervisor's memory.
#[derive(Clone, Debug)]
pub struct ForceGuard {
    soft: WrenchLimits,
    hard: WrenchLimits,
    /// One bit per sample, the latest lowest: beyond the soft limit.
    strikes: u8,
    /// Likewise: beyond the hard limit after the reaction time.
    ahead: u8,
    previous: Option<Wrench>,
    /// Prediction horizon in samples.
    horizon: f64,
    rearm_ratio: f64,
    rearm_samples: u32,
    /// Samples in a row below the re-arm level; a force that never was is gone.
    quiet: u32,
}

impl ForceGuard {
    /// Trips at `soft` in 2 of 3 samples and at `hard` at once; predicts `horizon` samples ahead; the force
    /// is gone after `rearm_samples` below `rearm_ratio` of the soft limits.
    pub fn new(
        soft: WrenchLimits,
        hard: WrenchLimits,
        horizon: f64,
        rearm_ratio: f64,
        rearm_samples: u32,
    ) -> Self {
        Self {
            soft,
            hard,
            strikes: 0,
            ahead: 0,
            previous: None,
            horizon,
            rearm_ratio,
            rearm_samples,
            quiet: rearm_samples,
        }
    }

    /// Other soft limits from now on.
    pub fn set_soft(&mut self, soft: WrenchLimits) {
        self.soft = soft;
        (self.strikes, self.ahead) = (0, 0);
    }

    /// Forgets the past, for instance after the sensor was zeroed.
    pub fn restart(&mut self) {
        (self.strikes, self.ahead, self.previous) = (0, 0, None);
        self.quiet = self.rearm_samples;
    }

    /// The soft limits in force.
    pub fn soft(&self) -> &WrenchLimits {
        &self.soft
    }

    /// Takes in one sample.
    pub fn update(&mut self, raw: &Wrench, filtered: &Wrench) -> Contact {
        let soft = self.soft.exceeded(filtered).or_else(|| self.soft.exceeded(raw));
        self.strikes = (self.strikes << 1 | u8::from(soft.is_some())) & 0b111;
        let calm = self.soft.scaled(self.rearm_ratio);
        let is_calm = calm.exceeded(filtered).is_none() && calm.exceeded(raw).is_none();
        self.quiet = if is_calm { self.quiet.saturating_add(1) } else { 0 };
        let predicted = self.predict(filtered);
        self.previous = Some(*filtered);

        let hard = self.hard.exceeded(raw).or_else(|| self.hard.exceeded(filtered));
        let ahead = self.hard.exceeded(&predicted);
        self.ahead = (self.ahead << 1 | u8::from(ahead.is_some())) & 0b111;
        // A single spike may look like a steep rise; two of three samples do not.
        if let Some(excess) = hard.or(ahead.filter(|_| self.ahead.count_ones() >= 2)) {
            return Contact::Hard(excess);
        }
        if let Some(excess) = soft
            && self.strikes.count_ones() >= 2
        {
            return Contact::Soft(excess);
        }
        self.soft.exceeded(&predicted).map_or(Contact::Fine, Contact::Rising)
    }

    /// Whether the force has been gone for long enough.
    pub fn is_armed(&self) -> bool {
        self.quiet >= self.rearm_samples
    }

    /// F + Ḟ·t, but only where the force is growing: one that fades is no danger.
    fn predict(&self, filtered: &Wrench) -> Wrench {
        let Some(previous) = self.previous else { return *filtered };
        let (now, before) = (filtered.vector(), previous.vector());
        let ahead = now.zip_map(&before, |now: f64, before: f64| {
            let rise = (now - before) * self.horizon;
            if now * rise > 0.0 { now + rise } else { now }
        });
        Wrench::from(ahead)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_spatial::Vector3;

    fn guard(horizon: f64) -> ForceGuard {
        let soft = WrenchLimits { force: 25.0, torque: 2.0, force_norm: 30.0, torque_norm: 2.5 };
        ForceGuard::new(soft, soft.scaled(2.0), horizon, 0.8, 3)
    }

    fn push(x: f64, y: f64, z: f64) -> Wrench {
        Wrench::new(Vector3::new(x, y, z), Vector3::zeros())
    }

    #[test]
    fn one_spike_is_forgiven_two_of_three_are_not_and_the_hard_limit_is_not_once() {
        let mut g = guard(0.0);
        let calm = Wrench::zero();
        assert_eq!(g.update(&push(30.0, 0.0, 0.0), &calm), Contact::Fine);
        assert_eq!(g.update(&calm, &calm), Contact::Fine);
        assert!(matches!(g.update(&push(30.0, 0.0, 0.0), &calm), Contact::Soft(e) if e.axis == 0));
        g.restart();
        assert!(matches!(g.update(&push(0.0, -51.0, 0.0), &calm), Contact::Hard(e) if e.axis == 1));
    }

    #[test]
    fn the_filtered_wrench_counts_as_well_as_the_raw_one() {
        let mut g = guard(0.0);
        let (calm, slow) = (Wrench::zero(), push(0.0, 0.0, 26.0));
        assert!(matches!(g.update(&calm, &slow), Contact::Rising(e) if e.axis == 2));
        assert!(matches!(g.update(&calm, &slow), Contact::Soft(e) if e.axis == 2));
    }

    #[test]
    fn norms_count_where_no_axis_does_and_torque_has_limits_of_its_own() {
        let mut g = guard(0.0);
        let slant = push(20.0, 20.0, 20.0);
        let _ = g.update(&slant, &slant);
        assert!(
            matches!(g.update(&slant, &slant), Contact::Soft(e) if e.axis == Excess::FORCE_NORM && e.value > 34.0)
        );
        g.restart();
        let twist = Wrench::new(Vector3::zeros(), Vector3::new(0.0, 2.1, 0.0));
        let _ = g.update(&twist, &twist);
        assert!(matches!(g.update(&twist, &twist), Contact::Soft(e) if e.axis == 4));
    }

    #[test]
    fn a_rising_force_is_seen_ahead_and_a_falling_one_is_not() {
        let mut g = guard(10.0);
        assert_eq!(g.update(&push(10.0, 0.0, 0.0), &push(10.0, 0.0, 0.0)), Contact::Fine);
        assert!(
            matches!(g.update(&push(12.0, 0.0, 0.0), &push(12.0, 0.0, 0.0)), Contact::Rising(e) if e.value == 32.0)
        );
        assert_eq!(g.update(&push(8.0, 0.0, 0.0), &push(8.0, 0.0, 0.0)), Contact::Fine);
        // Once may be a spike, twice is a rise.
        for (z, said) in [(13.0, false), (19.0, true)] {
            let contact = g.update(&push(z, 0.0, 0.0), &push(z, 0.0, 0.0));
            assert_eq!(matches!(contact, Contact::Hard(e) if e.limit == 50.0), said, "{contact:?}");
        }
    }

    #[test]
    fn it_is_armed_again_only_after_calm() {
        let mut g = guard(0.0);
        let (nearly, calm) = (push(21.0, 0.0, 0.0), push(19.0, 0.0, 0.0));
        for _ in 0..5 {
            let _ = g.update(&nearly, &nearly);
        }
        assert!(!g.is_armed(), "21 N is above 80 % of 25 N");
        for expected in [false, false, true] {
            let _ = g.update(&calm, &calm);
            assert_eq!(g.is_armed(), expected);
        }
    }

    #[test]
    fn both_readings_must_be_calm() {
        let mut g = guard(0.0);
        let (nearly, calm) = (push(21.0, 0.0, 0.0), Wrench::zero());
        for (raw, filtered) in [(nearly, calm), (calm, nearly)] {
            g.restart();
            assert!(g.is_armed(), "nothing was there");
            let _ = g.update(&raw, &filtered);
            assert!(!g.is_armed());
        }
    }

    #[test]
    fn a_restart_forgives_what_was() {
        let mut g = guard(10.0);
        let (hit, calm) = (push(30.0, 0.0, 0.0), Wrench::zero());
        let _ = g.update(&hit, &calm);
        g.restart();
        assert_eq!(g.update(&hit, &calm), Contact::Fine, "the first of two");
        let _ = g.update(&calm, &push(-20.0, 0.0, 0.0));
        g.restart();
        assert_eq!(
            g.update(&calm, &push(-24.0, 0.0, 0.0)),
            Contact::Fine,
            "no rise without a past"
        );
    }

    #[test]
    fn a_force_that_fades_to_nothing_is_not_seen_on_the_other_side() {
        let mut g = guard(10.0);
        let _ = g.update(&push(-5.0, 0.0, 0.0), &push(-5.0, 0.0, 0.0));
        assert_eq!(g.update(&Wrench::zero(), &Wrench::zero()), Contact::Fine);
    }

    #[test]
    fn every_axis_has_its_own_kind_of_limit() {
        let limits = guard(0.0).soft;
        for axis in 0..6 {
            let at = |x: f64| {
                let mut components = [0.0; 6];
                components[axis] = x;
                Wrench::from(palpate_spatial::Vector6::from(components))
            };
            let limit = if axis < 3 { 25.0 } else { 2.0 };
            assert_eq!(limits.exceeded(&at(limit)), None);
            let excess = limits.exceeded(&at(-limit * 1.001)).unwrap();
            assert_eq!((excess.axis, excess.limit), (axis, limit));
        }
    }

    #[test]
    fn limits_scale_alike() {
        let half = guard(0.0).soft.scaled(0.5);
        let expected =
            WrenchLimits { force: 12.5, torque: 1.0, force_norm: 15.0, torque_norm: 1.25 };
        assert_eq!(half, expected);
    }

    #[test]
    fn nan_trips() {
        let mut g = guard(0.0);
        assert!(matches!(g.update(&push(f64::NAN, 0.0, 0.0), &Wrench::zero()), Contact::Hard(_)));
    }
}
