//! The engine of `overtaking-core` for x86 CPUs with AVX2 or AVX-512.
//!
//! A crate of its own, because cargo compiles crates at the same time, but the functions of a crate that
//! have to be inlined into each other one after the other. `build.rs` chooses the levels.

/// What calls of a level that is not compiled answer.
pub const NOT_COMPILED: &str =
    "this SIMD level is not compiled: build again without OVERTAKING_LEVELS";

/// Whether AVX-512 is compiled.
pub const HAS_AVX512: bool = cfg!(avx512);

/// Whether AVX2 is compiled.
pub const HAS_AVX2: bool = cfg!(avx2);

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
mod levels;
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
pub use levels::{avx2, avx512, serve_avx2, serve_avx512};
