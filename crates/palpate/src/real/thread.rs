//! The control thread and what is said to it and by it.
//!
//! It owns the arm, acts at 20 Hz and controls at 500 Hz, and waits for nobody. What goes out goes into a channel
//! with room for more than an episode; what comes in is looked at without waiting, and only between two actions. A
//! learner that is busy, late or gone therefore changes nothing about the arm's motion: the policy it last handed
//! over acts on, and after the episode the arm holds its place.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use anyhow::Context as _;
use palpate_env::{Env, EnvError};
use palpate_robot_io::FaultKind;
use palpate_runs::Journal;
use palpate_safety::{Entry, Guarded};

use super::exchange::Exchange;
use super::journal;
use super::pilot::Pilot;
use crate::baselines::Actor;
use crate::record::OnArm;
use crate::train::lesson::Lesson;

/// Room for verdicts that the learner has not written yet.
const VERDICTS: usize = 4096;

/// What the control thread is asked for.
#[derive(Debug)]
pub(super) enum Order {
    /// Drive to the start of this episode and run it.
    Episode(u64),
    /// The same with the policy's mean after so many steps, on a start of its own: to be measured, not learned from.
    Evaluate { episode: u64, step: u64 },
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
    /// The same in an evaluation: no experience, and in no journal.
    Measured(Box<Lesson>),
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

impl Fault {
    pub(super) fn of<R: Guarded>(error: &EnvError<R::Error>) -> Self {
        let kind = match error {
            EnvError::Robot(e) => R::fault(e),
            _ => None,
        };
        Self { text: error.to_string(), kind }
    }
}

/// The control thread's ends of its channels.
#[derive(Debug)]
pub(super) struct Ends {
    pub(super) orders: Receiver<Order>,
    pub(super) news: SyncSender<News>,
    pub(super) verdicts: SyncSender<Entry>,
    /// Lessons that were learned, to be written anew.
    pub(super) learned: Receiver<Box<Lesson>>,
}

/// The handle of a running control thread. Dropped, the thread stops the arm and ends.
#[derive(Debug)]
pub(super) struct Control {
    pub(super) orders: SyncSender<Order>,
    pub(super) news: Receiver<News>,
    /// What the fail-safe layer said until then, on the way to the start (times before 0) and in the episode.
    pub(super) verdicts: Receiver<Entry>,
    learned: SyncSender<Box<Lesson>>,
    thread: Option<JoinHandle<()>>,
}

/// Room for an episode and what is said around it: the control thread never waits to be heard.
pub(super) fn room(steps: u32) -> usize {
    steps as usize + 8
}

impl Control {
    /// A handle without a thread, and the thread's ends. An episode has at most `steps` actions.
    pub(super) fn pair(steps: u32) -> (Self, Ends) {
        let (orders, inbox) = sync_channel(4);
        let (outbox, news) = sync_channel(room(steps));
        let (said, verdicts) = sync_channel(VERDICTS);
        let (learned, back) = sync_channel(room(steps));
        let ends = Ends { orders: inbox, news: outbox, verdicts: said, learned: back };
        (Self { orders, news, verdicts, learned, thread: None }, ends)
    }

    /// Starts the thread. `build` makes the environment there, because a connected arm must be read at once; `fly`
    /// has the pilot serve, and looks at it a last time.
    pub(super) fn start<R: Guarded + 'static>(
        build: impl FnOnce() -> anyhow::Result<Env<R>> + Send + 'static,
        actor: Actor,
        exchange: Exchange,
        steps: u32,
        fly: impl FnOnce(&mut Pilot<R>) + Send + 'static,
    ) -> anyhow::Result<Self> {
        let (mut control, ends) = Self::pair(steps);
        let thread = std::thread::Builder::new()
            .name("control".into())
            .spawn(move || match build() {
                Ok(env) => {
                    let mut pilot = Pilot::new(env, actor, exchange, ends, steps);
                    fly(&mut pilot);
                    pilot.finish();
                }
                Err(e) => {
                    let text = format!("{e:#}");
                    _ = ends.news.try_send(News::Fault(Fault { text, kind: None }));
                }
            })
            .context("cannot start the control thread")?;
        control.thread = Some(thread);
        Ok(control)
    }

    /// Gives a lesson back once it is learned: the control thread writes the next one into it.
    pub(super) fn give_back(&self, lesson: Box<Lesson>) {
        // There is room for all of them; one that is lost is made anew.
        _ = self.learned.try_send(lesson);
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
