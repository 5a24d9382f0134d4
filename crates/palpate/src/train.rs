//! `train-sim`: the loop that makes a policy.
//!
//! Checkpoints are taken between episodes, where the world is rebuilt from the seed and the episode's
//! number, so a resumed run continues exactly as if it had never stopped.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context as _, bail};
use palpate_env::{Outcome, Summary};
use palpate_runs::{CheckpointStore, Console, Metrics, RunDir, Slot, Table};
use palpate_sac::{Mode, Sac, Transition, UpdateStats};

use crate::baselines::Actor;
use crate::config::{Choice, Config};
use crate::progress::{Evaluation, Progress};
use crate::stack::{Purpose, SimEnv, sim_env};
use crate::{evaluate, interrupt};

/// Columns of metrics.csv. Names as in Stable-Baselines3 where it has one.
const METRICS: &[&str] = &[
    "time/total_timesteps",
    "time/episodes",
    "rollout/ep_rew_mean",
    "rollout/ep_len_mean",
    "rollout/success_rate",
    "rollout/peak_force_mean",
    "safety/collisions",
    "safety/refused_ik",
    "safety/refused_speed",
    "safety/refused_non_finite",
    "sim/faults",
    "train/n_updates",
    "train/critic_loss",
    "train/actor_loss",
    "train/ent_coef",
    "train/entropy",
    "train/q_mean",
    "eval/success_rate",
    "eval/mean_reward",
    "eval/mean_ep_length",
    "eval/peak_force",
    "eval/q_minus_return",
];

/// Columns of episodes.csv.
const EPISODES: &[&str] = &[
    "episode",
    "step",
    "return",
    "length",
    "success",
    "collision",
    "fault",
    "peak_force",
    "mean_force",
    "final_distance",
    "refused_ik",
    "refused_speed",
];

/// Starts a new run.
pub fn start(choice: &Choice, out: Option<&Path>) -> anyhow::Result<()> {
    let config = Config::load(choice)?;
    let name = format!("{}_{}_s{}", config.task.name, config.policy.name, config.run.seed);
    let dir = RunDir::create(out, &name, &config.to_toml()?)?;
    let mut env = sim_env(&config, config.run.seed, Purpose::Train)?;
    let agent = Sac::new(&config.sac, env.observation_dim(), env.action_dim(), config.run.seed)?;
    env.set_next_episode(0);
    Trainer::new(config, dir, env, agent, Progress::default())?.run()
}

/// Continues a run from its last whole checkpoint.
pub fn resume(path: &Path, steps: Option<u64>) -> anyhow::Result<()> {
    let dir = RunDir::open(path)?;
    let set: Vec<String> = steps.map(|s| format!("run.steps={s}")).into_iter().collect();
    let config = Config::of_run(path, &set)?;
    let checkpoint = dir.checkpoints()?.latest()?.with_context(|| {
        format!(
            "{} holds no checkpoint to resume from; start it again with train-sim",
            path.display()
        )
    })?;
    let text = std::fs::read_to_string(checkpoint.join("progress.json"))?;
    let progress: Progress =
        serde_json::from_str(&text).context("progress.json of the checkpoint")?;
    if progress.step >= config.run.steps {
        bail!(
            "the run is complete: {} of {} steps; extend it with --resume {} --steps N",
            progress.step,
            config.run.steps,
            path.display()
        );
    }
    let mut env = sim_env(&config, config.run.seed, Purpose::Train)?;
    env.set_next_episode(progress.episodes);
    let agent = Sac::load(&checkpoint)?;
    Trainer::new(config, dir, env, agent, progress)?.run()
}

struct Trainer {
    config: Config,
    dir: RunDir,
    store: CheckpointStore,
    env: SimEnv,
    monitor: SimEnv,
    agent: Sac,
    progress: Progress,
    metrics: Metrics,
    episodes: Table,
    console: Console,
    /// Latest statistics of the learner, for the next row.
    stats: Option<UpdateStats>,
    /// Evaluation to put into the next row.
    pending: Option<Evaluation>,
}

impl Trainer {
    fn new(
        config: Config,
        dir: RunDir,
        env: SimEnv,
        agent: Sac,
        progress: Progress,
    ) -> anyhow::Result<Self> {
        let monitor = sim_env(&config, config.run.seed, Purpose::Monitor)?;
        Ok(Self {
            store: dir.checkpoints()?,
            metrics: Metrics::open(&dir, METRICS, progress.rows.0)?,
            episodes: Table::open(&dir.path().join("episodes.csv"), EPISODES, progress.rows.1)?,
            console: Console::new(config.run.steps, progress.step),
            config,
            dir,
            env,
            monitor,
            agent,
            progress,
            stats: None,
            pending: None,
        })
    }

