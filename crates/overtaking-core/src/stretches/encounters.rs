//! The ego and one of its neighbours at single frames, as one vehicle behind another.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use super::around::{Around, METRES};
use super::formulas::{drac, time_gap, ttc_accel};
use super::{NO_VEHICLE, PLACES};
use crate::engine::supported;
use crate::lanes::{LANES, V, dispatch};
use crate::signals::{Along, neighbour_at};

/// Whom to look at, and when.
pub struct Encounters<'a> {
    /// The neighbours of the ego.
    pub around: Around<'a>,
    /// Acceleration of every slot [mm/s^2].
    pub accels: Vec<&'a [i16]>,
    /// Frames that a simulation has room for.
    pub frames: usize,
    /// Simulation, place and frame of each instant.
    pub instants: Vec<[usize; 3]>,
    /// Whether the neighbours are ahead of the ego.
    pub is_ahead: bool,
}

/// What there is to say of an instant, in the order of the rows of the result.
pub const ENCOUNTERS: [&str; 6] = ["gap", "closing_speed", "time_gap", "ttc", "mttc", "drac"];

/// Sixteen instants side by side.
#[derive(Default)]
struct Few {
    gap: [f32; LANES],
    closing: [f32; LANES],
    speed: [f32; LANES],
    closing_accel: [f32; LANES],
}

/// Measure each instant: a row of `out` for each of `ENCOUNTERS`, and who it is.
///
/// # Errors
/// The SIMD level is unknown or not supported by this CPU.
pub fn encounters(
    given: &Encounters<'_>,
    forced: Option<&str>,
    vehicle: &mut [u8],
    out: &mut [f32],
) -> Result<(), String> {
    let (level, count) = (supported(forced)?, given.instants.len());
    let chunks = given.instants.chunks(LANES).zip(vehicle.chunks_mut(LANES));
    for (chunk, (instants, vehicles)) in chunks.enumerate() {
        let mut few = Few::default();
        for (lane, (instant, vehicle)) in instants.iter().zip(vehicles).enumerate() {
            *vehicle = given.look(*instant, lane, &mut few);
        }
        let found = dispatch!(level, |simd| measured(simd, &few));
        for (values, row) in found.iter().zip(out.chunks_mut(count)) {
            let row = &mut row[chunk * LANES..][..instants.len()];
            row.copy_from_slice(&values[..row.len()]);
        }
    }
    Ok(())
}

fn measured<S: Simd>(simd: S, few: &Few) -> [[f32; LANES]; ENCOUNTERS.len()] {
    simd.vectorize(
        #[inline(always)]
        || {
            let load = |values: &[f32; LANES]| V::simd_from(simd, *values);
            let (gap, closing) = (load(&few.gap), load(&few.closing));
            [
                gap,
                closing,
                time_gap(gap, load(&few.speed)),
                time_gap(gap, closing),
                ttc_accel(gap, closing, load(&few.closing_accel)),
                drac(gap, closing),
            ]
            .map(|values| values.to_array())
        },
    )
}

impl Encounters<'_> {
    /// Take down what was recorded at an instant; gives the slot of the neighbour.
    fn look(&self, [simulation, place, frame]: [usize; 3], lane: usize, few: &mut Few) -> u8 {
        let around = &self.around;
        let vehicle = around.vehicle[(simulation * PLACES + place) * self.frames + frame];
        let exists = vehicle != NO_VEHICLE;
        let own = simulation * around.slots;
        let other = own + if exists { usize::from(vehicle) } else { 0 };
        let along = |slot: usize| Along {
            s: around.s[slot][frame],
            speed: around.speed[slot][frame],
            half_length: around.length[slot] * 0.5,
        };
        let accel = |slot: usize| f32::from(self.accels[slot][frame]) * METRES;
        let (gap, closing) = if exists {
            neighbour_at(along(own), along(other), place.is_multiple_of(2))
        } else {
            (0.0, 0.0)
        };
        let speed = around.speed[own][frame] as f32 * METRES;
        (few.gap[lane], few.closing[lane]) = (gap, closing);
        (few.speed[lane], few.closing_accel[lane]) = if self.is_ahead {
            (speed, accel(own) - accel(other))
        } else {
            (speed + closing, accel(other) - accel(own))
        };
        vehicle
    }
}
