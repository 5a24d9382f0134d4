//! A run copied whole, also while it is being written.

use std::fs;
use std::path::Path;

use crate::dir::{CONFIG, LOCK, is_free};
use crate::error::{At as _, RunError};
use crate::{CheckpointStore, RunDir, durable};

/// Copies a run to a folder that does not exist or is empty: first its whole checkpoints, then the rest, so that
/// tables are never behind a checkpoint; config.toml last, so that a copy that was interrupted is no run.
/// Gives the names of the checkpoints copied.
///
/// # Errors
///
/// If there is no run, if the folder holds something, or if the run has checkpoints and none is whole.
pub fn copy(run: &Path, to: &Path) -> Result<Vec<String>, RunError> {
    RunDir::view(run)?;
    if !is_free(to) {
        return Err(RunError::NotEmpty(to.to_owned()));
    }
    durable::create_dir(to)?;
    let store = CheckpointStore::open(run)?;
    // Damage of all of them is an error here; of some, a warning.
    let last = store.latest()?;
    let mut copied = Vec::new();
    for entry in store.entries()? {
        // In a run that is being written, an old checkpoint may go while it is read.
        let whole = matches!(entry.damage(), Ok(None));
        let folder = to.join(CheckpointStore::FOLDER).join(&entry.name);
        if whole && tree(&entry.path, &folder).is_ok() {
            copied.push(entry.name);
        } else if folder.exists() {
            fs::remove_dir_all(&folder).at("remove", &folder)?;
        }
    }
    let copy = CheckpointStore::open(to)?;
    if last.is_some() {
        copy.latest()?;
    }
    let skipped = [LOCK, CONFIG, CheckpointStore::FOLDER];
    for entry in fs::read_dir(run).at("list", run)? {
        let entry = entry.at("list", run)?;
        let name = entry.file_name();
        if skipped.iter().any(|skip| name == *skip) {
            continue;
        }
        rest(&entry.path(), &to.join(name))?;
    }
    file(&run.join(CONFIG), &to.join(CONFIG))?;
    durable::sync_dir(to)?;
    Ok(copied)
}

/// Copies what is neither a checkpoint nor the configuration: without what is being written, and without what goes
/// while it is read, as old recordings do.
fn rest(from: &Path, to: &Path) -> Result<(), RunError> {
    if from.extension().is_some_and(|e| e == "tmp") {
        return Ok(());
    }
    if !from.is_dir() {
        return match file(from, to) {
            Err(_) if !from.exists() => Ok(()),
            copied => copied,
        };
    }
    durable::create_dir(to)?;
    for entry in fs::read_dir(from).at("list", from)? {
        let entry = entry.at("list", from)?;
        rest(&entry.path(), &to.join(entry.file_name()))?;
    }
    durable::sync_dir(to)
}

/// Copies a file or a folder with all it holds.
fn tree(from: &Path, to: &Path) -> Result<(), RunError> {
    if !from.is_dir() {
        return file(from, to);
    }
    durable::create_dir(to)?;
    for entry in fs::read_dir(from).at("list", from)? {
        let entry = entry.at("list", from)?;
        tree(&entry.path(), &to.join(entry.file_name()))?;
    }
    durable::sync_dir(to)
}

fn file(from: &Path, to: &Path) -> Result<(), RunError> {
    fs::copy(from, to).at("copy", from)?;
    fs::File::options().append(true).open(to).and_then(|file| file.sync_all()).at("sync", to)
}
