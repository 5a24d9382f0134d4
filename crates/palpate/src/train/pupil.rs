//! The learner, and the account of what it went through.

use anyhow::Result;
use palpate_env::{Outcome, Summary};
use palpate_runs::{CheckpointStore, Console, Metrics, RunDir, Slot, Table};
use palpate_sac::{Diagnosis, Sac, UpdateStats};
use palpate_safety::Entry;

use super::alarm::Alarms;
use super::book::Book;
use super::disk::insist;
use super::lesson::Lesson;
use super::profile::{Laps, Profile, TimeSpent};
use super::tables::{EPISODES, METRICS};
use crate::Config;
use crate::progress::{Evaluation, Progress};

/// File of a checkpoint with what a run remembers besides the learner.
pub(super) const PROGRESS: &str = "progress.json";
/// File of a checkpoint with the configuration it was made under.
pub(crate) const CONFIG: &str = "config.toml";

/// A learner with its run directory.
pub(crate) struct Pupil {
    pub(crate) config: Config,
    pub(crate) agent: Sac,
    pub(crate) progress: Progress,
    pub(crate) console: Console,
    dir: RunDir,
    store: CheckpointStore,
    metrics: Metrics,
    episodes: Table,
    ledger: Book,
    /// The command that resumes it.
    command: &'static str,
    /// Steps of this process.
    taken: u64,
    /// Latest statistics of the learner, for the next row.
    stats: Option<UpdateStats>,
    alarms: Alarms,
    /// Where the time goes.
    pub(crate) profile: Profile,
}

impl Pupil {
    pub(crate) fn new(
        config: Config,
        dir: RunDir,
        agent: Sac,
        progress: Progress,
        command: &'static str,
    ) -> Result<Self> {
        Ok(Self {
            store: dir.checkpoints()?,
            metrics: Metrics::open(&dir, METRICS, progress.tables.0)?,
            episodes: Table::open(&dir.path().join("episodes.csv"), EPISODES, progress.tables.1)?,
            ledger: Book::open(&config, &dir, progress.ledger)?,
            console: Console::new(config.run.steps, progress.step),
            config,
            dir,
            agent,
            progress,
            command,
            taken: 0,
            stats: None,
            alarms: Alarms::default(),
            profile: Profile::default(),
        })
    }

    /// Says where it writes and what is unwise.
    pub(crate) fn begin(&mut self) {
        self.console.note(&format!("run directory: {}", self.dir.path().display()));
        let shown = self.agent.demonstrated();
        if shown > 0 {
            let percent = 100.0 * self.config.sac.demonstration_share;
            let until = match self.config.sac.demonstration_steps {
                0 => String::new(),
                steps => format!(" at first, none after {steps} steps"),
            };
            self.console.note(&format!(
                "{shown} demonstrated steps make {percent:.0} % of every batch{until}"
            ));
        }
        for warning in self.config.warnings() {
            self.console.note(&format!("warning: {warning}"));
        }
    }

    /// Whether all steps are done.
    pub(crate) fn complete(&self) -> bool {
        self.progress.step >= self.config.run.steps
    }

    /// Remembers a step and learns.
    pub(crate) fn take(&mut self, lesson: &Lesson) -> Result<()> {
        let mut laps = Laps::begin();
        self.agent.observe(&lesson.transition())?;
        if lesson.summary.as_ref().is_some_and(|s| s.outcome == Outcome::Collision) {
            self.agent.remember_danger();
        }
        self.progress.step += 1;
        self.taken += 1;
        if let Some(stats) = self.agent.update()? {
            self.stats = Some(stats);
        }
        self.profile.update += laps.lap();
        if let Some(summary) = &lesson.summary {
            self.progress.record(summary);
            self.write_episode(summary)?;
        }
        if self.progress.step.is_multiple_of(self.config.run.log_every) {
            self.write_row()?;
        }
        self.console.update(self.progress.step, &self.line());
        self.profile.logging += laps.lap();
        Ok(())
    }

    /// Writes what the fail-safe layer said in an episode.
    pub(crate) fn keep_verdicts(&mut self, episode: u64, entries: &[Entry]) -> Result<()> {
        let at = (episode, self.progress.step);
        self.ledger.write(&mut self.console, at, entries)
    }

