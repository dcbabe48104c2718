//! Sixteen consecutive frames of one simulation side by side, in two forms.
//!
//! `FrameBlock` computes signals of whole blocks, also behind the last recorded frame: rows usually have memory for
//! them, and nothing reads these results. Where the memory of a row ends, the block is filled up with zeros.
//!
//! `SpanBlock` reads a span of frames for minima and counts. Its last frame fills it up, so that a minimum over all
//! sixteen lanes is one over the frames of the span.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};
use overtaking_core::math::elementary::sincos;
use overtaking_core::prefetch;

use crate::recording::{METRES_PER_MM, PackedRecording};
use crate::vectors::{F32, Mask, SIMD_LANES};

/// Distance of the frames that are fetched into the cache ahead of their use. The CPU's own prefetcher does not follow
/// the rows of many vehicles at once.
const PREFETCH_DISTANCE: usize = 2 * SIMD_LANES;
/// Radians to a recorded unit of a heading.
const RADIANS_PER_UNIT: f32 = 1e-4;

/// Sixteen frames of one simulation, to compute signals.
#[derive(Clone, Copy)]
pub(crate) struct FrameBlock<'a, S: Simd> {
    pub(crate) simd: S,
    pub(crate) recording: &'a PackedRecording<'a>,
    pub(crate) simulation: usize,
    pub(crate) first_frame: usize,
}

/// Evaluate an expression for each block of the first frames of a simulation, with the SIMD features of the CPU.
///
/// A macro, because a closure that the compiler does not inline would lose these features.
macro_rules! for_each_frame_block {
    ($block:expr, $num_frames:expr, |$at:ident| $body:expr) => {{
        let block = $block;
        for first_frame in (0..$num_frames).step_by($crate::vectors::SIMD_LANES) {
            block.simd.vectorize(
                #[inline(always)]
                || {
                    let $at = $crate::frame_block::FrameBlock {
                        first_frame,
                        ..block
                    };
                    $body
                },
            );
        }
    }};
}
pub(crate) use for_each_frame_block;

impl<'a, S: Simd> FrameBlock<'a, S> {
    /// The first block of a simulation.
    #[inline(always)]
    pub(crate) fn new(simd: S, recording: &'a PackedRecording<'a>, simulation: usize) -> Self {
        Self {
            simd,
            recording,
            simulation,
            first_frame: 0,
        }
    }
}

impl<S: Simd> FrameBlock<'_, S> {
    /// The frames of a row as integers, zero behind its end.
    #[inline(always)]
    pub(crate) fn load<T: Copy + Into<i32>>(&self, row: &[T]) -> i32x16<S> {
        prefetch(row, self.first_frame + PREFETCH_DISTANCE);
        let mut values = [0; SIMD_LANES];
        if let Some(row) = row[self.first_frame..].first_chunk::<SIMD_LANES>() {
            for (value, recorded) in values.iter_mut().zip(row) {
                *value = (*recorded).into();
            }
        } else {
            for (value, recorded) in values.iter_mut().zip(&row[self.first_frame..]) {
                *value = (*recorded).into();
            }
        }
        i32x16::simd_from(self.simd, values)
    }

    /// The frames of a signal, zero behind its end.
    #[inline(always)]
    pub(crate) fn load_signal(&self, row: &[f32]) -> F32<S> {
        let mut values = [0.0; SIMD_LANES];
        let end = row.len().min(self.first_frame + SIMD_LANES);
        values[..end - self.first_frame].copy_from_slice(&row[self.first_frame..end]);
        F32::simd_from(self.simd, values)
    }

    #[inline(always)]
    pub(crate) fn store(&self, row: &mut [f32], values: F32<S>) {
        let values: [f32; SIMD_LANES] = values.to_array();
        if let Some(row) = row[self.first_frame..].first_chunk_mut::<SIMD_LANES>() {
            *row = values;
        } else {
            let len = self.recording.max_frames - self.first_frame;
            row[self.first_frame..].copy_from_slice(&values[..len]);
        }
    }

    #[inline(always)]
    pub(crate) fn store_bytes(&self, row: &mut [u8], values: i32x16<S>) {
        let values: [i32; SIMD_LANES] = values.to_array();
        let bytes = values.map(|value| value as u8);
        if let Some(row) = row[self.first_frame..].first_chunk_mut::<SIMD_LANES>() {
            *row = bytes;
        } else {
            let len = self.recording.max_frames - self.first_frame;
            row[self.first_frame..].copy_from_slice(&bytes[..len]);
        }
    }

    #[inline(always)]
    pub(crate) fn int(&self, value: i32) -> i32x16<S> {
        i32x16::splat(self.simd, value)
    }

    /// Row of a vehicle of this simulation.
    #[inline(always)]
    pub(crate) fn row(&self, slot: usize) -> usize {
        self.recording.row(self.simulation, slot)
    }

    /// Lateral position of a vehicle's centre, and half of the width that its turned body covers [m].
    #[inline(always)]
    pub(crate) fn footprint(&self, row: usize) -> (F32<S>, F32<S>) {
        let r = self.recording;
        let d: F32<S> = self.load(r.d[row]).to_float();
        let lateral_position = r.overtaking_sign * (d * METRES_PER_MM);
        let heading: F32<S> = self.load(r.heading[row]).to_float();
        let (sine, cosine) = sincos(heading * RADIANS_PER_UNIT - r.direction);
        let half_length = r.length[row] * 0.5;
        let half_width = r.width[row] * 0.5;
        let half_covered = half_length * sine.abs() + half_width * cosine.abs();
        (lateral_position, half_covered)
    }

    /// Whether the vehicle of a row has a state.
    #[inline(always)]
    pub(crate) fn has_state(&self, row: usize) -> Mask<S> {
        match &self.recording.is_recorded {
            Some(rows) => self.load(rows[row]).simd_gt(0),
            None => self.int(1).simd_gt(0),
        }
    }
}

