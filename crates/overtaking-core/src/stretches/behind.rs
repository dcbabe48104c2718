//! The duty to return once somebody is behind, and braking forced on who is.

use fearless_simd::Simd;
use fearless_simd::prelude::*;
use rayon::prelude::*;

use super::formulas::{Law, drac};
use super::row::Piece;
use super::{Found, Lowest, NEVER, NO_VEHICLE, SHARE, Spans};
use crate::lanes::{LANES, V, at_most, choose, dispatch, max, min, splat};

const FOLLOWER: usize = 1;
const RIGHT_LEADER: usize = 4;
const RIGHT_FOLLOWER: usize = 5;

/// Arrays (simulation, frame), of neighbours (simulation, place, frame), and numbers.
pub struct Duty<'a> {
    /// Lane of the ego.
    pub lane: &'a [u8],
    /// Lane that it came from, (simulation).
    pub original_lane: &'a [u8],
    /// Driving lanes.
    pub num_lanes: usize,
    /// Speed [m/s].
    pub speed: &'a [f32],
    /// Friction.
    pub friction: &'a [f32],
    /// Neighbours.
    pub vehicle: &'a [u8],
    /// Gaps to them [m].
    pub gap: &'a [f32],
    /// Closing speeds [m/s].
    pub closing_speed: &'a [f32],
    /// Ego minus target along the road [m].
    pub lead: &'a [f32],
    /// Gap to the target [m].
    pub target_gap: &'a [f32],
    /// Its speed [m/s].
    pub target_speed: &'a [f32],
    /// The distances of the law.
    pub law: Law,
    /// Time gap to the target that is enough [s].
    pub time_gap: f32,
    /// Time in which the vehicle ahead must not be reached [s].
    pub free_time: f32,
    /// Farthest that room is looked for [m].
    pub reach: f32,
}

/// The longest run of frames in which the ego could have returned: its first frame and its length.
pub fn duty(given: &Duty<'_>, spans: &Spans<'_>, first: &mut [i32], length: &mut [i32]) {
    let level = spans.level;
    first
        .par_iter_mut()
        .zip(length.par_iter_mut())
        .with_min_len(SHARE)
        .enumerate()
        .for_each(|(simulation, (first, length))| {
            (*first, *length) = dispatch!(level, |simd| longest(simd, given, spans, simulation));
        });
}

fn longest<S: Simd>(simd: S, given: &Duty<'_>, spans: &Spans<'_>, simulation: usize) -> (i32, i32) {
    let span = spans.of(simulation);
    let (mut first, mut length, mut run) = (NEVER, 0, 0);
    simd.vectorize(
        #[inline(always)]
        || {
            let lane = &given.lane[spans.own(simulation)];
            let original = given.original_lane[simulation];
            let away = |frame: usize| {
                lane[frame] != original && usize::from(lane[frame]) < given.num_lanes
            };
            for at in span.clone().step_by(LANES) {
                let piece = Piece::new(simd, at, span.end);
                if !(at..at + piece.len).any(away) {
                    run = 0;
                    continue;
                }
                let room = given.room(piece, spans, simulation);
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

impl Duty<'_> {
    /// Room to return, negative where the target is not far enough behind.
    #[inline(always)]
    fn room<S: Simd>(&self, piece: Piece<S>, spans: &Spans<'_>, simulation: usize) -> V<S> {
        let own = |values: &[f32]| piece.load(&values[spans.own(simulation)]);
        let (speed, theirs) = (own(self.speed), own(self.target_speed));
        let decel = self.law.sure_decel(own(self.friction));
        let lawful = self.law.lawful_gap(theirs, theirs - speed, decel);
        let wanted = max(self.time_gap * theirs, lawful);
        let enough = own(self.lead).simd_gt(0.0) & own(self.target_gap).simd_ge(wanted);
        let mut room = splat(piece.simd, self.reach);
        for place in [RIGHT_LEADER, RIGHT_FOLLOWER] {
            let row = spans.place(simulation, place);
            let closing = piece.load(&self.closing_speed[row.clone()]);
            let mut needed = if place == RIGHT_LEADER {
                self.law.lawful_gap(speed, closing, decel)
            } else {
                self.law.lawful_gap(speed + closing, closing, decel)
            };
            if place == RIGHT_LEADER {
                needed = max(needed, self.free_time * closing);
            }
            let there = piece
                .array(&self.vehicle[row.clone()])
                .map(|slot| f32::from(u8::from(slot != NO_VEHICLE)));
            let there = V::simd_from(piece.simd, there).simd_gt(0.5);
            room = choose(there, min(room, piece.load(&self.gap[row]) - needed), room);
        }
        choose(enough, room, splat(piece.simd, -1.0))
    }
}

/// Arrays (simulation, frame), of neighbours (simulation, place, frame), and numbers.
pub struct Obstruction<'a> {
    /// Lane of the ego.
    pub lane: &'a [u8],
    /// Neighbours.
    pub vehicle: &'a [u8],
    /// Gaps to them [m].
    pub gap: &'a [f32],
    /// Closing speeds [m/s].
    pub closing_speed: &'a [f32],
    /// Frames after a change of lane that count.
    pub lasting: usize,
    /// Braking that is allowed [m/s^2].
    pub allowed: f32,
    /// Braking beyond which none is told from another [m/s^2].
    pub most: f32,
}

/// Allowed braking minus what is forced on the follower after each change of lane.
pub fn obstruction(given: &Obstruction<'_>, spans: &Spans<'_>, mut found: Found<'_>) {
    let level = spans.level;
    found.fill(|simulation| dispatch!(level, |simd| after_changes(simd, given, spans, simulation)));
}

fn after_changes<S: Simd>(
    simd: S,
    given: &Obstruction<'_>,
    spans: &Spans<'_>,
    simulation: usize,
) -> Lowest {
    let span = spans.of(simulation);
    let lane = &given.lane[spans.own(simulation)];
    let mut found = Lowest::NOTHING;
    let mut next = span.start.max(1);
    while let Some(change) = (next..span.end).find(|&frame| lane[frame] != lane[frame - 1]) {
        let until = span.end.min(change + given.lasting + 1);
        simd.vectorize(
            #[inline(always)]
            || braking(simd, given, spans, simulation, change..until, &mut found),
        );
        next = change + 1;
    }
    found
}

#[inline(always)]
fn braking<S: Simd>(
    simd: S,
    given: &Obstruction<'_>,
    spans: &Spans<'_>,
    simulation: usize,
    frames: std::ops::Range<usize>,
    found: &mut Lowest,
) {
    let row = spans.place(simulation, FOLLOWER);
    let followers = &given.vehicle[row.clone()];
    for at in frames.clone().step_by(LANES) {
        let piece = Piece::new(simd, at, frames.end);
        let (gap, closing) = (
            piece.load(&given.gap[row.clone()]),
            piece.load(&given.closing_speed[row.clone()]),
        );
        let margin = given.allowed - at_most(drac(gap, closing), given.most);
        piece.each(margin, |margin, frame| {
            if followers[frame] != NO_VEHICLE {
                found.take(margin, frame);
            }
        });
    }
}
