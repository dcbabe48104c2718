//! Frames to their place in memory, percepts and contacts; see `overtaking.sim.reference.recorder`.

pub(crate) mod frame_tiles;
pub(crate) mod output;

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16, u32x16};

use crate::decision_context::DriverContext;
use crate::gap_acceptance::Intent;
use crate::math::vectors::{CopyLane, F32, Mask, SIMD_LANES, clamp_to, select, splat};
use crate::names::lights;
use crate::oncoming::OncomingVehicle;
use crate::params::{Params, RoadPose};
use crate::recorder::frame_tiles::{
    FRAMES_PER_TILE, FrameTile, NUM_PACKED_WORDS, NUM_STATE_WORDS, Row, packed, put_tile, transpose,
};
use crate::recorder::output::{MAX_PERCEPTS, Output};
use crate::state::{
    EGO_SLOT, LEADER, LEFT_FOLLOWER, LEFT_LEADER, RIGHT_FOLLOWER, RIGHT_LEADER, State,
};
use crate::vehicle_handle::VehicleHandle;

/// The manoeuvre at which a percept is recorded.
#[derive(Clone, Copy)]
pub enum ManoeuvreKind {
    PullOut = 0,
    Return = 1,
    Cancel = 2,
}

/// Percepts of three vehicles at a manoeuvre of the ego.
struct RecordedPercepts<'a, S: Simd> {
    /// Simulations in which the ego makes the manoeuvre at this step.
    made: Mask<S>,
    kind: ManoeuvreKind,
    /// Roles of the leader, and of the leader and the follower in the lane that is entered.
    roles: [usize; 3],
    /// Oncoming vehicle in place of the leader in the left lane.
    oncoming: Option<&'a OncomingVehicle<S>>,
    step: u32,
}

/// Collects the recorded integers of a block and hashes them.
pub struct Recorder<'a, const N: usize> {
    /// Outputs of the simulation in each lane; `None` in free lanes.
    out: [Option<Output<'a>>; SIMD_LANES],
    hash: [[u32; SIMD_LANES]; 4],
    frames: [usize; SIMD_LANES],
    flushed: usize,
}

/// Hash and counters of a recorder, which outlive the outputs that it borrows.
#[derive(Clone, Copy)]
pub struct RecorderProgress {
    hash: [[u32; SIMD_LANES]; 4],
    frames: [usize; SIMD_LANES],
    flushed: usize,
}

impl<'a, const N: usize> Recorder<'a, N> {
    /// Go on with the recording in lane 0, whose outputs are those at the time of `progress`.
    pub fn resume(output: Output<'a>, progress: RecorderProgress) -> Self {
        let mut output = Some(output);
        Self {
            out: core::array::from_fn(|_| output.take()),
            hash: progress.hash,
            frames: progress.frames,
            flushed: progress.flushed,
        }
    }

    /// Hash and counters, from which `resume` goes on.
    pub fn progress(&self) -> RecorderProgress {
        RecorderProgress {
            hash: self.hash,
            frames: self.frames,
            flushed: self.flushed,
        }
    }

    /// A recorder of the simulations in the first lanes, at most sixteen.
    pub fn new(mut outputs: Vec<Output<'a>>) -> Self {
        outputs.iter_mut().for_each(clear);
        let mut outputs = outputs.into_iter();
        Self {
            out: core::array::from_fn(|_| outputs.next()),
            hash: hash_start(),
            frames: [0; SIMD_LANES],
            flushed: 0,
        }
    }

    /// Move the recording in lane `source_lane` of another recorder, which has written as many tiles, into `lane`.
    pub fn take_over(&mut self, lane: usize, source: &mut Self, source_lane: usize) {
        debug_assert_eq!(self.flushed, source.flushed);
        self.out[lane] = source.out[source_lane].take();
        self.hash.copy_lane(lane, &source.hash, source_lane);
        self.frames[lane] = source.frames[source_lane];
    }

