//! `train-real`: the trainer on an arm.

use std::io::Write as _;
use std::path::PathBuf;

use anyhow::{Context as _, bail};
use palpate_runs::RunDir;
use palpate_sac::Sac;

use super::exchange::Exchange;
use super::thread::Order;
use super::world::RealTime;
use super::{Address, connect, journal, permitted};
use crate::baselines::Actor;
use crate::config::{Choice, Config};
use crate::demonstrate::file::Demonstrations;
use crate::progress::Progress;
use crate::record::{self, OnArm, Recorder};
use crate::stack::{Purpose, sim_env, stream};
use crate::train::pupil::Pupil;
use crate::train::{create, fresh, heir, last_checkpoint, run};

/// What to train, where, and from what.
#[derive(Clone, Debug)]
pub struct TrainReal {
    /// The controller.
    pub address: Address,
    /// A new run's configuration; of a run to start from only the file and the overrides count.
    pub choice: Choice,
    /// A run whose learner goes on here.
    pub from: Option<PathBuf>,
    /// A run on an arm to continue.
    pub resume: Option<PathBuf>,
    /// A new run's demonstrations.
    pub demonstrations: Option<PathBuf>,
    /// Run directory to create.
    pub out: Option<PathBuf>,
    /// Look, and move nothing.
    pub dry_run: bool,
    /// Do not ask.
    pub yes: bool,
}

/// Trains on an arm.
pub fn train_real(what: &TrainReal) -> anyhow::Result<()> {
    let arm = what.address.arm();
    let set = &what.choice.set;
    let config = match (&what.resume, &what.from) {
        (Some(run), _) | (None, Some(run)) => {
            Config::of_run_for(run, &arm, what.choice.file.as_deref(), set)?
        }
        (None, None) if what.demonstrations.is_some() => {
            Config::load_shown(&what.choice, Some(&arm))?
        }
        (None, None) => Config::load_for(&what.choice, &arm)?,
    };
    let shown = what.demonstrations.as_deref().map(Demonstrations::read).transpose()?;
    if config.sac.warmup_steps > 0 {
        bail!(
            "sac.warmup_steps is {}, but no arm is driven at random: set it to 0",
            config.sac.warmup_steps
        );
    }
    let (agent, progress, dir) = learner(what, &config, shown.as_ref())?;
    if !permitted(&config, what.yes, what.dry_run)? {
        return Ok(());
    }
    let exchange = Exchange::default();
    let seed = stream(config.run.seed, Purpose::Explore);
    let actor = Actor::learned(agent.policy(), Some(seed));
    let mut arm = connect(&config, actor, exchange.clone())?;
    // From here on: the control thread has started with the priority that this one had.
    let background = palpate_ur::background(&arm.realtime);
    // Not before there is an arm, or a folder without a run would stay.
    let dir = match dir {
        Some(dir) => dir,
        None => create(&config, shown.as_ref(), what.out.as_deref())?,
    };
    let (path, steps) = (dir.path().to_owned(), config.env.max_steps);
    if config.record.collisions > 0 || config.record.evaluations > 0 {
        let recorder = Recorder::new(&config, &path.join(record::FOLDER))?;
        let recorder = OnArm::training(recorder, &config.record);
        arm.control.orders.send(Order::Record(Box::new(recorder)))?;
    }
    let mut pupil = Pupil::new(config, dir, agent, progress, "train-real --rtde ADDRESS")?;
    if what.resume.is_none() {
        // Something to continue from, whatever happens in the first minutes.
        pupil.checkpoint()?;
    }
    let journal = journal::catch_up(&path, &mut pupil)?;
    exchange.offer(pupil.agent.policy());
    arm.control.journal(journal, pupil.progress.step, steps)?;
    pupil.console.note(&format!("control thread: {}; learner: {background}", arm.realtime));
    run(RealTime::new(arm, exchange, background), pupil)?;
    Ok(())
}

/// The learner, how far it is, and its run directory if there is one already.
fn learner(
    what: &TrainReal,
    config: &Config,
    shown: Option<&Demonstrations>,
) -> anyhow::Result<(Sac, Progress, Option<RunDir>)> {
    if let Some(run) = &what.resume {
        let dir = RunDir::open(run)?;
        let (agent, progress) = last_checkpoint(&dir, config)?.with_context(|| {
            format!("{} holds no checkpoint to resume from; start it again", run.display())
        })?;
        return Ok((agent, progress, Some(dir)));
    }
    // The same observations and actions as on the arm, without one.
    let env = sim_env(config, config.run.seed, Purpose::Train)?;
    let Some(run) = &what.from else {
        let agent = fresh(config, shown, (env.observation_dim(), env.action_dim()))?;
        return Ok((agent, Progress::default(), None));
    };
    let (agent, remarks) = heir(run, config, &env)?;
    for remark in remarks {
        writeln!(std::io::stderr(), "{remark}")?;
    }
    Ok((agent, Progress::default(), None))
}
