//! One folder per run.

use std::fs::{self, File, TryLockError};
use std::io::{Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::error::{At as _, RunError};
use crate::time::{Utc, since_epoch};
use crate::{CheckpointStore, durable, provenance};

/// Where runs go that are given no folder.
const ROOT: &str = "runs";
/// Makes a folder a run.
pub(crate) const CONFIG: &str = "config.toml";
pub(crate) const LOCK: &str = "lock";
/// How long to wait for a lock that is held.
const LOCK_TRIES: u32 = 10;
const LOCK_PAUSE: Duration = Duration::from_millis(30);

/// A run's folder. Who [creates](Self::create) or [opens](Self::open) it is its only writer until the
/// value is dropped or the process ends in any way.
#[derive(Debug)]
pub struct RunDir {
    path: PathBuf,
    /// Locked while this is open.
    lock: Option<File>,
}

impl RunDir {
    /// Makes a new run: `out`, or `runs/DATE_TIME_NAME` (UTC). `config` is its config.toml.
    ///
    /// # Errors
    ///
    /// If `out` exists and is not empty.
    pub fn create(out: Option<&Path>, name: &str, config: &str) -> Result<Self, RunError> {
        let path = match out {
            Some(out) => {
                if !is_free(out) {
                    return Err(RunError::NotEmpty(out.to_owned()));
                }
                durable::create_dir(out)?;
                out.to_owned()
            }
            None => fresh(Path::new(ROOT), &Utc::new(since_epoch()).stamp(), name)?,
        };
        let lock = Some(lock(&path)?);
        provenance::record(&path)?;
        // Last: only a folder with a configuration is a run.
        durable::write(&path.join(CONFIG), config.as_bytes())?;
        Ok(Self { path, lock })
    }

    /// Takes up a run, to write to it. The start is added to provenance.json.
    ///
    /// # Errors
    ///
    /// If there is no run (the error lists those nearby) or if another process writes it.
    pub fn open(path: &Path) -> Result<Self, RunError> {
        let run = Self::hold(path)?;
        provenance::record(path)?;
        Ok(run)
    }

    /// The run, held for writing by a process that does not go on with it.
    pub(crate) fn hold(path: &Path) -> Result<Self, RunError> {
        let mut run = Self::view(path)?;
        run.lock = Some(lock(path)?);
        Ok(run)
    }

    /// Whether a process writes the run now.
    pub fn is_written(path: &Path) -> bool {
        let lock = File::open(path.join(LOCK));
        lock.is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
    }

    /// Opens a run to read it; it may be in training.
    ///
    /// # Errors
    ///
    /// If there is no run: the error lists those nearby.
    pub fn view(path: &Path) -> Result<Self, RunError> {
        if path.join(CONFIG).is_file() {
            return Ok(Self { path: path.to_owned(), lock: None });
        }
        let what =
            if path.is_dir() { "is not a run: it holds no config.toml" } else { "does not exist" };
        let around = path.parent().filter(|parent| !parent.as_os_str().is_empty());
        let places = [Some(path), around, Some(Path::new(ROOT)), Some(Path::new("."))];
        let nearby = places.into_iter().flatten().map(list).find(|runs| !runs.is_empty());
        Err(RunError::NoRun { path: path.to_owned(), what, nearby: nearby.unwrap_or_default() })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether this process holds the run for writing.
    pub fn is_writer(&self) -> bool {
        self.lock.is_some()
    }

    /// The run's checkpoints.
    pub fn checkpoints(&self) -> Result<CheckpointStore, RunError> {
        CheckpointStore::open(&self.path)
    }

    /// Writes summary.json, whole or not at all.
    pub fn write_summary(&self, summary: &serde_json::Value) -> Result<(), RunError> {
        self.write_json("summary.json", summary)
    }

    /// Writes a file of the run, whole or not at all.
    pub fn write_json(&self, name: &str, value: &serde_json::Value) -> Result<(), RunError> {
        let path = self.path.join(name);
        let text = serde_json::to_string_pretty(value)
            .map_err(|source| RunError::Json { path: path.clone(), source })?;
        durable::write(&path, format!("{text}\n").as_bytes())
    }
}

/// The runs in a folder, by name; that is by age where the names are dates.
pub fn list(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut runs: Vec<_> =
        entries.map(|entry| entry.path()).filter(|path| path.join(CONFIG).is_file()).collect();
    runs.sort();
    runs
}

/// Whether a folder is empty, but for what a run leaves that was killed while it was being created.
pub(crate) fn is_free(folder: &Path) -> bool {
    let begun = |name: &Path| {
        name == Path::new(LOCK)
            || name == Path::new(provenance::FILE)
            || name.extension().is_some_and(|extension| extension == "tmp")
    };
    let mut entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.all(|entry| begun(Path::new(&entry.file_name())))
}

/// Makes the first of `root/stamp_name`, `root/stamp_name_2`, … that does not exist.
fn fresh(root: &Path, stamp: &str, name: &str) -> Result<PathBuf, RunError> {
    durable::create_dir(root)?;
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let name: String = name.chars().map(plain).collect();
    let mut path = root.join(format!("{stamp}_{name}"));
    let mut n = 1;
    loop {
        match fs::create_dir(&path) {
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
                n += 1;
                path = root.join(format!("{stamp}_{name}_{n}"));
            }
            made => {
                made.at("create", &path)?;
                durable::sync_dir(root)?;
                return Ok(path);
            }
        }
    }
}

/// Locks a run. The system releases it with the process, so a kill leaves nothing to clean up.
fn lock(run: &Path) -> Result<File, RunError> {
    let path = run.join(LOCK);
    let mut file = File::options()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .open(&path)
        .at("open", &path)?;
    let mut taken = file.try_lock();
    // A process that was just killed may leave a child that has not quite begun and still holds its files.
    for _ in 0..LOCK_TRIES {
        if !matches!(taken, Err(TryLockError::WouldBlock)) {
            break;
        }
        std::thread::sleep(LOCK_PAUSE);
        taken = file.try_lock();
    }
    match taken {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            let mut holder = String::new();
            // Some systems let nobody read a locked file.
            let _ = file.read_to_string(&mut holder);
            let holder = Some(holder.trim().to_owned()).filter(|pid| !pid.is_empty());
            return Err(RunError::Locked { path: run.to_owned(), holder });
        }
        Err(TryLockError::Error(error)) => return Err(error).at("lock", &path),
    }
    file.set_len(0).and_then(|()| file.rewind()).at("write", &path)?;
    writeln!(file, "{}", std::process::id()).at("write", &path)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_default_name_is_date_and_name_and_never_taken_twice() {
        let root = tempfile::tempdir().unwrap();
        let runs = root.path().join("runs");
        let name = |path: PathBuf| path.file_name().unwrap().to_str().unwrap().to_owned();
        let stamp = "2026-11-22_154500";
        assert_eq!(
            name(fresh(&runs, stamp, "peg_P-14_s1").unwrap()),
            "2026-11-22_154500_peg_P-14_s1"
        );
        assert_eq!(
            name(fresh(&runs, stamp, "peg_P-14_s1").unwrap()),
            "2026-11-22_154500_peg_P-14_s1_2"
        );
        assert_eq!(name(fresh(&runs, stamp, "a/b c").unwrap()), "2026-11-22_154500_a-b-c");
    }

    #[test]
    fn a_new_run_holds_its_configuration_and_provenance() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("deep/run");
        let run = RunDir::create(Some(&path), "x", "seed = 1\n").unwrap();
        assert!(run.is_writer());
        assert_eq!(fs::read_to_string(path.join("config.toml")).unwrap(), "seed = 1\n");
        assert!(path.join("provenance.json").is_file());
        assert!(path.join(LOCK).is_file());
        run.write_summary(&serde_json::json!({ "complete": true })).unwrap();
        let summary = fs::read_to_string(path.join("summary.json")).unwrap();
        assert!(summary.contains("\"complete\": true"));
    }

    #[test]
    fn a_folder_that_holds_something_is_refused() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("thesis.tex"), "years").unwrap();
        let error = RunDir::create(Some(root.path()), "x", "").unwrap_err();
        assert!(matches!(error, RunError::NotEmpty(_)));
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1);
        let begun = root.path().join("begun");
        RunDir::create(Some(&begun), "x", "").unwrap();
        fs::remove_file(begun.join(CONFIG)).unwrap();
        fs::write(begun.join("config.toml.tmp"), "see").unwrap();
        RunDir::create(Some(&begun), "x", "").unwrap();
    }

    #[test]
    fn a_run_has_one_writer_and_any_number_of_readers() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("run");
        let writer = RunDir::create(Some(&path), "x", "").unwrap();
        let error = RunDir::open(&path).unwrap_err();
        let pid = std::process::id();
        assert!(error.to_string().contains(&format!("another process (pid {pid})")), "{error}");
        assert!(!RunDir::view(&path).unwrap().is_writer());
        assert!(RunDir::is_written(&path));
        drop(writer);
        assert!(!RunDir::is_written(&path));
        assert!(RunDir::open(&path).unwrap().is_writer());
    }

    #[test]
    fn a_missing_run_says_which_exist() {
        let root = tempfile::tempdir().unwrap();
        let runs = root.path().join("runs");
        let none = RunDir::view(&runs.join("a")).unwrap_err().to_string();
        assert!(none.contains("does not exist"), "{none}");
        for name in ["first", "second"] {
            RunDir::create(Some(&runs.join(name)), "x", "").unwrap();
        }
        for wrong in [runs.join("third"), runs.clone()] {
            let said = RunDir::open(&wrong).unwrap_err().to_string();
            let (second, first) = (said.find("second").unwrap(), said.find("first").unwrap());
            assert!(second < first, "the newest comes first: {said}");
        }
        assert!(RunDir::view(&runs).unwrap_err().to_string().contains("holds no config.toml"));
    }
}
