//! `train-sim` and `train-real`: the loop that makes a policy.
//!
//! One loop for both. What differs is where the steps come from: a `World` that waits for the
//! learner, or one that cannot wait ([`crate::real`]).
//!
//! Checkpoints are taken between episodes, where a simulated world is rebuilt from the seed and the episode's
//! number, so a simulated run that is resumed continues exactly as if it had never stopped.

mod alarm;
pub(crate) mod book;
mod disk;
pub(crate) mod lesson;
pub(crate) mod past;
mod profile;
pub(crate) mod pupil;
mod tables;
pub(crate) mod trials;
pub(crate) mod world;

use std::path::Path;
use std::time::Instant;

use anyhow::{Context as _, bail};
use palpate_env::Env;
use palpate_runs::{CheckpointStore, DEMONSTRATIONS, LAST, RunDir};
use palpate_sac::Sac;
use palpate_safety::{Guarded, Safe};
use palpate_sim::SimArm;

use crate::config::{Choice, Config};
use crate::demonstrate::file::Demonstrations;
use crate::evaluate;
use crate::interrupt;
use crate::parallel;
use crate::progress::Progress;
use crate::stack::{self, Purpose};
pub use profile::TimeSpent;
use profile::{Laps, Timed};
use pupil::{CONFIG, PROGRESS, Pupil};
use world::{Lockstep, World};

/// File of a run that began with another one's learner: where that one was.
const ORIGIN: &str = "from.txt";

/// Starts a new run in simulation.
pub fn start(choice: &Choice, out: Option<&Path>) -> anyhow::Result<TimeSpent> {
    begin(Config::load(choice)?, None, out)
}

/// The same, with demonstrations from a file to learn from as well.
pub fn start_shown(
    choice: &Choice,
    demonstrations: &Path,
    out: Option<&Path>,
) -> anyhow::Result<TimeSpent> {
    let shown = Demonstrations::read(demonstrations)?;
    begin(Config::load_shown(choice, None)?, Some(&shown), out)
}

/// Starts a new run with the learner of another, replay included, under that run's settings, changed by the file and
/// the overrides of `choice`: on a harder task, say.
///
/// # Errors
/// If `run` was made on an arm or holds no checkpoint, and if its learner would have to be another one.
pub fn start_from(run: &Path, choice: &Choice, out: Option<&Path>) -> anyhow::Result<TimeSpent> {
    RunDir::view(run)?;
    let config = Config::of_run_with(run, choice.file.as_deref(), &choice.set)?;
    if config.ur.is_some() {
        bail!("{} is a run on an arm: go on from it with train-real --from", run.display());
    }
    let world = simulation(&config, 0)?;
    let (agent, remarks) = heir(run, &config, &world.env)?;
    let dir = create(&config, None, out)?;
    let origin = run.canonicalize().unwrap_or_else(|_| run.to_owned());
    std::fs::write(dir.path().join(ORIGIN), format!("{}\n", origin.display()))?;
    let world = world.recorded(&config, dir.path())?;
    let mut pupil = Pupil::new(config, dir, agent, Progress::default(), "train-sim")?;
    // Something to continue from, whatever happens in the first minutes.
    pupil.checkpoint()?;
    for remark in &remarks {
        pupil.console.note(remark);
    }
    self::run(world, pupil)
}

/// The learner of a run, to go on learning in an environment of this configuration, and what to be warned of.
pub(crate) fn heir<R: Guarded>(
    run: &Path,
    config: &Config,
    env: &Env<R>,
) -> anyhow::Result<(Sac, Vec<String>)> {
    let checkpoint = CheckpointStore::open(run)?
        .find(LAST)?
        .with_context(|| format!("{} holds no checkpoint", run.display()))?;
    let path = checkpoint.join(CONFIG);
    let then = std::fs::read_to_string(&path)
        .with_context(|| format!("cannot read {}", path.display()))?;
    let worth = past::inheritable(&then, config)
        .with_context(|| format!("the learner of {} stays as it is", run.display()))?;
    let mut agent = Sac::load_on(&checkpoint, config.sac.threads)?;
    agent.reseed(config.run.seed);
    evaluate::check_shape(&agent.policy(), env)?;
    let remark = |change| {
        format!("warning: {change}: what the learner remembers was rewarded and scaled otherwise")
    };
    Ok((agent, worth.into_iter().map(remark).collect()))
}

