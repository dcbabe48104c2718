//! Rounding once, and the hash over what was recorded; see `overtaking.sim.reference.recording`.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16, u32x16};

use crate::lanes::{LANES, M, Seats, V, choose, clamp_to, splat};
use crate::neighbours::Neighbours;
use crate::output::{MAX_PERCEPTS, Output};
use crate::perception::Beliefs;
use crate::state::{EGO, State, World};
use crate::tile::{PACKED, Row, TILE, Tile, WORDS, bytes, halves, packed, put, transposed};

const NO_VEHICLE: i32 = 255;
const INT16_LIMIT: f32 = 32767.0;
const INT32_LIMIT: f32 = 2.0e9;
const TURNS_PER_RADIAN: f32 = 0.159_154_94;
const THOUSAND: f32 = 1000.0;
const TEN_THOUSAND: f32 = 10000.0;
const INDICATOR_LEFT: i32 = 1;
const INDICATOR_RIGHT: i32 = 2;
const BRAKE: i32 = 4;
const PRIME_1: u32 = 2_654_435_761;
const PRIME_2: u32 = 2_246_822_519;
const PRIME_3: u32 = 3_266_489_917;

/// Which decision a percept was written down for.
#[derive(Clone, Copy)]
pub enum Kind {
    PullOut = 0,
    Return = 1,
    Abort = 2,
}

#[inline(always)]
fn rounded<S: Simd>(value: V<S>, scale: f32, limit: f32) -> i32x16<S> {
    clamp_to(value * scale, -limit, limit)
        .round_ties_even()
        .to_int()
}

#[inline(always)]
fn wrapped<S: Simd>(angle: V<S>) -> V<S> {
    let turns = (angle * TURNS_PER_RADIAN).round_ties_even();
    angle - turns * core::f32::consts::TAU
}

#[inline(always)]
fn mix_word(hash: u32, word: u32) -> u32 {
    hash.wrapping_add(word.wrapping_mul(PRIME_2))
        .rotate_left(13)
        .wrapping_mul(PRIME_1)
}

/// Collects the recorded integers of a block and hashes them.
pub struct Recorder<'a, const N: usize> {
    /// Where the simulation of each lane goes; `None` in lanes that are free.
    out: [Option<Output<'a>>; LANES],
    hash: [[u32; LANES]; 4],
    frames: [usize; LANES],
    flushed: usize,
}

