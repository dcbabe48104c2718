//! Gaps to the vehicles around the ego, once it is known who they are, and the lane to its left.

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};

use super::chunk::{Frames, in_chunks};
use super::{METRES, PLACES, Recording, signal_outputs};
use crate::lanes::{V, choose, dispatch, splat};

const OCCUPANCY_REACH_MM: i32 = 100_000;

signal_outputs! {
    /// Where they go: a row of frames, or `PLACES` of them, for each simulation.
    Around:
    /// Gaps [m].
    gap: f32, PLACES;
    /// Closing speeds [m/s].
    closing_speed: f32, PLACES;
    /// Lateral gaps [m].
    lateral_gap: f32, PLACES;
    /// Occupancy of the lane to the left.
    left_occupancy: f32, 1;
    /// Vehicles in it.
    left_count: u8, 1;
}

/// Work out the gaps of a batch to its neighbours, slots by (simulation, place, frame), and its lanes to the left.
pub fn around(recording: &Recording<'_>, vehicle: &[u8], level: Level, out: &mut Around<'_>) {
    let row = PLACES * recording.frames;
    let mut filled = vec![i32::MAX; recording.num_frames.len()];
    out.fill(recording, &mut filled, |simulation, rest, out| {
        let vehicle = &vehicle[simulation * row..(simulation + 1) * row];
        dispatch!(level, |simd| in_chunks!(
            Frames::new(simd, recording, simulation),
            rest,
            |chunk| {
                chunk.gaps(vehicle, out);
                chunk.left_lane(out);
            }
        ));
    });
}

impl<S: Simd> Frames<'_, S> {
    /// The gaps to all places, zero where nobody is.
    #[inline(always)]
    fn gaps(&self, vehicle: &[u8], out: &mut Around<'_>) {
        let (r, ego, zero) = (self.recording, self.slot(0), splat(self.simd, 0.0));
        let (own_s, own_speed) = (self.load(r.s[ego]), self.load(r.speed[ego]));
        let (across, reach) = self.footprint(ego);
        let mut found = [[zero; 3]; PLACES];
        for j in 1..r.slots {
            let slot = self.slot(j);
            let ahead = self.load(r.s[slot]) - own_s;
            let distance: V<S> = ahead.simd_ge(0).select(ahead, -ahead).to_float();
            let halves = r.length[ego] * 0.5 + r.length[slot] * 0.5;
            let slower = own_speed - self.load(r.speed[slot]);
            let (their_across, their_reach) = self.footprint(slot);
            let aside = (across - their_across).abs() - (reach + their_reach);
            for (place, known) in found.iter_mut().enumerate() {
                let row = &vehicle[place * r.frames..][..r.frames];
                let here = self.load(row).simd_eq(j as i32);
                let closing = if place.is_multiple_of(2) {
                    slower
                } else {
                    -slower
                };
                let closing: V<S> = closing.to_float();
                let values = [distance * METRES - halves, closing * METRES, aside];
                for (known, value) in known.iter_mut().zip(values) {
                    *known = choose(here, value, *known);
                }
            }
        }
        for (place, [gap, closing, aside]) in found.into_iter().enumerate() {
            let row = place * r.frames..(place + 1) * r.frames;
            self.store(&mut out.gap[row.clone()], gap);
            self.store(&mut out.closing_speed[row.clone()], closing);
            self.store(&mut out.lateral_gap[row], aside);
        }
    }

    /// Occupancy of the lane to the left, summed in half-millimetres.
    #[inline(always)]
    fn left_lane(&self, out: &mut Around<'_>) {
        let (r, ego) = (self.recording, self.slot(0));
        let (own_s, own_lane) = (self.load(r.s[ego]), self.load(r.lane[ego]));
        let limit = self.int(2 * OCCUPANCY_REACH_MM);
        let (mut total, mut count) = (self.int(0), self.int(0));
        for j in 1..r.slots {
            let slot = self.slot(j);
            if !r.valid[slot] {
                continue;
            }
            let lane = self.load(r.lane[slot]);
            let there =
                self.present(slot) & lane.simd_eq(own_lane + 1) & lane.simd_lt(r.num_lanes as i32);
            let length = r.length[slot] * 1000.0;
            let length = self.int(length.round_ties_even() as i32);
            let ahead = (self.load(r.s[slot]) - own_s).max(-limit).min(limit) * 2;
            let front = (ahead + length).min(limit);
            let rear = (ahead - length).max(-limit);
            let inside = (front - rear).max(self.int(0));
            total = there.select(total + inside, total);
            count = there.select(count + 1, count);
        }
        let total: V<S> = total.to_float();
        let share = total * (1.0 / (4 * OCCUPANCY_REACH_MM) as f32);
        self.store(out.left_occupancy, share);
        self.store_bytes(out.left_count, count);
    }
}
