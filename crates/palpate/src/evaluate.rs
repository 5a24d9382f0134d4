//! `evaluate`: what the policy does on fresh episodes, beside three baselines on the same ones.

use std::fmt::Write as _;
use std::io::{IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use anyhow::Context as _;
use palpate_env::{Env, Outcome, Summary};
use palpate_runs::stats::clopper_pearson;
use palpate_runs::{CheckpointStore, RunDir};
use palpate_sac::Policy;
use palpate_safety::{Counts, Guarded, Tally};

use crate::baselines::Actor;
use crate::parallel::{self, share_out};
use crate::record::Recorder;
use crate::stack::{Purpose, SimEnv, sim_env};
use crate::{Config, interrupt};

/// Seed of the episodes when none is given: fresh ones, the same for every run.
pub const DEFAULT_SEED: u64 = 1000;

/// Episodes of every policy that are recorded, however they end.
const FIRST: u64 = 3;
/// Most episodes of a policy that are recorded.
const MOST: usize = 10;

/// What to evaluate.
#[derive(Clone, Debug)]
pub struct Options {
    /// Episodes per policy.
    pub episodes: u64,
    /// Seed of the episodes.
    pub seed: u64,
    /// `key.path=value` changes to the run's configuration (another friction, another clearance, …).
    pub set: Vec<String>,
    /// Sample actions instead of taking the mean.
    pub stochastic: bool,
    /// Folder for recordings of every policy's first episodes and of those that failed.
    pub record: Option<PathBuf>,
}

/// One policy on all episodes.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Row {
    /// Which policy.
    pub policy: String,
    /// Episodes run.
    pub episodes: usize,
    /// Episodes that reached the goal.
    pub successes: usize,
    /// successes / episodes.
    pub success_rate: f64,
    /// Clopper-Pearson interval of the success rate, 95 %.
    pub success_interval: (f64, f64),
    /// Episodes ended by the force limit.
    pub collisions: usize,
    /// Mean sum of rewards.
    pub mean_return: f64,
    /// Mean actions per episode.
    pub mean_steps: f64,
    /// Median time of the successful episodes, s.
    pub median_seconds: Option<f64>,
    /// Mean over episodes of the mean contact force, N.
    pub mean_force: f64,
    /// Median over episodes of the peak contact force, N.
    pub median_peak_force: f64,
    /// Largest contact force of all, N.
    pub max_peak_force: f64,
    /// Refused commands and force stops by cause, control ticks.
    pub tally: Tally,
    /// Verdicts of the fail-safe layer other than a plain pass, control ticks.
    pub verdicts: Counts,
    /// Episodes cut by a simulator fault.
    pub faults: usize,
}

/// Evaluates the last and the kept policy of a run and the baselines, on all cores unless episodes are recorded. After
/// an interrupt, as far as it got.
pub fn run(
    dir: &Path,
    options: &Options,
    progress: impl FnMut(&str, u64) + Send,
) -> anyhow::Result<Vec<Row>> {
    RunDir::view(dir)?;
    let config = Config::of_run(dir, &options.set)?;
    let threads = if options.record.is_some() { 1 } else { parallel::cores() as u64 };
    let mut envs = (0..threads.min(options.episodes).max(1))
        .map(|_| sim_env(&config, options.seed, Purpose::Evaluate))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let dim = envs[0].action_dim();
    let mut actors = Vec::new();
    for (name, policy) in learned(dir)? {
        check_shape(&policy, &envs[0])?;
        actors.push((name, Actor::learned(policy, options.stochastic.then_some(options.seed))));
    }
    if actors.is_empty() {
        anyhow::bail!("{} holds no checkpoint yet: train for longer, or resume it", dir.display());
    }
    actors.push(("a = 0", Actor::zero(dim)));
    actors.push(("uniform random", Actor::random(dim, options.seed)));
    actors.push(("scripted", Actor::scripted(&config, dim)));
    let mut recorder = match &options.record {
        Some(folder) => {
            let recorder = Recorder::new(&config, folder)?;
            recorder.load(&mut envs[0]);
            Some(recorder)
        }
        None => None,
    };
    let mut rows = Vec::new();
    let told = Mutex::new((&mut recorder, progress));
    for (name, actor) in actors {
        let (done, kept) = (AtomicU64::new(0), AtomicUsize::new(0));
        let episode = |(env, actor): &mut (&mut SimEnv, Actor), episode| {
            let summary = rollout(env, actor, episode)?;
            let telling = episode < FIRST || summary.outcome != Outcome::Success;
            if let Ok((recorder, progress)) = told.lock().as_deref_mut() {
                if let Some(recorder) = recorder.as_mut().filter(|_| telling)
                    && kept.fetch_add(1, Ordering::Relaxed) < MOST
                {
                    recorder.keep_as(env, name);
                }
                progress(name, done.fetch_add(1, Ordering::Relaxed) + 1);
            }
            Ok(summary)
        };
        let mut workers: Vec<_> = envs.iter_mut().map(|env| (env, actor.clone())).collect();
        let summaries = share_out(&mut workers, options.episodes, interrupt::requested, episode)?;
        if !summaries.is_empty() {
            rows.push(Row::new(name, &summaries));
        }
        if interrupt::requested() {
            break;
        }
    }
    match recorder.map_or_else(Vec::new, Recorder::finish) {
        lost if lost.is_empty() => Ok(rows),
        lost => anyhow::bail!("{}", lost.join("\n")),
    }
}

