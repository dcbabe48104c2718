//! The engine of `overtaking-core` for x86 CPUs with AVX2 or AVX-512.
//!
//! It is a crate of its own because cargo compiles several crates at the same time. Functions that are inlined into
//! each other have to be in one crate, which one core compiles. `build.rs` chooses the levels.

/// Message of calls at a SIMD level that is not compiled.
pub const NOT_COMPILED: &str =
    "this SIMD level is not compiled: build again without OVERTAKING_LEVELS";

/// Whether AVX-512 is compiled.
pub const HAS_AVX512: bool = cfg!(avx512);

/// Whether AVX2 is compiled.
pub const HAS_AVX2: bool = cfg!(avx2);

/// The entry points of the engine at one SIMD level. If the level is not compiled, they return `NOT_COMPILED`.
///
/// `$level` is the flag that `build.rs` sets if it compiles the level, and the name of the function that simulates.
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
macro_rules! entry_points {
    ($level:ident, $stepped:ident, $externally_moved:ident, $simd:ident) => {
        /// Simulate a batch at this level.
        ///
        /// # Errors
        /// `overtaking_core::simulate` refuses the inputs, or the level is not compiled.
        pub fn $level(
            simd: fearless_simd::x86::$simd,
            inputs: &overtaking_core::Inputs<'_>,
            switches: &[overtaking_core::ParameterSwitch<'_>],
            out: overtaking_core::Output<'_>,
        ) -> Result<(), String> {
            #[cfg($level)]
            let result = overtaking_core::simulate(simd, inputs, switches, out);
            #[cfg(not($level))]
            let result = refuse((simd, inputs, switches, out));
            result
        }

        /// Make a batch that waits for an external driver, at this level.
        ///
        /// # Errors
        /// `overtaking_core::run::stepped_batch::stepped_batch` refuses the inputs, or the level is not compiled.
        pub fn $stepped(
            simd: fearless_simd::x86::$simd,
            inputs: &overtaking_core::Inputs<'_>,
            kind: Option<overtaking_core::ego_action::ActionKind>,
            source: overtaking_core::observation_table::ObservationSource,
        ) -> Result<Box<dyn overtaking_core::run::stepped_batch::SteppedBatch>, String> {
            #[cfg($level)]
            let result =
                overtaking_core::run::stepped_batch::stepped_batch(simd, inputs, kind, source);
            #[cfg(not($level))]
            let result = refuse((simd, inputs, kind, source));
            result
        }

        /// Prepare a simulation whose vehicles another simulator moves, at this level.
        ///
        /// # Errors
        /// `overtaking_core::external_motion::externally_moved` refuses the inputs, or the level is not compiled.
        pub fn $externally_moved(
            simd: fearless_simd::x86::$simd,
            inputs: &overtaking_core::Inputs<'_>,
            tick: f32,
            out: overtaking_core::Output<'_>,
        ) -> Result<Box<dyn overtaking_core::external_motion::ExternallyMoved>, String> {
            #[cfg($level)]
            let result =
                overtaking_core::external_motion::externally_moved(simd, inputs, tick, out);
            #[cfg(not($level))]
            let result = refuse((simd, inputs, tick, out));
            result
        }
    };
}
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
entry_points!(
    avx512,
    stepped_batch_avx512,
    externally_moved_avx512,
    Avx512
);
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
entry_points!(avx2, stepped_batch_avx2, externally_moved_avx2, Avx2);

/// The result of a call at a level that is not compiled. The function takes the arguments of the call, so that they
/// count as used.
#[cfg(all(
    any(target_arch = "x86", target_arch = "x86_64"),
    not(all(avx512, avx2))
))]
fn refuse<T, R>(_: T) -> Result<R, String> {
    Err(NOT_COMPILED.to_string())
}
