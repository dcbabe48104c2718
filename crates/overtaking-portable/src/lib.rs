//! The engine of `overtaking-core` for every CPU of an architecture, and the choice of the crate for a
//! SIMD level; see `overtaking-avx`.

use fearless_simd::Level;
use overtaking_core::{Inputs, Later, Output, simulate};

/// Simulate a batch at a SIMD level of this CPU.
///
/// # Errors
/// Those of `overtaking_core::simulate`.
pub fn simulate_at(
    level: Level,
    inputs: &Inputs<'_>,
    later: Option<&Later<'_>>,
    out: Output<'_>,
) -> Result<(), String> {
    match level {
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Level::Avx512(simd) => overtaking_avx::avx512(simd, inputs, later, out),
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Level::Avx2(simd) => overtaking_avx::avx2(simd, inputs, later, out),
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Level::Sse4_2(_) | Level::Sse2(_) => match level.as_sse2() {
            Some(simd) => simulate(simd, inputs, later, out),
            None => unreachable!("a level above SSE2 has SSE2"),
        },
        #[cfg(target_arch = "aarch64")]
        Level::Neon(simd) => simulate(simd, inputs, later, out),
        #[cfg(not(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64")))]
        Level::Fallback(simd) => simulate(simd, inputs, later, out),
        _ => unreachable!("every level of this architecture is handled"),
    }
}
