//! What can go wrong in an environment.

use palpate_control::ControlError;
use palpate_kinematics::IkError;
use palpate_robot_io::FaultKind;
use palpate_safety::{Excess, Guarded, Refusal};

use crate::config::ConfigError;

/// An error of the environment; `E` is the robot's.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EnvError<E: std::error::Error + 'static> {
    /// The robot failed.
    #[error(transparent)]
    Robot(E),
    /// The action was refused (wrong length, not finite).
    #[error(transparent)]
    Control(#[from] ControlError),
    /// A setting makes no sense.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The start pose of an episode has no joint solution near `task.q_home`.
    #[error("the episode's start pose cannot be reached from task.q_home: {0}")]
    StartUnreachable(IkError),
    /// The way back to the start pressed too hard.
    #[error("the way back to the start is blocked: {0}")]
    ResetForce(Excess),
    /// The way back to the start was refused.
    #[error("the way back to the start was refused: {0}")]
    ResetRefused(Refusal),
    /// The way back to the start leads nowhere: what holds the tool.
    #[error(
        "the way back to the start goes no further: {force:.0} N and {torque:.1} N·m hold the tool"
    )]
    ResetStuck {
        /// Norm of the contact force, N.
        force: f64,
        /// Norm of the contact torque about the tool centre point, N·m.
        torque: f64,
    },
    /// The way back failed too often: a person must look.
    #[error(
        "{tries} tries to drive back to the start failed; a person must look at the arm. The last one: {last}"
    )]
    AskHuman {
        /// Tries.
        tries: u32,
        /// How the last one failed.
        last: String,
    },
    /// `step` was called before `reset` or after the episode's end.
    #[error("no episode is under way: call reset first")]
    NoEpisode,
}

/// A tool that does not come free or a simulation that broke down: what a fresh world mends, if there can be one.
pub(crate) fn is_stuck<R: Guarded>(error: &EnvError<R::Error>) -> bool {
    match error {
        EnvError::Robot(e) => R::fault(e) == Some(FaultKind::Simulation),
        EnvError::ResetForce(_)
        | EnvError::ResetRefused(_)
        | EnvError::ResetStuck { .. }
        | EnvError::AskHuman { .. } => true,
        _ => false,
    }
}
