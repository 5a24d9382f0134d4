//! What can go wrong while learning.

use std::path::{Path, PathBuf};

/// An error of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SacError {
    /// A configuration key holds a value that cannot work.
    #[error("sac.{key}: {reason}")]
    Config {
        /// The key.
        key: &'static str,
        /// What is wrong with its value.
        reason: String,
    },
    /// A vector has the wrong length.
    #[error("{what} has {got} values, expected {expected}")]
    Dimension {
        /// Which vector.
        what: &'static str,
        /// Length the agent was made for.
        expected: usize,
        /// Length that was given.
        got: usize,
    },
    /// A number from outside is NaN or infinite.
    #[error("{what}[{index}] is {value}")]
    NonFinite {
        /// Which vector.
        what: &'static str,
        /// Where in it.
        index: usize,
        /// The number.
        value: f32,
    },
    /// Learning produced a number that is NaN or infinite; the network it belongs to was not changed by it.
    #[error("learning diverged at update {update}: {what} is {value}")]
    Diverged {
        /// Which quantity.
        what: &'static str,
        /// Its value.
        value: f32,
        /// Updates done before.
        update: u64,
    },
    /// There is no GPU to compute with.
    #[error(
        "sac.device = \"cuda\": {0}; it takes an NVIDIA GPU with its driver and a build with --features cuda"
    )]
    Cuda(String),
    /// A tensor operation failed.
    #[error("tensor operation failed")]
    Tensor(#[from] candle_core::Error),
    /// A file could not be read or written.
    #[error("{}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// A checkpoint file does not hold what it should.
    #[error("{}: {reason}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

impl SacError {
    pub(crate) fn checkpoint(path: &Path, reason: impl std::fmt::Display) -> Self {
        Self::Checkpoint { path: path.to_owned(), reason: reason.to_string() }
    }
}

/// Refuses a vector of the wrong length.
pub(crate) fn check_length(
    what: &'static str,
    expected: usize,
    got: usize,
) -> Result<(), SacError> {
    if got == expected { Ok(()) } else { Err(SacError::Dimension { what, expected, got }) }
}

/// Refuses a vector of the wrong length or with a number that is not finite.
pub(crate) fn check_vector(
    what: &'static str,
    expected: usize,
    values: &[f32],
) -> Result<(), SacError> {
    check_length(what, expected, values.len())?;
    match values.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(index) => Err(SacError::NonFinite { what, index, value: values[index] }),
    }
}
