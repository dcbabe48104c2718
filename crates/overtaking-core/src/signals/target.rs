//! The vehicle that is overtaken, frame by frame; see `overtaking.labels.signals.target`.

use std::ops::Range;

use fearless_simd::Simd;
use fearless_simd::prelude::*;
use rayon::prelude::*;

use super::chunk::{Frames, METRES, NO_VEHICLE, in_chunks};
use super::{Bodies, Recording, lateral_speed, signal_outputs};
use crate::engine::supported;
use crate::lanes::{LANES, V, dispatch};

/// Which vehicle is overtaken, and where the ego is across the road.
pub struct Targets<'a> {
    /// Slot of the target of each simulation, `NO_VEHICLE` where there is none.
    pub vehicle: &'a [u8],
    /// Position of the ego across the road, (simulation, frame) [m].
    pub lateral: &'a [f32],
    /// Its right-most corner [m].
    pub right_reach: &'a [f32],
    /// Its left-most corner [m].
    pub left_reach: &'a [f32],
}

impl Targets<'_> {
    /// Row of the target of a simulation in a recording; that of the ego where there is none.
    fn slot(&self, recording: &Recording<'_>, simulation: usize) -> usize {
        let vehicle = self.vehicle[simulation];
        let own = if vehicle == NO_VEHICLE { 0 } else { vehicle };
        simulation * recording.slots + usize::from(own)
    }
}

signal_outputs! {
    /// Where the signals of targets go: a row of frames for each simulation.
    Target:
    /// Whether there is a target in that frame.
    valid: bool, 1;
    /// Centre of the ego minus that of the target along the road [m].
    lead: f32, 1;
    /// Whether they overlap along the road.
    overlaps: bool, 1;
    /// Gap between the bumpers [m].
    gap: f32, 1;
    /// Position across the road, to the left [m].
    lateral: f32, 1;
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

/// Work out the signals of the targets of a batch.
///
/// # Errors
/// The SIMD level is unknown or not supported by this CPU.
pub fn target(
    recording: &Recording<'_>,
    bodies: &Bodies<'_>,
    targets: &Targets<'_>,
    frames: usize,
    forced: Option<&str>,
    out: Target<'_>,
) -> Result<(), String> {
    let level = supported(forced)?;
    out.fill(recording, frames, |simulation, rest, out| {
        let vehicle = targets.vehicle[simulation];
        let slot = targets.slot(recording, simulation);
        let recorded = recording.recorded(simulation, frames);
        let speed = &mut out.lateral_speed[..rest];
        if recording.present.is_some() {
            lateral_speed_between_gaps(recording, slot, recorded, bodies, speed);
        } else {
            lateral_speed(recording.d[slot], recorded, bodies, speed);
        }
        dispatch!(level, |simd| in_chunks!(
            Frames::new(simd, recording, bodies, simulation, frames),
            0..rest,
            |chunk| {
                chunk.along(slot, out);
                chunk.across(slot, targets, out);
            }
        ));
        for frame in 0..rest {
            let there = vehicle != NO_VEHICLE && recording.is_present(slot, frame);
            out.valid[frame] = there && frame < recorded;
            out.overlaps[frame] = out.valid[frame] && out.gap[frame] < 0.0;
        }
    });
    Ok(())
}

/// Speed to the left of a vehicle that is not in all frames: a central difference, one-sided beside a gap.
fn lateral_speed_between_gaps(
    recording: &Recording<'_>,
    slot: usize,
    recorded: usize,
    bodies: &Bodies<'_>,
    out: &mut [f32],
) {
    let (d, half) = (recording.d[slot], bodies.half_window);
    let there = |frame: &usize| *frame < recorded && recording.is_present(slot, *frame);
    for (frame, speed) in out.iter_mut().enumerate() {
        let later = frame + (frame + 1..=frame + half).take_while(there).count();
        let before = (frame.saturating_sub(half)..frame).rev();
        let earlier = frame - before.take_while(there).count();
        let moved = d[later].wrapping_sub(d[earlier]) as f32;
        let elapsed = ((later - earlier) as i32 * bodies.interval_ms).max(1) as f32;
        *speed = bodies.side * (moved / elapsed);
    }
}

/// Where what is asked of targets in some frames goes: a number for each of these frames, one simulation after
/// the other.
pub struct Instants<'a> {
    /// Whether ego and target overlap along the road.
    pub overlaps: &'a mut [bool],
    /// Lane of the target.
    pub lane: &'a mut [u8],
    /// Gap between the sides [m].
    pub lateral_gap: &'a mut [f32],
    /// Acceleration of the target [m/s^2].
    pub accel: &'a mut [f32],
}

impl Instants<'_> {
    /// The first of these frames, and the others.
    fn split_at(self, count: usize) -> (Self, Self) {
        let (overlaps, more_overlaps) = self.overlaps.split_at_mut(count);
        let (lane, more_lanes) = self.lane.split_at_mut(count);
        let (lateral_gap, more_gaps) = self.lateral_gap.split_at_mut(count);
        let (accel, more_accels) = self.accel.split_at_mut(count);
        let first = Instants {
            overlaps,
            lane,
            lateral_gap,
            accel,
        };
        let others = Instants {
            overlaps: more_overlaps,
            lane: more_lanes,
            lateral_gap: more_gaps,
            accel: more_accels,
        };
        (first, others)
    }
}

