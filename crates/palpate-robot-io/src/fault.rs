//! Faults reduced to a small set of kinds that generic code can react to.

/// What went wrong, as far as the code above a backend needs to know.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub enum FaultKind {
    /// The connection is lost or stalled.
    Link,
    /// The other side sent something that is not the protocol.
    Protocol,
    /// The robot is in a state that takes no commands (protective stop, local mode, …).
    RobotState,
    /// The force/torque sensor's data cannot be trusted.
    Sensor,
    /// The command itself was refused (non-finite, out of range).
    InvalidCommand,
    /// The backend was stopped and not yet recovered.
    Stopped,
    /// A deadline was missed.
    Timing,
    /// The simulation broke down (non-finite state, engine fault).
    Simulation,
    /// Anything else.
    Internal,
}

/// An error of a backend: as detailed as it likes, reducible to a [`FaultKind`].
pub trait BackendError: std::error::Error + Send + Sync + 'static {
    /// The kind of fault, for code that is generic over backends.
    fn kind(&self) -> FaultKind;
}
