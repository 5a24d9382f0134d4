//! The threads of an update: one, or two.

use std::hint::spin_loop;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::yield_now;

mod spread;

use rayon::{ThreadPool, ThreadPoolBuilder, Yield};

use crate::SacError;

/// How often the second thread is given way to before the first begins alone.
const PATIENCE: u32 = 200;

/// Runs pieces of work in pairs.
///
/// Two pieces never touch the same numbers, so how many threads there are changes no result.
#[derive(Debug)]
pub(crate) struct Team {
    pool: Option<ThreadPool>,
}

impl Team {
    /// A team of one thread, or of two.
    pub(crate) fn new(threads: usize) -> Result<Self, SacError> {
        if threads < 2 {
            return Ok(Self { pool: None });
        }
        let pool = ThreadPoolBuilder::new()
            .num_threads(2)
            .thread_name(|i| format!("learner-{i}"))
            .build()
            .map_err(|e| SacError::Threads(e.to_string()))?;
        Ok(Self { pool: Some(pool) })
    }

    /// Runs something that calls [`both`](Self::both) many times; cheaper from inside.
    ///
    /// The second thread stays awake meanwhile: pieces are shorter than waking up takes.
    pub(crate) fn enter<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        let Some(pool) = &self.pool else { return work() };
        let (awake, done) = (&AtomicBool::new(false), &AtomicBool::new(false));
        pool.scope(|scope| {
            // However the work ends.
            let _end = Ends(done);
            let (home, processor) = (rayon::current_thread_index(), spread::processor());
            scope.spawn_broadcast(move |_, here| {
                if Some(here.index()) == home {
                    return;
                }
                spread::away_from(processor);
                awake.store(true, Ordering::Release);
                while !done.load(Ordering::Acquire) {
                    if rayon::yield_now() != Some(Yield::Executed) {
                        spin_loop();
                    }
                }
            });
            // Woken on this processor it would not run before this thread is taken off it.
            (0..PATIENCE).take_while(|_| !awake.load(Ordering::Acquire)).for_each(|_| yield_now());
            work()
        })
    }

    /// Runs both pieces, at the same time if there are two threads.
    pub(crate) fn both<A: Send, B: Send>(
        &self,
        a: impl FnOnce() -> A + Send,
        b: impl FnOnce() -> B + Send,
    ) -> (A, B) {
        match &self.pool {
            Some(pool) => pool.join(a, b),
            None => (a(), b()),
        }
    }
}

/// Says that the work is done when it goes.
struct Ends<'a>(&'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}
