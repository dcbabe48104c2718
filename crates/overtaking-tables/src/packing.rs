//! Compression of pages: Zstandard, with what each thread has set up for it used again.

use std::cell::RefCell;
use std::io::Result;

use zstd::bulk::Compressor;

/// As fast as it gets without being much larger; what pyarrow takes if it is not told.
const LEVEL: i32 = 1;

/// A page that is shorter is not worth the frame around it.
const LEAST_BYTES: usize = 64;

thread_local! {
    static COMPRESSOR: RefCell<Option<Compressor<'static>>> = const { RefCell::new(None) };
}

/// Some bytes compressed.
///
/// # Errors
///
/// If there is no memory for it.
pub fn compressed(whole: &[u8]) -> Result<Vec<u8>> {
    COMPRESSOR.with_borrow_mut(|slot| {
        let compressor = match slot {
            Some(known) => known,
            None => slot.insert(Compressor::new(LEVEL)?),
        };
        compressor.compress(whole)
    })
}

/// Some bytes compressed, if that saves a sixteenth of them.
///
/// # Errors
///
/// As for `compressed`.
pub fn worthwhile(whole: &[u8]) -> Result<Option<Vec<u8>>> {
    if whole.len() < LEAST_BYTES {
        return Ok(None);
    }
    let small = compressed(whole)?;
    Ok((small.len() <= whole.len() - whole.len() / 16).then_some(small))
}
