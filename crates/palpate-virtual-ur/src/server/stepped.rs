//! The server in a caller's own time, for tests without a clock.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::Server;

/// A virtual controller whose cycles the caller runs one by one, or lets run by themselves while it waits for a
/// client that needs several.
///
/// While the caller runs them there is no clock in it: on the loopback interface a command that was sent is there
/// in the next cycle, and the cycle's packet when it is over, however busy the computer is.
#[derive(Debug)]
pub struct Stepped {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

type Each = Box<dyn FnMut(&mut Server) + Send>;

struct Shared {
    server: Mutex<(Server, Each)>,
    automatic: AtomicBool,
    end: AtomicBool,
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shared").field("automatic", &self.automatic).finish_non_exhaustive()
    }
}

impl Shared {
    fn tick(&self) {
        let (server, each) = &mut *self.lock();
        server.tick();
        each(server);
    }

    fn lock(&self) -> MutexGuard<'_, (Server, Each)> {
        self.server.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Stepped {
    /// A server that runs no cycle yet. `each` looks at it after every one; cycles that run by themselves start
    /// `period` apart.
    pub fn new(
        server: Server,
        period: Duration,
        each: impl FnMut(&mut Server) + Send + 'static,
    ) -> Self {
        let shared = Arc::new(Shared {
            server: Mutex::new((server, Box::new(each))),
            automatic: AtomicBool::new(false),
            end: AtomicBool::new(false),
        });
        let own = Arc::clone(&shared);
        let thread = std::thread::spawn(move || {
            let mut next = Instant::now();
            while !own.end.load(Ordering::SeqCst) {
                if own.automatic.load(Ordering::SeqCst) {
                    own.tick();
                }
                next = (next + period).max(Instant::now());
                std::thread::sleep(next.saturating_duration_since(Instant::now()));
            }
        });
        Self { shared, thread: Some(thread) }
    }

    /// One cycle.
    pub fn tick(&self) {
        self.shared.tick();
    }

    /// Looks at or pokes the server between two cycles.
    pub fn with<R>(&self, job: impl FnOnce(&mut Server) -> R) -> R {
        job(&mut self.shared.lock().0)
    }

    /// Lets cycles run by themselves until `job` is done.
    pub fn meanwhile<R>(&self, job: impl FnOnce() -> R) -> R {
        self.shared.automatic.store(true, Ordering::SeqCst);
        let done = job();
        self.shared.automatic.store(false, Ordering::SeqCst);
        // The cycle under way ends.
        drop(self.shared.lock());
        done
    }
}

impl Drop for Stepped {
    fn drop(&mut self) {
        self.shared.end.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            _ = thread.join();
        }
    }
}
