//! What is read from an arm and what is written to it.

use palpate_spatial::{JointVector, Wrench};

/// One sample of an arm.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RobotState {
    /// The robot's own clock, s. Strictly increasing from sample to sample.
    pub time: f64,
    /// Measured joint positions, rad.
    pub q: JointVector,
    /// Measured joint velocities, rad/s.
    pub dq: JointVector,
    /// Joint set-point the arm is following now, rad.
    pub q_target: JointVector,
    /// What the environment does to the tool: tool0 axes, about the tool0 origin (the F/T sensor),
    /// tared, unfiltered.
    pub sensor_wrench: Wrench,
}

impl RobotState {
    /// Whether every number in the sample is finite.
    pub fn is_finite(&self) -> bool {
        self.time.is_finite()
            && self.q.iter().chain(&self.dq).chain(&self.q_target).all(|x| x.is_finite())
            && self.sensor_wrench.is_finite()
    }
}

/// A joint set-point for the next period.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct JointCommand {
    /// Joint positions, rad.
    pub q: JointVector,
}
