//! Frames that wait to be moved to their place in memory, and how they are turned for it.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};

use crate::math::vectors::SIMD_LANES;
use crate::recorder::output::Output;

/// Frames that are collected before they are moved.
pub const FRAMES_PER_TILE: usize = 16;

/// Where a number lies among the words of 32 bits in which the frame of a vehicle waits.
#[derive(Clone, Copy)]
pub struct BitField {
    /// Which word.
    word: usize,
    /// Its lowest bit.
    from: u32,
    /// How many bits it has.
    bits: u32,
}

impl BitField {
    /// Words with a number put in here.
    #[inline(always)]
    fn with<S: Simd>(self, words: i32x16<S>, number: i32x16<S>) -> i32x16<S> {
        if self.bits == u32::BITS {
            return number;
        }
        let is_last = self.from + self.bits == u32::BITS;
        let part = if is_last {
            number
        } else {
            number & ((1 << self.bits) - 1)
        };
        if self.from == 0 {
            part
        } else {
            words | (part << self.from)
        }
    }
}

/// Numbers side by side, none of them across the border of a word.
const fn side_by_side<const COUNT: usize>(bits: [u32; COUNT]) -> [BitField; COUNT] {
    let mut found = [BitField {
        word: 0,
        from: 0,
        bits: 0,
    }; COUNT];
    let (mut word, mut from, mut k) = (0, 0, 0);
    while k < COUNT {
        if from + bits[k] > u32::BITS {
            (word, from) = (word + 1, 0);
        }
        found[k] = BitField {
            word,
            from,
            bits: bits[k],
        };
        (from, k) = (from + bits[k], k + 1);
    }
    found
}

/// What follows from the list of states.
macro_rules! frame_layout {
    ({} $($(#[$doc:meta])* $state:ident: $kind:ident,)*) => {
        /// Recorded numbers of a vehicle in a frame.
        pub const NUM_STATE_WORDS: usize = [$(stringify!($state)),*].len();

        const PACKINGS: [BitField; NUM_STATE_WORDS] = side_by_side([$($kind::BITS),*]);

        #[allow(non_camel_case_types)]
        enum Number { $($state),* }

        /// Put sixteen frames of word `k` of vehicle `i` to their place.
        #[inline(always)]
        pub fn put_tile(out: &mut Output<'_>, i: usize, k: usize, start: usize, row: &[i32; SIMD_LANES]) {
            let place = i * out.frames + start;
            if k == 0 {
                out.written[i] = out.written[i].max((start + FRAMES_PER_TILE) as i32);
            }
            // Packings are constants here, so that the compiler knows each shift: a loop over them is slower.
            $({
                const AT: BitField = PACKINGS[Number::$state as usize];
                if AT.word == k {
                    put(out.$state, place, row.map(|word| (word >> AT.from) as $kind));
                }
            })*
        }

        /// Numbers that are as wide as a word stay, narrow ones share: fewer words wait, and are turned.
        #[inline(always)]
        pub fn packed<S: Simd>(simd: S, words: &[i32x16<S>; NUM_STATE_WORDS]) -> [i32x16<S>; NUM_PACKED_WORDS] {
            let mut packed = [i32x16::splat(simd, 0); NUM_PACKED_WORDS];
            $({
                const AT: BitField = PACKINGS[Number::$state as usize];
                packed[AT.word] = AT.with(packed[AT.word], words[Number::$state as usize]);
            })*
            packed
        }

        /// Begin to load the lines of the cache in which the states at a place lie.
        #[inline(always)]
        pub fn prefetch_rows(out: &Output<'_>, place: usize) {
            $(prefetch(out.$state, place);)*
        }

        /// Zero the states at some places.
        pub fn clear(out: &mut Output<'_>, places: core::ops::Range<usize>) {
            $(out.$state[places.clone()].fill(0);)*
        }
    };
}

with_states! { frame_layout! {} }

/// Words of 32 bits that a frame of a vehicle takes.
pub const NUM_PACKED_WORDS: usize = PACKINGS[NUM_STATE_WORDS - 1].word + 1;

/// Memory for the frames that wait to be moved; what is in it before it is written means nothing.
pub struct FrameTile<const N: usize>(pub(crate) Vec<Row>);

/// A number of each simulation, where a vector does not cross a line of the cache.
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

/// Sixteen frames of sixteen simulations, turned into sixteen simulations of sixteen frames.
#[inline(always)]
pub fn transpose<S: Simd>(simd: S, rows: &[Row]) -> [Row; SIMD_LANES] {
    let mut turned = [i32x16::splat(simd, 0); SIMD_LANES];
    for (vector, row) in turned.iter_mut().zip(rows) {
        *vector = i32x16::simd_from(simd, row.0);
    }
    // Four perfect shuffles of the rows turn the square.
    for _ in 0..4 {
        let before = turned;
        for k in 0..SIMD_LANES / 2 {
            (turned[2 * k], turned[2 * k + 1]) = before[k].interleave(before[k + SIMD_LANES / 2]);
        }
    }
    turned.map(|vector| Row(vector.to_array()))
}

/// Sixteen numbers to their place.
#[inline(always)]
fn put<T: Copy>(out: &mut [T], place: usize, row: [T; SIMD_LANES]) {
    if let Some(to) = out[place..].first_chunk_mut::<SIMD_LANES>() {
        *to = row;
    }
}

/// Begin to load the line of the cache that an element lies in, where the CPU has an instruction for it.
#[inline(always)]
pub fn prefetch<T>(slice: &[T], place: usize) {
    #[cfg(target_arch = "x86_64")]
    if let Some(element) = slice.get(place) {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint, which reads nothing and faults nowhere; every x86-64 has it.
        unsafe { _mm_prefetch(core::ptr::from_ref(element).cast(), _MM_HINT_T0) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (slice, place);
}
