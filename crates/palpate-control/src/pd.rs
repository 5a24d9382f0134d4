//! The PD action on position that both laws share.

use palpate_spatial::Vector6;

use crate::config::DerivativeRule;

/// K_p^x·x_e + K_d^x·ẋ_e, with K_d^x a function of K_p^x (Sect. III-D.1).
#[derive(Clone, Debug)]
pub(crate) struct PositionPd {
    rule: DerivativeRule,
    kp: Vector6,
    kd: Vector6,
    rate: Derivative,
}

impl PositionPd {
    pub(crate) fn new(rule: DerivativeRule) -> Self {
        Self { rule, kp: Vector6::zeros(), kd: Vector6::zeros(), rate: Derivative::default() }
    }

    pub(crate) fn set(&mut self, kp: &Vector6) {
        self.kp = *kp;
        self.kd = Vector6::from_fn(|axis, _| self.rule.derivative_gain(kp[axis], axis));
    }

    pub(crate) fn update(&mut self, pose_error: &Vector6, dt: f64) -> Vector6 {
        let rate = self.rate.update(pose_error, dt);
        self.kp.component_mul(pose_error) + self.kd.component_mul(&rate)
    }

    pub(crate) fn undo(&mut self) {
        self.rate.undo();
    }

    pub(crate) fn reset(&mut self) {
        self.rate = Derivative::default();
    }
}

/// ẋ_e as a backward difference, without a kick at the first tick.
#[derive(Clone, Copy, Debug, Default)]
struct Derivative {
    kept: Sample,
    /// What `kept` was before the last update, with that update's dt on its age.
    before: Option<Sample>,
}

/// The last sample that led to motion, and the seconds since then that led to none.
#[derive(Clone, Copy, Debug, Default)]
struct Sample {
    value: Option<Vector6>,
    age: f64,
}

impl Derivative {
    fn update(&mut self, value: &Vector6, dt: f64) -> Vector6 {
        let elapsed = self.kept.age + dt;
        let rate = self.kept.value.map_or_else(Vector6::zeros, |last| (value - last) / elapsed);
        self.before = Some(Sample { age: elapsed, ..self.kept });
        self.kept = Sample { value: Some(*value), age: 0.0 };
        rate
    }

    /// Forgets the last sample but not the time it took. Were the time forgotten too, an arm that
    /// coasts while it is held would come back with a rate that grows with every refusal, and be
    /// refused for it.
    fn undo(&mut self) {
        if let Some(before) = self.before.take() {
            self.kept = before;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_of_a_ramp_is_right_through_refusals() {
        let ramp = |tick: i32| Vector6::repeat(0.3 * 0.002 * f64::from(tick));
        let mut rate = Derivative::default();
        assert_eq!(rate.update(&ramp(0), 0.002), Vector6::zeros());
        for tick in 1..50 {
            let got = rate.update(&ramp(tick), 0.002);
            assert!((got - Vector6::repeat(0.3)).norm() < 1e-12, "tick {tick}: {got}");
            if tick % 3 != 0 {
                rate.undo();
                rate.undo(); // once is enough; twice is no more
            }
        }
    }
}
