//! Threads that share a list of work.

use std::num::NonZero;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Result;

/// One thread a core.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZero::get)
}

/// Runs `work` on so many threads, until all are done. It is told by a flag when it should stop because another one has
/// failed, or panicked.
///
/// # Errors
/// What the first of the threads says, in their order.
pub fn run(threads: usize, work: impl Fn(&AtomicBool) -> Result<()> + Sync) -> Result<()> {
    let stop = AtomicBool::new(false);
    let guarded = || {
        let _stop_others = StopOnPanic(&stop);
        work(&stop).inspect_err(|_| stop.store(true, Ordering::Relaxed))
    };
    std::thread::scope(|scope| {
        let handles: Vec<_> = (0..threads.max(1)).map(|_| scope.spawn(guarded)).collect();
        handles.into_iter().try_for_each(|handle| match handle.join() {
            Ok(result) => result,
            Err(panic) => std::panic::resume_unwind(panic),
        })
    })
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
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn one_that_fails_or_panics_stops_the_others() {
        for panics in [false, true] {
            let next = AtomicUsize::new(0);
            let outcome = std::panic::catch_unwind(|| {
                run(3, |stop| {
                    if next.fetch_add(1, Ordering::Relaxed) == 1 {
                        assert!(!panics, "as asked");
                        anyhow::bail!("failed");
                    }
                    while !stop.load(Ordering::Relaxed) {
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
        assert!(run(0, |_| Ok(())).is_ok());
    }
}
