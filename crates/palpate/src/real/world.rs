//! Experience from an arm that cannot wait.

use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

use anyhow::bail;

use super::keys::Keys;
use super::thread::{Exchange, Fault, News, Order};
use super::{Arm, ended};
use crate::interrupt;
use crate::progress::Evaluation;
use crate::train::pupil::Pupil;
use crate::train::world::World;
use palpate_safety::Entry;

/// How often a wait looks at Enter and Ctrl-C.
const GLANCE: Duration = Duration::from_millis(50);

/// An arm under its control thread, seen from the learner.
pub(super) struct RealTime {
    arm: Arm,
    exchange: Exchange,
    keys: Keys,
    /// Stops that a person has cleared.
    faults: u64,
}

impl RealTime {
    pub(super) fn new(arm: Arm, exchange: Exchange) -> Self {
        Self { arm, exchange, keys: Keys::listen(), faults: 0 }
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
        if self.keys.take() {
            self.pause(pupil, "paused: the arm holds its place. Enter goes on")?;
        }
        // An interrupt stops the arm without an order; one more changes nothing.
        self.arm.control.orders.send(Order::Episode(pupil.progress.episodes))?;
        loop {
            match self.news()? {
                Some(News::Step(x)) => {
                    pupil.take(&x)?;
                    self.exchange.offer(pupil.agent.policy());
                    if x.summary.is_some() {
                        return Ok(());
                    }
                }
                Some(News::Fault(fault)) => return self.stopped(pupil, &fault),
                Some(News::Ready) => {}
                None => {
                    pupil.agent.end_episode();
                    return Ok(());
                }
            }
        }
    }

    fn verdicts(&mut self) -> Vec<Entry> {
        self.arm.control.verdicts.try_iter().collect()
    }

    /// Not during training: it would cost the arm's time. `run-policy` measures afterwards.
    fn evaluate(&mut self, _: &Pupil) -> anyhow::Result<Option<Evaluation>> {
        Ok(None)
    }

    fn end(self) -> (Option<serde_json::Value>, Vec<String>) {
        let (faults, realtime) = (self.faults, self.arm.realtime.clone());
        let Some(stats) = self.arm.release() else { return (None, Vec::new()) };
        let link = serde_json::json!({
            "stops_cleared_by_a_person": faults,
            "scheduling": realtime,
            "ticks": stats,
            "commands_taken": stats.success_rate(),
        });
        (Some(link), Vec::new())
    }
}