/// The last and the kept policy of a run, as far as it has them; once if they are the same.
fn learned(dir: &Path) -> anyhow::Result<Vec<(&'static str, Policy)>> {
    let load = |folder| -> anyhow::Result<Option<Policy>> {
        let Some(path) = CheckpointStore::open(dir)?.find(folder)? else { return Ok(None) };
        let policy = Policy::load(&path);
        policy.map(Some).with_context(|| format!("cannot load the policy in {}", path.display()))
    };
    Ok(match (load(palpate_runs::LAST)?, load(palpate_runs::BEST)?) {
        (Some(last), Some(kept)) if last == kept => vec![("learned (last, kept)", last)],
        (last, kept) => [("learned (last)", last), ("learned (kept)", kept)]
            .into_iter()
            .filter_map(|(name, policy)| Some((name, policy?)))
            .collect(),
    })
}

/// Runs episodes 0 … n−1 with one policy. An interrupt ends it early, at an episode's end.
pub fn rollouts<R: Guarded>(
    env: &mut Env<R>,
    actor: &mut Actor,
    episodes: u64,
    mut done: impl FnMut(&mut Env<R>, &Summary),
) -> anyhow::Result<Vec<Summary>> {
    let mut summaries = Vec::with_capacity(episodes as usize);
    for episode in 0..episodes {
        let summary = rollout(env, actor, episode)?;
        done(env, &summary);
        summaries.push(summary);
        if interrupt::requested() {
            break;
        }
    }
    Ok(summaries)
}

/// Runs one episode.
fn rollout<R: Guarded>(
    env: &mut Env<R>,
    actor: &mut Actor,
    episode: u64,
) -> anyhow::Result<Summary> {
    env.set_next_episode(episode);
    env.reset()?;
    actor.reset(episode);
    loop {
        let action = actor.act(env).to_vec();
        if let Some(summary) = env.step(&action)?.summary {
            return Ok(summary);
        }
    }
}

/// Refuses a policy that was trained on other observations or actions than an environment's.
pub(crate) fn check_shape<R: Guarded>(policy: &Policy, env: &Env<R>) -> anyhow::Result<()> {
    let (have, want) = (
        (policy.observation_dim(), policy.action_dim()),
        (env.observation_dim(), env.action_dim()),
    );
    if have != want {
        anyhow::bail!(
            "the policy maps {} observations to {} actions, but this configuration has {} and {}: do not change env.observation or policy with --set",
            have.0,
            have.1,
            want.0,
            want.1
        );
    }
    Ok(())
}

