//! The vehicles around the ego, as they were recorded.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};

use super::row::Piece;
use super::{NO_VEHICLE, Spans};
use crate::lanes::{LANES, M, V};

pub(super) const METRES: f32 = 1e-3;

/// Who is around, and the recorded states that say how far and how fast.
pub struct Around<'a> {
    /// Neighbours, (simulation, place, frame).
    pub vehicle: &'a [u8],
    /// Position of each slot along the road [mm].
    pub s: Vec<&'a [i32]>,
    /// Its speed [mm/s].
    pub speed: Vec<&'a [i32]>,
    /// Its length, (simulation, slot) [m].
    pub length: &'a [f32],
    /// Slots of a simulation.
    pub slots: usize,
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

impl Around<'_> {
    /// Where the vehicles of one simulation lie among all.
    pub(super) fn vehicles(&self, simulation: usize) -> std::ops::Range<usize> {
        simulation * self.slots..(simulation + 1) * self.slots
    }

    /// A neighbour, if it is there in any of some frames.
    #[inline(always)]
    pub(super) fn neighbour<S: Simd>(
        &self,
        piece: Piece<S>,
        spans: &Spans<'_>,
        simulation: usize,
        place: usize,
    ) -> Option<Near<S>> {
        let found = piece.array(&self.vehicle[spans.place(simulation, place)]);
        if found == [NO_VEHICLE; LANES] {
            return None;
        }
        let there = found.map(|slot| f32::from(u8::from(slot != NO_VEHICLE)));
        let (slots, own) = (Slots::new(found), self.vehicles(simulation));
        let (s, speed) = (&self.s[own.clone()], &self.speed[own.clone()]);
        let ahead = slots.recorded(piece, s) - piece.integers(s[0]);
        let slower = piece.integers(speed[0]) - slots.recorded(piece, speed);
        // Leaders have even places; a follower closes up where it is faster.
        let closing = if place.is_multiple_of(2) {
            slower
        } else {
            -slower
        };
        let distance: V<S> = ahead.simd_ge(0).select(ahead, -ahead).to_float();
        let length = &self.length[own];
        let halves = length[0] * 0.5 + slots.of(piece.simd, length) * 0.5;
        let closing: V<S> = closing.to_float();
        Some(Near {
            there: V::simd_from(piece.simd, there).simd_gt(0.5),
            slots,
            gap: distance * METRES - halves,
            closing: closing * METRES,
        })
    }
}
