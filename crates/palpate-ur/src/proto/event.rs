//! What a session is given, what it says, and why it ends.

use std::time::Duration;

use super::frame::FrameError;
use super::message::{ControllerVersion, DecodeError, EncodeError, Text};
use super::recipe::{RecipeError, Record};

/// What a client wants of a controller.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Data packets per second: at most 500 on an e-Series, 125 on a CB3.
    pub frequency: f64,
    /// Outputs to receive.
    pub outputs: Vec<String>,
    /// Inputs to send, one recipe each.
    pub inputs: Vec<Vec<String>>,
    /// How long the controller may take to answer one request.
    pub timeout: Duration,
}

/// What a [`Session`](super::Session) understood.
#[derive(Debug)]
pub enum Event<'a> {
    /// Version 2 is spoken from here on.
    Negotiated,
    /// The controller's software.
    Controller(ControllerVersion),
    /// All outputs were granted.
    OutputsGranted,
    /// All inputs of the recipe with this index were granted.
    InputsGranted(usize),
    /// Data will come.
    Started,
    /// Outputs.
    Data(Record<'a>),
    /// Data that was under way when the pause was asked for.
    LateData,
    /// A text for a person.
    Text(Text<'a>),
    /// No more data will come.
    Paused,
}

/// Why a connection cannot go on. Close it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// Not RTDE.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A broken packet.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// A recipe that was not granted or not kept to.
    #[error(transparent)]
    Recipe(#[from] RecipeError),
    /// A request too long for a packet.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// The controller is too old.
    #[error(
        "the controller refuses RTDE protocol version 2, it speaks version 1: update it to PolyScope 5.3 or newer"
    )]
    Version,
    /// `S` was answered with no.
    #[error("the controller refuses to start sending data")]
    StartRefused,
    /// `P` was answered with no.
    #[error("the controller refuses to pause")]
    PauseRefused,
    /// A packet that the controller should not send now.
    #[error("the controller sent {got} while {waiting} was due")]
    Unexpected {
        /// What came.
        got: &'static str,
        /// What should have come.
        waiting: &'static str,
    },
    /// Data of a recipe that does not exist.
    #[error("the controller sent data of recipe {got}, the recipe is {want}")]
    RecipeId {
        /// The packet's id.
        got: u8,
        /// The recipe's id.
        want: u8,
    },
    /// No answer in time.
    #[error("the controller did not answer with {waiting} within {timeout:?}")]
    Timeout {
        /// What should have come.
        waiting: &'static str,
        /// How long was waited.
        timeout: Duration,
    },
    /// Values of other types or another number than the recipe.
    #[error("input recipe {0} does not take these values")]
    Values(usize),
    /// The connection failed earlier.
    #[error("the session has failed: reconnect")]
    Failed,
}
