//! The smallest and the largest of single numbers over a stretch.

use fearless_simd::{Level, Simd};
use rayon::prelude::*;

use super::{Found, NEVER, SHARE, Spans};
use crate::lanes::dispatch;

/// How numbers are reduced to one.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Extreme {
    /// The smallest.
    Least,
    /// The largest.
    Greatest,
}

/// The smallest or the largest of an array (simulation, frame) in each stretch.
///
/// Where that is empty the number of its first frame, or of the first frame of all.
pub fn extreme_float(values: &[f32], kind: Extreme, spans: &Spans<'_>, out: &mut [f32]) {
    let lower = |a: f32, b: f32| if b < a { b } else { a };
    let higher = |a: f32, b: f32| if b > a { b } else { a };
    match kind {
        Extreme::Least => reduce(values, spans, out, lower),
        Extreme::Greatest => reduce(values, spans, out, higher),
    }
}

/// The same extreme, and the first and the last frame with a number beyond a limit of its simulation.
pub fn beyond(
    values: &[f32],
    limits: &[f32],
    kind: Extreme,
    spans: &Spans<'_>,
    mut found: Found<'_>,
) {
    let is_least = kind == Extreme::Least;
    extreme_float(values, kind, spans, found.low);
    for (simulation, &limit) in limits.iter().enumerate() {
        let (extreme, span) = (found.low[simulation], spans.of(simulation));
        let is_beyond = |value: f32| {
            if is_least {
                value < limit
            } else {
                value > limit
            }
        };
        found.set_ends(simulation, NEVER, NEVER);
        if span.is_empty() || !is_beyond(extreme) {
            continue;
        }
        let row = &values[spans.own(simulation)][span.clone()];
        let at = |frame: Option<usize>| frame.map_or(NEVER, |frame| (span.start + frame) as i32);
        let first = row.iter().position(|&value| is_beyond(value));
        let last = row.iter().rposition(|&value| is_beyond(value));
        found.set_ends(simulation, at(first), at(last));
    }
}

fn reduce<T, F>(values: &[T], spans: &Spans<'_>, out: &mut [T], by: F)
where
    T: Copy + Send + Sync,
    F: Fn(T, T) -> T + Sync,
{
    let level = spans.level;
    out.par_iter_mut()
        .with_min_len(SHARE)
        .enumerate()
        .for_each(|(simulation, found)| {
            let row = &values[spans.own(simulation)];
            let span = spans.of(simulation);
            let some = if span.is_empty() {
                &row[..1]
            } else {
                &row[span]
            };
            *found = folded(level, some, &by);
        });
}

/// All numbers of a slice that has some, reduced to one; the order does not matter.
fn folded<T: Copy, F: Fn(T, T) -> T>(level: Level, values: &[T], by: &F) -> T {
    const WIDTH: usize = 32;
    dispatch!(level, |simd| simd.vectorize(
        #[inline(always)]
        || {
            let mut sides = [values[0]; WIDTH];
            let (whole, rest) = values.as_chunks::<WIDTH>();
            for chunk in whole {
                for (side, value) in sides.iter_mut().zip(chunk) {
                    *side = by(*side, *value);
                }
            }
            sides
                .iter()
                .chain(rest)
                .fold(values[0], |one, other| by(one, *other))
        }
    ))
}
