//! The client's side of a connection, from the first packet to data and back to silence.

use std::borrow::Cow;
use std::time::Duration;

use super::event::{Event, SessionError, Setup};
use super::frame::Framer;
use super::message::{ControllerVersion, Version};
use super::packet::{ClientPacket, ServerPacket};
use super::recipe::Recipe;
use super::value::Value;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Version,
    Controller,
    Outputs,
    Inputs(usize),
    Starting,
    Running,
    Pausing,
    Paused,
    Failed,
}

impl State {
    fn waiting(self) -> &'static str {
        match self {
            Self::Version => "the answer to the protocol version",
            Self::Controller => "the controller version",
            Self::Outputs => "the output recipe",
            Self::Inputs(_) => "an input recipe",
            Self::Starting => "the answer to start",
            Self::Running => "data",
            Self::Pausing => "the answer to pause",
            Self::Paused | Self::Failed => "nothing",
        }
    }
}

/// The client's state machine: received bytes and the time in, events and bytes to send out.
///
/// Times are durations since any fixed moment of the caller's choice. After `Err` the session repeats
/// [`SessionError::Failed`]: a controller and a client that disagree once cannot agree again on the same
/// connection.
#[derive(Debug)]
pub struct Session {
    setup: Setup,
    framer: Framer,
    version: Version,
    state: State,
    start_confirmed: bool,
    deadline: Option<Duration>,
    outgoing: Vec<u8>,
    sent: usize,
    scratch: Vec<u8>,
    controller: ControllerVersion,
    outputs: Recipe,
    inputs: Vec<Recipe>,
}

impl Session {
    /// A new connection; the first request is ready to be sent.
    ///
    /// # Errors
    ///
    /// The setup does not fit into packets.
    pub fn new(setup: Setup, now: Duration) -> Result<Self, SessionError> {
        let mut session = Self {
            framer: Framer::new(),
            version: Version::V1,
            state: State::Version,
            start_confirmed: false,
            deadline: None,
            outgoing: Vec::with_capacity(4096),
            sent: 0,
            scratch: Vec::with_capacity(1024),
            controller: ControllerVersion::default(),
            outputs: Recipe::new(0, []),
            inputs: Vec::with_capacity(setup.inputs.len()),
            setup,
        };
        session.ask(State::Version, now)?;
        Ok(session)
    }

    /// Where to put received bytes.
    pub fn space(&mut self) -> &mut [u8] {
        self.framer.space()
    }

    /// Says how many bytes were put there.
    pub fn filled(&mut self, n: usize) {
        self.framer.filled(n);
    }

    /// Bytes to send.
    pub fn outgoing(&self) -> &[u8] {
        &self.outgoing[self.sent..]
    }

    /// Says how many of them were sent.
    pub fn sent(&mut self, n: usize) {
        self.sent = (self.sent + n).min(self.outgoing.len());
        if self.sent == self.outgoing.len() {
            self.outgoing.clear();
            self.sent = 0;
        }
    }

    /// When to call [`poll`](Self::poll) at the latest.
    pub fn deadline(&self) -> Option<Duration> {
        self.deadline
    }

    /// The controller's software, once it has said so.
    pub fn controller(&self) -> ControllerVersion {
        self.controller
    }

    /// The output recipe; empty before it was granted.
    pub fn outputs(&self) -> &Recipe {
        &self.outputs
    }

    /// Whether data is coming.
    pub fn is_running(&self) -> bool {
        self.state == State::Running
    }

    /// Fails if an answer is overdue.
    pub fn poll(&mut self, now: Duration) -> Result<(), SessionError> {
        if self.deadline.is_some_and(|deadline| now >= deadline) {
            let waiting = self.state.waiting();
            self.state = State::Failed;
            self.deadline = None;
            return Err(SessionError::Timeout { waiting, timeout: self.setup.timeout });
        }
        Ok(())
    }

