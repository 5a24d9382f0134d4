//! Experience from an arm that cannot wait.

use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

use anyhow::bail;
use palpate_safety::Entry;
use palpate_ur::Background;

use super::exchange::Exchange;
use super::keys::Keys;
use super::thread::{Fault, News, Order};
use super::{Arm, ended};
use crate::interrupt;
use crate::progress::Evaluation;
use crate::train::pupil::Pupil;
use crate::train::trials::Trials;
use crate::train::world::World;

/// How often a wait looks at Enter and Ctrl-C.
const GLANCE: Duration = Duration::from_millis(50);

/// An arm under its control thread, seen from the learner.
pub(super) struct RealTime {
    arm: Arm,
    exchange: Exchange,
    keys: Keys,
    /// Stops that a person has cleared.
    faults: u64,
    /// Priority of the learner.
    background: Background,
}

impl RealTime {
    pub(super) fn new(arm: Arm, exchange: Exchange, background: Background) -> Self {
        Self { arm, exchange, keys: Keys::listen(), faults: 0, background }
    }

    /// With the keys of a test.
    #[cfg(test)]
    pub(super) fn attended(arm: Arm, exchange: Exchange, keys: Keys) -> Self {
        Self { arm, exchange, keys, faults: 0, background: Background::Nice }
    }

    /// The next news; `None` after an interrupt.
    fn news(&self) -> anyhow::Result<Option<News>> {
        loop {
            match self.arm.control.news.recv_timeout(GLANCE) {
                Ok(news) => return Ok(Some(news)),
                Err(RecvTimeoutError::Timeout) if interrupt::requested() => return Ok(None),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => bail!("the control thread has ended"),
            }
        }
    }

    /// One episode of an evaluation; whether it came to its end.
    fn measure(
        &mut self,
        pupil: &mut Pupil,
        episode: u64,
        trials: &mut Trials,
    ) -> anyhow::Result<bool> {
        let step = pupil.progress.step;
        self.arm.control.orders.send(Order::Evaluate { episode, step })?;
        let mut begun = false;
        loop {
            match self.news()? {
                Some(News::Measured(x)) => {
                    if !std::mem::replace(&mut begun, true) {
                        trials.begin();
                        trials.expected(f64::from(pupil.agent.q_start(&x.observation)?));
                    }
                    trials.step(f64::from(x.reward), x.summary.as_ref());
                    let over = x.summary.is_some();
                    self.arm.control.give_back(x);
                    if over {
                        return Ok(true);
                    }
                }
                Some(News::Fault(fault)) => return self.stopped(pupil, &fault).map(|()| false),
                Some(News::Ready | News::Step(_)) => {}
                None => return Ok(false),
            }
        }
    }

    /// Between two episodes a person may have pressed Enter.
    fn perhaps_pause(&mut self, pupil: &mut Pupil) -> anyhow::Result<()> {
        if self.keys.take() {
            self.pause(pupil, "paused: the arm holds its place. Enter goes on")?;
        }
        Ok(())
    }

    /// Waits for Enter; the arm holds its place meanwhile. An interrupt ends the wait too.
    fn pause(&mut self, pupil: &mut Pupil, why: &str) -> anyhow::Result<()> {
        pupil.console.note(why);
        while !self.keys.take() && !interrupt::requested() {
            match self.arm.control.news.recv_timeout(GLANCE) {
                Ok(News::Fault(fault)) => return self.stopped(pupil, &fault),
                Err(RecvTimeoutError::Disconnected) => bail!("the control thread has ended"),
                _ => {}
            }
        }
        Ok(())
    }

    /// Saves, and goes on only when a person says so.
    fn stopped(&mut self, pupil: &mut Pupil, fault: &Fault) -> anyhow::Result<()> {
        pupil.agent.end_episode();
        pupil.keep_verdicts(pupil.progress.episodes, &self.verdicts())?;
        pupil.progress.aborted += 1;
        if interrupt::requested() {
            return Ok(());
        }
        pupil.checkpoint()?;
        if !self.keys.attended {
            return Err(
                ended(fault).context("a checkpoint is saved; continue with train-real --resume")
            );
        }
        self.faults += 1;
        self.keys.take();
        pupil.console.note(&format!(
            "{:#}\nA checkpoint is saved. Enter when the cause is found and removed: the arm then drives to its start. Ctrl-C ends the run.",
            ended(fault)
        ));
        while !interrupt::requested() {
            if !self.keys.take() {
                std::thread::sleep(GLANCE);
                continue;
            }
            self.arm.operator.acknowledge();
            self.arm.control.orders.send(Order::Recover)?;
            match self.news()? {
                Some(News::Fault(still)) => {
                    pupil.console.note(&format!("{:#}\nEnter tries again.", ended(&still)));
                }
                _ => return Ok(()),
            }
        }
        Ok(())
    }
}

impl World for RealTime {
    /// Learns while the arm moves; the episode ends when the last of its steps has been learned from, and
    /// only then is the next one ordered.
    fn episode(&mut self, pupil: &mut Pupil) -> anyhow::Result<()> {
        self.perhaps_pause(pupil)?;
        // An interrupt stops the arm without an order; one more changes nothing.
        // No start twice: what stopped the arm there might again.
        let number = pupil.progress.episodes + pupil.progress.aborted;
        self.arm.control.orders.send(Order::Episode(number))?;
        loop {
            match self.news()? {
                Some(News::Step(x)) => {
                    pupil.take(&x)?;
                    self.exchange.offer(pupil.agent.policy());
                    let over = x.summary.is_some();
                    self.arm.control.give_back(x);
                    if over {
                        return Ok(());
                    }
                }
                Some(News::Fault(fault)) => return self.stopped(pupil, &fault),
                Some(News::Ready | News::Measured(_)) => {}
                None => {
                    pupil.agent.end_episode();
                    pupil.progress.aborted += 1;
                    return Ok(());
                }
            }
        }
    }

    fn verdicts(&mut self) -> Vec<Entry> {
        self.arm.control.verdicts.try_iter().collect()
    }

    /// Episodes of the policy as it is now, on the arm; given up after a stop or an interrupt.
    fn evaluate(&mut self, pupil: &mut Pupil) -> anyhow::Result<Option<Evaluation>> {
        self.exchange.offer(pupil.agent.policy());
        let mut trials = Trials::new(&pupil.config.sac);
        for episode in 0..pupil.config.run.evaluate_episodes {
            self.perhaps_pause(pupil)?;
            if !self.measure(pupil, episode, &mut trials)? {
                return Ok(None);
            }
        }
        Ok(Some(trials.result(pupil.progress.step)))
    }

    fn end(self) -> (Option<serde_json::Value>, Vec<String>) {
        let (faults, realtime) = (self.faults, self.arm.realtime.clone());
        let background = self.background;
        let Some(stats) = self.arm.release() else { return (None, Vec::new()) };
        let link = serde_json::json!({
            "stops_cleared_by_a_person": faults,
            "scheduling": realtime.to_string(),
            "learner": background.to_string(),
            "ticks": stats,
            "commands_taken": stats.success_rate(),
        });
        (Some(link), Vec::new())
    }
}
