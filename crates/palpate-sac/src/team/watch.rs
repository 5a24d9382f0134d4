//! Keeps the second thread awake.

use std::hint::spin_loop;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering::SeqCst};
use std::thread::yield_now;
use std::time::{Duration, Instant};

use rayon::{ThreadPool, Yield};

use super::spread;

/// How often the second thread is given way to before the first begins without it.
const YIELDS: u32 = 200;
/// How long it stays awake for the next update: longer than a simulated step takes.
const LINGER: Duration = Duration::from_millis(1);

const ASLEEP: u8 = 0;
const CALLED: u8 = 1;
const AWAKE: u8 = 2;

/// What the second thread is told, and tells. If it sleeps, pieces of work wake it, only slowly.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch(Arc<State>);

#[derive(Debug, Default)]
struct State {
    second: AtomicU8,
    /// Whether there is work for it.
    busy: AtomicBool,
    /// The processor of the first thread.
    processor: AtomicUsize,
}

impl Watch {
    /// Runs `work` while the pool's thread is awake.
    pub(super) fn during<R>(&self, pool: &ThreadPool, work: impl FnOnce() -> R) -> R {
        let state = &self.0;
        state.processor.store(spread::processor(), SeqCst);
        state.busy.store(true, SeqCst);
        // However the work ends.
        let _rest = Rest(state);
        if state.second.compare_exchange(ASLEEP, CALLED, SeqCst, SeqCst).is_ok() {
            let watch = self.clone();
            pool.spawn(move || watch.0.watch());
            // Woken on this processor it would not run before this thread is taken off it.
            let called = |_: &u32| state.second.load(SeqCst) == CALLED;
            (0..YIELDS).take_while(called).for_each(|_| yield_now());
        }
        work()
    }
}

#[cfg(test)]
impl Watch {
    pub(super) fn is_awake(&self) -> bool {
        self.0.second.load(SeqCst) == AWAKE
    }
}

impl State {
    /// Looks for work, all the time while there is some, and until [`LINGER`] has gone by without.
    fn watch(&self) {
        self.second.store(AWAKE, SeqCst);
        let mut resting = Some(Instant::now());
        loop {
            if rayon::yield_now() == Some(Yield::Executed) {
                continue;
            }
            if self.busy.load(SeqCst) {
                if resting.take().is_some() {
                    spread::away_from(self.processor.load(SeqCst));
                }
                spin_loop();
            } else if resting.get_or_insert_with(Instant::now).elapsed() < LINGER {
                yield_now();
            } else if self.falls_asleep() {
                return;
            }
        }
    }

    /// Not if there has been a call meanwhile that was meant for who is awake.
    fn falls_asleep(&self) -> bool {
        self.second.store(ASLEEP, SeqCst);
        !self.busy.load(SeqCst)
            || self.second.compare_exchange(ASLEEP, AWAKE, SeqCst, SeqCst).is_err()
    }
}

/// Says that there is no more work when it goes.
struct Rest<'a>(&'a State);

impl Drop for Rest<'_> {
    fn drop(&mut self) {
        self.0.busy.store(false, SeqCst);
    }
}
