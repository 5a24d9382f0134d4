//! Files that are there after a power cut, whole or not at all.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;

use crate::RunError;
use crate::error::At as _;

/// Writes a file in one step: readers see the old bytes or the new ones, also after a power cut.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    let temporary = path.with_added_extension("tmp");
    create(&temporary, bytes)?;
    fs::rename(&temporary, path).at("replace", path)?;
    path.parent().map_or(Ok(()), sync_dir)
}

/// Writes and syncs a file. Its name is durable once the folder is synced too.
pub(crate) fn create(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    let mut file = File::create(path).at("create", path)?;
    file.write_all(bytes).and_then(|()| file.sync_all()).at("write", path)
}

/// Makes the names in a folder durable.
pub(crate) fn sync_dir(path: &Path) -> Result<(), RunError> {
    // An empty parent is the working directory.
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    // Windows opens no folder as a file; its renames are journalled.
    if cfg!(unix) {
        File::open(path).and_then(|dir| dir.sync_all()).at("sync", path)
    } else {
        Ok(())
    }
}

/// Creates a folder, unless it is there.
pub(crate) fn create_dir(path: &Path) -> Result<(), RunError> {
    if path.is_dir() {
        return Ok(());
    }
    fs::create_dir_all(path).at("create", path)?;
    path.parent().map_or(Ok(()), sync_dir)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_and_nothing_is_left_beside_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("summary.json");
        for text in ["a long first text", "short"] {
            write(&path, text.as_bytes()).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}
