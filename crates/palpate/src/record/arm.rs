//! Recording on an arm's control thread: nothing here waits or asks for memory in an episode.

use palpate_env::{Env, Outcome};
use palpate_safety::Guarded;

use super::{Kind, Recorder};

/// A recorder and which episodes it keeps.
#[derive(Debug)]
pub(crate) struct OnArm {
    recorder: Recorder,
    /// All, under this name; or the collisions.
    name: Option<&'static str>,
}

impl OnArm {
    /// Keeps all episodes under a name, or the collisions.
    pub(crate) fn new(recorder: Recorder, name: Option<&'static str>) -> Self {
        Self { recorder, name }
    }

    /// Takes all memory that it will need.
    pub(crate) fn load<R: Guarded>(&mut self, env: &mut Env<R>) {
        self.recorder.load_in_real_time(env);
    }

    /// Keeps the episode that has just ended, if it is worth it and there is room.
    pub(crate) fn keep<R: Guarded>(&mut self, env: &mut Env<R>, outcome: Outcome) {
        match self.name {
            Some(name) => self.recorder.keep(env, Kind::Policy(name), false),
            None if outcome == Outcome::Collision => {
                self.recorder.keep(env, Kind::Collision, false)
            }
            None => {}
        }
    }

    /// Waits for the files. Only once the arm is at rest.
    pub(crate) fn finish(self) {
        self.recorder.finish().iter().for_each(|lost| tracing::warn!("{lost}"));
    }
}
