//! A person's word that the arm may move again.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use crate::UrError;
use crate::proto::SafetyStatus;

/// No stop waits to be acknowledged.
const NOTHING: i32 = 0;

/// Acknowledges stops of the safety system.
///
/// After a protective or emergency stop, a safeguard stop or a fault, clearing it on the pendant is not
/// enough: the arm stays refused until a person has said that the cause is found. Call
/// [`acknowledge`](Self::acknowledge) on a key press of theirs, never from a program of its own accord: the
/// manufacturer prohibits automatic resets. Clones speak for the same arm.
#[derive(Clone, Debug, Default)]
pub struct Operator(Arc<AtomicI32>);

impl Operator {
    /// The stop that waits for a person.
    pub fn pending(&self) -> Option<SafetyStatus> {
        match self.0.load(Ordering::SeqCst) {
            NOTHING => None,
            status => Some(status.into()),
        }
    }

    /// A person has looked and says go on.
    pub fn acknowledge(&self) {
        self.0.store(NOTHING, Ordering::SeqCst);
    }

    pub(super) fn require(&self, status: SafetyStatus) {
        self.0.store(status.into(), Ordering::SeqCst);
    }

    pub(super) fn check(&self) -> Result<(), UrError> {
        self.pending().map_or(Ok(()), |status| Err(UrError::NeedsOperator(status)))
    }
}
