//! The functions of each SIMD level; those of a level that is not compiled fail.

use fearless_simd::x86::{Avx2, Avx512};
use overtaking_core::run::stepped_batch::Talk;
use overtaking_core::{Inputs, Output, ParameterSwitch};

macro_rules! level {
    ($name:ident, $serve:ident, $simd:ident) => {
        /// Simulate a batch at this level.
        ///
        /// # Errors
        /// Those of `overtaking_core::simulate`; the level is not compiled.
        #[cfg($name)]
        pub fn $name(
            simd: $simd,
            inputs: &Inputs<'_>,
            later: &[ParameterSwitch<'_>],
            out: Output<'_>,
        ) -> Result<(), String> {
            overtaking_core::simulate(simd, inputs, later, out)
        }

        /// Serve another driver of a batch at this level.
        ///
        /// # Errors
        /// Those of `overtaking_core::run::stepped_batch::stepped_batch`; the level is not compiled.
        #[cfg($name)]
        pub fn $serve(simd: $simd, inputs: &Inputs<'_>, talk: &Talk) -> Result<(), String> {
            overtaking_core::run::stepped_batch::stepped_batch(simd, inputs, talk)
        }

        /// Refuse, as this level is not compiled.
        ///
        /// # Errors
        /// Always.
        #[cfg(not($name))]
        pub fn $name(
            _: $simd,
            _: &Inputs<'_>,
            _: &[ParameterSwitch<'_>],
            _: Output<'_>,
        ) -> Result<(), String> {
            Err(crate::NOT_COMPILED.to_string())
        }

        /// Refuse, as this level is not compiled.
        ///
        /// # Errors
        /// Always.
        #[cfg(not($name))]
        pub fn $serve(_: $simd, _: &Inputs<'_>, _: &Talk) -> Result<(), String> {
            Err(crate::NOT_COMPILED.to_string())
        }
    };
}

level!(avx512, serve_avx512, Avx512);
level!(avx2, serve_avx2, Avx2);
