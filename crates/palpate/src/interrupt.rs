//! Signals: Ctrl-C, SIGTERM and SIGHUP once to finish cleanly, twice to stop now; SIGUSR1, with which
//! schedulers announce that time is up, always to finish cleanly.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

use anyhow::Context as _;
use signal_hook::flag;

static REQUESTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Exit code after an interrupt that could not wait.
const INTERRUPTED: i32 = 130;

/// Installs the handlers. Call once.
pub fn install() -> anyhow::Result<()> {
    for signal in twice_means_now() {
        // First looks at the flag, then raises it: the second signal finds it raised.
        flag::register_conditional_shutdown(*signal, INTERRUPTED, Arc::clone(&REQUESTED))
            .and_then(|_| flag::register(*signal, Arc::clone(&REQUESTED)))
            .with_context(|| format!("cannot handle signal {signal}"))?;
    }
    #[cfg(unix)]
    {
        use signal_hook::consts::{SIGUSR1, SIGXFSZ};
        flag::register(SIGUSR1, Arc::clone(&REQUESTED)).context("cannot handle SIGUSR1")?;
        // A limit on the size of files is then an error of the write, as a full disk is.
        flag::register(SIGXFSZ, Arc::default()).context("cannot handle SIGXFSZ")?;
    }
    Ok(())
}

fn twice_means_now() -> &'static [i32] {
    use signal_hook::consts::{SIGINT, SIGTERM};
    #[cfg(unix)]
    return &[SIGINT, SIGTERM, signal_hook::consts::SIGHUP];
    #[cfg(not(unix))]
    &[SIGINT, SIGTERM]
}

/// The flag itself, for whoever has to look at it often.
pub fn flag() -> &'static AtomicBool {
    &REQUESTED
}

/// Whether the run should wind up.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}
