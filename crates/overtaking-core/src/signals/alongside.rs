//! The frames in which the ego and the vehicle that it overtakes overlap along the road.

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};
use rayon::prelude::*;

use super::chunk::Frames;
use super::{METRES, NO_VEHICLE, Recording, Seen};
use crate::lanes::{LANES, V, dispatch};

/// Simulations that a thread takes at a time; each is a matter of less than a microsecond.
const SHARE: usize = 64;

/// Such frames, in the order of simulations and time, and what there is to say of the other vehicle.
#[derive(Default)]
pub struct Alongside {
    /// Number of the simulation.
    pub simulation: Vec<i64>,
    /// Frame.
    pub frame: Vec<i64>,
    /// Lane.
    pub lane: Vec<u8>,
    /// Gap between the sides [m].
    pub lateral_gap: Vec<f32>,
    /// Acceleration [m/s^2].
    pub accel: Vec<f32>,
}

/// Find them in a batch: slots of the targets by simulation, `NO_VEHICLE` for none, and the first and the last frame of
/// each stretch in which to look, both within it, (end, simulation).
#[must_use]
pub fn alongside(
    recording: &Recording<'_>,
    seen: &Seen<'_>,
    targets: &[u8],
    span: &[i32],
    level: Level,
) -> Alongside {
    let count = targets.len();
    (0..count)
        .into_par_iter()
        .with_min_len(SHARE)
        .fold(Alongside::default, |mut found, simulation| {
            let target = targets[simulation];
            if target != NO_VEHICLE {
                let slot = simulation * recording.slots + usize::from(target);
                let seen = seen.of(simulation, recording.frames);
                let (start, stop) = (span[simulation].max(0), span[count + simulation].max(-1));
                let end = (stop as usize + 1).min(recording.recorded(simulation));
                for at in (start as usize..end).step_by(LANES) {
                    dispatch!(level, |simd| {
                        let whole = Frames::new(simd, recording, simulation);
                        found.take(Frames { at, ..whole }, slot, &seen, end);
                    });
                }
            }
            found
        })
        .reduce(Alongside::default, Alongside::followed_by)
}

impl Alongside {
    /// Take down which of some frames count.
    fn take<S: Simd>(&mut self, frames: Frames<'_, S>, slot: usize, seen: &Seen<'_>, end: usize) {
        let (r, at) = (frames.recording, frames.at);
        let [gap, aside] = frames.simd.vectorize(
            #[inline(always)]
            || {
                let lead = frames.load(r.s[frames.slot(0)]) - frames.load(r.s[slot]);
                let lead: V<S> = lead.to_float();
                let half = 0.5 * (r.length[frames.slot(0)] + r.length[slot]);
                let gap: [f32; LANES] = ((lead * METRES).abs() - half).to_array();
                let aside: [f32; LANES] = frames.aside(slot, seen).1.to_array();
                [gap, aside]
            },
        );
        for frame in at..end.min(at + LANES) {
            if gap[frame - at] < 0.0 && r.is_present(slot, frame) {
                self.simulation.push(frames.simulation as i64);
                self.frame.push(frame as i64);
                self.lane.push(r.lane[slot][frame]);
                self.lateral_gap.push(aside[frame - at]);
                self.accel.push(f32::from(r.accel[slot][frame]) * METRES);
            }
        }
    }

    fn followed_by(mut self, mut later: Self) -> Self {
        self.simulation.append(&mut later.simulation);
        self.frame.append(&mut later.frame);
        self.lane.append(&mut later.lane);
        self.lateral_gap.append(&mut later.lateral_gap);
        self.accel.append(&mut later.accel);
        self
    }
}
