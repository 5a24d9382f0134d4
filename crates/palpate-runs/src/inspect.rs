//! Is a run whole? And if not: what can be saved.

use std::fmt;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use crate::dir::CONFIG;
use crate::error::{At as _, RunError};
use crate::provenance;
use crate::{CheckpointStore, Csv, Journal, RunDir, durable};

/// Where a repair puts what nothing can be done with.
const DAMAGED: &str = "damaged";
/// The tables of a run.
const TABLES: [&str; 2] = ["metrics.csv", "episodes.csv"];
/// Every transition of a run on an arm.
pub const JOURNAL: &str = "replay.journal";
/// What a run was shown before it began.
pub const DEMONSTRATIONS: &str = "demonstrations.journal";

/// How a part of a run is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Health {
    /// As it was written.
    Whole(String),
    /// Left so by a kill; the next start puts it right by itself.
    Unfinished(String),
    /// Not as it was written.
    Damaged(String),
}

/// A part of a run and how it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Its path below the run's folder.
    pub name: String,
    /// How it is.
    pub health: Health,
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (mark, what) = match &self.health {
            Health::Whole(what) => ("ok  ", what),
            Health::Unfinished(what) => ("cut ", what),
            Health::Damaged(what) => ("FAIL", what),
        };
        write!(f, "{mark} {:<28} {what}", self.name)
    }
}

/// Reads every byte of a run and says how each part is. Changes nothing.
///
/// # Errors
///
/// If there is no run, or if a checkpoint is of a later version.
pub fn inspect(run: &Path) -> Result<Vec<Part>, RunError> {
    RunDir::view(run)?;
    let mut parts = vec![text(run, CONFIG, |s| toml::from_str::<toml::Table>(s).map(drop))];
    parts.push(text(run, provenance::FILE, |s| serde_json::from_str(s).map(|_: Starts| ())));
    for entry in CheckpointStore::open(run)?.entries()? {
        let health = match entry.damage()? {
            None => Health::Whole("every byte as written".into()),
            Some(damage) => Health::Damaged(damage.reason),
        };
        parts.push(Part { name: below(run, &entry.path), health });
    }
    for unfinished in CheckpointStore::open(run)?.unfinished()? {
        let health = Health::Unfinished("was being written; not counted".into());
        parts.push(Part { name: below(run, &unfinished), health });
    }
    parts.extend(TABLES.iter().filter(|name| run.join(name).exists()).map(|name| table(run, name)));
    for name in [JOURNAL, DEMONSTRATIONS].into_iter().filter(|name| run.join(name).exists()) {
        parts.push(journal(run, name)?);
    }
    Ok(parts)
}

type Starts = Vec<serde_json::Value>;

/// Puts right what can be: moves damaged checkpoints to `damaged/`, cuts half rows and records, restores
/// config.toml from the newest whole checkpoint. Gives what it did.
///
/// # Errors
///
/// If the run is being written, or if config.toml is damaged and no checkpoint holds a copy.
pub fn repair(run: &Path) -> Result<Vec<String>, RunError> {
    let _writer = RunDir::hold(run)?;
    let mut done = Vec::new();
    for Part { name, health } in inspect(run)? {
        let path = run.join(&name);
        match health {
            Health::Whole(_) => {}
            Health::Unfinished(_) if path.is_dir() => {
                fs::remove_dir_all(&path).at("remove", &path)?;
                done.push(format!("removed {name}, which was never finished"));
            }
            Health::Unfinished(_) | Health::Damaged(_) if name == JOURNAL => {
                let (_, held) = Journal::open(&path)?;
                done.push(format!("cut {name} to its {} whole records", held.records.len()));
            }
            Health::Unfinished(_) if name != DEMONSTRATIONS => {
                cut_half_row(&path)?;
                done.push(format!("cut the half row at the end of {name}"));
            }
            // Learning from half of what was shown would be another training: a checkpoint holds the whole.
            Health::Unfinished(_) | Health::Damaged(_) => {
                let restored = (name == CONFIG).then(|| spare_config(run)).transpose()?;
                let aside = set_aside(run, &path)?;
                done.push(format!("moved {name} to {aside}"));
                if let Some((text, checkpoint)) = restored {
                    durable::write(&path, text.as_bytes())?;
                    done.push(format!("restored {name} from {checkpoint}"));
                }
            }
        }
    }
    Ok(done)
}

