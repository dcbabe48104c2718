//! The ego and one of its neighbours at single frames, as one vehicle behind another.

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};

use super::formulas::{drac, time_gap, ttc_accel};
use crate::lanes::{LANES, V, dispatch};
use crate::signals::{METRES, gap_between};

/// A vehicle at one frame, as recorded.
#[derive(Clone, Copy)]
pub struct Along {
    /// Position [mm].
    pub s: i32,
    /// Speed [mm/s].
    pub speed: i32,
    /// Acceleration [mm/s^2].
    pub accel: i16,
    /// Half of the length [m].
    pub half_length: f32,
}

/// The ego and a neighbour at an instant.
pub struct Pair {
    /// The ego.
    pub own: Along,
    /// The neighbour, if there is one.
    pub other: Option<Along>,
    /// Whether the neighbour is ahead of the ego.
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

/// Measure each instant: a row of `out` for each of `ENCOUNTERS`.
pub fn encounters(pairs: &[Pair], level: Level, out: &mut [f32]) {
    for (chunk, instants) in pairs.chunks(LANES).enumerate() {
        let mut few = Few::default();
        for (lane, pair) in instants.iter().enumerate() {
            few.take(lane, pair);
        }
        let found = dispatch!(level, |simd| measured(simd, &few));
        for (values, row) in found.iter().zip(out.chunks_mut(pairs.len())) {
            let row = &mut row[chunk * LANES..][..instants.len()];
            row.copy_from_slice(&values[..row.len()]);
        }
    }
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

impl Few {
    /// Take down an instant; gap and closing speed are 0 where nobody is there.
    fn take(&mut self, lane: usize, pair: &Pair) {
        let (own, other) = (pair.own, pair.other.unwrap_or(pair.own));
        let halves = own.half_length + other.half_length;
        let slower = own.speed.wrapping_sub(other.speed);
        let closing = if pair.is_ahead {
            slower
        } else {
            slower.wrapping_neg()
        };
        let closing = closing as f32 * METRES;
        let accel = |one: Along| f32::from(one.accel) * METRES;
        let speed = own.speed as f32 * METRES;
        if pair.other.is_some() {
            self.gap[lane] = gap_between(own.s, other.s, halves);
        }
        self.closing[lane] = closing;
        (self.speed[lane], self.closing_accel[lane]) = if pair.is_ahead {
            (speed, accel(own) - accel(other))
        } else {
            (speed + closing, accel(other) - accel(own))
        };
    }
}
