//! Recording on an arm's control thread: nothing here waits or asks for memory, but where it begins and ends.

use std::sync::Arc;

use palpate_env::{Env, Outcome};
use palpate_safety::Guarded;

use super::{Kind, RecordConfig, Recorder};

/// A recorder and which episodes it keeps.
#[derive(Debug)]
pub(crate) struct OnArm {
    recorder: Recorder,
    keeps: Keeps,
}

#[derive(Debug)]
enum Keeps {
    All(Arc<str>),
    Configured { collisions: bool, evaluations: u64 },
}

impl OnArm {
    /// Keeps all episodes, under this name.
    pub(crate) fn all(recorder: Recorder, name: &str) -> Self {
        Self { recorder, keeps: Keeps::All(name.into()) }
    }

    /// Keeps what is configured for a training.
    pub(crate) fn training(recorder: Recorder, what: &RecordConfig) -> Self {
        let (collisions, evaluations) = (what.collisions > 0, what.evaluations);
        Self { recorder, keeps: Keeps::Configured { collisions, evaluations } }
    }

    /// Takes all memory that it will need.
    pub(crate) fn load<R: Guarded>(&mut self, env: &mut Env<R>) {
        self.recorder.load_in_real_time(env);
    }

    /// Keeps the episode that has just ended, if it is worth it and there is room. `evaluation`: the steps learned
    /// from before and the number of the start, if it was to be measured.
    pub(crate) fn keep<R: Guarded>(
        &mut self,
        env: &mut Env<R>,
        outcome: Outcome,
        evaluation: Option<(u64, u64)>,
    ) {
        let kind = match (&self.keeps, evaluation) {
            (Keeps::All(name), _) => Kind::Policy(Arc::clone(name)),
            (Keeps::Configured { evaluations, .. }, Some((step, episode)))
                if episode < *evaluations =>
            {
                Kind::Evaluation { step, episode }
            }
            (Keeps::Configured { collisions: true, .. }, None) if outcome == Outcome::Collision => {
                Kind::Collision
            }
            _ => return,
        };
        self.recorder.keep(env, kind, false);
    }

    /// Waits for the files. Only once the arm is at rest.
    pub(crate) fn finish(self) {
        self.recorder.finish().iter().for_each(|lost| tracing::warn!("{lost}"));
    }
}
