//! The Enter key, without waiting for it.

use std::io::{BufRead as _, IsTerminal as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Counts lines on a terminal's standard input.
#[derive(Debug)]
pub(super) struct Keys {
    pressed: Arc<AtomicUsize>,
    seen: usize,
    /// Whether there is a person.
    pub(super) attended: bool,
}

impl Keys {
    /// Listens, if standard input is a terminal.
    pub(super) fn listen() -> Self {
        let attended = std::io::stdin().is_terminal();
        let pressed = Arc::new(AtomicUsize::new(0));
        if attended {
            let count = Arc::clone(&pressed);
            // It ends with the process: a read of a terminal cannot be called off.
            std::thread::spawn(move || {
                for line in std::io::stdin().lock().lines() {
                    if line.is_err() {
                        return;
                    }
                    count.fetch_add(1, Ordering::Relaxed);
                }
            });
        }
        Self { pressed, seen: 0, attended }
    }

    /// A person in a test: every count is a press.
    #[cfg(test)]
    pub(super) fn pressed_by(pressed: &Arc<AtomicUsize>) -> Self {
        Self { pressed: Arc::clone(pressed), seen: 0, attended: true }
    }

    /// Whether Enter was pressed since the last call.
    pub(super) fn take(&mut self) -> bool {
        let now = self.pressed.load(Ordering::Relaxed);
        std::mem::replace(&mut self.seen, now) != now
    }
}
