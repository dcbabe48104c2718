//! Frames that wait to be moved to their place in memory, and how they are turned for it.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};

use crate::lanes::LANES;

/// Frames that are collected before they are moved.
pub const TILE: usize = 16;
/// Recorded numbers of a vehicle in a frame.
pub const WORDS: usize = 12;
/// Words of 32 bits that they take: five of their own, five halves and two bytes.
pub const PACKED: usize = 8;

/// Memory for the frames that wait to be moved; what is in it before it is written means nothing.
pub struct Tile<const N: usize>(pub(crate) Vec<Row>);

/// A number of each simulation, where a vector does not cross a line of the cache.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Row(pub [i32; LANES]);

impl<const N: usize> Default for Tile<N> {
    fn default() -> Self {
        Self(vec![Row([0; LANES]); PACKED * N * TILE])
    }
}

/// Numbers that are as wide as a word stay, narrow ones share: fewer words wait, and are turned.
#[inline(always)]
pub fn packed<S: Simd>(words: &[i32x16<S>; WORDS]) -> [i32x16<S>; PACKED] {
    let [
        x,
        y,
        s,
        d,
        speed,
        heading,
        wheel,
        a_lon,
        a_lat,
        yaw,
        lane,
        lights,
    ] = *words;
    let both = |low: i32x16<S>, high: i32x16<S>| (low & 0xFFFF) | (high << 16);
    let bytes = lane | (lights << 8);
    [
        x,
        y,
        s,
        d,
        speed,
        both(heading, wheel),
        both(a_lon, a_lat),
        both(yaw, bytes),
    ]
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

/// The halves of sixteen words that begin at bit `from`.
#[inline(always)]
pub fn halves(row: &[i32; LANES], from: u32) -> [i16; LANES] {
    row.map(|word| (word >> from) as i16)
}

/// The bytes of sixteen words that begin at bit `from`.
#[inline(always)]
pub fn bytes(row: &[i32; LANES], from: u32) -> [u8; LANES] {
    row.map(|word| (word >> from) as u8)
}