    fn run(mut self) -> anyhow::Result<()> {
        let started = Instant::now();
        self.console.note(&format!("run directory: {}", self.dir.path().display()));
        for warning in self.config.warnings() {
            self.console.note(&format!("warning: {warning}"));
        }
        let every = |step: u64, every: u64| step / every;
        while self.progress.step < self.config.run.steps && !interrupt::requested() {
            let before = self.progress.step;
            self.episode()?;
            let (step, run) = (self.progress.step, &self.config.run);
            let done = step >= run.steps || interrupt::requested();
            let (evaluate_every, checkpoint_every) = (run.evaluate_every, run.checkpoint_every);
            if every(before, evaluate_every) != every(step, evaluate_every) {
                self.evaluate()?;
            }
            if done || every(before, checkpoint_every) != every(step, checkpoint_every) {
                self.checkpoint()?;
            }
        }
        self.finish(started.elapsed().as_secs_f64())
    }

    /// One episode, with an update of the learner after every step.
    fn episode(&mut self) -> anyhow::Result<()> {
        self.env.reset()?;
        let mut observation = self.env.observation().to_vec();
        let mut action = vec![0.0f32; self.env.action_dim()];
        loop {
            self.agent.act(&observation, Mode::Explore, &mut action)?;
            let wide: Vec<f64> = action.iter().copied().map(f64::from).collect();
            let step = self.env.step(&wide)?;
            let next = self.env.observation().to_vec();
            self.agent.observe(&Transition {
                observation: &observation,
                action: &action,
                reward: step.reward.total() as f32,
                next_observation: &next,
                terminal: step.terminated,
                episode_end: step.terminated || step.truncated,
            })?;
            observation = next;
            self.progress.step += 1;
            if let Some(stats) = self.agent.update()? {
                self.stats = Some(stats);
            }
            if let Some(summary) = &step.summary {
                self.progress.record(summary);
                self.write_episode(summary)?;
            }
            if self.progress.step.is_multiple_of(self.config.run.log_every) {
                self.write_row()?;
            }
            self.console.update(self.progress.step, &self.line());
            if step.summary.is_some() {
                return Ok(());
            }
        }
    }

    /// Deterministic episodes on the same starts every time; keeps the best policy.
    fn evaluate(&mut self) -> anyhow::Result<()> {
        let gamma = f64::from(self.config.sac.gamma);
        let scale = f64::from(self.config.sac.reward_scale);
        let mut actor = Actor::learned(self.agent.policy(), None);
        let (mut summaries, mut gap) = (Vec::<Summary>::new(), 0.0);
        for episode in 0..self.config.run.evaluate_episodes {
            self.monitor.set_next_episode(episode);
            self.monitor.reset()?;
            actor.reset(episode);
            let q = f64::from(self.agent.q_start(self.monitor.observation())?);
            let (mut discounted, mut weight) = (0.0, scale);
            let summary = loop {
                let action = actor.act(&self.monitor).to_vec();
                let step = self.monitor.step(&action)?;
                discounted += weight * step.reward.total();
                weight *= gamma;
                if let Some(summary) = step.summary {
                    break summary;
                }
            };
            gap += q - discounted;
            summaries.push(summary);
        }
        let row = evaluate::Row::new("monitor", &summaries);
        let evaluation = Evaluation {
            step: self.progress.step,
            success_rate: row.success_rate,
            mean_return: row.mean_return,
            mean_steps: row.mean_steps,
            peak_force: row.median_peak_force,
            q_minus_return: gap / summaries.len().max(1) as f64,
        };
        self.progress.evaluated = Some(evaluation);
        self.pending = Some(evaluation);
        if self.progress.best.is_none_or(|best| evaluation.beats(&best)) {
            self.progress.best = Some(evaluation);
            let agent = &self.agent;
            self.store.save(Slot::Best, |dir| agent.save_policy(dir).map_err(Into::into))?;
        }
        self.console.table(&[
            ("evaluation at step", self.progress.step.to_string()),
            ("eval/success_rate", format!("{:.2}", evaluation.success_rate)),
            ("eval/mean_reward", format!("{:.1}", evaluation.mean_return)),
            ("eval/mean_ep_length", format!("{:.1}", evaluation.mean_steps)),
            ("eval/peak_force", format!("{:.1} N", evaluation.peak_force)),
            ("eval/q_minus_return", format!("{:+.2}", evaluation.q_minus_return)),
            ("safety/collisions", self.progress.collisions.to_string()),
            (
                "best so far",
                self.progress
                    .best
                    .map_or(String::new(), |b| format!("{:.2} at {}", b.success_rate, b.step)),
            ),
        ]);
        Ok(())
    }

