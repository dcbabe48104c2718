//! Margins to a limit that one signal keeps, and lamps that are on, over a stretch of frames.

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};
use rayon::prelude::*;

use super::row::{Piece, least};
use super::{Lowest, SHARE};
use crate::lanes::{LANES, V, dispatch, min, splat};

/// A signal and its limit; slices lead with the simulation.
pub struct Limited<'a> {
    /// Frames of each simulation.
    pub signal: Vec<&'a [f32]>,
    /// First and last frame, both within the stretch, (end, simulation); empty where the last is before.
    pub span: &'a [i32],
    /// The limit of each simulation.
    pub limit: &'a [f32],
    /// Whether it is the greatest that is allowed, not the least.
    pub is_most: bool,
}

/// Smallest margins of a batch, and rows of `frames` with the first and the last negative one, and how many follow
/// each other.
pub fn limited(asked: &Limited<'_>, level: Level, low: &mut [f32], frames: &mut [i32]) {
    let count = asked.signal.len();
    let found: Vec<Lowest> = (0..count)
        .into_par_iter()
        .with_min_len(SHARE)
        .map(|simulation| {
            let span = within(
                asked.span,
                simulation,
                count,
                asked.signal[simulation].len(),
            );
            dispatch!(level, |simd| asked.lowest(simd, simulation, span))
        })
        .collect();
    let (first, rest) = frames.split_at_mut(count);
    let (last, longest) = rest.split_at_mut(count);
    for (simulation, one) in found.iter().enumerate() {
        low[simulation] = one.low;
        (first[simulation], last[simulation]) = (one.first, one.last);
        longest[simulation] = one.longest;
    }
}

/// The frames of a stretch that there are.
fn within(span: &[i32], simulation: usize, count: usize, frames: usize) -> Range<usize> {
    let (start, stop) = (span[simulation], span[count + simulation]);
    let end = ((stop.max(-1) + 1) as usize).min(frames);
    (start.max(0) as usize).min(end)..end
}

impl Limited<'_> {
    fn lowest<S: Simd>(&self, simd: S, simulation: usize, span: Range<usize>) -> Lowest {
        let (signal, limit) = (self.signal[simulation], self.limit[simulation]);
        simd.vectorize(
            #[inline(always)]
            || {
                let mut found = Lowest::NOTHING;
                let mut low = splat(simd, found.low);
                for at in span.clone().step_by(LANES) {
                    let piece = Piece::new(simd, at, span.end);
                    let value: V<S> = piece.load(signal);
                    let margin = if self.is_most {
                        limit - value
                    } else {
                        value - limit
                    };
                    low = min(margin, low);
                    let broken = margin.simd_lt(0.0);
                    if broken.all_true() {
                        found.take_all(at..at + piece.len);
                    } else if broken.any_true() {
                        piece.each(margin, |margin, frame| found.take(margin, frame));
                    }
                }
                Lowest {
                    low: least(low),
                    ..found
                }
            },
        )
    }
}

/// Bits that are set in any frame of a stretch of each simulation, and those that are in all of them: two rows of `out`.
///
/// None and all where a stretch has no frame.
pub fn bits(rows: &[&[u8]], span: &[i32], out: &mut [u8]) {
    let count = rows.len();
    let (any, all) = out.split_at_mut(count);
    for (simulation, row) in rows.iter().enumerate() {
        let frames = &row[within(span, simulation, count, row.len())];
        any[simulation] = frames.iter().fold(0, |any, one| any | one);
        all[simulation] = frames.iter().fold(u8::MAX, |all, one| all & one);
    }
}
