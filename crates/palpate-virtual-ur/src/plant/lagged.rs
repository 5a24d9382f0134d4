//! An arm in free air behind a first-order lag.

use palpate_spatial::{JointVector, Wrench};

use super::{Plant, PlantError, PlantState};

/// Follows set-points 4 ms late and feels nothing: without lookahead a UR lags by two to three cycles.
#[derive(Clone, Debug)]
pub struct LaggedArm {
    q: JointVector,
    /// Part of the remaining distance covered per cycle: 1 − exp(−2/4).
    follow: f64,
}

impl LaggedArm {
    const LAG: f64 = 0.004;
    const DT: f64 = 0.002;

    /// At rest at `q`, rad.
    pub fn at(q: JointVector) -> Self {
        Self { q, follow: -(-Self::DT / Self::LAG).exp_m1() }
    }
}

impl Plant for LaggedArm {
    fn start(&self) -> JointVector {
        self.q
    }

    fn step(&mut self, q_target: &JointVector) -> Result<PlantState, PlantError> {
        let step = (q_target - self.q) * self.follow;
        self.q += step;
        Ok(PlantState { q: self.q, dq: step / Self::DT, wrench: Wrench::zero() })
    }

    fn zero_sensor(&mut self) {}
}
