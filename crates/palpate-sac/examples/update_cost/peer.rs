//! The same update by someone else, in a process of its own.

use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../python/peers.py");

/// python/peers.py, ready for its next update.
pub(crate) struct Peer {
    pub(crate) name: String,
    /// CPU seconds of its updates so far.
    pub(crate) updates: Vec<f64>,
    child: Child,
    ask: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl Peer {
    /// Starts `torch` or `jax` in the Python that `PYTHON` names; it compiles and warms up.
    pub(crate) fn start(which: &str) -> Self {
        let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
        let mut child = Command::new(python)
            .args([SCRIPT, which])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let answers = BufReader::new(child.stdout.take().unwrap());
        let ask = child.stdin.take();
        let mut peer = Self { name: String::new(), updates: Vec::new(), child, ask, answers };
        peer.name = peer.line();
        peer
    }

    /// One update of it, while this process waits.
    pub(crate) fn update(&mut self) {
        let ask = self.ask.as_mut().unwrap();
        ask.write_all(b"\n").and_then(|()| ask.flush()).unwrap();
        let seconds = self.line().parse().unwrap();
        self.updates.push(seconds);
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.answers.read_line(&mut line).unwrap();
        line.trim().to_owned()
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // The end of its input is the end of it.
        drop(self.ask.take());
        _ = self.child.wait();
    }
}