/// Work out what `target` says of some frames of each simulation, for those in which it is asked.
///
/// `spans` are the frames of each simulation, which must be recorded; `out` has room for all of them.
///
/// # Errors
/// The SIMD level is unknown or not supported by this CPU.
pub fn alongside(
    recording: &Recording<'_>,
    bodies: &Bodies<'_>,
    targets: &Targets<'_>,
    spans: &[Range<usize>],
    frames: usize,
    forced: Option<&str>,
    out: Instants<'_>,
) -> Result<(), String> {
    let level = supported(forced)?;
    let (mut parts, mut rest) = (Vec::new(), out);
    for (simulation, span) in spans
        .iter()
        .enumerate()
        .filter(|(_, span)| !span.is_empty())
    {
        let (part, others) = rest.split_at(span.len());
        parts.push((simulation, span.clone(), part));
        rest = others;
    }
    parts
        .into_par_iter()
        .for_each(|(simulation, span, mut out)| {
            dispatch!(level, |simd| in_chunks!(
                Frames::new(simd, recording, bodies, simulation, frames),
                span.clone(),
                |chunk| chunk.beside(targets, &span, &mut out)
            ));
        });
    Ok(())
}

impl<S: Simd> Frames<'_, S> {
    /// The target in those of these frames that are in a span.
    #[inline(always)]
    fn beside(&self, targets: &Targets<'_>, span: &Range<usize>, out: &mut Instants<'_>) {
        let r = self.recording;
        let exists = targets.vehicle[self.simulation] != NO_VEHICLE;
        let slot = targets.slot(r, self.simulation);
        let (_, gap) = self.lead(slot);
        let (_, aside) = self.aside(slot, targets);
        let accel: V<S> = self.load(r.accel[slot]).to_float();
        let gaps: [f32; LANES] = gap.to_array();
        let asides: [f32; LANES] = aside.to_array();
        let accels: [f32; LANES] = (accel * METRES).to_array();
        for frame in self.at..span.end.min(self.at + LANES) {
            let (from, to) = (frame - self.at, frame - span.start);
            let there = exists && r.is_present(slot, frame);
            out.overlaps[to] = there && gaps[from] < 0.0;
            out.lane[to] = r.lane[slot][frame];
            out.lateral_gap[to] = asides[from];
            out.accel[to] = accels[from];
        }
    }

    /// Centre of the ego minus that of a vehicle along the road, and the gap between their bumpers.
    #[inline(always)]
    fn lead(&self, slot: usize) -> (V<S>, V<S>) {
        let (r, ego) = (self.recording, self.slot(0));
        let lead: V<S> = (self.load(r.s[ego]) - self.load(r.s[slot])).to_float();
        let lead = lead * METRES;
        let half = 0.5 * (self.bodies.length[ego] + self.bodies.length[slot]);
        (lead, lead.abs() - half)
    }

    /// Position of a vehicle across the road, and the gap between its side and the ego's.
    #[inline(always)]
    fn aside(&self, slot: usize, targets: &Targets<'_>) -> (V<S>, V<S>) {
        let row = |values: &[f32]| self.own(values);
        let (across, reach) = self.footprint(slot);
        let own_reach = (row(targets.left_reach) - row(targets.right_reach)) * 0.5;
        let aside = (across - row(targets.lateral)).abs() - (own_reach + reach);
        (across, aside)
    }

    /// Place and motion of a target along the road.
    #[inline(always)]
    fn along(&self, slot: usize, out: &mut Target<'_>) {
        let r = self.recording;
        let (lead, gap) = self.lead(slot);
        let speed: V<S> = self.load(r.speed[slot]).to_float();
        let accel: V<S> = self.load(r.accel[slot]).to_float();
        self.store(out.lead, lead);
        self.store(out.gap, gap);
        self.store(out.speed, speed * METRES);
        self.store(out.accel, accel * METRES);
    }

    /// Its place across the road.
    #[inline(always)]
    fn across(&self, slot: usize, targets: &Targets<'_>, out: &mut Target<'_>) {
        let (across, aside) = self.aside(slot, targets);
        self.store(out.lateral, across);
        self.store(out.lateral_gap, aside);
        self.store_bytes(out.lane, self.load(self.recording.lane[slot]));
    }

    /// These frames of an array (simulation, frame), zero beyond its end.
    #[inline(always)]
    fn own(&self, values: &[f32]) -> V<S> {
        let row = &values[self.simulation * self.frames..][..self.frames];
        let mut found = [0.0; LANES];
        let end = self.frames.min(self.at + LANES);
        found[..end - self.at].copy_from_slice(&row[self.at..end]);
        V::simd_from(self.simd, found)
    }
}
