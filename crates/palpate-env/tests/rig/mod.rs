//! An environment with the project's own settings around any arm.

use palpate_control::{ControlConfig, PolicyModel};
use palpate_env::{Env, EnvConfig, RewardConfig, TaskConfig};
use palpate_kinematics::SerialChain;
use palpate_robot_io::RobotBackend;
use palpate_safety::{Safe, SafetyConfig};
use palpate_spatial::{Pose, UnitQuaternion, Vector3};

#[derive(serde::Deserialize)]
pub(crate) struct Preset {
    control: ControlConfig,
    pub(crate) safety: SafetyConfig,
    pub(crate) env: EnvConfig,
    pub(crate) reward: RewardConfig,
}

#[derive(serde::Deserialize)]
struct Task {
    task: TaskConfig,
}

const ASSETS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets");

fn read(path: &str) -> String {
    std::fs::read_to_string(format!("{ASSETS}/{path}")).unwrap()
}

pub(crate) fn task() -> TaskConfig {
    toml::from_str::<Task>(&read("tasks/peg-insertion.toml")).unwrap().task
}

pub(crate) fn flange() -> SerialChain<6> {
    SerialChain::from_urdf_file(format!("{ASSETS}/robots/ur3e.urdf"), "base_link", "tool0").unwrap()
}

pub(crate) fn tool0_T_tool() -> Pose {
    let tip = Vector3::new(0.0, 0.0, 0.15);
    Pose::from_parts(tip.into(), UnitQuaternion::identity())
}

/// A policy model's environment on `arm`, with settings changed.
pub(crate) fn env<B: RobotBackend>(
    arm: B,
    model: &str,
    seed: u64,
    change: impl FnOnce(&mut Preset, &mut TaskConfig),
) -> Env<Safe<B>> {
    let mut preset: Preset = toml::from_str(&read("presets/palpate.toml")).unwrap();
    let mut task = task();
    change(&mut preset, &mut task);
    let model: PolicyModel = toml::from_str(&read(&format!("policies/{model}.toml"))).unwrap();
    let robot = Safe::new(arm, flange(), tool0_T_tool(), preset.safety).unwrap();
    Env::new(robot, preset.env, task, preset.reward, &preset.control, &model, seed).unwrap()
}