    /// Write down one frame of the simulations that still run.
    #[inline(always)]
    pub fn record_frame<S: Simd>(
        &mut self,
        state: &State<S, N>,
        params: &Params<S, N>,
        active: Mask<S>,
        number: usize,
        tile: &mut FrameTile<N>,
    ) {
        let simd = params.simd;
        let [h0, h1, h2, h3] = self.hash;
        let mut hash = [
            u32x16::simd_from(simd, h0),
            u32x16::simd_from(simd, h1),
            u32x16::simd_from(simd, h2),
            u32x16::simd_from(simd, h3),
        ];
        let at = number - self.flushed;
        for i in 0..params.num_slots_in_use {
            let valid = params.vehicles[i].valid.simd_gt(0.0);
            let words = state.vehicle(params, i).state_words();
            for (k, word) in words.into_iter().enumerate() {
                hash[k % 4] = mix(hash[k % 4], word, active & valid);
            }
            for (k, word) in packed(simd, &words).into_iter().enumerate() {
                tile.0[(i * NUM_PACKED_WORDS + k) * FRAMES_PER_TILE + at] = Row(word.to_array());
            }
            if valid.test(at) {
                self.prefetch_rows(i, at);
            }
        }
        let stage: i32x16<S> = state.overtake.stage[EGO_SLOT].to_int();
        let nobody = state.first_contact.partner[EGO_SLOT].simd_lt(0.0);
        let partner: i32x16<S> = state.first_contact.partner[EGO_SLOT].to_int();
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
        if at + 1 == FRAMES_PER_TILE {
            simd.vectorize(
                #[inline(always)]
                || self.write_tile(params, tile),
            );
            self.flushed = number + 1;
        }
    }

    /// Ask for the memory that the frames of vehicle `i` of the simulation in lane `at` will be moved to.
    ///
    /// A tile has as many frames as there are lanes, so all of it is there when the tile is full; else each
    /// line of it would be waited for. A vehicle after the other, as the CPU waits for a few lines at a time.
    #[inline(always)]
    fn prefetch_rows(&self, i: usize, at: usize) {
        if let Some(out) = self.out[at].as_ref() {
            frame_tiles::prefetch_rows(out, i * out.frames + self.flushed);
        }
    }

    /// Move the collected frames to their place: the frames of one vehicle are adjacent.
    ///
    /// Sixteen frames are turned at once; what is written beyond the end of a simulation is cleared when
    /// it is finished.
    #[inline(always)]
    pub fn write_tile<S: Simd>(&mut self, params: &Params<S, N>, tile: &FrameTile<N>) {
        let start = self.flushed;
        if self.frames.iter().all(|frames| *frames <= start) {
            return;
        }
        for i in 0..params.num_slots_in_use {
            let there = params.vehicles[i].valid.simd_gt(0.0);
            for k in 0..NUM_PACKED_WORDS {
                let from = (i * NUM_PACKED_WORDS + k) * FRAMES_PER_TILE;
                let turned = transpose(params.simd, &tile.0[from..from + SIMD_LANES]);
                for (lane, (out, Row(row))) in self.out.iter_mut().zip(&turned).enumerate() {
                    if let Some(out) = out.as_mut().filter(|_| there.test(lane)) {
                        put_tile(out, i, k, start, row);
                    }
                }
            }
        }
    }

    /// Record what the ego believes at each manoeuvre that it starts or cancels.
    #[inline(always)]
    pub fn record_manoeuvres<S: Simd>(
        &mut self,
        state: &mut State<S, N>,
        params: &Params<S, N>,
        context: &DriverContext<S>,
        intent: &Intent<S>,
        step: u32,
    ) {
        let left = [LEADER, LEFT_LEADER, LEFT_FOLLOWER];
        let right = [LEADER, RIGHT_LEADER, RIGHT_FOLLOWER];
        // On two-way roads the oncoming vehicle is recorded as leader of the lane that is entered.
        let has_oncoming_traffic = params.road.directions.has_oncoming_traffic;
        let oncoming = has_oncoming_traffic.then_some(&context.oncoming.nearest);
        for (made, kind, roles, oncoming) in [
            (
                intent.starts_pull_out,
                ManoeuvreKind::PullOut,
                left,
                oncoming,
            ),
            (intent.cancels_pull_out, ManoeuvreKind::Cancel, right, None),
            (intent.cancels_return, ManoeuvreKind::Cancel, left, None),
            (intent.starts_return, ManoeuvreKind::Return, right, None),
        ] {
            let percepts = RecordedPercepts {
                made,
                kind,
                roles,
                oncoming,
                step,
            };
            self.record_percepts(state, params, context, &percepts);
        }
    }

