//! One run of a study: train it or go on, judge it, write its rows.

use std::path::Path;
use std::time::Instant;

use anyhow::Context as _;
use palpate_env::Outcome as Ending;
use palpate_runs::{BEST, CheckpointStore, LAST, RunDir};
use palpate_sac::Policy;

use super::folder::Folder;
use super::plan::{Judging, Kind, Planned};
use super::rows::{self, EVALUATION, JudgedRow, Outcome, RESULT, RunRow, TimeRow, rounded};
use crate::baselines::Actor;
use crate::evaluate::rollouts;
use crate::stack::{Purpose, SimEnv, sim_env};
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
    let Some(judged) = judge(&dir, run, folder.study.evaluation)? else {
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

/// Fresh episodes, the same ones for every run of the study; `None` if interrupted.
fn judge(dir: &Path, run: &Planned, how: Judging) -> anyhow::Result<Option<Vec<JudgedRow>>> {
    let config = Config::of_run(dir, &[])?;
    let mut env = sim_env(&config, how.seed, Purpose::Evaluate)?;
    let dim = env.action_dim();
    let mut actors = Vec::new();
    match run.kind {
        Kind::Learned => {
            for (name, slot) in [("last", LAST), ("kept", BEST)] {
                let Some(path) = CheckpointStore::open(dir)?.find(slot)? else { continue };
                let policy = || {
                    Policy::load(&path)
                        .with_context(|| format!("cannot load the policy in {}", path.display()))
                };
                actors.push((name, "mean", Actor::learned(policy()?, None)));
                actors.push((name, "sampled", Actor::learned(policy()?, Some(how.seed))));
            }
        }
        Kind::Zero => actors.push(("zero", "mean", Actor::zero(dim))),
        Kind::Random => actors.push(("random", "sampled", Actor::random(dim, how.seed))),
        Kind::Scripted => actors.push(("scripted", "mean", Actor::scripted(&config, dim))),
    }
    let mut all = Vec::new();
    for (policy, actions, mut actor) in actors {
        all.extend(episodes(&mut env, &mut actor, run, (policy, actions), how.episodes)?);
        if interrupt::requested() {
            return Ok(None);
        }
    }
    Ok(Some(all))
}

fn episodes(
    env: &mut SimEnv,
    actor: &mut Actor,
    run: &Planned,
    (policy, actions): (&str, &str),
    episodes: u64,
) -> anyhow::Result<Vec<JudgedRow>> {
    let is = |ending: Ending, what: Ending| u8::from(ending == what);
    let summaries = rollouts(env, actor, episodes, |_, _| {})?;
    let row = |s: &palpate_env::Summary| JudgedRow {
        run: run.id.clone(),
        policy: policy.into(),
        actions: actions.into(),
        episode: s.episode,
        success: is(s.outcome, Ending::Success),
        collision: is(s.outcome, Ending::Collision),
        total: rounded(s.total_reward),
        length: s.steps.into(),
        seconds: rounded(s.seconds),
        peak_force: rounded(s.peak_force),
        mean_force: rounded(s.mean_force),
    };
    Ok(summaries.iter().map(row).collect())
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
