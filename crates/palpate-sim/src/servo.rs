//! The arm's position servo: a dead time and a first-order lag in each joint.

use std::collections::VecDeque;

use palpate_spatial::JointVector;

use crate::config::ServoConfig;

/// Remaining distance to the set-point at which the arm counts as at rest, rad.
const AT_REST: f64 = 1e-6;

/// Joints that follow their set-points late.
#[derive(Debug)]
pub(crate) struct Servo {
    /// Part of the remaining distance covered per tick: 1 − exp(−dt/lag).
    follow: f64,
    dt: f64,
    /// rad.
    pub(crate) q: JointVector,
    /// rad/s.
    pub(crate) dq: JointVector,
    /// Newest set-point, rad.
    pub(crate) q_target: JointVector,
    /// Set-points on their way through the dead time, oldest first.
    delayed: VecDeque<JointVector>,
}

impl Servo {
    /// At rest at `q`, advanced `dt` seconds per tick.
    pub(crate) fn new(config: &ServoConfig, dt: f64, q: JointVector) -> Self {
        let dead_ticks = (config.dead_time / dt).round() as usize;
        Self {
            follow: if config.lag > 0.0 { -(-dt / config.lag).exp_m1() } else { 1.0 },
            dt,
            q,
            dq: JointVector::zeros(),
            q_target: q,
            delayed: VecDeque::from(vec![q; dead_ticks]),
        }
    }

    /// The exact step of q̇ = (q_set − q)/lag for a set-point held over the tick.
    pub(crate) fn tick(&mut self) {
        let mut set = self.q_target;
        if let Some(oldest) = self.delayed.pop_front() {
            self.delayed.push_back(set);
            set = oldest;
        }
        let step = (set - self.q) * self.follow;
        self.q += step;
        self.dq = step / self.dt;
    }

    /// Stands still where it is.
    pub(crate) fn halt(&mut self) {
        self.place(self.q);
    }

    /// Stands still at `q`.
    pub(crate) fn place(&mut self, q: JointVector) {
        self.q = q;
        self.dq.fill(0.0);
        self.q_target = q;
        self.delayed.iter_mut().for_each(|d| *d = q);
    }

    /// Lands on a set-point that the lag has all but reached, so that what follows is exact.
    pub(crate) fn settle(&mut self) {
        let on_the_way = self.delayed.iter().all(|d| *d == self.q_target);
        if on_the_way && (self.q_target - self.q).amax() < AT_REST {
            self.place(self.q_target);
        }
    }
}
