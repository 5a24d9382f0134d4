//! Checkpoints that are whole or absent.
//!
//! A checkpoint is a folder. It is filled under a temporary name (`.step_0002000.tmp`), sealed with
//! checksums, synced, and renamed; only then are older ones removed. At every moment the disk holds
//! the old checkpoint or the new one. Two of the kept policy stay, three of the rest: a reader that
//! has found one can finish while the next is being written, and there is one to fall back to.

use std::fs;
use std::path::{Path, PathBuf};

use crate::durable;
use crate::error::{At as _, Rejected, RunError};
use crate::manifest::{FORMAT, Unusable, seal, verify};

/// Finds the newest checkpoint that training can continue from.
pub const LAST: &str = "last";
/// Finds the policy that the evaluations during training liked best.
pub const BEST: &str = "best";

/// Ends the name of a checkpoint that is being written.
const UNFINISHED: &str = ".tmp";
/// Ends the name of a checkpoint that another of the same name is about to replace.
const REPLACED: &str = ".replaced";

/// What kind of checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// To continue from, taken at this step. The last three are kept.
    Step(u64),
    /// The best policy so far, of this step. It and the one before are kept.
    Best(u64),
}

/// A checkpoint on disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Folder name: `step_0002000`, `best_0002000`.
    pub name: String,
    /// Its folder.
    pub path: PathBuf,
    kind: Kind,
    number: u64,
    replaced: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Step,
    Best,
}

impl Kind {
    fn prefix(self) -> &'static str {
        match self {
            Self::Step => "step_",
            Self::Best => "best_",
        }
    }

    fn name(self, number: u64) -> String {
        format!("{}{number:07}", self.prefix())
    }

    fn kept(self) -> usize {
        match self {
            Self::Step => 3,
            Self::Best => 2,
        }
    }
}

impl Entry {
    fn new(path: PathBuf) -> Option<Self> {
        let folder = path.file_name()?.to_str()?;
        let (name, replaced) = match folder.strip_suffix(REPLACED) {
            Some(name) => (name.strip_prefix('.')?, true),
            None => (folder, false),
        };
        let kind =
            [Kind::Step, Kind::Best].into_iter().find(|kind| name.starts_with(kind.prefix()))?;
        let number = name.strip_prefix(kind.prefix())?.parse().ok()?;
        Some(Self { name: name.into(), kind, number, replaced, path })
    }

    /// Steps taken when it was written; none for a kept policy.
    pub fn step(&self) -> Option<u64> {
        (self.kind == Kind::Step).then_some(self.number)
    }

    /// Reads every byte: `None` if all are as they were written.
    pub fn damage(&self) -> Result<Option<Rejected>, RunError> {
        match verify(&self.path, &self.name) {
            Ok(()) => Ok(None),
            Err(Unusable::Torn(rejected)) => Ok(Some(rejected)),
            Err(Unusable::Newer(format)) => {
                Err(RunError::Newer { path: self.path.clone(), format, known: FORMAT })
            }
        }
    }
}

/// The checkpoints of a run.
#[derive(Clone, Debug)]
pub struct CheckpointStore {
    dir: PathBuf,
}

impl CheckpointStore {
    /// Folder below the run's.
    pub(crate) const FOLDER: &str = "checkpoints";

    /// The checkpoints of the run in `run`. There may be none yet.
    ///
    /// Any number of readers may look; only the process that holds the [`RunDir`](crate::RunDir)
    /// may save.
    pub fn open(run: &Path) -> Result<Self, RunError> {
        Ok(Self { dir: run.join(Self::FOLDER) })
    }

