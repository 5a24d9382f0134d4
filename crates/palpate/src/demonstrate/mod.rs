//! `demonstrate`: a task done by something that can do it, written down to learn from.
//!
//! [`record`] runs a [`Source`] on any guarded robot and keeps what it went through; `train-sim --demonstrations` draws
//! a share of every batch from it (`sac.demonstration_share`).

pub(crate) mod file;
mod propose;
mod source;
#[cfg(test)]
mod tests;

use std::fmt::Write as _;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use palpate_env::{Env, Outcome, Summary};
use palpate_runs::{BEST, CheckpointStore, LAST, RunDir};
use palpate_sac::Policy;
use palpate_safety::Guarded;

use crate::baselines::Actor;
use crate::config::Choice;
use crate::stack::{Purpose, sim_env};
use crate::train::lesson::Lesson;
use crate::{Config, evaluate, interrupt};
use file::Writer;
pub use propose::Observed;
pub use source::{Source, View};

/// Episodes that are tried for each one that is wanted.
const PATIENCE: u64 = 10;

/// What to keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Episodes to keep.
    pub episodes: u64,
    /// Keep those that reached the goal and no others.
    pub only_successes: bool,
}

/// What was recorded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Account {
    /// Episodes begun.
    pub tried: u64,
    /// Episodes in the file.
    pub kept: u64,
    /// Episodes that reached the goal, of those that were tried.
    pub successes: u64,
    /// Actions in the file.
    pub steps: u64,
    /// Time of the robot in the file, s.
    pub seconds: f64,
    /// Largest norm of the unfiltered contact force in the file, N.
    pub peak_force: f64,
    /// What they say about a configuration.
    pub observed: Observed,
}

/// Lets `source` act in `env` and keeps its episodes in the file `to`.
///
/// Ends when enough are kept, after ten times as many tries, or on an interrupt, at an episode's end. What is kept by
/// then survives a kill.
///
/// # Errors
/// If `to` exists, if nothing came of it, or what the robot or the disk says.
pub fn record<R: Guarded>(
    env: &mut Env<R>,
    source: &mut dyn Source,
    config: &Config,
    options: &Options,
    to: &Path,
    mut progress: impl FnMut(&Account, &Summary),
) -> anyhow::Result<Account> {
    let dims = (env.observation_dim(), env.action_dim());
    let mut writer = Writer::create(to, &source.name(), dims, config)?;
    let mut account = Account::default();
    let before = env.swap_tape(None);
    let done = loop {
        let enough = account.kept >= options.episodes
            || account.tried >= options.episodes.saturating_mul(PATIENCE)
            || interrupt::requested();
        if enough {
            break Ok(());
        }
        if let Err(e) = episode(env, source, options, &mut writer, &mut account, &mut progress) {
            break Err(e);
        }
    };
    env.swap_tape(before);
    writer.finish()?;
    done?;
    if account.kept == 0 {
        bail!(
            "nothing is recorded: none of {} episodes{}",
            account.tried,
            if options.only_successes {
                " reached the goal; --only-successes false keeps the others too"
            } else {
                " came to its end"
            }
        );
    }
    Ok(account)
}

fn episode<R: Guarded>(
    env: &mut Env<R>,
    source: &mut dyn Source,
    options: &Options,
    writer: &mut Writer,
    account: &mut Account,
    progress: &mut impl FnMut(&Account, &Summary),
) -> anyhow::Result<()> {
    account.tried += 1;
    let tape = env.new_tape();
    env.swap_tape(Some(tape));
    let number = env.next_episode();
    env.reset()?;
    source.begin(number);
    let mut lessons: Vec<Lesson> = Vec::new();
    let mut action = vec![0.0; env.action_dim()];
    let summary = loop {
        if source.act(&View::of(env), &mut action) == ControlFlow::Break(()) {
            return Ok(());
        }
        // As the learner will hold it: the robot does what the file says.
        let narrow: Vec<f32> = action.iter().map(|a| *a as f32).collect();
        let wide: Vec<f64> = narrow.iter().copied().map(f64::from).collect();
        let observation = env.observation().to_vec();
        let step = env.step(&wide)?;
        let mut lesson = Lesson::blank(observation.len(), narrow.len());
        lesson.write(env, &observation, &narrow, step);
        let summary = lesson.summary.clone();
        lessons.push(lesson);
        if let Some(summary) = summary {
            break summary;
        }
    };
    let succeeded = summary.outcome == Outcome::Success;
    account.successes += u64::from(succeeded);
    // Of an episode that a fault of the simulator cut, nothing is true.
    if summary.outcome != Outcome::Fault && (succeeded || !options.only_successes) {
        writer.keep(&lessons)?;
        account.kept += 1;
        account.steps += u64::from(summary.steps);
        account.seconds += summary.seconds;
        account.peak_force = account.peak_force.max(summary.peak_force);
        if let Some(tape) = env.swap_tape(None) {
            account.observed.look(&tape, source.chooses_gains());
        }
    }
    progress(account, &summary);
    Ok(())
}

