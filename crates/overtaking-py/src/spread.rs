//! Work on all threads of this process.

use overtaking_core::pool::process_pool;
use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;

/// Do work on the threads of this process, while other Python threads run.
///
/// # Errors
/// `OSError`: The system starts no more threads.
pub fn spread<R: Send>(py: Python<'_>, work: impl FnOnce() -> R + Send) -> PyResult<R> {
    let pool = process_pool().map_err(no_threads)?;
    Ok(py.detach(|| pool.install(work)))
}

/// The Python error for threads that do not start.
pub fn no_threads(message: String) -> PyErr {
    PyOSError::new_err(message)
}
