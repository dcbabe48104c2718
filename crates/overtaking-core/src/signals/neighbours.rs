//! Gaps to the vehicles around the ego, once it is known who they are.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use super::chunk::{Frames, METRES, in_chunks};
use super::{Bodies, PLACES, Recording, signal_outputs};
use crate::engine::supported;
use crate::lanes::{V, choose, dispatch, splat};

signal_outputs! {
    /// Where gaps go: `PLACES` rows of frames for each simulation.
    Neighbours:
    /// Gaps [m].
    gap: f32, PLACES;
    /// Closing speeds [m/s].
    closing_speed: f32, PLACES;
    /// Lateral gaps [m].
    lateral_gap: f32, PLACES;
}

/// Work out the gaps of a batch to its neighbours, slots by (simulation, place, frame).
///
/// # Errors
/// The SIMD level is unknown or not supported by this CPU.
pub fn neighbours(
    recording: &Recording<'_>,
    bodies: &Bodies<'_>,
    vehicle: &[u8],
    frames: usize,
    forced: Option<&str>,
    out: Neighbours<'_>,
) -> Result<(), String> {
    let level = supported(forced)?;
    out.fill(recording, frames, |simulation, rest, out| {
        let vehicle = &vehicle[simulation * PLACES * frames..][..PLACES * frames];
        dispatch!(level, |simd| in_chunks!(
            Frames::new(simd, recording, bodies, simulation, frames),
            0..rest,
            |chunk| chunk.gaps(vehicle, out)
        ));
    });
    Ok(())
}

impl<S: Simd> Frames<'_, S> {
    /// The gaps to all places, zero where nobody is.
    #[inline(always)]
    fn gaps(&self, vehicle: &[u8], out: &mut Neighbours<'_>) {
        let (r, ego, zero) = (self.recording, self.slot(0), splat(self.simd, 0.0));
        let (own_s, own_speed) = (self.load(r.s[ego]), self.load(r.speed[ego]));
        let (across, reach) = self.footprint(ego);
        let mut found = [[zero; 3]; PLACES];
        for j in 1..r.slots {
            let slot = self.slot(j);
            let ahead = self.load(r.s[slot]) - own_s;
            let distance: V<S> = ahead.simd_ge(0).select(ahead, -ahead).to_float();
            let halves = self.bodies.length[ego] * 0.5 + self.bodies.length[slot] * 0.5;
            let slower = own_speed - self.load(r.speed[slot]);
            let (their_across, their_reach) = self.footprint(slot);
            let aside = (across - their_across).abs() - (reach + their_reach);
            for (place, known) in found.iter_mut().enumerate() {
                let row = &vehicle[place * self.frames..][..self.frames];
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
            let row = place * self.frames..(place + 1) * self.frames;
            self.store(&mut out.gap[row.clone()], gap);
            self.store(&mut out.closing_speed[row.clone()], closing);
            self.store(&mut out.lateral_gap[row], aside);
        }
    }
}

/// A vehicle at one frame, as recorded: where along the road [mm], how fast [mm/s], and half its length [m].
#[derive(Clone, Copy)]
pub struct Along {
    /// Position.
    pub s: i32,
    /// Speed.
    pub speed: i32,
    /// Half of the length.
    pub half_length: f32,
}

/// Gap between the ego and a neighbour, and the speed at which it shrinks, as in `Neighbours`.
#[must_use]
pub fn neighbour_at(own: Along, other: Along, is_leader: bool) -> (f32, f32) {
    let slower = own.speed.wrapping_sub(other.speed);
    let closing = if is_leader {
        slower
    } else {
        slower.wrapping_neg()
    };
    let gap = gap_between(own.s, other.s, own.half_length + other.half_length);
    (gap, closing as f32 * METRES)
}

/// Gap between the bumpers of two bodies, from their places along the road [m].
pub(crate) fn gap_between(one: i32, other: i32, half_lengths: f32) -> f32 {
    one.wrapping_sub(other).wrapping_abs() as f32 * METRES - half_lengths
}
