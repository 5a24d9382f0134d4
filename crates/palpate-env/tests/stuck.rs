//! A tool that does not come free: a simulation begins afresh, an arm asks for a person.
#![expect(clippy::unwrap_used, reason = "our own settings load")]

mod rig;

use std::time::Duration;

use palpate_env::EnvError;
use palpate_robot_io::{IdealArm, IdealArmError, JointCommand, RobotBackend, RobotState};
use palpate_spatial::JointVector;

/// Pulls at the tool while it is stuck. Beyond the limits of the preset, N.
const PULL: f64 = -500.0;

#[derive(Debug)]
struct Stuck {
    arm: IdealArm,
    simulated: bool,
}

impl RobotBackend for Stuck {
    type Error = IdealArmError;
    fn period(&self) -> Duration {
        self.arm.period()
    }
    fn read(&mut self) -> Result<RobotState, Self::Error> {
        self.arm.read()
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), Self::Error> {
        self.arm.write(command)
    }
    fn stop(&mut self) -> Result<(), Self::Error> {
        self.arm.stop()
    }
    fn recover(&mut self) -> Result<(), Self::Error> {
        self.arm.recover()
    }
    fn tare(&mut self) -> Result<(), Self::Error> {
        self.arm.tare()
    }
    fn rebuild(&mut self) -> bool {
        if self.simulated {
            self.arm = IdealArm::at(home());
        }
        self.simulated
    }
}

fn home() -> JointVector {
    rig::task().q_home
}

fn stuck(simulated: bool) -> Stuck {
    let mut arm = IdealArm::at(home());
    arm.load.force.z = PULL;
    Stuck { arm, simulated }
}

#[test]
fn a_simulated_tool_that_is_stuck_gets_a_fresh_world() {
    let mut env = rig::env(stuck(true), "p-14", 1, |_, _| {});
    env.reset().unwrap();
    assert_eq!(env.rebuilt(), 1);
    let start = env.task().draw(1, 0).base_T_start;
    let tool = env.measurement().unwrap().base_T_tool;
    assert!((tool.translation.vector - start.translation.vector).norm() < 1e-6);
    assert!(env.step(&[0.0; 14]).unwrap().summary.is_none());
}

#[test]
fn an_arm_whose_tool_is_stuck_is_left_to_a_person() {
    let mut env = rig::env(stuck(false), "p-14", 1, |_, _| {});
    assert!(matches!(env.reset(), Err(EnvError::ResetForce(_))));
    assert_eq!(env.rebuilt(), 0);
}
