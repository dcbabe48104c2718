//! Work on all threads of this process, begun only where the system grants threads and memory for it.

use overtaking_core::pool::process_pool;
use pyo3::prelude::*;

/// Memory that a thread allocates to advance its simulations: states, histories and frames of four blocks of sixteen
/// simulations with 32 vehicles each take less than this.
const THREAD_BYTES: usize = 4 << 20;

/// Memory that the engine allocates for each simulation beside the arrays of the caller: where its results go, and
/// the values of its answers before they are transposed.
pub const SIMULATION_BYTES: usize = 2048;

/// Do work on the threads of this process, while other Python threads run.
///
/// `room` is the memory that the work allocates at most, without that of each thread [bytes].
///
/// # Errors
/// `SystemLimitError`: The system starts no more threads or grants no more memory.
pub fn spread<R: Send>(
    py: Python<'_>,
    room: usize,
    work: impl FnOnce() -> R + Send,
) -> PyResult<R> {
    let pool = process_pool().map_err(no_threads)?;
    expect_room(room.saturating_add(pool.current_num_threads() * THREAD_BYTES))?;
    Ok(py.detach(|| pool.install(work)))
}

/// Refuse to begin work for which the system grants too little memory.
///
/// Rust ends the process when an allocation fails. Memory for all of the work is therefore allocated in a way that
/// can fail, and freed again, before the work begins.
///
/// # Errors
/// `SystemLimitError`: The system grants less.
pub fn expect_room(bytes: usize) -> PyResult<()> {
    reserved::<u8>(bytes).map(drop)
}

/// An empty vector with room for some elements.
///
/// # Errors
/// `SystemLimitError`: The system grants less memory.
pub fn reserved<T>(count: usize) -> PyResult<Vec<T>> {
    let mut room = Vec::new();
    let answer = room.try_reserve_exact(count);
    answer.map_err(|error| system_limit("memory_error", &error.to_string()))?;
    Ok(room)
}

/// The Python error for threads that do not start.
pub fn no_threads(message: String) -> PyErr {
    system_limit("thread_error", &message)
}

/// A `SystemLimitError`, made by a function of the Python package with the answer of the system.
fn system_limit(function: &str, answer: &str) -> PyErr {
    Python::attach(|py| {
        py.import("overtaking.core.process_limits")
            .and_then(|module| module.call_method1(function, ("engine", answer)))
            .map_or_else(|error| error, PyErr::from_value)
    })
}