impl Row {
    /// Summarises episodes.
    pub(crate) fn new(policy: &str, summaries: &[Summary]) -> Self {
        let count = |o: Outcome| summaries.iter().filter(|s| s.outcome == o).count();
        let mean = |f: fn(&Summary) -> f64| {
            summaries.iter().map(f).sum::<f64>() / summaries.len().max(1) as f64
        };
        let successes = count(Outcome::Success);
        let (mut tally, mut verdicts) = (Tally::default(), Counts::default());
        for s in summaries {
            tally += s.tally;
            verdicts += s.verdicts;
        }
        let times: Vec<f64> =
            summaries.iter().filter(|s| s.outcome == Outcome::Success).map(|s| s.seconds).collect();
        let peaks: Vec<f64> = summaries.iter().map(|s| s.peak_force).collect();
        Self {
            policy: policy.into(),
            episodes: summaries.len(),
            successes,
            success_rate: successes as f64 / summaries.len().max(1) as f64,
            success_interval: clopper_pearson(successes as u64, summaries.len() as u64, 0.95),
            collisions: count(Outcome::Collision),
            mean_return: mean(|s| s.total_reward),
            mean_steps: mean(|s| f64::from(s.steps)),
            median_seconds: median(times),
            mean_force: mean(|s| s.mean_force),
            median_peak_force: median(peaks.clone()).unwrap_or(0.0),
            max_peak_force: peaks.into_iter().fold(0.0, f64::max),
            tally,
            verdicts,
            faults: count(Outcome::Fault),
        }
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    match n {
        0 => None,
        _ if n % 2 == 1 => Some(values[n / 2]),
        _ => Some(f64::midpoint(values[n / 2 - 1], values[n / 2])),
    }
}

/// The rows as a table for people.
pub fn table(rows: &[Row]) -> String {
    let mut out = String::from(
        "policy               success (95 % interval)   return  steps  median s  force mean / peak median / max N  collisions  refused ik / speed\n",
    );
    for r in rows {
        let seconds = r.median_seconds.map_or_else(|| "–".into(), |s| format!("{s:.2}"));
        let success = format!(
            "{:>3}/{} ({:.0}–{:.0} %)",
            r.successes,
            r.episodes,
            100.0 * r.success_interval.0,
            100.0 * r.success_interval.1
        );
        let force =
            format!("{:.1} / {:.1} / {:.1}", r.mean_force, r.median_peak_force, r.max_peak_force);
        let refused = format!("{} / {}", r.tally.no_ik, r.tally.joint_speed);
        let _ = writeln!(
            out,
            "{:<20} {success:<24} {:>7.1} {:>6.1}  {seconds:>8}  {force:<33} {:>10}  {refused}",
            r.policy, r.mean_return, r.mean_steps, r.collisions
        );
    }
    if rows.iter().any(|r| r.verdicts.iter().any(|(_, ticks)| ticks > 0)) {
        out.push_str("\nThe fail-safe layer's verdicts per episode, control ticks of all others than plain passes\n");
        for r in rows {
            let per = |ticks: u64| ticks as f64 / r.episodes.max(1) as f64;
            let given = r.verdicts.iter().filter(|(_, ticks)| *ticks > 0);
            let given: Vec<_> =
                given.map(|(cause, n)| format!("{} {:.1}", cause.name(), per(n))).collect();
            let given = if given.is_empty() { "none".into() } else { given.join(", ") };
            let _ = writeln!(out, "{:<20} {given}", r.policy);
        }
    }
    out
}

/// The `evaluate` command.
pub fn command(dir: &Path, options: &Options, json: bool) -> anyhow::Result<()> {
    let mut console = Counter::new(options.episodes);
    let rows = run(dir, options, |policy, done| console.show(policy, done))?;
    console.clear();
    let mut out = std::io::stdout().lock();
    if json {
        writeln!(out, "{}", serde_json::to_string_pretty(&rows)?)?;
    } else {
        writeln!(out, "{}", table(&rows).trim_end())?;
        let how = if options.stochastic {
            "learned policies were sampled, not their mean"
        } else {
            "learned policies took their mean action; --stochastic samples them, which early in a training succeeds more often"
        };
        writeln!(out, "{how}")?;
    }
    if interrupt::requested() {
        anyhow::bail!(
            "interrupted: there are figures of the episodes that were finished, no others"
        );
    }
    Ok(())
}

/// "policy: 12/100" on a terminal's standard error; silent elsewhere.
struct Counter {
    total: u64,
    live: bool,
}

impl Counter {
    fn new(total: u64) -> Self {
        Self { total, live: std::io::stderr().is_terminal() }
    }

    fn show(&mut self, policy: &str, done: u64) {
        if self.live {
            let _ = write!(std::io::stderr(), "\r\x1b[K{policy}: {done}/{} episodes", self.total);
        }
    }

    fn clear(&mut self) {
        if self.live {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
    }
}

#[cfg(test)]
mod tests {
    use palpate_runs::Slot;
    use palpate_sac::{Sac, SacConfig};

    use super::*;

    #[test]
    fn a_policy_that_is_last_and_kept_is_named_once() {
        let run = tempfile::tempdir().unwrap();
        let store = CheckpointStore::open(run.path()).unwrap();
        let keep = |slot, seed| {
            let agent = Sac::new(&SacConfig::default(), 3, 2, seed).unwrap();
            store.save(slot, |dir| Ok(agent.save(dir)?)).unwrap();
        };
        let names = || learned(run.path()).unwrap().into_iter().map(|(name, _)| name);
        keep(Slot::Step(100), 1);
        assert!(names().eq(["learned (last)"]));
        // Of the same step, and another: an arm's run that lost what came after a checkpoint.
        keep(Slot::Best(100), 2);
        assert!(names().eq(["learned (last)", "learned (kept)"]));
        keep(Slot::Best(200), 1);
        assert!(names().eq(["learned (last, kept)"]));
    }
}
