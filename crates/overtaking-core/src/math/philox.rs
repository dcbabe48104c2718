//! Counter-based random numbers: Philox 4x32-10 (Salmon et al., SC'11), sixteen simulations at a time.
//!
//! The generator has no state. It maps a key (the seed of the data set), a scenario index (lower and upper 32 bits),
//! a stream (the purpose of the draws) and the number of a block to a block of four random words of 32 bits. So a
//! simulation has the same random numbers in every batch. `overtaking.core.random_numbers` is the Python twin. The
//! multipliers and the steps of the key come from the Random123 library.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, u32x16};

use crate::math::vectors::{F32, SIMD_LANES};

const ROUNDS: usize = 10;
/// Mask of the lower 32 bits.
const WORD: u64 = 0xFFFF_FFFF;
/// Stream of gusts, errors of perception and wandering in the lane; the vehicle's slot is added.
pub const MOTION: u32 = 0x300;
/// Stream of looks over the shoulder before a lane change; the vehicle's slot is added.
pub const GLANCES: u32 = 0x400;

/// The four random words of block number `draw` in `stream`, for each of sixteen simulations.
///
/// `low` and `high` are the lower and upper 32 bits of the scenario indices.
#[inline(always)]
pub fn words(
    key: [u32; 2],
    low: &[u32; SIMD_LANES],
    high: &[u32; SIMD_LANES],
    stream: u32,
    draw: u32,
) -> [[u32; SIMD_LANES]; 4] {
    words_of_streams(key, low, high, &[stream; SIMD_LANES], draw)
}

/// The same as `words`, with a stream for each simulation.
#[inline(always)]
pub fn words_of_streams(
    key: [u32; 2],
    low: &[u32; SIMD_LANES],
    high: &[u32; SIMD_LANES],
    stream: &[u32; SIMD_LANES],
    draw: u32,
) -> [[u32; SIMD_LANES]; 4] {
    // In 64 bits, because a round needs the upper and the lower half of each product. `c1` and `c3` keep whole
    // products: their upper halves are removed by the mask of the next round or by the last conversion.
    let widen = |numbers: &[u32; SIMD_LANES]| numbers.map(u64::from);
    let (mut c0, mut c1) = ([u64::from(draw); SIMD_LANES], widen(stream));
    let (mut c2, mut c3) = (widen(low), widen(high));
    let [mut k0, mut k1] = key;
    for _ in 0..ROUNDS {
        for lane in 0..SIMD_LANES {
            let product0 = (c0[lane] & WORD) * 0xD251_1F53;
            let product1 = (c2[lane] & WORD) * 0xCD9E_8D57;
            c0[lane] = (product1 >> 32) ^ c1[lane] ^ u64::from(k0);
            c1[lane] = product1;
            c2[lane] = (product0 >> 32) ^ c3[lane] ^ u64::from(k1);
            c3[lane] = product0;
        }
        k0 = k0.wrapping_add(0x9E37_79B9);
        k1 = k1.wrapping_add(0xBB67_AE85);
    }
    [c0, c1, c2, c3].map(|lanes| lanes.map(|word| word as u32))
}

/// Convert random words to uniform numbers in (0, 1): the upper 23 bits select one of 2^23 equal intervals, and the
/// number is its middle.
#[inline(always)]
pub fn uniform<S: Simd>(simd: S, word: [u32; SIMD_LANES]) -> F32<S> {
    let bits = u32x16::simd_from(simd, word) >> 9;
    let number: F32<S> = bits.to_float();
    // Times 2^-23.
    (number + 0.5) * 1.192_092_9e-7
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known-answer vectors of the Random123 library.
    #[test]
    fn words_match_the_published_vectors() {
        let zeros = words([0, 0], &[0; SIMD_LANES], &[0; SIMD_LANES], 0, 0);
        assert_eq!(
            zeros.map(|word| word[0]),
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
            pi.map(|word| word[7]),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }
}
