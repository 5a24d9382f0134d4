//! One run of a study: train it or go on, judge it, write its rows.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, ensure};
use palpate_env::Outcome as Ending;
use palpate_runs::{BEST, CheckpointStore, LAST, RunDir};
use palpate_sac::Policy;

use super::folder::Folder;
use super::plan::{Kind, Planned, Study};
use super::rows::{self, EVALUATION, JudgedRow, Outcome, RESULT, RunRow, TimeRow, rounded};
use crate::baselines::Actor;
use crate::demonstrate::{Options, record};
use crate::evaluate::rollouts;
use crate::stack::{Purpose, sim_env};
use crate::{Config, interrupt, train};

/// How an attempt ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// The run has its rows.
    Done,
    /// It can be gone on with.
    Interrupted,
}

/// Does a run, or what is left of it.
pub(super) fn run(folder: &Folder, run: &Planned, threads: usize) -> anyhow::Result<End> {
    if folder.is_done(run) {
        return Ok(End::Done);
    }
    let (dir, started) = (folder.dir(run), Instant::now());
    let begun = dir.join("config.toml").is_file();
    let threads_key = format!("sac.threads={threads}");
    match run.kind {
        Kind::Learned if begun => {
            if !train::is_complete(&dir) {
                train::go_on(&dir, &[threads_key])?;
            }
        }
        Kind::Learned if run.demonstrations > 0 => {
            let Some(shown) = show(&dir, run)? else { return Ok(End::Interrupted) };
            train::start_shown(&run.choice(&[threads_key]), shown.path(), Some(&dir))?;
        }
        Kind::Learned => {
            train::start(&run.choice(&[threads_key]), Some(&dir))?;
        }
        _ if begun => {}
        _ => {
            let config = Config::load(&run.choice(&[]))?;
            RunDir::create(Some(&dir), &run.id, &config.to_toml()?)?;
        }
    }
    if interrupt::requested() {
        return Ok(End::Interrupted);
    }
    let held = RunDir::open(&dir)?;
    let Some(judged) = judge(&dir, run, &folder.study)? else {
        return Ok(End::Interrupted);
    };
    rows::write(&dir.join(EVALUATION), &judged)?;
    let outcome = Outcome {
        run: row(run, &dir)?,
        time: time(run, &dir, threads, started.elapsed().as_secs_f64()),
    };
    held.write_json(RESULT, &serde_json::to_value(&outcome)?)?;
    Ok(End::Done)
}

/// Records what a run is shown, in a file that is gone with this process: the run directory keeps its own; `None` if
/// interrupted.
fn show(dir: &Path, run: &Planned) -> anyhow::Result<Option<Shown>> {
    let runs = dir.parent().context("a run lies in a folder")?;
    std::fs::create_dir_all(runs).context("cannot make the folder of runs")?;
    let shown = Shown(runs.join(format!("{}.{}.demo", run.id, std::process::id())));
    let config = Config::load(&run.choice(&[]))?;
    let mut env = sim_env(&config, config.run.seed, Purpose::Demonstrate)?;
    let mut script = Actor::scripted(&config, env.action_dim());
    let options = Options { episodes: run.demonstrations, only_successes: true };
    let account = record(&mut env, &mut script, &config, &options, shown.path(), |_, _| {});
    if interrupt::requested() {
        return Ok(None);
    }
    let account = account?;
    ensure!(
        account.kept == run.demonstrations,
        "the script reached the goal in {} of {} episodes; {} demonstrations were asked for",
        account.successes,
        account.tried,
        run.demonstrations
    );
    Ok(Some(shown))
}

/// A file of demonstrations that is removed with this.
struct Shown(PathBuf);