    fn checkpoint(&mut self) -> anyhow::Result<()> {
        self.progress.rows = (self.metrics.rows(), self.episodes.rows());
        self.metrics.sync()?;
        self.episodes.sync()?;
        let (agent, progress) = (&self.agent, &self.progress);
        self.store.save(Slot::Step(progress.step), |dir| {
            agent.save(dir)?;
            std::fs::write(dir.join("progress.json"), serde_json::to_string_pretty(progress)?)?;
            Ok(())
        })?;
        Ok(())
    }

    fn finish(mut self, seconds: f64) -> anyhow::Result<()> {
        let p = &self.progress;
        let complete = p.step >= self.config.run.steps;
        self.dir.write_summary(&serde_json::json!({
            "complete": complete,
            "steps": p.step,
            "episodes": p.episodes,
            "successes": p.successes,
            "collisions": p.collisions,
            "first_success_step": p.first_success,
            "refusals": p.tally,
            "simulator_faults": p.faults,
            "success_rate_last_20": p.success_rate(),
            "last_evaluation": p.evaluated,
            "best_evaluation": p.best,
            "seconds_this_time": seconds,
        }))?;
        self.console.finish();
        let path = self.dir.path().display();
        if complete {
            self.console.note(&format!(
                "done in {seconds:.0} s: {} episodes, {} collisions.\nnext: cargo xtask evaluate {path}\n      cargo xtask plot {path}",
                p.episodes, p.collisions
            ));
        } else {
            self.console.note(&format!(
                "stopped at step {} of {}; a checkpoint is saved.\ncontinue: cargo xtask train-sim --resume {path}",
                p.step, self.config.run.steps
            ));
        }
        Ok(())
    }

    /// What the live line says besides the step, the rate and the time left.
    fn line(&self) -> String {
        let p = &self.progress;
        let number = |x: Option<f64>, digits: usize| {
            x.map_or_else(|| "–".into(), |x| format!("{x:.digits$}"))
        };
        format!(
            "return {}  success {} of last {}  collisions {}  peak {} N",
            number(p.mean_return(), 0),
            number(p.success_rate().map(|rate| rate * p.recent.len() as f64), 0),
            p.recent.len(),
            p.collisions,
            number(p.mean_peak_force(), 1),
        )
    }

    fn write_row(&mut self) -> anyhow::Result<()> {
        let p = &self.progress;
        let s = self.stats.as_ref();
        let e = self.pending.take();
        let train = |f: fn(&UpdateStats) -> f32| s.map(f).map(f64::from);
        let eval = |f: fn(&Evaluation) -> f64| e.as_ref().map(f);
        self.metrics.write(
            p.step,
            &[
                Some(p.step as f64),
                Some(p.episodes as f64),
                p.mean_return(),
                p.mean_steps(),
                p.success_rate(),
                p.mean_peak_force(),
                Some(p.collisions as f64),
                Some(p.tally.no_ik as f64),
                Some(p.tally.joint_speed as f64),
                Some(p.tally.non_finite as f64),
                Some(p.faults as f64),
                Some(self.agent.updates() as f64),
                train(|s| s.critic_loss),
                train(|s| s.actor_loss),
                train(|s| s.alpha),
                train(|s| s.entropy),
                train(|s| s.q_mean),
                eval(|e| e.success_rate),
                eval(|e| e.mean_return),
                eval(|e| e.mean_steps),
                eval(|e| e.peak_force),
                eval(|e| e.q_minus_return),
            ],
        )?;
        Ok(())
    }

    fn write_episode(&mut self, s: &Summary) -> anyhow::Result<()> {
        let flag = |o: Outcome| Some(if s.outcome == o { 1.0 } else { 0.0 });
        self.episodes.write(&[
            Some(s.episode as f64),
            Some(self.progress.step as f64),
            Some(s.total_reward),
            Some(f64::from(s.steps)),
            flag(Outcome::Success),
            flag(Outcome::Collision),
            flag(Outcome::Fault),
            Some(s.peak_force),
            Some(s.mean_force),
            Some(s.final_distance),
            Some(s.tally.no_ik as f64),
            Some(s.tally.joint_speed as f64),
        ])?;
        Ok(())
    }
}
