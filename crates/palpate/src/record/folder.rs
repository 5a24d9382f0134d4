//! The folder of recordings: whole files only, and not too many.

use std::fs;
use std::path::Path;

use anyhow::Context as _;

/// Extension of a recording.
const EXTENSION: &str = "mcap";

/// Writes a recording, whole or not at all.
pub(super) fn write(folder: &Path, name: &str, bytes: &[u8]) -> anyhow::Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let (half, whole) =
        (folder.join(format!("{name}.tmp")), folder.join(format!("{name}.{EXTENSION}")));
    let written = fs::write(&half, bytes).and_then(|()| fs::rename(&half, &whole));
    if written.is_err() {
        // What a full disk leaves behind is in the way.
        _ = fs::remove_file(&half);
    }
    written.with_context(|| format!("cannot write {}", whole.display()))
}

/// Deletes the collisions before the latest `collisions`, and the evaluations between the first and the latest.
pub(super) fn prune(folder: &Path, collisions: usize) -> anyhow::Result<()> {
    let entries =
        fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut names: Vec<String> = entries
        .filter_map(|entry| Some(entry.ok()?.file_name().to_str()?.to_owned()))
        .filter(|name| name.ends_with(EXTENSION))
        .collect();
    names.sort();
    for name in stale(&names, collisions) {
        let path = folder.join(name);
        fs::remove_file(&path).with_context(|| format!("cannot delete {}", path.display()))?;
    }
    Ok(())
}

/// Which of these sorted names are not needed any more.
fn stale(names: &[String], collisions: usize) -> Vec<&str> {
    let of = |prefix: &'static str| {
        names.iter().map(String::as_str).filter(move |n| n.starts_with(prefix))
    };
    let collided = of("collision_").count();
    let mut stale: Vec<&str> = of("collision_").take(collided.saturating_sub(collisions)).collect();
    let step = |name: &str| name.split('_').nth(1).map(str::to_owned);
    let (first, last) = (of("eval_").next().and_then(step), of("eval_").next_back().and_then(step));
    stale.extend(of("eval_").filter(|name| step(name) != first && step(name) != last));
    stale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_collisions_and_the_first_and_last_evaluation_stay() {
        let names: Vec<String> = [
            "a_000_success.mcap",
            "collision_000003.mcap",
            "collision_000010.mcap",
            "collision_000200.mcap",
            "eval_0001000_000.mcap",
            "eval_0001000_001.mcap",
            "eval_0002000_000.mcap",
            "eval_0003000_000.mcap",
        ]
        .map(String::from)
        .to_vec();
        assert_eq!(stale(&names, 2), ["collision_000003.mcap", "eval_0002000_000.mcap"]);
        assert_eq!(stale(&names, 9), ["eval_0002000_000.mcap"]);
        assert_eq!(stale(&names[..6], 9), [""; 0]);
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_an_error_and_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("file");
        fs::write(&file, "").unwrap();
        let error = format!("{:#}", write(&file, "x", b"1").unwrap_err());
        assert!(error.contains("cannot create"), "{error}");
        write(dir.path(), "x", b"1").unwrap();
        assert_eq!(fs::read(dir.path().join("x.mcap")).unwrap(), b"1");
        assert!(!dir.path().join("x.tmp").exists());
    }
}
