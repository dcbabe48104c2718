//! The thread pool that all parallel work of the engine in this process shares.

use std::process::id;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicPtr, Ordering};

use rayon::{ThreadPool, ThreadPoolBuilder};

/// A pool and the id of the process that built it.
struct ProcessPool {
    process: u32,
    pool: ThreadPool,
}

/// The pool that was built last, by this process or by an ancestor that forked. It is an atomic pointer and
/// not a mutex, because a mutex that another thread holds during a fork stays locked in the child.
static LAST_BUILT: AtomicPtr<ProcessPool> = AtomicPtr::new(null_mut());

/// The thread pool of this process.
///
/// A forked child does not have its parent's threads, so work in the parent's pool would never start. Each
/// process therefore builds a pool at its first call. The parent's pool stays in the child's memory, because
/// dropping it would wait for threads that do not exist.
///
/// # Errors
/// The system starts no more threads; the text is its message.
pub fn process_pool() -> Result<&'static ThreadPool, String> {
    let last = LAST_BUILT.load(Ordering::Acquire);
    // SAFETY: The pointer is null or comes from `Box::into_raw` below, and is never freed.
    match unsafe { last.as_ref() } {
        Some(built) if built.process == id() => Ok(&built.pool),
        _ => build_pool(last),
    }
}

/// Build the pool of this process, and store it in place of the last one.
fn build_pool(last: *mut ProcessPool) -> Result<&'static ThreadPool, String> {
    let pool = ThreadPoolBuilder::new()
        .build()
        .map_err(|error| error.to_string())?;
    let process = id();
    let new = Box::into_raw(Box::new(ProcessPool { process, pool }));
    match LAST_BUILT.compare_exchange(last, new, Ordering::AcqRel, Ordering::Acquire) {
        // SAFETY: Nothing frees a pointer that was stored.
        Ok(_) => Ok(unsafe { &(*new).pool }),
        Err(stored) => {
            // Another thread of this process has stored a pool meanwhile.
            // SAFETY: `new` was not stored, so no other thread has it; `stored` is never freed.
            unsafe {
                drop(Box::from_raw(new));
                Ok(&(*stored).pool)
            }
        }
    }
}
