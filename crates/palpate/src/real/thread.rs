//! The control thread: it owns the arm, acts at 20 Hz and controls at 500 Hz, and waits for nobody.
//!
//! What goes out goes into a channel with room for more than an episode; what comes in is looked at without
//! waiting, and only between two actions. A learner that is busy, late or gone therefore changes nothing about
//! the arm's motion: the policy it last handed over acts on, and after the episode the arm holds its place.

use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::Context as _;
use palpate_env::{Env, EnvError};
use palpate_robot_io::FaultKind;
use palpate_runs::Journal;
use palpate_sac::Policy;
use palpate_safety::{Entry, Guarded};

use super::journal;
use crate::baselines::Actor;
use crate::record::OnArm;
use crate::train::lesson::Lesson;

/// Pause between two looks at an arm that has stopped.
const REST: Duration = Duration::from_millis(1);

/// Joints slower than this stand, rad/s.
const AT_REST: f64 = 0.01;
/// Control periods that braking may take: 1 s; from 2π rad/s at 10 rad/s² it takes 0.63 s.
const TICKS_TO_REST: u32 = 500;

/// Room for verdicts that the learner has not written yet.
const VERDICTS: usize = 4096;

/// What the control thread is asked for.
#[derive(Debug)]
pub(super) enum Order {
    /// Drive to the start of this episode and run it.
    Episode(u64),
    /// A person says that the arm may move again.
    Recover,
    /// Record from now on.
    Record(Box<OnArm>),
    /// Stop and let go.
    End,
}

/// What the control thread says.
#[derive(Debug)]
pub(super) enum News {
    /// The arm is connected, at rest and takes orders.
    Ready,
    /// An action and what came of it.
    Step(Box<Lesson>),
    /// The arm has stopped and waits for [`Order::Recover`].
    Fault(Fault),
}

/// Why the arm has stopped.
#[derive(Debug)]
pub(super) struct Fault {
    /// For people.
    pub(super) text: String,
    /// The backend's kind, if it was the backend.
    pub(super) kind: Option<FaultKind>,
}

/// The newest policy on its way from the learner to the arm.
///
/// The two policies change places, so that neither side frees or copies the other's. The arm's side never
/// waits: while the learner has its hand on the slot, it keeps the policy it has.
#[derive(Clone, Debug, Default)]
pub(super) struct Exchange(Arc<Mutex<Option<Box<Slot>>>>);

#[derive(Debug)]
struct Slot {
    policy: Policy,
    fresh: bool,
}

impl Exchange {
    /// The learner's side.
    pub(super) fn offer(&self, policy: Policy) {
        let mut slot = Some(Box::new(Slot { policy, fresh: true }));
        if let Ok(mut shared) = self.0.lock() {
            std::mem::swap(&mut *shared, &mut slot);
        }
        // The old one is freed here, after the lock.
        drop(slot);
    }

    /// The arm's side.
    fn take(&self, policy: &mut Policy) {
        if let Ok(mut shared) = self.0.try_lock()
            && let Some(slot) = shared.as_mut().filter(|slot| slot.fresh)
        {
            std::mem::swap(&mut slot.policy, policy);
            slot.fresh = false;
        }
    }
}

/// The handle of a running control thread. Dropped, the thread stops the arm and ends.
#[derive(Debug)]
pub(super) struct Control {
    pub(super) orders: SyncSender<Order>,
    pub(super) news: Receiver<News>,
    /// What the fail-safe layer said until then, on the way to the start (times before 0) and in the episode.
    pub(super) verdicts: Receiver<Entry>,
    thread: Option<JoinHandle<()>>,
}

/// Room for an episode and what is said around it: the control thread never waits to be heard.
fn room(steps: u32) -> usize {
    steps as usize + 8
}

