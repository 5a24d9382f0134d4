//! The environment behind the shield, on an ideal arm whose load the test sets.
#![expect(clippy::unwrap_used, reason = "our own settings load")]

mod rig;

use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

use palpate_env::{Env, EnvError, Outcome};
use palpate_robot_io::{IdealArm, IdealArmError, JointCommand, RobotBackend, RobotState};
use palpate_safety::Cause;
use palpate_safety::shield::Standing;
use palpate_safety::{Mode, Safe};
use palpate_spatial::JointVector;

/// Every set-point that was sent, and a force along tool z.
#[derive(Debug, Default)]
struct Seen {
    force: Cell<f64>,
    last: Cell<Option<(JointVector, JointVector)>>,
    worst_step_in_speed: Cell<f64>,
}

#[derive(Debug)]
struct Watched(IdealArm, Rc<Seen>);

impl RobotBackend for Watched {
    type Error = IdealArmError;
    fn period(&self) -> Duration {
        self.0.period()
    }
    fn read(&mut self) -> Result<RobotState, Self::Error> {
        self.0.load.force.z = self.1.force.get();
        self.0.read()
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), Self::Error> {
        let seen = &self.1;
        if let Some((q, v)) = seen.last.get() {
            let now = (command.q - q) / 0.002;
            seen.worst_step_in_speed.set(seen.worst_step_in_speed.get().max((now - v).amax()));
            seen.last.set(Some((command.q, now)));
        } else {
            seen.last.set(Some((command.q, JointVector::zeros())));
        }
        self.0.write(command)
    }
    fn stop(&mut self) -> Result<(), Self::Error> {
        self.0.stop()
    }
    fn recover(&mut self) -> Result<(), Self::Error> {
        self.0.recover()
    }
    fn tare(&mut self) -> Result<(), Self::Error> {
        self.0.tare()
    }
}

fn env(mode: Mode) -> (Env<Safe<Watched>>, Rc<Seen>) {
    let seen = Rc::new(Seen::default());
    let arm = Watched(IdealArm::at(rig::task().q_home), Rc::clone(&seen));
    let env = rig::env(arm, "p-14", 3, |preset, _| preset.safety.mode = mode);
    (env, seen)
}

/// Steps to the end of the episode.
fn outcome(env: &mut Env<Safe<Watched>>, action: &[f64; 14]) -> Outcome {
    loop {
        if let Some(summary) = env.step(action).unwrap().summary {
            return summary.outcome;
        }
    }
}

#[test]
fn episodes_run_to_their_end_and_every_start_is_reached() {
    let (mut env, seen) = env(Mode::Shield);
    for episode in 0..5 {
        env.reset().unwrap();
        let start = env.task().draw(3, episode).base_T_start;
        let tool = env.measurement().unwrap().base_T_tool;
        assert!((tool.translation.vector - start.translation.vector).norm() < 1e-6);
        assert!(tool.rotation.angle_to(&start.rotation) < 1e-6);
        let _ = env.step(&[0.8; 14]).unwrap();
        let _ = env.step(&[-0.8; 14]).unwrap();
        assert_eq!(outcome(&mut env, &[0.0; 14]), Outcome::Success);
        assert_eq!(env.robot().standing(), Standing::AtRest, "nobody commands it now");
    }
    // 30 rad/s² for 2 ms.
    let worst = seen.worst_step_in_speed.get();
    assert!(worst < 0.0601, "{worst} rad/s from one set-point to the next");
}

/// The reason for the shield: without it the same episodes send steps in speed that a real arm answers with a
/// protective stop.
#[test]
fn without_it_the_same_episodes_jerk_the_arm() {
    let (mut env, seen) = env(Mode::ForceFirst);
    env.reset().unwrap();
    let _ = env.step(&[0.8; 14]).unwrap();
    let _ = env.step(&[-0.8; 14]).unwrap();
    assert!(seen.worst_step_in_speed.get() > 0.1, "{}", seen.worst_step_in_speed.get());
}

#[test]
fn a_collision_ends_at_rest_and_the_next_reset_recovers() {
    let (mut env, seen) = env(Mode::Shield);
    env.reset().unwrap();
    let _ = env.step(&[0.3; 14]).unwrap();
    seen.force.set(-30.0);
    assert_eq!(outcome(&mut env, &[0.3; 14]), Outcome::Collision);
    assert_eq!(env.robot().standing(), Standing::AtRest);
    let counts = env.robot().ledger().counts();
    assert_eq!(counts.of(Cause::ForceSoft) + counts.of(Cause::ForceHard), 1);
    assert!(counts.of(Cause::Stopped) > 0);
    seen.force.set(0.0);
    env.reset().unwrap();
    assert_eq!(outcome(&mut env, &[0.0; 14]), Outcome::Success);
    assert_eq!(env.robot().tally().force, 1);
}

#[test]
fn an_arm_that_cannot_get_back_asks_a_person() {
    let (mut env, seen) = env(Mode::Shield);
    env.reset().unwrap();
    seen.force.set(-70.0); // beyond the reset's 60 N, for ever
    assert_eq!(outcome(&mut env, &[0.0; 14]), Outcome::Collision);
    let error = env.reset().unwrap_err();
    assert!(matches!(&error, EnvError::AskHuman { tries: 3, last } if last.contains("blocked")));
    assert!(error.to_string().contains("a person must look"), "{error}");
    assert_eq!(env.robot().standing(), Standing::AtRest);
}
