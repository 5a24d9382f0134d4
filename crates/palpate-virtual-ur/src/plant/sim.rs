//! The contact world of `palpate-sim` behind the controller.

use palpate_robot_io::{JointCommand, RobotBackend};
use palpate_sim::SimArm;
use palpate_spatial::JointVector;

use super::{Plant, PlantError, PlantState};

/// A [`SimArm`]: servo lag, sensor and contact are the simulator's own.
#[derive(Debug)]
pub struct ContactArm {
    arm: SimArm,
    start: JointVector,
}

impl ContactArm {
    /// An arm that stands at `start`, rad.
    pub fn new(arm: SimArm, start: JointVector) -> Self {
        Self { arm, start }
    }

    fn advance(&mut self, q_target: &JointVector) -> Result<PlantState, palpate_sim::SimError> {
        self.arm.write(&JointCommand { q: *q_target })?;
        let state = self.arm.read()?;
        Ok(PlantState { q: state.q, dq: state.dq, wrench: state.sensor_wrench })
    }
}

impl Plant for ContactArm {
    fn start(&self) -> JointVector {
        self.start
    }

    fn step(&mut self, q_target: &JointVector) -> Result<PlantState, PlantError> {
        self.advance(q_target).map_err(|e| PlantError(e.to_string()))
    }

    /// The arm stands at its start again, in a new world.
    fn restart(&mut self) -> JointVector {
        // A simulator without a fault has nothing to recover from, one with a fault always can.
        _ = self.arm.recover();
        self.start
    }

    /// As on the arm: in free air at rest the simulator also rebuilds its world there.
    fn zero_sensor(&mut self) {
        // A tare of the simulator cannot fail.
        _ = self.arm.tare();
    }
}
