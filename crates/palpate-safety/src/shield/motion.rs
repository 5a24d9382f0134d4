//! The arm's commanded motion: the set-points sent so far, as position, speed and acceleration.

use palpate_spatial::{DOF, JointVector};

use super::brake::Brake;

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
}
