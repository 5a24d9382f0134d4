//! The arm's commanded motion: the set-points sent so far, as position, speed and acceleration.

use palpate_spatial::{DOF, JointVector};

use super::brake::Brake;

/// Keeps what is at a limit by construction from being beyond it by rounding.
const ROUNDING: f64 = 1.0 - 1e-12;

/// Set-point with its first and second backward differences.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Set-point, rad.
    pub q: JointVector,
    /// (q_t − q_{t−1}) / dt, rad/s.
    pub v: JointVector,
    /// (v_t − v_{t−1}) / dt, rad/s².
    pub a: JointVector,
}

impl Motion {
    /// At rest at `q`.
    pub fn at_rest(q: JointVector) -> Self {
        Self { q, v: JointVector::zeros(), a: JointVector::zeros() }
    }

    /// Whether another period without a command changes nothing.
    pub fn is_at_rest(&self) -> bool {
        self.v.iter().chain(&self.a).all(|&x| x == 0.0)
    }

    /// The motion that has arrived at `q` one tick from here.
    pub(crate) fn reaching(&self, q: &JointVector, dt: f64) -> Self {
        let v = (q - self.q) / dt;
        Self { q: *q, v, a: (v - self.v) / dt }
    }

    /// One tick of the brakes.
    pub(crate) fn braked(&self, brakes: &[Brake; DOF], dt: f64) -> Self {
        self.approaching(&JointVector::zeros(), brakes, dt)
    }

    /// One tick towards the steady speed `v`: the brake's law on the speed still missing.
    pub(crate) fn approaching(&self, v: &JointVector, brakes: &[Brake; DOF], dt: f64) -> Self {
        let mut next = *self;
        for (i, brake) in brakes.iter().enumerate() {
            let (missing, a) = brake.step(self.v[i] - v[i], self.a[i]);
            next.v[i] = missing + v[i];
            next.a[i] = a;
            next.q[i] += next.v[i] * dt;
        }
        next
    }

    /// One tick towards the steady speed `v` with all joints in step (time-synchronised): the speed goes straight from
    /// what it is to `v`, so that the tool's velocity stays between the two. Joint by joint, each as fast as it can,
    /// the tool would swerve: at a reversal to several times the speed of either.
    ///
    /// One brake's law for the whole arm stops what is missing. An acceleration that points elsewhere is turned as
    /// fast as every joint's jerk allows. A NaN goes into the acceleration, where it is refused.
    pub(crate) fn in_step(
        &self,
        v: &JointVector,
        acceleration: &JointVector,
        jerk: &JointVector,
        dt: f64,
    ) -> Self {
        let missing = self.v - v;
        let square = missing.norm_squared();
        let wanted = if square <= 1e-18 {
            JointVector::zeros()
        } else {
            let per_unit = |limit: &JointVector| {
                limit.zip_fold(&missing, f64::INFINITY, |least: f64, l, m| least.min(l / m.abs()))
            };
            let most = per_unit(acceleration) * ROUNDING;
            let along = (self.a.dot(&missing) / square).max(-most).min(most);
            missing * Brake::new(most, per_unit(jerk), dt).step(1.0, along).1
        };
        let change = wanted - self.a;
        let part = change.zip_fold(jerk, 1.0, |part: f64, c, j| part.min(j * dt / c.abs()));
        let a = self.a + change * (part * ROUNDING);
        let v = self.v + a * dt;
        Self { q: self.q + v * dt, v, a }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DT: f64 = 0.002;

    fn limits() -> (JointVector, JointVector) {
        let acceleration = [15.0, 15.0, 15.0, 30.0, 30.0, 30.0].into();
        (acceleration, JointVector::from_element(3000.0))
    }

    fn joints(size: f64) -> impl Strategy<Value = JointVector> {
        prop::array::uniform6(-size..size).prop_map(JointVector::from)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]

        /// From a steady speed every joint goes the same part of its way in every tick, forward only, as fast as the
        /// slowest may: the tool's velocity stays between the two.
        #[test]
        fn from_a_steady_speed_it_goes_straight(from in joints(2.0), to in joints(2.0)) {
            let (acceleration, jerk) = limits();
            let (mut here, way) = (Motion { v: from, ..Motion::at_rest(JointVector::zeros()) }, to - from);
            let (mut part, mut ticks) = (0.0, 0);
            let mut used = 0.0f64;
            while part < 1.0 - 1e-9 {
                prop_assert!(ticks < 1_000, "never there");
                let next = here.in_step(&to, &acceleration, &jerk, DT);
                let now = (next.v - from).dot(&way) / way.norm_squared();
                prop_assert!((next.v - from - way * now).amax() < 1e-9, "off the line");
                prop_assert!(now > part && now < 1.0 + 1e-9, "{} after {}", now, part);
                prop_assert!((next.q - here.q - next.v * DT).amax() < 1e-15);
                prop_assert!((next.v - here.v - next.a * DT).amax() < 1e-12);
                used = used.max(next.a.component_div(&acceleration).amax());
                (here, part, ticks) = (next, now, ticks + 1);
            }
            // The time of the joint that needs longest, by its own brake.
            let least = (0..DOF)
                .map(|i| Brake::new(acceleration[i], jerk[i], DT).stopping_time(way[i], 0.0))
                .fold(0.0, f64::max);
            prop_assert!(f64::from(ticks) * DT <= least + 4.0 * DT, "{} ticks, {} s", ticks, least);
            prop_assert!(used > 0.5 || way.amax() < 0.5, "{}", used);
        }

        /// A number that is none is not lost on the way: the step is refused for it.
        #[test]
        fn a_nan_stays_visible(v in joints(2.0), to in joints(2.0), joint in 0..DOF) {
            let (acceleration, jerk) = limits();
            let here = Motion { v, ..Motion::at_rest(JointVector::zeros()) };
            let mut bad = to;
            bad[joint] = f64::NAN;
            prop_assert!(here.in_step(&bad, &acceleration, &jerk, DT).a[joint].is_nan());
        }

        /// From any motion, and to a wish that moves, no limit is exceeded.
        #[test]
        fn it_keeps_acceleration_and_jerk(
            v in joints(2.0),
            a in joints(15.0),
            wishes in prop::collection::vec(joints(2.0), 1..20),
        ) {
            let (acceleration, jerk) = limits();
            let mut here = Motion { q: JointVector::zeros(), v, a };
            for wish in &wishes {
                for _ in 0..4 {
                    let next = here.in_step(wish, &acceleration, &jerk, DT);
                    prop_assert!((0..DOF).all(|i| {
                        next.a[i].abs() <= acceleration[i]
                            && (next.a[i] - here.a[i]).abs() <= jerk[i] * DT
                    }), "{:?} after {:?}", next, here);
                    here = next;
                }
            }
            for _ in 0..400 {
                here = here.in_step(&wishes[0], &acceleration, &jerk, DT);
            }
            prop_assert!((here.v - wishes[0]).amax() < 1e-9 && here.a.amax() < 1e-6, "{:?}", here);
        }
    }
}
