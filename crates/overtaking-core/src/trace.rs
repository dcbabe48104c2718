//! The hash over everything that is recorded; see `overtaking.sim.reference.recording`.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16, u32x16};

use crate::lanes::{LANES, M};

const PRIME_1: u32 = 2_654_435_761;
const PRIME_2: u32 = 2_246_822_519;
const PRIME_3: u32 = 3_266_489_917;

/// The four words of the hash of each simulation before anything is recorded.
pub fn start() -> [[u32; LANES]; 4] {
    [
        PRIME_1.wrapping_add(PRIME_2),
        PRIME_2,
        0,
        0u32.wrapping_sub(PRIME_1),
    ]
    .map(|word| [word; LANES])
}

/// Mix a word of each simulation into one of the four, in the masked simulations.
#[inline(always)]
pub fn mix<S: Simd>(hash: u32x16<S>, word: i32x16<S>, mask: M<S>) -> u32x16<S> {
    let word: u32x16<S> = word.bitcast();
    let sum = hash + word * PRIME_2;
    let mixed = ((sum << 13) | (sum >> 19)) * PRIME_1;
    mask.select(mixed, hash)
}

/// Mix a word into one of the four of a single simulation.
#[inline(always)]
pub fn mix_word(hash: u32, word: u32) -> u32 {
    hash.wrapping_add(word.wrapping_mul(PRIME_2))
        .rotate_left(13)
        .wrapping_mul(PRIME_1)
}

/// The hash once everything is mixed in.
pub fn digest(hash: [u32; 4]) -> [u32; 4] {
    core::array::from_fn(|k| {
        let word = hash[k].wrapping_add(hash[(k + 1) % 4].rotate_left(7));
        let word = (word ^ (word >> 15)).wrapping_mul(PRIME_2);
        let word = (word ^ (word >> 13)).wrapping_mul(PRIME_3);
        word ^ (word >> 16)
    })
}
