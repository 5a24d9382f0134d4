//! One RTDE connection as the controller sees it: bytes in, bytes out.

use std::borrow::Cow;

use palpate_ur::proto::{
    ClientPacket, DataType, DecodeError, FrameError, Framer, Level, Recipe, ServerPacket, Text,
    VariableReply, Version,
};

use super::inputs::{Input, Masked};
use super::outputs::Output;
use crate::controller::{Controller, Severity};

/// Highest frequency of an e-Series, Hz.
const FREQUENCY_MAX: f64 = 500.0;
/// Input recipes that a connection may have; 0 is none.
const RECIPES_MAX: usize = 255;

/// The client broke the protocol: the controller closes the connection.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SessionFault {
    /// Bytes that are no packet.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A packet whose content does not fit its kind.
    #[error(transparent)]
    Decode(#[from] DecodeError),
}

/// One RTDE connection.
#[derive(Debug)]
pub struct ServerSession {
    framer: Framer,
    talk: Conversation,
}

/// What has been agreed.
#[derive(Debug)]
struct Conversation {
    client: u64,
    version: Version,
    outputs: Option<Outputs>,
    inputs: Vec<(Recipe, Vec<Input>)>,
    running: bool,
    only_version_1: bool,
    complained: bool,
    values: Vec<u8>,
}

#[derive(Debug)]
struct Outputs {
    variables: Vec<Output>,
    /// A data packet in every so many cycles.
    every: u64,
}

impl ServerSession {
    /// A fresh connection of a client whose number no other has; 0 is taken.
    pub fn new(client: u64) -> Self {
        let talk = Conversation {
            client,
            version: Version::V1,
            outputs: None,
            inputs: Vec::new(),
            running: false,
            only_version_1: false,
            complained: false,
            values: Vec::new(),
        };
        Self { framer: Framer::new(), talk }
    }

    /// Refuses protocol version 2 from now on, as an old controller does.
    pub fn speak_version_1(&mut self) {
        self.talk.only_version_1 = true;
    }

    /// Whether data packets are being sent.
    pub fn is_running(&self) -> bool {
        self.talk.running
    }

    /// Takes what the client sent; appends the answers to `out`.
    ///
    /// # Errors
    /// The client does not speak RTDE: close the connection.
    pub fn receive(
        &mut self,
        mut bytes: &[u8],
        controller: &mut Controller,
        out: &mut Vec<u8>,
    ) -> Result<(), SessionFault> {
        while !bytes.is_empty() {
            let taken = self.framer.push(bytes);
            bytes = &bytes[taken..];
            while let Some(frame) = self.framer.next_frame()? {
                let packet = ClientPacket::decode(self.talk.version, frame)?;
                self.talk.handle(packet, controller, out);
            }
        }
        Ok(())
    }

    /// Appends this cycle's data packet, if the client wants one; says whether it did.
    pub fn data(&mut self, controller: &Controller, out: &mut Vec<u8>) -> bool {
        self.talk.data(controller, out)
    }

    /// Appends a text for the client.
    pub fn text(&self, message: &str, out: &mut Vec<u8>) {
        let mut end = message.len().min(255);
        while !message.is_char_boundary(end) {
            end -= 1;
        }
        let text = Text {
            message: message[..end].into(),
            source: "controller".into(),
            level: Level::Warning,
        };
        self.talk.send(&ServerPacket::Text(text), out);
    }

    /// The connection is over: its inputs are free again.
    pub fn close(&mut self, controller: &mut Controller) {
        controller.registers.release(self.talk.client);
    }
}

impl Conversation {
    fn handle(&mut self, packet: ClientPacket<'_>, controller: &mut Controller, out: &mut Vec<u8>) {
        let reply = match packet {
            ClientPacket::RequestVersion(version) => {
                let accepted = match version {
                    1 => Some(Version::V1),
                    2 if !self.only_version_1 => Some(Version::V2),
                    _ => None,
                };
                self.version = accepted.unwrap_or(self.version);
                ServerPacket::VersionAccepted(accepted.is_some())
            }
            ClientPacket::ControllerVersion => {
                ServerPacket::ControllerVersion(controller.config.version)
            }
            ClientPacket::Text(text) => {
                return controller.note(
                    Severity::Info,
                    format!("RTDE client {}: {}", text.source, text.message),
                );
            }
            ClientPacket::Data { recipe, values } => {
                return self.take_inputs(recipe, values, controller, out);
            }
            ClientPacket::SetupOutputs { frequency, names } => {
                self.set_up_outputs(frequency, &names)
            }
            ClientPacket::SetupInputs { names } => self.set_up_inputs(&names, controller),
            ClientPacket::Start => {
                self.running = self.outputs.is_some();
                ServerPacket::Started(self.running)
            }
            ClientPacket::Pause => {
                self.running = false;
                ServerPacket::Paused(true)
            }
        };
        self.send(&reply, out);
    }

