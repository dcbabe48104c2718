//! The engine of `overtaking-core` for every CPU of an architecture; see `overtaking-avx`.

#[cfg(not(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64")))]
use fearless_simd::Fallback as Portable;
#[cfg(target_arch = "aarch64")]
use fearless_simd::Neon as Portable;
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
use fearless_simd::x86::Sse2 as Portable;
use overtaking_core::stepper::{Talk, serve};
use overtaking_core::{Inputs, Later, Output, simulate};

/// Simulate a batch with the vectors that every CPU has.
///
/// # Errors
/// Those of `overtaking_core::simulate`.
pub fn portable(
    simd: Portable,
    inputs: &Inputs<'_>,
    later: Option<&Later<'_>>,
    out: Output<'_>,
) -> Result<(), String> {
    simulate(simd, inputs, later, out)
}

/// Serve another driver of a batch with the vectors that every CPU has.
///
/// # Errors
/// Those of `overtaking_core::stepper::serve`.
pub fn serve_portable(simd: Portable, inputs: &Inputs<'_>, talk: &Talk) -> Result<(), String> {
    serve(simd, inputs, talk)
}