impl Control {
    /// Starts the thread. `build` makes the environment there, because a connected arm must be read at once;
    /// `farewell` looks at it a last time. An episode has at most `steps` actions.
    pub(super) fn start<R: Guarded + 'static>(
        build: impl FnOnce() -> anyhow::Result<Env<R>> + Send + 'static,
        actor: Actor,
        exchange: Exchange,
        steps: u32,
        farewell: impl FnOnce(&Env<R>) + Send + 'static,
    ) -> anyhow::Result<Self> {
        let (orders, inbox) = sync_channel(4);
        let (outbox, news) = sync_channel(room(steps));
        let (said, verdicts) = sync_channel(VERDICTS);
        let thread = std::thread::Builder::new()
            .name("control".into())
            .spawn(move || {
                let env = match build() {
                    Ok(env) => env,
                    Err(e) => {
                        let text = format!("{e:#}");
                        _ = outbox.try_send(News::Fault(Fault { text, kind: None }));
                        return;
                    }
                };
                let recorder = None;
                let mut pilot = Pilot { env, actor, exchange, inbox, outbox, said, recorder };
                pilot.say(News::Ready);
                pilot.serve();
                farewell(&pilot.env);
                if let Some(recorder) = pilot.recorder {
                    recorder.finish();
                }
            })
            .context("cannot start the control thread")?;
        Ok(Self { orders, news, verdicts, thread: Some(thread) })
    }

    /// Keeps every step in a journal before it is heard; `taken` steps came before, an episode has at most
    /// `steps`.
    pub(super) fn journal(
        &mut self,
        journal: Journal,
        taken: u64,
        steps: u32,
    ) -> anyhow::Result<()> {
        let nobody = sync_channel(0).1;
        let news = std::mem::replace(&mut self.news, nobody);
        self.news = journal::tee(journal, news, taken, room(steps))?;
        Ok(())
    }
}

impl Drop for Control {
    fn drop(&mut self) {
        _ = self.orders.send(Order::End);
        if let Some(thread) = self.thread.take() {
            _ = thread.join();
        }
    }
}

struct Pilot<R: Guarded> {
    env: Env<R>,
    actor: Actor,
    exchange: Exchange,
    inbox: Receiver<Order>,
    outbox: SyncSender<News>,
    said: SyncSender<Entry>,
    recorder: Option<Box<OnArm>>,
}

impl<R: Guarded> Pilot<R> {
    /// Does what it is asked for and holds the arm in between.
    fn serve(&mut self) {
        let mut stopped = false;
        loop {
            let order = self.inbox.try_recv();
            let done = match order {
                Ok(Order::Episode(number)) if !stopped => self.episode(number),
                Ok(Order::Episode(_)) => continue,
                Ok(Order::Record(mut recorder)) => {
                    recorder.load(&mut self.env);
                    self.recorder = Some(recorder);
                    continue;
                }
                Ok(Order::Recover) => self.env.recover().map(|()| self.say(News::Ready)),
                Err(TryRecvError::Empty) if stopped => {
                    // Goes on reading, so that nothing old waits in the link; what it reads is known.
                    _ = self.env.hold();
                    std::thread::sleep(REST);
                    continue;
                }
                Err(TryRecvError::Empty) => self.env.hold().map(|_| ()),
                Ok(Order::End) | Err(TryRecvError::Disconnected) => return self.rest(),
            };
            stopped = done.is_err();
            if let Err(error) = done {
                // Also where the arm is whole and only the way was blocked.
                _ = self.env.stop();
                self.empty_ledger();
                self.say(News::Fault(fault::<R>(&error)));
            }
        }
    }

    /// Stops the arm and watches until it stands.
    fn rest(&mut self) {
        _ = self.env.stop();
        for _ in 0..TICKS_TO_REST {
            match self.env.hold() {
                Ok(m) if m.state.dq.amax() < AT_REST => return,
                Ok(_) => {}
                // Nothing can be seen any more; the arm's own program stops it.
                Err(_) => return,
            }
        }
    }

    fn episode(&mut self, number: u64) -> Result<(), EnvError<R::Error>> {
        self.env.set_next_episode(number);
        self.env.reset()?;
        self.actor.reset(number);
        let mut observation = self.env.observation().to_vec();
        loop {
            if let Some(policy) = self.actor.policy_mut() {
                self.exchange.take(policy);
            }
            let action = self.actor.act(&self.env);
            let narrow: Vec<f32> = action.iter().map(|x| *x as f32).collect();
            let step = self.env.step(action)?;
            let over = step.summary.as_ref().map(|summary| summary.outcome);
            let seen = std::mem::take(&mut observation);
            let lesson = Lesson::new(&self.env, seen, narrow, step);
            observation.clone_from(&lesson.next);
            if let Some(outcome) = over {
                self.empty_ledger();
                if let Some(recorder) = &mut self.recorder {
                    recorder.keep(&mut self.env, outcome);
                }
            }
            self.say(News::Step(Box::new(lesson)));
            if over.is_some() {
                return Ok(());
            }
        }
    }

    /// Hands over what the fail-safe layer said; what there is no room for is still counted in the summary.
    fn empty_ledger(&mut self) {
        let start = self.env.started();
        let ledger = self.env.ledger_mut();
        for entry in ledger.entries() {
            _ = self.said.try_send(Entry { time: entry.time - start, ..*entry });
        }
        ledger.clear_entries();
    }

