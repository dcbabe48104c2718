//! Frames that wait to be moved to their place in memory, and how they are turned for it.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};

use crate::lanes::LANES;

/// Frames that are collected before they are moved.
pub const TILE: usize = 16;
/// Recorded numbers of a vehicle in a frame.
pub const WORDS: usize = 12;

/// Memory for the frames that wait to be moved; what is in it before it is written means nothing.
pub struct Tile<const N: usize>(pub(crate) Vec<Row>);

/// A number of each simulation, where a vector does not cross a line of the cache.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Row(pub [i32; LANES]);

impl<const N: usize> Default for Tile<N> {
    fn default() -> Self {
        Self(vec![Row([0; LANES]); WORDS * N * TILE])
    }
}

/// Sixteen frames of sixteen simulations, turned into sixteen simulations of sixteen frames.
#[inline(always)]
pub fn transposed<S: Simd>(simd: S, rows: &[Row]) -> [Row; LANES] {
    let mut turned = [i32x16::splat(simd, 0); LANES];
    for (vector, row) in turned.iter_mut().zip(rows) {
        *vector = i32x16::simd_from(simd, row.0);
    }
    // Four perfect shuffles of the rows turn the square.
    for _ in 0..4 {
        let before = turned;
        for k in 0..LANES / 2 {
            (turned[2 * k], turned[2 * k + 1]) = before[k].interleave(before[k + LANES / 2]);
        }
    }
    turned.map(|vector| Row(vector.to_array()))
}

/// Sixteen numbers to their place.
#[inline(always)]
pub fn put<T: Copy>(out: &mut [T], place: usize, row: [T; LANES]) {
    if let Some(to) = out[place..].first_chunk_mut::<LANES>() {
        *to = row;
    }
}

/// The lower halves of sixteen numbers.
#[inline(always)]
pub fn halves(row: &[i32; LANES]) -> [i16; LANES] {
    let mut narrow = [0; LANES];
    for (narrow, wide) in narrow.iter_mut().zip(row) {
        *narrow = *wide as i16;
    }
    narrow
}

/// The lowest bytes of sixteen numbers.
#[inline(always)]
pub fn bytes(row: &[i32; LANES]) -> [u8; LANES] {
    let mut narrow = [0; LANES];
    for (narrow, wide) in narrow.iter_mut().zip(row) {
        *narrow = *wide as u8;
    }
    narrow
}
