//! Packets of both directions, decoded from frames and encoded to bytes.

use std::borrow::Cow;

use super::frame::{Frame, HEADER, Kind, MAX_PACKET};
use super::message::{
    ControllerVersion, DecodeError, EncodeError, Text, Version, long_text, put_long_text,
};
use super::value::VariableReply;
use super::wire::{Reader, Short};

/// From a client to the controller.
#[derive(Clone, Debug, PartialEq)]
pub enum ClientPacket<'a> {
    /// Asks to speak this protocol version.
    RequestVersion(u16),
    /// Asks for the controller's software version.
    ControllerVersion,
    /// A text for the controller's log.
    Text(Text<'a>),
    /// Values for an input recipe.
    Data {
        /// The id that the setup's reply gave.
        recipe: u8,
        /// Values back to back; see [`Recipe`](super::Recipe).
        values: &'a [u8],
    },
    /// Asks for these outputs.
    SetupOutputs {
        /// Hz. In version 1 not on the wire, then NaN here.
        frequency: f64,
        /// Variables, in the order in which values will be sent.
        names: Vec<Cow<'a, str>>,
    },
    /// Announces inputs.
    SetupInputs {
        /// Variables, in the order in which values will be sent.
        names: Vec<Cow<'a, str>>,
    },
    /// Asks for data.
    Start,
    /// Asks for silence.
    Pause,
}

/// From the controller to a client.
#[derive(Clone, Debug, PartialEq)]
pub enum ServerPacket<'a> {
    /// Whether the version asked for will be spoken.
    VersionAccepted(bool),
    /// The controller's software.
    ControllerVersion(ControllerVersion),
    /// A text for the client.
    Text(Text<'a>),
    /// Values of the output recipe.
    Data {
        /// The recipe's id; 0 in version 1, which has none.
        recipe: u8,
        /// Values back to back; see [`Recipe`](super::Recipe).
        values: &'a [u8],
    },
    /// The answer to `SetupOutputs`.
    OutputRecipe {
        /// 0 if refused; 1 in version 1, which has none.
        recipe: u8,
        /// One per name, in order.
        types: Vec<VariableReply>,
    },
    /// The answer to `SetupInputs`.
    InputRecipe {
        /// 0 if refused.
        recipe: u8,
        /// One per name, in order.
        types: Vec<VariableReply>,
    },
    /// Whether data will come.
    Started(bool),
    /// Whether data has stopped.
    Paused(bool),
}

impl<'a> ClientPacket<'a> {
    /// Reads a frame that a client sent.
    pub fn decode(version: Version, frame: Frame<'a>) -> Result<Self, DecodeError> {
        let mut r = Reader::new(frame.payload);
        let short = |Short| DecodeError::short(frame);
        let packet = match frame.kind {
            Kind::ProtocolVersion => Self::RequestVersion(r.u16().map_err(short)?),
            Kind::ControllerVersion => Self::ControllerVersion,
            Kind::Text => Self::Text(long_text(&mut r).map_err(short)?),
            Kind::Data => Self::Data { recipe: r.u8().map_err(short)?, values: r.rest() },
            Kind::SetupOutputs => Self::SetupOutputs {
                frequency: match version {
                    Version::V1 => f64::NAN,
                    Version::V2 => r.f64().map_err(short)?,
                },
                names: names(r.rest()),
            },
            Kind::SetupInputs => Self::SetupInputs { names: names(r.rest()) },
            Kind::Start => Self::Start,
            Kind::Pause => Self::Pause,
        };
        ended(frame, &r).map(|()| packet)
    }

    /// Appends the packet's bytes to `out`. After an error `out` is as it was.
    pub fn encode(&self, version: Version, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        let kind = match self {
            Self::RequestVersion(_) => Kind::ProtocolVersion,
            Self::ControllerVersion => Kind::ControllerVersion,
            Self::Text(_) => Kind::Text,
            Self::Data { .. } => Kind::Data,
            Self::SetupOutputs { .. } => Kind::SetupOutputs,
            Self::SetupInputs { .. } => Kind::SetupInputs,
            Self::Start => Kind::Start,
            Self::Pause => Kind::Pause,
        };
        packet(kind, out, |out| {
            match self {
                Self::RequestVersion(n) => out.extend_from_slice(&n.to_be_bytes()),
                Self::Text(text) => put_long_text(text, out)?,
                Self::Data { recipe, values } => {
                    out.push(*recipe);
                    out.extend_from_slice(values);
                }
                Self::SetupOutputs { frequency, names } => {
                    if version == Version::V2 {
                        out.extend_from_slice(&frequency.to_be_bytes());
                    }
                    put_list(names.iter().map(AsRef::as_ref), out);
                }
                Self::SetupInputs { names } => put_list(names.iter().map(AsRef::as_ref), out),
                Self::ControllerVersion | Self::Start | Self::Pause => {}
            }
            Ok(())
        })
    }
}

