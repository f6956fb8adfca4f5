//! Threads that outlive a call, and processes that were forked from one that had some: these are only in the parent.

use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context, Result, bail};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// This process's own threads.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);
/// The process in which threads that everybody shares have been started.
static SHARED: Mutex<Option<u32>> = Mutex::new(None);

/// Does `work` on threads of this process, also in one that was forked from another with threads.
pub fn pooled<T: Send>(work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let pool = {
        let mut known = POOL.lock().unwrap_or_else(PoisonError::into_inner);
        let process = std::process::id();
        match &*known {
            Some((of, pool)) if *of == process => pool.clone(),
            _ => {
                let pool = ThreadPoolBuilder::new().build().context("no threads can be started")?;
                let pool = Arc::new(pool);
                // That of the parent has no threads here, and could not be waited for.
                std::mem::forget(known.replace((process, pool.clone())));
                pool
            }
        }
    };
    pool.install(work)
}

/// Before work that starts threads of its own, which share a pool for as long as the process lives.
///
/// # Errors
/// In a process that was forked from one in which they run: here they would be waited for in vain.
pub fn shares_threads() -> Result<()> {
    let process = std::process::id();
    let mut known = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
    match *known.get_or_insert(process) {
        of if of == process => Ok(()),
        of => bail!(
            "this process was forked from process {of}, in which grip has threads that were not forked with it; start processes by \
             multiprocessing.get_context(\"spawn\"), or call this function in no process but the new ones"
        ),
    }
}
