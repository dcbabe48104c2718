//! Parameters and constants by name, in the order in which Python hands them over. Their names are in
//! `names.rs`, which `crates/fields.py` makes from their declarations in Python.

/// A struct whose fields are loaded in order from rows of sixteen numbers.
macro_rules! lane_fields {
    ($(#[$doc:meta])* $name:ident, $names:ident { $($field:ident),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub struct $name<S: Simd> { $(pub(crate) $field: V<S>),* }

        /// Names of the fields, in the order in which they are handed over.
        pub const $names: &[&str] = &[$(stringify!($field)),*];

        impl<S: Simd> Seats for $name<S> {
            fn seat(&mut self, lane: usize, from: &Self, other: usize) {
                $(self.$field.seat(lane, &from.$field, other);)*
            }
        }

        impl<S: Simd> $name<S> {
            /// Fill the fields from consecutive rows.
            #[inline(always)]
            pub(crate) fn load(simd: S, mut row: impl FnMut(usize) -> [f32; LANES]) -> Self {
                let mut at = 0;
                $(
                    let $field = V::simd_from(simd, row(at));
                    at += 1;
                )*
                debug_assert_eq!(at, $names.len());
                Self { $($field),* }
            }
        }
    };
}

/// A struct of numbers filled in order from a slice.
macro_rules! number_fields {
    ($(#[$doc:meta])* $name:ident { $($field:ident),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default)]
        pub struct $name {
            $(
                #[allow(missing_docs)] // `overtaking.world.constants` documents them.
                pub $field: f32,
            )*
            /// Peak friction of a new tyre at (speed, film) station_indices.
            pub friction_new: [[f32; 4]; 3],
            /// The same of a worn one.
            pub friction_worn: [[f32; 4]; 3],
            /// Speed station_indices [m/s].
            pub friction_speeds: [f32; 3],
            /// Film station_indices [mm].
            pub friction_films: [f32; 4],
        }

        impl $name {
            /// Names of the numbers, in order.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($field)),*];

            /// Set the numbers from a slice in the order of `NAMES`.
            ///
            /// # Panics
            /// If the slice has another length.
            pub fn set(&mut self, values: &[f32]) {
                assert_eq!(values.len(), Self::NAMES.len());
                let mut rest = values.iter();
                $(if let Some(value) = rest.next() { self.$field = *value; })*
            }
        }
    };
}
