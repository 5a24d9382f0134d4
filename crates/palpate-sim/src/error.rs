//! What can go wrong.

use palpate_robot_io::{BackendError, FaultKind};
use palpate_spatial::JointVector;

/// Why the simulation refused or failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// A setting that makes no sense.
    #[error("sim.{key} is {value}, but it must be {must}")]
    Setting {
        /// Where in `[sim]`.
        key: &'static str,
        /// What it is, SI.
        value: f64,
        /// What would work.
        must: String,
    },
    /// The held part starts inside the other one.
    #[error("the tool starts {:.3} mm inside the board or bolt: raise its start by at least that", depth * 1e3)]
    Overlap {
        /// The way out, m.
        depth: f64,
    },
    /// The tool starts inside an obstacle.
    #[error("the tool starts {:.3} mm inside obstacle {index}: move one of them by at least that", depth * 1e3)]
    Obstructed {
        /// Which of `sim.obstacles`, from 0.
        index: usize,
        /// The way out, m.
        depth: f64,
    },
    /// A command that is not finite.
    #[error("joint command is not finite: {0:?}")]
    NotFinite(JointVector),
    /// A command after `stop`.
    #[error("the simulated arm is stopped: call recover first")]
    Stopped,
    /// The physics engine broke down.
    #[error("the physics engine broke down ({what}): recover rebuilds the world")]
    Engine {
        /// A panic or a result that is not finite.
        what: EngineFault,
    },
}

/// How the physics engine broke down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EngineFault {
    /// It panicked.
    Panic,
    /// A force, pose or velocity is not finite.
    NotFinite,
}

impl std::fmt::Display for EngineFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Panic => "panic",
            Self::NotFinite => "non-finite state",
        })
    }
}

impl BackendError for SimError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Setting { .. } | Self::Overlap { .. } | Self::Obstructed { .. } => {
                FaultKind::Internal
            }
            Self::NotFinite(_) => FaultKind::InvalidCommand,
            Self::Stopped => FaultKind::Stopped,
            Self::Engine { .. } => FaultKind::Simulation,
        }
    }
}
