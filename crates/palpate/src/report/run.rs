//! What a report needs to know of a run.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use palpate_runs::stats::clopper_pearson;
use palpate_runs::{CheckpointStore, Csv, LAST, RunDir};
use palpate_sac::{Policy, Sac};

use super::behaviour::Behaviour;
use crate::Config;
use crate::ledger;
use crate::stack::{Purpose, sim_env};
use crate::train::book;

/// Steps of a run that take part in its last evaluation's interval.
type Rate = (f64, (f64, f64));

/// A run, read.
#[derive(Debug)]
pub(super) struct Run {
    pub(super) name: String,
    pub(super) path: PathBuf,
    pub(super) config: Config,
    pub(super) metrics: Option<Csv>,
    pub(super) episodes: Option<Csv>,
    /// Verdicts by cause; none of a run that kept no ledger.
    pub(super) ledger: Option<ledger::Report>,
    /// Where they happened: cause, x, y, z in the hole frame, m.
    pub(super) places: Vec<(String, [f64; 3])>,
    pub(super) provenance: serde_json::Value,
    pub(super) written: bool,
    /// A fresh policy and the last one; the latter only if there is a checkpoint.
    pub(super) before: Option<Behaviour>,
    pub(super) after: Option<Behaviour>,
}

impl Run {
    pub(super) fn read(path: &Path) -> anyhow::Result<Self> {
        RunDir::view(path)?;
        let config = Config::of_run(path, &[])?;
        let provenance = std::fs::read_to_string(path.join("provenance.json"))
            .ok()
            .and_then(|text| serde_json::from_str(&text).ok())
            .unwrap_or_default();
        let name = path
            .canonicalize()
            .ok()
            .and_then(|p| Some(p.file_name()?.to_string_lossy().into_owned()))
            .unwrap_or_else(|| path.display().to_string());
        let mut run = Self {
            name,
            path: path.to_owned(),
            metrics: Csv::read(&path.join("metrics.csv")).ok(),
            episodes: Csv::read(&path.join("episodes.csv")).ok(),
            ledger: ledger::Report::of(path).ok(),
            places: Vec::new(),
            provenance,
            written: RunDir::is_written(path),
            before: None,
            after: None,
            config,
        };
        run.places = run.read_places().unwrap_or_default();
        run.behave()?;
        Ok(run)
    }

    /// Runs a fresh policy and the last one on the same starts.
    fn behave(&mut self) -> anyhow::Result<()> {
        let mut env = sim_env(&self.config, self.config.run.seed, Purpose::Monitor)?;
        let (observation, action) = (env.observation_dim(), env.action_dim());
        let fresh = Sac::new(&self.config.sac, observation, action, self.config.run.seed)?;
        self.before = Some(Behaviour::of(&mut env, &self.config, fresh.policy())?);
        // A run in training may be between two checkpoints.
        if let Ok(Some(last)) = CheckpointStore::open(&self.path).and_then(|s| s.find(LAST)) {
            let policy = Policy::load(&last)
                .with_context(|| format!("cannot load the policy in {}", last.display()))?;
            crate::evaluate::check_shape(&policy, &env)?;
            self.after = Some(Behaviour::of(&mut env, &self.config, policy)?);
        }
        Ok(())
    }

    fn read_places(&self) -> anyhow::Result<Vec<(String, [f64; 3])>> {
        let text = std::fs::read_to_string(self.path.join(book::FILE))?;
        let mut lines = text.split_inclusive('\n').filter_map(|line| line.strip_suffix('\n'));
        let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let at = |name: &str| header.iter().position(|h| *h == name).context("no such column");
        let (cause, x, y, z) = (at("cause")?, at("x")?, at("y")?, at("z")?);
        let hole_T_base = self.config.task.base_T_hole().inverse();
        let place = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            let number = |i: usize| cells.get(i)?.parse::<f64>().ok();
            let p = hole_T_base * nalgebra::Point3::new(number(x)?, number(y)?, number(z)?);
            Some(((*cells.get(cause)?).to_owned(), [p.x, p.y, p.z]))
        };
        Ok(lines.filter_map(place).collect())
    }

    /// The last value of a column of metrics.csv.
    pub(super) fn last(&self, column: &str) -> Option<f64> {
        self.metrics.as_ref()?.column(column).ok()?.into_iter().flatten().last()
    }

    /// Points of two columns of a table, none if a column is missing.
    pub(super) fn points(table: Option<&Csv>, x: &str, y: &str) -> Vec<(f64, f64)> {
        table.and_then(|table| table.points(x, y).ok()).unwrap_or_default()
    }

    /// Success of the latest evaluation and its 95 % interval.
    pub(super) fn success(&self) -> Option<Rate> {
        let (rate, n) = (self.last("eval/success_rate")?, self.config.run.evaluate_episodes);
        Some((rate, clopper_pearson((rate * n as f64).round() as u64, n, 0.95)))
    }

    /// Steps taken.
    pub(super) fn steps(&self) -> u64 {
        let table = self.episodes.as_ref().and_then(|t| t.column("step").ok());
        table.and_then(|c| c.into_iter().flatten().last()).unwrap_or(0.0) as u64
    }

    /// Sum of a column of episodes.csv.
    pub(super) fn sum(&self, column: &str) -> f64 {
        let table = self.episodes.as_ref().and_then(|t| t.column(column).ok());
        table.map_or(0.0, |c| c.into_iter().flatten().sum())
    }

    /// What the run is doing.
    pub(super) fn state(&self) -> &'static str {
        match (self.written, self.steps() >= self.config.run.steps) {
            (true, _) => "training",
            (false, true) => "complete",
            (false, false) => "stopped",
        }
    }
}
