//! The distance to the vehicle ahead, but for the time after it cut in.

use std::ops::Range;

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use super::one::{LEADER, One};
use super::row::{Piece, least};
use super::{ENDLESS, Lowest};
use crate::lanes::{LANES, M, V, choose, min, splat};
use crate::signals::NO_VEHICLE;

impl One<'_> {
    /// Gap minus lawful gap.
    pub(super) fn follow<S: Simd>(&self, simd: S, span: Range<usize>) -> Lowest {
        let mut since = CutIns::new(self);
        let mut found = Lowest::NOTHING;
        if span.is_empty() {
            return found;
        }
        since.pass_all(0..span.start);
        simd.vectorize(
            #[inline(always)]
            || {
                let mut low = splat(simd, found.low);
                for at in span.clone().step_by(LANES) {
                    let piece = Piece::new(simd, at, span.end);
                    since.pass_all(at..at + piece.len);
                    let Some((margin, there)) = self.follow_margin(piece) else {
                        continue;
                    };
                    let margin = if since.is_settled(at) {
                        choose(there, margin, splat(simd, ENDLESS))
                    } else {
                        since.without_recent(piece, margin)
                    };
                    low = min(margin, low);
                    if margin.simd_lt(0.0).any_true() {
                        piece.each(margin, |margin, frame| found.take(margin, frame));
                    }
                }
                found.low = least(low);
            },
        );
        found
    }

    /// Gap minus lawful gap in some frames, and where somebody is ahead; nothing where nobody is.
    #[inline(always)]
    fn follow_margin<S: Simd>(&self, piece: Piece<S>) -> Option<(V<S>, M<S>)> {
        let near = self.neighbour(piece, LEADER)?;
        let decel = self.numbers.sure_decel(piece.load(self.seen.friction));
        let speed = piece.load(self.seen.speed);
        let lawful = self.numbers.lawful_gap(speed, near.closing, decel);
        Some((near.gap - lawful, near.there))
    }
}

/// When each vehicle has cut in for the last time.
struct CutIns<'a> {
    one: &'a One<'a>,
    leaders: &'a [u8],
    /// Vehicles that have cut in, and when; the latest is the last.
    latest: Vec<(u8, usize)>,
}

impl<'a> CutIns<'a> {
    fn new(one: &'a One<'a>) -> Self {
        Self {
            one,
            leaders: one.seen.neighbour(LEADER),
            latest: Vec::new(),
        }
    }

    /// Note who cuts in during some frames.
    #[inline(always)]
    fn pass_all(&mut self, frames: Range<usize>) {
        let start = frames.start.max(1);
        let pairs = self.leaders[start - 1..frames.end.max(start)].iter();
        // Most pieces have one leader, which is found without a branch for each frame.
        let changes = pairs
            .clone()
            .zip(pairs.skip(1))
            .fold(false, |any, (one, other)| any | (one != other));
        if changes {
            frames
                .filter(|&frame| frame > 0)
                .for_each(|frame| self.pass(frame));
        }
    }

    /// Note whether a vehicle from another lane becomes the leader of an ego that keeps its own.
    fn pass(&mut self, frame: usize) {
        let (leader, before, lane) = (self.leaders[frame], frame - 1, self.one.seen.lane);
        if leader == self.leaders[before] || leader == NO_VEHICLE || lane[frame] != lane[before] {
            return;
        }
        let slot = usize::from(leader);
        let present = self.one.present.is_none_or(|rows| rows[slot][before]);
        if present && self.one.lane[slot][before] != lane[before] {
            self.latest.push((leader, frame));
        }
    }

    /// Whether from a frame on nobody has cut in so lately that its distance may still be regained.
    fn is_settled(&self, frame: usize) -> bool {
        let last = self.latest.last();
        last.is_none_or(|&(_, cut)| cut + self.one.numbers.regain < frame)
    }

    /// Margins of the frames in which there is a leader that has not cut in lately.
    fn without_recent<S: Simd>(&self, piece: Piece<S>, margin: V<S>) -> V<S> {
        let mut counted = [ENDLESS; LANES];
        piece.each(margin, |margin, frame| {
            let leader = self.leaders[frame];
            if leader != NO_VEHICLE && !self.is_recent(leader, frame) {
                counted[frame - piece.at] = margin;
            }
        });
        V::simd_from(piece.simd, counted)
    }

    /// Whether a vehicle has cut in so lately that its distance may still be regained.
    fn is_recent(&self, vehicle: u8, frame: usize) -> bool {
        let lately = |cut: usize| cut <= frame && frame - cut <= self.one.numbers.regain;
        let mut cuts = self.latest.iter();
        cuts.any(|&(other, cut)| other == vehicle && lately(cut))
    }
}
