//! Two threads that have just woken may find themselves on one processor, where the kernel leaves them for longer than an
//! update takes.

/// The processor that runs the calling thread, if that is known here.
#[cfg(target_os = "linux")]
pub(super) fn processor() -> Option<usize> {
    Some(rustix::thread::sched_getcpu())
}

/// Moves the calling thread to another processor if it is on this one. It may be moved on from there.
#[cfg(target_os = "linux")]
pub(super) fn away_from(processor: Option<usize>) {
    use rustix::thread::{sched_getaffinity, sched_setaffinity};
    let Some(processor) = processor.filter(|p| *p == rustix::thread::sched_getcpu()) else {
        return;
    };
    let Ok(all) = sched_getaffinity(None) else { return };
    let mut others = all;
    others.unset(processor);
    if others.count() > 0 && sched_setaffinity(None, &others).is_ok() {
        // Nowhere to stay: the kernel decides again from now on.
        _ = sched_setaffinity(None, &all);
    }
}

/// Unknown.
#[cfg(not(target_os = "linux"))]
pub(super) fn processor() -> Option<usize> {
    None
}

/// Nothing.
#[cfg(not(target_os = "linux"))]
pub(super) fn away_from(_: Option<usize>) {}
