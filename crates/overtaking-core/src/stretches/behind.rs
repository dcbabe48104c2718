//! The duty to return once somebody is behind, and braking forced on who is.

use std::ops::Range;

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use super::formulas::drac;
use super::one::{FOLLOWER, One, RIGHT_FOLLOWER, RIGHT_LEADER};
use super::row::Piece;
use super::{ENDLESS, Lowest, NEVER};
use crate::lanes::{LANES, M, V, at_most, choose, max, min, splat};
use crate::signals::{METRES, NO_VEHICLE};

impl One<'_> {
    /// The longest run of frames in which the ego could have returned: its first frame and its length.
    pub(super) fn due<S: Simd>(
        &self,
        simd: S,
        target: u8,
        original: u8,
        span: Range<usize>,
    ) -> (i32, i32) {
        let (mut first, mut length, mut run) = (NEVER, 0, 0);
        let lane = self.seen.lane;
        let away =
            |frame: usize| lane[frame] != original && usize::from(lane[frame]) < self.num_lanes;
        simd.vectorize(
            #[inline(always)]
            || {
                for at in span.clone().step_by(LANES) {
                    let piece = Piece::new(simd, at, span.end);
                    if !(at..at + piece.len).any(away) {
                        run = 0;
                        continue;
                    }
                    let room = self.room(piece, target);
                    piece.each(room, |room, frame| {
                        run = if away(frame) && room >= 0.0 {
                            run + 1
                        } else {
                            0
                        };
                        if run > length {
                            (first, length) = (frame as i32 + 1 - run, run);
                        }
                    });
                }
            },
        );
        (first, length)
    }

    /// Room to return, negative where the target is not far enough behind.
    #[inline(always)]
    fn room<S: Simd>(&self, piece: Piece<S>, target: u8) -> V<S> {
        let numbers = self.numbers;
        let speed = piece.load(self.seen.speed);
        let decel = numbers.sure_decel(piece.load(self.seen.friction));
        let mut room = splat(piece.simd, numbers.reach);
        for place in [RIGHT_LEADER, RIGHT_FOLLOWER] {
            let Some(near) = self.neighbour(piece, place) else {
                continue;
            };
            let needed = if place == RIGHT_LEADER {
                let lawful = numbers.lawful_gap(speed, near.closing, decel);
                max(lawful, numbers.free_time * near.closing)
            } else {
                let behind = speed + near.closing;
                numbers.lawful_gap(behind, near.closing, decel)
            };
            room = choose(near.there, min(room, near.gap - needed), room);
        }
        let enough = self.is_behind(piece, target, speed, decel);
        choose(enough, room, splat(piece.simd, -1.0))
    }

    /// Whether the target is far enough behind.
    #[inline(always)]
    fn is_behind<S: Simd>(&self, piece: Piece<S>, target: u8, speed: V<S>, decel: V<S>) -> M<S> {
        let slot = match target {
            NO_VEHICLE => 0,
            slot => usize::from(slot),
        };
        let lead: V<S> = (piece.integers(self.s[0]) - piece.integers(self.s[slot])).to_float();
        let theirs: V<S> = piece.integers(self.speed[slot]).to_float();
        let (lead, theirs) = (lead * METRES, theirs * METRES);
        let gap = lead.abs() - 0.5 * (self.length[0] + self.length[slot]);
        let lawful = self.numbers.lawful_gap(theirs, theirs - speed, decel);
        let wanted = max(self.numbers.time_gap * theirs, lawful);
        lead.simd_gt(0.0) & gap.simd_ge(wanted)
    }

    /// Allowed braking minus what is forced on the follower after each change of lane.
    pub(super) fn braking<S: Simd>(&self, simd: S, span: Range<usize>) -> Lowest {
        let mut found = Lowest::NOTHING;
        let (mut next, mut done) = (span.start.max(1), 0);
        while let Some(change) = next_change(self.seen.lane, next..span.end) {
            let until = span.end.min(change + self.numbers.lasting + 1);
            // Two changes in a short time have frames in common, each of which is taken once.
            let frames = change.max(done)..until;
            simd.vectorize(
                #[inline(always)]
                || self.braking_after(simd, frames.clone(), &mut found),
            );
            (next, done) = (change + 1, until);
        }
        found
    }

    #[inline(always)]
    fn braking_after<S: Simd>(&self, simd: S, frames: Range<usize>, found: &mut Lowest) {
        for at in frames.clone().step_by(LANES) {
            let piece = Piece::new(simd, at, frames.end);
            let Some(near) = self.neighbour(piece, FOLLOWER) else {
                continue;
            };
            let forced = at_most(drac(near.gap, near.closing), self.numbers.most_braking);
            let margin = self.numbers.allowed_braking - forced;
            let margin = choose(near.there, margin, splat(simd, ENDLESS));
            piece.each(margin, |margin, frame| found.take(margin, frame));
        }
    }
}

/// First of some frames in which a lane is another than before; `frames` begin after the first of all.
fn next_change(lane: &[u8], frames: Range<usize>) -> Option<usize> {
    // Where the lane stays, and it mostly does, many frames are compared at once.
    let kept = |frames: Range<usize>| {
        let same = lane[frames.start];
        lane[frames]
            .iter()
            .fold(true, |all, &each| all & (each == same))
    };
    let mut at = frames.start;
    while at + LANES <= frames.end && kept(at - 1..at + LANES) {
        at += LANES;
    }
    (at..frames.end).find(|&frame| lane[frame] != lane[frame - 1])
}
