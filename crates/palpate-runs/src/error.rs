//! What can go wrong in a run directory.

use std::fmt;
use std::path::{Path, PathBuf};

/// An error of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The file system refused.
    #[error("cannot {action} {}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// On which file or folder.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A new run would mix with what is there.
    #[error("{} exists and is not empty: choose another folder, or continue the run in it with --resume", .0.display())]
    NotEmpty(PathBuf),
    /// There is no run where one was expected.
    #[error("{} {what}{}", path.display(), there_is(nearby))]
    NoRun {
        /// Where it was expected.
        path: PathBuf,
        /// What is wrong with that place.
        what: &'static str,
        /// Runs nearby.
        nearby: Vec<PathBuf>,
    },
    /// Another process writes this run.
    #[error("{} is being written by another process{}: two writers would mix their rows", path.display(), holder.as_ref().map_or(String::new(), |pid| format!(" (pid {pid})")))]
    Locked {
        /// The run.
        path: PathBuf,
        /// What the lock file says about its holder.
        holder: Option<String>,
    },
    /// Whoever fills a checkpoint failed. The checkpoints on disk are as they were.
    #[error("cannot write the checkpoint {name}")]
    Fill {
        /// The checkpoint.
        name: String,
        /// Why not.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// There are checkpoints, but none is as it was written.
    #[error("no checkpoint in {} is whole: {}", dir.display(), list(rejected))]
    NoneWhole {
        /// The folder of checkpoints.
        dir: PathBuf,
        /// Each with what is wrong.
        rejected: Vec<Rejected>,
    },
    /// A checkpoint of a later version.
    #[error("{} has format {format}, this version reads up to {known}: use the version that wrote it", path.display())]
    Newer {
        /// The checkpoint.
        path: PathBuf,
        /// Its format.
        format: u64,
        /// The newest that can be read.
        known: u64,
    },
    /// A table is not what the caller takes it for.
    #[error("{}: {reason}", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A value has no JSON form.
    #[error("cannot write {} as JSON", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: serde_json::Error,
    },
}

impl RunError {
    /// Whether the disk refused: full, over quota, read-only or failing. The same call may succeed once a
    /// person has made room; nothing of what it was to write is half there then.
    pub fn is_storage(&self) -> bool {
        use std::io::ErrorKind as Kind;
        // EIO has no kind of its own.
        const FAILING: i32 = 5;
        let mut cause: Option<&(dyn std::error::Error + 'static)> = Some(self);
        while let Some(error) = cause {
            if let Some(io) = error.downcast_ref::<std::io::Error>() {
                let refused = matches!(
                    io.kind(),
                    Kind::StorageFull
                        | Kind::QuotaExceeded
                        | Kind::ReadOnlyFilesystem
                        | Kind::FileTooLarge
                        | Kind::StaleNetworkFileHandle
                );
                return refused || (cfg!(unix) && io.raw_os_error() == Some(FAILING));
            }
            cause = error.source();
        }
        false
    }
}

/// A checkpoint that is not as it was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rejected {
    /// Its folder's name.
    pub name: String,
    /// What is wrong.
    pub reason: String,
}

impl fmt::Display for Rejected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.name, self.reason)
    }
}

fn list(rejected: &[Rejected]) -> String {
    rejected.iter().map(Rejected::to_string).collect::<Vec<_>>().join(", ")
}

/// Runs named in a message.
const SHOWN: usize = 8;

fn there_is(runs: &[PathBuf]) -> String {
    if runs.is_empty() {
        return ", and there are no runs nearby; start one with train-sim".into();
    }
    let newest = runs.iter().rev().take(SHOWN);
    let names: Vec<_> = newest.map(|run| format!("\n  {}", run.display())).collect();
    let more = runs.len().saturating_sub(SHOWN);
    let more = if more == 0 { String::new() } else { format!("\n  and {more} more") };
    format!(". There are:{}{more}", names.concat())
}

/// Says what was tried on which path.
pub(crate) trait At<T> {
    fn at(self, action: &'static str, path: &Path) -> Result<T, RunError>;
}

impl<T> At<T> for std::io::Result<T> {
    fn at(self, action: &'static str, path: &Path) -> Result<T, RunError> {
        self.map_err(|source| RunError::Io { action, path: path.to_owned(), source })
    }
}
