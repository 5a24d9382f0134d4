//! The arm's commanded motion: the set-points sent so far, as position, speed and acceleration.

#![expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must fail")]

use palpate_spatial::{DOF, JointVector};

use super::brake::Brake;

/// Part of the limits for motion along the way; the rest is for what is across it.
pub(crate) const MAIN: f64 = 0.8;

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

    /// One tick towards the steady speed `v` with all joints in step, so that the tool keeps its direction.
    ///
    /// What there is of speed and acceleration along `v` follows one brake's law for the whole arm, within
    /// [`MAIN`] of the limits; what is across it dies out joint by joint within the rest (`side`). None without
    /// a direction. The sum may still break a limit: check it.
    pub(crate) fn together(
        &self,
        v: &JointVector,
        acceleration: &JointVector,
        jerk: &JointVector,
        side: &[Brake; DOF],
        dt: f64,
    ) -> Option<Self> {
        let square = v.norm_squared();
        if !(square > 1e-18) {
            return None;
        }
        let (speed, rise) = (self.v.dot(v) / square, self.a.dot(v) / square);
        let per_unit = |limit: &JointVector| {
            limit.zip_fold(v, f64::INFINITY, |least: f64, l, v| least.min(l / v.abs()))
        };
        let path = Brake::new(MAIN * per_unit(acceleration), MAIN * per_unit(jerk), dt);
        let (missing, next_rise) = path.step(speed - 1.0, rise);
        let mut next = *self;
        for (i, brake) in side.iter().enumerate() {
            let (across, a) = brake.step(self.v[i] - speed * v[i], self.a[i] - rise * v[i]);
            next.v[i] = across + (missing + 1.0) * v[i];
            next.a[i] = a + next_rise * v[i];
            next.q[i] += next.v[i] * dt;
        }
        Some(next)
    }
}