    /// What the next received packet says; `None` if more bytes are needed.
    pub fn next_event(&mut self, now: Duration) -> Result<Option<Event<'_>>, SessionError> {
        if self.state == State::Failed {
            return Err(SessionError::Failed);
        }
        let state = std::mem::replace(&mut self.state, State::Failed);
        // Data first: nothing else comes 500 times a second.
        let packet = match self.framer.next_frame()? {
            None => {
                self.state = state;
                return Ok(None);
            }
            Some(frame) => ServerPacket::decode(self.version, frame)?,
        };
        let (next, event) = match (state, packet) {
            (_, ServerPacket::Text(text)) => (state, Event::Text(text)),
            (State::Starting | State::Running, ServerPacket::Data { recipe, values }) => {
                if recipe != self.outputs.id() {
                    return Err(SessionError::RecipeId { got: recipe, want: self.outputs.id() });
                }
                self.deadline = None;
                (State::Running, Event::Data(self.outputs.record(values)?))
            }
            (State::Pausing, ServerPacket::Data { .. }) => (state, Event::LateData),
            (State::Version, ServerPacket::VersionAccepted(accepted)) => {
                if !accepted {
                    return Err(SessionError::Version);
                }
                self.version = Version::V2;
                (State::Controller, Event::Negotiated)
            }
            (State::Controller, ServerPacket::ControllerVersion(version)) => {
                self.controller = version;
                (State::Outputs, Event::Controller(version))
            }
            (State::Outputs, ServerPacket::OutputRecipe { recipe, types }) => {
                self.outputs = Recipe::granted(recipe, &self.setup.outputs, &types)?;
                let next =
                    if self.setup.inputs.is_empty() { State::Starting } else { State::Inputs(0) };
                (next, Event::OutputsGranted)
            }
            (State::Inputs(n), ServerPacket::InputRecipe { recipe, types }) => {
                self.inputs.push(Recipe::granted(recipe, &self.setup.inputs[n], &types)?);
                let last = n + 1 == self.setup.inputs.len();
                (if last { State::Starting } else { State::Inputs(n + 1) }, Event::InputsGranted(n))
            }
            (State::Starting, ServerPacket::Started(accepted)) => {
                if !accepted {
                    return Err(SessionError::StartRefused);
                }
                self.start_confirmed = true;
                (State::Running, Event::Started)
            }
            // The first data may overtake the answer to start.
            (State::Running, ServerPacket::Started(true)) if !self.start_confirmed => {
                self.start_confirmed = true;
                (State::Running, Event::Started)
            }
            (State::Pausing, ServerPacket::Paused(accepted)) => {
                if !accepted {
                    return Err(SessionError::PauseRefused);
                }
                (State::Paused, Event::Paused)
            }
            (_, other) => {
                return Err(SessionError::Unexpected {
                    got: name(&other),
                    waiting: state.waiting(),
                });
            }
        };
        self.state = next;
        if next != state && !matches!(next, State::Running) {
            let sending = Sending {
                outgoing: &mut self.outgoing,
                deadline: &mut self.deadline,
                version: self.version,
                setup: &self.setup,
            };
            if let Err(error) = sending.ask(next, now) {
                self.state = State::Failed;
                return Err(error);
            }
        } else if matches!(next, State::Running) {
            self.deadline = None;
        }
        Ok(Some(event))
    }

    /// Puts values of an input recipe on their way. `Ok(false)`: bytes of an earlier packet still wait to
    /// be sent, this packet is dropped.
    pub fn write(&mut self, recipe: usize, values: &[Value]) -> Result<bool, SessionError> {
        let Some(inputs) = self.inputs.get(recipe) else {
            return Err(SessionError::Values(recipe));
        };
        let fits = inputs.fields().len() == values.len()
            && inputs.fields().iter().zip(values).all(|(f, v)| f.data_type == v.data_type());
        if !fits {
            return Err(SessionError::Values(recipe));
        }
        if !self.outgoing().is_empty() {
            return Ok(false);
        }
        self.scratch.clear();
        for value in values {
            value.write(&mut self.scratch);
        }
        ClientPacket::Data { recipe: inputs.id(), values: &self.scratch }
            .encode(self.version, &mut self.outgoing)?;
        Ok(true)
    }

    /// Asks for silence. Data packets under way still arrive as [`Event::LateData`].
    pub fn pause(&mut self, now: Duration) -> Result<(), SessionError> {
        match self.state {
            State::Running => self.ask(State::Pausing, now),
            _ => Err(self.misuse("data")),
        }
    }

    /// Asks for data again after a pause.
    pub fn resume(&mut self, now: Duration) -> Result<(), SessionError> {
        match self.state {
            State::Paused => {
                self.start_confirmed = false;
                self.ask(State::Starting, now)
            }
            _ => Err(self.misuse("a pause")),
        }
    }

    fn misuse(&self, waiting: &'static str) -> SessionError {
        SessionError::Unexpected { got: self.state.waiting(), waiting }
    }

    fn ask(&mut self, state: State, now: Duration) -> Result<(), SessionError> {
        self.state = state;
        Sending {
            outgoing: &mut self.outgoing,
            deadline: &mut self.deadline,
            version: self.version,
            setup: &self.setup,
        }
        .ask(state, now)
    }
}

/// The parts of a session that sending a request needs, while an event still borrows the others.
struct Sending<'a> {
    outgoing: &'a mut Vec<u8>,
    deadline: &'a mut Option<Duration>,
    version: Version,
    setup: &'a Setup,
}

impl Sending<'_> {
    /// Sends the request whose answer `state` waits for.
    fn ask(self, state: State, now: Duration) -> Result<(), SessionError> {
        let borrowed = |names: &'_ [String]| -> Vec<Cow<'static, str>> {
            names.iter().map(|name| Cow::Owned(name.clone())).collect()
        };
        let request = match state {
            State::Version => ClientPacket::RequestVersion(Version::V2.number()),
            State::Controller => ClientPacket::ControllerVersion,
            State::Outputs => ClientPacket::SetupOutputs {
                frequency: self.setup.frequency,
                names: borrowed(&self.setup.outputs),
            },
            State::Inputs(n) => {
                ClientPacket::SetupInputs { names: borrowed(&self.setup.inputs[n]) }
            }
            State::Starting => ClientPacket::Start,
            State::Pausing => ClientPacket::Pause,
            State::Running | State::Paused | State::Failed => {
                *self.deadline = None;
                return Ok(());
            }
        };
        request.encode(self.version, self.outgoing)?;
        *self.deadline = Some(now + self.setup.timeout);
        Ok(())
    }
}

fn name(packet: &ServerPacket<'_>) -> &'static str {
    match packet {
        ServerPacket::VersionAccepted(_) => "an answer to the protocol version",
        ServerPacket::ControllerVersion(_) => "a controller version",
        ServerPacket::Text(_) => "a text",
        ServerPacket::Data { .. } => "data",
        ServerPacket::OutputRecipe { .. } => "an output recipe",
        ServerPacket::InputRecipe { .. } => "an input recipe",
        ServerPacket::Started(_) => "an answer to start",
        ServerPacket::Paused(_) => "an answer to pause",
    }
}
