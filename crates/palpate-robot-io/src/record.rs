//! Recording everything that passes between a program and an arm, and playing it back.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::{BackendError, FaultKind, JointCommand, RobotBackend, RobotState};

/// What a call came to: nothing more, or the kind and text of the error.
pub type Outcome<T = ()> = Result<T, (FaultKind, String)>;

/// One call and what came of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Call {
    /// `read`.
    Read(Outcome<RobotState>),
    /// `write`, with the command.
    Write(JointCommand, Outcome),
    /// `stop`.
    Stop(Outcome),
    /// `recover`.
    Recover(Outcome),
    /// `tare`.
    Tare(Outcome),
}

/// A backend that writes down what passes through it.
///
/// Takes its memory once; when it is full, further calls pass but are counted instead of kept. Only a call
/// that fails takes anything from the heap, for its text.
#[derive(Debug)]
pub struct Recorder<B> {
    inner: B,
    calls: Vec<Call>,
    dropped: u64,
}

impl<B: RobotBackend> Recorder<B> {
    /// Wraps `inner` with room for this many calls: a second of control is 1,000.
    pub fn new(inner: B, capacity: usize) -> Self {
        Self { inner, calls: Vec::with_capacity(capacity), dropped: 0 }
    }

    /// The arm, to look at.
    pub fn inner(&self) -> &B {
        &self.inner
    }

    /// Calls that found no room.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Everything kept so far; the memory stays for what follows.
    pub fn take(&mut self) -> Vec<Call> {
        let taken = self.calls.clone();
        self.calls.clear();
        taken
    }

    fn keep(&mut self, call: Call) {
        if self.calls.len() < self.calls.capacity() {
            self.calls.push(call);
        } else {
            self.dropped += 1;
        }
    }
}

fn outcome<T: Copy, E: BackendError>(result: &Result<T, E>) -> Outcome<T> {
    match result {
        Ok(value) => Ok(*value),
        Err(error) => Err((error.kind(), error.to_string())),
    }
}

impl<B: RobotBackend> RobotBackend for Recorder<B> {
    type Error = B::Error;

    fn period(&self) -> Duration {
        self.inner.period()
    }

    fn read(&mut self) -> Result<RobotState, Self::Error> {
        let result = self.inner.read();
        self.keep(Call::Read(outcome(&result)));
        result
    }

    fn write(&mut self, command: &JointCommand) -> Result<(), Self::Error> {
        let result = self.inner.write(command);
        self.keep(Call::Write(*command, outcome(&result)));
        result
    }

    fn stop(&mut self) -> Result<(), Self::Error> {
        let result = self.inner.stop();
        self.keep(Call::Stop(outcome(&result)));
        result
    }

    fn recover(&mut self) -> Result<(), Self::Error> {
        let result = self.inner.recover();
        self.keep(Call::Recover(outcome(&result)));
        result
    }

    fn tare(&mut self) -> Result<(), Self::Error> {
        let result = self.inner.tare();
        self.keep(Call::Tare(outcome(&result)));
        result
    }
}

/// A backend that answers as the recorded one did, as long as it is asked the same.
///
/// It does not wait: a minute of an arm plays in milliseconds. A program that is deterministic passes to
/// the end; the first call that differs from the recording is an error that says where.
#[derive(Clone, Debug)]
pub struct Replay {
    calls: Vec<Call>,
    period: Duration,
    at: usize,
}

/// Why a [`Replay`] fails.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The recorded arm failed here, too.
    #[error("{message}")]
    Recorded {
        /// The recorded kind.
        kind: FaultKind,
        /// The recorded text.
        message: String,
    },
    /// Another call than the recorded one.
    #[error("call {at} is {got}, the recording has {recorded}")]
    Differs {
        /// Number of the call, from 0.
        at: usize,
        /// What was called.
        got: String,
        /// What was called then.
        recorded: String,
    },
    /// The recording ends before this call.
    #[error("the recording ends after {0} calls")]
    Ended(usize),
}

impl BackendError for ReplayError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Recorded { kind, .. } => *kind,
            Self::Differs { .. } | Self::Ended(_) => FaultKind::Internal,
        }
    }
}

