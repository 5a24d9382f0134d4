//! Cutting a TCP stream into packets, however TCP cut it before.

/// Bytes of the header: `u16` total size, `u8` kind.
pub const HEADER: usize = 3;
/// The largest packet the header can announce, header included.
pub const MAX_PACKET: usize = u16::MAX as usize;

/// What a packet is: the third byte of its header. The letters are the protocol's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// `V`: which protocol version to speak.
    ProtocolVersion,
    /// `v`: which software the controller runs.
    ControllerVersion,
    /// `M`: a text for a person.
    Text,
    /// `U`: values of a recipe.
    Data,
    /// `O`: what the controller shall send.
    SetupOutputs,
    /// `I`: what the client will send.
    SetupInputs,
    /// `S`: start sending.
    Start,
    /// `P`: stop sending.
    Pause,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 8] = [
        Self::ProtocolVersion,
        Self::ControllerVersion,
        Self::Text,
        Self::Data,
        Self::SetupOutputs,
        Self::SetupInputs,
        Self::Start,
        Self::Pause,
    ];

    /// The byte on the wire.
    pub const fn byte(self) -> u8 {
        match self {
            Self::ProtocolVersion => b'V',
            Self::ControllerVersion => b'v',
            Self::Text => b'M',
            Self::Data => b'U',
            Self::SetupOutputs => b'O',
            Self::SetupInputs => b'I',
            Self::Start => b'S',
            Self::Pause => b'P',
        }
    }

    /// The kind of a byte on the wire.
    pub fn from_byte(byte: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.byte() == byte)
    }
}

/// One whole packet, still in the receive buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// What it is.
    pub kind: Kind,
    /// What follows the header.
    pub payload: &'a [u8],
}

/// The stream is not RTDE (any more). There is no way to find the next packet: close the connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// A size that does not even cover the header.
    #[error(
        "a packet announces {size} bytes, fewer than its header of 3: the stream is out of step, reconnect"
    )]
    Size {
        /// The size field.
        size: u16,
    },
    /// A kind that RTDE does not have.
    #[error(
        "a packet of {size} bytes has the unknown kind {kind:#04x}: is the other end an RTDE server (port 30004)?"
    )]
    Kind {
        /// The kind byte.
        kind: u8,
        /// The size field.
        size: u16,
    },
}

/// A receive buffer of fixed size that yields whole packets.
///
/// The same bytes give the same frames in the same order however they are split or merged. A packet
/// that cannot be RTDE is reported as soon as its header is there, without waiting for the length it
/// claims; after that the framer repeats the error for ever.
///
/// ```
/// use palpate_ur::proto::{Framer, Kind};
///
/// let mut framer = Framer::new();
/// for byte in [0, 4, b'S', 1, 0, 3] {
///     framer.push(&[byte]); // one byte at a time, and the start of another packet
/// }
/// let frame = framer.next_frame()?.expect("whole");
/// assert_eq!((frame.kind, frame.payload), (Kind::Start, &[1][..]));
/// assert_eq!(framer.next_frame()?, None);
/// # Ok::<(), palpate_ur::proto::FrameError>(())
/// ```
#[derive(Debug)]
pub struct Framer {
    buffer: Box<[u8]>,
    start: usize,
    end: usize,
    broken: Option<FrameError>,
}

impl Default for Framer {
    fn default() -> Self {
        Self::new()
    }
}

impl Framer {
    /// Twice the largest packet: one may be incomplete while a whole one is still behind it.
    const CAPACITY: usize = 2 * MAX_PACKET;

    /// An empty buffer. The only allocation of its life.
    pub fn new() -> Self {
        Self { buffer: vec![0; Self::CAPACITY].into_boxed_slice(), start: 0, end: 0, broken: None }
    }

    /// Where to read to. At least one packet's length is free once all frames have been taken;
    /// empty only while frames wait to be taken.
    pub fn space(&mut self) -> &mut [u8] {
        if self.start == self.end {
            (self.start, self.end) = (0, 0);
        } else if Self::CAPACITY - self.end < MAX_PACKET {
            self.buffer.copy_within(self.start..self.end, 0);
            (self.start, self.end) = (0, self.end - self.start);
        }
        &mut self.buffer[self.end..]
    }