fn begin(
    config: Config,
    shown: Option<&Demonstrations>,
    out: Option<&Path>,
) -> anyhow::Result<TimeSpent> {
    let world = simulation(&config, 0)?;
    let agent = fresh(&config, shown, world.dims())?;
    let dir = create(&config, shown, out)?;
    let world = world.recorded(&config, dir.path())?;
    run(world, Pupil::new(config, dir, agent, Progress::default(), "train-sim")?)
}

/// Continues a simulated run from its last whole checkpoint, or from its beginning if it has none.
pub fn resume(path: &Path, steps: Option<u64>) -> anyhow::Result<TimeSpent> {
    let set: Vec<String> = steps.map(|s| format!("run.steps={s}")).into_iter().collect();
    go_on(path, &set)
}

/// Whether a run's summary says that it took all its steps.
pub(crate) fn is_complete(path: &Path) -> bool {
    let text = std::fs::read_to_string(path.join("summary.json")).unwrap_or_default();
    serde_json::from_str::<serde_json::Value>(&text).is_ok_and(|s| s["complete"] == true)
}

/// Continues a simulated run with these settings, which may not change its past.
pub(crate) fn go_on(path: &Path, set: &[String]) -> anyhow::Result<TimeSpent> {
    let dir = RunDir::open(path)?;
    let config = Config::of_run(path, set)?;
    if config.ur.is_some() {
        bail!("{} is a run on an arm: continue it with train-real --resume", path.display());
    }
    let (agent, progress) = match last_checkpoint(&dir, &config)? {
        Some((agent, progress)) => (Some(agent), progress),
        None => (None, Progress::default()),
    };
    let world = simulation(&config, progress.episodes)?;
    let origin = path.join(ORIGIN);
    if agent.is_none() && origin.exists() {
        let from = std::fs::read_to_string(&origin).unwrap_or_default();
        bail!(
            "{} was to go on from another run and ended before its first checkpoint: begin it again, with --from {}",
            path.display(),
            from.trim_end()
        );
    }
    let agent = match agent {
        Some(agent) => agent,
        None => fresh(&config, shown_to(path)?.as_ref(), world.dims())?,
    };
    let world = world.recorded(&config, dir.path())?;
    run(world, Pupil::new(config, dir, agent, progress, "train-sim")?)
}

/// The run directory of a new run, with what it was shown.
pub(crate) fn create(
    config: &Config,
    shown: Option<&Demonstrations>,
    out: Option<&Path>,
) -> anyhow::Result<RunDir> {
    let name = format!("{}_{}_s{}", config.task.name, config.policy.name, config.run.seed);
    let dir = RunDir::create(out, &name, &config.to_toml()?)?;
    if let Some(shown) = shown {
        shown.keep(dir.path())?;
    }
    Ok(dir)
}

/// What a run was shown before it began.
fn shown_to(run: &Path) -> anyhow::Result<Option<Demonstrations>> {
    let path = run.join(DEMONSTRATIONS);
    path.exists().then(|| Demonstrations::read(&path)).transpose()
}

/// A learner at its beginning, with observations and actions of these lengths.
///
/// # Errors
/// If the demonstrations do not fit, or if a share of every batch is to be drawn from them and there are none.
pub(crate) fn fresh(
    config: &Config,
    shown: Option<&Demonstrations>,
    dims: (usize, usize),
) -> anyhow::Result<Sac> {
    let mut agent = Sac::new(&config.sac, dims.0, dims.1, config.run.seed)?;
    let share = config.sac.demonstration_share;
    match shown {
        Some(_) if share == 0.0 => {
            bail!("sac.demonstration_share is 0: nothing would be learned from the demonstrations")
        }
        Some(shown) => {
            shown.fit(config, dims)?;
            shown.teach(&mut agent)?;
        }
        None if share > 0.0 => bail!(
            "sac.demonstration_share is {share}, but there are no demonstrations: give --demonstrations FILE, or set it to 0"
        ),
        None => {}
    }
    Ok(agent)
}

