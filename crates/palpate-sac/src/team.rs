//! The threads of an update: one, or two.

use std::hint::spin_loop;
use std::sync::OnceLock;
use std::sync::atomic::Ordering::{self, Relaxed};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64};
use std::thread::yield_now;
use std::time::{Duration, Instant};

mod spread;
mod watch;

use rayon::{ThreadPool, ThreadPoolBuilder};

use watch::Watch;

/// Name of the second thread.
const NAME: &str = "learner-2";

/// How often the first thread looks for the end of the second one's piece before it gives way to others.
const LOOKS: u32 = 10_000;
/// Waiting for the second thread for longer than this, and for longer than working, says that it has no processor.
const HELD_UP: Duration = Duration::from_millis(2);
/// How many calls the first thread does alone at most before it asks again.
const ALONE: u32 = 256;

/// Runs pieces of work in pairs.
///
/// Two pieces never touch the same numbers, so how many threads there are changes no result.
#[derive(Debug)]
pub(crate) struct Team {
    threads: usize,
    /// Empty if it cannot be started: then the first thread does all there is.
    second: OnceLock<Option<Second>>,
}

/// The second thread, started when it is first needed: with the priority of whoever needs it.
#[derive(Debug)]
struct Second {
    pool: ThreadPool,
    watch: Watch,
    /// Nanoseconds of a call that the first thread spent on its own pieces.
    worked: AtomicU64,
    /// Nanoseconds of a call that it waited for the second one's.
    waited: AtomicU64,
    /// How many calls the second one is still left out of.
    alone: AtomicU32,
    /// How many it was left out of last, less what it has made up for since.
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
    pub(crate) fn enter<R>(&self, work: impl FnOnce() -> R) -> R {
        let Some(second) = self.second() else { return work() };
        let alone = second.alone.load(Relaxed);
        if alone > 0 {
            let result = work();
            second.alone.store(alone - 1, Relaxed);
            return result;
        }
        second.worked.store(0, Relaxed);
        second.waited.store(0, Relaxed);
        let result = second.watch.during(&second.pool, work);
        let held_up = second.alone.load(Relaxed) > 0;
        let next = left_out(second.latest.load(Relaxed), held_up);
        second.latest.store(next, Relaxed);
        second.alone.store(if held_up { next } else { 0 }, Relaxed);
        result
    }

    /// Runs both pieces, at the same time if there are two threads. A piece that calls this itself does both of its own.
    pub(crate) fn both<A, B: Send>(
        &self,
        a: impl FnOnce() -> A,
        b: impl FnOnce() -> B + Send,
    ) -> (A, B) {
        match self.second() {
            Some(second) if second.is_free() => second.both(a, b),
            _ => (a(), b()),
        }
    }

    fn second(&self) -> Option<&Second> {
        if self.threads < 2 {
            return None;
        }
        self.second.get_or_init(Second::start).as_ref()
    }
}

/// How many calls to leave the second thread out of: twice as many whenever it holds the first one up, half as many
/// whenever it does not.
fn left_out(latest: u32, held_up: bool) -> u32 {
    if held_up { (2 * latest).clamp(1, ALONE) } else { latest / 2 }
}

impl Second {
    fn start() -> Option<Self> {
        let pool = ThreadPoolBuilder::new().num_threads(1).thread_name(|_| NAME.into()).build();
        Some(Self {
            pool: pool.ok()?,
            watch: Watch::default(),
            worked: AtomicU64::default(),
            waited: AtomicU64::default(),
            alone: AtomicU32::default(),
            latest: AtomicU32::default(),
        })
    }

    /// Whether it would take a piece: not where it is asked from one of its own, which it has to end first.
    fn is_free(&self) -> bool {
        self.alone.load(Relaxed) == 0 && self.pool.current_thread_index().is_none()
    }

    /// Runs the one piece here and the other one there.
    fn both<A, B: Send>(&self, a: impl FnOnce() -> A, b: impl FnOnce() -> B + Send) -> (A, B) {
        let (mut there, done) = (None, AtomicBool::new(false));
        let here = self.pool.in_place_scope(|scope| {
            scope.spawn(|_| {
                // However the piece ends.
                let _end = Ends(&done);
                there = Some(b());
            });
            let began = Instant::now();
            let here = a();
            let worked = began.elapsed();
            // The scope itself would go to sleep until then.
            let mut looks = 0;
            while !done.load(Ordering::Acquire) {
                if looks < LOOKS {
                    looks += 1;
                    spin_loop();
                } else {
                    yield_now();
                }
            }
            self.judge(worked, began.elapsed().saturating_sub(worked));
            here
        });
        let Some(there) = there else { unreachable!("a scope ends after what was spawned in it") };
        (here, there)
    }

    /// Leaves it out for the rest of a call that it holds up.
    fn judge(&self, worked: Duration, waited: Duration) {
        let add = |to: &AtomicU64, time: Duration| {
            let time = time.as_nanos() as u64;
            to.fetch_add(time, Relaxed).saturating_add(time)
        };
        let (worked, waited) = (add(&self.worked, worked), add(&self.waited, waited));
        if waited > worked && Duration::from_nanos(waited) > HELD_UP {
            self.alone.store(1, Relaxed);
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
        // Either piece alone would not see the other one begin.
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
        assert_eq!(met, (true, true));
    }

    #[test]
    fn one_thread_does_both() {
        let (a, b) = threads(&Team::new(1));
        assert_eq!((a, b), (current().id(), current().id()));
    }

    #[test]
    fn a_piece_that_has_pieces_does_them_itself() {
        let team = Team::new(2);
        let (first, (a, b)) = team.both(|| current().id(), || threads(&team));
        assert!(first != a && a == b);
    }

    #[test]
    fn who_keeps_the_first_waiting_is_left_out_for_a_while() {
        let team = Team::new(2);
        let alone = || {
            let (a, b) = threads(&team);
            a == b
        };
        let rest = team.enter(|| {
            team.both(|| (), || sleep(Duration::from_millis(100)));
            alone()
        });
        assert!(rest, "asked again in the same call");
        assert_eq!([team.enter(alone), team.enter(alone)], [true, false]);
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
    fn the_second_thread_is_awake_during_a_call_and_asleep_a_while_after() {
        let team = Team::new(2);
        let comes = |awake: bool| {
            let began = Instant::now();
            while team.second().unwrap().watch.is_awake() != awake {
                assert!(began.elapsed() < Duration::from_secs(20), "awake: {}", !awake);
                yield_now();
            }
        };
        // Nobody asks it for anything.
        team.enter(|| comes(true));
        comes(false);
        team.enter(|| comes(true));
    }

    #[test]
    fn a_piece_that_panics_ends_the_pair_and_not_the_team() {
        let team = Team::new(2);
        let broken = || team.enter(|| team.both(|| (), || panic!("on purpose")));
        assert!(catch_unwind(AssertUnwindSafe(broken)).is_err());
        // Telling of it took long; so it may be left out once.
        let again = |_| team.enter(|| threads(&team));
        assert!((0..3).map(again).any(|(a, b)| a != b));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_second_thread_is_as_nice_as_the_first() {
        let team = Team::new(2);
        // A thread of its own: who has been nice stays so. 19 is as nice as can be.
        let nice = || {
            rustix::process::setpriority_process(None, 19).unwrap();
            team.both(|| (), || rustix::process::getpriority_process(None).unwrap()).1
        };
        assert_eq!(std::thread::scope(|scope| scope.spawn(nice).join().unwrap()), 19);
    }
}
