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
use palpate_env::{Env, EnvError, Step};
use palpate_robot_io::FaultKind;
use palpate_sac::Policy;
use palpate_safety::Guarded;

use crate::baselines::Actor;

/// Pause between two looks at an arm that has stopped.
const REST: Duration = Duration::from_millis(1);

/// Joints slower than this stand, rad/s.
const AT_REST: f64 = 0.01;
/// Control periods that braking may take: 1 s; from 2π rad/s at 10 rad/s² it takes 0.63 s.
const TICKS_TO_REST: u32 = 500;

/// What the control thread is asked for.
#[derive(Debug)]
pub(super) enum Order {
    /// Drive to the start of this episode and run it.
    Episode(u64),
    /// A person says that the arm may move again.
    Recover,
    /// Stop and let go.
    End,
}

/// What the control thread says.
#[derive(Debug)]
pub(super) enum News {
    /// The arm is connected, at rest and takes orders.
    Ready,
    /// An action and what came of it.
    Step(Box<Experience>),
    /// The arm has stopped and waits for [`Order::Recover`].
    Fault(Fault),
}

/// One step of an episode.
#[derive(Debug)]
pub(super) struct Experience {
    pub(super) observation: Vec<f32>,
    pub(super) action: Vec<f32>,
    pub(super) next: Vec<f32>,
    pub(super) step: Step,
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
    thread: Option<JoinHandle<()>>,
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
        // Room for an episode and what is said around it: the thread never waits to be heard.
        let (outbox, news) = sync_channel(steps as usize + 8);
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
                let mut pilot = Pilot { env, actor, exchange, inbox, outbox };
                pilot.say(News::Ready);
                pilot.serve();
                farewell(&pilot.env);
            })
            .context("cannot start the control thread")?;
        Ok(Self { orders, news, thread: Some(thread) })
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
            let narrow = action.iter().map(|x| *x as f32).collect();
            let step = self.env.step(action)?;
            let next = self.env.observation().to_vec();
            let over = step.summary.is_some();
            let seen = std::mem::replace(&mut observation, next.clone());
            self.say(News::Step(Box::new(Experience {
                observation: seen,
                action: narrow,
                next,
                step,
            })));
            if over {
                return Ok(());
            }
        }
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
