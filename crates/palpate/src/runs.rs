//! `runs`: what lies in the run directories, and whether it is whole.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use anyhow::{Context as _, bail};
use palpate_runs::{
    CheckpointStore, Csv, Health, JOURNAL, Journal, RunDir, copy, inspect, list, repair,
};
use palpate_sac::Sac;

use crate::Config;
use crate::train::lesson::Lesson;
use crate::train::pupil::CONFIG;

/// Prints a line for every run in `folder`, oldest first.
pub fn show(folder: &Path, out: &mut dyn Write) -> anyhow::Result<()> {
    let runs = list(folder);
    if runs.is_empty() {
        bail!("there are no runs in {}; start one with train-sim", folder.display());
    }
    writeln!(
        out,
        "{:<16} {:<7} {:>5} {:>15}  {:>8} {:>8}  run",
        "task", "model", "seed", "steps", "success", "state"
    )?;
    for run in runs {
        let path = run.display();
        match Line::of(&run) {
            Ok(line) => writeln!(out, "{line}  {path}")?,
            Err(error) => writeln!(out, "unreadable ({error:#}): see `runs verify`  {path}")?,
        }
    }
    Ok(())
}

/// A run in a line.
struct Line {
    config: Config,
    step: u64,
    /// Its summary says so.
    complete: bool,
    /// Latest evaluation of the deterministic policy.
    success: Option<f64>,
    written: bool,
}

impl Line {
    fn of(run: &Path) -> anyhow::Result<Self> {
        let mut config = Config::of_run(run, &[])?;
        config.run.steps = extended_to(run)?.unwrap_or(config.run.steps);
        let (mut step, mut success) = (0, None);
        if let Ok(csv) = Csv::read(&run.join("metrics.csv")) {
            let last = |name| csv.column(name).map(|c| c.into_iter().flatten().last());
            step = last("time/total_timesteps")?.unwrap_or(0.0) as u64;
            success = last("eval/success_rate")?;
        }
        let summary = std::fs::read_to_string(run.join("summary.json")).ok();
        let summary =
            summary.and_then(|text| serde_json::from_str::<serde_json::Value>(&text).ok());
        // A run that is being extended has the summary of before.
        let complete = summary.is_some_and(|summary| {
            summary["complete"] == true && summary["steps"].as_u64() >= Some(config.run.steps)
        });
        Ok(Self { config, step, complete, success, written: RunDir::is_written(run) })
    }
}

/// The steps that a run was last asked for: --steps of a resumed one stands in its checkpoints.
fn extended_to(run: &Path) -> anyhow::Result<Option<u64>> {
    let entries = CheckpointStore::open(run)?.entries()?;
    let Some(newest) = entries.iter().find(|entry| entry.step().is_some()) else { return Ok(None) };
    let text = std::fs::read_to_string(newest.path.join(CONFIG)).unwrap_or_default();
    Ok(toml::from_str::<Config>(&text).ok().map(|config| config.run.steps))
}

impl std::fmt::Display for Line {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { config, step, complete, success, written } = self;
        let run = &config.run;
        let state = match (written, complete) {
            (true, _) => "training",
            (false, true) => "complete",
            (false, false) => "stopped",
        };
        let success = success.map_or_else(|| "–".into(), |rate| format!("{:.0} %", 100.0 * rate));
        let steps = format!("{step}/{}", run.steps);
        let (task, model, seed) = (&config.task.name, &config.policy.name, run.seed);
        write!(f, "{task:<16} {model:<7} {seed:>5} {steps:>15}  {success:>8} {state:>8}")
    }
}

/// Reads every byte of a run. An error if something is damaged.
pub fn verify(run: &Path, out: &mut dyn Write) -> anyhow::Result<()> {
    let parts = inspect(run)?;
    for part in &parts {
        writeln!(out, "{part}")?;
    }
    let damaged = parts.iter().filter(|p| matches!(p.health, Health::Damaged(_))).count();
    if damaged > 0 {
        bail!("{damaged} of {} parts damaged; `runs repair` saves what can be saved", parts.len());
    }
    Ok(())
}

/// Puts right what can be.
pub fn mend(run: &Path, out: &mut dyn Write) -> anyhow::Result<()> {
    let done = repair(run)?;
    for what in &done {
        writeln!(out, "{what}")?;
    }
    if done.is_empty() {
        writeln!(out, "nothing to repair")?;
    }
    Ok(())
}

/// Copies a run whole, also while it is being trained.
pub fn duplicate(run: &Path, to: &Path, out: &mut dyn Write) -> anyhow::Result<()> {
    let checkpoints = copy(run, to)?;
    writeln!(out, "{} with {} whole checkpoints", to.display(), checkpoints.len())?;
    Ok(())
}

/// Writes every transition of a run as CSV: of a run on an arm all of its journal, of a simulated one the replay of
/// its last checkpoint.
pub fn export(run: &Path, to: &Path, out: &mut dyn Write) -> anyhow::Result<()> {
    RunDir::view(run)?;
    let checkpoint = RunDir::view(run)?.checkpoints()?.latest()?;
    let checkpoint = checkpoint.context("the run has no checkpoint yet")?;
    let agent = Sac::load(&checkpoint)?;
    let (observation, action) = (agent.observation_dim(), agent.action_dim());
    let file = File::create_new(to).with_context(|| format!("cannot create {}", to.display()))?;
    let mut csv = BufWriter::new(file);
    let many = |name: &'static str, n: usize| (0..n).map(move |i| format!("{name}_{i}"));
    let names = ["step", "terminal", "episode_end", "reward"].map(String::from).into_iter();
    let names = names
        .chain(many("observation", observation))
        .chain(many("action", action))
        .chain(many("executed", action))
        .chain(many("next_observation", observation));
    writeln!(csv, "{}", names.collect::<Vec<_>>().join(","))?;
    let mut row = |step: u64, flags: [bool; 2], numbers: &[&[f32]]| -> std::io::Result<()> {
        write!(csv, "{step},{},{}", u8::from(flags[0]), u8::from(flags[1]))?;
        for x in numbers.iter().copied().flatten() {
            write!(csv, ",{x}")?;
        }
        writeln!(csv)
    };
    let mut rows = 0u64;
    let held = Journal::read(&run.join(JOURNAL))?;
    if held.records.is_empty() {
        let first = agent.steps() - agent.replay_len() as u64;
        for (step, t) in (first + 1..).zip(agent.transitions()) {
            let numbers = [&[t.reward], t.observation, t.action, t.executed, t.next_observation];
            row(step, [t.terminal, t.episode_end], &numbers)?;
            rows += 1;
        }
    }
    for record in &held.records {
        let (step, l) = Lesson::parse(record, observation, action)
            .with_context(|| format!("{JOURNAL} is that of another task"))?;
        let numbers: [&[f32]; 5] = [&[l.reward], &l.observation, &l.action, &l.executed, &l.next];
        row(step, [l.terminal, l.episode_end], &numbers)?;
        rows += 1;
    }
    csv.flush()?;
    writeln!(out, "{} with {rows} transitions", to.display())?;
    Ok(())
}
