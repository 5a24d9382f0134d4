//! Ctrl-C and SIGTERM: once to finish cleanly, twice to stop now.

use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context as _;

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Exit code after an interrupt that could not wait.
const INTERRUPTED: i32 = 130;

/// Installs the handler. Call once.
pub fn install() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::SeqCst) {
            #[expect(
                clippy::exit,
                reason = "the second Ctrl-C means now; the last checkpoint on disk is whole"
            )]
            std::process::exit(INTERRUPTED);
        }
    })
    .context("cannot install the Ctrl-C handler")
}

/// The flag itself, for whoever has to look at it often.
pub fn flag() -> &'static AtomicBool {
    &REQUESTED
}

/// Whether the run should wind up.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}
