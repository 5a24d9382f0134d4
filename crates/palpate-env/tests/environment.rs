//! The environment on an ideal arm in free air: loops, episodes, draws and endings.
#![expect(clippy::unwrap_used, reason = "our own settings load")]

mod rig;

use palpate_env::{Distribution, Env, EnvConfig, EnvError, Outcome, TaskConfig};
use palpate_robot_io::IdealArm;
use palpate_safety::{Cause, Mode, Safe};
use palpate_spatial::{JointVector, Twist, Vector3};

fn env(seed: u64, change: impl FnOnce(&mut EnvConfig, &mut TaskConfig)) -> Env<Safe<IdealArm>> {
    env_of("p-14", seed, change)
}

fn env_of(
    model: &str,
    seed: u64,
    change: impl FnOnce(&mut EnvConfig, &mut TaskConfig),
) -> Env<Safe<IdealArm>> {
    let arm = IdealArm::at(rig::task().q_home);
    rig::env(arm, model, seed, |preset, task| change(&mut preset.env, task))
}

fn fixed(_: &mut EnvConfig, task: &mut TaskConfig) {
    task.distribution = Distribution::Fixed;
}

#[test]
fn reset_reaches_the_drawn_start_and_the_first_reward_scale_is_the_start_error() {
    let mut env = env(3, |_, _| {});
    for episode in 0..5 {
        env.reset().unwrap();
        let start = env.task().draw(3, episode).base_T_start;
        let tool = env.measurement().unwrap().base_T_tool;
        assert!((tool.translation.vector - start.translation.vector).norm() < 1e-6);
        assert!(tool.rotation.angle_to(&start.rotation) < 1e-6);
        assert_eq!(env.observation().len(), 18);
        assert!(
            env.observation().iter().all(|x| x.abs() < 3.0),
            "order one: {:?}",
            env.observation()
        );
    }
}

#[test]
fn position_control_alone_carries_a_tool_through_free_air_to_the_goal() {
    let mut env = env(1, fixed);
    env.reset().unwrap();
    let summary = loop {
        let step = env.step(&[0.0; 14]).unwrap();
        if let Some(summary) = step.summary {
            assert!(step.terminated && !step.truncated);
            assert!(step.reward.terminal > 100.0);
            break summary;
        }
    };
    assert_eq!(summary.outcome, Outcome::Success);
    assert!(summary.final_distance < 0.004);
    assert_eq!(summary.seconds, f64::from(summary.steps) * 0.05);
    assert!(matches!(env.step(&[0.0; 14]), Err(EnvError::NoEpisode)), "the episode is over");
}

#[test]
fn the_time_limit_truncates_and_does_not_terminate() {
    let mut env = env(1, |config, task| {
        fixed(config, task);
        config.max_steps = 5;
    });
    env.reset().unwrap();
    for _ in 0..4 {
        let step = env.step(&[0.0; 14]).unwrap();
        assert!(!step.terminated && !step.truncated && step.summary.is_none());
    }
    let last = env.step(&[0.0; 14]).unwrap();
    assert!(last.truncated && !last.terminated);
    assert_eq!(last.summary.unwrap().outcome, Outcome::TimeLimit);
}

#[test]
fn a_bad_action_is_refused_and_the_episode_goes_on() {
    let mut env = env(1, fixed);
    env.reset().unwrap();
    assert!(env.step(&[0.0; 13]).is_err());
    let mut action = [0.0; 14];
    action[7] = f64::NAN;
    assert!(env.step(&action).is_err());
    assert!(env.step(&[0.0; 14]).is_ok());
}

#[test]
fn motion_actions_move_the_tool_the_way_they_point() {
    let mut env = env(1, fixed);
    env.reset().unwrap();
    let before = env.measurement().unwrap().base_T_tool.translation.vector;
    let mut still = self::env(1, fixed);
    still.reset().unwrap();
    let mut action = [0.0; 14];
    action[1] = 1.0;
    env.step(&action).unwrap();
    still.step(&[0.0; 14]).unwrap();
    let moved = env.measurement().unwrap().base_T_tool.translation.vector - before;
    let alone = still.measurement().unwrap().base_T_tool.translation.vector - before;
    // a_x = 20 mm/s along base y for 50 ms, less the lag.
    let by = (moved - alone).y;
    assert!(by > 0.8e-3 && by <= 1.0e-3, "{by}");
}

#[test]
fn draws_depend_on_seed_and_episode_alone() {
    let task = env(1, |_, _| {}).task().clone();
    assert_eq!(task.draw(5, 7), task.draw(5, 7));
    assert_ne!(task.draw(5, 7), task.draw(5, 8));
    assert_ne!(task.draw(5, 7), task.draw(6, 7));
    let nominal = task.base_T_goal().translation.vector;
    let mut widest = Vector3::zeros();
    for episode in 0..500 {
        let offset = (task.draw(5, episode).base_T_believed.translation.vector - nominal).abs();
        widest = widest.sup(&offset);
    }
    // The hole's x and y are base y and x here; ±1 mm, ±0.5 mm along the axis.
    assert!(widest.x <= 1.0e-3 && widest.x > 0.9e-3, "{widest}");
    assert!(widest.z <= 0.5e-3 && widest.z > 0.45e-3, "{widest}");
}

