//! Errors of Rust as exceptions of Python.

use anyhow::Result;
use grip::progress::Interrupted;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt};
use pyo3::prelude::*;

pyo3::create_exception!(
    grip,
    Error,
    PyException,
    "What could not be done, and why: the text that the command `grip` prints."
);

/// The same as an exception: that of Python's own code where it was the cause.
pub fn exception(error: anyhow::Error) -> PyErr {
    if error.is::<Interrupted>() {
        return PyKeyboardInterrupt::new_err(());
    }
    match error.downcast::<PyErr>() {
        Ok(cause) => cause,
        Err(error) => Error::new_err(format!("{error:#}")),
    }
}

/// Does `work`, whose errors are raised.
pub fn raised<T>(work: impl FnOnce() -> Result<T>) -> PyResult<T> {
    work().map_err(exception)
}