impl Replay {
    /// Plays `calls` of an arm with this period.
    pub fn new(calls: Vec<Call>, period: Duration) -> Self {
        Self { calls, period, at: 0 }
    }

    /// Calls that have not been played.
    pub fn remaining(&self) -> usize {
        self.calls.len() - self.at
    }

    /// The recorded outcome of the next call, if `matching` recognises it.
    fn play<T>(
        &mut self,
        got: impl FnOnce() -> String,
        matching: impl FnOnce(&Call) -> Option<Outcome<T>>,
    ) -> Result<T, ReplayError> {
        let call = self.calls.get(self.at).ok_or(ReplayError::Ended(self.at))?;
        let Some(outcome) = matching(call) else {
            return Err(ReplayError::Differs {
                at: self.at,
                got: got(),
                recorded: format!("{call:?}"),
            });
        };
        self.at += 1;
        outcome.map_err(|(kind, message)| ReplayError::Recorded { kind, message })
    }
}

/// The same bits: a recorded NaN is the same NaN.
fn same(a: &JointCommand, b: &JointCommand) -> bool {
    a.q.iter().zip(&b.q).all(|(a, b)| a.to_bits() == b.to_bits())
}

impl RobotBackend for Replay {
    type Error = ReplayError;

    fn period(&self) -> Duration {
        self.period
    }

    fn read(&mut self) -> Result<RobotState, ReplayError> {
        self.play(
            || "read".into(),
            |call| match call {
                Call::Read(outcome) => Some(outcome.clone()),
                _ => None,
            },
        )
    }

    fn write(&mut self, command: &JointCommand) -> Result<(), ReplayError> {
        self.play(
            || format!("write of {command:?}"),
            |call| match call {
                Call::Write(recorded, outcome) if same(recorded, command) => Some(outcome.clone()),
                _ => None,
            },
        )
    }

    fn stop(&mut self) -> Result<(), ReplayError> {
        self.play(
            || "stop".into(),
            |call| match call {
                Call::Stop(outcome) => Some(outcome.clone()),
                _ => None,
            },
        )
    }

    fn recover(&mut self) -> Result<(), ReplayError> {
        self.play(
            || "recover".into(),
            |call| match call {
                Call::Recover(outcome) => Some(outcome.clone()),
                _ => None,
            },
        )
    }

    fn tare(&mut self) -> Result<(), ReplayError> {
        self.play(
            || "tare".into(),
            |call| match call {
                Call::Tare(outcome) => Some(outcome.clone()),
                _ => None,
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use palpate_spatial::JointVector;

    use super::*;
    use crate::{IdealArm, contract};

    fn arm() -> IdealArm {
        IdealArm::at(JointVector::from_element(0.3))
    }

    #[test]
    fn a_recording_of_the_contract_keeps_the_contract() {
        let mut recorder = Recorder::new(arm(), 20_000);
        contract::check(&mut recorder).unwrap();
        assert_eq!(recorder.dropped(), 0);
        let mut replay = Replay::new(recorder.take(), recorder.period());
        contract::check(&mut replay).unwrap();
        assert_eq!(replay.remaining(), 0);
        assert_eq!(replay.read(), Err(ReplayError::Ended(replay.calls.len())));
    }

    #[test]
    fn the_first_call_that_differs_is_named() {
        let mut recorder = Recorder::new(arm(), 10);
        let q = recorder.read().unwrap().q;
        recorder.write(&JointCommand { q }).unwrap();
        let mut replay = Replay::new(recorder.take(), recorder.period());
        replay.read().unwrap();
        let error = replay.write(&JointCommand { q: q.add_scalar(1e-12) }).unwrap_err();
        assert!(matches!(error, ReplayError::Differs { at: 1, .. }), "{error}");
        assert!(replay.stop().unwrap_err().to_string().contains("call 1 is stop"));
        replay.write(&JointCommand { q }).unwrap();
    }

    #[test]
    fn a_full_recorder_counts_and_lets_pass() {
        let mut recorder = Recorder::new(arm(), 3);
        for _ in 0..8 {
            recorder.read().unwrap();
        }
        assert_eq!((recorder.take().len(), recorder.dropped()), (3, 5));
        recorder.read().unwrap();
        assert_eq!(recorder.take().len(), 1);
    }
}