    /// Record what the ego believes, and what is true, where it makes a manoeuvre and has fewer than `MAX_PERCEPTS`.
    #[inline(always)]
    fn record_percepts<S: Simd>(
        &mut self,
        state: &mut State<S, N>,
        params: &Params<S, N>,
        context: &DriverContext<S>,
        percepts: &RecordedPercepts<'_, S>,
    ) {
        let (near, believed) = (&context.neighbours, &context.beliefs);
        let RecordedPercepts {
            made,
            kind,
            roles,
            oncoming,
            step,
        } = *percepts;
        let now = splat(params.simd, step as f32);
        let mask =
            made & state.num_percepts.simd_lt(MAX_PERCEPTS as f32) & now.simd_le(state.end_step);
        if !mask.any_true() {
            return;
        }
        let (own, _) = state.vehicle(params, EGO_SLOT).road_velocity();
        for (column, role) in roles.into_iter().enumerate() {
            // Who comes stands for the front of the lane that is pulled out to.
            let comes = oncoming.filter(|_| role == LEFT_LEADER);
            let slot = comes.map_or(near.slot[role], |one| one.slot);
            let mut speed = state.vehicle(params, 0).road_velocity().0;
            for j in 1..params.num_slots_in_use {
                speed = select(
                    slot.simd_eq(j as f32),
                    state.vehicle(params, j).road_velocity().0,
                    speed,
                );
            }
            let closing = if comes.is_some() {
                own + speed
            } else if role.is_multiple_of(2) {
                own - speed
            } else {
                speed - own
            };
            let gap = comes.map_or(believed.gap[role], |one| one.believed_gap);
            let gap = to_recorded_integers(gap, INTEGERS_PER_UNIT, INT32_LIMIT);
            let believed_closing =
                comes.map_or(believed.closing_speed[role], |one| one.closing_speed);
            let believed_closing =
                to_recorded_integers(believed_closing, INTEGERS_PER_UNIT, INT32_LIMIT);
            let true_gap = comes.map_or(near.gap[role], |one| one.gap);
            let true_gap = to_recorded_integers(true_gap, INTEGERS_PER_UNIT, INT32_LIMIT);
            let detected = comes.map_or(believed.is_detected[role], |one| one.is_detected);
            let true_closing = to_recorded_integers(closing, INTEGERS_PER_UNIT, INT32_LIMIT);
            for (lane, out) in self.out.iter_mut().enumerate() {
                let Some(out) = out.as_mut().filter(|_| mask.test(lane)) else {
                    continue;
                };
                let at = state.num_percepts[lane] as usize * 3 + column;
                let nobody = slot[lane] < 0.0;
                out.percept_slot[at] = if nobody { 255 } else { slot[lane] as u8 };
                out.percept_is_detected[at] = u8::from(detected.test(lane));
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
        state.num_percepts = select(mask, state.num_percepts + 1.0, state.num_percepts);
    }

    /// Write what is left of a simulation that has ended: zeros behind its frames, contacts and hash.
    ///
    /// The lane is free afterwards.
    pub fn finish<S: Simd>(&mut self, lane: usize, state: &State<S, N>, params: &Params<S, N>) {
        let Some(mut out) = self.out[lane].take() else {
            return;
        };
        let mut hash = self.hash.map(|word| word[lane]);
        clear_behind(&mut out, self.frames[lane], lane, params);
        put_contacts(&mut out, &mut hash, lane, state, params);
        mix_percepts(&mut hash, &out);
        out.num_frames[0] = self.frames[lane] as i32;
        out.trace_hash.copy_from_slice(&digest(hash));
    }
}

/// Set what is only written where something happens.
fn clear(out: &mut Output<'_>) {
    out.percept_valid.fill(0);
    out.percept_slot.fill(255);
    out.collided_with.fill(255);
    for slice in [
        &mut *out.percept_kind,
        &mut *out.percept_is_detected,
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

/// Zero what lies behind the last frame, and the slots that are empty, as far as something was ever written there.
fn clear_behind<S: Simd, const N: usize>(
    out: &mut Output<'_>,
    frames: usize,
    lane: usize,
    params: &Params<S, N>,
) {
    let room = out.frames;
    for i in 0..out.slots {
        let used = if params.vehicles[i].valid[lane] > 0.0 {
            frames
        } else {
            0
        };
        let written = (out.written[i].max(0) as usize).clamp(used, room);
        out.written[i] = used as i32;
        let rest = i * room + used..i * room + written;
        frame_tiles::clear(out, rest);
    }
}

/// Write down the first contact of each vehicle.
fn put_contacts<S: Simd, const N: usize>(
    out: &mut Output<'_>,
    hash: &mut [u32; 4],
    lane: usize,
    state: &State<S, N>,
    params: &Params<S, N>,
) {
    for i in 0..out.slots {
        let partner = state.first_contact.partner[i][lane];
        let slot = if partner < 0.0 { 255 } else { partner as u8 };
        let time =
            to_recorded_integers(state.first_contact.time[i], INTEGERS_PER_UNIT, INT32_LIMIT)[lane];
        let impulse = to_recorded_integers(state.first_contact.impulse[i], 1.0, INT32_LIMIT)[lane];
        let speed = to_recorded_integers(
            state.first_contact.closing_speed[i],
            INTEGERS_PER_UNIT,
            INT32_LIMIT,
        )[lane];
        out.contact_partner[i] = slot;
        out.contact_time[i] = time;
        out.contact_impulse[i] = impulse;
        out.contact_speed[i] = speed;
        // Empty slots are no part of the hash, which is the same for any number of slots.
        if params.vehicles[i].valid[lane] == 0.0 {
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
                u32::from(out.percept_slot[k]),
                u32::from(out.percept_is_detected[k]),
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

/// Slot number, or lane, of nobody and nothing.
pub const NO_VEHICLE: i32 = 255;
const INT16_LIMIT: f32 = 32767.0;
/// Largest recorded word of 32 bits.
pub const INT32_LIMIT: f32 = 2.0e9;
const TURNS_PER_RADIAN: f32 = 0.159_154_94;
/// Steps of a metre, of a metre a second, of a second.
pub const INTEGERS_PER_UNIT: f32 = 1000.0;
const INTEGERS_PER_RADIAN: f32 = 10000.0;

/// A number in steps, the nearest, within limits.
#[inline(always)]
pub fn to_recorded_integers<S: Simd>(value: F32<S>, scale: f32, limit: f32) -> i32x16<S> {
    clamp_to(value * scale, -limit, limit)
        .round_ties_even()
        .to_int()
}

#[inline(always)]
fn wrap_angle<S: Simd>(angle: F32<S>) -> F32<S> {
    let turns = (angle * TURNS_PER_RADIAN).round_ties_even();
    angle - turns * core::f32::consts::TAU
}

impl<S: Simd, const N: usize> VehicleHandle<'_, S, N> {
    /// The recorded integers of vehicle `i`.
    #[inline(always)]
    pub fn state_words(self) -> [i32x16<S>; NUM_STATE_WORDS] {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let (road, vehicle) = (&params.road, self.vehicle());
        let RoadPose {
            x0,
            y0,
            heading,
            cosine,
            sine,
        } = road.pose;
        let (s, from_slow) = self.road_position();
        let d = road.overtaking_sign * from_slow;
        let mut lane = i32x16::splat(params.simd, NO_VEHICLE);
        for k in 0..=road.directions.num_own_lanes {
            let beyond = from_slow.simd_ge(road.boundaries[k]);
            lane = beyond.select(i32x16::splat(params.simd, k as i32), lane);
        }
        let speed = (state.motion.vx[slot] * state.motion.vx[slot]
            + state.motion.vy[slot] * state.motion.vy[slot])
            .sqrt();
        let wheel = select(
            vehicle.two_wheeler.simd_gt(0.0),
            splat(params.simd, 0.0),
            state.controls.wheel_angle[slot],
        );
        let mut course = heading + road.overtaking_sign * state.motion.heading[slot];
        if road.directions.has_oncoming_traffic {
            let half_turn = splat(params.simd, core::f32::consts::PI);
            course += select(
                vehicle.travel_sign.simd_lt(0.0),
                half_turn,
                splat(params.simd, 0.0),
            );
        }
        [
            to_recorded_integers(x0 + s * cosine - d * sine, INTEGERS_PER_UNIT, INT32_LIMIT),
            to_recorded_integers(y0 + s * sine + d * cosine, INTEGERS_PER_UNIT, INT32_LIMIT),
            to_recorded_integers(s, INTEGERS_PER_UNIT, INT32_LIMIT),
            to_recorded_integers(d, INTEGERS_PER_UNIT, INT32_LIMIT),
            to_recorded_integers(speed, INTEGERS_PER_UNIT, INT32_LIMIT),
            to_recorded_integers(wrap_angle(course), INTEGERS_PER_RADIAN, INT16_LIMIT),
            to_recorded_integers(
                road.overtaking_sign * wheel,
                INTEGERS_PER_RADIAN,
                INT16_LIMIT,
            ),
            to_recorded_integers(state.motion.accel_lon[slot], INTEGERS_PER_UNIT, INT16_LIMIT),
            to_recorded_integers(
                road.overtaking_sign * state.motion.accel_lat[slot],
                INTEGERS_PER_UNIT,
                INT16_LIMIT,
            ),
            to_recorded_integers(
                road.overtaking_sign * state.motion.yaw_rate[slot],
                INTEGERS_PER_RADIAN,
                INT16_LIMIT,
            ),
            lane,
            self.recorded_lights(),
        ]
    }

    #[inline(always)]
    pub(crate) fn recorded_lights(self) -> i32x16<S> {
        let (state, params, slot) = (self.state, self.params, self.slot);
        let towards_left = params.road.overtaking_sign * state.controls.indicator[slot];
        let left = towards_left.simd_gt(0.0).select(
            i32x16::splat(params.simd, lights::INDICATOR_LEFT),
            i32x16::splat(params.simd, 0),
        );
        let right = towards_left.simd_lt(0.0).select(
            i32x16::splat(params.simd, lights::INDICATOR_RIGHT),
            i32x16::splat(params.simd, 0),
        );
        let braking = state.controls.requested_accel[slot]
            .simd_lt(-params.constants.stop_lamp_decel)
            | state.motion.is_wreck[slot].simd_gt(0.0);
        let base: i32x16<S> = self.vehicle().initial_lights.to_int();
        let shown = base
            + left
            + right
            + braking.select(
                i32x16::splat(params.simd, lights::BRAKE),
                i32x16::splat(params.simd, 0),
            );
        if !params.road.directions.has_oncoming_traffic {
            return shown;
        }
        let flashes = state.controls.flashes_high_beam[slot].simd_gt(0.0);
        shown
            + flashes.select(
                i32x16::splat(params.simd, lights::HIGH_BEAM),
                i32x16::splat(params.simd, 0),
            )
    }
}

const PRIME_1: u32 = 2_654_435_761;
const PRIME_2: u32 = 2_246_822_519;
const PRIME_3: u32 = 3_266_489_917;

/// The four words of the hash of each simulation before anything is recorded.
pub fn hash_start() -> [[u32; SIMD_LANES]; 4] {
    [
        PRIME_1.wrapping_add(PRIME_2),
        PRIME_2,
        0,
        0u32.wrapping_sub(PRIME_1),
    ]
    .map(|word| [word; SIMD_LANES])
}

/// Mix a word of each simulation into one of the four, in the masked simulations.
#[inline(always)]
pub fn mix<S: Simd>(hash: u32x16<S>, word: i32x16<S>, mask: Mask<S>) -> u32x16<S> {
    let word: u32x16<S> = word.bitcast();
    let sum = hash + word * PRIME_2;
    let mixed = ((sum << 13) | (sum >> 19)) * PRIME_1;
    mask.select(mixed, hash)
}

/// Mix a word into one of the four of a single simulation.
#[inline(always)]
pub fn mix_word(hash: u32, word: u32) -> u32 {
    hash.wrapping_add(word.wrapping_mul(PRIME_2))
        .rotate_left(13)
        .wrapping_mul(PRIME_1)
}

/// The hash once everything is mixed in.
pub fn digest(hash: [u32; 4]) -> [u32; 4] {
    core::array::from_fn(|k| {
        let word = hash[k].wrapping_add(hash[(k + 1) % 4].rotate_left(7));
        let word = (word ^ (word >> 15)).wrapping_mul(PRIME_2);
        let word = (word ^ (word >> 13)).wrapping_mul(PRIME_3);
        word ^ (word >> 16)
    })
}