#[test]
fn the_same_episode_is_bitwise_the_same_whatever_came_before() {
    let run = |env: &mut Env<Safe<IdealArm>>| {
        env.set_next_episode(9);
        env.reset().unwrap();
        (0..10).map(|_| env.step(&[0.3; 14]).unwrap().reward.total()).collect::<Vec<_>>()
    };
    let mut fresh = env(4, |_, _| {});
    let mut used = env(4, |_, _| {});
    used.reset().unwrap();
    used.step(&[-1.0; 14]).unwrap();
    assert_eq!(run(&mut fresh), run(&mut used));
}

#[test]
fn no_model_oscillates_in_free_air_at_the_ends_of_its_gains() {
    for model in ["p-6", "p-9", "p-14", "p-19", "p-24", "a-8", "a-13", "a-13pd", "a-18"] {
        for gain in [-1.0, 0.0, 1.0] {
            let mut env = env_of(model, 1, fixed);
            env.reset().unwrap();
            let mut action = vec![gain; env.action_dim()];
            action[..6].fill(0.0);
            let mut last = env.believed_error().unwrap();
            let mut over = false;
            while !over {
                over = env.step(&action).unwrap().summary.is_some();
                let error = env.believed_error().unwrap();
                for axis in 0..6 {
                    // Towards the goal on every axis, never past it: 10 µm and 10 µrad are the lag's.
                    assert!(
                        error[axis].abs() <= last[axis].abs() + 1e-5,
                        "{model} at {gain}, axis {axis}: {} after {}",
                        error[axis],
                        last[axis]
                    );
                }
                last = error;
            }
        }
    }
}

/// An environment whose arm is too slow for anything but the way to the start.
fn held(q: JointVector, change: impl FnOnce(&mut rig::Preset)) -> Env<Safe<IdealArm>> {
    rig::env(IdealArm::at(q), "p-14", 7, |preset, task| {
        fixed(&mut preset.env, task);
        preset.safety.mode = Mode::ForceFirst;
        preset.safety.joint_velocity_max.fill(0.05);
        (preset.env.reset.linear_speed, preset.env.reset.joint_speed) = (0.005, 0.02);
        change(preset);
    })
}

const FAST: [f64; 14] = [0.6, -0.5, 0.7, 0.3, 0.2, -0.3, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5];

/// What was executed where every command was refused is an action that moves nothing; and where nothing is refused,
/// it does move little: the law's own part changes within a step.
#[test]
fn the_executed_action_is_the_one_that_moves_the_arm_as_it_was_moved() {
    let moved = |env: &mut Env<Safe<IdealArm>>, action: &[f64]| {
        let at =
            |env: &Env<Safe<IdealArm>>| env.measurement().unwrap().base_T_tool.translation.vector;
        let before = at(env);
        let step = env.step(action).unwrap();
        (step, (at(env) - before).norm())
    };
    // Nothing shapes what it does.
    let free = || {
        rig::env(IdealArm::at(rig::task().q_home), "p-14", 7, |preset, task| {
            fixed(&mut preset.env, task);
            preset.safety.mode = Mode::ForceFirst;
        })
    };
    let (mut free, mut again) = (free(), free());
    free.reset().unwrap();
    again.reset().unwrap();
    let mut held = held(rig::task().q_home, |_| {});
    held.reset().unwrap();

    let (passed, far) = moved(&mut free, &FAST);
    assert_eq!(passed.deviation, Twist::zero());
    let (refused, nowhere) = moved(&mut held, &FAST);
    assert!(nowhere < 1e-3 * far && far > 5e-4, "{nowhere} {far}");
    let mut executed = FAST.map(|a| a as f32);
    held.executed(&mut executed, &refused.deviation);
    assert_eq!(executed[6..], FAST.map(|a| a as f32)[6..], "gains are executed as proposed");
    let (_, little) = moved(&mut again, &executed.map(f64::from));
    assert!(little < 0.3 * far, "{little} of {far}");
}

#[test]
fn verdicts_have_a_price_by_cause_and_are_counted() {
    let mut env = held(rig::task().q_home, |preset| {
        preset.env.max_steps = 1;
        preset.reward.verdicts.insert(Cause::JointSpeed, -0.25);
        preset.reward.verdicts.insert(Cause::NoIk, -100.0);
    });
    env.reset().unwrap();
    let step = env.step(&FAST).unwrap();
    assert_eq!(step.reward.verdicts, -0.25 * 25.0);
    let verdicts = step.summary.unwrap().verdicts;
    assert_eq!((verdicts.of(Cause::JointSpeed), verdicts.of(Cause::NoIk)), (25, 0));
    let entry = *env.ledger_mut().entries().last().unwrap();
    assert_eq!((entry.cause, entry.ticks), (Cause::JointSpeed, 25));
    assert!(entry.distance < 0.0 && entry.proposed.is_some_and(|q| q != entry.executed));
}
