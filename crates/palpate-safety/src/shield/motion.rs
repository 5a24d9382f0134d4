//! The arm's commanded motion: the set-points sent so far, as position, speed and acceleration.

#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must fail")]

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

    /// One tick towards the steady speed `v` with all joints in step: the speed goes straight from what it is to `v`,
    /// so that the tool's velocity stays between the two. Joint by joint, each as fast as it can, the tool would
    /// swerve: at a reversal to several times the speed of either.
    ///
    /// One brake's law for the whole arm stops what is missing. An acceleration that points elsewhere is turned as
    /// fast as every joint's jerk allows.
    pub(crate) fn in_step(
        &self,
        v: &JointVector,
        acceleration: &JointVector,
        jerk: &JointVector,
        dt: f64,
    ) -> Self {
        let missing = self.v - v;
        let square = missing.norm_squared();
        let wanted = if square > 1e-18 {
            let per_unit = |limit: &JointVector| {
                limit.zip_fold(&missing, f64::INFINITY, |least: f64, l, m| least.min(l / m.abs()))
            };
            let most = per_unit(acceleration) * ROUNDING;
            let along = (self.a.dot(&missing) / square).clamp(-most, most);
            missing * Brake::new(most, per_unit(jerk), dt).step(1.0, along).1
        } else {
            JointVector::zeros()
        };
        let change = wanted - self.a;
        let whole = change.zip_fold(jerk, 1.0, |part: f64, c, j| part.min(j * dt / c.abs()));
        let a = self.a + change * (whole * ROUNDING);
        let v = self.v + a * dt;
        Self { q: self.q + v * dt, v, a }
    }
}
