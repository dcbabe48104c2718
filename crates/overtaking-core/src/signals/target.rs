//! The vehicle that is overtaken, frame by frame; see `overtaking.signals.target`.

use fearless_simd::Simd;
use fearless_simd::prelude::*;
use rayon::prelude::*;

use super::chunk::{Frames, METRES};
use super::{Bodies, Recording, lateral_speed, signal_outputs};
use crate::engine::supported;
use crate::lanes::{LANES, V, dispatch};

const NO_VEHICLE: u8 = 255;

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
    out.into_simulations(frames)
        .into_par_iter()
        .enumerate()
        .for_each(|(simulation, mut out)| {
            dispatch!(level, |simd| one(
                simd, recording, bodies, targets, simulation, frames, &mut out
            ));
        });
    Ok(())
}

/// The target of one simulation.
fn one<S: Simd>(
    simd: S,
    recording: &Recording<'_>,
    bodies: &Bodies<'_>,
    targets: &Targets<'_>,
    simulation: usize,
    frames: usize,
    out: &mut Target<'_>,
) {
    let recorded = recording.recorded(simulation, frames);
    let rest = recorded.next_multiple_of(LANES).min(frames);
    out.clear_from(rest, frames);
    let vehicle = targets.vehicle[simulation];
    let slot = simulation * recording.slots
        + if vehicle == NO_VEHICLE {
            0
        } else {
            usize::from(vehicle)
        };
    lateral_speed(
        recording.d[slot],
        recorded,
        bodies,
        &mut out.lateral_speed[..rest],
    );
    for at in (0..rest).step_by(LANES) {
        simd.vectorize(
            #[inline(always)]
            || {
                let frames = Frames {
                    simd,
                    recording,
                    bodies,
                    simulation,
                    at,
                    frames,
                };
                frames.along(slot, out);
                frames.across(slot, targets, out);
            },
        );
    }
    let exists = vehicle != NO_VEHICLE;
    for frame in 0..rest {
        let present = recording
            .present
            .as_ref()
            .is_none_or(|rows| rows[slot][frame]);
        out.valid[frame] = exists && present && frame < recorded;
        out.overlaps[frame] = out.valid[frame] && out.gap[frame] < 0.0;
    }
}

impl<S: Simd> Frames<'_, S> {
    /// Place and motion of a target along the road.
    #[inline(always)]
    fn along(&self, slot: usize, out: &mut Target<'_>) {
        let (r, ego) = (self.recording, self.slot(0));
        let lead: V<S> = (self.load(r.s[ego]) - self.load(r.s[slot])).to_float();
        let lead = lead * METRES;
        let half = 0.5 * (self.bodies.length[ego] + self.bodies.length[slot]);
        let speed: V<S> = self.load(r.speed[slot]).to_float();
        let accel: V<S> = self.load(r.accel[slot]).to_float();
        self.store(out.lead, lead);
        self.store(out.gap, lead.abs() - half);
        self.store(out.speed, speed * METRES);
        self.store(out.accel, accel * METRES);
    }

    /// Its place across the road.
    #[inline(always)]
    fn across(&self, slot: usize, targets: &Targets<'_>, out: &mut Target<'_>) {
        let row = |values: &[f32]| self.own(values);
        let (across, reach) = self.footprint(slot);
        let own_reach = (row(targets.left_reach) - row(targets.right_reach)) * 0.5;
        let aside = (across - row(targets.lateral)).abs() - (own_reach + reach);
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
