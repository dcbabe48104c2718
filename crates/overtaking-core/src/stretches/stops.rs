//! Whether the ego can stop in the distance that it sees.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use super::formulas::Grip;
use super::row::{Piece, least};
use super::{Found, Lowest, Spans};
use crate::lanes::{LANES, V, at_least, dispatch, min, splat};

/// Arrays (simulation, frame), and numbers.
pub struct Stops<'a> {
    /// Speed [m/s].
    pub speed: &'a [f32],
    /// Friction.
    pub friction: &'a [f32],
    /// Distance that is seen [m].
    pub sight: &'a [f32],
    /// Friction and gravity.
    pub grip: Grip,
    /// Before the ego brakes [s].
    pub reaction_time: f32,
}

/// Sight minus stopping distance.
pub fn stops(given: &Stops<'_>, spans: &Spans<'_>, mut found: Found<'_>) {
    let level = spans.level;
    found.fill(|simulation| dispatch!(level, |simd| one(simd, given, spans, simulation)));
}

fn one<S: Simd>(simd: S, given: &Stops<'_>, spans: &Spans<'_>, simulation: usize) -> Lowest {
    simd.vectorize(
        #[inline(always)]
        || {
            let (span, own) = (spans.of(simulation), spans.own(simulation));
            let (speed, friction) = (&given.speed[own.clone()], &given.friction[own.clone()]);
            let sight = &given.sight[own];
            let mut found = Lowest::NOTHING;
            let mut low = splat(simd, found.low);
            for at in span.clone().step_by(LANES) {
                let piece = Piece::new(simd, at, span.end);
                let margin =
                    piece.load(sight) - way(given, piece.load(speed), piece.load(friction));
                low = min(margin, low);
                if margin.simd_lt(0.0).any_true() {
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

/// Way to a standstill.
#[inline(always)]
fn way<S: Simd>(given: &Stops<'_>, speed: V<S>, friction: V<S>) -> V<S> {
    let decel = given.grip.usable * at_least(friction, given.grip.floor);
    speed * given.reaction_time + speed * speed / (2.0 * decel)
}
