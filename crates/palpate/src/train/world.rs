//! Where experience comes from.

use std::path::Path;
use std::sync::Mutex;
use std::time::Duration;

use palpate_env::{Env, Outcome};
use palpate_robot_io::RobotBackend;
use palpate_sac::Mode;
use palpate_safety::{Entry, Safe};

use super::lesson::Lesson;
use super::profile::{Laps, Timed};
use super::pupil::Pupil;
use super::trials::Trials;
use crate::Config;
use crate::baselines::Actor;
use crate::parallel;
use crate::progress::Evaluation;
use crate::record::{self, Kind, Recorder};

/// Something that makes episodes and gives every step of them to the pupil.
pub(crate) trait World {
    /// One episode. It may end early after an interrupt.
    fn episode(&mut self, pupil: &mut Pupil) -> anyhow::Result<()>;

    /// The fail-safe layer's verdicts in the last episode; times count from its first tick.
    fn verdicts(&mut self) -> Vec<Entry>;

    /// How good the policy is now, on the same starts every time; `None` if it could not be measured to the end.
    fn evaluate(&mut self, pupil: &mut Pupil) -> anyhow::Result<Option<Evaluation>>;

    /// Lets go of the arm. What summary.json says about the link, if there is one, and what could not be recorded.
    fn end(self) -> (Option<serde_json::Value>, Vec<String>);
}

/// A world whose time stands still while the learner learns.
#[derive(Debug)]
pub(crate) struct Lockstep<B: RobotBackend> {
    /// Training episodes.
    pub(crate) env: Env<Safe<Timed<B>>>,
    /// Frozen starts of the evaluations, the same in each; they work at the same time.
    pub(crate) monitors: Vec<Env<Safe<Timed<B>>>>,
    /// Keeps collisions and evaluations.
    pub(crate) recorder: Option<Recorder>,
}

impl<B: RobotBackend> Lockstep<B> {
    /// Length of an observation and of an action.
    pub(crate) fn dims(&self) -> (usize, usize) {
        (self.env.observation_dim(), self.env.action_dim())
    }

    /// Time that the world of the training episodes has taken so far.
    fn simulated(&self) -> Duration {
        self.env.robot().backend().spent()
    }

    /// The same, recorded into the run as configured.
    pub(crate) fn recorded(mut self, config: &Config, run: &Path) -> anyhow::Result<Self> {
        let recorder = Recorder::new(config, &run.join(record::FOLDER))?;
        if config.record.collisions > 0 {
            recorder.load(&mut self.env);
        }
        if config.record.evaluations > 0 {
            self.monitors.iter_mut().for_each(|monitor| recorder.load(monitor));
        }
        self.recorder = Some(recorder);
        Ok(self)
    }
}

impl<B: RobotBackend + Send> World for Lockstep<B> {
    /// An update of the learner after every step.
    fn episode(&mut self, pupil: &mut Pupil) -> anyhow::Result<()> {
        let (rebuilt, mut laps) = (self.env.rebuilt(), Laps::begin());
        let simulated = self.simulated();
        self.env.reset()?;
        // A resumed run does not come the same way: what was said on it is not part of the run.
        self.env.ledger_mut().clear_entries();
        let mut observation = self.env.observation().to_vec();
        let mut action = vec![0.0f32; self.env.action_dim()];
        let mut lesson = Lesson::blank(observation.len(), action.len());
        let mut acting = laps.lap();
        loop {
            pupil.agent.act(&observation, Mode::Explore, &mut action)?;
            pupil.profile.inference += laps.lap();
            let wide: Vec<f64> = action.iter().copied().map(f64::from).collect();
            let step = self.env.step(&wide)?;
            lesson.write(&self.env, &observation, &action, step);
            observation.clone_from(&lesson.next);
            acting += laps.lap();
            pupil.take(&lesson)?;
            laps.lap();
            if let Some(summary) = &lesson.summary {
                if let Some(recorder) = &mut self.recorder
                    && summary.outcome == Outcome::Collision
                {
                    recorder.keep(&mut self.env, Kind::Collision, true);
                }
                pupil.progress.rebuilt += self.env.rebuilt() - rebuilt;
                pupil.profile.logging += laps.lap();
                let simulation = self.simulated().saturating_sub(simulated);
                pupil.profile.simulation += simulation;
                pupil.profile.control += acting.saturating_sub(simulation);
                return Ok(());
            }
        }
    }

    fn verdicts(&mut self) -> Vec<Entry> {
        let start = self.env.started();
        let ledger = self.env.ledger_mut();
        let entries = ledger.entries().map(|e| Entry { time: e.time - start, ..*e }).collect();
        ledger.clear_entries();
        entries
    }

    /// Deterministic episodes on the same starts every time.
    fn evaluate(&mut self, pupil: &mut Pupil) -> anyhow::Result<Option<Evaluation>> {
        let (config, step) = (&pupil.config, pupil.progress.step);
        let recorder = Mutex::new(self.recorder.as_mut());
        let mut workers: Vec<_> = self
            .monitors
            .iter_mut()
            .map(|monitor| (monitor, Actor::learned(pupil.agent.policy(), None)))
            .collect();
        let trial = |(monitor, actor): &mut (&mut Env<Safe<Timed<B>>>, Actor), episode| {
            monitor.set_next_episode(episode);
            monitor.reset()?;
            actor.reset(episode);
            let start = monitor.observation().to_vec();
            let mut trial = Trials::new(&config.sac);
            trial.begin();
            loop {
                let action = actor.act(monitor).to_vec();
                let step = monitor.step(&action)?;
                trial.step(step.reward.total(), step.summary.as_ref());
                if step.summary.is_some() {
                    break;
                }
            }
            if episode < config.record.evaluations
                && let Ok(Some(recorder)) = recorder.lock().as_deref_mut()
            {
                recorder.keep(monitor, Kind::Evaluation { step, episode }, true);
            }
            Ok((start, trial))
        };
        let episodes = config.run.evaluate_episodes;
        let mut trials = Trials::new(&config.sac);
        for (start, trial) in parallel::share_out(&mut workers, episodes, || false, trial)? {
            trials.expected(f64::from(pupil.agent.q_start(&start)?));
            trials.join(trial);
        }
        Ok(Some(trials.result(step)))
    }

    fn end(self) -> (Option<serde_json::Value>, Vec<String>) {
        (None, self.recorder.map_or_else(Vec::new, Recorder::finish))
    }
}
