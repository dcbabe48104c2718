//! Sixteen frames of one simulation side by side, and the signals in them.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16};

use super::{METRES, NO_VEHICLE, PLACES, Recording, Signals, Surroundings};
use crate::elementary::{log, sincos};
use crate::environment::{at_film, speed_columns};
use crate::lanes::{LANES, M, V, at_least, at_most, choose, max, min, splat};
use crate::tile::prefetch;

/// Frames for which memory is asked before they are loaded: rows of many vehicles are more than the CPU follows.
const AHEAD: usize = 2 * LANES;
const RADIANS: f32 = 1e-4;
const NEWTON_STEPS: usize = 8;
const LEAST_EXTINCTION: f32 = 1e-7;
/// Optical depth by which a lamp that is seen beyond the reach of attention surely is: Newton's steps end within a
/// thousandth of their limit.
const SURELY: f32 = 0.01;
/// Lanes that a road has at most.
const MAX_LANES: usize = 8;

/// The nearest vehicle of a place so far.
#[derive(Clone, Copy)]
struct Nearest<S: Simd> {
    distance: i32x16<S>,
    vehicle: i32x16<S>,
}

/// Up to sixteen frames of one simulation.
#[derive(Clone, Copy)]
pub(super) struct Frames<'a, S: Simd> {
    pub(super) simd: S,
    pub(super) recording: &'a Recording<'a>,
    pub(super) simulation: usize,
    pub(super) at: usize,
}

/// Do something with some frames of a simulation, sixteen at a time, with the SIMD features of the CPU.
///
/// A macro, because a closure that the compiler leaves outside would lose them.
macro_rules! in_chunks {
    ($whole:expr, $end:expr, |$chunk:ident| $body:expr) => {{
        let whole = $whole;
        for at in (0..$end).step_by($crate::lanes::LANES) {
            $crate::lanes::outlined!(whole.simd, {
                let $chunk = $crate::signals::chunk::Frames { at, ..whole };
                $body
            });
        }
    }};
}
pub(super) use in_chunks;

impl<'a, S: Simd> Frames<'a, S> {
    /// The first of the frames of a simulation.
    #[inline(always)]
    pub(super) fn new(simd: S, recording: &'a Recording<'a>, simulation: usize) -> Self {
        Self {
            simd,
            recording,
            simulation,
            at: 0,
        }
    }
}

impl<S: Simd> Frames<'_, S> {
    /// The frames of a row as integers, zero beyond its end.
    #[inline(always)]
    pub(super) fn load<T: Copy + Into<i32>>(&self, row: &[T]) -> i32x16<S> {
        prefetch(row, self.at + AHEAD);
        let mut values = [0; LANES];
        if let Some(row) = row[self.at..].first_chunk::<LANES>() {
            for (value, recorded) in values.iter_mut().zip(row) {
                *value = (*recorded).into();
            }
        } else {
            for (value, recorded) in values.iter_mut().zip(&row[self.at..]) {
                *value = (*recorded).into();
            }
        }
        i32x16::simd_from(self.simd, values)
    }

    #[inline(always)]
    pub(super) fn store(&self, row: &mut [f32], values: V<S>) {
        let values: [f32; LANES] = values.to_array();
        if let Some(row) = row[self.at..].first_chunk_mut::<LANES>() {
            *row = values;
        } else {
            let end = self.recording.frames - self.at;
            row[self.at..].copy_from_slice(&values[..end]);
        }
    }

    #[inline(always)]
    pub(super) fn store_bytes(&self, row: &mut [u8], values: i32x16<S>) {
        let values: [i32; LANES] = values.to_array();
        let bytes = values.map(|value| value as u8);
        if let Some(row) = row[self.at..].first_chunk_mut::<LANES>() {
            *row = bytes;
        } else {
            let end = self.recording.frames - self.at;
            row[self.at..].copy_from_slice(&bytes[..end]);
        }
    }

    #[inline(always)]
    pub(super) fn int(&self, value: i32) -> i32x16<S> {
        i32x16::splat(self.simd, value)
    }

    #[inline(always)]
    pub(super) fn slot(&self, vehicle: usize) -> usize {
        self.simulation * self.recording.slots + vehicle
    }

    /// Where a body lies across the road: its centre, and its reach to either side.
    #[inline(always)]
    pub(super) fn footprint(&self, slot: usize) -> (V<S>, V<S>) {
        let r = self.recording;
        let d: V<S> = self.load(r.d[slot]).to_float();
        let across = r.side * (d * METRES);
        let heading: V<S> = self.load(r.heading[slot]).to_float();
        let (sine, cosine) = sincos(heading * RADIANS - r.direction);
        let half_length = r.length[slot] * 0.5;
        let half_width = r.width[slot] * 0.5;
        (across, half_length * sine.abs() + half_width * cosine.abs())
    }

    /// Whether a vehicle is there at all.
    #[inline(always)]
    pub(super) fn present(&self, slot: usize) -> M<S> {
        match &self.recording.present {
            Some(rows) => self.load(rows[slot]).simd_gt(0),
            None => self.int(1).simd_gt(0),
        }
    }
}