impl Shown {
    fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Shown {
    fn drop(&mut self) {
        // A file that stays behind harms nobody.
        let _ = std::fs::remove_file(&self.0);
    }
}

/// What acts, and what the rows call it.
type Named = (&'static str, &'static str, Actor);

/// Fresh episodes, the same ones for every run of the study; `None` if interrupted.
///
/// Under a condition the last policy's mean action alone, or the baseline.
fn judge(dir: &Path, run: &Planned, study: &Study) -> anyhow::Result<Option<Vec<JudgedRow>>> {
    let how = study.evaluation;
    let plain = ("", Vec::new());
    let conditions = study.conditions.iter().map(|c| (c.name.as_str(), c.settings()));
    let mut all = Vec::new();
    for (condition, set) in std::iter::once(plain).chain(conditions) {
        let config = Config::of_run(dir, &set)?;
        let mut env = sim_env(&config, how.seed, Purpose::Evaluate)?;
        let all_of_them = condition.is_empty();
        let actors = actors(dir, run, &config, (env.action_dim(), how.seed), all_of_them)?;
        for (policy, actions, mut actor) in actors {
            let summaries = rollouts(&mut env, &mut actor, how.episodes, |_, _| {})?;
            let named = (condition, policy, actions);
            all.extend(summaries.iter().map(|summary| judged(run, named, summary)));
            if interrupt::requested() {
                return Ok(None);
            }
        }
    }
    Ok(Some(all))
}

/// All that a run is judged by, or the first alone.
fn actors(
    dir: &Path,
    run: &Planned,
    config: &Config,
    (dim, seed): (usize, u64),
    all: bool,
) -> anyhow::Result<Vec<Named>> {
    let mut actors: Vec<Named> = Vec::new();
    match run.kind {
        Kind::Learned => {
            for (name, slot) in [("last", LAST), ("kept", BEST)] {
                let Some(path) = CheckpointStore::open(dir)?.find(slot)? else { continue };
                let policy = || {
                    Policy::load(&path)
                        .with_context(|| format!("cannot load the policy in {}", path.display()))
                };
                actors.push((name, "mean", Actor::learned(policy()?, None)));
                actors.push((name, "sampled", Actor::learned(policy()?, Some(seed))));
            }
        }
        Kind::Zero => actors.push(("zero", "mean", Actor::zero(dim))),
        Kind::Random => actors.push(("random", "sampled", Actor::random(dim, seed))),
        Kind::Scripted => actors.push(("scripted", "mean", Actor::scripted(config, dim))),
    }
    if !all {
        actors.truncate(1);
    }
    Ok(actors)
}

fn judged(
    run: &Planned,
    (condition, policy, actions): (&str, &str, &str),
    s: &palpate_env::Summary,
) -> JudgedRow {
    let is = |what: Ending| u8::from(s.outcome == what);
    JudgedRow {
        run: run.id.clone(),
        condition: condition.into(),
        policy: policy.into(),
        actions: actions.into(),
        episode: s.episode,
        success: is(Ending::Success),
        collision: is(Ending::Collision),
        total: rounded(s.total_reward),
        length: s.steps.into(),
        seconds: rounded(s.seconds),
        peak_force: rounded(s.peak_force),
        mean_force: rounded(s.mean_force),
    }
}

fn read(path: &Path) -> Option<serde_json::Value> {
    serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()
}

fn row(run: &Planned, dir: &Path) -> anyhow::Result<RunRow> {
    let summary = match run.kind {
        Kind::Learned => read(&dir.join("summary.json")).context("summary.json")?,
        _ => serde_json::json!({}),
    };
    let number = |key: &str| summary[key].as_u64();
    Ok(RunRow {
        run: run.id.clone(),
        block: run.block.clone(),
        task: run.task.clone(),
        model: run.model.clone(),
        policy: run.kind,
        penalty: run.penalty,
        seed: run.seed,
        demonstrations: run.demonstrations,
        steps: number("steps").unwrap_or(0),
        varied: run.variation(),
        episodes: number("episodes").unwrap_or(0),
        successes: number("successes").unwrap_or(0),
        collisions: number("collisions").unwrap_or(0),
        first_success_step: number("first_success_step"),
        kept_step: summary["best_evaluation"]["step"].as_u64(),
    })
}

fn time(run: &Planned, dir: &Path, threads: usize, seconds: f64) -> TimeRow {
    let starts = read(&dir.join("provenance.json")).unwrap_or_default();
    let start = starts.as_array().and_then(|starts| starts.last()).cloned().unwrap_or_default();
    let word = |pointer: &str| {
        start.pointer(pointer).and_then(serde_json::Value::as_str).unwrap_or_default().to_owned()
    };
    TimeRow {
        run: run.id.clone(),
        seconds: (10.0 * seconds).round() / 10.0,
        threads,
        cpu: word("/cpu"),
        commit: word("/git/commit").chars().take(12).collect(),
        version: env!("CARGO_PKG_VERSION").into(),
    }
}
