//! The buffer of recorded frames, and the transposition that moves them to the output arrays.
//!
//! The engine computes one frame (recorded instant) of sixteen simulations at a time, but in the output the frames of
//! one vehicle are adjacent. So the recorder collects sixteen frames in a *tile*, transposes it in squares of sixteen
//! times sixteen words, and writes it at once. Narrow state fields of a vehicle share a word of 32 bits in the tile.
//! The macro `with_states` lists the fields and their integer types. A *slot* is the number of a vehicle in its
//! simulation; a *place* is an index into an output array of one simulation.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};

use crate::math::vectors::SIMD_LANES;
use crate::recorder::output::Output;

/// Number of frames in a tile; the transposition needs as many frames as simulations in a block.
pub const FRAMES_PER_TILE: usize = 16;

/// The position of a state field in the packed words of a vehicle in one frame.
#[derive(Clone, Copy)]
pub struct BitField {
    /// Index of the word of 32 bits.
    word: usize,
    /// Lowest bit of the field in the word.
    first_bit: u32,
    /// Width of the field in bits.
    bits: u32,
}

impl BitField {
    /// Insert `number` into `words`, one word per simulation. The lowest field of a word must be inserted first,
    /// because it replaces the whole word.
    #[inline(always)]
    fn insert<S: Simd>(self, words: i32x16<S>, number: i32x16<S>) -> i32x16<S> {
        if self.bits == u32::BITS {
            return number;
        }
        let is_last = self.first_bit + self.bits == u32::BITS;
        // The shift below moves excess bits of the last field out of the word, so this field needs no mask.
        let masked = if is_last {
            number
        } else {
            number & ((1 << self.bits) - 1)
        };
        if self.first_bit == 0 {
            masked
        } else {
            words | (masked << self.first_bit)
        }
    }
}

/// Positions of fields with these widths [bits], in order; a field that does not fit into a word starts the next one.
const fn side_by_side<const COUNT: usize>(bits: [u32; COUNT]) -> [BitField; COUNT] {
    let mut fields = [BitField {
        word: 0,
        first_bit: 0,
        bits: 0,
    }; COUNT];
    let (mut word, mut first_bit, mut k) = (0, 0, 0);
    while k < COUNT {
        if first_bit + bits[k] > u32::BITS {
            (word, first_bit) = (word + 1, 0);
        }
        fields[k] = BitField {
            word,
            first_bit,
            bits: bits[k],
        };
        (first_bit, k) = (first_bit + bits[k], k + 1);
    }
    fields
}

/// Declare the functions that pack and move all state fields, from the list of fields and their integer types.
macro_rules! frame_layout {
    ({} $($(#[$doc:meta])* $state:ident: $kind:ident,)*) => {
        /// Number of state fields of a vehicle in a frame, before they are packed.
        pub const NUM_STATE_WORDS: usize = [$(stringify!($state)),*].len();

        /// Position of each field, in the order of the list.
        const PACKINGS: [BitField; NUM_STATE_WORDS] = side_by_side([$($kind::BITS),*]);

        #[allow(non_camel_case_types)]
        enum FieldIndex { $($state),* }

        /// Write sixteen frames of the fields in packed word `k` of the vehicle in `slot` to the output of one
        /// simulation, from frame `start`.
        #[inline(always)]
        pub fn put_tile(out: &mut Output<'_>, slot: usize, k: usize, start: usize, row: &[i32; SIMD_LANES]) {
            // Outputs have shape (vehicle, frame).
            let place = slot * out.frames + start;
            // `written` counts the frames that may have been written; the first packed word updates it for all words.
            if k == 0 {
                out.written[slot] = out.written[slot].max((start + FRAMES_PER_TILE) as i32);
            }
            // Unrolled, with the positions as constants: a loop is slower, because its shifts are not constants.
            $({
                const AT: BitField = PACKINGS[FieldIndex::$state as usize];
                if AT.word == k {
                    write_sixteen(out.$state, place, row.map(|word| (word >> AT.first_bit) as $kind));
                }
            })*
        }

        /// Pack the fields of a vehicle into fewer words, which saves transpositions and memory of the tile.
        #[inline(always)]
        pub fn pack_words<S: Simd>(simd: S, words: &[i32x16<S>; NUM_STATE_WORDS]) -> [i32x16<S>; NUM_PACKED_WORDS] {
            let mut packed_words = [i32x16::splat(simd, 0); NUM_PACKED_WORDS];
            $({
                const AT: BitField = PACKINGS[FieldIndex::$state as usize];
                packed_words[AT.word] =
                    AT.insert(packed_words[AT.word], words[FieldIndex::$state as usize]);
            })*
            packed_words
        }

        /// Prefetch the cache lines of all state fields at a place of their output arrays.
        #[inline(always)]
        pub fn prefetch_rows(out: &Output<'_>, place: usize) {
            $(prefetch(out.$state, place);)*
        }

        /// Set all state fields to zero at some places of their output arrays.
        pub fn clear(out: &mut Output<'_>, places: core::ops::Range<usize>) {
            $(out.$state[places.clone()].fill(0);)*
        }
    };
}

with_states! { frame_layout! {} }

/// Number of packed words of a vehicle in a frame.
pub const NUM_PACKED_WORDS: usize = PACKINGS[NUM_STATE_WORDS - 1].word + 1;

/// The tile: rows (vehicle, packed word, frame). A row is undefined until its frame has been recorded.
pub struct FrameTile<const N: usize>(pub(crate) Vec<Row>);

/// One word of each simulation, aligned to a cache line, so that a vector is loaded from one line.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Row(pub [i32; SIMD_LANES]);

impl<const N: usize> Default for FrameTile<N> {
    fn default() -> Self {
        Self(vec![
            Row([0; SIMD_LANES]);
            NUM_PACKED_WORDS * N * FRAMES_PER_TILE
        ])
    }
}

/// Transpose sixteen rows (frame, simulation) to (simulation, frame).
#[inline(always)]
pub fn transpose<S: Simd>(simd: S, rows: &[Row]) -> [Row; SIMD_LANES] {
    let mut square = [i32x16::splat(simd, 0); SIMD_LANES];
    for (vector, row) in square.iter_mut().zip(rows) {
        *vector = i32x16::simd_from(simd, row.0);
    }
    // Interleaving row k with row k + 8 exchanges one of the four bits of the row index with one of the column index,
    // so four passes transpose the square.
    for _ in 0..4 {
        let previous = square;
        for k in 0..SIMD_LANES / 2 {
            (square[2 * k], square[2 * k + 1]) =
                previous[k].interleave(previous[k + SIMD_LANES / 2]);
        }
    }
    square.map(|vector| Row(vector.to_array()))
}

/// Copy sixteen numbers into `out` from `place` on. They fit, because `Output::frames` is a multiple of sixteen.
#[inline(always)]
fn write_sixteen<T: Copy>(out: &mut [T], place: usize, row: [T; SIMD_LANES]) {
    if let Some(destination) = out[place..].first_chunk_mut::<SIMD_LANES>() {
        *destination = row;
    }
}

/// Prefetch the cache line of an element; on CPUs other than x86-64 this does nothing.
#[inline(always)]
pub fn prefetch<T>(slice: &[T], place: usize) {
    #[cfg(target_arch = "x86_64")]
    if let Some(element) = slice.get(place) {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: The instruction is a hint: it cannot fault, and every x86-64 CPU has it.
        unsafe { _mm_prefetch(core::ptr::from_ref(element).cast(), _MM_HINT_T0) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (slice, place);
}
