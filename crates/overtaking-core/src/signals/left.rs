//! Who is in the lane to the left of the ego.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use super::chunk::{Frames, in_chunks};
use super::{Bodies, Recording, signal_outputs};
use crate::engine::supported;
use crate::lanes::{V, dispatch};

const OCCUPANCY_REACH_MM: i32 = 100_000;

signal_outputs! {
    /// Where it goes: a row of frames for each simulation.
    LeftLane:
    /// Occupancy of the lane to the left.
    left_occupancy: f32, 1;
    /// Vehicles in it.
    left_count: u8, 1;
}

/// Work out the occupancy of the lane to the left in a batch, on a road with some driving lanes.
///
/// # Errors
/// The SIMD level is unknown or not supported by this CPU.
pub fn left_lane(
    recording: &Recording<'_>,
    bodies: &Bodies<'_>,
    num_lanes: usize,
    frames: usize,
    forced: Option<&str>,
    out: LeftLane<'_>,
) -> Result<(), String> {
    let level = supported(forced)?;
    out.fill(recording, frames, |simulation, rest, out| {
        dispatch!(level, |simd| in_chunks!(
            Frames::new(simd, recording, bodies, simulation, frames),
            0..rest,
            |chunk| chunk.left_lane(num_lanes as i32, out)
        ));
    });
    Ok(())
}

impl<S: Simd> Frames<'_, S> {
    /// Occupancy of the lane to the left, summed in half-millimetres.
    #[inline(always)]
    fn left_lane(&self, num_lanes: i32, out: &mut LeftLane<'_>) {
        let (r, ego) = (self.recording, self.slot(0));
        let (own_s, own_lane) = (self.load(r.s[ego]), self.load(r.lane[ego]));
        let limit = self.int(2 * OCCUPANCY_REACH_MM);
        let (mut total, mut count) = (self.int(0), self.int(0));
        for j in 1..r.slots {
            let slot = self.slot(j);
            if !self.bodies.valid[slot] {
                continue;
            }
            let lane = self.load(r.lane[slot]);
            let there = self.present(slot) & lane.simd_eq(own_lane + 1) & lane.simd_lt(num_lanes);
            let length = self.bodies.length[slot] * 1000.0;
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
