//! What packets are made of, and what can be wrong with one.

use std::borrow::Cow;

use super::frame::Kind;
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

/// u8 length, message, u8 length, source, level.
pub(super) fn long_text<'a>(r: &mut Reader<'a>) -> Result<Text<'a>, Short> {
    let mut part = || -> Result<Cow<'a, str>, Short> {
        let length = r.u8()?;
        Ok(String::from_utf8_lossy(r.bytes(length.into())?))
    };
    let (message, source) = (part()?, part()?);
    Ok(Text { message, source, level: r.u8()?.into() })
}

pub(super) fn put_long_text(text: &Text<'_>, out: &mut Vec<u8>) -> Result<(), EncodeError> {
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
