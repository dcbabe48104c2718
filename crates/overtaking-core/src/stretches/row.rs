//! Sixteen frames of a row side by side.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};

use crate::lanes::{LANES, V};

/// Frames from `at` on, at most sixteen; beyond the last one it is repeated.
#[derive(Clone, Copy)]
pub(super) struct Piece<S: Simd> {
    pub(super) simd: S,
    pub(super) at: usize,
    pub(super) len: usize,
}

impl<S: Simd> Piece<S> {
    /// The pieces of a stretch that is not empty.
    #[inline(always)]
    pub(super) fn new(simd: S, at: usize, end: usize) -> Self {
        let len = (end - at).min(LANES);
        Self { simd, at, len }
    }

    #[inline(always)]
    pub(super) fn array<T: Copy>(&self, row: &[T]) -> [T; LANES] {
        if let Some(whole) = row[self.at..].first_chunk::<LANES>()
            && self.len == LANES
        {
            return *whole;
        }
        let last = row[self.at + self.len - 1];
        let mut values = [last; LANES];
        values[..self.len].copy_from_slice(&row[self.at..self.at + self.len]);
        values
    }

    #[inline(always)]
    pub(super) fn load(&self, row: &[f32]) -> V<S> {
        V::simd_from(self.simd, self.array(row))
    }

    #[inline(always)]
    pub(super) fn integers<T: Copy + Into<i32>>(&self, row: &[T]) -> i32x16<S> {
        i32x16::simd_from(self.simd, self.array(row).map(Into::into))
    }

    /// Numbers of the frames that count, each asked for what it says.
    #[inline(always)]
    pub(super) fn each(&self, values: V<S>, mut take: impl FnMut(f32, usize)) {
        let values: [f32; LANES] = values.to_array();
        for (step, value) in values.iter().enumerate().take(self.len) {
            take(*value, self.at + step);
        }
    }
}

/// The smallest of sixteen numbers.
#[inline(always)]
pub(super) fn least<S: Simd>(values: V<S>) -> f32 {
    let values: [f32; LANES] = values.to_array();
    values.into_iter().fold(
        f32::INFINITY,
        |low, each| if each < low { each } else { low },
    )
}

/// The largest of sixteen numbers.
#[inline(always)]
pub(super) fn greatest<S: Simd>(values: V<S>) -> f32 {
    let values: [f32; LANES] = values.to_array();
    values.into_iter().fold(
        f32::NEG_INFINITY,
        |high, each| if each > high { each } else { high },
    )
}
