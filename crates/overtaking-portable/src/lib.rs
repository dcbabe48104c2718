//! The engine of `overtaking-core` for every CPU of an architecture, and the choice of the crate for a
//! SIMD level; see `overtaking-avx`.

use fearless_simd::Level;
use overtaking_core::stepper::{Talk, serve};
use overtaking_core::{Inputs, Later, Output, simulate};

/// Call what is compiled for a SIMD level of this CPU: the functions for AVX-512, for AVX2, and for others.
macro_rules! at_level {
    ($level:expr, $avx512:path, $avx2:path, $other:path, ($($argument:expr),*)) => {
        match $level {
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Level::Avx512(simd) => $avx512(simd, $($argument),*),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Level::Avx2(simd) => $avx2(simd, $($argument),*),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Level::Sse4_2(_) | Level::Sse2(_) => match $level.as_sse2() {
                Some(simd) => $other(simd, $($argument),*),
                None => unreachable!("a level above SSE2 has SSE2"),
            },
            #[cfg(target_arch = "aarch64")]
            Level::Neon(simd) => $other(simd, $($argument),*),
            #[cfg(not(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64")))]
            Level::Fallback(simd) => $other(simd, $($argument),*),
            _ => unreachable!("every level of this architecture is handled"),
        }
    };
}

/// Simulate a batch at a SIMD level of this CPU.
///
/// # Errors
/// Those of `overtaking_core::simulate`.
pub fn simulate_at(
    level: Level,
    inputs: &Inputs<'_>,
    later: &[Later<'_>],
    out: Output<'_>,
) -> Result<(), String> {
    at_level!(
        level,
        overtaking_avx::avx512,
        overtaking_avx::avx2,
        simulate,
        (inputs, later, out)
    )
}

/// Serve another driver of a batch at a SIMD level of this CPU.
///
/// # Errors
/// Those of `overtaking_core::stepper::serve`.
pub fn serve_at(level: Level, inputs: &Inputs<'_>, talk: &Talk) -> Result<(), String> {
    at_level!(
        level,
        overtaking_avx::serve_avx512,
        overtaking_avx::serve_avx2,
        serve,
        (inputs, talk)
    )
}
