//! A stream of bytes cut into programs, as the script ports receive them.

use std::collections::VecDeque;

/// A program as it was sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unit {
    /// `def … end`, `sec … end` or one line.
    Program(String),
    /// More text than a program may have, thrown away.
    TooLong(usize),
}

/// Cuts what a client sends into programs: from a line that opens a block to the `end` that closes it,
/// or single lines.
#[derive(Debug, Default)]
pub struct Units {
    /// Bytes of a line that has no end yet.
    line: Vec<u8>,
    program: String,
    depth: i64,
    ready: VecDeque<Unit>,
}

/// Longest program, bytes: five times the largest control program known.
const LENGTH_MAX: usize = 256 * 1024;

impl Units {
    /// Takes bytes from the client.
    pub fn push(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.line.push(byte);
            if byte == b'\n' {
                self.end_line();
            } else if self.line.len() + self.program.len() > LENGTH_MAX {
                self.discard();
            }
        }
    }

    /// The client has sent nothing more for a while: a block whose `end` has no newline is complete.
    pub fn idle(&mut self) {
        let tail = String::from_utf8_lossy(&self.line);
        if self.depth > 0 && self.depth + balance(&tail) <= 0 {
            self.end_line();
        }
    }

    /// The next complete program.
    pub fn take(&mut self) -> Option<Unit> {
        self.ready.pop_front()
    }

    fn discard(&mut self) {
        self.ready.push_back(Unit::TooLong(self.line.len() + self.program.len()));
        *self = Self { ready: std::mem::take(&mut self.ready), ..Self::default() };
    }

    fn end_line(&mut self) {
        let line = String::from_utf8_lossy(&self.line).into_owned();
        self.line.clear();
        let blank = code(&line).trim().is_empty();
        if self.program.is_empty() && blank {
            return;
        }
        self.depth = (self.depth + balance(&line)).max(0);
        self.program.push_str(&line);
        if self.depth == 0 {
            self.ready.push_back(Unit::Program(std::mem::take(&mut self.program)));
        }
    }
}

/// The line without its comment and with its strings blanked.
fn code(line: &str) -> String {
    let mut text = String::with_capacity(line.len());
    let mut quoted = false;
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            '#' if !quoted => break,
            _ if quoted => {}
            c => text.push(c),
        }
    }
    text
}

/// Blocks that the line opens minus those it closes.
fn balance(line: &str) -> i64 {
    let code = code(line);
    let words = code.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
    words
        .map(|word| match word {
            "def" | "sec" | "thread" | "if" | "while" => 1,
            "end" => -1,
            _ => 0,
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units(text: &str) -> Vec<String> {
        let mut units = Units::default();
        units.push(text.as_bytes());
        units.idle();
        let taken = std::iter::from_fn(|| units.take());
        taken.map(|u| if let Unit::Program(p) = u { p } else { "too long".into() }).collect()
    }

    #[test]
    fn programs_and_lines_are_cut_apart() {
        let text = "\n# hello\ntextmsg(\"if #\")\ndef f():\n  if True: # while\n    sync()\n  end\nend\nsec g():\nend\n";
        assert_eq!(
            units(text),
            [
                "textmsg(\"if #\")\n",
                "def f():\n  if True: # while\n    sync()\n  end\nend\n",
                "sec g():\nend\n"
            ]
        );
    }

    #[test]
    fn a_last_end_needs_no_newline_but_a_line_does() {
        assert_eq!(units("def f():\nend"), ["def f():\nend"]);
        assert_eq!(units("textmsg(1)"), [] as [&str; 0]);
        assert_eq!(units("def f():\nendless = 1"), [] as [&str; 0]);
    }

    #[test]
    fn every_split_of_the_stream_gives_the_same_programs() {
        let text = "def f():\n  while True:\n    sync()\n  end\nend\nmovej([0,0,0,0,0,0])\n";
        for cut in 0..text.len() {
            let mut units = Units::default();
            units.push(&text.as_bytes()[..cut]);
            units.push(&text.as_bytes()[cut..]);
            assert_eq!(std::iter::from_fn(|| units.take()).count(), 2, "cut at {cut}");
        }
    }

    #[test]
    fn endless_text_is_thrown_away() {
        let mut units = Units::default();
        units.push(b"def f():\n");
        units.push(&vec![b'x'; 300_000]);
        assert!(matches!(units.take(), Some(Unit::TooLong(_))));
        units.push(b"\ntextmsg(1)\n");
        assert!(std::iter::from_fn(|| units.take()).last().is_some());
    }
}
