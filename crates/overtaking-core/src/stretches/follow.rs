//! The distance to the vehicle ahead, but for the time after it cut in.

use fearless_simd::Simd;

use super::formulas::Law;
use super::row::Piece;
use super::{Found, Lowest, NO_VEHICLE, Spans};
use crate::lanes::{LANES, dispatch};

/// Arrays (simulation, frame), of neighbours (simulation, place, frame), and numbers.
pub struct Follow<'a> {
    /// Speed [m/s].
    pub speed: &'a [f32],
    /// Friction.
    pub friction: &'a [f32],
    /// Lane of the ego.
    pub lane: &'a [u8],
    /// Neighbours.
    pub vehicle: &'a [u8],
    /// Gaps to them [m].
    pub gap: &'a [f32],
    /// Closing speeds [m/s].
    pub closing_speed: &'a [f32],
    /// Lane of every slot.
    pub lanes: Vec<&'a [u8]>,
    /// Whether there is a state; `None` where every vehicle has all frames.
    pub present: Option<Vec<&'a [bool]>>,
    /// Slots of a simulation.
    pub slots: usize,
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
    let leaders = &given.vehicle[spans.place(simulation, 0)];
    let mut margins = vec![0.0; span.len()];
    simd.vectorize(
        #[inline(always)]
        || {
            let (own, lead) = (spans.own(simulation), spans.place(simulation, 0));
            let (speed, friction) = (&given.speed[own.clone()], &given.friction[own]);
            let (gap, closing) = (&given.gap[lead.clone()], &given.closing_speed[lead]);
            for at in span.clone().step_by(LANES) {
                let piece = Piece::new(simd, at, span.end);
                let decel = given.law.sure_decel(piece.load(friction));
                let (speed, closing) = (piece.load(speed), piece.load(closing));
                let margin = piece.load(gap) - given.law.lawful_gap(speed, closing, decel);
                piece.each(margin, |margin, frame| margins[frame - span.start] = margin);
            }
        },
    );
    let mut since = CutIns::new(given, spans, simulation);
    let mut found = Lowest::NOTHING;
    for frame in 0..span.end {
        since.pass(frame);
        let leader = leaders[frame];
        if frame >= span.start && leader != NO_VEHICLE && !since.is_recent(leader, frame) {
            found.take(margins[frame - span.start], frame);
        }
    }
    found
}

/// When each vehicle has cut in for the last time.
struct CutIns<'a> {
    given: &'a Follow<'a>,
    leaders: &'a [u8],
    lane: &'a [u8],
    first_slot: usize,
    latest: Vec<Option<usize>>,
}

impl<'a> CutIns<'a> {
    fn new(given: &'a Follow<'a>, spans: &Spans<'_>, simulation: usize) -> Self {
        Self {
            given,
            leaders: &given.vehicle[spans.place(simulation, 0)],
            lane: &given.lane[spans.own(simulation)],
            first_slot: simulation * given.slots,
            latest: vec![None; given.slots],
        }
    }

    /// Note whether a vehicle from another lane becomes the leader of an ego that keeps its own.
    fn pass(&mut self, frame: usize) {
        let leader = self.leaders[frame];
        let Some(before) = frame.checked_sub(1) else {
            return;
        };
        if leader == self.leaders[before]
            || leader == NO_VEHICLE
            || self.lane[frame] != self.lane[before]
        {
            return;
        }
        let slot = self.first_slot + usize::from(leader);
        let present = self
            .given
            .present
            .as_ref()
            .is_none_or(|rows| rows[slot][before]);
        if present && self.given.lanes[slot][before] != self.lane[before] {
            self.latest[usize::from(leader)] = Some(frame);
        }
    }

    /// Whether a vehicle has cut in so lately that its distance may still be regained.
    fn is_recent(&self, vehicle: u8, frame: usize) -> bool {
        self.latest[usize::from(vehicle)].is_some_and(|cut| frame - cut <= self.given.regain)
    }
}
