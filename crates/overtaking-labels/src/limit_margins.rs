//! Margins of one signal to a limit, and flags such as lamps, over a span of frames.
//!
//! A margin is negative where the signal exceeds a maximum or falls below a minimum.

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};
use overtaking_core::dispatch;
use rayon::prelude::*;

use crate::frame_block::{SpanBlock, min_of_lanes};
use crate::recording::span_frames;
use crate::span_scans::{MarginMinimum, SIMULATIONS_PER_TASK};
use crate::vectors::{F32, SIMD_LANES, min, splat};

/// A signal and its limit in each simulation.
pub struct LimitQuery<'a> {
    /// The frames of each simulation.
    pub signal: Vec<&'a [f32]>,
    /// First and last frame of the span, (end, simulation); empty if the last frame is before the first.
    pub span: &'a [i32],
    /// The limit of each simulation.
    pub limit: &'a [f32],
    /// Whether the limit is the largest allowed value, and not the smallest.
    pub is_maximum: bool,
}

/// Find the smallest margin of each simulation, and the frames with a negative margin.
///
/// `min_margin` has shape (simulation). `frames` has three rows, (row, simulation): the first negative frame, the last
/// one, and the length of the longest run of them.
pub fn limit_margins(
    query: &LimitQuery<'_>,
    level: Level,
    min_margin: &mut [f32],
    frames: &mut [i32],
) {
    let num_simulations = query.signal.len();
    let minima: Vec<MarginMinimum> = (0..num_simulations)
        .into_par_iter()
        .with_min_len(SIMULATIONS_PER_TASK)
        .map(|simulation| {
            let num_frames = query.signal[simulation].len();
            let span = span_frames(query.span, simulation, num_simulations, num_frames);
            dispatch!(level, |simd| query.minimum(simd, simulation, span))
        })
        .collect();
    let (first_frame, rest) = frames.split_at_mut(num_simulations);
    let (last_frame, longest_run) = rest.split_at_mut(num_simulations);
    for (simulation, minimum) in minima.iter().enumerate() {
        min_margin[simulation] = minimum.min_margin;
        first_frame[simulation] = minimum.first_frame;
        last_frame[simulation] = minimum.last_frame;
        longest_run[simulation] = minimum.longest_run;
    }
}

impl LimitQuery<'_> {
    /// The smallest margin of one simulation over the frames of `span`.
    fn minimum<S: Simd>(&self, simd: S, simulation: usize, span: Range<usize>) -> MarginMinimum {
        let (signal, limit) = (self.signal[simulation], self.limit[simulation]);
        simd.vectorize(
            #[inline(always)]
            || {
                let mut minimum = MarginMinimum::UNCONSTRAINED;
                let mut smallest = splat(simd, minimum.min_margin);
                for first_frame in span.clone().step_by(SIMD_LANES) {
                    let block = SpanBlock::new(simd, first_frame, span.end);
                    let value: F32<S> = block.load(signal);
                    let margin = if self.is_maximum {
                        limit - value
                    } else {
                        value - limit
                    };
                    smallest = min(margin, smallest);
                    // A loop over single frames is slow; only blocks with margins of both signs need it.
                    let is_negative = margin.simd_lt(0.0);
                    if is_negative.all_true() {
                        minimum.take_negative_frames(first_frame..first_frame + block.len);
                    } else if is_negative.any_true() {
                        block.for_each_frame(margin, |margin, frame| minimum.take(margin, frame));
                    }
                }
                // `take` saw only some blocks, and `take_negative_frames` leaves the minimum to its caller.
                minimum.min_margin = min_of_lanes(smallest);
                minimum
            },
        )
    }
}

/// Bits that are set in any frame of a span, then bits that are set in all of its frames: two rows of `out`, (row,
/// simulation).
///
/// A span without frames has no bit in the first row and all bits in the second.
pub fn flag_bits(rows: &[&[u8]], span: &[i32], out: &mut [u8]) {
    let num_simulations = rows.len();
    let (in_any, in_all) = out.split_at_mut(num_simulations);
    for (simulation, row) in rows.iter().enumerate() {
        let flags = &row[span_frames(span, simulation, num_simulations, row.len())];
        in_any[simulation] = flags.iter().fold(0, |bits, flags| bits | flags);
        in_all[simulation] = flags.iter().fold(u8::MAX, |bits, flags| bits & flags);
    }
}
