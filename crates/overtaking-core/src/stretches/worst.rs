//! The worst of each measure of safety over a stretch.

use std::ops::Range;

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use super::formulas::{drac, time_gap, ttc_accel};
use super::one::{FOLLOWER, LEADER, One, Slots};
use super::row::{Piece, greatest, least};
use crate::lanes::{LANES, M, V, choose, max, min, put, splat};
use crate::signals::METRES;

/// Measures of a simulation, in the order of the rows of the result.
pub(super) const WORST: [&str; 21] = [
    "leader.valid",
    "leader.gap",
    "leader.time_gap",
    "leader.ttc",
    "leader.mttc",
    "leader.closing_speed",
    "leader.drac",
    "follower.valid",
    "follower.gap",
    "follower.time_gap",
    "follower.ttc",
    "follower.mttc",
    "follower.closing_speed",
    "follower.drac",
    "time_headway",
    "picud",
    "rss_margin",
    "lawful_margin",
    "num_close",
    "num_critical",
    "shortfall",
];

impl One<'_> {
    /// The worst of each measure, 0 where nobody was there.
    pub(super) fn worst<S: Simd>(&self, simd: S, span: Range<usize>) -> [f32; WORST.len()] {
        let mut rear = Extremes::new(simd);
        let mut front = Extremes::new(simd);
        let mut margins = Margins::new(simd);
        simd.vectorize(
            #[inline(always)]
            || {
                for at in span.clone().step_by(LANES) {
                    let piece = Piece::new(simd, at, span.end);
                    if let Some(ahead) = self.encounter(piece, LEADER) {
                        let time = front.take(&ahead);
                        margins.take(self, piece, &ahead, time);
                    }
                    if let Some(behind) = self.encounter(piece, FOLLOWER) {
                        rear.take(&behind);
                    }
                }
            },
        );
        let mut found = [0.0; WORST.len()];
        found[..7].copy_from_slice(&front.result());
        found[7..14].copy_from_slice(&rear.result());
        found[14..18].copy_from_slice(&margins.lowest.map(|values| front.known(least(values))));
        found[18..].copy_from_slice(&[
            margins.num_close as f32,
            margins.num_critical as f32,
            margins.shortfall as f32,
        ]);
        found
    }

    /// A neighbour, if it is there in any of some frames.
    #[inline(always)]
    fn encounter<S: Simd>(&self, piece: Piece<S>, place: usize) -> Option<Encounter<S>> {
        let near = self.neighbour(piece, place)?;
        let own_speed = piece.load(self.seen.speed);
        let own_accel: V<S> = piece.integers(self.accel[0]).to_float();
        let accel: V<S> = near.slots.recorded(piece, self.accel).to_float();
        let (own_accel, accel) = (own_accel * METRES, accel * METRES);
        let (speed, closing_accel) = if place == LEADER {
            (own_speed, own_accel - accel)
        } else {
            (own_speed + near.closing, accel - own_accel)
        };
        Some(Encounter {
            there: near.there,
            slots: near.slots,
            gap: near.gap,
            closing: near.closing,
            speed,
            closing_accel,
        })
    }
}

/// The ego and a neighbour, as one vehicle behind another.
struct Encounter<S: Simd> {
    there: M<S>,
    slots: Slots,
    gap: V<S>,
    closing: V<S>,
    /// Of whoever is behind.
    speed: V<S>,
    closing_accel: V<S>,
}

/// The worst of an encounter so far.
struct Extremes<S: Simd> {
    /// Gap, time gap, and times to collision.
    lowest: [V<S>; 4],
    /// Closing speed and braking.
    highest: [V<S>; 2],
    exists: bool,
}

impl<S: Simd> Extremes<S> {
    fn new(simd: S) -> Self {
        Self {
            lowest: [splat(simd, f32::INFINITY); 4],
            highest: [splat(simd, f32::NEG_INFINITY); 2],
            exists: false,
        }
    }

    /// Take some frames; gives the times to collision in them.
    #[inline(always)]
    fn take(&mut self, one: &Encounter<S>) -> V<S> {
        let (gap, closing) = (one.gap, one.closing);
        let ttc = time_gap(gap, closing);
        let mttc = ttc_accel(gap, closing, one.closing_accel);
        let low = [gap, time_gap(gap, one.speed), ttc, mttc];
        for (lowest, value) in self.lowest.iter_mut().zip(low) {
            let lower = min(value, *lowest);
            put(lowest, one.there, lower);
        }
        for (highest, value) in self.highest.iter_mut().zip([closing, drac(gap, closing)]) {
            let higher = max(value, *highest);
            put(highest, one.there, higher);
        }
        self.exists = true;
        ttc
    }

    /// A number, 0 where nobody was there.
    fn known(&self, value: f32) -> f32 {
        if self.exists { value } else { 0.0 }
    }

    fn result(&self) -> [f32; 7] {
        let [gap, time_gap, ttc, mttc] = self.lowest.map(|values| self.known(least(values)));
        let [closing, drac] = self.highest.map(|values| self.known(greatest(values)));
        [
            f32::from(u8::from(self.exists)),
            gap,
            time_gap,
            ttc,
            mttc,
            closing,
            drac,
        ]
    }
}

/// What else there is to say of the vehicle ahead.
struct Margins<S: Simd> {
    /// Headway, PICUD, margins of RSS and of the law.
    lowest: [V<S>; 4],
    num_close: usize,
    num_critical: usize,
    shortfall: f64,
}

impl<S: Simd> Margins<S> {
    fn new(simd: S) -> Self {
        Self {
            lowest: [splat(simd, f32::INFINITY); 4],
            num_close: 0,
            num_critical: 0,
            shortfall: 0.0,
        }
    }

    #[inline(always)]
    fn take(&mut self, run: &One<'_>, piece: Piece<S>, one: &Encounter<S>, ttc: V<S>) {
        let (numbers, lead_speed) = (run.numbers, one.speed - one.closing);
        let decel = numbers.sure_decel(piece.load(run.seen.friction));
        let lawful = one.gap - numbers.lawful_gap(one.speed, one.closing, decel);
        let length = one.slots.of(piece.simd, run.length);
        let values = [
            time_gap(one.gap + length, one.speed),
            numbers.picud(one.gap, one.speed, lead_speed),
            one.gap - numbers.rss(one.speed, lead_speed),
            lawful,
        ];
        for (lowest, value) in self.lowest.iter_mut().zip(values) {
            let lower = min(value, *lowest);
            put(lowest, one.there, lower);
        }
        let nothing = splat(piece.simd, 0.0);
        if (one.there & lawful.simd_lt(0.0)).any_true() {
            let counted = choose(one.there, lawful, nothing);
            piece.each(counted, |margin, _| {
                self.num_close += usize::from(margin < 0.0)
            });
        }
        let critical = one.there & numbers.is_critical(ttc);
        if critical.any_true() {
            let lacking = numbers.critical_ttc - ttc;
            piece.each(choose(critical, lacking, nothing), |each, _| {
                self.shortfall += f64::from(each)
            });
            let ones = choose(critical, splat(piece.simd, 1.0), nothing);
            piece.each(ones, |each, _| self.num_critical += usize::from(each > 0.0));
        }
    }
}
