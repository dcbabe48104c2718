//! The engine of `overtaking-core` for x86 CPUs with AVX2 or AVX-512.
//!
//! A crate of its own, because cargo compiles crates at the same time, but the functions of a crate that
//! have to be inlined into each other one after the other.
#![cfg(any(target_arch = "x86", target_arch = "x86_64"))]

use fearless_simd::x86::{Avx2, Avx512};
use overtaking_core::stepper::{Talk, serve};
use overtaking_core::{Inputs, Later, Output, simulate};

/// Simulate a batch with AVX2.
///
/// # Errors
/// Those of `overtaking_core::simulate`.
pub fn avx2(
    simd: Avx2,
    inputs: &Inputs<'_>,
    later: &[Later<'_>],
    out: Output<'_>,
) -> Result<(), String> {
    simulate(simd, inputs, later, out)
}

/// Simulate a batch with AVX-512.
///
/// # Errors
/// Those of `overtaking_core::simulate`.
pub fn avx512(
    simd: Avx512,
    inputs: &Inputs<'_>,
    later: &[Later<'_>],
    out: Output<'_>,
) -> Result<(), String> {
    simulate(simd, inputs, later, out)
}

/// Serve another driver of a batch with AVX2.
///
/// # Errors
/// Those of `overtaking_core::stepper::serve`.
pub fn serve_avx2(simd: Avx2, inputs: &Inputs<'_>, talk: &Talk) -> Result<(), String> {
    serve(simd, inputs, talk)
}

/// Serve another driver of a batch with AVX-512.
///
/// # Errors
/// Those of `overtaking_core::stepper::serve`.
pub fn serve_avx512(simd: Avx512, inputs: &Inputs<'_>, talk: &Talk) -> Result<(), String> {
    serve(simd, inputs, talk)
}
