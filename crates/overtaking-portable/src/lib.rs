//! The engine of `overtaking-core` at the portable SIMD level, which every CPU of an architecture has.
//!
//! The functions choose the engine of a SIMD level: `overtaking-avx` for AVX2 and AVX-512, else the portable one.

use fearless_simd::Level;
use overtaking_core::ego_action::ActionKind;
use overtaking_core::external_motion::{ExternallyMoved, externally_moved};
use overtaking_core::observation_table::ObservationSource;
use overtaking_core::run::stepped_batch::{SteppedBatch, stepped_batch};
use overtaking_core::{Inputs, Output, ParameterSwitch, dispatch, simulate};

/// Whether a SIMD level is compiled, by its name in `overtaking_core::simd_levels`.
pub fn is_compiled(name: &str) -> bool {
    match name {
        "avx512" => overtaking_avx::HAS_AVX512,
        "avx2" => overtaking_avx::HAS_AVX2,
        // `build.rs` sets `portable`, unless the build is for the present CPU alone and that CPU has AVX2.
        _ => cfg!(portable),
    }
}

/// Simulate a batch at a SIMD level of this CPU.
///
/// # Errors
/// `overtaking_core::simulate` refuses the inputs, or the level is not compiled.
pub fn simulate_at(
    level: Level,
    inputs: &Inputs<'_>,
    switches: &[ParameterSwitch<'_>],
    out: Output<'_>,
) -> Result<(), String> {
    dispatch!(level, |simd|
        avx512: overtaking_avx::avx512(simd, inputs, switches, out),
        avx2: overtaking_avx::avx2(simd, inputs, switches, out),
        portable: if_compiled(simd, |simd| simulate(simd, inputs, switches, out)))
}

/// Make a batch that waits for an external driver, at a SIMD level of this CPU.
///
/// # Errors
/// `stepped_batch` refuses the inputs, or the level is not compiled.
pub fn stepped_batch_at(
    level: Level,
    inputs: &Inputs<'_>,
    kind: Option<ActionKind>,
    source: ObservationSource,
) -> Result<Box<dyn SteppedBatch>, String> {
    dispatch!(level, |simd|
        avx512: overtaking_avx::stepped_batch_avx512(simd, inputs, kind, source),
        avx2: overtaking_avx::stepped_batch_avx2(simd, inputs, kind, source),
        portable: if_compiled(simd, |simd| stepped_batch(simd, inputs, kind, source)))
}

/// Prepare a simulation whose vehicles another simulator moves, at a SIMD level of this CPU.
///
/// # Errors
/// `externally_moved` refuses the inputs, or the level is not compiled.
pub fn externally_moved_at(
    level: Level,
    inputs: &Inputs<'_>,
    tick: f32,
    out: Output<'_>,
) -> Result<Box<dyn ExternallyMoved>, String> {
    dispatch!(level, |simd|
        avx512: overtaking_avx::externally_moved_avx512(simd, inputs, tick, out),
        avx2: overtaking_avx::externally_moved_avx2(simd, inputs, tick, out),
        portable: if_compiled(simd, |simd| externally_moved(simd, inputs, tick, out)))
}

/// Run the engine at the level of every CPU; `NOT_COMPILED` where that level is not compiled.
#[cfg(portable)]
fn if_compiled<S, T>(simd: S, run: impl FnOnce(S) -> Result<T, String>) -> Result<T, String> {
    run(simd)
}

#[cfg(not(portable))]
fn if_compiled<S, T>(_: S, _: impl FnOnce(S) -> Result<T, String>) -> Result<T, String> {
    Err(overtaking_avx::NOT_COMPILED.to_string())
}