fn text<E: fmt::Display>(run: &Path, name: &str, parse: impl Fn(&str) -> Result<(), E>) -> Part {
    let health = match fs::read_to_string(run.join(name)) {
        Ok(text) => match parse(&text) {
            Ok(()) => Health::Whole(format!("{} bytes", text.len())),
            Err(error) => Health::Damaged(first_line(&error)),
        },
        Err(error) => Health::Damaged(first_line(&error)),
    };
    Part { name: name.into(), health }
}

fn first_line(error: &dyn fmt::Display) -> String {
    error.to_string().lines().next().unwrap_or_default().to_owned()
}

fn table(run: &Path, name: &str) -> Part {
    let path = run.join(name);
    let half = fs::read(&path).is_ok_and(|bytes| bytes.last().is_some_and(|last| *last != b'\n'));
    let health = match Csv::read(&path) {
        Ok(_) if half => Health::Unfinished("ends in half a row".into()),
        Ok(csv) => Health::Whole(format!("{} rows", csv.rows())),
        Err(error) => Health::Damaged(first_line(&error)),
    };
    Part { name: name.into(), health }
}

fn journal(run: &Path, name: &str) -> Result<Part, RunError> {
    let held = Journal::read(&run.join(name))?;
    let records = held.records.len();
    let health = match held.damage {
        Some(damage) => Health::Damaged(format!("{damage}; {records} whole records before it")),
        None if held.torn => Health::Unfinished(format!("ends in half a record after {records}")),
        None if name == DEMONSTRATIONS => {
            Health::Whole(format!("{} transitions", records.saturating_sub(1)))
        }
        None => Health::Whole(format!("{records} transitions")),
    };
    Ok(Part { name: name.into(), health })
}

fn cut_half_row(path: &Path) -> Result<(), RunError> {
    let bytes = fs::read(path).at("read", path)?;
    let end = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
    let file = File::options().write(true).open(path).at("open", path)?;
    file.set_len(end as u64).and_then(|()| file.sync_all()).at("cut", path)
}

/// The configuration in the newest whole checkpoint, and that one's name.
fn spare_config(run: &Path) -> Result<(String, String), RunError> {
    let checkpoint = CheckpointStore::open(run)?.latest()?;
    let spare = checkpoint.and_then(|checkpoint| {
        let text = fs::read_to_string(checkpoint.join(CONFIG)).ok()?;
        Some((text, below(run, &checkpoint)))
    });
    spare.ok_or_else(|| RunError::Table {
        path: run.join(CONFIG),
        reason: "it is damaged, and no whole checkpoint holds a copy".into(),
    })
}

fn set_aside(run: &Path, path: &Path) -> Result<String, RunError> {
    let folder = run.join(DAMAGED);
    durable::create_dir(&folder)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let (mut to, mut n) = (folder.join(&*name), 1);
    while to.exists() {
        n += 1;
        to = folder.join(format!("{name}_{n}"));
    }
    fs::rename(path, &to).at("move aside", path)?;
    durable::sync_dir(&folder)?;
    path.parent().map_or(Ok(()), durable::sync_dir)?;
    Ok(below(run, &to))
}

fn below(run: &Path, path: &Path) -> String {
    let path = path.strip_prefix(run).map_or_else(|_| path.to_owned(), PathBuf::from);
    path.display().to_string()
}

#[cfg(test)]
#[path = "inspect_tests.rs"]
mod tests;
