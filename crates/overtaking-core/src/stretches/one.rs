//! One simulation: its vehicles as they were recorded, and what the ego sees of them.

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};

use super::formulas::Numbers;
use super::row::{Piece, least};
use super::{Lowest, NEVER};
use crate::lanes::{LANES, M, V, at_least, min, splat};
use crate::signals::{METRES, NO_VEHICLE, Recording, Seen};

pub(super) const LEADER: usize = 0;
pub(super) const FOLLOWER: usize = 1;
const LEFT_FOLLOWER: usize = 3;
pub(super) const RIGHT_LEADER: usize = 4;
pub(super) const RIGHT_FOLLOWER: usize = 5;

/// One simulation; states are rows of frames by slot.
#[derive(Clone, Copy)]
pub(super) struct One<'a> {
    pub(super) recorded: usize,
    pub(super) s: &'a [&'a [i32]],
    pub(super) speed: &'a [&'a [i32]],
    pub(super) accel: &'a [&'a [i16]],
    pub(super) lane: &'a [&'a [u8]],
    pub(super) present: Option<&'a [&'a [bool]]>,
    pub(super) valid: &'a [bool],
    pub(super) length: &'a [f32],
    pub(super) num_lanes: usize,
    pub(super) seen: Seen<'a>,
    pub(super) numbers: &'a Numbers,
}

impl<'a> One<'a> {
    /// A simulation of a batch.
    pub(super) fn new(
        recording: &'a Recording<'a>,
        seen: &Seen<'a>,
        numbers: &'a Numbers,
        simulation: usize,
    ) -> Self {
        let slots = recording.vehicles(simulation);
        Self {
            recorded: recording.recorded(simulation),
            s: &recording.s[slots.clone()],
            speed: &recording.speed[slots.clone()],
            accel: &recording.accel[slots.clone()],
            lane: &recording.lane[slots.clone()],
            present: recording.present.as_ref().map(|rows| &rows[slots.clone()]),
            valid: &recording.valid[slots.clone()],
            length: &recording.length[slots],
            num_lanes: recording.num_lanes,
            seen: seen.of(simulation, recording.frames),
            numbers,
        }
    }

    /// Sights, of something lit and of something unlit, minus stopping distance.
    pub(super) fn stops<S: Simd>(&self, simd: S, span: Range<usize>) -> [Lowest; 2] {
        let (seen, numbers) = (&self.seen, self.numbers);
        let sights = [seen.sight_lit, seen.sight_unlit];
        simd.vectorize(
            #[inline(always)]
            || {
                let mut found = [Lowest::NOTHING; 2];
                let mut low = [splat(simd, Lowest::NOTHING.low); 2];
                for at in span.clone().step_by(LANES) {
                    let piece = Piece::new(simd, at, span.end);
                    let (speed, friction) = (piece.load(seen.speed), piece.load(seen.friction));
                    let decel = numbers.usable * at_least(friction, numbers.floor);
                    let way = speed * numbers.stop_reaction_time + speed * speed / (2.0 * decel);
                    for ((sight, low), found) in sights.iter().zip(&mut low).zip(&mut found) {
                        let margin = piece.load(sight) - way;
                        *low = min(margin, *low);
                        if margin.simd_lt(0.0).any_true() {
                            piece.each(margin, |margin, frame| found.take(margin, frame));
                        }
                    }
                }
                for (found, low) in found.iter_mut().zip(low) {
                    found.low = least(low);
                }
                found
            },
        )
    }

    /// When the vehicle behind on the left came where the ego's rear was at a frame.
    pub(super) fn entry_arrival(&self, frame: i32) -> i32 {
        let row = self.seen.neighbour(LEFT_FOLLOWER);
        let begin = usize::try_from(frame).ok();
        begin.map_or(NEVER, |begin| self.arrival(row[begin], frame))
    }

