//! Lines of a text protocol, however TCP cut them.

/// Longest line that is waited for; replies are far shorter.
const LONGEST: usize = 8192;

/// Collects bytes and yields whole lines, without their ends.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    bytes: Vec<u8>,
}

impl Lines {
    /// Adds received bytes. Beyond the longest line they are dropped.
    pub fn push(&mut self, bytes: &[u8]) {
        let room = LONGEST.saturating_sub(self.bytes.len());
        self.bytes.extend_from_slice(&bytes[..bytes.len().min(room)]);
    }

    /// The next whole line; bytes that are no UTF-8 are replaced.
    pub fn next_line(&mut self) -> Option<String> {
        let end = self.bytes.iter().position(|b| *b == b'\n')?;
        let line: Vec<u8> = self.bytes.drain(..=end).collect();
        Some(String::from_utf8_lossy(&line).trim_end_matches(['\r', '\n']).to_owned())
    }

    /// Whether this is not a line of the protocol any more.
    pub fn is_overlong(&self) -> bool {
        self.bytes.len() >= LONGEST
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_the_same_for_every_split() {
        let text = b"Powering on\nRobotmode: IDLE\r\n\nlast\n";
        let lines = |size: usize| {
            let mut lines = Lines::default();
            let mut all = Vec::new();
            for piece in text.chunks(size) {
                lines.push(piece);
                while let Some(line) = lines.next_line() {
                    all.push(line);
                }
            }
            all
        };
        for size in 1..=text.len() {
            assert_eq!(lines(size), ["Powering on", "Robotmode: IDLE", "", "last"]);
        }
    }

    #[test]
    fn memory_is_bounded() {
        let mut lines = Lines::default();
        for _ in 0..100 {
            lines.push(&[b'x'; 1000]);
        }
        assert!(lines.is_overlong());
        assert_eq!(lines.bytes.len(), LONGEST);
        assert_eq!(lines.next_line(), None);
    }
}