impl<'a, const N: usize> Recorder<'a, N> {
    /// A recorder of the simulations of some lanes.
    pub fn new(mut out: [Option<Output<'a>>; LANES]) -> Self {
        let start = [
            PRIME_1.wrapping_add(PRIME_2),
            PRIME_2,
            0,
            0u32.wrapping_sub(PRIME_1),
        ];
        for out in out.iter_mut().flatten() {
            clear(out);
        }
        Self {
            out,
            hash: start.map(|word| [word; LANES]),
            frames: [0; LANES],
            flushed: 0,
        }
    }

    /// Whether a lane holds a simulation that is not finished.
    pub fn is_busy(&self, lane: usize) -> bool {
        self.out[lane].is_some()
    }

    /// Take over the simulation in lane `other` of a recorder that has written down as many frames.
    pub fn seat(&mut self, lane: usize, from: &mut Self, other: usize) {
        debug_assert_eq!(self.flushed, from.flushed);
        self.out[lane] = from.out[other].take();
        self.hash.seat(lane, &from.hash, other);
        self.frames[lane] = from.frames[other];
    }

    /// Write down one frame of the simulations that still run.
    #[inline(always)]
    pub fn frame<S: Simd>(
        &mut self,
        state: &State<'_, S, N>,
        w: &World<'_, S, N>,
        active: M<S>,
        number: usize,
        tile: &mut Tile<N>,
    ) {
        let simd = w.simd;
        let [h0, h1, h2, h3] = self.hash;
        let mut hash = [
            u32x16::simd_from(simd, h0),
            u32x16::simd_from(simd, h1),
            u32x16::simd_from(simd, h2),
            u32x16::simd_from(simd, h3),
        ];
        let at = number - self.flushed;
        for i in 0..w.count {
            let valid = w.p[i].valid.simd_gt(0.0);
            let words = vehicle_words(state, w, i);
            for (k, word) in words.into_iter().enumerate() {
                hash[k % 4] = mix(hash[k % 4], word, active & valid);
            }
            let none = i32x16::splat(simd, 0);
            for (k, word) in packed(&words).into_iter().enumerate() {
                let word = valid.select(word, none);
                tile.0[(i * PACKED + k) * TILE + at] = Row(word.to_array());
            }
        }
        let stage: i32x16<S> = state.stage.to_int();
        let nobody = state.contact_partner[EGO].simd_lt(0.0);
        let partner: i32x16<S> = state.contact_partner[EGO].to_int();
        let partner = nobody.select(i32x16::splat(simd, NO_VEHICLE), partner);
        let frame = i32x16::splat(simd, number as i32);
        let zero = i32x16::splat(simd, 0);
        for (k, word) in [stage, partner, frame, zero].into_iter().enumerate() {
            hash[k] = mix(hash[k], word, active);
        }
        for (kept, word) in self.hash.iter_mut().zip(hash) {
            *kept = word.to_array();
        }
        for (lane, out) in self.out.iter_mut().enumerate() {
            if let Some(out) = out.as_mut().filter(|_| active.test(lane)) {
                out.stage[number] = stage[lane] as u8;
                out.collided_with[number] = partner[lane] as u8;
                self.frames[lane] = number + 1;
            }
        }
        self.fetch(w.count, at);
        if at + 1 == TILE {
            simd.vectorize(
                #[inline(always)]
                || self.flush(simd, w.count, tile),
            );
            self.flushed = number + 1;
        }
    }

    /// Ask for the memory that the frames of the simulation in lane `at` will be moved to.
    ///
    /// A tile has as many frames as there are lanes, so all of it is there when the tile is full; else each
    /// line of it would be waited for.
    #[inline(always)]
    fn fetch(&self, count: usize, at: usize) {
        let Some(out) = self.out[at].as_ref() else {
            return;
        };
        for i in 0..count.min(out.slots) {
            let place = i * out.frames + self.flushed;
            for wide in [&*out.x, out.y, out.s, out.d, out.speed] {
                prefetch(wide, place);
            }
            for half in [
                &*out.heading,
                out.wheel_angle,
                out.accel_lon,
                out.accel_lat,
                out.yaw_rate,
            ] {
                prefetch(half, place);
            }
            prefetch(out.lane, place);
            prefetch(out.lights, place);
        }
    }

    /// Move the collected frames to their place: the frames of one vehicle are adjacent.
    ///
    /// Sixteen frames are turned at once; what is written beyond the end of a simulation is cleared when
    /// it is finished.
    #[inline(always)]
    pub fn flush<S: Simd>(&mut self, simd: S, count: usize, tile: &Tile<N>) {
        let start = self.flushed;
        if self.frames.iter().all(|frames| *frames <= start) {
            return;
        }
        for i in 0..count {
            for k in 0..PACKED {
                let from = (i * PACKED + k) * TILE;
                let turned = transposed(simd, &tile.0[from..from + LANES]);
                for (out, Row(row)) in self.out.iter_mut().zip(&turned) {
                    let Some(out) = out.as_mut().filter(|out| i < out.slots) else {
                        continue;
                    };
                    let place = i * out.frames + start;
                    match k {
                        0 => put(out.x, place, *row),
                        1 => put(out.y, place, *row),
                        2 => put(out.s, place, *row),
                        3 => put(out.d, place, *row),
                        4 => put(out.speed, place, *row),
                        5 => {
                            put(out.heading, place, halves(row, 0));
                            put(out.wheel_angle, place, halves(row, 16));
                        }
                        6 => {
                            put(out.accel_lon, place, halves(row, 0));
                            put(out.accel_lat, place, halves(row, 16));
                        }
                        _ => {
                            put(out.yaw_rate, place, halves(row, 0));
                            put(out.lane, place, bytes(row, 16));
                            put(out.lights, place, bytes(row, 24));
                        }
                    }
                }
            }
        }
    }

    /// Write down what the ego believed at a decision, as long as there is room.
    #[allow(clippy::too_many_arguments)]
    #[inline(always)]
    pub fn percepts<S: Simd>(
        &mut self,
        state: &mut State<'_, S, N>,
        w: &World<'_, S, N>,
        near: &Neighbours<S>,
        believed: &Beliefs<S>,
        mask: M<S>,
        kind: Kind,
        roles: [usize; 3],
        step: u32,
    ) {
        let now = splat(w.simd, step as f32);
        let mask =
            mask & state.num_percepts.simd_lt(MAX_PERCEPTS as f32) & now.simd_le(state.end_step);
        if !mask.any_true() {
            return;
        }
        let (own, _) = state.road_velocity(EGO);
        for (column, role) in roles.into_iter().enumerate() {
            let slot = near.slot[role];
            let mut speed = state.road_velocity(0).0;
            for j in 1..w.count {
                speed = choose(slot.simd_eq(j as f32), state.road_velocity(j).0, speed);
            }
            let closing = if role.is_multiple_of(2) {
                own - speed
            } else {
                speed - own
            };
            let gap = rounded(believed.gap[role], THOUSAND, INT32_LIMIT);
            let believed_closing = rounded(believed.closing[role], THOUSAND, INT32_LIMIT);
            let true_gap = rounded(near.gap[role], THOUSAND, INT32_LIMIT);
            let true_closing = rounded(closing, THOUSAND, INT32_LIMIT);
            for (lane, out) in self.out.iter_mut().enumerate() {
                let Some(out) = out.as_mut().filter(|_| mask.test(lane)) else {
                    continue;
                };
                let at = state.num_percepts[lane] as usize * 3 + column;
                let nobody = slot[lane] < 0.0;
                out.percept_vehicle[at] = if nobody { 255 } else { slot[lane] as u8 };
                out.percept_detected[at] = u8::from(believed.detected[role].test(lane));
                out.percept_gap[at] = gap[lane];
                out.percept_closing_speed[at] = believed_closing[lane];
                out.percept_true_gap[at] = if nobody { 0 } else { true_gap[lane] };
                out.percept_true_closing_speed[at] = if nobody { 0 } else { true_closing[lane] };
            }
        }
        for (lane, out) in self.out.iter_mut().enumerate() {
            if let Some(out) = out.as_mut().filter(|_| mask.test(lane)) {
                let at = state.num_percepts[lane] as usize;
                out.percept_valid[at] = 1;
                out.percept_kind[at] = kind as u8;
                out.percept_time[at] = step as i32 * 10;
            }
        }
        state.num_percepts = choose(mask, state.num_percepts + 1.0, state.num_percepts);
    }

    /// Write what is left of a simulation that has ended: zeros behind its frames, contacts and hash.
    ///
    /// The lane is free afterwards.
    pub fn finish<S: Simd>(&mut self, lane: usize, state: &State<'_, S, N>, w: &World<'_, S, N>) {
        let Some(mut out) = self.out[lane].take() else {
            return;
        };
        let mut hash = self.hash.map(|word| word[lane]);
        clear_behind(&mut out, self.frames[lane], lane, w);
        put_contacts(&mut out, &mut hash, lane, state, w);
        mix_percepts(&mut hash, &out);
        out.num_frames[0] = self.frames[lane] as i32;
        out.trace_hash.copy_from_slice(&digest(hash));
    }
}

/// Begin to load the line of the cache that an element lies in, where the CPU has an instruction for it.
#[inline(always)]
fn prefetch<T>(slice: &[T], place: usize) {
    #[cfg(target_arch = "x86_64")]
    if let Some(element) = slice.get(place) {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint, which reads nothing and faults nowhere; every x86-64 has it.
        unsafe { _mm_prefetch(core::ptr::from_ref(element).cast(), _MM_HINT_T0) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (slice, place);
}

/// Set what is only written where something happens.
fn clear(out: &mut Output<'_>) {
    out.percept_valid.fill(0);
    out.percept_vehicle.fill(255);
    out.collided_with.fill(255);
    for slice in [
        &mut *out.percept_kind,
        &mut *out.percept_detected,
        &mut *out.stage,
    ] {
        slice.fill(0);
    }
    for slice in [
        &mut *out.percept_time,
        &mut *out.percept_gap,
        &mut *out.percept_closing_speed,
        &mut *out.percept_true_gap,
        &mut *out.percept_true_closing_speed,
    ] {
        slice.fill(0);
    }
}

/// Zero what lies behind the last frame, and the slots that are empty.
fn clear_behind<S: Simd, const N: usize>(
    out: &mut Output<'_>,
    frames: usize,
    lane: usize,
    w: &World<'_, S, N>,
) {
    let room = out.frames;
    for i in 0..out.slots {
        let used = if w.p[i].valid[lane] > 0.0 { frames } else { 0 };
        let rest = i * room + used..(i + 1) * room;
        for wide in [&mut *out.x, out.y, out.s, out.d, out.speed] {
            wide[rest.clone()].fill(0);
        }
        for half in [
            &mut *out.heading,
            out.wheel_angle,
            out.accel_lon,
            out.accel_lat,
            out.yaw_rate,
        ] {
            half[rest.clone()].fill(0);
        }
        out.lane[rest.clone()].fill(0);
        out.lights[rest].fill(0);
    }
}

/// Write down the first contact of each vehicle.
fn put_contacts<S: Simd, const N: usize>(
    out: &mut Output<'_>,
    hash: &mut [u32; 4],
    lane: usize,
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
) {
    for i in 0..out.slots {
        let partner = state.contact_partner[i][lane];
        let slot = if partner < 0.0 { 255 } else { partner as u8 };
        let time = rounded(state.contact_time[i], THOUSAND, INT32_LIMIT)[lane];
        let impulse = rounded(state.contact_impulse[i], 1.0, INT32_LIMIT)[lane];
        let speed = rounded(state.contact_speed[i], THOUSAND, INT32_LIMIT)[lane];
        out.contact_partner[i] = slot;
        out.contact_time[i] = time;
        out.contact_impulse[i] = impulse;
        out.contact_speed[i] = speed;
        // Empty slots are no part of the hash, which is the same for any number of slots.
        if w.p[i].valid[lane] == 0.0 {
            continue;
        }
        let words = [u32::from(slot), time as u32, impulse as u32, speed as u32];
        for (hash, word) in hash.iter_mut().zip(words) {
            *hash = mix_word(*hash, word);
        }
    }
}

fn mix_percepts(hash: &mut [u32; 4], out: &Output<'_>) {
    for at in 0..MAX_PERCEPTS {
        if out.percept_valid[at] == 0 {
            continue;
        }
        let mut words = vec![u32::from(out.percept_kind[at]), out.percept_time[at] as u32];
        for k in at * 3..at * 3 + 3 {
            words.extend([
                u32::from(out.percept_vehicle[k]),
                u32::from(out.percept_detected[k]),
                out.percept_gap[k] as u32,
                out.percept_closing_speed[k] as u32,
                out.percept_true_gap[k] as u32,
                out.percept_true_closing_speed[k] as u32,
            ]);
        }
        for (k, word) in words.into_iter().enumerate() {
            hash[k % 4] = mix_word(hash[k % 4], word);
        }
    }
}

fn digest(hash: [u32; 4]) -> [u32; 4] {
    core::array::from_fn(|k| {
        let word = hash[k].wrapping_add(hash[(k + 1) % 4].rotate_left(7));
        let word = (word ^ (word >> 15)).wrapping_mul(PRIME_2);
        let word = (word ^ (word >> 13)).wrapping_mul(PRIME_3);
        word ^ (word >> 16)
    })
}

#[inline(always)]
fn mix<S: Simd>(hash: u32x16<S>, word: i32x16<S>, mask: M<S>) -> u32x16<S> {
    let word: u32x16<S> = word.bitcast();
    let sum = hash + word * PRIME_2;
    let mixed = ((sum << 13) | (sum >> 19)) * PRIME_1;
    mask.select(mixed, hash)
}

/// The recorded integers of vehicle `i`.
#[inline(always)]
fn vehicle_words<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> [i32x16<S>; WORDS] {
    let (road, p) = (w.road, &w.p[i]);
    let [x0, y0, heading, cosine, sine] = road.pose;
    let d = road.side * state.d[i];
    let mut lane = i32x16::splat(w.simd, NO_VEHICLE);
    for k in 0..=road.num_lanes {
        let beyond = state.d[i].simd_ge(road.boundaries[k]);
        lane = beyond.select(i32x16::splat(w.simd, k as i32), lane);
    }
    let speed = (state.vx[i] * state.vx[i] + state.vy[i] * state.vy[i]).sqrt();
    let wheel = choose(
        p.two_wheeler.simd_gt(0.0),
        splat(w.simd, 0.0),
        state.wheel[i],
    );
    [
        rounded(x0 + state.s[i] * cosine - d * sine, THOUSAND, INT32_LIMIT),
        rounded(y0 + state.s[i] * sine + d * cosine, THOUSAND, INT32_LIMIT),
        rounded(state.s[i], THOUSAND, INT32_LIMIT),
        rounded(d, THOUSAND, INT32_LIMIT),
        rounded(speed, THOUSAND, INT32_LIMIT),
        rounded(
            wrapped(heading + road.side * state.psi[i]),
            TEN_THOUSAND,
            INT16_LIMIT,
        ),
        rounded(road.side * wheel, TEN_THOUSAND, INT16_LIMIT),
        rounded(state.a_lon[i], THOUSAND, INT16_LIMIT),
        rounded(road.side * state.a_lat[i], THOUSAND, INT16_LIMIT),
        rounded(road.side * state.r[i], TEN_THOUSAND, INT16_LIMIT),
        lane,
        lights(state, w, i),
    ]
}

#[inline(always)]
fn lights<S: Simd, const N: usize>(
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
    i: usize,
) -> i32x16<S> {
    let towards_left = w.road.side * state.indicator[i];
    let left = towards_left.simd_gt(0.0).select(
        i32x16::splat(w.simd, INDICATOR_LEFT),
        i32x16::splat(w.simd, 0),
    );
    let right = towards_left.simd_lt(0.0).select(
        i32x16::splat(w.simd, INDICATOR_RIGHT),
        i32x16::splat(w.simd, 0),
    );
    let braking = state.accel[i].simd_lt(-w.c.stop_lamp_decel) | state.crashed[i].simd_gt(0.0);
    let base: i32x16<S> = w.p[i].lights.to_int();
    base + left + right + braking.select(i32x16::splat(w.simd, BRAKE), i32x16::splat(w.simd, 0))
}
