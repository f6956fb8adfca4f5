//! Verbs of the command, run for Python: work goes on in a thread of its own while Python's waits for it without its lock, hears Ctrl-C,
//! and lets other threads run.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result};
use grip::commands::{self, Caller, Given};
use grip::experiment::plan;
use grip::progress::Progress;
use pyo3::panic::PanicException;
use pyo3::prelude::*;
use serde_json::{Map, Value};

use crate::error::{exception, raised};
use crate::process::shares_threads;
use crate::{estimators, graspers};

/// How often Ctrl-C is looked for.
const LISTEN_EVERY: Duration = Duration::from_millis(20);
/// As much as a program's first thread has.
const STACK: usize = 8 << 20;

/// Does `work` while Python's other threads go on. At Ctrl-C it is told so by the flag, and waited for.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&Arc<AtomicBool>) -> Result<T> + Send,
) -> PyResult<T> {
    let cancelled = Arc::new(AtomicBool::new(false));
    let (sender, receiver) = mpsc::channel();
    // The one that waits need not be this thread while it is without Python's lock.
    let receiver = Mutex::new(receiver);
    std::thread::scope(|scope| {
        let flag = &cancelled;
        let worker = std::thread::Builder::new().name("grip".into()).stack_size(STACK);
        let handle = worker.spawn_scoped(scope, move || {
            let done = work(flag);
            let _ = sender.send(());
            done
        })?;
        let mut interruption = None;
        loop {
            match py
                .detach(|| receiver.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LISTEN_EVERY))
            {
                // The sender is gone without a word when the work has panicked.
                Ok(()) | Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => {
                    if let Err(signal) = py.check_signals() {
                        cancelled.store(true, Ordering::Relaxed);
                        interruption.get_or_insert(signal);
                    }
                }
            }
        }
        let done = py.detach(|| handle.join());
        match (done, interruption) {
            (Ok(Ok(value)), None) => Ok(value),
            (_, Some(signal)) => Err(signal),
            (Ok(Err(error)), None) => Err(exception(error)),
            (Err(_), None) => Err(PanicException::new_err(
                "grip panicked: this is a mistake in the program; please report it",
            )),
        }
    })
}

/// What a verb has said.
#[derive(Default)]
struct Said {
    data: Mutex<String>,
    messages: Mutex<Vec<String>>,
    made: Mutex<Vec<PathBuf>>,
}

/// Who is told of it.
struct Told {
    said: Arc<Said>,
    /// Called with the unit of a piece of work; what it returns has `begin`, `advance`, `message` and `warn`.
    progress: Option<Py<PyAny>>,
    cancelled: Arc<AtomicBool>,
}

impl Caller for Told {
    fn data(&self, line: &str) {
        let mut data = self.said.data.lock().unwrap_or_else(PoisonError::into_inner);
        data.push_str(line);
        data.push('\n');
    }

    fn message(&self, line: &str) {
        self.said.messages.lock().unwrap_or_else(PoisonError::into_inner).push(line.to_owned());
    }

    fn made(&self, path: &Path) {
        self.said.made.lock().unwrap_or_else(PoisonError::into_inner).push(path.to_owned());
    }

    fn progress(&self, unit: &str) -> Box<dyn Progress + Send> {
        let shown = self.progress.as_ref().and_then(|progress| {
            Python::attach(|py| {
                let shown = progress.bind(py).call1((unit,));
                shown.map(Bound::unbind).map_err(|error| error.write_unraisable(py, None)).ok()
            })
        });
        Box::new(Shown { shown, said: self.said.clone(), cancelled: self.cancelled.clone() })
    }
}

/// Progress as Python shows it. What goes wrong in showing it spoils no work.
struct Shown {
    shown: Option<Py<PyAny>>,
    said: Arc<Said>,
    cancelled: Arc<AtomicBool>,
}

impl Shown {
    fn with(&self, call: impl FnOnce(Python<'_>, &Py<PyAny>) -> PyResult<Py<PyAny>>) {
        if let Some(shown) = &self.shown {
            Python::attach(|py| {
                if let Err(error) = call(py, shown) {
                    error.write_unraisable(py, Some(shown.bind(py)));
                }
            });
        }
    }
}

impl Progress for Shown {
    fn begin(&self, pieces: u64, done: u64) {
        self.with(|py, shown| shown.call_method1(py, "begin", (pieces, done)));
    }

    fn advance(&self, pieces: u64) {
        self.with(|py, shown| shown.call_method1(py, "advance", (pieces,)));
    }

    fn message(&self, text: &str) {
        self.with(|py, shown| shown.call_method1(py, "message", (text,)));
    }

    fn warn(&self, text: &str) {
        self.said.messages.lock().unwrap_or_else(PoisonError::into_inner).push(text.to_owned());
    }

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

/// Runs a verb of the command with options as JSON. Returns its exit code (never 2: that is an error), what it printed, its
/// messages, and the files that it made where it chose.
///
/// `estimators` and `graspers` are, where given, lists of words of the command line and of pairs of a name and a function.
#[pyfunction]
#[pyo3(signature = (verb, options, estimators = None, graspers = None, progress = None))]
pub fn call(
    py: Python<'_>,
    verb: &str,
    options: &str,
    estimators: Option<Vec<Bound<'_, PyAny>>>,
    graspers: Option<Vec<Bound<'_, PyAny>>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(u8, String, Vec<String>, Vec<PathBuf>)> {
    let options: Map<String, Value> = raised(|| serde_json::from_str(options).context("options"))?;
    let given = raised(|| {
        let estimators = estimators.map(|all| all.iter().map(estimators::kind).collect()).transpose()?;
        let graspers = graspers.map(|all| all.iter().map(graspers::kind).collect()).transpose()?;
        Ok(Given { estimators, graspers })
    })?;
    raised(shares_threads)?;
    let said = Arc::new(Said::default());
    tells_its_file(py)?;
    let code = interruptible(py, |cancelled| {
        let told = Told { said: said.clone(), progress, cancelled: cancelled.clone() };
        commands::call(verb, &options, given, Arc::new(told))
    })?;
    fn taken<T: Default>(said: &Mutex<T>) -> T {
        std::mem::take(&mut *said.lock().unwrap_or_else(PoisonError::into_inner))
    }
    Ok((code, taken(&said.data), taken(&said.messages), taken(&said.made)))
}

/// The command `grip` itself, with `arguments` behind its name; prints, and returns its exit code. At Ctrl-C the process ends.
#[pyfunction]
pub fn main(py: Python<'_>, arguments: Vec<OsString>) -> PyResult<u8> {
    tells_its_file(py)?;
    Ok(py.detach(|| commands::code([OsString::from("grip")].into_iter().chain(arguments))))
}

/// The program that results are of is this module, and not Python's.
fn tells_its_file(py: Python<'_>) -> PyResult<()> {
    plan::program_is(py.import("grip._grip")?.getattr("__file__")?.extract()?);
    Ok(())
}
