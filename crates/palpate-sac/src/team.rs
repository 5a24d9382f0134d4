//! The threads of an update: one, or two.

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::SacError;

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
    pub(crate) fn enter<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
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
