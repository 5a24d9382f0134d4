//! Bytes on their way to a socket, late, split or merged if a fault asks for it.

use std::collections::VecDeque;
use std::io::{self, Write};

/// Bytes on their way out.
#[derive(Debug, Default)]
pub(super) struct Queue {
    /// When each may leave, and what; in order, since TCP keeps order.
    late: VecDeque<(u64, Vec<u8>)>,
    wire: Vec<u8>,
    written: usize,
    /// The socket took less than it was offered.
    blocked: bool,
}

impl Queue {
    /// Puts bytes in, to leave not before `due`.
    pub(super) fn push(&mut self, due: u64, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        let due = self.late.back().map_or(due, |(last, _)| due.max(*last));
        self.late.push_back((due, bytes.to_vec()));
    }

    /// Whether the client has not taken what left in earlier cycles.
    pub(super) fn is_blocked(&self) -> bool {
        self.blocked
    }

    pub(super) fn is_empty(&self) -> bool {
        self.late.is_empty() && self.wire.is_empty()
    }

    /// Writes what is due, but for the last `hold_back` bytes; says how many bytes went.
    pub(super) fn flush(
        &mut self,
        now: u64,
        hold_back: usize,
        socket: &mut impl Write,
    ) -> io::Result<usize> {
        while let Some((due, _)) = self.late.front()
            && *due <= now
        {
            if let Some((_, bytes)) = self.late.pop_front() {
                self.wire.extend_from_slice(&bytes);
            }
        }
        let end = self.wire.len().saturating_sub(hold_back).max(self.written);
        let begin = self.written;
        self.blocked = false;
        while self.written < end {
            match socket.write(&self.wire[self.written..end]) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(n) => self.written += n,
                Err(e) if e.kind() == io::ErrorKind::WouldBlock => {
                    self.blocked = true;
                    break;
                }
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(e),
            }
        }
        let count = self.written - begin;
        if self.written == self.wire.len() {
            self.wire.clear();
            self.written = 0;
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_is_kept_and_nothing_leaves_early() {
        let mut queue = Queue::default();
        queue.push(5, b"ab");
        queue.push(3, b"cd");
        let mut out = Vec::new();
        queue.flush(4, 0, &mut out).unwrap();
        assert_eq!(out, b"");
        queue.flush(5, 1, &mut out).unwrap();
        assert_eq!(out, b"abc");
        queue.push(6, b"e");
        queue.flush(6, 0, &mut out).unwrap();
        assert_eq!(out, b"abcde");
        assert!(queue.is_empty());
    }
}