    fn send(&self, packet: &ServerPacket<'_>, out: &mut Vec<u8>) {
        // The only reply that could outgrow a packet is to a request of the same size with longer names.
        _ = packet.encode(self.version, out);
    }

    fn set_up_outputs(&mut self, frequency: f64, names: &[Cow<'_, str>]) -> ServerPacket<'static> {
        // Version 1 has no frequency: always the highest.
        let frequency = if self.version == Version::V1 { FREQUENCY_MAX } else { frequency };
        let found: Vec<_> = names.iter().map(|name| Output::named(name)).collect();
        let types = found
            .iter()
            .map(|o| o.map_or(VariableReply::NotFound, |o| VariableReply::Type(o.data_type())))
            .collect();
        let variables: Option<Vec<_>> = found.into_iter().collect();
        let fits = frequency > 0.0 && frequency <= FREQUENCY_MAX && !names.is_empty();
        self.outputs = variables.filter(|_| fits).map(|variables| Outputs {
            variables,
            every: (FREQUENCY_MAX / frequency).floor() as u64,
        });
        self.running &= self.outputs.is_some();
        ServerPacket::OutputRecipe { recipe: u8::from(self.outputs.is_some()), types }
    }

    fn set_up_inputs(
        &mut self,
        names: &[Cow<'_, str>],
        controller: &mut Controller,
    ) -> ServerPacket<'static> {
        let free = |name: &str| controller.registers.is_free_for(name, self.client);
        let types: Vec<_> = names
            .iter()
            .map(|name| match Input::named(name) {
                None => VariableReply::NotFound,
                Some(_) if !free(name) => VariableReply::InUse,
                Some(input) => VariableReply::Type(input.data_type()),
            })
            .collect();
        let inputs: Option<Vec<_>> = names.iter().map(|name| Input::named(name)).collect();
        let granted = types.iter().all(|t| matches!(t, VariableReply::Type(_)));
        let id = u8::try_from(self.inputs.len() + 1).ok();
        let recipe = match (inputs, id) {
            (Some(inputs), Some(id))
                if granted && !names.is_empty() && usize::from(id) <= RECIPES_MAX =>
            {
                let typed: Vec<(&str, DataType)> =
                    names.iter().zip(&inputs).map(|(n, i)| (n.as_ref(), i.data_type())).collect();
                for name in names {
                    controller.registers.claim(name, self.client);
                }
                self.inputs.push((Recipe::new(id, typed), inputs));
                id
            }
            _ => 0,
        };
        ServerPacket::InputRecipe { recipe, types }
    }

    /// One input packet is applied as a whole, in the cycle in which it came.
    fn take_inputs(
        &mut self,
        id: u8,
        values: &[u8],
        controller: &mut Controller,
        out: &mut Vec<u8>,
    ) {
        let recipe = usize::from(id).checked_sub(1).and_then(|i| self.inputs.get(i));
        let problem = match recipe.map(|(recipe, inputs)| (recipe.record(values), inputs)) {
            None => format!("no input recipe {id}"),
            Some((Err(error), _)) => error.to_string(),
            Some((Ok(record), inputs)) => {
                let mut masked = Masked::default();
                let now = controller.tick;
                for (position, (input, field)) in
                    inputs.iter().zip(record.recipe().fields()).enumerate()
                {
                    controller.write_input(*input, record.value(position), &mut masked);
                    controller.registers.touch(&field.name, now);
                }
                controller.apply_masked(&masked);
                return;
            }
        };
        if !std::mem::replace(&mut self.complained, true) {
            let text = Text { message: problem.into(), source: "RTDE".into(), level: Level::Error };
            self.send(&ServerPacket::Text(text), out);
        }
    }

    fn data(&mut self, controller: &Controller, out: &mut Vec<u8>) -> bool {
        let Some(outputs) = &self.outputs else { return false };
        if !self.running || !controller.tick.is_multiple_of(outputs.every) {
            return false;
        }
        let mut values = std::mem::take(&mut self.values);
        values.clear();
        for variable in &outputs.variables {
            variable.value(controller).write(&mut values);
        }
        self.send(&ServerPacket::Data { recipe: 1, values: &values }, out);
        self.values = values;
        true
    }
}