/// What a run knew when its last whole checkpoint was written; `None` if none was.
pub(crate) fn last_checkpoint(
    dir: &RunDir,
    config: &Config,
) -> anyhow::Result<Option<(Sac, Progress)>> {
    let path = dir.path();
    let Some(checkpoint) = dir.checkpoints()?.latest()? else { return Ok(None) };
    let read = |name| {
        let path = checkpoint.join(name);
        std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))
    };
    past::unchanged(&read(CONFIG)?, config)
        .with_context(|| format!("{} cannot be continued", path.display()))?;
    let progress: Progress =
        serde_json::from_str(&read(PROGRESS)?).context("progress.json of the checkpoint")?;
    // One that was killed between its last checkpoint and its summary still has to finish.
    if progress.step >= config.run.steps && is_complete(path) {
        bail!(
            "the run is complete: {} of {} steps; extend it with --resume {} --steps N",
            progress.step,
            config.run.steps,
            path.display()
        );
    }
    Ok(Some((Sac::load_on(&checkpoint, config.sac.threads)?, progress)))
}

fn simulation(config: &Config, next_episode: u64) -> anyhow::Result<Lockstep<SimArm>> {
    let mut env = timed_env(config, Purpose::Train)?;
    env.set_next_episode(next_episode);
    let threads = if config.sac.threads == 0 { parallel::cores() } else { config.sac.threads };
    let monitors = (threads as u64).min(config.run.evaluate_episodes).max(1);
    let monitors = (0..monitors).map(|_| timed_env(config, Purpose::Monitor));
    Ok(Lockstep { env, monitors: monitors.collect::<Result<_, _>>()?, recorder: None })
}

fn timed_env(config: &Config, purpose: Purpose) -> anyhow::Result<Env<Safe<Timed<SimArm>>>> {
    let chain = stack::chain(&config.robot)?;
    let arm = stack::sim_arm(config, &chain, config.run.seed, purpose)?;
    stack::env(config, chain, Timed::new(arm), config.run.seed, purpose)
}

/// The loop: episodes, and between them what is due.
pub(crate) fn run(mut world: impl World, mut pupil: Pupil) -> anyhow::Result<TimeSpent> {
    let started = Instant::now();
    pupil.begin();
    let every = |step: u64, every: u64| step / every;
    while !pupil.complete() && !interrupt::requested() {
        let before = pupil.progress.step;
        world.episode(&mut pupil)?;
        let mut laps = Laps::begin();
        let finished = pupil.progress.episodes.saturating_sub(1);
        pupil.keep_verdicts(finished, &world.verdicts())?;
        pupil.profile.logging += laps.lap();
        let (step, run) = (pupil.progress.step, &pupil.config.run);
        let done = step >= run.steps || interrupt::requested();
        let (evaluate_every, checkpoint_every) = (run.evaluate_every, run.checkpoint_every);
        if every(before, evaluate_every) != every(step, evaluate_every)
            && let Some(evaluation) = world.evaluate(&mut pupil)?
        {
            pupil.evaluated(evaluation)?;
            pupil.profile.evaluation += laps.lap();
        }
        if done || every(before, checkpoint_every) != every(step, checkpoint_every) {
            pupil.checkpoint()?;
            pupil.profile.checkpoints += laps.lap();
        }
    }
    let (link, lost) = world.end();
    for what in lost {
        pupil.console.note(&format!("warning: {what}"));
    }
    pupil.finish(started.elapsed().as_secs_f64(), link)
}