/// What `demonstrate` is asked for.
#[derive(Clone, Debug)]
pub struct Session {
    /// The task; of a run's policy the file and the overrides, over the run's own configuration.
    pub choice: Choice,
    /// `scripted`, or a run whose policy acts.
    pub by: String,
    /// What to keep.
    pub options: Options,
    /// File to create.
    pub out: PathBuf,
    /// File to write a configuration to.
    pub propose: Option<PathBuf>,
}

/// The `demonstrate` command, in simulation.
pub fn command(session: &Session, out: &mut dyn std::io::Write) -> anyhow::Result<()> {
    let (config, mut actor, by) = who(session)?;
    if let Some(path) = session.propose.as_ref().filter(|path| path.exists()) {
        bail!("{} exists: a proposal replaces no file", path.display());
    }
    let mut env = sim_env(&config, config.run.seed, Purpose::Demonstrate)?;
    if let Actor::Learned(_) = actor {
        let policy = actor.policy_mut().context("a learned actor has a policy")?;
        evaluate::check_shape(policy, &env)?;
    }
    let account = record(&mut env, &mut actor, &config, &session.options, &session.out, |a, s| {
        let _ = writeln!(
            std::io::stderr(),
            "episode {}: {:?}, {} steps, peak {:.1} N; {} kept",
            s.episode,
            s.outcome,
            s.steps,
            s.peak_force,
            a.kept
        );
    })?;
    write!(out, "{}", told(&account, &config, &by, session))?;
    if let Some(path) = &session.propose {
        let text = account.observed.fragment(&config, &by)?;
        std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))?;
        writeln!(out, "{} takes this as --config; read it first", path.display())?;
    }
    Ok(())
}

/// Configuration, actor, and what to call it.
fn who(session: &Session) -> anyhow::Result<(Config, Actor, String)> {
    if session.by == "scripted" {
        let config = Config::load(&session.choice)?;
        let dim = palpate_control::ActionMap::new(&config.policy)?.dim();
        let actor = Actor::scripted(&config, dim);
        return Ok((config, actor, "scripted".into()));
    }
    let run = Path::new(&session.by);
    RunDir::view(run)?;
    let choice = &session.choice;
    let config = Config::of_run_with(run, choice.file.as_deref(), &choice.set)?;
    let store = CheckpointStore::open(run)?;
    // The best of its evaluations, where it has been evaluated.
    let kept = match store.find(BEST)? {
        Some(best) => Some(best),
        None => store.find(LAST)?,
    };
    let kept = kept.with_context(|| format!("{} holds no checkpoint yet", run.display()))?;
    let policy = Policy::load(&kept)?;
    Ok((config, Actor::learned(policy, None), format!("the policy of {}", run.display())))
}

fn told(account: &Account, config: &Config, by: &str, session: &Session) -> String {
    let Account { tried, kept, successes, steps, seconds, peak_force, observed } = account;
    let mut said = format!(
        "{}: {kept} episodes of {}, {}, by {by}\n  episodes   {successes} of {tried} reached the goal, {kept} kept\n  steps      {steps}, {seconds:.1} s of robot time\n  peak       {peak_force:.1} N, norm of the unfiltered force\n",
        session.out.display(),
        config.task.name,
        config.policy.name,
    );
    said += &observed.lines(config);
    if session.options.only_successes && 2 * successes < *tried {
        said += "the goal was reached on few starts, so these show the easy ones; --by RUN records a policy that copes with all\n";
    }
    if *kept < session.options.episodes {
        let _ = writeln!(said, "fewer than the {} that were asked for", session.options.episodes);
    }
    let _ = writeln!(
        said,
        "next: cargo xtask train-sim --demonstrations {}, with the same --task, --model, --config and --set",
        session.out.display()
    );
    said
}