    /// All checkpoints, the newest of each kind first; unchecked.
    pub fn entries(&self) -> Result<Vec<Entry>, RunError> {
        let listing = match fs::read_dir(&self.dir) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            listing => listing.at("list", &self.dir)?,
        };
        let mut entries = Vec::new();
        for entry in listing {
            entries.extend(Entry::new(entry.at("list", &self.dir)?.path()));
        }
        entries.sort_by_key(|e| (e.kind == Kind::Best, std::cmp::Reverse(e.number), e.replaced));
        Ok(entries)
    }

    /// The newest whole checkpoint to continue from; [`find`](Self::find)`(`[`LAST`]`)`.
    pub fn latest(&self) -> Result<Option<PathBuf>, RunError> {
        self.find(LAST)
    }

    /// The newest whole checkpoint of a kind ([`LAST`], [`BEST`]) or the one of a name.
    ///
    /// Damaged ones are passed over with a warning that names each and what is wrong. `None` means
    /// that none was written.
    ///
    /// # Errors
    ///
    /// If all are damaged, or if one is of a later version: to fall back then would lose work.
    pub fn find(&self, name: &str) -> Result<Option<PathBuf>, RunError> {
        let wanted = |entry: &Entry| match name {
            LAST => entry.kind == Kind::Step,
            BEST => entry.kind == Kind::Best,
            name => entry.name == name,
        };
        let mut rejected = Vec::new();
        for entry in self.entries()?.into_iter().filter(wanted) {
            match entry.damage()? {
                None => return Ok(Some(entry.path)),
                Some(damage) => {
                    tracing::warn!("the checkpoint {damage} is passed over");
                    rejected.push(damage);
                }
            }
        }
        if rejected.is_empty() {
            Ok(None)
        } else {
            Err(RunError::NoneWhole { dir: self.dir.clone(), rejected })
        }
    }

    /// Writes a checkpoint: `fill` puts files into the folder it is given.
    ///
    /// When this returns, the checkpoint survives a power cut. After an error, those that were there
    /// still are.
    pub fn save(
        &self,
        slot: Slot,
        fill: impl FnOnce(&Path) -> Result<(), Box<dyn std::error::Error + Send + Sync>>,
    ) -> Result<PathBuf, RunError> {
        let (kind, number) = match slot {
            Slot::Step(step) => (Kind::Step, step),
            Slot::Best(step) => (Kind::Best, step),
        };
        let name = kind.name(number);
        let temporary = self.dir.join(format!(".{name}{UNFINISHED}"));
        self.sweep()?;
        durable::create_dir(&self.dir)?;
        fs::create_dir(&temporary).at("create", &temporary)?;
        let filled = fill(&temporary)
            .map_err(|source| RunError::Fill { name: name.clone(), source })
            .and_then(|()| seal(&temporary, &name));
        if let Err(error) = filled {
            // What made it fail may prevent this too; the next save sweeps.
            let _ = fs::remove_dir_all(&temporary);
            return Err(error);
        }
        let path = self.dir.join(&name);
        if path.exists() {
            let aside = self.dir.join(format!(".{name}{REPLACED}"));
            remove(&aside)?;
            fs::rename(&path, &aside).at("move aside", &path)?;
        }
        fs::rename(&temporary, &path).at("name", &path)?;
        durable::sync_dir(&self.dir)?;
        self.prune(kind, number)?;
        Ok(path)
    }

    /// Folders of checkpoints that were never finished.
    pub(crate) fn unfinished(&self) -> Result<Vec<PathBuf>, RunError> {
        let mut found = Vec::new();
        if self.dir.is_dir() {
            for entry in fs::read_dir(&self.dir).at("list", &self.dir)? {
                let path = entry.at("list", &self.dir)?.path();
                let name = path.file_name().and_then(|name| name.to_str());
                if name.is_some_and(|n| n.starts_with('.') && n.ends_with(UNFINISHED)) {
                    found.push(path);
                }
            }
        }
        Ok(found)
    }

    /// Removes what a process that was killed had begun.
    fn sweep(&self) -> Result<(), RunError> {
        self.unfinished()?.iter().try_for_each(|path| remove(path))
    }

    /// Keeps `newest` and those before it, as many as is due. A later number is from a run that was
    /// taken up again before it.
    fn prune(&self, kind: Kind, newest: u64) -> Result<(), RunError> {
        let mut kept = 0;
        for entry in self.entries()?.into_iter().filter(|e| e.kind == kind) {
            let superseded = entry.number > newest || (entry.replaced && entry.number == newest);
            if superseded || kept == kind.kept() {
                remove(&entry.path)?;
            } else {
                kept += 1;
            }
        }
        Ok(())
    }
}

/// Removes a folder, if there is one. Its manifest goes first: what is left is no checkpoint.
fn remove(path: &Path) -> Result<(), RunError> {
    if !path.exists() {
        return Ok(());
    }
    let manifest = path.join(crate::manifest::MANIFEST);
    if manifest.exists() {
        fs::remove_file(&manifest).at("remove", &manifest)?;
    }
    fs::remove_dir_all(path).at("remove", path)
}

#[cfg(test)]
#[path = "checkpoint_tests.rs"]
mod tests;
