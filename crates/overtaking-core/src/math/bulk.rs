//! Random numbers and elementary functions of whole arrays, for Python.
//!
//! `overtaking.core.native` calls these functions for large arrays. They return the same bits as their Python twins
//! in `overtaking.core.random_numbers` and `overtaking.core.float32_math`, at every SIMD level.

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};

use crate::math::elementary::{exp, log, sincos};
use crate::math::philox;
use crate::math::vectors::{F32, SIMD_LANES, dispatch};

/// The position of one block of four random words in the random numbers of each simulation.
pub struct DrawBlock<'a> {
    /// Seed of the data set: the key of the generator.
    pub seed: u64,
    /// Scenario index of each simulation.
    pub index: &'a [u64],
    /// Stream (purpose of the draws) of each simulation, as long as `index`.
    pub stream: &'a [u32],
    /// Number of the block within the stream, from 0.
    pub draw: u32,
}

/// Fill `out` with the four random words of a block, four arrays as long as `block.index`.
pub fn random_words(level: Level, block: &DrawBlock<'_>, out: [&mut [u32]; 4]) {
    dispatch!(level, |simd| fill_words(simd, block, out));
}

/// Replace each number by its exponential.
pub fn exp_in_place(level: Level, values: &mut [f32]) {
    dispatch!(level, |simd| fill_exponentials(simd, values));
}

/// Replace each number by its natural logarithm.
pub fn log_in_place(level: Level, values: &mut [f32]) {
    dispatch!(level, |simd| fill_logarithms(simd, values));
}

/// Convert each random word to a uniform number in (0, 1).
///
/// The upper 23 bits select one of 2^23 equal intervals, and the number is the middle of the interval.
pub fn uniform_numbers(words: &[u32]) -> Vec<f32> {
    let number = |&word: &u32| ((word >> 9) as f32 + 0.5) * (1.0 / (1 << 23) as f32);
    words.iter().map(number).collect()
}

/// The second operand of a minimum or maximum of an array.
pub enum Operand<'a> {
    /// The same number for each element.
    One(f32),
    /// An array of the same length.
    Each(&'a [f32]),
}

/// Replace each number by the larger of itself and the operand.
///
/// Equal numbers give the operand, as `core.float32_math.maximum` does. Zeros are equal, so the operand sets the sign.
pub fn maximum_in_place(values: &mut [f32], others: &Operand<'_>) {
    combine_in_place(values, others, |value, operand| {
        if value > operand { value } else { operand }
    });
}

/// Replace each number by the smaller of itself and the operand; equal numbers give the operand.
pub fn minimum_in_place(values: &mut [f32], others: &Operand<'_>) {
    combine_in_place(values, others, |value, operand| {
        if value < operand { value } else { operand }
    });
}

#[inline(always)]
fn combine_in_place(values: &mut [f32], operands: &Operand<'_>, choose: impl Fn(f32, f32) -> f32) {
    match *operands {
        Operand::One(operand) => values
            .iter_mut()
            .for_each(|value| *value = choose(*value, operand)),
        Operand::Each(operands) => {
            for (value, &operand) in values.iter_mut().zip(operands) {
                *value = choose(*value, operand);
            }
        }
    }
}

/// Replace each pair of uniform numbers (`u`, `v`) by two independent standard normal numbers (Box-Muller transform).
pub fn normal_pairs_in_place(level: Level, u: &mut [f32], v: &mut [f32]) {
    dispatch!(level, |simd| fill_pairs(simd, u, v));
}

fn fill_words<S: Simd>(simd: S, block: &DrawBlock<'_>, out: [&mut [u32]; 4]) {
    let key = [block.seed as u32, (block.seed >> 32) as u32];
    // `a` to `d` are the first to fourth words.
    let [a, b, c, d] = out;
    let out = a.chunks_mut(SIMD_LANES).zip(b.chunks_mut(SIMD_LANES));
    let out = out.zip(c.chunks_mut(SIMD_LANES).zip(d.chunks_mut(SIMD_LANES)));
    let inputs = block
        .index
        .chunks(SIMD_LANES)
        .zip(block.stream.chunks(SIMD_LANES));
    for ((index, stream), ((a, b), (c, d))) in inputs.zip(out) {
        simd.vectorize(
            #[inline(always)]
            || {
                let (mut low, mut high, mut streams) =
                    ([0; SIMD_LANES], [0; SIMD_LANES], [0; SIMD_LANES]);
                for (lane, (&index, &stream)) in index.iter().zip(stream).enumerate() {
                    low[lane] = index as u32;
                    high[lane] = (index >> 32) as u32;
                    streams[lane] = stream;
                }
                let words = philox::words_of_streams(key, &low, &high, &streams, block.draw);
                for (row, values) in [a, b, c, d].into_iter().zip(words) {
                    row.copy_from_slice(&values[..row.len()]);
                }
            },
        );
    }
}

fn fill_exponentials<S: Simd>(simd: S, values: &mut [f32]) {
    for row in values.chunks_mut(SIMD_LANES) {
        simd.vectorize(
            #[inline(always)]
            || store(row, exp(load(simd, row))),
        );
    }
}

fn fill_logarithms<S: Simd>(simd: S, values: &mut [f32]) {
    for row in values.chunks_mut(SIMD_LANES) {
        simd.vectorize(
            #[inline(always)]
            || store(row, log(load(simd, row))),
        );
    }
}

fn fill_pairs<S: Simd>(simd: S, u: &mut [f32], v: &mut [f32]) {
    for (u, v) in u.chunks_mut(SIMD_LANES).zip(v.chunks_mut(SIMD_LANES)) {
        simd.vectorize(
            #[inline(always)]
            || {
                let radius = (-2.0 * log(load(simd, u))).sqrt();
                // 2 pi times v.
                let (sine, cosine) = sincos(6.283_185_5 * load(simd, v));
                store(u, radius * cosine);
                store(v, radius * sine);
            },
        );
    }
}

/// Load at most sixteen numbers; the other lanes are 1, for which every function here is defined.
#[inline(always)]
fn load<S: Simd>(simd: S, row: &[f32]) -> F32<S> {
    let mut values = [1.0; SIMD_LANES];
    values[..row.len()].copy_from_slice(row);
    F32::simd_from(simd, values)
}

#[inline(always)]
fn store<S: Simd>(row: &mut [f32], values: F32<S>) {
    let values: [f32; SIMD_LANES] = values.to_array();
    row.copy_from_slice(&values[..row.len()]);
}
