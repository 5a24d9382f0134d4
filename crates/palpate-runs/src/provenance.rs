//! Where a run's numbers come from.

use std::io::Read as _;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use crate::durable;
use crate::error::{At as _, RunError};
use crate::time::{Utc, since_epoch};

pub(crate) const FILE: &str = "provenance.json";

/// Adds this start to the list in `dir`; the first entry is the run's creation.
pub(crate) fn record(dir: &Path) -> Result<(), RunError> {
    let path = dir.join(FILE);
    let json = |source| RunError::Json { path: path.clone(), source };
    let mut starts: Vec<Value> = if path.exists() {
        let bytes = std::fs::read(&path).at("read", &path)?;
        serde_json::from_slice(&bytes).map_err(|error| RunError::Table {
            path: path.clone(),
            reason: format!("damaged ({error}); `palpate runs repair` sets it aside"),
        })?
    } else {
        Vec::new()
    };
    starts.push(start());
    let text = serde_json::to_string_pretty(&starts).map_err(json)?;
    durable::write(&path, text.as_bytes())
}

fn start() -> Value {
    json!({
        "started": Utc::new(since_epoch()).rfc3339(),
        "arguments": std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect::<Vec<_>>(),
        "palpate": env!("CARGO_PKG_VERSION"),
        "git": git(),
        "cargo_lock_crc32c": env!("PALPATE_CARGO_LOCK"),
        "rustc": env!("PALPATE_RUSTC"),
        "os": std::env::consts::OS,
        "arch": std::env::consts::ARCH,
        // Matrix products pick their code by what the processor can do, so the last bits depend on it.
        "cpu": cpu(),
        "cores": std::thread::available_parallelism().map(std::num::NonZero::get).ok(),
    })
}

/// Commit of the checkout that the binary was built in, and whether tracked files differ from it;
/// null if there is none any more.
fn git() -> Value {
    let git = |args: &[&str]| {
        let mut command = Command::new("git");
        // Without its locks: somebody may be committing there.
        command.args(["--no-optional-locks", "-C", env!("CARGO_MANIFEST_DIR")]).args(args);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
        // Not `output`, which panics where the pipe cannot be read.
        let (mut child, mut said) = (command.spawn().ok()?, String::new());
        let read = child.stdout.take()?.read_to_string(&mut said);
        let ended = child.wait().ok()?;
        (read.is_ok() && ended.success()).then(|| said.trim().to_owned())
    };
    let commit = git(&["rev-parse", "HEAD"]);
    let changes = git(&["status", "--porcelain", "--untracked-files=no"]);
    commit.zip(changes).map_or(
        Value::Null,
        |(commit, changes)| json!({ "commit": commit, "dirty": !changes.is_empty() }),
    )
}

fn cpu() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    line.split_once(':').map(|(_, name)| name.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_start_is_recorded() {
        let dir = tempfile::tempdir().unwrap();
        record(dir.path()).unwrap();
        record(dir.path()).unwrap();
        let text = std::fs::read_to_string(dir.path().join(FILE)).unwrap();
        let starts: Vec<Value> = serde_json::from_str(&text).unwrap();
        assert_eq!(starts.len(), 2);
        let start = &starts[0];
        assert!(start["rustc"].as_str().unwrap().starts_with("rustc 1."));
        assert_eq!(start["cargo_lock_crc32c"].as_str().unwrap().len(), 8);
        assert!(start["started"].as_str().unwrap().ends_with('Z'));
        assert!(!start["arguments"].as_array().unwrap().is_empty());
        assert!(start["cores"].as_u64().unwrap() > 0);
        if let Some(commit) = start["git"]["commit"].as_str() {
            assert!(commit.len() >= 40 && start["git"]["dirty"].is_boolean());
        }
    }
}
