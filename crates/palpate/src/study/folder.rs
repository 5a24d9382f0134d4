//! Where a study lies.
//!
//! ```text
//! studies/paper/
//! ├── study.toml      what was asked
//! ├── plan.csv        one row per run
//! ├── runs/ID/        run directories; result.json and evaluation.csv once a run is done
//! ├── runs/ID.log     what the run said
//! ├── runs.csv        one row per finished run        ┐
//! ├── episodes.csv    one row per training episode    │ written by `study report` from runs/, and enough for it
//! ├── evaluation.csv  one row per judged episode      │ without them
//! ├── curves.csv      metrics over the training       │
//! ├── times.csv       how long each run took, and where ┘
//! └── report.md, report.html, *.svg
//! ```

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};

use super::plan::{self, Planned, Study};
use super::rows::{RESULT, Rows};

const STUDY: &str = "study.toml";

/// A study's folder, with its plan.
#[derive(Debug)]
pub(super) struct Folder {
    pub(super) path: PathBuf,
    pub(super) study: Study,
    pub(super) plan: Vec<Planned>,
    /// Names of the runs that were collected before, perhaps elsewhere.
    collected: Vec<String>,
}

impl Folder {
    /// Opens a study's folder, or makes the one of a study file (or of a built-in study's name).
    ///
    /// # Errors
    /// If the folder holds another study under that name, naming both.
    pub(super) fn open(what: &Path, out: Option<&Path>) -> anyhow::Result<Self> {
        if what.join(STUDY).is_file() {
            let text = plan::text(&what.join(STUDY))?;
            return Self::with(what.to_owned(), &text);
        }
        let text = plan::text(what)?;
        let study = Study::parse(&text)?;
        let path = out.map_or_else(|| Path::new("studies").join(&study.name), Path::to_owned);
        let kept = path.join(STUDY);
        match std::fs::read_to_string(&kept) {
            Ok(before) if before != text => bail!(
                "{} was begun with another study file than {}: give --out another folder, or go on with `study run {}`",
                path.display(),
                what.display(),
                path.display()
            ),
            Ok(_) => {}
            Err(_) => {
                study.plan()?;
                std::fs::create_dir_all(&path)
                    .with_context(|| format!("cannot create {}", path.display()))?;
                palpate_runs::write_whole(&kept, text.as_bytes())?;
            }
        }
        Self::with(path, &text)
    }

    fn with(path: PathBuf, text: &str) -> anyhow::Result<Self> {
        let study = Study::parse(text).with_context(|| format!("{}", path.display()))?;
        let plan = study.plan().with_context(|| format!("{}", path.display()))?;
        let collected = Rows::names(&path)?;
        Ok(Self { path, study, plan, collected })
    }

    /// What to give to `study run` to do the same: a built-in study's name, or the file in this folder.
    pub(super) fn source(&self) -> &str {
        let name = self.study.name.as_str();
        let built_in = crate::config::STUDIES.iter().any(|(known, _)| *known == name);
        if built_in { name } else { STUDY }
    }

    /// The run directory of a run.
    pub(super) fn dir(&self, run: &Planned) -> PathBuf {
        self.path.join("runs").join(&run.id)
    }

    /// Where a run's words go.
    pub(super) fn log(&self, run: &Planned) -> PathBuf {
        self.path.join("runs").join(format!("{}.log", run.id))
    }

    /// Whether a run has its rows.
    pub(super) fn is_done(&self, run: &Planned) -> bool {
        self.collected.contains(&run.id) || self.dir(run).join(RESULT).is_file()
    }

    /// How far a run is: steps in its table.
    pub(super) fn steps(&self, run: &Planned) -> u64 {
        let text = std::fs::read_to_string(self.dir(run).join("metrics.csv")).unwrap_or_default();
        let last = text.lines().last().and_then(|line| line.split(',').next()?.parse::<f64>().ok());
        last.map_or(0, |step| step as u64)
    }

    /// All finished runs' rows: of run directories, and of what was collected before.
    pub(super) fn rows(&self) -> anyhow::Result<Rows> {
        let (mut all, collected) = (Rows::default(), Rows::read(&self.path)?);
        for run in &self.plan {
            match Rows::of_run(&self.dir(run)) {
                Some(rows) => all.take(rows.with_context(|| format!("run {}", run.id))?),
                None => all.take(collected.only(&run.id)),
            }
        }
        Ok(all)
    }
}