    /// Takes in an evaluation; keeps the best policy.
    pub(crate) fn evaluated(&mut self, evaluation: Evaluation) -> Result<()> {
        let (sac, pays) = (&self.config.sac, self.config.reward.success);
        let (best, diagnosis) = (self.progress.best.as_ref(), self.agent.diagnose()?);
        let warnings = self.alarms.new_ones(sac, pays, best, &evaluation, diagnosis.as_ref());
        for warning in warnings {
            self.console.note(&format!("warning: {warning}"));
        }
        self.progress.evaluated = Some(evaluation);
        self.progress.pending = Some(evaluation);
        if self.progress.best.is_none_or(|best| evaluation.beats(&best)) {
            self.progress.best = Some(evaluation);
            let (agent, store, slot) = (&self.agent, &self.store, Slot::Best(self.progress.step));
            insist(&mut self.console, || {
                store.save(slot, |dir| agent.save_policy(dir).map_err(Into::into))
            })?;
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

    /// Writes everything that is needed to go on from here.
    pub(crate) fn checkpoint(&mut self) -> Result<()> {
        self.progress.tables = (self.metrics.mark(), self.episodes.mark());
        self.progress.ledger = self.ledger.mark();
        let Self { config, agent, progress, console, store, metrics, episodes, ledger, .. } = self;
        let config = config.to_toml()?;
        insist(console, || {
            metrics.sync()?;
            episodes.sync()?;
            ledger.sync()?;
            store.save(Slot::Step(progress.step), |dir| {
                agent.save(dir)?;
                std::fs::write(dir.join(PROGRESS), serde_json::to_string_pretty(progress)?)?;
                std::fs::write(dir.join(CONFIG), &config)?;
                Ok(())
            })
        })?;
        Ok(())
    }

    /// Writes the summary and says what comes next.
    pub(crate) fn finish(
        mut self,
        seconds: f64,
        link: Option<serde_json::Value>,
    ) -> Result<TimeSpent> {
        // What came after the last row; cut away again where a run goes on from its checkpoint.
        if self.progress.pending.is_some()
            || !self.progress.step.is_multiple_of(self.config.run.log_every)
        {
            self.write_row()?;
        }
        let p = &self.progress;
        let complete = self.complete();
        let mut summary = serde_json::json!({
            "complete": complete,
            "steps": p.step,
            "episodes": p.episodes,
            "successes": p.successes,
            "collisions": p.collisions,
            "first_success_step": p.first_success,
            "refusals": p.tally,
            "verdicts": p.verdicts,
            "simulator_faults": p.faults,
            "worlds_rebuilt": p.rebuilt,
            "success_rate_last_20": p.success_rate(),
            "last_evaluation": p.evaluated,
            "best_evaluation": p.best,
            "seconds_this_time": seconds,
            "seconds_on": self.profile,
        });
        let on_an_arm = link.is_some();
        if let Some(link) = link {
            summary["link"] = link;
        }
        let dir = &self.dir;
        insist(&mut self.console, || dir.write_summary(&summary))?;
        self.console.finish();
        let path = self.dir.path().display();
        let next = if on_an_arm { "run-policy" } else { "evaluate" };
        let judged = p.evaluated.map_or_else(String::new, |e| {
            let hint = if e.success_rate < 0.5 { ": it needs more --steps" } else { "" };
            format!("; the last evaluation {:.0} %{hint}", 100.0 * e.success_rate)
        });
        if complete {
            self.console.note(&format!(
                "done in {seconds:.0} s: {} of {} episodes succeeded, {} ended in a collision{}.\nnext: cargo xtask {next} {path}\n      cargo xtask report {path}",
                p.successes, p.episodes, p.collisions, judged
            ));
        } else {
            self.console.note(&format!(
                "stopped at step {} of {}; a checkpoint is saved.\ncontinue: cargo xtask {} --resume {path}",
                p.step, self.config.run.steps, self.command
            ));
        }
        Ok(TimeSpent { profile: self.profile, steps: self.taken, seconds })
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

    fn write_row(&mut self) -> Result<()> {
        let e = self.progress.pending.take();
        let p = &self.progress;
        let s = self.stats.as_ref();
        let train = |f: fn(&UpdateStats) -> f32| s.map(f).map(f64::from);
        let eval = |f: fn(&Evaluation) -> f64| e.as_ref().map(f);
        let diagnosis = if s.is_some() { self.agent.diagnose()? } else { None };
        let state = |f: fn(&Diagnosis) -> f32| diagnosis.as_ref().map(f).map(f64::from);
        let (metrics, step) = (&mut self.metrics, p.step);
        let row = [
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
            train(|s| s.critic_gradient_norm),
            train(|s| s.actor_gradient_norm),
            state(|d| d.critic_weights),
            state(|d| d.actor_weights),
            state(|d| d.dormant_critic),
            state(|d| d.dormant_actor),
            state(|d| d.saturation),
            state(|d| d.replay_age),
            eval(|e| e.success_rate),
            eval(|e| e.mean_return),
            eval(|e| e.mean_steps),
            eval(|e| e.peak_force),
            eval(|e| e.q_minus_return),
        ];
        insist(&mut self.console, || metrics.write(step, &row))
    }

    fn write_episode(&mut self, s: &Summary) -> Result<()> {
        let flag = |o: Outcome| Some(if s.outcome == o { 1.0 } else { 0.0 });
        let row = [
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
        ];
        let episodes = &mut self.episodes;
        insist(&mut self.console, || episodes.write(&row))
    }
}
