//! The vehicle that is overtaken, frame by frame.

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};

use super::chunk::{Frames, in_chunks};
use super::{METRES, NO_VEHICLE, Recording, Seen, lateral_speed, signal_outputs};
use crate::lanes::{LANES, V, dispatch};

signal_outputs! {
    /// Where the signals of targets go: a row of frames for each simulation.
    Target:
    /// Whether there is a target in that frame.
    valid: bool, 1;
    /// Centre of the ego minus that of the target along the road [m].
    ego_lead: f32, 1;
    /// Whether they overlap along the road.
    overlaps: bool, 1;
    /// Gap between the bumpers [m].
    gap: f32, 1;
    /// Position across the road, to the left [m].
    lateral_position: f32, 1;
    /// Gap between the sides [m].
    lateral_gap: f32, 1;
    /// Lane.
    lane: u8, 1;
    /// Speed [m/s].
    speed: f32, 1;
    /// Acceleration [m/s^2].
    accel: f32, 1;
    /// Speed to the left [m/s].
    lateral_speed: f32, 1;
}

/// Work out the signals of the targets of a batch, slots by simulation, `NO_VEHICLE` where there is none.
pub fn target(
    recording: &Recording<'_>,
    seen: &Seen<'_>,
    targets: &[u8],
    level: Level,
    out: &mut Target<'_>,
) {
    let mut filled = vec![i32::MAX; targets.len()];
    out.fill(recording, &mut filled, |simulation, rest, out| {
        let (seen, vehicle) = (seen.of(simulation, recording.frames), targets[simulation]);
        // The ego's own row where there is no target.
        let own = if vehicle == NO_VEHICLE { 0 } else { vehicle };
        let slot = simulation * recording.slots + usize::from(own);
        let speed = &mut out.lateral_speed[..rest];
        if recording.present.is_some() {
            lateral_speed_between_gaps(recording, slot, speed);
        } else {
            lateral_speed(recording, slot, speed);
        }
        dispatch!(level, |simd| in_chunks!(
            Frames::new(simd, recording, simulation),
            rest,
            |chunk| {
                chunk.along(slot, out);
                chunk.across(slot, &seen, out);
            }
        ));
        let recorded = recording.recorded(simulation);
        for frame in 0..rest {
            let there = vehicle != NO_VEHICLE && recording.is_present(slot, frame);
            out.valid[frame] = there && frame < recorded;
            out.overlaps[frame] = out.valid[frame] && out.gap[frame] < 0.0;
        }
    });
}

/// Speed to the left of a vehicle that is not in all frames: a central difference, one-sided beside a gap.
fn lateral_speed_between_gaps(recording: &Recording<'_>, slot: usize, out: &mut [f32]) {
    let (d, half) = (recording.d[slot], recording.half_window);
    let recorded = recording.recorded(slot / recording.slots);
    let there = |frame: &usize| *frame < recorded && recording.is_present(slot, *frame);
    for (frame, speed) in out.iter_mut().enumerate() {
        let later = frame + (frame + 1..=frame + half).take_while(there).count();
        let before = (frame.saturating_sub(half)..frame).rev();
        let earlier = frame - before.take_while(there).count();
        let moved = d[later].wrapping_sub(d[earlier]) as f32;
        let elapsed = ((later - earlier) as i32 * recording.interval_ms).max(1) as f32;
        *speed = recording.side * (moved / elapsed);
    }
}

impl<S: Simd> Frames<'_, S> {
    /// Place and motion of a target along the road.
    #[inline(always)]
    fn along(&self, slot: usize, out: &mut Target<'_>) {
        let r = self.recording;
        let lead: V<S> = (self.load(r.s[self.slot(0)]) - self.load(r.s[slot])).to_float();
        let lead = lead * METRES;
        let half = 0.5 * (r.length[self.slot(0)] + r.length[slot]);
        let speed: V<S> = self.load(r.speed[slot]).to_float();
        let accel: V<S> = self.load(r.accel[slot]).to_float();
        self.store(out.ego_lead, lead);
        self.store(out.gap, lead.abs() - half);
        self.store(out.speed, speed * METRES);
        self.store(out.accel, accel * METRES);
    }

    /// Its place across the road, and the gap between its side and the ego's.
    #[inline(always)]
    fn across(&self, slot: usize, seen: &Seen<'_>, out: &mut Target<'_>) {
        let (across, aside) = self.aside(slot, seen);
        self.store(out.lateral_position, across);
        self.store(out.lateral_gap, aside);
        self.store_bytes(out.lane, self.load(self.recording.lane[slot]));
    }

    /// The place of a body across the road, and the gap between its side and the ego's.
    #[inline(always)]
    pub(super) fn aside(&self, slot: usize, seen: &Seen<'_>) -> (V<S>, V<S>) {
        let (across, reach) = self.footprint(slot);
        let own_reach = (self.own(seen.left_edge) - self.own(seen.right_edge)) * 0.5;
        let aside = (across - self.own(seen.lateral_position)).abs() - (own_reach + reach);
        (across, aside)
    }

    /// These frames of a row, zero beyond its end.
    #[inline(always)]
    fn own(&self, row: &[f32]) -> V<S> {
        let mut found = [0.0; LANES];
        let end = row.len().min(self.at + LANES);
        found[..end - self.at].copy_from_slice(&row[self.at..end]);
        V::simd_from(self.simd, found)
    }
}
