//! Threads that share a list of work.

use std::num::NonZero;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Result;

use crate::progress::{Interrupted, Progress};

/// One thread a core.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZero::get)
}

/// Tells a thread whether it should stop.
pub struct Stop<'a> {
    /// Another one has failed, or panicked.
    failed: AtomicBool,
    progress: &'a dyn Progress,
}

impl Stop<'_> {
    /// Whether it should: because another one has failed, or all were asked to end early.
    pub fn is_asked_for(&self) -> bool {
        self.failed.load(Ordering::Relaxed) || self.progress.cancelled()
    }
}

/// Runs `work` on so many threads, until all are done.
///
/// # Errors
/// What the first of the threads says, in their order; [`Interrupted`] when `progress` was cancelled.
pub fn run(
    threads: usize,
    progress: &dyn Progress,
    work: impl Fn(&Stop<'_>) -> Result<()> + Sync,
) -> Result<()> {
    let stop = Stop { failed: AtomicBool::new(false), progress };
    let guarded = || {
        let _stop_others = StopOnPanic(&stop.failed);
        work(&stop).inspect_err(|_| stop.failed.store(true, Ordering::Relaxed))
    };
    std::thread::scope(|scope| {
        let handles: Vec<_> = (0..threads.max(1)).map(|_| scope.spawn(guarded)).collect();
        handles.into_iter().try_for_each(|handle| match handle.join() {
            Ok(result) => result,
            Err(panic) => std::panic::resume_unwind(panic),
        })
    })?;
    if progress.cancelled() { Err(Interrupted.into()) } else { Ok(()) }
}

struct StopOnPanic<'a>(&'a AtomicBool);

impl Drop for StopOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Quiet;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn what_is_cancelled_ends_as_interrupted() {
        struct Cancelled(AtomicBool);
        impl Progress for Cancelled {
            fn advance(&self, _: u64) {
                self.0.store(true, Ordering::Relaxed);
            }

            fn cancelled(&self) -> bool {
                self.0.load(Ordering::Relaxed)
            }
        }
        let progress = Cancelled(AtomicBool::new(false));
        let ended = run(2, &progress, |stop| {
            progress.advance(1);
            while !stop.is_asked_for() {
                std::thread::yield_now();
            }
            Ok(())
        });
        assert!(ended.unwrap_err().is::<Interrupted>());
    }

    #[test]
    fn one_that_fails_or_panics_stops_the_others() {
        for panics in [false, true] {
            let next = AtomicUsize::new(0);
            let outcome = std::panic::catch_unwind(|| {
                run(3, &Quiet, |stop| {
                    if next.fetch_add(1, Ordering::Relaxed) == 1 {
                        assert!(!panics, "as asked");
                        anyhow::bail!("failed");
                    }
                    while !stop.is_asked_for() {
                        std::thread::yield_now();
                    }
                    Ok(())
                })
            });
            match outcome {
                Ok(result) => assert_eq!(result.unwrap_err().to_string(), "failed"),
                Err(_) => assert!(panics),
            }
        }
        assert!(run(0, &Quiet, |_| Ok(())).is_ok());
    }
}
