//! What the controller moves: an arm, and what its tool touches.

mod lagged;
#[cfg(feature = "sim")]
mod sim;

use palpate_spatial::{JointVector, Wrench};

pub use lagged::LaggedArm;
#[cfg(feature = "sim")]
pub use sim::ContactArm;

/// One sample of the arm and its sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantState {
    /// rad.
    pub q: JointVector,
    /// rad/s.
    pub dq: JointVector,
    /// What the environment does to the tool, tool0 axes, about the tool0 origin; N and N·m.
    pub wrench: Wrench,
}

/// The arm broke down: the controller reports a safety fault.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the arm broke down: {0}")]
pub struct PlantError(pub String);

/// An arm that follows joint set-points, one 2 ms cycle at a time.
pub trait Plant: Send {
    /// Joints at the beginning, rad.
    fn start(&self) -> JointVector;

    /// Follows the set-point for one cycle.
    ///
    /// # Errors
    /// The simulation behind it broke down.
    fn step(&mut self, q_target: &JointVector) -> Result<PlantState, PlantError>;

    /// Is whole again after a failed [`step`](Self::step); where its joints are then, rad.
    fn restart(&mut self) -> JointVector {
        self.start()
    }

    /// Makes the sensor read zero under its present load.
    fn zero_sensor(&mut self);
}
