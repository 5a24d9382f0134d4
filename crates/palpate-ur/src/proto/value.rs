//! The ten types of RTDE variables and their values.

use super::wire::{Reader, Short};

/// The type of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DataType {
    /// One byte; 0 is false, anything else true.
    Bool,
    /// Unsigned, 8 bits.
    Uint8,
    /// Unsigned, 32 bits.
    Uint32,
    /// Unsigned, 64 bits.
    Uint64,
    /// Signed, 32 bits.
    Int32,
    /// IEEE 754, 64 bits.
    Double,
    /// Three doubles.
    Vector3d,
    /// Six doubles.
    Vector6d,
    /// Six signed 32-bit numbers.
    Vector6Int32,
    /// Six unsigned 32-bit numbers.
    Vector6Uint32,
}

impl DataType {
    /// All types.
    pub const ALL: [Self; 10] = [
        Self::Bool,
        Self::Uint8,
        Self::Uint32,
        Self::Uint64,
        Self::Int32,
        Self::Double,
        Self::Vector3d,
        Self::Vector6d,
        Self::Vector6Int32,
        Self::Vector6Uint32,
    ];

    /// The name on the wire.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bool => "BOOL",
            Self::Uint8 => "UINT8",
            Self::Uint32 => "UINT32",
            Self::Uint64 => "UINT64",
            Self::Int32 => "INT32",
            Self::Double => "DOUBLE",
            Self::Vector3d => "VECTOR3D",
            Self::Vector6d => "VECTOR6D",
            Self::Vector6Int32 => "VECTOR6INT32",
            Self::Vector6Uint32 => "VECTOR6UINT32",
        }
    }

    /// Bytes on the wire.
    pub const fn size(self) -> usize {
        match self {
            Self::Bool | Self::Uint8 => 1,
            Self::Uint32 | Self::Int32 => 4,
            Self::Uint64 | Self::Double => 8,
            Self::Vector3d | Self::Vector6Int32 | Self::Vector6Uint32 => 24,
            Self::Vector6d => 48,
        }
    }

    /// The type of a name on the wire.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// The value that registers hold before anyone writes them.
    pub const fn zero(self) -> Value {
        match self {
            Self::Bool => Value::Bool(false),
            Self::Uint8 => Value::Uint8(0),
            Self::Uint32 => Value::Uint32(0),
            Self::Uint64 => Value::Uint64(0),
            Self::Int32 => Value::Int32(0),
            Self::Double => Value::Double(0.0),
            Self::Vector3d => Value::Vector3d([0.0; 3]),
            Self::Vector6d => Value::Vector6d([0.0; 6]),
            Self::Vector6Int32 => Value::Vector6Int32([0; 6]),
            Self::Vector6Uint32 => Value::Vector6Uint32([0; 6]),
        }
    }
}

/// A value with its type.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the variants are those of DataType")]
pub enum Value {
    Bool(bool),
    Uint8(u8),
    Uint32(u32),
    Uint64(u64),
    Int32(i32),
    Double(f64),
    Vector3d([f64; 3]),
    Vector6d([f64; 6]),
    Vector6Int32([i32; 6]),
    Vector6Uint32([u32; 6]),
}

impl Value {
    /// Its type.
    pub const fn data_type(&self) -> DataType {
        match self {
            Self::Bool(_) => DataType::Bool,
            Self::Uint8(_) => DataType::Uint8,
            Self::Uint32(_) => DataType::Uint32,
            Self::Uint64(_) => DataType::Uint64,
            Self::Int32(_) => DataType::Int32,
            Self::Double(_) => DataType::Double,
            Self::Vector3d(_) => DataType::Vector3d,
            Self::Vector6d(_) => DataType::Vector6d,
            Self::Vector6Int32(_) => DataType::Vector6Int32,
            Self::Vector6Uint32(_) => DataType::Vector6Uint32,
        }
    }

    /// Appends the value's bytes.
    pub fn write(&self, out: &mut Vec<u8>) {
        match self {
            Self::Bool(b) => out.push(u8::from(*b)),
            Self::Uint8(n) => out.push(*n),
            Self::Uint32(n) => out.extend_from_slice(&n.to_be_bytes()),
            Self::Uint64(n) => out.extend_from_slice(&n.to_be_bytes()),
            Self::Int32(n) => out.extend_from_slice(&n.to_be_bytes()),
            Self::Double(x) => out.extend_from_slice(&x.to_be_bytes()),
            Self::Vector3d(v) => extend(out, v.map(f64::to_be_bytes)),
            Self::Vector6d(v) => extend(out, v.map(f64::to_be_bytes)),
            Self::Vector6Int32(v) => extend(out, v.map(i32::to_be_bytes)),
            Self::Vector6Uint32(v) => extend(out, v.map(u32::to_be_bytes)),
        }
    }

    pub(crate) fn read(kind: DataType, reader: &mut Reader<'_>) -> Result<Self, Short> {
        Ok(match kind {
            DataType::Bool => Self::Bool(reader.u8()? != 0),
            DataType::Uint8 => Self::Uint8(reader.u8()?),
            DataType::Uint32 => Self::Uint32(reader.u32()?),
            DataType::Uint64 => Self::Uint64(reader.u64()?),
            DataType::Int32 => Self::Int32(reader.i32()?),
            DataType::Double => Self::Double(reader.f64()?),
            DataType::Vector3d => Self::Vector3d(reader.many(Reader::f64)?),
            DataType::Vector6d => Self::Vector6d(reader.many(Reader::f64)?),
            DataType::Vector6Int32 => Self::Vector6Int32(reader.many(Reader::i32)?),
            DataType::Vector6Uint32 => Self::Vector6Uint32(reader.many(Reader::u32)?),
        })
    }
}

fn extend<const N: usize, const M: usize>(out: &mut Vec<u8>, bytes: [[u8; M]; N]) {
    out.extend_from_slice(bytes.as_flattened());
}

/// What the controller says about one variable of a recipe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VariableReply {
    /// Granted, with this type.
    Type(DataType),
    /// `NOT_FOUND`: this controller has no variable of that name.
    NotFound,
    /// `IN_USE`: another client owns that input.
    InUse,
}

impl VariableReply {
    /// The word on the wire.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Type(kind) => kind.name(),
            Self::NotFound => "NOT_FOUND",
            Self::InUse => "IN_USE",
        }
    }

    /// The reply of a word on the wire.
    pub fn from_word(word: &str) -> Option<Self> {
        match word {
            "NOT_FOUND" => Some(Self::NotFound),
            "IN_USE" => Some(Self::InUse),
            _ => DataType::from_name(word).map(Self::Type),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_what_is_written() {
        for kind in DataType::ALL {
            let mut bytes = Vec::new();
            kind.zero().write(&mut bytes);
            assert_eq!(bytes.len(), kind.size(), "{kind:?}");
            assert_eq!(kind.zero().data_type(), kind);
            assert_eq!(DataType::from_name(kind.name()), Some(kind));
            assert_eq!(VariableReply::from_word(kind.name()), Some(VariableReply::Type(kind)));
        }
    }

    #[test]
    fn numbers_are_big_endian() {
        let mut bytes = Vec::new();
        Value::Uint32(0x0102_0304).write(&mut bytes);
        Value::Double(500.0).write(&mut bytes);
        assert_eq!(bytes, [1, 2, 3, 4, 0x40, 0x7f, 0x40, 0, 0, 0, 0, 0]);
    }
}
