//! Counter-based random numbers, Philox 4x32-10; see `overtaking.core.random_numbers`.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, u32x16};

use crate::math::vectors::{F32, SIMD_LANES};

const ROUNDS: usize = 10;
/// The bits of a word.
const WORD: u64 = 0xFFFF_FFFF;
/// Stream of gusts and errors of perception; the vehicle's slot is added.
pub const MOTION: u32 = 0x300;
/// Stream of looks over the shoulder; the vehicle's slot is added.
pub const GLANCES: u32 = 0x400;

/// The four words of draw `draw` of `stream` in each simulation of a block.
#[inline(always)]
pub fn words(
    key: [u32; 2],
    low: &[u32; SIMD_LANES],
    high: &[u32; SIMD_LANES],
    stream: u32,
    draw: u32,
) -> [[u32; SIMD_LANES]; 4] {
    words_of(key, low, high, &[stream; SIMD_LANES], draw)
}

/// As `words`, each of a stream of its own.
#[inline(always)]
pub fn words_of(
    key: [u32; 2],
    low: &[u32; SIMD_LANES],
    high: &[u32; SIMD_LANES],
    stream: &[u32; SIMD_LANES],
    draw: u32,
) -> [[u32; SIMD_LANES]; 4] {
    // Words in lanes of 64 bits, as products need them; what is in the upper halves means nothing.
    let wide = |words: &[u32; SIMD_LANES]| words.map(u64::from);
    let (mut c0, mut c1) = ([u64::from(draw); SIMD_LANES], wide(stream));
    let (mut c2, mut c3) = (wide(low), wide(high));
    let [mut k0, mut k1] = key;
    for _ in 0..ROUNDS {
        for lane in 0..SIMD_LANES {
            let p0 = (c0[lane] & WORD) * 0xD251_1F53;
            let p1 = (c2[lane] & WORD) * 0xCD9E_8D57;
            c0[lane] = (p1 >> 32) ^ c1[lane] ^ u64::from(k0);
            c1[lane] = p1;
            c2[lane] = (p0 >> 32) ^ c3[lane] ^ u64::from(k1);
            c3[lane] = p0;
        }
        k0 = k0.wrapping_add(0x9E37_79B9);
        k1 = k1.wrapping_add(0xBB67_AE85);
    }
    [c0, c1, c2, c3].map(|words| words.map(|word| word as u32))
}

/// A word as a number in the open interval (0, 1).
#[inline(always)]
pub fn uniform<S: Simd>(simd: S, word: [u32; SIMD_LANES]) -> F32<S> {
    let bits = u32x16::simd_from(simd, word) >> 9;
    let number: F32<S> = bits.to_float();
    (number + 0.5) * 1.192_092_9e-7
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known-answer vectors of the Random123 library.
    #[test]
    fn words_match_the_published_vectors() {
        let zero = words([0, 0], &[0; SIMD_LANES], &[0; SIMD_LANES], 0, 0);
        assert_eq!(
            zero.map(|w| w[0]),
            [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]
        );
        let pi = words(
            [0xa409_3822, 0x299f_31d0],
            &[0x1319_8a2e; SIMD_LANES],
            &[0x0370_7344; SIMD_LANES],
            0x85a3_08d3,
            0x243f_6a88,
        );
        assert_eq!(
            pi.map(|w| w[7]),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }
}
