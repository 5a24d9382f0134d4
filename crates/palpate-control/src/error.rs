//! Why a law, its gains, a policy model or an action was refused.

use crate::Law;

/// Axes in the order of every six-vector here.
pub(crate) const AXES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// Why a law, its gains, a policy model or an action was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ControlError {
    /// Gains of the other family.
    #[error("the {0} law was given the gains of the other law")]
    WrongLaw(Law),
    /// A number that makes no sense.
    #[error("{key} is {value}, but it must be {must}")]
    BadValue {
        /// Path of the key.
        key: String,
        /// Its value.
        value: f64,
        /// What it must be.
        must: String,
    },
    /// A gain that the law needs and the model lacks, or the other way round.
    #[error("policy.gains.{0} {1}")]
    GainSet(String, &'static str),
    /// An action of the wrong length.
    #[error("the action has {found} components, but the policy model has {expected}")]
    ActionLength {
        /// Components given.
        found: usize,
        /// Components expected.
        expected: usize,
    },
    /// An action that is not finite.
    #[error("component {index} of the action is {value}")]
    ActionNotFinite {
        /// Component.
        index: usize,
        /// Its value.
        value: f64,
    },
}

pub(crate) fn bad(key: impl Into<String>, value: f64, must: impl Into<String>) -> ControlError {
    ControlError::BadValue { key: key.into(), value, must: must.into() }
}
