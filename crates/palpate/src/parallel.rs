//! Work that is shared out among threads.

use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

/// Cores that this process may use: by affinity, control group, and what Slurm gave the task.
pub(crate) fn cores() -> usize {
    let here = thread::available_parallelism().map_or(1, usize::from);
    let given = std::env::var("SLURM_CPUS_PER_TASK").ok().and_then(|text| text.parse().ok());
    given.map_or(here, |given: usize| given.clamp(1, here))
}

/// What `work` makes of the items 0 … `count` − 1, in their order. Each worker has a thread and takes the next item
/// when it is free; none is begun after an error, or once `stop` says so.
///
/// # Errors
/// The first one of a worker.
pub(crate) fn share_out<W: Send, T: Send>(
    workers: &mut [W],
    count: u64,
    stop: impl Fn() -> bool + Sync,
    work: impl Fn(&mut W, u64) -> anyhow::Result<T> + Sync,
) -> anyhow::Result<Vec<T>> {
    let next = AtomicU64::new(0);
    let share = |worker: &mut W| -> anyhow::Result<Vec<(u64, T)>> {
        let mut done = Vec::new();
        while !stop() {
            let item = next.fetch_add(1, Ordering::Relaxed);
            if item >= count {
                break;
            }
            let made = work(worker, item);
            if made.is_err() {
                next.store(count, Ordering::Relaxed);
            }
            done.push((item, made?));
        }
        Ok(done)
    };
    let Some((here, others)) = workers.split_first_mut() else { return Ok(Vec::new()) };
    let shares = thread::scope(|scope| {
        let threads: Vec<_> =
            others.iter_mut().map(|worker| scope.spawn(|| share(worker))).collect();
        let mut shares = vec![share(here)];
        for thread in threads {
            shares.push(thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        shares
    });
    let mut all = Vec::new();
    for share in shares {
        all.extend(share?);
    }
    all.sort_by_key(|(item, _)| *item);
    Ok(all.into_iter().map(|(_, made)| made).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::sync::Barrier;
    use std::time::Duration;

    #[test]
    fn results_come_in_the_order_of_the_items_whoever_made_them() {
        let barrier = Barrier::new(3);
        let mut workers = [(); 3];
        let made = share_out(
            &mut workers,
            30,
            || false,
            |(), item| {
                if item < 3 {
                    barrier.wait(); // Nobody passes before three threads are at work.
                }
                Ok((item, thread::current().id()))
            },
        );
        let made = made.unwrap();
        assert!(made.iter().map(|(item, _)| *item).eq(0..30));
        assert_eq!(made.iter().map(|(_, id)| *id).collect::<HashSet<_>>().len(), 3);
        assert!(share_out(&mut [(); 0], 3, || false, |(), _| Ok(())).unwrap().is_empty());
    }

    #[test]
    fn nothing_is_begun_after_an_error_or_a_stop() {
        // One worker fails while the other is at work, which comes to its end; no third item is begun.
        let (begun, both) = (AtomicU64::new(0), Barrier::new(2));
        let error = share_out(
            &mut [(); 2],
            1000,
            || false,
            |(), item| {
                begun.fetch_add(1, Ordering::Relaxed);
                if item < 2 {
                    both.wait();
                }
                anyhow::ensure!(item != 0, "the first");
                thread::sleep(Duration::from_millis(50));
                Ok(())
            },
        );
        assert_eq!(error.unwrap_err().to_string(), "the first");
        assert_eq!(begun.load(Ordering::Relaxed), 2);
        let begun = AtomicU64::new(0);
        let enough = || begun.load(Ordering::Relaxed) >= 2;
        let count = |(): &mut (), item| {
            begun.fetch_add(1, Ordering::Relaxed);
            Ok(item)
        };
        assert_eq!(share_out(&mut [()], 1000, enough, count).unwrap(), [0, 1]);
    }
}
