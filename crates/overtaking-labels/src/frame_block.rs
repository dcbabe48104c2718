//! Sixteen consecutive frames of one simulation in the lanes of SIMD vectors, in two forms.
//!
//! `FrameBlock` computes signals in whole blocks, also after the last recorded frame: rows usually have memory for
//! them, and nothing reads these results. Where the memory of a row ends, zeros fill up the block.
//!
//! `SpanBlock` reads a span of frames for minima and counts. The last frame of the span fills up the block, so that a
//! minimum over all sixteen lanes is the minimum over the frames of the span.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};
use overtaking_core::math::elementary::sincos;
use overtaking_core::prefetch;

use crate::recording::{METRES_PER_MM, PackedRecording};
use crate::vectors::{F32, Mask, SIMD_LANES};

/// Number of frames by which rows are loaded into the cache ahead of their use: two blocks, a choice. The CPU's own
/// prefetcher does not follow the rows of many vehicles at once.
const PREFETCH_DISTANCE: usize = 2 * SIMD_LANES;
/// Unit of recorded headings [rad].
const RADIANS_PER_UNIT: f32 = 1e-4;

/// Sixteen frames of one simulation, to compute signals.
#[derive(Clone, Copy)]
pub(crate) struct FrameBlock<'a, S: Simd> {
    /// Token of the SIMD level.
    pub(crate) simd: S,
    /// The batch.
    pub(crate) recording: &'a PackedRecording<'a>,
    /// Index of the simulation in the batch.
    pub(crate) simulation: usize,
    /// Frame in the first lane.
    pub(crate) first_frame: usize,
}

/// The part of the road's width that the turned body of a vehicle covers, frame by frame.
pub(crate) struct Footprint<S: Simd> {
    /// Lateral position of the centre, positive towards the overtaking side [m].
    pub(crate) lateral_position: F32<S>,
    /// Half of the covered width [m].
    pub(crate) half_width: F32<S>,
}

/// Evaluate `$body` for each block of the first `$num_frames` frames, with the SIMD features of the CPU.
///
/// `$block` is any block of the simulation, and `$current` names each block in `$body`. This is a macro, because a
/// closure that the compiler does not inline would lose these features.
macro_rules! for_each_frame_block {
    ($block:expr, $num_frames:expr, |$current:ident| $body:expr) => {{
        let block = $block;
        for first_frame in (0..$num_frames).step_by($crate::vectors::SIMD_LANES) {
            block.simd.vectorize(
                #[inline(always)]
                || {
                    let $current = $crate::frame_block::FrameBlock {
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
    /// The frames of a row as integers, zero after its end.
    #[inline(always)]
    pub(crate) fn load<T: Copy + Into<i32>>(&self, row: &[T]) -> i32x16<S> {
        prefetch(row, self.first_frame + PREFETCH_DISTANCE);
        let mut values = [0; SIMD_LANES];
        // The same loop twice: in a whole block the compiler knows its length.
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

    /// The frames of a signal, zero after its end.
    #[inline(always)]
    pub(crate) fn load_signal(&self, row: &[f32]) -> F32<S> {
        let mut values = [0.0; SIMD_LANES];
        let end = row.len().min(self.first_frame + SIMD_LANES);
        values[..end - self.first_frame].copy_from_slice(&row[self.first_frame..end]);
        F32::simd_from(self.simd, values)
    }

    /// Write the frames of a signal, as far as its row has memory.
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

    /// Write the frames of a signal of bytes, as far as its row has memory.
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

    /// The same integer in every frame.
    #[inline(always)]
    pub(crate) fn int(&self, value: i32) -> i32x16<S> {
        i32x16::splat(self.simd, value)
    }

    /// Row of a vehicle of this simulation.
    #[inline(always)]
    pub(crate) fn row(&self, slot: usize) -> usize {
        self.recording.row(self.simulation, slot)
    }

    /// The footprint of the vehicle of a row.
    #[inline(always)]
    pub(crate) fn footprint(&self, row: usize) -> Footprint<S> {
        let recording = self.recording;
        let d: F32<S> = self.load(recording.d[row]).to_float();
        let heading: F32<S> = self.load(recording.heading[row]).to_float();
        // Sine and cosine of the vehicle's angle to the road.
        let (sine, cosine) = sincos(heading * RADIANS_PER_UNIT - recording.direction);
        let half_length = recording.length[row] * 0.5;
        let half_width = recording.width[row] * 0.5;
        Footprint {
            lateral_position: recording.overtaking_sign * (d * METRES_PER_MM),
            half_width: half_length * sine.abs() + half_width * cosine.abs(),
        }
    }

    /// Whether the vehicle of a row has a state, frame by frame.
    #[inline(always)]
    pub(crate) fn has_state(&self, row: usize) -> Mask<S> {
        match &self.recording.is_recorded {
            Some(rows) => self.load(rows[row]).simd_gt(0),
            None => self.int(1).simd_gt(0),
        }
    }
}

/// At most sixteen frames of a span, for minima and counts.
#[derive(Clone, Copy)]
pub(crate) struct SpanBlock<S: Simd> {
    /// Token of the SIMD level.
    pub(crate) simd: S,
    /// Frame in the first lane.
    pub(crate) first_frame: usize,
    /// Number of frames that belong to the span.
    pub(crate) len: usize,
}

impl<S: Simd> SpanBlock<S> {
    /// The block that begins at `first_frame` of a span; `end` is the frame after the span.
    #[inline(always)]
    pub(crate) fn new(simd: S, first_frame: usize, end: usize) -> Self {
        let len = (end - first_frame).min(SIMD_LANES);
        Self {
            simd,
            first_frame,
            len,
        }
    }

    /// The frames of a row; after the span its last frame repeats.
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

    /// The frames of a signal.
    #[inline(always)]
    pub(crate) fn load(&self, row: &[f32]) -> F32<S> {
        F32::simd_from(self.simd, self.array(row))
    }

    /// The frames of a row of integers.
    #[inline(always)]
    pub(crate) fn load_ints<T: Copy + Into<i32>>(&self, row: &[T]) -> i32x16<S> {
        i32x16::simd_from(self.simd, self.array(row).map(Into::into))
    }

    /// Call `visit(value, frame)` for each frame of the span, in order.
    #[inline(always)]
    pub(crate) fn for_each_frame(&self, values: F32<S>, mut visit: impl FnMut(f32, usize)) {
        let values: [f32; SIMD_LANES] = values.to_array();
        for (simd_lane, value) in values.iter().enumerate().take(self.len) {
            visit(*value, self.first_frame + simd_lane);
        }
    }
}

/// The smallest of sixteen numbers, except NaN; infinity if all are NaN.
#[inline(always)]
pub(crate) fn min_of_lanes<S: Simd>(values: F32<S>) -> f32 {
    let values: [f32; SIMD_LANES] = values.to_array();
    values.into_iter().fold(f32::INFINITY, |smallest, value| {
        if value < smallest { value } else { smallest }
    })
}

/// The largest of sixteen numbers, except NaN; minus infinity if all are NaN.
#[inline(always)]
pub(crate) fn max_of_lanes<S: Simd>(values: F32<S>) -> f32 {
    let values: [f32; SIMD_LANES] = values.to_array();
    values
        .into_iter()
        .fold(f32::NEG_INFINITY, |largest, value| {
            if value > largest { value } else { largest }
        })
}
