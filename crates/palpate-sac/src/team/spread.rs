//! Two threads that have just woken may find themselves on one processor, where the kernel leaves them for longer than an
//! update takes.

#[cfg(target_os = "linux")]
use rustix::thread::{sched_getaffinity, sched_getcpu, sched_setaffinity};

/// The processor that runs the calling thread; any number where that is not known.
#[cfg(target_os = "linux")]
pub(super) fn processor() -> usize {
    sched_getcpu()
}

/// Moves the calling thread to another processor if it is on this one. It may be moved on from there.
#[cfg(target_os = "linux")]
pub(super) fn away_from(processor: usize) {
    if sched_getcpu() != processor {
        return;
    }
    let Ok(all) = sched_getaffinity(None) else { return };
    let mut others = all;
    others.unset(processor);
    if others.count() > 0 && sched_setaffinity(None, &others).is_ok() {
        // Nowhere to stay: the kernel decides again from now on.
        _ = sched_setaffinity(None, &all);
    }
}

#[cfg(not(target_os = "linux"))]
pub(super) fn processor() -> usize {
    0
}

#[cfg(not(target_os = "linux"))]
pub(super) fn away_from(_: usize) {}
