//! Packets of both directions, decoded from frames and encoded to bytes.

use std::borrow::Cow;

use super::frame::{Frame, HEADER, Kind, MAX_PACKET};
use super::value::VariableReply;
use super::wire::{Reader, Short};

/// Which layout of the packets is spoken. A connection starts in V1 until the controller accepts V2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Version {
    /// Outputs have no frequency and no recipe id.
    #[default]
    V1,
    /// What this crate's client speaks.
    V2,
}

impl Version {
    /// The number on the wire.
    pub const fn number(self) -> u16 {
        match self {
            Self::V1 => 1,
            Self::V2 => 2,
        }
    }
}

/// How much a text matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// 0.
    Exception,
    /// 1.
    Error,
    /// 2.
    Warning,
    /// 3.
    Info,
    /// A level this crate does not know.
    Unknown(u8),
}

impl From<u8> for Level {
    fn from(byte: u8) -> Self {
        match byte {
            0 => Self::Exception,
            1 => Self::Error,
            2 => Self::Warning,
            3 => Self::Info,
            other => Self::Unknown(other),
        }
    }
}

impl From<Level> for u8 {
    fn from(level: Level) -> Self {
        match level {
            Level::Exception => 0,
            Level::Error => 1,
            Level::Warning => 2,
            Level::Info => 3,
            Level::Unknown(other) => other,
        }
    }
}

/// A text for a person, from either side, at any time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Text<'a> {
    /// What is said.
    pub message: Cow<'a, str>,
    /// Who says it; empty in version 1 from the controller.
    pub source: Cow<'a, str>,
    /// How much it matters.
    pub level: Level,
}

/// Software of a controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "the usual four parts")]
pub struct ControllerVersion {
    pub major: u32,
    pub minor: u32,
    pub bugfix: u32,
    pub build: u32,
}

impl std::fmt::Display for ControllerVersion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}.{}.{}", self.major, self.minor, self.bugfix, self.build)
    }
}

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

/// A frame whose payload does not fit its kind.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// Fewer bytes than the layout needs.
    #[error("a {kind:?} packet of {size} bytes ends too early")]
    Short {
        /// What it was.
        kind: Kind,
        /// Its total size.
        size: usize,
    },
    /// More bytes than the layout needs.
    #[error("a {kind:?} packet of {size} bytes has {extra} bytes too many")]
    Trailing {
        /// What it was.
        kind: Kind,
        /// Its total size.
        size: usize,
        /// What was left.
        extra: usize,
    },
    /// A type name that RTDE does not have.
    #[error("the controller answers a recipe with the unknown type {0:?}")]
    UnknownType(String),
}

/// A packet that cannot be put on the wire.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a {kind:?} packet would need {size} bytes where {limit} fit")]
pub struct EncodeError {
    /// What it was.
    pub kind: Kind,
    /// Bytes needed, of the packet or of a text in it.
    pub size: usize,
    /// Bytes that fit.
    pub limit: usize,
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

/// u8 length, message, u8 length, source, level.
fn long_text<'a>(r: &mut Reader<'a>) -> Result<Text<'a>, Short> {
    let mut part = || -> Result<Cow<'a, str>, Short> {
        let length = r.u8()?;
        Ok(String::from_utf8_lossy(r.bytes(length.into())?))
    };
    let (message, source) = (part()?, part()?);
    Ok(Text { message, source, level: r.u8()?.into() })
}

fn put_long_text(text: &Text<'_>, out: &mut Vec<u8>) -> Result<(), EncodeError> {
    for part in [&text.message, &text.source] {
        let size = part.len();
        let length = u8::try_from(size).or(Err(EncodeError {
            kind: Kind::Text,
            size,
            limit: usize::from(u8::MAX),
        }))?;
        out.push(length);
        out.extend_from_slice(part.as_bytes());
    }
    out.push(text.level.into());
    Ok(())
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
