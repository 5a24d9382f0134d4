//! Recordings of episodes in MCAP, which Foxglove and Rerun open.
//!
//! The environment writes each control period onto a tape ([`palpate_env::Tape`]), which takes no memory and waits for
//! nobody. After an episode that is worth keeping, its tape changes places with an empty one and a thread of its own
//! turns it into a file. On an arm an episode goes unrecorded if that thread is behind; in simulation it is waited for.

mod arm;
mod episode;
mod folder;
mod scene;

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use anyhow::Context as _;
use palpate_env::{Env, Outcome, Tape};
use palpate_safety::Guarded;

use crate::Config;
use crate::stack;
pub(crate) use arm::OnArm;
use episode::Setup;

/// Folder of the recordings in a run.
pub const FOLDER: &str = "episodes";
/// Tapes that wait to be written.
const QUEUE: usize = 2;

/// Which episodes of a training are kept.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordConfig {
    /// Episodes of the first and of the latest evaluation; 0: none.
    pub evaluations: u64,
    /// The latest collisions; 0: none.
    pub collisions: usize,
    /// Samples per second, at most the control rate. Frames are told 50 times a second.
    pub rate: f64,
}

impl Default for RecordConfig {
    /// None.
    fn default() -> Self {
        Self { evaluations: 0, collisions: 0, rate: 500.0 }
    }
}

impl RecordConfig {
    /// Checks that the numbers make sense.
    pub fn validate(&self) -> anyhow::Result<()> {
        if !(self.rate > 0.0 && self.rate.is_finite()) {
            anyhow::bail!("record.rate is {} Hz, but it must be positive", self.rate);
        }
        Ok(())
    }
}

/// What an episode was, for the name of its file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kind {
    /// A collision in training.
    Collision,
    /// An episode of the evaluation after this many steps.
    Evaluation { step: u64, episode: u64 },
    /// An episode of this policy, to be looked at.
    Policy(Arc<str>),
}

impl Kind {
    fn name(&self, episode: u64, outcome: Outcome) -> String {
        match self {
            Self::Collision => format!("collision_{episode:06}"),
            Self::Evaluation { step, episode } => format!("eval_{step:07}_{episode:03}"),
            Self::Policy(policy) => {
                let words: Vec<&str> = policy
                    .split(|c: char| !c.is_ascii_alphanumeric())
                    .filter(|word| !word.is_empty())
                    .collect();
                let policy = words.join("-");
                let outcome = match outcome {
                    Outcome::Success => "success",
                    Outcome::Collision => "collision",
                    Outcome::TimeLimit => "time-limit",
                    Outcome::Fault => "fault",
                };
                format!("{policy}_{episode:03}_{outcome}")
            }
        }
    }
}

struct Job {
    tape: Box<Tape>,
    kind: Kind,
}

/// Writes episodes into a folder, on a thread of its own.
#[derive(Debug)]
pub struct Recorder {
    full: Option<SyncSender<Job>>,
    /// Tapes to be used again. Never locked: it makes the recorder one that can be sent in an order.
    empty: Mutex<Receiver<Box<Tape>>>,
    thread: Option<JoinHandle<Vec<String>>>,
    folder: PathBuf,
    /// Tapes that are ready, so that none has to be made on a control thread.
    #[expect(clippy::vec_box, reason = "a box more or less would be an allocation")]
    spare: Vec<Box<Tape>>,
    unrecorded: u64,
}

impl Recorder {
    /// A recorder of this configuration's episodes into `folder`, which it creates with the first of them.
    pub fn new(config: &Config, folder: &Path) -> anyhow::Result<Self> {
        let (full, jobs) = sync_channel::<Job>(QUEUE);
        let (done, empty) = sync_channel(QUEUE + 2);
        let setup = Setup::new(config, stack::chain(&config.robot)?)?;
        let (place, limits) = (folder.to_owned(), config.record.clone());
        let work = move || {
            let mut failures = Vec::new();
            for Job { tape, kind } in jobs {
                let Some(summary) = tape.summary() else { continue };
                let name = kind.name(tape.episode(), summary.outcome);
                let written = setup.encode(&tape, &name).and_then(|bytes| {
                    folder::write(&place, &name, &bytes)?;
                    folder::prune(&place, limits.collisions)
                });
                if let Err(e) = written {
                    failures.push(format!("{name}: {e:#}"));
                }
                // Where nobody takes it back, it is not needed any more.
                _ = done.try_send(tape);
            }
            failures
        };
        let thread = std::thread::Builder::new().name("recorder".into()).spawn(work);
        Ok(Self {
            full: Some(full),
            empty: Mutex::new(empty),
            thread: Some(thread.context("cannot start the recorder")?),
            folder: folder.to_owned(),
            spare: Vec::new(),
            unrecorded: 0,
        })
    }

    /// Puts a tape into an environment.
    pub fn load<R: Guarded>(&self, env: &mut Env<R>) {
        let tape = env.new_tape();
        env.swap_tape(Some(tape));
    }

    /// The same for an environment whose thread must not wait for memory afterwards.
    pub(crate) fn load_in_real_time<R: Guarded>(&mut self, env: &mut Env<R>) {
        self.load(env);
        // One is written and the queue is full: then an episode goes unrecorded, not a tape missing.
        self.spare = (0..=QUEUE).map(|_| env.new_tape()).collect();
    }

    /// Keeps the episode that has just ended as one of `policy`, and waits for room if there is none.
    pub fn keep_as<R: Guarded>(&mut self, env: &mut Env<R>, policy: &str) {
        self.keep(env, Kind::Policy(policy.into()), true);
    }

    /// Keeps the episode that has just ended, if its environment was [loaded](Self::load). With `wait` it is surely
    /// kept; without, this neither waits nor takes memory.
    pub(crate) fn keep<R: Guarded>(&mut self, env: &mut Env<R>, kind: Kind, wait: bool) {
        let Some(full) = &self.full else { return };
        let Some(tape) = env.swap_tape(None) else { return };
        if tape.summary().is_none() {
            env.swap_tape(Some(tape));
            return;
        }
        let next = self.empty.get_mut().ok().and_then(|empty| empty.try_recv().ok());
        let next = next.or_else(|| self.spare.pop()).or_else(|| wait.then(|| env.new_tape()));
        let Some(next) = next else {
            self.unrecorded += 1;
            env.swap_tape(Some(tape));
            return;
        };
        env.swap_tape(Some(next));
        let job = Job { tape, kind };
        let sent = if wait {
            full.send(job).map_err(|e| TrySendError::Disconnected(e.0))
        } else {
            full.try_send(job)
        };
        if let Err(TrySendError::Full(job) | TrySendError::Disconnected(job)) = sent {
            self.unrecorded += 1;
            self.spare.push(job.tape);
        }
    }

    /// Waits until all is written. What went wrong, for people; nothing is lost but recordings.
    pub fn finish(mut self) -> Vec<String> {
        self.full = None;
        let mut failures = match self.thread.take().map(JoinHandle::join) {
            Some(Ok(failures)) => failures,
            _ => vec!["the recorder broke down".into()],
        };
        if self.unrecorded > 0 {
            failures.push(format!("{} episodes came too fast to be recorded", self.unrecorded));
        }
        failures.iter().map(|f| format!("recording into {}: {f}", self.folder.display())).collect()
    }
}

#[cfg(test)]
mod tests;
