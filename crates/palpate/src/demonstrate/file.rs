//! A file of demonstrations.
//!
//! A journal ([`palpate_runs::Journal`]) whose first record is a header in JSON; the others are steps, numbered through
//! the file, in the form of a run's journal. A kill loses the episode under way.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use palpate_runs::{DEMONSTRATIONS, Journal};
use palpate_sac::Sac;
use serde::{Deserialize, Serialize};

use crate::Config;
use crate::train::lesson::Lesson;
use crate::train::past;

const FORMAT: u32 = 1;

/// What the transitions are and how they came about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Header {
    /// Of the file.
    palpate_demonstrations: u32,
    /// Who showed it.
    by: String,
    observation_dim: usize,
    action_dim: usize,
    /// The resolved configuration, TOML.
    config: String,
}

/// Keys that decide what an observation, an action and a reward mean. Demonstrations under other values teach
/// something else.
fn decides(key: &str) -> bool {
    // Where episodes start and what they are simulated with may differ.
    let goal = ["name", "hole_position", "hole_rpy_deg", "depth", "success_distance"];
    let aims = key.strip_prefix("task.").is_some_and(|key| goal.contains(&key));
    aims || past::gives_meaning(key) || past::gives_worth(key)
}

/// Writes a file; each episode is there for good once it is kept.
#[derive(Debug)]
pub(super) struct Writer {
    path: PathBuf,
    journal: Journal,
    steps: u64,
}

impl Writer {
    /// Begins a file. One that exists is left alone.
    pub(super) fn create(
        path: &Path,
        by: &str,
        dims: (usize, usize),
        config: &Config,
    ) -> anyhow::Result<Self> {
        File::create_new(path).with_context(|| {
            format!(
                "cannot begin {}: demonstrations replace no file, take another --out",
                path.display()
            )
        })?;
        let (mut journal, _) = Journal::open(path)?;
        let header = Header {
            palpate_demonstrations: FORMAT,
            by: by.into(),
            observation_dim: dims.0,
            action_dim: dims.1,
            config: config.to_toml()?,
        };
        journal.append(&serde_json::to_vec(&header)?)?;
        Ok(Self { path: path.to_owned(), journal, steps: 0 })
    }

    /// Keeps an episode.
    pub(super) fn keep(&mut self, episode: &[Lesson]) -> anyhow::Result<()> {
        for lesson in episode {
            self.steps += 1;
            self.journal.append(&lesson.record(self.steps))?;
        }
        Ok(())
    }

    /// Ends a file; one without an episode is removed.
    pub(super) fn finish(self) -> anyhow::Result<()> {
        if self.steps == 0 {
            fs::remove_file(&self.path)
                .with_context(|| format!("cannot remove {}", self.path.display()))?;
        }
        Ok(())
    }
}

/// Demonstrations to learn from.
#[derive(Clone, Debug)]
pub(crate) struct Demonstrations {
    path: PathBuf,
    header: Header,
    lessons: Vec<Lesson>,
}

impl Demonstrations {
    /// Reads a file.
    ///
    /// # Errors
    /// If it is none of demonstrations, if it has changed on disk, or if it holds no whole episode.
    pub(crate) fn read(path: &Path) -> anyhow::Result<Self> {
        let name = path.display();
        if !path.is_file() {
            bail!("there is no file {name}; `demonstrate --out FILE` makes one");
        }
        let held = Journal::read(path)?;
        if let Some(damage) = held.damage {
            bail!("{name} cannot be learned from: {damage}");
        }
        let mut records = held.records.iter();
        let header: Option<Header> =
            records.next().and_then(|bytes| serde_json::from_slice(bytes).ok());
        let header = header.with_context(|| format!("{name} holds no demonstrations"))?;
        if header.palpate_demonstrations != FORMAT {
            let format = header.palpate_demonstrations;
            bail!("{name} is of format {format}; this version reads format {FORMAT}");
        }
        let dims = (header.observation_dim, header.action_dim);
        let lessons: Option<Vec<Lesson>> =
            records.map(|bytes| Lesson::parse(bytes, dims.0, dims.1).map(|(_, l)| l)).collect();
        let mut lessons = lessons.with_context(|| format!("{name} holds what is no step"))?;
        let whole = lessons.iter().rposition(|l| l.episode_end).map_or(0, |end| end + 1);
        // An episode that was being written when its recording was killed teaches no end.
        lessons.truncate(whole);
        if lessons.is_empty() {
            bail!("{name} holds no whole episode");
        }
        Ok(Self { path: path.to_owned(), header, lessons })
    }

    /// The steps, in the order in which they were taken.
    #[cfg(test)]
    pub(super) fn lessons(&self) -> &[Lesson] {
        &self.lessons
    }

    /// Refuses to be learned from under settings that give its numbers another meaning.
    pub(crate) fn fit(&self, config: &Config, dims: (usize, usize)) -> anyhow::Result<()> {
        let then: Config = toml::from_str(&self.header.config).with_context(|| {
            format!("the configuration in {} is not of this version", self.path.display())
        })?;
        let mut changes = past::differences(&then, config)?;
        changes.retain(|(key, _)| decides(key));
        if !changes.is_empty() {
            let changes: Vec<String> = changes.into_iter().map(|(_, change)| change).collect();
            bail!(
                "{} was recorded under other settings, where its numbers mean something else:\n  {}\nRecord it again: demonstrate takes the same --task, --model, --config and --set as a training",
                self.path.display(),
                changes.join("\n  ")
            );
        }
        let (observation, action) = (self.header.observation_dim, self.header.action_dim);
        if (observation, action) != dims {
            bail!(
                "{} has {observation} observations and {action} actions, but this configuration {} and {}",
                self.path.display(),
                dims.0,
                dims.1
            );
        }
        Ok(())
    }

    /// Shows them to an agent.
    pub(crate) fn teach(&self, agent: &mut Sac) -> anyhow::Result<()> {
        for lesson in &self.lessons {
            agent.demonstrate(&lesson.transition())?;
        }
        Ok(())
    }

    /// Puts a copy where a run keeps them.
    pub(crate) fn keep(&self, run: &Path) -> anyhow::Result<()> {
        Journal::copy(&self.path, &run.join(DEMONSTRATIONS))?;
        Ok(())
    }
}