    /// First frame from one on in which the front of a vehicle is where the ego's rear was then, or past it.
    pub(super) fn arrival(&self, vehicle: u8, frame: i32) -> i32 {
        let (Ok(begin), slot) = (usize::try_from(frame), usize::from(vehicle)) else {
            return NEVER;
        };
        if vehicle == NO_VEHICLE {
            return NEVER;
        }
        let (place, halves) = (self.s[0][begin], 0.5 * (self.length[0] + self.length[slot]));
        let is_past = |frame: &usize| {
            let way = self.s[slot][*frame].wrapping_sub(place) as f32 * METRES;
            way + halves >= 0.0 && self.present.is_none_or(|rows| rows[slot][*frame])
        };
        (begin..self.recorded)
            .find(is_past)
            .map_or(NEVER, |frame| frame as i32)
    }

    /// A neighbour, if it is there in any of some frames.
    #[inline(always)]
    pub(super) fn neighbour<S: Simd>(&self, piece: Piece<S>, place: usize) -> Option<Near<S>> {
        let found = piece.array(self.seen.neighbour(place));
        if found == [NO_VEHICLE; LANES] {
            return None;
        }
        let there = found.map(|slot| f32::from(u8::from(slot != NO_VEHICLE)));
        let (slots, s, speed) = (Slots::new(found), self.s, self.speed);
        let ahead = slots.recorded(piece, s) - piece.integers(s[0]);
        let slower = piece.integers(speed[0]) - slots.recorded(piece, speed);
        // Leaders have even places; a follower closes up where it is faster.
        let closing = if place.is_multiple_of(2) {
            slower
        } else {
            -slower
        };
        let distance: V<S> = ahead.simd_ge(0).select(ahead, -ahead).to_float();
        let halves = self.length[0] * 0.5 + slots.of(piece.simd, self.length) * 0.5;
        let closing: V<S> = closing.to_float();
        Some(Near {
            there: V::simd_from(piece.simd, there).simd_gt(0.5),
            slots,
            gap: distance * METRES - halves,
            closing: closing * METRES,
        })
    }
}

/// A neighbour in a few frames of a simulation; means nothing where nobody is there.
pub(super) struct Near<S: Simd> {
    pub(super) there: M<S>,
    /// Its slots, the ego's where nobody is there.
    pub(super) slots: Slots,
    pub(super) gap: V<S>,
    pub(super) closing: V<S>,
}

/// Slots of a simulation, frame by frame.
#[derive(Clone, Copy)]
pub(super) struct Slots {
    each: [u8; LANES],
    /// The only one, if there is but one.
    only: Option<usize>,
}

impl Slots {
    fn new(found: [u8; LANES]) -> Self {
        let each = found.map(|slot| if slot == NO_VEHICLE { 0 } else { slot });
        let only = (each == [each[0]; LANES]).then_some(usize::from(each[0]));
        Self { each, only }
    }

    /// Numbers of the slots, frame by frame.
    #[inline(always)]
    pub(super) fn of<S: Simd>(&self, simd: S, values: &[f32]) -> V<S> {
        match self.only {
            Some(slot) => V::splat(simd, values[slot]),
            None => V::simd_from(simd, self.each.map(|slot| values[usize::from(slot)])),
        }
    }

    /// Recorded numbers of the slots in some frames, out of a row for each slot.
    #[inline(always)]
    pub(super) fn recorded<S: Simd, T: Copy + Into<i32>>(
        &self,
        piece: Piece<S>,
        rows: &[&[T]],
    ) -> i32x16<S> {
        if let Some(slot) = self.only {
            return piece.integers(rows[slot]);
        }
        let mut values = [0; LANES];
        for (step, (value, slot)) in values.iter_mut().zip(self.each).enumerate() {
            let frame = piece.at + step.min(piece.len - 1);
            *value = rows[usize::from(slot)][frame].into();
        }
        i32x16::simd_from(piece.simd, values)
    }
}
