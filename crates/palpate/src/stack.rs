//! Builds the simulated stack: arm, fail-safe layer, environment.

use anyhow::Context as _;
use palpate_env::Env;
use palpate_kinematics::SerialChain;
use palpate_robot_io::RobotBackend;
use palpate_safety::Safe;
use palpate_sim::SimArm;
use palpate_spatial::{DOF, Pose, Vector3};

use crate::Config;
use crate::config::{ROBOTS, RobotConfig};

/// The environment in simulation.
pub type SimEnv = Env<Safe<SimArm>>;

/// What an environment's episodes are for; each purpose draws from its own stream of the seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Training episodes.
    Train,
    /// Frozen starts of the evaluations during training.
    Monitor,
    /// Fresh episodes of `evaluate`.
    Evaluate,
    /// The exploration of a policy that acts on an arm in real time.
    Explore,
    /// Episodes of `demonstrate`.
    Demonstrate,
}

/// Builds the simulated environment.
pub fn sim_env(config: &Config, seed: u64, purpose: Purpose) -> anyhow::Result<SimEnv> {
    let chain = chain(&config.robot)?;
    let arm = sim_arm(config, &chain, seed, purpose)?;
    env(config, chain, arm, seed, purpose)
}

/// Builds the simulated arm alone.
pub(crate) fn sim_arm(
    config: &Config,
    chain: &SerialChain<DOF>,
    seed: u64,
    purpose: Purpose,
) -> anyhow::Result<SimArm> {
    Ok(SimArm::new(
        chain.clone(),
        config.task.base_T_hole(),
        &config.sim,
        config.task.q_home,
        stream(seed, purpose),
    )?)
}

/// Puts the fail-safe layer and the environment around an arm.
pub fn env<B: RobotBackend>(
    config: &Config,
    chain: SerialChain<DOF>,
    arm: B,
    seed: u64,
    purpose: Purpose,
) -> anyhow::Result<Env<Safe<B>>> {
    let robot = Safe::new(arm, chain, tool0_T_tool(&config.robot), config.safety.clone())?;
    Ok(Env::new(
        robot,
        config.env.clone(),
        config.task.clone(),
        config.reward.clone(),
        &config.control,
        &config.policy,
        stream(seed, purpose),
    )?)
}

/// The tool centre point.
pub(crate) fn tool0_T_tool(robot: &RobotConfig) -> Pose {
    Pose::from_parts(Vector3::from(robot.tcp).into(), nalgebra::UnitQuaternion::identity())
}

/// Loads the arm's chain from a built-in or a user's URDF.
pub fn chain(robot: &RobotConfig) -> anyhow::Result<SerialChain<DOF>> {
    let built_in = ROBOTS.iter().find(|(name, _)| *name == robot.urdf);
    let chain = match built_in {
        Some((_, text)) => SerialChain::from_urdf_str(text, &robot.base_link, &robot.tip_link),
        None => SerialChain::from_urdf_file(&robot.urdf, &robot.base_link, &robot.tip_link),
    };
    chain.with_context(|| format!("cannot use the robot `{}`", robot.urdf))
}

/// SplitMix64 of the seed and the purpose, so that no two purposes share draws.
pub(crate) fn stream(seed: u64, purpose: Purpose) -> u64 {
    let mut z = seed.wrapping_add(0x9E37_79B9_7F4A_7C15u64.wrapping_mul(purpose as u64 + 1));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