    fn say(&self, news: News) {
        // There is room by construction; and without a listener the order to end is near.
        _ = self.outbox.try_send(news);
    }
}

fn fault<R: Guarded>(error: &EnvError<R::Error>) -> Fault {
    let kind = match error {
        EnvError::Robot(e) => R::fault(e),
        _ => None,
    };
    Fault { text: error.to_string(), kind }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::time::Instant;

    use palpate_robot_io::{IdealArm, IdealArmError, JointCommand, RobotBackend, RobotState};
    use palpate_sac::Sac;

    use crate::Config;
    use crate::config::Choice;
    use crate::stack::{self, Purpose};

    fn config() -> Config {
        let set = ["sac.hidden=[8]", "env.max_steps=12"].map(String::from).to_vec();
        let (preset, task, model) = ("palpate".into(), "peg-insertion".into(), "P-14".into());
        Config::load(&Choice { preset, task, model, file: None, set }).unwrap()
    }

    fn policy(seed: u64) -> Policy {
        Sac::new(&config().sac, 18, 14, seed).unwrap().policy()
    }

    fn mean(policy: &mut Policy) -> Vec<f32> {
        let mut action = vec![0.0; policy.action_dim()];
        policy.mean(&[0.1; 18], &mut action);
        action
    }

    #[test]
    fn the_arm_takes_the_newest_policy_once_and_never_waits() {
        let (exchange, mut acting) = (Exchange::default(), policy(1));
        exchange.take(&mut acting);
        assert_eq!(mean(&mut acting), mean(&mut policy(1)), "nothing was offered");
        exchange.offer(policy(2));
        exchange.offer(policy(3));
        {
            let _learner = exchange.0.lock();
            exchange.take(&mut acting);
            assert_eq!(mean(&mut acting), mean(&mut policy(1)), "the learner has its hand on it");
        }
        exchange.take(&mut acting);
        assert_eq!(mean(&mut acting), mean(&mut policy(3)));
        exchange.take(&mut acting);
        assert_eq!(mean(&mut acting), mean(&mut policy(3)), "an old one came back");
    }

    /// An ideal arm in real time that counts its reads.
    struct Paced {
        arm: IdealArm,
        next: Instant,
        reads: Arc<AtomicU64>,
    }

    impl RobotBackend for Paced {
        type Error = IdealArmError;
        fn period(&self) -> Duration {
            self.arm.period()
        }
        fn read(&mut self) -> Result<RobotState, IdealArmError> {
            std::thread::sleep(self.next.saturating_duration_since(Instant::now()));
            self.next = Instant::now() + self.period();
            self.reads.fetch_add(1, Ordering::Relaxed);
            self.arm.read()
        }
        fn write(&mut self, command: &JointCommand) -> Result<(), IdealArmError> {
            self.arm.write(command)
        }
        fn stop(&mut self) -> Result<(), IdealArmError> {
            self.arm.stop()
        }
        fn recover(&mut self) -> Result<(), IdealArmError> {
            self.arm.recover()
        }
        fn tare(&mut self) -> Result<(), IdealArmError> {
            self.arm.tare()
        }
    }

    #[test]
    fn an_episode_needs_no_learner_and_the_arm_is_held_after_it() {
        let reads = Arc::new(AtomicU64::new(0));
        let count = Arc::clone(&reads);
        let build = move || {
            let config = config();
            let arm =
                Paced { arm: IdealArm::at(config.task.q_home), next: Instant::now(), reads: count };
            stack::env(&config, stack::chain(&config.robot)?, arm, 1, Purpose::Train)
        };
        let actor = Actor::learned(policy(1), Some(1));
        let exchange = Exchange::default();
        // A learner that died with its hand on the slot.
        let held = exchange.clone();
        let _hand = held.0.lock();
        let control = Control::start(build, actor, exchange.clone(), 12, |_| {}).unwrap();
        assert!(matches!(control.news.recv().unwrap(), News::Ready));
        control.orders.send(Order::Episode(0)).unwrap();
        // Nobody listens for longer than the way and the episode take.
        std::thread::sleep(Duration::from_secs(4));
        let before = reads.load(Ordering::Relaxed);
        std::thread::sleep(Duration::from_millis(500));
        assert!(reads.load(Ordering::Relaxed) > before + 50, "the arm is not read any more");
        let steps: Vec<_> = control.news.try_iter().collect();
        assert_eq!(steps.len(), 12, "{steps:?}");
        let over = |news: &News| matches!(news, News::Step(x) if x.summary.is_some());
        assert!(over(&steps[11]) && !steps[..11].iter().any(over), "{steps:?}");
    }
}