/// What frames of a simulation leave for later ones.
pub(super) struct Lamps<S: Simd> {
    /// Distance at which a lamp was seen.
    range: Option<V<S>>,
    /// Twice the logarithm of the reach of attention.
    attention: Option<V<S>>,
}

impl<S: Simd> Lamps<S> {
    pub(super) const NONE: Self = Self {
        range: None,
        attention: None,
    };
}

/// The same, with what is around the ego.
pub(super) struct Chunk<'a, S: Simd> {
    pub(super) frames: Frames<'a, S>,
    pub(super) around: &'a Surroundings<'a>,
}

impl<S: Simd> Chunk<'_, S> {
    /// Signals of the ego alone.
    #[inline(always)]
    pub(super) fn own(
        &self,
        (across, reach): (V<S>, V<S>),
        lamps: &mut Lamps<S>,
        out: &mut Signals<'_>,
    ) {
        let ego = self.frames.slot(0);
        let speed: V<S> = self
            .frames
            .load(self.frames.recording.speed[ego])
            .to_float();
        let accel: V<S> = self
            .frames
            .load(self.frames.recording.accel[ego])
            .to_float();
        let speed = speed * METRES;
        self.frames.store(out.accel, accel * METRES);
        self.frames
            .store_bytes(out.lane, self.frames.load(self.frames.recording.lane[ego]));
        self.frames.store(out.lateral_position, across);
        self.frames.store(out.speed, speed);
        self.frames.store(out.right_edge, across - reach);
        self.frames.store(out.left_edge, across + reach);
        self.frames.store(out.friction, self.friction(ego, speed));
        let (lit, unlit) = self.sights(speed, lamps);
        self.frames.store(out.sight_lit, lit);
        self.frames.store(out.sight_unlit, unlit);
    }

    #[inline(always)]
    fn friction(&self, ego: usize, speed: V<S>) -> V<S> {
        let a = self.around;
        let lane = self.frames.load(self.frames.recording.lane[ego]);
        let films =
            &a.film[self.frames.simulation * MAX_LANES..][..self.frames.recording.num_lanes];
        let mut film = splat(self.frames.simd, films[0]);
        for (k, value) in films.iter().enumerate().skip(1) {
            // 255 is beyond the slow edge.
            let beyond = lane.simd_ge(k as i32) & lane.simd_lt(255);
            film = choose(beyond, splat(self.frames.simd, *value), film);
        }
        let wear = splat(self.frames.simd, a.wear[self.frames.simulation]);
        let truck = splat(self.frames.simd, a.truck[self.frames.simulation]);
        at_film(
            a.constants,
            &speed_columns(a.constants, speed, wear, truck),
            film,
        )
    }

    /// Distances at which something lit and something unlit is seen.
    #[inline(always)]
    fn sights(&self, speed: V<S>, lamps: &mut Lamps<S>) -> (V<S>, V<S>) {
        let (a, k) = (self.around, self.frames.simulation);
        let rain = a.rain[k] * (1.0 + speed / a.constants.rain_speed);
        let air = a.fog[k] + rain;
        let contrast = a.contrast_depth[k] / at_least(air, LEAST_EXTINCTION);
        let unlit = at_most(contrast, a.unlit_limit[k]);
        if unlit.simd_ge(a.attention).all_true() {
            return (splat(self.frames.simd, a.attention), unlit);
        }
        // Without rain the air is the same at any speed, and so in every frame.
        let lamp = if let (Some(lamp), 0.0) = (lamps.range, a.rain[k]) {
            lamp
        } else if self.is_seen_far(air, lamps) {
            splat(self.frames.simd, a.attention)
        } else {
            self.lamp_range(air)
        };
        lamps.range = Some(lamp);
        (at_most(max(lamp, unlit), a.attention), unlit)
    }

    /// Whether a lamp is surely seen beyond the reach of attention, in each of these frames.
    #[inline(always)]
    fn is_seen_far(&self, air: V<S>, lamps: &mut Lamps<S>) -> bool {
        let (a, k) = (self.around, self.frames.simulation);
        let attention = match lamps.attention {
            Some(known) => known,
            None => 2.0 * log(splat(self.frames.simd, a.attention)),
        };
        lamps.attention = Some(attention);
        let excess = attention + air * a.attention - a.lamp_depth[k];
        excess.simd_lt(-SURELY).all_true()
    }

    #[inline(always)]
    fn lamp_range(&self, air: V<S>) -> V<S> {
        let (a, k) = (self.around, self.frames.simulation);
        let depth = a.lamp_depth[k];
        let mut r = min(
            splat(self.frames.simd, a.lamp_clear[k]),
            4.0 / at_least(air, 1e-6),
        );
        for _ in 0..NEWTON_STEPS {
            let excess = 2.0 * log(r) + air * r - depth;
            let next = at_least(r - r * excess / (2.0 + air * r), 0.5);
            // What a step leaves as it is every further step leaves as well.
            if next.simd_eq(r).all_true() {
                break;
            }
            r = next;
        }
        r
    }

    /// Who is nearest in each place.
    #[inline(always)]
    pub(super) fn nearest(&self, out: &mut Signals<'_>) {
        let r = self.frames.recording;
        let ego = self.frames.slot(0);
        let (own_s, own_lane) = (self.frames.load(r.s[ego]), self.frames.load(r.lane[ego]));
        let num_lanes = r.num_lanes as i32;
        let on_road = own_lane.simd_lt(num_lanes);
        let mut nearest = [Nearest {
            distance: self.frames.int(i32::MAX),
            vehicle: self.frames.int(i32::from(NO_VEHICLE)),
        }; PLACES];
        for j in 1..r.slots {
            let slot = self.frames.slot(j);
            if !r.valid[slot] {
                continue;
            }
            let ahead = self.frames.load(r.s[slot]) - own_s;
            let lane = self.frames.load(r.lane[slot]);
            let there = self.frames.present(slot) & on_road & lane.simd_lt(num_lanes);
            let (shift, is_ahead) = (lane - own_lane, ahead.simd_ge(0));
            let distance = is_ahead.select(ahead, -ahead);
            let number = self.frames.int(j as i32);
            for (pair, shifted) in nearest.as_chunks_mut::<2>().0.iter_mut().zip([0, 1, -1]) {
                let in_lane = there & shift.simd_eq(shifted);
                if !in_lane.any_true() {
                    continue;
                }
                for (known, end) in pair.iter_mut().zip([is_ahead, !is_ahead]) {
                    let closer = in_lane & end & distance.simd_lt(known.distance);
                    known.distance = closer.select(distance, known.distance);
                    known.vehicle = closer.select(number, known.vehicle);
                }
            }
        }
        for (row, known) in out.neighbour_slot.chunks_mut(r.frames).zip(nearest) {
            self.frames.store_bytes(row, known.vehicle);
        }
    }
}