    /// Says that the first `n` bytes of [`space`](Self::space) were read. More than was free counts
    /// as all of it.
    pub fn filled(&mut self, n: usize) {
        self.end = (self.end + n).min(Self::CAPACITY);
    }

    /// Copies from `bytes` what fits and says how much that was.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        let space = self.space();
        let n = space.len().min(bytes.len());
        space[..n].copy_from_slice(&bytes[..n]);
        self.filled(n);
        n
    }

    /// Forgets all bytes and a broken stream: for the next connection.
    pub fn clear(&mut self) {
        (self.start, self.end, self.broken) = (0, 0, None);
    }

    /// Bytes of a packet that is not complete yet.
    pub fn pending(&self) -> usize {
        self.end - self.start
    }

    /// The next whole packet, `None` if more bytes are needed.
    pub fn next_frame(&mut self) -> Result<Option<Frame<'_>>, FrameError> {
        if let Some(error) = self.broken {
            return Err(error);
        }
        let unread = &self.buffer[self.start..self.end];
        let Some(&[high, low]) = unread.first_chunk() else { return Ok(None) };
        let size = u16::from_be_bytes([high, low]);
        if usize::from(size) < HEADER {
            return Err(*self.broken.insert(FrameError::Size { size }));
        }
        let Some(&kind) = unread.get(2) else { return Ok(None) };
        let Some(kind) = Kind::from_byte(kind) else {
            return Err(*self.broken.insert(FrameError::Kind { kind, size }));
        };
        let Some(packet) = unread.get(..usize::from(size)) else { return Ok(None) };
        self.start += packet.len();
        Ok(Some(Frame { kind, payload: &packet[HEADER..] }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_size_with_every_kind_is_a_frame_an_error_or_a_wait() {
        let body = [0; 16];
        for size in 0..=u16::MAX {
            for kind in 0..=u8::MAX {
                // The buffer is costly to make: one framer per size for the kinds that are errors.
                if !(Kind::from_byte(kind).is_some() || size % 257 == 0) {
                    continue;
                }
                let mut framer = Framer {
                    buffer: vec![0; 0].into_boxed_slice(),
                    start: 0,
                    end: 0,
                    broken: None,
                };
                let mut bytes = size.to_be_bytes().to_vec();
                bytes.push(kind);
                bytes.extend(body);
                framer.end = bytes.len();
                framer.buffer = bytes.into_boxed_slice();
                let whole = usize::from(size) <= HEADER + body.len();
                match framer.next_frame() {
                    Err(FrameError::Size { .. }) => assert!(size < 3),
                    Err(FrameError::Kind { .. }) => assert!(Kind::from_byte(kind).is_none()),
                    Ok(None) => assert!(!whole && Kind::from_byte(kind).is_some()),
                    Ok(Some(frame)) => {
                        assert!(whole);
                        assert_eq!(frame.payload.len(), usize::from(size) - HEADER);
                    }
                }
            }
        }
    }

    #[test]
    fn the_largest_packet_passes_behind_an_incomplete_one() {
        let mut framer = Framer::new();
        let mut packet = u16::MAX.to_be_bytes().to_vec();
        packet.push(Kind::Data.byte());
        packet.resize(MAX_PACKET, 7);
        for _ in 0..5 {
            let mut left = &packet[..];
            while !left.is_empty() {
                let n = framer.push(&left[..left.len().min(40_000)]);
                left = &left[n..];
            }
            assert_eq!(framer.next_frame().unwrap().unwrap().payload.len(), MAX_PACKET - HEADER);
            framer.push(&packet[..2]);
            framer.push(&packet[2..60_000]);
            framer.push(&packet[60_000..]);
            assert_eq!(framer.next_frame().unwrap().unwrap().payload.len(), MAX_PACKET - HEADER);
            assert_eq!(framer.pending(), 0);
        }
    }

    #[test]
    fn an_error_stays() {
        let mut framer = Framer::new();
        framer.push(b"HTTP/1.1 400 Bad Request");
        for _ in 0..2 {
            let error = framer.next_frame().unwrap_err();
            assert!(error.to_string().contains("30004"), "{error}");
            framer.push(&[0, 3, b'S']);
        }
    }
}
