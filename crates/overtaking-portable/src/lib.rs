//! The engine of `overtaking-core` for every CPU of an architecture, and the choice of the crate for a
//! SIMD level; see `overtaking-avx`.

use fearless_simd::Level;
use overtaking_core::run::stepped_batch::Talk;
use overtaking_core::{Inputs, Output, ParameterSwitch};

/// Call what is compiled for a SIMD level of this CPU: the functions for AVX-512, for AVX2, and for others.
macro_rules! at_level {
    ($level:expr, $avx512:path, $avx2:path, $other:path, ($($argument:expr),*)) => {
        match $level {
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Level::Avx512(simd) => $avx512(simd, $($argument),*),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Level::Avx2(simd) => $avx2(simd, $($argument),*),
            #[cfg(all(portable, any(target_arch = "x86", target_arch = "x86_64")))]
            Level::Sse4_2(_) | Level::Sse2(_) => match $level.as_sse2() {
                Some(simd) => $other(simd, $($argument),*),
                None => unreachable!("a level above SSE2 has SSE2"),
            },
            #[cfg(target_arch = "aarch64")]
            Level::Neon(simd) => $other(simd, $($argument),*),
            #[cfg(not(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64")))]
            Level::Fallback(simd) => $other(simd, $($argument),*),
            _ => Err(overtaking_avx::NOT_COMPILED.to_string()),
        }
    };
}

/// Whether a SIMD level is compiled, by its name.
pub fn is_compiled(name: &str) -> bool {
    match name {
        "avx512" => overtaking_avx::HAS_AVX512,
        "avx2" => overtaking_avx::HAS_AVX2,
        _ => cfg!(portable),
    }
}

/// Simulate a batch at a SIMD level of this CPU.
///
/// # Errors
/// Those of `overtaking_core::simulate`; the level is not compiled.
pub fn simulate_at(
    level: Level,
    inputs: &Inputs<'_>,
    later: &[ParameterSwitch<'_>],
    out: Output<'_>,
) -> Result<(), String> {
    at_level!(
        level,
        overtaking_avx::avx512,
        overtaking_avx::avx2,
        overtaking_core::simulate,
        (inputs, later, out)
    )
}

/// Serve another driver of a batch at a SIMD level of this CPU.
///
/// # Errors
/// Those of `overtaking_core::run::stepped_batch::stepped_batch`; the level is not compiled.
pub fn serve_at(level: Level, inputs: &Inputs<'_>, talk: &Talk) -> Result<(), String> {
    at_level!(
        level,
        overtaking_avx::serve_avx512,
        overtaking_avx::serve_avx2,
        overtaking_core::run::stepped_batch::stepped_batch,
        (inputs, talk)
    )
}
