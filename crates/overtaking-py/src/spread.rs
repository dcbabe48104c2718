//! Parallel work that begins only if the system grants enough threads and memory; otherwise Python gets an error.

use overtaking_core::pool::process_pool;
use pyo3::prelude::*;

/// Estimate of the memory that a thread needs to simulate [bytes]: 512 numbers of 4 bytes for each vehicle of 8
/// blocks of 16 simulations with 32 vehicles, for parameters, states, histories and frames.
const THREAD_BYTES: usize = 8 << 20;

/// Estimate of the memory that the engine needs for each simulation in addition to the caller's arrays [bytes]: views
/// of the outputs, and results before they are transposed.
pub const SIMULATION_BYTES: usize = 2048;

/// Run `work` in the thread pool of this process, while other Python threads run.
///
/// `work_bytes` is the largest amount of memory that the work allocates besides the `THREAD_BYTES` of each thread.
///
/// # Errors
/// `SystemLimitError`: The system starts no more threads or grants no more memory.
pub fn run_in_pool<R: Send>(
    py: Python<'_>,
    work_bytes: usize,
    work: impl FnOnce() -> R + Send,
) -> PyResult<R> {
    let pool = process_pool().map_err(no_threads)?;
    expect_memory(work_bytes.saturating_add(pool.current_num_threads() * THREAD_BYTES))?;
    run_without_memory_check(py, work)
}

/// As `run_in_pool`, for work whose memory an earlier call has allocated.
///
/// # Errors
/// `SystemLimitError`: The system starts no more threads.
pub fn run_without_memory_check<R: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> R + Send,
) -> PyResult<R> {
    let pool = process_pool().map_err(no_threads)?;
    Ok(py.detach(|| pool.install(work)))
}

/// Refuse to begin work for which the system grants too little memory.
///
/// Rust ends the process when an allocation fails. Memory for all of the work is therefore allocated in a way that
/// can fail, and freed again, before the work begins.
///
/// # Errors
/// `SystemLimitError`: The system grants less memory.
pub fn expect_memory(bytes: usize) -> PyResult<()> {
    reserve::<u8>(bytes).map(drop)
}

/// Allocate an empty vector with memory for `count` elements.
///
/// # Errors
/// `SystemLimitError`: The system grants less memory.
pub fn reserve<T>(count: usize) -> PyResult<Vec<T>> {
    let mut elements = Vec::new();
    let reservation = elements.try_reserve_exact(count);
    reservation.map_err(|error| system_limit("memory_error", &error.to_string()))?;
    Ok(elements)
}

/// The Python error for threads that do not start; `message` is the answer of the system.
pub fn no_threads(message: String) -> PyErr {
    system_limit("thread_error", &message)
}

/// Make a `SystemLimitError` with `function` of `overtaking.core.process_limits` and the answer of the system.
///
/// The texts of errors are in Python, so that both languages have the same. An error of the call itself is returned.
fn system_limit(function: &str, answer: &str) -> PyErr {
    Python::attach(|py| {
        py.import("overtaking.core.process_limits")
            .and_then(|module| module.call_method1(function, ("engine", answer)))
            .map_or_else(|error| error, PyErr::from_value)
    })
}
