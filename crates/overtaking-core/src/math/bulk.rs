//! Draws and elementary functions of many numbers; see `overtaking.core.random_numbers` and `.elementary`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::elementary::{exp, log, sincos};
use crate::math::philox;
use crate::math::vectors::{F32, SIMD_LANES, dispatch};
use crate::run::engine::require_level;

/// A block of draws of every simulation and stream.
pub struct DrawBlock<'a> {
    /// Key of the random numbers.
    pub seed: u64,
    /// Number of each simulation.
    pub index: &'a [u64],
    /// Stream of each.
    pub stream: &'a [u32],
    /// Number of the block inside the stream.
    pub draw: u32,
}

/// The four words of a block, each as long as the block.
///
/// # Errors
/// The SIMD level is unknown or not supported by this CPU.
pub fn random_words(
    block: &DrawBlock<'_>,
    forced: Option<&str>,
    out: [&mut [u32]; 4],
) -> Result<(), String> {
    let level = require_level(forced)?;
    dispatch!(level, |simd| fill_words(simd, block, out));
    Ok(())
}

/// The exponential of each number, in its place.
///
/// # Errors
/// As for `words`.
pub fn exp_in_place(forced: Option<&str>, values: &mut [f32]) -> Result<(), String> {
    let level = require_level(forced)?;
    dispatch!(level, |simd| fill_exponentials(simd, values));
    Ok(())
}

/// The natural logarithm of each number, in its place.
///
/// # Errors
/// As for `words`.
pub fn log_in_place(forced: Option<&str>, values: &mut [f32]) -> Result<(), String> {
    let level = require_level(forced)?;
    dispatch!(level, |simd| fill_logarithms(simd, values));
    Ok(())
}

/// The uniform number in (0, 1) that each word stands for.
pub fn uniform_numbers(words: &[u32]) -> Vec<f32> {
    let number = |&word: &u32| ((word >> 9) as f32 + 0.5) * (1.0 / (1 << 23) as f32);
    words.iter().map(number).collect()
}

/// Something to compare many numbers with.
pub enum Operand<'a> {
    /// One number.
    One(f32),
    /// One number for each.
    Each(&'a [f32]),
}

/// The larger of each number and another, in its place; the other where they are equal.
pub fn maximum_in_place(values: &mut [f32], others: &Operand<'_>) {
    with_others(
        values,
        others,
        |value, other| if value > other { value } else { other },
    );
}

/// The smaller of each number and another, in its place; the other where they are equal.
pub fn minimum_in_place(values: &mut [f32], others: &Operand<'_>) {
    with_others(
        values,
        others,
        |value, other| if value < other { value } else { other },
    );
}

#[inline(always)]
fn with_others(values: &mut [f32], others: &Operand<'_>, chosen: impl Fn(f32, f32) -> f32) {
    match *others {
        Operand::One(other) => values
            .iter_mut()
            .for_each(|value| *value = chosen(*value, other)),
        Operand::Each(others) => {
            for (value, &other) in values.iter_mut().zip(others) {
                *value = chosen(*value, other);
            }
        }
    }
}

/// Two independent normal numbers from each two uniform ones, in their places.
///
/// # Errors
/// As for `words`.
pub fn normal_pairs_in_place(
    forced: Option<&str>,
    u: &mut [f32],
    v: &mut [f32],
) -> Result<(), String> {
    let level = require_level(forced)?;
    dispatch!(level, |simd| fill_pairs(simd, u, v));
    Ok(())
}

fn fill_words<S: Simd>(simd: S, block: &DrawBlock<'_>, out: [&mut [u32]; 4]) {
    let key = [block.seed as u32, (block.seed >> 32) as u32];
    let [a, b, c, d] = out;
    let out = a.chunks_mut(SIMD_LANES).zip(b.chunks_mut(SIMD_LANES));
    let out = out.zip(c.chunks_mut(SIMD_LANES).zip(d.chunks_mut(SIMD_LANES)));
    let given = block
        .index
        .chunks(SIMD_LANES)
        .zip(block.stream.chunks(SIMD_LANES));
    for ((index, stream), ((a, b), (c, d))) in given.zip(out) {
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
                let found = philox::words_of(key, &low, &high, &streams, block.draw);
                for (row, words) in [a, b, c, d].into_iter().zip(found) {
                    row.copy_from_slice(&words[..row.len()]);
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
                let (sine, cosine) = sincos(6.283_185_5 * load(simd, v));
                store(u, radius * cosine);
                store(v, radius * sine);
            },
        );
    }
}

/// At most sixteen numbers, and ones beyond them.
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
