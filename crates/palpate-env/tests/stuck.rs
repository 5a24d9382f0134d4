//! A tool that does not come free: a simulation begins afresh, an arm asks for a person.
#![expect(clippy::unwrap_used, reason = "our own settings load")]

mod rig;

use std::time::Duration;

use palpate_env::EnvError;
use palpate_kinematics::{IkOptions, SerialChain};
use palpate_robot_io::{IdealArm, IdealArmError, JointCommand, RobotBackend, RobotState};
use palpate_safety::Mode;
use palpate_spatial::JointVector;

/// Pulls at the tool while it is stuck. Beyond the limits of the preset, N.
const PULL: f64 = -500.0;

#[derive(Debug)]
struct Stuck {
    arm: IdealArm,
    simulated: bool,
    /// Holds the tool as a glue does: 20 N/mm against any motion up from this height, m.
    glued_at: Option<f64>,
}

impl RobotBackend for Stuck {
    type Error = IdealArmError;
    fn period(&self) -> Duration {
        self.arm.period()
    }
    fn read(&mut self) -> Result<RobotState, Self::Error> {
        let state = self.arm.read()?;
        if let Some(height) = self.glued_at {
            // The flange looks down: what pulls the tool down is along its +z.
            self.arm.load.force.z =
                2e4 * (chain().forward(&state.q).translation.z - height).max(0.0);
        }
        Ok(state)
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

fn chain() -> SerialChain<6> {
    rig::flange().with_tool(rig::tool0_T_tool())
}

fn home() -> JointVector {
    rig::task().q_home
}

fn stuck(simulated: bool) -> Stuck {
    let mut arm = IdealArm::at(home());
    arm.load.force.z = PULL;
    Stuck { arm, simulated, glued_at: None }
}

fn force_first(preset: &mut rig::Preset, _: &mut palpate_env::TaskConfig) {
    preset.safety.mode = Mode::ForceFirst;
}

#[test]
fn a_simulated_tool_that_is_stuck_gets_a_fresh_world() {
    let mut env = rig::env(stuck(true), "p-14", 1, force_first);
    env.reset().unwrap();
    assert_eq!(env.rebuilt(), 1);
    let start = env.task().draw(1, 0).base_T_start;
    let tool = env.measurement().unwrap().base_T_tool;
    assert!((tool.translation.vector - start.translation.vector).norm() < 1e-6);
    assert!(env.step(&[0.0; 14]).unwrap().summary.is_none());
}

#[test]
fn an_arm_whose_tool_is_stuck_is_left_to_a_person() {
    let mut env = rig::env(stuck(false), "p-14", 1, force_first);
    assert!(matches!(env.reset(), Err(EnvError::ResetForce(_))));
    assert_eq!(env.rebuilt(), 0);
}

/// A shield slows pulling down to nothing before any limit is reached: this must end all the same.
#[test]
fn a_tool_that_is_held_below_every_limit_is_not_pulled_at_for_ever() {
    for shielded in [false, true] {
        let chain = chain();
        let options = IkOptions::default();
        let deep = chain.solve_near(&rig::task().base_T_goal(), &home(), &options).unwrap().q;
        let height = chain.forward(&deep).translation.z;
        let glued = Stuck { arm: IdealArm::at(deep), simulated: false, glued_at: Some(height) };
        let mut env = rig::env(glued, "p-14", 1, |preset, _| {
            preset.safety.mode = if shielded { Mode::Shield } else { Mode::ForceFirst };
        });
        match env.reset().unwrap_err() {
            EnvError::ResetStuck { force, .. } if !shielded => {
                assert!((20.0..60.0).contains(&force), "{force}");
            }
            EnvError::AskHuman { tries: 3, last } if shielded => {
                assert!(last.contains("goes no further"), "{last}");
            }
            other => panic!("{other}"),
        }
    }
}