impl<'a> ServerPacket<'a> {
    /// Reads a frame that a controller sent. Takes nothing from the heap for data.
    pub fn decode(version: Version, frame: Frame<'a>) -> Result<Self, DecodeError> {
        let mut r = Reader::new(frame.payload);
        let short = |Short| DecodeError::short(frame);
        let accepted = |r: &mut Reader<'_>| r.u8().map(|b| b != 0).map_err(short);
        let packet = match frame.kind {
            Kind::ProtocolVersion => Self::VersionAccepted(accepted(&mut r)?),
            Kind::ControllerVersion => {
                let [major, minor, bugfix, build] = r.many(Reader::u32).map_err(short)?;
                Self::ControllerVersion(ControllerVersion { major, minor, bugfix, build })
            }
            Kind::Text => Self::Text(match version {
                Version::V1 => Text {
                    level: r.u8().map_err(short)?.into(),
                    message: String::from_utf8_lossy(r.rest()),
                    source: "".into(),
                },
                Version::V2 => long_text(&mut r).map_err(short)?,
            }),
            Kind::Data => Self::Data {
                recipe: match version {
                    Version::V1 => 0,
                    Version::V2 => r.u8().map_err(short)?,
                },
                values: r.rest(),
            },
            Kind::SetupOutputs => Self::OutputRecipe {
                recipe: match version {
                    Version::V1 => 1,
                    Version::V2 => r.u8().map_err(short)?,
                },
                types: types(r.rest())?,
            },
            Kind::SetupInputs => {
                Self::InputRecipe { recipe: r.u8().map_err(short)?, types: types(r.rest())? }
            }
            Kind::Start => Self::Started(accepted(&mut r)?),
            Kind::Pause => Self::Paused(accepted(&mut r)?),
        };
        ended(frame, &r).map(|()| packet)
    }

    /// Appends the packet's bytes to `out`. After an error `out` is as it was.
    pub fn encode(&self, version: Version, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        let kind = match self {
            Self::VersionAccepted(_) => Kind::ProtocolVersion,
            Self::ControllerVersion(_) => Kind::ControllerVersion,
            Self::Text(_) => Kind::Text,
            Self::Data { .. } => Kind::Data,
            Self::OutputRecipe { .. } => Kind::SetupOutputs,
            Self::InputRecipe { .. } => Kind::SetupInputs,
            Self::Started(_) => Kind::Start,
            Self::Paused(_) => Kind::Pause,
        };
        packet(kind, out, |out| {
            match self {
                Self::VersionAccepted(ok) | Self::Started(ok) | Self::Paused(ok) => {
                    out.push(u8::from(*ok));
                }
                Self::ControllerVersion(v) => {
                    for part in [v.major, v.minor, v.bugfix, v.build] {
                        out.extend_from_slice(&part.to_be_bytes());
                    }
                }
                Self::Text(text) => match version {
                    Version::V1 => {
                        out.push(text.level.into());
                        out.extend_from_slice(text.message.as_bytes());
                    }
                    Version::V2 => put_long_text(text, out)?,
                },
                Self::Data { recipe, values } => {
                    if version == Version::V2 {
                        out.push(*recipe);
                    }
                    out.extend_from_slice(values);
                }
                Self::OutputRecipe { recipe, types } => {
                    if version == Version::V2 {
                        out.push(*recipe);
                    }
                    put_list(types.iter().map(|t| t.word()), out);
                }
                Self::InputRecipe { recipe, types } => {
                    out.push(*recipe);
                    put_list(types.iter().map(|t| t.word()), out);
                }
            }
            Ok(())
        })
    }
}

impl DecodeError {
    fn short(frame: Frame<'_>) -> Self {
        Self::Short { kind: frame.kind, size: HEADER + frame.payload.len() }
    }
}

fn ended(frame: Frame<'_>, r: &Reader<'_>) -> Result<(), DecodeError> {
    match r.left() {
        0 => Ok(()),
        extra => Err(DecodeError::Trailing {
            kind: frame.kind,
            size: HEADER + frame.payload.len(),
            extra,
        }),
    }
}

/// Comma-separated. Some clients end the list with a comma.
fn list(bytes: &[u8]) -> impl Iterator<Item = Cow<'_, str>> {
    let bytes = bytes.strip_suffix(b",").unwrap_or(bytes);
    let count = if bytes.is_empty() { 0 } else { usize::MAX };
    bytes.split(|b| *b == b',').take(count).map(String::from_utf8_lossy)
}

fn names(bytes: &[u8]) -> Vec<Cow<'_, str>> {
    list(bytes).collect()
}

fn types(bytes: &[u8]) -> Result<Vec<VariableReply>, DecodeError> {
    list(bytes)
        .map(|word| {
            VariableReply::from_word(&word)
                .ok_or_else(|| DecodeError::UnknownType(word.into_owned()))
        })
        .collect()
}

fn put_list<'a>(items: impl Iterator<Item = &'a str>, out: &mut Vec<u8>) {
    for (n, item) in items.enumerate() {
        if n > 0 {
            out.push(b',');
        }
        out.extend_from_slice(item.as_bytes());
    }
}

/// Header and body, the size filled in afterwards.
fn packet(
    kind: Kind,
    out: &mut Vec<u8>,
    body: impl FnOnce(&mut Vec<u8>) -> Result<(), EncodeError>,
) -> Result<(), EncodeError> {
    let start = out.len();
    out.extend_from_slice(&[0, 0, kind.byte()]);
    let result = body(out).and_then(|()| {
        let size = out.len() - start;
        u16::try_from(size).or(Err(EncodeError { kind, size, limit: MAX_PACKET }))
    });
    match result {
        Ok(size) => out[start..start + 2].copy_from_slice(&size.to_be_bytes()),
        Err(_) => out.truncate(start),
    }
    result.map(|_| ())
}
