//! The duty to return once somebody is behind, and braking forced on who is.

use fearless_simd::Simd;
use fearless_simd::prelude::*;
use rayon::prelude::*;

use super::around::Around;
use super::formulas::{Law, drac};
use super::row::Piece;
use super::{ENDLESS, Found, Lowest, NEVER, NO_VEHICLE, SHARE, Spans};
use crate::lanes::{LANES, M, V, at_most, choose, dispatch, max, min, splat};

const METRES: f32 = 1e-3;
const FOLLOWER: usize = 1;
const RIGHT_LEADER: usize = 4;
const RIGHT_FOLLOWER: usize = 5;

/// Arrays (simulation, frame), and numbers.
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
    /// Its neighbours.
    pub around: Around<'a>,
    /// Whom it overtakes, (simulation); 255 for nobody.
    pub target: &'a [u8],
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
        let (speed, decel) = (own(self.speed), self.law.sure_decel(own(self.friction)));
        let mut room = splat(piece.simd, self.reach);
        for place in [RIGHT_LEADER, RIGHT_FOLLOWER] {
            let Some(near) = self.around.neighbour(piece, spans, simulation, place) else {
                continue;
            };
            let needed = if place == RIGHT_LEADER {
                let lawful = self.law.lawful_gap(speed, near.closing, decel);
                max(lawful, self.free_time * near.closing)
            } else {
                let behind = speed + near.closing;
                self.law.lawful_gap(behind, near.closing, decel)
            };
            room = choose(near.there, min(room, near.gap - needed), room);
        }
        let enough = self.is_behind(piece, simulation, speed, decel);
        choose(enough, room, splat(piece.simd, -1.0))
    }

    /// Whether the target is far enough behind.
    #[inline(always)]
    fn is_behind<S: Simd>(
        &self,
        piece: Piece<S>,
        simulation: usize,
        speed: V<S>,
        decel: V<S>,
    ) -> M<S> {
        let own = self.around.vehicles(simulation);
        let slot = match self.target[simulation] {
            NO_VEHICLE => 0,
            slot => usize::from(slot),
        };
        let (s, length) = (
            &self.around.s[own.clone()],
            &self.around.length[own.clone()],
        );
        let lead: V<S> = (piece.integers(s[0]) - piece.integers(s[slot])).to_float();
        let theirs: V<S> = piece.integers(self.around.speed[own][slot]).to_float();
        let (lead, theirs) = (lead * METRES, theirs * METRES);
        let gap = lead.abs() - 0.5 * (length[0] + length[slot]);
        let lawful = self.law.lawful_gap(theirs, theirs - speed, decel);
        let wanted = max(self.time_gap * theirs, lawful);
        lead.simd_gt(0.0) & gap.simd_ge(wanted)
    }
}

/// Arrays (simulation, frame), and numbers.
pub struct Obstruction<'a> {
    /// Lane of the ego.
    pub lane: &'a [u8],
    /// Its neighbours.
    pub around: Around<'a>,
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
    while let Some(change) = next_change(lane, next..span.end) {
        let until = span.end.min(change + given.lasting + 1);
        simd.vectorize(
            #[inline(always)]
            || braking(simd, given, spans, simulation, change..until, &mut found),
        );
        next = change + 1;
    }
    found
}

/// First of some frames in which a lane is another than before; `frames` begin after the first of all.
fn next_change(lane: &[u8], frames: std::ops::Range<usize>) -> Option<usize> {
    // Where the lane stays, and it mostly does, many frames are compared at once.
    let kept = |frames: std::ops::Range<usize>| {
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

#[inline(always)]
fn braking<S: Simd>(
    simd: S,
    given: &Obstruction<'_>,
    spans: &Spans<'_>,
    simulation: usize,
    frames: std::ops::Range<usize>,
    found: &mut Lowest,
) {
    for at in frames.clone().step_by(LANES) {
        let piece = Piece::new(simd, at, frames.end);
        let Some(near) = given.around.neighbour(piece, spans, simulation, FOLLOWER) else {
            continue;
        };
        let margin = given.allowed - at_most(drac(near.gap, near.closing), given.most);
        let margin = choose(near.there, margin, splat(simd, ENDLESS));
        piece.each(margin, |margin, frame| found.take(margin, frame));
    }
}
