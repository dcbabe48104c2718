//! The distance to the vehicle ahead, but for the time after it cut in.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use super::around::Around;
use super::formulas::Law;
use super::row::{Piece, least};
use super::{ENDLESS, Found, Lowest, NO_VEHICLE, Spans};
use crate::lanes::{LANES, M, V, choose, dispatch, min, splat};

const LEADER: usize = 0;

/// Arrays (simulation, frame), and numbers.
pub struct Follow<'a> {
    /// Speed [m/s].
    pub speed: &'a [f32],
    /// Friction.
    pub friction: &'a [f32],
    /// Lane of the ego.
    pub lane: &'a [u8],
    /// Its neighbours.
    pub around: Around<'a>,
    /// Lane of every slot.
    pub lanes: Vec<&'a [u8]>,
    /// Whether there is a state; `None` where every vehicle has all frames.
    pub present: Option<Vec<&'a [bool]>>,
    /// Frames in which a distance that was taken may be regained.
    pub regain: usize,
    /// The distances of the law.
    pub law: Law,
}

/// Gap minus lawful gap.
pub fn follow(given: &Follow<'_>, spans: &Spans<'_>, mut found: Found<'_>) {
    let level = spans.level;
    found.fill(|simulation| dispatch!(level, |simd| one(simd, given, spans, simulation)));
}

fn one<S: Simd>(simd: S, given: &Follow<'_>, spans: &Spans<'_>, simulation: usize) -> Lowest {
    let span = spans.of(simulation);
    let mut since = CutIns::new(given, spans, simulation);
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
                let Some((margin, there)) = given.margin(piece, spans, simulation) else {
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

impl Follow<'_> {
    /// Gap minus lawful gap in some frames, and where somebody is ahead; nothing where nobody is.
    #[inline(always)]
    fn margin<S: Simd>(
        &self,
        piece: Piece<S>,
        spans: &Spans<'_>,
        simulation: usize,
    ) -> Option<(V<S>, M<S>)> {
        let near = self.around.neighbour(piece, spans, simulation, LEADER)?;
        let own = |values: &[f32]| piece.load(&values[spans.own(simulation)]);
        let decel = self.law.sure_decel(own(self.friction));
        let lawful = self.law.lawful_gap(own(self.speed), near.closing, decel);
        Some((near.gap - lawful, near.there))
    }
}

/// When each vehicle has cut in for the last time.
struct CutIns<'a> {
    given: &'a Follow<'a>,
    leaders: &'a [u8],
    lane: &'a [u8],
    first_slot: usize,
    /// Vehicles that have cut in, and when; the latest is the last.
    latest: Vec<(u8, usize)>,
}

impl<'a> CutIns<'a> {
    fn new(given: &'a Follow<'a>, spans: &Spans<'_>, simulation: usize) -> Self {
        Self {
            given,
            leaders: &given.around.vehicle[spans.place(simulation, LEADER)],
            lane: &given.lane[spans.own(simulation)],
            first_slot: simulation * given.around.slots,
            latest: Vec::new(),
        }
    }

    /// Note who cuts in during some frames.
    #[inline(always)]
    fn pass_all(&mut self, frames: std::ops::Range<usize>) {
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
        let (leader, before) = (self.leaders[frame], frame - 1);
        if leader == self.leaders[before]
            || leader == NO_VEHICLE
            || self.lane[frame] != self.lane[before]
        {
            return;
        }
        let slot = self.first_slot + usize::from(leader);
        let present = self.given.present.as_ref();
        let present = present.is_none_or(|rows| rows[slot][before]);
        if present && self.given.lanes[slot][before] != self.lane[before] {
            self.latest.push((leader, frame));
        }
    }

    /// Whether from a frame on nobody has cut in so lately that its distance may still be regained.
    fn is_settled(&self, frame: usize) -> bool {
        let last = self.latest.last();
        last.is_none_or(|&(_, cut)| cut + self.given.regain < frame)
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
        let lately = |cut: usize| cut <= frame && frame - cut <= self.given.regain;
        let mut cuts = self.latest.iter();
        cuts.any(|&(other, cut)| other == vehicle && lately(cut))
    }
}
