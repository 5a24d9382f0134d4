//! The threads of an update: one, or two.

use std::hint::spin_loop;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::thread::yield_now;
use std::time::{Duration, Instant};

mod spread;
mod watch;

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::SacError;
use watch::Watch;

/// How often the first thread looks for the end of the second one's piece before it gives way to others.
const PATIENCE: u32 = 10_000;
/// Waiting for the second thread for longer than this, and for most of the time, says that it has no processor.
const HELD_UP: Duration = Duration::from_millis(1);
/// How often the first thread works alone at most before it asks again.
const ALONE: u32 = 256;

/// Runs pieces of work in pairs.
///
/// Two pieces never touch the same numbers, so how many threads there are changes no result.
#[derive(Debug)]
pub(crate) struct Team {
    threads: usize,
    second: OnceLock<Second>,
}

/// The second thread, started when it is first needed: with the priority of whoever needs it.
#[derive(Debug)]
struct Second {
    pool: ThreadPool,
    watch: Watch,
    /// Nanoseconds that the first thread has waited for it.
    waited: AtomicU64,
    /// How often it is still left out.
    alone: AtomicU32,
    /// How often it was left out last, less what it has made up for since.
    latest: AtomicU32,
}

impl Team {
    /// A team of one thread, or of two.
    pub(crate) fn new(threads: usize) -> Self {
        Self { threads, second: OnceLock::new() }
    }

    /// Runs something that calls [`both`](Self::both) many times.
    ///
    /// The second thread stays awake meanwhile: pieces are shorter than waking up takes. Where others keep it from its
    /// processor, the first one works alone for a while.
    pub(crate) fn enter<R>(&self, work: impl FnOnce() -> R) -> Result<R, SacError> {
        let Some(second) = self.second()? else { return Ok(work()) };
        let alone = second.alone.load(Ordering::Relaxed);
        if alone > 0 {
            let result = work();
            second.alone.store(alone - 1, Ordering::Relaxed);
            return Ok(result);
        }
        second.waited.store(0, Ordering::Relaxed);
        let began = Instant::now();
        let result = second.watch.during(&second.pool, work);
        let waited = Duration::from_nanos(second.waited.load(Ordering::Relaxed));
        let latest = second.latest.load(Ordering::Relaxed);
        let held_up = waited > HELD_UP && waited > began.elapsed() / 2;
        let next = left_out(latest, held_up);
        second.latest.store(next, Ordering::Relaxed);
        second.alone.store(if held_up { next } else { 0 }, Ordering::Relaxed);
        Ok(result)
    }

    /// Runs both pieces, at the same time if there are two threads.
    pub(crate) fn both<A, B: Send>(
        &self,
        a: impl FnOnce() -> A,
        b: impl FnOnce() -> B + Send,
    ) -> (A, B) {
        match self.second() {
            Ok(Some(second)) if second.alone.load(Ordering::Relaxed) == 0 => second.both(a, b),
            _ => (a(), b()),
        }
    }

    fn second(&self) -> Result<Option<&Second>, SacError> {
        if self.threads < 2 || self.second.get().is_some() {
            return Ok(self.second.get());
        }
        let pool = ThreadPoolBuilder::new()
            .num_threads(1)
            .thread_name(|_| "learner-2".into())
            .build()
            .map_err(|e| SacError::Threads(e.to_string()))?;
        let second = || Second {
            pool,
            watch: Watch::default(),
            waited: AtomicU64::default(),
            alone: AtomicU32::default(),
            latest: AtomicU32::default(),
        };
        Ok(Some(self.second.get_or_init(second)))
    }
}

/// How often to leave the second thread out: twice as often whenever it holds the first one up, half as often
/// whenever it does not.
fn left_out(latest: u32, held_up: bool) -> u32 {
    if held_up { (2 * latest).clamp(1, ALONE) } else { latest / 2 }
}

impl Second {
    /// Runs the one piece here and the other one there.
    fn both<A, B: Send>(&self, a: impl FnOnce() -> A, b: impl FnOnce() -> B + Send) -> (A, B) {
        let (mut there, done) = (None, AtomicBool::new(false));
        let here = self.pool.in_place_scope(|scope| {
            scope.spawn(|_| {
                // However the piece ends.
                let _end = Ends(&done);
                there = Some(b());
            });
            let here = a();
            // The scope itself would go to sleep until then.
            let (mut looks, began) = (0, Instant::now());
            while !done.load(Ordering::Acquire) {
                looks += 1;
                if looks < PATIENCE { spin_loop() } else { yield_now() }
            }
            self.waited.fetch_add(began.elapsed().as_nanos() as u64, Ordering::Relaxed);
            here
        });
        let Some(there) = there else { unreachable!("a scope ends after what was spawned in it") };
        (here, there)
    }
}

/// Says that the work is done when it goes.
struct Ends<'a>(&'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::thread::{ThreadId, current, sleep};

    use super::*;

    fn threads(team: &Team) -> (ThreadId, ThreadId) {
        team.both(|| current().id(), || current().id())
    }

    #[test]
    fn two_threads_work_at_the_same_time() {
        let (team, first) = (Team::new(2), AtomicBool::new(false));
        // Either piece alone would wait for good.
        let met = team.enter(|| {
            let second = AtomicBool::new(false);
            let meet = |mine: &AtomicBool, other: &AtomicBool| {
                mine.store(true, Ordering::SeqCst);
                let began = Instant::now();
                while !other.load(Ordering::SeqCst) && began.elapsed() < Duration::from_secs(20) {
                    yield_now();
                }
                other.load(Ordering::SeqCst)
            };
            team.both(|| meet(&first, &second), || meet(&second, &first))
        });
        assert_eq!(met.unwrap(), (true, true));
    }

    #[test]
    fn one_thread_does_both() {
        let (a, b) = threads(&Team::new(1));
        assert_eq!((a, b), (current().id(), current().id()));
    }

    #[test]
    fn who_keeps_the_first_waiting_is_left_out_for_a_while() {
        let team = Team::new(2);
        let late = || team.both(|| (), || sleep(Duration::from_millis(20)));
        let alone = || team.enter(|| threads(&team)).map(|(a, b)| a == b).unwrap();
        team.enter(late).unwrap();
        assert_eq!([alone(), alone()], [true, false]);
    }

    #[test]
    fn and_for_longer_every_time() {
        let mut latest = 0;
        let mut next = |held_up| {
            latest = left_out(latest, held_up);
            latest
        };
        assert_eq!([true; 10].map(&mut next), [1, 2, 4, 8, 16, 32, 64, 128, 256, 256]);
        assert_eq!([false, true, false, false].map(&mut next), [128, 256, 128, 64]);
        assert_eq!([false; 8].map(&mut next), [32, 16, 8, 4, 2, 1, 0, 0]);
    }

    #[test]
    fn a_piece_that_panics_ends_the_pair_and_not_the_team() {
        let team = Team::new(2);
        let broken = || team.enter(|| team.both(|| (), || panic!("on purpose")));
        assert!(catch_unwind(AssertUnwindSafe(broken)).is_err());
        let (a, b) = team.enter(|| threads(&team)).unwrap();
        assert_ne!(a, b);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_second_thread_is_as_nice_as_the_first() {
        let team = Team::new(2);
        // A thread of its own: who has been nice stays so.
        let nice = || {
            rustix::process::setpriority_process(None, 7).unwrap();
            team.both(|| (), || rustix::process::getpriority_process(None).unwrap()).1
        };
        assert_eq!(std::thread::scope(|scope| scope.spawn(nice).join().unwrap()), 7);
    }
}