/// At most sixteen frames of a span, to find minima and count; the last frame of the span fills the block up.
#[derive(Clone, Copy)]
pub(crate) struct SpanBlock<S: Simd> {
    pub(crate) simd: S,
    pub(crate) first_frame: usize,
    /// Number of frames that belong to the span.
    pub(crate) len: usize,
}

impl<S: Simd> SpanBlock<S> {
    /// The block that begins at a frame of a span, before its end.
    #[inline(always)]
    pub(crate) fn new(simd: S, first_frame: usize, end: usize) -> Self {
        let len = (end - first_frame).min(SIMD_LANES);
        Self {
            simd,
            first_frame,
            len,
        }
    }

    #[inline(always)]
    pub(crate) fn array<T: Copy>(&self, row: &[T]) -> [T; SIMD_LANES] {
        if let Some(whole) = row[self.first_frame..].first_chunk::<SIMD_LANES>()
            && self.len == SIMD_LANES
        {
            return *whole;
        }
        let end = self.first_frame + self.len;
        let mut values = [row[end - 1]; SIMD_LANES];
        values[..self.len].copy_from_slice(&row[self.first_frame..end]);
        values
    }

    #[inline(always)]
    pub(crate) fn load(&self, row: &[f32]) -> F32<S> {
        F32::simd_from(self.simd, self.array(row))
    }

    #[inline(always)]
    pub(crate) fn load_ints<T: Copy + Into<i32>>(&self, row: &[T]) -> i32x16<S> {
        i32x16::simd_from(self.simd, self.array(row).map(Into::into))
    }

    /// Call `visit(value, frame)` for each frame of the span, in order.
    #[inline(always)]
    pub(crate) fn for_each_frame(&self, values: F32<S>, mut visit: impl FnMut(f32, usize)) {
        let values: [f32; SIMD_LANES] = values.to_array();
        for (lane, value) in values.iter().enumerate().take(self.len) {
            visit(*value, self.first_frame + lane);
        }
    }
}

/// The smallest of sixteen numbers; NaN does not count.
#[inline(always)]
pub(crate) fn min_of_lanes<S: Simd>(values: F32<S>) -> f32 {
    let values: [f32; SIMD_LANES] = values.to_array();
    values.into_iter().fold(f32::INFINITY, |smallest, value| {
        if value < smallest { value } else { smallest }
    })
}

/// The largest of sixteen numbers; NaN does not count.
#[inline(always)]
pub(crate) fn max_of_lanes<S: Simd>(values: F32<S>) -> f32 {
    let values: [f32; SIMD_LANES] = values.to_array();
    values
        .into_iter()
        .fold(f32::NEG_INFINITY, |largest, value| {
            if value > largest { value } else { largest }
        })
}
